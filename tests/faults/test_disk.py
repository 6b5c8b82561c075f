"""A full disk, a cache that is taken away, two commands at once: a sentence that names the file, and nothing lost."""

import errno
import os
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

import rigid.series
from experiments.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
TUMBLE = ["tumble", "--duration", "0.1", "--quiet", "--out"]
SWEEP = ["sweep", "--experiment", "tumble", "--fixed", "duration=0.1", "--over", "torque=[0.15, 0.2]", "--workers", "1",
         "--quiet", "--out"]  # fmt: skip
FULL = os.strerror(errno.ENOSPC)


@pytest.fixture(autouse=True)
def quick(monkeypatch, tmp_path):
    """No report is drawn."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)


def numbers(folder):
    """What a run says: its numbers, series and tables."""
    paths = [path for path in folder.rglob("*") if path.suffix in (".csv", ".nc") or path.name == "result.json"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def said_of(tokens, capsys):
    """Exit status of the command, and what it said on stderr."""
    capsys.readouterr()
    status = main([*map(str, tokens)])
    return status, capsys.readouterr().err


def resumed(tokens, out):
    """The tokens that go on with a run, or begin it where nothing of it is there."""
    return ["resume", out, "--quiet"] if (out / "run.toml").exists() else [*tokens, out]


@pytest.mark.parametrize("tokens", [TUMBLE, pytest.param(SWEEP, marks=pytest.mark.long)], ids=["tumble", "sweep"])
def test_each_file_that_cannot_be_written_is_named_and_the_run_goes_on_afterwards(
    tokens, tmp_path, monkeypatch, capsys
):
    """The first write fails, the second, ... until all go well; each time the rest is made when there is room again."""
    assert main([*tokens, str(tmp_path / "whole")]) == 0
    whole, fsync, places, out = numbers(tmp_path / "whole"), os.fsync, 0, tmp_path / "out"
    while True:
        left = [places]

        def failing(number, left=left):
            if not left[0]:
                raise OSError(errno.ENOSPC, FULL)
            left[0] -= 1
            fsync(number)

        shutil.rmtree(out, ignore_errors=True)
        with monkeypatch.context() as patch:
            patch.setattr(rigid.series.os, "fsync", failing)
            status, said = said_of([*tokens, out], capsys)
        if status == 0:
            break
        assert FULL in said and str(out) in said and "Traceback" not in said, said
        assert status in (1, 2), said
        assert main([*map(str, resumed(tokens, out))]) == 0
        assert numbers(out) == whole
        places += 1
    assert places >= 6 and numbers(out) == whole


@contextmanager
def small_disk(path, size):
    """A file system of so many bytes at `path`."""
    path.mkdir(exist_ok=True)
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", path], capture_output=True, check=False
    )
    if made.returncode:
        pytest.skip(f"this user may mount no file system: {made.stderr.decode().strip()}")
    try:
        yield path
    finally:
        subprocess.run(["umount", "-l", path], check=True)


@pytest.mark.parametrize("pages", [1, 3, 6, 10])
def test_a_full_disk_ends_a_run_in_words_and_with_room_it_goes_on_to_the_same_bits(pages, tmp_path, capsys):
    """Pages of 4 kB; the whole run takes some 14."""
    assert main([*TUMBLE, str(tmp_path / "whole")]) == 0
    with small_disk(tmp_path / "disk", 4096 * pages) as disk:
        out = disk / "out"
        status, said = said_of([*TUMBLE, out], capsys)
        assert status in (1, 2) and FULL in said and str(out) in said and "Traceback" not in said, said
        subprocess.run(["mount", "-o", "remount,size=4m", disk], check=True)
        assert main([*map(str, resumed(TUMBLE, out))]) == 0
        assert numbers(out) == numbers(tmp_path / "whole")
        assert not list(out.rglob(".*.tmp"))


GRAINS = """
bed_size = [0.03, 0.03, 0.0254]
grain = 0.004
tip_diameter = 0.0075
shaft_length = 0.03
allow_coarse = true
seeds = [1]
speeds = [0.2, 0.4]
depth = 0.006
hold = 0.0
load = 0.1
drop_speeds = []
rest_time = 0.01
young = 2e7
frame_count = 0
checkpoint_interval = 0.2
threads = 1
"""


@pytest.mark.long
def test_a_full_disk_under_the_cache_is_named_by_the_file_of_the_bed_and_with_room_the_run_goes_on(
    tmp_path, monkeypatch, capsys
):
    """A page of 4 kB; what is kept of the bed takes some 100. The system names no file that it cannot write further."""
    Path("case.toml").write_text(GRAINS.replace("speeds = [0.2, 0.4]", "speeds = [0.4]"))
    tokens = ["penetrate", "case.toml", "--quiet", "--out"]
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "room"))
    assert main([*tokens, "whole"]) == 0
    (name,) = (path.name for path in (tmp_path / "room" / "beds").glob("*.npz"))
    with small_disk(tmp_path / "cache", 4096) as cache:
        monkeypatch.setenv("HEDGEBED_CACHE", str(cache))
        status, said = said_of([*tokens, "out"], capsys)
        assert status == 1 and f"failed: {cache / 'unfinished' / name}: {FULL}\n" in said, said
        assert "Traceback" not in said and not list(cache.rglob("*.npz"))
        subprocess.run(["mount", "-o", "remount,size=4m", cache], check=True)
        assert main(["resume", "out", "--quiet"]) == 0
    assert numbers(tmp_path / "out") == numbers(tmp_path / "whole")


OFTEN = """
import sys
import dem.prepare.laboratory
from experiments.cli.main import main
dem.prepare.laboratory._KEEP_INTERVAL = 0.02
sys.exit(main(sys.argv[1:]))
"""
"""The command line, where a bed that is being prepared is kept in the cache all the time."""


def begun(home, *tokens, cache):
    """The command in a process of its own; its log is the file of its output folder's name."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "HEDGEBED_CACHE": str(home / cache)}
    with (home / f"{len(list(home.glob('*.log')))}.log").open("w") as log:
        return subprocess.Popen(
            [sys.executable, "-c", OFTEN, *map(str, tokens)], env=environment, cwd=home, stdout=log, stderr=log
        )


