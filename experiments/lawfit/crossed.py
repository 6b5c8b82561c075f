"""Entries of result.json for all tips and gravities together: dimensionless laws, and K and C within the design."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.runs.progress import Progress
from experiments.runs.types import Json

from .data import Data
from .dimensionless import (
    CROSSED,
    CrossedData,
    CrossedLaw,
    cross,
    crossed_laws,
    shape_of,
    tangent_at,
)
from .fit import LawFit, fit_law, fit_usable
from .settings import say
from .trust import beyond, held_out, paired
from .words import ends_of, error_of, ranked

__all__ = ["Crossed", "crossed_result", "tangents_of"]

_LOADS = (0.25, 0.5, 1.0)
"""Loads of the table of tangents, over the mean force of a cell's drives at their ends [1]."""


@dataclass(frozen=True)
class Crossed:
    """The laws of all cells."""

    fits: dict[str, LawFit[CrossedLaw]]
    laws: list[Json]  # The best first
    tangents: list[Json]
    tables: list[Json]
    sentences: list[str]
    warnings: list[str]

    def columns(self) -> dict[str, NDArray[Any]]:
        """The rows that were fitted, without dimensions, and the force of each law there."""
        data = self.best.data
        assert isinstance(data, CrossedData)
        cells = list(dict.fromkeys(data.cell_of_row.tolist()))
        columns: dict[str, NDArray[Any]] = {
            "cell": np.array([cells.index(cell) for cell in data.cell_of_row]), "bed": data.bed_of_row,
            "depth": data.depth, "froude": data.rate, "inertial": data.inertial * data.rate,
            "force": data.force / data.weight,
        }  # fmt: skip
        return columns | {name: fit.predicted / data.weight for name, fit in self.fits.items()}

    @property
    def best(self) -> LawFit[CrossedLaw]:
        """The fit of the first law."""
        return self.fits[self.laws[0]["name"]]


def crossed_result(cells: Mapping[str, Data], progress: Progress) -> Crossed:
    """Fit every law of `experiments.lawfit.dimensionless` to all cells, and compare them."""
    data = cross(cells)
    candidates = crossed_laws(data)
    progress.stage("crossed laws", total=float(len(candidates)))
    fits, laws = {}, []
    for done, law in enumerate(candidates, 1):
        fits[law.name] = fit_usable(fit_law(law, data))
        laws.append(_entry(fits[law.name], data))
        progress.update(done)
    laws = _usable_first(laws)
    best = fits[laws[0]["name"]]
    tangents, missing = [], []
    for name, own in cells.items():
        rows, left = tangents_of(best, name, own)
        tangents += rows
        missing += left
    tables = [{"title": say("table_crossed"), **_law_rows(laws)}]
    tables.append({"title": say("table_tangents", law=best.candidate.name), **_tangent_rows(tangents)})
    bounds = [say("crossed_bound", law=law["name"], keys=", ".join(law["at_bound"])) for law in laws if law["at_bound"]]
    return Crossed(fits, laws, tangents, tables, _sentences(laws), [*_unlike_beds(cells), *missing, *bounds])


def _usable_first(laws: Sequence[Json]) -> list[Json]:
    """The laws in their order, but those with a parameter at a bound last."""
    usable = [law for law in laws if not law["at_bound"]] or list(laws)
    first = ranked(usable)
    rest = sorted((law for law in laws if law not in first), key=lambda law: float(law["held_out"]["beds"]))
    for law in rest:
        law["above_best"] = asdict(paired(law["held_out"]["of_beds"], first[0]["held_out"]["of_beds"]))
    return [*first, *rest]


def _unlike_beds(cells: Mapping[str, Data]) -> list[str]:
    """A warning if cells have different beds: an interval assumes that each cell has all beds."""
    beds = {name: set(data.beds) for name, data in cells.items()}
    fewest = min(beds, key=lambda name: len(beds[name]))
    every = set.union(*beds.values())
    return [say("unlike_beds", cell=fewest, own=len(beds[fewest]), all=len(every))] if beds[fewest] != every else []


def _entry(fitted: LawFit[CrossedLaw], data: CrossedData) -> Json:
    law = fitted.candidate
    static, rate = CROSSED[law.name]
    error = fitted.predicted - data.force
    by_cell = {
        cell: float(np.sqrt(np.mean(error[rows] ** 2) / np.mean(data.force[rows] ** 2)))
        for cell in dict.fromkeys(data.cell_of_row.tolist())
        if (rows := data.cell_of_row == cell).any()
    }
    return {
        "name": law.name, "static": static, "rate": rate if law.with_rate else None,
        "parameters": {name: asdict(fitted.parameter(name)) for name in law.free},
        "negative_rate": None if fitted.free_rate is None else asdict(fitted.free_rate),
        "at_bound": [name for name in law.free if fitted.at_bound(name)], "information": fitted.information,
        "held_out": held_out(fitted), "by_cell": by_cell,
        "beyond": {kind: asdict(one) for kind, one in beyond(fitted).items()},
        "gravity_out": _left_out(fitted, data, [f"{run.of.gravity:.6g}" for run in data.scaled]),
        "tip_out": _left_out(fitted, data, [f"{shape_of(run.of)} {run.of.diameter:g}" for run in data.scaled]),
    }  # fmt: skip


