"""The same bits: on any number of threads, after a restore, after a load elsewhere, after kill -9; chunks agree."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import falling_bed
import numpy as np
import pytest
import solid_shapes

import dem.engine.engine
from dem import Bed, Mesh

ROOT = Path(__file__).resolve().parents[3]
STEPS, EVERY = 900, 100


@pytest.fixture(autouse=True)
def chunks(monkeypatch):
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", falling_bed.GRAINS_PER_CHUNK)


def elsewhere(*arguments, **environment) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, falling_bed.__file__, *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])} | environment,
        stdout=subprocess.PIPE,
        text=True,
    )


def finish(process) -> dict[int, str]:
    """Digests by step that a process said."""
    said = process.communicate()[0]
    assert process.returncode == 0
    return {int(step): digest for step, digest in (line.split() for line in said.splitlines())}


@pytest.fixture(scope="module")
def one_thread(tmp_path_factory):
    """A process with one thread that runs to the end, while this one works."""
    path = tmp_path_factory.mktemp("bits") / "bed.npz"
    return elsewhere("fresh", path, STEPS, 1, EVERY), path


@pytest.fixture(scope="module")
def two_threads(one_thread):
    """Digests of a run in this process, with two threads, at every look; the file of its middle."""
    middle = one_thread[1].with_name("middle.npz")
    dem.engine.engine.GRAINS_PER_CHUNK, kept = falling_bed.GRAINS_PER_CHUNK, dem.engine.engine.GRAINS_PER_CHUNK
    bed = falling_bed.make(2)
    dem.engine.engine.GRAINS_PER_CHUNK = kept
    digests, states = {}, {}
    while bed.steps < STEPS:
        bed.advance(EVERY)
        digests[bed.steps] = falling_bed.digest(bed)
        states[bed.steps] = bed.state()
        if bed.steps == 400:
            bed.save(middle)
    bed.save(middle.with_name("end.npz"))
    assert bed.engine.chunk_count == (300 if bed.engine.gpu else 8) and bed.list_count > 4
    assert np.linalg.norm(bed.reaction(1)[0]) > 1e-3
    return bed, digests, states, middle


def test_one_thread_in_another_process_gives_the_same_bits(one_thread, two_threads):
    assert finish(one_thread[0]) == two_threads[1]


@pytest.mark.long
@pytest.mark.parametrize("cohesion", ["dmt", "jkr"])
def test_cohesive_grains_keep_their_bits_too(cohesion, tmp_path):
    """One thread elsewhere, two here; and from a file of the middle."""
    elsewhere_too = elsewhere("fresh", tmp_path / "other.npz", 300, 1, 100, cohesion)
    bed = falling_bed.make(2, cohesion=cohesion)
    digests, loaded = {}, {}
    for step in (100, 200, 300):
        bed.advance(100)
        digests[step] = falling_bed.digest(bed)
        if step == 100:
            bed.save(tmp_path / "bed.npz")
    assert (bed.grains().coordination > 0).mean() > 0.2
    again = Bed.load(tmp_path / "bed.npz", threads=2)
    assert again.material == bed.material and again.material.cohesion == cohesion
    for step in (200, 300):
        again.advance(100)
        loaded[step] = falling_bed.digest(again)
    assert loaded == {step: digests[step] for step in (200, 300)}
    assert finish(elsewhere_too) == digests


@pytest.mark.long
@pytest.mark.skipif(not find_spec("quadrants"), reason="quadrants is not installed: pip install 'hedgebed[quadrants]'")
@pytest.mark.parametrize("kind", [("none", "spike"), ("jkr", "spike"), ("none", "solids", "sleep")])
def test_the_fork_of_taichi_gives_the_same_bits(kind, tmp_path):
    both = {
        taichi: elsewhere("fresh", tmp_path / f"{taichi}.npz", 300, 1, 100, *kind, HEDGEBED_TAICHI=taichi)
        for taichi in ("taichi", "quadrants")
    }
    digests = {taichi: finish(process) for taichi, process in both.items()}
    assert len(digests["taichi"]) == 3 and digests["quadrants"] == digests["taichi"]


@pytest.mark.long
def test_a_body_of_meshes_and_turned_boxes_keeps_the_bits_too(tmp_path):
    """One thread elsewhere, two here; from a file of the middle; and back after the table held another mesh."""
    elsewhere_too = elsewhere("fresh", tmp_path / "other.npz", 300, 1, 100, "none", "solids")
    bed = falling_bed.make(2, body="solids")
    digests, again = {}, {}
    for step in (100, 200, 300):
        bed.advance(100)
        digests[step] = falling_bed.digest(bed)
        if step == 100:
            bed.save(tmp_path / "bed.npz")
            state = bed.state()
    assert np.linalg.norm(bed.reaction(1)[0]) > 1e-3 and bed.list_count > 2
    loaded = Bed.load(tmp_path / "bed.npz", threads=2)
    assert loaded.add_body(Mesh(*solid_shapes.box((0.001, 0.002, 0.003))), position=(0.0, 0.0, 0.15)) == 2
    loaded.restore(state)
    for step in (200, 300):
        loaded.advance(100)
        again[step] = falling_bed.digest(loaded)
    assert again == {step: digests[step] for step in (200, 300)}
    fewer = loaded.without(np.arange(300) == 7)
    assert np.array_equal(fewer.state()["mesh_vertices"], state["mesh_vertices"])
    fewer.advance(20)
    assert finish(elsewhere_too) == digests


@pytest.mark.long
@pytest.mark.parametrize("version", [1, 2, 3])
def test_a_file_of_an_older_format_is_read(two_threads, tmp_path, version):
    """Format 3: springs are not rescaled. 2: contacts do not remember their last step. 1: no word of cohesion."""
    bed, _, states, middle = two_threads
    with np.load(middle) as file:
        old = {name: file[name] for name in file.files}
    assert str(old["format"]) == "hedgebed-bed/4" and old["material_numbers"][-1] == 0
    del old["tangential"]
    if version < 3:
        old |= {f"state.{name}": old[f"state.{name}"][:, :3] for name in ("slide", "near_slide")}
    if version == 1:
        del old["cohesion"]
        old |= {"material_numbers": old["material_numbers"][:-1]}
    old |= {"format": np.array(f"hedgebed-bed/{version}")}
    np.savez(tmp_path / "old.npz", **old)
    again = Bed.load(tmp_path / "old.npz", threads=2)
    assert again.material == replace(bed.material, tangential="displacement")
    assert np.array_equal(again.state()["slide"][:, :3], old["state.slide"][:, :3])
    assert again.state()["slide"][:, 3].any() == (version == 3)
    for name in ("position", "velocity", "spin", "force", "near_grain"):
        assert np.array_equal(again.state()[name], states[400][name]), name
    again.advance(EVERY)


def test_restore_goes_on_to_the_same_bits(two_threads):
    bed, digests, states, _ = two_threads
    bed.restore(states[500])
    assert falling_bed.digest(bed) == digests[500]
    for step in (600, 700, 800):
        bed.advance(EVERY)
        assert falling_bed.digest(bed) == digests[step]


def test_the_bits_do_not_depend_on_how_a_run_is_cut(two_threads):
    bed, digests, states, _ = two_threads
    bed.restore(states[200])
    for steps in (1, 2, 3, 57, 36, 1):
        bed.advance(steps)
    bed.advance(EVERY)
    assert falling_bed.digest(bed) == digests[400]


@pytest.mark.long
def test_kill_9_and_resume_gives_the_bits_of_a_run_without(two_threads, tmp_path):
    """Killed in mid-run, at whatever it does after its third save; what it left is resumed elsewhere."""
    _, digests, _, middle = two_threads
    path = tmp_path / "bed.npz"
    path.write_bytes(middle.read_bytes())
    first = elsewhere("resume", path, 1_000_000, 1, EVERY)
    lines = [first.stdout.readline().split() for _ in range(2)]
    first.send_signal(signal.SIGKILL)
    first.communicate()
    assert [digests[int(step)] for step, _ in lines] == [digest for _, digest in lines]
    left = Bed.load(path, threads=2)
    assert left.steps >= int(lines[-1][0])
    del left
    if not 600 <= int(np.load(path)["state.numbers"][0]) < STEPS:
        pytest.fail("the process ran on past the end before it was killed")
    resumed = finish(elsewhere("resume", path, STEPS, 1, EVERY))
    assert resumed[STEPS] == digests[STEPS]


def test_load_in_this_process_goes_on_to_the_same_bits(two_threads):
    _, digests, _, middle = two_threads
    bed = Bed.load(middle, threads=2)
    assert falling_bed.digest(bed) == digests[400]
    for step in (500, 600):
        bed.advance(EVERY)
        assert falling_bed.digest(bed) == digests[step]


@pytest.mark.long
@pytest.mark.cpu_only("chunks")
def test_a_file_goes_on_in_other_chunks_to_round_off(two_threads, monkeypatch):
    """A bed saved in eight chunks, loaded into two: histories find their rows."""
    _, _, states, end = two_threads
    end = end.with_name("end.npz")
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 150)
    bed = Bed.load(end, threads=2)
    assert bed.engine.chunk_count == 2
    touching = len(states[STEPS]["slide"])
    assert touching > 40
    bed.advance(60)
    other = bed.grains()
    monkeypatch.undo()
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", falling_bed.GRAINS_PER_CHUNK)
    same = Bed.load(end, threads=2)
    same.advance(60)
    grains = same.grains()
    for name in ("velocity", "spin", "force"):
        assert np.abs(grains[name] - other[name]).max() <= 1e-9 * np.abs(grains[name]).max(), name


@pytest.mark.parametrize("loss", ["truncated", "garbage", "bit", "missing", "absent"])
def test_a_file_that_is_no_bed_is_refused(two_threads, tmp_path, loss):
    path, whole = tmp_path / "bed.npz", two_threads[3].read_bytes()
    if loss == "truncated":
        path.write_bytes(whole[: len(whole) // 2])
    elif loss == "garbage":
        path.write_bytes(b"not a bed")
    elif loss == "bit":
        half = len(whole) // 2
        path.write_bytes(whole[:half] + bytes([whole[half] ^ 1]) + whole[half + 1 :])
    elif loss == "missing":
        with np.load(two_threads[3]) as file:
            np.savez(path, **{name: file[name] for name in file.files if name != "state.pair"})
    with pytest.raises(ValueError, match=r"bed\.npz"):
        Bed.load(path, threads=2)


def test_a_state_of_another_bed_is_refused(two_threads):
    bed, _, states, _ = two_threads
    fewer = states[100] | {"id": states[100]["id"][:-1]}
    with pytest.raises(ValueError, match="299 grains"):
        bed.restore(fewer)
    single = states[100] | {"position": states[100]["position"].astype(np.float32)}
    with pytest.raises(ValueError, match="float32"):
        bed.restore(single)
