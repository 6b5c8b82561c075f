"""Prints the tables of docs/experiments.md from runs.csv: `python docs/results/tumble-sand/tables.py` from the root.

`... tables.py RUNS` first adds finished run folders below RUNS to runs.csv. They are named
<case>-w<width>-g<grain>-s<seed>, width and grain in m; a run of the same case, width, grain and seed is replaced.
"""

import csv
import json
import math
import sys
from pathlib import Path

import numpy as np

from experiments.converge.statistics import Size, apart, extrapolate, interval_of

KEPT = Path(__file__).with_name("runs.csv")
SPIKE = 0.012  # Diameter of the tips [m]
REAL = 0.0002  # Mean grain of fine sand [m]
QUANTITIES = {
    "angle_deg": "trajectory angle [degrees]",
    "ahead_mm": "ahead after 1 s [mm]",
    "up_mm": "up after 1 s [mm]",
    "rotation_deg": "rotation after 1 s [degrees]",
    "work_mJ": "work of the torque in 1 s [mJ]",
    "deepest_mm": "deepest row [mm]",
    "depth_at_start_mm": "depth after placement [mm]",
}


def read(folder: Path) -> dict[str, object]:
    """One run in the columns of runs.csv; a brake's run ends, and is read, at 0.6 s."""
    case, width, grain, seed = folder.name.rsplit("-", 3)
    result = json.loads((folder / "result.json").read_text())
    with (folder / "trajectory.csv").open() as file:
        rows = [{name: float(row[name]) for name in ("t_s", "x_m", "y_m", "theta_rad")} for row in csv.DictReader(file)]
    time, x, y, theta = (np.array([row[name] for row in rows]) for name in ("t_s", "x_m", "y_m", "theta_rad"))
    until = min(1.0, time[-1])
    angle = result["quantities"]["trajectory_angle"]["value"]
    x1, y1, turned = (float(np.interp(until, time, values) - values[0]) for values in (x, y, theta))
    motor = result["actuator"] == "motor"
    hops = any(change["state"] == "hop" for change in result["transitions"])  # A hop ends the torque
    work = 1e3 * result["trial"]["torque"]["value"] * turned if motor and not hops else None
    grains = result["grains"]
    return {
        "case": case, "width_mm": 1e3 * float(width[1:]), "grain_mm": 1e3 * float(grain[1:]), "seed": int(seed[1:]),
        "until_s": round(until, 3), "angle_deg": "" if angle is None else round(math.degrees(angle), 2),
        "ahead_mm": round(1e3 * x1, 2), "up_mm": round(1e3 * y1, 2), "rotation_deg": round(math.degrees(turned), 2),
        "work_mJ": "" if work is None else round(work, 2),
        "deepest_mm": round(1e3 * result["quantities"]["sinkage_largest"]["value"], 2),
        "depth_at_start_mm": round(1e3 * result["quantities"]["sinkage_start"]["value"], 2),
        "largest_overlap": round(grains["max_overlap"], 4), "packing": round(grains["packing_fraction"], 4),
        "grains": grains["grain_count"], "grain_steps": int(grains["grain_steps"]),
        "grain_steps_all_awake": int(grains["grain_steps_all_awake"]), "code": result["code"],
    }  # fmt: skip


def kept() -> list[dict[str, str]]:
    """The rows of runs.csv."""
    with KEPT.open() as file:
        return list(csv.DictReader(file))


def as_text(row: dict[str, object]) -> dict[str, str]:
    """A row as it is read from runs.csv."""
    return {name: str(value) for name, value in row.items()}


def key_of(row: dict[str, str]) -> tuple[str, float, float, int]:
    """What tells runs apart, in the order of the file."""
    return row["case"], float(row["width_mm"]), float(row["grain_mm"]), int(row["seed"])


def values(rows: list[dict[str, str]], name: str, **where: float | str) -> list[float]:
    """The numbers of a column, of the rows whose other columns are as `where` says."""
    chosen = [
        row for row in rows
        if all(row[key] == value or (key != "case" and float(row[key]) == value) for key, value in where.items())
    ]  # fmt: skip
    return [float(row[name]) for row in chosen if row[name]]


def cell(numbers: list[float]) -> str:
    """Mean, half-width of the 95 % interval of the mean, standard deviation of one run, number of beds."""
    if not numbers:
        return "-"
    found = interval_of(numbers)
    assert found is not None
    if found.half is None:
        return f"{found.mean:.1f} (1)"
    return f"{found.mean:.1f} ± {found.half:.1f}; {np.std(numbers, ddof=1):.1f} ({found.count})"


def table(title: str, columns: dict[str, dict[str, float | str]]) -> None:
    """A table of all quantities: one column for each set of runs."""
    rows = kept()
    print(f"\n{title}\n| | {' | '.join(columns)} |\n|{'---|' * (len(columns) + 1)}")
    for name, label in QUANTITIES.items():
        print(f"| {label} | {' | '.join(cell(values(rows, name, **where)) for where in columns.values())} |")


def main() -> None:
    """Add to runs.csv where a folder is given, then print the tables."""
    if len(sys.argv) > 1:
        folders = [path.parent for path in sorted(Path(sys.argv[1]).glob("*/result.json"))]
        rows = {key_of(row): row for row in [*kept(), *(as_text(read(folder)) for folder in folders)]}
        with KEPT.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(next(iter(rows.values()))), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows[key] for key in sorted(rows))
    rows = kept()
    motor: dict[str, float | str] = {"case": "0.22", "grain_mm": 4.0}
    table("Width", {f"{w:g} mm": motor | {"width_mm": w} for w in (36.0, 72.0, 153.0)})
    for name, label in QUANTITIES.items():
        wide = values(rows, name, **motor, width_mm=153.0)
        if len(wide) > 1:
            found = [apart(wide, values(rows, name, **motor, width_mm=w)) for w in (36.0, 72.0)]
            print(label, "less that of 153 mm:", *(f"{one.mean:.1f} ± {one.half:.1f}" for one in found))
    narrow: dict[str, float | str] = {"case": "0.22", "width_mm": 36.0}
    grains = sorted({float(row["grain_mm"]) for row in rows}, reverse=True)
    table("Grain size", {f"{g:g} mm": narrow | {"grain_mm": g} for g in grains})
    for name, label in QUANTITIES.items():
        sizes = [Size(g * 1e-3 / SPIKE, tuple(values(rows, name, **narrow, grain_mm=g))) for g in grains]
        line = extrapolate([size for size in sizes if size.values], REAL / SPIKE)
        if line is not None and line.chance is not None and line.grain is not None:
            print(
                f"{label}, {1e3 * REAL:g} mm: {line.value:.1f} ± {line.chance:.1f} (chance) ± {line.grain:.1f} (size)"
            )
    cases = sorted({row["case"] for row in rows})
    table("Cases, 36 mm wide, 4 mm grains", {c: {"case": c, "width_mm": 36.0, "grain_mm": 4.0} for c in cases})


if __name__ == "__main__":
    main()
