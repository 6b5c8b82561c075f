"""`run` and `resume` of an experiment without checkpoints: it is over so soon that resuming it is doing it again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from .folder import RunFolder
from .progress import Progress
from .result import Result

__all__ = ["whole_run"]

Settings = TypeVar("Settings", bound=BaseModel)


def whole_run(
    name: str,
    settings_class: type[Settings],
    carry_out: Callable[[Settings, RunFolder, Progress], Result],
    *,
    check: Callable[[Settings], None],
    material_copy: str = "",
) -> tuple[Callable[..., Result], Callable[..., Result]]:
    """The `run` and the `resume` of the experiment `name`, whose work on a folder is `carry_out`.

    ``material_copy``: the file in the folder that `resume` takes the material from, where there is one.
    """

    def run(settings: Settings, folder: str | Path, *, progress: Progress | None = None) -> Result:
        """Carry it out into `folder` and return the result, as result.json has it.

        Raises ValueError for settings that will not do, before any work; RuntimeError where it cannot go on.
        """
        check(settings)
        return carry_out(settings, RunFolder.ensure(Path(folder), name, settings), progress or Progress())

    def resume(folder: str | Path, *, progress: Progress | None = None) -> Result:
        """Carry out again, from its start, what `folder` was made for."""
        kept = RunFolder.open(Path(folder))
        fields = settings_class.model_fields
        # run.toml has them all: those at their defaults are said to be so again.
        given = {k: value for k, value in kept.settings.items() if k not in fields or value != fields[k].default}
        if material_copy and (kept.path / material_copy).is_file():
            given["material"] = str(kept.path / material_copy)
        return carry_out(settings_class(**given), kept, progress or Progress())

    return run, resume
