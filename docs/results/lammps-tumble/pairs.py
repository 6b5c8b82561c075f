"""Whole tumbles from the same grains in our bed and in LAMMPS, for many beds.

    python docs/results/lammps-tumble/pairs.py OUT RUN.toml SEED...

Contacts begin without history in both, and the grains do not come to rest in LAMMPS first, so that both begin from the
same grains. Adds two rows for each seed to OUT/pairs.csv, with the numbers at the end, and writes the motion of each
run to OUT/motion-SEED-bed.csv and OUT/motion-SEED-lammps.csv. `own_processor_s` is hedgebed's, without LAMMPS'.
"""

import csv
import json
import math
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from same import from_fresh_grains, settings_of

from experiments import tumble

COLUMNS = ("t_s", "theta_rad", "x_m", "y_m")
HEAD = ("seed", "ground", "rotation_rad", "ahead_mm", "rise_mm", "angle_deg", "deepest_mm", "own_processor_s")


def numbers(seed: int, kind: str, given: dict[str, Any], out: Path) -> tuple[Any, ...]:
    """The row of one run."""
    began, folder = time.process_time(), Path(tempfile.mkdtemp()) / "run"
    tumble.run(settings_of(seed, kind, given, 1), folder)
    taken = time.process_time() - began
    with (folder / "trajectory.csv").open(encoding="utf-8") as stream:
        rows = [[float(row[key]) for key in COLUMNS] for row in csv.DictReader(stream)]
    time_s, theta, x, y = np.transpose(rows)
    begin = int(np.argmax(time_s >= 0.0))
    np.savetxt(out / f"motion-{seed}-{kind}.csv", rows[::10], delimiter=",", fmt="%.7g", header=",".join(COLUMNS))
    found = json.loads((folder / "result.json").read_text(encoding="utf-8"))["quantities"]
    angle = found["trajectory_angle"]["value"]
    return (
        seed, kind, float(theta[-1] - theta[begin]), 1e3 * float(x[-1] - x[begin]), 1e3 * float(y[-1] - y[begin]),
        math.degrees(math.nan if angle is None else angle), 1e3 * found["sinkage_largest"]["value"], taken,
    )  # fmt: skip


def main(out: Path, given: dict[str, Any], seeds: list[int]) -> None:
    """Run both for each seed."""
    out.mkdir(parents=True, exist_ok=True)
    from_fresh_grains(1)
    for seed in seeds:
        rows = [numbers(seed, kind, given, out) for kind in ("bed", "lammps")]
        begun = (out / "pairs.csv").exists()
        with (out / "pairs.csv").open("a", newline="", encoding="utf-8") as stream:
            shown = [[*row[:2], *(f"{value:.6g}" for value in row[2:])] for row in rows]
            csv.writer(stream).writerows(shown if begun else [HEAD, *shown])
        print(*rows, sep="\n", flush=True)


if __name__ == "__main__":
    read = tomllib.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))["settings"]
    main(Path(sys.argv[1]), read, [int(word) for word in sys.argv[3:]])
