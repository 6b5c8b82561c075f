"""Tables of the gap: by phase and channel, by channel in its unit, by condition; when trials leave the base model."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.gaps import unit_of
from experiments.diagnose.fit.problem import Array

__all__ = ["Gaps"]

Row = dict[str, Any]

_ZEROED = ("x", "y", "theta")  # channels whose zero is fitted in each trial
_WINDOW = 9  # samples of the running mean
_SURE = 3.0  # standard errors of a mean square of noise beyond which it is more than noise
_SIGMAS = 5.0  # standard errors of that mean at which a trial leaves the base model


class Gaps:
    """Sums over samples, gathered channel by channel and trial by trial; count and sum of squares of both models."""

    def __init__(self) -> None:
        self._phases: dict[tuple[str, str, bool], list[float]] = {}
        self._channels: dict[tuple[str, bool], list[float]] = {}
        self._noises: dict[tuple[str, bool], list[float]] = {}  # sums of variances beside either model
        self._beyond: dict[str, list[float]] = {}  # of the best model: readings, sums of squares and variances
        self._conditions: dict[tuple[tuple[str, float], ...], list[float]] = {}
        self._trials: dict[tuple[tuple[str, float], ...], set[str]] = {}
        self._parted: list[Row] = []

    def add(
        self, trial: str, channel: str, time: Array, before: Array, after: Array, std: Array, std_after: Array,
        *, phases: NDArray[np.str_], settings: Mapping[str, float], held_out: bool,
    ) -> None:  # fmt: skip
        """One channel of one trial: measured less modelled of both models and the noise of each, in the channel's SI
        unit; shapes [n]. A reading whose noise is infinite beside a model, as while a contact switches, does not count
        there."""
        condition, zeros = _condition(settings), [0.0] * 4
        sums = self._channels.setdefault((channel, held_out), zeros.copy())
        noises = self._noises.setdefault((channel, held_out), [0.0] * 2)
        over = self._conditions.setdefault(condition, zeros.copy())
        self._trials.setdefault(condition, set()).add(trial)
        own = {phase: phases == phase for phase in dict.fromkeys(phases.tolist())}
        for at, rest, noise in ((0, before, std), (2, after, std_after)):
            counts = np.isfinite(noise)
            noises[at // 2] += float(np.sum(noise[counts] ** 2))
            for target, values in ((sums, rest[counts]), (over, rest[counts] / noise[counts])):
                target[at] += len(values)
                target[at + 1] += float(np.sum(values**2))
            if at:
                beyond = self._beyond.setdefault(channel, [0.0] * 3)
                for place, part in enumerate((counts, rest[counts] ** 2, noise[counts] ** 2)):
                    beyond[place] += float(np.sum(part))
            valid = np.where(np.isinf(noise), np.nan, rest / noise)
            for phase, rows in own.items():
                cell = self._phases.setdefault((str(phase), channel, held_out), zeros.copy())
                counted = valid[rows][~np.isnan(valid[rows])]
                cell[at] += len(counted)
                cell[at + 1] += float(counted @ counted)
        if len(time) >= _WINDOW:
            standing = time < 0  # a camera's zero, fitted to the whole trial, does not count
            zero = float(before[standing].mean()) if channel in _ZEROED and standing.sum() > 1 else 0.0
            mean = np.convolve((before - zero) / std, np.ones(_WINDOW) / _WINDOW, mode="valid") * math.sqrt(_WINDOW)
            away = np.flatnonzero((np.abs(mean) > _SIGMAS) & (time[_WINDOW // 2 :][: len(mean)] >= 0))
            if len(away):
                self._parted.append({"trial": trial, "channel": channel, "at_s": float(time[away[0] + _WINDOW // 2]),
                                     "held_out": held_out})  # fmt: skip

    @property
    def by_phase(self) -> list[Row]:
        """Chi-square per sample by phase and channel, without cells in which no reading counts."""
        return [
            {"phase": phase, "channel": channel, "held_out": held_out} | cell
            for (phase, channel, held_out), sums in sorted(self._phases.items()) if (cell := _cell(sums))
        ]  # fmt: skip

    @property
    def by_channel(self) -> list[Row]:
        """Root mean square of measured less modelled, and of the noise as the gap takes it beside that model, in the
        channel's unit (mm, degrees)."""
        rows = []
        for (channel, held_out), sums in sorted(self._channels.items()):
            if cell := _cell(sums):
                unit, factor = unit_of(channel)
                row: Row = {"channel": channel, "unit": unit, "held_out": held_out, "samples": cell["samples"]}
                for at, stage in enumerate(("before", "after")):
                    noise = self._noises[channel, held_out][at] / sums[2 * at]
                    row |= {
                        f"rms_{stage}": factor * math.sqrt(cell[stage]),
                        f"noise_{stage}": factor * math.sqrt(noise),
                    }
                rows.append(row)
        return rows

    @property
    def residue(self) -> list[Row]:
        """What the best model leaves beyond the noise: root mean square in the channel's unit (mm, degrees, N). Only
        channels are listed in which it exceeds 3 standard errors of the noise's own mean square."""
        found = []
        for channel, (count, squares, variances) in sorted(self._beyond.items()):
            beyond = (squares - variances) / max(count, 1.0)
            if beyond > _SURE * math.sqrt(2 / max(count, 1.0)) * variances / max(count, 1.0):
                unit, factor = unit_of(channel)
                found.append({"channel": channel, "unit": unit, "rms": factor * math.sqrt(beyond)})
        return found

    @property
    def by_condition(self) -> list[Row]:
        """Chi-square per sample by the trials' settings."""
        return [
            {"settings": dict(settings), "trials": sorted(self._trials[settings])} | cell
            for settings, sums in sorted(self._conditions.items()) if (cell := _cell(sums))
        ]  # fmt: skip

    @property
    def parted(self) -> list[Row]:
        """When each channel of each trial first leaves the base model: its running mean is beyond 5 errors."""
        return sorted(self._parted, key=lambda row: (row["trial"], row["at_s"]))


def _condition(settings: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Settings by name, the speed of a push to three digits: where none is stated it is measured, and never the same
    twice."""
    shown = {name: float(f"{value:.3g}") if name == "speed_m_s" else value for name, value in settings.items()}
    return tuple(sorted(shown.items()))


def _cell(sums: list[float]) -> Row:
    """Samples, and the mean squares before and after; empty where no reading counts."""
    count, before, count_after, after = sums
    if not (count and count_after):
        return {}
    return {"samples": int(count), "before": before / count, "after": after / count_after}
