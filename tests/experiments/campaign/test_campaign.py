"""Campaigns read, written and read back; what is wrong with one is said by file, line or key."""

import json
import math
import random
import re

import numpy as np
import pytest
from campaign_files import IMU, POSE, change, penetration_folder, tumble_folder

from experiments.campaign import (
    EffectTable,
    TumbleModel,
    read_campaign,
    read_model,
    write_campaign,
    write_model,
)
from experiments.campaign.digests import DIGESTS
from experiments.campaign.files import TEMPLATES, new_campaign


def same_bits(one, other):
    """Whether two campaigns hold the same tables and the same bits."""
    assert one.tables == other.tables
    assert one.recordings.keys() == other.recordings.keys()
    for key, recording in one.recordings.items():
        twin = other.recordings[key]
        assert recording.extra == twin.extra
        assert list(recording.columns) == list(twin.columns)
        for name in recording.columns:
            assert recording[name].tobytes() == twin[name].tobytes()


# Reading


def test_a_campaign_of_tumbles_reads_as_it_is_written_down(tmp_path):
    campaign = read_campaign(tumble_folder(tmp_path / "c"))
    tables = campaign.tables
    assert (tables.name, tables.platform.mass, tables.surface.damping) == ("brick, October", 5.3, 60.0)
    assert tables.notes["room"] == {"temperature": 21.5}
    first, second = tables.trial
    assert (first.actuator, first.torque_until, second.torque_until) == ("motor", 10.0, math.inf)
    assert tables.counterweight_of(second) == 5.21
    assert tables.local_gravity_of(second) == 9.80665
    pose = campaign.recording("001", "pose")
    assert pose["theta_rad"].tolist() == [0.0, 0.001, 0.002, 0.1]
    assert np.isnan(pose["x_m"][2]) and np.isnan(pose["y_m"][2])
    assert campaign.recording("002", "imu") is None
    with pytest.raises(KeyError, match="003"):
        campaign.recording("003", "imu")


def test_a_campaign_of_penetrations_reads_as_it_is_written_down(tmp_path):
    campaign = read_campaign(penetration_folder(tmp_path / "c"))
    driven, drop = campaign.tables.trial
    assert [campaign.tables.diameter_of(trial) for trial in (driven, drop)] == [0.010, 0.012]
    assert drop.grain_gravity == 1.0
    assert campaign.recording("001", "data")["force_N"].tolist() == [0.0, 0.9]
    assert campaign.recording("002", "data")["accel_m_s2"].tolist() == [9.80665, 9.80665, -3.0]


