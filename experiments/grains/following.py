"""A run on a ground followed to its end in a run folder: checkpoints, Ctrl-C, frames, what is kept of a failure."""

import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from coupling import BedGround, LeftTheBedError
from dem import BedFailure
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.stopping import held_back

from .sentences import say

__all__ = ["CHECKPOINT", "Frames", "follow"]

CHECKPOINT = "tumble"


class Frames(Protocol):
    """What writes the frames of a run."""

    interval: float
    """Between two of them [s]."""

    def write(self, run: Any) -> None:
        """One frame of what there is now."""


def follow(
    run: Any,
    folder: RunFolder,
    progress: Progress,
    *,
    frames: Callable[[bool], Frames | None],
    checkpoint_interval: float,
    sinkage: Callable[[], float],
    write_series: Callable[[], Any],
) -> Any:
    """What `run.run` gives, `run` a `CoupledTumble` or a `SpatialRun`; taken up from its checkpoint where there is one.

    `frames` is told whether it is taken up; `sinkage` says how deep it stands [m] once it is set down; `write_series`
    keeps what there is where it fails. Raises KeyboardInterrupt and RuntimeError with the state saved.
    """
    kept = folder.load_checkpoint(CHECKPOINT)
    if kept is not None:
        _take_up(run, kept)
        progress.message(say("goes_on", time=run.time))
    drawn = frames(kept is not None)
    progress.stage("tumble", total=1.0)
    saved, placing, said = time.monotonic(), not run.placed, False

    def on_step(run: Any) -> None:
        nonlocal saved, placing, said
        progress.update(run.fraction)
        if run.placement_is_long and not said:
            said = True
            progress.message(say("long_placement", held=run.body.time))
        if placing and run.placed:
            placing = False
            held = run.placing_steps * run.master.macro_step
            progress.message(say("set_down", held=held, depth=1e3 * sinkage()))
        stop = asked_to_stop()
        if not run.done and (stop or time.monotonic() - saved >= checkpoint_interval):
            folder.save_checkpoint(CHECKPOINT, run.state())
            saved = time.monotonic()
        if stop and not run.done:
            raise KeyboardInterrupt

    try:
        with held_back() as asked_to_stop:
            found = run.run(
                on_step=on_step, on_frame=drawn.write if drawn else None,
                frame_interval=drawn.interval if drawn else None,
            )  # fmt: skip
    except RuntimeError as error:  # a grain lost, an overlap past its bound, a spike beyond the bed
        folder.save_checkpoint(f"{CHECKPOINT}.failed", run.state())
        if run.placed:
            write_series()
        left = say("state_kept", name=CHECKPOINT) + (say("series_kept") if run.placed else "")
        when = f"at {run.time:.4g} s" if run.placed else say("failed_in_placement", time=run.body.time)
        clock = say("own_time") if " at t = " in str(error) else ""
        raise RuntimeError(f"{when}: {error}{clock}; {_would_do(error)}; {left}") from error
    folder.save_checkpoint(CHECKPOINT, run.state())
    return found


def _take_up(run: Any, kept: Mapping[str, Any]) -> None:
    """Restore it, but for the bound on overlaps: a checkpoint has the one of the version that made it."""
    bed = run.ground.bed if isinstance(run.ground, BedGround) else None
    limit = None if bed is None else bed.overlap_limit
    run.restore(kept)
    if bed is not None and limit is not None:
        bed.overlap_limit = limit


def _would_do(error: RuntimeError) -> str:
    if isinstance(error, LeftTheBedError):
        return say("longer_bed", by=2 * error.lacking) if error.lacking else say("deeper_bed")
    if "come to rest" in str(error):
        return say("slower_placement")
    return say("coupling_or_bed" if isinstance(error, BedFailure) else "other_bed")
