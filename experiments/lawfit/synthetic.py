"""Synthetic runs of a known law, which measure the bias of the fit and the coverage of its intervals.

Each bed multiplies the force by a factor 1 + u with u normal of standard deviation `bed_spread`. In addition the force
of a run fluctuates by `noise` times its mean. The noise is normal and correlated over the depth of a grain, as forces
in grains are. So the bins of a run are not independent, although the likelihood of a fit assumes it.

`python -m experiments.lawfit.synthetic OUT.json` measures the coverage of docs/results/calibrate-coverage: of fits to
so many beds, and of the whole procedure of `design`, which adds beds until the tolerance is reached.
"""

import json
import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.runs.folder import write_json
from experiments.runs.types import Json

from .data import Array, Data, Foundation, PushRun
from .design import LEAST_BEDS, how_sure, middle_force, sure_enough
from .dimensionless import CrossedLaw, cross, tangent_at
from .fit import fit_law
from .laws import CANDIDATES
from .trust import beyond

__all__ = [
    "DESIGNS",
    "FOUNDATION",
    "beyond_coverage",
    "coverage",
    "crossed_coverage",
    "scaled_cells",
    "stopping_coverage",
    "synthetic_data",
]

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
SPREADS = (0.02, 0.05, 0.08, 0.12, 0.2)
"""Spreads of the beds with which the whole procedure is measured [1]."""
TRUTHS: dict[str, dict[str, float]] = {
    "spring-damper": {"stiffness": 62.0, "damping": 0.3},
    "katsuragi-durian": {"stiffness": 62.0, "drag": 0.6},
    "power-irreversible": {"stiffness": 100.0, "damping": 0.3, "exponent": 1.1},
}
"""Law -> its free parameters in synthetic runs."""


def synthetic_data(
    law: str,
    truth: Mapping[str, float],
    design: Design,
    *,
    seed: int,
    bed_spread: float = 0.08,
    noise: float = 0.1,
    bins: int = BINS,
) -> Data:
    """Synthetic runs of `law` with the free parameters `truth`, by `design`; the same `seed` gives the same runs.

    `bins`: intervals over which the rows of a run are averaged, a divisor of 240; the rows are the same for all.
    """
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
            seen = factor * force + noise * force.mean() * _waves(random, rows, kept)
            means = [values.reshape(bins, -1).mean(axis=1) for values in (depth, seen)]
            still = np.zeros(bins)
            runs.append(
                PushRun(f"{bed}-{speed:g}", str(bed), "driven", speed, means[0], still + speed, still, means[1])
            )
    return Data(FOUNDATION, tuple(runs))


def _waves(random: np.random.Generator, count: int, kept: float) -> Array:
    """Normal numbers of variance 1, neighbours correlated by `kept`, shape [count]."""
    waves = np.empty(count)
    waves[0] = random.standard_normal()
    for k, kick in enumerate(random.standard_normal(count - 1)):
        waves[k + 1] = kept * waves[k] + np.sqrt(1 - kept**2) * kick
    return waves


def scaled_cells(
    law: CrossedLaw,
    theta: Sequence[float],
    *,
    shapes: Sequence[str] = ("sphere", "flat"),
    gravities: Sequence[float] = (9.80665, 0.980665),
    beds: int = 3,
    noise: float = 0.02,
    seed: int = 1,
) -> dict[str, Data]:
    """Synthetic runs of a dimensionless law at three Froude numbers, in `beds` beds of every shape and gravity.

    Beds differ by 5 %; the force of each interval of depth fluctuates by `noise` times the mean of its run, correlated
    over a grain.
    """
    random, cells = np.random.default_rng(seed), {}
    factors = 1 + 0.05 * random.standard_normal(beds)
    x, still = (np.arange(BINS) + 0.5) / BINS * 0.9, np.zeros(BINS)
    for gravity in gravities:
        for shape, diameter in zip(shapes, (0.012, 0.016), strict=False):
            of, runs = replace(FOUNDATION, tip=shape, diameter=diameter, gravity=gravity, grain=0.0024), []
            depth = x * diameter
            for bed, factor in enumerate(factors):
                for number in (0.2, 0.4, 0.8):
                    speed = number * math.sqrt(gravity * diameter)
                    force = factor * np.array([law.force(np.array(theta), of, z, speed) for z in depth.tolist()])
                    force += noise * force.mean() * _waves(random, BINS, math.exp(-(depth[1] - depth[0]) / of.grain))
                    name = f"{bed}-{number}"
                    runs.append(PushRun(name, f"seed {bed}", "driven", speed, depth, still + speed, still, force))
            cells[f"{shape}-{gravity:.3g}"] = Data(of, tuple(runs))
    return cells


def coverage(
    law: str, design: Design, *, count: int, first_seed: int = 0, bed_spread: float = 0.08, noise: float = 0.1
) -> dict[str, dict[str, float]]:
    """Share of `count` fits whose 90 % intervals contain the truth, by parameter [1], and the bias."""
    truth, candidate = TRUTHS[law], CANDIDATES[law](FOUNDATION)
    assert candidate is not None
    inside = dict.fromkeys(truth, 0)
    values: dict[str, list[float]] = {name: [] for name in truth}
    for seed in range(first_seed, first_seed + count):
        fitted = fit_law(candidate, synthetic_data(law, truth, design, seed=seed, bed_spread=bed_spread, noise=noise))
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


CROSSED_TRUTHS: dict[str, tuple[float, ...]] = {
    "scaled-spring-damper": (20.0, 30.0, 1.0),
    "power-square": (6.0, 9.0, 1.3, 0.9, 2.0),
    "power-early": (6.0, 9.0, 1.3, 0.9, 3.0, 0.5),
}
"""Law of all tips and gravities -> its free parameters in synthetic runs of a ball and a flat tip."""