def test_without_a_rig_there_is_no_counterweight_and_the_gravity_is_the_trials(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    change(folder / "campaign.toml", "[rig]\ncounterweight = 5.21   # kg\nwire_length = 2.2      # m\n", "")
    change(folder / "campaign.toml", "gravity = 9.80665      # m/s2\n", "")
    change(folder / "campaign.toml", "counterweight = 5.21\n", "")
    tables = read_campaign(folder).tables
    assert tables.counterweight_of(tables.trial[0]) == 0.0
    assert tables.local_gravity_of(tables.trial[0]) == 0.0834


def test_what_uncertainty_does_not_list_is_exact_and_sliding_friction_is_half_where_it_is_left_out(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    change(folder / "campaign.toml", "mass = 0.002\n", "")
    change(folder / "campaign.toml", "mu_d = 0.25\n", "")
    tables = read_campaign(folder).tables
    assert tables.uncertainty.mass == 0.0
    assert tables.surface.sliding_friction == 0.25


@pytest.mark.parametrize(
    ("header", "row", "column", "expected"),
    [
        ("t_ms,x_m,y_m,theta_rad", "20,1,2,3", "t_s", 0.02),
        ("t_s,x_mm,y_m,theta_rad", "0,5,2,3", "x_m", 0.005),
        ("t_s,x_m,y_m,theta_deg", "0,1,2,90", "theta_rad", math.pi / 2),
    ],
)
def test_units_come_from_the_suffix(tmp_path, header, row, column, expected):
    folder = tumble_folder(tmp_path / "c")
    (folder / "001-pose.csv").write_text(f"{header}\n{row}\n")
    assert read_campaign(folder).recording("001", "pose")[column][0] == expected


def test_units_of_the_imu_the_wheel_and_the_force_come_from_the_suffix(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    (folder / "001-imu.csv").write_text("t_s,gyro_deg_s,ax_g,ay_m_s2\n0,180,1,9.8\n1,60,0,9.8\n")
    (folder / "001-wheel.csv").write_text("t_s,omega_rpm\n0,60\n")
    campaign = read_campaign(folder)
    assert campaign.recording("001", "imu")["gyro_rad_s"].tolist() == [math.pi, math.radians(60)]
    assert campaign.recording("001", "imu")["ax_m_s2"].tolist() == [9.80665, 0.0]
    assert campaign.recording("001", "wheel")["omega_rad_s"][0] == pytest.approx(2 * math.pi, rel=1e-15)
    folder = penetration_folder(tmp_path / "p")
    (folder / "001.csv").write_text("t_s,depth_mm,force_mN\n0,1,2500\n")
    assert read_campaign(folder).recording("001", "data")["force_N"][0] == 2.5


def test_unknown_columns_are_kept_and_columns_may_come_in_any_order(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    (folder / "001-imu.csv").write_text('ay_m_s2,t_s,remark,gyro_rad_s,ax_m_s2\n9.8,0,"a, b",1,2\n')
    recording = read_campaign(folder).recording("001", "imu")
    assert list(recording.columns) == ["t_s", "gyro_rad_s", "ax_m_s2", "ay_m_s2"]
    assert recording["ay_m_s2"][0] == 9.8
    assert recording.extra == {"remark": ("a, b",)}


def test_gaps_are_nan_and_rows_of_nothing_else_are_left_out(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    (folder / "001-imu.csv").write_text(IMU + "nan,nan,nan,nan\n,,,\n\n0.02,NaN,,9.9\n")
    recording = read_campaign(folder).recording("001", "imu")
    assert recording.time.tolist() == [0.0, 0.01, 0.02]
    assert np.isnan(recording["gyro_rad_s"][2])


# Round trips


@pytest.mark.parametrize("make", [tumble_folder, penetration_folder])
def test_a_campaign_written_and_read_back_is_the_same_to_the_bit(tmp_path, make):
    folder = make(tmp_path / "c")
    table = next(folder.glob("001*.csv"))
    header, *rows = table.read_text().splitlines()
    drawn = np.random.default_rng(3).standard_normal((len(rows), header.count(","))) / 3
    cells = [
        ",".join([row.split(",")[0], *map(repr, values)]) for row, values in zip(rows, drawn.tolist(), strict=True)
    ]
    table.write_text("\n".join([header + ",odd", *(f"{row},?{number}" for number, row in enumerate(cells))]))
    campaign = read_campaign(folder)
    again = read_campaign(write_campaign(tmp_path / "again", campaign))
    same_bits(campaign, again)
    (held,) = [recording for recording in campaign.recordings.values() if recording.extra]
    assert np.array_equal(np.stack([held[name] for name in list(held.columns)[1:]], axis=1), drawn)
    write_campaign(tmp_path / "third", again)
    for path in (tmp_path / "again").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "third" / path.relative_to(tmp_path / "again")).read_bytes()


def one_digit_other(path, chance):
    """Change one digit of a file: the number is as good as another."""
    content = bytearray(path.read_bytes())
    at = chance.choice([at for at, byte in enumerate(content) if byte in b"0123456789"])
    content[at] = chance.choice([byte for byte in b"0123456789" if byte != content[at]])
    path.write_bytes(content)


@pytest.mark.parametrize("make", [tumble_folder, penetration_folder])
def test_every_changed_digit_of_a_written_campaign_is_found_and_may_be_intended(tmp_path, make):
    """Without the digests, as they are in a campaign that a person makes, the file is taken as it is."""
    folder = write_campaign(tmp_path / "written", read_campaign(make(tmp_path / "c")))
    chance = random.Random(make.__name__)
    files = sorted(path for path in folder.rglob("*.*") if path.name != DIGESTS)
    for path in files * 5:
        whole = path.read_bytes()
        one_digit_other(path, chance)
        with pytest.raises(ValueError, match="has changed since its digest") as refused:
            read_campaign(folder)
        assert f"{path}: " in str(refused.value) and f"delete {folder / DIGESTS}" in str(refused.value)
        path.write_bytes(whole)
    read_campaign(folder)
    other = folder / "campaign.toml"
    other.write_text(other.read_text().replace("stiffness = ", "stiffness = 1"))
    (folder / DIGESTS).unlink()
    assert str(read_campaign(folder).tables.surface.stiffness).startswith("1")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"digests": 1}', "\x00"])
def test_damaged_digests_of_a_campaign_are_named(tmp_path, text):
    folder = write_campaign(tmp_path / "written", read_campaign(tumble_folder(tmp_path / "c")))
    (folder / DIGESTS).write_text(text)
    with pytest.raises(ValueError, match=f"{DIGESTS}: is damaged"):
        read_campaign(folder)


def test_shipped_recordings_have_digests_and_templates_to_fill_in_have_none():
    """The recordings of others are as they were put here; a template is there to be changed."""
    with_digests = {path.parent.name for path in TEMPLATES.glob(f"*/{DIGESTS}")}
    assert with_digests == {path.parent.name for path in TEMPLATES.glob("cmu-*/campaign.toml")}
    for name in with_digests:
        named = json.loads((TEMPLATES / name / DIGESTS).read_text())["digests"]
        assert set(named) == {path.name for path in (TEMPLATES / name).glob("c*.toml")} | {
            path.name for path in (TEMPLATES / name).glob("*.csv")
        }
        read_campaign(TEMPLATES / name)


def test_a_campaign_is_not_written_over_another(tmp_path):
    campaign = read_campaign(tumble_folder(tmp_path / "c"))
    with pytest.raises(ValueError, match="in use"):
        write_campaign(tmp_path / "c", campaign)


def test_a_model_written_and_read_back_is_the_same(tmp_path):
    tables = read_campaign(tumble_folder(tmp_path / "c")).tables
    shared = {name: getattr(tables, name) for name in TumbleModel.model_fields if name not in ("trial", "effect")}
    effects = (
        EffectTable(id="pendulum", parameters={"length": 2.2}),
        EffectTable(id="mine", file="mine.py"),
    )
    model = TumbleModel(**shared, effect=effects)
    write_model(tmp_path / "model.toml", model)
    assert read_model(tmp_path / "model.toml") == model
    free = model.model_copy(update={"rig": None})
    write_model(tmp_path / "free.toml", free)
    assert read_model(tmp_path / "free.toml") == free


def test_a_model_needs_no_trials_but_a_campaign_does(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    text = (folder / "campaign.toml").read_text().split("[[trial]]")[0]
    (folder / "campaign.toml").write_text(text)
    assert read_model(folder / "campaign.toml").effect == ()
    with pytest.raises(ValueError, match=r"campaign\.toml: trial is missing; at least one \[\[trial\]\]"):
        read_campaign(folder)


# What is wrong


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mass = 5.3 ", 'mass = "heavy" ', ["[platform] mass = 'heavy'", "kg", "expected"]),
        ("mass = 5.3 ", "mass = -5.3 ", ["[platform] mass = -5.3", "greater than 0"]),
        ("mass = 5.3 ", "mass = nan ", ["[platform] mass = nan", "finite"]),
        ("mass = 5.3 ", "mass = true ", ["[platform] mass = True", "kg"]),
        ("mass = 5.3 ", "", ["[platform] mass is missing", "kg was expected"]),
        ("mass = 5.3 ", "mas = 5.3 ", ["[platform] mas = 5.3 is an unknown key", "did you mean 'mass'"]),
        ("[wheel]", "[wheels]", ["wheels = ", "unknown key", "'wheel'"]),
        ("[uncertainty]\n", "[uncertainty]\ncolour = 0.1\n", ["[uncertainty] colour = 0.1 is an unknown key"]),
        ("mass = 0.002", "mass = -0.002", ["[uncertainty] mass = -0.002", "greater than or equal to 0"]),
        ("std = [0.0005, 0.0005, 0.003]", "std = [0.0005, -0.0005, 0.003]", ["[sensors.pose] std[1] = -0.0005"]),
        ("std = [0.0005, 0.0005, 0.003]", "std = [0.0005]", ["[sensors.pose] std", "missing", "three numbers"]),
        ("std = [0.5]", "std = 0.5", ["[sensors.wheel] std = 0.5", "one number in brackets"]),
        ("[sensors.imu]", "[sensors.gyro]", ["[sensors] gyro", "unknown key"]),
        ("format = ", 'format = "hedgehog-campaign/2"\n#', ["format = 'hedgehog-campaign/2'", "hedgehog-campaign/1"]),
        ("format = ", "#", ["format is missing", "hedgehog-campaign/1"]),
        ('kind = "tumble"', 'kind = "tumbles"', ["kind = 'tumbles'", "'tumble' or 'penetration'"]),
        ('kind = "tumble"', "", ["kind is missing", "'tumble' or 'penetration'"]),
        ("mu_d = 0.25", "mu_d = 0.6", ["[surface]", "mu_d = 0.6 is above mu_s = 0.5"]),
        ('id = "002"', 'id = "001"', ["[[trial]] 2", "id = '001' is that of [[trial]] 1 too"]),
        ('id = "002"', "id = 2", ["[[trial]] 2", "id = 2", "text"]),
        ('id = "002"', "", ["[[trial]] 2", "id is missing"]),
        ('id = "002"', 'id = "../002"', ["[[trial]] 2", "id = '../002'", "a name without /"]),
        ("torque = 6.0", 'torque = "strong"', ["[[trial]] 2 (id '002') torque = 'strong'", "N m"]),
        ('actuator = "brake"', 'actuator = "hand"', ["[[trial]] 2 (id '002') actuator = 'hand'", "'motor' or 'brake'"]),
        ("wheel_speed_0 = 500.0", "", ["[[trial]] 2 (id '002')", "nothing to brake", "rad/s"]),
        ("wheel_speed_0 = 500.0", "speed = 1.0", ["[[trial]] 2 (id '002') speed = 1.0 is an unknown key"]),
        ("inertia = 0.06 ", "inertia = 0.3 ", ["[platform] inertia = 0.3 is above mass spike_length^2 = 0.212"]),
        ("inertia = 0.06 ", "inertia = 0.0005 ", ["[wheel] inertia = 0.0012 is not below [platform] inertia = 0.0005"]),
        ("gravity_sim = 0.0834\ntorque = 6", "torque = 6", ["gravity_sim is missing", "m/s2"]),
        ("gravity_sim = 0.0834\ntorque = 6", "gravity_sim = 9.9\ntorque = 6", ["gravity_sim = 9.9 is not below"]),
        ("counterweight = 5.21   #", "counterweight = 6.0 #", ["(id '002')", "counterweight = 6 is not below", "lift"]),
        ('pose = "more/002-pose.csv"\n', "", ["(id '002')", "names no file", "pose, imu, wheel"]),
        ('pose = "more/002-pose.csv"', 'pose = "/002-pose.csv"', ["pose = '/002-pose.csv'", "relative"]),
        ('pose = "more/002-pose.csv"', 'pose = "003-pose.csv"', ["003-pose.csv", "no such file"]),
        ("[sensors.pose]\nstd = [0.0005, 0.0005, 0.003]", "", ["pose is given, but [sensors.pose] is missing"]),
        ("mass = 5.3 ", "mass = = 5.3 ", ["not TOML", "line"]),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_table_is_said_by_file_and_key(tmp_path, old, new, said):
    folder = tumble_folder(tmp_path / "c")
    change(folder / "campaign.toml", old, new)
    with pytest.raises(ValueError) as caught:
        read_campaign(folder)
    text = str(caught.value)
    assert all(words in text for words in said), text
    assert "campaign.toml" in text or "003-pose.csv" in text
    assert "Traceback" not in text and "pydantic" not in text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("-0.1,0.0,0.18,0.0", "-0.1,0.0,high,0.0", ["line 2", "y_m = 'high'", "number or nan"]),
        ("-0.1,0.0,0.18,0.0", "-0.1,0.0,inf,0.0", ["line 2", "y_m = 'inf'", "finite"]),
        ("-0.1,0.0,0.18,0.0", "-0.1,0.0,-1e308,0.0", ["line 2", "y_m = '-1e308'", "1e+50"]),
        ("-0.1,0.0,0.18,0.0", "-0.1,0.0,0.18", ["line 2", "found 3 cells, expected 4"]),
        ("-0.1,0.0,0.18,0.0", ",0.0,0.18,0.0", ["line 2", "t_s is missing"]),
        ("0.2,0.01", "0.05,0.01", ["line 5", "t_s runs backwards", "0.1 s to 0.05 s"]),
        ("x_m,", "", ["line 1", "column x_m or x_mm is missing; found t_s, y_m, theta_rad"]),
        ("x_m,", "x_cm,", ["line 1", "x_m or x_mm is missing; found t_s, x_cm"]),
        ("y_m,theta_rad", "x_mm,theta_rad", ["line 1", "x_m and x_mm are the same quantity"]),
        ("y_m,theta_rad", "y_m,y_m", ["line 1", "column 'y_m' is there 2 times"]),
        (POSE, "t_s,x_m,y_m,theta_rad\n", ["no row of numbers"]),
        (POSE, "", ["line 1", "no header"]),
        (POSE, POSE.replace(",", ";").replace(".", ","), ["parted by semicolons", "decimal commas"]),
        (POSE, POSE.replace(".", ","), ["decimal commas"]),
    ],
)
def test_what_is_wrong_with_a_recording_is_said_by_file_and_line(tmp_path, old, new, said):
    folder = tumble_folder(tmp_path / "c")
    change(folder / "001-pose.csv", old, new)
    with pytest.raises(ValueError) as caught:
        read_campaign(folder)
    text = str(caught.value)
    assert all(words in text for words in ["001-pose.csv", *said]), text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mass = 0.5\n", "", ["[[trial]] 2 (id '002')", "mode = 'drop' needs [spike] mass"]),
        ("speed = 0.8\n", "", ["[[trial]] 2 (id '002')", "speed is missing", "m/s"]),
        ('mode = "drop"', 'mode = "thrown"', ["mode = 'thrown'", "'driven' or 'drop'"]),
        ("diameter = 0.012\n", "", ["(id '002')", "diameter is given neither here nor in [spike]"]),
        ('tip = "sphere"\ncone_angle = 60.0', 'tip = "cone"', ["[spike]", "cone_angle is missing"]),
        ("[sensors.accel]\nstd = [0.1]", "", ["(id '002')", "[sensors.accel] is missing"]),
        ('data = "002.csv"\n', "", ["data is missing", "accel_m_s2"]),
        ('data = "002.csv"\n', 'data = "001.csv"\n', ["001.csv, line 1", "accel_m_s2 or accel_g is missing"]),
    ],
)
def test_what_is_wrong_with_a_campaign_of_penetrations_is_said(tmp_path, old, new, said):
    folder = penetration_folder(tmp_path / "c")
    change(folder / "campaign.toml", old, new)
    with pytest.raises(ValueError) as caught:
        read_campaign(folder)
    assert all(words in str(caught.value) for words in said), str(caught.value)


