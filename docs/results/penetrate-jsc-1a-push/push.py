"""Pushes a ball tip into a bed of jsc-1a-loose-cut: `python push.py SEED GRAIN_MM SPEED...`, the repository on
PYTHONPATH. Further words: `gravity=1e-3` [g], `tip=12` [mm], `places=01234`, `box=50x50x38` [mm] instead of 64x64x44,
`arch=cuda` for a GPU.

The bed is prepared at 1 g by the recipe of the material (as docs/results/penetrate-foot-jsc-1a-loose-cut-beds before
gravity is lowered), and its grains are stiffened to 80 MPa. Every push starts from this bed, in its centre (place 0) or
between the centre and a corner (places 1 to 4), and goes 5.2/12 of the tip deep. Appends the mean force in each
1/120 of the tip's diameter to pushes.csv in the working folder; pushes that are already there are left out.
"""

import csv
import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
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
COLUMNS = ("gravity_m_s2", "grain_mm", "bed_mm", "seed", "place", "tip_mm", "speed_m_s", "depth_mm", "force_N")
YOUNG, DEPTH, BIN = 8e7, 0.0052 / 0.012, 1 / 120  # [Pa], [tip diameters], [tip diameters]
LEAST = 1e-3  # Gravity down to which grains come to rest by the rule of `penetrate` [g]; below, by a drag
PLACES = ((0.5, 0.5), (0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75))  # Of the widths of the bed [1]


@dataclass(frozen=True)
class Case:
    """The pushes of one call."""

    seed: int
    grain: float  # [mm]
    speeds: tuple[float, ...]  # [m/s]
    gravity: float = 1.0  # [g]
    tip: float = 12.0  # [mm]
    places: tuple[int, ...] = (0, 1, 2, 3, 4)
    box: str = "64x64x44"  # [mm]
    arch: str = "cpu"

    @property
    def size(self) -> tuple[float, ...]:
        """Size of the bed [m]."""
        return tuple(1e-3 * float(part) for part in self.box.split("x"))

    @property
    def kept(self) -> Path:
        """File of the bed."""
        return Path(
            f"bed-{self.grain:g}mm-seed{self.seed}" + ("" if self.box == "64x64x44" else f"-{self.box}") + ".npz"
        )

    def named(self, place: int, speed: float) -> tuple[str, ...]:
        """The first seven columns of a push."""
        gravity = f"{self.gravity * STANDARD_GRAVITY:.6g}"
        return gravity, f"{self.grain:g}", self.box, f"{self.seed}", f"{place}", f"{self.tip:g}", f"{speed:g}"


def case_of(words: Sequence[str]) -> Case:
    """The case that the words of the command line name."""
    given: dict[str, Any] = dict(word.split("=") for word in words if "=" in word)
    seed, grain, *speeds = [float(word) for word in words if "=" not in word]
    found: dict[str, Any] = {key: float(given.pop(key)) for key in ("gravity", "tip") if key in given}
    if "places" in given:
        found["places"] = tuple(map(int, given.pop("places")))
    return Case(int(seed), grain, tuple(speeds), **found, **given)


def prepared(case: Case) -> PenetrateSettings:
    """Prepare and keep the bed; the settings of its pushes."""
    grain = 1e-3 * case.grain
    other = {"grain": grain, "allow_coarse": True, "bed_size": case.size, "tip_diameter": 0.012}
    foot = PenetrateSettings(**(RunFolder.open(FOOT).settings | other))
    spike = PenetrateSettings(
        material=foot.material, bed_size=foot.bed_size, grain=grain, depth=1e-3 * case.tip * DEPTH, speeds=(0.03125,),
        tip_diameter=1e-3 * case.tip, drop_speeds=(), seeds=(case.seed,), allow_coarse=True, threads=1,
        arch=case.arch, max_overlap=0.08,
    )  # fmt: skip
    if not case.kept.exists():
        bed = staged_bed(
            beds.find_material(foot), beds.stages_of(foot) or (), progress=Progress(), asked_to_stop=lambda: False,
            size=foot.bed_size, grain=grain, spread=foot.spread, gravity=beds.first_gravity(foot), seed=case.seed,
            young=beds.choose_softness(foot).young, max_overlap=foot.max_overlap, time_step=None,
            precision="float64", arch=case.arch, threads=1, cache=True,
        )  # fmt: skip
        beds.stiffened(bed, YOUNG, spike).save(case.kept)
    return spike


def push(case: Case, spike: PenetrateSettings, speed: float, place: int) -> tuple[np.ndarray, float]:
    """Depth [m] and force [N] of a push at `speed` [m/s], shape (n, 2), and its largest overlap [of a diameter]."""
    bed = Bed.load(case.kept, arch=case.arch, threads=1)
    if case.gravity != 1:
        unit = (spike.grain / STANDARD_GRAVITY) ** 0.5  # [s]
        bed.set_gravity(max(case.gravity, LEAST) * STANDARD_GRAVITY)
        beds._come_to_rest(bed, unit=unit)
        if case.gravity < LEAST:
            bed.set_gravity(case.gravity * STANDARD_GRAVITY)
            bed.advance(math.ceil(1.5 * unit / bed.time_step), drag_time=0.3 * unit)
            bed.measure_surface()
            bed.max_overlap = 0.0
    bed.overlap_limit = 0.12
    at = tuple(share * width for share, width in zip(PLACES[place], bed.size[:2], strict=True))
    run = units.make_run(spike, units.Unit(case.seed, "driven", speed), BedGround(bed, units.make_spike(spike), at=at))
    while run.depth < 0.999 * spike.depth and not run.done:
        run.advance()
    found = run.result()
    return np.column_stack([found.depth, found.force]), bed.max_overlap


def means_of(series: np.ndarray, tip: float) -> list[tuple[float, float]]:
    """Depth [m] of the middle of each bin and its mean force [N]; between two steps where no step is in a bin."""
    means = []
    for index in range(round(DEPTH / BIN)):
        low, high = index * BIN * tip, (index + 1) * BIN * tip
        inside = (series[:, 0] >= low) & (series[:, 0] < high)
        middle = (low + high) / 2
        means.append((middle, float(series[inside, 1].mean() if inside.any() else np.interp(middle, *series.T))))
    return means


def main(words: Sequence[str]) -> None:
    """Prepare the bed, push, and append the means."""
    case, file = case_of(words), Path("pushes.csv")
    if not file.exists():
        file.write_text(",".join(COLUMNS) + "\n")
    with file.open() as lines:
        done = {tuple(row[:7]) for row in csv.reader(lines)}
    spike = prepared(case)
    for speed in case.speeds:
        for place in case.places:
            name = case.named(place, speed)
            if name in done:
                continue
            series, overlap = push(case, spike, speed, place)
            np.savetxt(
                re.sub(r"\s+", "-", " ".join(name)) + ".csv", series, "%.6g", ",", header="depth_m,force_N", comments=""
            )
            with file.open("a", newline="") as lines:
                csv.writer(lines, lineterminator="\n").writerows(
                    (*name, f"{1e3 * depth:.4g}", f"{force:.5g}")
                    for depth, force in means_of(series, spike.tip_diameter)
                )
            print(*name, f"overlap {overlap:.3g}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
