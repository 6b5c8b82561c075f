"""The tests behind a calibration: what a sheared sample, a drained or a cut bed says, and the bulk figures that follow.

Stresses at large strain are means over the second half of the strain, their standard error that of five parts of it.
The largest strength is that of the stress ratio averaged over a twentieth of strain.

Friction angle and cohesion are those of a straight line through the tests' stresses, shear = cohesion + tan(angle)
normal (Mohr-Coulomb), on the shear plane. Of grains that do not stick one test gives the angle, as nothing but the
pressure has the unit of a stress. The triaxial angle is that of triaxial compression at the same
I1 I2 / I3 = (9 - sin^2) / (1 - sin^2) (Matsuoka & Nakai 1974, Proc. JSCE 232:59), from the whole stress tensor inside,
cohesion c added to it as c / tan(angle). Those of Mohr's circle are of the straight line through the circles of the
largest and least principal stress, radius = cohesion cos(angle) + sin(angle) centre: what Coulomb's wedge, and with it
a vertical cut, is reckoned with. Where volume stays, the shear plane has c cos(angle) and tan = sin(angle) instead.

A cut height comes from no formula: vertical faces are cut in a bed, and gravity rises until one falls
(`dem.measure.cutting`). The critical height is anywhere between the last height that stood and the first that fell.
Its standard error is that of a uniform distribution, the interval over sqrt(12).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem import Bed, BedFailure
from dem.grains.materials import Material
from dem.measure.cutting import MOST, cut_and_load
from dem.measure.element import ElementShear, shear_element
from dem.measure.repose import angle_of_repose
from experiments.bed.peaks import peak_over_noise
from experiments.bed.repose import BEARING
from experiments.bed.tests import picked, stiff_enough
from experiments.runs.types import Json

from .settings import CalibrateSettings, Target

__all__ = ["SampleTest", "figures_of", "laboratory_figure", "mohr_circle", "run_test", "summary_of", "tests_for"]

Tell = Callable[[float], None]
Kept = tuple[Json, dict[str, np.ndarray]]
"""What is kept of a test, and its series."""
BEDS = ("drained", "cut")
"""States of a bed; a sample is sheared in the others."""
STRIP = 3.0
"""Width of the strip that is cut out of a bed [mean diameters]."""
_WINDOW = 0.05
"""Strain over which the largest strength is averaged."""
_PARTS = 5
_STEEPEST = math.sin(math.radians(85.0))
"""Slope of a line through Mohr's circles, at most: chance brings few tests to 1 and more, which is no angle."""
_COLUMNS = {"strain": "strain", "height": "height_m", "shear": "shear_Pa", "normal": "normal_Pa"}


@dataclass(frozen=True)
class SampleTest:
    """One sample: in which state it is sheared, the pressure [Pa], the seed; a bed is "drained" or "cut", without a
    pressure."""

    state: str
    pressure: float
    seed: int

    @property
    def name(self) -> str:
        """For files."""
        pressed = f"-{self.pressure:g}" if self.pressure else ""
        return f"{self.state}{pressed}-seed{self.seed}"


def tests_for(settings: CalibrateSettings, targets: Sequence[Target], *, seed: int) -> list[SampleTest]:
    """The tests that these targets need, of one set of parameters and one seed."""
    states = dict.fromkeys(target.state for target in targets if target.state)
    pressures = settings.pressures if settings.base.cohesion != "none" else settings.pressures[-1:]
    return [SampleTest(state, p, seed) for state in states for p in ((0.0,) if state in BEDS else pressures)]


def run_test(stuff: Material, test: SampleTest, settings: CalibrateSettings, *, tell: Tell) -> Kept:
    """Carry a test out: what is kept of it, of a sheared sample as ``summary_of`` gives it, and its series.

    Raises BedFailure.
    """
    if test.state in BEDS:
        return (_drain if test.state == "drained" else _cut)(stuff, test, settings, tell)
    run = shear_element(
        stuff, pressure=test.pressure, grain=settings.grain, size=settings.size,
        pressed_friction=settings.dense_friction if test.state == "dense" else settings.loose_friction,
        spread=settings.spread, strain=settings.strain, inertial_number=settings.inertial_number,
        max_overlap=settings.max_overlap, seed=test.seed, threads=settings.threads, tell=tell,
    )  # fmt: skip
    return summary_of(run, stuff.density), {column: getattr(run, key) for key, column in _COLUMNS.items()}


@dataclass
class _Preparing:
    """Shows the preparation of a bed as the first half of a test."""

    tell: Tell
    part: int = 0

    def stage(self, name: str, total: float | None = None) -> None:
        """The next part begins."""
        self.part += 1

    def update(self, done: float) -> None:
        """``done`` of it, 0 to 1."""
        self.tell(0.5 - 0.5 ** (self.part + min(1.0, max(0.0, done))))


