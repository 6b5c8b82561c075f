"""Graded beds: the field of sizes, the column that is rained, what lies where at the end, and what is refused."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dem import SAND, Bed, Graded, measure_grading
from dem.grains.graded import DRIFT, THROAT, steepest
from dem.measure.grading import packing_under
from dem.prepare.stages import PAST, SHORT

SIZE = (0.06, 0.024, 0.024)
GRADED = Graded(fine=0.002, coarse=0.004, footprints=((0.004, 0.022),), depth=0.014)


def test_the_mean_diameter_is_fine_under_footprints_and_grows_by_no_more_than_growth():
    """|d(a) - d(b)| <= growth |a - b| for any two places, the bed's ends joined; the largest is where it is said."""
    rng = np.random.default_rng(5)
    a, b = rng.uniform(0, 1, (2, 20000, 2)) * (SIZE[0], SIZE[2])
    one, other = (GRADED.diameter(p[:, 0], p[:, 1], SIZE) for p in (a, b))
    along = np.abs(a[:, 0] - b[:, 0])
    apart = np.hypot(np.minimum(along, SIZE[0] - along), a[:, 1] - b[:, 1])
    assert (np.abs(one - other) <= GRADED.growth * apart + 1e-12).all()
    under = (a[:, 0] > 0.004) & (a[:, 0] < 0.022) & (a[:, 1] > 0.010)
    assert (one[under] == 0.002).all() and (one[~under] > 0.002).all()
    wide = Graded(fine=0.002, coarse=0.02, footprints=((0.004, 0.022),), depth=0.014)
    found = wide.diameter(a[:, 0], a[:, 1], SIZE).max()
    # farthest: 21 mm from either end of the strip, 10 mm below it
    assert wide.largest(SIZE) == pytest.approx(0.002 + 0.15 * math.hypot(0.021, 0.010), rel=1e-12)
    assert found == pytest.approx(wide.largest(SIZE), rel=0.01)


def test_no_grain_within_two_diameters_fits_through_the_widest_throat_at_the_steepest_growth():
    """(1 - s) d / ((1 + s) D) = sqrt(2) - 1, where d = D - growth DRIFT D; from the field itself, not the formula."""
    for spread in (0.0, 0.15, 0.3):
        graded = Graded(fine=0.001, coarse=0.9, footprints=((0.0, 0.01),), growth=steepest(spread), spread=spread)
        size = (20.0, 1.0, 1.0)
        x = np.linspace(0.02, 4.0, 400)
        large = graded.diameter(x, 0 * x, size)
        there = x - DRIFT * large
        inside = there > 0.01
        small = graded.diameter(there, 0 * x, size)
        ratio = (1 - spread) * small[inside] / ((1 + spread) * large[inside])
        assert inside.sum() > 100 and ratio.min() == pytest.approx(THROAT, rel=1e-9) and (ratio > THROAT - 1e-9).all()


def test_the_column_holds_the_volume_in_grains_that_belong_where_they_are_and_do_not_touch():
    volume = 0.6 * math.prod(SIZE)
    positions, radii = GRADED.column(np.random.default_rng(1), volume, SIZE)
    solid = 4 / 3 * math.pi * radii**3
    assert solid.sum() == pytest.approx(volume, rel=0.02)
    period = (*SIZE[:2], 0.0)
    tree = cKDTree(positions, boxsize=period)
    pairs = tree.query_pairs(2.04 * radii.max(), output_type="ndarray")
    between = positions[pairs[:, 0]] - positions[pairs[:, 1]]
    between[:, :2] -= np.round(between[:, :2] / SIZE[:2]) * SIZE[:2]
    assert (np.linalg.norm(between, axis=1) >= 1.0199 * (radii[pairs[:, 0]] + radii[pairs[:, 1]])).all()
    assert (positions[:, 2] > radii).all()
    # As much solid above every stretch of the floor, where the field has sevenfold differences in number.
    columns = np.histogram(positions[:, 0], bins=6, range=(0, SIZE[0]), weights=solid)[0]
    assert columns.max() / columns.min() < 1.15
    again, _ = GRADED.column(np.random.default_rng(1), volume, SIZE)
    assert (again == positions).all()


