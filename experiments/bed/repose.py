"""`hedgebed bed test repose`: angle of repose, of the slopes that stay beside a slot (`dem.measure.repose`)."""

from collections.abc import Callable
from functools import partial
from typing import Any

from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.runs.whole_runs import whole_run

from .test_settings import BedReposeSettings
from .tests import about, carry_out, check_bed, picked, quantity, table, write_frame

__all__ = ["BEARING", "check", "resume", "run"]

BEARING = 2.0
"""Pressure over what lies on the floor [1]: a bed that drains bears no more than itself."""
_SHORT = 6.0
"""A fitted stretch shorter than this leaves the slope to chance [mean diameters]; a guess."""


def check(settings: BedReposeSettings) -> None:
    """Raise ValueError for a bed that is none, not level, or too narrow for two slopes."""
    from dem.measure.repose import check_width

    bed = check_bed(settings)
    check_width(bed.size[0], slot=settings.slot, grain=bed.grain, depth=bed.surface)


def _carry_out(settings: BedReposeSettings, folder: RunFolder, progress: Progress) -> Result:
    def test(bed: Any, name: str, tell: Callable[[float], None]) -> Json:
        from dem.measure.repose import angle_of_repose

        first = about(bed)
        found = angle_of_repose(bed, slot=settings.slot, tell=tell)
        series = folder.write_series(name, {"x_m": found.distance, "thickness_m": found.thickness})
        write_frame(folder, name, found.bed)
        grain, warnings = first["grain"], []
        if min(flank.end - flank.start for flank in found.flanks) < _SHORT * grain:
            warnings.append(
                f"a slope was fitted over less than {_SHORT:g} diameters: a wider or a deeper bed tells it better"
            )
        told = picked(found, "angle", "error", "flanks", "drained", "crest", "slot", "plate")
        kept = {"max_overlap": found.bed.max_overlap, "series": series, "frames": name, "warnings": warnings}
        return first | told | kept

    return carry_out(
        settings, folder, progress, test=test, result=_result, report="vis.bed.tests:write_test_report",
        bearing=BEARING,
    )  # fmt: skip


def _result(runs: list[Json]) -> Json:
    of = partial(quantity, runs)

    def slope(flank: Json) -> str:
        return f"{flank['angle']:.1f} +- {flank['error']:.1f}"

    fitted = "drained; mean of two slopes a run, fitted from three diameters to four fifths of the crest's height"
    quantities = {
        "angle_of_repose": of("angle", "degrees", fitted, error="error"),
        "crest": of("crest", "m", "height of what stayed"),
        "drained": of("drained", "1", "grains that fell out"),
        "packing_fraction": of("packing_fraction", "1", "of the bed before"),
        "grain_count": of("grain_count", "1", "grains before"),
        "max_overlap": of("max_overlap", "1", "over diameter"),
    }
    columns = {
        "run": lambda run: run["id"],
        "angle [deg]": lambda run: f"{run['angle']:.1f}",
        "error": lambda run: f"{run['error']:.1f}",
        "right slope": lambda run: slope(run["flanks"][0]),
        "left slope": lambda run: slope(run["flanks"][1]),
        "crest [d]": lambda run: f"{run['crest'] / run['grain']:.1f}",
        "fitted over [d]": lambda run: f"{min((f['end'] - f['start']) for f in run['flanks']) / run['grain']:.0f}",
        "drained": lambda run: f"{run['drained']} of {run['grain_count']}",
    }
    title = f"Angle of repose of {runs[0]['material']}"
    return {"title": title, "quantities": quantities, "tables": [table("Run by run", runs, columns)], "warnings": []}


run, resume = whole_run("bed test repose", BedReposeSettings, _carry_out, check=check)
