"""The examples in docstrings, and those of the page of `dem`, print what they say."""

import doctest
from importlib import import_module

import pytest
from import_graph import ROOT

FINDER = doctest.DocTestFinder(exclude_empty=True, recurse=True)
EXAMPLES = [
    pytest.param(test, id=f"{package}.{test.name}")
    for package in ("rigid", "coupling", "coupling.robot")
    for name in import_module(package).__all__
    if isinstance((public := getattr(import_module(package), name)), type) or callable(public)
    for test in FINDER.find(public, name, module=import_module(public.__module__))
    if test.examples
]
WITH_AN_EXAMPLE = {
    "rigid.Spike", "rigid.simulate", "rigid.flight", "rigid.escape_speed", "rigid.launch_speed_for",
    "rigid.find_platform", "coupling.drive", "coupling.drop", "coupling.set_down",
    "coupling.robot.law_under_feet",
}  # fmt: skip


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_example_of_a_docstring_prints_what_it_says(example, monkeypatch):
    if example.name.startswith("coupling.robot"):
        pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")
    monkeypatch.chdir(ROOT)
    assert doctest.DocTestRunner().run(example).failed == 0


def test_the_main_functions_have_an_example():
    assert {example.id for example in EXAMPLES} >= WITH_AN_EXAMPLE


@pytest.mark.long
def test_the_examples_of_dem_print_what_they_say():
    found = doctest.testfile(str(ROOT / "docs/site/dem-examples.md"), module_relative=False)
    assert (found.failed, found.attempted) == (0, 10)
