"""A tumble on surface laws beside the same tumble on grains: writes laws.csv and the figure, prints the table.

`python docs/results/tumble-laws/tables.py` from the root, with the repository on PYTHONPATH: a minute of one core.
`... tables.py draw` only draws the figure, from laws.csv. The runs on grains are kept in ../tumble-sand/runs.csv.
"""

import csv
import json
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

from experiments import groundmap, tumble
from experiments.converge.statistics import interval_of
from rigid.ground_file import GroundFile, read_ground
from vis.page.plots import BED, MODEL, handle, legend_above, sheet, styled, title_above

HERE = Path(__file__).parent
RESULTS = HERE.parent
TRIAL = {"rig": 0.0085, "torque": 0.22, "duration": 1.1}
QUANTITIES = {  # name in result.json: column of runs.csv, in words, scale
    "trajectory_angle": ("angle_deg", "trajectory angle [degrees]", 180 / math.pi),
    "ahead_1s": ("ahead_mm", "ahead after 1 s [mm]", 1e3),
    "up_1s": ("up_mm", "up after 1 s [mm]", 1e3),
    "rotation_1s": ("rotation_deg", "rotation after 1 s [degrees]", 180 / math.pi),
    "torque_work_1s": ("work_mJ", "work of the torque in 1 s [mJ]", 1e3),
    "sinkage_largest": ("deepest_mm", "deepest row until 1.1 s [mm]", 1e3),
    "sinkage_start": ("depth_at_start_mm", "depth after placement [mm]", 1e3),
}
SHIPPED_BEFORE = "spring-damper, 140 N/m, 3 N s/m"  # as it shipped until 2026-11-26
SIZES = (3.0, 2.4)  # of the grains [mm]


def power_law(size: str) -> Path:
    """The ground file of the irreversible power law of a kept calibration, written beside this script."""
    folder = RESULTS / f"calibrate-sand-{size}"
    pair = read_ground(folder / "ground.toml")
    laws = json.loads((folder / "result.json").read_text(encoding="utf-8"))["laws"]
    law = next(one for one in laws if one["name"] == "power-irreversible")
    parameters = {
        name: {"value": max(0.0, found["value"]), "std": found["std"]} for name, found in law["parameters"].items()
    }
    parameters |= {name: {"value": value, "std": 0.0} for name, value in law["fixed"].items()}
    made = pair.model_dump() | {
        "law": "power-irreversible", "parameters": parameters, "notes": (),
        "source": f"docs/results/calibrate-sand-{size}/result.json",
    }  # fmt: skip
    return GroundFile(**made).write(HERE / f"power-irreversible-{size}.toml")


def looked_up() -> Path:
    """The pair of `hedgebed ground` for grains of 0.2 mm, written beside this script."""
    with tempfile.TemporaryDirectory() as folder:
        groundmap.run(groundmap.Settings(), Path(folder) / "run")
        text = (Path(folder) / "run" / "ground.toml").read_text(encoding="utf-8")
    (HERE / "ground-0.2mm.toml").write_text(text, encoding="utf-8")
    return HERE / "ground-0.2mm.toml"


def on_law(**options: object) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of each quantity, in the units of the table."""
    with tempfile.TemporaryDirectory() as folder:
        result = tumble.run(tumble.Settings(**TRIAL, **options), Path(folder) / "run")
    entries = {name: result["quantities"][name] for name in QUANTITIES}
    return {
        name: (entry["value"] * QUANTITIES[name][2], (entry["std"] or 0.0) * QUANTITIES[name][2])
        for name, entry in entries.items()
    }


def on_grains(size: float) -> dict[str, list[float]]:
    """The runs on grains of this size [mm], 36 mm wide, in the units of the table."""
    with (RESULTS / "tumble-sand" / "runs.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if (row["case"], row["width_mm"]) == ("0.22", "36.0")]
    mine = [row for row in rows if float(row["grain_mm"]) == size]
    return {name: [float(row[column]) for row in mine] for name, (column, *_) in QUANTITIES.items()}


def main() -> None:
    """Run the laws, keep their numbers, print the table, draw the figure."""
    laws = {
        SHIPPED_BEFORE: {"surface": "sand", "stiffness": 140.0, "damping": 3.0},
        "spring-damper of 2.4 mm": {"ground": str(RESULTS / "calibrate-sand-2.4mm" / "ground.toml")},
        "power-irreversible of 2.4 mm": {"ground": str(power_law("2.4mm"))},
        "spring-damper of 1 mm": {"ground": str(RESULTS / "calibrate-sand-1mm" / "ground.toml")},
        "power-irreversible of 1 mm": {"ground": str(power_law("1mm"))},
        "hedgebed ground, 0.2 mm": {"ground": str(looked_up())},
    }
    found = {name: on_law(**options) for name, options in laws.items()}
    grains = {size: on_grains(size) for size in SIZES}
    with (HERE / "laws.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["law", "quantity", "value", "std"])
        for law, numbers in found.items():
            for name, (value, std) in numbers.items():
                writer.writerow([law, QUANTITIES[name][1], f"{value:.4g}", f"{std:.2g}"])
    heads = [*(f"grains of {size:g} mm" for size in SIZES), *laws]
    print(f"| | {' | '.join(heads)} |\n|{'---|' * (len(heads) + 1)}")
    for name, (_, words, _) in QUANTITIES.items():
        cells = []
        for size in SIZES:
            interval = interval_of(grains[size][name])
            assert interval is not None
            cells.append(f"{interval.mean:.1f} ± {interval.half:.1f}")
        for numbers in found.values():
            value, std = numbers[name]
            cells.append(f"{value:.1f} ± {std:.1f}" if std else f"{value:.1f}")
        print(f"| {words} | {' | '.join(cells)} |")
    draw()


def draw() -> None:
    """The figure, from laws.csv and the runs on grains."""
    kept: dict[str, dict[str, tuple[float, float]]] = {}
    with (HERE / "laws.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            kept.setdefault(row["law"], {})[row["quantity"]] = (float(row["value"]), float(row["std"]))
    grains = {size: on_grains(size) for size in SIZES}
    heads = [*(f"grains of {size:g} mm" for size in SIZES), *kept]
    heads[heads.index(SHIPPED_BEFORE)] += "\n(shipped until 2026-11-26)"
    shown = ("trajectory_angle", "ahead_1s", "sinkage_largest", "sinkage_start")
    with styled():
        drawing, (panels,) = sheet(1, 4, 3.6, sharey=True)
        for axis, name in zip(panels, shown, strict=True):
            for place, size in enumerate(SIZES):
                values = grains[size][name]
                axis.plot(values, [place] * len(values), "o", color=BED, ms=4)
            for place, numbers in enumerate(kept.values(), len(SIZES)):
                value, std = numbers[QUANTITIES[name][1]]
                axis.errorbar([value], [place], xerr=[std], fmt="s", color=MODEL, ms=5, capsize=3)
            axis.set_xlabel(QUANTITIES[name][1].replace(" [", "\n["), fontsize=8.5)
        panels[0].set_yticks(np.arange(len(heads)), heads)
        panels[0].invert_yaxis()
        marks = [handle("grains of sand, each bed", BED, ls="", marker="o", ms=4)]
        marks.append(handle("surface law, ± standard deviation", MODEL, ls="", marker="s", ms=5))
        legend_above(drawing, marks, 2)
        title_above(drawing, "The motor of 0.22 N m on sand at 0.0085 g: grains and surface laws")
        drawing.savefig(RESULTS.parent / "images" / "tumble-laws.png", dpi=126)


if __name__ == "__main__":
    draw() if sys.argv[1:] == ["draw"] else main()
