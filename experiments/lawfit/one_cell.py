"""The laws of one tip and gravity: fit, comparison, ground files, entries of result.json."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.runs.progress import Progress
from experiments.runs.types import Json
from rigid.ground_file import GROUND_FORMAT, OPTIONAL, Estimate, Foot, GroundFile

from .data import Data
from .fit import Estimated, LawFit, fit_law, fit_usable, interval, mean_of
from .identify import identified, influences
from .laws import ADDED_MASS, RATES, Candidate, candidates_for
from .settings import LawFitSettings, say
from .trust import beyond, error_map, held_out, sinkage_check, sinkage_range, within
from .words import closing, ranked

__all__ = ["PAIR", "OneCell", "fit_cell", "ground_file"]

PAIR = "spring-damper"
_LOADS = (0.1, 0.25, 0.5, 0.75, 1.0)
"""Loads of the table of tangents, over the largest mean force of a bin [1]."""

Fitted = LawFit[Candidate]


@dataclass(frozen=True)
class OneCell:
    """All laws of one tip and gravity."""

    name: str
    data: Data
    fits: dict[str, Fitted]
    laws: list[Json]  # The entries of result.json, the best first
    unidentified: list[str]  # Sentences on parameters that the runs do not identify
    tangents: list[Json]
    contributions: list[Json]
    sentences: list[str]
    quantities: dict[str, Json]
    warnings: list[str]

    @property
    def entries(self) -> dict[str, Json]:
        """The laws by name."""
        return {law["name"]: law for law in self.laws}

    @property
    def best(self) -> str:
        """Name of the first law."""
        return str(self.laws[0]["name"])

    def write(self, folder: Path) -> None:
        """Write ground.toml, and laws/NAME.toml of every law that can be a ground, into `folder`."""
        for name, fit in self.fits.items():
            if name != ADDED_MASS and not _beyond_the_law(fit):
                ground_file(fit, self.data, self.unidentified).write(folder / "laws" / f"{name}.toml")
        pair = ground_file(self.fits[PAIR], self.data, [*self.unidentified, *self.entries[PAIR]["holds"]])
        pair.write(folder / "ground.toml")

    @property
    def exported(self) -> Fitted:
        """The best law that can be a ground and has no parameter at a bound; the spring-damper where there is none."""
        fits = [self.fits[law["name"]] for law in self.laws if law["name"] != ADDED_MASS]
        good = [fit for fit in fits if not _beyond_the_law(fit) and not any(map(fit.at_bound, fit.candidate.free))]
        return good[0] if good else self.fits[PAIR]

    def columns(self) -> dict[str, NDArray[Any]]:
        """The rows that were fitted, and each law's force there."""
        return _columns(self.data, self.fits)


def fit_cell(settings: LawFitSettings, name: str, data: Data, progress: Progress) -> OneCell:
    """Fit and compare the laws of `settings` in the runs of one tip and gravity."""
    candidates, left = candidates_for(data, tuple(dict.fromkeys((PAIR, *settings.laws))))
    progress.message(say("read", data=data, beds=len(data.beds), runs=len(data.runs), f=data.foundation))
    progress.stage("laws", total=float(len(candidates)))
    fits: dict[str, Fitted] = {}
    laws: list[Json] = []
    unidentified: list[str] = []
    contributed: list[Json] = []
    for done, candidate in enumerate(candidates, 1):
        free = fit_law(candidate, data)
        fits[candidate.name] = fit_usable(free)
        unidentified += identified(free) if candidate.name == PAIR else []
        contributed += influences(free) if candidate.name == PAIR else []
        laws.append(_law_entry(settings, fits[candidate.name]))
        progress.update(done)
    laws = ranked(laws)
    entries = {law["name"]: law for law in laws}
    holds, rest = closing(settings, data, entries, laws[0]["name"])
    entries[PAIR]["holds"] = holds
    warnings = [*unidentified, *data.notes, *(say(why, name=law, f=data.foundation) for law, why in left.items())]
    warnings += [say("few_beds", beds=len(data.beds))] if len(data.beds) < 3 else []
    warnings += [] if "speed" in entries[PAIR]["beyond"] else [say("two_speeds")]
    if (shown := entries[PAIR]["map"]) is not None and shown["left"]:
        warnings.append(say("not_in_map", mm=1e3 * shown["depth"][-1], runs=", ".join(shown["left"])))
    warnings += [f"{law['name']}: {text}" for law in laws for text in law["notes"]]
    warnings += [text for fit in fits.values() for text in _beyond_the_law(fit)]
    others = [law["name"] for law in laws if law["name"] not in (PAIR, ADDED_MASS)]
    return OneCell(
        name=name, data=data, fits=fits, laws=laws, unidentified=unidentified,
        tangents=_tangents(fits, data, (PAIR, *others[:1])),
        contributions=contributed, sentences=[*holds, *rest], warnings=warnings,
        quantities=_quantities(settings, fits[PAIR], entries[PAIR], laws[0]),
    )  # fmt: skip


