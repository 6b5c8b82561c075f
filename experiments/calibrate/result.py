"""What a calibration says: result.json, the material's file, what could not be met."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from dem.grains.materials import MATERIAL_FORMAT, MATERIALS, Material
from experiments.bed.peaks import LEAST_PEAK, without_peak
from experiments.bed.tests import picked, table
from experiments.runs.folder import RunFolder, toml_value
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from experiments.runs.version import __version__
from rigid.intervals import half_of

from .fit import Fit, Surfaces
from .settings import FREE, CalibrateSettings, Target, say
from .tests import SampleTest, figures_of

__all__ = ["Simulated", "calibration_result", "material_toml"]

_CURVE = 41
"""Points of a response's curve."""
Values = Mapping[str, float]
"""Of the parameters, by name."""
Measured = tuple[float, float | None] | None
"""Value and standard error of a figure; None where no test of a bed gives it."""
_UNSOURCED = ("name", "cohesion", "grain", "tangential")


@dataclass(frozen=True)
class Simulated:
    """What a calibration has simulated."""

    points: list[dict[str, float]] = field(default_factory=list)  # parameter -> value
    figures: list[dict[str, tuple[float, float]]] = field(default_factory=list)  # of each, with standard errors
    tests: list[Json] = field(default_factory=list)  # the check's as well
    measured: Mapping[str, Measured] = field(default_factory=dict)  # at the parameters found, by figure


def calibration_result(
    settings: CalibrateSettings,
    done: Simulated,
    fit: Fit,
    responses: Surfaces,
    best: Values,
    stuff: Material,
    folder: RunFolder,
) -> Result:
    """result.json; writes the series of the responses' curves."""
    targets, measured = list(settings.wanted.values()), done.measured
    quantities: Json = {}
    for k, (key, value) in enumerate(best.items()):
        low, high = settings.free[key]
        note = say("found_between", low=low, high=high, lower=fit.low[k], upper=fit.high[k])
        quantities[key] = quantity(value, FREE[key], note, std=float(fit.std[k]))
    if "bond_number" in best:
        note = f"for grains of {settings.grain:g} m"
        quantities["surface_energy"] = quantity(stuff.surface_energy, "J/m2", note, std=None)
    reach = _reach(responses)
    freedom = len(settings.check_seeds) - 1
    entries = [
        _entry(target, measured[target.name], fit, reach.get(target.name), freedom)
        | _no_peak(target, measured[target.name], done, best)
        for target in targets
    ]
    warnings = _warnings(settings, fit)
    for target, entry in zip(targets, entries, strict=True):
        got, error, verdict = entry["simulated"], entry["error"], entry["verdict"]
        note = f"{verdict}; wanted {target.value:g} ± {target.tolerance:g}"
        quantities[target.name] = quantity(got, target.unit, note, std=error) | _freedom(entry)
        if verdict != "met":
            warnings.append(_unmet(target, entry))
        if entry.get("no_peak"):
            warnings.append(say("no_peak", name=target.name, least=LEAST_PEAK, **entry["no_peak"]))
    if settings.name in MATERIALS and MATERIALS[settings.name] != stuff:
        warnings.append(say("name_ships_otherwise", s=settings))
    over = max((test["max_overlap"] for test in done.tests), default=0.0)
    return Result.make(
        "bed calibrate",
        code=folder.code,
        title=f"{settings.name}: grain parameters from bulk figures",
        quantities=quantities,
        figures=entries,
        tables=[table("Figure by figure", entries, _FIGURES) | {"words": True}, _point_table(settings, done)],
        points=_points(settings, done, responses, best),
        curves=_curves(settings, responses, best, folder),
        scatter={name: response.scatter for name, response in responses.items()},
        correlation=fit.correlation,
        chi2=fit.chi2,
        tests=[{k: v for k, v in test.items() if "tensor" not in k} for test in done.tests],
        max_overlap=over,
        material={f.name: getattr(stuff, f.name) for f in fields(stuff) if f.name != "sources"},
        warnings=warnings,
    )