def crossed_coverage(law: str, *, count: int, beds: int = 4, first_seed: int = 0) -> dict[str, float]:
    """Share of `count` fits to all cells whose 90 % intervals contain the truth [1], by parameter.

    "stiffness": of the local K of the ball under the second gravity, at half the depth and the middle speed.
    """
    candidate, truth = CrossedLaw(law, ("sphere", "flat")), CROSSED_TRUTHS[law]
    inside = dict.fromkeys((*candidate.free, "stiffness"), 0)
    for seed in range(first_seed, first_seed + count):
        cells = scaled_cells(candidate, truth, beds=beds, noise=0.05, seed=seed)
        fitted, of = fit_law(candidate, cross(cells)), cells["sphere-0.981"].foundation
        for name, value in zip(candidate.free, truth, strict=True):
            found = fitted.parameter(name)
            inside[name] += found.low <= value <= found.high
        speed = 0.4 * math.sqrt(of.gravity * of.diameter)
        load = candidate.force(np.array(truth), of, 0.45 * of.diameter, speed)
        exact = tangent_at(replace(fitted, theta=np.array(truth)), of, load, speed)
        own = tangent_at(fitted, of, load, speed)
        assert exact is not None and own is not None
        inside["stiffness"] += own.stiffness.low <= exact.stiffness.value <= own.stiffness.high
    return {name: number / count for name, number in inside.items()}


def beyond_coverage(law: str, design: Design, *, count: int, first_seed: int = 0) -> dict[str, float]:
    """Share of `count` fits whose 90 % interval of the mean error beyond the fitted range contains 0, the truth [1].

    "speed": the fastest runs were left out; "depth": the deepest third. The beds differ by 8 %.
    """
    candidate = CANDIDATES[law](FOUNDATION)
    assert candidate is not None
    inside: dict[str, float] = {}
    for seed in range(first_seed, first_seed + count):
        for kind, one in beyond(fit_law(candidate, synthetic_data(law, TRUTHS[law], design, seed=seed))).items():
            assert one.interval is not None
            inside[kind] = inside.get(kind, 0.0) + (one.interval[0] <= 0 <= one.interval[1])
    return {kind: number / count for kind, number in inside.items()}


def stopping_coverage(
    *,
    count: int,
    bed_spread: float,
    tolerance: float = 0.1,
    least: int = LEAST_BEDS,
    most: int = 12,
    first_seed: int = 0,
) -> dict[str, float]:
    """Share of `count` runs of the whole procedure whose last 90 % interval contains the truth [1].

    Beds of a spring-damper, driven at two speeds each, are added as in `design`, from `least` up to `most`. "force": of
    the force to which the tolerance applies; "beds": their mean number; "sure": share of runs that reach the tolerance.
    """
    truth = TRUTHS["spring-damper"]
    candidate = CANDIDATES["spring-damper"](FOUNDATION)
    assert candidate is not None
    found = dict.fromkeys((*truth, "force", "beds", "sure"), 0.0)
    for seed in range(first_seed, first_seed + count):
        design = dict.fromkeys(range(most), (0.1, 0.4))
        whole = synthetic_data("spring-damper", truth, design, seed=seed, bed_spread=bed_spread)
        for beds in range(min(least, most), most + 1):
            fitted = fit_law(candidate, whole.only(lambda run, beds=beds: int(run.bed) < beds))  # type: ignore[misc]
            if sure_enough(how_sure(fitted)[0], beds, tolerance, least=least):
                found["sure"] += 1
                break
        force = middle_force(fitted)
        real = truth["stiffness"] * 0.5 * float(fitted.data.depth.max()) + truth["damping"] * 0.4
        found["force"] += force.low <= real <= force.high
        found["beds"] += beds
        for name, value in truth.items():
            found[name] += fitted.parameter(name).low <= value <= fitted.parameter(name).high
    return {name: total / count for name, total in found.items()}


def _measure(path: Path, count: int = 400) -> None:
    """Coverage of every law and design, into a JSON file, written anew after each so that it can be stopped."""
    found: Json = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for design, own in DESIGNS.items():
        for law in TRUTHS:
            key, began = f"{law}: {design}", time.process_time()
            if key in found:
                continue
            found[key] = {"fits": count, "parameters": coverage(law, own, count=count)}
            write_json(path, found)
            print(key, {name: one["covered"] for name, one in found[key]["parameters"].items()}, flush=True)
            print(f"{time.process_time() - began:.0f} s", file=sys.stderr)
    for law in CROSSED_TRUTHS:
        key = f"{law}: two tips, two gravities, four beds"
        if key not in found:
            found[key] = {"fits": count, "parameters": crossed_coverage(law, count=count)}
            write_json(path, found)
            print(key, found[key]["parameters"], flush=True)
    for law in TRUTHS:
        for beds in (3, 5):
            key, runs = (
                f"beyond the runs, {law}: {beds} beds, three speeds",
                dict.fromkeys(range(beds), (0.1, 0.2, 0.4)),
            )
            if key not in found:
                found[key] = {"fits": count, "beyond": beyond_coverage(law, runs, count=count)}
                write_json(path, found)
                print(key, found[key]["beyond"], flush=True)
    for spread in SPREADS:
        for least in (LEAST_BEDS, 2):
            key = f"beds added until sure, spread {spread:g}" + (f", from {least} beds" if least != LEAST_BEDS else "")
            if key not in found:
                procedure = stopping_coverage(count=count, bed_spread=spread, least=least)
                found[key] = {"runs": count, "procedure": procedure}
                write_json(path, found)
                print(key, found[key]["procedure"], flush=True)


if __name__ == "__main__":
    _measure(Path(sys.argv[1]))