def logs(home):
    """What all commands said."""
    return "\n".join(path.read_text() for path in sorted(home.glob("*.log")))


@pytest.mark.slow
def test_two_commands_at_once_on_one_cache_or_one_folder_lose_nothing(tmp_path):
    """Two make the same bed and keep it in the same files; of two that have one folder, one is refused."""
    (tmp_path / "case.toml").write_text(GRAINS)
    tokens = ["penetrate", "case.toml", "--quiet", "--out"]
    first, second = (begun(tmp_path, *tokens, name, cache="shared") for name in ("one", "two"))
    third = begun(tmp_path, *tokens, "two", cache="shared")
    ended = [process.wait(timeout=500) for process in (first, second, third)]
    said = logs(tmp_path)
    assert ended[0] == 0 and sorted(ended[1:]) == [0, 2] and "Traceback" not in said, said
    assert "two" in said and ("in use" in said or "being written" in said), said
    assert begun(tmp_path, *tokens, "alone", cache="own").wait(timeout=500) == 0
    alone = numbers(tmp_path / "alone")
    assert numbers(tmp_path / "one") == numbers(tmp_path / "two") == alone and len(alone) > 2


@pytest.mark.slow
def test_a_run_whose_cache_is_taken_away_again_and_again_ends_in_the_same_bits(tmp_path):
    """Or ends with a sentence that names a file of the cache, and goes on to the same bits once the cache stays."""
    (tmp_path / "case.toml").write_text(GRAINS)
    tokens, out, cache = ["penetrate", "case.toml", "--quiet", "--out"], tmp_path / "out", tmp_path / "cache"
    assert begun(tmp_path, *tokens, "whole", cache="own").wait(timeout=500) == 0
    process, removed = begun(tmp_path, *tokens, out, cache="cache"), 0
    while process.poll() is None:
        if cache.exists():
            shutil.rmtree(cache, ignore_errors=True)
            removed += 1
        time.sleep(0.01)
    said = logs(tmp_path)
    assert removed and process.returncode in (0, 1) and "Traceback" not in said, said
    if process.returncode:
        assert str(cache) in said, said
        assert begun(tmp_path, "resume", out, "--quiet", cache="cache").wait(timeout=500) == 0, logs(tmp_path)
    assert numbers(out) == numbers(tmp_path / "whole")
