"""Data that are wrong: found, reported, and set aside before anything is fitted.

Checked without a model: a camera marker that jumps for a while or permanently (a step that no motion makes), a clock
that jumps forward, long gaps. Faults that only a model shows, such as a trial that disagrees with its replicates, are
found by the statistics.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from experiments.check.tumbles import find_lag, pieces
from experiments.diagnose.fit.problem import Finding
from experiments.diagnose.noise.stuck import clipped, clipped_wheel, stuck_rows, unsigned_rows

from .data import CHANNELS, TrialData, TumbleData

__all__ = ["checked", "spikes"]

_FAR = 12.0  # stds of the sensor: white noise does not get there
_SHARE = 0.5  # of a channel's rows; more of them are not set aside
_NEAR = 8  # rows on either side that show how much a row usually changes
_STEEP = 6.0  # times the usual change
_AROUND = 8  # rows at least, on either side of a gap, from which a slope is taken
_SPAN = 0.08  # s that they cover
_SURE = 25.0  # squared standard deviations by which a clock that is right must be off
_SENSORS = {"the camera": ("theta", "x", "y"), "the IMU": ("gyro",), "the wheel": ("wheel",)}  # what is smooth
_ALL = {"the camera": ("theta", "x", "y"), "the IMU": ("gyro", "ax", "ay"), "the wheel": ("wheel",)}
_END = 0.1  # s by which a channel must be shorter than the others to be reported
_MOVED = 0.02  # s by which a clock must have jumped to be distinguished from the motion on either side
_OFTEN = 4  # times that a marker may be lost before nothing is set aside where half of the rows would be
_INERTIAL = ("gyro", "ax", "ay", "wheel")  # channels that are searched for single readings
_BESIDE = 6.0  # times the neighbours' own distance from their parabola
_QUIET = 3.0  # stds of the sensor that this distance may be
_SAME = 0.5  # of a spike's size at which a replicate has it too
_MOMENT = 2  # rows within which it counts as the same moment
_FEW = 0.02  # of a channel's rows; more of them are no single readings
_SLOWEST = 0.012  # s between readings of a force: it is read often while a tip stays on the ground
_SETS_IN = 0.05  # s after which what the torque does in setting in or ending is over
_OFFSETS = np.array([-4, -3, -2, -1, 1, 2, 3, 4])
_PARABOLA = np.linalg.pinv(np.vander(_OFFSETS, 3, increasing=True))


def checked(data: TumbleData) -> tuple[TumbleData, list[Finding]]:
    """The data without rows that cannot be, and what was found."""
    findings: list[Finding] = []
    trials = []
    alone, found = spikes(data.trials)
    findings += found
    for trial in data.trials:
        keep = np.ones(len(trial.time), dtype=bool)
        keep[alone.get(trial.id, [])] = False
        _clocks(trial, keep, findings)
        for number, name in enumerate(CHANNELS):
            mine = np.flatnonzero((trial.channel == number) & keep)
            if len(mine) < 8:
                continue
            _gaps(trial, name, mine, findings)
            _ends(trial, name, keep, findings)
            values = trial.value[mine]
            for end in clipped(values) if name != "wheel" else clipped_wheel(values, float(trial.std[mine[0]])):
                keep[mine[end.rows]] = False
                what = f"{len(end.rows)} readings of {name} {end.words}"
                findings.append(aside(trial, name, trial.time[mine[end.rows]], what))
            mine = mine[keep[mine]]
            if len(mine) < 8:
                continue
            stuck = stuck_rows(trial.value[mine]) if name != "wheel" else mine[:0]  # in a hop it turns evenly
            if len(stuck):
                keep[mine[stuck]] = False
                what = f"{len(stuck)} rows of {name} repeat the one before where it never does otherwise: the sensor "
                what += "is stuck, they are set aside"
                findings.append(aside(trial, name, trial.time[mine[stuck]], what))
                mine = np.delete(mine, stuck)
            if name in ("x", "y", "theta"):
                _jumps(trial, name, mine, keep, findings)
        camera = trial.of("x") | trial.of("y") | trial.of("theta")  # a marker lost for one is lost for all three
        keep &= ~(camera & np.isin(trial.time, trial.time[camera & ~keep]))
        trials.append(trial if keep.all() else _only(trial, keep))
    kept, found = _unsigned(trials)
    return replace(data, trials=kept), findings + found


def _unsigned(trials: Sequence[TrialData]) -> tuple[tuple[TrialData, ...], list[Finding]]:
    """Without readings of a wheel near rest, where its sensor gives no sign."""
    wheels = [np.flatnonzero(trial.of("wheel")) for trial in trials]
    std = next((float(t.std[mine[0]]) for t, mine in zip(trials, wheels, strict=True) if len(mine)), 1.0)
    rows = unsigned_rows([trial.value[mine] for trial, mine in zip(trials, wheels, strict=True)], std)
    kept, findings = [], []
    for trial, mine, gone in zip(trials, wheels, rows, strict=True):
        keep = np.ones(len(trial.time), dtype=bool)
        keep[mine[gone]] = False
        kept.append(trial if keep.all() else _only(trial, keep))
        if len(gone):
            what = (
                "the wheel's sensor gives no sign, so that at rest it reads the size of its noise: set aside near zero"
            )
            findings.append(aside(trial, "wheel", trial.time[mine[gone]], what))
    return tuple(kept), findings


def _only(trial: TrialData, keep: NDArray[np.bool_]) -> TrialData:
    """The trial with these samples only."""
    return replace(trial, **{field: getattr(trial, field)[keep] for field in ("time", "value", "std", "channel")})


def _jumps(
    trial: TrialData, name: str, mine: NDArray[np.intp], keep: NDArray[np.bool_], findings: list[Finding]
) -> None:
    """Rows between two opposite steps that no motion makes, and the shorter side of a step that is never taken back."""
    time, value, std = trial.time[mine], trial.value[mine], trial.std[mine[0]]
    steps_in_time = np.diff(time)
    lost = np.maximum(steps_in_time / max(float(np.median(steps_in_time)), 1e-12), 1.0)
    change = np.diff(value) / lost  # where rows are missing the motion has gone on
    size = np.abs(change)
    usual = median_filter(size, size=2 * _NEAR + 1, mode="nearest")
    steps = np.flatnonzero(size > _FAR * np.sqrt(2) * std + _STEEP * usual)
    odd = np.zeros(len(mine), dtype=bool)
    k = times = 0
    while k < len(steps):
        here = steps[k]
        back = next((e for e in steps[k + 1 :] if abs(change[e] + change[here]) < 0.5 * size[here]), None)
        times += 1
        if back is None:
            after = time > time[here]
            odd |= after if after.mean() <= 0.5 else ~after
            k += 1
        else:
            odd[here + 1 : back + 1] = True
            k = int(np.searchsorted(steps, back)) + 1
    if not odd.any():
        return
    if odd.mean() > _SHARE and times > _OFTEN:
        what = f"{name} jumps so often that {100 * odd.mean():.0f} % of its rows would be lost: kept"
        findings.append(Finding(trial=trial.id, channel=name, what=what))
        return
    keep[mine[odd]] = False
    what = f"{int(odd.sum())} row(s) of {name} stand apart by a jump that no motion makes (the camera lost its "
    findings.append(aside(trial, name, time[odd], what + "marker): set aside"))


def _clocks(trial: TrialData, keep: NDArray[np.bool_], findings: list[Finding]) -> None:
    """All rows of a sensor from the moment on at which its clock jumps forward while the motion does not.

    On either side of a gap a straight line is fitted to each of the sensor's channels that are smooth. A clock that is
    right takes the value on by slope x gap; one that jumped, by slope x the usual step.
    """
    for sensor, names in _SENSORS.items():
        smooth = [np.flatnonzero(trial.of(name)) for name in names if trial.of(name).sum() > 2 * _AROUND]
        if not smooth:
            continue
        clock = np.unique(trial.time[smooth[0]])
        if len(clock) < 3:
            continue
        steps = np.diff(clock)
        usual = float(np.median(steps))
        for k in np.flatnonzero(steps > max(4 * usual, 2e-3)):
            surprise = np.array([_surprise(trial, mine, clock[k], clock[k + 1], usual) for mine in smooth])
            good = np.isfinite(surprise).all(axis=1)
            right, jumped = surprise[good].sum(axis=0) if good.any() else (0.0, 0.0)
            if right < _SURE or jumped > 0.05 * right or jumped > 16.0 * good.sum():
                continue
            whole = np.isin(trial.channel, [CHANNELS.index(name) for name in _ALL[sensor]])
            keep &= ~(whole & (trial.time > clock[k]))
            what = f"the clock of {sensor} jumps forward by {steps[k] - usual:.3g} s while the motion goes on as if "
            findings.append(aside(trial, names[0], clock[k + 1 :], what + "it had not: all that follows is set aside"))
            break
    _clocks_apart(trial, keep, findings)


def _clocks_apart(trial: TrialData, keep: NDArray[np.bool_], findings: list[Finding]) -> None:
    """The same for camera and IMU, compared with one another: the angle is late against the gyro from a gap on."""
    angle, rate = (np.flatnonzero(trial.of(name) & keep) for name in ("theta", "gyro"))
    if not len(angle) or not len(rate):
        return
    std = (float(trial.std[angle[0]]), float(trial.std[rate[0]]))

    def between(angle: NDArray[np.intp], rate: NDArray[np.intp], near: float) -> tuple[float, bool]:
        """The lag, and whether it is another than `near`, which it else is."""
        found = find_lag(
            trial.time[angle], trial.value[angle], trial.time[rate], trial.value[rate], std=std, near=near
        )  # fmt: skip
        return (near, False) if found is None or not found.is_another else (found.value, True)

    for sensor, rows, sign in (("the IMU", rate, -1.0), ("the camera", angle, 1.0)):
        parts = [rows[low:high] for low, high in pieces(trial.time[rows])]
        first: float | None = None
        for number, part in enumerate(parts):
            seen, felt = (angle, part) if sensor == "the IMU" else (part, rate)
            lag, another = between(seen, felt, first or 0.0)
            if first is None:
                first = lag
                continue
            jumped = sign * (lag - first)
            if not another or jumped < _MOVED:
                continue
            start = float(trial.time[part[0]])
            before = float(trial.time[parts[number - 1][-1]])
            whole = np.isin(trial.channel, [CHANNELS.index(name) for name in _ALL[sensor]])
            keep &= ~(whole & (trial.time > before))
            other = "camera's angle" if sensor == "the IMU" else "gyro"
            what = f"the clock of {sensor} jumps forward by about {jumped:.2g} s while the motion, as the {other} "
            what += "has it, goes on as if it had not: all that follows is set aside"
            findings.append(aside(trial, _SENSORS[sensor][0], np.array([start, trial.time[rows].max()]), what))
            return


def _surprise(
    trial: TrialData, mine: NDArray[np.intp], before: float, after: float, usual: float
) -> tuple[float, float]:
    """Squared standard deviations by which the value after a gap is off, for a clock that is right and one that jumped.

    NaN where the slopes on either side differ: then the gap shows nothing.
    """
    time, value, std = trial.time[mine], trial.value[mine], float(trial.std[mine[0]])
    around = max(_AROUND, int(_SPAN / usual))
    left, right = np.flatnonzero(time <= before)[-around:], np.flatnonzero(time >= after)[:around]
    if min(len(left), len(right)) < around:
        return np.nan, np.nan
    one, two = np.polyfit(time[left] - before, value[left], 1), np.polyfit(time[right] - after, value[right], 1)
    doubt = std * np.sqrt(12 / around) / (around * usual)  # of a slope
    if abs(one[0] - two[0]) > 0.3 * max(abs(one[0]), abs(two[0])) + 4 * doubt:
        return np.nan, np.nan
    slope, moved = 0.5 * (one[0] + two[0]), two[1] - one[1]
    place = 2 * std * np.sqrt(2 / around)  # of a line's end

    def off(gap: float) -> float:
        bend = 0.5 * abs(one[0] - two[0]) * gap
        return float((moved - slope * gap) ** 2 / (place**2 + (doubt * gap) ** 2 + bend**2))

    return off(after - before), off(usual)


def _ends(trial: TrialData, name: str, keep: NDArray[np.bool_], findings: list[Finding]) -> None:
    """A channel that begins later or ends earlier than what is kept of the others; one whose clock is off does both."""
    time, whole = trial.time[trial.of(name)], trial.time[keep]
    longest = max(float(np.ptp(own)) for other in CHANNELS if len(own := trial.time[trial.of(other) & keep]))
    least = max(10 * float(np.median(np.diff(time))), _END)
    first, last = float(whole.min()), float(whole.max())
    if name == "wheel":  # before the torque it turns as is stated: a tachometer that starts with it misses nothing
        first = max(first, 0.0)
    for low, high, words in (
        (first, float(time[0]), f"before {time[0]:.3g} s, others begin at {first:.3g} s"),
        (float(time[-1]), last, f"after {time[-1]:.3g} s, others go on to {last:.3g} s"),
    ):
        if min(high - low, longest - float(np.ptp(time))) > least:
            findings.append(Finding(trial=trial.id, channel=name, from_s=low, to_s=high,
                                    what=f"{name} has no valid row {words}: the rest is used"))  # fmt: skip


def _gaps(trial: TrialData, name: str, mine: NDArray[np.intp], findings: list[Finding]) -> None:
    """Stretches without rows."""
    time = trial.time[mine]
    steps = np.diff(time)
    usual = float(np.median(steps))
    for k in np.flatnonzero(steps > max(10 * usual, 0.02)):
        what = f"{name} has no valid row for {steps[k]:.3g} s, where one every {usual:.3g} s is usual: kept as a "
        what += "gap (a clock that jumped forward looks the same)"
        findings.append(replace(aside(trial, name, time[k : k + 2], what), set_aside=False))


def spikes(trials: Sequence[TrialData]) -> tuple[dict[str, NDArray[np.intp]], list[Finding]]:
    """Single readings of gyro, accelerometers and wheel that neither their neighbours nor other trials share: rows of
    each trial (trial -> rows), and what is reported of them.

    A touch of the ground is no such reading: a tip stays on its spring for half a period at least (80 ms for 10 kg on
    1.5e4 N/m), and what it does to speed and rotation stays. A reading counts as one only where its eight neighbours
    lie on a parabola as closely as the sensor's noise lets them.
    """
    rows_alone: dict[str, NDArray[np.intp]] = {}
    findings: list[Finding] = []
    apart = {(trial.id, name): _apart(trial, name) for trial in trials for name in _INERTIAL}
    for trial in trials:
        gone = []
        for name in _INERTIAL:
            rows, off = apart[trial.id, name]
            like = [other for other in trials if other is not trial and other.condition == trial.condition]
            far = np.abs(off) > _FAR
            alone = [k for k in np.flatnonzero(far) if not any(_shared(trial, other, name, rows[k], off[k], apart)
                                                               for other in like)]  # fmt: skip
            if not alone or len(alone) > max(1.0, _FEW * len(rows)):
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
    around = off[max(0, int(near) - _MOMENT) : int(near) + _MOMENT + 1]
    return bool((around * np.sign(size) > _SAME * abs(size)).any())