def _left_out(fitted: LawFit[CrossedLaw], data: CrossedData, groups: Sequence[str]) -> Json | None:
    """Error in each group of runs by the fit to all others; None where one is all there is, or has parameters alone."""
    names, square, total = list(dict.fromkeys(groups)), 0.0, 0.0
    if len(names) < 2:
        return None
    of_run = dict(zip((run.id for run in data.runs), groups, strict=True))
    for name in names:
        rest, out = (data.only(lambda run, name=name, own=own: (of_run[run.id] == name) == own)  # type: ignore[misc]
                     for own in (False, True))  # fmt: skip
        if CROSSED[fitted.candidate.name][0] in ("linear", "power") and set(out.shapes) - set(rest.shapes):
            return None
        theta = fit_law(fitted.candidate, rest, jackknife=False).theta
        square += float(np.sum((fitted.candidate.predict(theta, out) - out.force) ** 2))
        total += float(np.sum(out.force**2))
    return {"groups": names, "rms": float(np.sqrt(square / total))}


def tangents_of(fitted: LawFit[CrossedLaw], name: str, data: Data) -> tuple[list[Json], list[str]]:
    """K and C in one cell, at a few loads and at the slowest and the fastest speed, and a warning of those without."""
    of, rows, left = data.foundation, [], []
    largest = float(np.mean([run.force[-1] for run in data.runs if run.kind == "driven"] or [data.force.max()]))
    for load in (float(f"{share * largest:.2g}") for share in _LOADS):
        for speed in dict.fromkeys((data.speeds[0], data.speeds[-1])):
            found = tangent_at(fitted, of, load, speed)
            if found is not None and found.depth.value <= float(data.depth.max()):
                where = {"tip": of.tip, "diameter": of.diameter, "gravity": of.gravity}
                rows.append({"cell": name, **where, "law": fitted.candidate.name, **asdict(found)})
            else:
                left.append(f"{load:g} N, {speed:.3g} m/s")
    law = fitted.candidate.name
    return rows, [say("no_tangent", cell=name, law=law, where="; ".join(left))] if left else []


def _law_rows(laws: Sequence[Json]) -> Json:
    rows = []
    for law in laws:
        above, own = law["above_best"], law["held_out"]
        beyond_both = [law["beyond"].get(kind) for kind in ("speed", "depth")]
        rows.append([
            law["name"] + (" *" if law["at_bound"] else ""),
            f"{100 * own['beds']:.3g} % ({ends_of(own['interval'])})",
            "-" if law is laws[0] else f"{100 * above['value']:+.2g} ± {50 * (above['high'] - above['low']):.2g} %",
            *("-" if one is None else f"{100 * one['rms']:.3g} %" for one in (law["gravity_out"], law["tip_out"])),
            *("-" if one is None else error_of(one["error"], one["interval"]) for one in beyond_both),
        ])  # fmt: skip
    keys = ("law", "beds", "above", "gravity_out", "tip_out", "faster", "deeper")
    return {"head": [say(f"head_{key}") for key in keys], "rows": rows}


def _tangent_rows(tangents: Sequence[Json]) -> Json:
    rows = []
    for row in tangents:
        texts = [f"{row[key]['value']:.3g} ({row[key]['low']:.3g} to {row[key]['high']:.3g})"
                 for key in ("stiffness", "damping")]  # fmt: skip
        where = [f"{row['load']:.3g} N", f"{row['speed']:.3g} m/s", f"{1e3 * row['depth']['value']:.3g} mm"]
        rows.append([row["cell"], *where, *texts])
    keys = ("cell", "load", "speed", "depth", "stiffness", "damping")
    return {"head": [say(f"head_{key}") for key in keys], "rows": rows}


def _sentences(laws: Sequence[Json]) -> list[str]:
    best, naive = laws[0], next(law for law in laws if law["name"] == "one-pair")
    numbers = {"best": best["name"], "own": 100 * best["held_out"]["beds"], "one": 100 * naive["held_out"]["beds"]}
    said = [say("crossed_best", **numbers)]
    alike = [law["name"] for law in laws[1:] if law["above_best"]["low"] <= 0]
    if alike:
        said.append(say("crossed_alike", laws="; ".join(alike)))
    additive = [next((law for law in laws if law["name"] == f"power-{rate}"), None) for rate in ("square", "early")]
    if all(additive):
        square, early = (100 * law["held_out"]["beds"] for law in additive if law is not None)
        said.append(say("crossed_roth", square=square, early=early))
    return said
