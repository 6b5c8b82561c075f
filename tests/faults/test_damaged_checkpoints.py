"""Checkpoints of a push into grains that are cut off or have a wrong bit: the run goes on from the one before.

On our bed it ends in the bits of the run that was never stopped. LAMMPS' restart file is one array of a checkpoint of
ours, a zip file with a checksum for each array. Resumed twice from the same checkpoint on one rank, LAMMPS has the same
numbers, so the series tells from which checkpoint a run went on.
"""

import os
import random
import shutil
from contextlib import contextmanager, redirect_stderr
from itertools import count
from pathlib import Path

import pytest
from faults.damaged_folders import case
from faults.test_damage import damaged
from small_cases import GRAINS

import experiments.penetrate.experiment
from coupling.lammps import LammpsMissingError, find_lammps
from experiments.cli.main import main
from experiments.runs import folder, whole_runs

DAMAGES = int(os.environ.get("HEDGEBED_DAMAGES", "3"))
ON_OUR_BED = GRAINS.replace("depth = 0.006", "depth = 0.004") + """
grain = 0.004
seeds = [1]
speeds = [0.4]
hold = 0.0
drop_speeds = []
young = 2e7
"""  # fmt: skip
CASE = (
    ON_OUR_BED
    + """
ground = "lammps"
ranks = 1
"""
)
NEWEST, BEFORE = (Path("run/checkpoint/seed1-driven-0.4.npz" + end) for end in ("", ".before"))
SERIES = Path("run/series/seed1-driven-0.4.csv")


@contextmanager
def stopped_after(steps):
    """Within, a run is told to stop after so many steps of its body."""

    @contextmanager
    def held_back():
        asked = count(1)
        yield lambda: next(asked) > steps

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiments.penetrate.experiment, "held_back", held_back)
        yield


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A run in LAMMPS that was stopped twice in its push: it has two checkpoints, which no test changes."""
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    return stopped_twice(CASE, tmp_path_factory.mktemp("whole") / "stopped")


def stopped_twice(text, home):
    """`home`, with the run of a case that was stopped twice in its push."""
    home.mkdir()
    with pytest.MonkeyPatch.context() as patch, stopped_after(40):
        patch.setattr(whole_runs, "write_report", lambda *given: None)
        patch.setenv("HEDGEBED_CACHE", str(home.parent / "cache"))
        patch.chdir(home)
        assert main(["penetrate", case(text), "--out", "run", "--quiet"]) == 3
        assert main(["resume", "run", "--quiet"]) == 3
        assert NEWEST.exists() and BEFORE.exists() and not SERIES.exists()
    return home


@pytest.fixture(scope="module")
def on_our_bed(tmp_path_factory):
    """The same on our bed, and the series of the run that is not stopped."""
    home = stopped_twice(ON_OUR_BED, tmp_path_factory.mktemp("ours") / "stopped")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(whole_runs, "write_report", lambda *given: None)
        patch.setenv("HEDGEBED_CACHE", str(home.parent / "cache"))
        patch.chdir(home.parent)
        assert main(["penetrate", case(ON_OUR_BED), "--out", "run", "--quiet"]) == 0
    return home, (home.parent / SERIES).read_bytes()


def resumed(stopped, home, change):
    """The series of a copy of the run, in the new folder `home`, that is resumed after the change; what it said."""
    shutil.copytree(stopped, home)
    log = home.with_suffix(".log")
    with pytest.MonkeyPatch.context() as patch, log.open("w", encoding="utf-8") as file, redirect_stderr(file):
        patch.setattr(whole_runs, "write_report", lambda *given: None)
        patch.setattr(folder, "_TOLD", set())
        patch.setenv("HEDGEBED_CACHE", str(stopped.parent / "cache"))
        patch.chdir(home)
        change()
        status = main(["resume", "run", "--quiet"])
    said = log.read_text(encoding="utf-8")
    assert status == 0 and "Traceback" not in said, said
    return (home / SERIES).read_bytes(), said


def without(*paths):
    """What removes these files of the present folder."""
    return lambda: [path.unlink() for path in paths]


@pytest.fixture(scope="module")
def series(stopped, tmp_path_factory):
    """The series from the newest checkpoint, from the one before it, and from the start: no two are the same."""
    home = tmp_path_factory.mktemp("series")
    kept = {"newest": without(), "before": without(NEWEST), "anew": without(NEWEST, BEFORE)}
    found = {name: resumed(stopped, home / name, change)[0] for name, change in kept.items()}
    assert len(set(found.values())) == 3  # new lists of neighbours, from another step on
    return found


def cut(path):
    """Leave half of a file."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.long
@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_damaged_checkpoint_on_our_bed_is_named_and_the_run_ends_in_the_same_bits(seed, on_our_bed, tmp_path):
    home, whole = on_our_bed
    rng = random.Random(seed)
    found, said = resumed(home, tmp_path / "one", lambda: damaged(NEWEST, rng))
    assert found == whole, said
    found, said = resumed(home, tmp_path / "both", lambda: [cut(NEWEST), damaged(BEFORE, rng)])
    assert found == whole and f"{NEWEST} is damaged" in said


@pytest.mark.long
@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_damaged_checkpoint_of_lammps_gives_way_to_the_one_before_it(seed, stopped, series, tmp_path):
    """Or the damage met what is not read, such as the time of day: then the run goes on from this checkpoint."""
    found, said = resumed(stopped, tmp_path / "home", lambda: damaged(NEWEST, random.Random(seed)))
    assert found == series["before" if f"{NEWEST} is damaged" in said else "newest"], said


@pytest.mark.long
def test_a_checkpoint_of_lammps_that_is_cut_off_gives_way_and_of_two_neither_is_used(stopped, series, tmp_path):
    found, said = resumed(stopped, tmp_path / "one", lambda: cut(NEWEST))
    assert found == series["before"] and f"{NEWEST} is damaged" in said
    found, said = resumed(stopped, tmp_path / "both", lambda: [cut(NEWEST), cut(BEFORE)])
    assert f"{NEWEST} is damaged" in said and f"{BEFORE} is damaged" in said
    assert found == series["anew"]
