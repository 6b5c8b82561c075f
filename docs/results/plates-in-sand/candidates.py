"""What could make the measured plates bear as they do: forms of the measured curves, and beds changed in one respect.

    python docs/results/plates-in-sand/candidates.py forms          # seconds; the measured curves alone
    python docs/results/plates-in-sand/candidates.py beds [NAME]    # a plate of 100 mm in grains of 10 mm; minutes each
    python docs/results/plates-in-sand/candidates.py plates [NAME]  # all plates as predicted, beside the measured

Both write into candidates.json beside this file. Forms: F / rho g = s(D) f(x), with s and x as named, f a cubic in ln x
between logarithms, the same for all nine pushes from 2 mm of depth on; what is missed is the root mean square over the
measured force's, in the mean over the pushes. Beds: as for the kept prediction but for what the name says.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from dem import Bed, Cylinder
from experiments.validate.base.drops import drive_down, part
from experiments.validate.measured import plates

HERE = Path(__file__).parent
FROM = 0.002  # [m]
UNIT = 0.08  # of lengths [m]
WEIGHT = plates.BULK_DENSITY * plates.GRAVITY
# Of each form its first guesses and, from them, depths z and the diameter D, what f takes and what multiplies it.
FORMS: dict[str, tuple[list[float], Callable[..., tuple[np.ndarray, Any]]]] = {
    "D^3 f(z / D): any cohesionless bed without another length": ([], lambda p, z, d: (z / d, d**3)),
    "D^a f(z / D)": ([4.0], lambda p, z, d: (z / d, UNIT**3 * (d / UNIT) ** p[0])),
    "D^3 f(z): a length in the depth alone": ([], lambda p, z, d: (z / UNIT, d**3)),
    "D^a f(z)": ([3.0], lambda p, z, d: (z / UNIT, UNIT**3 * (d / UNIT) ** p[0])),
    "D^3 f((z + o) / D), an offset for each plate [mm]": (
        [0.0, 2.0, 3.0], lambda p, z, d: ((z + 1e-3 * p[plates.PLATES.index(d)]) / d, d**3),
    ),
    "D^3 f(z / D) exp((z + D / 2) / L): stronger with depth, 100 mm / L": (
        [3.0], lambda p, z, d: (z / d, d**3 * np.exp(10 * p[0] * (z + 0.5 * d))),
    ),
    "D^3 f(z / D) exp(z / L): the same, felt at the plate alone": (
        [5.0], lambda p, z, d: (z / d, d**3 * np.exp(10 * p[0] * z)),
    ),
    "D^3 f(z / D) / (1 - (z + D / 2) / H): a floor at H, 100 mm": (
        [1.0], lambda p, z, d: (z / d, d**3 / np.clip(1 - (z + 0.5 * d) / (0.1 * p[0]), 1e-3, None)),
    ),
}  # fmt: skip
BEDS: dict[str, dict[str, Any]] = {
    "as predicted": {},
    "floor at 100 mm": {"box": (0.3, 0.3, 0.1)},
    "floor at 75 mm": {"box": (0.3, 0.3, 0.075)},
    "floor at 70 mm": {"box": (0.3, 0.3, 0.07)},
    "floor at 50 mm": {"box": (0.3, 0.3, 0.05)},
    "sides 250 mm apart": {"box": (0.25, 0.25, 0.14)},
    "sides 200 mm apart": {"box": (0.2, 0.2, 0.14)},
    "sides 150 mm apart": {"box": (0.15, 0.15, 0.14)},
    "as rained": {"stages": ("rain", "level")},
}


def fitted(guesses: list[float], form: Callable[..., tuple[np.ndarray, Any]]) -> dict[str, Any]:
    """A form's numbers, and what it misses of each push [1]."""
    rows = [(d, z[z >= FROM], force[z >= FROM]) for d, _, z, force in plates.measured_pushes()]
    count = len(guesses)

    def off(numbers: np.ndarray) -> np.ndarray:
        parts = []
        for d, z, force in rows:
            x, scale = form(numbers[:count], z, d)
            found = WEIGHT * scale * np.exp(np.polyval(numbers[count:], np.log(np.clip(x, 1e-4, None))))
            parts.append((found - force) / np.sqrt((force**2).mean() * len(z)))
        return np.concatenate(parts)

    found = least_squares(off, [*guesses, 0.0, 0.0, 1.3, 5.0], x_scale="jac", max_nfev=5000)
    each = np.split(found.fun**2, np.cumsum([len(z) for _, z, _ in rows])[:-1])
    missed = np.sqrt([one.sum() for one in each])
    return {"numbers": found.x[:count].round(3).tolist(), "missed": round(float(np.sqrt((missed**2).mean())), 4)}


