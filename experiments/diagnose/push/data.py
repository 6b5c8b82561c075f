"""Trials of penetration made ready for fits: gaps left out, faults found and set aside, depth smoothed."""

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.stats import norm

from experiments.campaign import Campaign, PenetrationCampaign, Recording
from experiments.campaign.tables import PenetrationTrial, SpikeTable
from experiments.check.replicas import pace_of
from experiments.diagnose.fit.problem import Array, Finding
from experiments.diagnose.fit.trials import TrialInfo
from experiments.diagnose.noise.colour import Colour, colour_of, together
from experiments.diagnose.noise.replicates import parted
from experiments.diagnose.noise.stuck import clipped, cut_rows, stuck_rows
from experiments.grains.spells import spells

from .depth import SmoothDepth, smooth_depth
from .drive import Drive, Holds, Weights

__all__ = ["Prepared", "of_drop", "prepare", "stds", "tip_depth"]

_FEWEST = 12  # rows that a trial must have to be used
_AROUND = 20  # rows on either side of a gap that show whether the clock has jumped
_LONG = 0.02  # share of a recording from which on a stretch without rows is reported
_SMOOTH, _ROUGH = 1.7, 3.0
"""Chi-square a row up to which a polynomial goes through both sides of a gap, and beyond which it does not."""
_NOISIER = 1.2
"""Power of a depth sensor's slow noise, over what is stated, from which on its pushes are smoothed once more."""
_AS_TAKEN = 3.0  # standard errors within which what is left is what it was taken for
_OF_MEDIAN = 1.8
"""Relative standard error of a median of n absolute third differences, times the root of n: 1.17 of independent normal
numbers, and sqrt(1 + 2 (0.75^2 + 0.3^2 + 0.05^2)) for those of neighbours."""
_SIDE = 3  # rows on each side by which a turning point is told from a lone reading
_OUTLIER = 8.0  # noise standard deviations beyond which a lone reading is a fault (once in 1e15 by chance)


@dataclass(frozen=True)
class Prepared:
    """One trial. Driven: rows with a depth, on which the force of a law with a memory depends whether or not the sensor
    read it. Drop: all rows. And which rows have what."""

    table: PenetrationTrial
    info: TrialInfo
    diameter: float  # [m]
    time: Array  # [s], shape [n]
    depth: Array  # as measured [m], shape [n]
    other: Array  # force [N] or acceleration [m/s2], NaN where there is none, shape [n]
    has_depth: NDArray[np.bool_]
    has_other: NDArray[np.bool_]
    smooth: SmoothDepth | None = None  # of a driven trial

    @property
    def driven(self) -> bool:
        """Whether its depth was prescribed."""
        return self.table.mode == "driven"

    @property
    def path(self) -> SmoothDepth:
        """The smoothed depth of a driven trial."""
        assert self.smooth is not None
        return self.smooth


def prepare(campaign: Campaign) -> tuple[list[Prepared], list[Finding]]:
    """The trials that can be used, and what was wrong with the data. The last campaign's are kept: a command checks a
    campaign before it diagnoses it, and smoothing takes long.

    Raises ValueError where no trial is left, or a sensor that is scored has no noise.
    """
    digest = hashlib.sha256(repr(campaign.tables).encode())
    for of, recording in campaign.recordings.items():
        for name, column in recording.columns.items():
            digest.update(repr((of, name)).encode() + column.tobytes())
    if (key := digest.digest()) not in _KEPT:
        found = _prepared(campaign)
        _KEPT.clear()
        _KEPT[key] = found
    trials, findings = _KEPT[key]
    return list(trials), list(findings)


_KEPT: dict[bytes, tuple[list[Prepared], list[Finding]]] = {}  # by the digest of the campaign


