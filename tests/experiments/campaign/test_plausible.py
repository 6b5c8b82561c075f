"""Recordings that are not what the format asks for are said by what is wrong with them; others are left in peace."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from golden import golden
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, drop_trial

from experiments.campaign import Campaign, Recording, TumbleCampaign, read_campaign
from experiments.campaign.files import TEMPLATES, new_campaign
from experiments.check import find_implausible
from experiments.check.pushes import depth_zeros
from experiments.diagnose.inspection import find_faults, unnamed_files
from experiments.diagnose.noise.stuck import clipped

GRAVITY = 9.80665


def changed(kind: str, trial: str, sensor: str, change: Callable[[dict[str, np.ndarray]], None]) -> Campaign:
    """The template of a kind with the columns of one recording changed."""
    campaign = read_campaign(TEMPLATES / f"template-{kind}")
    columns = {name: column.copy() for name, column in campaign.recordings[trial, sensor].columns.items()}
    change(columns)
    return replace(campaign, recordings={**campaign.recordings, (trial, sensor): Recording(columns)})


def times(name: str, factor: float, plus: float = 0.0) -> Callable[[dict[str, np.ndarray]], None]:
    """That column becomes factor x column + plus."""

    def change(columns: dict[str, np.ndarray]) -> None:
        columns[name] = factor * columns[name] + plus

    return change


def frozen(columns: dict[str, np.ndarray]) -> None:
    columns["force_N"][60:90] = columns["force_N"][60]


def lost_for_a_while(columns: dict[str, np.ndarray]) -> None:
    columns["depth_m"][60:70] += 0.02


@pytest.mark.parametrize(
    ("kind", "trial", "sensor", "change", "said"),
    [
        ("tumble", "001", "pose", times("theta_rad", 57.3), "theta_deg would say so"),
        ("tumble", "001", "imu", times("gyro_rad_s", 57.3), "gyro_deg_s would say so"),
        ("tumble", "001", "imu", times("gyro_rad_s", -1.0), "sign reversed"),
        ("tumble", "001", "pose", times("y_m", 1e3), "thousandths"),
        ("tumble", "001", "pose", times("x_m", 1.0, 0.02), "subtract its zero"),
        ("tumble", "001", "pose", times("y_m", 1.0, 0.02), "m at the start, where 0.18"),
        ("tumble", "001", "imu", times("ay_m_s2", 1 / GRAVITY), "units of g"),
        ("tumble", "001", "wheel", times("omega_rad_s", 9.55), "revolutions per minute"),
        ("tumble", "002", "wheel", times("omega_rad_s", 9.55), "1913 rad/s at the start where wheel_speed_0 = 200; "),
        ("tumble", "001", "wheel", times("t_s", 1.0, 0.2), "begins to change at 0.199 s"),
        ("penetration", "001", "data", times("depth_m", 1e3), "name the column depth_mm"),
        ("penetration", "001", "data", times("depth_m", -1.0), "hardly into the bed"),
        ("penetration", "001", "data", times("force_N", -1.0), "expected: the force of the bed on the spike, upwards"),
        ("penetration", "001", "data", times("force_N", 1.0, 4.9), "subtract its zero, or the weight of the spike"),
        ("penetration", "001", "data", times("t_s", 0.1), "speed = 0.01 m/s, but the depth goes in at 0.098"),
        ("penetration", "003", "data", times("accel_m_s2", 1.0, -GRAVITY), "gravity is to be added"),
        ("penetration", "003", "data", times("accel_m_s2", -1.0, GRAVITY), "gravity less the reading"),
        ("penetration", "001", "data", frozen, "the sensor is stuck"),
        ("penetration", "001", "data", lost_for_a_while, "comes back 10 rows later"),
    ],
)
def test_what_is_wrong_with_a_recording_is_said(kind, trial, sensor, change, said):
    told = [finding.what for finding in find_faults(changed(kind, trial, sensor, change)) if finding.trial == trial]
    assert any(said in what for what in told), told


def shifted(column: str, by: float, since: float) -> Callable[[dict[str, np.ndarray]], None]:
    """The clock of a sensor jumps forward by that much at that time."""

    def change(columns: dict[str, np.ndarray]) -> None:
        columns[column] += by * (columns[column] > since)

    return change


def anticlockwise(columns: dict[str, np.ndarray]) -> None:
    for name in {"theta_rad", "gyro_rad_s"} & set(columns):
        columns[name] *= -1


@pytest.mark.parametrize(
    ("changes", "tables", "said"),
    [
        ({"imu": shifted("t_s", 0.4, 0.5)}, {}, ["the clock of the IMU jumps forward by about 0.4 s", "set aside"]),
        ({"imu": shifted("t_s", 0.1, 0.5)}, {}, ["the clock of the IMU jumps forward by about 0.1 s", "set aside"]),
        ({"pose": shifted("t_s", 0.2, -1.0)}, {}, ["the camera's angle is 0.2 s later than the gyro", "t = 0"]),
        ({"imu": times("ax_m_s2", -1.0)}, {}, ["ax_m_s2 rises as the platform turns clockwise", "sign is reversed"]),
        ({"pose": anticlockwise, "imu": anticlockwise}, {}, ["theta falls at the start", "anticlockwise"]),
        ({"pose": times("theta_rad", 57.3)}, {}, ["theta_deg would say so"]),
        ({}, {"spike_length": 200.0}, ["[platform] spike_length looks like mm; 0.2 m would fit"]),
        ({}, {"stiffness": 0.015}, ["[surface] stiffness = 0.015", "would stand 29 m deep"]),
        ({}, {"torque": 220.0}, ["torque = 220 looks like mN m: 0.22 N m would fit"]),
        ({}, {"gravity_sim": 0.0085}, ["counterweight = 5.21 kg leaves 0.883 N", "units of g: 0.08336 m/s2 would"]),
        ({}, {"std": (5e-4, 5e-4, 0.17)}, ["[sensors.pose] states 0.17 for theta_rad", "degrees"]),
    ],
)
def test_a_mistake_in_a_tumble_is_said_once_by_its_cause(changes, tables, said):
    """What a newcomer got wrong without a word, or with the wrong one; what follows from it is not said beside it."""
    campaign = read_campaign(TEMPLATES / "template-tumble")
    recordings = {key: value for key, value in campaign.recordings.items() if key[0] == "001"}
    for sensor, change in changes.items():
        columns = {name: column.copy() for name, column in recordings["001", sensor].columns.items()}
        change(columns)
        recordings["001", sensor] = Recording(columns)
    given = campaign.tables.model_dump(mode="python", exclude_none=True)
    given["trial"] = (given["trial"][0],)
    for key, value in tables.items():
        tables_of = {"spike_length": "platform", "stiffness": "surface"}
        place = given["sensors"]["pose"] if key == "std" else given.get(tables_of.get(key, ""), given["trial"][0])
        place[key] = value
    told = [finding.what for finding in find_faults(Campaign(TumbleCampaign(**given), recordings))]
    assert len(told) == 1 and all(words in told[0] for words in said), told


@pytest.mark.parametrize(
    ("table", "change", "said"),
    [
        ("spike", {"diameter": 12.0}, "is it in mm? 0.012 m would fit"),
        ("surface", {"stiffness": 0.9}, "is [surface] stiffness in other units"),
        ("spike", {"mass": 500.0}, "is [spike] mass or stiffness in other units"),
    ],
)
def test_a_number_of_a_push_in_other_units_is_said(table, change, said):
    """Millimetres, N/mm and grams: a newcomer's campaign passed with all three."""
    campaign = read_campaign(TEMPLATES / "template-penetration")
    known = campaign.tables.uncertainty.model_copy(update={"stiffness": 0.1, "damping": 0.2})
    changed_table = getattr(campaign.tables, table).model_copy(update=change)
    tables = campaign.tables.model_copy(update={"uncertainty": known, table: changed_table})
    told = [finding.what for finding in find_faults(replace(campaign, tables=tables))]
    assert any(said in what for what in told), told


