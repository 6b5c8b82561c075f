"""The bed carries from a depth below the first touch on: fitted beside K and C, and used by predictions."""

import math

import numpy as np
import pytest
from penetration_campaigns import DAMPING, DEPTH_STD, FORCE_STD, GRAVITY, MASS, STIFFNESS, campaign_of
from penetration_campaigns import driven_trial as driven
from penetration_campaigns import drop_trial as drop

from experiments.campaign import read_model
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.push.law import fall
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.push.slots import SLOTS, slot_table
from experiments.penetrate.amended import AmendedGround, read_law
from experiments.penetrate.settings import PenetrateSettings

LOOSE = 1.2e-4
"""Depth at which the bed begins to carry [m]: 2 noises of the force, 1 of the depth."""


def law(z, v, *_):
    return STIFFNESS * max(z - LOOSE, 0.0) + DAMPING * max(v, 0.0)


@pytest.fixture(scope="module")
def campaign():
    """Four pushes with their way back and two drops."""
    trials = [(f"{k}", "driven", v, driven(law, speed=v, retreat=True, seed=k)) for k, v in enumerate([0.02, 0.1] * 2)]
    trials += [(f"{k}", "drop", 0.3, drop(law, speed=0.3, seed=k)) for k in (4, 5)]
    return campaign_of(trials, doubt=(1.0, 1.0))


@pytest.fixture(scope="module")
def found(campaign):
    return diagnose(make_problem(campaign))


def test_a_loose_surface_is_no_missing_effect_and_k_is_that_of_the_bed_below(found):
    assert (found.verdict, found.effects) == ("none", ())
    told = found.base_parameters(found.best)
    for name, true in (("stiffness", STIFFNESS), ("damping", DAMPING), ("surface_depth", LOOSE)):
        assert told[name]["value"] == pytest.approx(true, abs=3 * told[name]["std"])
    assert told["surface_depth"]["value"] > 5 * told["surface_depth"]["std"]
    assert max(found.before.fit, found.before.held_out) < 1.1


def test_a_drop_is_free_above_the_bed_and_a_harmonic_motion_in_it():
    """Without a damper: z = o + v1 sin(w t) / w + g (1 - cos(w t)) / w^2 after the free way o, v1^2 = v0^2 + 2 g o."""
    speed, w = 0.3, math.sqrt(STIFFNESS / MASS)
    table = slot_table(1)
    for name, value in {"mass": MASS, "gravity": GRAVITY, "stiffness": STIFFNESS, "given_way": LOOSE}.items():
        table[0, SLOTS.index(name)] = value
    inside = math.sqrt(speed**2 + 2 * GRAVITY * LOOSE)
    free = (inside - speed) / GRAVITY
    t = np.linspace(0.0, 0.03, 40)
    (motion,) = fall(table, np.zeros(1, np.int32), np.array([0, len(t)], np.int32), t, np.array([speed]))
    after = t - free
    bed = LOOSE + inside * np.sin(w * after) / w + GRAVITY * (1 - np.cos(w * after)) / w**2
    expected = np.where(after < 0, speed * t + 0.5 * GRAVITY * t**2, bed)
    assert motion[:, 0] == pytest.approx(expected, abs=0.004 * DEPTH_STD)  # as `law` says of its steps


@pytest.fixture(scope="module")
def model(found, tmp_path_factory):
    """model.toml of the diagnosis."""
    path = tmp_path_factory.mktemp("model") / "model.toml"
    found.problem.write_model(str(path), found.best_values, found.forms)
    return path


def test_a_prediction_pushes_into_the_same_bed(model):
    settings = PenetrateSettings(
        ground="spring-damper", model=str(model), speeds=(0.02,), tip_diameter=0.012, mass=MASS, seeds=(1,)
    )
    known = read_law(model, settings)
    assert known.surface_depth == pytest.approx(LOOSE, abs=3e-5)
    ground = AmendedGround(known, time_step=1e-4, speed=0.02)
    at = {z: ground.step([0.0, 0.0, -z], [0.0, 0.0, 0.0], 1e-9).force[2] for z in (0.5 * LOOSE, 0.01)}
    assert at[0.5 * LOOSE] == 0.0
    stiffness = read_model(model).surface.stiffness
    assert at[0.01] == pytest.approx(stiffness * (0.01 - known.surface_depth), rel=1e-9)


def test_a_depth_that_is_none_is_refused_by_file_and_key(model, tmp_path):
    other = tmp_path / "model.toml"
    text = model.read_text()
    head, _, tail = text.partition("[notes.fitted_surface]\n")
    other.write_text(head + "[notes.fitted_surface]\n" + tail.replace('"depth_m" = ', '"depth_m" = inf # ', 1))
    with pytest.raises(ValueError, match=r"model\.toml: \[notes\] fitted_surface depth_m = inf"):
        read_law(other, PenetrateSettings(ground="spring-damper", model=str(other), speeds=(0.02,)))


def test_the_noise_of_these_pushes_alone_is_the_size_of_what_is_hidden():
    """Else the first test would show nothing: K o over the force's noise, and o over the depth's."""
    assert STIFFNESS * LOOSE / FORCE_STD > 2 and LOOSE / DEPTH_STD > 1
