"""What a run is doing, how far it has come and how long it has to go.

Work reports to a `Progress`; the terminal, a log file and a script each have their own. The base class is silent.
```
with make_progress() as progress:
    progress.plan({"prepare": 40.0, "drive 0.1 m/s": 20.0},     # relative costs, for the time of the whole
                  seconds={"report": 30.0},                     # what is known in seconds
                  unit=1.5)                                     # a first guess at what a unit of cost takes [s]
    progress.stage("prepare", total=steps)
    progress.update(done)
    progress.message("the bed is settled")
```
Everything is written to stderr; stdout belongs to results.
"""

import math
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task, TaskID, TextColumn
from rich.progress import Progress as Bars
from rich.text import Text

from .pace import PaceMeter

__all__ = ["LineProgress", "LiveProgress", "Progress", "as_expected", "duration", "make_progress"]


_LEAST_SHARE = 0.03  # Share of a stage from which on its pace so far is taken for its pace
_QUICK_START = 1.0  # A stage that reports its first share sooner has gone on from an earlier one's [s]
_GUESSED = 15.0  # A first guess of the rate weighs as much as so much work done [s]
_MOST_SLOWER = 3.0  # Most by which the machine's pace scales times that are known in seconds [1]
_SLOWEST = 3e4
"""Grain-steps in a second of a bed below which kernels are still being compiled [1/s], if all that are awake also make
less than a step in two seconds. A bed on a busy core does 1e6."""
_RECENT = 10.0  # A bed's rate is that of so long before now [s]
_LATE = 0.15  # What a stage that is late is said to take yet, over how late it is [1]


