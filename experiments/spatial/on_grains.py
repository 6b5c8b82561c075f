"""A platform in space, followed on the spring-damper or on a bed of grains.

What a run in the plane does alike is in `experiments.grains.on_bed`. On a bed the same trial on the spring-damper is
stepped first: it says how far and how deep the bed must reach, and stands beside the result.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedGround, LawGround, SpatialRun, spatial_members
from coupling.lowered_gravity import pace_under
from coupling.members import Member
from coupling.platform_run import PLACING_WAY, REST_TIME
from dem import Bed
from experiments.grains.following import Followed
from experiments.grains.lammps import check_lammps
from experiments.grains.on_bed import MARGIN, PACE, Forecast, OnLoweredBed
from experiments.grains.softening import PUSHED
from experiments.platform.settled import check_lengths
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.tumble.coupled import STEP
from rigid.spatial.quaternions import from_turn, to_matrix

from . import say
from .result import SpatialFrames, conclude, sinkage_start, write_series_of
from .settings import SpatialSettings
from .spread import add_spread, uncertain_in
from .trial import SpatialPlan

__all__ = ["SpatialFollowed", "SpatialForecast", "SpatialOnBed"]

LAW_LOWERING, LAW_REST = 0.05, 0.11
"""Of the placement on a law, where it is not set: its least speed [m/s], and the longest time constant with which a
platform comes to rest, W / (K speed) on all tips that it stands on [s]; on one of four it still rests within 3 s."""


class SpatialFollowed(Followed[SpatialRun]):
    """A platform in space; its run on the spring-damper."""

    settings: SpatialSettings
    frames, write_series, sinkage = SpatialFrames, staticmethod(write_series_of), staticmethod(sinkage_start)

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
        stiffness = self.plan.numbers["stiffness"].value
        sinks = self.weight / (self.feet_count * stiffness)
        if settings.placed and sinks > self.platform.reach:
            least = self.weight / (self.feet_count * self.platform.reach)
            raise ValueError(say("sinks_away", value=stiffness, sinks=sinks, reach=self.platform.reach, least=least))
        slow = self.weight / (self.feet_count * stiffness * LAW_REST)
        lowering = settings.lowering_speed or max(LAW_LOWERING, slow)
        return SpatialRun(
            self.trial, ground, duration=settings.duration, lowering_speed=lowering if settings.placed else None,
            energy_interval=1e-3, **({} if settings.on_grains else settings.stepping()), **self.start(),
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
        self.progress = progress
        for sentence in self.plan.announcement():
            progress.message(sentence)
        if not self.settings.on_grains and (count := 2 * len(uncertain_in(self.plan))):
            progress.message(say("moved_trials", count=count))

    def conclude(self, run: SpatialRun, folder: Path) -> Result:
        def spread(result: Json) -> None:
            add_spread(self.plan, result, lambda plan: SpatialFollowed(self.settings, plan).run_on_law())

        return conclude(self.settings, self.plan, run, folder, spread=spread)


@dataclass(frozen=True, kw_only=True)
class SpatialForecast(Forecast):
    """What the same trial on the spring-damper says of the bed."""

    run: SpatialRun
    low: tuple[float, float]
    high: tuple[float, float]  # corners of where tips come down, x and y from the start [m]


class SpatialOnBed(SpatialFollowed, OnLoweredBed[SpatialSettings, SpatialRun, SpatialForecast]):
    """A platform in space on a bed."""

    turns_freely = True

    def __init__(self, settings: SpatialSettings, plan: SpatialPlan) -> None:
        super().__init__(settings, plan)
        platform = self.platform
        self.duration, self.surface = settings.duration, plan.surface
        self.gravity = -float(plan.trial.weight[2]) / platform.mass
        self.counterweight = plan.trial.counterweight
        self.spike_diameter, self.reach = 2 * platform.tip_radius, platform.reach

    def announce(self, progress: Progress) -> None:
        super().announce(progress)
        if self.settings.ground != "lammps":
            progress.message(self._work())

    def _work(self) -> str:
        """Grains, steps and time of the run, of its bed and of the lowering of gravity, in a sentence."""
        pace, minutes = self.pace, self.minutes
        lowered = minutes.get(self.lowering_stage)
        return say(
            "work", count=self.grain_count(), steps=self.costs[self.stage] / self.time_step(),
            minutes=minutes[self.stage], bed=minutes[self.bed_stage], pace=1e-6 * pace if pace else PACE,
            of=say("as_measured" if pace else "of_one_core"),
            lowered="" if lowered is None else say("lowered_takes", minutes=lowered),
        )  # fmt: skip

    @property
    def placement_time(self) -> float:
        """As on every bed, in the gravity of the run: it has fallen before the platform is set down."""
        speed = self.lowering_speed
        return 0.0 if speed is None else pace_under(self.grain_gravity) * REST_TIME + PLACING_WAY / speed

    @cached_property
    def forecast(self) -> SpatialForecast:
        run = self.run_on_law()
        rows = run.run()
        tips = self.platform.tips - self.platform.centre_of_mass
        centre = np.column_stack([rows[name] for name in "xyz"])
        turns = np.array([to_matrix(turn) for turn in np.column_stack([rows[f"q{k}"] for k in range(4)])])
        arms = np.einsum("nij,tj->nti", turns, tips)
        places = centre[:, None] + arms
        spins = np.column_stack([rows[name] for name in ("wx", "wy", "wz")])
        speeds = np.column_stack([rows[name] for name in ("vx", "vy", "vz")])[:, None] + np.cross(spins[:, None], arms)
        near = places[..., 2] < self.platform.tip_radius
        if not near.any():  # it never comes down
            near = places[..., 2] <= places[..., 2].min() + 1e-12
        low, high = places[near].min(axis=0), places[near].max(axis=0)
        return SpatialForecast(
            run=run, low=(float(low[0]), float(low[1])), high=(float(high[0]), float(high[1])),
            deepest=max(float(-places[..., 2].min()), 0.0),
            fastest=float(np.linalg.norm(speeds[near], axis=1).max()), rise=float(rows["z"].max() - rows["z"][0]),
        )  # fmt: skip

    def check(self) -> None:
        """Raise ValueError, naming key, value and what is accepted, for a bed that does not suit this trial."""
        check_lammps(self.settings, self.material)
        check_lengths(self.settings, self.platform.stance().spike_length)
        try:
            super().check()
        except RuntimeError as error:
            raise ValueError(say("forecast_fails", error=error)) from error

    def check_extent(self) -> None:
        margin, s, forecast = MARGIN * self.spike_diameter, self.settings, self.forecast
        for axis, (name, low, high) in enumerate(zip("xy", forecast.low, forecast.high, strict=True)):
            need = high - low + 2 * margin
            if s.bed_size[axis] < need:
                wanted = math.ceil(100 * need) / 100
                raise ValueError(
                    say("too_short", s=s, size=s.bed_size[axis], name=name, low=low, high=high, margin=margin,
                        wanted=wanted)
                )  # fmt: skip

    @property
    def pressure(self) -> float:
        """Of the weight, in flight of what the torque presses with too, under one of the spikes that carry [Pa]."""
        load = self.weight / self.feet_count
        if self.counterweight == 0:
            pushed = PUSHED[self.settings.actuator] * self.plan.numbers["stiffness"].value * self.forecast.deepest
            load = max(load, pushed)
        return load / (math.pi * self.platform.tip_radius**2)

    @property
    def lowering_speed(self) -> float | None:
        """Of the placement, where there is one [m/s]."""
        if not self.settings.placed:
            return None
        return self.settings.lowering_speed or math.sqrt(self.grain_gravity * self.settings.grain)

    def members(self) -> list[Member]:
        """All spikes and the ball inside the hull."""
        return spatial_members(self.platform)

    def layout(self, bed: Bed) -> Mapping[str, Any]:
        low, high = self.forecast.low, self.forecast.high
        x, y = (0.5 * (bed.size[k] - low[k] - high[k]) for k in range(2))
        return {"origin": (x, y), "bounded_across": True}

    def run_on(self, ground: BedGround) -> SpatialRun:
        return SpatialRun(self.trial, ground, **self.stepping(), **self.start())

    def conclude(self, run: SpatialRun, folder: Path) -> Result:
        return conclude(self.settings, self.plan, run, folder, beside=self.forecast.run, softening=self.softening())
