"""Ploughing against the passive pressure on a narrow blade, and its energy balance."""

import math

import pytest
from rigid_trials import effect, in_rig

from rigid import EFFECTS, Effect, simulate

SAND = {"stiffness": 82.2, "damping": 0.713, "mu_s": 0.6, "mu_d": 0.3, "torque_until": 100.0}


def ploughing(strength: float) -> Effect:
    return effect("ploughing", strength=strength, speed=0.01)


def test_the_force_is_that_of_the_sand_s_passive_pressure_against_the_slip():
    force = EFFECTS["ploughing"].hooks["side_force"]
    given = {"strength": 1300.0, "speed": 0.01, "power": 2.0, "reference": 0.01}
    assert force(None, 0.02, 0.1, **given) == pytest.approx(-1300 * 0.02**2)
    assert force(None, 0.02, -0.1, **given) == pytest.approx(1300 * 0.02**2)
    assert force(None, 0.02, 0.01, **given) == pytest.approx(-0.52 * math.tanh(1))
    assert force(None, -0.01, 0.1, **given) == 0.0
    # Albert et al. 1999, Phys. Rev. Lett. 82:205: half the depth, a quarter of the force; of power 1 half of it.
    assert force(None, 0.01, 0.1, **given) == pytest.approx(force(None, 0.02, 0.1, **given) / 4)
    straight = given | {"power": 1.0}
    assert force(None, 0.02, 0.1, **straight) == pytest.approx(-1300 * 0.01 * 0.02)


def test_a_platform_on_spikes_that_plough_goes_farther_and_turns_less():
    """The energy balance holds with the new force: its work is dissipated."""
    plain = simulate(in_rig(0.22, **SAND), duration=0.8)
    found = simulate(in_rig(0.22, **SAND, effects=(ploughing(1300.0),)), duration=0.8)
    assert found.x[-1] > 1.3 * plain.x[-1] and found.theta[-1] < 0.8 * plain.theta[-1]
    assert found.energy_residual < 1e-6
    assert plain.energy_residual < 1e-6
