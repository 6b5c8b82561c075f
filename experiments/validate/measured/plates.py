"""Plates of 60, 80 and 100 mm pushed into loose dry sand: predicted from its density and its angle alone.

The sand is not named; 1330 kg/m3 and an angle of repose of 29 degrees are what its authors state. Grains of quartz
(2650 kg/m3) that lie at a packing of 0.502 have that density, and a rolling friction of 0.356 has 28.3 to 28.7 degrees
on the plane of shear and 0.501 fluffed (docs/materials.md): nothing else is chosen, and no force enters.

Without cohesion, and where neither grains nor speed nor walls count, a plate's force can only be
    F = rho g D^3 f(z / D)
with one f for all plates: bulk density rho, diameter D, depth z. So one figure shows what of the measured curves any
such bed can have, and grains of two sizes show what their size does.

Each bed is periodic sideways, ``BOX`` large, and takes the three plates one after the other, each in a fresh copy. A
plate goes at the speed at which the inertial number (speed / D) d sqrt(density / (rho g D / 2)) is ``INERTIAL``: the
pressure is that of the bed at half a plate's depth, which is less than what the plate adds.
"""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dem import Bed, Cylinder, Material
from experiments.runs.types import Json
from experiments.validate.base.case import Tell, tracked
from experiments.validate.base.drops import drive_down, part

__all__ = ["DATA", "PLATES", "Push", "grid_of", "measured_pushes", "predicted", "settings", "stiffness"]

DATA = Path(__file__).parents[2] / "examples" / "cmu-plate-sinkage"
PLATES = (0.06, 0.08, 0.1)  # diameters [m]
SAND = Material("sand-29-degrees", 2650.0, 70e9, 0.25, 0.5, 0.5, 0.356)
BULK_DENSITY, GRAVITY = 1330.0, 9.80665  # as stated [kg/m3]; [m/s2]
STAGES = ("rain", "fluff", "level")
SPREAD, YOUNG, OVERLAP, PRESSED = 0.15, 2e7, 0.05, 0.2
"""Of diameters [1]; softened modulus [Pa]; bound on overlaps of the bed, and of the push [1]."""
BOX = (0.3, 0.3, 0.14)  # of the bed [m]: three of the largest plate wide
THICK = 0.01  # of a plate [m]: a guess; sand may fall on it
INERTIAL = 0.009
DEEP = (0.031, 0.029, 0.02)  # how far each is pushed [m]: as the shortest of its measured pushes, and a little more
COARSE, FINE = 0.01, 0.0075  # mean diameters of the grains [m]: 6 and 8 across the smallest plate
SEEDS = (1, 2, 3)
SMALL_BOX, STIFF = (0.18, 0.18, 0.14), 8e7
"""For what else may count, with the smallest plate in coarse grains: a narrower bed, and stiffer grains in it."""
SMALL_SEEDS = (1, 2)
STEP = 0.00025  # between two depths of a curve [m]


@dataclass(frozen=True)
class Push:
    """A plate that goes down into a bed of its own; SI units."""

    diameter: float
    grain: float
    seed: int
    box: tuple[float, float, float] = BOX
    young: float = YOUNG

    @property
    def speed(self) -> float:
        """At which the inertial number is ``INERTIAL`` [m/s]."""
        slow = math.sqrt(BULK_DENSITY * GRAVITY * 0.5 * self.diameter / SAND.density)
        return INERTIAL * self.diameter / self.grain * slow

    @property
    def depth(self) -> float:
        """How far it is pushed [m]."""
        return DEEP[PLATES.index(self.diameter)]

    def run(self) -> dict[str, np.ndarray]:
        """Depth [m] and force [N] of each step, shape [n], what the bed's packing was, its grains, overlaps; kept."""

        def compute() -> dict[str, Any]:
            bed = Bed.prepare_as(
                SAND, stages=STAGES, size=self.box, grain=self.grain, spread=SPREAD, gravity=GRAVITY, seed=self.seed,
                young=self.young, max_overlap=OVERLAP, cache=True,
            ).whole  # fmt: skip
            bed.overlap_limit, bed.max_overlap = PRESSED, 0.0
            packing, count = bed.packing_fraction, bed.grain_count
            plate = Cylinder(0.0, THICK, 0.5 * self.diameter)
            middle = (0.5 * self.box[0], 0.5 * self.box[1])
            found = drive_down(bed, plate, at=middle, speed=self.speed, depth=self.depth)
            return found | {"packing": packing, "count": count, "overlap": bed.max_overlap}

        return part("plate", asdict(self) | {"speed": self.speed, "depth": self.depth, "thick": THICK}, compute)


