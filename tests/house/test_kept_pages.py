"""What pages say of a motor in sand and of the converged spike is what their kept runs give."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

from experiments.converge.statistics import Size, extrapolate, interval_of

ROOT = Path(__file__).parents[2]
FILE = ROOT / "docs" / "results" / "tumble-sand" / "tables.py"
GRAINS = (4.0, 3.0, 2.4, 1.6)  # mm, the columns of the table
ROWS = {
    "trajectory angle": "angle_deg", "ahead after": "ahead_mm", "rotation after": "rotation_deg",
    "work of the torque": "work_mJ", "deepest row": "deepest_mm",
}  # fmt: skip


@pytest.fixture(scope="module")
def values():
    """The numbers of a column of runs.csv, of the motor of 0.22 N m on narrow beds of this grain [mm]."""
    spec = importlib.util.spec_from_file_location("tumble_sand_tables", FILE)
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    rows = tables.kept()
    return lambda name, grain: tables.values(rows, name, case="0.22", width_mm=36.0, grain_mm=grain)


def real(values, name):
    """Extrapolated to grains of 0.2 mm: the value, and the sum of its errors of chance and size."""
    sizes = [Size(grain / 12.0, tuple(values(name, grain))) for grain in GRAINS]
    line = extrapolate(sizes, 0.2 / 12.0)
    return line.value, line.chance + line.grain


@pytest.mark.parametrize("label", ROWS)
def test_the_table_of_a_motor_in_sand_is_that_of_its_kept_runs(values, label):
    page = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8")
    line = next(line for line in page.splitlines() if line.startswith(f"| {label}"))
    cells = [cell.strip(" *") for cell in line.split("|")[2:-1]]
    assert len(cells) == len(GRAINS)
    for cell, grain in zip(cells, GRAINS, strict=True):
        found = interval_of(values(ROWS[label], grain))
        for shown, number in zip(cell.split(" ± "), (found.mean, found.half), strict=True):
            digits = len(shown.partition(".")[2])
            assert float(shown) == pytest.approx(number, abs=0.51 * 10.0**-digits), f"{label}, {grain} mm"


def test_limits_and_readme_state_the_angle_among_real_grains_of_the_kept_runs(values):
    angle, half = real(values, "angle_deg")
    deepest, around = real(values, "deepest_mm")
    limits = (ROOT / "docs" / "limits.md").read_text(encoding="utf-8")
    assert f"{angle:.0f} ± {half:.0f} degrees, {deepest:.0f} ± {around:.0f} mm" in limits
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    five, three = (interval_of(values("angle_deg", grain)) for grain in (2.4, 1.6))
    said = re.search(r"\*downwards\*, (\d+) ± (\d+) degrees on 2.4 mm grains, ([\d.]+) ± ([\d.]+) on 1.6 mm", readme)
    assert [float(one) for one in said.groups()] == [
        round(-five.mean), round(five.half), pytest.approx(-three.mean, abs=0.051), pytest.approx(three.half, abs=0.051)
    ]  # fmt: skip
    assert f"to 0.2 mm: {-angle:.0f} ± {half:.0f}" in readme


@pytest.mark.parametrize(
    ("label", "name", "factor"),
    [("K [N/m]", "stiffness", 1.0), ("C [N s/m]", "damping", 1.0), ("sinkage", "sinkage", 1e3), ("work", "work", 1e3)],
)
def test_the_errors_of_the_converged_spike_on_its_page_are_those_of_its_kept_result(label, name, factor):
    kept = json.loads((ROOT / "docs/results/converge-flagship/result.json").read_text(encoding="utf-8"))
    found = kept["quantities"][name]
    errors = [found[key] for key in ("chance", "grain_size", "rest")]
    page = (ROOT / "docs" / "converge.md").read_text(encoding="utf-8")
    table = page.split("| among real grains", 1)[1].splitlines()
    cells = next(line for line in table if line.startswith(f"| {label}")).split("|")[2:-1]
    for shown, number in zip(cells, (found["value"], *errors, sum(errors)), strict=True):
        digits = len(shown.strip().partition(".")[2])
        assert float(shown) == pytest.approx(factor * number, abs=0.51 * 10.0**-digits)
