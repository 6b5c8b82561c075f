"""Friction depends on the sliding speed."""

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, logarithm, shape
from rigid.terms.curves import raised
from rigid.terms.term import Parameter, Term


def rate_friction_factor(s, slip, change, speed, power):
    """mu_d (1 + c |u|^p / (|u|^p + u_0^p)): grows (c > 0) or falls (c < 0) and saturates."""
    u = raised(abs(slip), power)
    return 1.0, 1.0 + change * u / (u + raised(speed, power))


TERM = Term(
    rank=160, id="rate-friction", summary="friction depends on the sliding speed", acts="mu_d",
    parameters=(
        Parameter("change", "1", 0.0, "relative change of mu_d at high sliding speed", lowest=-0.95, highest=10.0,
                  visible=(-0.4, 1.0)),
        Parameter("speed", "m/s", 0.05, "sliding speed at half of it", lowest=0.0, above_lowest=True),
        Parameter("power", "1", 1.0, "p: how sharply it sets in about that speed", lowest=0.2, highest=8.0,
                  visible=(0.6, 2.0)),
    ),
    source="velocity strengthening or weakening (Stribeck; Armstrong-Helouvry et al. 1994, Automatica 30:1083)",
    limits="no memory of past sliding", hooks={"friction_factor": rate_friction_factor},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="friction depends on the sliding speed",
    confirm="drag {one} over the surface at two speeds a factor of ten apart",
    tumble=Tumble(
        rank=100,
        forms=lambda t: (
            Form("saturating", (free("change", "1", 0.1, -0.9, 5.0), logarithm("speed", t.friction_speed)),
                 ((0.3, 0.0), (-0.25, 0.0), (0.4, 1.5), (-0.35, 1.5))),
        ),
        bends=(bent("of any shape", "saturating", shape("power", 1.0, 0.5, -0.7, 4.0)),),
        equation="mu_d times 1 + change * abs(u)^power / (abs(u)^power + speed^power), u the sliding speed, power 1 "
                 "where it is not named",
        bench="drag one spike over the surface at two speeds",
    ),
)  # fmt: skip
