"""Taichi's threads: a core for each worker, where there are as many."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dem.engine import runtime

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system pins no threads"),
    pytest.mark.cpu_only("threads"),
]


def test_workers_get_a_core_each_only_where_there_are_as_many_cores(monkeypatch):
    put = []
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5})
    monkeypatch.setattr(os, "sched_setaffinity", lambda thread, cores: put.append((thread, cores)))
    for workers in ([], [70], [70, 71, 72]):
        runtime._keep_apart(workers)
    assert put == []
    runtime._keep_apart([70, 71])
    assert put == [(70, {3}), (71, {5})]


def test_a_core_that_is_refused_is_no_failure(monkeypatch):
    def refused(thread, cores):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1})
    monkeypatch.setattr(os, "sched_setaffinity", refused)
    runtime._keep_apart([70, 71])


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no list of threads")
def test_the_threads_that_taichi_starts_for_its_loops_are_the_ones_that_are_pinned(tmp_path):
    """In a process of its own: Taichi is started once in this one."""
    if (os.cpu_count() or 1) < 2:
        pytest.skip("one core: nothing is pinned")
    code = """
import os
from dem.engine import runtime
put = {}
pin = os.sched_setaffinity
os.sched_setaffinity = lambda thread, cores: (put.update({thread: cores}), pin(thread, cores))
runtime.start()
from hedgebed_taichi import ti
total = ti.field(ti.f64, 1 << 16)

@ti.kernel
def work(turns: int):
    for i in range(1 << 16):
        x = 0.0
        for j in range(turns):
            x += ti.sin(x + j)
        total[i] = x

def used(thread):
    return int(open(f"/proc/self/task/{thread}/schedstat").read().split()[0])

work(1)
before = {thread: used(thread) for thread in put}
work(300)
assert len(put) == len(os.sched_getaffinity(0)), put
assert all(used(thread) - spent > 1e6 for thread, spent in before.items()), "a pinned thread did nothing"
assert all(os.sched_getaffinity(thread) == cores for thread, cores in put.items())
"""
    script = tmp_path / "pinned.py"
    script.write_text(code, encoding="utf-8")
    root = Path(__file__).resolve().parents[3]
    said = subprocess.run([sys.executable, str(script)], cwd=root, env=os.environ | {"PYTHONPATH": str(root)},
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert said.returncode == 0, said.stderr
