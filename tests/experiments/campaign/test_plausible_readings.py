"""Forces in another unit of force, and readings that are cut off: said by name, never averaged in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, FORCE_STD, STIFFNESS, campaign_of, driven_trial, drop_trial

from experiments.campaign import Campaign, Recording, read_campaign, write_campaign
from experiments.campaign.files import TEMPLATES
from experiments.check import find_implausible
from experiments.check.pushes import force_units
from experiments.diagnose.inspection import find_faults
from experiments.diagnose.noise.stuck import clipped_wheel, cut_rows
from experiments.diagnose.push.data import prepare

GRAVITY = 9.80665


def law(z: float, v: float, top: float = 0.0) -> float:
    """The base model."""
    return STIFFNESS * z + DAMPING * max(v, 0.0)


def pulled(z: float, v: float, top: float) -> float:
    """A crater that gives back little, and a tip that is held on the way out: 1.5 N."""
    if z >= top:
        return law(z, v)
    return max(STIFFNESS * (z - 0.8 * top) / 0.2, 0.0) - 1.5 * np.tanh((top - z) / 1e-3)


def scaled(campaign: Campaign, factor: float) -> Campaign:
    """The same with every force times `factor`, as in another unit."""
    recordings = {}
    for key, recording in campaign.recordings.items():
        columns = {name: column * (factor if name == "force_N" else 1.0) for name, column in recording.columns.items()}
        recordings[key] = Recording(columns)
    return replace(campaign, recordings=recordings)


def some_pushes(*, doubt: tuple[float, float] = (0.3, 0.3), stiffness: float = 1.3 * STIFFNESS) -> Campaign:
    """Three speeds, K stated 30 % too large."""
    trials = [(f"{k}", "driven", speed, driven_trial(law, speed=speed, seed=k))
              for k, speed in enumerate((0.01, 0.02, 0.05))]  # fmt: skip
    return campaign_of(trials, stiffness=stiffness, damping=DAMPING, doubt=doubt)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1 / GRAVITY, "kilograms of force, kgf"),
        (1e3 / GRAVITY, "grams of force, gf"),
        (1 / 4.44822, "pounds of force, lbf"),
        (GRAVITY, "newtons that were multiplied by 9.81 once more"),
        (1e3, "millinewtons (force_mN would say so)"),
        (1e-3, "kilonewtons"),
    ],
)
def test_a_force_in_another_unit_is_named_where_the_stiffness_is_uncertain(factor, words):
    (finding,) = [f for f in find_implausible(scaled(some_pushes(), factor)) if f.channel == "force"]
    assert words in finding.what and "Nothing was converted" in finding.what and finding.doubt


@pytest.mark.parametrize("stated", [0.35 * STIFFNESS, STIFFNESS, 2.5 * STIFFNESS])
def test_a_stiffness_that_is_off_within_what_is_stated_is_no_unit(stated):
    assert list(force_units(some_pushes(stiffness=stated, doubt=(0.5, 0.3)))) == []


def test_a_bed_that_hardens_by_the_factor_of_a_unit_is_no_unit():
    """At the bottom 4.4 times the stated spring, near the surface as stated: no unit does that."""
    trials = [(f"{k}", "driven", 0.01, driven_trial(lambda z, v, top: law(z, v) * (1 + 3.4 * (z / 0.02) ** 2),
                                                    speed=0.01, seed=k)) for k in range(3)]  # fmt: skip
    assert list(force_units(campaign_of(trials, stiffness=STIFFNESS / 2, damping=DAMPING))) == []


def test_drops_tell_the_unit_of_a_force_where_nobody_knows_the_stiffness():
    drops = [(f"d{k}", "drop", 0.5, drop_trial(law, speed=0.5, seed=k)) for k in range(2)]
    trials = [*((f"{k}", "driven", 0.01, driven_trial(law, speed=0.01, seed=k)) for k in range(2)), *drops]
    campaign = campaign_of(trials, stiffness=1.0, doubt=(2.0, 2.0))
    assert list(force_units(campaign)) == []
    (said,) = force_units(scaled(campaign, 1 / GRAVITY))
    assert "kgf" in said and "the drops" in said


def columns_times(campaign: Campaign, column: str, factor: float, *, trial: str = "", sensor: str = "") -> Campaign:
    """The same with a column times `factor`, of one trial or sensor where one is given."""
    recordings = {}
    for (id, name), recording in campaign.recordings.items():
        chosen = trial in ("", id) and sensor in ("", name)
        own = {key: values * (factor if chosen and key == column else 1.0) for key, values in recording.columns.items()}
        recordings[id, name] = Recording(own)
    return replace(campaign, recordings=recordings)


def nobody_knows(campaign: Campaign) -> Campaign:
    """The same without a stated stiffness."""
    free = campaign.tables.uncertainty.model_copy(update={"stiffness": 2.0, "damping": 2.0})
    return replace(campaign, tables=campaign.tables.model_copy(update={"uncertainty": free}))


def stated_noise(campaign: Campaign, factor: float) -> Campaign:
    """The same with the noise of the force stated `factor` times as large."""
    force = campaign.tables.sensors.force.model_copy(update={"std": (factor * FORCE_STD,)})
    sensors = campaign.tables.sensors.model_copy(update={"force": force})
    return replace(campaign, tables=campaign.tables.model_copy(update={"sensors": sensors}))


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: columns_times(nobody_knows(some_pushes()), "force_N", 1e3), "is force_N in mN"),
        (lambda: stated_noise(columns_times(nobody_knows(some_pushes()), "force_N", 1e3), 1e3), "is force_N in mN"),
        (lambda: columns_times(nobody_knows(some_pushes()), "force_N", 1e3, trial="1"), "other pushes at"),
        (lambda: columns_times(nobody_knows(some_pushes()), "force_N", 1e-4), "is force_N in kN"),
        (lambda: columns_times(nobody_knows(some_pushes()), "force_N", 1e-3), "is force_N in kN"),
        (lambda: columns_times(some_pushes(), "force_N", 1 / 4.4482), "pounds of force"),
        (lambda: columns_times(nobody_knows(some_pushes()), "depth_m", 1 / 0.0254), "inches"),
        (lambda: columns_times(some_pushes(), "t_s", 1e3), "is t_s in ms"),
        (lambda: columns_times(some_pushes(), "t_s", 1 / 60), "is t_s in minutes"),
        (lambda: columns_times(template("tumble"), "t_s", 1e3), "t_ms would say"),
        (lambda: columns_times(template("tumble"), "t_s", 1e3, sensor="wheel"), "is t_s in ms"),
        (lambda: columns_times(template("tumble"), "x_m", 1e3), "is x_m in mm"),
        (lambda: columns_times(template("tumble"), "x_m", 1 / 0.0254), "is x_m in inches"),
        (lambda: columns_times(template("tumble"), "y_m", 100.0), "is y_m in cm"),
        (lambda: turned(template("tumble"), 180 / np.pi), "theta_deg would say"),
        (lambda: columns_times(template("penetration"), "t_s", 1e3, trial="003"), "t_ms would say"),
    ],
)
def test_a_unit_that_no_stated_number_tells_is_asked_for_before_anything_is_fitted(made, said):
    """By the sensor's noise, by the other trials, by what no bed bears, by the stated speed."""
    found = find_implausible(made())
    assert any(said in finding.what and finding.doubt for finding in found), [finding.what for finding in found]
    assert not any("subtract its zero" in finding.what for finding in found)


