"""What a run is doing, how far it has come and how long it has to go.

Work reports to a `Progress`; the terminal, a log file and a script each have their own. The base class is silent.
```
with make_progress() as progress:
    progress.plan({"prepare": 40.0, "drive 0.1 m/s": 20.0},     # relative costs, for the time of the whole
                  seconds={"report": 30.0})                     # what is known in seconds
    progress.stage("prepare", total=steps)
    progress.update(done)
    progress.message("the bed is settled")
```
Everything is written to stderr; stdout belongs to results.
"""

import sys
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Self, TextIO

from rich.console import Console
from rich.progress import BarColumn, TaskID, TextColumn
from rich.progress import Progress as Bars

__all__ = ["LineProgress", "LiveProgress", "Progress", "duration", "make_progress"]


_SAYS_SOMETHING = 0.03
"""Share of a stage from which on its pace so far is taken for its pace."""


def duration(seconds: float | None) -> str:
    """`seconds` as a person reads it: 0:05, 12:30, 1:02:30; '?' where it is unknown."""
    if seconds is None:
        return "?"
    minutes, second = divmod(round(max(seconds, 0.0)), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"


class Progress:
    """Keeps count, shows nothing. Also the interface that work reports to.

    `stage_fraction`, `fraction` are in 0..1, or None where a total was not given; `remaining()` is in seconds.

    The whole is reckoned in time: a stage that is over counts what it took, the one under way what it seems to take,
    those to come their costs at the rate so far. A stage that was over without an `update` found its work done, as a
    bed in the cache, and says nothing about the rate. A share once shown is never taken back.
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic):
        self._clock = clock
        self._began = self._planned = self._stage_began = clock()
        self._costs: dict[str, float] = {}
        self._seconds: dict[str, float] = {}
        self._took: dict[str, float] = {}  # stages of the plan that are over -> time [s]
        self._idle: set[str] = set()  # those of them that had nothing to do
        self._open = ""  # the stage of the plan that is under way
        self._opened = clock()
        self._worked = False  # whether it has done anything yet
        self._reached = 0.0  # the largest share of the whole that was told
        self.stage_name = ""
        self._total: float | None = None
        self._done = 0.0

    def plan(self, costs: Mapping[str, float], *, seconds: Mapping[str, float] | None = None) -> None:
        """Say which stages are to come and what each costs, in any one unit: the time of the whole follows from it.

        Stages in `seconds` come after those and are known by the time they take. Calling it again starts the reckoning
        afresh: do so once the bed is there and only the runs remain.
        """
        every = dict(costs) | dict(seconds or {})
        if any(not cost >= 0 for cost in every.values()):
            raise ValueError(f"a stage cannot cost less than nothing: {every}")
        self._costs, self._seconds = dict(costs), dict(seconds or {})
        self._took, self._idle, self._reached = {}, set(), 0.0
        self._open = self.stage_name if self.stage_name in every else ""
        self._planned = self._opened = self._clock()

    def stage(self, name: str, total: float | None = None) -> None:
        """Begin the stage `name`, which ends at `total` (in whatever unit `update` counts; None if unknown).

        A stage of the plan ends when the next one of the plan begins; others may come and go within it.
        """
        if name in self._costs or name in self._seconds:
            self._end_stage()
            self._open, self._opened, self._worked = name, self._clock(), False
        self.stage_name, self._total, self._done = name, total, 0.0
        self._stage_began = self._clock()

    def update(self, done: float) -> None:
        """`done` of the stage's total is done (not: more than last time). Less than before is not believed."""
        self._done = max(self._done, float(done))
        self._worked = True

    def message(self, text: str) -> None:
        """Tell the person something: a warning, a finding."""

    def close(self) -> None:
        """End the last stage and tidy up. Called by `with`."""
        self._end_stage()
        self.stage_name = ""

    def _end_stage(self) -> None:
        if self._open:
            self._took[self._open] = self._clock() - self._opened
            if not self._worked:
                self._idle.add(self._open)
        self._open = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def elapsed(self) -> float:
        """Time since this object was made [s]."""
        return self._clock() - self._began

    @property
    def stage_fraction(self) -> float | None:
        """How much of the stage is done, 0..1; None if its total is unknown."""
        if self._total is None or self._total <= 0:
            return None
        return min(max(self._done / self._total, 0.0), 1.0)

    @property
    def fraction(self) -> float | None:
        """How much of the plan is done, 0..1, never less than before; None without a plan."""
        done, whole = self._reckon()
        if whole <= 0:
            return 1.0 if self._took else None
        self._reached = max(self._reached, min(done / whole, 1.0))
        return self._reached

    def _reckon(self) -> tuple[float, float]:
        """What is done and the whole [s], or in the unit of the costs before any time has passed."""
        share = self.stage_fraction if self.stage_name == self._open else None
        spent = self._clock() - self._opened if self._open else 0.0
        seems = spent / share if share is not None and share >= _SAYS_SOMETHING else None
        rate = self._rate(seems)
        done = whole = 0.0
        for name in (*self._costs, *self._seconds):
            expected = self._seconds[name] if name in self._seconds else self._costs[name] * rate
            if name == self._open:
                expected = seems if seems else max(expected, spent)
                done += (share or 0.0) * expected
            elif name in self._took:
                nothing_known = self._clock() <= self._planned
                expected = expected if nothing_known else self._took[name]
                done += expected
            whole += expected
        return done, whole

    def _rate(self, seems: float | None) -> float:
        """Time per unit of cost [s], of the stages that had something to do; 1 before there is one."""
        worked = {name: took for name, took in self._took.items() if name in self._costs and name not in self._idle}
        if seems and self._open in self._costs:
            worked[self._open] = seems
        cost = sum(self._costs[name] for name in worked)
        took = sum(worked.values())
        return took / cost if took > 0 and cost > 0 else 1.0

    def stage_remaining(self) -> float | None:
        """How long the stage has to go [s]; None as long as nothing can be said."""
        return _remaining(self.stage_fraction, self._clock() - self._stage_began)

    def remaining(self) -> float | None:
        """How long the whole plan has to go [s]; None as long as nothing can be said."""
        if not self._says_something():
            return None
        done, whole = self._reckon()
        return max(whole - done, 0.0)

    def _says_something(self) -> bool:
        """Whether anything tells how fast it goes: a stage that did its work, or enough of the one under way."""
        if not self._open:
            return bool(self._took)
        share = self.stage_fraction if self.stage_name == self._open else None
        worked = any(took > 0 for name, took in self._took.items() if name not in self._idle)
        return worked or (share is not None and share >= _SAYS_SOMETHING)


def _remaining(fraction: float | None, elapsed: float) -> float | None:
    return None if not fraction else elapsed * (1.0 - fraction) / fraction


class LineProgress(Progress):
    """Plain lines, for logs and pipes: one when a stage begins, then at most one per `every` seconds."""

    def __init__(
        self, stream: TextIO | None = None, *, every: float = 10.0, clock: Callable[[], float] = time.monotonic
    ):
        super().__init__(clock=clock)
        self._stream = stream or sys.stderr
        self._every = every
        self._last = float("-inf")

    def _write(self, text: str) -> None:
        print(f"[{duration(self.elapsed):>7}] {text}", file=self._stream, flush=True)
        self._last = self._clock()

    def _where(self) -> str:
        parts = []
        if (fraction := self.stage_fraction) is not None:
            parts.append(f"{100 * fraction:.0f} %")
        if (rest := self.stage_remaining()) is not None:
            parts.append(f"{duration(rest)} to go")
        if (whole := self.fraction) is not None:
            parts.append(f"all {100 * whole:.0f} %")
            if (rest := self.remaining()) is not None:
                parts.append(f"{duration(rest)} to go")
        return ", ".join(parts)

    def stage(self, name: str, total: float | None = None) -> None:
        super().stage(name, total)
        where = "" if (whole := self.fraction) is None else f" (all {100 * whole:.0f} %"
        if where:
            where += ")" if (rest := self.remaining()) is None else f", {duration(rest)} to go)"
        self._write(f"{name}{where}")

    def update(self, done: float) -> None:
        super().update(done)
        if self._clock() - self._last >= self._every:
            self._write(f"{self.stage_name}: {self._where() or f'{done:g}'}")

    def message(self, text: str) -> None:
        last = self._last
        self._write(text)
        self._last = last


class LiveProgress(Progress):
    """Bars on a terminal: the whole, where there is a plan, and the stage under way."""

    def __init__(self, console: Console | None = None, *, clock: Callable[[], float] = time.monotonic):
        super().__init__(clock=clock)
        self._bars = Bars(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=30),
            TextColumn("{task.fields[percent]:>5}", markup=False),
            TextColumn("{task.fields[rest]}", markup=False),
            console=console or Console(stderr=True),
            transient=True,
            refresh_per_second=4,
        )
        self._whole: TaskID | None = None
        self._stage: TaskID | None = None
        self._shown = float("-inf")

    def _show(self, task: TaskID, fraction: float | None, rest: float | None) -> None:
        self._bars.update(
            task,
            total=None if fraction is None else 1.0,
            completed=fraction or 0.0,
            percent="" if fraction is None else f"{100 * fraction:.0f} %",
            rest="" if rest is None else f"{duration(rest)} to go",
        )

    def _refresh(self) -> None:
        self._shown = self._clock()
        if self._whole is not None:
            self._show(self._whole, self.fraction, self.remaining())
        if self._stage is not None:
            self._show(self._stage, self.stage_fraction, self.stage_remaining())

    def plan(self, costs: Mapping[str, float], *, seconds: Mapping[str, float] | None = None) -> None:
        super().plan(costs, seconds=seconds)
        if self._whole is None:
            self._whole = self._bars.add_task("all", total=1.0, percent="", rest="")
        self._refresh()

    def stage(self, name: str, total: float | None = None) -> None:
        before, began = self.stage_name, self._stage_began
        super().stage(name, total)
        self._bars.start()
        if before:
            self._bars.console.print(
                f"{before}: {duration(self._clock() - began)}", style="dim", markup=False, highlight=False
            )
        if self._stage is not None:
            self._bars.remove_task(self._stage)
        self._stage = self._bars.add_task(name, total=None, percent="", rest="")
        self._refresh()

    def update(self, done: float) -> None:
        super().update(done)
        if self._clock() - self._shown >= 0.2:
            self._refresh()

    def message(self, text: str) -> None:
        self._bars.console.print(text, markup=False, highlight=False)

    def close(self) -> None:
        super().close()
        self._bars.stop()


def make_progress(stream: TextIO | None = None, *, quiet: bool = False) -> Progress:
    """The `Progress` that suits `stream` (stderr by default): bars on a terminal, lines elsewhere, none if `quiet`."""
    stream = stream or sys.stderr
    if quiet:
        return Progress()
    if stream.isatty():
        return LiveProgress(Console(file=stream))
    return LineProgress(stream)
