"""Forces in another unit of force, and readings that are cut off: said by name, never averaged in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, FORCE_STD, STIFFNESS, campaign_of, driven_trial, drop_trial

from experiments.campaign import Campaign, Recording, read_campaign
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
