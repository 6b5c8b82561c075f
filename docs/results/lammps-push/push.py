"""One bed of sand in LAMMPS under MPI beside the same bed in this process: the force on a spike, and what steps cost.

    python docs/results/lammps-push/push.py                      # 1,400 grains, one rank; 10 s
    python docs/results/lammps-push/push.py --size 0.06 0.12 0.05 --copies 7 --ranks 2 --parts 40 --out push.csv

`--seeds 1 2 3` pushes into that many beds, one after the other; with `--out` each bed's forces are written as it ends.
`--finer 2 4` repeats all runs with steps that are so many times shorter, from the same grains, over the same time.
`--kept` keeps the springs of contacts: all runs begin from the prepared bed as it is, at rest. Without it all of them
begin with contacts that have no history, as did the kept files of before 2026-11-29.

LAMMPS and mpiexec must be there: `hedgebed doctor` says how to install them.
"""

import argparse
import csv
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from coupling.lammps import LammpsBed, LammpsMissingError
from dem import Ball, Bed, Cylinder, Polyhedron

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--size", type=float, nargs=3, default=(0.03, 0.03, 0.03), help="of the prepared bed [m]")
parser.add_argument("--grain", type=float, default=0.003, help="mean diameter [m]")
parser.add_argument("--copies", type=int, default=1, help="how often the prepared bed is laid end to end [1]")
parser.add_argument("--ranks", type=int, nargs="+", default=(1,), help="each is a run of its own in LAMMPS")
parser.add_argument("--radius", type=float, default=0.006, help="of the spike [m]")
parser.add_argument("--sides", type=int, default=0, help="of a plate as thick as its radius, in place of the spike")
parser.add_argument("--seeds", type=int, nargs="+", default=(1,), help="of the prepared beds")
parser.add_argument("--speed", type=float, default=0.2, help="of the spike [m/s]")
parser.add_argument("--parts", type=int, default=20, help="means of the force, each over --steps")
parser.add_argument("--steps", type=int, default=10, help="time steps of a part")
parser.add_argument("--finer", type=int, nargs="+", default=(1,), help="steps in the time of one, here and in LAMMPS")
parser.add_argument(
    "--change", nargs="+", default=(), metavar="KEY=NUMBER", help="of the material, after the preparation"
)
parser.add_argument("--kept", action="store_true", help="begin with the springs of contacts, in all runs")
parser.add_argument("--threads", type=int, default=1, help="of our bed")
parser.add_argument("--alone", action="store_true", help="LAMMPS alone")
parser.add_argument("--out", type=Path, help="a CSV of the forces")


