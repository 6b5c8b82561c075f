"""The gap in units: rms by channel, when a trial first parts from the base model, and the gap by condition."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .problem import Array

__all__ = ["Gaps", "numeral", "size_words", "unit_of"]

#: channel -> (unit, factor on SI)
_UNITS: dict[str, tuple[str, float]] = {
    "x": ("mm", 1e3), "y": ("mm", 1e3), "theta": ("degrees", 180 / math.pi), "gyro": ("rad/s", 1.0),
    "ax": ("m/s2", 1.0), "ay": ("m/s2", 1.0), "wheel": ("rad/s", 1.0), "depth": ("mm", 1e3), "force": ("N", 1.0),
    "accel": ("m/s2", 1.0), "depth zero": ("mm", 1e3), "force zero": ("N", 1.0),
}  # fmt: skip
_ZEROED = ("x", "y", "theta")  # channels whose zero is fitted in each trial
_WINDOW = 9  # samples of the running mean
_SIGMAS = 5.0  # standard errors of that mean at which a trial has parted


def unit_of(channel: str) -> tuple[str, float]:
    """The unit in which a channel is told, and its size in SI units."""
    return _UNITS.get(channel, ("SI", 1.0))


def size_words(kind: str, size: float) -> str:
    """How much replicates differ by: 3.5 %, or of a channel or a zero 0.09 N."""
    unit, factor = unit_of(kind)
    return f"{100 * size:.2g} %" if unit == "SI" else f"{factor * size:.2g} {unit}"


def numeral(value: float, digits: int = 3) -> str:
    """A number in a sentence: 0.97, 153, 19,400, and powers of ten only from ten millions on."""
    if not 10**digits <= abs(value) < 1e7:
        return f"{value:.{digits}g}"
    return f"{float(f'{value:.{digits - 1}e}'):,.0f}"


class Gaps:
    """Gathered channel by channel and trial by trial."""

    def __init__(self) -> None:
        self._channels: dict[tuple[str, bool], list[float]] = {}
        self._conditions: dict[tuple[tuple[str, float], ...], tuple[set[str], list[float]]] = {}
        self._parted: list[dict[str, Any]] = []

    def add(
        self, trial: str, channel: str, time: Array, before: Array, after: Array, std: Array, std_after: Array,
        *, settings: Mapping[str, float], held_out: bool,
    ) -> None:  # fmt: skip
        """One channel of one trial: measured less modelled of both models and the noise of each, in the channel's SI
        unit; shapes [n]. A reading whose noise is endless beside a model does not count there."""
        if not len(time):
            return
        sums = self._channels.setdefault((channel, held_out), [0.0] * 4)
        trials, over = self._conditions.setdefault(tuple(sorted(settings.items())), (set(), [0.0] * 4))
        trials.add(trial)
        for at, rest, noise in ((0, before, std), (2, after, std_after)):
            counts = np.isfinite(noise)  # as in the gap: a reading at a switch of the contact says nothing
            for target, scale in ((sums, np.ones(len(noise))), (over, noise)):
                target[at] += int(counts.sum())
                target[at + 1] += float(np.sum((rest[counts] / scale[counts]) ** 2))
        if len(time) >= _WINDOW:
            standing = time < 0  # a camera's zero, fitted to the whole trial, is no parting
            zero = float(before[standing].mean()) if channel in _ZEROED and standing.sum() > 1 else 0.0
            mean = np.convolve((before - zero) / std, np.ones(_WINDOW) / _WINDOW, mode="valid") * math.sqrt(_WINDOW)
            away = np.flatnonzero((np.abs(mean) > _SIGMAS) & (time[_WINDOW // 2 :][: len(mean)] >= 0))
            if len(away):
                self._parted.append({"trial": trial, "channel": channel, "at_s": float(time[away[0] + _WINDOW // 2]),
                                     "held_out": held_out})  # fmt: skip

    @property
    def by_channel(self) -> list[dict[str, Any]]:
        """Root mean square of measured less modelled, in the channel's unit (mm, degrees)."""
        return [
            {"channel": channel, "unit": unit_of(channel)[0], "held_out": held_out, "samples": int(count),
             "rms_before": unit_of(channel)[1] * math.sqrt(before / count),
             "rms_after": unit_of(channel)[1] * math.sqrt(after / count_after)}
            for (channel, held_out), (count, before, count_after, after) in sorted(self._channels.items())
            if count and count_after
        ]  # fmt: skip

    @property
    def by_condition(self) -> list[dict[str, Any]]:
        """Chi-square per sample by the trials' settings."""
        return [
            {"settings": dict(settings), "trials": sorted(trials), "samples": int(count), "before": before / count,
             "after": after / count_after}
            for settings, (trials, (count, before, count_after, after)) in sorted(self._conditions.items())
            if count and count_after
        ]  # fmt: skip

    @property
    def parted(self) -> list[dict[str, Any]]:
        """When each channel of each trial first parts from the base model: its running mean is beyond 5 errors."""
        return sorted(self._parted, key=lambda row: (row["trial"], row["at_s"]))
