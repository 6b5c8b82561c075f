"""The sphere whose contact slips ring by ring, against Mindlin's stiffness and a contact that slides throughout."""

import math

import numpy as np
import pytest

from experiments.validate.contacts.law_alone import _influence, _settled, tangential_restitution

ALUMINA = {"friction": 0.092, "restitution": 0.98, "poisson": 0.23}


def test_rings_that_all_stick_have_mindlins_stiffness():
    """F = 8 G a u / (2 - nu) of a rigid shift (Mindlin 1949), with c = (2 - nu) / 8 G = 1: F = a u."""
    edge = np.arange(1, 81) / 80
    moved, traction = _influence(edge, edge - 0.5 / 80, 1.0)
    found, slips = _settled(moved, traction, np.zeros(80), 1.0, np.full(80, 1e9), np.zeros(80, dtype=int))
    assert not slips.any()
    assert 2 * math.pi / 3 * edge**3 @ found == pytest.approx(1.0, rel=0.005)


@pytest.mark.parametrize("angle", [50, 70, 85])
def test_a_contact_that_slides_throughout_has_its_impulse(angle):
    """e_t = 1 - mu (1 + e) / tan where tan > 7/2 mu (1 + e)."""
    wanted = 1 - 0.092 * 1.98 / math.tan(math.radians(angle))
    assert tangential_restitution(angle, **ALUMINA) == pytest.approx(wanted, abs=2e-3)


def test_the_rings_are_fine_enough():
    """Half of them, and half the steps, move the spin at 10 degrees by less than half of what is told of it."""
    coarse, fine = (tangential_restitution(10, **ALUMINA, rings=n, steps=15 * n) for n in (20, 40))
    spring = 0.6951  # one spring with its dashpot, `oblique.law_alone`
    assert abs(fine - coarse) < 0.2 * abs(fine - spring)
