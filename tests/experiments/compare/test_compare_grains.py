"""`hedgebed compare` of a tumble in the plane on grains beside it on the spring-damper; a light one."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from tumble_runs import SMALL, prepare_small

from experiments.cli.main import main
from experiments.grains.settings import TumbleBedSettings
from experiments.runs.folder import read_series
from experiments.tumble import experiment as tumble
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings

LIGHT = {"mass": 0.05, "inertia": 3e-5, "torque": 0.002}
"""A sixth of the platform, so that its weight in the rig is that of some ten grains."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The small platform and a light one on 384 grains; the small one's trial on the spring-damper, by the master."""
    home = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlanarOnBed, "prepare", prepare_small)
        patch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
        tumble.run(TumbleSettings(**SMALL), home / "bed")
        tumble.run(TumbleSettings(**SMALL | LIGHT), home / "light")
        own = {key: value for key, value in SMALL.items() if key not in TumbleBedSettings.model_fields}
        law = own | {"ground": "spring-damper", "method": "coupled"}
        tumble.run(TumbleSettings(**law), home / "law")
    return home


def result_of(folder):
    return json.loads((folder / "result.json").read_text())


@pytest.mark.long
def test_a_tumble_on_grains_stands_beside_the_spring_damper_in_loads_sinkage_energy_and_pictures(
    runs, tmp_path, monkeypatch
):
    monkeypatch.setenv("HEDGEBED_NO_OPENGL", "1")
    out = tmp_path / "both"
    assert main(["compare", str(runs / "bed"), str(runs / "law"), "--quiet", "--out", str(out)]) == 0
    result, (bed, law) = result_of(out), (result_of(runs / name) for name in ("bed", "law"))
    assert [Path(one["folder"]).name for one in result["runs"]] == ["bed", "law"]
    columns = read_series(out / "series" / "compared.csv")
    for number in (1, 2):
        # Newton: what the rows bear together is what lifts the platform; means over 5 ms, of weights near 0.1 N.
        loads = sum(columns[f"load_{row}_N_{number}"] for row in range(result["spike_count"]))
        assert loads == pytest.approx(columns[f"lift_N_{number}"], abs=0.02 * result["weights"][0])
        energy = columns[f"energy_J_{number}"] + columns[f"dissipated_J_{number}"] - columns[f"torque_work_J_{number}"]
        assert np.ptp(energy) < 0.01 * np.max(np.abs(columns[f"torque_work_J_{number}"]))
    rows = {row["row"]: row for row in result["rows"]}
    feet = read_series(runs / "bed" / "series" / "feet.csv")
    for row, depths in rows.items():
        assert depths["first"] == pytest.approx(feet[f"sinkage_{row}_m"].max(), rel=0.05, abs=1e-6)
    shown = {row["name"]: row for row in result["compared"]}
    for name in ("sinkage_largest", "max_speed", "energy_residual"):
        told = [one["quantities"][name]["value"] if name in one["quantities"] else None for one in (bed, law)]
        assert shown[name]["first"] == pytest.approx(told[0])
        assert told[1] is None or shown[name]["second"] == pytest.approx(told[1])
    differs = {row["key"] for row in result["differs"]}
    assert "ground" in differs and not {"grain", "seed", "bed_size", "mass", "torque"} & differs
    page = (out / "report.html").read_text()
    assert page.count("data:image/png") >= 6 and "no OpenGL" in page and "States" in page


@pytest.mark.long
def test_a_platform_of_50_g_is_set_down_at_rest_on_real_grains(runs):
    """Its speed when the torque begins is small beside what it falls in a millisecond of its own gravity."""
    path = read_series(runs / "light" / "trajectory.csv")
    speed = math.hypot(path["vx_m_s"][0], path["vy_m_s"][0]) + SMALL["spike_length"] * abs(path["omega_rad_s"][0])
    assert speed < 1e-3 * SMALL["rig"] * 9.80665
    weight = result_of(runs / "light")["trial"]["weight"]["value"]
    motion = read_series(runs / "light" / "series" / "feet.csv")
    loads = sum(values for name, values in motion.items() if name.startswith("normal_"))
    assert loads[:5].mean() == pytest.approx(weight, rel=0.1)
