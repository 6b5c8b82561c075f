"""Which experiments there are. A further one is one line in `EXPERIMENTS`, one settings class and one module.

The module of an experiment offers
``run(settings, folder: Path, *, progress: Progress) -> dict`` (the result, as result.json has it) and
``resume(folder: Path, *, progress: Progress) -> dict``;
if it also has ``check(settings) -> None``, that is called before a folder is made and raises ValueError for what
the settings class cannot see; if it has ``fingerprint() -> str``, a digest of what computes, run.toml keeps it.
Both names are text here so that help does not wait for Taichi.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from experiments.runs.headline import Headline

__all__ = ["EXPERIMENTS", "Experiment", "Preset", "face", "find_experiment"]

CASES = Path(__file__).parents[1] / "cases"


@dataclass(frozen=True)
class Preset:
    """A case that has an option of its own: ``--<option>`` lays it under the case file and the command line."""

    option: str
    case: str  # a file in experiments/cases
    summary: str


@dataclass(frozen=True)
class Experiment:
    """One experiment: its name on the command line, one line of help, and where its settings and its code are."""

    name: str
    """On the command line; a second word makes it a command of the experiment that is called by the first."""
    summary: str
    settings: str  # "module:Class", a frozen pydantic model; every field with a description that gives the unit
    module: str
    presets: tuple[Preset, ...] = ()
    subject: str = ""
    """The setting that the command's first argument is (its first two, of a setting of two), instead of a case file."""
    example: str = ""
    """Of what has no default because its case is the question: one that ships, a file in experiments/cases."""
    headline: str = ""
    """"module:function" from a result to the `Headline` that is shown in the end; all there is where it is empty."""

    def settings_class(self) -> type[BaseModel]:
        """The settings class. Quick: it imports no Taichi."""
        module, _, name = self.settings.partition(":")
        return getattr(import_module(module), name)

    def run(self, settings: BaseModel, folder: Path, *, progress: Any) -> dict[str, Any]:
        """Run it into `folder`; return the result."""
        return import_module(self.module).run(settings, folder, progress=progress)

    def resume(self, folder: Path, *, progress: Any) -> dict[str, Any]:
        """Finish the run in `folder`; return the result."""
        return import_module(self.module).resume(folder, progress=progress)

    def headline_of(self, result: dict[str, Any]) -> Headline | None:
        """The short form of a result; None where it is shown in full."""
        module, _, name = self.headline.partition(":")
        return getattr(import_module(module), name)(result) if module else None

    def code(self) -> str:
        """The module's ``fingerprint()`` of the code that computes, empty where it has none."""
        fingerprint: Callable[[], str] | None = getattr(import_module(self.module), "fingerprint", None)
        return fingerprint() if fingerprint is not None else ""

    def check(self, settings: BaseModel) -> None:
        """Raise ValueError for settings that cannot be run, before any work."""
        check: Callable[[BaseModel], None] | None = getattr(import_module(self.module), "check", None)
        if check is not None:
            check(settings)


EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in [
        Experiment(
            "penetrate",
            "How far a spike sinks into a bed, what the bed pushes back with, and how wrong the spring-damper is.",
            settings="experiments.penetrate.settings:PenetrateSettings",
            module="experiments.penetrate.experiment",
            headline="experiments.penetrate.headline:penetrate_headline",
            presets=(
                Preset(
                    "full",
                    "penetrate-full.toml",
                    "Start from the fine case: overlaps of at most 1 %, ten grains across, slower speeds, all seeds.",
                ),
            ),
        ),
        Experiment(
            "hop",
            "The wheel speed that a hop over a distance takes, or how far one goes; launch, flight, escape.",
            settings="experiments.hop.settings:HopSettings",
            module="experiments.hop.experiment",
        ),
        Experiment(
            "tumble",
            "One trial of a platform on spikes that a flywheel turns over: pivot, slip, hop.",
            settings="experiments.tumble.settings:TumbleSettings",
            module="experiments.tumble.experiment",
        ),
        Experiment(
            "tumble spatial",
            "A platform in six degrees of freedom, driven or thrown, on a bed of grains or on the spring-damper.",
            settings="experiments.spatial.settings:SpatialSettings",
            module="experiments.spatial.experiment",
        ),
        Experiment(
            "paper",
            "Redoes Figures 5 to 8 of the paper beside what its text states in numbers.",
            settings="experiments.paper.settings:PaperSettings",
            module="experiments.paper.experiment",
        ),
        Experiment(
            "campaign",
            "Makes up a campaign of tumbles: every gravity and torque, recorded by noisy sensors, and what is true.",
            settings="experiments.tumble.campaign_settings:CampaignSettings",
            module="experiments.tumble.synthesis",
        ),
        Experiment(
            "campaign check",
            "Is a campaign fit to be diagnosed? Every fault by file and line, a table of its trials, plots of what is "
            "in it.",
            settings="experiments.check.settings:CheckSettings",
            module="experiments.diagnose.inspection",
            subject="campaign",
        ),
        Experiment(
            "diagnose",
            "Measured trials: where the model fails, which effect it lacks, how sure that is, and the gap it closes.",
            settings="experiments.diagnose.settings:DiagnoseSettings",
            module="experiments.diagnose.experiment",
            subject="campaign",
        ),
        Experiment(
            "compare",
            "Two finished runs side by side: numbers with their differences, curves, states, pictures.",
            settings="experiments.compare.settings:CompareSettings",
            module="experiments.compare.experiment",
            subject="runs",
        ),
        Experiment(
            "bed make",
            "Prepares a bed as in a laboratory: rain, level, fluff, compact, cut, tilt; a report of every stage.",
            settings="experiments.bed.settings:BedSettings",
            module="experiments.bed.make",
        ),
        Experiment(
            "bed refine",
            "The same bed with smaller grains, beside the one it is made from.",
            settings="experiments.bed.settings:BedRefineSettings",
            module="experiments.bed.refine",
            subject="bed",
        ),
        Experiment(
            "bed test shear",
            "A bed sheared under a lid at several pressures: peak and critical friction angle, cohesion.",
            settings="experiments.bed.test_settings:BedShearSettings",
            module="experiments.bed.shear",
            subject="bed",
        ),
        Experiment(
            "bed test repose",
            "Angle of repose: beds drain through a slot, and the slopes that stay are measured.",
            settings="experiments.bed.test_settings:BedReposeSettings",
            module="experiments.bed.repose",
        ),
        Experiment(
            "bed test cone",
            "A cone penetrometer pushed into beds: cone index against depth, and its gradient.",
            settings="experiments.bed.test_settings:BedConeSettings",
            module="experiments.bed.cone",
        ),
        Experiment(
            "bed test cut",
            "A vertical face cut in beds, gravity rising until it falls: critical height and cohesion.",
            settings="experiments.bed.test_settings:BedCutSettings",
            module="experiments.bed.cut",
        ),
        Experiment(
            "bed calibrate",
            "Grain parameters from bulk figures: a response surface over sheared samples, and a material.toml.",
            settings="experiments.calibrate.settings:CalibrateSettings",
            module="experiments.calibrate.experiment",
            example="calibrate-sand.toml",
        ),
        Experiment(
            "validate",
            "Verifies the bed: closed forms, published figures and other codes, beside what comes out.",
            settings="experiments.validate.settings:ValidateSettings",
            module="experiments.validate.experiment",
        ),
    ]
}


def find_experiment(name: str) -> Experiment:
    """The experiment called `name`. Raises ValueError naming those there are."""
    if name not in EXPERIMENTS:
        raise ValueError(f"there is no experiment {name!r}: there is {', '.join(EXPERIMENTS)}")
    return EXPERIMENTS[name]


def face(command: str) -> Callable[[str], Any]:
    """The ``__getattr__`` of a package whose public names are those of the experiment `command`.

    `Settings` is its settings class, `run`, `resume` and `check` are those of its module.
    """

    def __getattr__(name: str) -> Any:  # noqa: N807
        experiment = EXPERIMENTS[command]
        if name == "Settings":
            return experiment.settings_class()
        if name in ("check", "resume", "run"):
            return getattr(import_module(experiment.module), name)
        raise AttributeError(f"the package of {command!r} has no attribute {name!r}")

    return __getattr__
