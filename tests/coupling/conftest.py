"""One engine serves all small beds; a test may ask for another layout of it."""

import pytest
from engine_pool import POOL, roomy_engines

__all__ = ["other_layouts", "roomy_engines"]


@pytest.fixture
def other_layouts():
    """`overrides` of what beds ask of their engines."""
    with POOL.installed() as pool:
        yield pool
