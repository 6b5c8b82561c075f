"""Pulleys resist vertical motion."""

from math import exp

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, shape
from rigid.terms.term import Parameter, Term

_STRIBECK = (
    "more near rest by Stribeck's curve (as Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30:1083, "
    "tell it)"
)


def rig_friction(s, force, excess, speed):
    """F (1 + a exp(-(v / v_0)^2)), v the vertical speed: dry friction of the pulleys, felt along the wires."""
    bound = force + 0.0 * s.vy
    if excess != 0.0:
        share = (s.up_x * s.vx + s.up_y * s.vy) / speed
        bound = force * (1.0 + excess * exp(-share * share))
    return bound


TERM = Term(
    rank=50, id="rig-friction", summary="pulleys resist vertical motion", acts="virtual work, dry friction",
    needs_rig=True,
    parameters=(
        Parameter("force", "N", 0.0, lowest=0.0, summary="the same in both directions"),
        Parameter("excess", "1", 0.0, lowest=0.0,
                  summary="a: what friction at rest has more, over that of fast motion"),
        Parameter("speed", "m/s", 0.03, lowest=0.0, above_lowest=True,
                  summary="v_0 of exp(-(v / v_0)^2), by which the excess falls"),
    ),
    source=f"Coulomb friction of the pulleys' bearings; {_STRIBECK}",
    limits="the static bound is that of sliding as it starts; none that grows with speed",
    hooks={"vertical_friction": rig_friction},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the rig's pulleys resist vertical motion",
    confirm="add small weights to the balanced rig until it moves, up and down: half the difference is it",
    tumble=Tumble(
        rank=160,
        # It depends on the speed, too (Stribeck; grease), by some tens of percent: what "the" friction is, is uncertain
        # by some hundredths, on the suite of hidden effects 3 to 4 %.
        forms=lambda t: (
            Form("dry", (free("force", "N", t.force, 0.0, 5 * t.weight),), ((t.force,), (5 * t.force,)), form_std=0.05),
        ),
        bends=(bent("more near rest", "dry", shape("excess", 0.0, 0.5, 0.0, 4.0, sides=(0.7,)),
                    shape("speed", 0.03, 1.0, -4.0, 4.0, log=True)),),
        equation="- force * (1 + excess * exp(-(v / speed)^2)) * sign(v) along the wires, v the vertical speed; excess "
                 "0 where it is not named",
        bench="add small weights to the balanced rig until it moves, up and down",
    ),
)  # fmt: skip
