"""What has become of a graded bed: sizes by place and depth, packing by zone, and whether small grains have drained."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dem.engine.core import BedCore
from dem.grains.graded import THROAT, Graded, middles
from dem.grains.packing import bulk_packing, surface_height

__all__ = [
    "MOST_DRAINED", "MOST_STRAYED", "Grading", "Layer", "Zone", "measure_grading", "packing_under", "surface_under",
]  # fmt: skip

Array = np.ndarray

# So many mean diameters of its place beyond where it belongs a grain has strayed; the rain scatters most less far.
_SCATTER = 1.0
_FINENESS = 8  # squares of half a fine diameter over this measure the zones
_LEAST = 30.0  # a zone of fewer of its grains' cubes has no packing fraction to speak of
MOST_STRAYED, MOST_DRAINED = 0.02, 1e-4
"""Shares of the solid volume; with more out of place, or small enough to fall through, the grading did not hold [1]."""


@dataclass(frozen=True)
class Zone:
    """The grains of one part of the bed. Diameters in m, shares of the bed's solid volume.

    Attributes:
        name: "under the footprints", "between" or "coarse".
        wanted: mean of what belongs to the grains' places. mean, smallest, largest: of what lies there; None: no grain.
        packing: fraction [1], a diameter away from floor and surface; None where too little is left to say.
    """

    name: str
    grain_count: int
    share: float
    wanted: float | None
    mean: float | None
    smallest: float | None
    largest: float | None
    packing: float | None


@dataclass(frozen=True)
class Layer:
    """Mean diameters between two heights [m], under the footprints and elsewhere; None where there are no grains."""

    bottom: float
    top: float
    under: float | None
    elsewhere: float | None


@dataclass(frozen=True)
class Grading:
    """How a graded bed lies.

    Attributes:
        zones: by distance from the fine grains. layers: by height, from the floor up.
        drained_share: share of the solid volume in grains that could drain [1]: they fit through the widest throat
            (``THROAT``) between the largest grains nearby.
        strayed_share: in grains farther out than any of their size belongs, by more than a mean diameter there [1].
        farthest: the farthest of these, in such diameters [1]; 0: none is beyond where it belongs.
        touching_ratio: the largest ratio of the diameters of two grains that touch [1]; a grain falls through three
            that touch where they are 6.46 times as large (``dem.grains.graded``).
        fine_count: grains of a bed of the same size that is fine throughout, at the same packing fraction.
    """

    zones: list[Zone]
    layers: list[Layer]
    drained_share: float
    strayed_share: float
    farthest: float
    touching_ratio: float
    grain_count: int
    fine_count: int

    @property
    def held(self) -> bool:
        """Whether small grains stayed where they belong, by ``MOST_STRAYED`` and ``MOST_DRAINED``."""
        return self.strayed_share <= MOST_STRAYED and self.drained_share <= MOST_DRAINED


def measure_grading(bed: BedCore, graded: Graded) -> Grading:
    """Measure how the grains of a bed lie, beside the field of sizes that they were drawn from."""
    grains = bed.grains()
    position, d = grains.position, 2 * grains.radius
    x, z, size = position[:, 0], position[:, 2], bed.size
    solid = math.pi / 6 * d**3
    total = float(solid.sum())
    distance = graded.distance(x, z, size)
    place = graded.diameter(x, z, size)
    belongs = (d / (1 - graded.spread) - graded.fine) / graded.growth
    belongs[d >= graded.coarse * (1 - graded.spread)] = math.inf
    beyond = np.maximum(distance - np.maximum(belongs, 0.0), 0.0) / place
    falls = d < THROAT * (1 + graded.spread) * place
    return Grading(
        zones=_zones(size, bed.surface, graded, x, z, d, solid, distance, place),
        layers=_layers(graded, x, z, d, size, bed.surface),
        drained_share=float(solid[falls].sum()) / total,
        strayed_share=float(solid[beyond > _SCATTER].sum()) / total,
        farthest=float(beyond.max()),
        touching_ratio=_touching_ratio(position, d, size[:2]),
        grain_count=len(d),
        fine_count=round(total / (math.pi / 6 * graded.fine**3 * (1 + graded.spread**2))),
    )


def _touching_ratio(position: Array, d: Array, period: Sequence[float]) -> float:
    """Largest ratio of the diameters of two grains that touch, from their centres [m] and diameters ``d`` [m]."""
    from scipy.spatial import cKDTree  # here, since it is slow to import

    inside = position.copy()
    inside[:, :2] %= period
    inside[:, :2][inside[:, :2] >= period] = 0.0  # what rounds to the period itself
    inside[:, 2] -= inside[:, 2].min()
    pairs = cKDTree(inside, boxsize=(*period, 0.0)).query_pairs(float(d.max()), output_type="ndarray")
    apart = inside[pairs[:, 0]] - inside[pairs[:, 1]]
    apart[:, :2] -= period * np.round(apart[:, :2] / period)
    one, other = d[pairs[:, 0]], d[pairs[:, 1]]
    touch = np.linalg.norm(apart, axis=1) < 0.5 * (one + other)
    return float((np.maximum(one, other) / np.minimum(one, other))[touch].max(initial=1.0))


def surface_under(bed: BedCore, graded: Graded) -> float:
    """Height of the surface under the footprints [m], as ``Bed.surface`` is of the whole bed."""
    grains = bed.grains()
    here = _under(graded, grains.position[:, 0], bed.size[0])
    heights, radii = grains.position[here, 2], grains.radius[here]
    covered = end = 0.0  # length along x that footprints cover [m]
    for low, high in graded.footprints:
        covered += max(0.0, high - max(low, end))
        end = max(end, high)
    area = bed.size[1] * covered
    return surface_height(heights, radii, area, bulk=bulk_packing(heights, radii, area))


def packing_under(bed: BedCore, graded: Graded) -> float:
    """Packing fraction of the fine grains under the footprints [1]; of the whole bed where they are too few to say."""
    grains = bed.grains()
    x, z, d = grains.position[:, 0], grains.position[:, 2], 2 * grains.radius
    distance, place = graded.distance(x, z, bed.size), graded.diameter(x, z, bed.size)
    surface = surface_under(bed, graded)
    found = _zones(bed.size, surface, graded, x, z, d, math.pi / 6 * d**3, distance, place)[0].packing
    return bed.packing_fraction if found is None else found


def _under(graded: Graded, x: np.ndarray, length: float) -> np.ndarray:
    """Whether places are under the footprints."""
    along = np.mod(x, length)
    return np.logical_or.reduce([(along >= low) & (along <= high) for low, high in graded.footprints])


def _zones(
    size: Sequence[float], surface: float, graded: Graded, x: Array, z: Array, d: Array, solid: Array, distance: Array,
    place: Array,
) -> list[Zone]:  # fmt: skip
    full = (graded.coarse - graded.fine) / graded.growth
    grid_x, grid_z = middles(graded.fine / _FINENESS, size[0], surface)
    cell = size[0] * size[1] * surface / len(grid_x)
    grid_distance, grid_place = graded.distance(grid_x, grid_z, size), graded.diameter(grid_x, grid_z, size)
    # By centres: a sphere that sticks out of its zone stands for one that sticks into it.
    inner = (z > place) & (z < surface - place)
    grid_inner = (grid_z > grid_place) & (grid_z < surface - grid_place)
    zones = []
    for name, low, high in (("under the footprints", 0.0, 0.0), ("between", 0.0, full), ("coarse", full, math.inf)):

        def within(away: np.ndarray, low: float = low, high: float = high) -> np.ndarray:
            return away == 0 if high == 0 else (away > 0) & (away >= low) & (away < high)

        here, room = within(distance), cell * float((within(grid_distance) & grid_inner).sum())
        count = int(here.sum())
        enough = count > 0 and room > _LEAST * float(place[here].max()) ** 3
        share = float(solid[here].sum() / solid.sum())
        found: list[float | None] = [None] * 4
        if count:
            found = [float(size) for size in (place[here].mean(), d[here].mean(), d[here].min(), d[here].max())]
        packing = float(solid[here & inner].sum()) / room if enough else None
        zones.append(Zone(name, count, share, *found, packing=packing))
    return zones


def _layers(
    graded: Graded, x: np.ndarray, z: np.ndarray, d: np.ndarray, size: tuple[float, ...], surface: float
) -> list[Layer]:
    """Slices of about two of the coarsest diameters, three at least."""
    edges = np.linspace(0.0, surface, max(3, round(surface / (2 * graded.largest(size)))) + 1)
    under = _under(graded, x, size[0])
    layers = []
    for bottom, top in itertools.pairwise(edges.tolist()):
        here = (z >= bottom) & ((z < top) | (top == edges[-1]))
        means = (float(sizes.mean()) if len(sizes) else None for sizes in (d[here & under], d[here & ~under]))
        layers.append(Layer(bottom, top, *means))
    return layers
