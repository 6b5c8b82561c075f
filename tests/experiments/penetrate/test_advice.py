"""What is said before a run of a bed that is too narrow, too shallow or too coarse for its tip."""

import pytest
from pydantic import ValidationError

from experiments.grains.advice import costs, resolution_advice, times_as_long
from experiments.penetrate.settings import PenetrateSettings

TIP = {"tip": 0.012, "grain": 0.0012, "size": (0.072, 0.072, 0.05), "depth": 0.012}


def test_of_a_bed_that_is_fine_and_wide_nothing_is_said():
    assert not list(resolution_advice(**TIP))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"size": (0.048, 0.072, 0.05)}, ["4 tips wide", "0.072 m both ways", "1.5 times the time"]),
        ({"size": (0.072, 0.072, 0.03)}, ["1.5 tips below", "0.036 m in depth", "1.2 times the time"]),
        ({"grain": 0.0024}, ["5 grains across", "51 % higher", "0.0012 m", "16 times the time"]),
        ({"grain": 0.004}, ["3 grains across", "120 % higher", "0.0012 m", "120 times the time"]),
    ],
)
def test_each_fault_is_said_with_what_would_do_and_its_cost(change, words):
    (text,) = resolution_advice(**TIP | change, seconds=600.0)
    assert all(word in text for word in words), text
    assert "in place of 10 min" in text


def test_a_run_takes_time_with_grains_and_with_their_size_to_the_fourth():
    """Volume / d^3 grains, and steps as 1 / d."""
    size = (0.05, 0.05, 0.03)
    assert times_as_long(size, 0.002, wanted=size, wanted_grain=0.001) == pytest.approx(16)
    assert times_as_long(size, 0.002, wanted=(0.1, 0.1, 0.03), wanted_grain=0.002) == pytest.approx(4)
    assert costs(16.0, 3600.0).split()[-7::5] == ["16", "60"]


@pytest.mark.parametrize(
    ("given", "cost"),
    [
        ({"bed_size": (0.03, 0.03, 0.05)}, (0.048 / 0.03) ** 2),
        ({"tip_diameter": 0.0115, "grain": 0.0025}, (0.0025 / 0.0023) ** 4),
    ],
)
def test_what_is_refused_says_what_the_remedy_costs(given, cost):
    with pytest.raises(ValidationError, match=f"at {cost:.2g} times the time"):
        PenetrateSettings(**given)


def test_of_a_plate_the_ratio_of_a_ball_is_said_not_to_have_been_seen():
    """K = K_0 (1 - c d / D) with -6 % to ever finer grains at 8 across (plates-in-sand) is 2 % from 6 to 8 across."""
    (text,) = resolution_advice(**TIP | {"grain": 0.0024}, flat=True)
    ratio = (1 + (1 / 0.94 - 1) * 8 / 6) * 0.94
    assert f"fell by {100 * (1 - 1 / ratio):.0f} %" in text and "8 across" in text and "51 %" in text


def test_of_grains_that_stick_no_ratio_of_sand_is_said():
    (text,) = resolution_advice(**TIP | {"grain": 0.0024}, cohesive=True)
    assert "5 grains across" in text and "not known" in text and "%" not in text
