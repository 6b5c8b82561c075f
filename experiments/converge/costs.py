"""What a member run costs, reckoned before the work: grains, steps, and hours of one core."""

from experiments.penetrate import beds
from experiments.penetrate.rest import made_units
from experiments.penetrate.settings import PenetrateSettings
from experiments.penetrate.units import expected_time, plan_units, preparation_time

__all__ = ["core_hours", "step_count"]

CORE_STEP = 1.5e-7
"""What a grain takes in a step on one core, with rolling [s] (docs/performance.md, 2026-11-25: 105 to 150 ns)."""


def step_count(settings: PenetrateSettings, *, bed: bool = True) -> float:
    """About how many steps all runs of the first seed take [1], with the preparation of its bed if `bed`.

    Raises ValueError for a material that is not there, or whose real grains are too soft.
    """
    step = beds.bed_step(settings, beds.choose_softness(settings).young)
    stiffness, held = beds.expected_stiffness(settings), beds.expected_bearing(settings).held
    units = [unit for unit in made_units(settings, plan_units(settings)) if unit.seed == settings.seeds[0]]
    time = sum(expected_time(settings, unit, stiffness, held=held) for unit in units)
    if bed:
        time += preparation_time(settings, beds.stages_of(settings), beds.first_gravity(settings))
    return time / step


def core_hours(settings: PenetrateSettings, *, bed: bool = True) -> float:
    """About how long the runs of the first seed take one core [h]; arguments and errors as `step_count`."""
    return CORE_STEP * settings.grain_count * step_count(settings, bed=bed) / 3600
