"""K and C of a 12 mm spike in `jsc-1a-loose-cut` by the pushes of push.py: `python table.py`, with PYTHONPATH.

Reads pushes.csv (mean force in each 0.1 mm of depth). Writes fits.csv (a line for each place and depth) and
numbers.json, and prints the tables of README.md.

K [N/m] of a place: least squares of F = K z for its slowest push. If there is only the fast one, its K times the mean
ratio of both. C [N s/m]: mean force of the fast push less that of the slow one, over the difference of their speeds.
`experiments.converge` extrapolates the places to the real grain, as it does the beds of `sand`.

The line does not determine K. So the range goes from K of the finest grains, divided by what grains of this size add in
`sand`, to K of the finest grains; K is its middle in the logarithm. C is taken in proportion.
"""

import csv
import json
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

import numpy as np

from experiments.converge.statistics import Extrapolation, Interval, Size, apart, extrapolate, interval_of

HERE = Path(__file__).parent
TIP = 0.012  # Diameter of the tip [m]
LIFE = 1e-4  # Median diameter of JSC-1A's grains, about 0.1 mm [m]
SAND = 2e-4  # The grains to which `converge` extrapolates K of `sand` [m]
DEPTHS = (3e-3, 5e-3)  # Down to which K and C are fitted [m]
EARTH = 9.80665
SLOW = 0.1  # Pushes below this speed are slow [m/s]


@dataclass(frozen=True, order=True)
class Place:
    """Where a spike was pushed."""

    gravity: float  # [m/s2]
    grain: float  # Mean diameter [m]
    bed: str  # Its size [mm]
    seed: int
    place: int  # 0: its centre


@dataclass(frozen=True)
class Fit:
    """K and C of a place."""

    stiffness: float  # [N/m]
    damping: float | None  # [N s/m]; None where it was pushed at one speed


Pushes = dict[Place, dict[float, np.ndarray]]
"""Place -> speed [m/s] -> rows of depth [m] and force [N]."""


def read_pushes() -> Pushes:
    """All of pushes.csv."""
    rows: dict[Place, dict[float, list[tuple[float, float]]]] = defaultdict(lambda: defaultdict(list))
    with (HERE / "pushes.csv").open() as file:
        for row in csv.DictReader(file):
            place = Place(
                float(row["gravity_m_s2"]), 1e-3 * float(row["grain_mm"]), row["bed_mm"], int(row["seed"]),
                int(row["place"]),
            )  # fmt: skip
            rows[place][float(row["speed_m_s"])].append((1e-3 * float(row["depth_mm"]), float(row["force_N"])))
    return {place: {speed: np.array(own) for speed, own in found.items()} for place, found in sorted(rows.items())}


def spring(rows: np.ndarray, depth: float) -> float:
    """K of one push: least squares of F = K z down to `depth` [N/m]."""
    z, force = rows[rows[:, 0] <= depth].T
    return float(z @ force / (z @ z))


def fit_places(pushes: Pushes, depth: float) -> dict[Place, Fit]:
    """K and C of every place."""
    several = {place: own for place, own in pushes.items() if len(own) > 1}
    ratio = fmean(spring(own[min(own)], depth) / spring(own[max(own)], depth) for own in several.values())
    fits = {}
    for place, own in pushes.items():
        slow, fast = min(own), max(own)
        if place in several:
            forces = [own[speed][own[speed][:, 0] <= depth, 1].mean() for speed in (slow, fast)]
            fits[place] = Fit(spring(own[slow], depth), float((forces[1] - forces[0]) / (fast - slow)))
        else:
            fits[place] = Fit(spring(own[slow], depth) * (ratio if slow > SLOW else 1.0), None)
    return fits


def sizes_of(fits: dict[Place, Fit], gravity: float, per: str) -> list[Size]:
    """The values of K of each grain size: of its places, or of its beds."""
    values: dict[float, dict[tuple[str, int, int], list[float]]] = defaultdict(lambda: defaultdict(list))
    for place, fit in fits.items():
        if place.gravity == gravity:
            unit = (place.bed, place.seed, place.place if per == "place" else 0)
            values[place.grain][unit].append(fit.stiffness)
    return [Size(grain / TIP, tuple(fmean(own) for own in found.values())) for grain, found in sorted(values.items())]


