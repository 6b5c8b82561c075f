"""Where the time of a step goes: in our bed, and in the loop in plain C beside it.

Our steps are one kernel, so nothing in it is timed. The same state is stepped with a time step of 0, in which grains
stay where they are. The time of a phase is found by leaving it out:

* **all**: a step of the race, lists and all;
* **moving**: a step of the bed that stands still, with lists made for grains so small that they have no row. It holds
  bodies, launches, and the threads' waiting between two phases;
* **contacts found**: a step with the race's lists and grains smaller by a tenth, so that every row is read and nothing
  touches, less that;
* **contact forces**: a step of the bed as it is, less both;
* **sorting, making lists**: their kernels, times the lists that a step needed;
* **else** (inferred): what is left of a step: contacts that come and go, Python, threads that wait longer.

The loop in C has a clock in it, which its waiting threads stop. All in ns of thread time for a grain and a step: of
one thread of ours processor time, so that other jobs do not spoil it; else wall time times threads, which holds their
waiting.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.race.entrants import Ours
from benchmarks.race.grains import Grains, coordination, wrapped
from benchmarks.race.table import PHASES
from benchmarks.race.yardstick import Yardstick, compile_yardstick
from dem import Bed
from experiments.runs.types import Json

__all__ = ["profile_bed"]

_NOTHING = 1e-30  # a time step in which nothing happens [s]
_SHRINK, _DOTS = 0.9, 0.01
_LIST_KERNELS = {"keep_lists": "listing", "sort": "sorting", "make_lists": "listing"}
_SKIN = 2e-4  # of the C loop's lists [m]

_Clock = Callable[[], float]


def profile_bed(grains: Grains, *, steps: int, repeats: int, threads: int, folder: Path) -> tuple[Json, list[str]]:
    """What bench.json has of one bed's profile, and what is to be said.

    ``steps``: of the race. ``repeats``: of each kernel; the least counts. ``threads``: besides one. ``folder``: for the
    files of the C loop.
    """
    columns, counts = [], {}
    for count in sorted({1, threads}):
        ours = Ours(grains, threads=count)
        columns.append({"name": "hedgebed", "threads": count} | _ours(ours, steps, repeats))
        counts = _counts(ours.warmed())
    program, said = compile_yardstick(folder)
    if program is not None:
        for blocks in (True, False):
            for count in sorted({1, threads}):
                loop = Yardstick(
                    grains, program=program, folder=folder, threads=count, blocks=blocks, skin=_SKIN
                )  # fmt: skip
                columns.append({"name": loop.name, "threads": count} | _theirs(loop, steps, _few(repeats)))
    bed = {"grain_count": grains.count, "steps": steps, "counts": counts, "columns": columns}
    return bed, [said] if said else []


def _ours(ours: Ours, steps: int, repeats: int) -> Json:
    """Phases of our bed, and rows and touching pairs."""
    clock = time.process_time if ours.threads == 1 else time.perf_counter
    lives = []
    for _ in range(_few(repeats)):
        bed = ours.warmed()
        lists, began = bed.list_count, clock()
        bed.advance(steps)
        lives.append(clock() - began)
        lists = bed.list_count - lists
    with _stopwatch(bed.engine, _LIST_KERNELS, clock) as spent:
        for _ in range(repeats):
            bed.make_lists()
    listing = {phase: lists / steps * min(_sums(spent, phase)) for phase in ("sorting", "listing")}
    step, bed.time_step = bed.time_step, _NOTHING
    try:
        full = _frozen(bed, steps, repeats, clock)
        position = bed.engine.read("position")
        bed.engine.write("position", position * [1.0, 1.0, 1.0, _SHRINK])
        apart = _frozen(bed, steps, repeats, clock)
        bed.engine.write("position", position * [1.0, 1.0, 1.0, _DOTS])
        bed.make_lists()
        alone = _frozen(bed, steps, repeats, clock)
    finally:
        bed.time_step = step
    # Wall time of a step [s]
    wall = {"finding": apart - alone, "forces": full - apart, "moving": alone, **listing}
    total = min(lives) / steps
    wall["else"] = total - sum(wall.values())
    by_grain = 1e9 * ours.threads / bed.grain_count
    return {
        "phases": {phase: by_grain * value for phase, value in wall.items()}, "total": by_grain * total,
        "lists_per_step": lists / steps,
    }  # fmt: skip


def _few(repeats: int) -> int:
    """How often what takes long is done."""
    return max(2, repeats // 10)


def _frozen(bed: Bed, steps: int, repeats: int, clock: _Clock) -> float:
    """The least time of a step in which nothing moves [s]."""
    bed.compute_forces(_NOTHING)  # contacts that have gone are taken off the lists once
    part = min(steps, 200)
    return _least(lambda: bed.advance(part), _few(repeats), clock) / part


def _counts(bed: Bed) -> Json:
    """Rows of the lists, touching ones and contacts between grains, for each grain."""
    engine, count = bed.engine, bed.grain_count
    bed.make_lists()
    bed.compute_forces()
    start, end, pair = engine.read("pair_start"), engine.read("pair_end"), engine.read("pair")
    rows = np.concatenate([pair[a:b] for a, b in zip(start, end, strict=True)])
    now = bed.grains(contacts=False)
    contacts = 0.5 * coordination(Grains(wrapped(now.position, bed.size[:2]), now.radius, bed.size[:2]))
    touching = int((rows < 0).sum()) / count
    return {
        "rows": len(rows) / count, "touching_rows": touching, "contacts": contacts,
        "computed_twice": touching / contacts - 1, "skin": bed.skin, "chunks": engine.chunk_count,
    }  # fmt: skip


def _theirs(loop: Yardstick, steps: int, repeats: int) -> Json:
    """Phases of the C loop, of its fastest run."""
    heat, told = max((loop.timed(steps) for _ in range(repeats)), key=lambda run: run[0].speed)
    count = loop.grain_count
    by_grain = 1e9 / (count * steps)
    phases = {phase: by_grain * told[phase] for phase in PHASES if phase in told}
    total = 1e9 * loop.threads / heat.speed
    return {
        "phases": phases | {"else": total - sum(phases.values())}, "total": total,
        "lists_per_step": heat.list_count / steps, "rows_looked_at": told["looked_at"] / count,
        "touching_rows": told["touching"] / count,
    }  # fmt: skip


def _least(work: Callable[[], Any], repeats: int, clock: _Clock) -> float:
    """The least time that it takes [s]."""
    times = []
    for _ in range(repeats):
        began = clock()
        work()
        times.append(clock() - began)
    return min(times)


@contextmanager
def _stopwatch(engine: Any, names: dict[str, str], clock: _Clock) -> Iterator[dict[str, list[float]]]:
    """The times of each call of these kernels [s], while it lasts."""
    spent: dict[str, list[float]] = {name: [] for name in names}

    def timed(name: str, kernel: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            began = clock()
            result = kernel(*arguments)
            spent[name].append(clock() - began)
            return result

        return call

    for name in names:
        setattr(engine, name, timed(name, getattr(engine, name)))
    try:
        yield spent
    finally:
        for name in names:
            delattr(engine, name)


def _sums(spent: dict[str, list[float]], phase: str) -> list[float]:
    """The times of a phase's kernels, added up call by call [s]."""
    calls = [spent[name] for name, of in _LIST_KERNELS.items() if of == phase]
    return [sum(parts) for parts in zip(*calls, strict=True)]
