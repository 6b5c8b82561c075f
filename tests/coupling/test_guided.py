"""A spike moved along legs: forces of a known law on every leg, and what is refused."""

import numpy as np
import pytest
from fake_bed import FakeBed

from coupling.guided import Leg, guide
from rigid import Spike, SpringDamper

SPIKE = Spike(diameter=0.012)


def test_on_a_spring_damper_each_leg_has_the_law_s_force_and_ends_where_it_was_to_end():
    # F = K z + C dz/dt while it goes in; the damper does not pull.
    ground = SpringDamper(stiffness=100.0, damping=0.5, time_step=1e-4)
    legs = [Leg(0.1, down=0.005), Leg(0.2, down=-0.001), Leg(0.1, along=0.004), Leg(0.05, down=0.002)]
    rows = guide(SPIKE, ground, legs, substeps=5)
    going_in = rows["leg"] == 0
    expected = 100.0 * rows["depth_m"][going_in] + 0.5 * 0.1
    np.testing.assert_allclose(rows["force_N"][going_in][1:], expected[1:], rtol=1e-9)
    for leg, depth, along in ((0, 0.005, 0.0), (1, 0.004, 0.0), (2, 0.004, 0.004), (3, 0.006, 0.004)):
        last = np.flatnonzero(rows["leg"] == leg)[-1]
        half = 0.5 * 5e-4 * legs[leg].speed
        assert rows["depth_m"][last] == pytest.approx(depth, abs=1.01 * half)
        assert rows["along_m"][last] == pytest.approx(along, abs=1.01 * half)
    sideways = rows["leg"] == 2
    np.testing.assert_allclose(rows["force_N"][sideways], 100.0 * 0.004, rtol=1e-9)


def test_a_leg_without_length_and_a_depth_below_the_floor_are_refused():
    with pytest.raises(ValueError, match="length"):
        guide(SPIKE, SpringDamper(stiffness=1.0, damping=0.0), [Leg(0.1)])
    with pytest.raises(ValueError, match="depth"):
        guide(SPIKE, FakeBed(), [Leg(0.1, down=0.2)])
