"""`hedgebed tumble --ground bed`: the platform on a slice of a bed, beside the same trial on the spring-damper.

In the rig the grains are at 1 g and the platform hangs on its counterweight; with ``gravity`` both are at that. The
part that is common with runs in space is in `experiments.grains.on_bed`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedGround, CoupledTumble, LawGround, platform_members
from coupling.members import FEWEST_SLOTS, Member, slots_of
from dem import Bed, Graded
from experiments.grains.flight import lies_in_flight
from experiments.grains.graded import graded_under
from experiments.grains.lammps import check_lammps
from experiments.grains.on_bed import MARGIN, Forecast, PlatformOnBed
from experiments.grains.softening import PUSHED, Softening
from experiments.grains.staged import check_bed_stages
from experiments.platform.numbers import platform_numbers, tip_angles, tip_depth, torque_within_limit
from experiments.platform.settled import check_lengths
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from rigid.planar.simulate import simulate
from rigid.planar.trajectory import Trajectory

from . import say
from .on_grains_result import TumbleFrames, conclude, write_trajectory
from .opening import opening, short_of_way
from .settings import TumbleSettings
from .steppers import is_plain, sinkage_start, stepper_of
from .trial import plan_tumble, spikes_of

__all__ = ["PlanarForecast", "PlanarOnBed"]

ROLLED = {"motor": 0.8, "brake": 0.4}
"""Way on grains over that of rolling without slip [1]: 0.64 to 0.78 and 0.3 were met (docs/notes/experiments.md)."""
THROW = 2.0  # Speed of a grain that a spike throws up, over the spike's [1]: an elastic ball has twice the wall's
HULL_SHARE = 0.95  # The hull's cylinder over the distance of its sides: it stays inside the hull [1]


@dataclass(frozen=True, kw_only=True)
class PlanarForecast(Forecast):
    """Demands on a slice of a bed, from the same trial on the spring-damper."""

    trajectory: Trajectory
    behind: float
    ahead: float  # where the tips come down, from the start [m]
    sunk: float  # depth of the tips that it stands on before it moves [m]
    pushed: float  # largest force of the rows together [N]
    farthest: float  # Where tips may come down on grains, which hold a row and the torque with it [m]

    @property
    def length(self) -> float:
        """Between the outermost tips [m]."""
        return self.ahead - self.behind


class PlanarOnBed(PlatformOnBed[TumbleSettings, CoupledTumble, PlanarForecast]):
    """A tumble in the plane on a slice of a bed. `plan` has the numbers of the spring-damper beside it."""

    copies = 2.0  # Spikes in a row: the bed holds one of them and the sand that it has for itself
    frames, write_series, sinkage = TumbleFrames, staticmethod(write_trajectory), staticmethod(sinkage_start)

    def __init__(self, settings: TumbleSettings, platform_file: Path | None = None) -> None:
        """`platform_file` stands in for ``settings.platform``, where that was copied."""
        platform = platform_numbers(settings.platform, file=platform_file)
        self.settings, self.duration = settings, settings.duration
        self.spikes = spikes = spikes_of(settings, platform)
        self.plan = plan_tumble(_beside(settings), platform=platform, spikes=spikes)
        self.trial = trial = self.plan.trial
        self.surface, self.gravity, self.counterweight = self.plan.surface, trial.gravity_sim, trial.counterweight
        self.weight = trial.weight
        self.spike_diameter, self.reach = spikes.diameter, trial.spike_length
        self.repeats, self.given_stages = settings.bed_repeats, settings.bed_stages
        check_lengths(settings, self.reach, spike_diameter=spikes.diameter, spike_clear=spikes.clear)

    # The forecast

    @cached_property
    def forecast(self) -> PlanarForecast:
        """The same trial on the spring-damper; in flight with the corrections of `experiments.grains.flight`."""
        settings, trial = self.settings, self.trial
        if is_plain(settings):
            duration = settings.duration
            trial, _ = torque_within_limit(trial, max_wheel_speed=self.plan.max_wheel_speed, duration=duration)
            found = simulate(trial, duration=duration, sample_interval=min(1e-3, duration))
        else:  # several tumbles and landings are the master's; ten steps of 0.1 ms
            ground, limit = LawGround.of_trial(trial), self.plan.max_wheel_speed
            found = stepper_of(settings, trial, ground, duration=settings.duration, max_wheel_speed=limit).run()
        angles = tip_angles(trial.spike_count, found.theta)
        tips_x = found.x[:, None] - trial.spike_length * np.sin(angles)
        depth = tip_depth(found.theta, found.y, count=trial.spike_count, length=trial.spike_length)
        near = depth > -0.5 * self.spike_diameter
        speed = np.hypot(
            found.vx[:, None] - found.omega[:, None] * trial.spike_length * np.cos(angles),
            found.vy[:, None] + found.omega[:, None] * trial.spike_length * np.sin(angles),
        )
        ahead, deepest = float(tips_x[near].max()), float(depth.max())
        law = PlanarForecast(
            trajectory=found, behind=float(tips_x[near].min()), ahead=ahead, deepest=deepest,
            fastest=float(speed[near].max()), rise=float(found.y.max() - found.y[0]), sunk=float(depth[0].max()),
            pushed=trial.weight + (trial.mass + trial.counterweight) * float(np.gradient(found.vy, found.time).max()),
            farthest=max(ahead, self._rolled(deepest)),
        )  # fmt: skip
        return law if trial.counterweight > 0 else self._in_flight(law)

    def _rolled(self, deepest: float) -> float:
        """Where the tip ahead of the next row touches, rolled on l cos(pi / n) for ROLLED of the way [m]; or 0.

        On springs a row leaves the ground, which ends the torque; sand holds one row all the time. 0 for other motions.
        """
        trial, duration = self.trial, self.duration
        if not is_plain(self.settings):
            return 0.0
        high = trial.spike_length * math.cos(math.pi / trial.spike_count)
        gained = trial.torque * high / (trial.inertia + trial.mass * high**2)
        brake = trial.actuator == "brake"
        room = trial.wheel_speed_0 if brake else self.plan.max_wheel_speed - trial.wheel_speed_0
        acts = min(duration, trial.torque_until, room * trial.wheel_inertia / max(trial.torque, 1e-12))
        way = gained * acts * (duration - 0.5 * acts)
        return ROLLED[trial.actuator] * way + math.sqrt(max(trial.spike_length**2 - (high - 1.5 * deepest) ** 2, 0.0))

    def _in_flight(self, law: PlanarForecast) -> PlanarForecast:
        """Corrections for sand in flight: the spring-damper has one K for any gravity (`experiments.grains.flight`)."""
        settings, trial = self.settings, self.trial
        lying = lies_in_flight(
            trial, surface=self.surface, material=self.material, hull_radius=self.hull_radius,
            width=self.copies * settings.bed_size[1], duration=self.duration, max_wheel_speed=self.plan.max_wheel_speed,
        )  # fmt: skip
        pushed = 0.5 * trial.gravity_sim * self.duration**2  # by sand that pushes ahead with the weight, as at 1e-2 g
        ahead = lying.reach + max(pushed, float(law.trajectory.x.max()))
        return replace(
            law, behind=min(law.behind, -lying.reach), ahead=max(law.ahead, ahead),
            deepest=max(law.deepest, lying.deepest), fastest=max(law.fastest, lying.fastest), sunk=lying.sunk,
            farthest=max(law.ahead, ahead), margin=1.5 if settings.drop_speed is not None else 1.0,
            on=say("on_its_hull") if lying.on_hull else law.on,
        )  # fmt: skip

    # The bed

    @property
    def first_gravity(self) -> float:
        """Gravity while the bed settles: as set, or that of the grains [m/s2]."""
        return self.settings.settle_gravity or self.grain_gravity

    @property
    def lowering_speed(self) -> float:
        """As set, or sqrt(g z) [m/s], slow for sand in any gravity: z a grain, in flight how deep it lies.

        Its dynamic pressure, 1.1 rho g z, equals the strength of sand at a depth of z / 50 (3D-RFT, `softening`).
        """
        if self.settings.lowering_speed is not None:
            return self.settings.lowering_speed
        deep = self.settings.grain if self.counterweight > 0 else self.forecast.sunk
        return math.sqrt(self.first_gravity * deep)

    @property
    def pressure(self) -> float:
        """Pressure under one spike by the weight, in flight also by the torque [Pa]."""
        load = self.trial.weight
        if self.counterweight == 0:
            load = max(load, PUSHED[self.trial.actuator] * self.forecast.pushed)
        return load / self.copies / (0.25 * math.pi * self.spike_diameter**2)

    @property
    def hull_radius(self) -> float:
        """Of the cylinder that stands for the hull [m]."""
        sides = (self.reach - self.spikes.clear) * math.cos(math.pi / self.trial.spike_count)
        return HULL_SHARE * max(sides, 0.0)

    @property
    def origin(self) -> float:
        """x in the bed of the platform's start [m]: the expected footprints lie in the middle, or `place` off."""
        settings, forecast = self.settings, self.forecast
        return settings.place + 0.5 * settings.bed_length - 0.5 * (forecast.behind + forecast.ahead)

    @cached_property
    def graded(self) -> Graded | None:
        """Fine grains where the forecast's tips come down, two spike diameters deeper than they go; None: one size."""
        settings, spike = self.settings, self.spike_diameter
        if settings.coarse is None:
            return None
        return graded_under(
            self.forecast.trajectory, length=settings.bed_size[0], origin=self.origin, spike_diameter=spike,
            grain=settings.grain, spread=settings.spread, coarse=settings.coarse,
            margin=(settings.fine_radius or 1.5 * spike) / spike,
            depth=settings.fine_depth or min(settings.bed_size[2], self.forecast.deepest + 2 * spike),
        )  # fmt: skip

    def grain_count(self) -> float:
        """About how many grains the whole bed will have. Raises ValueError for sizes by place that do not fit it."""
        count, size = super().grain_count(), self.settings.bed_size
        if self.graded is None:
            return count
        self.graded.check(size)
        return count * self.graded.share(size)

    def thrown(self) -> float:
        """How high over the surface grains are followed [m]: thrown at THROW times the fastest tip's speed.

        At most the length of the bed: at a small gravity, grains thrown higher do not return within a run, and end it.
        """
        return min((THROW * self.forecast.fastest) ** 2 / (2 * self.grain_gravity), self.settings.bed_size[0])

    def _length_on_grains(self) -> float:
        """Length of a bed with the expected footprints in its middle and space for the farthest possible one [m]."""
        forecast = self.forecast
        return 2 * (forecast.farthest + MARGIN * self.spike_diameter) - forecast.behind - forecast.ahead

    def check_extent(self) -> None:
        s, forecast, spike = self.settings, self.forecast, self.spike_diameter
        margin = MARGIN * spike
        need, on_grains = forecast.length + 2 * margin, self._length_on_grains()
        if s.bed_length < need:
            repeated = say("with_repeats", s=s) if s.bed_repeats > 1 else ""
            wanted = math.ceil(100 * max(need, on_grains)) / 100
            farther = say("may_go_farther") if on_grains > need * (1 + 1e-9) else ""
            need = math.ceil(100 * need) / 100
            raise ValueError(
                say("too_short", s=s, f=forecast, repeated=repeated, need=need, margin=margin, farther=farther,
                    wanted=wanted)
            )  # fmt: skip
        if s.bed_size[1] < 3 * spike * (1 - 1e-9):
            raise ValueError(say("too_narrow", s=s, spike=spike, need=3 * spike))

    def check_layout(self) -> None:
        """Raise ValueError for a place off the bed, or of a graded bed, and for stages that leave no level bed."""
        s = self.settings
        if abs(s.place) > 0.5 * s.bed_length:
            raise ValueError(say("off_the_bed", s=s, half=0.5 * s.bed_length))
        if s.place and s.coarse is not None:
            raise ValueError(say("place_on_graded", s=s))
        for key in ("fine_radius", "fine_depth"):
            if s.coarse is None and getattr(s, key) is not None:
                raise ValueError(say("of_graded", key=key, value=getattr(s, key)))
        if s.fine_radius is not None and s.fine_radius < 0.5 * self.spike_diameter:
            raise ValueError(say("fine_radius", s=s, least=0.5 * self.spike_diameter))
        if s.fine_depth is not None and not self.forecast.deepest <= s.fine_depth <= s.bed_size[2]:
            raise ValueError(say("fine_depth", s=s, f=self.forecast, most=s.bed_size[2]))
        if s.bed_repeats > 1 and s.coarse is not None:
            raise ValueError(say("graded_repeated", s=s))
        if s.bed_stages is not None:
            check_bed_stages(s.bed_stages, self.material, size=s.bed_size, grain=s.grain, spread=s.spread)

    # The run

    def announce(self, progress: Progress) -> None:
        self.progress = progress
        settings, plan = self.settings, self.plan
        for sentence in opening(
            settings, plan, grains=self.grain_count(), softening=self.softening(), lowering_speed=self.lowering_speed
        ):
            progress.message(sentence)
        short = short_of_way(settings, plan, self.forecast.trajectory)
        for warning in (*plan.warnings, short, self.may_leave(), self.whose_spikes()):
            if warning:
                progress.message(f"warning: {warning}")

    def bed(self, softening: Softening, progress: Progress) -> Bed:
        """The bed; for one laid end to end, a message whether tips meet the same sand again."""
        bed = super().bed(softening, progress)
        if self.repeats > 1:
            piece, way = self.settings.bed_size[0], self.forecast.length + self.spike_diameter
            said = say("laid_end_to_end", repeats=self.repeats, grains=bed.grain_count, piece=piece)
            again = say("same_sand_expected", said=said, on=self.forecast.on, way=way)
            progress.message(said if way <= piece else again)
        return bed

    def whose_spikes(self) -> str | None:
        """Message that a body of another size than the platform's has the platform's spikes."""
        spikes, own, given = self.spikes, self.plan.platform.spike_length, self.settings.spike_length
        if not spikes.of_platform or given is None or math.isclose(given, own):
            return None
        names = " and ".join(spikes.of_platform)
        return say(
            "other_bodys_spikes", s=self.settings, names=names, thick=1e3 * spikes.diameter, clear=1e3 * spikes.clear,
            own=1e3 * own,
        )  # fmt: skip

    def may_leave(self) -> str | None:
        """Warning that tips may come down beyond the bed before the end; None if they cannot."""
        s, forecast = self.settings, self.forecast
        ahead = s.bed_length - self.origin
        if ahead >= forecast.farthest + 0.5 * self.spike_diameter:
            return None
        long = self._length_on_grains() + 2 * abs(s.place)
        longer = say("longer_bed", length=math.ceil(100 * long) / 100)
        if s.coarse is None:
            longer += say("more_repeats", repeats=math.ceil(long / s.bed_size[0]))
        return say("may_leave", s=s, f=forecast, ahead=ahead, longer=longer)

    def members(self) -> list[Member]:
        """One spike a row and the hull's cylinder. Raises ValueError for rows too near each other."""
        trial = self.trial
        if slots_of(trial.spike_count) < FEWEST_SLOTS:
            raise ValueError(say("rows_too_near", s=self.settings, rows=trial.spike_count))
        return platform_members(
            spike_length=trial.spike_length, count=trial.spike_count, diameter=self.spikes.diameter,
            clear=self.spikes.clear, hull_radius=self.hull_radius, width=self.settings.bed_size[1],
        )  # fmt: skip

    def layout(self, bed: Bed) -> Mapping[str, Any]:
        return {"origin": (self.origin, 0.5 * bed.size[1]), "begin": self.settings.place}

    def check(self) -> None:
        """As `PlatformOnBed.check`; also checks LAMMPS if it is requested."""
        check_lammps(self.settings, self.material)
        super().check()

    def run_on(self, ground: BedGround) -> CoupledTumble:
        lowered = {"lower_gravity": True} if self.settings.settle_gravity is not None else {}
        return stepper_of(
            self.settings, self.trial, ground, **lowered, **self.stepping(), tip_radius=0.5 * self.spikes.diameter,
            max_wheel_speed=self.plan.max_wheel_speed,
        )  # fmt: skip

    def conclude(self, run: CoupledTumble, folder: Path) -> Result:
        law = self.forecast.trajectory
        result = conclude(self.settings, self.plan, run, law, self.softening(), folder, self.graded)
        result["warnings"] += [warning for warning in (self.whose_spikes(),) if warning]
        return Result.make("tumble", **result)


def _beside(settings: TumbleSettings) -> TumbleSettings:
    """The same trial without the settings of the bed; its numbers are those of the grains, except K, C and friction."""
    kept = {name: getattr(settings, name) for name in settings.model_fields_set}
    own = set(settings.bed_settings_given()) | {"ground"}
    landing = {"torque": 0.0} if settings.drop_speed is not None else {}
    return TumbleSettings(**{name: value for name, value in kept.items() if name not in own} | landing)
