"""The motion of a drive: levels of constant speed joined by ramps, at times that the depth column shows.

A machine that pushes a spike moves at a speed, holds, and returns. Between two speeds it takes some time, during which
the speed changes in proportion to time or as a raised cosine. Depth is then z0 + sum of L_k (time at level k), linear
in the levels L_k. The ramps' middles and widths are found with them by damped least squares (Marquardt, J. SIAM 11
(1963), 431). Ramps are added where they reduce the misfit most, while the Bayesian information criterion falls. By the
same rule levels are set to rest and needless ramps removed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.problem import Array

__all__ = ["Drive", "Holds", "Weights", "find_drive"]

Holds = tuple[bool, ...]  # which levels are at rest

_ALIKE = 6.0  # twice the logarithm of the odds (20 to 1) that a machine's pushes go alike
_MOST_RAMPS = 10
_FIRST_WIDTH = 0.05  # of a ramp when it is added, of the record
_HIDDEN = 2.0  # change of all depths together, in standard deviations of the noise, that may go unseen
_GRID = 200  # places at which a ramp is looked for
_BLOCKS = 400  # means of neighbouring rows in which the search is made, at most
_WAYS = 2  # ways of adding a ramp that are fitted
_AHEAD = 2
"""Ramps that may be added without a gain before the search ends: a stop and a start are worth something together."""


@dataclass(frozen=True)
class Weights:
    """Turns rows into independent ones of unit variance."""

    root: Array  # one over the standard deviation of each row, shape [n]
    persistence: float = 0.0  # correlation of neighbouring rows, an autoregressive law of order one

    def __call__(self, rows: Array) -> Array:
        """Of shape [n] or [n, p], the same."""
        a, x = self.persistence, (rows.T * self.root).T
        if a:
            x = np.concatenate([x[:1], (x[1:] - a * x[:-1]) / np.sqrt(1 - a * a)])
        return x

    def of_means(self, sizes: NDArray[np.int64]) -> Weights:
        """For means of so many neighbouring rows, whose correlation is taken for one of order one again."""
        a = self.persistence
        powers = [(1 + 2 * sum((1 - k / b) * a**k for k in range(1, b))) / b for b in sizes.tolist()]
        usual = int(sizes[0])
        together = a * ((1 - a**usual) / (1 - a) / usual) ** 2
        return Weights(1 / np.sqrt(np.array(powers)), float(together / powers[0]))


@dataclass(frozen=True)
class Drive:
    """A motion of levels and ramps; times from 0 to 1, depths in standard deviations of the noise."""

    start: float  # depth at time 0
    levels: Array  # speeds, shape [ramp_count + 1]
    middles: Array  # of the ramps, shape [ramp_count]
    widths: Array  # shape [ramp_count]; 0 for a corner
    round: bool  # whether the speed of a ramp changes as a raised cosine, not in proportion to time
    resting: Holds  # which levels are 0 for certain
    even: bool = False  # whether the ramps' widths change in proportion, as with one acceleration for all of them
    chi_square: float = np.inf

    @property
    def count(self) -> float:
        """Numbers that were chosen from the data; a width, which only the few rows of its ramp show, for half a one."""
        ramps = len(self.middles)
        return 1 + len(self.levels) - sum(self.resting) + ramps + 0.5 * (min(ramps, 1) if self.even else ramps)

    def criterion(self, rows: int, alike: Holds = ()) -> float:
        """Bayesian information criterion (Schwarz, Annals of Statistics 6 (1978), 461), up to a constant.

        `alike`: where most of the machine's other pushes hold, which is likelier beforehand.
        """
        return self.chi_square + np.log(rows) * self.count - (_ALIKE if self.resting == alike else 0.0)

    def curve(self, u: Array) -> tuple[Array, Array]:
        """Depth and speed at times u, shapes [n]."""
        on, gone = self._columns(u)
        shares, spent = _between(on), _between(gone)
        return self.start + spent @ self.levels, shares @ self.levels

    def softened(self, u: Array, weigh: Weights) -> Drive:
        """The drive with the widest ramps that the noise may hide, and no level that is certainly at rest."""
        widths = self.widths.copy()
        for k, jump in enumerate(np.diff(self.levels)):
            for width in np.geomspace(2.0 / len(u), 0.5, 24):
                if width > widths[k]:
                    widths[k] = width
                by_width = _ramp_changes(u, self.middles[k], widths[k], self.round)[1]
                if abs(jump) * widths[k] * float(np.linalg.norm(weigh(by_width))) > _HIDDEN:
                    break
        count = len(self.levels)
        return replace(self, widths=widths, resting=(False,) * count, even=False)

    def changes(self, u: Array) -> tuple[Array, Array]:
        """Derivatives of depth and speed by the chosen numbers (start, levels, middles, widths), shapes [n, count]."""
        on, gone = self._columns(u)
        jumps = np.diff(self.levels)
        free = ~np.array(self.resting)
        depth = [np.ones((len(u), 1)), _between(gone)[:, free], -on[:, 1:] * jumps]
        speed = [np.zeros((len(u), 1)), _between(on)[:, free]]
        rises, wider, faster = [], [], []
        for middle, width, jump in zip(self.middles, self.widths, jumps, strict=True):
            rise, by_width, rate_by_width = _ramp_changes(u, middle, width, self.round)
            rises.append(-jump * rise)
            wider.append(jump * by_width)
            faster.append(jump * rate_by_width)
        if rises:
            each = self._shares[:, None] if self.even else np.eye(len(rises))
            depth.append(np.column_stack(wider) @ each)
            speed += [np.column_stack(rises), np.column_stack(faster) @ each]
        return np.hstack(depth), np.hstack(speed)

    def moved(self, step: Array) -> Drive:
        """With its chosen numbers changed by `step`, in the order of `changes`; ramps in the order of time."""
        free = np.flatnonzero(~np.array(self.resting))
        k = len(self.middles)
        levels, widths = self.levels.copy(), self.widths
        levels[free] += step[1 : 1 + len(free)]
        middles = np.clip(self.middles + step[1 + len(free) : 1 + len(free) + k], -0.02, 1.02)
        wider = step[1 + len(free) + k :]
        widths = np.clip(widths + (self._shares * wider[0] if self.even and k else wider), 0.0, 1.0)
        middles = np.maximum.accumulate(middles)
        if len(middles) > 1:  # a ramp ends before the next begins
            room = np.diff(middles) / np.maximum(0.5 * (widths[1:] + widths[:-1]), 1e-12)
            widths = widths * np.minimum(1.0, np.minimum(np.append(room, 1.0), np.insert(room, 0, 1.0)))
        return replace(self, start=self.start + float(step[0]), levels=levels, middles=middles, widths=widths)

    def stretched(self, span: float, other: float) -> Drive | None:
        """This motion, of a record that lasts `span` [s], as a machine makes it in one that lasts `other` [s]: holds
        last as long as here, all else is longer or shorter in proportion. None where no time is left for that.

        Levels of speed stay as they are: a fit begins with the best ones for its ramps.
        """
        lasts = span * np.diff(np.concatenate([[0.0], self.middles, [1.0]]))
        rests = np.array(self.resting)
        moving = float(lasts[~rests].sum())
        factor = (other - float(lasts[rests].sum())) / moving if moving > 0 else 0.0
        if factor <= 0:
            return None
        lasts[~rests] *= factor
        widths = self.widths * span * factor / other
        return replace(self, middles=np.cumsum(lasts)[:-1] / other, widths=widths, round=False, even=False,
                       chi_square=np.inf)  # fmt: skip

    @property
    def _shares(self) -> Array:
        """The ramps' widths over their mean."""
        mean = float(self.widths.mean())
        return self.widths / mean if mean > 1e-9 else np.ones(len(self.widths))

    def _columns(self, u: Array) -> tuple[Array, Array]:
        """How far each ramp has gone (0 to 1), and its integral; before them the time itself. Shapes [n, 1 + ramps]."""
        on, gone = [np.ones(len(u))], [u]
        for middle, width in zip(self.middles, self.widths, strict=True):
            one, other = _ramp(u, middle, width, self.round)
            on.append(one)
            gone.append(other)
        return np.column_stack(on), np.column_stack(gone)