def processor_time(pids):
    """User and system time of processes so far [s]."""
    ticks = 0
    for pid in pids:
        stat = (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()
        ticks += int(stat[11]) + int(stat[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def push(bed, start, asked, pids, finer):
    """Mean force and moment on the spike in each part, shape [parts, 6]; processor and wall time a grain-step [s]."""
    steps = asked.steps * finer
    shapes = [Ball(radius=asked.radius), Cylinder(bottom=0.0, top=0.06, radius=asked.radius)]
    if asked.sides:
        angle = 2 * np.pi * (np.arange(asked.sides) + 0.5) / asked.sides
        ring = asked.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        shapes = [Polyhedron([(*point, z) for point in ring for z in (0.0, asked.radius)])]
    body = bed.add_body(shapes, position=start)
    bed.move_body(body, velocity=(0.0, 0.0, -asked.speed))
    bed.advance(steps)  # compiles here, sets up there
    found, began, clock = [bed.reactions()[body].copy()], processor_time(pids), time.perf_counter()
    for _ in range(asked.parts - 1):
        bed.advance(steps)
        found.append(bed.reactions()[body].copy())
    work = bed.grain_count * steps * max(1, asked.parts - 1)
    return np.array(found), ((processor_time(pids) - began) / work, (time.perf_counter() - clock) / work)


def push_all(asked, seed):
    """Forces and costs by name of the pushes into the bed of this seed, as `push` has them; its time step [s]."""
    threads = asked.threads if asked.kept else 1
    piece = Bed.prepare("sand", size=tuple(asked.size), grain=asked.grain, gravity=9.81, seed=seed, threads=threads)
    stuff = replace(piece.material, **{key: float(number) for key, number in (one.split("=") for one in asked.change)})
    grains = piece.repeated(asked.copies).grains()
    size = (asked.copies * asked.size[0], *asked.size[1:])

    def fresh(finer):
        """The bed, without the history of its contacts unless that is asked for."""
        if asked.kept:
            return piece.repeated(asked.copies, height=0.2)
        return Bed.from_grains(
            stuff, positions=grains.position, radii=grains.radius, velocities=grains.velocity,
            spins=grains.spin, size=size, height=0.2, time_step=piece.time_step / finer, threads=asked.threads,
        )  # fmt: skip

    x, y = 0.5 * size[0], 0.5 * size[1]
    away = np.hypot(grains.position[:, 0] % size[0] - x, grains.position[:, 1] % size[1] - y)
    near = away < asked.radius + grains.radius
    reach = np.sqrt((asked.radius + grains.radius[near]) ** 2 - away[near] ** 2)
    if asked.sides:
        reach = grains.radius[near]  # its lower face touches no grain yet
    start = (x, y, float((grains.position[near, 2] + reach).max()))
    print(f"seed {seed}: {len(grains.id)} grains, steps of {piece.time_step:.4g} s")
    columns, costs = {}, {}
    for finer in asked.finer:
        suffix = "" if finer == 1 else f", steps / {finer}"
        own = f"bed{suffix}"
        if not asked.alone:
            columns[own], costs[own] = push(fresh(finer), start, asked, [os.getpid()], finer)
        for ranks in asked.ranks:
            began, bed = time.monotonic(), LammpsBed(fresh(finer), ranks=ranks)
            name = f"lammps on {ranks} ranks{suffix}"
            if asked.kept:
                print(f"springs of {bed.springs} contacts went over {bed.springs_fault}", flush=True)
            columns[name], costs[name] = push(bed, start, asked, bed.processes, finer)
            print(f"{name}: {time.monotonic() - began:.3g} s in all")
            bed.close()
            if own in columns:
                so_far = np.cumsum(columns[name][:, 2]) / np.cumsum(columns[own][:, 2])
                print(
                    "  over the bed's mean force, up to the end of each part:",
                    *(f"{v:.4f}" for v in so_far),
                    flush=True,
                )
    for name, forces in columns.items():
        processor, wall = costs[name]
        print(
            f"{name}: mean force {forces[:, 2].mean():.5g} N; a grain-step takes {1e9 * processor:.4g} ns "
            f"of processor time, {1e9 * wall:.4g} ns of wall time", flush=True,
        )  # fmt: skip
    return columns, piece.time_step


def written(path, asked, columns, time_step):
    """Write the forces of a bed as CSV."""
    moments = asked.steps * time_step * (np.arange(asked.parts) + 0.5)
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time_s", *(f"{axis} {name} [N]" for name in columns for axis in ("fx", "fy", "fz"))])
        for k, moment in enumerate(moments):
            table.writerow([f"{v:.8g}" for v in (moment, *(f for forces in columns.values() for f in forces[k, :3]))])


def main():
    asked = parser.parse_args()
    if asked.kept and (asked.change or list(asked.finer) != [1]):
        parser.error("--kept begins from the prepared bed: it takes neither --change nor --finer")
    for seed in asked.seeds:
        columns, time_step = push_all(asked, seed)
        if asked.out is not None:
            several = len(asked.seeds) > 1
            written(
                asked.out.with_stem(f"{asked.out.stem}-{seed}") if several else asked.out, asked, columns, time_step
            )


if __name__ == "__main__":
    try:
        main()
    except LammpsMissingError as error:
        raise SystemExit(str(error)) from None