def _law_entry(settings: LawFitSettings, fitted: Fitted) -> Json:
    """The entry of one law in result.json."""
    candidate, found = fitted.candidate, error_map(fitted)
    parameters = {
        name: asdict(found) | {"unit": _unit(candidate, name)} for name, found in _fitted_parameters(fitted).items()
    }
    entry: Json = {
        "name": candidate.name, "summary": candidate.law.summary, "parameters": parameters,
        "fixed": {name: value for name, value in candidate.fixed.items() if name not in parameters},
        "bed_spread": fitted.bed_spread, "sigma": fitted.sigma, "information": fitted.information,
        "log_likelihood": fitted.log_likelihood, "held_out": held_out(fitted),
        "sinkage": [asdict(one) for one in sinkage_check(fitted)], "notes": _notes(fitted),
        "beyond": {kind: asdict(one) for kind, one in beyond(fitted).items()}, "holds": [], "map": None, "within": [],
        "sinkage_range": None,
    }  # fmt: skip
    if found is not None:
        entry["map"] = {
            "speeds": list(found.speeds), "depth": found.depth.tolist(), "force": found.force.tolist(),
            "error": found.error.tolist(), "left": list(found.left),
        }  # fmt: skip
        entry["within"] = [asdict(one) for one in within(found, settings.force_error)]
        entry["sinkage_range"] = sinkage_range(fitted, found, settings.sinkage_error)
    return entry


def _unit(candidate: Candidate, name: str) -> str:
    return next(parameter.unit for parameter in candidate.law.parameters if parameter.name == name)


def _fitted_parameters(fitted: Fitted) -> dict[str, Estimated]:
    """All fitted parameters within the bounds of the law: a rate below 0 becomes 0, and its interval begins at 0."""
    found = {name: fitted.parameter(name) for name in fitted.candidate.free}
    if (free := fitted.free_rate) is not None:
        rate = next(name for name in RATES if name in fitted.candidate.fixed)
        found[rate] = Estimated(0.0, free.std, 0.0, max(free.high, 0.0))
    return found


def _notes(fitted: Fitted) -> list[str]:
    """Sentences on parameters at a bound."""
    candidate, said = fitted.candidate, []
    for name, found in _fitted_parameters(fitted).items():
        unit = f" {_unit(candidate, name)}".removesuffix(" 1")
        if name not in candidate.free:
            said.append(say("negative_rate", key=name, found=fitted.free_rate, unit=unit))
        elif fitted.at_bound(name):
            said.append(say("at_bound", key=name, found=found, unit=unit))
    return said


