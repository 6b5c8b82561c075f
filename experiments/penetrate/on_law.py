"""`hedgebed penetrate --ground ground.toml`: the runs of one seed on the law in a ground file, without a bed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from coupling import Penetration, Run
from experiments.platform.ground_file import fitted_ground, with_kept_ground
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of
from experiments.runs.version import __version__
from experiments.runs.whole_runs import publish
from rigid.checks.unfit import UnfitSettingsError
from rigid.ground_file import GroundFile

from .findings import mean_of, returned_work
from .settings import PenetrateSettings, say
from .units import Unit, make_run, make_spike, plan_units

__all__ = ["MOST_STEPS_ON_LAW", "StepsOnLaw", "fastest_speed", "law_step", "run_on_law", "without_rest"]

MOST_STEPS_ON_LAW = 2e6
"""Of the spike on a law, in all runs: some minutes, and 200 MB of rows; no more are made."""

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
