"""One run of a sweep as a task: found by its settings and code, carried out once, taken up where it was left.

The run folder is named by a digest of the settings, of the files that they name, and of the code that computes. Who
comes upon it while another process works in it waits for that one; what is done there is read, what was left is gone
on with from its checkpoint.
"""

import hashlib
import json
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from experiments.runs.folder import RunFolder, write_json, write_text
from experiments.runs.progress import Progress
from experiments.runs.registry import Experiment, find_experiment
from experiments.runs.whole_runs import keeping_status, without_reports

__all__ = ["Outcome", "Task", "Tell", "carry_out", "code_of", "done_before", "received", "task_of"]

Settings = TypeVar("Settings", bound=BaseModel)
Tell = Callable[[float], None]
"""Called with the share of a run that is done, 0 to 1."""
_ROOT = Path(__file__).parents[2]
_HOW = ("threads", "checkpoint_interval", "cache")
"""Settings that say how a run is computed; its bits do not depend on them."""
_WAIT = 0.5  # Between two looks whether a folder is free [s]
_SIGNS = ("/", ".toml", ".csv", ".npz", ".stl", ".json")  # a text that may name a file


@dataclass(frozen=True)
class Task:
    """One run: the experiment's name, its settings, its folder below `home`, and the code it is meant for."""

    name: str
    experiment: str
    settings: BaseModel
    home: str
    code: str
    reports: bool = False

    @property
    def path(self) -> Path:
        """The run folder."""
        return Path(self.home) / self.name


@dataclass(frozen=True)
class Outcome:
    """What became of a task: its result, or in `fault` why there is none."""

    name: str
    result: str = ""  # the text of result.json
    fault: str = ""
    processor_time: float = 0.0  # [s]


def task_of(experiment: Experiment, settings: BaseModel, home: Path, *, threads: int, reports: bool) -> Task:
    """The task of these settings; `threads` where they do not say how many. Files that they name are made absolute."""
    files = {name: str(path.resolve()) for name, path in _files(settings).items()}
    settings = _with_threads(settings.model_copy(update=files), threads)
    kept = {name: value for name, value in settings.model_dump(mode="json").items() if name not in _HOW}
    contents = {name: _digest(path) for name, path in _files(settings).items()}
    code = code_of(experiment)
    text = json.dumps([experiment.name, {**kept, **contents}, code], sort_keys=True)
    name = f"{experiment.name.replace(' ', '-')}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    return Task(name, experiment.name, settings, str(home.resolve()), code, reports)


@cache
def code_of(experiment: Experiment) -> str:
    """A digest of the code that computes the experiment: its own where it has one, else of the packages it is made of.

    These are `coupling`, `dem` and `rigid` with all their files, and the experiment's own.
    """
    if own := experiment.code():
        return own
    package = _ROOT.joinpath(*experiment.module.split(".")).parent
    digest = hashlib.sha256()
    for folder in (*(_ROOT / name for name in ("coupling", "dem", "rigid")), package):
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".toml"):
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def done_before(task: Task) -> Outcome | None:
    """The outcome of a task whose folder is done; None where it is not, or where its result cannot be read."""
    try:
        folder = RunFolder.open(task.path)
        if folder.status != "done":
            return None
        folder.read_result()
        text = (task.path / "result.json").read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None
    return Outcome(task.name, text, processor_time=folder.processor_time)


def carry_out(task: Task, tell: Tell) -> Outcome:
    """Do the task, or go on with it; what goes wrong is its outcome. Waits while another process has its folder.

    Raises KeyboardInterrupt, with the run kept to go on from, where the process is told to stop.
    """
    try:
        if code_of(find_experiment(task.experiment)) != task.code:
            raise ValueError("the code here is not that of the sweep: install the same version of hedgebed everywhere")
        while (folder := _free_folder(task)) is None:
            time.sleep(_WAIT)
        with folder.lock():
            if (done := done_before(task)) is not None:
                return done
            return _compute(task, folder, tell)
    except Exception as error:
        if task.path.is_dir():
            write_text(task.path / "traceback.txt", traceback.format_exc())
        return Outcome(task.name, fault=" ".join(f"{type(error).__name__}: {error}".split()))


def _free_folder(task: Task) -> RunFolder | None:
    """The folder of the task, made where it is not there; None while another process has it."""
    begun = (task.path / "run.toml").is_file()
    folder = (
        RunFolder.open(task.path)
        if begun
        else RunFolder.create(task.path, task.experiment, task.settings, code=task.code)
    )
    try:
        with folder.lock():
            return folder
    except ValueError:
        return None


def _compute(task: Task, folder: RunFolder, tell: Tell) -> Outcome:
    experiment, progress = find_experiment(task.experiment), _Told(tell)
    same = type(task.settings)(**folder.settings) == task.settings  # not so where it was begun on other threads
    with without_reports(not task.reports), keeping_status(folder):
        if same and not folder.has_work:
            experiment.run(task.settings, folder.path, progress=progress)
        else:
            experiment.resume(folder.path, progress=progress)
    outcome = done_before(task)
    if outcome is None:
        raise RuntimeError(f"{task.path / 'result.json'} is not there after the run")
    return outcome


def received(task: Task, outcome: Outcome) -> None:
    """Keep a result that came from a worker whose storage is another: settings, result and status, and no series."""
    if not outcome.fault and not (task.path / "result.json").is_file():
        folder = RunFolder.ensure(task.path, task.experiment, task.settings, code=task.code)
        write_text(task.path / "result.json", outcome.result)
        write_json(
            task.path / "status.json",
            {"status": "done", "reason": "computed elsewhere", "processor_time": outcome.processor_time},
        )
        assert folder.status == "done"


def _with_threads(settings: Settings, threads: int) -> Settings:
    """The same on so many threads, where the settings leave it open and have anything that takes threads."""
    given = dict(settings)
    if given.get("threads", threads) is not None:
        return settings
    try:
        return type(settings)(**given | {"threads": threads})
    except ValidationError:
        return settings


def _files(settings: BaseModel) -> dict[str, Path]:
    """Settings that name a file or folder that is there -> its path."""
    texts = {name: value for name, value in settings if isinstance(value, str) and value}
    signed = {name: Path(value) for name, value in texts.items() if any(sign in value for sign in _SIGNS)}
    return {name: path for name, path in signed.items() if path.exists()}


def _digest(path: Path) -> str:
    """Of a file, or of all files of a folder with their names."""
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            digest.update(f"{file.relative_to(path)}".encode() + file.read_bytes())
    return digest.hexdigest()


class _Told(Progress):
    """Silent, but for the share of the whole, which it tells."""

    def __init__(self, tell: Tell) -> None:
        super().__init__()
        self._tell = tell

    def update(self, done: float) -> None:
        super().update(done)
        self._tell((self.fraction if self.fraction is not None else self.stage_fraction) or 0.0)
