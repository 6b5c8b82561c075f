"""Single readings of gyro, accelerometers and wheel that neither their neighbours nor other trials share.

A touch of the ground is no such reading: a tip stays on its spring for half a period at least (80 ms for 10 kg on
1.5e4 N/m), and what it does to speed and rotation stays. A reading counts as one only where its eight neighbours lie on
a parabola as closely as the sensor's noise lets them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.problem import Finding

from .data import CHANNELS, TrialData

__all__ = ["aside", "spikes"]

_NAMES = ("gyro", "ax", "ay", "wheel")
_FAR = 12.0  # stds of the sensor: white noise does not get there
_BESIDE = 6.0  # times the neighbours' own distance from their parabola
_QUIET = 3.0  # stds of the sensor that this distance may be
_SAME = 0.5  # of a spike's size at which a replicate has it too
_NEAR = 2  # rows within which it counts as the same moment
_SHARE = 0.02  # of a channel's rows; more of them are no single readings
_SLOWEST = 0.012  # s between readings of a force: it is read often while a tip stays on the ground
_SETS_IN = 0.05  # s after which what the torque does in setting in or ending is over
_OFFSETS = np.array([-4, -3, -2, -1, 1, 2, 3, 4])
_PARABOLA = np.linalg.pinv(np.vander(_OFFSETS, 3, increasing=True))


def spikes(trials: Sequence[TrialData]) -> tuple[dict[str, NDArray[np.intp]], list[Finding]]:
    """Rows of each trial that stand alone (trial -> rows), and what is reported of them."""
    rows_alone: dict[str, NDArray[np.intp]] = {}
    findings: list[Finding] = []
    apart = {(trial.id, name): _apart(trial, name) for trial in trials for name in _NAMES}
    for trial in trials:
        gone = []
        for name in _NAMES:
            rows, off = apart[trial.id, name]
            like = [other for other in trials if other is not trial and other.condition == trial.condition]
            far = np.abs(off) > _FAR
            alone = [k for k in np.flatnonzero(far) if not any(_shared(trial, other, name, rows[k], off[k], apart)
                                                               for other in like)]  # fmt: skip
            if not alone or len(alone) > max(1.0, _SHARE * len(rows)):
                continue
            gone.append(rows[alone])
            when = trial.time[rows[alone]]
            size = float(np.abs(off[alone]).max())
            what = f"{len(alone)} single reading(s) of {name} at {', '.join(f'{t:.3f}' for t in when[:4])}"
            what += f"{' ...' if len(when) > 4 else ''} s lie up to {size:.0f} std from their neighbours, which agree: "
            findings.append(aside(trial, name, when, what + "set aside"))
        if gone:
            rows_alone[trial.id] = np.concatenate(gone)
    return rows_alone, findings


def aside(trial: TrialData, channel: str, times: NDArray[np.float64], what: str) -> Finding:
    """That readings of a channel, at `times` [s], are set aside."""
    return Finding(trial=trial.id, channel=channel, from_s=float(times[0]), to_s=float(times[-1]), what=what,
                   set_aside=True)  # fmt: skip


def _apart(trial: TrialData, name: str) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Rows of a channel, and by how many std each is off its neighbours' parabola; 0 where these do not lie on one."""
    rows = np.flatnonzero(trial.channel == CHANNELS.index(name))
    off = np.zeros(len(rows))
    if len(rows) < 3 * len(_OFFSETS):
        return rows, off
    time, value, std = trial.time[rows], trial.value[rows], float(trial.std[rows[0]])
    inner = np.arange(4, len(rows) - 4)
    beside = value[inner[:, None] + _OFFSETS]
    law = beside @ _PARABOLA.T
    left = beside - law @ np.vander(_OFFSETS, 3, increasing=True).T
    scatter = np.sqrt((left**2).sum(axis=1) / (len(_OFFSETS) - 3))
    usual = float(np.median(np.diff(time)))
    if name in ("ax", "ay") and usual > _SLOWEST:
        return rows, off
    even = time[inner + 4] - time[inner - 4] < 12 * usual
    for moment in (0.0, trial.torque_until):
        even &= np.abs(time[inner] - moment) > _SETS_IN
    here = value[inner] - law[:, 0]
    sure = even & (scatter < _QUIET * std) & (np.abs(here) > _BESIDE * scatter)
    off[inner[sure]] = here[sure] / std
    return rows, off


def _shared(
    trial: TrialData, other: TrialData, name: str, row: np.intp, size: float,
    apart: dict[tuple[str, str], tuple[NDArray[np.intp], NDArray[np.float64]]],
) -> bool:  # fmt: skip
    """Whether a replicate has the same at the same moment."""
    rows, off = apart[other.id, name]
    if not len(rows):
        return False
    near = np.searchsorted(other.time[rows], trial.time[row])
    around = off[max(0, int(near) - _NEAR) : int(near) + _NEAR + 1]
    return bool((around * np.sign(size) > _SAME * abs(size)).any())
