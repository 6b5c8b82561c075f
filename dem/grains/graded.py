"""Graded beds: grains as fine as a tip wants where it comes down, coarser away from there, and none that drain.

The mean diameter is a field over the bed's length x and height z, the same across y: ``fine`` under the footprints,
down to a depth, and from there on ``growth`` metres more for each metre away, up to ``coarse``. Small grains fall
through large ones where they fit between them. Three spheres of diameter D that touch leave a throat of 2 / sqrt(3) - 1
= 0.155 D, which is D / 6.46. A smaller grain falls through a dense packing by its own weight (Savage & Lun 1988, J.
Fluid Mech. 189:311); four in a square leave sqrt(2) - 1 = 0.414 D. So that no grain passes even those, the field rises
no faster than ``steepest``. Rings of five and more leave wider ones; docs/bed.md has how much goes through.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .packing import curve_ranks
from .sizes import Json, Uniform

__all__ = ["NARROWEST", "THROAT", "Graded", "middles", "steepest"]

THROAT = math.sqrt(2) - 1  # The throat of four like spheres in a square, over their diameter [1]
NARROWEST = 2 / math.sqrt(3) - 1  # that of three which touch: 1 / 6.46 [1]
DRIFT = 2.0
"""So many diameters of the larger one may grains of the field have come closer to one another than they belong [1]."""
_WIDTHS, _DEPTHS = 6, 4  # a bed is at least so many of its coarsest grains wide and deep, as of its mean ones elsewhere
# The column that is rained: packing fraction at the start, and at rest. The denser the column, the looser it lies
# (docs/bed.md): from this one a bed lies looser than one of one size, so that a few taps bring it to the same packing.
_START, _RESTED = 0.36, 0.57
_CLEAR, _PUSHED = 1.02, 1.06  # centres are at least so many sums of radii apart; pushed to so many
_ROUNDS = 1000
_BLOCK = 100_000  # grains looked at in one go, for memory's sake


def steepest(spread: float) -> float:
    """The largest growth of the mean diameter with distance at which no grain drains [1].

    At a growth g a grain d and one of the mean diameter D that lies ``DRIFT`` D away differ by d = D (1 - DRIFT g).
    With the spread s the smallest of the one kind and the largest of the other differ by (1 - s) / (1 + s) more. The
    ratio stays at ``THROAT`` or above.

    ``spread``: of the diameters about their mean, over it [1]. Raises ValueError: one so wide that grains of one place
    would drain through one another.
    """
    if not 0 <= spread < (1 - THROAT) / (1 + THROAT):
        raise ValueError(
            f"Graded: spread = {spread} must be 0 or more and below {(1 - THROAT) / (1 + THROAT):.3g}: beyond, the "
            f"smallest grains of one place fall through gaps between the largest"
        )
    return (1 - THROAT * (1 + spread) / (1 - spread)) / DRIFT


@dataclass(frozen=True, kw_only=True)
class Graded:
    """Sizes by place: fine under the footprints, coarser away from them; ``grain`` of ``Bed.prepare``.

    Attributes:
        fine: mean diameter under the footprints [m]; for a tip's force a fifth of its diameter at most.
        coarse: largest mean diameter away from them [m].
        footprints: (from, to) along x of each strip of fine grains [m], within the bed; they go all the way across y.
        depth: how far down from the levelled surface the fine grains reach [m]; to the floor when None.
        growth: of the mean diameter with the distance from the fine grains [1]; at most ``steepest(spread)``.
        spread: diameters are uniform within the mean of their place (1 +- spread) [1].
    """

    fine: float
    coarse: float
    footprints: tuple[tuple[float, float], ...]
    depth: float | None = None
    growth: float = 0.15
    spread: float = 0.15

    def __post_init__(self):
        for key in ("fine", "coarse", "depth"):
            value: Any = getattr(self, key)
            if key == "depth" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
                raise ValueError(f"Graded: {key} = {value!r} must be a positive length [m]")
        if self.coarse < self.fine:
            raise ValueError(f"Graded: coarse = {self.coarse} m is below fine = {self.fine} m: give that or more")
        most = steepest(self.spread)
        if not 0 < self.growth <= most:
            raise ValueError(
                f"Graded: growth = {self.growth} must be above 0 and, with spread = {self.spread:g}, at most "
                f"{most:.3g}: beyond, small grains within {DRIFT:g} diameters of large ones fall through their gaps"
            )
        given: Sequence[Sequence[float]] = self.footprints
        if not len(given) or not all(len(strip) == 2 for strip in given):
            raise ValueError(f"Graded: footprints = {given!r} must be pairs (from, to) along x [m], one at least")
        strips = tuple(sorted((float(a), float(b)) for a, b in given))
        if not all(math.isfinite(a) and math.isfinite(b) and a < b for a, b in strips):
            raise ValueError(f"Graded: footprints = {given!r} must each begin before they end [m]")
        object.__setattr__(self, "footprints", strips)

    @classmethod
    def of(cls, described: Json) -> "Graded":
        """What ``dem.grains.sizes.describe`` wrote down."""
        return cls(**{field.name: described[field.name] for field in fields(cls)})

    @property
    def mean(self) -> float:
        """What stands for the grains where one diameter is asked for [m]: that under the footprints."""
        return self.fine

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest diameter that there can be [m]."""
        return self.fine * (1 - self.spread), self.coarse * (1 + self.spread)

    @property
    def local(self) -> Uniform:
        """The sizes under the footprints."""
        return Uniform(self.fine, self.spread)

    def check(self, size: Sequence[float]) -> None:
        """Raise ValueError for a bed of a ``size``, widths and depth [m], that these sizes do not fit."""
        for low, high in self.footprints:
            if low < 0 or high > size[0]:
                raise ValueError(
                    f"Graded: the footprint from {low:g} to {high:g} m is outside the bed, which reaches from 0 to "
                    f"{size[0]:g} m along x: give a longer bed or a footprint within it"
                )
        if self.depth is not None and self.depth > size[2]:
            raise ValueError(
                f"Graded: depth = {self.depth:g} m is more than the bed's, {size[2]:g} m; leave it out to have fine "
                f"grains down to the floor"
            )
        largest = self.largest(size)
        for name, length, least in (("x", size[0], _WIDTHS), ("y", size[1], _WIDTHS), ("z", size[2], _DEPTHS)):
            if length < least * largest * (1 - 1e-9):
                raise ValueError(
                    f"Graded: coarse = {self.coarse:g} m makes grains of {largest:.4g} m, and size: {name} = {length} "
                    f"m is less than {least} of them; give at most coarse = "
                    f"{math.floor(1e5 * length / least + 1e-6) / 1e5:g} m"
                )

    def distance(self, x: np.ndarray, z: np.ndarray, size: Sequence[float]) -> np.ndarray:
        """Distance [m] from the fine grains, 0 among them, of places x, z [m], of one shape; periodic along x."""
        along = np.mod(x, size[0])
        aside = np.full(np.shape(along), np.inf)
        for low, high in self.footprints:
            for image in (-size[0], 0.0, size[0]):
                aside = np.minimum(aside, np.maximum(np.maximum(low + image - along, along - high - image), 0.0))
        below = 0.0 if self.depth is None else np.maximum(size[2] - self.depth - np.asarray(z), 0.0)
        return np.hypot(aside, below)

    def diameter(self, x: np.ndarray, z: np.ndarray, size: Sequence[float]) -> np.ndarray:
        """The mean diameter that belongs to a place [m]; as for ``distance``."""
        return np.minimum(self.coarse, self.fine + self.growth * self.distance(x, z, size))

    def largest(self, size: Sequence[float]) -> float:
        """The largest mean diameter in a bed of this size [m]: farthest from the footprints, at the floor."""
        ends, gap = self.footprints[-1][1] - size[0], 0.0
        for low, high in self.footprints:
            gap, ends = max(gap, low - ends), max(ends, high)
        below = 0.0 if self.depth is None else size[2] - self.depth
        return min(self.coarse, self.fine + self.growth * math.hypot(0.5 * gap, below))

    def share(self, size: Sequence[float]) -> float:
        """Grains of such a bed over those of one that is fine throughout [1]: the mean of (fine / d)^3."""
        x, z = middles(self.fine, size[0], size[2])
        return float(((self.fine / self.diameter(x, z, size)) ** 3).mean())

    def column(self, rng: np.random.Generator, volume: float, size: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Grains of this solid volume in a loose column over the bed, none touching, each above its place.

        Heights are those at rest times ``_RESTED / _START``. Places come evenly from a low-discrepancy sequence (the
        additive recurrence of Roberts 2018, alpha_k = phi^-k with phi^5 = phi + 1). They are kept with probability
        (fine / d)^3. Grains that overlap there are pushed apart.

        Returns centres [m], shape [grain_count, 3], and radii [m], shape [grain_count], in the order of a curve through
        space. Raises RuntimeError: the grains do not fit into the column; a bed that passes ``check`` never raises it.
        """
        top = volume / (_START * size[0] * size[1])
        count = round(volume / (math.pi / 6 * self.fine**3 * (1 + self.spread**2)))
        phi = 2.0
        for _ in range(60):
            phi = (1 + phi) ** (1 / 5)
        steps = np.arange(count)[:, None] * phi ** -np.arange(1.0, 5.0)
        even = (steps + rng.uniform(0, 1, 4)) % 1.0
        homes = even[:, :3] * (size[0], size[1], top)
        diameters = self.diameter(homes[:, 0], homes[:, 2] * _START / _RESTED, size)
        kept = even[:, 3] < (self.fine / diameters) ** 3
        homes, diameters = homes[kept], diameters[kept]
        radii = 0.5 * diameters * (1 + self.spread * rng.uniform(-1, 1, len(homes)))
        positions = _moved_apart(homes, radii, (float(size[0]), float(size[1])))
        order = _along_curve(positions * (1, 1, _START / _RESTED), self.fine, size)
        return positions[order], radii[order]


def middles(step: float, length: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the squares of half of ``step`` or less that cut up a length and a height [m]; two flat arrays."""
    nx, nz = (math.ceil(2 * side / step) for side in (length, height))
    x, z = np.meshgrid((np.arange(nx) + 0.5) * length / nx, (np.arange(nz) + 0.5) * height / nz)
    return x.ravel(), z.ravel()


def _within(places: np.ndarray, radii: np.ndarray, period: tuple[float, float]) -> np.ndarray:
    """Wrapped into the bed, and above its floor."""
    found = places.copy()
    for axis, length in enumerate(period):
        found[:, axis] %= length
        found[found[:, axis] >= length, axis] = 0.0  # -1e-20 % 1 is 1
    found[:, 2] = np.maximum(found[:, 2], _CLEAR * radii)
    return found


def _moved_apart(places: np.ndarray, radii: np.ndarray, period: tuple[float, float]) -> np.ndarray:
    """Centres near ``places``, none touching: those that overlap push one another away, the smaller one farther."""
    places = _within(places, radii, period)
    for _ in range(_ROUNDS):
        one, other = _meeting(places, radii, period)
        between = _between(places, one, other, period)
        apart, need = np.linalg.norm(between, axis=1), radii[one] + radii[other]
        if not (apart < _CLEAR * need).any():
            return places
        push = (_PUSHED * need - apart)[:, None] * between / np.maximum(apart, 1e-9 * need)[:, None]
        share = (radii[other] / need)[:, None]
        for axis in range(3):
            places[:, axis] += np.bincount(one, (share * push)[:, axis], len(places))
            places[:, axis] -= np.bincount(other, ((1 - share) * push)[:, axis], len(places))
        places = _within(places, radii, period)
    raise RuntimeError(f"the {len(places)} grains of a graded bed do not fit into their column")


def _between(places: np.ndarray, one: np.ndarray, other: np.ndarray, period: tuple[float, float]) -> np.ndarray:
    """From each other to each one, or to its nearest image [m], shape [pair, 3]."""
    between = places[one] - places[other]
    between[:, :2] -= period * np.round(between[:, :2] / period)
    return between


def _meeting(places: np.ndarray, radii: np.ndarray, period: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Pairs closer than ``_PUSHED`` sums of radii; the first is the larger one, so that its own reach finds all."""
    from scipy.spatial import cKDTree  # here, since few scripts need it and it is slow to import

    tree = cKDTree(places, boxsize=(*period, 0.0))
    found = []
    for start in range(0, len(places), _BLOCK):
        block = np.arange(start, min(start + _BLOCK, len(places)))
        near = tree.query_ball_point(places[block], 2 * _PUSHED * radii[block], return_sorted=True)
        one = np.repeat(block, [len(others) for others in near])
        other = np.concatenate(near).astype(np.intp)
        larger = (radii[other] < radii[one]) | ((radii[other] == radii[one]) & (other < one))
        between = _between(places, one, other, period)
        close = (between**2).sum(axis=1) < (_PUSHED * (radii[one] + radii[other])) ** 2
        found.append((one[larger & close], other[larger & close]))
    return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])


def _along_curve(positions: np.ndarray, cell: float, size: Sequence[float]) -> np.ndarray:
    """The order of a Morton curve through cells of this size [m], which ids within one of the engine's cells follow."""
    shape = [*(max(1, math.ceil(length / cell)) for length in size[:2]), 1]
    shape[2] = int(positions[:, 2].max() / cell) + 1
    i, j, k = (np.minimum((positions[:, a] / cell).astype(int), shape[a] - 1) for a in range(3))
    return np.argsort(curve_ranks(*shape)[(k * shape[1] + j) * shape[0] + i], kind="stable")