def settings() -> Json:
    """Everything that the prediction was made with, as it is kept beside it."""
    return {
        "material": {key: value for key, value in asdict(SAND).items() if key != "sources"}, "stages": list(STAGES),
        "spread": SPREAD, "young": YOUNG, "box": list(BOX), "gravity": GRAVITY, "bulk_density": BULK_DENSITY,
        "plates": list(PLATES), "thick": THICK, "inertial_number": INERTIAL, "depths": list(DEEP), "coarse": COARSE,
        "fine": FINE, "seeds": list(SEEDS), "small_box": list(SMALL_BOX), "small_seeds": list(SMALL_SEEDS),
        "stiff": STIFF, "step": STEP,
    }  # fmt: skip


def grid_of(deepest: float) -> np.ndarray:
    """The depths at which curves are compared, from the first step down to ``deepest`` [m]."""
    return STEP * np.arange(1, math.floor(deepest / STEP + 1e-9) + 1)


def on_grid(run: Mapping[str, np.ndarray], grid: np.ndarray) -> np.ndarray:
    """Force of a push at the depths of a grid [N]: its mean over a step about each."""
    edges = np.concatenate([grid - 0.5 * STEP, [grid[-1] + 0.5 * STEP]])
    order = np.argsort(run["depth"], kind="stable")
    depth, force = run["depth"][order], run["force"][order]
    places = np.searchsorted(depth, edges)
    plain = np.interp(grid, depth, force)
    means = [float(force[a:b].mean()) if b > a else float(at) for (a, b), at in zip(pairwise(places), plain, strict=True)]
    return np.array(means)


def pushes() -> list[Push]:
    """Every push of the prediction, the quick ones first."""
    coarse = [Push(d, COARSE, seed) for seed in SEEDS for d in PLATES]
    small = [Push(PLATES[0], COARSE, s, SMALL_BOX, young) for s in SMALL_SEEDS for young in (YOUNG, STIFF)]
    return [*coarse, *(Push(d, FINE, seed) for seed in SEEDS for d in PLATES), *small]


def predicted(tell: Tell) -> Json:
    """The forces of all pushes on their grids, with the settings: what is kept as the prediction."""
    rows = []
    for push in tracked(pushes(), tell):
        run = push.run()
        about = asdict(push) | {"speed": push.speed} | {key: run[key].item() for key in ("packing", "count", "overlap")}
        rows.append(about | {"force": [round(f, 4) for f in on_grid(run, grid_of(push.depth)).tolist()]})
    return {"settings": settings(), "pushes": rows}


