"""`hedgebed bed test cone`: a cone goes down at constant speed; cone index and its gradient
(`dem.measure.penetrometer`)."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.runs.whole_runs import whole_run

from .settings import say
from .test_settings import BedConeSettings
from .tests import about, carry_out, check_bed, picked, quantity, table, write_frame

__all__ = ["check", "place_of", "resume", "run"]

_COARSE, _NARROW = 5.0, 5.0
"""A cone of fewer grains, a bed of fewer cones across: said in a warning."""


def check(settings: BedConeSettings) -> None:
    """Raise ValueError for a bed that is none or not level, and a cone that cannot go into it."""
    from dem.measure.penetrometer import check_cone

    bed = check_bed(settings)
    check_cone(
        size=bed.size, surface=bed.surface, grain=bed.grain, diameter=settings.diameter, angle=settings.angle,
        depth=settings.depth, shaft=settings.shaft,
    )  # fmt: skip


def place_of(push: int, size: tuple[float, ...]) -> tuple[float, float]:
    """Where the push goes in, x and y [m]: the middle, then places far from those before, evenly spread."""
    return (0.5 + push * 0.7548776662) % 1 * size[0], (0.5 + push * 0.5698402910) % 1 * size[1]


def _carry_out(settings: BedConeSettings, folder: RunFolder, progress: Progress) -> Result:
    def test(bed: Any, name: str, tell: Callable[[float], None]) -> Json:
        from dem.measure.penetrometer import SHAFT, cone_gradient, push_cone

        first = about(bed)
        if settings.max_overlap is not None:
            bed.overlap_limit = settings.max_overlap
        push = int(name.rpartition("-")[2]) - 1 if settings.pushes > 1 else 0
        found = push_cone(
            bed, diameter=settings.diameter, angle=settings.angle, depth=settings.depth, speed=settings.speed,
            shaft=settings.shaft, friction=settings.friction, place=place_of(push, bed.size), tell=tell,
        )  # fmt: skip
        columns = {"depth_m": found.depth, "force_N": found.force, "index_Pa": found.index}
        series = folder.write_series(name, columns | {"base_depth_m": found.base_depth})
        write_frame(folder, name, bed)
        gradient, start = cone_gradient(found)
        grain, warnings = first["grain"], []
        if found.diameter < _COARSE * grain:
            warnings.append(f"the cone is {found.diameter / grain:.2g} grains across: single grains show in its force")
        if min(bed.size[:2]) < _NARROW * found.diameter:
            warnings.append(say("cone_narrow", cones=min(bed.size[:2]) / found.diameter))
        half = 0.5 * float(found.base_depth[-1])
        return first | {
            "gradient": gradient,
            "start": start,
            "index_at_end": float(found.index[found.depth >= 0.9 * found.depth[-1]].mean()),
            "index_at_half": float(np.interp(half, found.base_depth, _smooth(found.index))),
            **picked(found, "diameter", "length", "angle"),
            "shaft": SHAFT * found.diameter if settings.shaft is None else settings.shaft,
            "speed": found.speed,
            "froude": found.speed / math.sqrt(first["gravity"] * found.diameter),
            "depth": float(found.depth[-1]),
            "place": list(found.place),
            "max_overlap": found.max_overlap,
            "series": series,
            "frames": name,
            "warnings": warnings,
        }

    return carry_out(
        settings, folder, progress, test=test, result=_result, report="vis.bed.tests:write_test_report",
        copies=settings.pushes,
    )  # fmt: skip


def _smooth(values: np.ndarray) -> np.ndarray:
    """Mean over a twentieth of the samples."""
    count = max(1, len(values) // 20)
    return np.convolve(np.pad(values, (count // 2, count - 1 - count // 2), "edge"), np.ones(count) / count, "valid")


def _result(runs: list[Json]) -> Json:
    of = partial(quantity, runs)
    one = runs[0]

    def over_weight(run: Json) -> float:
        return run["gradient"] / (run["packing_fraction"] * run["density"] * run["gravity"])

    quantities = {
        "gradient": of("gradient", "Pa/m", "of the cone index with the depth of the cone's base, least squares"),
        "gradient_over_weight": of(over_weight, "1", "the same over the bed's unit weight"),
        "index_at_end": of("index_at_end", "Pa", f"cone index, last tenth of the way to {1e3 * one['depth']:.3g} mm"),
        "index_at_half": of("index_at_half", "Pa", "cone index where the base is half as deep as at the end"),
        "index_at_surface": of("start", "Pa", "where the line begins, base at the surface"),
        "froude": of("froude", "1", "speed over sqrt(g D)"),
        "packing_fraction": of("packing_fraction", "1", "of the bed before"),
        "grain_count": of("grain_count", "1", "grains"),
        "max_overlap": of("max_overlap", "1", "over diameter"),
    }
    columns = {
        "run": lambda run: run["id"],
        "gradient [MPa/m]": lambda run: f"{1e-6 * run['gradient']:.3g}",
        "index, half way [kPa]": lambda run: f"{1e-3 * run['index_at_half']:.3g}",
        "at the end [kPa]": lambda run: f"{1e-3 * run['index_at_end']:.3g}",
        "at surface [kPa]": lambda run: f"{1e-3 * run['start']:.2g}",
        "packing": lambda run: f"{run['packing_fraction']:.4f}",
        "overlap [%]": lambda run: f"{100 * run['max_overlap']:.2g}",
    }
    title = f"Cone of {1e3 * one['diameter']:.3g} mm and {one['angle']:g} degrees in {one['material']}"
    return {"title": title, "quantities": quantities, "tables": [table("Push by push", runs, columns)], "warnings": []}


run, resume = whole_run("bed test cone", BedConeSettings, _carry_out, check=check)
