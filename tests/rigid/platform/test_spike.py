"""The spike's geometry and what it refuses."""

import math

import pytest

from rigid import Spike


def test_sections_make_the_spike_up():
    ball, shaft = Spike(diameter=0.012, shaft_diameter=0.008, length=0.05).sections
    assert (ball.shape, ball.bottom, ball.top, ball.top_radius) == ("ball", 0.0, 0.012, 0.006)
    assert (shaft.shape, shaft.bottom, shaft.top, shaft.top_radius) == ("cylinder", 0.006, 0.05, 0.004)
    cone, _ = Spike(tip="cone", diameter=0.01, cone_angle=60.0).sections
    assert cone.top == pytest.approx(0.005 * math.sqrt(3)) and cone.bottom_radius == 0.0
    assert len(Spike(tip="flat").sections) == 1


@pytest.mark.parametrize("tip", ["sphere", "cone", "flat"])
def test_radius_and_area_follow_the_profile(tip):
    spike = Spike(tip=tip, diameter=0.012, length=0.05)
    assert spike.radius_at(0.04) == pytest.approx(0.006)
    assert spike.radius_at(0.06) == 0.0
    assert spike.area_at(0.03) == pytest.approx(math.pi * 0.006**2)
    assert spike.area_at(-0.001) == 0.0
    if tip == "sphere":  # cap of height h: a^2 = 2 R h - h^2
        assert spike.area_at(0.002) == pytest.approx(math.pi * (2 * 0.006 * 0.002 - 0.002**2))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"diameter": -0.01}, "diameter = -0.01"),
        ({"diameter": math.nan}, "diameter = nan"),
        ({"shaft_diameter": 0.02}, "shaft_diameter is 0.02"),
        ({"tip": "flat", "shaft_diameter": 0.01}, "shaft_diameter is 0.01"),
        ({"tip": "spoon"}, "tip is 'spoon'"),
        ({"tip": "cone", "cone_angle": 200.0}, "cone_angle is 200"),
        ({"length": 0.001}, "length is 0.001"),
        ({"friction": -1.0}, "friction = -1"),
        ({"restitution": 0.0}, "restitution is 0"),
        ({"mass": 0.0}, "mass = 0"),
    ],
)
def test_a_body_that_cannot_be_is_refused_by_name(given, words):
    with pytest.raises(ValueError, match=words):
        Spike(**given)


def test_a_misspelt_name_raises():
    with pytest.raises(TypeError):
        Spike(diametre=0.01)
