"""The ground ahead of a spike that is drawn sideways resists by more than friction."""

from math import tanh

from rigid.terms.candidate import Candidate, Form, Tumble, bent, fixed, free, logarithm, shape
from rigid.terms.term import Parameter, Term


def ploughed(s, depth, slip, strength, speed, power, reference):
    """-k h^2 tanh(u / w); with another power p, -k h_0^2 (h / h_0)^p tanh(u / w)."""
    h = max(depth, 0.0)
    wedge = h * h
    if power != 2.0:
        wedge = reference * reference * (max(h, 1e-12) / reference) ** power
    return -strength * wedge * tanh(slip / speed)


TERM = Term(
    rank=125, id="ploughing", summary="the ground ahead of a spike resists, by its depth squared",
    acts="tangential force",
    parameters=(
        Parameter("strength", "N/m2", 0.0, "k, of a row", lowest=0.0, visible=(300.0, 5000.0)),
        Parameter("speed", "m/s", 0.01, "w: slower than this it resists less", lowest=1e-3),
        Parameter("power", "1", 2.0, "p of the depth h", lowest=0.5, highest=4.0, visible=(1.0, 2.5)),
        Parameter("reference", "m", 0.01, "h_0: the depth at which the power changes nothing", lowest=0.0,
                  above_lowest=True),
    ),
    source="passive earth pressure on a narrow blade follows the depth squared (Hegedus 1960, A simplified method "
           "for the determination of bulldozing resistance; McKyes 1985, Soil Cutting and Tillage). A short pile "
           "carries 1.5 K_p rho g d h^2 sideways (Broms 1964, J. Soil Mech. Found. Div. 90(SM3):123): 670 N/m2 for "
           "K_p = 2.46, 1540 kg/m3, d = 12 mm, twice that for a row of two spikes",
    limits="no heap ahead and no furrow of rows before; the force needed to start the motion is mobilised with the "
           "speed w, so that a spike that sticks has none",
    hooks={"side_force": ploughed},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the ground ahead of a spike resists by more than friction",
    confirm="drag {one} sideways at two depths: at twice the depth the force beyond friction is about four times "
            "as large",
    tumble=Tumble(
        forms=lambda t: (
            Form("by depth squared",
                 (free("strength", "N/m2", t.force / t.depth**2, 0.0, 1e3 * t.weight / t.depth**2),
                  logarithm("speed", 0.2 * t.friction_speed), fixed("reference", t.depth)),
                 ((3.0 * t.force / t.depth**2, 0.0), (20.0 * t.force / t.depth**2, 0.0))),
        ),
        bends=(bent("by any power of depth", "by depth squared", shape("power", 2.0, 0.5, -1.2, 1.5)),),
        equation="- strength * reference^2 * (h / reference)^power * tanh(u / speed), h the depth of the tip, u its "
                 "sliding speed; power 2 where it is not named",
        bench="drag one spike sideways at two depths and read the force beyond friction",
    ),
)  # fmt: skip
