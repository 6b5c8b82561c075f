"""The pace of this machine: measured by the runs, kept in the cache, and taken for the next estimate."""

import pytest

from experiments.runs import pace
from experiments.runs.pace import ALIKE, KEPT, LATEST, keep_pace, known_pace
from experiments.runs.progress import Progress


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The file, in a folder of its own, on a quiet machine."""
    monkeypatch.setattr(pace.os, "getloadavg", lambda: (1.0, 1.0, 1.0), raising=False)
    path = tmp_path / "cache" / "pace.json"
    monkeypatch.setattr(pace, "_file", lambda: path)
    return path


def run_at(rate, *, seconds=20, waits=0, grains=10_000, runtime="cpu-2"):
    """A run of so many seconds at so many grain-steps a second, after some of waiting in the same stage."""
    now = [0.0]
    with Progress(clock=lambda: now[0]) as progress:
        progress.stage("bed", total=1.0)
        steps = 0.0
        for tick in range(2 * (seconds + waits)):
            now[0] += 0.5
            steps += 0.5 * rate if tick >= 2 * waits else 1.0
            progress.show_grains(grain_count=grains, awake_count=grains, grain_steps=int(steps), runtime=runtime)


def test_a_run_is_expected_at_the_pace_of_the_one_before_whatever_it_waited_for_compilers(kept):
    assert known_pace("cpu-2", grains=10_000) is None
    run_at(8e6, waits=9)
    assert known_pace("cpu-2", grains=10_000) == pytest.approx(8e6, rel=0.01)
    assert known_pace("cpu-2", grains=10_000 * 0.9 * ALIKE) == pytest.approx(8e6, rel=0.01)
    assert known_pace("cpu-2", grains=10_000 * 1.1 * ALIKE) is None  # a step of a large bed waits for memory
    assert known_pace("cpu-4", grains=10_000) is None


def test_a_run_beside_other_work_does_not_spoil_the_pace_and_an_old_one_is_forgotten(kept):
    run_at(8e6)
    for _ in range(LATEST - 1):
        run_at(2e6)
    assert known_pace("cpu-2", grains=10_000) == pytest.approx(8e6, rel=0.01)
    run_at(2e6)
    assert known_pace("cpu-2", grains=10_000) == pytest.approx(2e6, rel=0.01)


def test_a_short_run_one_in_lammps_and_a_damaged_file_are_no_pace(kept):
    run_at(8e6, seconds=3)
    run_at(8e6, runtime="")
    assert not kept.exists()
    kept.parent.mkdir(parents=True)
    for text in ("", "{", '{"runs": [{"runtime": "cpu-2"}]}', '{"runs": 3}'):
        kept.write_text(text, encoding="utf-8")
        assert known_pace("cpu-2", grains=10_000) is None
    run_at(8e6)
    assert known_pace("cpu-2", grains=10_000) == pytest.approx(8e6, rel=0.01)


def test_the_pace_of_a_busy_machine_is_not_kept(kept, monkeypatch):
    monkeypatch.setattr(pace.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(pace.os, "getloadavg", lambda: (9.0, 1.0, 1.0), raising=False)
    run_at(8e6)
    assert not kept.exists()


def test_the_file_stays_small_and_a_cache_that_cannot_be_written_fails_no_run(kept):
    for k in range(KEPT + 5):
        keep_pace("cpu-2", grains=100.0, rate=1e6 + k)
    assert len(pace._kept()) == KEPT and known_pace("cpu-2", grains=100.0) == 1e6 + KEPT + 4
    kept.unlink()
    kept.mkdir()
    run_at(8e6)
    assert known_pace("cpu-2", grains=10_000) is None
