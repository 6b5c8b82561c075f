"""Hop theory: launches against the closed forms of the planar model, flights against orbits integrated in time.

Numbers without a remark are the Hedgehog's: m = 5.3 kg, J = 0.06 kg m2, l = 0.2 m, leaning pi / 8.
"""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rigid.hop import (
    Tumbler,
    brake_launch,
    escape_speed,
    flight,
    impulsive_launch,
    launch,
    launch_speed_for,
    least_viable_angle,
)
from rigid.platform.files import find_platform

RIG = 5.21
STICKS = {"mu_s": math.inf, "mu_d": math.inf}


def hedgehog(**given_):
    return Tumbler(**({"mass": 5.3, "inertia": 0.06, "spike_length": 0.2} | given_))


def test_a_launch_states_the_lean_that_was_taken_also_where_none_is_given():
    assert math.degrees(impulsive_launch(hedgehog(gravity=0.1), 0.4).lean) == pytest.approx(22.5)
    assert brake_launch(hedgehog(gravity=0.1, lean=0.7), 0.4, 10.0).lean == 0.7


# Launch ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mu_d", "counterweight", "degrees"),
    [(0.125, 0, 82.9), (0.25, 0, 76.0), (0.5, 0, 63.4), (0.125, RIG, 76.1), (0.25, RIG, 63.6), (0.5, RIG, 45.2)],
)
def test_a_strong_torque_launches_sliding_at_tan_m_over_m_y_mu(mu_d, counterweight, degrees):
    """docs/planar.md, closed forms; by impulse and by the equations of motion under 1 kN m."""
    tumbler = hedgehog(mu_s=2 * mu_d, counterweight=counterweight, gravity=0.0834)
    sudden = impulsive_launch(tumbler, 0.4)
    assert math.degrees(sudden.angle) == pytest.approx(degrees, abs=0.06)
    assert sudden.slid
    exact = math.atan2(5.3, (5.3 + counterweight) * mu_d)
    assert sudden.angle == pytest.approx(exact, rel=1e-12)
    assert brake_launch(tumbler, 0.4, 1000.0).angle == pytest.approx(exact, abs=2e-3)


@pytest.mark.parametrize("counterweight", [0.0, RIG])
@pytest.mark.parametrize("mu", [0.25, 0.5, math.inf])
def test_a_brake_comes_to_the_sudden_launch_as_its_time_goes_to_nothing(counterweight, mu):
    """Sticking omega = H / (J + m l^2) free, sliding H / (J + M l^2 s (s + mu c)); the error falls with the time."""
    tumbler = hedgehog(mu_s=mu, mu_d=mu, counterweight=counterweight)
    sudden = impulsive_launch(tumbler, 0.4)
    s, c = math.sin(math.pi / 8), math.cos(math.pi / 8)
    my = 5.3 + counterweight
    lever = 5.3 * 0.04 * c * c + my * 0.04 * s * s if mu == math.inf else my * 0.04 * s * (s + mu * c)
    assert sudden.spin == pytest.approx(0.4 / (0.06 + lever), rel=1e-12)

    def velocity(left):
        return left.speed * np.array([math.cos(left.angle), math.sin(left.angle)])

    found = [velocity(brake_launch(tumbler, 0.4, torque)) for torque in (100.0, 200.0, 400.0)]
    errors = [np.linalg.norm(one - velocity(sudden)) / sudden.speed for one in found]
    assert errors[-1] < 0.01
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.1)


def test_launches_without_sliding_are_viable_from_the_cone_of_friction_up():
    """pi / 2 - atan(mu_s); the Hedgehog's 22.5 degrees take mu_s = cot(pi / 8) = 2.41 free and 1.22 in the rig."""
    assert least_viable_angle(1.0) == pytest.approx(math.pi / 4)
    assert least_viable_angle(0.0) == pytest.approx(math.pi / 2)
    assert least_viable_angle(0.7) == pytest.approx(math.pi / 2 - math.atan(0.7))
    for counterweight, least in ((0.0, 2.41), (RIG, 1.22)):
        angle = least_viable_angle(least, mass=5.3, counterweight=counterweight)
        assert math.degrees(angle) == pytest.approx(22.5, abs=0.1)
        assert not impulsive_launch(hedgehog(mu_s=least + 0.01, counterweight=counterweight), 1.0).slid
        assert impulsive_launch(hedgehog(mu_s=least - 0.01, counterweight=counterweight), 1.0).slid


