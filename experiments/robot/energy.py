"""Whether a robot's run keeps its energy: warnings of a swing that would grow, and of a balance that is not closed."""

from collections.abc import Iterator

import numpy as np

from coupling.robot import LawFeet, RobotRun
from coupling.robot.stability import ITERATED, ExchangeLoad, Load
from experiments.grains.bed_result import residual_warning

from . import say
from .plan import RobotPlan
from .settings import RobotSettings

__all__ = ["MOST_RESIDUAL", "balance_warning", "growth_warning", "idle"]

MOST_RESIDUAL = 0.05
"""`energy_residual` above which the numbers of a run are not to be used. The height of a hop is in
proportion to its energy, so it would be off by as much. The hopping leg that ships has 0.0001 on its law and 0.004 on
grains."""
MOST_GROWTH = 1.3
"""Growth of a swing above which a run is warned of before it starts. It is an upper bound, since a foot that bounces is
in the ground for a part of the time: at 1.5 in 1 s a robot of 2.6 kg that falls by 20 mm gains 5 % of its energy."""


def growth_warning(settings: RobotSettings, run: RobotRun) -> str | None:
    """Before a run on a law: the warning that a swing on the ground would grow, and how to avoid it; None if not.

    Laws with memory are left out: they absorb most of the energy of a swing.
    """
    ground, iterations = run.ground, settings.iterations
    if iterations > 1 or not isinstance(ground, LawFeet) or ground.has_memory:
        return None
    load = ExchangeLoad(run.robot, ground).now()
    grown = load.growth(run.macro_step, settings.duration)
    if grown <= MOST_GROWTH:
        return None
    times = f"{grown:.2g}" if grown < 1e3 else "more than 1000"
    remedy = _listed(_remedies(settings, run, load))
    return say("grows", load=load, times=times, duration=settings.duration, step=1e6 * run.macro_step, remedy=remedy)


def balance_warning(settings: RobotSettings, run: RobotRun) -> str | None:
    """After a run: the warning that its energy balance is not closed; None if it is."""
    residual = run.energy_residual
    if residual <= MOST_RESIDUAL:
        return residual_warning(residual)
    ground = run.ground
    load = ExchangeLoad(run.robot, ground).now() if isinstance(ground, LawFeet) else None
    return say(
        "not_closed", residual=residual, limit=MOST_RESIDUAL, made="created" if run.unaccounted > 0 else "lost",
        cause="the exchange of forces" if load else "the exchange of forces, or the step of the bed,",
        remedy=_listed(_remedies(settings, run, load)),
    )  # fmt: skip


def idle(plan: RobotPlan, run: RobotRun) -> bool:
    """Whether the robot has a controller and its actuators have given no work so far."""
    return plan.controller is not None and run.robot.model.nu > 0 and not np.any(run.columns["actuator_work"])


def _remedies(settings: RobotSettings, run: RobotRun, load: Load | None) -> Iterator[str]:
    """What to change; `load` is that of the feet on a law, None on grains, whose damping is not known."""
    if settings.iterations == 1 and settings.ground != "lammps" and run.load <= ITERATED:
        yield "--iterations 20"
    fewer = range(settings.substeps - 1, 0, -1)
    if load is None or settings.iterations > 1:
        yield from ["fewer --substeps"] * bool(fewer)
        return
    step, duration = run.ground.time_step, settings.duration
    most = next((n for n in fewer if load.growth(n * step, duration) <= MOST_GROWTH), None)
    if most is not None:
        yield f"--substeps {most}"


def _listed(remedies: Iterator[str]) -> str:
    return " or ".join(remedies) or say("softer")