def told(interval: Interval | None) -> str:
    """An interval as the tables show it."""
    if interval is None:
        return "-"
    half = "" if interval.half is None else f" ± {interval.half:.3g}"
    return f"{interval.mean:.3g}{half} ({interval.count})"


def line_of(sizes: Sequence[Size]) -> Extrapolation | None:
    """The line in d / D to the real grain."""
    return extrapolate(sizes, LIFE / TIP)


def named(finest: Size, damping: float) -> dict[str, float]:
    """The range of K of a spike, its middle and the factor to its ends, and C in proportion (see the module).

    `finest`: K of the places of the finest grains; `damping`: the mean C [N s/m].
    """
    sand = json.loads((HERE.parent / "converge-flagship/result.json").read_text())["convergence"]["stiffness"]
    added = 1 + sand["slope"] * (finest.x - SAND / TIP) / sand["value"]
    highest = fmean(finest.values)
    middle = highest / math.sqrt(added)
    return {
        "highest": highest, "lowest": highest / added, "stiffness": middle, "within": math.sqrt(added),
        "damping": damping * middle / highest,
    }  # fmt: skip


def in_low_gravity(fits: dict[Place, Fit], pushes: Pushes, depth: float) -> Interval | None:
    """K in low gravity over that at 1 g at one speed: the interval of the ratio, over places that have both."""
    ratios = []
    for place, own in pushes.items():
        earth = Place(EARTH, place.grain, place.bed, place.seed, place.place)
        if place.gravity < 1 and earth in pushes:
            speed = max(own)
            ratios.append(spring(own[speed], depth) / spring(pushes[earth][speed], depth))
    return interval_of(ratios)


def main() -> None:
    """Fit, extrapolate, write and print."""
    pushes, lines, numbers = read_pushes(), [], {}
    for depth in DEPTHS:
        fits = fit_places(pushes, depth)
        print(f"\n0 to {1e3 * depth:g} mm")
        for place, fit in fits.items():
            lines.append(
                {"depth_mm": 1e3 * depth, "gravity_m_s2": place.gravity, "grain_mm": round(1e3 * place.grain, 3),
                 "bed_mm": place.bed, "seed": place.seed, "place": place.place, "K_N_m": f"{fit.stiffness:.6g}",
                 "C_Ns_m": "" if fit.damping is None else f"{fit.damping:.6g}"}
            )  # fmt: skip
        for per in ("place", "bed"):
            sizes = sizes_of(fits, EARTH, per)
            for size in sizes:
                print(f"K, D/d = {1 / size.x:.3g}, over {per}s:", told(interval_of(size.values)))
            if per == "bed":
                print("values:", [[round(value) for value in size.values] for size in sizes])
            line = line_of(sizes)
            if line is not None:
                print(
                    f"at {1e3 * LIFE:g} mm:", line.value, line.chance, line.grain, line.without_coarsest, line.squared
                )
                numbers[f"K, 0 to {1e3 * depth:g} mm, over {per}s"] = {
                    "unit": "N/m", "value": line.value, "chance": line.chance, "grain_size": line.grain,
                }  # fmt: skip
        dampings = [fit.damping for place, fit in fits.items() if fit.damping is not None and place.gravity == EARTH]
        interval = interval_of(dampings)
        print("C over places:", told(interval))
        print("low gravity over 1 g:", told(in_low_gravity(fits, pushes, depth)))
        for grain in sorted({place.grain for place in fits}):
            boxes = defaultdict(list)
            for place, fit in fits.items():
                if place.grain == grain and place.gravity == EARTH:
                    boxes[place.bed].append(fit.stiffness)
            if len(boxes) > 1:
                (name, one), (other, two) = sorted(boxes.items())
                print(
                    f"{1e3 * grain:g} mm: K in {other} less K in {name}:", told(apart(one, two)), fmean(one), fmean(two)
                )
        if interval is not None:
            of_spike = named(sizes_of(fits, EARTH, "place")[0], interval.mean)
            print("of a spike:", {key: round(value, 2) for key, value in of_spike.items()})
            numbers[f"of a spike, 0 to {1e3 * depth:g} mm"] = of_spike
            numbers[f"C, 0 to {1e3 * depth:g} mm"] = {"unit": "N s/m", "value": interval.mean, "chance": interval.half}
    with (HERE / "fits.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, lines[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
    (HERE / "numbers.json").write_text(json.dumps(numbers, indent=1) + "\n")


if __name__ == "__main__":
    main()