@pytest.mark.parametrize(
    ("slope", "maybe"), [(-594.0, True), (-580.0, True), (-510.0, True), (-87.3, True), (-5.0, False), (594.0, False)]
)
def test_a_wheel_that_changes_too_slowly_is_a_fault_or_an_effect_of_the_torque_and_never_in_g(slope, maybe):
    """A brake of 6 N m whose torque took 0.12 s to come up was said to be in units of g, and to be corrected first.
    -580 and -510 rad/s2 are 1 / 8.6 and 1 / 9.8 of -5000, -5 a torque in mN m; a factor on the torque turns no sign."""
    campaign = read_campaign(TEMPLATES / "template-tumble")
    (first, *_), tables = campaign.tables.trial, campaign.tables
    brake = first.model_copy(update={"actuator": "brake", "torque": 6.0, "wheel_speed_0": 300.0})
    time = np.arange(0.0, 0.2, 1e-3)
    recordings = {("001", "wheel"): Recording({"t_s": time, "omega_rad_s": 300.0 + slope * time})}
    only = replace(campaign, tables=tables.model_copy(update={"trial": (brake,)}), recordings=recordings)
    (said,) = [finding for finding in find_implausible(only) if finding.channel == "wheel"]
    assert f"{slope:g} rad/s2" in said.what and "= -5000" in said.what
    assert said.doubt and said.maybe_effect == maybe
    assert ("torque-rise" in said.what and "torque-fade" in said.what) == maybe
    assert "units of g" not in said.what and "m_s2" not in said.what