def _beyond_the_law(fitted: Fitted) -> list[str]:
    """Why a law cannot be a ground with these parameters (a rate below 0 becomes 0 and is no reason)."""
    candidate, said = fitted.candidate, []
    for parameter in candidate.law.parameters:
        if parameter.name in candidate.free and fitted.parameter(parameter.name).value > parameter.highest:
            found = fitted.parameter(parameter.name)
            unit = f" {parameter.unit}".removesuffix(" 1")
            about = {"key": parameter.name, "unit": unit, "most": parameter.highest}
            said.append(say("not_a_ground", name=candidate.name, found=found, **about))
    return said


def ground_file(fitted: Fitted, data: Data, unidentified: Sequence[str]) -> GroundFile:
    """The law as a file: parameters within their bounds, the range of the runs, and notes for its user."""
    candidate, foundation = fitted.candidate, data.foundation
    known = {parameter.name: parameter for parameter in candidate.law.parameters}
    parameters, estimates = {}, _fitted_parameters(fitted)
    for name, parameter in known.items():
        if name not in estimates:
            if name in OPTIONAL:  # loading alone was fitted: the law's default
                continue
            own = candidate.fixed[name]
            parameters[name] = (
                _rebound(data, own) if name == "rebound" else Estimate(value=own, std=0.0, note=say("fixed"))
            )
            continue
        found = estimates[name]
        low, high = parameter.lowest, parameter.highest
        value = float(np.clip(found.value, low, high))
        ends = [float(np.clip(end, low, high)) for end in (found.low, found.high)]
        note = "" if name in candidate.free else say("clipped", value=fitted.free_rate.value)  # type: ignore[union-attr]
        if name == "bulk_density":
            note = say("scaled", own=foundation.bulk_density, scale=value / foundation.bulk_density)
        limits = (min(ends[0], value), max(ends[1], value))
        parameters[name] = Estimate(value=value, std=found.std, interval=limits, note=note)
    drops = any(run.kind == "drop" for run in data.runs)
    slowest = 0.0 if drops or data.placements else min(data.speeds)
    tall = [float(run.depth.max()) for run in data.runs]
    return GroundFile(
        format=GROUND_FORMAT, law=candidate.law.name, material=foundation.material, source=say("source"),
        runs=data.sources, notes=tuple(unidentified),
        foot=Foot(tip=foundation.tip, diameter=foundation.diameter, cone_angle=foundation.cone_angle),
        parameters=parameters,
        range={
            "load": (0.0, float(data.force.max())), "depth": (0.0, max(tall)),
            "speed": (slowest, max(data.speeds)), "gravity": (foundation.gravity, foundation.gravity),
            "diameter": (foundation.diameter, foundation.diameter),
        },
    )  # fmt: skip


def _rebound(data: Data, stiffest: float) -> Estimate:
    """Share of the deepest depth that springs back: that of the unloadings, or `stiffest` where there is none.

    A share below `stiffest` is replaced by it, because a step of 1 ms does not resolve stiffer unloading.
    """
    found = [one.force / (one.stiffness * one.depth) for one in data.unloadings if one.stiffness > 0]
    if len(found) < 2:
        return Estimate(value=stiffest, std=0.0, note=say("unloading"))
    measured = mean_of(np.array(found))
    if measured.value < stiffest:
        return Estimate(value=stiffest, std=0.0, note=say("stiffer_unloading", measured=measured))
    ends = (max(0.0, measured.low), measured.high)
    return Estimate(value=measured.value, std=measured.std, interval=ends, note=say("measured_unloading"))


def _columns(data: Data, fits: dict[str, Fitted]) -> dict[str, NDArray[Any]]:
    """The rows that were fitted, and each law's force there."""
    columns: dict[str, NDArray[Any]] = {
        "run": data.run_of_row, "bed": data.bed_of_row, "depth_m": data.depth, "rate_m_s": data.rate,
        "acceleration_m_s2": data.acceleration, "force_N": data.force,
    }  # fmt: skip
    return columns | {f"{name}_N": fit.predicted for name, fit in fits.items()}


