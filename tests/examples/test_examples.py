"""The scripts in examples/: each is short, runs at its small size and checks its own end."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
ON_GRAINS = {
    "foot_from_stl", "laboratory_bed", "spike_in_lammps", "spike_in_sand", "stiffness_and_damping", "tumble_on_grains",
}  # fmt: skip
names = pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)


@pytest.mark.parametrize(
    "script",
    [pytest.param(p, id=p.stem, marks=[pytest.mark.long] * (p.stem in ON_GRAINS)) for p in EXAMPLES],
)
def test_an_example_runs_at_its_small_size_and_its_checks_hold(script, tmp_path):
    done = subprocess.run(
        [sys.executable, str(script), "--small", "--out", str(tmp_path / "out")],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.strip(), "it prints an answer"
    assert [path.name for path in tmp_path.iterdir()] in ([], ["out"]), "it writes only where it is told to"


@names
def test_an_example_is_short_says_what_it_does_and_checks_its_end(script):
    text = script.read_text(encoding="utf-8")
    tree = ast.parse(text)
    assert 10 <= len(text.splitlines()) <= 40
    assert ast.get_docstring(tree)
    assert isinstance(tree.body[-1], ast.Assert)


def test_there_are_eight_to_twelve_and_the_readme_names_each():
    readme = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
    assert 8 <= len(EXAMPLES) <= 12
    assert [path.name for path in EXAMPLES if f"`{path.name}`" not in readme] == []
