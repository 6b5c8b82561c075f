"""A platform whose motion has died away is at rest, and is not followed any further."""

import math

import numpy as np
import pytest
from rigid_trials import LENGTH, effect, in_rig

from rigid import simulate
from rigid.planar.dynamics import OMEGA, THETA, VX, VY, System, Y
from rigid.planar.events import resolve
from rigid.planar.located import _scale
from rigid.planar.statics import comes_to_rest, standing


def test_a_platform_that_its_torque_does_not_tip_comes_to_rest_where_statics_says():
    # Two springs at -+d: 2 K d^2 theta = tau, but for W h theta. A thousand seconds take the steps of the first ten.
    trial = in_rig(0.03, damping=600.0)
    run = simulate(trial, duration=1000.0, sample_interval=1.0)
    short = simulate(trial, duration=10.0, sample_interval=1.0)
    assert run.notes["steps"] == short.notes["steps"]
    assert run.omega[-1] == 0.0 and run.vx[-1] == 0.0 and run.vy[-1] == 0.0
    d, h = LENGTH * math.sin(math.pi / 8), run.y[-1]
    lean = 0.03 / (2 * trial.stiffness * d * d - trial.weight * h)
    assert run.theta[-1] == pytest.approx(lean, rel=1e-3)
    exact = simulate(trial, duration=10.0, sample_interval=1.0, tolerance=1e-10)
    assert run.theta[-1] == pytest.approx(exact.theta[-1], abs=2e-9)
    assert run.energy_residual < 1e-9
    assert run.wheel_speed == pytest.approx(0.03 * run.time / 1.2e-3, rel=1e-9)  # the motor still drives it


def test_when_the_torque_ends_it_moves_again():
    run = simulate(in_rig(0.03, torque_until=60.0, damping=600.0), duration=120.0, sample_interval=0.1)
    rests = (run.omega == 0.0) & (run.time > 1.0)
    assert rests[run.time < 60.0].any() and rests[-1]
    shaken = (run.time > 60.0) & (run.time < 61.0)
    assert np.abs(run.omega[shaken]).max() > 1e-3
    assert run.theta[-1] == pytest.approx(0.0, abs=2e-9)


def stood(trial):
    system = System(trial)
    z, modes = standing(system)
    modes.torque_over = True
    resolve(system, 0.0, z, modes, spikes=[0, 7], dry=(0, 1))
    return system, z, modes, _scale(system)


def test_only_what_is_slow_near_and_stable_is_rest():
    system, z, modes, scale = stood(in_rig(damping=1e6))
    z[VY] = 1e-12
    assert comes_to_rest(system, 0.0, list(z), modes, scale, 1e-8)
    sinking = list(z)
    sinking[Y] += 1e-8  # the damper lets it down over a minute: slow, but not there yet
    assert not comes_to_rest(system, 0.0, sinking, modes, scale, 1e-8) and sinking[VY] == 1e-12
    swinging = list(z)
    swinging[OMEGA] = 1e-7
    assert not comes_to_rest(system, 0.0, swinging, modes, scale, 1e-8)
    # Ground so soft that the weight tips it: 2 K d^2 < W h.
    system, z, modes, scale = stood(in_rig(stiffness=12.0, damping=0.1))
    z[VX] = 1e-13
    assert z[THETA] == 0.0 and not comes_to_rest(system, 0.0, z, modes, scale, 1e-8)


@pytest.mark.parametrize("own", [{"id": "bearing-drag", "torque": 1e-3}, {"id": "rig-friction", "force": 0.05},
                                 {"id": "wire-compliance", "stiffness": 1.3e4, "damping": 30.0}])  # fmt: skip
def test_it_comes_to_rest_with_dry_friction_or_springs_for_wires_too(own):
    trial = in_rig(0.03, damping=600.0, effects=(effect(**own),))
    run = simulate(trial, duration=500.0, sample_interval=5.0)
    assert run.omega[-1] == 0.0 and run.notes["steps"] < 5_000
    assert run.energy_residual < 1e-8


def test_with_a_torque_that_fades_it_rests_once_the_torque_is_over():
    fade = effect("torque-fade", time_loss=0.5)
    run = simulate(in_rig(0.03, torque_until=1.0, damping=600.0, effects=(fade,)), duration=300.0, sample_interval=5.0)
    assert run.omega[-1] == 0.0 and run.notes["steps"] < 5_000
    assert run.wheel_speed[-1] == pytest.approx(0.03 * 0.75 / 1.2e-3, rel=1e-6)
