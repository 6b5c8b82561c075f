"""What `hedgebed bed test plates` says: the table, the fit of 3D-RFT, other shapes beside it, the files."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from experiments.penetrate.fit import spread
from experiments.runs.types import Json
from rigid.ground.rft import function_of
from rigid.ground.rft_table import RFT_FORMAT, Pieces, RftTable
from rigid.intervals import half_width

from .plates_fit import Fit, fit_of, measured_force, predicted_force
from .settings import say
from .test_settings import BedPlatesSettings
from .tests import of_beds, quantity, table

__all__ = ["FUNCTION_FILE", "TABLE_FILE", "result_of"]

TABLE_FILE, FUNCTION_FILE = "rft.json", "rft_force.py"
TERMS = (1, 2, 3)  # fitted numbers: xi; xi and b; xi_1, xi_2 and xi_3
GOAL = 0.15  # error of a shape that was not seen [1], above which a warning says so
FINE = 10.0  # grains across a plate from which its size hardly counts


def result_of(settings: BedPlatesSettings, runs: list[Json], surfaces: Mapping[str, Pieces], friction: float) -> Json:
    """Title, quantities, tables, warnings and files of the finished `runs`.

    `surfaces`: pieces of each body by its name; `friction`: of grains and bodies.
    """
    runs = [run | {"bed": run["id"].rpartition("-")[0]} for run in runs]
    plates = [run for run in runs if run["beta"] is not None]
    fits = {terms: fit_of(plates, surfaces, friction, terms=terms) for terms in TERMS}
    terms = min(fits, key=lambda count: (fits[count].unseen, count))
    fit = fits[terms]
    rows = [_row(own, surfaces, fit, friction) for own in _alike(plates)]
    others = [_row(own, surfaces, fit, friction) for own in _alike([run for run in runs if run["beta"] is None])]
    errors = [row["error"] for row in others]
    shapes = (float(np.sqrt(np.mean(np.square(errors)))), max(errors)) if errors else None
    kept = _table(settings, plates, surfaces, fit, friction, shapes)
    of = partial(quantity, runs)
    law = {
        f"gradient_{k + 1}": {"value": fit.factors[k], "std": fit.stds[k] or None, "unit": "N/m3", "note": note}
        for k, note in enumerate(say(f"gradient_{k}") for k in (1, 2, 3))
    }
    quantities = law | {
        "downward": {"value": fit.factors[3], "std": fit.stds[3] or None, "unit": "1", "note": say("downward")},
        "terms": _number(terms, say("terms")),
        "seen_error": _number(fit.seen, say("seen_error")),
        "unseen_error": _number(fit.unseen, say("unseen_error")),
        **{f"unseen_error_{n}": _number(fits[n].unseen, say("unseen_error_n", terms=n)) for n in TERMS},
    }  # fmt: skip
    if shapes:
        worst = max(others, key=lambda row: row["error"])
        quantities |= {
            "shape_error": _number(shapes[0], say("shape_error")),
            "shape_error_worst": _number(worst["error"], f"{worst['body']}, gamma = {worst['gamma']:g} degrees"),
        }
    quantities |= {"speed": of("speed", "m/s", "of the bodies")} | of_beds(runs, "grains of a bed")
    tables = [table(say("table_title"), rows, _PLATE_COLUMNS | _COLUMNS)]
    if others:
        tables.append(table(say("shapes_title"), others, _SHAPE_COLUMNS | _COLUMNS))
    return {
        "title": say("plates_title", material=runs[0]["material"], side=1e3 * settings.side, runs=len(runs)),
        "quantities": quantities,
        "tables": tables,
        "plates": rows,
        "shapes": others,
        "warnings": _warnings(settings, runs, fit, others),
        "files": {
            TABLE_FILE: kept.to_json(),
            FUNCTION_FILE: function_of(kept.factors, friction, kept.material, kept.speed),
        },
    }


def _number(value: float, note: str) -> Json:
    return {"value": value, "std": None, "unit": "1", "note": note}


def _alike(runs: list[Json]) -> list[list[Json]]:
    """The runs of each body and direction, of all beds."""
    found: dict[tuple[str, float], list[Json]] = {}
    for run in runs:
        found.setdefault((run["body"], run["gamma"]), []).append(run)
    return list(found.values())


def _row(own: list[Json], surfaces: Mapping[str, Pieces], fit: Fit, friction: float) -> Json:
    """One body and direction: mean force over beds [N], its standard deviation, what the law says, stress per depth."""
    measured = np.array([measured_force(run) for run in own])
    mean = measured.mean(axis=0)
    pieces = surfaces[own[0]["body"]]
    law = np.mean([predicted_force(fit.factors, friction, run, pieces) for run in own], axis=0)
    depths = [float(np.mean([row[0] for row in run["samples"]])) for run in own]
    between = [spread(measured[:, k].tolist()) for k in (0, 2)]
    return {
        "body": own[0]["body"], "beta": own[0]["beta"], "gamma": own[0]["gamma"], "beds": len(own),
        "force_x": float(mean[0]), "force_z": float(mean[2]), "std_x": between[0], "std_z": between[1],
        "law_x": float(law[0]), "law_z": float(law[2]), "depth": float(np.mean(depths)),
        "error": float(np.linalg.norm(law - mean) / np.linalg.norm(mean)),
        "size_ratio": float(np.linalg.norm(law) / np.linalg.norm(mean)),
    }  # fmt: skip


def _table(
    settings: BedPlatesSettings,
    plates: list[Json],
    surfaces: Mapping[str, Pieces],
    fit: Fit,
    friction: float,
    shapes: tuple[float, float] | None,
) -> RftTable:
    one = plates[0]
    entries = []
    for own in _alike(plates):
        row = _row(own, surfaces, fit, friction)
        per = 1.0 / (settings.side**2 * row["depth"])  # area and depth of the middle
        beds = len(own)
        error_x, error_z = ((row[key] or float("nan")) * per / beds**0.5 for key in ("std_x", "std_z"))
        entry = {
            "beta": row["beta"], "gamma": row["gamma"], "stress_x": row["force_x"] * per,
            "stress_z": row["force_z"] * per, "fitted_x": row["law_x"] * per, "fitted_z": row["law_z"] * per,
        }  # fmt: skip
        if beds > 1:
            entry |= {"error_x": error_x, "error_z": error_z}
        entries.append(entry)
    return RftTable(
        format=RFT_FORMAT, material=one["material"], source="hedgebed bed test plates", gravity=one["gravity"],
        grain=one["grain"], bulk_density=float(np.mean([run["packing_fraction"] for run in plates])) * one["density"],
        surface_friction=friction, factors=fit.factors, stds=fit.stds, left_out=fit.left_out, unseen=fit.unseen,
        shape_errors=shapes,
        depth=(settings.shallow * settings.depth, settings.depth), side=settings.side, speed=one["speed"],
        plates=tuple(entries), notes=(say("no_history", speed=one["speed"], inertial=_inertial(settings, one)),),
    )  # fmt: skip


def _inertial(settings: BedPlatesSettings, run: Json) -> float:
    """Inertial number of a run [1], as `BedPlatesSettings.inertial_number` has it."""
    head = 0.5 * run["packing_fraction"] * run["gravity"] * settings.side  # pressure over the grains' density
    return float(run["speed"] / settings.side * run["grain"] / head**0.5)


def _warnings(settings: BedPlatesSettings, runs: list[Json], fit: Fit, others: list[Json]) -> list[str]:
    said = []
    across = settings.side / runs[0]["grain"]
    if across < FINE:
        said.append(say("coarse_plate", across=across))
    if len(fit.left_out) < 3:
        said.append(say("few_plate_beds", beds=max(1, len(fit.left_out))))
    for row in others:
        if row["error"] > GOAL:
            more = "more" if row["size_ratio"] > 1 else "less"
            said.append(say("shape_missed", row=row, error=100 * row["error"], more=more,
                            ratio=100 * abs(row["size_ratio"] - 1)))  # fmt: skip
    return said


def _with_error(row: Json, axis: str) -> str:
    """The mean force over the beds with half of its 95 % interval."""
    half = half_width(row[f"std_{axis}"], row["beds"])
    return f"{row[f'force_{axis}']:.3g}" + ("" if half is None else f" ± {half:.2g}")


_PLATE_COLUMNS = {
    "beta [degrees]": lambda row: f"{row['beta']:g}",
    "gamma [degrees]": lambda row: f"{row['gamma']:g}",
}
_SHAPE_COLUMNS = {"shape": lambda row: str(row["body"]), "gamma [degrees]": lambda row: f"{row['gamma']:g}"}
_COLUMNS = {
    "force x [N]": lambda row: _with_error(row, "x"),
    "force z [N]": lambda row: _with_error(row, "z"),
    "predicted x": lambda row: f"{row['law_x']:.3g}",
    "predicted z": lambda row: f"{row['law_z']:.3g}",
    "difference": lambda row: f"{100 * row['error']:.0f} %",
}
