"""Packing fraction at rest of beds of one size that are rained from columns of different order.

    python docs/results/graded-packing/columns.py OUT.jsonl MATERIAL SEED,SEED... COLUMN,COLUMN... [X,Y,Z GRAIN]

COLUMN is ``lattice`` (as beds of one size are rained), ``displaced`` (each of its layers displaced sideways at random)
or a number: the low-discrepancy sequence of graded beds at about that packing fraction. Lengths in metres. A line for
each bed; nothing is kept in the cache.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from dem import Bed, Graded
from dem.grains import graded
from dem.grains.packing import draw_radii, rain_positions


def lattice(rng: np.random.Generator, volume: float, sizes: Graded, size: Any, *, displaced: bool) -> Any:
    """Centres and radii of the column of a bed of one size."""
    radii = draw_radii(rng, volume, sizes.local)
    positions = rain_positions(rng, radii, size[:2])
    if displaced:
        nx, ny = (int(length / (1.02 * 2 * radii.max())) for length in size[:2])
        layer = np.arange(len(radii)) // (nx * ny)
        positions[:, :2] += (rng.uniform(0, 1, (layer.max() + 1, 2)) * size[:2])[layer]
        positions[:, :2] %= size[:2]
    return positions, radii


def made(name: str, material: str, seed: int, size: tuple[float, ...], grain: float) -> dict[str, Any]:
    """A line: the bed and its packing."""
    sizes, plain, found = Graded(fine=grain, coarse=grain, footprints=((0.0, size[0]),)), Graded.column, {}

    def column(self: Graded, rng: np.random.Generator, volume: float, size: Any) -> Any:
        if name in ("lattice", "displaced"):
            positions, radii = lattice(rng, volume, self, size, displaced=name == "displaced")
        else:
            positions, radii = plain(self, rng, volume, size)
        high = float((positions[:, 2] + radii).max())
        found["column_packing"] = float((4 / 3 * math.pi * radii**3).sum() / (size[0] * size[1] * high))
        return positions, radii

    start = graded._START if name in ("lattice", "displaced") else float(name)
    with patch.object(Graded, "column", column), patch.object(graded, "_START", start):
        bed = Bed.prepare(
            material, size=size, grain=sizes, gravity=9.80665, seed=seed, young=1.6e7, threads=1, cache=False
        )
    line = {"column": name, "material": material, "seed": seed, "size_m": size, "grain_m": grain}
    line |= {"grains": bed.grain_count, **found, "packing": bed.packing_fraction}
    return line | {"coordination": bed.coordination_number, "surface_m": bed.surface}


def main(out: Path, material: str, seeds: str, columns: str, size: str = "0.048,0.048,0.036", grain: str = "0.003"):
    """Add the lines of these beds to a file."""
    extent = tuple(float(length) for length in size.split(","))
    for seed in seeds.split(","):
        for name in columns.split(","):
            line = made(name, material, int(seed), extent, float(grain))
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
