"""Runs of a known law, to see whether the fit gives it back and how often its intervals hold the truth.

Each bed multiplies the force by a factor 1 + u with u normal of standard deviation `bed_spread`. The force of a run
fluctuates besides by `noise` times its mean, normal and correlated over a length of a grain in depth, as forces in
grains are. The bins of a run are therefore not independent, which the likelihood of a fit takes them to be.

`python -m experiments.lawfit.synthetic OUT.json` measures the coverage of docs/results/calibrate-coverage.
"""

import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from experiments.runs.folder import write_json
from experiments.runs.types import Json

from .data import Data, Foundation, PushRun
from .fit import fit_law
from .laws import CANDIDATES

__all__ = ["DESIGNS", "FOUNDATION", "coverage", "synthetic_data"]

FOUNDATION = Foundation(
    material="sand", tip="sphere", diameter=0.012, tip_height=0.006, cone_angle=60.0, gravity=9.80665, grain=0.001,
    bulk_density=1450.0, surface_friction=0.5,
)  # fmt: skip
DEPTH, BINS = 0.012, 12  # of each run [m], [1]

Design = Mapping[int, Sequence[float]]
"""Bed -> speeds of its drives [m/s]."""
DESIGNS: dict[str, Design] = {
    "three beds, two speeds": dict.fromkeys(range(3), (0.1, 0.4)),
    "five beds, two speeds": dict.fromkeys(range(5), (0.1, 0.4)),
    "five beds, three speeds": dict.fromkeys(range(5), (0.1, 0.2, 0.4)),
    "five beds, three speeds in two of them and two in three": {
        bed: (0.1, 0.2, 0.4) if bed < 2 else (0.1, 0.4) for bed in range(5)
    },
}
"""What is driven in which bed, by name."""
TRUTHS: dict[str, dict[str, float]] = {
    "spring-damper": {"stiffness": 62.0, "damping": 0.3},
    "katsuragi-durian": {"stiffness": 62.0, "drag": 0.6},
    "power-irreversible": {"stiffness": 100.0, "damping": 0.3, "exponent": 1.1},
}
"""Law -> its free parameters in the runs that are made up."""


def synthetic_data(
    law: str,
    truth: Mapping[str, float],
    design: Design,
    *,
    seed: int,
    bed_spread: float = 0.08,
    noise: float = 0.1,
) -> Data:
    """Made-up runs of `law` with the free parameters `truth`, by `design`; the same `seed` gives the same runs."""
    candidate = CANDIDATES[law](FOUNDATION)
    assert candidate is not None
    random, theta = np.random.default_rng(seed), np.array([truth[name] for name in candidate.free])
    rows = 20 * BINS
    depth = (np.arange(rows) + 0.5) * DEPTH / rows
    kept = np.exp(-DEPTH / rows / FOUNDATION.grain)  # correlation of neighbouring rows
    runs = []
    for bed, speeds in design.items():
        factor = 1 + bed_spread * random.standard_normal()
        for speed in speeds:
            force = candidate.force(theta, depth, np.full(rows, speed))
            waves = np.empty(rows)
            waves[0] = random.standard_normal()
            for k, kick in enumerate(random.standard_normal(rows - 1)):
                waves[k + 1] = kept * waves[k] + np.sqrt(1 - kept**2) * kick
            seen = factor * force + noise * force.mean() * waves
            means = [values.reshape(BINS, -1).mean(axis=1) for values in (depth, seen)]
            still = np.zeros(BINS)
            runs.append(
                PushRun(f"{bed}-{speed:g}", str(bed), "driven", speed, means[0], still + speed, still, means[1])
            )
    return Data(FOUNDATION, tuple(runs))


def coverage(
    law: str, design: Design, *, count: int, first_seed: int = 0, **noise: float
) -> dict[str, dict[str, float]]:
    """How often the 90 % intervals of `count` fits to made-up runs hold the truth, by parameter [1], and the bias."""
    truth, candidate = TRUTHS[law], CANDIDATES[law](FOUNDATION)
    assert candidate is not None
    inside = dict.fromkeys(truth, 0)
    values: dict[str, list[float]] = {name: [] for name in truth}
    for seed in range(first_seed, first_seed + count):
        fitted = fit_law(candidate, synthetic_data(law, truth, design, seed=seed, **noise))
        for name, value in truth.items():
            found = fitted.parameter(name)
            inside[name] += found.low <= value <= found.high
            values[name].append(found.value)
    return {
        name: {
            "covered": inside[name] / count, "truth": value, "mean": float(np.mean(values[name])),
            "scatter": float(np.std(values[name])),
        }
        for name, value in truth.items()
    }  # fmt: skip


def _measure(path: Path, count: int = 400) -> None:
    """Coverage of every law and design, into a JSON file, written anew after each so that it can be stopped."""
    found: Json = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for design, beds in DESIGNS.items():
        for law in TRUTHS:
            key, began = f"{law}: {design}", time.process_time()
            if key in found:
                continue
            found[key] = {"fits": count, "parameters": coverage(law, beds, count=count)}
            write_json(path, found)
            print(key, {name: one["covered"] for name, one in found[key]["parameters"].items()}, flush=True)
            print(f"{time.process_time() - began:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    _measure(Path(sys.argv[1]))
