"""A small platform in space and a small bed under it, for tests of runs in space."""

import math
from pathlib import Path

import numpy as np

__all__ = ["CUBE", "small_bed"]

CUBE = Path(__file__).parents[1] / "experiments/examples/platform-cube/cube.toml"
"""A cube on eight spikes, 30 mm across, with wheels about x and y, that ships."""


def small_bed(*_):
    """Two layers of large grains, almost at rest."""
    from dem import Bed
    from dem.grains.materials import SAND

    d, rows = 6e-3, 20
    low = [((i + 0.5) * d, (j + 0.5) * d, 0.5 * d) for i in range(rows) for j in range(rows)]
    high = [((i + 1.0) * d, (j + 1.0) * d, 0.5 * d + d * math.sqrt(0.5)) for i in range(rows) for j in range(rows)]
    positions = np.array(low + high) % [rows * d, rows * d, 1.0]
    bed = Bed.from_grains(
        SAND, positions=positions, radii=np.full(len(positions), 0.5 * d), young=1e6, max_overlap=0.2,
        size=(rows * d, rows * d, 0.05), height=0.3, threads=1, gravity=1.0,
    )  # fmt: skip
    bed.advance(200)
    bed.surface = float((bed.grains().position[:, 2] + 0.5 * d).max())
    return bed
