"""The main experiment on real grains, killed (kill -9) in all its parts and resumed to the same bits.

Slow: it takes five processes, each of which compiles the bed anew: 98 s of one core.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

#: 1,735 grains, one seed, one drive, one drop, one set-down.
CASE = """
material = "sand"
bed_size = [0.03, 0.03, 0.0254]
grain = 0.0024
tip_diameter = 0.0075
allow_coarse = true
shaft_length = 0.03
seeds = [1]
speeds = [0.2]
depth = 0.006
hold = 0.005
load = 0.1
mass = 0.05
drop_speeds = [0.1]
after_stop = 0.01
rest_time = 0.01
frame_count = 2
checkpoint_interval = 0.2
"""

#: The command line in a process that finds so many cores and kills itself in the middle of a part of the work: after
#: something was kept there, and a few steps later.
CHILD = """
import itertools, os, signal, sys
from pathlib import Path
part, cores, folder = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
os.sched_getaffinity = lambda pid: set(range(cores))
import dem.prepare.laboratory
from experiments.grains import bed_progress
from experiments.penetrate import experiment as penetrate
dem.prepare.laboratory._KEEP_INTERVAL = 0.2
calls = itertools.count()

def perhaps(kept):
    if kept and next(calls) == 7:
        os.kill(os.getpid(), signal.SIGKILL)

share, bed_share = penetrate.share_done, bed_progress.BedProgress._share

def share_done(run, expected, **options):
    perhaps(run.kind == part and any((folder / "checkpoint").glob(f"*-{run.kind}-*.npz")))
    return share(run, expected, **options)

def share_of_bed(self, done):
    perhaps(part == "bed" and self._part == "settle")
    return bed_share(self, done)

penetrate.share_done, bed_progress.BedProgress._share = share_done, share_of_bed
import experiments.runs.whole_runs
experiments.runs.whole_runs.write_report = lambda *given: None
from experiments.cli.main import main
sys.exit(main(sys.argv[4:]))
"""


def hedgebed(part, cores, folder, cache, *tokens):
    """The child as it ended: a negative returncode is a signal's."""
    return subprocess.run(
        [sys.executable, "-c", CHILD, part, str(cores), str(folder), *map(str, tokens)],
        env=os.environ | {"PYTHONPATH": str(ROOT), "HEDGEBED_CACHE": str(cache)},
        capture_output=True,
        text=True,
    )


@pytest.mark.slow
def test_a_run_killed_in_preparation_drive_and_drop_ends_in_the_same_bits(tmp_path):
    """Every series, frame and number; with one thread and two in turn, beside a run on one that nothing happened to."""
    case, whole, broken = tmp_path / "case.toml", tmp_path / "whole", tmp_path / "broken"
    case.write_text(CASE)
    done = hedgebed("none", 1, whole, tmp_path / "whole-cache", "penetrate", case, "--out", whole)
    assert done.returncode == 0, done.stderr
    cache = tmp_path / "cache"
    for part, cores, tokens in (
        ("bed", 2, ("penetrate", case, "--out", broken)),
        ("driven", 1, ("resume", broken)),
        ("drop", 2, ("resume", broken)),
    ):
        died = hedgebed(part, cores, broken, cache, *tokens)
        assert died.returncode == -signal.SIGKILL, died.stderr
        assert ("drive at 0.2 m/s: goes on at" in died.stderr) == (part == "drop")
        if part == "bed":
            assert list((cache / "unfinished").glob("*.npz")) and not (broken / "checkpoint").exists()
        else:
            assert len(list((broken / "checkpoint").glob(f"seed1-{part}-*.npz"))) == 1
    assert not (broken / "result.json").exists()
    ended = hedgebed("none", 1, broken, cache, "resume", broken)
    assert ended.returncode == 0 and "drop at 0.1 m/s: goes on at" in ended.stderr, ended.stderr
    made = [
        sorted(
            str(path.relative_to(folder))
            for path in folder.rglob("*")
            if path.suffix in (".csv", ".vtu", ".pvd", ".json") and path.name != "status.json"
        )
        for folder in (whole, broken)
    ]
    assert made[0] == made[1] and len(made[0]) > 20 and "result.json" in made[0]
    for name in made[0]:
        assert (whole / name).read_bytes() == (broken / name).read_bytes(), name