def _prepared(campaign: Campaign) -> tuple[list[Prepared], list[Finding]]:
    """The same, made anew."""
    tables = campaign.tables
    assert isinstance(tables, PenetrationCampaign)
    recordings = {table.id: campaign.recordings[table.id, "data"] for table in tables.trial}
    trials: list[Prepared] = []
    findings: list[Finding] = []
    noisier = _noisier(tables, recordings)
    cuts = _cuts(tables, recordings)
    for table in tables.trial:
        colour = noisier if table.mode == "driven" else None
        trial, found = _one(tables, table, recordings[table.id], colour=colour, cut=cuts.get(table.id))
        findings += found
        if trial is not None:
            trials.append(trial)
    if not trials:
        reasons = "; ".join(finding.what for finding in findings)
        raise ValueError(f"no trial of {tables.name!r} can be used: {reasons}")
    for id, rows in cuts.items():  # gaps in the place of forces that are cut off
        columns = {name: column.copy() for name, column in recordings[id].columns.items()}
        columns["force_N"][rows] = np.nan
        recordings[id] = replace(recordings[id], columns=columns)

    def again(
        trial: Prepared, colours: Mapping[str, Colour], alike: Holds = (), begun: Drive | None = None
    ) -> Prepared:
        """The same, smoothed with what is known now."""
        id = trial.info.id
        found = _one(tables, trial.table, recordings[id], alike=alike, begun=begun, colour=colours.get(id))[0]
        return found or trial

    trials, colours = _recoloured(
        trials, noisier, stds(tables, True)[0] if any(t.driven for t in trials) else 0.0, again
    )
    if colours:
        findings.append(Finding(trial="", channel="depth", what=together(list(dict.fromkeys(colours.values())))))
    trials = _alike(trials, colours, again)
    infos = parted([trial.info for trial in trials], {trial.info.id: _path(trial) for trial in trials})
    return [replace(trial, info=info) for trial, info in zip(trials, infos, strict=True)], findings


def _cuts(tables: PenetrationCampaign, recordings: Mapping[str, Recording]) -> dict[str, NDArray[np.int64]]:
    """Rows of each push at which the amplifier shows 0 for all that is less."""
    forces = {table.id: recordings[table.id]["force_N"] for table in tables.trial if table.mode == "driven"}
    rows = cut_rows(list(forces.values()), stds(tables, True)[1]) if forces else []
    return {id: own for id, own in zip(forces, rows, strict=True) if len(own)}


def _noisier(tables: PenetrationCampaign, recordings: Mapping[str, Recording]) -> Colour | None:
    """How noisy the depth sensor of the pushes is, where it is noisier than stated; else None.

    Third differences know nothing of a smooth motion: those of white noise s have the variance 20 s^2. A curve smoothed
    at a noise that is too small would follow the noise, and what it leaves would show too little of it. Of noise that
    is correlated they show less than there is: that is looked for in what is left (`_recoloured`).
    """
    sizes, count = [], 0
    for table in tables.trial:
        depth = recordings[table.id]["depth_m"] if table.mode == "driven" else np.zeros(0)
        third = np.diff(depth[np.isfinite(depth)], 3)
        if len(third) >= _FEWEST:
            sizes.append(float(np.median(np.abs(third))) / (np.sqrt(20.0) * float(norm.ppf(0.75))))
            count += len(third)
    std = stds(tables, True)[0] if sizes else 0.0
    noisier = float(np.median(sizes)) / std if std > 0 else 1.0
    chance = 3 * _OF_MEDIAN / np.sqrt(max(count, 1))
    return Colour("depth", noisier, 0.0) if noisier**2 > _NOISIER and noisier > 1 + chance else None


def _recoloured(
    trials: list[Prepared], noisier: Colour | None, std: float, again: Callable[..., Prepared]
) -> tuple[list[Prepared], dict[str, Colour]]:
    """Trials, smoothed once more where the noise of the depths differs from the one assumed, and its colour by trial.

    One sensor reads all pushes; rows at another rate are as long apart as they are, so that each rate has its own.
    `noisier`: what the noise was taken for; None: as stated. `std`: of the depth as stated [m]. `again`: smooths a
    trial with the colours that are known.
    """
    rates: dict[int, list[Prepared]] = {}
    for trial in trials if std > 0 else ():
        if trial.driven:
            rates.setdefault(round(5 * float(np.log(np.median(np.diff(trial.time))))), []).append(trial)
    colours: dict[str, Colour] = {}
    anew: set[str] = set()
    for alike in rates.values():
        left = [(trial.depth - trial.path.depth) / std for trial in alike]
        colour = colour_of("depth", left)
        slow = float(colour.power(np.zeros(1))[0]) if colour is not None else 1.0
        if colour is not None and noisier is not None and 1 / _NOISIER < slow / noisier.std**2 < _NOISIER:
            colour = noisier  # as it was taken
        elif colour is not None and slow > _NOISIER:
            anew |= {trial.info.id for trial in alike}
        else:
            colour = noisier
        if colour is not None:
            colours |= {trial.info.id: colour for trial in alike}
    found = {t.info.id: again(t, colours) if t.info.id in anew else t for t in trials}
    for rate, alike in rates.items():
        if any(trial.info.id in colours for trial in alike) or not colours:
            continue
        # Few rows show little of it, least of all where a curve has followed the noise: then as at the rate next to
        # it, unless what is left is not that.
        near = min((r for r in rates if rates[r][0].info.id in colours), key=lambda r: abs(r - rate))
        known = colours[rates[near][0].info.id]
        own = [again(trial, {trial.info.id: known}) for trial in alike]
        left = [(trial.depth - trial.path.depth) / std / known.std for trial in own]
        rows = np.concatenate([Weights(np.ones(len(one)), known.persistence)(one) for one in left])
        if abs(float((rows**2).mean()) - 1) < _AS_TAKEN * np.sqrt(2 / len(rows)):
            colours |= {trial.info.id: known for trial in alike}
            found |= {trial.info.id: trial for trial in own}
    return [found[trial.info.id] for trial in trials], colours


