"""K and C of a ball tip in `jsc-1a-loose-cut` by the pushes of push.py: `python table.py`, with PYTHONPATH.

Reads pushes.csv (mean force in each 1/120 of the tip's diameter). Writes fits.csv (a line for each place and depth) and
numbers.json, and prints the tables of README.md. Depths are given for a tip of 12 mm; other tips go as many diameters.

K [N/m] of a place: least squares of F = K z for its slowest push. If there is only the fast one, its K times the mean
ratio of both at this gravity. C [N s/m]: mean force of the fast push less that of the slow one, over the difference of
their speeds. `experiments.converge` extrapolates the places to the real grain, as it does the beds of `sand`.

No line determines K of real grains. So the range goes from the lowest positive one of three extrapolations to
K of the finest grains, and K is its middle in the logarithm. C is that of the finest grains, in proportion.

The map. K = exp(a + b d / D) [(1 - s) (g / g0) (D / D0)^2 + s D / D0], D0 = 12 mm, g0 = 1 g: the weight of grains acts
as in sand, and cohesion, a stress, acts on an area. a, b, s: least squares in ln K of the mean of each case (a bed, a
tip and a gravity). Its error: what it misses by when it is fitted without the case, and without all cases of the bed.
"""

import csv
import json
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean

import numpy as np
from scipy.optimize import least_squares

from experiments.converge.statistics import Extrapolation, Interval, Size, apart, extrapolate, interval_of

HERE = Path(__file__).parent
TIP = 0.012  # Diameter of the tip of the surface [m]
LIFE = 1e-4  # Median diameter of JSC-1A's grains, about 0.1 mm [m]
SAND = 2e-4  # The grains to which `converge` extrapolates K of `sand` [m]
DEPTHS = (3e-3, 5e-3)  # Down to which K and C are fitted, for a tip of 12 mm [m]
EARTH = 9.80665
PACKING = 0.563  # Of the beds at 1 g [1]
SLOW = 0.1  # Pushes below this speed are slow [m/s]
SLOWEST = 0.02  # Pushes below this speed only show whether slow ones are slow enough [m/s]


@dataclass(frozen=True, order=True)
class Place:
    """Where a tip was pushed."""

    gravity: float  # [m/s2]
    grain: float  # Mean diameter [m]
    bed: str  # Its size [mm]
    seed: int
    place: int  # 0: its centre
    tip: float  # Diameter [m]


@dataclass(frozen=True)
class Fit:
    """K and C of a place."""

    stiffness: float  # [N/m]
    damping: float | None  # [N s/m]; None where it was pushed at one speed


Pushes = dict[Place, dict[float, np.ndarray]]
"""Place -> speed [m/s] -> rows of depth [m] and force [N]."""
Case = tuple[float, float, float]
"""d / D, gravity [m/s2] and diameter of the tip [m]."""


def read_pushes() -> Pushes:
    """All of pushes.csv."""
    rows: dict[Place, dict[float, list[tuple[float, float]]]] = defaultdict(lambda: defaultdict(list))
    with (HERE / "pushes.csv").open() as file:
        for row in csv.DictReader(file):
            place = Place(
                float(row["gravity_m_s2"]), 1e-3 * float(row["grain_mm"]), row["bed_mm"], int(row["seed"]),
                int(row["place"]), 1e-3 * float(row["tip_mm"]),
            )  # fmt: skip
            rows[place][float(row["speed_m_s"])].append((1e-3 * float(row["depth_mm"]), float(row["force_N"])))
    return {place: {speed: np.array(own) for speed, own in found.items()} for place, found in sorted(rows.items())}


def spring(rows: np.ndarray, depth: float) -> float:
    """K of one push: least squares of F = K z down to `depth` [N/m]."""
    z, force = rows[rows[:, 0] <= depth].T
    return float(z @ force / (z @ z))


def without_slowest(pushes: Pushes) -> Pushes:
    """The pushes that are fitted."""
    return {place: {speed: rows for speed, rows in own.items() if speed > SLOWEST} for place, own in pushes.items()}


def print_slowest(pushes: Pushes, depth: float) -> None:
    """K of the slowest pushes over that of the next slow one at their place."""
    for place, own in pushes.items():
        first, *others = sorted(own)
        if first < SLOWEST and others:
            to = depth * place.tip / TIP
            ratio = spring(own[first], to) / spring(own[others[0]], to)
            print(f"K at {1e3 * first:g} over {1e3 * others[0]:g} mm/s, {place}: {ratio:.3g}")


