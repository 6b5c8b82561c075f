"""`hedgebed campaign`: what it writes reads back as a campaign, and is the truth plus the noise that it states."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.campaign import read_campaign, read_model
from experiments.cli.main import main
from experiments.diagnose.tumble.problem import make_problem
from experiments.tumble.campaign_settings import CampaignSettings
from experiments.tumble.experiment import resume as resume_tumble
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.synthesis import record, run
from experiments.tumble.trial import model_trial, plan_tumble
from rigid.model.trial import Effect
from rigid.sensors import SensorSet

STDS = {"pose": (0.0005, 0.0005, 0.003), "imu": (0.01, 0.02, 0.02), "wheel": (0.5,)}


pytestmark = pytest.mark.usefixtures("unreported")


def quick(**changes):
    values = {"rig": (0.0085,), "motor_torques": (0.22,), "brake_torques": (), "duration": 0.8}
    return CampaignSettings(**(values | changes))


def test_it_writes_a_campaign_that_reads_back(tmp_path):
    settings = quick(rig=(0.0085, 0.015), brake_torques=(6.0,), trials=2, surface="brick", wire_length=2.2)
    run(settings, tmp_path / "a")
    campaign = read_campaign(tmp_path / "a" / "campaign")
    trials = campaign.tables.trial
    assert [trial.id for trial in trials] == [f"{number:03d}" for number in range(1, 9)]
    assert [trial.actuator for trial in trials] == ["motor", "motor", "brake", "brake"] * 2
    assert len({trial.gravity_sim for trial in trials}) == 2
    assert campaign.tables.rig.wire_length == 2.2
    assert (campaign.tables.surface.kind, campaign.tables.surface.mu_s) == ("brick", 0.5)
    for trial in trials:
        for sensor, rate in (("pose", 120), ("imu", 100), ("wheel", 600)):
            recording = campaign.recording(trial.id, sensor)
            assert recording.time[0] == pytest.approx(-0.2, abs=1 / rate)
            assert recording.time[-1] == pytest.approx(0.8, abs=2 / rate)


@pytest.mark.parametrize(
    "effects", [(), ("pendulum.length=2.2", "clock-offset.offset=0.01", "camera-scale.scale=1.02")]
)
def test_what_is_recorded_is_the_truth_plus_the_noise_that_is_stated(tmp_path, effects):
    run(quick(effects=effects), tmp_path / "a")
    campaign, truth = read_campaign(tmp_path / "a" / "campaign"), read_model(tmp_path / "a" / "truth.toml")
    assert [effect.id for effect in truth.effect] == [text.split(".")[0] for text in effects]
    found = tuple(Effect(id=effect.id, parameters=effect.parameters) for effect in truth.effect)
    trial = model_trial(truth, truth.trial[0], effects=found)
    bare, _ = record(trial, duration=0.8, sensors=SensorSet(), seed=None)
    (row,) = json.loads((tmp_path / "a" / "result.json").read_text())["trials"]
    zero = dict(zip(("x_m", "y_m", "theta_rad"), row["camera_zero"], strict=True))
    for sensor, stds in STDS.items():
        columns = getattr(bare, sensor)
        recording = campaign.recording("001", sensor)
        assert np.array_equal(recording.time, columns["t_s"])
        for name, std in zip(list(columns)[1:], stds, strict=True):
            noise = (recording[name] - columns[name] - zero.get(name, 0.0)) / std
            # chi-square per row, within five of its standard deviations; the mean within five standard errors
            assert abs((noise**2).mean() - 1) < 5 * math.sqrt(2 / len(noise)), (sensor, name)
            assert abs(noise.mean()) < 5 / math.sqrt(len(noise)), (sensor, name)


def test_the_same_seed_gives_the_same_files_and_another_others(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        run(quick(seed=seed), tmp_path / name)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a" / "campaign").glob("*.csv"))
    assert len(files) == 3
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
        assert (tmp_path / "a" / file).read_bytes() != (tmp_path / "c" / file).read_bytes()


def test_the_truth_lies_within_what_is_stated_and_not_on_it_unless_asked(tmp_path):
    for name, exact in (("drawn", False), ("exact", True)):
        run(quick(exact=exact, trials=3), tmp_path / name)
        stated = read_campaign(tmp_path / name / "campaign").tables
        truth = read_model(tmp_path / name / "truth.toml")
        ratios = [
            (truth.platform.mass / stated.platform.mass, stated.uncertainty.mass),
            (truth.platform.inertia / stated.platform.inertia, stated.uncertainty.inertia),
            (truth.surface.stiffness / stated.surface.stiffness, stated.uncertainty.stiffness),
            (truth.surface.damping / stated.surface.damping, stated.uncertainty.damping),
            (truth.surface.mu_s / stated.surface.mu_s, stated.uncertainty.mu_s),
        ]
        gravities = [b.gravity_sim / a.gravity_sim for a, b in zip(stated.trial, truth.trial, strict=True)]
        ratios += [(ratio, stated.uncertainty.gravity_sim) for ratio in gravities]
        for ratio, sigma in ratios:
            assert abs(ratio - 1) <= 3 * sigma + 1e-12
            assert (ratio == 1) == exact
        assert len(set(gravities)) == (1 if exact else 3)  # drawn anew for each trial


def test_free_of_the_rig_there_is_no_counterweight(tmp_path):
    run(quick(gravity=(0.05,), rig=(), exact=True), tmp_path / "a")
    campaign = read_campaign(tmp_path / "a" / "campaign")
    assert campaign.tables.rig is None
    rest = campaign.recording("001", "imu")
    still = rest.time < 0
    assert rest["ay_m_s2"][still].mean() == pytest.approx(0.05, abs=0.03)  # g_sim, not the earth's


def test_a_platform_of_other_rows_is_told_so_and_explained_by_the_model(tmp_path):
    """A cube has four rows: a model of the Hedgehog's eight tips it at another torque, and cannot follow its tumble."""
    run(quick(platform="cubli", motor_torques=(0.01,), exact=True, surface="brick"), tmp_path / "a")
    stated, truth = read_campaign(tmp_path / "a" / "campaign"), read_model(tmp_path / "a" / "truth.toml")
    assert stated.tables.platform.spike_count == truth.platform.spike_count == 4
    assert model_trial(stated.tables, stated.tables.trial[0]).spike_count == 4
    assert "spike_count = 4 (model)" in " ".join(
        f"{name} = {number.value:g} ({number.origin})"
        for name, number in plan_tumble(TumbleSettings(model=str(tmp_path / "a" / "truth.toml"))).numbers.items()
    )
    total, count = make_problem(stated).chi_square({}, (), "001")
    assert total / count == pytest.approx(1.0, abs=0.25)
    eight = stated.tables.platform.model_copy(update={"spike_count": None})
    other = replace(stated, tables=stated.tables.model_copy(update={"platform": eight}))
    total, count = make_problem(other).chi_square({}, (), "001")
    assert total / count > 5