def _drain(stuff: Material, test: SampleTest, settings: CalibrateSettings, tell: Tell) -> Kept:
    """The angle of repose of one bed as rained, as ``hedgebed bed test repose`` has it."""
    length, width, depth = (settings.grain * side for side in settings.repose_size)
    sizes = {"grain": settings.grain, "spread": settings.spread}
    bed = Bed.prepare(
        stuff.with_rolling(),  # the plate is rough
        size=(length, width, depth),
        **sizes,
        gravity=settings.gravity,
        seed=test.seed,
        young=stiff_enough(stuff, depth=depth, **sizes, gravity=settings.gravity, bearing=BEARING),
        threads=settings.threads,
        cache=False,
        progress=_Preparing(tell),
    )
    packing = bed.packing_fraction
    found = angle_of_repose(bed, tell=lambda share: tell(0.5 + 0.5 * share))
    of_bed = {"size": list(bed.size), "packing_before": packing, "young": bed.material.young}
    summary = picked(found, "angle", "error", "flanks", "slot") | of_bed | picked(bed, "grain_count", "max_overlap")
    return summary, {"x_m": found.distance, "thickness_m": found.thickness}


def _cut(stuff: Material, test: SampleTest, settings: CalibrateSettings, tell: Tell) -> Kept:
    """The critical height of vertical faces in one bed [m], measured as by ``hedgebed bed test cut``.

    Raises BedFailure: the bed cannot be prepared by ``cut_stages``, or its faces never fall.
    """
    size = tuple(settings.grain * side for side in settings.cut_size)
    of_bed = {"grain": settings.grain, "spread": settings.spread, "gravity": settings.gravity}
    try:
        bed = Bed.prepare_as(
            stuff,
            stages=settings.cut_stages,
            size=size,
            **of_bed,
            seed=test.seed,
            young=stiff_enough(stuff, depth=size[2], **of_bed, bearing=1 + MOST),
            threads=settings.threads,
            progress=_Preparing(tell),
        ).whole
    except ValueError as error:  # as a packing that taps do not reach
        raise BedFailure(f"cut_stages: {error}") from error
    packing, count = bed.packing_fraction, bed.grain_count
    found = cut_and_load(bed, width=STRIP * settings.grain, tell=lambda share: tell(0.5 + 0.5 * share))
    if found.fell is None:
        raise BedFailure(
            f"a face {found.height:.3g} m high stands even at {found.stood:.2g} times gravity: choose a smaller "
            f"surface_energy or a greater depth in cut_size"
        )
    low, high = found.bounds
    summary = {
        "cut_height": math.sqrt(low * high) if low else 0.5 * high,
        "error": (high - low) / math.sqrt(12.0),
        "stood": low,
        "fell": high,
        "bulk_density": packing * stuff.density,
        "packing_before": packing,
        "grain_count": count,
        **picked(found, "height", "width", "trials"),
        **picked(found.bed, "size", "max_overlap"),
        "young": found.bed.material.young,
    }
    columns = {"x_m": found.after[0], "thickness_m": found.after[1]}
    if found.before is not None:
        columns["thickness_standing_m"] = found.before[1]
    return summary, columns