def _alike(trials: list[Prepared], colours: Mapping[str, Colour], again: Callable[..., Prepared]) -> list[Prepared]:
    """Smoothed once more where the holds of a push are not those of most: one machine makes all of them.

    The fit begins also with the motion of that push of the others whose record is as long, or nearest to it: a search
    that adds one ramp after another may end beside the motion that the machine makes.
    """
    holds = Counter(trial.smooth.holds for trial in trials if trial.smooth is not None and trial.smooth.holds)
    if not holds:
        return trials
    usual, count = holds.most_common(1)[0]
    if count < 2:
        return trials
    like = [t for t in trials if t.smooth is not None and t.smooth.holds == usual]
    return [
        again(t, colours, usual, _motion_of(like, t)) if t.smooth and t.smooth.holds not in ((), usual) else t
        for t in trials
    ]


def _motion_of(others: Sequence[Prepared], trial: Prepared) -> Drive | None:
    """The motion of that of `others` which lasts most nearly as long as `trial`, stretched to its length."""
    span = float(np.ptp(trial.time))
    near = min(others, key=lambda other: abs(math.log(float(np.ptp(other.time)) / span)))
    return None if near.path.drive is None else near.path.drive.stretched(float(np.ptp(near.time)), span)


def _path(trial: Prepared) -> tuple[float, ...]:
    """Depth, withdrawal and duration, by which drives at one speed differ; for a drop the recorded duration."""
    lasted = float(np.ptp(trial.time))
    if trial.smooth is None:
        return (lasted,)
    if trial.table.speed is None:
        return ()
    deepest = max(float(trial.smooth.depth.max()), 1e-9)
    return deepest, 2.0 - float(trial.smooth.depth[-1]) / deepest, lasted * abs(trial.table.speed)


def stds(tables: PenetrationCampaign, driven: bool) -> tuple[float, float]:
    """Noise of depth [m] and of the other sensor. Raises ValueError for 0 where it is divided by."""
    name = "force" if driven else "accel"
    sensor = getattr(tables.sensors, name)
    depth = tables.sensors.depth
    if sensor is None or depth is None:
        raise ValueError(f"[sensors.{name}] or [sensors.depth] is missing: its std was expected")
    if sensor.std[0] <= 0 or (depth.std[0] <= 0 and not driven):
        which = name if sensor.std[0] <= 0 else "depth"
        raise ValueError(f"[sensors.{which}] std = [0.0]: more than 0 was expected, residuals are divided by it")
    return depth.std[0], sensor.std[0]


