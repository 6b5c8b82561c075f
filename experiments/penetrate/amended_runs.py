"""`hedgebed penetrate --model FILE`: the law with what it lacked, beside the bed and the plain spring-damper.

With a bed, every run of it is made on the law as well. Without one (``--ground spring-damper``), the runs of one seed
are made on the model's own K and C alone, and on the law.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from coupling import Penetration
from experiments.campaign.files import MODEL_COPY, keep_model
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of
from experiments.runs.types import Json
from experiments.runs.version import __version__
from experiments.runs.whole_runs import publish

from .amended import AmendedLaw, read_law
from .settings import PenetrateSettings, say
from .units import Unit, make_run, make_spike, plan_units

__all__ = ["Beside", "kept_law", "run_beside", "run_without_bed"]

_ROWS = 400
"""Macro steps in which the fastest run passes the driven depth, where no bed says how long a step is."""

Runs = Mapping[str, Penetration]


@dataclass(frozen=True)
class Beside:
    """The runs on the law, and what is said of them."""

    runs: Runs
    quantities: dict[str, Json]
    sentences: list[str]

    def entries(self, entries: Sequence[Json]) -> list[Json]:
        """The entry "runs" with this law's series and numbers."""
        found = []
        for entry in entries:
            numbers = {f"amended_{name}": value for name, value in self.runs[entry["id"]].quantities().items()}
            found.append(
                entry
                | {"amended_series": f"series/{entry['id']}.amended.csv", "quantities": entry["quantities"] | numbers}
            )
        return found


def kept_law(settings: PenetrateSettings, folder: Path) -> AmendedLaw | None:
    """The law of the model that the folder keeps; None where there is none."""
    return None if settings.model is None else read_law(folder / MODEL_COPY, settings)


def run_beside(law: AmendedLaw, units: Sequence[Unit], beds: Runs, models: Runs, folder: RunFolder) -> Beside:
    """Make every run of the bed on the law and keep its series.

    `models` are the same runs on the spring-damper that was fitted to the bed.
    """
    runs = {unit.id: law.run(unit, beds[unit.id] if unit.kind == "driven" else models[unit.id]) for unit in units}
    for name, series in runs.items():
        folder.write_series(f"{name}.amended", series.columns())
    driven = [unit.id for unit in units if unit.kind == "driven"]
    plain, amended = (_gap(driven, beds, others) for others in (models, runs))
    note = "rms difference over the bed's rms force, driven runs, in, at rest and out"
    quantities: dict[str, tuple[float | None, str, str]] = {
        "force_gap_spring_damper": (plain, "1", note),
        "force_gap_amended": (amended, "1", f"the same with {law.words}"),
        "sinkage_amended": (_rest(units, runs), "m", f"depth at rest with {law.words}"),
        "work_returned_amended": (_returned(driven, runs), "1", "work of the way out over work in, driven"),
    }
    sentences = []
    if plain is not None and amended is not None:
        sentences.append(say("off_by", law=law, amended=100 * amended, plain=100 * plain))
    return Beside(runs, quantities_of(quantities, std=None), sentences)


def run_without_bed(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> Result:
    """The runs of the first seed on the model's K and C, and on the law; write and return the result."""
    with folder.lock():
        keep_model(settings.model, folder.path)
        law = kept_law(settings, folder.path)
        assert law is not None  # the settings see to it
        units = plan_units(settings.model_copy(update={"seeds": settings.seeds[:1]}))
        progress.stage("spring-damper", total=float(len(units)))
        plain, runs = {}, {}
        fastest = max(*settings.speeds, *settings.drop_speeds, settings.retreat_speed)
        step = settings.time_step or settings.depth / fastest / _ROWS / settings.substeps
        for done, unit in enumerate(units, 1):
            plain[unit.id] = make_run(settings, unit, law.plain(step)).run()
            runs[unit.id] = law.run(unit, plain[unit.id])
            folder.write_series(unit.id, plain[unit.id].columns())
            folder.write_series(f"{unit.id}.amended", runs[unit.id].columns())
            progress.update(done)
        driven = [unit.id for unit in units if unit.kind == "driven"]
        stiffness, damping = law.pair
        found: dict[str, tuple[float | None, str, str]] = {
            "stiffness": (stiffness, "N/m", "of the model"),
            "damping": (damping, "N s/m", "of the model"),
            "load": (settings.weight, "N", "on the spike, set down and dropped"),
            "sinkage_spring_damper": (_rest(units, plain), "m", "depth at rest under the load"),
            "sinkage_amended": (_rest(units, runs), "m", f"depth at rest with {law.words}"),
            "work_returned_spring_damper": (_returned(driven, plain), "1", "work out over work in, driven"),
            "work_returned_amended": (_returned(driven, runs), "1", f"the same with {law.words}"),
        }
        made = Result.make(
            "penetrate",
            ground=settings.ground,
            version=__version__,
            title=f"A {1e3 * settings.tip_diameter:g} mm spike on the spring-damper, and with {law.words}",
            quantities=quantities_of(found, std=None),
            runs=[_entry(unit, plain[unit.id], runs[unit.id]) for unit in units],
            spike=asdict(make_spike(settings)) | {"load": settings.weight},
            model={"file": settings.model, "effects": list(law.effects)},
            departures={"sentences": _spike_words(settings, law)},
            warnings=law.warnings(),
        )
        return publish(folder, made, progress)


def _spike_words(settings: PenetrateSettings, law: AmendedLaw) -> list[str]:
    falls = f"; a drop moves {settings.mass:g} kg under {settings.weight:.4g} N" if settings.drop_speeds else ""
    spike = say("model_spike", s=settings, tip_mm=1e3 * settings.tip_diameter, falls=falls)
    return [spike, *([f"The model was fitted to {law.fitted_to}."] if law.fitted_to else [])]


def _entry(unit: Unit, plain: Penetration, amended: Penetration) -> Json:
    numbers = {f"model_{name}": value for name, value in plain.quantities().items()}
    numbers |= {f"amended_{name}": value for name, value in amended.quantities().items()}
    return {
        "id": unit.id,
        "kind": unit.kind,
        "seed": None,
        "speed": unit.speed,
        "model_series": f"series/{unit.id}.csv",
        "amended_series": f"series/{unit.id}.amended.csv",
        "ended": amended.ended,
        "quantities": numbers,
    }


def _rest(units: Sequence[Unit], runs: Runs) -> float | None:
    known = [runs[unit.id].resting_depth for unit in units if unit.kind == "set_down"]
    depths = [depth for depth in known if depth is not None]
    return float(np.mean(depths)) if depths else None


def _returned(driven: Sequence[str], runs: Runs) -> float | None:
    shares = [runs[name].work_out / runs[name].work_in for name in driven if runs[name].work_in > 0]
    return float(np.mean(shares)) if shares else None


def _gap(driven: Sequence[str], beds: Runs, others: Runs) -> float | None:
    """Rms difference over the bed's rms force, rows below the surface, every run weighing the same."""
    square = drag = 0.0
    for name in driven:
        bed, other = beds[name], others[name]
        rows = bed.depth > 0
        if rows.any():
            force = np.interp(bed.time, other.time, other.force)  # steps of other seeds' beds differ in the sixth digit
            square += float(np.mean((force[rows] - bed.force[rows]) ** 2))
            drag += float(np.mean(bed.force[rows] ** 2))
    return float(np.sqrt(square / drag)) if drag > 0 else None
