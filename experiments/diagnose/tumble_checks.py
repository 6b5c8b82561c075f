"""Data that are wrong: found, said, and set aside before anything is fitted.

Looked at without a model: the camera's marker that jumps for a while (a row far from the straight line through its
neighbours), a clock that jumps forward, long gaps. What needs the model (a trial at odds with its replicates) is the
statistics' affair.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .problem import Finding
from .tumble_data import CHANNELS, TrialData, TumbleData

__all__ = ["checked"]

_FAR = 12.0  # stds of the sensor: white noise does not get there
_SHARE = 0.1  # of a channel's rows; more of them are no outliers


def checked(data: TumbleData) -> tuple[TumbleData, list[Finding]]:
    """The data without rows that cannot be, and what was found."""
    findings: list[Finding] = []
    trials = []
    for trial in data.trials:
        keep = np.ones(len(trial.time), dtype=bool)
        for number, name in enumerate(CHANNELS):
            mine = np.flatnonzero(trial.channel == number)
            if len(mine) < 8:
                continue
            _gaps(trial, name, mine, findings)
            if name in ("x", "y", "theta"):
                _jumps(trial, name, mine, keep, findings)
        lost = {name: trial.time[trial.of(name) & ~keep] for name in ("x", "y", "theta")}
        together = np.unique(np.concatenate(list(lost.values())))
        if len(together):  # a marker that is lost for one is lost for all three
            camera = trial.of("x") | trial.of("y") | trial.of("theta")
            keep &= ~(camera & np.isin(trial.time, together))
        kept = {field: getattr(trial, field)[keep] for field in ("time", "value", "std", "channel")}
        trials.append(trial if keep.all() else replace(trial, **kept))
    return replace(data, trials=tuple(trials)), findings


def _jumps(
    trial: TrialData, name: str, mine: NDArray[np.intp], keep: NDArray[np.bool_], findings: list[Finding]
) -> None:
    """Single rows, or two side by side, that lie far off the line through the rows about them."""
    time, value, std = trial.time[mine], trial.value[mine], trial.std[mine[0]]
    odd = np.zeros(len(mine), dtype=bool)
    for k in range(len(mine)):
        near = [j for j in (k - 4, k - 3, k - 2, k + 2, k + 3, k + 4) if 0 <= j < len(mine)]
        if len(near) < 4:
            continue
        t = time[near] - time[k]
        # Two straight lines, before and behind: a contact bends a motion, a jump leaves both at once.
        off = []
        for side in (t < 0, t > 0):
            if side.sum() >= 2:
                line = np.polyfit(t[side], value[near][side], 1)
                off.append(abs(value[k] - line[1]))
        bend = np.ptp(value[near]) if off else 0.0
        odd[k] = bool(off) and min(off) > _FAR * 2 * std and min(off) > 0.5 * bend
    if not odd.any() or odd.mean() > _SHARE:
        return
    keep[mine[odd]] = False
    when = time[odd]
    findings.append(
        Finding(
            trial=trial.id,
            channel=name,
            from_s=float(when[0]),
            to_s=float(when[-1]),
            set_aside=True,
            what=f"{int(odd.sum())} row(s) of {name} lie far from the rows about them (the camera lost its marker): "
            f"set aside",
        )
    )


def _gaps(trial: TrialData, name: str, mine: NDArray[np.intp], findings: list[Finding]) -> None:
    """Stretches without rows."""
    time = trial.time[mine]
    steps = np.diff(time)
    usual = float(np.median(steps))
    for k in np.flatnonzero(steps > max(10 * usual, 0.02)):
        findings.append(
            Finding(
                trial=trial.id,
                channel=name,
                from_s=float(time[k]),
                to_s=float(time[k + 1]),
                what=f"{name} has no valid row for {steps[k]:.3g} s, where one every {usual:.3g} s is usual: kept as a "
                f"gap (a clock that jumped forward looks the same)",
            )
        )
