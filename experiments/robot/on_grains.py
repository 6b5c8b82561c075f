"""A robot followed on a surface law, and on a bed of grains.

On a bed the same robot on the spring-damper is stepped first: it says how far and how deep the bed must reach. The same
robot on the default law of the surface stands beside the result.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupling.members import Member
from coupling.poses import Vector as Array
from coupling.robot import BedFeet, LammpsFeet, MujocoRobot, RobotRun, by_regions
from coupling.robot.soles import plan_area
from coupling.robot.stability import ExpectedBed, check_exchange
from dem import Bed
from experiments.grains.following import Followed
from experiments.grains.lammps import check_lammps, moved_to_lammps
from experiments.grains.on_bed import PACE, Forecast, OnLoweredBed
from experiments.grains.softening import run_limit
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import draw_plots
from rigid.spatial.quaternions import to_matrix

from . import say
from .energy import idle
from .feet import buried_words
from .flight import fall_warning, touch_words
from .forms import MOST_INERTIA, NO_FORMS, Forms, OnLaw, forms_of, with_grains
from .on_laws import answer_of_run, follow_on, on_law
from .plan import RobotPlan, width_of
from .result import RobotFrames, conclude, deepest_at_start, write_series_of
from .settings import RobotSettings
from .sure import sure_of_law

__all__ = ["RobotFollowed", "RobotForecast", "RobotOnBed", "marked_stopped", "report_seconds"]

SEEN = 200  # Moments of the forecast at which the extent of the feet is taken
WIDE = 4.0
"""Width of a bed over that of the widest foot below which a run starts with a warning [1]: of `hedgebed penetrate`."""
REPORT = {True: 45.0, False: 20.0}
"""Expected duration of a report with pictures and film on grains and on a law [s]; `CURVES` without pictures."""
CURVES = 5.0
DEEPER = 1.3
"""Depth for which a bed must be deep, over that on `rft` with inertia=10 [1]. Four legs on grains of 10 and 12 mm went
0.7 to 1.25 times as deep (docs/notes/mujoco.md). This law is the nearest to grains."""
SPARE = 0.2  # Share of the way and depth of the feet that the advised bed has more than it needs
FEWEST_ACROSS = 5.0  # Grains across the widest part of a foot, below which it is refused [1]
FEWEST_ROWS = 3  # Of a run that is stopped, from which on it has a result [1]
POLYGON = 0.01  # Share by which a foot may be narrower than that: the outline of a ball is a polygon [1]


class RobotFollowed(Followed[RobotRun]):
    """A robot; its run on a surface law."""

    settings: RobotSettings
    stage = "robot"
    frames, write_series = RobotFrames, staticmethod(write_series_of)
    sinkage = staticmethod(deepest_at_start)

    def __init__(self, settings: RobotSettings, plan: RobotPlan) -> None:
        self.settings, self.plan = settings, plan
        self.weight, self._half_way, self._buried = plan.numbers["weight"].value, False, False

    def run_on_law(self, *, as_spring: bool = False) -> RobotRun:
        """The robot on its surface law, ready to be stepped; `as_spring`: explicitly, on the spring-damper."""
        s, robot = self.settings, self.plan.robot()
        options: Mapping[str, Any] = {} if as_spring else _stepping(s)
        ground = self.plan.law_feet(robot, as_spring=as_spring)
        return RobotRun(robot, ground, duration=s.duration, **options)

    def announce(self, progress: Progress) -> None:
        """Every default, and the warnings."""
        self._announce(self.plan, progress)

    def _announce(self, plan: RobotPlan, progress: Progress) -> None:
        """What `plan` announces, and that the robot is still in free fall at the end, if it is."""
        robot = plan.robot()
        falls = fall_warning(self.settings, robot)
        touch = touch_words(self.settings, robot)
        for sentence in [*plan.announcement(), *touch, *(f"warning: {warning}" for warning in falls)]:
            progress.message(sentence)

    def finish(self, run: RobotRun, folder: RunFolder, progress: Progress) -> Result:
        """As of every run; first a message where MuJoCo's steps are shorter than those of the model."""
        used, own = run.robot.step, run.robot.control_step
        if used < (1 - 1e-6) * own:
            progress.message(say("shorter_step", used=1e3 * used, own=1e3 * own, macro=1e3 * run.macro_step))
        try:
            return super().finish(run, folder, progress)
        except KeyboardInterrupt:
            if not run.done and len(run.columns["time"]) >= FEWEST_ROWS:
                self.write_so_far(run, folder)
                draw_plots(folder, progress)
                progress.message(say("stopped_report", report=folder.path / "report.html"))
            raise

    def write_so_far(self, run: RobotRun, folder: RunFolder) -> Result:
        """Write series and result of a run as far as it has come, marked as stopped; without ranges over laws."""
        so_far = say("stopped_at", time=run.time, duration=run.duration)
        result = marked_stopped(self.conclude_alone(run, folder.path), so_far)
        folder.write_result(result)
        return result

    def conclude_alone(self, run: RobotRun, folder: Path) -> Result:
        """As `conclude`, without the runs on other laws."""
        return conclude(self.settings, self.plan, run, folder)

    def notice(self, run: RobotRun) -> str | None:
        """Once: that what is fixed to a foot is in the ground; half way: that the actuators have given no work."""
        if not self._buried and (said := buried_words(run)):
            self._buried = True
            return f"warning: {said[0]}"
        if self._half_way or run.fraction < 0.5:
            return None
        self._half_way = True
        return f"note: {say('idle_so_far', time=run.time)}" if idle(self.plan, run) else None

    def conclude(self, run: RobotRun, folder: Path) -> Result:
        own = on_law(run, self.plan)
        sure, said = sure_of_law(self.plan, own.answer, self._answer_of)
        forms = forms_of(self.plan, own, self._long_enough, sure=sure)
        return conclude(self.settings, self.plan, run, folder, sure=sure, sure_words=said, forms=forms)

    def _answer_of(self, plan: RobotPlan) -> dict[str, float]:
        """The answer of the same robot on the law of another plan."""
        run = RobotFollowed(plan.settings, plan).run_on_law()
        run.run()
        return answer_of_run(run)

    def _long_enough(self, plan: RobotPlan) -> OnLaw:
        """The same until the robot is in flight or at rest."""
        run = RobotFollowed(plan.settings, plan).run_on_law()
        follow_on(run)
        return on_law(run, plan)


