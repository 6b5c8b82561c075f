"""Constant torque against the rotation."""

from rigid.terms.candidate import Candidate, Form, Tumble, free
from rigid.terms.curves import STRIBECK, stribeck, stribeck_bends, stribeck_parameters
from rigid.terms.term import Parameter, Term


def bearing_drag(s, torque, excess, speed):
    """T (1 + a exp(-(omega / omega_0)^2)): dry friction of the shaft's bearings."""
    return stribeck(torque, excess, s.omega / speed)


TERM = Term(
    rank=60, id="bearing-drag", summary="constant torque against the rotation", acts="virtual work, dry friction",
    parameters=(
        Parameter("torque", "N m", 0.0, "the same in both directions", lowest=0.0, visible=(0.002, 0.02)),
        *stribeck_parameters("rad/s", 0.2, "omega omega_0", "rotation"),
    ),
    source=f"Coulomb friction of the bearings on which the rig's wires hold the shaft; {STRIBECK}",
    limits="the static bound is that of sliding as it starts; none that grows with speed",
    hooks={"rotation_friction": bearing_drag},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="a constant torque acts against the rotation",
    confirm="let the platform turn freely on its shaft and see how fast it slows",
    tumble=Tumble(
        rank=120,
        # It depends on the speed, too (Stribeck; grease), by some tens of percent: what "the" friction is, is uncertain
        # by some hundredths, on the suite of hidden effects 3 to 4 %.
        forms=lambda t: (
            Form("dry", (free("torque", "N m", t.moment, 0.0, 5 * t.weight),),
                 ((t.moment,), (4 * t.moment,)), form_std=0.05),
        ),
        bends=stribeck_bends(0.2),
        equation="a torque - torque * (1 + excess * exp(-(omega / speed)^2)) * sign(omega); excess 0 where it is not "
                 "named",
        bench="let the platform turn freely on its shaft and see how fast it slows",
    ),
)  # fmt: skip
