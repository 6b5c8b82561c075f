"""`hedgebed bed test cut`: gravity rises until a vertical face falls; critical height and cohesion
(`dem.measure.cutting`)."""

import math
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.runs.whole_runs import whole_run

from .test_settings import BedCutSettings
from .tests import about, carry_out, check_bed, quantity, write_frame

__all__ = ["check", "resume", "run"]

_ANGLES = (25.0, 30.0, 35.0, 40.0, 45.0)
"""Friction angles for which the table tells a cohesion [degrees]."""


def check(settings: BedCutSettings) -> None:
    """Raise ValueError for a bed that is none or not level, or too narrow for a cut with two faces."""
    from dem.measure.cutting import check_width

    bed = check_bed(settings)
    check_width(settings.width, width=bed.size[0], height=bed.surface, grain=bed.grain)


def _carry_out(settings: BedCutSettings, folder: RunFolder, progress: Progress) -> Result:
    def test(bed: Any, name: str, tell: Callable[[float], None]) -> Json:
        from dem.measure.cutting import cut_and_load

        first = about(bed)
        found = cut_and_load(bed, width=settings.width, most=settings.most, tell=tell)
        columns = {"x_m": found.after[0], "thickness_m": found.after[1]}
        if found.before is not None:
            columns["thickness_standing_m"] = found.before[1]
        series = folder.write_series(name, columns)
        write_frame(folder, name, found.bed)
        low, high = found.bounds
        return first | {
            "critical_height": found.critical_height,
            "stood": found.stood,
            "fell": found.fell,
            "low": low,
            "high": high if math.isfinite(high) else None,
            "height": found.height,
            "unit_weight": found.unit_weight,
            "trials": [list(trial) for trial in found.trials],
            "flanks": None if found.flanks is None else [asdict(flank) for flank in found.flanks],
            "slumped_to": None if found.flanks is None else sum(flank.angle for flank in found.flanks) / 2,
            "width": found.width,
            "max_overlap": found.bed.max_overlap,
            "series": series,
            "frames": name,
            "warnings": [],
        }

    def result(runs: list[Json]) -> Json:
        return _result(runs, settings.friction_angle, settings.most)

    return carry_out(
        settings, folder, progress, test=test, result=result, report="vis.bed.tests:write_test_report",
        bearing=1.0 + settings.most,
    )  # fmt: skip


def _result(runs: list[Json], friction_angle: float | None, most: float) -> Json:
    from dem.measure.cutting import LEAST, cohesion_of

    of = partial(quantity, runs)

    def cohesion(run: Json, angle: float, key: str = "critical_height") -> float | None:
        return None if run[key] is None else cohesion_of(run[key], run["unit_weight"], angle)

    def half(run: Json) -> float | None:
        return None if run["critical_height"] is None else 0.5 * (run["high"] - run["low"])

    quantities = {
        "critical_height": of(
            "critical_height",
            "m",
            "of a vertical face at the bed's own gravity; null where no face stood, or none fell",
            error=half,
        ),
        "stands_to": of("low", "m", "largest height that stood, at the bed's own gravity"),
        "falls_from": of("high", "m", "least height that fell, likewise"),
        "cohesion": of(
            lambda run: None if friction_angle is None else cohesion(run, friction_angle),
            "Pa",
            "give friction_angle, that of Mohr's circle"
            if friction_angle is None
            else f"gamma H_c / 4 tan(45 + phi / 2) with phi = {friction_angle:g} degrees",
        ),
        "slumped_to": of("slumped_to", "degrees", "slope of a fallen face, fitted as the angle of repose is"),
        "unit_weight": of("unit_weight", "N/m3", "bulk density times the bed's own gravity"),
        "packing_fraction": of("packing_fraction", "1", "of the bed before"),
        "grain_count": of("grain_count", "1", "grains before the cut"),
        "max_overlap": of("max_overlap", "1", "over diameter"),
    }
    rows = [
        [
            run["id"],
            f"{1e3 * run['height']:.3g}",
            f"{run['stood']:.2g} g" if run["stood"] else f"not at {LEAST:g} g",
            f"{run['fell']:.2g} g" if run["fell"] else f"not at {most:g} g",
            "-" if run["critical_height"] is None else f"{1e3 * run['critical_height']:.3g}",
            "-" if run["slumped_to"] is None else f"{run['slumped_to']:.1f}",
        ]
        for run in runs
    ]
    head = ["run", "face [mm]", "stood at", "fell at", "critical height [mm]", "slumped to [deg]"]
    tables = [{"title": "Run by run (g: the bed's own gravity)", "head": head, "rows": rows}]
    if any(run["low"] > 0 for run in runs):
        tables.append(
            {
                "title": "What cohesion that means [Pa], by friction angle",
                "head": ["run", "", *(f"{angle:g} deg" for angle in _ANGLES)],
                "rows": [
                    [run["id"], words, *("-" if (c := cohesion(run, a, key)) is None else f"{c:.3g}" for a in _ANGLES)]
                    for run in runs
                    for words, key in (("stood: more than", "low"), ("fell: less than", "high"))
                ],
            }
        )
    warnings = []
    if not any(run["stood"] for run in runs):
        bound = max(cohesion_of(run["high"], run["unit_weight"], friction_angle or 30.0) for run in runs)
        warnings.append(
            f"no face stood at {LEAST:g} of the bed's gravity: its cohesion is less than {bound:.2g} Pa, or none"
        )
    elif any(run["fell"] is None for run in runs):
        warnings.append(
            f"not every face fell at {most:g} times the bed's gravity: more ('most') or a deeper bed would tell"
        )
    return {
        "title": f"Vertical cut in {runs[0]['material']}",
        "quantities": quantities,
        "tables": tables,
        "warnings": warnings,
    }


run, resume = whole_run("bed test cut", BedCutSettings, _carry_out, check=check)
