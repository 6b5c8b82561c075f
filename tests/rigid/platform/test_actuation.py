"""Flywheels, motors and brakes: torque histories, and what they refuse."""

import math

import pytest

from rigid.platform.actuation import Flywheel, TorqueHistory

WHEEL = Flywheel(inertia=1.2e-3, max_speed=1000.0, motor_torque=0.22, brake_torque=6.0)


def test_a_brake_gives_all_the_momentum_of_the_wheel_and_no_more():
    """H = J_w omega_0, in the time H / tau."""
    history = TorqueHistory.constant(WHEEL, 6.0, actuator="brake", wheel_speed_0=400.0)
    assert history.spin == pytest.approx(0.48)
    assert history.impulse() == pytest.approx(0.48)
    assert history.torque(0.0, 400.0) == 6.0
    assert history.torque(0.01, 0.0) == 0.0


def test_a_motor_ends_where_its_wheel_is_at_its_limit():
    history = TorqueHistory.constant(WHEEL, 0.22, actuator="motor")
    assert history.impulse() == pytest.approx(1.2e-3 * 1000.0)
    assert history.torque(3.0, -999.0) == 0.22
    assert history.torque(3.0, -1000.0) == 0.0


def test_pieces_follow_one_another():
    history = TorqueHistory(wheel=WHEEL, pieces=((0.1, 0.2), (0.3, -0.1), (0.4, 0.0)))
    assert [history.demanded(t) for t in (0.0, 0.0999, 0.1, 0.2999, 0.35, 0.5)] == [0.2, 0.2, -0.1, -0.1, 0.0, 0.0]
    assert history.impulse() == pytest.approx(0.1 * 0.2 - 0.2 * 0.1)
    assert history.times == (0.1, 0.3, 0.4)


@pytest.mark.parametrize(
    ("given_", "said"),
    [
        ({"torque": 0.3}, "motor gives at most 0.22"),
        ({"torque": 7.0, "actuator": "brake", "wheel_speed_0": 100.0}, "brake gives at most 6"),
        ({"torque": 6.0, "actuator": "brake"}, "needs a wheel that turns"),
        ({"torque": -1.0, "actuator": "brake", "wheel_speed_0": 100.0}, "negative"),
        ({"torque": 0.1, "wheel_speed_0": 2000.0}, "at most"),
        ({"torque": 0.1, "until": -1.0}, "torque_until"),
        ({"torque": math.nan}, "torque is nan"),
        ({"torque": 0.1, "actuator": "spring"}, "actuator"),
    ],
)
def test_what_motor_or_brake_cannot_do_is_refused(given_, said):
    with pytest.raises(ValueError, match=said):
        TorqueHistory.constant(WHEEL, given_.pop("torque"), given_.pop("until", math.inf), **given_)


@pytest.mark.parametrize("given_", [{"inertia": 0.0}, {"max_speed": -1.0}, {"axis": (1.0, 1.0, 0.0)}])
def test_a_wheel_that_cannot_be_is_refused_by_name(given_):
    with pytest.raises(ValueError, match=next(iter(given_))):
        Flywheel(**({"inertia": 1e-3} | given_))
