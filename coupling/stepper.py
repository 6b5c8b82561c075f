"""What all runs share: they go on in macro steps to an end, and report on the way."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, TypedDict

__all__ = ["LastRows", "Progress", "Reporters", "Reporting", "Stepper"]

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


class LastRows:
    """The last `count` of the rows of a run, which grow at their end: between which bounds a column is, and about its
    mean, at a cost that does not grow with `count`. A time at rest may be hundreds of thousands of rows.

    `extremes` are of the column `bounded`, exact; `may_be` is of the columns `summed`.
    """

    def __init__(self, rows: Sequence[Sequence[float]], count: int, *, bounded: int, summed: Sequence[int]) -> None:
        self._rows, self._count, self._bounded = rows, count, bounded
        self._next = max(0, len(rows) - count)  # The first row that is not taken in
        self._first = self._next
        self._lows: deque[tuple[int, float]] = deque()  # What may yet be the least: rising, each later than the last
        self._highs: deque[tuple[int, float]] = deque()
        self._sums = dict.fromkeys(summed, 0.0)
        self._errors = dict.fromkeys(summed, 0.0)  # No sum is further off

    def is_of(self, rows: Sequence[Sequence[float]], count: int) -> bool:
        """Whether it follows these very rows."""
        return self._rows is rows and self._count == count

    def follow(self) -> None:
        """Take in the rows since the last time."""
        for index in range(self._next, len(self._rows)):
            row = self._rows[index]
            left = self._rows[index - self._count] if index - self._count >= self._first else None
            value = row[self._bounded]
            while self._lows and self._lows[-1][1] >= value:
                self._lows.pop()
            while self._highs and self._highs[-1][1] <= value:
                self._highs.pop()
            for ends in (self._lows, self._highs):
                ends.append((index, value))
                if ends[0][0] <= index - self._count:
                    ends.popleft()
            for column in self._sums:
                change = row[column] - (left[column] if left is not None else 0.0)
                self._sums[column] += change
                self._errors[column] += 2.0**-52 * (abs(self._sums[column]) + abs(change))
        self._next = len(self._rows)

    @property
    def extremes(self) -> tuple[float, float]:
        """The least and the largest value."""
        return self._lows[0][1], self._highs[0][1]

    def may_be(self, column: int, value: float, within: float) -> bool:
        """Whether the mean of `column` may be `within` so much of `value`: False only where it is not."""
        room = within + self._errors[column] / self._count + 1e-9 * (abs(value) + within)
        return not abs(self._sums[column] / self._count - value) > room
