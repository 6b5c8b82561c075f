"""The tips are balls."""

from rigid.terms.candidate import Candidate, Form, Tumble, free
from rigid.terms.term import Parameter, Term


def ball_radius(radius):
    """The spike ends in a ball of this radius, whose lowest point touches."""
    return radius


TERM = Term(
    rank=110, id="tip-radius", summary="the tips are balls", acts="contact geometry: the point that touches rolls",
    parameters=(Parameter("radius", "m", 0.0, "of the ball, whose centre is l - r from the platform's", lowest=0.0,
                          highest=0.1, visible=(0.002, 0.01)),),
    source="the paper names ball tips; rolling of a circle on a line",
    limits="the ball's sinkage does not move the point of contact round it", hooks={"tip_radius": ball_radius},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the spikes end in balls, not points, and roll",
    confirm="measure the tips with a calliper, or repeat a trial with pointed ones",
    tumble=Tumble(
        rank=40,
        forms=lambda t: (Form("ball", (free("radius", "m", 1e-3, 0.0, 0.05),), ((2e-3,), (8e-3,))),),
        equation="the lowest point of a ball of that radius touches, its centre l - radius from the platform's",
        bench="measure the balls at the tips with a calliper",
    ),
)  # fmt: skip
