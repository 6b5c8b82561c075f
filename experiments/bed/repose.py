"""`hedgebed bed test repose`: angle of repose, of the slopes that stay beside a slot (`dem.measure.repose`)."""

from collections.abc import Callable
from functools import partial
from typing import Any

from dem.measure.repose import angle_of_repose, check_width
from experiments.runs.types import Json
from rigid.intervals import NORMAL

from .test_settings import BedReposeSettings
from .tests import Tested, bed_test, check_bed, of_beds, picked, quantity, table

__all__ = ["BEARING", "check", "resume", "run"]

BEARING = 2.0
"""Pressure over what lies on the floor [1]: a bed that drains bears no more than itself."""
_SHORT = 6.0
"""A fitted stretch shorter than this leaves the slope to chance [mean diameters]; a guess."""


def check(settings: BedReposeSettings) -> None:
    """Raise ValueError for a bed that is none, not level, or too narrow for two slopes."""
    bed = check_bed(settings)
    check_width(bed.size[0], slot=settings.slot, grain=bed.grain, depth=bed.surface)


def _test(settings: BedReposeSettings, bed: Any, about: Json, _: int, tell: Callable[[float], None]) -> Tested:
    found = angle_of_repose(bed, slot=settings.slot, tell=tell)
    short = min(flank.end - flank.start for flank in found.flanks) < _SHORT * about["grain"]
    said = f"a slope was fitted over less than {_SHORT:g} diameters: a wider or a deeper bed is more accurate"
    numbers = picked(found, "angle", "error", "flanks", "drained", "crest", "slot", "plate")
    return Tested(found.bed, {"x_m": found.distance, "thickness_m": found.thickness}, numbers, [said] if short else [])


def _result(_: BedReposeSettings, runs: list[Json]) -> Json:
    of = partial(quantity, runs)

    def slope(flank: Json) -> str:
        return f"{flank['angle']:.1f} ± {NORMAL * flank['error']:.1f}"

    fitted = "drained; mean of two slopes a run, fitted from three diameters to four fifths of the crest's height"
    quantities = {
        "angle_of_repose": of("angle", "degrees", fitted, error="error"),
        "crest": of("crest", "m", "height of what stayed"),
        "drained": of("drained", "1", "grains that fell out"),
    } | of_beds(runs, "grains before")
    columns = {
        "run": lambda run: run["id"],
        "angle [deg]": lambda run: f"{run['angle']:.1f}",
        "± 95 %": lambda run: f"{NORMAL * run['error']:.1f}",
        "right slope": lambda run: slope(run["flanks"][0]),
        "left slope": lambda run: slope(run["flanks"][1]),
        "crest [d]": lambda run: f"{run['crest'] / run['grain']:.1f}",
        "fitted over [d]": lambda run: f"{min((f['end'] - f['start']) for f in run['flanks']) / run['grain']:.0f}",
        "drained": lambda run: f"{run['drained']} of {run['grain_count']}",
    }
    title = f"Angle of repose of {runs[0]['material']}"
    return {"title": title, "quantities": quantities, "tables": [table("Run by run", runs, columns)]}


run, resume = bed_test(
    "bed test repose", BedReposeSettings, check=check, test=_test, result=_result, bearing=lambda settings: BEARING
)
