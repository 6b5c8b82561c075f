"""Engines from the pool, and a cache of one's own, for every test of physics."""

import pytest
from engine_pool import POOL


@pytest.fixture(autouse=True)
def engines(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "cache"))
    with POOL.installed() as pool:
        yield pool
