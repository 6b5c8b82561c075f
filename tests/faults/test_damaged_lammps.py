"""Checkpoints of grains in LAMMPS that are cut off or have a wrong bit: the run goes on from the one before.

LAMMPS' restart file is one array of a checkpoint of ours, a zip file with a checksum for each array. Resumed twice from
the same checkpoint on one rank, LAMMPS has the same numbers, so the series tells from which checkpoint a run went on.
"""

import os
import random
import shutil
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import pytest
from faults.damaged_folders import case
from faults.test_damage import damaged
from small_cases import GRAINS

import experiments.penetrate.experiment
from coupling.lammps import LammpsMissingError, find_lammps
from experiments.cli.main import main

DAMAGES = int(os.environ.get("HEDGEBED_DAMAGES", "3"))
CASE = GRAINS.replace("depth = 0.006", "depth = 0.004") + """
ground = "lammps"
ranks = 1
grain = 0.004
seeds = [1]
speeds = [0.4]
hold = 0.0
drop_speeds = []
young = 2e7
"""  # fmt: skip
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


@pytest.fixture
def stopped(tmp_path, monkeypatch):
    """A run in LAMMPS that was stopped twice in its push: it has two checkpoints, which no test changes."""
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "cache"))
    home = tmp_path / "stopped"
    home.mkdir()
    monkeypatch.chdir(home)
    with stopped_after(40):
        assert main(["penetrate", case(CASE), "--out", "run", "--quiet"]) == 3
        assert main(["resume", "run", "--quiet"]) == 3
    assert NEWEST.exists() and BEFORE.exists() and not SERIES.exists()
    return home


@pytest.mark.long
def test_a_damaged_checkpoint_of_lammps_gives_way_to_the_one_before_it(stopped, tmp_path, monkeypatch, capsys):
    def resumed(name, change):
        """The series of a copy of the run that is resumed after the change, and what it said."""
        monkeypatch.chdir(shutil.copytree(stopped, tmp_path / name))
        change()
        capsys.readouterr()
        status, said = main(["resume", "run", "--quiet"]), capsys.readouterr().err
        assert status == 0 and "Traceback" not in said, said
        return SERIES.read_bytes(), said

    def both_damaged():
        for path in (NEWEST, BEFORE):
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    newest, before = (resumed(*given)[0] for given in (("whole", lambda: None), ("without", NEWEST.unlink)))
    assert newest != before  # new lists of neighbours, from another step on
    gave_way = 0
    for seed in range(DAMAGES):
        found, said = resumed(f"damaged{seed}", lambda seed=seed: damaged(NEWEST, random.Random(seed)))
        named = f"{NEWEST} is damaged" in said
        assert found == (before if named else newest), said
        gave_way += named
    assert gave_way > 0
    anew, said = resumed("both", both_damaged)
    assert f"{NEWEST} is damaged" in said and f"{BEFORE} is damaged" in said
    assert anew not in (newest, before) and anew.count(b"\n") == newest.count(b"\n")
