"""Terzaghi's formula for a foot in real grains, against numbers computed by hand."""

import math

import pytest

from dem.grains.materials import MATERIALS, Material
from experiments.grains.bearing import cohesion_in_95, enough_cohesion, footing_angles, footing_depths, friction_angle

G = 9.80665
PRESSURE = 0.5 / (math.pi * 0.008**2)  # 0.5 N on 16 mm
SAND, JSC = MATERIALS["sand"], MATERIALS["jsc-1a-loose-cut"]


def test_sand_and_jsc_1a_have_the_angles_of_their_measured_samples_and_others_one():
    """docs/materials.md: 28.9 on the shear plane, 34.2 of Mohr's circles; of JSC-1A 32 to 50."""
    assert footing_angles(SAND) == (28.9, 34.2)
    assert footing_angles(JSC) == (32.0, 36.8, 50.0)
    other = Material("other", 2650.0, 7e10, 0.25, 0.5, 0.5, 0.1)
    assert footing_angles(other) == (friction_angle(other),)


def test_the_cohesion_that_carries_the_foot_is_the_load_over_area_and_1_3_n_c():
    """N_c = 27.67 and 42.9 at 28.9 and 34.2 degrees (Prandtl): 69 and 45 Pa, as docs/tutorials/own-foot.md has them."""
    for angle, factor in zip(footing_angles(SAND), (27.67, 42.9), strict=True):
        assert enough_cohesion(PRESSURE, angle) == pytest.approx(PRESSURE / (1.3 * factor), rel=3e-3)
    found = cohesion_in_95(JSC)
    assert (found.value, found.least, found.most) == (24.0, 0.0, pytest.approx(24 + 1.96 * 20, rel=1e-3))
    assert cohesion_in_95(SAND) is None


@pytest.mark.parametrize(
    ("stuff", "gravity", "depths"),
    [(SAND, 1.0, (0.7e-3, 7.1e-3)), (SAND, 1e-3, (5.8, 10.8)), (JSC, 1.0, (0.0, 2.1e-3)), (JSC, 1e-3, (0.47, 6.7))],
)
def test_the_depths_without_cohesion_are_those_of_the_tutorial(stuff, gravity, depths):
    """docs/tutorials/own-foot.md: 0.7 and 7.1 mm, 6 to 11 m; 0 to 2.1 mm, up to 6.7 m."""
    found = footing_depths(stuff, PRESSURE, gravity=gravity * G, diameter=0.016)
    assert found == pytest.approx(depths, rel=0.04, abs=1e-6)


def test_a_cohesion_takes_its_part_of_the_pressure_off():
    """p - 1.3 c N_c, N_c = 35.49 at 32 degrees, over rho g N_q, N_q = 23.18, rho = 0.563 * 2900 kg/m3."""
    none, some = (footing_depths(JSC, PRESSURE, gravity=1e-3 * G, diameter=0.016, cohesion=c)[1] for c in (0.0, 20.0))
    assert none - some == pytest.approx(1.3 * 20 * 35.49 / (0.563 * 2900 * 1e-3 * G * 23.18), rel=1e-3)
