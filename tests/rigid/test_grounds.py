"""The spring-damper: F = K z + C max(0, dz/dt) for z > 0, and 0 above."""

import numpy as np
import pytest

from rigid import SpringDamper

GROUND = SpringDamper(stiffness=200.0, damping=3.0)


@pytest.mark.parametrize("seed", range(30))
def test_the_mean_over_a_step_is_the_exact_impulse(seed):
    start, sinking, dt = np.random.default_rng(seed).uniform((-0.02, -1.0, 1e-5), (0.02, 1.0, 0.05))
    share = (np.arange(20000) + 0.5) / 20000
    expected = GROUND.force(start + sinking * dt * share, np.full(20000, sinking)).mean()
    reaction = GROUND.step((0.0, 0.0, -start), (0.0, 0.0, -sinking), dt)
    assert reaction.force[2] == pytest.approx(expected, abs=1e-3)
    assert reaction.force[2] >= 0


def test_the_spring_gives_back_what_it_took():
    """Work along the way is K z^2 / 2 up or down, whatever the step."""
    ground = SpringDamper(stiffness=200.0)
    work = sum(ground.step((0, 0, -0.001 * k), (0, 0, -0.1), 0.01).force[2] * 0.001 for k in range(10))
    assert work == pytest.approx(0.5 * 200.0 * 0.01**2, rel=1e-12)


def test_contact_carries_the_coulomb_bound():
    (contact,) = GROUND.step((0.1, 0.2, -0.01), (0, 0, 0), 1e-3).contacts
    assert contact.normal_force == pytest.approx(2.0)
    assert (contact.mu_s, contact.mu_d, contact.tangential_force) == (0.5, 0.25, None)
    assert GROUND.step((0, 0, 0.01), (0, 0, 0), 1e-3).contacts == ()


@pytest.mark.parametrize("given_", [{"stiffness": -1.0}, {"stiffness": 1.0, "damping": -1.0},
                                    {"stiffness": 1.0, "mu_d": 0.9}, {"stiffness": 1.0, "time_step": 0.0}])  # fmt: skip
def test_a_law_that_cannot_be_is_refused_by_name(given_):
    with pytest.raises(ValueError, match=list(given_)[-1]):
        SpringDamper(**given_)
