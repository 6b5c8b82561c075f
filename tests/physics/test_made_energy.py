"""What friction makes of energy, over what it takes, in a sheared sample and in a tumble: below 0.1 % with rescaled
springs, above it with displacement springs (docs/bed.md has the figures)."""

from dataclasses import replace

import numpy as np
import pytest
from tumble_runs import SMALL, small_bed

from dem import SAND_WEAK, Bed
from dem.measure.shearing import shear_bed
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings

GRAIN = 2.7e-3  # [m]


def made(bed):
    """Over what was taken: by tangential springs, by those of rolling and twisting [1]."""
    work = bed.friction_work
    assert min(work["tangential_lost"], work["turning_lost"]) > 0
    return np.array([work[f"{part}_made"] / work[f"{part}_lost"] for part in ("tangential", "turning")])


def sheared(tangential):
    """200 grains that have fallen, sheared by two grain diameters under a rough lid."""
    rng = np.random.default_rng(1)
    lattice = np.stack(np.meshgrid(*map(np.arange, (5, 5, 8)), indexing="ij"), -1).reshape(-1, 3)
    bed = Bed.from_grains(
        replace(SAND_WEAK, tangential=tangential),
        positions=(lattice + 0.5) * 3.1e-3 + rng.uniform(-1e-4, 1e-4, (200, 3)),
        radii=0.5 * GRAIN * rng.uniform(0.9, 1.1, 200), velocities=rng.normal(0, 0.2, (200, 3)), young=1e7,
        size=(0.0155, 0.0155, 0.03), height=0.1, max_overlap=0.1, threads=1,
    )  # fmt: skip
    bed.advance(8000, drag_time=0.02)
    bed.measure_surface()
    bed.track_contact_work()
    shear_bed(bed, pressure=500.0, way=2 * GRAIN, inertial_number=2e-2, grain=GRAIN)
    return made(bed)


def tumbled(tangential):
    """A platform of a few hundred grams tumbles on 384 grains for 0.06 s."""
    run = PlanarOnBed(TumbleSettings(**SMALL)).stepper(
        small_bed(TumbleSettings(**SMALL), replace(SAND_WEAK, tangential=tangential))
    )
    run.run()
    return made(run.ground.bed)


@pytest.mark.long
@pytest.mark.parametrize("moved", [sheared, tumbled])
def test_what_rescaled_springs_make_is_below_a_thousandth_of_what_friction_takes(moved):
    assert moved("rescaled").max() < 1e-3
    assert moved("displacement")[0] > 2e-3
