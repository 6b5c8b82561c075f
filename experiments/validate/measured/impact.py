"""Katsuragi & Durian's drops: one law of force for all heights, m a = m g - m v^2 / d1 - k z.

As they do, the law is read off a(z, v). At each depth a straight line over v^2 is fitted to the forces of drops that
pass it at different speeds. Its slope is 1 / d1 there, and its start is the force of depth alone, k z / m if the law is
right. Both are left free at every depth (``Separated``), so that a bed whose force has another form shows it. It shows
the published k z / m beside a drag that is larger where the ball goes in. Refitted with that (``Refit``) the law states
the depths at which its own balls stop. A fit of d1 and k/m to v^2 over depth hides it. Where the ball goes in, the drag
is several times as large as deeper down. So one d1 for all of it stops no ball where it stopped.

The force is taken from the energy, d(v^2)/dz = 2 g - 2 F / m, over bins of depth, so that nothing is differentiated
twice. By the law v^2 over z is known in closed form (Clark & Behringer 2013, EPL 101, 64001).

The experiment's beads are 85 to the ball's diameter, ours 5 and 7. Grains' centres keep half a bead clear of the ball,
and drag goes with the diameter D + d that they see (Kumar et al. 2017, arXiv 1712.09057): the ball here is so much
smaller that D + d is the experiment's, its mass is kept. What is left of the grains' size shows between the two, and
stopping depths are put on a straight line in d / (D + d) to the experiment's beads.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, listed, tracked
from experiments.validate.base.drops import BEADS, Drop

from . import say

__all__ = [
    "BALL", "CASES", "KNOTS", "K_OVER_M", "MASS", "Refit", "Separated", "energy", "published",
    "refit", "separated",
]  # fmt: skip

BALL, BEAD, MASS, GRAVITY = 0.0254, 0.0003, 0.0692, 9.81  # diameters [m], [kg], [m/s2]
D1, K_OVER_M = 0.087, 1040.0  # published [m], [1/s2]
CLEAR = BALL + BEAD
SPEEDS = (0.4, 0.9, 1.8)  # on touching [m/s]
BOX = (3.2, 3.2, 2.15)  # of the bed, over D + d
PLACES = ((0.25, 0.25), (0.75, 0.75))
SIZES = ((6, ((1, PLACES), (4, PLACES), (5, PLACES))), (8, ((2, PLACES), (3, PLACES))))
"""D + d over d, which is one more than the grains across the ball; seeds of the beds, and places in each."""
STOP_BAND, DEPTH_BAND, TIME_BAND, K_BAND, D1_BAND = 0.03, 0.1, 0.15, 0.25, 0.15
LONGEST = 0.4  # [s]
BIN = 0.002  # of depth [m]
POINTS, STOPS = 50, 4
KNOTS = (0.0, 0.004, 0.008, 0.012, 0.016, 0.02, 0.03, 0.04)  # at which the refit law has drags of its own [m]
_DEPTHS = np.linspace(0.0, 0.15, 1501)  # at which it is integrated [m]

Fall = Mapping[str, np.ndarray]


def fall(across: int, seed: int, at: tuple[float, float], speed: float) -> Drop:
    """One drop; ``across``: D + d over d."""
    grain = CLEAR / across
    radius = 0.5 * (CLEAR - grain)
    density = MASS / (4 / 3 * math.pi * radius**3)
    size = tuple(share * CLEAR for share in BOX)
    return Drop(grain, 2 * radius, density, size, GRAVITY, seed, at, speed, LONGEST)  # type: ignore[arg-type]


def energy(depth: np.ndarray, *, start: float, d1: float, k_over_m: float, gravity: float = GRAVITY) -> np.ndarray:
    """v^2 [m2/s2] at depths [m] by the law, from ``start`` at depth 0."""
    steady = d1 * gravity + 0.5 * k_over_m * d1**2
    return (start - steady) * np.exp(-2 * np.asarray(depth) / d1) + steady - k_over_m * d1 * np.asarray(depth)


def published(speed: float) -> tuple[float, float]:
    """Depth [m] and time [s] at which the published law stops the ball."""
    stops = lambda _, y: y[1]  # noqa: E731
    stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda _, y: [y[1], GRAVITY - y[1] ** 2 / D1 - K_OVER_M * y[0]], (0, LONGEST), [0.0, speed], events=stops,
        rtol=1e-8,
    )  # fmt: skip
    return float(found.y_events[0][0][0]), float(found.t_events[0][0])


@dataclass(frozen=True)
class Separated:
    """F / m = v^2 drag(z) + rest(z), read off drops bin by bin; shapes [n]."""

    depth: np.ndarray  # middles of the bins [m]
    drag: np.ndarray  # 1 / d1 [1/m]
    drag_error: np.ndarray  # of the regression [1/m]; NaN where drops of one speed alone came by
    rest: np.ndarray  # what depends on depth alone [m/s2]
    squares: np.ndarray  # v^2 of each drop in each bin [m2/s2], NaN where it did not come by, shape [drops, n]
    force: np.ndarray  # F / m likewise [m/s2]

    @property
    def regressed(self) -> np.ndarray:
        """Which bins drops of several speeds went through."""
        return np.isfinite(self.drag_error)

    @property
    def misfit(self) -> float:
        """Of the separated law: its residuals over the forces, root mean squares [1]."""
        return self._misfit(self.drag, self.rest)

    def misfit_of(self, law: "Refit") -> float:
        """Of a law with numbers, likewise [1]."""
        return self._misfit(law.at(self.depth), law.k_over_m * self.depth)

    @property
    def k_over_m(self) -> float:
        """Of what depends on depth alone: the straight line through the surface, where drags were regressed [1/s2]."""
        known = self.regressed
        return float(self.rest[known] @ self.depth[known] / (self.depth[known] @ self.depth[known]))

    def _misfit(self, drag: np.ndarray, rest: np.ndarray) -> float:
        off = self.force - self.squares * drag - rest
        return float(np.sqrt(np.nanmean(off**2) / np.nanmean(self.force**2)))

    @property
    def beyond(self) -> np.ndarray:
        """Which bins lie deeper than half the ball: there its whole front is in the beads."""
        return self.depth > 0.5 * BALL


@dataclass(frozen=True)
class Refit:
    """F / m = v^2 drag(z) + k z / m: the published law with a drag that is free at every depth."""

    drag: tuple[float, ...]  # 1 / d1 at ``KNOTS``, straight between them [1/m]
    k_over_m: float  # [1/s2]

    def squares(self, start: float, depth: np.ndarray) -> np.ndarray:
        """v^2 at these depths, of a ball with ``start`` = v^2 at depth 0 [m2/s2]; negative below its stop."""
        exponent, gained = self._integrals()
        return np.exp(-np.interp(depth, _DEPTHS, exponent)) * (start + np.interp(depth, _DEPTHS, gained))

    def stop(self, start: float) -> float:
        """Depth at which a ball stops that has ``start`` = v^2 at depth 0 [m]."""
        left = start + self._integrals()[1]
        if (left > 0).all():
            return math.inf
        k = int(np.argmax(left <= 0))
        return float(_DEPTHS[k - 1] + (_DEPTHS[k] - _DEPTHS[k - 1]) * left[k - 1] / (left[k - 1] - left[k]))

    def _integrals(self) -> tuple[np.ndarray, np.ndarray]:
        """A = 2 int drag dz and I = int e^A (2 g - 2 k z / m) dz at ``_DEPTHS``: e^A v^2 = v0^2 + I."""
        exponent = _cumulated(2 * self.at(_DEPTHS))
        return exponent, _cumulated(np.exp(exponent) * 2 * (GRAVITY - self.k_over_m * _DEPTHS))

    def at(self, depth: np.ndarray) -> np.ndarray:
        """1 / d1 at depths [1/m]."""
        return np.interp(depth, KNOTS, self.drag)


def _cumulated(rate: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(_DEPTHS))])


PUBLISHED = Refit((1 / D1,) * len(KNOTS), K_OVER_M)


def start_of(one: Fall) -> float:
    """v^2 of a drop at the undisturbed surface [m2/s2]; it touches the highest beads a little above."""
    return float(np.interp(0.0, one["depth"], one["velocity"] ** 2))


def refit(falls: Sequence[Fall]) -> Refit:
    """The law that fits v^2 over depth of drops and where they stop, all drops alike, by least squares.

    v^2 at ``POINTS`` depths counts over the largest of its drop, the stop over its depth and ``STOPS`` times as much as
    all of these.
    """
    grids = [np.linspace(0.0, 0.98 * float(one["depth"][-1]), POINTS) for one in falls]
    known = [np.interp(z, one["depth"], one["velocity"] ** 2) for z, one in zip(grids, falls, strict=True)]
    stops = [float(one["depth"][-1]) for one in falls]

    def off(numbers: np.ndarray) -> np.ndarray:
        law = Refit(tuple(numbers[:-1] / D1), numbers[-1] * K_OVER_M)
        parts = [(law.squares(u[0], z) - u) / u.max() for z, u in zip(grids, known, strict=True)]
        last = [(law.stop(u[0]) / stop - 1) * math.sqrt(STOPS * POINTS) for u, stop in zip(known, stops, strict=True)]
        return np.concatenate([*parts, np.clip(last, -10, 10)])

    count = len(KNOTS)
    found = least_squares(off, np.ones(count + 1), bounds=([0.0] * count + [0.1], [30.0] * count + [5.0])).x
    return Refit(tuple((found[:-1] / D1).tolist()), float(found[-1]) * K_OVER_M)


def separated(falls: Sequence[Fall], speeds: Sequence[float]) -> Separated:
    """The force of drops as a part that goes with v^2 and one of depth alone. ``speeds``: of each on touching [m/s].

    Where drops of one speed alone still move, their drag cannot be told from the rest: it is taken as it was in the
    deepest bin before.
    """
    ends = np.array([float(one["depth"][-1]) for one in falls])
    edges = BIN * np.arange(1 + int(ends.max() / BIN))
    at = np.array([np.interp(edges, one["depth"], one["velocity"] ** 2) for one in falls])
    force = GRAVITY - 0.5 * np.diff(at, axis=1) / BIN
    squares = 0.5 * (at[:, 1:] + at[:, :-1])
    passed = (edges[None, 1:] <= ends[:, None]) & (edges[None, :-1] >= [[float(one["depth"][0])] for one in falls])
    force, squares = (np.where(passed, values, np.nan) for values in (force, squares))
    rows: list[tuple[float, float, float]] = []
    kept = []
    for k in range(len(edges) - 1):
        here = passed[:, k]
        if not here.any():
            continue
        x, y = squares[here, k], force[here, k]
        slope, off = (rows[-1][0] if rows else 0.0), math.nan
        if len({speed for speed, by in zip(speeds, here, strict=True) if by}) > 1 and len(x) > 2:
            line = np.polyfit(x, y, 1)
            slope, left = float(line[0]), y - np.polyval(line, x)
            off = math.sqrt(float(left @ left) / (len(x) - 2) / float(((x - x.mean()) ** 2).sum()))
        rows.append((slope, off, float((y - slope * x).mean())))
        kept.append(k)
    middles = 0.5 * (edges[1:] + edges[:-1])
    drag, error, rest = np.array(rows).T
    return Separated(middles[kept], drag, error, rest, squares[:, kept], force[:, kept])


@dataclass(frozen=True)
class Size:
    """What beds of one size of grains have shown."""

    across: int  # D + d over d
    settings: Sequence[Drop]
    falls: Sequence[Fall]
    law: Separated
    fitted: Refit

    def mean(self, key: str, speed: float) -> float:
        """Of the last values of the drops with this speed."""
        ends = [run[key][-1] for one, run in zip(self.settings, self.falls, strict=True) if one.speed == speed]
        return float(np.mean(ends))

    def refit_stop(self, speed: float) -> float:
        """Mean of the stops that the refit law has for the drops with this speed [m]."""
        drops = zip(self.settings, self.falls, strict=True)
        return float(np.mean([self.fitted.stop(start_of(run)) for one, run in drops if one.speed == speed]))


def _sizes(tell: Tell) -> list[Size]:
    planned = [[fall(n, seed, at, v) for seed, places in beds for at in places for v in SPEEDS] for n, beds in SIZES]
    runs = iter([one.run() for one in tracked([one for each in planned for one in each], tell)])
    found = []
    for (across, _), settings in zip(SIZES, planned, strict=True):
        falls = [next(runs) for _ in settings]
        found.append(Size(across, settings, falls, separated(falls, [one.speed for one in settings]), refit(falls)))
    return found


def _to_beads(sizes: Sequence[Size], values: Sequence[float]) -> float:
    """What beads of the experiment's size would have, on a straight line in d / (D + d)."""
    return float(np.polyval(np.polyfit([1 / one.across for one in sizes], values, 1), BEAD / CLEAR))