def fit_places(pushes: Pushes, depth: float) -> dict[Place, Fit]:
    """K and C of every place; a fast push alone counts only where this gravity has places with both speeds."""
    ratios: dict[float, list[float]] = defaultdict(list)
    for place, own in pushes.items():
        if min(own) < SLOW < max(own):
            to = depth * place.tip / TIP
            ratios[place.gravity].append(spring(own[min(own)], to) / spring(own[max(own)], to))
    fits = {}
    for place, own in pushes.items():
        slow, fast, to = min(own), max(own), depth * place.tip / TIP
        if slow < SLOW < fast:
            forces = [own[speed][own[speed][:, 0] <= to, 1].mean() for speed in (slow, fast)]
            fits[place] = Fit(spring(own[slow], to), float((forces[1] - forces[0]) / (fast - slow)))
        elif slow < SLOW:
            fits[place] = Fit(spring(own[slow], to), None)
        elif place.gravity in ratios:
            fits[place] = Fit(spring(own[slow], to) * fmean(ratios[place.gravity]), None)
    return fits


def sizes_of(fits: dict[Place, Fit], per: str) -> list[Size]:
    """The values of K of each grain size under a tip of 12 mm at 1 g: of its places, or of its beds."""
    values: dict[float, dict[tuple[str, int, int], list[float]]] = defaultdict(lambda: defaultdict(list))
    for place, fit in fits.items():
        if place.gravity == EARTH and place.tip == TIP:
            unit = (place.bed, place.seed, place.place if per == "place" else 0)
            values[place.grain][unit].append(fit.stiffness)
    return [Size(grain / TIP, tuple(fmean(own) for own in found.values())) for grain, found in sorted(values.items())]


def told(interval: Interval | None) -> str:
    """An interval as the tables show it."""
    if interval is None:
        return "-"
    half = "" if interval.half is None else f" ± {interval.half:.3g}"
    return f"{interval.mean:.3g}{half} ({interval.count})"


def named(sizes: Sequence[Size], line: Extrapolation, damping: Interval, off: float) -> dict[str, float]:
    """The range of K of a spike, its middle and the factor to its ends, and C in proportion (see the module).

    `sizes`: K of the places of each grain size; `line`: that through them; `damping`: C of the finest [N s/m]; `off`:
    standard deviation of the mean of C over all beds, over this mean.
    """
    sand = json.loads((HERE.parent / "converge-flagship/result.json").read_text())["convergence"]["stiffness"]
    finest, highest = sizes[0], fmean(sizes[0].values)
    x, logs = np.array([size.x for size in sizes]), np.log([fmean(size.values) for size in sizes])
    slope, first = np.polyfit(x, logs, 1, w=np.sqrt([len(size.values) for size in sizes]) / x)
    others = {
        "as_sand": highest / (1 + sand["slope"] * (finest.x - SAND / TIP) / sand["value"]),
        "squared": float(line.squared or math.nan),
        "exponential": float(math.exp(first + slope * LIFE / TIP)),
    }
    lowest = min(value for value in others.values() if value > 0)
    middle = math.sqrt(lowest * highest)
    return {
        "highest": highest, "lowest": lowest, **others, "stiffness": middle, "within": math.sqrt(highest / lowest),
        "damping": damping.mean * middle / highest,
        "damping_std": damping.mean * middle / highest * math.hypot(off, 0.5 * math.log(highest / lowest)),
    }  # fmt: skip


def over(fits: dict[Place, float], change: Callable[[Place], Place], which: Iterable[Place]) -> Interval | None:
    """K of each place over that of the place which `change` makes of it: the interval of the ratio."""
    return interval_of([fits[place] / fits[change(place)] for place in which if change(place) in fits])


def speeds_of(pushes: Pushes, depth: float, slow: bool) -> dict[Place, float]:
    """K of the places at one of the two speeds."""
    return {
        place: spring(rows, depth * place.tip / TIP)
        for place, own in pushes.items() for speed, rows in own.items()
        if (speed < SLOW) == slow
    }  # fmt: skip


def cases_of(fits: dict[Place, Fit]) -> dict[tuple[str, int], dict[Case, float]]:
    """Bed (its grains and size, its seed) -> case -> mean K over places."""
    values: dict[tuple[str, int], dict[Case, list[float]]] = defaultdict(lambda: defaultdict(list))
    for place, fit in fits.items():
        bed = (f"{1e3 * place.grain:g}mm {place.bed}", place.seed)
        values[bed][place.grain / place.tip, place.gravity, place.tip].append(fit.stiffness)
    return {bed: {case: fmean(own) for case, own in found.items()} for bed, found in values.items()}


