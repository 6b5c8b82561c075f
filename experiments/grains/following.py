"""Steps a run of a platform to its end in a run folder: checkpoints, Ctrl-C, frames, the state after a failure."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from coupling import BedGround, CoupledTumble, LeftTheBedError, SpatialRun
from coupling.lammps import LammpsEndedError
from coupling.robot import LostRobotError, RobotRun
from coupling.stepper import Reporting
from dem import BedFailure
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.stopping import held_back
from experiments.runs.whole_runs import publish
from rigid.checks.unfit import failed_as
from rigid.ground.reaction import State

from . import say
from .bed_progress import show_bed
from .bed_result import sleep_words

__all__ = ["CHECKPOINT", "Followed", "Frames"]

CHECKPOINT = "tumble"

Run = TypeVar("Run", bound=CoupledTumble | SpatialRun | RobotRun)


class Frames(Protocol):
    """Writer of the frames of a run."""

    interval: float  # Between two of them [s]

    def write(self, run: Any) -> None:
        """Write one frame of the present state."""

    def watch(self, run: Any) -> None:
        """Called after every step: write the frame of a moment of its own, where this is one."""


class Followed(ABC, Generic[Run]):
    """An experiment that steps a platform: its frames, files and result."""

    stage = "tumble"  # What the progress calls the run
    settings: Any  # `GrainsSettings` with a duration
    frames: Callable[..., Frames]  # Of a run, a folder, the settings and whether it is `resumed`: what writes frames
    sinkage: Callable[[Any], float]  # Of a run: how deep the platform stands once it is set down [m]
    write_series: Callable[[Any, Path], Any]  # Of a run and a folder: writes the series, as far as it has come
    kept: State | None = None  # The checkpoint that the run continues from, once it is read

    def notice(self, run: Run) -> str | None:
        """A message on the way, after a step; None where there is none."""
        return None

    @abstractmethod
    def conclude(self, run: Run, folder: Path) -> Result:
        """The result, its series written."""

    def finish(self, run: Run, folder: RunFolder, progress: Progress) -> Result:
        """Step `run` to its end, write result and report, and delete the checkpoint; returns the result."""
        self.follow(run, folder, progress)
        result = publish(folder, self.conclude(run, folder.path), progress)
        folder.drop_checkpoint(CHECKPOINT)
        return result

    def follow(self, run: Run, folder: RunFolder, progress: Progress) -> Any:
        """Return what `run.run` returns; the run continues from its checkpoint if there is one.

        Raises KeyboardInterrupt and RuntimeError with the state saved.
        """
        kept, self.kept = self.kept or folder.load_checkpoint(CHECKPOINT), None
        if kept is not None:
            bed = run.ground.bed if isinstance(run.ground, BedGround) else None
            limit = bed.overlap_limit if bed is not None else 0.0
            run.restore(kept)
            if bed is not None:  # a checkpoint has the bound on overlaps of the version that made it
                bed.overlap_limit = limit
            progress.message(say("goes_on", time=run.time))
        resumed, settings = kept is not None, self.settings
        drawn = self.frames(run, folder.path, settings, resumed=resumed) if settings.frame_count else None
        progress.stage(self.stage, total=1.0)
        saved, placing, late = time.monotonic(), not run.placed, False

        def on_step(run: Any) -> None:
            nonlocal saved, placing, late
            if isinstance(run.ground, BedGround):
                show_bed(progress, run.ground.bed)
            progress.update(run.fraction)
            if drawn:
                drawn.watch(run)
            if said := self.notice(run):
                progress.message(said)
            if run.placement_is_long and not late:
                late = True
                progress.message(say("long_placement", held=run.body.time))
            if placing and run.placed:
                placing = False
                held = run.placing_steps * run.master.macro_step
                progress.message(say("set_down", held=held, depth=1e3 * self.sinkage(run)))
            stop = asked_to_stop()
            if not run.done and (stop or time.monotonic() - saved >= self.settings.checkpoint_interval):
                folder.save_checkpoint(CHECKPOINT, run.state())
                saved = time.monotonic()
            if stop and not run.done:
                raise KeyboardInterrupt

        reporting = Reporting(on_step=on_step)
        if drawn:
            reporting |= Reporting(on_frame=drawn.write, frame_interval=drawn.interval)
        try:
            with held_back() as asked_to_stop:
                found = run.run(**reporting)
        except LammpsEndedError:  # there is no state to be saved
            raise
        except RuntimeError as error:  # a grain lost, an overlap past its bound, a spike beyond the bed
            folder.save_checkpoint(f"{CHECKPOINT}.failed", run.state())
            left = say("state_kept", name=CHECKPOINT)
            when = say("failed_in_placement", time=run.body.time)
            if run.placed:
                self.write_series(run, folder.path)
                left, when = left + say("series_kept"), f"at {run.time:.4g} s"
            clock = say("own_time") if " at t = " in str(error) else ""
            raise failed_as(error, f"{when}: {error}{clock}; {_remedy(error)}; {left}") from error
        folder.save_checkpoint(CHECKPOINT, run.state())
        if isinstance(run.ground, BedGround):
            for sentence in sleep_words(settings, run, run.ground.bed):
                progress.message(sentence)
        return found


def _remedy(error: RuntimeError) -> str:
    if isinstance(error, LeftTheBedError):
        return say("longer_bed", by=2 * error.lacking) if error.lacking else say("deeper_bed")
    if isinstance(error, LostRobotError):
        return error.remedy
    if "come to rest" in str(error):
        return say("slower_placement")
    return say("coupling_or_bed" if isinstance(error, BedFailure) else "other_bed")
