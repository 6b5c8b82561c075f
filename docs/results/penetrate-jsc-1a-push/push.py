"""Pushes a 12 mm ball tip into a bed of jsc-1a-loose-cut: `python push.py SEED GRAIN_MM SPEED...`, the repository on
PYTHONPATH; `low` behind it also pushes at 0.0085 g, `box=50x50x38` [mm] takes another bed than 64 x 64 x 44.

The bed is prepared at 1 g by the recipe of the material (as docs/results/penetrate-foot-jsc-1a-loose-cut-beds before
gravity is lowered), and its grains are stiffened to 80 MPa. Every push starts from this bed, in its centre (place 0) or
between the centre and a corner (places 1 to 4). Writes a CSV for each push to the working folder: depth [m] and force
[N] of each step of the spike.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedGround
from dem import Bed
from experiments.grains.staged import staged_bed
from experiments.penetrate import beds, units
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from rigid.platform.rig import STANDARD_GRAVITY

FOOT = Path(__file__).parents[1] / "penetrate-foot-jsc-1a-loose-cut-beds"
YOUNG, DEPTH = 8e7, 0.0052  # [Pa], [m]
LOW = 0.0085 * STANDARD_GRAVITY  # [m/s2]
PLACES = ((0.5, 0.5), (0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75))  # Of the widths of the bed [1]


def prepared(seed: int, grain: float, size: tuple[float, float, float] | None, kept: Path) -> PenetrateSettings:
    """Prepare and keep the bed; the settings of its pushes. `grain`, `size`: [m]."""
    other: dict[str, Any] = {"grain": grain, "allow_coarse": True} | (
        {"bed_size": size, "tip_diameter": 0.012} if size else {}
    )
    foot = PenetrateSettings(**(RunFolder.open(FOOT).settings | other))
    spike = PenetrateSettings(
        material=foot.material, bed_size=foot.bed_size, grain=grain, depth=DEPTH, speeds=(0.03125,), drop_speeds=(),
        seeds=(seed,), allow_coarse=True, threads=1, max_overlap=0.08,
    )  # fmt: skip
    if not kept.exists():
        bed = staged_bed(
            beds.find_material(foot), beds.stages_of(foot) or (), progress=Progress(), asked_to_stop=lambda: False,
            size=foot.bed_size, grain=grain, spread=foot.spread, gravity=beds.first_gravity(foot), seed=seed,
            young=beds.choose_softness(foot).young, max_overlap=foot.max_overlap, time_step=None,
            precision="float64", arch="cpu", threads=1, cache=True,
        )  # fmt: skip
        beds.stiffened(bed, YOUNG, spike).save(kept)
    return spike


def push(kept: Path, spike: PenetrateSettings, speed: float, gravity: float, place: tuple[float, float]) -> np.ndarray:
    """Depth [m] and force [N] of a push at `speed` [m/s], shape (n, 2)."""
    bed = Bed.load(kept, arch="cpu", threads=1)
    if gravity != STANDARD_GRAVITY:
        bed.set_gravity(gravity)
        beds._come_to_rest(bed, unit=(spike.grain / STANDARD_GRAVITY) ** 0.5)
    bed.overlap_limit = 0.12
    ground = BedGround(bed, units.make_spike(spike), at=(place[0] * bed.size[0], place[1] * bed.size[1]))
    run = units.make_run(spike, units.Unit(spike.seeds[0], "driven", speed), ground)
    while run.depth < 0.999 * DEPTH and not run.done:
        run.advance()
    found = run.result()
    return np.column_stack([found.depth, found.force])


def main(words: Sequence[str]) -> None:
    """Prepare the bed, push, and write the series."""
    box = next((word[4:] for word in words if word.startswith("box=")), None)
    length, width, height = (1e-3 * float(part) for part in (box or "64x64x44").split("x"))
    seed, grain, *speeds = [float(word) for word in words if word != "low" and not word.startswith("box=")]
    name = f"{grain:g}mm-seed{seed:g}" + (f"-{box}" if box else "")
    kept = Path(f"bed-{name}.npz")
    spike = prepared(int(seed), 1e-3 * grain, (length, width, height) if box else None, kept)
    for gravity in (STANDARD_GRAVITY, LOW) if "low" in words else (STANDARD_GRAVITY,):
        for speed in speeds:
            for index, place in enumerate(PLACES):
                table = push(kept, spike, speed, gravity, place)
                file = f"{name}-place{index}-{speed:g}" + ("" if gravity == STANDARD_GRAVITY else "-low") + ".csv"
                np.savetxt(file, table, "%.6g", ",", header="depth_m,force_N", comments="")


if __name__ == "__main__":
    main(sys.argv[1:])
