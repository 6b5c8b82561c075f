"""A member of a sweep: an ordinary run of `penetrate` in a folder of its own, found again by its settings."""

from pathlib import Path

from experiments.penetrate import experiment as penetrate
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder, holding
from experiments.runs.progress import Progress
from experiments.runs.whole_runs import keeping_status

__all__ = ["finished_member", "make_member"]


def make_member(settings: PenetrateSettings, path: Path, progress: Progress) -> str | None:
    """Carry out the run in the folder `path`, or go on with it; what went wrong, None where nothing did.

    Waits while another process has the folder, and takes over what that one has done.
    """
    with holding(path, waiting=progress.message):
        if finished_member(path) is not None:
            return None
        own = RunFolder.open(path) if (path / "run.toml").is_file() else RunFolder.create(
            path, "penetrate", settings, code=penetrate.fingerprint()
        )  # fmt: skip
        try:
            with keeping_status(own):
                penetrate.compute(settings, own, _Within(progress))
        except RuntimeError as error:
            return str(error)
    return None


def finished_member(path: Path) -> RunFolder | None:
    """The folder of a member that is done; None where it is not."""
    own = RunFolder.open(path) if (path / "run.toml").is_file() else None
    return own if own is not None and own.status == "done" and (path / "result.json").is_file() else None


class _Within(Progress):
    """The progress of one member as a stage of the sweep's."""

    def __init__(self, whole: Progress) -> None:
        super().__init__()
        self._whole = whole

    def show_grains(self, *, grain_count: int, awake_count: int, grain_steps: int) -> None:
        self._whole.show_grains(grain_count=grain_count, awake_count=awake_count, grain_steps=grain_steps)

    def update(self, done: float) -> None:
        super().update(done)
        self._whole.update(self.fraction or 0.0)
