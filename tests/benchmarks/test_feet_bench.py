"""`hedgebed bench feet`: small, what it times and what it leaves."""

from itertools import product

import pytest

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

from benchmarks import feet
from experiments.runs.progress import Progress


def test_every_law_is_timed_with_all_feet_in_contact(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("HEDGEBED_BENCH_CALLS", "60")
    monkeypatch.setenv("HEDGEBED_BENCH_ROUNDS", "1")
    bench = feet.run(tmp_path, progress=Progress())
    found = [(case["shape"], case["law"], case["feet"]) for case in bench["cases"]]
    assert {"ellipsoid", "cylinder that lies"} < set(feet.SHAPES) and {"rft", "ground.toml of sand"} < set(feet.LAWS)
    assert found == list(product(feet.SHAPES, feet.LAWS, (1, 6)))
    assert all(case["per_s"] > 0 for case in bench["cases"]) and "feet/s" in capsys.readouterr().out
