"""The fastest of Katsuragi & Durian's drops in beds changed in one respect. Writes candidates.json beside this file.

    python docs/results/katsuragi-durian/candidates.py [NAME]     # minutes each

A ball at 1.8 m/s, grains of D + d over 6, the bed of seed 1, two places: as the case katsuragi-durian but for what the
name says. `drag`: (F / m - k z / m) / v^2 with the published k/m, over 3 mm of depth each; it would be 11.5 1/m.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.validate.measured import impact

HERE = Path(__file__).parent
BIN = 0.003  # [m]
BEDS: dict[str, dict[str, Any]] = {
    "as the case": {},
    "8 times stiffer": {"stiffer": 8.0},
    "4 D + d deep for 2.15": {"box": (3.2, 3.2, 4.0)},
    "5.5 D + d wide for 3.2": {"box": (5.5, 5.5, 2.15)},
}


def changed(*, box: tuple[float, float, float] = impact.BOX, stiffer: float = 1.0) -> dict[str, Any]:
    """Where the ball stops [mm], and the drag [1/m] over depth [mm]: means over the places."""
    size = tuple(share * impact.CLEAR for share in box)
    stops, drags = [], []
    for place in impact.PLACES:
        drop = replace(impact.fall(6, 1, place, impact.SPEEDS[-1]), size=size, stiffer=stiffer)
        found = drop.run()
        edges = BIN * np.arange(1 + int(found["depth"][-1] / BIN))
        squares = np.interp(edges, found["depth"], found["velocity"] ** 2)
        middle = 0.5 * (edges[1:] + edges[:-1])
        force = impact.GRAVITY - 0.5 * np.diff(squares) / BIN
        drags.append((force - impact.K_OVER_M * middle) / (0.5 * (squares[1:] + squares[:-1])))
        stops.append(round(1e3 * float(found["depth"][-1]), 2))
    count = min(map(len, drags))
    mean = np.mean([one[:count] for one in drags], axis=0)
    return {
        "box": box, "stiffer": stiffer, "grains": int(found["count"]), "stops_mm": stops,
        "drag": {f"{1e3 * BIN * (k + 0.5):g}": round(float(one), 1) for k, one in enumerate(mean)},
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
