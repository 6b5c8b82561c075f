"""Ploughing as a term of one's own: what the sand ahead of a spike adds to friction, and what it makes of a tumble."""

import math
from pathlib import Path

import pytest
from rigid_trials import in_rig

import experiments
from rigid import Effect, simulate
from rigid.terms import load_effect

FILE = Path(experiments.__file__).parent / "terms" / "ploughing.py"
SAND = {"stiffness": 82.2, "damping": 0.713, "mu_s": 0.6, "mu_d": 0.3, "torque_until": 100.0}


def ploughing(strength: float) -> Effect:
    return Effect(id="ploughing", parameters={"strength": strength, "speed": 0.01}, file=FILE)


def test_the_force_is_that_of_the_sand_s_passive_pressure_against_the_slip():
    force = load_effect(FILE).hooks["side_force"]
    assert force(None, 0.02, 0.1, 1300.0, 0.01) == pytest.approx(-1300 * 0.02**2)
    assert force(None, 0.02, -0.1, 1300.0, 0.01) == pytest.approx(1300 * 0.02**2)
    assert force(None, 0.02, 0.01, 1300.0, 0.01) == pytest.approx(-0.52 * math.tanh(1))
    assert force(None, -0.01, 0.1, 1300.0, 0.01) == 0.0


def test_a_platform_on_spikes_that_plough_goes_farther_and_turns_less():
    """Its books close with the new force in them: what it takes is dissipated."""
    plain = simulate(in_rig(0.22, **SAND), duration=0.8)
    found = simulate(in_rig(0.22, **SAND, effects=(ploughing(1300.0),)), duration=0.8)
    assert found.x[-1] > 1.3 * plain.x[-1] and found.theta[-1] < 0.8 * plain.theta[-1]
    assert found.energy_residual < 1e-6
    assert plain.energy_residual < 1e-6