def template(kind: str) -> Campaign:
    """The template of a kind."""
    return read_campaign(TEMPLATES / f"template-{kind}")


def turned(campaign: Campaign, factor: float) -> Campaign:
    """The same with both angle and rate times `factor`, so that camera and gyro agree."""
    return columns_times(columns_times(campaign, "theta_rad", factor), "gyro_rad_s", factor)


@pytest.mark.parametrize("name", ["cmu-plate-sinkage", "cmu-plates-against-bed"])
def test_measured_pushes_into_sand_are_asked_for_no_unit_and_in_millinewtons_they_are(name):
    measured = read_campaign(TEMPLATES / name)
    assert find_implausible(measured) == []
    (asked,) = find_implausible(columns_times(measured, "force_N", 1e3))
    assert "force_N in mN" in asked.what
    first = measured.tables.trial[0].id
    for column, unit in (("force_N", "force_mN"), ("t_s", "t_ms")):
        (asked,) = find_implausible(columns_times(measured, column, 1e3, trial=first))
        assert asked.trial == first and unit in asked.what


def test_made_up_pushes_are_asked_for_no_unit(tmp_path):
    """Of a seen suite, effects and causes outside the library among them; its files have other units, all named."""
    from benchmarks.hidden.suite import make_case, suite

    for case in suite("rig", 4, seed=760, trials=6):
        made = read_campaign(write_campaign(tmp_path / str(case["seed"]), make_case("rig", case)[0]))
        told = " ".join(finding.what for finding in find_implausible(made))
        assert not any(words in told for words in ("is force_N in", "is t_s in", "is depth_m in", "newtons")), case


