"""`hedgebed campaign new`, `check` and `from-run`: templates that hold, faults all said at once, odd data found."""

import dataclasses
import json

import numpy as np
import pytest
from campaign_files import change, tumble_folder
from fake_bed import FakeBed
from golden import golden
from penetration_campaigns import campaign_of, driven_trial, drop_trial

from dem import Material
from experiments.campaign import Campaign, Recording, read_campaign, write_campaign
from experiments.campaign import tables as known
from experiments.campaign.files import TEMPLATES, new_campaign
from experiments.check import template_warning
from experiments.cli.main import main
from experiments.diagnose.inspection import find_faults
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.penetrate.recorded import SpikeSensors, campaign_of_run
from experiments.penetrate.settings import PenetrateSettings
from experiments.tumble import synthesis
from experiments.tumble.campaign_settings import CampaignSettings

BOTH = pytest.mark.parametrize("kind", ["tumble", "penetration"])
TABLES = {
    "tumble": (
        known.PlatformTable, known.WheelTable, known.RigTable, known.TumbleSurface, known.TumbleUncertainty,
        known.PoseSensor, known.ImuSensor, known.TumbleTrial,
    ),
    "penetration": (
        known.SpikeTable, known.PenetrationSurface, known.PenetrationUncertainty, known.DepthSensor,
        known.PenetrationTrial,
    ),
}  # fmt: skip


# The name of one that ships


def test_a_campaign_that_ships_is_found_by_its_name_after_a_folder_of_that_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert read_campaign("cmu-plate-sinkage").tables.name == read_campaign(TEMPLATES / "cmu-plate-sinkage").tables.name
    assert main(["campaign", "check", "cmu-plate-sinkage", "--out", "checked", "--quiet"]) == 0
    new_campaign("cmu-plate-sinkage", kind="tumble")
    assert read_campaign("cmu-plate-sinkage").tables.kind == "tumble"
    capsys.readouterr()
    assert main(["diagnose", "cmu-plate-sinkag", "--out", "made"]) == 2
    assert "mean 'cmu-plate-sinkage'" in capsys.readouterr().err
    assert main(["diagnose", "nowhere", "--out", "made"]) == 2
    assert "cmu-plate-sinkage, cmu-plates-against-bed," in capsys.readouterr().err


# new


@BOTH
def test_the_template_reads_as_a_campaign_and_explains_every_key(tmp_path, kind):
    folder = new_campaign(tmp_path / "c", kind=kind)
    campaign = read_campaign(folder)
    assert campaign.tables.kind == kind
    assert not [finding for finding in find_faults(campaign) if "has no recording" not in finding.what]
    lines = [line.lstrip("# ") for line in (folder / "campaign.toml").read_text().splitlines()]
    keys = {line.split("=")[0].strip() for line in lines if "=" in line}
    for table in TABLES[kind]:
        assert set(table.model_fields) <= keys, table.__name__


@BOTH
def test_a_template_never_overwrites(tmp_path, kind, capsys):
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "mine.txt").write_text("mine")
    assert main(["campaign", "new", str(tmp_path / "c"), "--kind", kind]) == 2
    assert "in use" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "c").iterdir()] == ["mine.txt"]