def test_every_fault_of_the_tables_is_said_at_once(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    change(folder / "campaign.toml", "mass = 5.3 ", "mass = -1 ")
    change(folder / "campaign.toml", "mu_s = 0.5\n", "mu_x = 0.5\n")
    with pytest.raises(ValueError) as caught:
        read_campaign(folder)
    assert len(str(caught.value).splitlines()) == 3  # the mass, mu_s missing, mu_x unknown


def test_trials_that_are_all_refused_are_not_said_to_be_missing(tmp_path):
    folder = tumble_folder(tmp_path / "c")
    path = folder / "campaign.toml"
    text = re.sub(r'actuator = "(motor|brake)"', 'actuator = "hand"', path.read_text())
    path.write_text(text)
    with pytest.raises(ValueError) as caught:
        read_campaign(folder)
    said = str(caught.value).splitlines()
    assert len(said) == text.count("[[trial]]") and all("actuator = 'hand'" in line for line in said)


def test_a_campaign_there_is_not_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no folder"):
        read_campaign(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match=r"campaign\.toml: there is no such file"):
        read_campaign(tmp_path / "empty")
    (tmp_path / "run").mkdir()
    tumble_folder(tmp_path / "run" / "campaign")
    with pytest.raises(ValueError, match=r"run' is a run folder: its campaign is '.*campaign'"):
        read_campaign(tmp_path / "run")


@pytest.mark.parametrize(
    ("header", "renamed"),
    [
        (
            "time [s],displacement [mm],force [N]",
            "time [s] to t_s, displacement [mm] to depth_mm, force [N] to force_N",
        ),
        ("Time (ms),z_mm,load_mN", "Time (ms) to t_ms, z_mm to depth_mm, load_mN to force_mN"),
        ("t_s,depth [cm],Force [N]", "Force [N] to force_N"),
        ("t_s,depth_m,F [kN]", None),
    ],
)
def test_columns_of_another_program_are_refused_once_with_what_to_rename(tmp_path, header, renamed):
    """Ten files had three lines each. What has no unit of the format is not renamed."""
    folder = new_campaign(tmp_path / "c", kind="penetration")
    tables = (folder / "campaign.toml").read_text().split("[[trial]]")[0]
    for name in ("1", "2", "3"):
        tables += f'[[trial]]\nid = "{name}"\nmode = "driven"\ndata = "{name}.csv"\n'
        (folder / f"{name}.csv").write_text(f"{header}\n0,0,0\n1,1,1\n")
    (folder / "campaign.toml").write_text(tables)
    with pytest.raises(ValueError) as refused:
        read_campaign(folder)
    (line,) = str(refused.value).splitlines()
    assert "(1.csv, 2.csv, 3.csv)" in line
    assert line.partition("; rename ")[2] == (renamed or "")
