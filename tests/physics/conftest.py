"""The bed may be asked for other layouts of its engine, and has a cache of its own, in every test of physics."""

import gc

import pytest
from engine_pool import POOL


@pytest.fixture(scope="session", autouse=True)
def quick_collection():
    gc.collect()
    gc.freeze()  # what was imported need not be looked through again and again


@pytest.fixture(autouse=True)
def engines(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "cache"))
    with POOL.installed() as pool:
        yield pool
    gc.collect()  # beds that a traceback held give their engines back, to be used again instead of compiled anew