def _drops(tell: Tell) -> Outcome:
    sizes = _sizes(tell)
    rows = [
        Comparison(
            f"stop at {v:g} m/s by the refit law, {one.across - 1} across", "mm", 1e3 * one.mean("depth", v),
            1e3 * one.refit_stop(v), STOP_BAND,
        )
        for one in sizes for v in SPEEDS
    ]  # fmt: skip
    for v in SPEEDS:
        deep = _to_beads(sizes, [one.mean("depth", v) for one in sizes])
        rows.append(
            Comparison(f"depth at {v:g} m/s, to the beads' size", "mm", 1e3 * published(v)[0], 1e3 * deep, DEPTH_BAND)
        )
    rows += [
        Comparison(
            f"k/m of what depends on depth alone, {one.across - 1} across", "1/s2", K_OVER_M, one.law.k_over_m, K_BAND
        )
        for one in sizes
    ]
    finest = sizes[-1]
    slope = float(finest.law.drag[finest.law.regressed].mean())
    rows.append(Comparison(f"1 / d1, mean over the depths, {finest.across - 1} across", "1/m", 1 / D1, slope, D1_BAND))
    first, last = SPEEDS[0], SPEEDS[-1]
    longer = _to_beads(sizes, [one.mean("time", last) / one.mean("time", first) for one in sizes])
    wanted = published(last)[1] / published(first)[1]
    rows.append(
        Comparison(f"time to stop, {last:g} over {first:g} m/s, to the beads' size", "1", wanted, longer, TIME_BAND)
    )
    words = "; ".join(_words(one) for one in sizes)
    box = " x ".join(f"{share:g}" for share in BOX)
    at = ", ".join(f"{speed:g}" for speed in SPEEDS)
    remark = say("drops", words=words, bin=1e3 * BIN, at=at, beads=BEADS, box=box, half=500 * BALL)
    return Outcome(rows, list(_plots(sizes)), [remark])


