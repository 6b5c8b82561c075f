"""Whole tumbles on our bed and in LAMMPS, from the same grains with the springs of their contacts.

    python docs/results/lammps-tumble/kept.py OUT RUN.toml SEED...

Adds two rows for each seed to OUT/kept.csv, with the columns of `pairs.py`, and writes the motion of each run to
OUT/motion-SEED-GROUND.csv. Ends where springs do not go over.
"""

import csv
import sys
import tomllib
from pathlib import Path
from typing import Any

import pairs

import experiments.grains.lammps as lammps


def main(out: Path, given: dict[str, Any], seeds: list[int]) -> None:
    """Run each seed."""
    out.mkdir(parents=True, exist_ok=True)
    own = lammps.moved_to_lammps

    def moved(*given: Any, **options: Any) -> Any:
        found = own(*given, **options)
        print(f"{found}: springs of {found.springs} contacts went over {found.springs_fault}", flush=True)
        if not found.springs:
            raise SystemExit(1)
        return found

    lammps.moved_to_lammps = moved
    for seed in seeds:
        rows = [pairs.numbers(seed, kind, given, out) for kind in ("bed", "lammps")]
        begun = (out / "kept.csv").exists()
        with (out / "kept.csv").open("a", newline="", encoding="utf-8") as stream:
            shown = [[*row[:2], *(f"{value:.6g}" for value in row[2:])] for row in rows]
            csv.writer(stream).writerows(shown if begun else [pairs.HEAD, *shown])
        print(*rows, sep="\n", flush=True)


if __name__ == "__main__":
    read = tomllib.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))["settings"]
    main(Path(sys.argv[1]), read, [int(word) for word in sys.argv[3:]])
