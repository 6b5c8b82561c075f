"""The bed as a ground: where the spike starts, how it is stepped."""

import numpy as np
import pytest
from fake_bed import FakeBed

from coupling import BedGround
from rigid import Spike


class OneGrain(FakeBed):
    """One grain of radius r whose top sticks out of the surface, at a distance from the axis."""

    def __init__(self, away=0.0, **more):
        super().__init__(**more)
        self._grains = np.array([[0.03 + away, 0.03, self.surface]])


@pytest.mark.parametrize("away", [0.0, 0.002, 0.003])
def test_the_ball_starts_just_clear_of_the_grain(away):
    bed = OneGrain(away)
    ground = BedGround(bed, Spike(diameter=0.012, length=0.05))
    centre = np.array([0.03, 0.03, bed.surface + ground.clearance + 0.006])
    gap = np.linalg.norm(centre - bed.grains().position[0]) - 0.006 - 0.001
    assert 0 < gap < 5e-5


def test_the_start_looks_across_the_periodic_edge():
    bed = OneGrain(-0.0295)
    assert BedGround(bed, Spike(diameter=0.012), at=(0.058, 0.03)).clearance > 1e-4


@pytest.mark.parametrize("tip", ["cone", "flat"])
def test_other_tips_start_clear_too(tip):
    ground = BedGround(OneGrain(0.002), Spike(tip=tip, diameter=0.012))
    assert 0 < ground.clearance < 0.0011


def test_a_bed_used_again_takes_the_spike_up_again():
    bed, spike = FakeBed(), Spike(diameter=0.012)
    first, second = BedGround(bed, spike), BedGround(bed, Spike(diameter=0.012))
    assert (first.body, second.body, bed.bodies) == (0, 0, 1)
    BedGround(bed, Spike(diameter=0.01))
    assert bed.bodies == 2


def test_a_step_is_a_whole_number_of_the_beds():
    ground = BedGround(FakeBed(time_step=2e-5), Spike())
    ground.step((0, 0, 0.05), (0, 0, -0.1), 1e-4)
    assert ground.bed.time == pytest.approx(1e-4)
    with pytest.raises(ValueError, match="whole multiple"):
        ground.step((0, 0, 0.05), (0, 0, -0.1), 3e-5)


def test_a_bed_narrower_than_two_spikes_is_refused():
    with pytest.raises(ValueError, match="size"):
        BedGround(FakeBed(size=(0.02, 0.02, 0.05)), Spike(diameter=0.012))
