"""A platform in space on the spring-damper, as the coupling's master steps it: by itself, or beside a run on grains."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from coupling import LawGround, SpatialRun
from experiments.grains.following import Followed
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.tumble.coupled import STEP
from rigid.spatial.quaternions import from_turn, to_matrix

from .result import SpatialFrames, conclude, sinkage_start, write_series_of
from .settings import SpatialSettings
from .trial import SpatialPlan

__all__ = ["SpatialFollowed"]

LAW_LOWERING, LAW_REST = 0.05, 0.11
"""Of the placement on a law, where it is not set: its least speed [m/s], and the longest time constant with which a
platform comes to rest, W / (K speed) on all tips that it stands on [s]; on one of four it still rests within 3 s."""


class SpatialFollowed(Followed[SpatialRun]):
    """A platform in space; its run on the spring-damper."""

    settings: SpatialSettings

    def __init__(self, settings: SpatialSettings, plan: SpatialPlan) -> None:
        self.settings, self.plan, self.trial = settings, plan, plan.trial
        self.platform, self.weight = plan.trial.platform, float(np.linalg.norm(plan.trial.weight))
        stance = self.platform.stance()
        self.feet_count = len(stance.row) + len(stance.rear)  # Spikes that the platform stands on

    def run_on_law(self) -> SpatialRun:
        """The trial on the spring-damper, ready to be stepped; beside a bed explicitly, ten steps at a time."""
        settings = self.settings
        ground = LawGround.of_spatial(self.trial)
        ground.grounds = [replace(ground, time_step=STEP) for ground in ground.grounds]
        # Heavier on softer ground is set down faster.
        slow = self.weight / (self.feet_count * self.plan.numbers["stiffness"].value * LAW_REST)
        lowering = settings.lowering_speed or max(LAW_LOWERING, slow)
        return SpatialRun(
            self.trial, ground, duration=settings.duration, lowering_speed=lowering if settings.placed else None,
            energy_interval=1e-3, **({} if settings.ground == "bed" else settings.stepping()), **self.start(),
        )  # fmt: skip

    def start(self) -> Mapping[str, Any]:
        """Where it starts and how it moves there, as `SpatialRun` takes it."""
        settings, platform = self.settings, self.platform
        turn = from_turn(settings.turn)
        start: Json = {
            "quaternion": tuple(turn), "velocity": settings.velocity, "angular_velocity": settings.angular_velocity,
        }  # fmt: skip
        if settings.height is not None:
            lowest = float(((platform.tips - platform.centre_of_mass) @ to_matrix(turn)[2]).min())
            start["position"] = (0.0, 0.0, settings.height - lowest)
        return start

    def announce(self, progress: Progress) -> None:
        """Every default, and the warnings."""
        for sentence in self.plan.announcement():
            progress.message(sentence)

    def sinkage(self, run: SpatialRun) -> float:
        return sinkage_start(run)

    def frames(self, run: SpatialRun, folder: Path, resumed: bool) -> SpatialFrames:
        return SpatialFrames(run, folder, self.settings, resumed=resumed)

    def write_series(self, run: SpatialRun, folder: Path) -> None:
        write_series_of(run, folder)

    def conclude(self, run: SpatialRun, folder: Path) -> Result:
        return conclude(self.settings, self.plan, run, folder)
