"""Plates of 60, 80 and 100 mm pushed into loose dry sand: predicted from its density and its angle alone.

The sand is not named; 1330 kg/m3 and an angle of repose of 29 degrees are what its authors state. Grains of quartz
(2650 kg/m3) that lie at a packing of 0.502 have that density. A rolling friction of 0.356 gives 28.3 to 28.7 degrees on
the plane of shear and 0.501 fluffed (docs/materials.md). Nothing else is chosen, and no force enters.

Without cohesion, and where neither grains nor speed nor walls count, a plate's force can only be
    F = rho g D^3 f(z / D)
with one f for all plates: bulk density rho, diameter D, depth z. So one figure shows what of the measured curves any
such bed can have, and grains of two sizes show what their size does.

Each bed is periodic sideways and three diameters of its largest plate wide; plates go into fresh copies of it, one
each. The two larger ones are 8 and 10 grains across in the coarse grains, the smallest is 8 in finer ones, in a bed of
its own. A plate goes at the speed at which the inertial number (speed / D) d sqrt(density / (rho g D / 2)) is
``INERTIAL``: the pressure is that of the bed at half a plate's depth, which is less than what the plate adds.
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
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, listed, near_zero, tracked
from experiments.validate.base.drops import drive_down, part

from . import say

__all__ = ["CASES", "PLATES", "Push", "compared_with", "measured_pushes", "predicted", "settings"]

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
SEEDS, FINE_SEEDS = (1,), (1,)  # of the wide beds of coarse grains; of the smallest plate's of fine ones
SMALL_BOX, SMALL_SEEDS = (0.18, 0.18, 0.14), (1,)  # the bed of the smallest plate [m]; seeds of coarse grains in it
STEP = 0.00025  # between two depths of a curve [m]
BAND, POWER_BAND = 0.25, 0.3  # of K and of the curves, of the exponent [1]; ours
FROM = 0.004  # from this depth on the powers of diameter and depth are read [m]
DOTS = 40  # of a curve in a figure


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
        "fine": FINE, "seeds": list(SEEDS),
        "fine_seeds": list(FINE_SEEDS), "small_box": list(SMALL_BOX), "small_seeds": list(SMALL_SEEDS),
        "step": STEP,
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
    means = [
        float(force[a:b].mean()) if b > a else float(at) for (a, b), at in zip(pairwise(places), plain, strict=True)
    ]
    return np.array(means)


def pushes() -> list[Push]:
    """Every push of the prediction."""
    coarse = [Push(d, COARSE, seed) for seed in SEEDS for d in PLATES]
    fine = [Push(PLATES[0], FINE, seed, SMALL_BOX) for seed in FINE_SEEDS]
    small = [Push(PLATES[0], COARSE, seed, SMALL_BOX) for seed in SMALL_SEEDS]
    return [*coarse, *fine, *small]


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
    grain: float  # of the beds that count [m]
    grid: np.ndarray  # depths [m], shape [n]
    beds: np.ndarray  # forces in them [N], shape [beds, n]
    measured: np.ndarray  # of the measured pushes, shape [3, n]

    def stiffnesses(self, forces: np.ndarray) -> np.ndarray:
        """K of each curve [N/m]."""
        return np.array([stiffness(self.grid, force) for force in forces])

    @property
    def ours(self) -> float:
        """K of the mean predicted curve [N/m]."""
        return stiffness(self.grid, self.beds.mean(axis=0))

    @property
    def theirs(self) -> float:
        """K of the mean measured curve [N/m]."""
        return stiffness(self.grid, self.measured.mean(axis=0))

    @property
    def off(self) -> float:
        """How far the mean curves are apart, over the measured one; root mean squares [1]."""
        wanted = self.measured.mean(axis=0)
        return float(np.sqrt(((self.beds.mean(axis=0) - wanted) ** 2).mean() / (wanted**2).mean()))


def held(prediction: Mapping[str, Any]) -> list[Held]:
    """The prediction beside what was measured, plate by plate."""
    curves: dict[float, list[tuple[np.ndarray, np.ndarray]]] = {}
    for diameter, _, depth, force in measured_pushes():
        curves.setdefault(diameter, []).append((depth, force))
    coarse, fine = by_plate(prediction, grain=COARSE), by_plate(prediction, grain=FINE, box=SMALL_BOX)
    rows = []
    for diameter, deep in zip(PLATES, DEEP, strict=True):
        grid = grid_of(min(deep, *(float(depth.max()) for depth, _ in curves[diameter])))
        measured = np.array([np.interp(grid, depth, force) for depth, force in curves[diameter]])
        grain = FINE if diameter in fine else COARSE
        rows.append(Held(diameter, grain, grid, (coarse | fine)[diameter][:, : len(grid)], measured))
    return rows


def effects(prediction: Mapping[str, Any]) -> dict[str, float]:
    """What K of the smallest plate owes to chance, the grains' size and the bed's width [1].

    ``scatter``: standard deviation between the beds of coarse grains, of both widths. ``size``: c of K = K_0
    (1 - c d / D), from coarse and fine grains in the small bed. ``narrow``: mean ratio less one of a narrower
    bed, with the same seeds.
    """
    smallest, grid = PLATES[0], grid_of(DEEP[0])

    def each(**wanted: Any) -> np.ndarray:
        return np.array([stiffness(grid, force) for force in by_plate(prediction, **wanted)[smallest]])

    wide, small = each(grain=COARSE), each(grain=COARSE, box=SMALL_BOX)
    fine = each(grain=FINE, box=SMALL_BOX)
    ratio = float(small.mean() / fine.mean())  # (1 - c d / D) / (1 - c d' / D)
    alike = np.concatenate([wide, small])
    return {
        "scatter": float(alike.std(ddof=1) / alike.mean()), "size": smallest * (1 - ratio) / (COARSE - ratio * FINE),
        "narrow": float((small[: len(wide)] / wide[: len(small)]).mean()) - 1,
    }  # fmt: skip


def compared_with(prediction: Mapping[str, Any]) -> Outcome:
    """The prediction held against the nine curves. ``prediction``: as ``predicted`` gives it."""
    rows, other = held(prediction), effects(prediction)
    names = [f"{1e3 * one.diameter:.0f} mm" for one in rows]
    ours, theirs = ([getattr(one, key) for one in rows] for key in ("ours", "theirs"))
    wanted, found = (exponent(PLATES, values) for values in (theirs, ours))
    numbers = [
        Comparison(f"K, plate of {name}", "N/m", one.theirs, one.ours, BAND)
        for name, one in zip(names, rows, strict=True)
    ]
    numbers += [
        near_zero(f"the whole curve, plate of {name}, rms over the measured one's", one.off, BAND)
        for name, one in zip(names, rows, strict=True)
    ]
    numbers.append(Comparison("exponent of the diameter in K", "1", wanted, found, POWER_BAND, False))
    each = "; ".join(
        say(
            "plate", name=name, theirs=one.theirs, spread=100 * one.stiffnesses(one.measured).std(ddof=1) / one.theirs,
            ours=one.ours, chance=100 * other["scatter"] / math.sqrt(len(one.beds)), across=one.diameter / one.grain,
            beds=len(one.beds),
            finer=100 * (1 / (1 - other["size"] * one.grain / one.diameter) - 1),
        )
        for name, one in zip(names, rows, strict=True)
    )  # fmt: skip
    kept = prediction["pushes"]
    packing = np.array([row["packing"] for row in kept])
    words = say(
        "pushes", each=each, fine=1e3 * FINE, coarse=1e3 * COARSE, packing=float(packing.mean()),
        density=float(packing.mean()) * SAND.density, inertial=INERTIAL, rolling=SAND.rolling_friction,
        least=min(row["count"] for row in kept), most=max(row["count"] for row in kept),
        overlap=100 * max(row["overlap"] for row in kept), narrow=100 * other["narrow"], small=1e3 * SMALL_BOX[0],
        wide=1e3 * BOX[0],
    )  # fmt: skip
    rest = say("rest", thick=1e3 * THICK)
    one_bed = by_plate(prediction, grain=COARSE)
    alike = [stiffness(one.grid, one_bed[one.diameter].mean(axis=0)[: len(one.grid)]) for one in rows]
    return Outcome(numbers, list(_plots(rows, names)), [words, rest, _collapse(rows, exponent(PLATES, alike))])


def _plots(rows: Sequence[Held], names: Sequence[str]) -> Iterator[Plot]:
    for one, name in zip(rows, names, strict=True):
        depth = 1e3 * one.grid
        curves = [Curve(f"measured, push {k}", depth, force, False) for k, force in enumerate(one.measured, 1)]
        some = slice(None, None, max(1, len(depth) // DOTS))
        curves += [Curve(f"bed {k}, predicted", depth[some], f[some]) for k, f in enumerate(one.beds, 1)]
        yield Plot(f"Plate of {name}", "depth [mm]", "force [N]", curves)
    curves = []
    for one, name in zip(rows, names, strict=True):
        unit, x = BULK_DENSITY * GRAVITY * one.diameter**3, one.grid / one.diameter
        some = slice(None, None, max(1, len(x) // DOTS))
        curves.append(Curve(f"measured, {name}", x, one.measured.mean(axis=0) / unit, False))
        curves.append(Curve(f"bed, {name}", x[some], one.beds.mean(axis=0)[some] / unit))
    yield Plot("Forces of all plates, scaled by their size", "z / D [1]", "F / (rho g D^3) [1]", curves)


def powers(rows: Sequence[Held], kind: str) -> tuple[float, float]:
    """a and b of F = c D^a z^b, by logarithms, over the depths that all plates reach. ``kind``: of curve."""
    deepest = min(float(one.grid[-1]) for one in rows)
    terms, logs = [], []
    for one in rows:
        here = (one.grid >= FROM) & (one.grid <= deepest)
        z, force = one.grid[here], getattr(one, kind).mean(axis=0)[here]
        terms.append(np.column_stack([np.ones(len(z)), np.full(len(z), math.log(one.diameter)), np.log(z)]))
        logs.append(np.log(force))
    found = np.linalg.lstsq(np.concatenate(terms), np.concatenate(logs), rcond=None)[0]
    return float(found[1]), float(found[2])


def _collapse(rows: Sequence[Held], alike: float) -> str:
    """What of the curves no bed without cohesion, walls and grains' size can have, in words.

    ``alike``: exponent of the diameter in K where all plates go into one bed.
    """
    share = min(float(one.grid[-1]) / one.diameter for one in rows)
    found = []
    for kind in ("measured", "beds"):
        forces = [np.interp(share * one.diameter, one.grid, getattr(one, kind).mean(axis=0)) for one in rows]
        units = [BULK_DENSITY * GRAVITY * one.diameter**3 for one in rows]
        found.append(listed([float(force / unit) for force, unit in zip(forces, units, strict=True)], ".1f"))
    theirs, ours = (powers(rows, kind) for kind in ("measured", "beds"))
    return say(
        "collapse", share=share, measured=found[0], ours=found[1], least=1e3 * FROM, a=theirs[0], b=theirs[1],
        both=sum(theirs), ours_a=ours[0], ours_b=ours[1], ours_both=sum(ours),
        alike=alike,
    )  # fmt: skip


def _compute(tell: Tell) -> Outcome:
    return compared_with(predicted(tell))


CASES = {"plates-in-sand": _compute}