def of_law(law: Sequence[float], case: Case) -> float:
    """ln K by the map: a, b and s for d / D, gravity and tip."""
    (a, b, share), (x, gravity, tip) = law, case
    return a + b * x + math.log((1 - share) * gravity / EARTH * (tip / TIP) ** 2 + share * tip / TIP)


def law_of(cases: Iterable[tuple[Case, float]]) -> list[float]:
    """a, b and s by least squares in ln K."""
    known = list(cases)
    found = least_squares(
        lambda law: [of_law(law, case) - math.log(value) for case, value in known], [6.0, 4.0, 0.3],
        bounds=([0, -20, 1e-4], [12, 20, 0.999]),
    )  # fmt: skip
    return [float(number) for number in found.x]


def map_of(fits: dict[Place, Fit]) -> dict[str, float]:
    """The map, and by which factor it misses cases and beds that it was not fitted to (root mean square)."""
    beds = cases_of(fits)
    everything = [(case, value, bed) for bed, found in beds.items() for case, value in found.items()]
    a, b, share = law_of((case, value) for case, value, _ in everything)
    misses: dict[str, list[float]] = {"case": [], "bed": []}
    for case, value, bed in everything:
        alone = law_of((other, own) for other, own, of in everything if (other, of) != (case, bed))
        apart_from = law_of((other, own) for other, own, of in everything if of != bed)
        misses["case"].append(math.log(value) - of_law(alone, case))
        misses["bed"].append(math.log(value) - of_law(apart_from, case))
        print(
            f"{bed} d/D {case[0]:.3g} tip {1e3 * case[2]:g} mm {case[1] / EARTH:.3g} g: K {value:.0f},",
            f"map {math.exp(of_law([a, b, share], case)):.0f}, without the case {math.exp(of_law(alone, case)):.0f},",
            f"without the bed {math.exp(of_law(apart_from, case)):.0f}",
        )
    off = {f"off_{key}": math.exp(math.sqrt(fmean(own**2 for own in found))) for key, found in misses.items()}
    return {
        "a": a, "b": b, "share": share, "cases": len(everything), "beds": len(beds), **off,
        "worst_case": math.exp(max(map(abs, misses["case"]))), "worst_bed": math.exp(max(map(abs, misses["bed"]))),
        "finest": min(case[0] for case, *_ in everything), "coarsest": max(case[0] for case, *_ in everything),
        "heaviest": max(case[1] * case[2] for case, *_ in everything),
    }  # fmt: skip


def shape_of(pushes: Pushes) -> float:
    """Root mean square of ln(F / K z) over depths from 1 mm (of 12) down, slow pushes: the error of one K for all."""
    found = []
    for place, own in pushes.items():
        if min(own) < SLOW:
            to, rows = DEPTHS[-1] * place.tip / TIP, own[min(own)]
            z, force = rows[(rows[:, 0] <= to) & (rows[:, 0] > 0.2 * to) & (rows[:, 1] > 0)].T
            found += list(np.log(force / (spring(rows, to) * z)) ** 2)
    return math.sqrt(fmean(found))


def print_gravities(pushes: Pushes, depth: float) -> dict[str, Interval | None]:
    """K in low gravity over that at 1 g, and of other tips over 12 mm, at the same places and speed."""
    found = {}
    for slow, word in ((True, "31"), (False, "313")):
        values = speeds_of(pushes, depth, slow)
        for gravity in sorted({place.gravity for place in values} - {EARTH}):
            ratio = over(
                values, lambda place: replace(place, gravity=EARTH), [own for own in values if own.gravity == gravity]
            )
            found[f"K at {gravity / EARTH:.2g} g over 1 g, {word} mm/s"] = ratio
        for tip in sorted({place.tip for place in values} - {TIP}):
            for gravity in sorted({place.gravity for place in values if place.tip == tip}):
                those = [own for own in values if own.tip == tip and own.gravity == gravity]
                ratio = over(values, lambda place: replace(place, tip=TIP), those)
                found[f"K of {1e3 * tip:g} mm over 12 mm at {gravity / EARTH:.2g} g, {word} mm/s"] = ratio
    for key, ratio in found.items():
        print(f"{key}:", told(ratio))
    return found


