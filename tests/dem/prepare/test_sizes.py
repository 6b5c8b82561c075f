"""Distributions of diameters: their moments and bounds, what is drawn from them, what is refused."""

import math

import numpy as np
import pytest

from dem import SAND, Bed, LogNormal, Normal, Sieve, Uniform
from dem.grains.packing import RAIN_COLUMN, draw_radii, rain_column, rain_positions
from dem.grains.sizes import describe, sizes_of
from dem.prepare.prepare import bound_of_mean, soft_enough

# A graded sand, by the share of its mass that passes.
TABLE = Sieve(openings=(0.001, 0.0015, 0.002, 0.003, 0.004), passing=(0.0, 0.1, 0.1, 0.7, 1.0))
ALL = [Uniform(0.002, 0.3), Normal(0.002, 0.2), Normal(0.002, 0.25, cut=3.5), LogNormal(0.002, 0.3), TABLE]


@pytest.mark.parametrize("sizes", ALL, ids=str)
def test_what_is_drawn_has_the_mean_the_bounds_and_the_mean_cube_stated(sizes):
    """200,000 draws: to five standard errors; the bounds are kept and nearly reached."""
    d = sizes.draw(np.random.default_rng(1), 200_000)
    least, largest = sizes.bounds
    assert d.min() >= least * (1 - 1e-12) and d.max() <= largest * (1 + 1e-12)
    assert d.min() < least + 0.02 * (largest - least) and d.max() > largest - 0.02 * (largest - least)
    for power, stated in ((1, sizes.mean), (3, sizes.mean_cube)):
        error = (d**power).std() / math.sqrt(len(d))
        assert abs((d**power).mean() - stated) < 5 * error


def test_sieving_what_was_drawn_from_a_table_gives_the_table():
    """Mass shares between sieves, and half a class's mass below the geometric middle of its sieves."""
    d = TABLE.draw(np.random.default_rng(2), 400_000)
    masses = d**3 / (d**3).sum()
    for opening, share in zip(TABLE.openings, TABLE.passing, strict=True):
        assert masses[d <= opening * (1 + 1e-12)].sum() == pytest.approx(share, abs=4e-3)
    assert masses[d < math.sqrt(0.002 * 0.003)].sum() == pytest.approx(0.1 + 0.3, abs=4e-3)
    assert ((d > 0.0015) & (d < 0.002)).sum() == 0  # nothing lies between sieves of the same share
    larger = Sieve(TABLE.openings, TABLE.passing, scale=12.0)
    assert larger.mean == pytest.approx(12 * TABLE.mean) and larger.bounds == pytest.approx((0.012, 0.048))
    assert larger.draw(np.random.default_rng(2), 400_000) == pytest.approx(12 * d)


def test_the_log_normal_is_normal_in_the_logarithm():
    """Quartiles of ln d about the median, at +-0.6745 deviations when the cut is far."""
    sizes = LogNormal(0.002, 0.4, cut=4.0)
    logs = np.log(sizes.draw(np.random.default_rng(3), 100_000) / sizes.median)
    assert np.quantile(logs, [0.25, 0.5, 0.75]) == pytest.approx([-0.6745 * 0.4, 0.0, 0.6745 * 0.4], abs=5e-3)
    assert sizes.median == pytest.approx(0.002 * math.exp(-0.08), rel=1e-3)


@pytest.mark.parametrize("sizes", ALL, ids=str)
def test_radii_of_every_distribution_fill_the_volume_and_rain_without_overlap(sizes):
    volume = 400 * math.pi / 6 * sizes.mean_cube
    radii = draw_radii(np.random.default_rng(4), volume, sizes)
    assert len(radii) == 400
    spread = (radii**3).std() / (radii**3).mean() / math.sqrt(400)
    assert abs((4 / 3 * math.pi * radii**3).sum() / volume - 1) < 5 * spread + 1e-12
    period = (6 * sizes.bounds[1], 5 * sizes.bounds[1])
    x = rain_positions(np.random.default_rng(5), radii, period)
    d = x[:, None] - x[None]
    d[..., :2] -= np.array(period) * np.round(d[..., :2] / period)
    gap = np.linalg.norm(d, axis=2) - radii[:, None] - radii
    np.fill_diagonal(gap, 1.0)
    assert gap.min() > 0 and (x[:, 2] - radii).min() > 0


def test_a_mean_diameter_draws_the_same_bits_as_ever():
    """Uniform within mean (1 +- spread): what beds were made of before there were distributions."""
    rng = np.random.default_rng(6)
    count = round(1e-6 / (math.pi / 6 * 0.003**3 * (1 + 0.15**2)))
    wanted = 0.5 * 0.003 * (1 + 0.15 * rng.uniform(-1, 1, count))
    for given in ((0.003, 0.15), (0.003,), (Uniform(0.003),)):
        assert (draw_radii(np.random.default_rng(6), 1e-6, *given) == wanted).all()


