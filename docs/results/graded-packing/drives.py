"""Spikes driven into beds rained in three ways: graded, of one size as a graded bed is rained, and of one size.

    python docs/results/graded-packing/drives.py OUT.jsonl SEED,SEED... graded,same,uniform

A line for each drive: the bed, the packing under the tip before it (a cylinder of 18 mm across, 2 to 18 mm below the
surface, by 60,000 random points), mean forces from 0 to 5 and from 5 to 10 mm [N].
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from coupling import BedGround, drive
from dem import SAND, Bed, Graded
from rigid.platform.spike import Spike

SIZE = (0.084, 0.048, 0.036)
PLACES = tuple((0.042, y) for y in (0.006, 0.018, 0.030, 0.042))
KINDS: dict[str, Any] = {
    "graded": Graded(fine=0.003, coarse=0.0072, footprints=((0.024, 0.060),), depth=0.024),
    "same": Graded(fine=0.003, coarse=0.003, footprints=((0.024, 0.060),), depth=0.024),
    "uniform": 0.003,
}


def made(kind: str, seed: int) -> Any:
    """The bed, from the cache where it is there; its drives may overlap by 12 %."""
    spread = {"spread": 0.15} if kind == "uniform" else {}
    bed = Bed.prepare(
        SAND,
        size=SIZE,
        grain=KINDS[kind],
        gravity=9.80665,
        seed=seed,
        young=1.6e7,
        max_overlap=0.05,
        threads=1,
        **spread,
    )
    bed.overlap_limit = 0.12
    return bed


def packing_under(bed: Any, at: tuple[float, float]) -> float:
    """Packing fraction under a place."""
    rng, grains, width = np.random.default_rng(0), bed.grains(), np.array(SIZE[:2])
    angle, far = rng.uniform(0, 2 * np.pi, 60_000), 0.009 * np.sqrt(rng.uniform(0, 1, 60_000))
    height = rng.uniform(bed.surface - 0.018, bed.surface - 0.002, 60_000)
    points = np.c_[(at[0] + far * np.cos(angle)) % width[0], (at[1] + far * np.sin(angle)) % width[1], height]
    centres = np.c_[grains.position[:, :2] % width, grains.position[:, 2]]
    near = cKDTree(centres, boxsize=(*width, 0.0)).query_ball_point(points, grains.radius.max())
    inside = 0
    for point, others in zip(points, near, strict=True):
        apart = point - centres[others]
        apart[:, :2] -= width * np.round(apart[:, :2] / width)
        inside += bool(((apart**2).sum(axis=1) < grains.radius[others] ** 2).any())
    return inside / len(points)


def main(out: Path, seeds: list[int], kinds: list[str]) -> None:
    """Add the lines of these beds to a file."""
    spike = Spike(diameter=0.012, length=0.06)
    for seed in seeds:
        for kind in kinds:
            for at in PLACES:
                bed = made(kind, seed)
                packing, count, surface = packing_under(bed, at), bed.grain_count, bed.surface
                run = drive(spike, into=BedGround(bed, spike, at=at), speed=0.2, depth=0.010, hold=1e-4, retreat=False)
                depth, force = run.depth[run.phase == "in"], run.force[run.phase == "in"]
                line = {"seed": seed, "kind": kind, "n": count, "surface": surface, "packing": bed.packing_fraction}
                line |= {"y": at[1], "phi": packing, "overlap": bed.max_overlap}
                line |= {
                    "F05": float(force[(depth >= 0) & (depth < 0.005)].mean()),
                    "F": float(force[depth >= 0.005].mean()),
                }
                with out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), [int(seed) for seed in sys.argv[2].split(",")], sys.argv[3].split(","))
