"""Which experiments there are: `EXPERIMENTS`, from registry.toml. A further one is one table there, one settings class
and one module.

The module of an experiment offers
``run(settings, folder: Path, *, progress: Progress) -> Result`` (as result.json has it) and
``resume(folder: Path, *, progress: Progress) -> Result``;
It may have ``check(settings) -> None``, which is called before a folder is made and raises ValueError for what the
settings class cannot see. It may have ``fingerprint() -> str``, a digest of what computes, which run.toml keeps. Both
names are text here so that help does not wait for Taichi.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from pydantic import BaseModel

from rigid.checks.unfit import UnfitSettingsError

if TYPE_CHECKING:
    from experiments.runs.progress import Progress
    from experiments.runs.result import Result

__all__ = ["EXPERIMENTS", "Experiment", "Headline", "Preset", "TOO_LARGE", "face", "find_experiment", "findings_shown"]

TOO_LARGE = "a number becomes larger than any that can be computed: a setting is far too large or too small"
"""What an OverflowError means to a user."""
CASES = Path(__file__).parents[1] / "cases"
S = TypeVar("S", bound=BaseModel)
S_contra = TypeVar("S_contra", bound=BaseModel, contravariant=True)


class Run(Protocol[S_contra]):
    """The `run` of an experiment whose settings are of the class `S_contra`."""

    def __call__(self, settings: S_contra, folder: str | Path, *, progress: "Progress | None" = None) -> "Result": ...


class Resume(Protocol):
    """The `resume` of an experiment."""

    def __call__(self, folder: str | Path, *, progress: "Progress | None" = None) -> "Result": ...


_SAID, _OF_FINDINGS = 4, 2
"""Sentences that a headline shows, warnings first; but all warnings, and at least so many findings."""


def findings_shown(warnings: Sequence[str]) -> int:
    """How many findings a headline with these warnings shows at most [1]."""
    return max(_OF_FINDINGS, _SAID - len(warnings))


@dataclass(frozen=True)
class Headline:
    """The short form of a result that the terminal shows when a run ends: a table and the sentences below it."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    warnings: tuple[str, ...]
    sentences: tuple[str, ...]
    left: int  # findings that are left to the report
    notes: tuple[str, ...] = ()  # what the columns of the table mean
    tables: tuple[Mapping[str, Any], ...] = ()  # further ones of the result
    more: bool = False  # whether tables are left to the report


@dataclass(frozen=True)
class Preset:
    """A case that has an option of its own: ``--<option>`` lays it under the case file and the command line."""

    option: str
    case: str  # a file in experiments/cases
    summary: str


@dataclass(frozen=True)
class Experiment:
    """One experiment: its name on the command line, one line of help, and where its settings and its code are."""

    name: str  # on the command line; a second word makes it a command of the experiment that is called by the first
    summary: str
    settings: str  # "module:Class", a frozen pydantic model; every field with a description that gives the unit
    module: str
    group: str = ""  # Of a command of one word: the group of `hedgebed --help`, a key of cli.main.GROUPS
    presets: tuple[Preset, ...] = ()
    subject: str = ""  # Setting that the first argument is (the first two, of a setting of two)
    example: str = ""  # File in experiments/cases, of an experiment whose case has no default
    details: str = ""  # What `--help` adds to the summary
    answer: str = ""  # "module:function" from a result to the rows of its report's table
    tables: bool = False  # Whether the terminal shows the tables of the result below those rows
    headline: str = ""  # "module:function" from a result to its `Headline`; without both all is shown

    def settings_class(self) -> type[BaseModel]:
        """The settings class. Quick: it imports no Taichi."""
        module, _, name = self.settings.partition(":")
        return getattr(import_module(module), name)

    def run(self, settings: BaseModel, folder: Path, *, progress: Any) -> "Result":
        """Run it into `folder`; return the result."""
        return import_module(self.module).run(settings, folder, progress=progress)

    def resume(self, folder: Path, *, progress: Any) -> "Result":
        """Finish the run in `folder`; return the result."""
        return import_module(self.module).resume(folder, progress=progress)

    def code(self) -> str:
        """The module's ``fingerprint()`` of the code that computes, empty where it has none."""
        fingerprint: Callable[[], str] | None = getattr(import_module(self.module), "fingerprint", None)
        return fingerprint() if fingerprint is not None else ""

    def check(self, settings: BaseModel) -> None:
        """Raise ValueError for settings that cannot be run, before any work."""
        check: Callable[[BaseModel], None] | None = getattr(import_module(self.module), "check", None)
        if check is not None:
            try:
                check(settings)
            except RuntimeError as error:  # a short trial that fails; other subclasses are raised again
                if type(error) is not RuntimeError and not isinstance(error, UnfitSettingsError):
                    raise
                raise ValueError(f"with these settings a short trial fails: {error}") from error
            except OverflowError as error:
                raise ValueError(f"with these settings {TOO_LARGE}") from error


def _read() -> dict[str, Experiment]:
    tables = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["experiment"]
    for table in tables:
        table.setdefault("module", f"{table['settings'].rpartition('.')[0]}.experiment")
        table["presets"] = tuple(Preset(**preset) for preset in table.get("presets", ()))
    return {table["name"]: Experiment(**table) for table in tables}


EXPERIMENTS = _read()


def find_experiment(name: str) -> Experiment:
    """The experiment called `name`. Raises ValueError naming those there are."""
    if name not in EXPERIMENTS:
        raise ValueError(f"there is no experiment {name!r}: there is {', '.join(EXPERIMENTS)}")
    return EXPERIMENTS[name]


def face(command: str, settings_class: type[S]) -> tuple[Callable[[S], None], Resume, Run[S]]:
    """`check`, `resume` and `run` of the experiment `command`, for its package; calling one imports what computes.

    `settings_class` is its settings class, by which a type checker knows what they take.
    """
    experiment = EXPERIMENTS[command]

    def check(settings: S) -> None:
        """Raise ValueError for settings that cannot be run, before any work."""
        experiment.check(settings)

    def resume(folder: str | Path, *, progress: "Progress | None" = None) -> "Result":
        """Finish the run in `folder`; return the result."""
        return experiment.resume(Path(folder), progress=progress)

    def run(settings: S, folder: str | Path, *, progress: "Progress | None" = None) -> "Result":
        """Run the experiment into `folder`; return the result. Raises ValueError for settings that cannot be run."""
        return experiment.run(settings, Path(folder), progress=progress)

    return check, resume, run