def lying(positions, diameters):
    """A bed as `measure_grading` sees one."""

    class Lying:
        size, surface = SIZE, SIZE[2]

        def grains(self):
            return SimpleNamespace(position=np.array(positions, dtype=float), radius=0.5 * np.array(diameters))

    return Lying()


def test_small_grains_that_have_drained_are_found():
    """2 mm fits through sqrt(2) - 1 of 4.4 mm and more; at home, under the footprint, it does not count."""
    graded = Graded(fine=0.002, coarse=0.0044, footprints=((0.004, 0.010),))
    held = measure_grading(lying([(0.007, 0.01, 0.01), (0.036, 0.01, 0.01)], [0.002, 0.0044]), graded)
    assert held.held and held.drained_share == held.strayed_share == held.farthest == 0
    assert held.touching_ratio == 1  # the two lie apart
    out = measure_grading(lying([(0.036, 0.01, 0.012), (0.036, 0.01, 0.01)], [0.002, 0.0044]), graded)
    share = 0.002**3 / (0.002**3 + 0.0044**3)
    assert not out.held
    assert out.touching_ratio == pytest.approx(4.4 / 2)
    assert out.drained_share == pytest.approx(share) and out.strayed_share == pytest.approx(share)
    # the largest 2 mm grain's home: 2 mm / (1 - 0.15) belongs 2.4 mm out; this one lies 26 mm out, among 4.4 mm
    home = (0.002 / 0.85 - 0.002) / 0.15
    assert out.farthest == pytest.approx((0.026 - home) / 0.0044)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"fine": 0.0}, "fine = 0.0 must be a positive length"),
        ({"coarse": 0.001}, "coarse = 0.001 m is below fine"),
        ({"growth": 0.3}, "growth = 0.3 must be above 0 and, with spread = 0.15, at most 0.22"),
        ({"spread": 0.45}, "spread = 0.45 must be 0 or more and below 0.414"),
        ({"footprints": ()}, r"footprints = \(\) must be pairs"),
        ({"footprints": ((0.02, 0.01),)}, "must each begin before they end"),
        ({"footprints": ((0.05, 0.07),)}, "from 0.05 to 0.07 m is outside the bed, which reaches from 0 to 0.06 m"),
        ({"depth": 0.03}, "depth = 0.03 m is more than the bed's, 0.024 m"),
        ({"coarse": 0.008, "growth": 0.2}, r"size: y = 0.024 m is less than 6 of them; give at most coarse = 0.004 m"),
    ],
)
def test_a_grading_that_cannot_be_is_refused_before_any_work(options, words):
    given = {"fine": 0.002, "coarse": 0.004, "footprints": ((0.004, 0.022),)} | options
    with pytest.raises(ValueError, match=words):
        Bed.prepare(SAND, size=SIZE, grain=Graded(**given), cache=False)
    with pytest.raises(ValueError, match="Graded has a spread of its own"):
        Bed.prepare(SAND, size=SIZE, grain=GRADED, spread=0.1)


@pytest.mark.long
def test_a_packing_fraction_is_reached_under_the_footprints_where_a_tip_meets_it():
    """Within the tolerances of tapping; the mixed sizes beside them lie denser, so the whole bed's would not do."""
    bed = Bed.prepare(
        SAND, size=SIZE, grain=GRADED, gravity=9.80665, young=1e7, packing=0.56, cache=False, threads=1
    )  # fmt: skip
    assert 0.56 - SHORT <= packing_under(bed, GRADED) <= 0.56 + PAST
    assert measure_grading(bed, GRADED).held