def _stepping(settings: RobotSettings) -> Mapping[str, Any]:
    """How the master steps the run."""
    return {name: getattr(settings, name) for name in ("substeps", "extrapolation", "iterations")}


def marked_stopped(result: Result, why: str) -> Result:
    """The same result with the status "stopped", and ``why`` in its title and as its first warning."""
    return result.model_copy(
        update={"status": "stopped", "title": f"{result.title}: {why}", "warnings": [why, *result.warnings]}
    )


def report_seconds(settings: RobotSettings) -> float:
    """Expected duration of the report [s]."""
    return REPORT[settings.on_grains] if settings.frame_count else CURVES


@dataclass(frozen=True, kw_only=True)
class RobotForecast(Forecast):
    """What the same robot on the spring-damper says of the bed."""

    run: RobotRun
    low: tuple[float, float]
    high: tuple[float, float]  # Corners of where feet come down, x and y from the robot's origin [m]
    sunk: tuple[tuple[int, ...], ...]  # Of each foot the numbers of its parts that go at least half as deep as it does


class RobotOnBed(RobotFollowed, OnLoweredBed[RobotSettings, RobotRun, RobotForecast]):
    """A robot on a bed."""

    def __init__(self, settings: RobotSettings, plan: RobotPlan) -> None:
        super().__init__(settings, plan)
        self.duration, self.surface, self.counterweight = settings.duration, plan.surface.name, 0.0
        self.gravity = plan.numbers["gravity"].value
        robot = self._robot = plan.robot()
        self.widths, self.narrowest = {}, math.inf  # Of the feet and of any part [m]
        for foot, turn in zip(robot.feet, robot.pose.turn.reshape(-1, 4), strict=True):
            matrix = to_matrix(turn)
            widths = [width_of(part, matrix) for part in foot.parts]
            self.widths[foot.name], self.narrowest = max(widths), min(self.narrowest, *widths)
        self.reach = 2 * max(foot.reach for foot in robot.feet)

    @cached_property
    def forecast(self) -> RobotForecast:
        run = self.run_on_law(as_spring=True)
        rows = run.run()
        feet = run.feet
        places, depth = feet[:, :, :3], feet[:, :, -1]
        speeds = np.linalg.norm(np.diff(places, axis=0), axis=2) / run.macro_step
        near = depth > 0
        if not near.any():  # it never comes down
            near = np.ones_like(near)
        low, high, sunk = self._footprint(feet, near)
        return RobotForecast(
            run=run, low=(float(low[0]), float(low[1])), high=(float(high[0]), float(high[1])), sunk=sunk,
            deepest=float(depth.max()),
            fastest=float(speeds.max(where=near[1:], initial=0.05)), rise=float(rows["z"].max() - rows["z"][0]),
        )  # fmt: skip

    def _footprint(self, feet: Array, near: NDArray[np.bool_]) -> tuple[Array, Array, tuple[tuple[int, ...], ...]]:
        """Corners of what the feet cover from above where they are `near` the ground, x and y from the origin [m]; of
        each foot the parts that go at least half as deep as the foot, or all where none goes into the ground.

        Of `SEEN` moments evenly over the run; ``feet``: `RobotRun.feet`; ``near``: shape (row, foot).
        """
        low, high = np.full(2, math.inf), np.full(2, -math.inf)
        sunk: list[tuple[int, ...]] = []
        for k, foot in enumerate(self._robot.feet):
            rows, lowest = np.flatnonzero(near[:, k]), np.full(len(foot.parts), math.inf)
            for row in rows[np.linspace(0, len(rows) - 1, min(SEEN, len(rows))).astype(int)]:
                turn = to_matrix(feet[row, k, 3:7]).T
                for part, own in enumerate(foot.parts):
                    points = feet[row, k, :3] + own.vertices @ turn
                    low, high = np.minimum(low, points[:, :2].min(axis=0)), np.maximum(high, points[:, :2].max(axis=0))
                    lowest[part] = min(lowest[part], points[:, 2].min())
            reached = lowest <= 0.5 * lowest.min() if lowest.min() < 0 else np.ones(len(lowest), dtype=bool)
            sunk.append(tuple(np.flatnonzero(reached).tolist()))
        return low, high, tuple(sunk)

    @cached_property
    def beside(self) -> RobotRun:
        """The same robot on the default law of the surface, to compare with, until it is in flight or at rest.

        Size and modulus of the bed follow from the spring-damper nevertheless: a flat foot goes deeper on it.
        """
        law = self.settings.default_law
        if law == "spring-damper":
            run = self.run_on_law(as_spring=True)
        else:
            plan = self.plan.on_law(law)
            robot = plan.robot()
            run = RobotRun(robot, plan.law_feet(robot), duration=self.duration, **_stepping(self.settings))
        follow_on(run)
        return run

    @cached_property
    def _standing(self) -> list[tuple[float, float]]:
        """Of each foot: width of the widest of its `RobotForecast.sunk` parts [m], and the area of these parts [m2]."""
        found = []
        for foot, sunk, turn in zip(
            self._robot.feet, self.forecast.sunk, self._robot.pose.turn.reshape(-1, 4), strict=True
        ):
            matrix, parts = to_matrix(turn), [foot.parts[k] for k in sunk]
            area = sum(plan_area(part.vertices @ matrix.T) for part in parts)
            found.append((max(width_of(part, matrix) for part in parts), area))
        return found

    @cached_property
    def spike_diameter(self) -> float:  # type: ignore[override]
        """Width of the narrowest foot, by its `RobotForecast.sunk` parts [m]."""
        return min(width for width, _ in self._standing)

    @cached_property
    def told(self) -> RobotPlan:
        """The plan, whose words name K of the parts that go into the ground."""
        feet = zip(self._robot.feet, self.forecast.sunk, strict=True)
        plan = self.plan.standing_on(foot.parts[k].name for foot, sunk in feet for k in sunk)
        return replace(plan, warnings=(*plan.warnings, *self._narrow(), *self._few_grains()))

    def _narrow(self) -> list[str]:
        """A warning of a bed that is narrow for the widest foot that goes into the ground, as `penetrate` refuses."""
        s, wide = self.settings, max(width for width, _ in self._standing)
        least = WIDE * wide
        if min(s.bed_size[:2]) >= least * (1 - 1e-6):
            return []
        return [say("narrow_bed", s=s, wide=wide, least=least)]

    def _few_grains(self) -> list[str]:
        """A warning for each foot whose parts in the ground are all narrower than `FEWEST_ACROSS` grains."""
        s = self.settings
        least = FEWEST_ACROSS * s.grain * (1 - POLYGON)
        return [
            say("few_grains", s=s, name=foot.name, width=width, across=width / s.grain, most=width / FEWEST_ACROSS)
            for foot, (width, _) in zip(self._robot.feet, self._standing, strict=True)
            if width < least
        ]

    def announce(self, progress: Progress) -> None:
        self.progress = progress
        _ = self.beside  # before the bed is made: a failure loses no work on grains
        self._announce(self.told, progress)
        for sentence in self._softness():
            progress.message(sentence)
        for sentence in buried_words(self.beside, on=self.settings.default_law):
            progress.message(f"warning: {sentence}")
        if idle(self.plan, self.beside):
            law, time = self.settings.default_law, self.beside.time
            progress.message(f"warning: {say('idle_on_law', law=law, time=time)}")
        if self.settings.ground != "lammps":
            progress.message(self._work())

    def _softness(self) -> list[str]:
        """The modulus of the grains, and a warning where one that is set makes them overlap by more than was meant."""
        s, used, chosen = self.settings, self.softening(), self.softening(chosen=True)
        overlap = s.max_overlap * (chosen.young / used.young) ** (2 / 3)  # Hertz
        words: Mapping[str, Any] = {
            "s": s, "young": used.young, "chosen": chosen.young, "factor": used.factor, "overlap": overlap,
        }  # fmt: skip
        softer = s.young is not None and used.young < chosen.young
        own = say("young_given" if s.young is not None else "young_chosen", **words)
        return [own, *([f"warning: {say('young_soft', **words)}"] if softer else [])]

    def _work(self) -> str:
        """Grains, steps and time of the run, its bed, the lowering of gravity and the report, in a sentence."""
        count, step, pace, costs = self.grain_count(), self.time_step(), self.pace, self.minutes
        words = {"minutes": costs[self.stage], "bed": costs[self.bed_stage], "pace": 1e-6 * pace if pace else PACE}
        lowered = costs.get(self.lowering_stage)
        return say(
            "work", count=count, steps=self.duration / step, report=self.report_seconds / 60, **words,
            pictures=say("with_pictures" if self.settings.frame_count else "without_pictures"),
            of=say("as_measured" if pace else "of_one_core"), unit="" if pace else " of processor time",
            lowered="" if lowered is None else say("lowered_takes", minutes=lowered),
        )  # fmt: skip

    @property
    def report_seconds(self) -> float:  # type: ignore[override]
        """Expected duration of the report [s]."""
        return report_seconds(self.settings)

    def check_exchange(self) -> float:
        """The load of the exchange at the start over the largest stable one [1], on the expected bed.

        Raises ValueError where it would not be stable.
        """
        s, robot = self.settings, self.plan.robot()
        grains = self.material.softened(self.softening().young)
        step = self.time_step()
        robot.start()
        bed = ExpectedBed(0.5 * s.grain, run_limit(s.max_overlap), grains, step, repeatable=s.ground != "lammps")
        return check_exchange(robot, bed, substeps=s.substeps, iterations=s.iterations)

    def check(self) -> None:
        """Raise ValueError, naming key, value and what is accepted, for a bed that does not suit this robot."""
        s = self.settings
        if s.settle_gravity is not None and s.settle_gravity < self.gravity:
            raise ValueError(say("settle_below", s=s, gravity=self.gravity))
        check_lammps(s, self.material)
        for foot in self._robot.feet:
            if not foot.shapes:
                raise ValueError(say("site_on_grains", name=foot.name))
            width = self.widths[foot.name]
            if width < FEWEST_ACROSS * s.grain * (1 - POLYGON):
                words = {"width": width, "across": width / s.grain, "most": width / FEWEST_ACROSS}
                raise ValueError(say("small_foot", s=s, name=foot.name, fewest=FEWEST_ACROSS, **words))
        if self._robot.clearance < s.grain * (1 - 1e-9):
            raise ValueError(say("low_start", s=s, clearance=self._robot.clearance))
        if not self.gravity > 0:
            raise ValueError(say("no_gravity", gravity=self.gravity))
        try:
            super().check()
        except RuntimeError as error:
            raise ValueError(say("forecast_fails", error=error)) from error
        try:
            _ = self.beside
        except RuntimeError as error:
            raise ValueError(say("beside_fails", law=s.default_law, error=error)) from error
        self.check_exchange()

    def check_extent(self) -> None:
        s, forecast, faults = self.settings, self.forecast, []
        sizes = list(s.bed_size)
        wide = WIDE * max(width for width, _ in self._standing)
        for axis, (name, low, high) in enumerate(zip("xy", forecast.low, forecast.high, strict=True)):
            way = high - low
            need = way + 2 * s.grain
            if s.bed_size[axis] < need:
                why = "" if s.default_law == "spring-damper" else say("why_spring", law=s.default_law)
                words = {"low": low, "high": high, "wanted": math.ceil(100 * need) / 100}
                said = say("too_short", s=s, name=name, size=s.bed_size[axis], why=why, **words)
                faults.append(said)
                need += SPARE * way
            sizes[axis] = max(s.bed_size[axis], math.ceil(100 * max(need, wide) - 1e-6) / 100)
        deepest, on = self.depth_expected
        least = deepest + 2 * self.spike_diameter
        if s.bed_size[2] < least:
            sizes[2] = math.ceil(1e3 * (least + SPARE * deepest)) / 1e3
            least = math.ceil(1e3 * least) / 1e3
            faults.insert(
                0, say("too_shallow", s=s, width=self.spike_diameter, least=least, deepest=deepest, on=on)
            )  # fmt: skip
        if faults:
            told = " ".join(f"{size:g}" for size in sizes)
            raise ValueError(say("all_sides", s=s, faults=". ".join(faults), sizes=told, spare=SPARE))

    @cached_property
    def depth_expected(self) -> tuple[float, str]:
        """Depth for which the bed must be deep [m], and on what it is expected, in words.

        On sand that on the law which is nearest to grains, times `DEEPER`, if that is less than on the spring-damper.
        """
        deepest, on = self.forecast.deepest, self.forecast.on
        if self.settings.default_law == "spring-damper":
            return deepest, on
        nearest = self.plan.on_law("rft", MOST_INERTIA)
        try:
            near = DEEPER * self._answer_of(nearest)["sinkage_largest"]
        except (RuntimeError, ValueError):  # lost, or an exchange that would be unstable
            return deepest, on
        return (near, say("on_nearest_law", times=DEEPER)) if near < deepest else (deepest, on)

    @property
    def pressure(self) -> float:
        """Of the weight under the smallest foot alone [Pa]."""
        return self.weight / max(min(area for _, area in self._standing), 1e-12)

    @property
    def lowering_speed(self) -> float | None:
        """None: a robot is not set down."""
        return None

    def members(self) -> list[Member]:
        """None: its feet are not members of one platform."""
        return []

    def layout(self, bed: Bed) -> Mapping[str, Any]:
        low, high = self.forecast.low, self.forecast.high
        x, y = (0.5 * (float(bed.size[k]) - low[k] - high[k]) for k in range(2))
        return {"origin": (x, y)}

    def ground(self, bed: Bed) -> BedFeet:
        """The robot's feet on the prepared bed, in LAMMPS where its grains are to live there."""
        s, make = self.settings, BedFeet
        if s.ground == "lammps":
            bed.overlap_limit = run_limit(s.max_overlap)
            free = not by_regions(self._robot)
            bed, make = moved_to_lammps(bed, s, self.progress, free=free, kept=self.kept), LammpsFeet
        return make(
            bed, self._robot.feet, touch=1e-3 * self.weight, friction=s.spike_friction,
            restitution=s.spike_restitution, **self.layout(bed),
        )  # fmt: skip

    def run_on(self, ground: Any) -> RobotRun:
        robot: MujocoRobot = self.plan.robot()
        return RobotRun(robot, ground, duration=self.duration, **_stepping(self.settings))

    @cached_property
    def forms(self) -> Forms:
        """The same robot on the laws of sand; nothing on other surfaces. They do not depend on the bed."""
        law = self.settings.default_law
        if law == "spring-damper":
            return NO_FORMS
        plan = self.plan.on_law(law)
        return forms_of(plan, on_law(self.beside, plan), self._long_enough, sure={})

    def conclude(self, run: RobotRun, folder: Path) -> Result:
        return self._concluded(
            run, folder, with_grains(self.forms, answer_of_run(run), depth=self.settings.bed_size[2])
        )

    def conclude_alone(self, run: RobotRun, folder: Path) -> Result:
        return self._concluded(run, folder, NO_FORMS)

    def _concluded(self, run: RobotRun, folder: Path, forms: Forms) -> Result:
        return conclude(
            self.settings, self.told, run, folder, beside=self.beside, softening=self.softening(),
            across=self.narrowest / self.settings.grain, forms=forms,
        )  # fmt: skip
