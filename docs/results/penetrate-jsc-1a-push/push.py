"""Pushes a 12 mm ball tip into a bed of jsc-1a-loose-cut at 1 g: `python push.py SEED`, the repository on PYTHONPATH.

The bed is that of the foot in docs/results/penetrate-foot-jsc-1a-loose-cut-beds before gravity is lowered, of grains
stiffened to 80 MPa. Writes seed<SEED>.csv to the working folder: depth [m] and force [N] of each step of the spike.
"""

import sys
from pathlib import Path

import numpy as np

from experiments.grains.staged import staged_bed
from experiments.penetrate import beds, units
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress

FOOT = Path(__file__).parents[1] / "penetrate-foot-jsc-1a-loose-cut-beds"
YOUNG, SPEED, DEPTH = 8e7, 0.03125, 0.007  # [Pa], [m/s], [m]


def main(seed: int) -> None:
    """Prepare the bed, push, and write the series."""
    foot = PenetrateSettings(**RunFolder.open(FOOT).settings)
    bed = staged_bed(
        beds.find_material(foot), beds.stages_of(foot) or (), progress=Progress(), asked_to_stop=lambda: False,
        size=foot.bed_size, grain=foot.grain, spread=foot.spread, gravity=beds.first_gravity(foot), seed=seed,
        young=beds.choose_softness(foot).young, max_overlap=foot.max_overlap, time_step=None, precision="float64",
        arch="cpu", threads=1, cache=True,
    )  # fmt: skip
    spike = PenetrateSettings(
        material=foot.material, bed_size=foot.bed_size, grain=foot.grain, depth=DEPTH, speeds=(SPEED,),
        drop_speeds=(), seeds=(seed,), allow_coarse=True, threads=1, max_overlap=0.08,
    )  # fmt: skip
    bed = beds.stiffened(bed, YOUNG, spike)
    bed.overlap_limit = 0.12
    run = units.make_run(spike, units.Unit(seed, "driven", SPEED), bed)
    while run.depth < 0.999 * DEPTH:
        run.advance()
    found = run.result()
    table = np.column_stack([found.depth, found.force])
    np.savetxt(f"seed{seed}.csv", table, "%.6g", ",", header="depth_m,force_N", comments="")


if __name__ == "__main__":
    main(int(sys.argv[1]))
