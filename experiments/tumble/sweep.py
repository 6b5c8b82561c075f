"""`hedgebed tumble --sweep KEY=FROM:TO:STEP`: the same tumble over a range of one number, or over two.

All trials are integrated at once by the batched model (`rigid.simulate_batch`). The trial in the middle, or the one
nearest to it that can stand, is the run's own, integrated accurately; it and the corners tell how far the batch is off.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from experiments.platform.numbers import PlatformNumbers, torque_within_limit
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.types import Json
from rigid.batch.simulate import BatchTrajectory, simulate_batch
from rigid.model.trial import Trial
from rigid.planar.dynamics import System
from rigid.planar.simulate import PAPER_STEP, longest_step, simulate
from rigid.planar.statics import standing

from . import say
from .settings import TumbleSettings
from .sweep_ranges import SweepRange, parse_sweep, unit_of
from .trial import plan_tumble

__all__ = ["SWEEP_FILE", "check_sweep", "middle_of_sweep", "run_sweep"]

SWEEP_FILE = "sweep.csv"
MOST_ROWS = 24  # Rows that the terminal shows
COLUMNS = {
    "trajectory_angle": "rad",
    "max_speed": "m/s",
    "max_angular_velocity": "rad/s",
    "transition_angle_slip": "rad",
    "transition_angle_hop": "rad",
}
"""Of each trial, by the names of a tumble's quantities."""
GAPS = ("trajectory_angle", "max_speed", "max_angular_velocity")  # What is compared with the accurate integrator
WHEEL_SAMPLES = 128
"""Moments of a trial among which the one at which its wheel is at its limit is sought, over and over more closely."""
SUFFIXES = {"1": "", "9.80665 m/s2": "_g"}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Point:
    """One trial of a sweep."""

    values: tuple[float, ...]
    trial: Trial  # as planned: its torque does not yet end where the wheel is at its limit
    max_wheel_speed: float  # [rad/s]


def middle_of_sweep(
    settings: TumbleSettings, *, model_file: Path | None = None, platform: PlatformNumbers | None = None
) -> TumbleSettings:
    """The settings of the trial in the middle that can stand, or nearest to it; `settings` themselves without a sweep.

    `model_file` stands in for ``settings.model``, where that was copied, `platform` for ``settings.platform``, where
    that was read. Raises ValueError where no trial can stand.
    """
    ranges = parse_sweep(settings.sweep)
    if not ranges:
        return settings
    points = _plan(settings, model_file=model_file, platform=platform)
    return _at(settings, ranges, points[_shown(ranges, points)].values)


def check_sweep(settings: TumbleSettings) -> None:
    """Raise ValueError, naming the point, where a trial of the sweep cannot be. Without a sweep there is none."""
    if not settings.sweep:
        return
    if settings.method != "located":
        raise ValueError(f"method = {settings.method!r} with a sweep, which the batched model does: 'located' would do")
    _plan(settings)


def run_sweep(
    settings: TumbleSettings,
    folder: RunFolder,
    *,
    model_file: Path | None = None,
    platform: PlatformNumbers | None = None,
) -> Json:
    """Integrate the sweep, write sweep.csv and return what result.json says of it.

    `model_file` and `platform` as `middle_of_sweep` takes them.
    """
    ranges = parse_sweep(settings.sweep)
    points = _plan(settings, model_file=model_file, platform=platform)
    corners = _corners(ranges)
    time_step = min(PAPER_STEP, *(0.999 * longest_step(points[place].trial) for place in corners))
    batch = _batch(points, duration=settings.duration, time_step=time_step)
    shown = _shown(ranges, points)
    found: dict[str, Array] = {
        "trajectory_angle": batch.trajectory_angle,
        "max_speed": batch.max_speed,
        "max_angular_velocity": batch.max_angular_velocity,
        "transition_angle_slip": batch.transition_angles["slip"],
        "transition_angle_hop": batch.transition_angles["hop"],
    }
    keys = {
        _column(each.key, unit_of(each.key)): np.array([point.values[k] for point in points])
        for k, each in enumerate(ranges)
    }
    write_series(folder.path / SWEEP_FILE, keys | {_column(name, COLUMNS[name]): found[name] for name in found})
    fallen = int((~batch.stands).sum())
    gaps = _gaps(settings.duration, points, found, [*corners, shown])
    return {
        "sweep": {
            "file": SWEEP_FILE,
            "keys": [
                {"key": each.key, "unit": unit_of(each.key), "column": column, "values": list(each.values)}
                for each, column in zip(ranges, keys, strict=True)
            ],
            "trials": len(points),
            "cannot_stand": fallen,
            "time_step": time_step,
            "gaps": gaps,
            "sentences": _sentences(settings, ranges, points, shown, fallen, gaps),
        },
        "tables": [_table(ranges, points, found)],
    }


