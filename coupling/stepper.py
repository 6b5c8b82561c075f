"""What all runs share: they go on in macro steps to an end, and report on the way."""

from collections.abc import Callable, Iterable
from typing import Any, Protocol, TypedDict

__all__ = ["Progress", "Reporters", "Reporting", "Stepper"]

Reporters = Callable[[Any], None] | Iterable[Callable[[Any], None]] | None  # Called with the run


class Progress(Protocol):
    """What shows how far a run is: `experiments.runs.progress.Progress`, a bar of tqdm, or the reader's own."""

    def update(self, fraction: float, /) -> object:
        """It is so far, from 0 to 1."""


class Reporting(TypedDict, total=False):
    """What a run reports to (`Stepper.follow`)."""

    on_step: Reporters
    on_frame: Reporters
    frame_interval: float | None
    progress: Progress | None


class Stepper:
    """A run: `advance` makes one macro step, `follow` goes on to the end and reports.

    `reporters` are called with the run after every macro step, `frame_reporters` at every frame: append to them.
    """

    macro_step: float  # [s]

    def __init__(self) -> None:
        self.reporters: list[Callable[[Any], None]] = []
        self.frame_reporters: list[Callable[[Any], None]] = []
        self._frames = 0

    @property
    def done(self) -> bool:
        """Whether it has come to its end."""
        raise NotImplementedError

    @property
    def fraction(self) -> float:
        """How far along it is, from 0 to 1, as well as can be known."""
        raise NotImplementedError

    @property
    def at_bottom(self) -> bool:
        """Whether the step just done ended the loading, at the deepest point."""
        return False

    @property
    def frames_taken(self) -> int:
        """How many times `frame_interval` was up."""
        return self._frames

    def advance(self) -> None:
        """Make one macro step; nothing once it has ended."""
        raise NotImplementedError

    @property
    def _elapsed(self) -> float:
        """Time that frames are counted by [s]; below 0: none are due yet."""
        raise NotImplementedError

    def follow(
        self,
        *,
        on_step: Reporters = None,
        on_frame: Reporters = None,
        frame_interval: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Go on to the end, and call these besides `reporters` and `frame_reporters`.

        Parameters
        ----------
        on_step : called after every macro step.
        on_frame : called every `frame_interval` [s], the first before the first step, and at the deepest point and the
            end. Frames already taken are part of the saved state.
        progress : gets `update(fraction)` after every macro step.
        """
        on_step, on_frame = _listed(on_step), _listed(on_frame)
        while True:
            frames = [*on_frame, *self.frame_reporters]
            if frames and frame_interval and self._elapsed >= 0:
                due = self._elapsed >= self._frames * frame_interval - 0.5 * self.macro_step
                self._frames += due
                if due or self.at_bottom or self.done:
                    for report in frames:
                        report(self)
            if self.done:
                return
            self.advance()
            for report in [*on_step, *self.reporters]:
                report(self)
            if progress is not None:
                progress.update(self.fraction)


def _listed(reporters: Reporters) -> list[Callable[[Any], None]]:
    if reporters is None:
        return []
    return [reporters] if callable(reporters) else list(reporters)
