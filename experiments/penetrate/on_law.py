"""`hedgebed penetrate` without a bed: the runs of one seed on the law in a ground file, or on that of a model.toml.

On a model (``--ground spring-damper``) they are made on its base model, fitted without effects, and on the law.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from coupling import Penetration, Run
from experiments.campaign.files import keep_model
from experiments.platform.ground_file import fitted_ground, with_kept_ground
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of
from experiments.runs.version import __version__
from experiments.runs.whole_runs import publish
from rigid.checks.unfit import UnfitSettingsError
from rigid.ground_file import GroundFile

from .amended import AmendedLaw, amended_numbers, kept_law, read_law, rest_of, returned_by
from .findings import mean_of, returned_work
from .settings import PenetrateSettings, say
from .sure.other_forms import kept_others
from .sure.peak import peak_error, returned_std, with_fit_errors
from .units import Unit, make_run, make_spike, plan_units

__all__ = [
    "MOST_STEPS_ON_LAW",
    "StepsOnLaw",
    "fastest_speed",
    "law_step",
    "run_on_law",
    "run_without_bed",
    "without_rest",
]

MOST_STEPS_ON_LAW = 2e6
"""Of the spike on a law, in all runs: some minutes, and 200 MB of rows; no more are made."""

_LOST = 0.9
"""Share of the largest force of a push below which a law that falls further on is warned of."""
_ROWS = 400
"""Macro steps in which the fastest run passes the driven depth, where no bed says how long a step is."""


def law_step(settings: PenetrateSettings) -> float:
    """Step of a law that has no step of its own [s]: `time_step`, or so that a run has some hundred rows."""
    return settings.time_step or settings.depth / fastest_speed(settings) / _ROWS / settings.substeps


def fastest_speed(settings: PenetrateSettings) -> float:
    """Of the runs on a law [m/s]: those of one seed."""
    return max(*settings.speeds, *settings.drop_speeds, settings.retreat_speed)


@dataclass
class StepsOnLaw:
    """The steps of all runs on a law, as they are made. How long a drop or a set-down lasts is not known before."""

    settings: PenetrateSettings
    made: int = 0  # In the runs that are over

    def run(self, unit: Unit, run: Run) -> Penetration:
        """Make a run to its end. Raises UnfitSettingsError past `MOST_STEPS_ON_LAW`."""

        def count(run: Run) -> None:
            if self.made + run.count > MOST_STEPS_ON_LAW and not run.done:
                keys = {"drop": "drop_time or after_stop", "set_down": "lowering_speed"}
                told = {"time": run.time, "step": run.macro_step, "fastest": fastest_speed(self.settings)}
                by = keys.get(unit.kind, "speeds")
                raise UnfitSettingsError(say("lasts_on_law", unit=unit, **told, most=MOST_STEPS_ON_LAW, by=by))

        series = run.run(on_step=count)
        self.made += run.count
        return series


def run_on_law(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> Result:
    """Drive, drop and set down the spike on the law; write and return the result.

    Raises ValueError for a file that cannot be read, UnfitSettingsError for runs that last too long.
    """
    with folder.lock():
        fitted = fitted_ground(with_kept_ground(settings, folder.path).ground)
        assert fitted is not None  # the settings see to it
        units = plan_units(settings.model_copy(update={"seeds": settings.seeds[:1]}))
        progress.stage(fitted.law, total=float(len(units)))
        runs: dict[str, Penetration] = {}
        steps = StepsOnLaw(settings)
        for done, unit in enumerate(units, 1):
            runs[unit.id] = steps.run(unit, make_run(settings, unit, fitted.ground(time_step=law_step(settings))))
            folder.write_series(unit.id, runs[unit.id].columns())
            progress.update(done)
        set_down = [runs[unit.id].resting_depth for unit in units if unit.kind == "set_down"]
        returned = [returned_work(runs[unit.id]) for unit in units if unit.kind == "driven"]
        found: dict[str, tuple[float | None, str, str]] = {
            "load": (settings.weight, "N", "on the spike, set down and dropped"),
            "sinkage_law": (mean_of(set_down), "m", "depth at rest under the load"),
            "work_returned_law": (mean_of(returned), "1", "work out over work in, driven"),
        }
        fitted_to = {
            parameter.name: {
                "value": fitted.parameters[parameter.name].value,
                "std": fitted.parameters[parameter.name].std,
                "unit": parameter.unit,
                "note": f"of the file; {parameter.summary}",
            }
            for parameter in fitted.surface_law.parameters
        }
        made = Result.make(
            "penetrate",
            ground=fitted.law,
            ground_file=fitted.model_dump(),
            version=__version__,
            title=f"A {settings.body_words} on the law {fitted.law} of {fitted.material}",
            quantities=quantities_of(found, std=None) | fitted_to,
            runs=[_entry(unit, runs[unit.id]) for unit in units],
            spike=asdict(make_spike(settings)) | {"load": settings.weight},
            departures={"sentences": [say("of_file", fitted=fitted)]},
            warnings=_warnings(settings, fitted, units, runs),
        )
        return publish(folder, made, progress)


def _entry(unit: Unit, run: Penetration) -> dict[str, object]:
    numbers = {f"model_{name}": value for name, value in run.quantities().items()}
    return {
        "id": unit.id, "kind": unit.kind, "seed": None, "speed": unit.speed, "model_series": f"series/{unit.id}.csv",
        "ended": run.ended, "quantities": numbers,
    }  # fmt: skip


def _warnings(
    settings: PenetrateSettings, fitted: GroundFile, units: list[Unit], runs: dict[str, Penetration]
) -> list[str]:
    """Where the spike or a run is outside the range of the law, and runs that did not come to rest."""
    said = fitted.beyond(gravity=settings.gravity, diameter=settings.tip_diameter)
    if settings.tip != fitted.foot.tip:
        said.append(say("tip_of_file", s=settings, fitted=fitted))
    fastest = {unit.id: _speed(runs[unit.id]) for unit in units}
    worst = {
        "load": max((run.peak_force, name) for name, run in runs.items()),
        "depth": max((run.max_depth, name) for name, run in runs.items()),
        "speed": max((speed, name) for name, speed in fastest.items()),
    }
    for key, (value, name) in worst.items():
        said += [f"{name}: {text}" for text in fitted.beyond(**{key: max(value, fitted.range[key][0])})]
    slowest, name = min((fastest[unit.id], unit.id) for unit in units if unit.kind == "driven")
    said += [f"{name}: {text}" for text in fitted.beyond(speed=min(slowest, fitted.range["speed"][1]))]
    return [*said, *without_rest(settings, units, runs, "the law")]


def without_rest(
    settings: PenetrateSettings, units: Sequence[Unit], runs: Mapping[str, Penetration], law: str
) -> list[str]:
    """Why a set-down on `law` has no sinkage, a sentence each; none where all came to rest."""
    found = []
    for unit in units:
        run = runs[unit.id]
        if unit.kind == "set_down" and run.resting_depth is None:
            how = "deep" if run.ended == "max_depth" else "slow"
            found.append(say(f"no_rest_{how}", law=law, s=settings, reached=1e3 * run.max_depth, lasted=run.time[-1]))
    return found


def _speed(run: Penetration) -> float:
    """Largest speed at which the tip goes in [m/s]; 0 where it never does."""
    inside = run.depth > 0
    return float(run.velocity[inside].max()) if inside.any() else 0.0


def run_without_bed(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> Result:
    """The runs of the first seed on the base model's spring-damper, and on the law; write and return the result."""
    with folder.lock():
        keep_model(settings.model, folder.path)
        law = kept_law(settings, folder.path)
        assert law is not None  # the settings see to it
        source = Path(str(settings.model)).parent
        others = kept_others(law, source, folder.path, lambda path: read_law(path, settings))
        units = plan_units(settings.model_copy(update={"seeds": settings.seeds[:1]}))
        progress.stage("spring-damper", total=float(len(units)))
        plain, runs = {}, {}
        step, steps = law_step(settings), StepsOnLaw(settings)
        for done, unit in enumerate(units, 1):
            plain[unit.id] = steps.run(unit, make_run(settings, unit, law.plain(step)))
            runs[unit.id] = law.run(unit, plain[unit.id], steps.run)
            folder.write_series(unit.id, plain[unit.id].columns())
            folder.write_series(f"{unit.id}.amended", runs[unit.id].columns())
            progress.update(done)
        (stiffness, damping), (plain_stiffness, plain_damping) = law.pair, law.pair_without_effects
        under = f"of the set-down: depth at rest under the load of {settings.weight:.3g} N"
        beside = f"with {law.words}" if law.effects else "without effects"
        of_plain = "of the spring-damper fitted without effects" if law.has_base else say("no_base_fit")
        found: dict[str, tuple[float | None, str, str]] = _peaks(settings, units, plain, runs, law) | {
            "stiffness": (stiffness, "N/m", f"of the model {beside}"),
            "damping": (damping, "N s/m", f"of the model {beside}"),
            "stiffness_spring_damper": (plain_stiffness, "N/m", of_plain),
            "damping_spring_damper": (plain_damping, "N s/m", of_plain),
            "load": (settings.weight, "N", "on the spike, set down and dropped"),
            "sinkage_spring_damper": (rest_of(units, plain), "m", under),
            "sinkage_amended": (rest_of(units, runs), "m", f"{under}, with {law.words}"),
            "work_returned_spring_damper": (returned_by(units, plain), "1", "work out over work in, driven"),
            "work_returned_amended": (returned_by(units, runs), "1", f"the same with {law.words}"),
        }
        if settings.load is None:  # nothing was set down
            found = {name: own for name, own in found.items() if not name.startswith(("sinkage", "load"))}
        falls = f"; a drop moves {settings.mass:g} kg under {settings.weight:.4g} N" if settings.drop_speeds else ""
        spike = say("model_spike", s=settings, tip_mm=1e3 * settings.tip_diameter, falls=falls)
        fitted = [f"The model was fitted to {law.fitted_to}."] if law.fitted_to else []
        which = "compared" if law.has_base else "compared_inflated"
        compared = [say(which, law=law, plain=plain_stiffness)] if law.effects else []
        peaked = {name: plain[id] for name, id in _peaked(units).items()}
        errors = {name: peak_error(law, like) for name, like in peaked.items()}
        returned = returned_std(law, list(peaked.values())) if law.saw_withdrawal else None
        made = Result.make(
            "penetrate",
            ground=settings.ground,
            version=__version__,
            title=f"A {settings.body_words} on the spring-damper, and with {law.words}",
            quantities=with_fit_errors(quantities_of(found, std=None), law.own_errors, errors, returned),
            runs=[_amended_entry(unit, plain[unit.id], runs[unit.id]) for unit in units],
            spike=asdict(make_spike(settings)) | {"load": settings.weight},
            model={"file": settings.model, "effects": list(law.effects), "other_forms": others.peaks(peaked)},
            departures={"sentences": [spike, *fitted, *compared]},
            warnings=[
                *law.warnings(),
                *others.warnings,
                *(text for unit in units if unit.kind == "driven" for text in _force_lost(runs[unit.id])),
                *without_rest(settings, units, plain, "the spring-damper"),
                *without_rest(settings, units, runs, f"the law with {law.words}"),
            ],
        )
        return publish(folder, made, progress)