def _plan(
    settings: TumbleSettings, *, model_file: Path | None = None, platform: PlatformNumbers | None = None
) -> list[_Point]:
    """Every trial, the last key running fastest."""
    ranges = parse_sweep(settings.sweep)
    points = []
    for values in itertools.product(*(each.values for each in ranges)):
        try:
            plan = plan_tumble(_at(settings, ranges, values), model_file=model_file, platform=platform)
        except ValueError as error:
            where = ", ".join(f"{each.key} = {value:g}" for each, value in zip(ranges, values, strict=True))
            raise ValueError(f"sweep: at {where}: {_plain(error)}") from None
        points.append(_Point(values, plan.trial, plan.max_wheel_speed))
    return points


def _batch(points: Sequence[_Point], *, duration: float, time_step: float) -> BatchTrajectory:
    """All trials by the batched model, a motor's torque ended where its wheel comes to its limit.

    The wheel of a motor only gains speed, so that the limit says nothing of those that end below it; of the others the
    moment is sought by the batch too, until it is known within a step, between two of which the gain is even.
    """
    trials = [point.trial for point in points]
    batch = simulate_batch(trials, duration=duration, time_step=time_step)
    limit = np.array([point.max_wheel_speed for point in points])
    beyond = np.flatnonzero(batch.final["wheel_speed"] > limit)
    if not len(beyond) or trials[0].actuator != "motor":
        return batch
    limit = limit[beyond, None]
    low, high = np.zeros(len(beyond)), np.full(len(beyond), duration)
    while True:
        times = np.clip(np.linspace(low, high, WHEEL_SAMPLES, axis=1), 0.0, duration)
        fast = simulate_batch([trials[k] for k in beyond], duration=duration, time_step=time_step, times=times)
        speed, rows = fast.channel("wheel_speed"), np.arange(len(beyond))
        after = np.clip(np.argmax(speed > limit, axis=1), 1, None)
        low, high = times[rows, after - 1], times[rows, after]
        if np.max(high - low) <= time_step:
            break
    slow, quick = speed[rows, after - 1], speed[rows, after]
    ends = low + (high - low) * np.clip((limit[:, 0] - slow) / (quick - slow), 0.0, 1.0)
    for k, end in zip(beyond, ends, strict=True):
        trials[k] = replace(trials[k], torque_until=float(end))
    return simulate_batch(trials, duration=duration, time_step=time_step)


def _plain(error: ValueError) -> str:
    """What was wrong: of pydantic's own errors the sentence alone."""
    if not isinstance(error, ValidationError):
        return str(error)
    return "; ".join(str(detail["msg"]).removeprefix("Value error, ") for detail in error.errors())


def _at(settings: TumbleSettings, ranges: Sequence[SweepRange], values: Sequence[float]) -> TumbleSettings:
    """The settings of one trial."""
    changed: Json = settings.model_dump(exclude_unset=True) | {"sweep": ()}  # what was not given stays so
    for each, value in zip(ranges, values, strict=True):
        if each.is_effect:
            changed["effects"] = (*changed.get("effects", ()), f"{each.key}={value!r}")
        else:
            changed[each.key] = value
    return TumbleSettings(**changed)


def _corners(ranges: Sequence[SweepRange]) -> list[int]:
    """Numbers of the trials at the ends of every range."""
    counts = [len(each.values) for each in ranges]
    ends = itertools.product(*({0, count - 1} for count in counts))
    return sorted(int(np.ravel_multi_index(end, counts)) for end in ends)