def _tangents(fits: dict[str, Fitted], data: Data, names: Sequence[str]) -> list[Json]:
    """K and C of the spring-damper tangent to the laws `names` at loads and speeds, each with its spread."""
    largest = float(np.mean([run.force[-1] for run in data.runs if run.kind == "driven"] or [data.force.max()]))
    deepest = max(float(run.depth.max()) for run in data.runs)
    speeds = sorted({run.speed for run in data.runs})
    rows: list[Json] = []
    for name in dict.fromkeys(names):
        fitted = fits[name]
        for share in _LOADS:
            for speed in speeds:
                load = float(f"{share * largest:.2g}")
                parts = _tangent_parts(fitted, load, speed)
                if parts and parts[2].value <= deepest:
                    kinds = zip(("stiffness", "damping", "depth"), parts, strict=True)
                    rows.append(
                        {"law": name, "load": load, "speed": speed} | {kind: asdict(one) for kind, one in kinds}
                    )
    return rows


def _tangent_parts(fitted: Fitted, load: float, speed: float) -> list[Estimated]:
    """K, C and depth at a load [N] and a speed [m/s], each with its uncertainty over beds; none where one has none."""
    found = [_tangent(fitted, theta, load, speed) for theta in (fitted.theta, *fitted.left_out)]
    if any(None in one for one in found):
        return []
    return [interval(float(column[0]), column[1:]) for column in np.array(found, dtype=float).T]


def _tangent(fitted: Fitted, theta: Any, load: float, speed: float) -> tuple[float | None, float | None, float | None]:
    """dF/dz, dF/dv and the depth where the law bears `load`; three None where it bears it at once, or never."""
    candidate, deepest = fitted.candidate, 10 * float(fitted.data.depth.max())
    depth = candidate.depth_at(theta, load, speed, deepest=deepest)
    if not depth:
        return None, None, None
    by, fast = 1e-4 * depth, 1e-4 * speed
    z = np.array([depth + by, depth - by, depth, depth])
    v = np.array([speed, speed, speed + fast, speed - fast])
    above, below, faster, slower = (float(force) for force in candidate.force(theta, z, v))
    return (above - below) / (2 * by), (faster - slower) / (2 * fast), depth


def _quantities(settings: LawFitSettings, pair: Fitted, own: Json, best: Json) -> dict[str, Json]:
    """The numbers to quote."""
    found: dict[str, Json] = {}
    for name, one in _fitted_parameters(pair).items():
        note = say("of_pair", found=one, bound="" if name in pair.candidate.free else say("is_bound"))
        unit, ends = _unit(pair.candidate, name), [one.low, one.high]
        found[name] = {"value": one.value, "std": one.std, "unit": unit, "note": note, "interval": ends}
    load = list(own["sinkage"])
    found["bed_spread"] = {"value": own["bed_spread"], "std": None, "unit": "1", "note": say("of_bed_spread")}
    found["bed_spread"]["interval"] = list(pair.bed_spread_interval)
    for key, entry in (("held_out_error", own), ("held_out_error_best", best)):
        note = say("of_held_out", law=entry["name"])
        out = entry["held_out"]
        found[key] = {"value": out["beds"], "std": out["beds_std"], "unit": "1", "note": note}
        found[key]["interval"] = out["interval"]
    if load:
        note = say("of_sinkage_error", one=load[0])
        error = {"value": load[0]["error"], "std": load[0]["error_std"], "unit": "1", "note": note}
        rms = {"value": load[0]["rms"], "std": None, "unit": "1", "note": say("of_sinkage_rms")}
        error["interval"], rms["interval"] = load[0]["interval"], load[0]["rms_interval"]
        found |= {"held_out_sinkage_error": error, "held_out_sinkage_rms": rms}
    if own["sinkage_range"] is not None:
        for key, value in zip(("load_least", "load_largest"), own["sinkage_range"], strict=True):
            note = say("of_load", percent=100 * settings.sinkage_error)
            found[key] = {"value": value, "std": None, "unit": "N", "note": note}
    return {name: one for name, one in found.items() if not math.isnan(one["value"])}