def run(
    diameter: float, box: tuple[float, float, float], stages: tuple[str, ...], seed: int, grain: float
) -> dict[str, Any]:
    """Depth [m] and force [N] of one push, packing, count and overlap of its bed."""
    push = plates.Push(diameter, grain, seed, box)

    def compute() -> dict[str, Any]:
        bed = Bed.prepare_as(
            plates.SAND, stages=stages, size=box, grain=grain, spread=plates.SPREAD, gravity=plates.GRAVITY, seed=seed,
            young=plates.YOUNG, max_overlap=plates.OVERLAP, cache=True, threads=1,
        ).whole  # fmt: skip
        bed.overlap_limit, bed.max_overlap = (
            0.5,
            0.0,
        )  # between a plate and a near floor soft grains give way: it is told
        packing, count = bed.packing_fraction, bed.grain_count
        plate, middle = Cylinder(0.0, plates.THICK, 0.5 * diameter), (0.5 * box[0], 0.5 * box[1])
        found = drive_down(bed, plate, at=middle, speed=push.speed, depth=push.depth)
        return found | {"packing": packing, "count": count, "overlap": bed.max_overlap}

    about = {"diameter": diameter, "box": box, "stages": stages, "seed": seed, "grain": grain}
    return part("plate-changed", about | {"speed": push.speed, "depth": push.depth}, compute)


def pushed(
    box: tuple[float, float, float] = plates.BOX, stages: tuple[str, ...] = plates.STAGES, seed: int = 1
) -> dict[str, Any]:
    """K down to z / D = 0.17, F / (rho g D^3) there and the packing, of a plate of 100 mm in grains of 10 mm."""
    diameter = plates.PLATES[-1]
    found = run(diameter, box, stages, seed, plates.COARSE)
    grid = plates.grid_of(0.17 * diameter)
    force, packing = plates.on_grid(found, grid), float(found["packing"])
    return {
        "box_m": box, "stages": stages, "seed": seed, "grains": int(found["count"]), "packing": round(packing, 4),
        "overlap": round(float(found["overlap"]), 3), "K_N_m": round(plates.stiffness(grid, force)),
        "force_over_weight": round(float(force[-4:].mean()) / (WEIGHT * diameter**3), 2),
    }  # fmt: skip


def beside(box: tuple[float, float, float] = plates.BOX, stages: tuple[str, ...] = plates.STAGES) -> dict[str, Any]:
    """K of each plate and how far its curve is off the measured one, as the case has them, and the exponent."""
    measured: dict[float, list[tuple[np.ndarray, np.ndarray]]] = {}
    for diameter, _, depth, force in plates.measured_pushes():
        measured.setdefault(diameter, []).append((depth, force))
    rows: dict[str, Any] = {"box_m": box, "stages": stages, "plates": {}}
    both = []
    for diameter, deep in zip(plates.PLATES, plates.DEEP, strict=True):
        grid = plates.grid_of(min(deep, *(float(depth.max()) for depth, _ in measured[diameter])))
        wanted = np.mean([np.interp(grid, depth, force) for depth, force in measured[diameter]], axis=0)
        small = diameter == plates.PLATES[0]
        own = (*plates.SMALL_BOX[:2], box[2]) if small and box[0] == plates.BOX[0] else box
        found = run(diameter, own, stages, 1, plates.FINE if small else plates.COARSE)
        ours = plates.on_grid(found, grid)
        both.append((plates.stiffness(grid, wanted), plates.stiffness(grid, ours)))
        rows["plates"][f"{1e3 * diameter:.0f} mm"] = {
            "K_measured": round(both[-1][0]), "K": round(both[-1][1]), "overlap": round(float(found["overlap"]), 3),
            "curve_off": round(float(np.sqrt(((ours - wanted) ** 2).mean() / (wanted**2).mean())), 3),
            "force_N": ours[3::8].round(1).tolist(),
        }  # fmt: skip
    rows |= {"grains": int(found["count"]), "packing": round(float(found["packing"]), 4)}  # of the last plate's bed
    rows["exponents"] = [round(plates.exponent(plates.PLATES, values), 2) for values in zip(*both, strict=True)]
    return rows


def main(what: str, *names: str) -> None:
    """Do a part, and put it beside what is there."""
    path = HERE / "candidates.json"
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if what == "forms":
        kept["forms"] = {name: fitted(*form) for name, form in FORMS.items()}
        print(json.dumps(kept["forms"], indent=1))
    for name in (names or BEDS) if what == "beds" else ():
        for seed in (1, 2):
            found = pushed(**BEDS[name], seed=seed)
            print(name, seed, found, flush=True)
            kept.setdefault("beds", {})[f"{name}, seed {seed}"] = found
            path.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    for name in names if what == "plates" else ():
        kept.setdefault("plates", {})[name] = beside(**BEDS[name])
        print(json.dumps(kept["plates"][name]), flush=True)
    path.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
