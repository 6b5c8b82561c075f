"""The surface is not level."""

from math import cos, sin

from rigid.terms.candidate import Candidate, Form, Tumble, free
from rigid.terms.term import Parameter, Term


def slope_up(angle):
    """The surface rises towards +x, so the vertical leans towards +x in the surface's axes."""
    return sin(angle), cos(angle)


TERM = Term(
    rank=30, id="slope", summary="the surface is not level", acts="gravity, counterweight, wires: their direction",
    parameters=(
        Parameter("angle", "rad", 0.0, "the surface rises towards +x; x and y stay along and normal to it",
                  lowest=-1.2, highest=1.2, visible=(-0.02, 0.02)),
    ),
    source="gravity and wires vertical, the camera's axes along the surface",
    limits="plane; the wires stay vertical", hooks={"up": slope_up},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the surface is not level",
    confirm="repeat a trial in the opposite direction: the effect should change its sign",
    tumble=Tumble(
        rank=30,
        forms=lambda t: (Form("plane", (free("angle", "rad", 1e-3, -0.3, 0.3),), ((2e-3,), (-2e-3,))),),
        equation="gravity and wires along (-sin(angle), -cos(angle)) of the surface's axes",
        bench="lay a spirit level or the unmoved IMU on the surface, or repeat a trial in the opposite direction",
    ),
)  # fmt: skip
