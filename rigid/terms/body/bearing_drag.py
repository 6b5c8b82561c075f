"""Constant torque against the rotation."""

from math import exp

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, shape
from rigid.terms.term import Parameter, Term

_STRIBECK = (
    "more near rest by Stribeck's curve (as Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30:1083, "
    "tell it)"
)


def bearing_drag(s, torque, excess, speed):
    """T (1 + a exp(-(omega / omega_0)^2)): dry friction of the shaft's bearings."""
    bound = torque + 0.0 * s.omega
    if excess != 0.0:
        share = s.omega / speed
        bound = torque * (1.0 + excess * exp(-share * share))
    return bound


TERM = Term(
    rank=60, id="bearing-drag", summary="constant torque against the rotation", acts="virtual work, dry friction",
    parameters=(
        Parameter("torque", "N m", 0.0, lowest=0.0, summary="the same in both directions"),
        Parameter("excess", "1", 0.0, lowest=0.0,
                  summary="a: what friction at rest has more, over that of fast rotation"),
        Parameter("speed", "rad/s", 0.2, lowest=0.0, above_lowest=True,
                  summary="omega_0 of exp(-(omega / omega_0)^2), by which the excess falls"),
    ),
    source=f"Coulomb friction of the bearings on which the rig's wires hold the shaft; {_STRIBECK}",
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
        bends=(bent("more near rest", "dry", shape("excess", 0.0, 0.5, 0.0, 4.0, sides=(0.7,)),
                    shape("speed", 0.2, 1.0, -4.0, 4.0, log=True)),),
        equation="a torque - torque * (1 + excess * exp(-(omega / speed)^2)) * sign(omega); excess 0 where it is not "
                 "named",
        bench="let the platform turn freely on its shaft and see how fast it slows",
    ),
)  # fmt: skip