def _entry(target: Target, found: Measured, fit: Fit, reach: tuple[float, float] | None, freedom: int) -> Json:
    """The result's entry of one figure: wanted, measured, and what the response surface expects.

    ``freedom``: degrees of freedom of the error, of several samples.
    """
    got, error = found if found is not None else (None, None)
    known: Json = {"error": error, **({"freedom": freedom} if error is not None and freedom > 0 else {})}
    half = _half(known) or 0.0
    off = math.inf if got is None else abs(got - target.value)
    verdict = "met" if off <= target.tolerance else "not met"
    if got is None:
        verdict = "no value"
    elif target.tolerance < off <= target.tolerance + half:
        verdict = "not met; the tests' noise does not exclude it"
    return {
        **picked(target, "name", "figure", "unit"),
        "wanted": target.value,
        **picked(target, "tolerance", "source"),
        "plane": target.plane if "friction_angle" in target.figure or target.plane == "mohr" else None,
        "state": target.state or None,
        "fitted": target.fit,
        "simulated": got,
        **known,
        "expected": fit.response.get(target.name),
        "expected_std": fit.response_std.get(target.name),
        "reach": reach,
        "verdict": verdict,
    }


def _freedom(entry: Json) -> Json:
    """The degrees of freedom of a figure's error, where they are known."""
    return {"freedom": entry["freedom"]} if "freedom" in entry else {}


def _no_peak(target: Target, found: Measured, done: Simulated, best: Values) -> Json:
    """The entry "no_peak" of a peak strength that is a maximum of fluctuations; nothing where there is a peak.

    "over": the largest strength less that at large strain, in standard deviations of the fluctuations. "critical": what
    the same tests have at large strain. "excess": the largest less that.
    """
    if not target.figure.startswith("peak") or found is None:
        return {}
    checks = [test for test in done.tests if test["test"].startswith("check") and test["values"] == best]
    own = [test for test in checks if test["state"] == target.state]
    if (over := without_peak(test.get("peak_over_noise") for test in own)) is None:
        return {}
    figure = "cohesion" if "cohesion" in target.figure else "critical_friction_angle"
    late = replace(target, figure=figure)
    values = []
    for seed in dict.fromkeys(test["seed"] for test in own):
        runs = {SampleTest(test["state"], test["pressure"], seed): test for test in own if test["seed"] == seed}
        values.append(figures_of([late], runs)[target.name][0])
    critical = float(np.mean(values))
    return {
        "no_peak": {"over": over, "critical": critical, "excess": found[0] - critical, "unit": target.unit,
                    "instead": figure},
    }  # fmt: skip


def _unmet(target: Target, entry: Json) -> str:
    value, verdict, reach = (entry[key] for key in ("simulated", "verdict", "reach"))
    half = _half(entry)
    wanted = f"{target.value:g} ± {target.tolerance:g} {target.unit} was wanted"
    if value is None:
        return f"{target.name} could not be simulated: {wanted}"
    said = f"{target.name} = {value:.4g}{'' if half is None else f' ± {half:.2g} (95 %)'} where {wanted}: {verdict}"
    if reach is not None and verdict.startswith("not met") and not reach[0] <= target.value <= reach[1]:
        said += f"; within the parameters' ranges it goes from {reach[0]:.3g} to {reach[1]:.3g}"
    return said


def _warnings(settings: CalibrateSettings, fit: Fit) -> list[str]:
    said = []
    for key, end in fit.at_edge.items():
        low, high = settings.free[key]
        said.append(
            f"{key} lies at the {end} end of its range, {low:g} to {high:g}: what the figures ask for may lie beyond"
        )
    said += [f"{key} is hardly decided by the figures: its uncertainty is that of its range" for key in fit.vague]
    if settings.name in MATERIALS:
        said.append(say("name_ships", s=settings))
    return said


def _reach(responses: Surfaces) -> dict[str, tuple[float, float]]:
    """From where to where each figure's surface goes over the whole box."""
    found = {}
    for name, response in responses.items():
        width = len(response.length)
        grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 11)] * width), axis=-1).reshape(-1, width)
        mean, _ = response.at(grid)
        found[name] = (float(mean.min()), float(mean.max()))
    return found


def _box(settings: CalibrateSettings, values: Values) -> tuple[np.ndarray, np.ndarray]:
    """The ends of the ranges, shape [parameter_count, 2], and where these values lie between them."""
    ends = np.array(list(settings.free.values()))
    return ends, (np.array(list(values.values())) - ends[:, 0]) / (ends[:, 1] - ends[:, 0])


def _points(settings: CalibrateSettings, done: Simulated, responses: Surfaces, best: Values) -> list[Json]:
    """The points explored; ``moved``: each figure along the surface to the parameters found, but for the one named."""
    _, at = _box(settings, best)
    found = []
    for point, figures in zip(done.points, done.figures, strict=True):
        x = _box(settings, point)[1]
        moved: dict[str, dict[str, float]] = {}
        for k, key in enumerate(settings.free):
            there = at.copy()
            there[k] = x[k]
            means = {name: response.at(np.array([x, there]))[0] for name, response in responses.items()}
            moved[key] = {name: float(figures[name][0] + mean[1] - mean[0]) for name, mean in means.items()}
        found.append({"values": point, "figures": figures, "moved": moved})
    return found


