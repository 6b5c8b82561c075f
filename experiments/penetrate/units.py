"""The pieces of a penetration experiment: one run of one spike in one bed, made alike on any ground.

A piece is finished or it is not; what is finished is never computed again.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any, Literal

from coupling import Drive, Drop, Run, SetDown
from coupling.planar_body import PLACEMENT_TIME
from dem.engine.runtime import usable_cores
from experiments.grains import staged
from experiments.grains.bearing import OF_PLATE
from experiments.runs.folder import RunFolder
from experiments.runs.pace import known_pace, runtime_name
from experiments.runs.progress import Progress, as_expected
from experiments.runs.types import Json
from experiments.runs.whole_runs import PictureCosts
from rigid import Spike

from .settings import PenetrateSettings, say
from .similarity import pace_of

__all__ = [
    "PenetratePlan", "Unit", "deepest", "expected_time", "make_run", "make_spike", "plan_units",
    "preparation_time",
]  # fmt: skip

_FAR_DOWN = 20.0
"""Tip diameters, or driven depths, past which a run on a law without a bed is ended [1]: it would not come to rest."""
_TIMES_TO_REST = 2.4
"""Of load / (lowering_speed K), until a set-down shows no sign of motion: 1.8 to 3.3 in six [1]."""


@dataclass(frozen=True)
class Unit:
    """One run: its bed's seed, what is done, and how fast [m/s]."""

    seed: int
    kind: Literal["driven", "drop", "set_down"]
    speed: float

    @property
    def id(self) -> str:
        """Its name in the run folder."""
        kind = self.kind.replace("_", "-")
        return f"seed{self.seed}-{kind}" + ("" if self.kind == "set_down" else f"-{self.speed:g}")

    @property
    def title(self) -> str:
        """What a person calls it."""
        words = {"driven": "drive at", "drop": "drop at", "set_down": "set down at"}[self.kind]
        return f"seed {self.seed}: {words} {self.speed:g} m/s"

    @property
    def condition(self) -> tuple[str, float]:
        """What it has in common with the same run on another seed."""
        return self.kind, self.speed


def plan_units(settings: PenetrateSettings) -> list[Unit]:
    """All runs, seed by seed: everything on the first seed, what the settings say on the others. On the law of a model
    nothing is set down unless `load` is given; nowhere without `set_down`."""
    units = []
    for index, seed in enumerate(settings.seeds):
        first, others = (settings.speeds, settings.drop_speeds), (settings.other_speeds, settings.other_drop_speeds)
        speeds, drops = first if index == 0 else others
        units += [Unit(seed, "driven", speed) for speed in speeds] + [Unit(seed, "drop", speed) for speed in drops]
        asked = settings.ground != "spring-damper" or settings.load is not None  # on a model's law
        if settings.set_down and asked:
            units.append(Unit(seed, "set_down", settings.lowering_speed))
    return units


def shown_units(units: Sequence[Unit]) -> set[str]:
    """Ids of the runs of which frames are kept: of the first seed the slowest drive, the fastest drop, the set-down."""
    first = sorted((unit for unit in units if unit.seed == units[0].seed), key=lambda unit: unit.speed)
    kinds = ("driven", "drop", "set_down")
    driven, drops, set_down = ([unit for unit in first if unit.kind == kind] for kind in kinds)
    return {unit.id for unit in driven[:1] + drops[-1:] + set_down[:1]}


def make_spike(settings: PenetrateSettings) -> Spike:
    """The spike that the settings describe."""
    return Spike(
        tip=settings.tip, diameter=settings.tip_diameter, shaft_diameter=settings.shaft_diameter,
        length=settings.tip_height + settings.shaft_length, cone_angle=settings.cone_angle, mass=settings.mass,
        friction=settings.spike_friction, restitution=settings.spike_restitution,
    )  # fmt: skip


def make_run(
    settings: PenetrateSettings,
    unit: Unit,
    ground: Any,
    *,
    start_depth: float | None = None,
    drop_time: float | None = None,
) -> Run:
    """The run of `unit` on any ground. `start_depth` [m] and `drop_time` [s] make it the same on another ground."""
    spike = make_spike(settings)
    common: Json = {"substeps": settings.substeps, "start_depth": start_depth}
    if unit.kind == "driven":
        return Drive(
            spike, ground, speed=unit.speed, depth=settings.depth, hold=settings.hold,
            retreat_speed=settings.retreat_speed, **common,
        )  # fmt: skip
    common |= {"load": settings.weight, "rest_time": settings.rest_time, "max_depth": deepest(settings)}
    if unit.kind == "drop":
        return Drop(
            spike, ground, speed=unit.speed, mass=settings.mass,
            after_stop=settings.after_stop if drop_time is None else math.inf,
            max_time=settings.drop_time if drop_time is None else drop_time, **common,
        )  # fmt: skip
    # The mass that counts is c times 2 ms on Earth, and as small beside the ground under any gravity.
    mass = settings.weight / unit.speed * PLACEMENT_TIME * pace_of(settings)
    longest = _set_down_time(settings, unit)
    return SetDown(spike, ground, lowering_speed=unit.speed, mass=mass, max_time=longest, **common)


def _set_down_time(settings: PenetrateSettings, unit: Unit) -> float:
    """When a set-down gives up [s]: thrice the time in which it would sink to where drops are stopped."""
    return 3 * deepest(settings) / unit.speed + 10 * settings.rest_time


def deepest(settings: PenetrateSettings) -> float:
    """Where a drop or a set-down is stopped [m]: one tip's diameter above the floor of the bed. A law has no floor, and
    the size of a bed that is not there bounds nothing: then `_FAR_DOWN` times the tip or the driven depth."""
    if settings.on_grains:
        return settings.bed_size[2] - settings.tip_diameter
    return _FAR_DOWN * max(settings.tip_diameter, settings.depth)


