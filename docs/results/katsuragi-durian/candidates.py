"""Katsuragi & Durian's drops in beds changed in one respect: deeper, wider, of stiffer grains. Writes candidates.json.

    python docs/results/katsuragi-durian/candidates.py [NAME]     # minutes each

Grains of D + d over 6, the bed of seed 1, two places, three speeds: as the case katsuragi-durian but for what the name
says. 1 / d1 is the slope of the force over v^2 at a fixed depth, in the mean down to 20 mm and below it.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.validate.measured import impact

HERE = Path(__file__).parent
BEDS: dict[str, dict[str, Any]] = {
    "as the case": {},
    "4 D + d deep for 2.15": {"box": (3.2, 3.2, 4.0)},
    "5.5 D + d wide for 3.2": {"box": (5.5, 5.5, 2.15)},
    "8 times stiffer": {"stiffer": 8.0},
}


def changed(*, box: tuple[float, float, float] = impact.BOX, stiffer: float = 1.0) -> dict[str, Any]:
    """Where the balls stop [mm], and the slopes [1/m]."""
    size = tuple(share * impact.CLEAR for share in box)
    jobs = [(at, speed) for at in impact.PLACES for speed in impact.SPEEDS]
    falls, speeds = [], []
    for at, speed in jobs:
        # The same place under the ball, counted in its diameters, whatever the bed's width.
        place = tuple(share * impact.BOX[k] / box[k] for k, share in enumerate(at))
        drop = replace(impact.fall(6, 1, at, speed), size=size, at=place, stiffer=stiffer)
        falls.append(drop.run())
        speeds.append(speed)
        print(speed, at, float(falls[-1]["depth"][-1]), flush=True)
    law = impact.separated(falls, speeds)
    shallow = law.depth < 0.02
    by_speed = {
        f"{v:g}": round(1e3 * float(np.mean([f["depth"][-1] for f, s in zip(falls, speeds, strict=True) if s == v])), 2)
        for v in impact.SPEEDS
    }
    known = law.regressed
    fast = [np.nanmean(law.force[[s == impact.SPEEDS[-1] for s in speeds]], axis=0) - impact.K_OVER_M * law.depth]
    squares = np.nanmean(law.squares[[s == impact.SPEEDS[-1] for s in speeds]], axis=0)
    return {
        "box": box, "stiffer": stiffer, "grains": int(falls[0]["count"]), "stops_mm": by_speed,
        "slope_to_20_mm": round(float(law.drag[known & shallow].mean()), 1),
        "slope_below": round(float(law.drag[known & ~shallow].mean()), 1) if (known & ~shallow).any() else None,
        "fastest_beyond_k_z": [
            [round(1e3 * float(z), 1), round(float(a), 1), round(float(u), 3)]
            for z, a, u in zip(law.depth, fast[0], squares, strict=True) if np.isfinite(a)
        ],
        "k_over_m": round(law.k_over_m), "packing": round(float(falls[0]["packing"]), 4),
    }  # fmt: skip


def main(*names: str) -> None:
    """Compute, and put it beside what is there."""
    path = HERE / "candidates.json"
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for name in names or BEDS:
        kept[name] = changed(**BEDS[name])
        print(name, kept[name], flush=True)
        path.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
