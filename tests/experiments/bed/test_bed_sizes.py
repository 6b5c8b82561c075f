"""Sizes by name about a mean; adhesion in grains of another size by its power law; what cannot be is refused by key."""

import math

import numpy as np
import pytest
from golden import golden

from dem.grains.materials import Material, material
from dem.grains.sizes import LogNormal, Normal, Sieve, Uniform
from experiments.bed import make as bed_make
from experiments.bed.settings import BedSettings
from experiments.grains.sizes import bond_number, in_grains_of, scaling_told, sizes_table

SIEVE = {"distribution": "sieve", "openings": (1e-4, 1.5e-4, 2e-4, 3e-4), "passing": (0.0, 0.2, 0.6, 1.0)}


def test_each_distribution_has_the_mean_asked_for():
    assert BedSettings(grain=0.003, spread=0.1).local == Uniform(0.003, 0.1)
    assert BedSettings(distribution="normal", deviation=0.2, cut=1.5).local == Normal(0.004, 0.2, 1.5)
    assert BedSettings(distribution="log-normal", deviation=0.3).local == LogNormal(0.004, 0.3)
    table = BedSettings(**SIEVE).local
    assert isinstance(table, Sieve) and table.mean == pytest.approx(0.004, rel=1e-12)
    assert table.scale == pytest.approx(0.004 / Sieve(SIEVE["openings"], SIEVE["passing"]).mean)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"distribution": "normal"}, "distribution = 'normal' needs a deviation"),
        ({"distribution": "sieve"}, r"needs openings \[m\] and the share of the mass"),
        ({"deviation": 0.2}, "deviation = 0.2 with distribution = 'uniform': it belongs to 'normal' or 'log-normal'"),
        (SIEVE | {"cut": 2.0}, "cut = 2.0 with distribution = 'sieve'"),
        (SIEVE | {"passing": (0.0, 0.6, 0.2, 1.0)}, "passing = .* rise from 0 to 1"),
        (SIEVE | {"coarse": 0.008, "footprints": (0.0, 0.02)}, "distribution = 'sieve' with coarse = 0.008"),
        ({"distribution": "normal", "deviation": 0.2, "spread": 0.1}, "spread = 0.1 with distribution = 'normal'"),
        ({"keep": "bond"}, "keep = 'bond': material 'sand' does not stick"),
    ],
)
def test_sizes_that_cannot_be_are_refused_by_key(settings, said):
    with pytest.raises(ValueError, match=said):
        BedSettings(**settings)


def test_adhesion_goes_with_the_power_of_the_diameter_that_keeps_what_is_kept():
    """Pull-off goes as gamma d: over d^2 it stays for gamma ~ d, over the weight, ~ d^3, for gamma ~ d^2."""
    own = material("jsc-1a-loose")
    for keep, power in (("strength", 1), ("bond", 2), ("surface-energy", 0)):
        settings = BedSettings(material="jsc-1a-loose", grain=0.002, keep=keep)
        now = bed_make.material_of(settings, settings.material)
        assert now.surface_energy == pytest.approx(own.surface_energy * 0.5**power)
        assert now.grain == 0.002
    bonds = [bond_number(in_grains_of(own, d, keep="bond", own=0.004), diameter=d, gravity=9.81) for d in (0.004, 1e-4)]
    assert bonds[0] == pytest.approx(bonds[1])
    assert bonds[0] == pytest.approx(6 * 0.575 / (2900 * 0.004**2 * 9.81))  # pi gamma d over pi / 6 rho d^3 g
    said = scaling_told(own, own.for_grain(0.002), diameter=0.002, gravity=9.81, keep="strength")
    golden("bed/strength_is_kept", said)


def test_a_material_that_does_not_say_for_which_grains_is_taken_as_it_stands():
    plain = Material("m", 2650.0, 7e10, 0.25, 0.5, 0.5, cohesion="jkr", surface_energy=0.1)
    golden("bed/taken_as_it_is", scaling_told(plain, plain, diameter=0.004, gravity=9.81, keep="strength"))
    assert bond_number(plain, diameter=0.004, gravity=9.81) == pytest.approx(4.5 * 0.1 / (2650 * 0.004**2 * 9.81))


def test_the_grading_told_is_the_table_s():
    """Of grains drawn from it: the shares by mass that pass the enlarged sieves."""
    table = BedSettings(**SIEVE).local
    assert isinstance(table, Sieve)
    radii = 0.5 * table.draw(np.random.default_rng(1), 100_000)
    told = sizes_table(radii, table)
    assert [float(row[0]) for row in told["rows"]] == pytest.approx([0.1, 0.15, 0.2, 0.3])
    assert [float(row[3]) for row in told["rows"]] == pytest.approx([0, 20, 60, 100], abs=1.0)
    even = sizes_table(np.full(10, 0.002), Uniform(0.004, 0.0))
    assert even["rows"][-1] == ["D60 / D10", "1"] and math.isclose(float(even["rows"][2][1]), 4.0)