def _one(
    tables: PenetrationCampaign, table: PenetrationTrial, recording: Recording, *, alike: Holds = (),
    begun: Drive | None = None, colour: Colour | None = None, cut: NDArray[np.int64] | None = None,
) -> tuple[Prepared | None, list[Finding]]:  # fmt: skip
    driven = table.mode == "driven"
    channel, key = ("force", "force_N") if driven else ("accel", "accel_m_s2")
    std_depth, std_other = stds(tables, driven)
    factor = max(colour.std, 1.0) if colour is not None else 1.0
    findings: list[Finding] = []
    time, depth, other = recording.time.copy(), recording["depth_m"].copy(), recording[key].copy()

    def report(what: str, *, where: str | None = None, rows: NDArray[np.int64] | None = None) -> None:
        span = (float(time[rows[0]]), float(time[rows[-1]])) if rows is not None and len(rows) else (None, None)
        findings.append(Finding(trial=table.id, what=f"trial {table.id}: {what}", channel=where, from_s=span[0],
                                to_s=span[1], set_aside=rows is not None))  # fmt: skip

    blind = np.isin(np.arange(len(time)), cut) if cut is not None else np.zeros(len(time), dtype=bool)
    keep = np.concatenate([[True], np.diff(time) > 0])  # a coarse clock repeats itself: the first reading rules
    if not keep.all():
        report(f"{int((~keep).sum())} rows repeat the time before them and are left out")
        time, depth, other, blind = time[keep], depth[keep], other[keep], blind[keep]
    for name, values in (("depth", depth), (channel, other)):
        missing = int(np.isnan(values).sum())
        if missing == len(values):
            report(f"not one of {missing} readings of {name} is a number")
        elif missing > 0.02 * len(values):
            report(f"{missing} of {len(values)} readings of {name} are gaps; the rest is used")
    jump = _clock_jump(time, depth, factor * std_depth) or (None if driven else _clock_jump(time, other, std_other))
    if jump is not None:
        rows = np.arange(jump, len(time))
        report(f"the clock jumps by {time[jump] - time[jump - 1]:.3g} s where the motion goes on as if it had not; all "
            f"that follows is set aside", rows=rows)  # fmt: skip
        time, depth, other, blind = time[:jump], depth[:jump], other[:jump], blind[:jump]
    if blind.any():
        report(f"{int(blind.sum())} readings of force are cut off at 0 or next to it: it reads exactly 0 and never "
               f"less, which its noise would, so that it shows nothing that pulls (adhesion would be hidden): an "
               f"amplifier for both signs is needed, or another zero; they are left out", where="force",
               rows=np.flatnonzero(blind))  # fmt: skip
        findings[-1] = replace(findings[-1], doubt=True)
        other[blind] = np.nan
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    for k in np.flatnonzero(steps > np.maximum(10 * usual, _LONG * float(np.ptp(time)) if len(time) else 0.0)):
        findings.append(Finding(
            trial=table.id, from_s=float(time[k]), to_s=float(time[k + 1]),
            what=f"trial {table.id}: there is no row from {time[k]:.4g} to {time[k + 1]:.4g} s, where one every "
            f"{usual:.3g} s is usual: kept as a gap",
        ))  # fmt: skip
    _drop_odd(table, "depth", depth, factor * std_depth, report)
    _drop_odd(table, channel, other, std_other, report)
    _drop_jumps(time, depth, factor * std_depth, report)
    if driven:
        held = _held(other)
        if held is not None:
            report(f"the force is held: {int((~held).sum())} of {len(other)} readings repeat the one before; only "
                   f"fresh ones are used", where="force")  # fmt: skip
            other[~held] = np.nan
        return _driven(tables, table, time, depth, other, std_depth, findings, alike, begun, colour)
    has_depth, has_other = np.isfinite(depth), np.isfinite(other)
    has_other &= np.abs(time) > 1e-9  # the force jumps at the touch: neither side is wrong
    if has_depth.sum() + has_other.sum() < _FEWEST:
        report("too few readings are left: it is set aside", rows=np.arange(0))
        return None, findings
    info = _info(tables, table, abs(float(table.speed or 0.0)))
    return Prepared(table, info, tables.diameter_of(table), time, depth, other, has_depth, has_other), findings


def _drop_odd(table: PenetrationTrial, name: str, values: Array, std: float, report: Callable[..., None]) -> None:
    """Put NaN in the place of readings that stand alone, clip or are stuck, and report it."""
    # A depth cannot jump; a force can, where a tip touches for a moment, but not beyond all that it is elsewhere.
    known = values[np.isfinite(values)]
    range_ = float(np.ptp(np.percentile(known, [0.5, 99.5]))) if name != "depth" and len(known) else 0.0
    lone = _lone_readings(values, max(std, 0.15 * range_))
    if len(lone):
        several = f"{len(lone)} readings of {name} lie far from their neighbours and are set aside"
        one = f"one reading of {name} lies far from its neighbours and is set aside"
        report(several if len(lone) > 1 else one, where=name, rows=lone)
        values[lone] = np.nan
    if table.mode == "driven" and name == "depth":
        return  # a machine may stop at its end, or stand still
    for end in clipped(values):
        if name == "accel" and abs(end.value - table.gravity) < 1e-3 * table.gravity:
            continue  # free flight
        report(f"{len(end.rows)} readings of {name} {end.words}", where=name, rows=end.rows)
        values[end.rows] = np.nan
    stuck = stuck_rows(values)
    if len(stuck):
        report(f"{len(stuck)} readings of {name} repeat the one before where it never does otherwise: the sensor is "
            f"stuck, they are set aside", where=name, rows=stuck)  # fmt: skip
        values[stuck] = np.nan


