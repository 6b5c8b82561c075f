"""`hedgebed bed test shear`: peak and critical friction angle and cohesion of a bed, by a lid at several pressures.

Peak: the largest shear stress, smoothed over half a diameter of the lid's way. Critical: the mean over the second half
of the way, with the standard error of five parts of it. Mohr-Coulomb: a straight line through the runs' stresses.

Normal stress is the lid's. Shear stress is the same at every height. The normal stress grows downwards with the bed's
own weight, so the bed shears under the lid. The grains between imitate a cohesion, which is reported beside it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem import Bed
from dem.engine.state import read_file
from dem.grains.materials import caveat
from dem.measure.shearing import Shearing, shear_bed
from dem.prepare.bedfile import find_bed
from experiments.grains.softening import stable_overlap
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run
from rigid.intervals import student

from .peaks import LEAST_PEAK, peak_over_noise, without_peak
from .settings import say
from .test_settings import BedShearSettings
from .tests import picked, table

__all__ = ["PARTS", "Strength", "check", "fit_line", "resume", "run", "strength_of"]

_SMOOTH = 0.5
"""Way of the lid over which the peak's stress is averaged [mean diameters]."""
_BAND = 3.0
"""How far below the lid it may shear [mean diameters]; a guess."""
_COLUMNS = {"way": "way_m", "height": "height_m", "shear": "shear_Pa", "normal": "normal_Pa"}
"""Of the series, by what a run calls them."""
_NUMBERS = ("pressure", "speed", "inertial_number", "packing_fraction", "overburden")
PARTS = 5
"""Parts of the second half of the way, whose scatter gives the standard error."""


@dataclass(frozen=True)
class Strength:
    """Of one run: normal stress, peak and critical shear stress with its standard error [Pa], way at the peak [m]."""

    normal: float
    peak: float
    critical: float
    critical_error: float
    peak_way: float
    peak_over_noise: float
    """Of the peak, as `peaks.peak_over_noise` has it [1]."""


