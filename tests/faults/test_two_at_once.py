"""Two commands at once on one run folder, one folder of members, one work folder or one cache: nothing is lost.

Both are processes of their own that begin in the same moment. Of two that have one run folder one is refused; where a
folder is shared, both end well. The numbers are those of a command that was alone.
"""

import multiprocessing
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.forkserver import ensure_running
from pathlib import Path

import pytest
from faults.damaged_folders import CALIBRATE, CONVERGE, KINDS, ON_GRAINS, SWEEP, TUMBLE, Kind, case, patched
from faults.test_damaged_checkpoints import CASE as IN_LAMMPS
from faults.test_damaged_folders import files_of
from faults.test_killed import CASES

from coupling.lammps import LammpsMissingError, find_lammps
from dem.files.arrays import read_arrays
from experiments.campaign.files import new_campaign
from experiments.cli.main import main
from experiments.runs.folder import RunFolder

ROOT = Path(__file__).resolve().parents[2]
MANY = 300.0  # Longest that a pair takes [s], also on a busy machine
ANSWERS = (
    "*/result.json", "*/*.csv", "*/*.nc", "*/series/*.csv", "*/ground.toml", "*/material.toml", "*/bed.npz",
    "results/*/*.csv",
)  # fmt: skip
BED = ["bed", "make", "--stages", "rain", "level", "--size", "0.024", "0.024", "0.02", "--threads", "1"]


@dataclass(frozen=True)
class Pair:
    """Two commands of the present folder, after `make`: words, `first` before their ends. Stand-in beds if `fake`."""

    words: list[str]
    ends: tuple[list[str], list[str]] = (["--out", "run"], ["--out", "run"])
    make: Callable[[], object] | None = None
    statuses: tuple[tuple[int, int], ...] = ((0, 2),)
    fake: bool = False
    tier: str = ""
    in_lammps: bool = False


def written(text, name="case.toml"):
    """What writes a case file."""

    def make():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        case(text, name)

    return make


BOTH = ((0, 0),)
OUTS = (["--out", "one"], ["--out", "two"])
NOTHING = ([], [])
PAIRS = {
    "tumble": Pair(["tumble", "--duration", "0.1"]),
    "sweep": Pair(SWEEP),
    "sweep, resumed": Pair(["resume", "run"], NOTHING, KINDS["sweep, members"].make, (*BOTH, (0, 2)), tier="long"),
    "sweep, one folder of members": Pair([*SWEEP, "--members", "members"], OUTS, statuses=BOTH, tier="long"),
    "calibrate": Pair(["calibrate", "case.toml"], make=written(CALIBRATE), fake=True),
    "converge": Pair(["converge", "case.toml"], make=written(CONVERGE), fake=True, tier="long"),
    "converge, one folder of members": Pair(
        ["converge", "case.toml", "--members", "members"], OUTS, written(CONVERGE), statuses=BOTH, fake=True,
        tier="long",
    ),
    "diagnose": Pair(
        ["diagnose", "campaign"], make=lambda: new_campaign(Path("campaign"), kind="penetration"), tier="long"
    ),
    "experiments run": Pair(
        ["experiments", "run", "--work", "work", "--results", "results", "--workers", "1"], NOTHING,
        written(TUMBLE, "cases/grains/grains1-small.toml"), statuses=BOTH, tier="slow",
    ),
    "bed make": Pair(BED, tier="slow"),
    "bed calibrate": Pair(["bed", "calibrate", "case.toml"], make=written(CASES["bed calibrate"]), tier="long"),
    "penetrate, one cache": Pair(["penetrate", "case.toml"], OUTS, written(ON_GRAINS), statuses=BOTH, tier="slow"),
    "penetrate in LAMMPS": Pair(["penetrate", "case.toml"], make=written(IN_LAMMPS), tier="slow", in_lammps=True),
    "penetrate in LAMMPS, one cache": Pair(
        ["penetrate", "case.toml"], OUTS, written(IN_LAMMPS), statuses=BOTH, tier="slow", in_lammps=True
    ),
}  # fmt: skip


def carried_out(words, home, log, fake, together):
    """In a process of its own, which ends with its exit status: the command in `home`, together with another."""
    with log.open("w", encoding="utf-8") as file, pytest.MonkeyPatch.context() as patch:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(file.fileno(), stream.fileno())
        patch.chdir(home)
        patched(Kind(print, (), fake=fake), patch)
        together.wait(MANY)
        status = main([*words, "--quiet"])
    sys.exit(status)


@pytest.fixture(scope="module")
def processes():
    """Where processes come from that have loaded everything and computed nothing."""
    found = multiprocessing.get_context("forkserver")
    found.set_forkserver_preload(["faults.test_two_at_once"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(ROOT / "tests")]))
        ensure_running()
    return found


def carry_out(pair, ends, home, processes):
    """The exit statuses of the command with each of these ends, all at once in a new folder; what they said."""
    home.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        patched(Kind(print, (), fake=pair.fake), patch)
        if pair.make is not None:
            pair.make()
    together, logs = processes.Barrier(len(ends)), [home.parent / f"{home.name}{number}" for number in range(len(ends))]
    begun = [
        processes.Process(target=carried_out, args=([*pair.words, *end], home, log, pair.fake, together))
        for end, log in zip(ends, logs, strict=True)
    ]
    for process in begun:
        process.start()
    for process in begun:
        process.join(MANY)
        process.kill()
    return [process.exitcode for process in begun], "\n".join(log.read_text(encoding="utf-8") for log in logs)


def numbers(home, monkeypatch):
    """What the commands wrote: arrays and the bytes of other files. A zip file of arrays holds the time of day too."""
    monkeypatch.chdir(home)
    found = {}
    for path in files_of(ANSWERS):
        arrays = read_arrays(path) if path.suffix == ".npz" else {}
        found[str(path)] = {name: array.tobytes() for name, array in arrays.items()} or path.read_bytes()
    return found


MARKED = [
    pytest.param(name, marks=getattr(pytest.mark, pair.tier) if pair.tier else ()) for name, pair in PAIRS.items()
]


@pytest.mark.parametrize("name", MARKED)
def test_two_commands_at_once_lose_nothing(name, processes, tmp_path, monkeypatch):
    pair = PAIRS[name]
    if pair.in_lammps:
        try:
            find_lammps()
        except LammpsMissingError as missing:
            pytest.skip(str(missing))
    statuses, said = carry_out(pair, pair.ends, tmp_path / "both", processes)
    assert tuple(sorted(statuses)) in pair.statuses and "Traceback" not in said, said
    if 2 in statuses:
        assert any(words in said for words in ("in use", "being written")), said
    found, whole = numbers(tmp_path / "both", monkeypatch), {}
    for number, end in enumerate(pair.ends if pair.ends[0] != pair.ends[1] else pair.ends[:1]):
        alone = tmp_path / f"alone{number}"
        assert carry_out(pair, [end], alone, processes)[0] == [0]
        whole |= numbers(alone, monkeypatch)
    assert found == whole and whole
    for folder in (path.parent for path in (tmp_path / "both").glob("*/run.toml")):
        assert RunFolder.open(folder).status == "done"
        RunFolder.open(folder).read_result()  # and its files have their digests
