"""Mud resists a spike that goes in, the more the faster, up to a bound; an effect of one's own in the shape of ours.

`hedgebed diagnose CAMPAIGN --effects-from experiments/terms/sticky_mud.py` puts it among the candidates, of tumbles and
of pushes. Put into `rigid/terms/contact/` it would be one of the library, without another line.
"""

from math import exp

from rigid.terms import Parameter, Term
from rigid.terms.candidate import Candidate, Form, Push, Tumble, Typical, amplitude, between, free, logarithm

__all__ = ["CANDIDATE", "TERM"]


def resists(s, depth, rate, force, speed):
    """f (1 - exp(-v / w)) while the tip sinks."""
    return force * (1.0 - exp(-max(rate, 0.0) / speed))


TERM = Term(
    id="sticky-mud", summary="mud resists, the more the faster, up to a bound", acts="normal force",
    source="made up, as an example", limits="on the way in only", hooks={"rate_force": resists},
    parameters=(
        Parameter("force", "N", 0.0, "f: the bound, of a row", lowest=0.0),
        Parameter("speed", "m/s", 0.03, "w: its scale", lowest=0.0, above_lowest=True),
    ),
)  # fmt: skip


def forms(t: Typical) -> tuple[Form, ...]:
    """Of tumbles: the bound from 0, the speed about that of bouncing."""
    numbers = (free("force", "N", t.force, 0.0, 20 * t.weight), logarithm("speed", t.lift_speed))
    return (Form("bounded", numbers, ((3 * t.force, 0.0), (10 * t.force, 1.0))),)


def push_force(v, mud_force, mud_speed):
    """The same of a spike that moves straight down, in the law of pushes."""
    return mud_force * (1.0 - exp(-max(v, 0.0) / mud_speed))


CANDIDATE = Candidate(
    meaning="mud resists a spike that goes in, up to a bound",
    confirm="push one spike into the mud at two speeds: the excess force should level off",
    tumble=Tumble(
        forms=forms, equation="+ force * (1 - exp(-rate / speed)) while a tip goes in",
        bench="push one spike into the mud at two speeds",
    ),
    push=Push(
        law={"force": push_force}, lengths={"mud_speed": 0.03},
        forms=(
            Form("bounded", (amplitude("mud_force", "area", 0.3, 0.0, 10.0), between("mud_speed", "speed", -4.0, 2.0)),
                 ((0.1, -2.0), (0.1, 0.0)), "+ mud_force * (1 - exp(-v / mud_speed)), while it goes in", "speeds"),
        ),
        apart={"inertial-drag": "Push to one depth at two speeds far beyond: mud levels off, drag does not."},
    ),
)  # fmt: skip