def strength_of(run: Shearing, grain: float) -> Strength:
    """Peak and critical shear stress of a run, at its mean normal stress.

    The servo lets the normal stress vary a little, and the shear stress varies with it: their ratio is averaged.
    """
    normal = float(run.normal.mean())
    count = max(1, round(_SMOOTH * grain / max(1e-12, (run.way[-1] - run.way[0]) / max(1, len(run.way) - 1))))
    count = min(count, len(run.way))
    kernel = np.ones(count) / count
    smooth = np.convolve(run.shear, kernel, "valid") / np.convolve(run.normal, kernel, "valid")
    top = int(np.argmax(smooth))
    shear, pressed = (np.array_split(values[len(run.way) // 2 :], PARTS) for values in (run.shear, run.normal))
    parts = [part.mean() / other.mean() for part, other in zip(shear, pressed, strict=True)]
    return Strength(
        normal=normal,
        peak=normal * float(smooth[top]),
        critical=normal * float(np.mean(parts)),
        critical_error=normal * float(np.std(parts, ddof=1)) / math.sqrt(PARTS),
        peak_way=float(run.way[min(top + count // 2, len(run.way) - 1)]),
        peak_over_noise=peak_over_noise(smooth),
    )


def fit_line(normal: np.ndarray, shear: np.ndarray) -> tuple[float, float, float | None, float | None]:
    """Least squares of shear = cohesion + tan(angle) normal: (cohesion, tan, their standard errors; None for two)."""
    slope, start = np.polyfit(normal, shear, 1)
    if len(normal) < 3:
        return float(start), float(slope), None, None
    rest = shear - start - slope * normal
    variance = float(rest @ rest) / (len(normal) - 2)
    spread = float(((normal - normal.mean()) ** 2).sum())
    error = math.sqrt(variance / spread)
    return float(start), float(slope), math.sqrt(variance * (1 / len(normal) + normal.mean() ** 2 / spread)), error


def check(settings: BedShearSettings) -> None:
    """Raise ValueError for what is no bed, or one that does not lie level."""
    stored, _, _ = read_file(find_bed(settings.bed))
    if stored.gravity[0] or stored.gravity[1]:
        raise ValueError(f"bed = {settings.bed!r} is tilted: a level one is accepted")


def _compute(settings: BedShearSettings, folder: RunFolder, progress: Progress) -> Result:
    path = find_bed(settings.bed)
    runs: list[Shearing] = []
    progress.plan({f"{p:g} times the weight": 1.0 for p in settings.pressures}, seconds={"report": 3.0})
    for pressure in settings.pressures:
        name = f"shear-{pressure:g}"
        progress.stage(f"{pressure:g} times the weight", total=1.0)
        prepared = Bed.load_prepared(path, threads=settings.threads)
        bed = prepared.bed
        assert bed is not None
        grain = 2 * float(bed.grains().radius.mean())
        if not folder.is_done(name):
            # A lid presses harder than the bed's own weight, for which its grains were made.
            bed.overlap_limit = stable_overlap(bed.material, bed.overlap_limit)
            run = shear_bed(
                bed, pressure=pressure * bed.weight / (bed.size[0] * bed.size[1]), way=settings.way * grain,
                inertial_number=settings.inertial_number, grain=grain, tell=progress.update,
            )  # fmt: skip
            folder.write_series(name, {column: getattr(run, key) for key, column in _COLUMNS.items()})
            folder.mark_done(name, picked(run, *_NUMBERS))
        columns = folder.read_series(name)
        kept: Json = {key: columns[column] for key, column in _COLUMNS.items()}
        runs.append(Shearing(**kept, **folder.done_data(name)))
    return _result(settings, runs, grain, prepared.recipe, bed)


def _strengths(strengths: list[Strength], band: float, run: Shearing) -> Json:
    """Friction angle, cohesion and stress ratio, peak and critical; `band`: share of the bed above where it shears."""
    normal = np.array([s.normal for s in strengths])
    found: Json = {}
    for kind in ("peak", "critical"):
        shear = np.array([s.peak if kind == "peak" else s.critical for s in strengths])
        start, slope, start_error, slope_error = fit_line(normal, shear)
        angle_error = None if slope_error is None else slope_error * (math.degrees(1) / (1 + slope**2))
        ratios = shear / normal
        degrees = math.degrees(math.atan(slope))
        feigned, spread = band * run.overburden * slope, float(ratios.std(ddof=1))
        found |= {
            f"{kind}_friction_angle": quantity(degrees, "degrees", say("slope"), std=angle_error),
            f"{kind}_cohesion": quantity(start, "Pa", "where that line begins", std=start_error),
            f"{kind}_cohesion_feigned": quantity(feigned, "Pa", say("feigned"), std=None),
            f"{kind}_ratio": quantity(float(ratios.mean()), "1", say("ratio"), std=spread),
        }
    return found | {"packing_fraction": quantity(run.packing_fraction, "1", "of the bed", std=None)}


def _result(settings: BedShearSettings, runs: list[Shearing], grain: float, recipe: Json, bed: Any) -> Result:
    strengths = [strength_of(run, grain) for run in runs]
    columns: dict[str, Callable[[tuple[Strength, Shearing]], str]] = {
        "normal [Pa]": lambda row: f"{row[0].normal:.0f}",
        "peak [Pa]": lambda row: f"{row[0].peak:.0f}",
        "at [d]": lambda row: f"{row[0].peak_way / grain:.1f}",
        "critical [Pa]": lambda row: f"{row[0].critical:.0f}",
        "± 95 % [Pa]": lambda row: f"{student(PARTS - 1) * row[0].critical_error:.0f}",
        "peak ratio": lambda row: f"{row[0].peak / row[0].normal:.3f}",
        "critical ratio": lambda row: f"{row[0].critical / row[0].normal:.3f}",
        "dilates [d]": lambda row: f"{row[1].height[-1] / grain:.2f}",
    }
    warnings = []
    if min(bed.size[:2]) < 12 * grain or bed.surface < 8 * grain:
        long, wide, deep = (side / grain for side in (*bed.size[:2], bed.surface))
        warnings.append(say("small_shear", long=long, wide=wide, deep=deep))
    if len(runs) < 3:
        warnings.append("fewer than three pressures: the line through them has no error that could be stated")
    quantities = _strengths(strengths, _BAND * grain / bed.surface, runs[0])
    if (over := without_peak(one.peak_over_noise for one in strengths)) is not None:
        peak, late = (math.degrees(math.atan(quantities[f"{kind}_ratio"]["value"])) for kind in ("peak", "critical"))
        warnings.append(say("no_peak", over=over, least=LEAST_PEAK, excess=peak - late))
    if doubt := caveat(bed.material):
        warnings.append(doubt)
    return Result.make(
        "bed test shear",
        title=f"{settings.bed}: sheared under a lid",
        quantities=quantities,
        tables=[table("Run by run", zip(strengths, runs, strict=True), columns)],
        runs=[
            {"id": f"shear-{pressure:g}", "series": f"series/shear-{pressure:g}.csv"}
            | picked(run, "pressure", "speed")
            | picked(strength, "normal", "peak", "critical", "critical_error")
            for pressure, run, strength in zip(settings.pressures, runs, strengths, strict=True)
        ],
        grain=grain,
        bed={"file": str(settings.bed), "recipe": recipe},
        warnings=warnings,
    )


run, resume = computed_run("bed test shear", BedShearSettings, _compute, check=check)
