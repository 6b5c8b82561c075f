"""What the member runs come to: each quantity at the real grain, with three errors, and what decides them.

value      at the real grain, by the line in d / D (`statistics`)
chance     of its interval over beds
grain      what that line may be wrong by
rest width, depth, overlap, speed: each by the paired difference between the base and the widest, the deepest, the
           stiffest and the slowest. The end of its interval that is farther from 0 counts; together the root of their
           squares. A share of the base's mean, taken of the value, but for C, which may be 0. What was not measured is
           not in it, and named.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import fmean

import numpy as np

from experiments.penetrate.fit import Moments
from experiments.runs.types import Json

from .design import BASE, Variant
from .statistics import Extrapolation, Interval, Size, apart, extrapolate, interval_of, paired

__all__ = ["QUANTITIES", "REST", "Finding", "findings_of", "numbers_of", "two_finest"]

REST = ("width", "depth", "overlap", "speed")
BANDS = 4
"""Bands of depth in which `penetrate` states the mean force."""
WANTED = 0.05
"""By how much the two finest grains may differ to agree [1]."""

Values = Mapping[str, Mapping[int, Mapping[str, float | None]]]
"""What was measured: variant id -> seed -> name of the quantity -> value."""


@dataclass(frozen=True)
class Quantity:
    """What is measured on a bed."""

    unit: str
    words: str
    scales: bool = True
    """It is above 0, and what changes the bed is taken to change it by a share."""


QUANTITIES = {
    "stiffness": Quantity("N/m", "stiffness K, fitted"),
    "damping": Quantity("N s/m", "damping C, fitted", scales=False),
    "sinkage": Quantity("m", "sinkage at rest"),
    "work": Quantity("J", "work to the deepest point, slowest drive"),
    **{f"force_{band}": Quantity("N", "") for band in range(1, BANDS + 1)},
    "drop_depth": Quantity("m", "deepest point of the fastest drop"),
    "packing_fraction": Quantity("1", "packing fraction of the bed"),
}
"""Name -> unit and words. `force_1` to `force_4` are mean forces of the slowest drive in quarters of its depth; K and C
are those of the least squares of `penetrate` without its bounds at 0, which would make an interval of C miss 0."""


def numbers_of(result: Mapping[str, Json]) -> dict[str, float | None]:
    """The quantities of one member, whose result.json `result` is; None for what it does not have."""
    told = result["quantities"]
    runs: Sequence[Json] = result["runs"]  # type: ignore[assignment]
    stiffness, damping = _free_fit([Moments(**run["moments"]) for run in runs if "moments" in run])
    driven = sorted((run for run in runs if run["kind"] == "driven"), key=lambda run: run["speed"])
    drops = sorted((run for run in runs if run["kind"] == "drop"), key=lambda run: run["speed"])
    slow = [row for row in result["departures"]["table"] if row["speed"] == driven[0]["speed"]]
    found: dict[str, float | None] = {
        "stiffness": stiffness,
        "damping": damping,
        "sinkage": told["sinkage_dem"]["value"],
        "work": driven[0]["quantities"]["work_in"]["value"],
        "drop_depth": drops[-1]["quantities"]["max_depth"]["value"] if drops else None,
    }
    found |= {f"force_{band}": row["bed_force"] for band, row in enumerate(slow, 1)}
    beside = ("packing_fraction", "grain_count", "time_step", "max_overlap")
    return found | {name: (told.get(name) or {}).get("value") for name in beside}


def _free_fit(runs: Sequence[Moments]) -> tuple[float | None, float | None]:
    """K [N/m] and C [N s/m] by least squares, every run of equal weight, without bounds; None where they are one."""
    matrix = sum((run.matrix for run in runs), np.zeros((2, 2)))
    right = sum((run.right for run in runs), np.zeros(2))
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(size, size)
    if not np.linalg.cond(scaled) < 1e6:
        return None, None
    stiffness, damping = np.linalg.solve(scaled, right / size) / size
    return float(stiffness), float(damping)


@dataclass(frozen=True)
class Difference:
    """What a variant changes: its values less those of the base, bed by bed."""

    variant: Variant
    interval: Interval
    values: Mapping[int, float]

    @property
    def reach(self) -> float | None:
        """The end of its interval that is farther from 0; None for one bed, which has no scatter."""
        return None if self.interval.half is None else abs(self.interval.mean) + self.interval.half


def _right(one: Difference) -> float:
    """The farther towards what is right, the larger: wide, deep, stiff, slow."""
    return one.variant.value if one.variant.what in ("width", "depth") else -one.variant.value


@dataclass(frozen=True)
class Finding:
    """One quantity and its errors."""

    name: str
    sizes: tuple[Size, ...]
    at_life: Extrapolation
    differences: tuple[Difference, ...]
    base: float | None
    """Mean over the beds of the base; None without one."""

    @property
    def farthest(self) -> dict[str, Difference]:
        """Of width, depth, overlap and speed the variant that is widest, deepest, stiffest, slowest; with two beds at
        least, where there is one."""
        by_axis = {what: [one for one in self.differences if one.variant.what == what] for what in REST}
        return {
            what: max([one for one in own if one.reach is not None] or own, key=_right)
            for what, own in by_axis.items()
            if own
        }

    @property
    def unknown(self) -> list[str]:
        """Which errors were not measured."""
        missing = [what for what in REST if (one := self.farthest.get(what)) is None or one.reach is None]
        chance = ["chance"] if self.at_life.chance is None else []
        return [*chance, *(["grain size"] if self.at_life.grain is None else []), *missing]

    @property
    def rest(self) -> float | None:
        """Root of the squares of what is known of width, depth, overlap and speed; None where nothing is."""
        reached = [one.reach for one in self.farthest.values() if one.reach is not None]
        if not reached:
            return None
        share = abs(self.at_life.value / self.base) if QUANTITIES[self.name].scales and self.base else 1.0
        return share * math.hypot(*reached)

    @property
    def total(self) -> float | None:
        """All errors that are known, added: a line that is wrong is wrong on all beds. None without chance or size."""
        chance, grain = self.at_life.chance, self.at_life.grain
        return None if chance is None or grain is None else chance + grain + (self.rest or 0.0)


def findings_of(variants: Sequence[Variant], values: Values, *, life: float, tip: float) -> dict[str, Finding]:
    """All quantities that any bed has. `life`: real grain [m], `tip`: diameter [m]."""
    found = {}
    for name in QUANTITIES:
        own = {
            variant.id: {seed: float(value) for seed, bed in values.get(variant.id, {}).items()
                         if (value := bed.get(name)) is not None}
            for variant in variants
        }  # fmt: skip
        graded = [variant for variant in variants if variant.what in (BASE, "grain") and own[variant.id]]
        sizes = tuple(
            Size(variant.settings.grain / tip, tuple(own[variant.id].values()))
            for variant in sorted(graded, key=lambda variant: variant.settings.grain)
        )
        line = extrapolate(sizes, life / tip)
        if line is None:
            continue
        differences = []
        for variant in variants:
            if variant.what in REST and (between := paired(own[BASE], own[variant.id])) is not None:
                shared = {
                    seed: own[variant.id][seed] - own[BASE][seed] for seed in own[BASE] if seed in own[variant.id]
                }
                differences.append(Difference(variant, between, shared))
        base = fmean(own[BASE].values()) if own[BASE] else None
        found[name] = Finding(name, sizes, line, tuple(differences), base)
    return found


def two_finest(finding: Finding) -> Json | None:
    """Do the two finest grains agree within 5 %? None below two sizes.

    "difference" is that of the coarser from the finer over the finer's mean [1], "half" its interval's;
    "verdict": yes where all of the interval is within, no where none of it is, else open.
    """
    if len(finding.sizes) < 2:
        return None
    fine, next_one = finding.sizes[:2]
    mean, between = abs(float(np.mean(fine.values))), apart(fine.values, next_one.values)
    if mean == 0:
        return None
    share, half = between.mean / mean, None if between.half is None else between.half / mean
    verdict = "open"
    if half is not None:
        verdict = "yes" if abs(share) + half <= WANTED else "no" if abs(share) - half > WANTED else "open"
    return {"ratios": [1 / fine.x, 1 / next_one.x], "difference": share, "half": half, "verdict": verdict}


def told(finding: Finding) -> Json:
    """The finding as result.json has it."""
    line = asdict(finding.at_life)
    return {
        "unit": QUANTITIES[finding.name].unit,
        **{key: line[key] for key in ("value", "chance", "grain", "slope", "without_coarsest", "squared", "misfit")},
        "rest": finding.rest,
        "total": finding.total,
        "unknown": finding.unknown,
        "line": line["line"],
        "sizes": [_size(size) for size in finding.sizes],
        "differences": [
            {"what": one.variant.what, "value": one.variant.value, "mean": one.interval.mean, "half": one.interval.half,
             "values": {str(seed): value for seed, value in one.values.items()}}
            for one in finding.differences
        ],
        "two_finest": two_finest(finding),
    }  # fmt: skip


def _size(size: Size) -> Json:
    interval = interval_of(size.values)
    assert interval is not None
    return {"x": size.x, "ratio": 1 / size.x, "values": size.values, "mean": interval.mean, "half": interval.half}
