"""`hedgebed bed test cut`: gravity rises until a vertical face falls; critical height and cohesion
(`dem.measure.cutting`)."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from dem.measure.cutting import LEAST, check_width, cohesion_of, cut_and_load
from experiments.runs.types import Json

from .test_settings import BedCutSettings
from .tests import Tested, bed_test, check_bed, of_beds, picked, quantity, table

__all__ = ["check", "resume", "run"]

_ANGLES = (25.0, 30.0, 35.0, 40.0, 45.0)
"""Friction angles for which the table has a cohesion [degrees]."""


def check(settings: BedCutSettings) -> None:
    """Raise ValueError for a bed that is none or not level, or too narrow for a cut with two faces."""
    bed = check_bed(settings)
    check_width(settings.width, width=bed.size[0], height=bed.surface, grain=bed.grain)


def _test(settings: BedCutSettings, bed: Any, _about: Json, _: int, tell: Callable[[float], None]) -> Tested:
    found = cut_and_load(bed, width=settings.width, most=settings.most, tell=tell)
    columns = {"x_m": found.after[0], "thickness_m": found.after[1]}
    if found.before is not None:
        columns["thickness_standing_m"] = found.before[1]
    (low, high), flanks = found.bounds, found.flanks
    numbers = {
        **picked(found, "critical_height", "stood", "fell"),
        "low": low,
        "high": high if math.isfinite(high) else None,
        **picked(found, "height", "unit_weight", "trials", "flanks"),
        "slumped_to": None if flanks is None else sum(flank.angle for flank in flanks) / 2,
        "width": found.width,
    }
    return Tested(found.bed, columns, numbers, [])


def _result(settings: BedCutSettings, runs: list[Json]) -> Json:
    of, friction_angle, most = partial(quantity, runs), settings.friction_angle, settings.most

    def cohesion(run: Json, angle: float, key: str = "critical_height") -> float | None:
        return None if run[key] is None else cohesion_of(run[key], run["unit_weight"], angle)

    def half(run: Json) -> float | None:
        return None if run["critical_height"] is None else 0.5 * (run["high"] - run["low"])

    stands = "of a vertical face at the bed's own gravity; null where no face stood, or none fell"
    told = "give friction_angle, that of Mohr's circle"
    if friction_angle is not None:
        told = f"gamma H_c / 4 tan(45 + phi / 2) with phi = {friction_angle:g} degrees"
    quantities = {
        "critical_height": of("critical_height", "m", stands, error=half),
        "stands_to": of("low", "m", "largest height that stood, at the bed's own gravity"),
        "falls_from": of("high", "m", "smallest height that fell, in the same way"),
        "cohesion": of(lambda run: None if friction_angle is None else cohesion(run, friction_angle), "Pa", told),
        "slumped_to": of("slumped_to", "degrees", "slope of a fallen face, fitted as the angle of repose is"),
        "unit_weight": of("unit_weight", "N/m3", "bulk density times the bed's own gravity"),
    } | of_beds(runs, "grains before the cut")
    columns = {
        "run": lambda run: run["id"],
        "face [mm]": lambda run: f"{1e3 * run['height']:.3g}",
        "stood at": lambda run: f"{run['stood']:.2g} g" if run["stood"] else f"not at {LEAST:g} g",
        "fell at": lambda run: f"{run['fell']:.2g} g" if run["fell"] else f"not at {most:g} g",
        "critical height [mm]": lambda run: _or_dash(run["critical_height"], 1e3, ".3g"),
        "slumped to [deg]": lambda run: _or_dash(run["slumped_to"], 1.0, ".1f"),
    }
    tables = [table("Run by run (g: the bed's own gravity)", runs, columns)]
    if any(run["low"] > 0 for run in runs):
        bounds = (("stood: more than", "low"), ("fell: less than", "high"))
        rows = [
            [run["id"], words, *(_or_dash(cohesion(run, angle, key), 1.0, ".3g") for angle in _ANGLES)]
            for run in runs
            for words, key in bounds
        ]
        head = ["run", "", *(f"{angle:g} deg" for angle in _ANGLES)]
        tables.append({"title": "What cohesion that means [Pa], by friction angle", "head": head, "rows": rows})
    warnings = []
    if not any(run["stood"] for run in runs):
        bound = max(cohesion_of(run["high"], run["unit_weight"], friction_angle or 30.0) for run in runs)
        what = f"its cohesion is less than {bound:.2g} Pa, or none"
        warnings.append(f"no face stood at {LEAST:g} of the bed's gravity: {what}")
    elif any(run["fell"] is None for run in runs):
        what = "more ('most') or a deeper bed would show it"
        warnings.append(f"not every face fell at {most:g} times the bed's gravity: {what}")
    title = f"Vertical cut in {runs[0]['material']}"
    return {"title": title, "quantities": quantities, "tables": tables, "warnings": warnings}


def _or_dash(value: float | None, scale: float, form: str) -> str:
    return "-" if value is None else format(scale * value, form)


run, resume = bed_test(
    "bed test cut", BedCutSettings, check=check, test=_test, result=_result, bearing=lambda settings: 1 + settings.most
)
