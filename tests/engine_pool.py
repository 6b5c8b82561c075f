"""Few shapes of the engine for all tests of beds; and a test may ask for another layout: chunks, one grain a chunk."""

from __future__ import annotations

import contextlib
import gc

import pytest

import dem.engine.base
import dem.engine.engine

LEAST_GRAINS, LEAST_CELLS = 1024, 8192
"""Room in an engine of the tests. Where an engine is large enough it makes no difference to a bed how large it is, and
one that is compiled for the largest bed of most tests serves them all, one after the other."""


class EnginePool:
    """Stands in for ``take_engine`` of ``dem.engine.base``; ``overrides`` go over what the bed asks for."""

    def __init__(self):
        self.overrides: dict = {}
        self._take = dem.engine.base.take_engine

    def __call__(self, owner, **settings):
        return self._take(owner, **(settings | self.overrides))

    @contextlib.contextmanager
    def installed(self):
        """Beds made inside have the overrides."""
        real, dem.engine.base.take_engine = dem.engine.base.take_engine, self
        try:
            yield self
        finally:
            dem.engine.base.take_engine = real
            self.overrides = {}


POOL = EnginePool()


@pytest.fixture(scope="session", autouse=True)
def roomy_engines():
    """Engines have room for ``LEAST_GRAINS`` and ``LEAST_CELLS``, but for those with one grain a chunk."""
    capacities = dem.engine.engine.capacities

    def roomy(*counts, gpu):
        found = capacities(*counts, gpu=gpu)
        if not gpu:
            found["capacity"] = max(found["capacity"], LEAST_GRAINS)
            found["cell_capacity"] = max(found["cell_capacity"], LEAST_CELLS)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dem.engine.engine, "capacities", roomy)
        yield


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
