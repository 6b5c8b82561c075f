"""The pieces of a penetration experiment: one run of one spike in one bed, made alike on any ground.

A piece is finished or it is not; what is finished is never computed again.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from coupling import Drive, Drop, Run, SetDown
from experiments.runs.progress import as_expected
from experiments.runs.types import Json
from rigid import Spike

from .settings import PenetrateSettings

__all__ = ["Unit", "deepest", "expected_time", "make_run", "make_spike", "plan_units", "share_done", "shown_units"]

_SOFTER = 0.41
"""K as fitted to the shipped case's runs over that of a flat plate in 3D-RFT: 38 of 92 N/m [1]."""
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
    """All runs, seed by seed: everything on the first seed, what the settings say on the others."""
    units = []
    for index, seed in enumerate(settings.seeds):
        speeds = settings.speeds if index == 0 else settings.other_speeds
        drops = settings.drop_speeds if index == 0 else settings.other_drop_speeds
        units += [Unit(seed, "driven", speed) for speed in speeds]
        units += [Unit(seed, "drop", speed) for speed in drops]
        units.append(Unit(seed, "set_down", settings.lowering_speed))
    return units


def shown_units(units: Sequence[Unit]) -> set[str]:
    """Ids of the runs of which frames are kept: of the first seed the slowest drive, the fastest drop, the set-down."""
    first = [unit for unit in units if unit.seed == units[0].seed]
    driven = sorted((unit for unit in first if unit.kind == "driven"), key=lambda unit: unit.speed)
    drops = sorted((unit for unit in first if unit.kind == "drop"), key=lambda unit: unit.speed)
    set_down = [unit for unit in first if unit.kind == "set_down"]
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
    return SetDown(spike, ground, lowering_speed=unit.speed, max_time=_set_down_time(settings, unit), **common)


def deepest(settings: PenetrateSettings) -> float:
    """Where a drop is stopped, one tip's diameter above the floor [m]."""
    return settings.bed_size[2] - settings.tip_diameter


def expected_time(settings: PenetrateSettings, unit: Unit, stiffness: float) -> float:
    """About how long a run lasts on the bed's clock [s], `stiffness` [N/m] being a flat plate's in 3D-RFT.

    A drop: down to the first stop of m z'' = W - K z with the speed v, at w t = pi - atan(v K / (W w)), w^2 = K / m,
    and what it is followed for after that. A set-down is of first order, with the hand's c / K = W / (lowering_speed K)
    for its time constant.
    """
    own = _SOFTER * stiffness
    if unit.kind == "driven":
        return settings.depth / unit.speed + settings.hold + settings.depth / settings.retreat_speed
    if unit.kind == "drop":
        rate = math.sqrt(own / settings.mass)
        stop = (math.pi - math.atan(unit.speed * own / (settings.weight * rate))) / rate
        return min(settings.drop_time, stop + settings.after_stop)
    return _TIMES_TO_REST * settings.weight / own / unit.speed + settings.rest_time


def share_done(run: Run, expected: float, *, sure: bool = False) -> float:
    """How much of a run is done [1], one that may well last `expected` [s]; `sure`: it will, unless it ends sooner."""
    if run.done or isinstance(run, Drive):
        return run.fraction
    passed = max(0.0, run.time) / expected
    return min(1.0, passed) if sure else as_expected(passed)


def _set_down_time(settings: PenetrateSettings, unit: Unit) -> float:
    """When a set-down gives up [s]: thrice the time in which it would sink to where drops are stopped."""
    return 3 * deepest(settings) / unit.speed + 10 * settings.rest_time
