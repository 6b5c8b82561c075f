"""What a run of `penetrate` is expected to cost, piece by piece, told to its progress and mended as pieces are done.

A piece costs the steps of the bed that it takes. The constants are those of the shipped case on two cores; the progress
learns how long a step takes here. What the next bed or the same run on the next seed will cost is best known from the
last.
"""

import math
import os
from collections.abc import Sequence
from statistics import fmean

from experiments.grains.sizes import expected_grain_count
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.whole_runs import PictureCosts

from .settings import PenetrateSettings
from .units import Unit, expected_time, shown_units

__all__ = ["RAIN", "PenetratePlan"]

RAIN = 2.5
"""Height of the loose column that a bed is rained from, over the bed's depth [1]."""
PREPARATION = 1.6
"""What a bed costs in falls from the top of the column that it is rained from, as steps of a bed at rest [1]."""
TAPPED = 10.0
"""How many times that, where it is tapped to a packing fraction: 15 taps from 0.571 to 0.600 [1]."""
GRAIN_STEP = 1.5e-7
"""A first guess at what a grain takes in a step on two cores [s]; 366 s of runs on 20,187 grains took that."""
FRAME = 40.0
"""What a frame costs, in steps [1]: 0.12 s among 20,187 grains."""
SPRING_DAMPER = 1.0
"""What the fit and the same runs on the law take [s]."""


class PenetratePlan:
    """The plan of one run; `bed_is_there` and `is_over` mend it. `step` is that of the grains [s]."""

    def __init__(
        self,
        settings: PenetrateSettings,
        units: Sequence[Unit],
        folder: RunFolder,
        progress: Progress,
        *,
        step: float,
        stiffness: float,
    ) -> None:
        self._settings, self._units, self._progress = settings, list(units), progress
        self._step, self._stiffness = step, stiffness
        self._shown = shown_units(units)
        self._lasted: dict[tuple[str, float], list[float]] = {}
        left = [unit for unit in units if not folder.is_done(unit.id)]
        costs: dict[str, float] = {}
        for seed in settings.seeds:
            todo = [unit for unit in left if unit.seed == seed]
            if todo:
                costs[_bed(seed)] = self._bed_cost()
            costs |= {unit.title: self._cost(unit) for unit in todo}
        grains = expected_grain_count(settings.bed_size, settings.grain, settings.spread)
        count = settings.frame_count + 3  # with those of the deepest point and the end
        frames = {unit.id: count for unit in units if unit.id in self._shown} if settings.frame_count else {}
        report = PictureCosts(frames, grains).seconds
        unit = GRAIN_STEP * grains * 2 / min(settings.threads or os.cpu_count() or 2, 8)
        progress.plan(
            costs,
            seconds={"spring-damper": SPRING_DAMPER, "report": report},
            unit=unit if settings.arch == "cpu" else None,
        )

    def expected_time(self, unit: Unit) -> float:
        """About how long the run of `unit` lasts on the bed's clock [s]: as on other seeds, where it was made."""
        known = self._lasted.get(unit.condition)
        return fmean(known) if known else expected_time(self._settings, unit, self._stiffness)

    def bed_is_there(self) -> None:
        """A bed was prepared, or found prepared: the next will be as well."""
        cost = self._bed_cost() if self._progress.stage_worked else 0.0
        self._progress.expect({_bed(seed): cost for seed in self._settings.seeds})

    def is_over(self, unit: Unit, lasted: float) -> None:
        """The run of `unit` took so long on the bed's clock [s]."""
        self._lasted.setdefault(unit.condition, []).append(lasted)
        alike = [other for other in self._units if other.condition == unit.condition and other != unit]
        self._progress.expect({other.title: self._cost(other) for other in alike})

    def _bed_cost(self) -> float:
        settings = self._settings
        if settings.bed is not None:
            return 0.0
        fall = math.sqrt(2 * RAIN * settings.bed_size[2] / settings.gravity)
        return PREPARATION * (TAPPED if settings.packing is not None else 1.0) * fall / self._step

    def _cost(self, unit: Unit) -> float:
        frames = self._settings.frame_count + 3 if unit.id in self._shown and self._settings.frame_count else 0
        return self.expected_time(unit) / self._step + FRAME * frames


def _bed(seed: int) -> str:
    return f"bed of seed {seed}"
