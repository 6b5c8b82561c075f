"""The law of `hedgebed mujoco` for a loop of one's own: `law_of_run`, arguments of `FootForces` and `LawFeet`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from coupling.robot.soles import FeetLaw

from . import say
from .laws import OneLaw
from .plan import plan_robot
from .settings import RobotSettings

__all__ = ["LawOfRun", "law_of_run"]


@dataclass(frozen=True, kw_only=True)
class LawOfRun:
    """A surface law under the feet of a robot, as a run has it."""

    law: FeetLaw | OneLaw  # Arguments of `FootForces` and `LawFeet`
    mu_s: float  # Friction of sticking [1]
    mu_d: float  # Friction of sliding [1]
    notes: tuple[str, ...]  # The warnings, then the law and each of its numbers


def law_of_run(model: Any, feet: Sequence[str], **settings: Any) -> LawOfRun:
    """The law that `hedgebed mujoco` puts under `feet` of a mujoco.MjModel, in the model's gravity.

    ``feet``: names of geoms or patterns of them. ``settings``: options of the command that belong to a law, by their
    names: surface, ground (a law or a ground.toml), keyframe (the posture in which the size of a foot counts) and
    others. Raises ValueError as the command does, and for a ground of grains.
    """
    own = RobotSettings(model="model", feet=tuple(feet), **settings)
    if own.on_grains:
        raise ValueError(say("no_law", s=own))
    plan = plan_robot(own, model=model)
    law = plan.feet_options(plan.robot())
    mu_s, mu_d = (plan.numbers[name].value for name in ("mu_s", "mu_d"))
    return LawOfRun(law=law, mu_s=mu_s, mu_d=mu_d, notes=tuple(plan.notes_of_loop()))
