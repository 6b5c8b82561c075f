"""A spike that is pushed into a bed of sand and then dragged sideways: in this process, and with the grains in LAMMPS.

    python docs/results/lammps-push/drag.py --seeds 1 2 3 4 5 --out drag.csv

`regions`: the spike is a region of LAMMPS. `free`: its contacts are computed by our own kernel, and the grains are in
LAMMPS all the same. All begin from the same grains, without the history of their contacts. A row of the CSV is a bed:
mean force along the motion and upwards over the second half of the way [N].
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np

from coupling.lammps import FreeLammpsBed, LammpsBed, LammpsMissingError
from dem import Ball, Bed, Cylinder

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--size", type=float, nargs=3, default=(0.03, 0.045, 0.03), help="of the prepared bed [m]")
parser.add_argument("--grain", type=float, default=0.003, help="mean diameter [m]")
parser.add_argument("--copies", type=int, default=4, help="how often the prepared bed is laid end to end [1]")
parser.add_argument("--radius", type=float, default=0.006, help="of the spike [m]")
parser.add_argument("--depth", type=float, default=0.008, help="of the tip in the drag, from the first grain [m]")
parser.add_argument("--way", type=float, default=0.02, help="of the drag [m]")
parser.add_argument("--speed", type=float, default=0.2, help="of push and drag [m/s]")
parser.add_argument("--steps", type=int, default=20, help="time steps of a mean force")
parser.add_argument("--seeds", type=int, nargs="+", default=(1,), help="of the prepared beds")
parser.add_argument("--kinds", nargs="+", default=("bed", "regions"), choices=("bed", "regions", "free"))
parser.add_argument("--out", type=Path, help="a CSV of the means; rows are added to it")


def grains_of(asked, seed):
    """The grains of the bed of a seed, its size and time step [s]."""
    piece = Bed.prepare("sand", size=tuple(asked.size), grain=asked.grain, gravity=9.81, seed=seed, threads=1)
    grains = piece.repeated(asked.copies).grains()
    return piece.material, grains, (asked.copies * asked.size[0], *asked.size[1:]), piece.time_step


def made(kind, stuff, grains, size, step):
    """A bed of these grains."""
    bed = Bed.from_grains(
        stuff, positions=grains.position, radii=grains.radius, velocities=grains.velocity, spins=grains.spin, size=size,
        height=0.2, time_step=step, threads=1,
    )  # fmt: skip
    bed.overlap_limit = 0.08  # a single contact may pass the 5 % for which the grains are softened
    return bed if kind == "bed" else {"regions": LammpsBed, "free": FreeLammpsBed}[kind](bed, ranks=1)


def dragged(bed, grains, size, asked):
    """Mean forces on the spike in each part of push and drag, shape [part, 3], and how many parts are of the push."""
    x, y = 0.25 * size[0], 0.5 * size[1]
    away = np.hypot(grains.position[:, 0] % size[0] - x, grains.position[:, 1] % size[1] - y)
    near = away < asked.radius + grains.radius
    reach = np.sqrt((asked.radius + grains.radius[near]) ** 2 - away[near] ** 2)
    start = (x, y, float((grains.position[near, 2] + reach).max()))
    body = bed.add_body(
        [Ball(radius=asked.radius), Cylinder(bottom=0.0, top=0.06, radius=asked.radius)], position=start
    )
    part, found = asked.steps * bed.time_step * asked.speed, []
    counts = [round(way / part) for way in (asked.depth, asked.way)]
    for velocity, count in zip(((0.0, 0.0, -asked.speed), (asked.speed, 0.0, 0.0)), counts, strict=True):
        bed.move_body(body, velocity=velocity)
        for _ in range(count):
            bed.advance(asked.steps)
            found.append(bed.reactions()[body][:3].copy())
    return np.array(found), counts[0]


def main():
    asked = parser.parse_args()
    for seed in asked.seeds:
        stuff, grains, size, step = grains_of(asked, seed)
        for kind in asked.kinds:
            began, bed = time.monotonic(), made(kind, stuff, grains, size, step)
            forces, pushed = dragged(bed, grains, size, asked)
            if kind != "bed":
                bed.close()
            drag = forces[pushed:]
            second = drag[len(drag) // 2 :].mean(axis=0)
            row = [
                seed,
                kind,
                len(grains.id),
                *(f"{v:.6g}" for v in (forces[:pushed, 2].mean(), -second[0], second[2])),
            ]
            print(*row, f"({time.monotonic() - began:.0f} s)", flush=True)
            if asked.out is not None:
                new = not asked.out.exists()
                with asked.out.open("a", newline="") as file:
                    table = csv.writer(file, lineterminator="\n")
                    if new:
                        table.writerow(["seed", "kind", "grains", "push_N", "drag_N", "lift_N"])
                    table.writerow(row)


if __name__ == "__main__":
    try:
        main()
    except LammpsMissingError as error:
        raise SystemExit(str(error)) from None