def test_a_torque_that_comes_up_in_0_12_s_is_a_possible_effect():
    """Wheel speed under M (1 - exp(-t / r)): w0 - M / I (t - r (1 - exp(-t / r)))."""
    campaign = read_campaign(TEMPLATES / "template-tumble")
    brake = campaign.tables.trial[0].model_copy(update={"actuator": "brake", "torque": 6.0, "wheel_speed_0": 300.0})
    time, rise = np.arange(0.0, 0.2, 1e-3), 0.12
    speed = np.maximum(300.0 - 5000.0 * (time - rise * (1 - np.exp(-time / rise))), 0.0)
    recordings = {("001", "wheel"): Recording({"t_s": time, "omega_rad_s": speed})}
    only = replace(campaign, tables=campaign.tables.model_copy(update={"trial": (brake,)}), recordings=recordings)
    (said,) = [finding for finding in find_implausible(only) if finding.channel == "wheel"]
    assert said.maybe_effect and "torque-rise" in said.what
    golden("campaign/slow_wheel", said.what)


def test_the_template_of_pushes_ties_no_fit_to_its_made_up_stiffness():
    """1 or more: not known beforehand, fitted freely."""
    stated = read_campaign(TEMPLATES / "template-penetration").tables.uncertainty
    assert min(stated.stiffness, stated.damping) >= 1.0


def test_nothing_is_wrong_with_the_templates():
    assert find_faults(read_campaign(TEMPLATES / "template-penetration")) == []
    (missing,) = find_faults(read_campaign(TEMPLATES / "template-tumble"))
    assert missing.trial == "002"
    golden("campaign/missing_sensor", missing.what)


def test_recordings_that_no_trial_names_are_said(tmp_path):
    folder = new_campaign(tmp_path / "c", kind="penetration")
    assert unnamed_files(folder, read_campaign(folder)) == []
    (folder / "004.csv").write_text("t_s,depth_m,force_N\n")
    (said,) = unnamed_files(folder, read_campaign(folder))
    golden("campaign/unnamed_file", said.what)


def test_what_is_odd_alike_in_many_trials_is_said_once():
    campaign = read_campaign(TEMPLATES / "template-penetration")
    (first, *_), data = campaign.tables.trial, campaign.recordings["001", "data"]
    wrong = Recording({**data.columns, "force_N": -data["force_N"]})
    trials = tuple(first.model_copy(update={"id": f"{k}"}) for k in range(6))
    many = replace(
        campaign, tables=campaign.tables.model_copy(update={"trial": trials}),
        recordings={(trial.id, "data"): wrong for trial in trials},
    )  # fmt: skip
    told = [finding.what for finding in find_faults(many) if "on the spike, upwards" in finding.what]
    assert len(told) == 1
    golden("campaign/alike", told)


def test_a_sensor_louder_than_stated_is_said():
    noise = np.random.default_rng(1)

    def louder(columns: dict[str, np.ndarray]) -> None:
        columns["force_N"] += 0.3 * noise.standard_normal(len(columns["force_N"]))

    campaign = changed("penetration", "001", "data", louder)
    one = campaign.tables.model_copy(update={"trial": campaign.tables.trial[:1]})
    (finding,) = [f for f in find_faults(replace(campaign, tables=one)) if "[sensors.force]" in f.what]
    assert finding.channel == "force" and finding.trial == ""
    golden("campaign/noisy_sensor", finding.what)


def pushes(shift: float, *, law: Callable[[float], float] = lambda z: STIFFNESS * z, above: float = 0.0) -> Campaign:
    """Three pushes whose depth reads `shift` [m] too much, recorded from `above` the surface on."""
    trials = []
    for k in range(3):
        made = driven_trial(
            lambda z, v, top: law(z - above) + DAMPING * v if z > above else 0.0, speed=0.01, depth=0.02 + above, seed=k
        )
        made.columns["depth_m"] += shift - above
        trials.append((f"{k}", "driven", 0.01, made))
    return campaign_of(trials)