def measured_pushes() -> Iterator[tuple[float, str, np.ndarray, np.ndarray]]:
    """Of each measured push its plate's diameter [m], its name, depths [m] and forces [N], shape [n].

    Forces are fresh some twelve times a second and held in between: the rows at which they change are taken.
    """
    for path in sorted(DATA.glob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            rows = np.array([[float(row["depth_m"]), float(row["force_N"])] for row in csv.DictReader(file)])
        fresh = np.concatenate([[True], np.diff(rows[:, 1]) != 0])
        diameter = 1e-3 * float(path.stem.rpartition("_")[2].removesuffix("mm"))
        yield diameter, path.stem, rows[fresh, 0], rows[fresh, 1]


def stiffness(grid: np.ndarray, force: np.ndarray) -> float:
    """K of the straight spring through the surface that fits a curve best [N/m]."""
    return float(grid @ force / (grid @ grid))


def exponent(diameters: Sequence[float], values: Sequence[float]) -> float:
    """b of the least squares values = a diameters^b in logarithms [1]."""
    return float(np.polyfit(np.log(diameters), np.log(values), 1)[0])


def by_plate(prediction: Mapping[str, Any], **wanted: Any) -> dict[float, np.ndarray]:
    """Forces [N] of the predicted pushes that have these values, by their plate [m]: shape [pushes, depths]."""
    wanted = {"box": BOX, "young": YOUNG} | wanted
    found: dict[float, list[list[float]]] = {}
    for row in prediction["pushes"]:
        if all((tuple(row[key]) if key == "box" else row[key]) == value for key, value in wanted.items()):
            found.setdefault(row["diameter"], []).append(row["force"])
    return {diameter: np.array(rows) for diameter, rows in found.items()}


@dataclass(frozen=True)
class Held:
    """One plate, predicted and measured, on the depths that all its measured pushes reach."""

    diameter: float  # [m]
    grid: np.ndarray  # depths [m], shape [n]
    fine: np.ndarray  # forces of the beds of fine grains [N], shape [beds, n]
    coarse: np.ndarray  # of those of coarse ones
    measured: np.ndarray  # of the measured pushes, shape [3, n]

    def stiffnesses(self, forces: np.ndarray) -> np.ndarray:
        """K of each curve [N/m]."""
        return np.array([stiffness(self.grid, force) for force in forces])

    @property
    def ours(self) -> float:
        """K of the mean curve of the fine grains [N/m]."""
        return stiffness(self.grid, self.fine.mean(axis=0))

    @property
    def theirs(self) -> float:
        """K of the mean measured curve [N/m]."""
        return stiffness(self.grid, self.measured.mean(axis=0))

    @property
    def chance(self) -> float:
        """Standard error of ours, from how beds differ [1]."""
        each = self.stiffnesses(self.fine)
        return float(each.std(ddof=1) / math.sqrt(len(each)) / each.mean()) if len(each) > 1 else math.nan

    @property
    def finer(self) -> float:
        """What grains of no size would add to ours, on a straight line through the two sizes [1]."""
        coarse = stiffness(self.grid, self.coarse.mean(axis=0))
        return (self.ours - coarse) / self.ours * FINE / (COARSE - FINE)

    @property
    def off(self) -> float:
        """How far the mean curves are apart, over the measured one; root mean squares [1]."""
        wanted = self.measured.mean(axis=0)
        return float(np.sqrt(((self.fine.mean(axis=0) - wanted) ** 2).mean() / (wanted**2).mean()))


def held(prediction: Mapping[str, Any]) -> list[Held]:
    """The prediction beside what was measured, plate by plate."""
    curves: dict[float, list[tuple[np.ndarray, np.ndarray]]] = {}
    for diameter, _, depth, force in measured_pushes():
        curves.setdefault(diameter, []).append((depth, force))
    fine, coarse = (by_plate(prediction, grain=grain) for grain in (FINE, COARSE))
    rows = []
    for diameter, deep in zip(PLATES, DEEP, strict=True):
        grid = grid_of(min(deep, *(float(depth.max()) for depth, _ in curves[diameter])))
        measured = np.array([np.interp(grid, depth, force) for depth, force in curves[diameter]])
        n = len(grid)
        rows.append(Held(diameter, grid, fine[diameter][:, :n], coarse[diameter][:, :n], measured))
    return rows


def beside(prediction: Mapping[str, Any], key: str, changed: Any, plain: Any, **others: Any) -> float:
    """Mean ratio less one of K of the smallest plate in coarse grains, where one setting is another; bed by bed [1]."""
    many = {"grain": COARSE} | others
    pairs = [by_plate(prediction, **many | {key: value})[PLATES[0]] for value in (changed, plain)]
    count, grid = min(map(len, pairs)), grid_of(DEEP[0])
    each = [[stiffness(grid, force) for force in forces[:count]] for forces in pairs]
    return float(np.mean(np.array(each[0]) / np.array(each[1]))) - 1