def _words(one: Size) -> str:
    law, fitted = one.law, one.fitted
    near, deep = law.regressed & ~law.beyond, law.regressed & law.beyond
    stood = ", ".join(f"{1e3 * one.mean('depth', v):.1f} ({1e3 * published(v)[0]:.1f}) at {v:g} m/s" for v in SPEEDS)
    return say(
        "of_size", across=one.across - 1, count=int(one.falls[0]["count"]), packing=float(one.falls[0]["packing"]),
        drops=len(one.falls), stood=stood, near=float(law.drag[near].mean()), deep=float(law.drag[deep].mean()),
        deep_error=float(law.drag[deep].std(ddof=1) / math.sqrt(max(1, deep.sum()))), k_over_m=law.k_over_m,
        misfit=100 * law.misfit, refit=100 * law.misfit_of(fitted), fitted=fitted.k_over_m,
        theirs=100 * law.misfit_of(PUBLISHED), drags=listed(fitted.drag, ".0f"),
    )  # fmt: skip


def _plots(sizes: Sequence[Size]) -> Iterator[Plot]:
    speeds = np.linspace(SPEEDS[0], SPEEDS[-1], 40)
    curves = [Curve("published law", speeds, [1e3 * published(v)[0] for v in speeds], False)]
    curves += [
        Curve(f"bed, {one.across - 1} across", SPEEDS, [1e3 * one.mean("depth", v) for v in SPEEDS]) for one in sizes
    ]
    curves.append(
        Curve(
            "to the beads' size",
            SPEEDS,
            [1e3 * _to_beads(sizes, [one.mean("depth", v) for one in sizes]) for v in SPEEDS],
        )
    )
    yield Plot("Depth at which the ball stops", "speed [m/s]", "depth [mm]", curves)
    law = sizes[-1].law
    curves = []
    for wanted in (0.003, 0.007, 0.015):
        k = int(np.abs(law.depth - wanted).argmin())
        squares, top = law.squares[:, k], float(np.nanmax(law.squares[:, k]))
        line, name = np.array([0.0, top]), f"{1e3 * law.depth[k]:.0f} mm"
        curves.append(Curve(f"line, {name}", line, law.drag[k] * line + law.rest[k], False))
        here = np.isfinite(squares)
        curves.append(Curve(f"bed, {name}", squares[here], law.force[here, k]))
    title = f"Force at fixed depths over v^2, {sizes[-1].across - 1} across"
    yield Plot(title, "v^2 [m2/s2]", "F / m [m/s2]", curves)
    curves = [Curve("published 1 / d1", [0.0, 40.0], [1 / D1] * 2, False)]
    for one in sizes:
        known = one.law.regressed
        curves.append(Curve(f"bed, {one.across - 1} across", 1e3 * one.law.depth[known], one.law.drag[known]))
    yield Plot("Slope over v^2 at each depth", "depth [mm]", "1 / d1 [1/m]", curves)
    curves = [Curve("published k z / m", [0.0, 40.0], [0.0, 0.04 * K_OVER_M], False)]
    curves += [Curve(f"bed, {one.across - 1} across", 1e3 * one.law.depth, one.law.rest) for one in sizes]
    yield Plot("What depends on depth alone", "depth [mm]", "F / m less v^2 / d1 [m/s2]", curves)


CASES = {"katsuragi-durian": _drops}