def print_sizes(fits: dict[Place, Fit]) -> dict[str, Extrapolation]:
    """K of each grain size over places and beds at 1 g, and the lines through them."""
    lines = {}
    for per in ("place", "bed"):
        sizes = sizes_of(fits, per)
        for size in sizes:
            print(f"K, D/d = {1 / size.x:.3g}, over {per}s:", told(interval_of(size.values)))
        line = extrapolate(sizes, LIFE / TIP)
        assert line is not None
        print(f"at {1e3 * LIFE:g} mm:", line.value, line.chance, line.grain, line.without_coarsest, line.squared)
        lines[per] = line
    for grain in sorted({place.grain for place in fits}):
        boxes = defaultdict(list)
        for place, fit in fits.items():
            if place.grain == grain and place.gravity == EARTH and place.tip == TIP:
                boxes[place.bed].append(fit.stiffness)
        if len(boxes) > 1:
            (name, one), (other, two) = sorted(boxes.items())
            print(f"{1e3 * grain:g} mm: K in {other} less K in {name}:", told(apart(one, two)), fmean(one), fmean(two))
    return lines


def print_dampings(fits: dict[Place, Fit]) -> tuple[Interval, float]:
    """C of each grain size and gravity over places, 12 mm; returns that of the finest grains at 1 g [N s/m].

    And the standard deviation of the mean over all beds at 1 g, over this mean.
    """
    dampings: dict[tuple[float, float], list[float]] = defaultdict(list)
    beds: dict[tuple[float, str, int], list[float]] = defaultdict(list)
    for place, fit in fits.items():
        if fit.damping is not None and place.tip == TIP:
            dampings[place.gravity, place.grain].append(fit.damping)
            if place.gravity == EARTH:
                beds[place.grain, place.bed, place.seed].append(fit.damping)
    for (gravity, grain), found in sorted(dampings.items()):
        print(f"C at {gravity / EARTH:.2g} g, D/d = {TIP / grain:.3g}, over places:", told(interval_of(found)))
    over_beds = interval_of([fmean(own) for own in beds.values()])
    print("C at 1 g over beds:", told(over_beds))
    finest = interval_of(dampings[min(key for key in dampings if key[0] == EARTH)])
    assert finest is not None and over_beds is not None and over_beds.half is not None
    return finest, over_beds.half / 1.96 / over_beds.mean


def main() -> None:
    """Fit, extrapolate, write and print."""
    everything = read_pushes()
    pushes = without_slowest(everything)
    lines, numbers = [], {}
    for depth in DEPTHS:
        fits, words = fit_places(pushes, depth), f"0 to {1e3 * depth:g} mm"
        print(f"\n{words}")
        for place, fit in fits.items():
            lines.append(
                {"depth_mm": f"{1e3 * depth * place.tip / TIP:g}", "gravity_m_s2": place.gravity,
                 "grain_mm": round(1e3 * place.grain, 3), "bed_mm": place.bed, "seed": place.seed,
                 "place": place.place, "tip_mm": f"{1e3 * place.tip:g}", "K_N_m": f"{fit.stiffness:.6g}",
                 "C_Ns_m": "" if fit.damping is None else f"{fit.damping:.6g}"}
            )  # fmt: skip
        found = print_sizes(fits)
        for per, line in found.items():
            numbers[f"K, {words}, over {per}s"] = {
                "unit": "N/m", "value": line.value, "chance": line.chance, "grain_size": line.grain,
            }  # fmt: skip
        of_spike = named(sizes_of(fits, "place"), found["place"], *print_dampings(fits))
        print("of a spike:", {key: round(value, 2) for key, value in of_spike.items()})
        numbers[f"of a spike, {words}"] = of_spike
        for key, ratio in print_gravities(pushes, depth).items():
            if ratio is not None:
                numbers[f"{key}, {words}"] = {"value": ratio.mean, "chance": ratio.half, "count": ratio.count}
        print_slowest(everything, depth)
        fastest = max(max(own) for own in pushes.values())
        numbers[f"map, {words}"] = map_of(fits) | {"fastest": fastest, "packing": PACKING}
        print("map:", {key: round(value, 3) for key, value in numbers[f"map, {words}"].items()})
    numbers["shape"] = shape_of(pushes)
    print("F over K z, root mean square of the logarithm:", numbers["shape"])
    with (HERE / "fits.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, lines[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
    (HERE / "numbers.json").write_text(json.dumps(numbers, indent=1) + "\n")


if __name__ == "__main__":
    main()
