"""A bed that is prepared in a larger gravity than that of the run, which is then lowered; and what a run costs."""

import math
from typing import Any, Generic

from dem import Bed
from experiments.runs.progress import Progress
from experiments.runs.stopping import held_back

from .bed_progress import Stages
from .on_bed import Expected, PlatformOnBed, Run, Settings
from .softening import Softening
from .staged import lower_gravity, lowering_time

__all__ = ["PACE", "OnLoweredBed"]

PACE = 3.0
"""Grain-steps in a second of processor time [1e6]: the leg for 1 s on 3,921 grains, 1.2e8 grain-steps, took 62 s with
its bed on one core (docs/notes/mujoco.md). Sleep makes it less."""


class OnLoweredBed(PlatformOnBed[Settings, Run, Expected], Generic[Settings, Run, Expected]):
    """A run whose bed `settle_gravity` of its settings may prepare faster."""

    lowering_stage = "lower gravity"  # What the progress calls the rest in the gravity of the run

    @property
    def first_gravity(self) -> float:
        settings: Any = self.settings
        return settings.settle_gravity or self.grain_gravity

    @property
    def costs(self) -> dict[str, float]:
        """As of every bed, and the rest in the gravity of the run where the bed is prepared in more."""
        found = dict(super().costs)
        run = found.pop(self.stage)
        if self.first_gravity != self.grain_gravity:
            grain = self.settings.grain
            found[self.lowering_stage] = lowering_time(self.first_gravity, self.grain_gravity, grain=grain)
        return found | {self.stage: run}

    @property
    def minutes(self) -> dict[str, float]:
        """Stage -> about how long it takes [min], at this machine's pace, or `PACE` where that is not known."""
        count, step, pace = self.grain_count(), self.time_step(), self.pace or 1e6 * PACE
        return {name: count * time / step / (60 * pace) for name, time in self.costs.items()}

    def prepare(self, softening: Softening, progress: Progress) -> Bed:
        """The prepared bed in the gravity of the run.

        Rigid grains without cohesion pack alike in any gravity, and settle sqrt(g / g') times as fast in a larger one.
        """
        bed = super().prepare(softening, progress)
        if self.first_gravity != self.grain_gravity:
            unit = math.sqrt(self.settings.grain / self.first_gravity)
            with held_back() as asked_to_stop:
                shown = Stages(progress, asked_to_stop)
                shown.stage(self.lowering_stage, total=1.0)
                lower_gravity(bed, self.grain_gravity, unit=unit, progress=shown)
        return bed
