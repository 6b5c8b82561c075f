"""Temporary folders of benchmarks: none stays, also after kill -9, and none is taken from a process that lives."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from benchmarks.race.scratch import scratch
from benchmarks.view import Browser, chromium

ROOT = Path(__file__).resolve().parents[2]
HOLDS = """
import time
from benchmarks.race.scratch import scratch
with scratch() as folder:
    print(folder, flush=True)
    time.sleep(100)
"""
OLD = (0.0, 0.0)  # As if it was made long ago


@pytest.fixture
def home(monkeypatch):
    """The folder for temporary files, of this process and its children: of a short name, as a socket of Chromium's."""
    with tempfile.TemporaryDirectory() as folder:
        monkeypatch.setattr("tempfile.tempdir", folder)
        monkeypatch.setenv("TMPDIR", folder)
        yield Path(folder)


def test_a_folder_of_a_killed_process_is_removed_by_the_next_and_that_of_a_living_one_is_not(home):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, "-c", HOLDS], env=environment, stdout=subprocess.PIPE, text=True) as other:
        left = Path(other.stdout.readline().strip())
        assert left.parent == home
        os.utime(left, OLD)
        with scratch():
            assert left.is_dir()
        other.kill()
    os.utime(left, OLD)
    with scratch("hedgebed-other-"):
        assert left.is_dir()
    with scratch():
        assert not left.exists()
    assert list(home.iterdir()) == []


def test_a_new_folder_without_a_lock_and_a_link_stay(home):
    (home / "hedgebed-bench-new").mkdir()
    (home / "kept").mkdir()
    (home / "hedgebed-bench-link").symlink_to(home / "kept")
    os.utime(home / "kept", OLD)
    with scratch():
        pass
    assert {path.name for path in home.iterdir()} == {"hedgebed-bench-new", "hedgebed-bench-link", "kept"}


def test_a_folder_into_which_something_was_written_meanwhile_goes_too(home, monkeypatch):
    remove, calls = shutil.rmtree, []

    def late(folder, **options):
        """As where a file appears after all others are removed: the folder is left."""
        calls.append(folder)
        if len(calls) > 2:
            remove(folder, **options)

    monkeypatch.setattr(shutil, "rmtree", late)
    with scratch():
        pass
    assert len(calls) == 3 and list(home.iterdir()) == []


@pytest.mark.long
@pytest.mark.skipif(chromium() is None, reason="no Chromium is installed (Debian: apt install chromium)")
def test_a_browser_leaves_nothing_in_the_folder_for_temporary_files(home, monkeypatch):
    """Also where it does not come up."""
    with Browser():
        assert [path.name.startswith("hedgebed-chromium-") for path in home.iterdir()] == [True]
    assert list(home.iterdir()) == []
    monkeypatch.setattr(Browser, "call", lambda self, method, **given: {"targetInfos": []})
    with pytest.raises(StopIteration):
        Browser()
    assert list(home.iterdir()) == []
