"""Whole tumbles on our bed and in LAMMPS, whose contacts keep their springs, or lose them and rest anew.

    python docs/results/lammps-tumble/kept.py OUT RUN.toml SEED...

Adds three rows for each seed to OUT/kept.csv, with the columns of `pairs.py`: `bed`, `lammps` and `rested`, which is
LAMMPS without the springs. Writes the motion of each run to OUT/motion-SEED-GROUND.csv.
"""

import csv
import sys
import tomllib
from pathlib import Path
from typing import Any

import pairs

from coupling.lammps import LammpsBed


def main(out: Path, given: dict[str, Any], seeds: list[int]) -> None:
    """Run each seed."""
    out.mkdir(parents=True, exist_ok=True)
    own = LammpsBed._take_springs
    for seed in seeds:
        for ground in ("bed", "lammps", "rested"):
            LammpsBed._take_springs = own if ground != "rested" else lambda self, bed: (0, "")
            row = pairs.numbers(seed, "bed" if ground == "bed" else "lammps", given, out)
            if ground == "rested":
                (out / f"motion-{seed}-lammps.csv").rename(out / f"motion-{seed}-rested.csv")
            elif ground == "lammps":
                (out / f"motion-{seed}-lammps.csv").rename(out / f"motion-{seed}-kept.csv")
            begun = (out / "kept.csv").exists()
            with (out / "kept.csv").open("a", newline="", encoding="utf-8") as stream:
                shown = [seed, ground, *(f"{value:.6g}" for value in row[2:])]
                csv.writer(stream).writerows([shown] if begun else [pairs.HEAD, shown])
            print(seed, ground, *row[2:], flush=True)


if __name__ == "__main__":
    read = tomllib.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))["settings"]
    main(Path(sys.argv[1]), read, [int(word) for word in sys.argv[3:]])
