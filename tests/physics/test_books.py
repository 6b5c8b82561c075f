"""Many grains: what the verification suite (test_suite.py) does not hold of the books."""

import numpy as np

from experiments.validate.base import cloud
from experiments.validate.contacts.balances import ROUGH, cluster, hertz_energy


def test_momentum_is_handed_on_to_every_grain_of_the_cloud():
    """So the suite's case, that its sum stays, is about a cloud in which everything collides."""
    bed = cloud.make(gravity=0.0, floor=False, shift=(0, 0, 0.03))
    before = bed.grains().velocity
    bed.advance(500)
    assert np.linalg.norm(bed.grains().velocity - before, axis=1).min() > 0.01


def test_energy_never_grows_in_a_dissipative_cluster():
    """Kinetic and Hertz energy with friction, rolling resistance and damping, from collision to dispersal."""
    bed = cluster(ROUGH, time_step=4e-6)
    energy = [bed.kinetic_energy]
    for _ in range(150):
        bed.advance(20)
        energy.append(bed.kinetic_energy + hertz_energy(bed, 1e7, 0.25))
    growth = np.diff(energy).max() / energy[0]
    assert energy[-1] < 0.5 * energy[0]
    assert growth < 1e-4  # springs of friction and rolling may give back what this sum does not hold
    assert max(energy) == energy[0]
