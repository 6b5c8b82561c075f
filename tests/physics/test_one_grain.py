"""One grain under gravity: what the verification suite (test_suite.py) does not hold."""

import numpy as np
import pytest

from dem import Ball
from experiments.validate.contacts.one_grain import GRAVITY, advance_to, downhill, sixteen


@pytest.mark.parametrize("rolling", [0.05, 0.2])
def test_every_grain_rolls_down_an_incline_alike(rolling):
    bed = sixteen(gravity=downhill(20), friction=0.5, rolling=rolling)
    speed = advance_to(bed, 0.02).velocity[:, 0]
    assert speed[0] > 0.01 and np.ptp(speed) < 1e-12


def test_forces_computed_anew_do_not_disturb_a_sliding_grain():
    """Setting the gravity that is in force, and adding a body far away, leave the motion as it was."""

    def motion(touch):
        bed = sixteen(velocities=np.tile([0.05, 0.0, 0.0], (16, 1)))
        bed.advance(2000)
        if touch:
            for _ in range(5):
                bed.set_gravity(GRAVITY)
            bed.add_body([Ball(radius=0.002)], position=(0.0, 0.0, 0.07))
        bed.advance(2000)
        return bed.grains().as_dict()

    a, b = motion(touch=False), motion(touch=True)
    for name in ("position", "velocity", "spin", "force"):
        assert np.abs(a[name] - b[name]).max() <= 1e-11 * np.abs(a[name]).max()
