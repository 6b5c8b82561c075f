"""Where a fitted law holds: its error over depth and speed, over loads, in beds that it was not fitted to."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .data import Array, Data, PushRun
from .fit import LawFit, fit_law

__all__ = ["ErrorMap", "SinkageCheck", "Within", "error_map", "held_out", "sinkage_check", "sinkage_range", "within"]


@dataclass(frozen=True)
class ErrorMap:
    """Error of a law against the mean force over beds, in drives; shapes [speed_count, bin_count]."""

    speeds: tuple[float, ...]  # [m/s]
    depth: Array  # Mean of each interval [m], shape [bin_count]
    force: Array  # Mean over beds [N]
    error: Array  # (law - mean) / mean [1]


def error_map(fitted: LawFit) -> ErrorMap | None:
    """The map of a fit; None where no drive reaches the usual depth."""
    data, predicted = fitted.data, fitted.predicted
    driven = [number for number, run in enumerate(data.runs) if run.kind == "driven"]
    if not driven:
        return None
    bins = max(len(data.runs[number].depth) for number in driven)
    driven = [number for number in driven if len(data.runs[number].depth) == bins]
    speeds = tuple(sorted({data.runs[number].speed for number in driven}))

    def means(values: Array) -> Array:
        rows = {number: values[data.run_of_row == number] for number in driven}
        return np.array([np.mean([rows[n] for n in driven if data.runs[n].speed == speed], axis=0) for speed in speeds])

    force = means(data.force)
    return ErrorMap(speeds, means(data.depth).mean(axis=0), force, means(predicted) / force - 1)


@dataclass(frozen=True)
class Within:
    """The longest stretch of depth in which a law is within an error, at one speed."""

    speed: float  # [m/s]
    low: float  # [m]
    high: float
    at_start: float  # Error at the least and at the largest depth [1]
    at_end: float


def within(found: ErrorMap, most: float) -> list[Within]:
    """For each speed the longest stretch of depth with |error| <= `most`; none where no bin is."""
    stretches = []
    edges = np.concatenate([[0.0], 0.5 * (found.depth[1:] + found.depth[:-1]), [found.depth[-1]]])
    for speed, errors in zip(found.speeds, found.error, strict=True):
        low, high = (float(edges[place]) for place in _longest(np.abs(errors) <= most))
        stretches.append(Within(speed, low, high, float(errors[0]), float(errors[-1])))
    return stretches


def sinkage_range(fitted: LawFit, found: ErrorMap, most: float) -> tuple[float, float] | None:
    """Loads [N] between which the depth at which the law bears the load is within `most` of that of the beds.

    The depth of the beds is where the mean force of the slowest drive first reaches the load, and the law is taken at
    that speed. None where no load is.
    """
    rising = np.maximum.accumulate(found.force[0])
    deepest = float(found.depth[-1])
    loads = np.linspace(float(rising[0]), float(rising[-1]), 60)
    good = []
    for load in loads:
        bed = float(np.interp(load, rising, found.depth))
        law = fitted.candidate.depth_at(fitted.theta, float(load), found.speeds[0], deepest=10 * deepest)
        good.append(law is not None and abs(law / bed - 1) <= most)
    start, end = _longest(good)
    return (float(loads[start]), float(loads[end - 1])) if end > start else None


def _longest(good: Iterable[bool]) -> tuple[int, int]:
    """The longest stretch of true values, as a slice has it; (0, 0) of none."""
    best, start = (0, 0), None
    for k, one in enumerate([*good, False]):
        if one and start is None:
            start = k
        elif not one and start is not None:
            best, start = max(best, (start, k), key=lambda pair: pair[1] - pair[0]), None
    return best


def held_out(fitted: LawFit) -> dict[str, float | None]:
    """Rms error of the force over the rms force, of runs that the law was not fitted to [1].

    "beds": each bed by the fit to all others. "speeds": each speed by the fit to all others; None below three speeds.
    """
    data = fitted.data
    beds = [
        (data.only(lambda run, bed=bed: run.bed == bed), theta)  # type: ignore[misc]
        for bed, theta in zip(data.beds, fitted.left_out, strict=True)
    ]
    speeds = []
    if len(data.speeds) > 2:
        for speed in data.speeds:

            def other(run: PushRun, speed: float = speed) -> bool:
                return run.speed != speed

            theta = fit_law(fitted.candidate, data.only(other), jackknife=False).theta
            speeds.append((data.only(lambda run, speed=speed: run.speed == speed), theta))  # type: ignore[misc]
    return {"beds": _rms(fitted, beds), "speeds": _rms(fitted, speeds) if speeds else None}


def _rms(fitted: LawFit, parts: Sequence[tuple[Data, Array]]) -> float:
    square = drag = 0.0
    for data, theta in parts:
        force = fitted.candidate.force(theta, data.depth, data.rate, data.acceleration)
        square += float(np.sum((force - data.force) ** 2))
        drag += float(np.sum(data.force**2))
    return math.sqrt(square / drag)


@dataclass(frozen=True)
class SinkageCheck:
    """Depth at rest under a load, of the beds and of the law fitted to the other beds; nothing of it was fitted."""

    load: float  # [N]
    count: int
    beds: float  # Mean over beds [m]
    beds_std: float | None  # Scatter of the beds [m]; None of one
    law: float  # Mean of the predictions [m]
    error: float  # law / beds - 1 [1]


def sinkage_check(fitted: LawFit) -> list[SinkageCheck]:
    """The check at every load of which there are placements; a bed is predicted by the fit to the other beds."""
    data, found = fitted.data, []
    deepest = 10 * float(data.depth.max())
    without = dict(zip(data.beds, fitted.left_out, strict=True))
    for load in sorted({place.load for place in data.placements}):
        own = [place for place in data.placements if place.load == load]
        laws = [fitted.candidate.depth_at(without.get(place.bed, fitted.theta), load, deepest=deepest) for place in own]
        known = [depth for depth in laws if depth is not None]
        if len(known) < len(own):
            continue
        beds, law = np.array([place.depth for place in own]), float(np.mean(known))
        std = float(beds.std(ddof=1)) if len(own) > 1 else None
        found.append(SinkageCheck(load, len(own), float(beds.mean()), std, law, law / float(beds.mean()) - 1))
    return found
