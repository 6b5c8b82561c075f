"""What grains did is nowhere said to be measured: materials that ship, their files, words of beds and of their laws."""

import re
import tomllib

import pytest
from import_graph import ROOT

WORDS = ("experiments/lawfit", "experiments/calibrate", "experiments/bed", "experiments/grains", "vis/bed")
FILES = sorted(path for folder in WORDS for path in (ROOT / folder).rglob("*.toml"))


@pytest.mark.parametrize("name", sorted(path.name for path in (ROOT / "dem/presets").glob("*.toml")))
def test_a_material_that_ships_has_what_its_beds_did_as_simulated(name):
    told = tomllib.loads((ROOT / "dem/presets" / name).read_text("utf-8")).get("calibration", {})
    for figure in (one for one in told.values() if isinstance(one, dict)):
        assert "simulated" in figure and "measured" not in figure


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_words_of_beds_call_nothing_measured(path):
    """Names of placeholders, such as `{measured.value}`, are no words; a source may be a measurement."""
    lines = re.sub(r"\{[^}]*\}", "", path.read_text("utf-8")).splitlines()
    lines = [line.partition(" = ")[2] or line for line in lines if not line.startswith(("source", "#"))]
    assert not [line for line in lines if re.search(r"\bmeasured\b", line)]