def _drop_jumps(time: Array, depth: Array, std: float, report: Callable[..., None]) -> None:
    """The same of depths from a jump on to where it is taken back."""
    step = _step(time, depth, std)
    while step is not None:
        size = depth[step] - depth[step - 1]
        back = _step(time, depth, std, after=step)
        while back is not None and abs(depth[back] - depth[back - 1] + size) > 0.5 * abs(size):
            back = _step(time, depth, std, after=back)  # until one takes it back
        rows = np.arange(step, len(depth) if back is None else back)
        stays = "stays there, as where a marker is lost; it is set aside from there on"
        comes = f"comes back {len(rows)} rows later, as where a marker is lost for a while; these are set aside"
        report(f"the depth jumps by {1e3 * size:.3g} mm between two readings and {stays if back is None else comes}",
            where="depth", rows=rows)  # fmt: skip
        depth[rows] = np.nan
        step = None if back is None else _step(time, depth, std, after=back)


def _driven(
    tables: PenetrationCampaign, table: PenetrationTrial, time: Array, depth: Array, other: Array, std: float,
    findings: list[Finding], alike: Holds, begun: Drive | None, colour: Colour | None,
) -> tuple[Prepared | None, list[Finding]]:  # fmt: skip
    known = np.isfinite(depth)
    if known.sum() < _FEWEST or (known & np.isfinite(other)).sum() < _FEWEST:
        what = f"trial {table.id}: fewer than {_FEWEST} rows hold both depth and force: it is set aside"
        findings.append(Finding(trial=table.id, what=what, set_aside=True))
        return None, findings
    noisier, persistence = (max(colour.std, 1.0), colour.persistence) if colour is not None else (1.0, 0.0)
    smooth = smooth_depth(time[known], depth[known], noisier * std, alike=alike, begun=begun, persistence=persistence)
    smooth = replace(smooth, inflation=noisier * float(np.sqrt((1 + persistence) / (1 - persistence))))
    speed = float(table.speed) if table.speed else float(np.percentile(np.abs(smooth.speed), 80))
    time, depth, other = time[known], depth[known], other[known]
    return Prepared(
        table, _info(tables, table, speed), tables.diameter_of(table), time, depth, other, np.isfinite(depth),
        np.isfinite(other), smooth,
    ), findings  # fmt: skip


def _info(tables: PenetrationCampaign, table: PenetrationTrial, speed: float) -> TrialInfo:
    gravity = table.gravity
    grains = gravity if table.grain_gravity is None else table.grain_gravity
    diameter = tables.diameter_of(table)
    pace = pace_of(tables, table)
    alike = f"{pace:.6g}" if pace is not None else "by hand"
    return TrialInfo(
        id=table.id,
        condition=(table.mode, diameter, gravity, grains, alike),
        settings={"speed_m_s": speed, "diameter_m": diameter, "gravity_m_s2": gravity},
    )


