"""A spinning wheel lowers the friction at the spikes."""

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, logarithm, shape
from rigid.terms.term import Parameter, Term


def vibration_factor(s, slip, reduction, speed, power):
    """1 - r w^p / (w^p + w_0^p) on both coefficients, w the wheel's speed."""
    w = s.wheel_speed * s.wheel_speed
    half = speed * speed
    if power != 2.0:
        w = max(w, 1e-12) ** (0.5 * power)
        half = speed**power
    factor = 1.0 - reduction * w / (w + half)
    return factor, factor


TERM = Term(
    rank=100, id="wheel-vibration", summary="a spinning wheel lowers the friction at the spikes", acts="mu_s and mu_d",
    parameters=(
        Parameter("reduction", "1", 0.0, "share of the friction that a fast wheel takes away", lowest=0.0,
                  highest=0.99, visible=(0.05, 0.6)),
        Parameter("speed", "rad/s", 100.0, "wheel speed at half of it", lowest=0.0, above_lowest=True),
        Parameter("power", "1", 2.0, "p: how sharply it sets in about that speed", lowest=0.3, highest=8.0,
                  visible=(1.0, 4.0)),
    ),
    source="the paper suspects it; vibration lowers mean friction by the share of time in light contact "
           "(Dupont et al. 1994, IEEE TAC 39:2, for the phenomenon)",
    limits="a mean effect: no resonances, no normal vibration of the platform",
    hooks={"friction_factor": vibration_factor},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the spinning wheel shakes the platform and lowers the friction at the spikes",
    confirm="pull the standing platform sideways with a spring balance, its wheel at rest and at full speed: friction "
            "should fall with the wheel's speed",
    tumble=Tumble(
        rank=10,
        forms=lambda t: (
            Form("saturating", (free("reduction", "1", 0.1, 0.0, 0.95), logarithm("speed", t.wheel_speed)),
                 ((0.15, -1.5), (0.15, 0.0), (0.15, 1.2))),
        ),
        bends=(bent("of any shape", "saturating", shape("power", 2.0, 0.8, -1.4, 5.0)),),
        equation="mu_s and mu_d times 1 - reduction * w^power / (w^power + speed^power), w the wheel's speed",
        bench="pull the standing platform sideways with a spring balance, its wheel at rest and at full speed",
    ),
)  # fmt: skip
