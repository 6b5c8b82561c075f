"""The skeleton of an experiment: `run` and `resume`, and how its result and its report come into the folder."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from .folder import RunFolder
from .progress import Progress
from .reporting import PictureCosts, write_report
from .result import Result

__all__ = ["computed_run", "draw_report", "publish", "whole_run"]

Settings = TypeVar("Settings", bound=BaseModel)


def publish(folder: RunFolder, result: Result, progress: Progress) -> Result:
    """Write the result into the folder, then the report of it; return the result."""
    folder.write_result(result)
    draw_report(folder, progress)
    return result


def draw_report(folder: RunFolder, progress: Progress, *costs: PictureCosts) -> None:
    """The report of a folder that has its result, as the last stage of a run."""
    progress.stage("report", total=1.0)
    write_report(folder.path, progress, *costs)


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

    def run(settings: Settings, folder: str | Path, *, progress: Progress | None = None) -> Result:
        """Carry it out into `folder` and return the result, as result.json has it.

        Raises ValueError for settings that will not do, before any work; RuntimeError where it cannot go on.
        """
        check(settings)
        return carry_out(settings, RunFolder.ensure(Path(folder), name, settings, code=code()), progress or Progress())

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
        if material_copy and (kept.path / material_copy).is_file():
            given["material"] = str(kept.path / material_copy)
        return carry_out(settings_class(**given), kept, progress or Progress())

    return run, resume
