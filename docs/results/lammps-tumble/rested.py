"""Tumbles on our own bed whose grains lost their springs and came to rest anew, as they do when they go to LAMMPS.

    python docs/results/lammps-tumble/rested.py OUT RUN.toml SEED...

Adds a row for each seed to OUT/rested.csv, with the columns of `pairs.py`, and writes OUT/motion-SEED-rested.csv.
"""

import csv
import math
import sys
import tomllib
from pathlib import Path
from typing import Any

import pairs
from same import fresh

from coupling.lammps.bed import STILL
from dem import Bed
from experiments.tumble.on_grains import PlanarOnBed

SPELL = 1.5  # Of rest between two looks at the kinetic energy, as in `LammpsBed.settle` [sqrt(d / g)]


def rested(bed: Any) -> Bed:
    """The bed without the springs of its contacts, again at rest by the bound of `LammpsBed.settle`."""
    made, before = fresh(bed), bed.surface
    g = math.hypot(*made.gravity)
    spell = math.ceil(SPELL * math.sqrt(made.mean_diameter / g) / made.time_step)
    limit = STILL * float(made.grains().mass.sum()) * g * made.mean_diameter
    taken = 0.0
    while True:
        made.advance(spell)
        taken += spell * made.time_step
        energy = made.kinetic_energy
        print(f"after {taken:.4f} s the kinetic energy is {energy / limit:.3g} times that of rest", flush=True)
        if energy < limit:
            break
    made.measure_surface()
    print(f"the surface moved by {1e6 * (made.surface - before):.1f} um", flush=True)
    return made


def main(out: Path, given: dict[str, Any], seeds: list[int]) -> None:
    """Run each seed."""
    out.mkdir(parents=True, exist_ok=True)
    own_ground = PlanarOnBed.ground
    PlanarOnBed.ground = lambda self, bed: own_ground(self, rested(bed))
    for seed in seeds:
        row = pairs.numbers(seed, "bed", given, out)
        begun = (out / "rested.csv").exists()
        with (out / "rested.csv").open("a", newline="", encoding="utf-8") as stream:
            shown = [row[0], "rested", *(f"{value:.6g}" for value in row[2:])]
            csv.writer(stream).writerows([shown] if begun else [pairs.HEAD, shown])
        print(*row, flush=True)


if __name__ == "__main__":
    read = tomllib.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))["settings"]
    main(Path(sys.argv[1]), read, [int(word) for word in sys.argv[3:]])