def find_drive(
    u: Array, measured: Array, *, alike: Holds = (), begun: Drive | None = None, persistence: float = 0.0
) -> Drive:
    """The motion behind depths `measured` (over their noise) at times `u` from 0 to 1, shapes [n].

    `alike`: which levels are at rest in most of the machine's other pushes. `begun`: a motion from which a fit begins
    beside those that the search finds (`Drive.stretched`). `persistence`: of the noise (`Weights`).
    """
    n = len(u)
    block = max(1, -(-n // _BLOCKS))
    edges = np.arange(0, n, block)
    sizes = np.diff(np.append(edges, n))
    t = np.add.reduceat(u, edges) / sizes
    every = Weights(np.ones(n), persistence)
    weigh = every.of_means(sizes) if block > 1 else every
    y = np.add.reduceat(measured, edges) / sizes
    drive = _level_fit(Drive(0.0, np.zeros(1), np.zeros(0), np.zeros(0), False, (False,)), t, y, weigh)
    tried, idle = [drive], 0  # the best, and what came after it
    within = float(((np.repeat(y, sizes) - measured) ** 2).sum())  # what the means have taken out
    if persistence:
        within = float(n - len(t))

    def score(one: Drive) -> float:
        return one.criterion(n) + within

    for _ in range(min(_MOST_RAMPS, len(t) // 8)):
        if drive.chi_square + within < n - 2 * np.sqrt(2 * n) or idle == _AHEAD:
            break
        ways = [_added(drive, t, y, weigh), *(_parted(drive, k, t, y, weigh) for k in range(len(drive.middles)))]
        ways = sorted(ways, key=lambda way: way.chi_square)[:_WAYS]
        drive = min((_fitted(way, t, y, weigh, most=12) for way in ways), key=lambda way: way.chi_square)
        drive = _fitted(drive, t, y, weigh)
        if score(drive) < score(tried[0]) - 2.0:
            tried, idle = [drive], 0
        else:
            tried.append(drive)
            idle += 1
    if begun is not None:
        tried.append(_fitted(begun, t, y, weigh))
    plain = min((_pared(one, t, y, weigh, n, alike) for one in tried), key=lambda one: one.criterion(n, alike))
    found = [plain]
    if len(plain.middles):  # a raised cosine is as steep as a straight ramp of two thirds of its width
        rounder = _fitted(replace(plain, widths=1.5 * plain.widths, round=True), t, y, weigh)
        found.append(_pared(rounder, t, y, weigh, n, alike))
    if len(plain.middles) > 1:
        found += [_fitted(_evened(one), t, y, weigh) for one in found]
    if block > 1:
        found = [_fitted(one, u, measured, every, most=8) for one in found]
    found = [_level_fit(replace(one, widths=np.maximum(one.widths, 1.0 / n)), u, measured, every) for one in found]
    return min(found, key=lambda one: one.criterion(n, alike))


def _pared(drive: Drive, t: Array, y: Array, weigh: Weights, n: int, alike: Holds) -> Drive:
    """With levels at rest, without needless ramps, and with holds in others, as the criterion asks for it."""
    tried: set[tuple[object, ...]] = set()
    while True:
        columns = weigh(drive.changes(t)[0])
        size = np.linalg.norm(columns, axis=0) + 1e-300
        covariance = np.linalg.pinv((columns / size).T @ (columns / size), rcond=1e-12, hermitian=True)
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0)) / size
        free = [k for k, rests in enumerate(drive.resting) if not rests]
        limit = np.sqrt(4 * np.log(n) + 9)
        simpler: list[tuple[float, Drive]] = []
        for place, k in enumerate(free):
            away = abs(drive.levels[k]) / max(std[1 + place], 1e-300)
            if away < limit:
                resting, levels = list(drive.resting), drive.levels.copy()
                resting[k], levels[k] = True, 0.0
                simpler.append((away, replace(drive, resting=tuple(resting), levels=levels)))
        for k in range(len(drive.middles)):
            jump = abs(drive.levels[k + 1] - drive.levels[k])
            simpler.append((jump / max(float(std[1 : 1 + len(free)].max()), 1e-300), _without(drive, k)))
        better = None
        holds = [_parted(drive, k, t, y, weigh, hold=True) for k in range(len(drive.middles))]
        for one in (*(one for _, one in sorted(simpler, key=lambda pair: pair[0])[:6]), *holds):
            mark = (one.resting, tuple(np.round(one.middles, 3)))
            if mark in tried:
                continue
            tried.add(mark)
            one = _fitted(one, t, y, weigh, most=10)
            if one.criterion(n, alike) < drive.criterion(n, alike):
                better = one
                break
        if better is None:
            return drive
        drive = better


def _evened(drive: Drive) -> Drive:
    """With one acceleration in all ramps."""
    jumps = np.abs(np.diff(drive.levels))
    return replace(drive, widths=jumps * float(drive.widths.sum() / max(jumps.sum(), 1e-300)), even=True)


def _without(drive: Drive, k: int) -> Drive:
    """Ramp k and the level after it left out."""
    keep = np.arange(len(drive.middles)) != k
    levels = np.delete(drive.levels, k + 1)
    resting = tuple(r for place, r in enumerate(drive.resting) if place != k + 1)
    return replace(drive, levels=levels, middles=drive.middles[keep], widths=drive.widths[keep], resting=resting)


def _added(drive: Drive, t: Array, y: Array, weigh: Weights) -> Drive:
    """With one more ramp where it takes most away."""
    rest = weigh(y - drive.curve(t)[0])
    columns = weigh(drive.changes(t)[0])
    q = np.linalg.qr(columns)[0]
    rest = rest - q @ (q.T @ rest)
    places = np.linspace(0.0, 1.0, _GRID + 2)[1:-1]
    bends = np.column_stack([_ramp(t, place, _FIRST_WIDTH, drive.round)[1] for place in places])
    bends = weigh(bends)
    whole = np.linalg.norm(bends, axis=0)
    bends = bends - q @ (q.T @ bends)
    size = np.linalg.norm(bends, axis=0)
    gain = np.where(size > 1e-5 * whole, np.abs(rest @ bends) / np.maximum(size, 1e-300), 0.0)
    place = places[int(np.argmax(gain))]
    at = int(np.searchsorted(drive.middles, place))
    levels = np.insert(drive.levels, at, drive.levels[at])
    new = replace(
        drive, levels=levels, middles=np.insert(drive.middles, at, place), chi_square=np.inf,
        widths=np.insert(drive.widths, at, _FIRST_WIDTH), resting=(False,) * len(levels),
    )  # fmt: skip
    return _level_fit(new, t, y, weigh)


def _parted(drive: Drive, k: int, t: Array, y: Array, weigh: Weights, *, hold: bool = False) -> Drive:
    """With ramp k in two, a level between them, which is a `hold` or begins as the best one."""
    middle, width = drive.middles[k], max(float(drive.widths[k]), 0.02)
    middles = np.insert(drive.middles, k, middle)
    middles[k : k + 2] = middle - 0.3 * width, middle + 0.3 * width
    widths = np.insert(drive.widths, k, 0.0)
    widths[k : k + 2] = 0.3 * width
    levels = np.insert(drive.levels, k + 1, 0.0)
    new = replace(drive, levels=levels, middles=middles, widths=widths)
    if not hold:
        return _level_fit(replace(new, resting=(False,) * len(levels)), t, y, weigh)
    return replace(new, resting=(*drive.resting[: k + 1], True, *drive.resting[k + 1 :]))


def _level_fit(drive: Drive, t: Array, y: Array, weigh: Weights) -> Drive:
    """The best levels for ramps as they are."""
    free = ~np.array(drive.resting)
    columns = weigh(np.column_stack([np.ones(len(t)), _between(drive._columns(t)[1])[:, free]]))
    found = np.linalg.lstsq(columns, weigh(y), rcond=1e-12)[0]
    levels = np.zeros(len(free))
    levels[free] = found[1:]
    rest = weigh(y) - columns @ found
    return replace(drive, start=float(found[0]), levels=levels, chi_square=float(rest @ rest))


def _fitted(drive: Drive, t: Array, y: Array, weigh: Weights, *, most: int = 25) -> Drive:
    """All numbers by damped least squares, from where they are; the levels are the best for every set of ramps."""
    drive = _level_fit(drive, t, y, weigh)
    damping = 1e-3
    for _ in range(most):
        columns = weigh(drive.changes(t)[0])
        rest = weigh(y - drive.curve(t)[0])
        size = np.linalg.norm(columns, axis=0)
        size = np.where(size > 0, size, 1.0)
        gram = (columns / size).T @ (columns / size)
        right = (columns / size).T @ rest
        moved, before = False, drive.chi_square
        for _ in range(5):
            step = np.linalg.solve(gram + damping * np.eye(len(gram)) + 1e-12 * np.eye(len(gram)), right) / size
            new = _level_fit(drive.moved(step), t, y, weigh)
            if new.chi_square < drive.chi_square:
                drive, damping, moved = new, max(0.2 * damping, 1e-9), True
                break
            damping *= 6.0
        if not moved or before - drive.chi_square < 1e-2 + 1e-5 * drive.chi_square:
            break
    return drive


def _between(on: Array) -> Array:
    """What belongs to each level: how far its ramp has gone less how far the next has."""
    return on - np.column_stack([on[:, 1:], np.zeros(len(on))])


def _ramp(u: Array, middle: float, width: float, round: bool) -> tuple[Array, Array]:
    """How far a ramp has gone at times u, 0 to 1, and the integral of that; shapes [n]."""
    x = u - middle
    if width < 1e-9:
        return (x > 0).astype(float), np.maximum(x, 0.0)
    s = np.clip(0.5 + x / width, 0.0, 1.0)
    beyond = np.maximum(x - 0.5 * width, 0.0)
    if not round:
        return s, 0.5 * width * s * s + beyond
    turn = 2 * np.pi * s
    return s - np.sin(turn) / (2 * np.pi), width * (0.5 * s * s + (np.cos(turn) - 1) / (4 * np.pi**2)) + beyond


def _ramp_changes(u: Array, middle: float, width: float, round: bool) -> tuple[Array, Array, Array]:
    """Of a ramp: its rate, and the derivatives by its width of its integral and of itself; shapes [n]."""
    if width < 1e-9:
        none = np.zeros(len(u))
        return none, none, none
    s = np.clip(0.5 + (u - middle) / width, 0.0, 1.0)
    inside = (s > 0) & (s < 1)
    if not round:
        return inside / width, 0.5 * s * (1 - s), -np.where(inside, s - 0.5, 0.0) / width
    turn = 2 * np.pi * s
    on = s - np.sin(turn) / (2 * np.pi)
    rate = np.where(inside, 1 - np.cos(turn), 0.0) / width
    by_width = np.where(inside, 0.5 * s * s + (np.cos(turn) - 1) / (4 * np.pi**2) - on * (s - 0.5), 0.0)
    return rate, by_width, -rate * (s - 0.5)
