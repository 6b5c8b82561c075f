"""Spikes driven into beds of one size and graded beds, crossed with how densely the beds are prepared.

    python docs/results/graded-packing/crossed.py OUT.jsonl BED,BED... SEED,SEED... [PUSHES [SET_DOWNS]]

BED is SIZES, SIZES@START, SIZES:PACKING or SIZES@START:PACKING. SIZES: ``one`` (one size, rained from the lattice),
``sequence`` (one size, rained like a graded bed), or a half width of the fine zone over the spike's diameter and its
depth [mm], such as ``1.5x24``. START: packing fraction of the column of a graded bed, as ``dem.grains.graded._START``.
PACKING: the bed is then brought to this packing fraction by ``Bed.prepare(packing=...)``.

A line for each push or set-down: the bed; packing fractions before it of a cylinder of 18 mm across, 2 to 18 mm deep
(phi), and of one of 36 mm, 2 to 28 mm deep (phi_wide), about the spike's axis; mean forces from 0 to 5 and from 5 to
10 mm [N], or the sinkage under 0.219 N [m].
"""

import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.spatial import cKDTree

from coupling import BedGround, drive, set_down
from dem import SAND, Bed, Graded, measure_grading
from dem.grains import graded
from rigid.platform.spike import Spike

SIZE = (0.084, 0.048, 0.036)
SPIKE = Spike(diameter=0.012, length=0.06)
PUSHES = ((0.042, 0.006), (0.042, 0.018), (0.042, 0.030), (0.042, 0.042))
SET_DOWNS = ((0.042, 0.012), (0.042, 0.036))
FINE, COARSE = 0.003, 0.0072


def sizes_of(name: str) -> tuple[Any, float, float | None]:
    """The sizes, the start of the column and the packing fraction that a bed's name asks for."""
    name, _, packing = name.partition(":")
    name, _, start = name.partition("@")
    grain: Any = FINE
    if name != "one":
        times, depth = (1.5, 24.0) if name == "sequence" else (float(number) for number in name.split("x"))
        middle, beside = 0.5 * SIZE[0], times * SPIKE.diameter
        grain = Graded(
            fine=FINE, coarse=FINE if name == "sequence" else COARSE, footprints=((middle - beside, middle + beside),),
            depth=depth / 1000,
        )  # fmt: skip
    return grain, float(start) if start else graded._START, float(packing) if packing else None


def made(name: str, seed: int, path: Path) -> dict[str, Any]:
    """Make the bed of a name, save it, and tell what it is."""
    grain, start, packing = sizes_of(name)
    spread = {"spread": 0.15} if isinstance(grain, float) else {}
    began = os.times().user
    with patch.object(graded, "_START", start):
        bed = Bed.prepare(
            SAND, size=SIZE, grain=grain, gravity=9.80665, seed=seed, young=1.6e7, max_overlap=0.05, threads=1,
            packing=packing, cache=False, **spread,
        )  # fmt: skip
    bed.save(path)
    line = {"bed": name, "seed": seed, "grains": bed.grain_count, "packing": bed.packing_fraction}
    line |= {"surface_m": bed.surface, "coordination": bed.coordination_number}
    if isinstance(grain, Graded):
        found = measure_grading(bed, grain)
        line |= {"strayed": found.strayed_share, "drained": found.drained_share, "fine_count": found.fine_count}
        line |= {"zones": {zone.name: zone.packing for zone in found.zones}}
    return line | {"processor_s": os.times().user - began}


def packing_about(bed: Any, at: tuple[float, float], *, radius: float, top: float, bottom: float) -> float:
    """Packing fraction of a cylinder about a place, from `top` to `bottom` below the surface [m], by 30,000 points."""
    rng, grains, width = np.random.default_rng(0), bed.grains(), np.array(SIZE[:2])
    angle, far = rng.uniform(0, 2 * np.pi, 30_000), radius * np.sqrt(rng.uniform(0, 1, 30_000))
    height = rng.uniform(bed.surface - bottom, bed.surface - top, 30_000)
    points = np.c_[(at[0] + far * np.cos(angle)) % width[0], (at[1] + far * np.sin(angle)) % width[1], height]
    centres = np.c_[grains.position[:, :2] % width, grains.position[:, 2]]
    inside = np.zeros(len(points), dtype=bool)
    for found in cKDTree(points, boxsize=(*width, 0.0)).query_ball_point(centres, grains.radius):
        inside[found] = True
    return float(inside.mean())


def main(out: Path, names: list[str], seeds: list[int], pushes: int, set_downs: int) -> None:
    """Add the lines of these beds to a file."""
    runs = [("push", at) for at in PUSHES[:pushes]] + [("set", at) for at in SET_DOWNS[:set_downs]]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bed.npz"
        for seed in seeds:
            for name in names:
                about = made(name, seed, path)
                lines = ({"kind": kind, "y": at[1]} | met(kind, at, path) for kind, at in runs)
                for line in lines if runs else [{"kind": "bed"}]:
                    with out.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(about | line) + "\n")


def met(kind: str, at: tuple[float, float], path: Path) -> dict[str, float]:
    """Packing about a place of the bed, and what a spike meets there."""
    bed = Bed.load(path, threads=1)
    bed.overlap_limit = 0.12
    near = packing_about(bed, at, radius=0.009, top=0.002, bottom=0.018)
    line = {"phi": near, "phi_wide": packing_about(bed, at, radius=0.018, top=0.002, bottom=0.028)}
    began, ground = os.times().user, BedGround(bed, SPIKE, at=at)
    if kind == "push":
        run = drive(SPIKE, into=ground, speed=0.2, depth=0.010, hold=1e-4, retreat=False)
        depth, force = run.depth[run.phase == "in"], run.force[run.phase == "in"]
        line |= {"F05": float(force[depth < 0.005].mean()), "F": float(force[depth >= 0.005].mean())}
    else:
        run = set_down(SPIKE, onto=ground, load=0.219, lowering_speed=0.1)
        line |= {"sinkage_m": float(run.depth[-1])}
    return line | {"overlap": bed.max_overlap, "run_s": os.times().user - began}


if __name__ == "__main__":
    counts = [int(word) for word in sys.argv[4:6]]
    main(
        Path(sys.argv[1]), sys.argv[2].split(","), [int(seed) for seed in sys.argv[3].split(",")],
        *(counts + [4, 0][len(counts):]),
    )  # fmt: skip
