"""The bed may be asked for other layouts of its engine, and has a cache of its own, in every test of the bed."""

import pytest
from engine_pool import POOL


@pytest.fixture(autouse=True)
def engines(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "cache"))
    with POOL.installed() as pool:
        yield pool
