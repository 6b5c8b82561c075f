"""`hedgebed bed test cone`: a cone goes down at constant speed; cone index and its gradient
(`dem.measure.penetrometer`)."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from dem.measure.penetrometer import SHAFT, check_cone, cone_gradient, push_cone
from experiments.runs.types import Json

from .settings import say
from .test_settings import BedConeSettings
from .tests import Tested, bed_test, check_bed, of_beds, picked, quantity, table

__all__ = ["check", "place_of", "resume", "run"]

_COARSE, _NARROW = 5.0, 5.0
"""A cone of fewer grains, a bed of fewer cones across: said in a warning."""


def check(settings: BedConeSettings) -> None:
    """Raise ValueError for a bed that is none or not level, and a cone that cannot go into it."""
    bed = check_bed(settings)
    check_cone(
        size=bed.size, surface=bed.surface, grain=bed.grain, diameter=settings.diameter, angle=settings.angle,
        depth=settings.depth, shaft=settings.shaft,
    )  # fmt: skip


def place_of(push: int, size: tuple[float, ...]) -> tuple[float, float]:
    """Where the push goes in, x and y [m]: the middle, then places far from those before, evenly spread."""
    return (0.5 + push * 0.7548776662) % 1 * size[0], (0.5 + push * 0.5698402910) % 1 * size[1]


def _test(settings: BedConeSettings, bed: Any, about: Json, push: int, tell: Callable[[float], None]) -> Tested:
    found = push_cone(
        bed, diameter=settings.diameter, angle=settings.angle, depth=settings.depth, speed=settings.speed,
        shaft=settings.shaft, friction=settings.friction, place=place_of(push, bed.size), tell=tell,
    )  # fmt: skip
    gradient, start = cone_gradient(found)
    across, wide = found.diameter / about["grain"], min(bed.size[:2]) / found.diameter
    warnings = {
        f"the cone is {across:.2g} grains across: single grains show in its force": across < _COARSE,
        say("cone_narrow", cones=wide): wide < _NARROW,
    }
    count = max(1, len(found.index) // 20)
    padded = np.pad(found.index, (count // 2, count - 1 - count // 2), "edge")
    smooth = np.convolve(padded, np.ones(count) / count, "valid")  # mean over a twentieth of the samples
    numbers = {
        "gradient": gradient,
        "start": start,
        "index_at_end": float(found.index[found.depth >= 0.9 * found.depth[-1]].mean()),
        "index_at_half": float(np.interp(0.5 * float(found.base_depth[-1]), found.base_depth, smooth)),
        **picked(found, "diameter", "length", "angle"),
        "shaft": SHAFT * found.diameter if settings.shaft is None else settings.shaft,
        "speed": found.speed,
        "froude": found.speed / math.sqrt(about["gravity"] * found.diameter),
        "depth": float(found.depth[-1]),
        "place": list(found.place),
    }
    columns = {
        "depth_m": found.depth,
        "force_N": found.force,
        "index_Pa": found.index,
        "base_depth_m": found.base_depth,
    }
    return Tested(bed, columns, numbers, [text for text, holds in warnings.items() if holds])


def _result(_: BedConeSettings, runs: list[Json]) -> Json:
    of = partial(quantity, runs)
    one = runs[0]

    quantities = {
        "gradient": of("gradient", "Pa/m", "of the cone index with the depth of the cone's base, least squares"),
        "gradient_over_weight": of(
            lambda run: run["gradient"] / (run["packing_fraction"] * run["density"] * run["gravity"]),
            "1",
            "the same over the bed's unit weight",
        ),
        "index_at_end": of("index_at_end", "Pa", f"cone index, last tenth of the way to {1e3 * one['depth']:.3g} mm"),
        "index_at_half": of("index_at_half", "Pa", "cone index where the base is half as deep as at the end"),
        "index_at_surface": of("start", "Pa", "where the line begins, base at the surface"),
        "froude": of("froude", "1", "speed over sqrt(g D)"),
    } | of_beds(runs, "grains")
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
    return {"title": title, "quantities": quantities, "tables": [table("Push by push", runs, columns)]}


run, resume = bed_test(
    "bed test cone", BedConeSettings, check=check, test=_test, result=_result, copies=lambda settings: settings.pushes
)
