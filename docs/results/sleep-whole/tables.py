"""Errors of sleep over whole tumbles: the paired differences of beds.csv, with their 95 % intervals (t).

Run by `python docs/results/sleep-whole/tables.py`. Rules: `default`, those of `dem.Sleep`; `strict`: speed 0.005, calm
1, own 0.02, unbalanced 0.2, still 0.003.
"""

import csv
from pathlib import Path

import numpy as np
from scipy import stats

QUANTITIES = (
    "depth_start_mm",
    "deepest_mm",
    "angle_deg",
    "up_mm",
    "ahead_mm",
    "rotation_deg",
    "lost_mJ",
    "lift_N",
    "work_mJ",
)


def main() -> None:
    """Print a table for each set of rules, from the runs at the first place."""
    with (Path(__file__).parent / "beds.csv").open() as file:
        runs = {(row["seed"], row["rules"]): row for row in csv.DictReader(file) if float(row["place_um"]) == 0}
    for rules in ("default", "strict"):
        seeds = [seed for seed, name in runs if name == rules and (seed, "awake") in runs]
        share = np.mean([float(runs[s, rules]["grain_steps"]) / float(runs[s, "awake"]["grain_steps"]) for s in seeds])
        print(f"{rules}: {len(seeds)} beds, {share:.3f} of the grain-steps of all awake")
        for name in QUANTITIES:
            known = [seed for seed in seeds if runs[seed, "awake"][name] and runs[seed, rules][name]]
            if len(known) < 2:  # lift and work were not kept for every bed
                continue
            awake, asleep = (np.array([float(runs[s, r][name]) for s in known]) for r in ("awake", rules))
            difference = asleep - awake
            half = stats.t.ppf(0.975, len(known) - 1) * difference.std(ddof=1) / len(known) ** 0.5
            mean = f"{difference.mean():7.3f} ± {half:.3f}"
            print(f"  {name:15s} awake {awake.mean():8.3f}, difference {mean}, {len(known)} beds")


if __name__ == "__main__":
    main()
