"""Compiled engines, shared between the beds of tests.

Taichi compiles an engine's kernels anew for every bed, which takes seconds, while the beds of most tests differ only
in numbers that live in fields. Within the pool a new bed takes over an engine of the same shape that no bed of the same
test uses, put back to what a new one holds. ``GRAINS_PER_CHUNK`` and ``overrides`` belong to the shape.
"""

from __future__ import annotations

import contextlib

import dem.bed
import dem.engine
from dem import runtime


class EnginePool:
    """Stands in for ``dem.engine.Engine`` while it is installed."""

    def __init__(self):
        self._engines: dict[tuple, list] = {}
        self._busy: set[int] = set()
        self.overrides: dict = {}

    def __call__(self, **settings):
        settings |= self.overrides
        shape = (runtime.generation(), dem.engine.GRAINS_PER_CHUNK, repr(sorted(settings.items(), key=lambda s: s[0])))
        for engine in self._engines.setdefault(shape, []):
            if id(engine) not in self._busy:
                clear(engine)
                break
        else:
            engine = dem.engine.Engine(**settings)
            self._engines[shape].append(engine)
        self._busy.add(id(engine))
        return engine

    @contextlib.contextmanager
    def installed(self, *, keep: bool = False):
        """Beds made inside take engines from here; they are free again at the end, unless they are to be kept."""
        busy, real = set(self._busy), dem.bed.Engine
        dem.bed.Engine = self
        try:
            yield self
        finally:
            dem.bed.Engine = real
            self.overrides = {}
            if not keep:
                self._busy = busy


def clear(engine) -> None:
    """Whatever a bed reads before it writes it, as in a new engine."""
    for name in ("pair_start", "pair_end", "overlap"):
        getattr(engine, name).fill(0)
    engine.clear_pushes()
    for name in ("body_count", "moved", "halted", "done"):
        getattr(engine, name)[None] = 0
    engine.problem[None] = [0, 0]
    engine.ticket[0] = engine.ticket[1] = 0


POOL = EnginePool()
