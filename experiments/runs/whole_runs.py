"""The skeleton of an experiment: `run` and `resume`, and how its result and its report come into the folder."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from .folder import RunFolder
from .progress import Progress
from .result import Result

__all__ = [
    "PictureCosts", "computed_run", "draw_plots", "draw_report", "keeping_status", "publish", "report_called",
    "whole_run", "without_reports", "write_report",
]  # fmt: skip

# What the report of `penetrate` takes with OpenGL in software on two cores [s], by the files' times of two runs, of
# 20,187 grains and 112 frames and of 51,850 grains and 190 frames.
_PLOTS, _WRITTEN = 2.0, 0.5
_STARTED, _READ = 3.5, 2.5e-6  # before the first picture; a grain of a frame that is looked through
_STILL, _STILL_GRAIN = 0.9, 5.4e-5
_FILM, _FILM_GRAIN = 0.06, 1.4e-5  # a frame of the animation
_MOST_FRAMES = 48  # of an animation (vis.pictures.pictures)
# Where `vis.report` tells that the plots and the pictures are done, and a still counts so many frames.
_SHARE_PLOTS, _SHARE_PICTURES, _SHARE_STILL = 0.1, 0.95, 4

Settings = TypeVar("Settings", bound=BaseModel)
_DRAWN = ContextVar("_DRAWN", default=True)  # whether runs draw their reports
_STAGE = ContextVar("_STAGE", default="report")  # what the progress calls the drawing of a report


@contextmanager
def without_reports(without: bool = True) -> Iterator[None]:
    """Within, runs draw no report, if `without`: one of hundreds, which nobody opens."""
    token = _DRAWN.set(_DRAWN.get() and not without)
    try:
        yield
    finally:
        _DRAWN.reset(token)


@contextmanager
def report_called(stage: str) -> Iterator[None]:
    """Within, the drawing of a report is this stage of the progress: one of several reports in one plan."""
    token = _STAGE.set(stage)
    try:
        yield
    finally:
        _STAGE.reset(token)


@contextmanager
def keeping_status(folder: RunFolder) -> Iterator[None]:
    """Hold the folder and keep its status: running within, then done; stopped or failed where something is raised.

    Raises ValueError where another process has the folder, and passes on what is raised within.
    """
    with folder.lock():
        folder.set_status("running")
        try:
            yield
        except BaseException as error:
            with suppress(OSError):  # a full disk may be why
                if isinstance(error, KeyboardInterrupt):
                    folder.set_status("stopped", "interrupted")
                else:
                    folder.set_status("failed", f"{type(error).__name__}: {error}")
            raise
        folder.set_status("done")


def publish(folder: RunFolder, result: Result, progress: Progress) -> Result:
    """Write the result into the folder, then the report of it; return the result."""
    folder.write_result(result)
    draw_report(folder, progress)
    return result


@dataclass(frozen=True)
class PictureCosts:
    """What a report of `penetrate` costs: `frames` of each run that is shown (id -> how many), of so many `grains`."""

    frames: Mapping[str, int]
    grains: float

    @property
    def _stills(self) -> int:
        """Three of the first drive, one of each other run (vis.pictures.pictures)."""
        return sum(3 if "driven" in name else 1 for name in self.frames)

    @property
    def _animated(self) -> int:
        return min(_MOST_FRAMES, next(iter(self.frames.values()), 0))

    def _parts(self) -> list[tuple[float, float]]:
        """Parts of the work in their order: the share of the whole at the end of each, and its time [s]."""
        if not self.frames:
            return [(_SHARE_PLOTS, _PLOTS), (1.0, _WRITTEN)]
        still, moving = _STILL + _STILL_GRAIN * self.grains, _FILM + _FILM_GRAIN * self.grains
        opened = _STARTED + _READ * self.grains * sum(self.frames.values())
        counted = (_SHARE_PICTURES - _SHARE_PLOTS) / (_SHARE_STILL * self._stills + self._animated)
        first, stills = (_SHARE_PLOTS + counted * _SHARE_STILL * count for count in (1, self._stills))
        return [
            (_SHARE_PLOTS, _PLOTS),
            (first, opened + still),
            (stills, still * (self._stills - 1)),
            (_SHARE_PICTURES, moving * self._animated),
            (1.0, _WRITTEN),
        ]

    @property
    def seconds(self) -> float:
        """About how long it takes [s]."""
        return sum(time for _, time in self._parts())

    def share(self, reported: float) -> float:
        """Share of the time that is over when the report is at `reported` [1]."""
        parts = self._parts()
        over = 0.0
        for (before, _), (after, time) in pairwise([(0.0, 0.0), *parts]):
            over += time * min(1.0, max(0.0, (reported - before) / (after - before))) if after > before else 0.0
        return over / self.seconds


def write_report(folder: Path, progress: Progress, costs: PictureCosts | None = None) -> None:
    """Make figures, pictures and report.html of a run folder; `costs`: the share of the time of each."""
    from vis.report import write_report as write

    write(folder, progress=progress.update if costs is None else lambda share: progress.update(costs.share(share)))


def draw_report(folder: RunFolder, progress: Progress, *costs: PictureCosts) -> None:
    """The report of a folder that has its result, as the last stage of a run; nothing `without_reports`."""
    if not _DRAWN.get():
        return
    progress.stage(_STAGE.get(), total=1.0)
    write_report(folder.path, progress, *costs)


def draw_plots(folder: RunFolder, progress: Progress) -> None:
    """The report of a run that was stopped, without pictures of grains: it is waited for; none `without_reports`."""
    from vis.report import write_report as write

    if _DRAWN.get():
        progress.stage("report", total=1.0)
        write(folder.path, pictures=False, progress=progress.update)


def computed_run(
    name: str,
    settings_class: type[Settings],
    compute: Callable[[Settings, RunFolder, Progress], Result],
    *,
    check: Callable[[Settings], None],
) -> tuple[Callable[..., Result], Callable[..., Result]]:
    """As `whole_run`, of an experiment that only computes: the folder is held, result and report are written for it."""

    def carry_out(settings: Settings, folder: RunFolder, progress: Progress) -> Result:
        with folder.lock():
            return publish(folder, compute(settings, folder, progress), progress)

    return whole_run(name, settings_class, carry_out, check=check)


def whole_run(
    name: str,
    settings_class: type[Settings],
    carry_out: Callable[[Settings, RunFolder, Progress], Result],
    *,
    check: Callable[[Settings], None],
    material_copy: str = "",
    code: Callable[[], str] = str,
    as_given: bool = True,
) -> tuple[Callable[..., Result], Callable[..., Result]]:
    """The `run` and the `resume` of the experiment `name`, whose work on a folder is `carry_out`.

    It is over so soon, or keeps its own checkpoints, that resuming it is carrying it out again.
    `material_copy`: the file in the folder that `resume` takes the material from, where there is one; `code`: a digest
    of what computes; `as_given`: whether settings at their defaults count as not given when the run is resumed.
    """

    def renewed(settings: Settings, folder: RunFolder, progress: Progress) -> Result:
        """Carry it out; where the run was done before, its digests are those of the files that are there after it."""
        done = folder.status == "done"
        result = carry_out(settings, folder, progress)
        if done:
            folder.set_status("done")
        return result

    def run(settings: Settings, folder: str | Path, *, progress: Progress | None = None) -> Result:
        """Carry it out into `folder` and return the result, as result.json has it.

        Raises ValueError for settings that are not accepted, before any work; RuntimeError where it cannot go on.
        """
        check(settings)
        return renewed(settings, RunFolder.ensure(Path(folder), name, settings, code=code()), progress or Progress())

    def resume(folder: str | Path, *, progress: Progress | None = None) -> Result:
        """Carry out again, from its start, what `folder` was made for."""
        kept = RunFolder.open(Path(folder))
        fields = settings_class.model_fields
        # run.toml has them all: those at their defaults are said to be so again.
        given = {
            name: value
            for name, value in kept.settings.items()
            if not as_given or name not in fields or value != fields[name].default
        }
        asked = dict(kept.settings)
        if material_copy and (kept.path / material_copy).is_file():
            given["material"] = asked["material"] = str(kept.path / material_copy)
        # Where another value is taken for what is not given, as how long a tumble on grains lasts, it was given.
        made, whole = settings_class(**given), settings_class(**asked)
        given |= {name: asked[name] for name in asked if getattr(made, name) != getattr(whole, name)}
        return renewed(settings_class(**given), kept, progress or Progress())

    return run, resume
