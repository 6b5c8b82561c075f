"""Grains poured without adhesion that stick once they lie; a lid that they do not stick to."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dem import SAND, Bed, Material
from dem.measure.lid import Lid
from dem.prepare.laboratory import touching_as
from dem.prepare.specification import Specification

GRAIN = 0.004
# Pull-off of two grains, 4 pi gamma R*, is 14 times the weight of one.
STICKY = Material("sticky", 2650.0, 70e9, 0.25, 0.5, 0.5, 0.1, cohesion="dmt", surface_energy=0.1 * 9.6)
BED = {"size": (0.024, 0.024, 0.018), "grain": GRAIN, "seed": 3, "threads": 1, "stages": ["rain:0.2", "stick"]}


class Stopped:
    """Ctrl-C at the first look at how far the stage 'stick' is."""

    def stage(self, name, total=None):
        self.name = name

    def update(self, done):
        if self.name == "stick":
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Poured, stopped while it sticks, and gone on with."""
    kept = tmp_path_factory.mktemp("poured") / "kept.npz"
    with pytest.raises(KeyboardInterrupt):
        Bed.prepare_as(STICKY, **BED, progress=Stopped(), keep=kept)
    prepared = Bed.prepare_as(STICKY, **BED, keep=kept)
    return prepared, prepared.bed.state()


@pytest.mark.long
def test_grains_that_were_poured_dry_lie_densely_and_then_hang_on_the_floor(made):
    """Upside down under a tenth of g the bed falls by three and a half diameters if its contacts do not pull.

    A bed that sticks while it rains is looser: docs/bed.md, Grains that stick.
    """
    prepared, state = made
    rained, stuck = prepared.reports
    assert rained.packing_fraction > 0.59 and abs(stuck.packing_fraction - rained.packing_fraction) < 0.005
    bed = prepared.bed
    assert bed.material == replace(STICKY, young=bed.material.young)
    before = bed.grains().position
    bed.set_gravity((0.0, 0.0, 0.981))
    bed.advance(round(math.sqrt(2 * 3.5 * GRAIN / 0.981) / bed.time_step))
    assert np.abs(bed.grains().position - before)[:, 2].max() < 0.05 * GRAIN
    bed.set_gravity(9.81)
    bed.restore(state)


@pytest.mark.long
def test_a_lid_comes_off_a_bed_of_grains_that_stick(made):
    """Lids that stuck held grains aloft without end, and were said not to come to their pressure."""
    prepared, state = made
    bed, notes = prepared.bed, {}
    bed.restore(state)
    fall = math.sqrt(2 * BED["size"][2] / 9.81)
    lid = Lid(bed, notes, grain=GRAIN, fall_time=fall, drag_time=0.1 * fall)
    pressure = bed.weight / (BED["size"][0] * BED["size"][1])
    while not lid.piece(pressure):
        pass
    assert int(bed.state()["numbers"][1]) == 1  # the floor alone
    bed.restore(state)


@pytest.mark.long
def test_sand_poured_with_little_friction_lies_as_densely_as_the_densest_toyoura_sand():
    """e_min = 0.616 (Cubrinovski & Ishihara 2002), a packing of 1 / 1.616 = 0.619; taps stop at 0.615 (docs/bed.md)."""
    stages = ["rain:0.1", "stick", "level"]
    bed = Bed.prepare_as(SAND, size=(0.024, 0.024, 0.028), grain=GRAIN, seed=1, threads=1, stages=stages)
    assert 1 / 1.616 < bed.reports[-1].packing_fraction < 0.64
    assert bed.whole.material == replace(SAND, young=bed.whole.material.young)


@pytest.mark.long
def test_grains_cannot_change_their_density(made):
    poured = Specification.of(SAND, size=BED["size"], grain=GRAIN).poured(0.2)
    assert poured.material.rolling_friction == 1e-9
    with pytest.raises(ValueError, match="density 2700"):
        touching_as(made[0].bed, replace(STICKY, density=2700.0))
