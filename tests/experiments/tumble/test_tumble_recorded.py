"""`hedgebed campaign from-run` of tumbles: what camera, IMU and wheel would have recorded, as a campaign."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from experiments.campaign import read_campaign
from experiments.cli.main import main
from experiments.tumble.campaign_settings import CampaignSettings
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.synthesis import record, sensor_set
from experiments.tumble.trial import plan_tumble


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two torques on the spring-damper of sand by the master, whose folders are as those of grains; one on brick."""
    home = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)
        for name, more in (("weak", ("sand", "0.125")), ("strong", ("sand", "0.22")), ("brick", ("brick", "0.22"))):
            given = ("--surface", more[0], "--torque", more[1], "--rig", "0.0085", "--duration", "0.3", "--quiet")
            assert main(["tumble", *given, "--method", "coupled", "--out", str(home / name)]) == 0
    return home


def test_a_tumble_is_recorded_as_its_own_model_would_be(runs, tmp_path):
    """Without noise to speak of, what is recorded of a run is what `record` makes of the planar model."""
    into = tmp_path / "made"
    given = ("--also", str(runs / "weak"), "--noise", "1e-6")
    assert main(["campaign", "from-run", str(runs / "strong"), str(into), *given]) == 0
    campaign = read_campaign(into)
    assert [(trial.id, trial.torque) for trial in campaign.tables.trial] == [("001", 0.22), ("002", 0.125)]
    trial = plan_tumble(TumbleSettings(surface="sand", torque=0.22, rig=0.0085, duration=0.3)).trial
    sensors = replace(sensor_set(CampaignSettings()), pose_std=(0, 0, 0), imu_std=(0, 0, 0), wheel_std=0)
    expected, _ = record(trial, duration=0.3, sensors=sensors, seed=None)
    tolerance = {"x_m": 5e-5, "y_m": 2e-4, "theta_rad": 1.5e-3, "gyro_rad_s": 3e-3, "ax_m_s2": 0.02, "ay_m_s2": 0.02,
                 "omega_rad_s": 0.1}  # fmt: skip
    for sensor in ("pose", "imu", "wheel"):
        found, wanted = campaign.recording("001", sensor), getattr(expected, sensor)
        assert found["t_s"] == pytest.approx(wanted["t_s"][: len(found["t_s"])], abs=1e-9)
        for channel, most in tolerance.items():
            if channel in wanted:
                away = np.abs(found[channel] - wanted[channel][: len(found[channel])])
                # The torque begins at once: around t = 0 a step of 0.4 ms and the IMU's window see it differently.
                assert away[np.abs(found["t_s"]) > 5e-3].max() < most, channel
    surface = campaign.tables.surface
    assert (surface.stiffness, surface.mu_d, surface.granular) == (77.8, 0.3, False)
    assert main(["campaign", "check", str(into), "--out", str(tmp_path / "checked"), "--quiet"]) == 0


def test_k_and_c_of_a_row_are_twice_those_fitted_to_a_spike_in_the_same_grains(runs, tmp_path, capsys):
    fitted = tmp_path / "fitted"
    fitted.mkdir()
    quantities = {"stiffness": (40.0, 3.0), "stiffness_error": (4.0, None), "damping": (0.5, 0.0)}
    result = {"quantities": {name: {"value": value, "std": std} for name, (value, std) in quantities.items()}}
    (fitted / "result.json").write_text(json.dumps(result))
    text = 'format = "hedgebed-run/2"\ncommand = "penetrate"\n[settings]\nmaterial = "{}"\n'
    (fitted / "run.toml").write_text(text.format("sand"))
    ask = ["campaign", "from-run", str(runs / "strong"), str(tmp_path / "made"), "--fitted", str(fitted)]
    assert main(ask) == 0
    tables = read_campaign(tmp_path / "made").tables
    assert (tables.surface.stiffness, tables.surface.damping) == (80.0, 1.0)
    assert tables.uncertainty.stiffness == pytest.approx(5.0 / 40.0)
    (fitted / "run.toml").write_text(text.format("glass"))
    assert main([*ask[:3], str(tmp_path / "other"), *ask[4:]]) == 2
    assert "in glass" in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            ("--also", "brick"),
            "has stiffness = 15000.* and .* 77.8: .* runs that differ only in gravity, torque or seed",
        ),
        (("--depth-std", "1e-4"), "--depth-std is given, and .* is a run of a tumble"),
    ],
)
def test_runs_that_do_not_belong_together_are_refused(runs, tmp_path, given, said, capsys):
    given = tuple(str(runs / "brick") if word == "brick" else word for word in given)
    assert main(["campaign", "from-run", str(runs / "strong"), str(tmp_path / "made"), *given]) == 2
    assert re.search(said, capsys.readouterr().err.replace("\n", " "))
    assert not (tmp_path / "made").exists()
