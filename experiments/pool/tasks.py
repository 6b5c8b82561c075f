"""One run of a list as a task: found by its settings and code, carried out once, taken up where it was left.

The run folder is named by a digest of the settings, of the files that they name, and of the code that computes. A
process that finds it while another one works in it waits for that one. A finished run is read, an unfinished one
continues from its checkpoint.
"""

import hashlib
import json
import re
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

from pydantic import BaseModel, ValidationError

from experiments.runs.folder import BusyError, RunFolder, holding, write_text
from experiments.runs.progress import Progress
from experiments.runs.registry import Experiment, find_experiment
from experiments.runs.streams import file_words, naming
from experiments.runs.whole_runs import keeping_status, without_reports

__all__ = ["After", "Outcome", "Task", "Tell", "carry_out", "code_of", "done_before", "name_of", "received", "task_of"]

Settings = TypeVar("Settings", bound=BaseModel)
Tell = Callable[[float], None]
"""Called with the share of a run that is done, 0 to 1."""
_ROOT = Path(__file__).parents[2]
_HOW = ("threads", "workers", "scheduler", "checkpoint_interval", "cache", "members")
"""Settings that say how a run is computed and where its parts are kept; its bits do not depend on them."""
_CODE = ("coupling", "dem", "experiments", "rigid")
_CODE_FILES = (".py", ".toml", ".csv", ".xml", ".json", ".gz")
_FOLDERS = ("bed", "campaign", "runs")  # settings that may name a file or folder of any name
_NAMING = (".toml", ".xml", ".urdf")  # files that may name others, in quotes
_QUOTED = re.compile(r"""\"([^"\n]{1,255})"|'([^'\n]{1,255})'""")


class After(Protocol):
    """What belongs to a task beyond its run: made in the folder of the finished run by whoever makes that."""

    @property
    def share(self) -> float:
        """Its share of the cost of the task, 0 to 1."""

    @property
    def files(self) -> Sequence[str]:
        """Files that it leaves in the run folder."""

    def missing(self, path: Path) -> bool:
        """Whether any of it is not yet in the run folder `path`."""

    def make(self, settings: BaseModel, path: Path, tell: Tell, progress: Progress) -> None:
        """Make what is missing; `settings`: of the run. The process has the folder for itself."""


@dataclass(frozen=True)
class Task:
    """One run: the experiment's name, its settings, its folder below `home`, and the code it is meant for."""

    name: str
    experiment: str
    settings: BaseModel
    home: str
    code: str
    reports: bool = False
    after: After | None = None

    @property
    def path(self) -> Path:
        """The run folder."""
        return Path(self.home) / self.name

    @property
    def key(self) -> str:
        """The name and a digest of all the rest: two tasks have one key only where one outcome does for both."""
        settings = self.settings.model_dump(mode="json")
        given = [self.home, self.experiment, settings, self.code, self.reports, repr(self.after)]
        return f"{self.name}-{hashlib.sha256(json.dumps(given, sort_keys=True).encode()).hexdigest()}"

    def on_threads(self, threads: int) -> "Task":
        """The same on so many threads, where its settings leave it open and have anything that takes threads."""
        given = dict(self.settings)
        if given.get("threads", threads) is not None:
            return self
        try:
            return replace(self, settings=type(self.settings)(**given | {"threads": threads}))
        except ValidationError:
            return self


@dataclass(frozen=True)
class Outcome:
    """What became of a task: its result, or in `fault` why there is none."""

    name: str
    result: str = ""  # the text of result.json
    fault: str = ""
    processor_time: float = 0.0  # [s]


def task_of(
    experiment: Experiment, settings: BaseModel, home: Path, *, name: str | None = None, reports: bool = False
) -> Task:
    """The task of these settings, below `home`; its folder is called as `name_of` says if no `name` is given.

    Files that the settings name are made absolute.
    """
    settings = _absolute(settings)
    name = name or name_of(experiment, settings)
    return Task(name, experiment.name, settings, str(home.resolve()), code_of(experiment), reports)