def duration(seconds: float | None) -> str:
    """`seconds` as a person reads it: 0:05, 12:30, 1:02:30; '?' where it is unknown."""
    if seconds is None:
        return "?"
    minutes, second = divmod(round(max(seconds, 0.0)), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"


def _to_go(seconds: float) -> str:
    """The remaining time as text; never zero, which would mean that the work is done."""
    return f"{duration(max(seconds, 1.0))} to go"


def _percent(share: float) -> str:
    """A share as text; only the whole is 100 %."""
    return f"{math.floor(100 * share + 1e-6)} %"


def as_expected(passed: float) -> float:
    """Share done of what nobody knows the end of, when it has taken `passed` times what was expected [1].

    From four fifths on it nears 1 ever more slowly, 0.84 at the time expected, 0.92 at twice that: what is late is
    not said to be over.
    """
    return passed if passed <= 0.8 else 1.0 - 0.16 / passed


@dataclass
class _Pace:
    """How fast one stage goes, from the shares of it that were reported."""

    began: float
    first: tuple[float, float] | None = None  # when it reported its first share [s], and that
    last: float = 0.0  # when it reported its last [s]
    share: float = 0.0

    def report(self, now: float, share: float) -> None:
        self.first = self.first or (now, share)
        self.last, self.share = now, share

    @property
    def gained(self) -> float:
        """What was done since the first share was reported, which may have waited for compilers or a file."""
        return self.share - self.first[1] if self.first else 0.0

    def work(self) -> float | None:
        """How long the whole stage takes at its pace, without what it waited for at first [s]."""
        if self.first is None or self.gained < _LEAST_SHARE:
            return None
        return (self.last - self.first[0]) / self.gained

    def so_far(self) -> float | None:
        """As `work`, where there was hardly more than one share to go by: with what it may have waited for."""
        known = self.first is not None and self.share >= _LEAST_SHARE and self.first[0] - self.began >= _QUICK_START
        return (self.last - self.began) / self.share if known else None

    def over(self, now: float) -> float:
        """`work` of a stage that ends now."""
        if self.first is None or self.work() is None:
            return now - self.began
        return (now - self.first[0]) / (1.0 - self.first[1])


class Progress(AbstractContextManager["Progress"]):
    """Keeps count, shows nothing. Also the interface that work reports to.

    `stage_fraction`, `fraction` are in 0..1, or None where a total was not given; `remaining()` is in seconds.

    The whole is reckoned in time: what has passed over that and what is to come. Stages to come take their costs at the
    rate so far. The one under way moves from its cost to its own pace. A stage that was over without an `update` found
    its work done, as a bed in the cache, and says nothing about the rate. A share once shown is never taken back.
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic):
        self._clock, self._began = clock, clock()
        self.meter = PaceMeter()
        self.stage_name = ""
        self._total: float | None = None
        self._done = 0.0
        self._bed: tuple[int, int, int] | None = None  # grains, those awake, those of them that are slow
        self._worked: deque[tuple[float, float]] = deque()  # when [s], and grain-steps until then
        self._start_reckoning({}, {}, None)
        self._pace = self._opened

    def _start_reckoning(self, costs: Mapping[str, float], seconds: Mapping[str, float], unit: float | None) -> None:
        self._costs, self._seconds, self._unit = dict(costs), dict(seconds), unit
        self._over: set[str] = set()  # stages of the plan that are over
        self._work: dict[str, float] = {}  # those of them that had something to do -> how long it took [s]
        self._open = self.stage_name if self.stage_name in {*costs, *seconds} else ""
        """The stage of the plan that is under way."""
        self._waited = 0.0  # until the first share of all was reported [s]
        self._reached = 0.0  # the largest share of the whole that was reported
        self._planned = self._clock()
        self._opened = _Pace(self._planned)

    def plan(
        self, costs: Mapping[str, float], *, seconds: Mapping[str, float] | None = None, unit: float | None = None
    ) -> None:
        """Announce the stages and the cost of each, in any one unit: the time of the whole follows from it.

        Stages in `seconds` come after those and are known by the time they take. `unit` is the first estimate of the
        time of one unit of cost [s]. Without it no time is shown until there is a pace. A second call starts the
        estimate anew: make it when the bed is ready and only the runs remain.
        """
        every = dict(costs) | dict(seconds or {})
        if any(not cost >= 0 for cost in every.values()):
            raise ValueError(f"a stage cannot cost less than nothing: {every}")
        self._start_reckoning(costs, seconds or {}, unit)

    def expect(self, costs: Mapping[str, float]) -> None:
        """Stages of the plan that have not begun cost this after all; others are left as they are."""
        begun = self._over | {self._open}
        self._costs |= {name: cost for name, cost in costs.items() if name in self._costs and name not in begun}

    def stage(self, name: str, total: float | None = None) -> None:
        """Begin the stage `name`, which ends at `total` (in whatever unit `update` counts; None if unknown).

        A stage of the plan ends when the next one of the plan begins; others may come and go within it.
        """
        self._pace = _Pace(self._clock())
        self._bed = None
        self._worked.clear()
        self.meter.leave()
        if name in self._costs or name in self._seconds:
            self._end_stage()
            self._open, self._opened = name, self._pace
        self.stage_name, self._total, self._done = name, total, 0.0

    def update(self, done: float) -> None:
        """`done` of the stage's total is done (not: more than last time). Less than before is not believed."""
        self._done = max(self._done, float(done))
        share, now = self.stage_fraction, self._clock()
        if not self._counts_down() and (share or 0.0) < _LEAST_SHARE:
            self._waited = now - self._opened.began
        self._pace.report(now, share or 0.0)
        if self._opened is not self._pace and self._opened.first is None:
            self._opened.report(now, 0.0)  # something is done within it

    def show_grains(
        self, *, grain_count: int, awake_count: int, grain_steps: int, slow_count: int = 0, runtime: str = ""
    ) -> None:
        """Say of the stage's bed how many grains it has, how many are awake, how many grain-steps it has done in all.

        ``slow_count``: how many of those awake are computed once in several steps. ``runtime``: what computes them
        (`experiments.runs.pace.runtime_name`); without it their pace is not kept for later runs.

        Before `update`, which shows it; the end of the stage ends it.
        """
        now = self._clock()
        if self._worked and grain_steps < self._worked[-1][1]:  # another bed
            self._worked.clear()
        while len(self._worked) > 1 and now - self._worked[1][0] >= _RECENT:
            self._worked.popleft()
        self._bed = (grain_count, awake_count, slow_count)
        if runtime:
            self.meter.read(now, grain_steps=float(grain_steps), awake=awake_count, runtime=runtime)
        self._worked.append((now, float(grain_steps)))

    @property
    def bed_words(self) -> list[str]:
        """Text on the bed of the stage: grains, shares awake and slow, grain-steps a second; empty without a bed."""
        if self._bed is None:
            return []
        grains, awake, slow = self._bed
        words = [f"{grains:,} grains", f"{_percent(awake / max(1, grains))} awake"]
        words += [f"{_percent(slow / grains)} slow"] if slow else []
        (began, first), (now, last) = self._worked[0], self._worked[-1]
        if now > began:
            rate = (last - first) / (now - began)
            compiles = 0 < rate < min(_SLOWEST, 0.5 * awake)
            words += ["compiling"] if compiles else [f"{rate / 1e6:.3g} million grain-steps/s"] if rate else []
        return words

    def message(self, text: str) -> None:
        """Show the user a message: a warning, a finding."""

    def close(self) -> None:
        """End the last stage and tidy up, and keep the machine's pace. Called by `with`."""
        self._end_stage()
        self.meter.keep()
        self.stage_name = ""

    def _end_stage(self) -> None:
        if self._open:
            self._over.add(self._open)
            if self._opened.first is not None:
                self._work[self._open] = self._opened.over(self._clock())
        self._open = ""

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def elapsed(self) -> float:
        """Time since this object was made [s]."""
        return self._clock() - self._began

    @property
    def stage_worked(self) -> bool:
        """Whether the stage has had anything to do yet."""
        return self._pace.first is not None

    @property
    def stage_fraction(self) -> float | None:
        """How much of the stage is done, 0..1; None if its total is unknown."""
        return min(max(self._done / self._total, 0.0), 1.0) if self._total is not None and self._total > 0 else None

    @property
    def fraction(self) -> float | None:
        """How much of the plan is done, 0..1, never less than before; None without a plan."""
        if not self._costs and not self._seconds:
            return None
        waiting = 0.0 if self._counts_down() else self._clock() - self._opened.began
        rest, spent = self.remaining(), self._clock() - self._planned - self._waited - waiting
        if rest is not None and (spent > 0 or self._over):
            self._reached = max(self._reached, spent / (spent + rest) if rest > 0 else 1.0)
        return self._reached

    def stage_remaining(self) -> float | None:
        """Remaining time of the stage [s]; None while it is unknown."""
        if self._open and self.stage_name == self._open:
            return self._left_of(self._expected(self._open, self._rate()))
        whole = self._pace.work() or self._pace.so_far()
        return None if whole is None else (1.0 - self._pace.share) * whole

    def remaining(self) -> float | None:
        """Remaining time of the whole plan [s]; None while it is unknown."""
        rate, rest = self._rate(), 0.0
        for name in (*self._costs, *self._seconds):
            if name in self._over:
                continue
            expected = self._expected(name, rate)
            left = self._left_of(expected) if name == self._open else expected
            if left is None:
                return None
            rest += left
        return rest

    def _expected(self, name: str, rate: float | None) -> float | None:
        """How long a stage that is not over should take, by the plan [s]; known times on a machine as was guessed."""
        if name in self._seconds:
            slower = rate / self._unit if rate is not None and self._unit else 1.0
            return self._seconds[name] * min(max(slower, 1 / _MOST_SLOWER), _MOST_SLOWER)
        return None if rate is None else self._costs[name] * rate

    def _left_of(self, expected: float | None) -> float | None:
        """How long the stage under way has to go, which by the plan takes `expected` [s].

        Half way through its own pace alone counts. Between two shares time goes on; a stage that is late is not said
        to be over at once.
        """
        pace = self._opened
        own, weight = pace.work(), min(1.0, 2.0 * pace.gained)
        if own is None:
            own, weight = pace.so_far(), 1.0 if expected is None else 0.0
        if own is None and expected is None:
            return None
        whole = own if expected is None else expected if own is None else (1.0 - weight) * expected + weight * own
        assert whole is not None
        left = (1.0 - pace.share) * whole
        passed = self._clock() - (pace.last if pace.first else pace.began) if self._counts_down() else 0.0
        return left - passed if (1.0 + _LATE) * passed < left else _LATE * passed

    def _counts_down(self) -> bool:
        """Whether time that passes is work done: before anything has reported a share, compilers run."""
        return self._opened.first is not None or self._open not in self._costs or bool(self._work)

    def _rate(self) -> float | None:
        """Time per unit of cost [s], of the stages that had something to do and the first guess; None: unknown."""
        took = sum(work for name, work in self._work.items() if name in self._costs)
        cost = sum(self._costs[name] for name in self._work if name in self._costs)
        if self._open in self._costs:
            own, weight = self._opened.work(), self._opened.gained
            if own is None and not cost and self._unit is None:
                own, weight = self._opened.so_far(), 1.0
            if own is not None:
                took, cost = took + weight * own, cost + weight * self._costs[self._open]
        if self._unit is not None:
            took, cost = took + _GUESSED, cost + _GUESSED / self._unit
        return took / cost if took > 0 and cost > 0 else None


class LineProgress(Progress):
    """Plain lines, for logs and pipes: one when a stage begins, then at most one per `every` seconds."""

    def __init__(
        self, stream: TextIO | None = None, *, every: float = 10.0, clock: Callable[[], float] = time.monotonic
    ):
        super().__init__(clock=clock)
        self._stream = stream or sys.stderr
        self._every = every
        self._last = float("-inf")

    def _of_all(self) -> list[str]:
        """The share of the whole and its time to go, as far as they are known."""
        if (whole := self.fraction) is None:
            return []
        return [f"all {_percent(whole)}", *([] if (rest := self.remaining()) is None else [_to_go(rest)])]

    def stage(self, name: str, total: float | None = None) -> None:
        super().stage(name, total)
        where = ", ".join(self._of_all())
        self.message(f"{name} ({where})" if where else name)
        self._last = self._clock()

    def update(self, done: float) -> None:
        super().update(done)
        if self._clock() - self._last >= self._every:
            share, rest = self.stage_fraction, self.stage_remaining()
            where = [] if share is None else [_percent(share)]
            where += [] if rest is None else [_to_go(rest)]
            where += self.bed_words
            self.message(f"{self.stage_name}: {', '.join([*where, *self._of_all()]) or f'{done:g}'}")
            self._last = self._clock()

    def message(self, text: str) -> None:
        print(f"[{duration(self.elapsed):>7}] {text}", file=self._stream, flush=True)


class _ToGo(ProgressColumn):
    """The time to go, counted down while nothing new is reported; never to nothing."""

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock

    def render(self, task: Task) -> Text:
        """See the class."""
        rest, reported = task.fields["rest"], task.fields["reported"]
        if rest is None:
            return Text("")
        passed = max(self._clock() - reported, 0.0)
        return Text(_to_go(rest - passed if passed < (1 - _LATE) * rest else _LATE * rest))


class LiveProgress(Progress):
    """Bars on a terminal: the whole, where there is a plan, and the stage under way."""

    def __init__(self, console: Console | None = None, *, clock: Callable[[], float] = time.monotonic):
        super().__init__(clock=clock)
        self._bars = Bars(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=30),
            TextColumn("{task.fields[percent]:>5}", markup=False),
            _ToGo(clock),
            TextColumn("{task.fields[bed]}", markup=False),
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
            percent="" if fraction is None else _percent(fraction),
            rest=rest,
            bed=", ".join(self.bed_words) if task == self._stage else "",
            reported=self._clock() if self._counts_down() else math.inf,
        )

    def _refresh(self) -> None:
        self._shown = self._clock()
        if self._whole is not None:
            self._show(self._whole, self.fraction, self.remaining())
        if self._stage is not None:
            self._show(self._stage, self.stage_fraction, self.stage_remaining())

    def plan(
        self, costs: Mapping[str, float], *, seconds: Mapping[str, float] | None = None, unit: float | None = None
    ) -> None:
        super().plan(costs, seconds=seconds, unit=unit)
        if self._whole is None:
            self._whole = self._bars.add_task("all", total=1.0, percent="", rest=None, bed="", reported=0.0)
        self._refresh()

    def stage(self, name: str, total: float | None = None) -> None:
        before, began = self.stage_name, self._pace.began
        super().stage(name, total)
        self._bars.start()
        if before:
            self._bars.console.print(
                f"{before}: {duration(self._clock() - began)}", style="dim", markup=False, highlight=False
            )
        if self._stage is not None:
            self._bars.remove_task(self._stage)
        self._stage = self._bars.add_task(name, total=None, percent="", rest=None, bed="", reported=0.0)
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
