"""Modules that have moved are still found under their old names, with a warning."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import dem  # noqa: F401
from hedgebed_renamed import RENAMED


@pytest.mark.parametrize("old", RENAMED)
def test_an_old_name_warns_and_is_the_module_of_today(old):
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"{old} is deprecated: use {RENAMED[old]}"):
        module = importlib.import_module(old)
    assert module is importlib.import_module(RENAMED[old])
    assert module.__name__ == module.__spec__.name == RENAMED[old]


@pytest.mark.parametrize("folder", ["dem", "rigid", "coupling", "experiments", "vis"])
def test_old_names_work_in_a_fresh_process_and_the_warning_names_the_line_that_imports(folder):
    old = next(name for name in RENAMED if name.startswith(f"{folder}."))
    code = f"import warnings\nwarnings.simplefilter('error', DeprecationWarning)\nimport {old}"
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    assert f"DeprecationWarning: {old} is deprecated" in done.stderr
