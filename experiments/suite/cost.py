"""What a tumble on grains will cost, from its settings alone: grains, steps, time on two cores."""

import math
from dataclasses import dataclass

import numpy as np

from experiments.tumble.settings import TumbleSettings

__all__ = ["Cost", "cost_of_tumble"]

RATES = ((2.8e3, 3.8e6), (2e4, 9.52e6), (1e5, 7.09e6))
"""Grain-steps a second, with rolling, by the count of grains computed: docs/performance.md, 2026-11-21, a quiet machine
with 2 cores; the first from `grains3-row-seed1` (2,800 awake of 84,772), where one core does as well as two."""
BOOK = 1.19
"""Time of a step with the book of what grains lose over one without (docs/coupling.md, 2026-11-22)."""
MACRO_STEP = 5e-3
"""Of the coupling beyond the grains, a macro step [s] (docs/coupling.md, 2026-11-21)."""
SET_DOWN = 0.4 * 0.05
"""Way of the placement in the rig, over its speed [m]: 0.39 s at 0.05 m/s in the first look of docs/coupling.md."""
FALL_TIMES = 1.5
"""What rain and rest take, over the time of a fall from the column's top: 0.27 s to 0.2 s for the beds of 80 mm in
docs/performance.md, rounded up."""

TAP = 1.07
"""What a tap and the rest after it take, over the time of that fall: 0.189 s to 0.176 s, nine taps of the bed of
grains1-jsc1a-*, 61,452 grains before the last `level` (docs/experiments.md, 2026-11-23)."""
TAPPED = 0.0041
"""Packing fraction that a tap adds, of the same nine: from 0.5343 to 0.5715."""
POURED, DENSEST = 0.534, 0.62
"""Where they began, and, roughly, where ``compact:densest`` ends."""

AWAKE = 20260 * 2.4e-3**3 / 0.036
"""Grains that a motor's tumble keeps awake on average, times their diameter cubed, over the bed's width [m2]:
grains1-sand-0.0085-0.22, 20.1 % of 100,753 over 2 s (the looks on 3 mm, of 0.9 to 1.2 s: 15, 25 and 28 % of 29,797). A
brake shakes all of it (79, 84 %)."""
CALM = 3.0
"""What rest under a lowered gravity takes, with drag and then without, over the mean that is taken for it [1]: 2.2 at
1e-6 g (docs/experiments.md)."""


@dataclass(frozen=True)
class Cost:
    """An estimate."""

    grains: float  # of the whole bed
    time_step: float  # [s]
    bed_seconds: float  # preparing the bed, once for all cases that share it [s]
    run_seconds: float
    """The tumble [s]; a motor's with sleep, as many grains awake as in the looks, otherwise every grain computed."""
    grain_steps: float  # of the tumble

    @property
    def seconds(self) -> float:
        """Both [s]."""
        return self.bed_seconds + self.run_seconds


def cost_of_tumble(settings: TumbleSettings) -> Cost:
    """The estimate for a tumble with ``ground = "bed"`` on two cores with nothing beside.

    Raises ValueError for a bed that will not do, as the run itself would.
    """
    from coupling.lowered_gravity import EFOLD, pace_under
    from coupling.platform_run import REST_TIME
    from dem.contact.timestep import time_step_for
    from experiments.grains.on_bed import RAIN
    from experiments.tumble.on_grains import PlanarOnBed

    on_bed = PlanarOnBed(settings)
    on_bed.members()
    on_bed.check_bed()
    soft = on_bed.material.softened(on_bed.softening().young)
    smallest = settings.grain * (1 - settings.spread)
    step = time_step_for(soft, diameter=smallest, max_overlap=settings.max_overlap, wanted=None)
    grains, gravity = on_bed.grain_count(), on_bed.first_gravity
    fall = math.sqrt(2 * RAIN * settings.bed_size[2] / gravity)
    way = SET_DOWN if on_bed.counterweight > 0 else on_bed.forecast.sunk
    placing = way / on_bed.lowering_speed + pace_under(gravity) * REST_TIME
    if settings.settle_gravity is not None:
        last = on_bed.grain_gravity
        placing += EFOLD * math.sqrt(settings.grain / gravity) * math.log(gravity / last)
        placing += CALM * pace_under(gravity) * REST_TIME
    steps = (settings.duration + placing) / step
    computed = grains
    if settings.sleep and settings.actuator == "motor":
        computed = min(grains, AWAKE * settings.bed_size[1] / settings.grain**3)
    prepared = grains / settings.bed_repeats
    making = FALL_TIMES + TAP * _taps(settings)
    return Cost(
        grains=grains, time_step=step, bed_seconds=making * fall / step * prepared / _rate(prepared),
        run_seconds=BOOK * steps * computed / _rate(computed) + steps / settings.substeps * MACRO_STEP,
        grain_steps=steps * computed,
    )  # fmt: skip


def _taps(settings: TumbleSettings) -> int:
    from dem.prepare.recipe import parse_stage

    stages = [parse_stage(stage) for stage in settings.bed_stages or ()]
    wanted = [DENSEST if s.value is None else s.value for s in stages if s.name == "compact" and s.by == "tap"]
    return math.ceil(max(0.0, max(wanted, default=0.0) - POURED) / TAPPED)


def _rate(grains: float) -> float:
    counts, rates = zip(*RATES, strict=True)
    if grains < counts[0]:  # what a step costs beside its grains is in proportion more
        return rates[0] * max(0.1, grains / counts[0])
    return float(np.interp(grains, counts, rates))