def _lone_readings(values: Array, std: float) -> NDArray[np.int64]:
    """Rows that lie far from the median of the seven around them, while those seven agree among themselves."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 9:
        return known[:0]
    v = values[known]
    middle = median_filter(v, 7, mode="nearest")
    away = np.abs(v - middle)
    spread = median_filter(away, 15, mode="nearest")
    suspect = away > np.maximum(_OUTLIER * std, 12 * spread)
    for low, high in spells(suspect):
        # A touch or a turn is sharp as well, but what is before it and after it differs.
        alike = low > 0 and high < len(v) and abs(v[low - 1] - v[high]) < 0.3 * away[low:high].min()
        if high - low > 3 or not alike or _turns(v, low, high, away[low:high].min()):
            suspect[low:high] = False
    return known[suspect] if suspect.sum() <= 0.05 * len(v) else known[:0]


def _turns(values: Array, low: int, high: int, away: float) -> bool:
    """Whether rows `low` to `high` are where the curve turns: both sides, going on as they came, lead to them."""
    if low < _SIDE or high + _SIDE > len(values):
        return False
    left, right = (np.polyfit(np.arange(_SIDE), values[k : k + _SIDE], 1) for k in (low - _SIDE, high))
    ahead = left[1] + left[0] * np.arange(_SIDE, _SIDE + high - low)
    back = right[1] - right[0] * np.arange(high - low, 0, -1)
    return all(bool((np.abs(values[low:high] - line) < 0.5 * away).all()) for line in (ahead, back))


def _step(time: Array, depth: Array, std: float, *, after: int = 0) -> int | None:
    """The first row beyond `after` at which the depth becomes another, the speeds on both sides agreeing; else None."""
    known = np.flatnonzero(np.isfinite(depth))
    t, d = time[known], depth[known]
    if len(t) < 20 or np.any(np.diff(t) <= 0):
        return None
    first = int(np.searchsorted(known, after)) if after else 0
    for k in range(max(3, first + 3), len(t) - 3):
        if abs(d[k] - d[k - 1]) < 12 * std:
            continue
        low, high = max(first, k - 6), min(len(t), k + 6)
        if t[k] - t[k - 1] > 4 * np.median(np.diff(t[low:high])):
            continue
        left, right = (np.polyfit(t[side] - t[k], d[side], 1) for side in (slice(low, k), slice(k, high)))
        bend = abs(left[0] - right[0]) * (t[k] - t[k - 1])
        if abs(right[1] - left[1]) > 12 * std + 3 * bend + 0.8 * abs(left[0]) * (t[k] - t[k - 1]):
            return int(known[k])
    return None


def _clock_jump(time: Array, values: Array, std: float) -> int | None:
    """The row at which the clock jumps forward while the motion does not; None where it never does.

    One polynomial is laid through the rows on both sides of a gap, once with the times as they stand and once with the
    gap closed, of the lowest degree up to 3 that fits the second: where the clock jumped, it does not fit the first.
    A few rows show that of a fast motion, as many as the gap is long of a slow one.
    """
    known = np.flatnonzero(np.isfinite(values))
    t, v = time[known], values[known]
    if len(t) < 2 * _AROUND:
        return None
    gaps = np.diff(t)
    usual = float(np.median(gaps))
    for k in np.flatnonzero(gaps > 4 * usual) + 1:
        most = min(k, len(t) - k)
        if most < _AROUND:
            continue
        for around in dict.fromkeys((_AROUND, min(most, max(_AROUND, round(gaps[k - 1] / usual))))):
            near = slice(k - around, k + around)
            as_read = t[near] - t[k]
            closed = as_read + np.where(as_read < 0, gaps[k - 1] - usual, 0.0)
            for degree in (1, 2, 3):
                stands, shut = (_beyond(degree, clock, v[near], std) for clock in (as_read, closed))
                if shut < _SMOOTH:
                    break
            if stands > max(_ROUGH, 2.5 * shut) and shut < _SMOOTH:
                return int(known[k])
    return None


def _beyond(degree: int, time: Array, values: Array, std: float) -> float:
    """Chi-square a row that the best polynomial leaves."""
    fitted = np.polynomial.Polynomial.fit(time, values, degree)
    return float(np.mean((values - fitted(time)) ** 2)) / max(std, 1e-300) ** 2


def _held(values: Array) -> NDArray[np.bool_] | None:
    """Which readings are fresh where most repeat the one before to the last digit; None where that is not so."""
    fresh = np.concatenate([[True], np.diff(values) != 0])
    known = np.isfinite(values)
    return fresh if known.sum() > 20 and fresh[known].mean() < 0.6 else None


def tip_depth(spike: SpikeTable, diameter: float) -> float:
    """Depth at which the tip is wholly in [m]."""
    if spike.tip == "sphere":
        return 0.5 * diameter
    if spike.tip == "cone":
        assert spike.cone_angle is not None  # the tables see to it
        return 0.5 * diameter / math.tan(math.radians(spike.cone_angle) / 2)
    return 1e-4 * diameter


def of_drop(trial: Prepared, depth: Array, acceleration: Array, tables: PenetrationCampaign) -> Array:
    """Columns of all rows as samples, over the stated noise."""
    std_depth, std_other = stds(tables, False)
    return np.concatenate([depth[trial.has_depth] / std_depth, acceleration[trial.has_other] / std_other])
