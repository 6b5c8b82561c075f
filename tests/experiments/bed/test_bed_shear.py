"""The shear test: lines and peaks of made-up runs come back exactly (test_bed.py shears a bed)."""

import math

import numpy as np
import pytest

from dem.measure.shearing import Shearing
from experiments.bed.peaks import LEAST_PEAK, peak_over_noise, without_peak
from experiments.bed.shear import fit_line, strength_of
from experiments.bed.test_settings import BedShearSettings

GRAIN = 0.004


def made_up(normal, *, peak, critical):
    """A run that rises to a plateau of half the way's quarter, then falls to another; its normal stress wavers."""
    way = np.linspace(0.0, 8 * GRAIN, 801)
    ratio = np.where(way < 2 * GRAIN, peak, critical)
    wavers = normal * (1 + 0.05 * np.cos(2 * np.pi * way / GRAIN))
    return Shearing(way, 0.1 * way, ratio * wavers, wavers, normal, 0.01, 5e-3, 0.6, 0.0)


def test_peak_and_critical_stress_are_those_of_a_made_up_run():
    found = strength_of(made_up(1000.0, peak=0.8, critical=0.6), GRAIN)
    assert found.peak == pytest.approx(0.8 * found.normal) and found.critical == pytest.approx(0.6 * found.normal)
    assert found.normal == pytest.approx(1000.0, rel=1e-3) and found.critical_error < 1e-9 * found.normal
    assert found.peak_way <= 2 * GRAIN


def test_the_line_through_three_runs_is_mohr_coulomb_s():
    """tau = 50 Pa + sigma tan 32 degrees, exactly, and its standard errors where one point lies off it."""
    normal = np.array([500.0, 1000.0, 2000.0])
    shear = 50.0 + math.tan(math.radians(32.0)) * normal
    start, slope, start_error, slope_error = fit_line(normal, shear)
    assert start == pytest.approx(50.0) and math.degrees(math.atan(slope)) == pytest.approx(32.0)
    assert start_error < 1e-9 and slope_error < 1e-12
    assert fit_line(normal[:2], shear[:2])[2:] == (None, None)
    off = shear + np.array([0.0, 10.0, 0.0])
    _, _, start_error, slope_error = fit_line(normal, off)
    rest = off - np.polyval(np.polyfit(normal, off, 1), normal)
    assert slope_error == pytest.approx(np.linalg.norm(rest) / np.linalg.norm(normal - normal.mean()))
    assert start_error > 0


@pytest.mark.parametrize(
    ("options", "said"),
    [({"pressures": (2.0, 40.0)}, "holds 40: at most 4 times"), ({"pressures": (2.0, 2.0)}, "holds a value twice")],
)
def test_pressures_that_will_not_do_are_refused(options, said):
    with pytest.raises(ValueError, match=said):
        BedShearSettings(bed="any", **options)


def test_the_largest_of_noise_is_no_peak_and_a_hump_is_one():
    """Stress ratios that only fluctuate, and the same with a hump three times their scatter and more."""
    noise = 0.6 + 0.03 * np.random.default_rng(5).standard_normal(60)
    hump = noise + 0.25 * np.exp(-(((np.arange(60) - 12) / 4) ** 2))
    flat, peaked = (peak_over_noise(curve) for curve in (noise, hump))
    assert without_peak([flat, flat]) == flat < LEAST_PEAK < peaked
    assert without_peak([peaked]) is None and without_peak([None]) is None  # an older run does not know it
