"""Katsuragi & Durian's drops: one law of force for all heights, m a = m g - m v^2 / d1 - k z.

As they do, the law is read off a(z, v): at each depth the forces of drops that pass it at different speeds are put on a
straight line over v^2, whose slope is 1 / d1 there and whose start is what depth alone does, k z / m if the law is
right. Both are left free at every depth (``Separated``), so that a bed whose force has another form shows it, and the
law so found is asked for the depths at which the balls of its own drops stop. A fit of d1 and k/m to v^2 over depth,
as it stood here before, hides it: over the first grains the drag is many times as large as deeper down, and one d1 for
all of it stops no ball where it stopped.

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

from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, tracked
from experiments.validate.base.drops import BEADS, Drop

from . import say

__all__ = ["BALL", "CASES", "K_OVER_M", "MASS", "Separated", "energy", "published", "separated"]

BALL, BEAD, MASS, GRAVITY = 0.0254, 0.0003, 0.0692, 9.81  # diameters [m], [kg], [m/s2]
D1, K_OVER_M = 0.087, 1040.0  # published [m], [1/s2]
CLEAR = BALL + BEAD
SPEEDS = (0.4, 0.9, 1.8)  # on touching [m/s]
BOX = (3.2, 3.2, 2.15)  # of the bed, over D + d
PLACES = ((0.25, 0.25), (0.75, 0.75))
SIZES = ((6, ((1, PLACES),)), (8, ((2, PLACES), (3, PLACES))))
"""D + d over d, which is one more than the grains across the ball; seeds of the beds, and places in each."""
STOP_BAND, DEPTH_BAND, TIME_BAND = 0.03, 0.1, 0.15
LONGEST = 0.4  # [s]
BIN = 0.002  # of depth [m]

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

    def misfit_of(self, d1: float, k_over_m: float) -> float:
        """Of the law with two numbers, likewise [1]."""
        return self._misfit(np.full_like(self.drag, 1 / d1), k_over_m * self.depth)

    def _misfit(self, drag: np.ndarray, rest: np.ndarray) -> float:
        off = self.force - self.squares * drag - rest
        return float(np.sqrt(np.nanmean(off**2) / np.nanmean(self.force**2)))

    def two_numbers(self) -> tuple[float, float]:
        """d1 [m] and k/m [1/s2] that come nearest: least squares over all bins and drops of F / m = v^2 / d1 + k z / m.

        Below the bins where the drag is that of the first grains; see ``beyond``.
        """
        here = np.isfinite(self.force) & self.beyond
        deep = np.broadcast_to(self.depth, self.force.shape)[here]
        terms = np.column_stack([self.squares[here], deep])
        slope, k_over_m = np.linalg.lstsq(terms, self.force[here], rcond=None)[0]
        return 1 / float(slope) if slope > 0 else math.inf, float(k_over_m)

    @property
    def beyond(self) -> np.ndarray:
        """Which bins lie deeper than half the ball: there its whole front is in the beads."""
        return self.depth > 0.5 * BALL

    def stop(self, speed: float) -> float:
        """Depth at which the ball stops that touches with ``speed`` [m]; d(v^2)/dz = 2 g - 2 F / m, bin by bin."""
        square, edge = speed**2, 0.0
        for depth, drag, rest in zip(self.depth, self.drag, self.rest, strict=True):
            width = 2 * (depth - edge)
            after = square + 2 * width * (GRAVITY - drag * square - rest) / (1 + width * drag)
            if after <= 0:
                return edge + width * square / (square - after)
            square, edge = after, edge + width
        steady = 2 * (self.rest[-1] - GRAVITY)
        return edge + square / steady if steady > 0 else math.inf


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

    def mean(self, key: str, speed: float) -> float:
        """Of the last values of the drops with this speed."""
        ends = [run[key][-1] for one, run in zip(self.settings, self.falls, strict=True) if one.speed == speed]
        return float(np.mean(ends))


def _sizes(tell: Tell) -> list[Size]:
    planned = [[fall(n, seed, at, v) for seed, places in beds for at in places for v in SPEEDS] for n, beds in SIZES]
    runs = iter([one.run() for one in tracked([one for each in planned for one in each], tell)])
    found = []
    for (across, _), settings in zip(SIZES, planned, strict=True):
        falls = [next(runs) for _ in settings]
        found.append(Size(across, settings, falls, separated(falls, [one.speed for one in settings])))
    return found


def _to_beads(sizes: Sequence[Size], values: Sequence[float]) -> float:
    """What beads of the experiment's size would have, on a straight line in d / (D + d)."""
    return float(np.polyval(np.polyfit([1 / one.across for one in sizes], values, 1), BEAD / CLEAR))


def _drops(tell: Tell) -> Outcome:
    sizes = _sizes(tell)
    rows = [
        Comparison(
            f"stop at {v:g} m/s by its own a(z, v), {one.across - 1} across", "mm", 1e3 * one.mean("depth", v),
            1e3 * one.law.stop(v), STOP_BAND,
        )
        for one in sizes for v in SPEEDS
    ]  # fmt: skip
    for v in SPEEDS:
        deep = _to_beads(sizes, [one.mean("depth", v) for one in sizes])
        rows.append(
            Comparison(f"depth at {v:g} m/s, to the beads' size", "mm", 1e3 * published(v)[0], 1e3 * deep, DEPTH_BAND)
        )
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
    law = one.law
    d1, k_over_m = law.two_numbers()
    near, deep = law.regressed & ~law.beyond, law.regressed & law.beyond
    stood = ", ".join(f"{1e3 * one.mean('depth', v):.1f} ({1e3 * published(v)[0]:.1f}) at {v:g} m/s" for v in SPEEDS)
    return say(
        "of_size", across=one.across - 1, count=int(one.falls[0]["count"]), packing=float(one.falls[0]["packing"]),
        drops=len(one.falls), stood=stood, near=float(law.drag[near].mean()), deep=float(law.drag[deep].mean()),
        deep_error=float(law.drag[deep].std(ddof=1) / math.sqrt(max(1, deep.sum()))), d1=100 * d1, k_over_m=k_over_m,
        misfit=100 * law.misfit, two=100 * law.misfit_of(d1, k_over_m), theirs=100 * law.misfit_of(D1, K_OVER_M),
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