def test_a_new_campaign_is_checked_with_a_report(tmp_path, capsys):
    assert main(["campaign", "new", str(tmp_path / "c"), "--kind", "penetration"]) == 0
    told = " ".join("".join(capsys.readouterr()).split())
    assert "001.csv, 002.csv, 003.csv" in told and "to delete or" in told
    assert "starting values" in (tmp_path / "c" / "campaign.toml").read_text()
    assert main(["campaign", "check", str(tmp_path / "c"), "--out", str(tmp_path / "run"), "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "drop 0.4 m/s" in said and "nothing found" in " ".join(said.split())
    assert "are made up" in (tmp_path / "run" / "report.html").read_text()
    again = ["campaign", "check", str(tmp_path / "run" / "run.toml"), "--out", str(tmp_path / "again"), "--quiet"]
    assert main([*again, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    # the speeds of both pushes change the force by less than its noise
    assert [trial["alike"] for trial in result["trials"]] == [2, 2, 1]
    assert result["recordings"][2]["rate"] == pytest.approx(1000.0)


@BOTH
def test_a_campaign_with_recordings_of_the_template_is_warned_of(tmp_path, kind, capsys):
    """By their numbers, whatever the files are called; one that is replaced is left out, and none is no warning."""
    folder = new_campaign(tmp_path / "c", kind=kind)
    assert template_warning(read_campaign(folder)).startswith("all recordings")
    assert main(["campaign", "check", str(folder), "--out", str(tmp_path / "run"), "--quiet"]) == 0
    assert "are made up" in " ".join(capsys.readouterr().out.split())
    campaign = read_campaign(folder)

    def replaced(count):
        changed = {trial.id for trial in campaign.tables.trial[:count]}
        recordings = {
            key: Recording({name: values + (name != "t_s") * 1e-6 for name, values in recording.columns.items()})
            if key[0] in changed
            else recording
            for key, recording in campaign.recordings.items()
        }
        return dataclasses.replace(campaign, recordings=recordings)

    first, *others = (trial.id for trial in campaign.tables.trial)
    said = template_warning(replaced(1))
    assert first not in said and all(name in said for name in others)
    own = write_campaign(tmp_path / "own", replaced(len(others) + 1))
    assert main(["campaign", "check", str(own), "--out", str(tmp_path / "checked"), "--quiet"]) == 0
    assert "are made up" not in " ".join(capsys.readouterr().out.split())
    page = (tmp_path / "checked" / "report.html").read_text()
    assert ("Nothing odd" in page) == (kind == "penetration")  # that of tumbles has a wheel without a recording


# check: what cannot be read


def test_all_faults_are_said_at_once_by_file_line_and_key(tmp_path, capsys):
    folder = tumble_folder(tmp_path / "c")
    change(folder / "campaign.toml", "mass = 5.3 ", "mas = 5.3 ")
    change(folder / "campaign.toml", "[sensors.wheel]\nstd = [0.5]\n", "")
    change(folder / "campaign.toml", 'id = "002"', 'id = "001"')
    change(folder / "001-imu.csv", "0.01,0.1,", "0.01,fast,")
    change(folder / "001-imu.csv", "0.0,0.0,0.0,9.8\n", "0.0,0.0,0.0\n")
    change(folder / "001-wheel.csv", "0.1,0.6", "0.05,0.6")
    (folder / "more" / "002-pose.csv").unlink()
    assert main(["campaign", "check", str(folder), "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    for part in (
        "campaign.toml: [platform] mass is missing; kg was expected",
        "[platform] mas = 5.3 is an unknown key; did you mean 'mass'?",
        "[[trial]] 2 (id '001'): id = '001' is that of [[trial]] 1 too",
        "[[trial]] 1 (id '001'): wheel is given, but [sensors.wheel] is missing",
        "001-imu.csv, line 2: found 3 cells, expected 4",
        "001-imu.csv, line 3: gyro_rad_s = 'fast', a number or nan was expected",
        "001-wheel.csv, line 4: t_s runs backwards, from 0.1 s to 0.05 s",
        "002-pose.csv: there is no such file",
    ):
        assert part in said
    assert not (tmp_path / "run").exists()


def test_of_a_thousand_faults_of_one_kind_five_are_said_and_the_number(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    (folder / "001-wheel.csv").write_text("t_s,omega_rad_s\n" + "".join(f"{k},x\n" for k in range(1000)))
    with pytest.raises(ValueError, match="omega_rad_s = 'x'") as error:
        read_campaign(folder)
    lines = str(error.value).splitlines()
    assert len(lines) == 6 and "and 995 more" in lines[5]


# check: what can be read but is odd


@pytest.fixture(scope="module")
def tumbles(tmp_path_factory):
    """Five trials alike, of a motor on brick."""
    settings = CampaignSettings(
        rig=(0.0085,), motor_torques=(0.22,), brake_torques=(), duration=1.0, trials=5, surface="brick"
    )
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
        synthesis.run(settings, folder / "run")
    return read_campaign(folder / "run" / "campaign")


def altered(campaign, key, change):
    columns = {name: values.copy() for name, values in campaign.recordings[key].columns.items()}
    change(columns)
    return Campaign(campaign.tables, {**campaign.recordings, key: Recording(columns)})


def lost_marker(columns):
    columns["x_m"][80:90] += 0.05
    columns["y_m"][80:90] -= 0.03


def late_clock(columns):
    columns["t_s"][110:] += 0.4


def silence(columns):
    columns["gyro_rad_s"][40:70] = np.nan


def other_way(columns):
    columns["x_m"] += 0.1 * np.maximum(columns["t_s"], 0) ** 2


def test_in_good_tumbles_nothing_is_found(tumbles):
    assert find_faults(tumbles) == []


@pytest.mark.parametrize(
    ("key", "change", "said"),
    [
        (("001", "pose"), lost_marker, "jump that no motion makes (the camera lost its marker)"),
        (("002", "pose"), late_clock, "the clock of the camera jumps forward by 0.4 s"),
        (("003", "imu"), silence, "gyro has no valid row for 0.31 s"),
        (("004", "pose"), other_way, "disagrees with its 4 replicates, which agree with one another: in x"),
    ],
)
def test_what_is_odd_in_a_tumble_is_found_where_it_is_and_nowhere_else(tumbles, key, change, said):
    findings = find_faults(altered(tumbles, key, change))
    assert {finding.trial for finding in findings} == {key[0]}
    assert any(said in finding.what and f"trial {key[0]}" in finding.what for finding in findings)


def test_a_missing_sensor_is_said(tumbles):
    trials = tuple(t.model_copy(update={"imu": None}) if t.id == "005" else t for t in tumbles.tables.trial)
    (finding,) = find_faults(Campaign(tumbles.tables.model_copy(update={"trial": trials}), tumbles.recordings))
    assert finding.trial == "005" and "no recording of" in finding.what


def test_a_push_at_odds_and_a_depth_that_jumps_are_found():
    pushes = [(f"{k}", "driven", 0.01, driven_trial(lambda z, v, top: 900 * z, speed=0.01, seed=k)) for k in range(3)]
    pushes.append(("soft", "driven", 0.01, driven_trial(lambda z, v, top: 600 * z, speed=0.01, seed=8)))
    drop = drop_trial(lambda z, v: 900 * z, speed=0.3)
    drop["depth_m"][100:] += 0.004
    found = find_faults(campaign_of([*pushes, ("fall", "drop", 0.3, drop)]))
    assert {finding.trial for finding in found} == {"soft", "fall"}
    golden("campaign/odd_pushes", [finding.what for finding in found])


# from-run


LOAD, MASS = 0.4, 0.3


@pytest.fixture(scope="module")
def grains(tmp_path_factory):
    """A finished run on three stand-in beds."""
    folder = tmp_path_factory.mktemp("grains") / "run"
    settings = PenetrateSettings(
        seeds=(1, 2, 3), speeds=(0.2, 0.4), other_speeds=(0.4,), drop_speeds=(0.1,), other_drop_speeds=(0.1,),
        drop_time=0.5, depth=0.01, frame_count=0, mass=MASS, load=LOAD, lowering_speed=0.1, substeps=20,
    )  # fmt: skip
    sand = Material("sand", 2650.0, 7e10, 0.25, 0.5, 0.5, 0.1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            beds, "prepare_bed",
            lambda settings, seed, young, progress: FakeBed(
                size=settings.bed_size, seed=seed, hardness=100.0 + 10 * seed, rate=0.5, unload=4000.0
            ),
        )  # fmt: skip
        patch.setattr(beds, "find_material", lambda name: sand)
        patch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
        patch.setattr(beds, "bed_step", lambda settings, young: 2e-5)
        penetrate.run(PenetrateSettings(**settings.model_dump()), folder)
    from experiments.runs.folder import RunFolder

    RunFolder.open(folder).set_status("done")
    return folder


def test_the_runs_of_a_bed_are_trials_as_the_format_has_them(grains, tmp_path):
    assert main(["campaign", "from-run", str(grains), str(tmp_path / "c"), "--rate", "500"]) == 0
    campaign = read_campaign(tmp_path / "c")
    trials = {trial.id: trial for trial in campaign.tables.trial}
    assert len(trials) == 10
    drop, driven, stood = (trials[name] for name in ("seed2-drop-0.1", "seed1-driven-0.2", "seed3-set-down"))
    # under a constant load m z'' = W - F: the body feels W / m, the grains their own weight
    assert (drop.gravity, drop.grain_gravity) == (pytest.approx(LOAD / MASS), 9.80665)
    assert (driven.speed, stood.mode, stood.speed) == (0.2, "driven", None)
    recording = campaign.recording("seed2-drop-0.1", "data")
    assert recording.time[0] > 0 and np.diff(recording.time) == pytest.approx(0.002)
    assert campaign.tables.uncertainty.stiffness >= 1
    again = write_campaign(tmp_path / "again", campaign)
    assert read_campaign(again).tables == campaign.tables


def test_what_is_recorded_is_the_run_plus_the_noise_that_is_stated(grains):
    sensors = SpikeSensors(rate=1000, depth_std=1e-4, force_std=0.03, accel_std=0.2, seed=4)
    noisy = campaign_of_run(grains, sensors=sensors)
    still = campaign_of_run(grains, sensors=SpikeSensors(rate=1000, depth_std=1e-12, force_std=1e-9, accel_std=1e-9))
    parts = {"depth_m": [], "force_N": [], "accel_m_s2": []}
    for key, recording in noisy.recordings.items():
        for name in list(recording.columns)[1:]:
            parts[name].append(recording[name] - still.recordings[key][name])
    for name, std in (("depth_m", 1e-4), ("force_N", 0.03), ("accel_m_s2", 0.2)):
        noise = np.concatenate(parts[name]) / std
        assert abs((noise**2).mean() - 1) < 5 * np.sqrt(2 / len(noise)), name
    # without noise a drop's acceleration is the second derivative of its depth
    drop = still.recordings["seed1-drop-0.1", "data"]
    step = np.diff(drop.time).mean()
    second = np.diff(drop["depth_m"], 2) / step**2
    inside = drop["depth_m"][1:-1] < 0.9 * drop["depth_m"].max()  # the stand-in's force has a kink where it turns
    assert second[inside] == pytest.approx(drop["accel_m_s2"][1:-1][inside], abs=0.02 * abs(drop["accel_m_s2"]).max())


@pytest.mark.parametrize("more", [(), ("--also", "other")])
def test_a_run_of_another_kind_is_refused_by_what_it_is(tmp_path, capsys, more):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
        spatial = ("tumble", "spatial", "--torque", "0", "0.02", "0", "--duration", "0.02", "--quiet")
        assert main([*spatial, "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    assert main(["campaign", "from-run", str(tmp_path / "run"), str(tmp_path / "made"), *more]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "'tumble spatial'" in said and "'penetrate'" in said


def test_only_a_finished_run_of_penetrate_becomes_a_campaign(grains, tmp_path):
    with pytest.raises(ValueError, match="has no run"):
        campaign_of_run(tmp_path)
    with pytest.raises(ValueError, match="use a higher rate"):
        campaign_of_run(grains, sensors=SpikeSensors(rate=5))


@BOTH
def test_a_changed_digit_of_ones_own_campaign_is_named_once_its_digests_are_kept(tmp_path, kind, capsys):
    """Without digests.json the changed number is a valid one."""
    folder = new_campaign(tmp_path / "c", kind=kind)
    reading = next(iter(read_campaign(folder).tables.trial[0].files.values()))
    whole = (folder / reading).read_text()
    digit = next(k for k in range(len(whole) - 9, 0, -1) if whole[k] in "12345678")
    changed = whole[:digit] + chr(ord(whole[digit]) + 1) + whole[digit + 1 :]
    check = ["campaign", "check", str(folder), "--quiet", "--out"]
    assert main([*check, str(tmp_path / "first")]) == 0 and not (folder / "digests.json").exists()
    assert main([*check, str(tmp_path / "kept"), "--keep-digests"]) == 0
    (folder / reading).write_text(changed)
    capsys.readouterr()
    assert main([*check, str(tmp_path / "again")]) == 2
    assert reading in (said := capsys.readouterr().err) and "digest" in said
    (folder / "digests.json").unlink()
    assert main([*check, str(tmp_path / "last")]) == 0
