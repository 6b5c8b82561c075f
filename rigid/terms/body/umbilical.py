"""The cable pulls or drags on the rotation."""

from rigid.terms.candidate import Candidate, Form, Tumble, Typical, bent, free, shape
from rigid.terms.curves import over_linear
from rigid.terms.term import Parameter, Term


def umbilical_potential(s, stiffness, spring_power, rest):
    """V = k |theta - theta_0|^(n + 1) / (n + 1)."""
    turned = s.theta - rest
    energy = 0.5 * stiffness * turned * turned
    if spring_power != 1.0:
        energy = stiffness * max(abs(turned), 1e-12) ** (spring_power + 1.0) / (spring_power + 1.0)
    return energy


def umbilical_force(s, stiffness, drag, spring_power, drag_power, rest):
    """-k (theta - theta_0) |theta - theta_0|^(n - 1) - c omega |omega|^(m - 1)."""
    turned = s.theta - rest
    spring = stiffness * turned * over_linear(abs(turned), spring_power)
    return 0.0, 0.0, -spring - drag * s.omega * over_linear(abs(s.omega), drag_power)


def umbilical_loss(s, drag, drag_power):
    """c |omega|^(m + 1)."""
    return drag * s.omega * s.omega * over_linear(abs(s.omega), drag_power)


TERM = Term(
    rank=70, id="umbilical", summary="the cable pulls or drags on the rotation", acts="V and D",
    parameters=(
        Parameter("stiffness", "N m/rad", 0.0, "bending of the cable", lowest=0.0, visible=(0.005, 0.05)),
        Parameter("drag", "N m s/rad", 0.0, "its inner friction", lowest=0.0, visible=(0.002, 0.02)),
        Parameter("spring_power", "1", 1.0,
                  "of the angle, in its torque; where it is not 1, stiffness is at 1 rad", lowest=0.3,
                  highest=4.0, visible=(0.7, 2.0)),
        Parameter("drag_power", "1", 1.0, "of the rate, in its drag; where it is not 1, drag is at 1 rad/s",
                  lowest=0.3, highest=3.0, visible=(0.7, 1.5)),
        Parameter("rest", "rad", 0.0, "theta_0: the angle at which it is free of torque; a cable that hangs wound up"),
    ),
    source="a cable as a torsion spring and a damper, straight or not",
    limits="the cable's pull on x and y is left out",
    hooks={"potential": umbilical_potential, "force": umbilical_force, "loss": umbilical_loss},
)  # fmt: skip


def forms(t: Typical) -> tuple[Form, ...]:
    """A spring; a spring and a damper."""
    stiffness = free("stiffness", "N m/rad", t.moment, 0.0, 50 * t.weight)
    drag = free("drag", "N m s/rad", t.moment, 0.0, 50 * t.weight)
    return (
        Form("spring", (stiffness,), ((3 * t.moment,),)),
        Form("both", (stiffness, drag), ((0.0, 2 * t.moment), (2 * t.moment, t.moment))),
    )


_POWER = (1.0, 0.4, -0.65, 2.0)
_WOUND = shape("rest", 0.0, 0.5, -3.0, 3.0, "rad")
_DRAG_POWER = shape("drag_power", *_POWER)

CANDIDATE = Candidate(
    meaning="the cable to the platform pulls or drags on its rotation",
    confirm="remove the cable, or hang it on the other side, and repeat a trial: the effect should vanish, or change "
            "its sign",
    tumble=Tumble(
        rank=110, forms=forms,
        bends=(
            bent("of any shape", "spring", shape("spring_power", *_POWER)),
            bent("of any shape", "both", _DRAG_POWER),
            bent("wound up", ("spring", "both"), _WOUND),
            bent("wound up, of any shape", "both", _WOUND, _DRAG_POWER),
        ),
        equation="a torque - stiffness * a * abs(a)^(spring_power - 1) - drag * omega * abs(omega)^(drag_power - 1), "
                 "a = theta - rest, powers 1 and rest 0 where they are not named",
        bench="repeat a trial with the cable hanging on the other side, or without it",
    ),
)  # fmt: skip