def _curves(settings: CalibrateSettings, responses: Surfaces, best: Values, folder: RunFolder) -> dict[str, str]:
    """Each fitted figure along each parameter through the best point, as series; parameter -> file."""
    ends, at = _box(settings, best)
    files = {}
    for k, key in enumerate(settings.free):
        x = np.repeat(at[None, :], _CURVE, axis=0)
        x[:, k] = np.linspace(0, 1, _CURVE)
        columns = {key: ends[k, 0] + x[:, k] * (ends[k, 1] - ends[k, 0])}
        for name, response in responses.items():
            columns[name], columns[f"{name}.std"] = response.at(x)
        files[key] = folder.write_series(f"response-{key}", columns)
    return files


def _half(entry: Json) -> float | None:
    """Half of the 95 % interval of a figure's entry."""
    return half_of({"std": entry["error"], **_freedom(entry)})


def _simulated(entry: Json) -> str:
    half = _half(entry)
    error = "" if half is None else f" ± {half:.2g}"
    return "-" if entry["simulated"] is None else f"{entry['simulated']:.4g}{error}"


_FIGURES: dict[str, Callable[[Json], str]] = {
    "figure": lambda entry: entry["name"] + (f" ({entry['plane']})" if entry["plane"] not in (None, "shear") else ""),
    "wanted": lambda entry: f"{entry['wanted']:g} ± {entry['tolerance']:g} {entry['unit']}",
    "simulated (95 %)": _simulated,
    "surface": lambda entry: (
        "-" if entry["expected"] is None else f"{entry['expected']:.4g} ± {entry['expected_std']:.2g}"
    ),
    "verdict": lambda entry: entry["verdict"],
    "source": lambda entry: entry["source"],
}
"""Columns of the table of figures."""


def _point_table(settings: CalibrateSettings, done: Simulated) -> Json:
    names = [target.name for target in settings.wanted.values() if target.fit]
    rows = [
        [str(k + 1), *(f"{v:.4g}" for v in point.values()), *(f"{found[n][0]:.4g} ± {found[n][1]:.2g}" for n in names)]
        for k, (point, found) in enumerate(zip(done.points, done.figures, strict=True))
    ]
    return {"title": "Point by point", "head": ["point", *settings.free, *names], "rows": rows, "words": False}


def material_toml(stuff: Material, settings: CalibrateSettings, fit: Fit, figures: list[Json]) -> str:
    """The text of material.toml, which ``dem.grains.materials.read_material`` reads."""
    found_keys = {"surface_energy" if key == "bond_number" else key for key in settings.free}
    said = ", ".join(f"{t.name} {t.value:g} ± {t.tolerance:g} {t.unit}" for t in settings.wanted.values() if t.fit)
    sources = dict(stuff.sources) | dict.fromkeys(found_keys, f"calibrated to {said}")
    shown = [f.name for f in fields(stuff) if f.name != "sources" and getattr(stuff, f.name) is not None]
    if stuff.cohesion == "none":
        shown = [key for key in shown if key not in ("cohesion", "surface_energy", "grain")]
    stds = {f"{key}_std": float(f"{std:.2g}") for key, std in zip(settings.free, fit.std, strict=True)}
    lines = [
        "# A material of hedgebed bed calibrate: `--material FILE` of penetrate and bed make takes it.",
        *_pairs({"format": MATERIAL_FORMAT} | {key: getattr(stuff, key) for key in shown}),
        "",
        "[sources]",
        *_pairs({key: sources.get(key, "not given") for key in shown if key not in _UNSOURCED}),
        "",
        "[calibration]",
        *_pairs({"version": __version__, "grain": settings.grain} | stds),
    ]
    for entry in figures:
        digits = {"simulated": ".5g", "error": ".2g"}
        rounded = {key: None if entry[key] is None else float(f"{entry[key]:{form}}") for key, form in digits.items()}
        found = {key: (entry | rounded)[key] for key in ("wanted", "tolerance", *digits, "verdict", "source")}
        if "no_peak" in entry:
            excess = f"{entry['no_peak']['excess']:.2g} {entry['unit']}"
            found["peak"] = f"none beyond fluctuations, which add {excess} to the value at large strain"
        lines += ["", f"[calibration.{entry['name']}]", *_pairs(found)]
    return "\n".join(lines) + "\n"


def _pairs(values: Json) -> list[str]:
    return [f"{key} = {toml_value(value)}" for key, value in values.items() if value is not None]
