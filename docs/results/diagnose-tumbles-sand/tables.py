"""Tumbles on grains beside the spring-damper and the model with two effects: prints the tables, draws the figure.

`python docs/results/diagnose-tumbles-sand/tables.py` from the root, with the repository on PYTHONPATH: half a minute.
`rows.csv` has the motion without noise, and the forces of the grains on the leading row, means of 10 ms.
"""

import csv
import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments import tumble
from vis.page.folder import read_columns
from vis.page.plots import AMENDED, BED, DASHED, MODEL, handle, legend_above, sheet, styled, title_above

HERE = Path(__file__).parent
LENGTH = 0.2  # of a spike, from the centre [m]
BASE = {"surface": "sand", "stiffness": 162.03, "damping": 1.2559}  # a row of two spikes, as campaign.toml states
SHOWN = {
    "x_mm": "way [mm]", "y_mm": "height [mm]", "theta_deg": "angle [degrees]", "depth_mm": "leading row [mm]",
}  # fmt: skip
Columns = Mapping[str, NDArray[np.float64]]


def grains() -> dict[str, Columns]:
    """The runs of rows.csv by name."""
    with (HERE / "rows.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = [name for name in rows[0] if name != "run"]
    runs = dict.fromkeys(row["run"] for row in rows)
    return {
        run: {name: np.array([float(row[name]) for row in rows if row["run"] == run]) for name in names} for run in runs
    }


def simulated(torque: float, rig: float, time: NDArray[np.float64], **options: Any) -> Columns:
    """The same tumble on a model, at these times [s]."""
    with tempfile.TemporaryDirectory() as folder:
        duration = float(time[-1]) + 0.01
        tumble.run(tumble.Settings(torque=torque, rig=rig, duration=duration, **options), Path(folder) / "run")
        found, _ = read_columns(Path(folder) / "run" / "trajectory.csv")
    x, y, theta = (np.interp(time, found["t_s"], found[name]) for name in ("x_m", "y_m", "theta_rad"))
    depth = LENGTH * np.cos(theta - math.pi / 8) - y
    return {
        "x_mm": 1e3 * (x - x[0]), "y_mm": 1e3 * (y - y[0]), "theta_deg": np.degrees(theta),
        "depth_mm": 1e3 * np.maximum(depth, 0.0),
    }  # fmt: skip


def forces(runs: Mapping[str, Columns]) -> None:
    """Print least squares of the forces on the leading row of all runs: friction and ploughing, and slip against load.

    Means of four rows (40 ms) are fitted; s is the share of slip in the speed of the tip.
    """
    blocks = [
        {name: values[: len(values) // 4 * 4].reshape(-1, 4).mean(axis=1) for name, values in run.items()}
        for run in runs.values()
    ]
    time, depth, slip, normal, along = (
        np.concatenate([block[name] for block in blocks])
        for name in ("t_s", "depth_mm", "slip_mm_s", "normal_N", "along_N")
    )
    rate = np.concatenate([np.gradient(block["depth_mm"], block["t_s"]) for block in blocks])
    depth = 1e-3 * depth
    sliding, sinking = ((np.abs(slip) > 8) & (time > 0.04)), ((rate > 3) & (time > 0.04))
    share = np.abs(slip) / np.hypot(slip, rate)
    side, _, _, _ = np.linalg.lstsq(
        np.stack([normal, depth**2], 1)[sliding], (-np.sign(slip) * along)[sliding], rcond=None
    )
    load, _, _, _ = np.linalg.lstsq(np.stack([depth, depth * share], 1)[sinking], normal[sinking], rcond=None)
    rising = (rate < -2) & (depth > 0.01)
    print(f"along = {side[0]:.2f} normal + {side[1]:.0f} N/m2 h^2")
    print(f"normal = {load[0]:.0f} N/m h (1 - {-load[1] / load[0]:.2f} s) while it sinks")
    print(f"normal = {np.median(normal[rising] / depth[rising]):.0f} N/m h while it rises, median")


def main() -> None:
    """Print the tables and draw the figure."""
    runs = grains()
    forces(runs)
    beds = [run for run in runs.values() if run["torque_N_m"][0] == 0.22]
    time = min((run["t_s"] for run in beds), key=len)
    models: dict[str, Mapping[str, Any]] = {
        "spring-damper": BASE,
        "with two effects": {"model": str(HERE / "amended.toml")},
    }
    print("| run | model | " + " | ".join(f"{words}: rms, largest" for words in SHOWN.values()) + " | deepest [mm] |")
    for name, run in runs.items():
        for words, options in models.items():
            at = run["t_s"][run["t_s"] <= time[-1]]
            model = simulated(float(run["torque_N_m"][0]), float(run["rig_g"][0]), at, **options)
            errors = [model[key] - run[key][: len(at)] for key in SHOWN]
            cells = [f"{math.sqrt(np.mean(error**2)):.2f}, {np.abs(error).max():.2f}" for error in errors]
            deepest = f"{model['depth_mm'].max():.1f} (grains {run['depth_mm'].max():.1f})"
            print(f"| {name} | {words} | {' | '.join(cells)} | {deepest} |")
    scatter = {key: np.std([run[key][: len(time)] for run in beds], axis=0, ddof=1) for key in SHOWN}
    print("scatter of beds, rms: " + ", ".join(f"{math.sqrt(np.mean(s**2)):.2f}" for s in scatter.values()))
    with styled():
        drawing, (panels,) = sheet(1, 4, 3.2)
        for axis, (key, words) in zip(panels, SHOWN.items(), strict=True):
            for run in beds:
                axis.plot(run["t_s"][: len(time)], run[key][: len(time)], color=BED, lw=1.2)
            styles: tuple[dict[str, Any], ...] = ({"color": MODEL, "ls": DASHED}, {"color": AMENDED})
            for options, style in zip(models.values(), styles, strict=True):
                axis.plot(time, simulated(0.22, 0.0085, time, **options)[key], lw=1.8, **style)
            axis.set(xlabel="time [s]", title=words)
        marks = [
            handle("grains, three beds", BED), handle("spring-damper", MODEL, ls=DASHED),
            handle("with ploughing and slip-sinkage", AMENDED),
        ]  # fmt: skip
        legend_above(drawing, marks, 3)
        title_above(drawing, "The motor of 0.22 N m on sand at 0.0085 g")
        drawing.savefig(HERE.parents[1] / "images" / "diagnose-tumbles-sand.png", dpi=110)


if __name__ == "__main__":
    main()