def expected_time(settings: PenetrateSettings, unit: Unit, stiffness: float, *, held: float = 0.0) -> float:
    """About how long a run lasts on the bed's clock [s], `stiffness` [N/m] being a flat plate's in 3D-RFT.

    `held`: what grains that stick bear of the load at the surface [N].

    A drop: to the first stop of m z'' = W - K z with the speed v, at w t = pi - atan(v K / (W w)), w^2 = K / m, and
    what follows. A set-down: of first order, with the placement's time constant c / K = W / (lowering_speed K).
    """
    own = OF_PLATE * stiffness
    if unit.kind == "driven":
        return settings.depth / unit.speed + settings.hold + settings.depth / settings.retreat_speed
    if unit.kind == "drop":
        rate = math.sqrt(own / settings.mass)
        stop = (math.pi - math.atan(unit.speed * own / (settings.weight * rate))) / rate
        return min(settings.drop_time, stop + settings.after_stop)
    sunk = min(max(settings.weight - held, 0.0) / own, deepest(settings))
    return _TIMES_TO_REST * sunk / unit.speed + settings.rest_time


def share_done(run: Run, expected: float, *, sure: bool = False) -> float:
    """How much of a run is done [1], one that may well last `expected` [s]; `sure`: it will, unless it ends sooner."""
    if run.done or isinstance(run, Drive):
        return run.fraction
    passed = max(0.0, run.time) / expected
    return min(1.0, passed) if sure else as_expected(passed)


GRAIN_STEP = 1.5e-7
"""A first guess at what a grain takes in a step on two cores [s]; 366 s of runs on 20,187 grains took that."""
FRAME = 40.0
"""What a frame costs, in steps [1]: 0.12 s among 20,187 grains."""
SPRING_DAMPER = 1.0
"""What the fit and the same runs on the law take [s]."""


def preparation_time(settings: PenetrateSettings, stages: Sequence[str] | None, gravity: float) -> float:
    """About how long a bed takes to prepare in `stages` under a gravity [m/s2], on its clock [s]; 0: it is given."""
    if settings.bed is not None:
        return 0.0
    tapped = settings.packing is not None or any("compact" in stage for stage in stages or ())
    return staged.preparation_time(settings.bed_size[2], gravity, tapped=tapped)


def step_seconds(settings: PenetrateSettings) -> float:
    """What a step of the bed takes on CPUs [s]: by earlier runs on this machine, else by `GRAIN_STEP`."""
    threads = settings.threads or len(usable_cores())
    pace = known_pace(runtime_name(arch="cpu", threads=threads), grains=settings.grain_count)
    return settings.grain_count / pace if pace else GRAIN_STEP * settings.grain_count * 2 / min(threads, 8)


def rest_stage(settings: PenetrateSettings, seed: int) -> str:
    """What the progress calls the rest of a bed in the gravity of the run."""
    return say("comes_to_rest", seed=seed, gravity=settings.gravity)


class PenetratePlan:
    """The plan of one run; `bed_is_there` and `is_over` mend it. `step` is that of the grains [s].

    `stages`, `gravity`: how a bed is prepared, and under which gravity [m/s2]; `held`: as for `expected_time`.
    """

    def __init__(
        self, settings: PenetrateSettings, units: Sequence[Unit], folder: RunFolder, progress: Progress,
        *, step: float, stiffness: float, held: float = 0.0, stages: Sequence[str] | None = None,
        gravity: float | None = None,
    ) -> None:  # fmt: skip
        self._held, self._stages, self._gravity = held, stages, gravity or settings.gravity
        self._settings, self._units, self._progress = settings, list(units), progress
        self._step, self._stiffness, self._shown = step, stiffness, shown_units(units)
        self._lasted: dict[tuple[str, float], list[float]] = {}
        left = [unit for unit in units if not folder.is_done(unit.id)]
        costs: dict[str, float] = {}
        for seed in settings.seeds:
            todo = [unit for unit in left if unit.seed == seed]
            if todo:
                costs[_bed(seed)] = self._bed_cost()
                if self._gravity != settings.gravity and settings.bed is None:
                    rest = staged.rest_time(self._gravity, grain=settings.grain)
                    costs[rest_stage(settings, seed)] = rest / step
            costs |= {unit.title: self._cost(unit) for unit in todo}
        grains = settings.grain_count
        count = settings.frame_count + 3  # with those of the deepest point and the end
        frames = {unit.id: count for unit in units if unit.id in self._shown} if settings.frame_count else {}
        report = PictureCosts(frames, grains).seconds
        unit = step_seconds(settings)
        self.seconds = unit * sum(costs.values())
        """What beds and runs are expected to take on CPUs [s]."""
        seconds = {"spring-damper": SPRING_DAMPER, "report": report}
        progress.plan(costs, seconds=seconds, unit=unit if settings.arch == "cpu" else None)

    def expected_time(self, unit: Unit) -> float:
        """About how long the run of `unit` lasts on the bed's clock [s]: as on other seeds, where it was made."""
        known = self._lasted.get(unit.condition)
        return fmean(known) if known else expected_time(self._settings, unit, self._stiffness, held=self._held)

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
        return preparation_time(self._settings, self._stages, self._gravity) / self._step

    def _cost(self, unit: Unit) -> float:
        frames = self._settings.frame_count + 3 if unit.id in self._shown and self._settings.frame_count else 0
        return self.expected_time(unit) / self._step + FRAME * frames


def _bed(seed: int) -> str:
    return f"bed of seed {seed}"