def name_of(experiment: Experiment, settings: BaseModel, *, label: str = "", beside: Sequence[str] = ()) -> str:
    """The name of the run folder: `label`, or the experiment, and a digest of settings, files and code.

    `beside`: settings that are not part of the digest, beside those that never change the numbers.
    """
    kept = {key: value for key, value in settings.model_dump(mode="json").items() if key not in (*_HOW, *beside)}
    contents = {key: _replaced(value, partial(_content, setting=key)) for key, value in kept.items()}
    text = json.dumps([experiment.name, contents, code_of(experiment)], sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    return f"{label or experiment.name.replace(' ', '-')}-{digest}"


@cache
def code_of(experiment: Experiment) -> str:
    """A digest of all code and data that compute: `coupling`, `dem`, `experiments`, `rigid`; and of the experiment's
    own digest, where it has one. `vis` only draws and is not part of it.
    """
    digest = hashlib.sha256(experiment.code().encode())
    files = [path for name in _CODE for path in (_ROOT / name).rglob("*") if path.suffix in _CODE_FILES]
    for path in sorted([*files, *_ROOT.glob("hedgebed*.py")]):
        _add(digest, path.relative_to(_ROOT).as_posix(), path.read_bytes())
    return digest.hexdigest()[:16]


def done_before(task: Task, tell: Callable[[str], None] | None = None) -> Outcome | None:
    """The outcome of a task whose folder is done; None where it is not, or where its result cannot be read.

    ``tell``: called with a sentence where a file of a run that was done is damaged or gone.
    """
    if task.after is not None and task.after.missing(task.path):
        return None
    return _run_before(task, tell or _unsaid)


def _run_before(task: Task, tell: Callable[[str], None]) -> Outcome | None:
    """The outcome of the run of a task, with or without what comes after it."""
    try:
        folder = RunFolder.open(task.path)
        if folder.status != "done":
            return None
        folder.read_result()
        text = (task.path / "result.json").read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        if task.path.is_dir():
            tell(f"{_said(error, task)}; the run is done again")
        return None
    return Outcome(task.name, text, processor_time=folder.processor_time)


def carry_out(task: Task, tell: Tell, shown: Progress | None = None) -> Outcome:
    """Do the task, or go on with it; what goes wrong is its outcome. Waits while another process has its folder.

    `shown` shows the grains of the run. Raises KeyboardInterrupt, with the run kept to go on from, where the process is
    told to stop.
    """
    waiting = shown.message if shown is not None else _unsaid
    try:
        if code_of(find_experiment(task.experiment)) != task.code:
            raise ValueError(
                "the code here is not that of the command: install the same version of hedgebed everywhere"
            )
        with holding(task.path, waiting=waiting):
            return _with_after(task, tell, shown)
    except Exception as error:
        if task.path.is_dir():
            with suppress(OSError):
                write_text(task.path / "traceback.txt", traceback.format_exc())
        return Outcome(task.name, fault=" ".join(f"{type(error).__name__}: {_said(error, task)}".split()))


def _said(error: Exception, task: Task) -> str:
    """What went wrong, with the file where one could not be read or written."""
    return file_words(error, f"a file below {task.path}") if isinstance(error, OSError) else str(error)


def _with_after(task: Task, tell: Tell, shown: Progress | None) -> Outcome:
    """The run and what comes after it; what is there is read."""
    own = 1.0 if task.after is None else 1.0 - task.after.share
    told = _Told(lambda share: tell(own * share), shown)
    outcome = _run_before(task, _unsaid) or _compute(task, _folder_of(task), told)
    if task.after is not None and task.after.missing(task.path):
        silent, folder = _Told(lambda share: None, shown), RunFolder.open(task.path)
        task.after.make(task.settings, task.path, lambda share: tell(own + (1.0 - own) * share), silent)
        folder.set_status("done")  # with the digests of what was added
    return outcome


def _folder_of(task: Task) -> RunFolder:
    """The folder of the task, held by this process: the existing one with its run.toml, or a new one."""
    if (task.path / "run.toml").is_file():
        with suppress(ValueError):  # damaged: the task knows what it held
            return RunFolder.open(task.path)
    code = find_experiment(task.experiment).code() or task.code
    make = RunFolder.mend if (task.path / "run.toml").is_file() else RunFolder.create
    return make(task.path, task.experiment, task.settings, code=code)


def _unsaid(_: str) -> None:
    """Print nothing while a worker waits: one display shows all runs together."""


def _compute(task: Task, folder: RunFolder, progress: Progress) -> Outcome:
    experiment = find_experiment(task.experiment)
    with naming(folder.path / "run.toml"):
        same = type(task.settings)(**folder.settings) == task.settings  # not so where it was begun on other threads
    with without_reports(not task.reports), keeping_status(folder):
        if same and not folder.has_work:
            experiment.run(task.settings, folder.path, progress=progress)
        else:
            experiment.resume(folder.path, progress=progress)
    outcome = _run_before(task, _unsaid)
    if outcome is None:
        raise RuntimeError(f"{task.path / 'result.json'} is not there after the run")
    return outcome


def received(task: Task, outcome: Outcome) -> None:
    """Keep a result that came from a worker whose storage is another: settings, result and status, and no series.

    Where another process has the folder, that one writes it.
    """
    if outcome.fault or (task.path / "result.json").is_file():
        return
    with suppress(BusyError), holding(task.path):
        folder = _folder_of(task)
        write_text(task.path / "result.json", outcome.result)
        folder.set_status("done", "computed elsewhere", processor_time=outcome.processor_time)


def _replaced(value: Any, of: Callable[[str], str]) -> Any:
    """`value` with each text in it, also in lists and tables, as `of` has it."""
    if isinstance(value, str):
        return of(value)
    if isinstance(value, Mapping):
        return {key: _replaced(item, of) for key, item in value.items()}
    if isinstance(value, BaseModel):
        return _absolute(value)
    if isinstance(value, list | tuple):
        return type(value)(_replaced(item, of) for item in value)
    return value


def _absolute(settings: Settings) -> Settings:
    """The same settings, each file or folder that they name by its whole path."""
    changed = {name: _replaced(value, partial(_whole, setting=name)) for name, value in settings}
    return settings.model_copy(update={name: new for name, new in changed.items() if new != getattr(settings, name)})


def _whole(text: str, setting: str) -> str:
    path, rest = _path_in(text, setting)
    return text if path is None else f"{path.resolve()}{rest}"


def _path_in(text: str, setting: str) -> tuple[Path | None, str]:
    """The path that a text names, None where it names none that is there; and what follows it (robot.py:control)."""
    if setting == "bed" and not any(_there(Path(text, name), Path.is_file) for name in ("", "bed.npz")):
        return None, ""  # it is one on the shelf
    head, colon, tail = text.rpartition(":")
    for name, rest in ((text, ""), (head, colon + tail)):
        if name and (setting in _FOLDERS or "/" in name or Path(name).suffix) and _there(Path(name)):
            return Path(name), rest
    return None, ""


def _content(text: str, setting: str) -> str:
    """A digest of what a text names: a file, a folder, or a bed on the shelf; the text itself where it names none."""
    from dem.prepare.bedfile import bed_shelf  # this module is loaded by commands without grains

    path, rest = _path_in(text, setting)
    if path is None and setting == "bed" and _there(shelved := bed_shelf() / f"{text}.npz"):
        path = shelved
    return text if path is None else _digest(path) + rest


def _there(path: Path, kind: Callable[[Path], bool] = Path.exists) -> bool:
    """Whether the path is there; a text may be too long for a path."""
    try:
        return kind(path)
    except (OSError, ValueError):
        return False


def _digest(path: Path) -> str:
    """Of a file, or of all files of a folder with their names; and of the files that its TOML and XML files name."""
    digest, todo, seen = hashlib.sha256(), [path.resolve()], set()
    while todo:
        at = todo.pop()
        for file in sorted(at.rglob("*")) if at.is_dir() else [at]:
            if not file.is_file() or file in seen:
                continue
            seen.add(file)
            content = file.read_bytes()
            _add(digest, file.relative_to(at).as_posix(), content)
            if file.suffix in _NAMING:
                todo += _named_in(file, content.decode(errors="replace"))
    return digest.hexdigest()


def _named_in(file: Path, text: str) -> Iterator[Path]:
    """The files that a text in `file` names in quotes: from its folder, from a folder that it names, or from here."""
    quoted = sorted({first or second for first, second in _QUOTED.findall(text)})
    below = [file.parent / name for name in quoted if _there(file.parent / name, Path.is_dir)]
    folders = [file.parent, *below, Path.cwd()]
    for name in quoted:
        if found := next((folder / name for folder in folders if _there(folder / name, Path.is_file)), None):
            yield found.resolve()


def _add(digest: "hashlib._Hash", name: str, content: bytes) -> None:
    digest.update(f"{name}\0{len(content)}\0".encode() + content)


class _Told(Progress):
    """Progress that prints nothing: it reports the share of the whole, and `shown` shows the grains."""

    def __init__(self, tell: Tell, shown: Progress | None) -> None:
        super().__init__()
        self._tell, self._shown = tell, shown

    def show_grains(
        self, *, grain_count: int, awake_count: int, grain_steps: int, slow_count: int = 0, runtime: str = ""
    ) -> None:
        if self._shown is not None:
            self._shown.show_grains(
                grain_count=grain_count, awake_count=awake_count, grain_steps=grain_steps, slow_count=slow_count,
                runtime=runtime,
            )  # fmt: skip

    def update(self, done: float) -> None:
        super().update(done)
        self._tell((self.fraction if self.fraction is not None else self.stage_fraction) or 0.0)
