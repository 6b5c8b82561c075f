"""Lets a test ask for another layout of the engine: chunks, one grain a chunk as on a GPU."""

from __future__ import annotations

import contextlib
import gc

import pytest

import dem.bed


class EnginePool:
    """Stands in for ``dem.bed.take_engine`` while it is installed; ``overrides`` go over what the bed asks for."""

    def __init__(self):
        self.overrides: dict = {}
        self._take = dem.bed.take_engine

    def __call__(self, owner, **settings):
        return self._take(owner, **(settings | self.overrides))

    @contextlib.contextmanager
    def installed(self):
        """Beds made inside have the overrides."""
        real, dem.bed.take_engine = dem.bed.take_engine, self
        try:
            yield self
        finally:
            dem.bed.take_engine = real
            self.overrides = {}


POOL = EnginePool()


@pytest.fixture(scope="session", autouse=True)
def quick_collection():
    gc.collect()
    gc.freeze()  # what was imported need not be looked through again and again


@pytest.fixture(autouse=True)
def engines(tmp_path, monkeypatch):
    """The layouts a test may ask for; and a cache of its own for every test."""
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "cache"))
    with POOL.installed() as pool:
        yield pool
    gc.collect()  # beds that a traceback held give their engines back, to be used again instead of compiled anew
