"""Loose first grains and a compliant frame: closed forms, a stiff integrator, and what a diagnosis makes of both."""

import math

import numpy as np
import pytest
from penetration_campaigns import DAMPING, GRAVITY, MASS, STIFFNESS, campaign_of, driven_trial, drop_trial
from scipy.integrate import solve_ivp

from experiments.campaign import Recording
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.push.law import SLOTS, fall, push, slot_table
from experiments.diagnose.push.problem import make_problem

SLOT = {name: place for place, name in enumerate(SLOTS)}
LOOSE, FRAME = 1.5e-4, 3e4  # [m], [N/m]


def lane(**numbers):
    table = slot_table(1)
    for name, value in {"mass": MASS, "gravity": GRAVITY, "stiffness": STIFFNESS, **numbers}.items():
        table[0, SLOT[name]] = value
    return table


def loose(z, v, top=0.0):
    # Not the law's own curve: the slope of spring and damper grows in proportion to depth, over twice the loose depth.
    firm = z * z / (4 * LOOSE) if z < 2 * LOOSE else z - LOOSE
    return STIFFNESS * firm + DAMPING * max(v, 0.0) * min(z / (2 * LOOSE), 1.0)


def yielding(recording):
    columns = dict(recording.columns)
    return Recording({**columns, "depth_m": columns["depth_m"] + columns["force_N"] / FRAME})


def test_the_force_of_a_push_sets_in_over_the_loose_depth():
    # K (z - l S) + C v S, S = 1 - e^(-z / l).
    depth, speed = np.linspace(1e-6, 0.01, 300), np.full(300, 0.05)
    starts = np.array([0, 300], dtype=np.int32)
    force = push(lane(damping=DAMPING, loose=LOOSE), np.zeros(1, dtype=np.int32), starts, depth, speed)[0]
    share = 1 - np.exp(-depth / LOOSE)
    assert force == pytest.approx(STIFFNESS * (depth - LOOSE * share) + DAMPING * speed * share, rel=1e-12)


def test_a_frame_in_series_with_the_bed_lessens_the_slope_that_the_drive_reads():
    # The tip is at z - F / k, so F = K z / (1 + K / k).
    depth = np.linspace(1e-6, 0.01, 300)
    force = STIFFNESS * depth / (1 + STIFFNESS / FRAME)
    starts, paths = np.array([0, 300], dtype=np.int32), np.zeros(1, dtype=np.int32)
    found = push(lane(compliance=1 / FRAME), paths, starts, depth, np.zeros(300), loads=force)[0]
    assert found == pytest.approx(force, rel=1e-12)


@pytest.mark.parametrize("depth", [1e-6, 5e-5, 5e-4])
def test_a_drop_through_loose_grains_agrees_with_an_implicit_integrator(depth):
    # m z'' = m g - K (z - l S) - C v S, S = 1 - e^(-z / l), by Radau's method to 1e-10.
    def motion(t, y):
        share = 1 - math.exp(-max(y[0], 0.0) / depth)
        return [y[1], GRAVITY - (STIFFNESS * (y[0] - depth * share) + 5 * DAMPING * max(y[1], 0.0) * share) / MASS]

    time = np.linspace(0.0, 0.04, 81)
    solved = solve_ivp(motion, (0, 0.04), [0.0, 0.6], t_eval=time, method="Radau", rtol=1e-10, atol=1e-12)
    starts = np.array([0, len(time)], dtype=np.int32)
    numbers = lane(damping=5 * DAMPING, loose=depth)
    z, v, a, _ = fall(numbers, np.zeros(1, dtype=np.int32), starts, time, np.array([0.6]))[0].T
    assert np.abs(z - solved.y[0]).max() < 2e-7
    assert np.abs(v - solved.y[1]).max() < 2e-5
    expected = [motion(0.0, y)[1] for y in solved.y.T]
    assert a[1:] == pytest.approx(expected[1:], abs=2e-3)


@pytest.fixture(scope="module")
def campaign():
    pushes = [(f"d{k}", "driven", v, yielding(driven_trial(loose, speed=v, seed=k)))
              for k, v in enumerate((0.01, 0.03, 0.1, 0.01, 0.03, 0.1))]  # fmt: skip
    return campaign_of([*pushes, *((f"f{k}", "drop", 0.7, drop_trial(loose, speed=0.7, seed=7 + k)) for k in range(2))])


def test_a_fit_recovers_spring_damper_and_frame_beside_grains_that_set_in_by_another_curve(campaign):
    problem = make_problem(campaign)
    found = fit(Model(problem, Whitener.white(problem), tuple(trial.id for trial in problem.trials)))
    std = dict(zip((p.name for p in found.model.parameters), np.sqrt(np.diag(found.covariance())), strict=True))
    true = {"stiffness": STIFFNESS, "damping": DAMPING, "frame_compliance": 1 / FRAME}
    away = {name: (found.values[name] - value) / std[name] for name, value in true.items()}
    assert max(map(abs, away.values())) < 3
    assert 0.5 * LOOSE < found.values["loose_depth"] < 2 * LOOSE


@pytest.mark.heavy
def test_loose_grains_and_a_frame_are_no_missing_effect(campaign):
    found = diagnose(make_problem(campaign))
    assert found.verdict == "none"
    told = found.base_parameters(found.base)
    assert told["loose_depth"]["value"] > 5 * told["loose_depth"]["std"]
