"""Depth of each row of spikes over four tumbles, from the kept trajectory: draws docs/images/row-feet.png."""

import json
import math
from pathlib import Path

import numpy as np

from vis.page.folder import read_columns
from vis.page.plots import as_it_lies, handle, legend_above, line_styles, sheet, styled, title_above
from vis.page.report import title_of

HERE = Path(__file__).parent


def main() -> None:
    """Depth of a tip below the undisturbed surface: l cos(theta + pi / 8 + n pi / 4) - y (docs/planar.md)."""
    folder = HERE / "grains3-row-seed1"
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    columns, _ = read_columns(folder / "trajectory.csv")
    length, count = float(result["trial"]["spike_length"]["value"]), int(result["spike_count"])
    styles = line_styles([f"row {row}" for row in range(count)])
    with styled():
        drawing, axes = sheet(2, 1, 4.2, height_ratios=(1.0, 1.6))
        path, depth = axes[:, 0]
        path.plot(1e3 * columns["x_m"], 1e3 * columns["y_m"], color="#222222", lw=1.4)
        path.set(xlabel="x of the centre [mm]", ylabel="y of the centre\nabove the surface [mm]")
        as_it_lies(path)
        for row, style in enumerate(styles.values()):
            angle = columns["theta_rad"] + math.pi / count + 2 * math.pi / count * row
            sunk = 1e3 * (length * np.cos(angle) - columns["y_m"])
            depth.plot(columns["t_s"], np.where(sunk > 0, sunk, np.nan), lw=1.4, **style)
        depth.set(xlabel="time [s]", ylabel="sinkage of a row [mm]")
        depth.invert_yaxis()
        legend_above(drawing, [handle(str(name), lw=1.6, **style) for name, style in styles.items()], count)
        title_above(drawing, title_of(result).replace("of sand:", "of sand-weak:"))  # what `sand` was when it ran
        drawing.savefig(HERE.parent / "images" / "row-feet.png", dpi=130)


if __name__ == "__main__":
    main()