def test_the_command_line_makes_one_with_a_report(reported, tmp_path, capsys):
    tokens = ["campaign", "--rig", "0.0085", "--motor-torques", "0.22", "--brake-torques", "6", "--duration", "0.3"]
    assert main([*tokens, "--quiet", "--json", "--out", "a"]) == 0
    assert json.loads(capsys.readouterr().out)["quantities"]["trial_count"]["value"] == 2
    page = Path("a/report.html").read_text()
    assert "data:image/png" in page and "https://" not in page


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--motor-torques", "0.5"], ["torque = 0.5", "at most 0.22"]),
        (["--motor-torques", "0.1", "0.1"], ["motor_torques", "twice"]),
        (["--pose-std", "0.1", "-0.1", "0.1"], ["--pose-std[1] = -0.1", "greater than or equal to 0"]),
        (["--gravity", "0.1", "--counterweight", "5"], ["counterweight = 5", "without a rig"]),
        (["--ground", "bekker"], ["ground = 'bekker'", "spring-damper"]),
        (["--effects", "magic"], ["'magic'"]),
    ],
)
def test_bad_input_is_refused_by_name_and_leaves_no_folder(capsys, options, said):
    assert main(["campaign", *options, "--out", "a"]) == 2
    text = capsys.readouterr().err
    assert all(words in text for words in said), text
    assert not Path("a").exists()


def test_a_tumble_writes_trials_of_itself_and_keeps_the_truth_in_its_own_folder(capsys):
    tokens = ["tumble", "--surface", "brick", "--gravity", "0.1", "--torque", "0.15", "--duration", "0.6"]
    tokens += ["--effects", "tip-radius.radius=0.01", "--campaign", "c", "--campaign-trials", "3"]
    tokens += ["--campaign-noise", "0.5", "--out", "run", "--quiet"]
    assert main(tokens) == 0
    campaign, truth = read_campaign("c"), read_model("run/truth.toml")
    trials = campaign.tables.trial
    assert [(trial.torque, trial.gravity_sim) for trial in trials] == [(0.15, 0.1)] * 3
    assert campaign.tables.rig is None and campaign.tables.sensors.pose.std == (0.00025, 0.00025, 0.0015)
    assert [effect.id for effect in truth.effect] == ["tip-radius"]
    assert len({trial.gravity_sim for trial in truth.trial}) == 3
    assert truth.platform.inertia != campaign.tables.platform.inertia
    said = "".join(path.read_text() for path in Path("c").iterdir())
    assert "tip-radius" not in said and not Path("c/truth.toml").exists()
    # what it recorded is the truth with half the usual noise
    found = tuple(Effect(id=effect.id, parameters=effect.parameters) for effect in truth.effect)
    bare, _ = record(model_trial(truth, truth.trial[1], effects=found), duration=0.6, sensors=SensorSet(), seed=None)
    noise = (campaign.recording("002", "imu")["gyro_rad_s"] - bare.imu["gyro_rad_s"]) / 0.005
    assert abs((noise**2).mean() - 1) < 5 * math.sqrt(2 / len(noise))
    # done again into the same folder it finds its own campaign there; another's is never written over
    assert resume_tumble("run")["campaign"]["trials"][0]["id"] == "001"
    capsys.readouterr()
    assert main([*tokens[:-2], "other"]) == 2
    assert "campaign = 'c' is in use" in capsys.readouterr().err
    assert not Path("other").exists()


def test_a_tumble_on_another_law_has_no_campaign(capsys):
    tokens = ["tumble", "--ground", "hunt-crossley", "--campaign", "c", "--out", "run"]
    assert main(tokens) == 2
    assert "use the spring-damper" in capsys.readouterr().err