def test_less_than_the_tipping_torque_does_not_move_it():
    """W l sin(pi / 8)."""
    tumbler = hedgehog(gravity=0.0834, mu_s=3.0)
    assert tumbler.tipping_torque == pytest.approx(5.3 * 0.0834 * 0.2 * math.sin(math.pi / 8))
    assert launch(tumbler, 0.999 * tumbler.tipping_torque) is None
    assert launch(tumbler, 10 * tumbler.tipping_torque) is not None


@pytest.mark.parametrize("torque", [0.125, 0.22, 2.0])
@pytest.mark.parametrize("counterweight", [0.0, RIG])
def test_a_sticking_launch_leaves_when_the_force_ends_with_the_energy_put_in(torque, counterweight):
    """T = tau phi - W l (cos(g0 - phi) - cos g0), and at the end y'' = -W / M: the ground gives nothing."""
    tumbler = hedgehog(gravity=0.0834, counterweight=counterweight, **STICKS)
    left = launch(tumbler, torque)
    beta, my = math.pi / 8 - left.rotation, 5.3 + counterweight
    rise = 0.2 * (math.cos(beta) - math.cos(math.pi / 8))
    up, along = left.speed * math.sin(left.angle), left.speed * math.cos(left.angle)
    energy = 0.5 * (5.3 * along**2 + my * up**2 + 0.06 * left.spin**2)
    assert energy == pytest.approx(torque * left.rotation - my * 0.0834 * rise, rel=1e-8)
    s, c = math.sin(beta), math.cos(beta)
    turn = torque - my * 0.0834 * 0.2 * s + (my - 5.3) * 0.04 * s * c * left.spin**2
    turn /= 0.06 + 5.3 * (0.2 * c) ** 2 + my * (0.2 * s) ** 2
    assert 0.2 * (s * turn - c * left.spin**2) == pytest.approx(-0.0834, rel=1e-6)


@settings(max_examples=150, deadline=None)
@given(
    mu=st.sampled_from([0.0, 0.05, 0.25, 0.5, 1.0, 2.0, math.inf]), share=st.sampled_from([0.0, 0.5, 1.0]),
    gravity=st.sampled_from([0.0, 1e-5, 1e-3, 0.1, 9.8]), counterweight=st.sampled_from([0.0, 5.0]),
    lean=st.floats(0.1, 1.2), torque=st.floats(-3, 2), until=st.floats(-3, 1),
)  # fmt: skip
def test_whatever_is_launched_ends_in_an_answer_that_has_no_more_energy_than_was_given(
    mu, share, gravity, counterweight, lean, torque, until
):
    sliding = mu if mu == math.inf else share * mu
    tumbler = hedgehog(mu_s=mu, mu_d=sliding, gravity=gravity, counterweight=counterweight, lean=lean)
    left = launch(tumbler, 10**torque, 10**until)
    assume(left is not None)
    beta, my = lean - left.rotation, 5.3 + counterweight
    up, along = left.speed * math.sin(left.angle), left.speed * math.cos(left.angle)
    energy = 0.5 * (5.3 * along**2 + my * up**2 + 0.06 * left.spin**2)
    energy += my * gravity * 0.2 * (math.cos(beta) - math.cos(lean))
    assert energy <= 10**torque * left.rotation * (1 + 1e-7)


def test_a_cube_jumps_onto_its_edge_with_the_momentum_of_energy_and_impulse():
    """Cubli: H = (J + m l^2) omega with (J + m l^2) omega^2 / 2 = m g (l - a / 2): 173 rad/s of its wheel at 1 g."""
    cubli = find_platform("cubli")
    stance = cubli.stance()
    lever = cubli.moment() + cubli.mass * stance.spike_length**2
    rise = stance.spike_length * (1 - math.cos(stance.lean))
    momentum = math.sqrt(2 * lever * cubli.mass * 9.81 * rise)
    tumbler = Tumbler(
        mass=cubli.mass, inertia=cubli.moment(), spike_length=stance.spike_length, lean=stance.lean, **STICKS
    )
    spin = impulsive_launch(tumbler, momentum).spin
    assert 0.5 * lever * spin**2 == pytest.approx(cubli.mass * 9.81 * rise, rel=1e-12)
    assert momentum / cubli.wheel().inertia == pytest.approx(173, abs=1)


@pytest.mark.parametrize(
    ("key", "value"),
    [("mass", 0.0), ("inertia", -1.0), ("spike_length", math.nan), ("gravity", -1e-3), ("counterweight", -1.0),
     ("lean", 2.0), ("mu_s", -0.1), ("mu_d", 0.9)],
)  # fmt: skip
def test_a_tumbler_that_cannot_be_is_refused_by_name(key, value):
    with pytest.raises(ValueError, match=key):
        hedgehog(**({"mu_s": 0.5} | {key: value}))