def summary_of(run: ElementShear, density: float) -> Json:
    """What is kept of a test: stresses at large strain and at the largest strength, with standard errors [Pa].

    ``bulk_density``: before it was sheared [kg/m3], for grains of this ``density``.
    ``tensor`` and ``peak_tensor``: stress tensors inside, at large strain and about the peak [Pa].
    """
    ratio, half = run.shear / run.normal, len(run.strain) // 2
    parts = np.array([part.mean() for part in np.array_split(ratio[half:], _PARTS)])
    count = max(1, min(len(ratio), round(len(ratio) * _WINDOW / run.strain[-1])))
    smooth = np.convolve(ratio, np.ones(count) / count, "valid")
    top = int(np.argmax(smooth))
    normal = float(run.normal[half:].mean())
    late = run.inside_strain >= run.strain[half]
    away = np.abs(run.inside_strain - run.strain[top + count // 2])
    at_peak = away <= max(_WINDOW / 2, away.min())
    error = float(parts.std(ddof=1)) / math.sqrt(_PARTS)
    return {
        "normal": normal,
        "shear": normal * float(parts.mean()),
        "error": normal * error,
        "peak_normal": float(run.normal[top : top + count].mean()),
        "peak_shear": float(run.normal[top : top + count].mean() * smooth[top]),
        "peak_strain": float(run.strain[top + count // 2]),
        "peak_over_noise": min(peak_over_noise(smooth), 1e6),
        "tensor": run.stress[late].mean(axis=0).tolist(),
        "peak_tensor": run.stress[at_peak].mean(axis=0).tolist(),
        "bulk_density": run.packing_before * density,
        "packing_before": run.packing_before,
        "packing_critical": float(run.packing[late].mean()),
        **picked(run, "young", "grain_count", "max_overlap"),
    }


def triaxial_angle(tensor: np.ndarray, *, added: float = 0.0) -> float:
    """The angle of triaxial compression [degrees] of a stress tensor [Pa], pressure positive; see the module.

    ``added``: cohesion over the tangent of the angle [Pa], taken as a pressure on all sides. Raises ValueError for a
    tensor that pulls.
    """
    tensor = np.asarray(tensor, dtype=float)
    principal = np.linalg.eigvalsh(0.5 * (tensor + tensor.T)) + added
    if not principal[0] > 0:
        raise ValueError(f"the least principal stress, {principal[0]:.4g} Pa, is none that presses")
    a, b, c = principal
    ratio = max(9.0, (a + b + c) * (a * b + b * c + c * a) / (a * b * c))
    return math.degrees(math.asin(math.sqrt((ratio - 9) / (ratio - 1))))


def mohr_circle(tensor: np.ndarray) -> tuple[float, float]:
    """Centre and radius of the circle of the largest and least principal stress [Pa]; the tensor need not press."""
    tensor = np.asarray(tensor, dtype=float)
    least, _, most = np.linalg.eigvalsh(0.5 * (tensor + tensor.T))
    return 0.5 * float(most + least), 0.5 * float(most - least)


def figures_of(
    targets: Sequence[Target], runs: Mapping[SampleTest, Mapping[str, Any]]
) -> dict[str, tuple[float, float]]:
    """Value and standard error of the targets' figures, from the tests of one set of parameters and one seed.

    The error is what the tests report; that of a peak is taken to be that of its test at large strain.
    """
    found = {}
    for target in targets:
        if not target.state:
            continue
        kept = [summary for test, summary in runs.items() if test.state == target.state]
        if target.figure in ("sample_density", "cut_density"):
            found[target.name] = (float(np.mean([summary["bulk_density"] for summary in kept])), 0.0)
            continue
        if target.state in BEDS:
            name = "cut_height" if target.state == "cut" else "angle"
            values, errors = ([summary[key] for summary in kept] for key in (name, "error"))
            found[target.name] = (float(np.mean(values)), float(np.linalg.norm(errors)) / len(errors))
            continue
        key = "peak_" if target.figure.startswith("peak") else ""
        names = (f"{key}normal", f"{key}shear", "error")
        normal, shear, error = (np.array([summary[name] for summary in kept]) for name in names)
        if target.plane == "mohr":
            normal, shear = np.array([mohr_circle(summary[f"{key}tensor"]) for summary in kept]).T
        start, slope, start_error, slope_error = _line(normal, shear, error, origin=target.through == "origin")
        angle = math.degrees(math.atan(slope))
        angle_error = math.degrees(slope_error / (1 + slope**2))
        if target.plane == "mohr":
            sine = min(slope, _STEEPEST)
            cosine = math.sqrt(1 - sine**2)
            angle, angle_error = math.degrees(math.asin(sine)), math.degrees(slope_error / cosine)
            start, start_error = start / cosine, start_error / cosine
        if "cohesion" in target.figure:
            found[target.name] = (start, start_error)
        elif target.plane in ("shear", "mohr"):
            found[target.name] = (angle, angle_error)
        else:
            added = max(0.0, start) / slope
            tensors = [summary[f"{key}tensor"] for summary in kept]
            found[target.name] = (float(np.mean([triaxial_angle(t, added=added) for t in tensors])), angle_error)
    return found


def _line(
    normal: np.ndarray, shear: np.ndarray, error: np.ndarray, *, origin: bool
) -> tuple[float, float, float, float]:
    """Where a straight line begins, its slope, and their standard errors; through the origin for one test, or asked."""
    if len(normal) == 1 or origin:
        along = normal / (normal @ normal)
        return 0.0, float(along @ shear), 0.0, math.sqrt(float(along**2 @ error**2))
    off = normal - normal.mean()
    along = off / (off @ off)
    level = 1 / len(normal) - normal.mean() * along
    start_error, slope_error = (math.sqrt(float(part**2 @ error**2)) for part in (level, along))
    return float(level @ shear), float(along @ shear), start_error, slope_error


def laboratory_figure(name: str, stuff: Material, settings: CalibrateSettings, *, seed: int, progress: Any) -> float:
    """A figure of a bed prepared as in a laboratory.

    ``progress``: anything with ``stage`` and ``update``, as ``dem.prepare.prepare.prepare_as`` takes it. Raises
    BedFailure where the bed did not come to rest, ValueError for a bed that cannot be.
    """
    stages = ["rain", "compact:densest" if name.endswith("_dense") else "fluff"]
    prepared = Bed.prepare_as(
        stuff, stages=stages, size=settings.bed_size, grain=settings.grain, spread=settings.spread,
        gravity=settings.gravity, seed=seed, threads=settings.threads, progress=progress,
    )  # fmt: skip
    packing = prepared.reports[-1].packing_fraction
    return packing if name.startswith("packing") else packing * stuff.density