def test_a_force_that_shows_nothing_below_zero_is_left_out_there_and_said():
    def cut(seed: int) -> Recording:
        columns = dict(driven_trial(pulled, speed=0.02, retreat=True, seed=seed).columns)
        return Recording(columns | {"force_N": np.maximum(columns["force_N"], 0.0)})

    trials, findings = prepare(campaign_of([(f"{k}", "driven", 0.02, cut(k)) for k in range(3)]))
    said = [f for f in findings if "cut off" in f.what]
    assert len(said) == 3 and all(f.channel == "force" and f.set_aside for f in said)
    assert not any("are gaps" in f.what for f in findings)  # said once
    for trial in trials:  # what is left is as it would be without the cut
        whole = driven_trial(pulled, speed=0.02, retreat=True, seed=int(trial.info.id))
        force, time = trial.other[trial.has_other], trial.time[trial.has_other]
        kept = np.isin(whole.time, time)
        assert 0.5 < kept.mean() < 0.85 and np.all(force == whole["force_N"][kept]) and force.min() > -FORCE_STD
    # One negative reading in one push: the sensor can.
    whole = driven_trial(pulled, speed=0.02, retreat=True, seed=9)
    _, findings = prepare(campaign_of([("0", "driven", 0.02, cut(0)), ("9", "driven", 0.02, whole)]))
    assert not any("cut off" in f.what for f in findings)


def test_a_coarse_force_whose_steps_hold_zero_is_not_cut_off():
    random = np.random.default_rng(0)
    force = np.abs(np.round(np.concatenate([0.02 * random.standard_normal(200), np.linspace(0, 10, 200)]) / 0.1) * 0.1)
    assert [len(rows) for rows in cut_rows([force], 0.05)] == [0]


def test_a_wheel_that_clips_is_told_from_one_that_turns_evenly():
    random = np.random.default_rng(1)
    true = np.minimum(150.0 * np.linspace(0, 2, 400), 240.0)  # without a torque from 1.6 s on
    noisy = true + 0.5 * random.standard_normal(400)
    assert clipped_wheel(true, 0.5) == [] and clipped_wheel(noisy, 0.5) == []
    (end,) = clipped_wheel(np.minimum(noisy, 200.0), 0.5)
    assert end.value == 200.0 and set(end.rows) == set(np.flatnonzero(noisy >= 200.0))


def test_a_campaign_whose_wheel_clips_is_told():
    campaign = read_campaign(TEMPLATES / "template-tumble")
    columns = dict(campaign.recordings["001", "wheel"].columns)
    columns["omega_rad_s"] = np.minimum(columns["omega_rad_s"], 0.8 * columns["omega_rad_s"].max())
    clipped = replace(campaign, recordings={**campaign.recordings, ("001", "wheel"): Recording(columns)})
    said = [f for f in find_faults(clipped) if f.channel == "wheel" and "clips there" in f.what]
    assert len(said) == 1 and said[0].trial == "001" and said[0].set_aside
    assert not any("clips" in f.what for f in find_faults(campaign))
