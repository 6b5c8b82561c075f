"""Puts the folder of the stand-ins that tests share on the path; the same examples in every run; one thread."""

import os

import pytest
from hypothesis import settings

# A suite that passes here has to pass elsewhere; HYPOTHESIS_PROFILE=search looks for new examples, and more of them.
settings.register_profile("same", derandomize=True, deadline=None, database=None)
settings.register_profile("search", max_examples=1000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(scope="session", autouse=True)
def one_core():
    """Beds and batches that are not told how many threads to take find one core.

    With another number of threads Taichi is started anew and every kernel is compiled again; these beds are too small
    for two, and two workers of pytest-xdist would be in each other's way. What threads do is shown in dem/test_bits.py.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
        yield
