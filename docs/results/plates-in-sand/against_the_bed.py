"""The measured pushes with the predicted curve as the base model: a campaign for `hedgebed diagnose`.

The straight spring of a diagnosis is F = K z. Here each depth z of a push is written as F_bed(z) / K_bed of its plate,
F_bed the predicted mean force (a cubic through it, 0 at the surface) and K_bed the straight spring that fits it best.
The straight spring then is a factor on the bed's own curve, one for each plate, and what a diagnosis names is what the
measured sand does beside the bed, in its shape.

    python docs/results/plates-in-sand/against_the_bed.py FOLDER
    hedgebed diagnose FOLDER --out runs/against-the-bed
"""

import csv
import json
import shutil
import sys
from pathlib import Path

import numpy as np

from experiments.validate.measured.plates import DATA, held, stiffness

HERE = Path(__file__).parent


def main(folder: Path) -> None:
    """Write the campaign into a new folder and say the factors that its straight springs start from."""
    folder.mkdir(parents=True)
    for name in ("campaign.toml", "LICENSE.txt"):
        shutil.copyfile(DATA / name, folder / name)
    rows = held(json.loads((HERE / "prediction.json").read_text(encoding="utf-8")))
    for one in rows:
        z, force = one.grid / one.grid[-1], one.beds.mean(axis=0)
        terms = np.linalg.lstsq(np.column_stack([z, z**2, z**3]), force, rcond=None)[0]
        fine = np.linspace(0.0, 1.0, 1001)
        curve = np.column_stack([fine, fine**2, fine**3]) @ terms
        if (np.diff(curve) <= 0).any():
            raise RuntimeError(f"the predicted curve of the plate of {one.diameter:g} m does not rise throughout")
        scale = stiffness(one.grid, force)
        print(f"{1e3 * one.diameter:.0f} mm: K of the bed {scale:.0f} N/m, measured {one.theirs:.0f} N/m")
        for path in sorted(DATA.glob(f"*_{1e3 * one.diameter:.0f}mm.csv")):
            with path.open(encoding="utf-8", newline="") as file:
                table = [[float(row[key]) for key in ("t_s", "depth_m", "force_N")] for row in csv.DictReader(file)]
            lines = ["t_s,depth_m,force_N"]
            for time, depth, push in table:
                if depth <= one.grid[-1]:
                    along = float(np.interp(depth / one.grid[-1], fine, curve)) / scale
                    lines.append(f"{time:.3f},{along:.6f},{push:.3f}")
            (folder / path.name).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
