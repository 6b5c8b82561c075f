"""Sand that flows down a rough slope, on our bed and with the same grains in LAMMPS: the law of grains under shear.

    python docs/results/lammps-push/flow.py --angles 32 36 --seeds 1 2 3 4 --out flow.csv

The floor has bars across the flow, so that the grains shear and do not slide. Both begin from the same grains, without
the history of their contacts, and gravity turns at once. A row of the CSV is one run: mean velocity down the slope
[m/s] at the end of each quarter of the duration. `ours` is our law; other kinds are our bed with terms of LAMMPS' law,
joined by "+" (see `terms.py`).
"""

import argparse
import csv
import math
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from coupling.lammps import LammpsBed
from dem import Bed, Capsule

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--size", type=float, nargs=3, default=(0.06, 0.03, 0.03), help="of the prepared bed [m]")
parser.add_argument("--grain", type=float, default=0.003, help="mean diameter [m]")
parser.add_argument("--angles", type=float, nargs="+", default=(36.0,), help="of the slope [degrees]")
parser.add_argument("--duration", type=float, default=0.4, help="of the flow [s]")
parser.add_argument("--rolling", type=float, help="coefficient of rolling friction in place of sand's [1]")
parser.add_argument("--sliding", type=float, help="coefficient of friction in place of sand's [1]")
parser.add_argument("--seeds", type=int, nargs="+", default=(1,), help="of the prepared beds")
parser.add_argument("--kinds", nargs="+", default=("ours", "lammps"), help="ours, lammps, or terms of terms.py")
parser.add_argument("--out", type=Path, required=True, help="the CSV; rows are added to it")
PARTS = 4


def start_of(asked, seed):
    """The grains above the bars at rest, the bars, and the time step [s]."""
    piece = Bed.prepare("sand", size=tuple(asked.size), grain=asked.grain, gravity=9.81, seed=seed, threads=1)
    grains, radius, edge = piece.grains(), 0.5 * asked.grain, 1.3 * asked.grain
    ends = (edge, asked.size[1] - edge)
    places = np.arange(edge, asked.size[0] - edge + 1e-9, 2 * asked.grain)
    middle = 0.5 * np.array(asked.size[:2])
    bars = [
        Capsule(
            start=(x - middle[0], ends[0] - middle[1], 0.0),
            end=(x - middle[0], ends[1] - middle[1], 0.0),
            radius=radius,
        )
        for x in places.tolist()
    ]
    away = np.hypot(grains.position[:, None, 0] % asked.size[0] - places, grains.position[:, None, 2]).min(axis=1)
    free = away > radius + grains.radius
    sizes = "-".join(f"{1e3 * length:g}" for length in (*asked.size, asked.grain))
    kept = asked.out.with_name(
        f"start-{seed}-{sizes}.npz"
    )  # our law makes it, so that terms of LAMMPS' law find it made
    if kept.exists():
        return piece.material, SimpleNamespace(**np.load(kept)), bars, piece.time_step
    bed = made(piece.material, grains.position[free], grains.radius[free], None, None, asked, piece.time_step)
    barred(bed, bars, asked)
    bed.advance(math.ceil(0.05 / bed.time_step))  # the grains come to rest among the bars
    grains = bed.grains()
    np.savez(kept, **{key: getattr(grains, key) for key in ("position", "radius", "velocity", "spin", "mass")})
    return piece.material, grains, bars, piece.time_step


def made(stuff, position, radii, velocity, spin, asked, step):
    """A bed of these grains."""
    moving = {} if velocity is None else {"velocities": velocity, "spins": spin}
    bed = Bed.from_grains(
        stuff, positions=position, radii=radii, size=tuple(asked.size), height=0.12, time_step=step, threads=1, **moving
    )
    bed.overlap_limit = 0.08  # a single contact may pass the 5 % for which the grains are softened
    return bed


def barred(bed, bars, asked):
    """The bed with bars on its floor; a body is felt up to half the bed from its origin."""
    bed.add_body(bars, position=(0.5 * asked.size[0], 0.5 * asked.size[1], 0.0))
    return bed


def flow(asked, seed, kind, angle):
    """Mean velocity down the slope at the end of each part [m/s], shape [PARTS]."""
    stuff, grains, bars, step = start_of(asked, seed)
    given = {"rolling_friction": asked.rolling, "friction": asked.sliding}
    stuff = replace(stuff, **{name: value for name, value in given.items() if value is not None})
    if kind not in ("ours", "lammps"):
        from terms import OVERLAP, patch

        patch(tuple(kind.split("+")), float(grains.radius.mean()) * OVERLAP**0.5, 0.5 * float(grains.mass.mean()))
    bed = made(stuff, grains.position, grains.radius, grains.velocity, grains.spin, asked, step)
    turned = math.radians(angle)
    bed.set_gravity((9.81 * math.sin(turned), 0.0, -9.81 * math.cos(turned)))
    bed = barred(LammpsBed(bed, ranks=1) if kind == "lammps" else bed, bars, asked)
    speeds = []
    for _ in range(PARTS):
        bed.advance(math.ceil(asked.duration / PARTS / step))
        now = bed.grains()
        speeds.append(float(now.mass @ now.velocity[:, 0] / now.mass.sum()))
    if kind == "lammps":
        bed.close()
    return speeds


def main():
    """Add the rows of all angles, seeds and kinds; a term of LAMMPS' law replaces ours for good, so it stands alone."""
    asked = parser.parse_args()
    if len(asked.kinds) > 1 and not {"ours", "lammps"}.issuperset(asked.kinds):
        parser.error(f"--kinds {' '.join(asked.kinds)}: terms of LAMMPS' law need a run of their own")
    for seed in asked.seeds:
        for angle in asked.angles:
            for kind in asked.kinds:
                began = time.monotonic()
                speeds = flow(asked, seed, kind, angle)
                rows = [[seed, f"{angle:g}", kind, *(f"{speed:.6g}" for speed in speeds)]]
                if not asked.out.exists():
                    ends = [f"speed_{asked.duration * (k + 1) / PARTS:g}s_m_s" for k in range(PARTS)]
                    rows = [["seed", "angle_deg", "kind", *ends], *rows]
                with asked.out.open("a", newline="", encoding="utf-8") as stream:
                    csv.writer(stream).writerows(rows)
                print(*rows[-1], f"({time.monotonic() - began:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