# Flight ---------------------------------------------------------------------------------------------------------------


def test_mascot_hops_17_m_at_5_cm_a_second_on_ryugu():
    """As DLR has it: g = 1.5e-4 m/s2, 5 cm/s, 17 m: v^2 / g at 45 degrees."""
    assert flight(0.05, math.pi / 4, gravity=1.5e-4).distance == pytest.approx(17.0, abs=0.5)


@pytest.mark.parametrize("degrees", [10.0, 45.0, 76.0, 90.0])
def test_on_a_body_far_larger_than_the_hop_the_ground_is_flat(degrees):
    angle = math.radians(degrees)
    flat = flight(0.1, angle, gravity=1e-3)
    round_ = flight(0.1, angle, gravity=1e-3, radius=1e8)
    assert (round_.distance, round_.time, round_.height) == pytest.approx(
        (flat.distance, flat.time, flat.height), rel=1e-6, abs=1e-9
    )


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9, 0.97])
@pytest.mark.parametrize("degrees", [15.0, 45.0, 80.0])
def test_a_flight_around_a_round_body_is_the_orbit_integrated(share, degrees):
    """r'' = -g R^2 r / |r|^3 from the surface back to it."""
    gravity, radius, angle = 1e-3, 300.0, math.radians(degrees)
    speed = share * escape_speed(gravity, radius)
    found = flight(speed, angle, gravity=gravity, radius=radius)
    velocity = (speed * math.cos(angle), speed * math.sin(angle))

    def slope(_, y):
        pull = -gravity * radius**2 / np.hypot(y[0], y[1]) ** 3
        return [y[2], y[3], pull * y[0], pull * y[1]]

    def ground(_, y):
        return np.hypot(y[0], y[1]) - radius

    def top(_, y):
        return y[0] * y[2] + y[1] * y[3]

    ground.terminal, ground.direction, top.direction = True, -1, -1
    start = [0.0, radius, *velocity]
    orbit = solve_ivp(slope, (0, 1.5 * found.time), start, "DOP853", events=[ground, top], rtol=1e-12, atol=1e-9)
    x, y = orbit.y_events[0][0][:2]
    around = math.atan2(x, y) % (2 * math.pi)
    assert found.time == pytest.approx(orbit.t_events[0][0], rel=1e-8)
    assert found.distance == pytest.approx(radius * around, rel=1e-8)
    assert found.height == pytest.approx(np.hypot(*orbit.y_events[1][0][:2]) - radius, rel=1e-7)


@settings(max_examples=100, deadline=None)
@given(degrees=st.floats(1, 89), share=st.floats(0.001, 0.99), radius=st.sampled_from([10.0, 300.0, 1e6]))
def test_the_speed_for_a_distance_is_the_speed_that_goes_it(degrees, share, radius):
    angle, speed = math.radians(degrees), share * escape_speed(1e-3, radius)
    flown = flight(speed, angle, gravity=1e-3, radius=radius)
    assert launch_speed_for(flown.distance, angle, gravity=1e-3, radius=radius) == pytest.approx(speed, rel=1e-7)
    flat = flight(speed, angle, gravity=1e-3)
    assert launch_speed_for(flat.distance, angle, gravity=1e-3) == pytest.approx(speed, rel=1e-9)


def test_from_the_escape_speed_on_it_does_not_come_down():
    escape = escape_speed(1e-3, 300.0)
    assert escape == pytest.approx(math.sqrt(0.6))
    assert flight(escape, 1.0, gravity=1e-3, radius=300.0) is None
    assert flight(0.9999 * escape, 1.0, gravity=1e-3, radius=300.0) is not None


@pytest.mark.parametrize(
    ("given_", "said"),
    [({"distance": 0.0}, "distance"), ({"distance": 2000.0}, "once around"), ({"distance": 1500.0}, "escape speed"),
     ({"gravity": 0.0}, "gravity"), ({"radius": -1.0}, "radius"), ({"angle": 0.0}, "angle")],
)  # fmt: skip
def test_a_flight_that_cannot_be_is_refused_by_name(given_, said):
    with pytest.raises(ValueError, match=said):
        launch_speed_for(**({"distance": 5.0, "angle": 1.3, "gravity": 1e-3, "radius": 300.0} | given_))
