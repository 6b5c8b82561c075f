"""Lets a test ask for another layout of the engine: chunks, one grain a chunk as on a GPU."""

from __future__ import annotations

import contextlib

import dem.bed


class EnginePool:
    """Stands in for ``dem.bed.take_engine`` while it is installed; ``overrides`` go over what the bed asks for."""

    def __init__(self):
        self.overrides: dict = {}
        self._take = dem.bed.take_engine

    def __call__(self, owner, **settings):
        return self._take(owner, **(settings | self.overrides))

    @contextlib.contextmanager
    def installed(self, *, keep: bool = False):
        """Beds made inside have the overrides."""
        real, dem.bed.take_engine = dem.bed.take_engine, self
        try:
            yield self
        finally:
            dem.bed.take_engine = real
            self.overrides = {}


POOL = EnginePool()
