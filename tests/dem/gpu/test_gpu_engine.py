"""A GPU's code (``dem.gpu``), here on a CPU, against the CPU's: motion, sums of forces, losses, and files of the other.

Against a plain double loop, and with all lists checked, the tests of lists have it.
"""

import os

import falling_bed
import numpy as np
import pytest

import dem.engine.engine
import dem.gpu.steps
from dem import Bed
from dem.engine import runtime
from experiments.validate.base import cloud

pytestmark = pytest.mark.cpu_only("a CPU's engine to compare with")
GPU = {"gpu": True, "neighbours_per_grain": 30}


def after(bed, steps):
    """Of a cloud and its ball: all that is to be the same to round-off, after some steps."""
    bed.advance(steps)
    grains = bed.grains()
    return {
        **{name: getattr(grains, name) for name in ("displacement", "velocity", "spin", "force")},
        **{f"{what} on body {b}": bed.reaction(b)[k] for b in (0, 1) for k, what in enumerate(("force", "torque"))},
        "overlap": np.array(bed.max_overlap),
    }


def same(found, wanted, *, within):
    for name, value in wanted.items():
        assert np.abs(found[name] - value).max() <= within * np.abs(value).max(), name


@pytest.mark.long
def test_motion_reactions_and_losses_are_the_cpus_to_round_off(engines):
    """With rolling, the balance of energy and of angular momentum; new lists in between."""
    results = []
    for layout in ({}, GPU):
        engines.overrides = layout
        bed = cloud.make(ball=True)
        bed.track_contact_work()
        lists = bed.list_count
        results.append(after(bed, 150) | {name: np.array(work) for name, work in bed.contact_work.items()})
        results[-1] |= bed.angular_momentum()
        assert bed.list_count > lists + 1 and bed.engine.gpu == bool(layout)
    same(*results, within=1e-9)


@pytest.mark.long
def test_several_steps_in_a_kernel_give_the_bits_of_single_ones(engines, monkeypatch):
    engines.overrides = GPU
    states = []
    for many in (10**9, dem.gpu.steps.STEPS_PER_KERNEL):
        monkeypatch.setattr(dem.gpu.steps, "MANY", many)
        bed = cloud.make(ball=True)
        bed.advance(120)
        bed.advance(3)
        assert bed.steps == 123
        states.append(bed.state())
    assert all(np.array_equal(states[0][name], states[1][name]) for name in states[0])


@pytest.mark.long
@pytest.mark.parametrize("first", ["cpu", "gpu"])
def test_a_file_of_the_one_goes_on_with_the_other(first, engines, tmp_path, monkeypatch):
    """Histories and forces come over: sixty steps later both are the same to round-off."""
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", falling_bed.GRAINS_PER_CHUNK)  # put back at the end
    layouts = {"cpu": {}, "gpu": GPU}
    engines.overrides = layouts.pop(first)
    bed = falling_bed.make(1)
    bed.advance(400)
    path = bed.save(tmp_path / "bed.npz")
    touching = len(bed.state()["slide"])
    bed.max_overlap = 0.0  # what is loaded counts from there
    wanted = after(bed, 60)
    engines.overrides = layouts.popitem()[1]
    other = Bed.load(path, threads=1)
    assert other.engine.gpu != (first == "gpu") and touching > 20
    same(after(other, 60), wanted, within=1e-8)


@pytest.mark.skipif(os.name != "posix", reason="the stand-in is a shell script")
def test_a_bed_too_large_for_the_gpu_is_refused_by_what_the_gpu_has_free(tmp_path, monkeypatch):
    stand_in = tmp_path / "nvidia-smi"
    stand_in.write_text("#!/bin/sh\necho 100\necho 300\n")  # [MiB], of two cards
    stand_in.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(runtime, "_current", runtime.Runtime("cuda", 1, "float64"))
    assert runtime.free_memory() == 300 * 2**20
    runtime.refuse_memory(2**20)
    with pytest.raises(MemoryError, match=r"1 GiB of memory, 0\.293 GiB are free on the GPU"):
        runtime.refuse_memory(2**30)
    stand_in.write_text("#!/bin/sh\nexit 9\n")
    assert runtime.free_memory() is None
    runtime.refuse_memory(2**60)  # unknown: Taichi will say