@pytest.mark.parametrize("above", [0.0, 0.004])
@pytest.mark.parametrize("shift", [0.002, -0.002])
def test_a_depth_whose_zero_is_off_in_all_pushes_of_a_machine_is_said_once(shift, above):
    ((trial, what),) = depth_zeros(pushes(shift, above=above))
    assert trial == "" and "all 3 pushes" in what
    low, high = (float(word) for word in what.split("depth of ")[1].split(" mm")[0].split(" to "))
    assert low - 0.5 < 1e3 * shift < high + 0.5
    said = [finding.what for finding in find_faults(pushes(shift, above=above))]
    assert not any("of the spike" in what for what in said)  # the force's zero is right


@pytest.mark.parametrize(
    "law", [lambda z: STIFFNESS * z, lambda z: 6e4 * z**2, lambda z: STIFFNESS * (z if z < 0.01 else 3 * z - 0.02)]
)
@pytest.mark.parametrize("above", [0.0, 0.004])
def test_a_depth_whose_zero_is_right_is_left_in_peace_whatever_the_law(law, above):
    assert list(depth_zeros(pushes(0.0, law=law, above=above))) == []


def test_readings_that_clip_are_told_from_a_sensor_that_is_stuck_and_from_a_coarse_one():
    time = np.linspace(0.0, 1.0, 400)
    noisy = np.sin(np.pi * time) + 0.01 * np.random.default_rng(0).standard_normal(400)
    (end,) = clipped(np.minimum(noisy, 0.9))
    assert end.highest and end.value == 0.9 and set(end.rows) == set(np.flatnonzero(noisy >= 0.9))
    (end,) = clipped(np.maximum(-noisy, -0.9))
    assert not end.highest and "the lowest" in end.words
    assert clipped(noisy) == [] and clipped(np.round(np.sin(np.pi * time), 3)) == []
    stuck = noisy.copy()
    stuck[60:90] = stuck[60]
    assert clipped(stuck) == []


def test_a_sensor_that_clips_is_said_and_its_readings_are_set_aside():
    def at_most(columns: dict[str, np.ndarray]) -> None:
        columns["force_N"] = np.minimum(columns["force_N"], 0.8 * columns["force_N"].max())

    said = [f for f in find_faults(changed("penetration", "001", "data", at_most)) if "clips there" in f.what]
    assert len(said) == 1 and said[0].channel == "force" and said[0].set_aside
    turning = changed("tumble", "001", "imu", lambda c: c.update(gyro_rad_s=np.minimum(c["gyro_rad_s"], 0.5)))
    assert any(f.channel == "gyro" and "the highest" in f.what and f.set_aside for f in find_faults(turning))


def late(columns: dict[str, np.ndarray], *, by: float, told: float = 0.0) -> None:
    """Rows before `by` [s] are missing, and the others' times are less by `told`."""
    kept = columns["t_s"] >= by
    for name in list(columns):
        columns[name] = columns[name][kept]
    columns["t_s"] = columns["t_s"] - told


@pytest.mark.parametrize(
    ("by", "told", "words"), [(0.3, 0.0, "was not recorded"), (0.6, 0.3, "the torque set in at -0.3 s of this clock")]
)
def test_a_clock_that_starts_late_is_said(by, told, words):
    campaign = read_campaign(TEMPLATES / "template-tumble")
    recordings = dict(campaign.recordings)
    for (trial, sensor), recording in campaign.recordings.items():
        columns = dict(recording.columns)
        late(columns, by=by, told=told)
        recordings[trial, sensor] = Recording(columns)
    said = [f for f in find_faults(replace(campaign, recordings=recordings)) if "no sensor has a row before" in f.what]
    assert said and all("0.3" in f.what and f.doubt for f in said)
    assert any(words in f.what for f in said)


def test_a_drop_whose_recording_begins_late_is_said():
    made = drop_trial(lambda z, v: STIFFNESS * z + DAMPING * max(v, 0.0), speed=0.3)
    columns = dict(made.columns)
    late(columns, by=0.03)
    said = [f.what for f in find_faults(campaign_of([("1", "drop", 0.3, Recording(columns))]))]
    assert any("30 ms" in what for what in said)
