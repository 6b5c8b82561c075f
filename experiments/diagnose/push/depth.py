"""The motion of a driven spike from its noisy depth column: smooth pieces and kinks, with the error that is left.

The curve is fitted by least squares. It is a machine's motion (`push.drive`: levels of speed joined by ramps), a
polynomial or a cubic spline with equal intervals, plus kinks (a drive that stops or turns). The Bayesian information
criterion at the stated noise chooses the kind, and the number of each (Schwarz, Annals of Statistics 6 (1978), 461).
The fit is linear, or all but so, and its error a known linear map of the noise.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline

from experiments.diagnose.fit.problem import Array

from .drive import Drive, Holds, Weights, find_drive

__all__ = ["SmoothDepth", "smooth_depth"]

_INTERVALS = (1, 2, 4, 8, 16, 32, 64, 128)
_MOST_KINKS = 10
_GENTLE = 3  # intervals of a cubic spline that is always let free
_ROUND = (0.008, 0.02, 0.032, 0.05)  # of the record, about a kink
_KINKED_INTERVALS = 2  # finer splines need no kinks, and the search is dear
_KINK_GRID = 160
_APART = 3.0
"""Rows between two kinks: of a speed that lasts less they show nothing, and a row that is far off would make one."""
_DRIVEN = 24  # rows from which on levels and ramps are looked for
_FINER = (1, 3)  # times as many intervals of bends, tried in turn
_SHOWN = 3.0  # nats by which finer bends must be likelier
_BENDS = 8  # intervals of the spline that lets levels and ramps be not quite such


@dataclass(frozen=True)
class SmoothDepth:
    """A smoothed depth column at its own times, n rows."""

    depth: Array  # [m], shape [n]
    speed: Array  # its slope [m/s], shape [n]
    depth_error: Array  # factor of the depth's error: the error is this times standard normal numbers [m], shape [n, p]
    speed_error: Array  # of the slope's, the same numbers [m/s], shape [n, p]
    drive: Drive | None = None  # its levels of speed and ramps; None where it is no such motion
    inflation: float = 1.0
    """By how much its standard error is larger than with white noise of the stated size, as the gap has it."""

    @property
    def holds(self) -> Holds:
        """Which of its levels of speed are 0; () where it is no motion of levels."""
        return () if self.drive is None else self.drive.resting

    @cached_property
    def slow(self) -> float:
        """Speed below which the direction of the motion is not certain [m/s]."""
        return max(0.02 * float(np.abs(self.speed).max()), 2 * float(np.median(self.speed_std)), 1e-12)

    @property
    def depth_std(self) -> Array:
        """Standard error of the smoothed depth, s in docs/diagnose.md [m], shape [n]."""
        return np.sqrt((self.depth_error**2).sum(axis=1))

    @property
    def speed_std(self) -> Array:
        """Standard error of the slope [m/s], shape [n]."""
        return np.sqrt((self.speed_error**2).sum(axis=1))


def smooth_depth(
    time: Array, depth: Array, std: float, *, alike: Holds = (), begun: Drive | None = None, persistence: float = 0.0
) -> SmoothDepth:
    """Smooth a depth column [m] at times [s], both of shape [n], with noise of standard deviation `std` [m].

    `alike`: the holds of most of the machine's other pushes. `begun`: their motion in a record as long as this one,
    from which a fit begins, too. `persistence`: correlation of the noise of a row with that of the next.

    Raises ValueError for fewer than two rows.
    """
    if len(time) < 2:
        raise ValueError(f"{len(time)} rows of depth: two or more were expected")
    span = time[-1] - time[0]
    u = (time - time[0]) / (span if span > 0 else 1.0)
    noise = max(std, 1e-9 * max(float(np.ptp(depth)), 1e-9))
    weigh = Weights(np.ones(len(u)), persistence)
    driven = len(u) >= _DRIVEN
    drive = find_drive(u, depth / noise, alike=alike, begun=begun, persistence=persistence) if driven else None
    curve, change, ways, hidden, intervals = _curve(u, depth / noise, drive, weigh)
    rest = depth - noise * curve
    chosen: tuple[float, Array, Array, int] | None = None
    for finer in _FINER:  # bends over the whole: gentle ones unless the column shows others
        basis, slopes, fixed = _joined(u, *ways, finer * intervals)
        log, means, root = _shrunk(basis, fixed, rest / noise, noise, weigh)
        if chosen is None or log > chosen[0] + _SHOWN:
            chosen = (log, noise * curve + basis @ means, noise * change + slopes @ means, finer * intervals)
            errors = basis @ root, slopes @ root
    assert chosen is not None
    _, best, speed, intervals = chosen
    if hidden is not ways:
        basis, slopes, fixed = _joined(u, *hidden, intervals)
        root = _shrunk(basis, fixed, rest / noise, noise, weigh)[2]
        errors = basis @ root, slopes @ root
    span = span if span > 0 else 1.0
    return SmoothDepth(best, speed / span, errors[0], errors[1] / span, drive if hidden is not ways else None)


_Columns = tuple[Array, Array]


def _curve(
    u: Array, measured: Array, drive: Drive | None, weigh: Weights
) -> tuple[Array, Array, _Columns, _Columns, int]:
    """A curve, its slope, columns and their slopes by which it may be moved, those by which it may be off without the
    noise showing it, and how many intervals of bends it may hide.

    Depth is in standard deviations of the noise, time from 0 to 1.
    """
    n = len(u)
    limit = n + 2 * np.sqrt(2 * n)  # down to the noise
    good = drive is not None and drive.chi_square < limit
    best: tuple[float, Array, Array, list[float], int] | None = None
    enough = 0
    for intervals in (0, *_INTERVALS):
        basis, slopes = _basis(u, intervals)
        if basis.shape[1] > max(2, n // 3):
            break
        kinks = _MOST_KINKS if intervals <= _KINKED_INTERVALS and not good else 0
        score, basis, slopes, places = _with_kinks(u, measured, basis, slopes, kinks, weigh)
        if best is None or score < best[0]:
            best = (score, basis, slopes, places, intervals)
        if score - np.log(n) * basis.shape[1] < limit:
            enough += 1
            if enough == 3:
                break
    assert best is not None
    if drive is None or _less(best[0], best[1].shape[1], drive, n, limit):
        *columns, intervals = _enlarged(u, *best[1:])
        ways = (columns[0], columns[1])
        return np.zeros(n), np.zeros(n), ways, ways, intervals
    linear = 1 + len(drive.levels) - sum(drive.resting)  # a ramp is moved by no more than its fit has found
    depths, speeds = (columns[:, :linear] for columns in drive.changes(u))
    return *drive.curve(u), (depths, speeds), drive.softened(u, weigh).changes(u), _BENDS


def _less(score: float, count: int, drive: Drive, n: int, limit: float) -> bool:
    """Whether a curve of `count` columns is better than a drive by the criterion, or by the noise they leave."""
    chi_square = score - float(np.log(n)) * count
    if min(chi_square, drive.chi_square) < limit:
        return score < drive.criterion(n)
    own, other = (n * float(np.log(one / n)) for one in (chi_square, drive.chi_square))
    return own + float(np.log(n)) * (count - drive.count) < other


def _shrunk(basis: Array, fixed: int, depth: Array, std: float, weigh: Weights) -> tuple[float, Array, Array]:
    """Evidence, coefficients and a factor of their covariance, all columns but the first `fixed` held small by a prior.
    `depth` is over the noise, `basis` in metres.

    Each of these moves the curve by as much as a normal number of one common variance. The coefficients are means over
    all variances, as likely as the column makes them; their error is that of the largest variance that is at most 2
    nats less likely than the best, so that what the column cannot exclude stays in it.
    """
    size = np.maximum(np.abs(basis).max(axis=0), 1e-300)
    x = weigh(basis / size) / std
    gram, right = x.T @ x, x.T @ weigh(depth)
    p = x.shape[1]
    extra = np.arange(p) >= fixed
    found: list[tuple[float, Array, Array]] = []
    for scale in std * np.geomspace(1e-3, 3e3, 27):
        precision = gram + np.diag(np.where(extra, scale**-2, 0.0))
        root = np.linalg.cholesky(precision + 1e-12 * np.diag(np.diag(precision)))
        means = np.linalg.solve(root.T, np.linalg.solve(root, right))
        # Marginal likelihood of the column, up to what no variance changes.
        log = 0.5 * float(right @ means) - float(np.log(np.diag(root)).sum()) - float(extra.sum()) * np.log(scale)
        found.append((log, means, np.linalg.inv(root).T))
    best = max(log for log, _, _ in found)
    weights = np.exp([log - best for log, _, _ in found])
    means = np.average([means for _, means, _ in found], axis=0, weights=weights)
    root = next(entry[2] for entry in reversed(found) if entry[0] >= best - 2.0)
    return best, means / size, root / size[:, None]


def _basis(u: Array, intervals: int) -> tuple[Array, Array]:
    """Columns and their slopes: a straight line for 0 intervals, else a cubic spline of that many on 0..1."""
    if intervals == 0:
        return np.column_stack([np.ones_like(u), u]), np.column_stack([np.zeros_like(u), np.ones_like(u)])
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, intervals + 1), np.ones(3)])
    count = intervals + 3
    spline = BSpline(knots, np.eye(count), 3)
    return spline(u), spline.derivative()(u)


def _enlarged(u: Array, basis: Array, slopes: Array, places: list[float], intervals: int) -> tuple[Array, Array, int]:
    """With what the noise may hide: rounder turns about each kink, and bends over the whole twice as fine.

    Says also into how many intervals these bends go.

    The criterion leaves out what a depth sensor cannot see; a force sensor in a stiff bed can, and would take it for an
    effect. So it is let free, and its error, which `SmoothDepth` knows, is part of the likelihood.
    """
    columns, changes = [basis], [slopes]
    for place in places:
        for away in _ROUND:
            for at in (place - away, place + away):
                if 0.01 < at < 0.99:
                    after = np.maximum(u - at, 0.0)[:, None]
                    columns.append(after**2)
                    changes.append(2 * after)
    return np.hstack(columns), np.hstack(changes), max(_GENTLE, 2 * intervals)


def _joined(u: Array, free: Array, slopes: Array, intervals: int) -> tuple[Array, Array, int]:
    """`free` columns and a cubic spline's that they do not hold, their slopes, and how many are free."""
    turns = free.shape[1]
    columns, changes = [free], [slopes]
    gentle, steep = _basis(u, intervals)
    if gentle.shape[1] <= len(u) // 8:
        columns.append(gentle)
        changes.append(steep)
    whole, steps = np.hstack(columns), np.hstack(changes)
    kept: list[int] = []
    q = np.zeros((len(u), 0))
    for k in range(whole.shape[1]):  # what the columns before it hold already is left out
        rest = whole[:, k] - q @ (q.T @ whole[:, k])
        rest -= q @ (q.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > 1e-4 * float(np.linalg.norm(whole[:, k])) and len(kept) < len(u) // 3:
            kept.append(k)
            q = np.column_stack([q, rest / size])
    return whole[:, kept], steps[:, kept], sum(k < turns for k in kept)


def _with_kinks(
    u: Array, measured: Array, basis: Array, slopes: Array, most: int, weigh: Weights
) -> tuple[float, Array, Array, list[float]]:
    """The criterion, the columns with as many kinks as it allows, each where it helps most, and where they are."""
    n = len(u)
    places: list[float] = []

    q = np.linalg.qr(weigh(basis))[0]
    rest = weigh(measured)
    rest = rest - q @ (q.T @ rest)
    score = float(rest @ rest) + np.log(n) * basis.shape[1]
    grid = np.linspace(0.0, 1.0, _KINK_GRID + 2)[1:-1]
    for _ in range(min(most, n // 6)):
        if rest @ rest < n + 3 * np.sqrt(2 * n):  # nothing left that a kink could explain
            break
        place, power = _best_kink(u, q, rest, _apart(grid, places, n), weigh)
        fine = place + np.linspace(-1.2, 1.2, 41) / _KINK_GRID
        place, power = _best_kink(u, q, rest, _apart(fine[(fine > 0) & (fine < 1)], places, n), weigh, (power,))
        after = np.maximum(u - place, 0.0)
        trial = np.column_stack([basis, after**power])
        column = weigh(trial[:, -1])
        column = column - q @ (q.T @ column)
        column /= np.linalg.norm(column)
        q_new, rest_new = np.column_stack([q, column]), rest - column * (column @ rest)
        new = float(rest_new @ rest_new) + np.log(n) * (trial.shape[1] + 1)
        if not new < score - 4.0:
            break
        score, q, rest, basis = new, q_new, rest_new, trial
        places.append(place)
        slopes = np.column_stack([slopes, (u > place).astype(float) if power == 1 else 2 * after])
    return score, basis, slopes, places


def _apart(grid: Array, places: list[float], n: int) -> Array:
    """Of the places in `grid` those that are some rows from each of the kinks there are."""
    return grid[(np.abs(grid[:, None] - np.array(places)) >= _APART / n).all(axis=1)]


def _best_kink(
    u: Array, q: Array, rest: Array, places: Array, weigh: Weights, powers: tuple[int, ...] = (1, 2)
) -> tuple[float, int]:
    """Where a kink (power 1: the speed jumps) or a bend (2: it begins to change) takes most away, and which."""
    best = (-1.0, 0.5, 1)
    for power in powers:
        columns = weigh(np.maximum(u[:, None] - places[None, :], 0.0) ** power)
        whole = np.sqrt((columns**2).sum(axis=0))
        columns = columns - q @ (q.T @ columns)
        size = np.sqrt((columns**2).sum(axis=0))
        gain = np.where(size > 1e-6 * whole, np.abs(rest @ columns) / np.maximum(size, 1e-300), 0.0)
        place = int(np.argmax(gain))
        best = max(best, (float(gain[place]), float(places[place]), power))
    return best[1], best[2]