def test_a_wide_distribution_rains_from_higher_up():
    """The lattice of the rain has the largest grain's sites; sizes alike keep their column."""
    assert rain_column(Uniform(0.002, 0.15)) == RAIN_COLUMN == rain_column(Normal(0.002, 0.05))
    wide = LogNormal(0.002, 0.4)
    share = (wide.bounds[1] ** 3 / wide.mean_cube) / (1.15**3 / (1 + 0.15**2))
    assert rain_column(wide) == pytest.approx(RAIN_COLUMN * share)
    assert share > 2


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Uniform(-0.002), "Uniform: mean = -0.002 must be a positive diameter"),
        (lambda: Uniform(0.002, 0.6), "Uniform: spread = 0.6 must be between 0 and 0.5"),
        (lambda: Normal(math.nan, 0.1), "Normal: mean = nan"),
        (lambda: Normal(0.002, -0.1), "Normal: deviation = -0.1 must be between 0 and 1"),
        (lambda: Normal(0.002, 0.5), r"Normal: deviation = 0.5 must be below 0.45 with cut = 2"),
        (lambda: LogNormal(0.002, 0.3, cut=0.0), "LogNormal: cut = 0.0 must be above 0"),
        (lambda: LogNormal(0.002, 2.0), "LogNormal: deviation = 2.0"),
        (lambda: Sieve((0.001,), (1.0,)), "Sieve: openings = .* must be two or more"),
        (lambda: Sieve((0.001, 0.002), (0.0, 0.5, 1.0)), "Sieve: passing = .* as many shares as there are openings, 2"),
        (lambda: Sieve((0.002, 0.001), (0.0, 1.0)), "Sieve: openings = .* positive and ascending"),
        (lambda: Sieve((0.001, math.nan), (0.0, 1.0)), "Sieve: openings = .* positive and ascending"),
        (lambda: Sieve((0.001, 0.002, 0.003), (0.0, 0.7, 0.4)), "Sieve: passing = .* rise from 0 to 1"),
        (lambda: Sieve((0.001, 0.002), (0.0, 100.0)), "Sieve: passing = .* rise from 0 to 1"),
        (lambda: Sieve((0.001, 0.002), (0.2, 1.0)), "Sieve: passing = .* rise from 0 to 1"),
        (lambda: Sieve((0.001, 0.002), (0.0, 1.0), scale=0.0), "Sieve: scale = 0.0"),
        (lambda: sizes_of("coarse"), "grain = 'coarse' must be a mean diameter"),
        (lambda: sizes_of(math.inf), "grain = inf must be a positive diameter"),
        (lambda: sizes_of(0.002, -0.1), "spread = -0.1 must be between"),
        (lambda: sizes_of(Normal(0.002, 0.1), 0.15), "spread = 0.15 is for a mean diameter; Normal has"),
        (lambda: draw_radii(np.random.default_rng(1), -1.0, 0.002), "volume = -1.0 must be positive"),
    ],
)
def test_a_distribution_that_cannot_be_is_refused_by_key_and_value(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_a_distribution_can_be_written_down():
    assert describe(TABLE) == {"kind": "Sieve", "openings": TABLE.openings, "passing": TABLE.passing, "scale": 1.0}
    assert describe(sizes_of(0.002)) == {"kind": "Uniform", "mean": 0.002, "spread": 0.15}


def test_wide_sizes_are_held_to_the_bound_of_their_smallest():
    """What a contact gives in is much the same, and so a larger share of the smallest diameter."""
    for sizes in (Uniform(0.003, 0.15), Uniform(0.003, 0.0), Uniform(0.0007, 0.15)):
        assert bound_of_mean(sizes, 0.05) == 0.05  # to the bit: these beds stay what they were
    assert bound_of_mean(Uniform(0.003, 0.5), 0.05) == pytest.approx(0.05 * 0.5 / 0.85)
    options = {"size": (0.027, 0.027, 0.018), "gravity": 9.81, "max_overlap": 0.05}
    narrow = soft_enough(SAND, sizes=Uniform(0.003, 0.15), **options)
    assert soft_enough(SAND, sizes=Uniform(0.003, 0.5), **options) > 2 * narrow


@pytest.mark.slow
def test_a_bed_of_wide_sizes_keeps_its_bound():
    """Made as soft as narrow ones these went past 5 % in the rain."""
    size = (0.024, 0.024, 0.016)
    bed = Bed.prepare_as(SAND, stages=["rain"], size=size, grain=LogNormal(0.003, 0.25), seed=1, threads=1)
    assert bed.reports[0].max_overlap < 0.05
