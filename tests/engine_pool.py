"""Few shapes of the engine for all tests of beds; and a test may ask for another layout: chunks, one grain a chunk.

HEDGEBED_TEST_ARCH says where all beds of the tests are computed: ``cpu``; ``cuda``; or ``gpu-layout``, which is a GPU's
code and layout on the CPU.
"""

from __future__ import annotations

import contextlib
import gc
import os

import pytest

import dem.engine.base
import dem.engine.engine
from dem.engine import runtime

ARCH = os.environ.get("HEDGEBED_TEST_ARCH", "cpu")
ARCHITECTURES = ("cpu", "cuda", "gpu-layout")
LEAST_GRAINS, LEAST_CELLS = 1024, 8192
"""Room in an engine of the tests. Where an engine is large enough it makes no difference to a bed how large it is, and
one that is compiled for the largest bed of most tests serves them all, one after the other."""


class EnginePool:
    """Stands in for ``take_engine`` of ``dem.engine.base``; ``overrides`` go over what the bed asks for."""

    def __init__(self):
        self.overrides: dict = {}
        self.layout: dict = {}
        self._take = dem.engine.base.take_engine

    def __call__(self, owner, **settings):
        return self._take(owner, **(settings | self.layout | self.overrides))

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
    """Engines have room for ``LEAST_GRAINS`` and ``LEAST_CELLS``."""
    capacities = dem.engine.engine.capacities

    def roomy(*counts, gpu):
        found = capacities(*counts, gpu=gpu)
        found["capacity"] = max(found["capacity"], LEAST_GRAINS)
        found["cell_capacity"] = max(found["cell_capacity"], LEAST_CELLS)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dem.engine.engine, "capacities", roomy)
        yield


@pytest.fixture(scope="session", autouse=True)
def test_arch():
    """Beds that would be computed on the CPU are computed where HEDGEBED_TEST_ARCH says."""
    with pytest.MonkeyPatch.context() as patch:
        go_there(patch)
        yield


def go_there(patch: pytest.MonkeyPatch) -> None:
    """Beds made from now on are computed where HEDGEBED_TEST_ARCH says. Raises ValueError: it says something else."""
    if ARCH not in ARCHITECTURES:
        raise ValueError(f"HEDGEBED_TEST_ARCH = {ARCH!r} must be one of {', '.join(ARCHITECTURES)}")
    start, take = runtime.start, dem.engine.base.take_engine

    def start_there(*, arch="cpu", threads=None, precision="float64"):
        return start(arch="cuda" if (ARCH, arch) == ("cuda", "cpu") else arch, threads=threads, precision=precision)

    patch.setattr(runtime, "start", start_there)
    if ARCH == "gpu-layout":
        patch.setattr(dem.engine.base, "take_engine", lambda owner, **given: take(owner, **(given | {"gpu": True})))
        POOL.layout = {"gpu": True}


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
