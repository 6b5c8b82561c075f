"""The rig's wires pull back."""

import math
from math import sqrt

from rigid.terms.candidate import Candidate, Form, Tumble, Typical, fixed, free, prior
from rigid.terms.term import Parameter, Term


def pendulum_potential(s, length, offset, arc):
    """V = m_b g [(1 - c) d^2 / 2 L + c (sqrt(a^2 + d^2) - a)], d the horizontal distance from under the pulleys.

    a = L - rise is the height of the pulleys above the shaft; sqrt(a^2 + d^2) - a is what the counterweight has risen.
    """
    d = s.up_y * s.x - s.up_x * (s.y - s.stance) - offset
    a = length - s.up_x * s.x - s.up_y * (s.y - s.stance)
    raised = d * d / (sqrt(a * a + d * d) + a)
    return s.counterweight * s.gravity * ((1.0 - arc) * 0.5 * d * d / length + arc * raised)


def pendulum_force(s, length, offset, arc):
    """-dV/dq."""
    d = s.up_y * s.x - s.up_x * (s.y - s.stance) - offset
    a = length - s.up_x * s.x - s.up_y * (s.y - s.stance)
    reach = sqrt(a * a + d * d)
    tension = s.counterweight * s.gravity
    side = -tension * ((1.0 - arc) * d / length + arc * d / reach)
    down = -tension * arc * d * d / (reach * (reach + a))
    return side * s.up_y + down * s.up_x, down * s.up_y - side * s.up_x, 0.0


TERM = Term(
    rank=10, id="pendulum", summary="the rig's wires pull back", acts="V", needs_rig=True,
    parameters=(
        Parameter("length", "m", math.inf, "from the pulleys down to the shaft", lowest=0.0, above_lowest=True,
                  visible=(1.5, 3.0)),
        Parameter("offset", "m", 0.0, "how far the pulleys stand towards +x of the start", lowest=-1.0, highest=1.0),
        Parameter("arc", "1", 0.0,
                  "0: a long pendulum, which pulls back only; 1: the true arc, whose wires carry less too", lowest=0.0,
                  highest=1.0),
    ),
    source="the rest tension times x / length of a long pendulum; the paper trusts its rig without it for 40 mm",
    limits="tension at its rest value m_b g (the motion changes it by a_y / g, below 1 %); with arc = 0 x far "
           "below the length: at 0.0085 g the arc adds a tenth of the weight at x / length = 0.06",
    hooks={"potential": pendulum_potential, "force": pendulum_force},
)  # fmt: skip


def forms(t: Typical) -> tuple[Form, ...]:
    """By 1 / length: with the pulleys over the start, or aside; on the true arc."""
    curvature = free("length", "1/m", 0.05, 0.0, 20.0, how="inverse", fitted="curvature")
    offset = prior("offset", "m", 0.02, 0.01, 2e-4, -0.2, 0.2)
    return (
        Form("centred", (curvature,), ((0.1,), (0.5,))),
        Form("off centre", (curvature, offset), ((0.3, 0.0),)),
        Form("true arc", (curvature, fixed("arc", 1.0)), ((0.1,), (0.5,))),
    )


CANDIDATE = Candidate(
    meaning="the rig's wires pull the platform back as it moves aside",
    confirm="hang the rig on longer wires, or time the platform's swing: the pull should go with 1 / length",
    tumble=Tumble(
        rank=150, forms=forms,
        equation="- m_b * g * (x - offset) / length along the surface; with arc = 1 on the arc of that length",
        bench="push the hanging platform 0.1 m aside and time its swing, or measure the wires' free length",
    ),
)  # fmt: skip
