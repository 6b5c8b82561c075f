"""The rig against the Atwood machine's own equations (planar-model: the pair falls at g (m - m_b) / (m + m_b))."""

import math

import pytest

from rigid.platform.rig import STANDARD_GRAVITY, Rig, counterweight_for

G = STANDARD_GRAVITY


def test_the_pair_falls_at_the_gravity_it_was_made_for():
    mass, stated = 5.3, 0.0085 * G
    m_b = counterweight_for(mass, stated)
    assert m_b == pytest.approx(5.2107, abs=1e-4)
    # Newton for each mass and one wire: (m + m_b) a = (m - m_b) g
    assert (mass - m_b) * G / (mass + m_b) == pytest.approx(stated, rel=1e-13)


def test_the_other_reading_leaves_the_stated_weight_per_mass():
    mass, stated = 5.3, 0.0085 * G
    m_b = counterweight_for(mass, stated, reading="weight")
    assert (mass - m_b) * G / mass == pytest.approx(stated, rel=1e-13)


def test_the_two_readings_leave_weights_almost_a_factor_of_two_apart():
    pair, weight = (Rig.offloading(5.3, 0.0085 * G, reading=reading) for reading in ("pair", "weight"))
    assert weight.weight == pytest.approx(5.3 * 0.0085 * G, rel=1e-12)
    # (m + m_b) g_sim over m g_sim is 1 + m_b / m = 2 g / (g + g_sim)
    assert pair.weight / weight.weight == pytest.approx(2 / 1.0085, rel=1e-12)
    # What is left is (m - m_b) g in both, by the definition of each.
    for rig in (pair, weight):
        assert rig.weight == pytest.approx((rig.mass - rig.counterweight) * G, rel=1e-9)


@pytest.mark.parametrize("reading", ["pair", "weight"])
def test_a_counterweight_that_is_given_does_not_move_the_weight_that_is_stated(reading):
    rig = Rig.offloading(5.3, 0.0834, reading=reading, counterweight=4.0)
    expected = (5.3 + 4.0) * 0.0834 if reading == "pair" else 5.3 * 0.0834
    assert rig.counterweight == 4.0
    assert rig.weight == pytest.approx(expected, rel=1e-12)


def test_the_tension_is_what_moves_the_counterweight():
    rig = Rig.offloading(5.3, 0.0834)
    assert rig.wire_tension() == pytest.approx(rig.counterweight * G)
    falling = rig.wire_tension(-rig.gravity_sim)
    # The platform in free fall: m y'' = T - m g, with no ground.
    assert (falling - rig.mass * G) / rig.mass == pytest.approx(-rig.gravity_sim, rel=1e-9)
    assert rig.wire_tension(2 * G) == 0.0


def test_the_balance_is_the_counterweight_that_belongs_to_the_gravity():
    rig = Rig.offloading(5.3, 0.0834, counterweight=5.0)
    assert rig.balance == counterweight_for(5.3, 0.0834)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"counterweight": 5.3}, "counterweight = 5.3 kg must be below mass = 5.3 kg"),
        ({"counterweight": 6.0}, "counterweight = 6 kg"),
        ({"counterweight": 0.0}, "counterweight = 0.0 must be above 0"),
        ({"gravity_sim": 9.9}, "gravity_sim = 9.9 m/s2 must be below gravity"),
        ({"gravity_sim": math.nan}, "gravity_sim = nan"),
        ({"mass": -1.0}, "mass = -1.0"),
        ({"gravity": math.inf}, "gravity = inf"),
        ({"wire_length": 0.0}, "wire_length = 0.0"),
    ],
)
def test_a_rig_that_cannot_be_is_refused_by_name(change, said):
    values = {"mass": 5.3, "counterweight": 5.2, "gravity_sim": 0.0834} | change
    with pytest.raises(ValueError, match=said):
        Rig(**values)


def test_a_stated_gravity_that_is_no_offloading_is_refused():
    with pytest.raises(ValueError, match=r"gravity_stated = 9\.81"):
        counterweight_for(5.3, 9.81)
    with pytest.raises(ValueError, match="neither 'pair' nor 'weight'"):
        counterweight_for(5.3, 0.1, reading="mass")
    with pytest.raises(ValueError, match="neither 'pair' nor 'weight'"):
        Rig.offloading(5.3, 0.1, reading="mass", counterweight=5.0)
