"""Pulleys resist vertical motion."""

from rigid.terms.candidate import Candidate, Form, Tumble, free
from rigid.terms.curves import STRIBECK, stribeck, stribeck_bends, stribeck_parameters
from rigid.terms.term import Parameter, Term


def rig_friction(s, force, excess, speed):
    """F (1 + a exp(-(v / v_0)^2)), v the vertical speed: dry friction of the pulleys, felt along the wires."""
    return stribeck(force, excess, (s.up_x * s.vx + s.up_y * s.vy) / speed)


TERM = Term(
    rank=50, id="rig-friction", summary="pulleys resist vertical motion", acts="virtual work, dry friction",
    needs_rig=True,
    parameters=(
        Parameter("force", "N", 0.0, "the same in both directions", lowest=0.0, visible=(0.01, 0.1)),
        *stribeck_parameters("m/s", 0.03, "v v_0", "motion"),
    ),
    source=f"Coulomb friction of the pulleys' bearings; {STRIBECK}",
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
        bends=stribeck_bends(0.03),
        equation="- force * (1 + excess * exp(-(v / speed)^2)) * sign(v) along the wires, v the vertical speed; excess "
                 "0 where it is not named",
        bench="add small weights to the balanced rig until it moves, up and down",
    ),
)  # fmt: skip
