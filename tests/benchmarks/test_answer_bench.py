"""The push of a spike, by us and by a peer: what is said of it, and a tiny one from end to end."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from race_stacks import stack

import benchmarks.answer as bench
from benchmarks.race import table
from benchmarks.race.entrants import PeerError
from benchmarks.race.pushing import SAMPLES, Push, Pushed, read_push
from experiments.runs.progress import Progress

KEYS = {"ours_s", "peer_s", "ratio", "force_difference", "awake_force_difference", "sleep_force_difference", "part",
        "extrapolated", "grain_steps", "all_awake", "steps", "curve"}  # fmt: skip
LOOP = "Loop time of {} on 2 procs for {} steps with 1000 atoms\n"


def test_a_push_begins_above_the_grains_and_is_cut_into_equal_parts():
    push = Push(radius=0.004, depth=0.01, speed=0.1, settle=250, points=30)
    assert push.every % SAMPLES == 0 and push.steps == 30 * push.every
    assert push.steps * 1e-5 * 0.1 == pytest.approx(0.01, rel=0.1)
    assert push.settling >= 250 and push.settling % push.every == 0
    grains = stack()
    x, y, tip = push.start(grains)
    assert (x, y) == pytest.approx([0.5 * length for length in grains.period])
    assert tip > (grains.positions[:, 2] + grains.radii).max()


def test_the_answer_has_the_peers_time_for_the_whole_and_forces_where_both_have_run():
    push = Push(radius=0.004, depth=0.01, speed=0.1, settle=0, points=4)
    ours = Pushed(np.array([1.0, 3.0, 5.0, 9.0]), wall=2.0, grain_steps=1000)
    awake = Pushed(np.array([1.0, 1.0]), wall=3.0, grain_steps=2000)
    peer = Pushed(np.array([2.0, 2.0]), wall=5.0, grain_steps=2000, command="lmp")
    answer = bench.answer_of(stack(), push, ours, awake, peer)
    assert set(answer) >= KEYS
    assert (answer["ours_s"], answer["peer_s"], answer["ratio"], answer["awake_s"]) == (2.0, 10.0, 5.0, 6.0)
    assert (answer["part"], answer["extrapolated"]) == (0.5, True)
    assert answer["force_difference"] == pytest.approx(0.0)
    assert answer["force_scatter"] == pytest.approx(0.5)
    assert answer["awake_force_difference"] == pytest.approx(-0.5)
    assert answer["sleep_force_difference"] == pytest.approx(1.0)
    assert answer["all_awake"] == 320 * push.steps
    alone = bench.answer_of(stack(), push, ours, awake, None)
    assert alone["peer_s"] is alone["ratio"] is alone["force_difference"] is None
    assert set(alone) == set(answer)


def test_a_log_without_a_push_is_refused():
    assert read_push(LOOP.format(1.5, 100) + LOOP.format(2.5, 300), 300) == 2.5
    for log in ("", LOOP.format(1.5, 300), LOOP.format(1.5, 100) + LOOP.format(2.5, 200)):
        with pytest.raises(PeerError, match="holds no push of 300 steps"):
            read_push(log, 300)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"depth": "deep"}, "depth = 'deep'"),
        ({"speed": "0"}, "speed = '0'"),
        ({"part": "1.5"}, "part = 1.5"),
        ({"part": "0.01", "points": 10}, "part = 0.01"),
        ({"depth": "0.02"}, "depth = 0.02 m: the spike would end"),
        ({"depth": "0.001", "radius": "0.01"}, "radius = 0.01 m: the spike is wider"),
    ],
)
def test_a_push_that_cannot_be_is_refused_by_name(options, said, monkeypatch, tmp_path):
    monkeypatch.setattr(bench, "prepare_grains", lambda count, **more: stack())
    with pytest.raises(ValueError, match=said):
        bench.run(tmp_path, progress=Progress(), **options)


def test_a_kept_tumble_says_how_many_grain_steps_it_took(tmp_path):
    assert bench.tumble_of(tmp_path) is None
    (tmp_path / "result.json").write_text(json.dumps({"grains": {"grain_steps": 2e9, "grain_steps_all_awake": 2.5e10}}))
    found = bench.tumble_of(tmp_path)
    assert (found["case"], found["times_fewer"]) == (tmp_path.name, 12.5)


@pytest.mark.long
@pytest.mark.skipif(not (shutil.which("lmp") and shutil.which("mpirun")), reason="a push in LAMMPS: apt install lammps")
def test_a_push_into_a_stack_meets_the_same_force_in_lammps(monkeypatch, tmp_path, capfd):
    """A stack in which layers press on one another gives way as springs do; LAMMPS samples where ours is a mean."""
    monkeypatch.setattr(bench, "prepare_grains", lambda count, **more: stack())
    threads = min(2, len(os.sched_getaffinity(0)))
    found = bench.run(
        tmp_path, progress=Progress(), grains=320, radius="0.003", depth="0.0004", speed="0.05", part="0.5", settle=100,
        points=10, threads=threads,
    )  # fmt: skip
    answer = found["answer"]
    assert found["remarks"] == [] or all("busy" in remark for remark in found["remarks"])
    assert answer["ratio"] > 0 and answer["extrapolated"]
    assert abs(answer["awake_force_difference"]) < 0.1
    assert answer["grain_steps"] <= answer["all_awake"]
    assert len(answer["curve"]["ours"]) == 10 and len(answer["curve"]["peer"]) == 5
    assert "bench answer" in table.marks_of(found)[0]
    assert "LAMMPS" in table.markdown(found)
    assert capfd.readouterr().out
    assert list(Path(tmp_path).iterdir()) == []