def _force_lost(run: Penetration) -> list[str]:
    """That the force of a law falls by a tenth or more while the tip still goes deeper, in a sentence; else none."""
    deepest = int(np.argmax(run.depth))
    highest = int(np.argmax(run.force[: deepest + 1]))
    high, low = float(run.force[highest]), float(run.force[highest : deepest + 1].min())
    if low > _LOST * high:
        return []
    depths = [1e3 * float(run.depth[place]) for place in (highest, deepest)]
    return [say("force_lost", high=high, low=low, at_mm=depths[0], to_mm=depths[1])]


def _amended_entry(unit: Unit, plain: Penetration, run: Penetration) -> dict[str, object]:
    return _entry(unit, plain) | {
        "amended_series": f"series/{unit.id}.amended.csv", "ended": run.ended,
        "quantities": {f"model_{name}": value for name, value in plain.quantities().items()} | amended_numbers(run),
    }  # fmt: skip


def _peaked(units: Sequence[Unit]) -> dict[str, str]:
    """Name of the peak force on the law -> id of its push; with the speed where there are several."""
    driven = [unit for unit in units if unit.kind == "driven"]
    return {f"peak_force_amended{f'@{unit.speed:g}' if len(driven) > 1 else ''}": unit.id for unit in driven}


def _peaks(
    settings: PenetrateSettings,
    units: Sequence[Unit],
    plain: Mapping[str, Penetration],
    runs: Mapping[str, Penetration],
    law: AmendedLaw,
) -> dict[str, tuple[float | None, str, str]]:
    """Peak forces [N] of the pushes on the spring-damper and on the law, for each speed where there are several."""
    speeds = {unit.id: unit.speed for unit in units}
    found: dict[str, tuple[float | None, str, str]] = {}
    for name, id in _peaked(units).items():
        path = f"push to {1e3 * settings.depth:.3g} mm at {1e3 * speeds[id]:.3g} mm/s"
        found[name] = (runs[id].peak_force, "N", f"{path}, with {law.words}")
        found[name.replace("amended", "spring_damper")] = (plain[id].peak_force, "N", path)
    return found
