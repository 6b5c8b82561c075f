"""One collision: what the verification suite (test_suite.py) does not hold.

The collisions themselves, Chung & Ooi's T1 to T8 and the order of the integrator are cases of the suite.
"""

import numpy as np

from dem import Bed
from experiments.validate.contacts.impacts import ANGLES, oblique
from experiments.validate.contacts.integrator import oblique_pair
from experiments.validate.contacts.law_alone import sliding_share, staggered_rebound


def test_each_sphere_of_t4_stays_in_its_plane():
    after = oblique()
    assert np.abs(after.velocity[:, 1]).max() == 0.0
    assert len(after.spin) == len(ANGLES) and np.abs(after.spin[:, [0, 2]]).max() == 0.0


def test_friction_that_bounds_the_spring_alone_passes_on_all_of_mu_times_the_normal_impulse():
    """The law by itself, sliding throughout: with the bound on spring and dashpot together a tenth and more is lost."""
    for restitution in (0.5, 0.8, 1.0):
        assert abs(sliding_share(restitution, 11.0, spring_alone=True, steps=3000) - 1) < 1e-9
    assert sliding_share(0.5, 11.0, spring_alone=False, steps=3000) < 0.9
    assert abs(sliding_share(1.0, 11.0, spring_alone=False, steps=3000) - 1) < 1e-9


def test_dashpots_that_see_their_own_time_and_the_first_touch_give_the_restitution():
    """The scheme alone, wherever in a step the contact begins; each of the two without the other leaves an error."""
    phase = (np.arange(50) + 0.5) / 50

    def off(**options):
        return staggered_rebound(0.2, 14, phase, **options) - 0.2

    assert np.abs(off()).max() < 0.005
    assert off(synchronised=False, first_touch=False).mean() < -0.01
    assert np.ptp(off(first_touch=False)) > 0.02


def test_contact_history_survives_new_lists(monkeypatch):
    """The same collision with new lists at every other step, which also sorts the grains anew."""
    _, seldom, made = oblique_pair(2e-7, steps=400)
    assert made < 10
    monkeypatch.setattr(Bed, "adapt_skin", lambda self: None)
    monkeypatch.setattr("dem.engine.base._SKIN", 1e-4)
    _, often, made = oblique_pair(2e-7, steps=400)
    assert made > 100
    for name in ("position", "velocity", "spin"):
        assert np.abs(getattr(often, name) - getattr(seldom, name)).max() <= 1e-12 * np.abs(getattr(seldom, name)).max()
    assert np.linalg.norm(seldom.velocity[0]) > 0.1