def _middle(ranges: Sequence[SweepRange]) -> int:
    counts = [len(each.values) for each in ranges]
    return int(np.ravel_multi_index([(count - 1) // 2 for count in counts], counts))


def _shown(ranges: Sequence[SweepRange], points: Sequence[_Point]) -> int:
    """The number of the trial that can stand in the middle, or, in steps of the ranges, nearest to it."""
    counts = [len(each.values) for each in ranges]
    steps = np.stack(np.unravel_index(np.arange(len(points)), counts), axis=1)
    far = np.sum((steps - steps[_middle(ranges)]) ** 2, axis=1)
    why: ValueError | None = None
    for place in np.argsort(far, kind="stable"):
        try:
            standing(System(points[place].trial))
        except ValueError as error:
            why = why or error
        else:
            return int(place)
    raise ValueError(f"sweep: none of its {len(points)} trials can stand; in the middle {why}")


def _gaps(duration: float, points: Sequence[_Point], found: dict[str, Array], places: Sequence[int]) -> Json:
    """Largest differences from the accurate integrator over the trials `places` that stand by both.

    `angles` counts those of them with a trajectory angle by both.
    `stand_by_one_only` and `away_by_one_only` count those that stand, or get 10 mm away, by one of the two alone.
    """
    most: dict[str, float] = dict.fromkeys(GAPS, 0.0)
    checked = angles = standing_apart = away_apart = 0
    for place in dict.fromkeys(places):
        point, stands = points[place], not math.isnan(found["max_speed"][place])
        try:
            standing(System(point.trial))
        except ValueError:
            standing_apart += stands
            continue
        if not stands:
            standing_apart += 1
            continue
        trial, _ = torque_within_limit(point.trial, max_wheel_speed=point.max_wheel_speed, duration=duration)
        run = simulate(trial, duration=duration, sample_interval=min(1e-2, duration))
        checked += 1
        away_apart += (run.trajectory_angle is None) != math.isnan(found["trajectory_angle"][place])
        for name in GAPS:
            accurate, ours = getattr(run, name), float(found[name][place])
            if accurate is not None and not math.isnan(ours):
                most[name] = max(most[name], abs(accurate - ours))
                angles += name == "trajectory_angle"
    counts = {"stand_by_one_only": standing_apart, "away_by_one_only": away_apart}
    return {"checked": checked, "angles": angles} | counts | most


def _column(name: str, unit: str) -> str:
    suffix = SUFFIXES.get(unit, "_" + unit.replace(" ", "_").replace("/", "_"))
    return f"{name}{suffix}"


def _table(ranges: Sequence[SweepRange], points: Sequence[_Point], found: dict[str, Array]) -> Json:
    """The trials as the terminal shows them, thinned out evenly where they are many."""
    shown = list(range(len(points)))
    if len(points) > MOST_ROWS:
        shown = sorted({round(k) for k in np.linspace(0, len(points) - 1, MOST_ROWS)})
    units = [unit_of(each.key) for each in ranges]
    head = [each.key + ("" if unit == "1" else f" [{unit}]") for each, unit in zip(ranges, units, strict=True)]
    head += ["angle [degrees]", "speed [m/s]", "turning [rad/s]", "slips from", "hops from"]
    rows = []
    for place in shown:
        angle, slip, hop = (
            _degrees(float(found[name][place]))
            for name in ("trajectory_angle", "transition_angle_slip", "transition_angle_hop")
        )
        speed, turning = (_number(float(found[name][place])) for name in ("max_speed", "max_angular_velocity"))
        rows.append([*(f"{value:g}" for value in points[place].values), angle, speed, turning, slip, hop])
    some = f", {len(rows)} of {len(points)} trials" if len(rows) < len(points) else ""
    return {"title": f"The sweep{some}", "head": head, "rows": rows}


def _sentences(
    settings: TumbleSettings,
    ranges: Sequence[SweepRange],
    points: Sequence[_Point],
    shown: int,
    fallen: int,
    gaps: Json,
) -> list[str]:
    where = ", ".join(f"{each.key} = {value:g}" for each, value in zip(ranges, points[shown].values, strict=True))
    which = "in the middle" if shown == _middle(ranges) else "nearest the middle that can stand"
    said = [say("which_trial", which=which, where=where, count=len(points), file=SWEEP_FILE)]
    if gaps["checked"]:
        angle = say("angle_gap", angle=math.degrees(gaps["trajectory_angle"])) if gaps["angles"] else ""
        said.append(say("batch_gap", angle=angle, gaps=gaps))
    for key, one, more, away in (
        ("stand_by_one_only", "stands", "stand", ""), ("away_by_one_only", "gets", "get", " 10 mm away"),
    ):  # fmt: skip
        if gaps[key]:
            said.append(say("by_one_only", count=gaps[key], what=(one if gaps[key] == 1 else more) + away))
    keys = {each.key for each in ranges}
    if "mu_s" in keys and settings.mu_d is None and "mu_d" not in keys:
        said.append("mu_d is half of mu_s throughout.")
    if fallen:
        said.append(say("cannot_stand", count=fallen))
    return said


def _degrees(angle: float) -> str:
    return "-" if math.isnan(angle) else f"{math.degrees(angle):.1f}"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.4g}"
