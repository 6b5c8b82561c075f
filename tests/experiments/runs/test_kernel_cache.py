"""A killed process must not switch off the cache of compiled kernels."""

import os
import time

import pytest

from experiments.runs.kernel_cache import free_kernel_cache


@pytest.mark.parametrize("names", ["ticache.lock T1.tic T2.tic T3.tic", "qdcache.lock T1.qdc T2.qdc T3.qdc"])
def test_a_lock_left_by_a_killed_process_is_removed_with_what_it_left_empty_and_one_in_use_stays(names, tmp_path):
    """Taichi's lock is a file that is there; without it Taichi reads the cache again."""
    lock, empty, new, whole = (tmp_path / name for name in names.split())
    for file in (lock, empty, new):
        file.touch()
    whole.write_bytes(b"kernel")
    assert not free_kernel_cache(tmp_path) and lock.exists()
    an_hour_ago = time.time() - 3600
    for file in (lock, empty, whole):
        os.utime(file, (an_hour_ago, an_hour_ago))
    assert free_kernel_cache(tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == [new.name, whole.name]
    assert not free_kernel_cache(tmp_path)
