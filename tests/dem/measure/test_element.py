"""Samples between two rough planes: pressed without weight, at rest under the pressure asked for."""

import math

import numpy as np
import pytest

import dem
from dem.measure.element import press_element


@pytest.mark.long
@pytest.mark.parametrize(("stuff", "friction", "overlap"), [("sand-weak", None, 0.05), ("jsc-1a-dense", 0.05, 0.02)])
def test_a_sample_comes_to_rest_under_its_pressure_soft_or_stiff(stuff, friction, overlap):
    """Grains that stick and are 13,000 times stiffer than the pressure shook under a servo too quick for them.

    Forces on lid and floor are those of the pressure; none is left to move a grain.
    """
    bed, lid = press_element(
        dem.material(stuff), pressure=300.0, grain=0.004, size=(6, 6, 7), pressed_friction=friction,
        max_overlap=overlap, seed=1, threads=1,
    )  # fmt: skip
    assert bed.material.young / 300 > (1e4 if overlap < 0.05 else 0)
    bed.move_body(lid, velocity=(0, 0, 0))
    bed.advance(200)
    wanted = 300.0 * bed.size[0] * bed.size[1]
    assert bed.reaction(lid)[0][2] == pytest.approx(wanted, rel=0.03)
    assert bed.reaction(0)[0][2] == pytest.approx(-wanted, rel=0.03)
    assert bed.kinetic_energy / bed.grain_count < 1e-5 * 300 * 0.004**3
    volume = 4 / 3 * math.pi * (bed.grains().radius ** 3).sum()
    packing = volume / (wanted / 300) / float(bed.body_position(lid)[2])
    assert 0.5 < packing < 0.64
    assert np.linalg.norm(bed.grains().force, axis=1).max() < 0.2 * 300 * 0.004**2
