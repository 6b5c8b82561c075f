"""What the runs of a sweep say beside their numbers stands in the sweep too: warnings, 95 % intervals."""

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from golden import golden

from experiments.runs.folder import RunFolder
from experiments.sweep.design import design_of
from experiments.sweep.members import KIND_OF_INTERVAL, MOST_WARNINGS, ends_of, warnings_of
from experiments.sweep.result import conclude
from experiments.sweep.settings import SweepSettings
from vis.report import write_report

SETTINGS = SweepSettings(
    experiment="penetrate", over={"tip_diameter": [0.006, 0.012, 0.024]}, quantities=("stiffness", "sinkage_dem"),
    fixed={"allow_coarse": True, "bed_size": [0.15, 0.15, 0.1], "shaft_length": 0.1, "depth": 0.006},
)  # fmt: skip


def member(diameter, *, one_bed=False, warnings=()):
    """A result of penetrate, K = 1e6 D² N/m in two beds that differ by a tenth of it."""
    stiffness, seeds = 1e6 * diameter**2, (1,) if one_bed else (1, 2)
    std = None if one_bed else 0.1 * stiffness / np.sqrt(2.0)
    return {
        "experiment": "penetrate", "title": "A spike in sand", "fits": [{"seed": seed} for seed in seeds],
        "runs": [{"kind": "driven", "seed": seed} for seed in seeds],
        "quantities": {
            "stiffness": {"value": stiffness, "std": std, "unit": "N/m"},
            "stiffness_error": {"value": None, "std": None, "unit": "N/m"},
            "sinkage_dem": {"value": 0.002, "std": None, "unit": "m"},
            "load": {"value": 0.2, "std": 0.0, "unit": "N"},
        },
        "sure": {"sinkage_dem": {"value": 0.002, "chance": [0.001, 0.003]}}, "warnings": list(warnings),
    }  # fmt: skip


@pytest.fixture
def swept(tmp_path):
    """Folder and result of a sweep over three diameters, the last of them of one bed."""
    folder = RunFolder.create(tmp_path / "swept", "sweep", SETTINGS)
    results = [member(0.006, warnings=["3 grains across: K 120 % high"]), member(0.012), member(0.024, one_bed=True)]
    tasks = [SimpleNamespace(name=f"run-{place}") for place in range(3)]
    outcomes = {
        task.name: SimpleNamespace(fault="", result=json.dumps(one)) for task, one in zip(tasks, results, strict=True)
    }
    result = conclude(SETTINGS, design_of(SETTINGS), tasks, outcomes, folder)
    folder.write_result(result)
    return folder.path, result


def test_the_table_has_both_ends_of_each_interval_that_a_run_knows(swept):
    folder, result = swept
    with (folder / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    half = 12.706 * 0.1 / 2.0  # Student's t of one degree of freedom; std / sqrt(2) is half the difference
    for row, stiffness in zip(rows, (36.0, 144.0), strict=False):
        ends = [float(row[f"stiffness_N_m{end}"]) for end in ("_low95", "_high95")]
        assert ends == pytest.approx([(1 - half) * stiffness, (1 + half) * stiffness], rel=1e-3)
    assert np.isnan(float(rows[2]["stiffness_N_m_low95"])) and float(rows[2]["sinkage_dem_m_high95"]) == 0.003
    shown = {row[0]: row[1:] for row in result["tables"][0]["rows"]}
    sinkage, stiffness = (
        shown[f"{name}: {KIND_OF_INTERVAL['penetrate']}"] for name in ("sinkage at rest, bed", "stiffness K")
    )
    assert sinkage == ["mm", *["1.0 to 3.0"] * 3] and stiffness[-1] == "\N{EN DASH}"
    assert not any("standard error" in name for name in shown)  # no run has one
    assert "Bars: 95" in write_report(folder).read_text()


def test_every_kind_of_warning_is_counted_and_shown_once(swept):
    found = warnings_of([
        member(0.006, warnings=["the tip is 3 grains across: K is about 120 % higher", "fewer than three seeds"]),
        member(0.012, warnings=["the tip is 3.9 grains across: K is about 82 % higher", "fewer than three seeds"]),
        member(0.024, warnings=["fewer than three seeds"]),
    ])  # fmt: skip
    golden("sweep/warnings_of_runs", {"of three": found, "in the result": swept[1]["warnings"]})
    many = warnings_of([member(0.006, warnings=["a" * length for length in range(1, MOST_WARNINGS + 4)])])
    assert len(many) == MOST_WARNINGS + 1 and many[-1].startswith("3 more kinds")


def test_a_sweep_of_converge_has_the_interval_of_all_errors_that_it_knows():
    entries = {
        "stiffness": {"value": 40.0, "std": 1.0, "unit": "N/m", "chance": 3.0, "total": 10.0},
        "damping": {"value": 1.0, "std": None, "unit": "N s/m", "chance": 0.2, "total": None},
        "members": {"value": 3, "std": 0.0, "unit": "1"},
    }
    found = ends_of({"experiment": "converge", "quantities": entries})
    assert found == {"stiffness": (30.0, 50.0), "damping": pytest.approx((0.8, 1.2))}
