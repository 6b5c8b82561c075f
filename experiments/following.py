"""A run on a footing followed to its end in a run folder: checkpoints, Ctrl-C, frames, what is kept of a failure."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from coupling import BedFooting, LeftTheBedError
from dem import BedFailure

from .progress import Progress
from .runfolder import RunFolder
from .stopping import held_back

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
        progress.message(f"goes on at {run.time:.4g} s")
    drawn = frames(kept is not None)
    progress.stage("tumble", total=1.0)
    saved, in_hand, said = time.monotonic(), not run.placed, False

    def on_step(run: Any) -> None:
        nonlocal saved, in_hand, said
        progress.update(run.fraction)
        if run.held_long and not said:
            said = True
            held = run.body.time
            progress.message(f"still in the hand that sets it down after {held:.3g} s: it is let go once it rests")
        if in_hand and run.placed:
            in_hand = False
            held = run.placing_steps * run.master.macro_step
            progress.message(f"set down after {held:.3g} s: {1e3 * sinkage():.3g} mm deep")
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
        left = f"the state is in checkpoint/{CHECKPOINT}.failed.npz"
        if run.placed:
            left += ", what was before it in trajectory.csv and series/"
        when = f"at {run.time:.4g} s" if run.placed else f"after {run.body.time:.4g} s in the hand that sets it down"
        clock = " (t is the bed's own time, its preparation included)" if " at t = " in str(error) else ""
        raise RuntimeError(f"{when}: {error}{clock}; {_would_do(error)}; {left}") from error
    folder.save_checkpoint(CHECKPOINT, run.state())
    return found


def _take_up(run: Any, kept: Mapping[str, Any]) -> None:
    """Restore it, but for the bound on overlaps: a checkpoint has the one of the version that made it."""
    bed = run.footing.bed if isinstance(run.footing, BedFooting) else None
    limit = None if bed is None else bed.overlap_limit
    run.restore(kept)
    if bed is not None and limit is not None:
        bed.overlap_limit = limit


def _would_do(error: RuntimeError) -> str:
    if isinstance(error, LeftTheBedError) and error.lacking:
        return (
            f"a bed_size longer by {2 * error.lacking:.2g} m, half of it at either end, would have held it until then, "
            f"one laid end to end (bed_repeats) for longer; or a shorter duration would do"
        )
    if isinstance(error, LeftTheBedError):
        return "a deeper bed_size, or a shorter duration, would do"
    if "come to rest" in str(error):
        return "a slower lowering_speed, a finer grain or, in space, a height to fall from would do"
    if isinstance(error, BedFailure):
        return "fewer substeps tell whether it is the coupling, stiffer grains (young) whether it is the bed"
    return "a longer or deeper bed_size, a shorter duration or another young would do"
