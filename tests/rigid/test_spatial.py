"""Six degrees of freedom: momentum in flight, closed forms of tops and of friction, the planar model in the plane."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rigid import Ground, Trial
from rigid import simulate as simulate_planar
from rigid.ground.laws import GROUNDS
from rigid.platform.actuation import Flywheel, TorqueHistory
from rigid.platform.files import find_platform
from rigid.spatial.quaternions import from_turn, multiply, to_matrix
from rigid.spatial.spatial import SpatialTrial, simulate, standing

HEDGEHOG = find_platform("hedgehog")
LENGTH = HEDGEHOG.stance().spike_length
STIFF = {"stiffness": 7500.0, "damping": 30.0}  # of one tip: a row of two has 15 kN/m and 60 N s/m
DAMPED = {"stiffness": 7500.0, "damping": 400.0}  # rocking dies out soon
HIGH = (0.0, 0.0, 5.0)


def with_inertia(*moments, platform=HEDGEHOG):
    return replace(platform, inertia=np.diag(moments))


def trial(**given_):
    return SpatialTrial(**({"platform": HEDGEHOG, "gravity": 0.0834, "ground_parameters": STIFF} | given_))


# Flight ---------------------------------------------------------------------------------------------------------------


def test_flight_keeps_momentum_and_angular_momentum_to_round_off():
    """Three wheels driven in flight: L does not change, P changes by W t, whatever the step."""
    wheels = [TorqueHistory.constant(w, t, 0.7) for w, t in zip(HEDGEHOG.wheels, (0.2, -0.15, 0.1), strict=True)]
    flown = simulate(
        trial(platform=with_inertia(0.05, 0.06, 0.07), torques=tuple(wheels), torque_in_flight=True), duration=2.0,
        position=HIGH, velocity=(0.1, 0.2, 0.3), angular_velocity=(1.0, -2.0, 0.5), time_step=0.02,
    )  # fmt: skip
    size = np.linalg.norm(flown.angular_momentum[0])
    assert np.abs(flown.angular_momentum - flown.angular_momentum[0]).max() < 1e-14 * size
    fallen = flown.momentum - flown.momentum[0] - flown.time[:, None] * np.array([0, 0, -5.3 * 0.0834])
    assert np.abs(fallen).max() < 1e-14 * np.abs(flown.momentum).max() * len(flown.time) ** 0.5
    assert np.abs(np.linalg.norm(flown.quaternion, axis=1) - 1).max() < 1e-14
    assert np.ptp(flown.wheel_speed, axis=0).min() > 10  # they were driven


def test_a_symmetric_top_precesses_about_its_angular_momentum():
    """I1 = I2: the axis turns about L at |L| / I1, its angle to L constant (Landau and Lifshitz, Mechanics, 33)."""
    platform = with_inertia(0.05, 0.05, 0.08)
    spin = np.array([1.5, 0.0, 3.0])
    flown = simulate(
        trial(platform=platform, gravity=0.0), duration=5.0, sample_interval=0.05, position=HIGH,
        angular_velocity=tuple(spin), tolerance=1e-10,
    )  # fmt: skip
    momentum = np.array([0.05 * 1.5, 0.0, 0.08 * 3.0])
    size = np.linalg.norm(momentum)
    for time, q in zip(flown.time, flown.quaternion, strict=True):
        expected = to_matrix(from_turn(momentum / size * (size / 0.05) * time)) @ (0.0, 0.0, 1.0)
        assert to_matrix(q)[:, 2] == pytest.approx(expected, abs=2e-8)


def test_the_attitude_converges_at_order_5_and_energy_with_it():
    """A body that tumbles about its middle axis: halving the step divides the error by 2^5."""
    top = trial(platform=with_inertia(0.04, 0.06, 0.08), gravity=0.0)
    runs = [
        simulate(
            top, duration=4.0, sample_interval=4.0, position=HIGH, angular_velocity=(1.0, 5.0, 1.0), time_step=step
        )
        for step in (0.02, 0.01, 0.005, 0.0025)
    ]
    between = [np.abs(a.quaternion[-1] - b.quaternion[-1]).max() for a, b in pairwise(runs)]
    lost = [abs(run.kinetic_energy[-1] - run.kinetic_energy[0]) for run in runs[:3]]
    orders = [math.log2(a / b) for errors in (between, lost) for a, b in pairwise(errors)]
    assert min(orders) > 4.7, orders
    assert between[-1] < 1e-10


def test_a_wheel_turns_the_platform_as_it_takes_up_momentum():
    """Free of the ground J omega = tau t, and the wheel has -tau t / J_w."""
    history = TorqueHistory.constant(HEDGEHOG.wheel(), 0.2, 0.5)
    flown = simulate(
        trial(torques=(history,), torque_in_flight=True, gravity=0.0), duration=1.0, position=HIGH, sample_interval=0.1
    )
    given_ = np.minimum(flown.time, 0.5) * 0.2
    assert flown.angular_velocity[:, 1] == pytest.approx(given_ / 0.06, abs=1e-12)
    assert flown.wheel_speed[:, 1] == pytest.approx(-given_ / 1.2e-3, abs=1e-9)
    assert flown.torque_work[-1] == pytest.approx(0.5 * 0.1**2 / 0.06, rel=1e-9)


def test_in_a_hop_the_wheels_rest_unless_told_otherwise():
    flown = simulate(
        trial(torques=(TorqueHistory.constant(HEDGEHOG.wheel(), 0.2),)),
        duration=0.3,
        position=HIGH,
        sample_interval=0.1,
    )
    assert not flown.wheel_speed.any() and not flown.angular_velocity.any()


# In the plane ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given_", "ground"),
    [
        ({"torque": 0.125, "mu_s": 0.5}, None),
        ({"torque": 0.22, "mu_s": 0.25, "counterweight": 5.21}, None),
        ({"torque": 6.0, "mu_s": 0.5, "counterweight": 5.21, "actuator": "brake", "wheel_speed_0": 400.0}, None),
        ({"torque": 0.22, "mu_s": 3.0, "damping": 300.0}, None),
        ({"torque": 0.03, "mu_s": 0.5}, None),  # below the tipping torque
        ({"torque": 0.22, "mu_s": 0.5}, "hunt-crossley"),
        ({"torque": 0.22, "mu_s": 0.5}, "rft"),
        ({"torque": 0.125, "mu_s": 0.5}, "bekker"),
    ],
)
def test_started_in_the_plane_it_moves_as_the_planar_model_does(given_, ground):
    """A planar row is two tips side by side. Two codes, two integrators, events located in both.

    How far a tumble lets differences grow after its events sets the bound: 1e-6 of l, and 2e-6 rad.
    """
    flat = Trial(
        **{"spike_length": LENGTH, "gravity_sim": 0.0834, "torque_until": 0.5, **given_},
        ground=Ground(name=ground, spikes_per_row=2.0) if ground else None,
    )
    duration = 1.2 if flat.torque > 0.05 else 0.3
    planar = simulate_planar(flat, duration=duration, sample_interval=0.01, tolerance=1e-9)
    history = TorqueHistory.constant(
        HEDGEHOG.wheel(), flat.torque, 0.5, actuator=flat.actuator, wheel_speed_0=flat.wheel_speed_0
    )
    parameters = {} if ground else {"stiffness": flat.stiffness / 2, "damping": flat.damping / 2}
    space = simulate(
        trial(
            ground=ground or "spring-damper", ground_parameters=parameters, mu_s=flat.mu_s, torques=(history,),
            counterweight=flat.counterweight,
        ),
        duration=duration, sample_interval=0.01, tolerance=1e-9,
    )  # fmt: skip
    assert np.abs(space.position[:, 0] - planar.x).max() < 1e-6 * LENGTH
    assert np.abs(space.position[:, 2] - planar.y).max() < 1e-6 * LENGTH
    assert np.abs(space.turn - planar.theta).max() < 2e-6
    assert np.abs(np.abs(space.wheel_speed[:, 1]) - np.abs(planar.wheel_speed)).max() < 1e-3
    assert np.abs(space.position[:, 1]).max() < 1e-15  # it stays in the plane
    assert max(space.energy_residual, planar.energy_residual) < 1e-7
    if flat.torque > 0.05:
        assert abs(space.turn[-1]) > 0.1


def test_turned_by_a_right_angle_it_does_the_same_thing_sideways():
    """The Hedgehog is its own image: the torque about -x takes it along y as the one about +y along x."""
    ahead = simulate(
        trial(torques=(TorqueHistory.constant(HEDGEHOG.wheel(), 0.2, 0.5),)), duration=0.8, sample_interval=0.05
    )
    side = simulate(
        trial(torques=(TorqueHistory.constant(HEDGEHOG.wheel((1, 0, 0)), -0.2, 0.5),)),
        duration=0.8,
        sample_interval=0.05,
    )
    assert side.position[:, 1] == pytest.approx(ahead.position[:, 0], abs=1e-7)
    assert side.position[:, 2] == pytest.approx(ahead.position[:, 2], abs=1e-7)
    assert abs(ahead.position[-1, 0]) > 1e-3


# Stick and slip -------------------------------------------------------------------------------------------------------


def slope(degrees, gravity=0.0834, towards=0.0):
    a, b = math.radians(degrees), math.radians(towards)
    return (gravity * math.sin(a) * math.cos(b), gravity * math.sin(a) * math.sin(b), -gravity * math.cos(a))


@pytest.mark.parametrize(("degrees", "towards"), [(20.0, 0.0), (12.0, 33.0)])
def test_at_rest_on_a_slope_below_mu_s_it_does_not_creep(degrees, towards):
    """mu_s = 0.5 is 26.6 degrees: in 10,000 s it moves by nothing, along the slope and along a diagonal."""
    still = simulate(trial(gravity=slope(degrees, towards=towards)), duration=1e4, sample_interval=1e3)
    moved = np.abs(still.position - still.position[0]).max(axis=0)
    assert (moved[:2] == 0).all()
    assert moved[2] < 1e-15
    assert (still.sticking == 4).all()
    assert np.abs(still.angular_velocity).max() < 1e-12


def test_a_push_too_weak_to_loosen_it_leaves_it_where_it_was():
    """Rocked about on a slope, it keeps its place: the load-weighted mean of the tips does not drift with time."""
    state = standing(trial(gravity=slope(10.0)))
    rocked = simulate(
        trial(gravity=slope(10.0), mu_s=2.0, ground_parameters=DAMPED), duration=6.0, sample_interval=0.25,
        position=state[0], quaternion=state[1], velocity=(0.0, 0.0, -0.001),
    )  # fmt: skip
    assert (rocked.sticking[4:] == rocked.touching[4:]).all()
    assert (rocked.position[-1] == rocked.position[-3]).all()
    assert np.abs(rocked.position[-1] - rocked.position[0]).max() < 2e-7  # of 0.02 mm that it sinks


@pytest.mark.parametrize("towards", [0.0, 45.0, 70.0])
def test_steeper_than_mu_s_it_slides_down_at_g_sin_less_mu_d_g_cos(towards):
    """a = g (sin - mu_d cos) in whatever direction; mu_s = 0.2 is 11.3 degrees."""
    steep = trial(gravity=slope(15.0, towards=towards), mu_s=0.2, mu_d=0.1)
    with pytest.raises(ValueError, match=r"slides, mu_s = 0\.2"):
        standing(steep)
    start = standing(trial(gravity=slope(15.0, towards=towards), mu_s=0.9))
    slid = simulate(steep, duration=3.0, sample_interval=0.5, position=start[0], quaternion=start[1])
    distance = math.hypot(*(slid.position[-1] - slid.position[0])[:2])
    expected = 0.0834 * (math.sin(math.radians(15)) - 0.1 * math.cos(math.radians(15)))
    assert 2 * distance / 3.0**2 == pytest.approx(expected, rel=0.01)
    heading = math.degrees(math.atan2(*(slid.position[-1] - slid.position[0])[1::-1]))
    assert heading == pytest.approx(towards, abs=0.5)


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_thrown_along_the_ground_it_stops_after_v2_over_2_mu_d_g_and_stays(degrees):
    """Not toppling, for mu_d is below tan(pi / 8): it comes to rest sticking, to the bit."""
    a, speed = math.radians(degrees), 0.02
    start = standing(trial())
    thrown = simulate(
        trial(mu_s=0.2, mu_d=0.1, ground_parameters=DAMPED), duration=6.0, sample_interval=0.5, position=start[0],
        quaternion=start[1], velocity=(speed * math.cos(a), speed * math.sin(a), 0.0),
    )  # fmt: skip
    way = thrown.position[:, :2] - thrown.position[0, :2]
    assert math.hypot(*way[-1]) == pytest.approx(speed**2 / (2 * 0.1 * 0.0834), rel=0.02)
    assert math.degrees(math.atan2(way[-1][1], way[-1][0])) == pytest.approx(degrees, abs=0.5)
    assert thrown.sticking[-1] == 4
    assert (way[-1] == way[-3]).all()
    assert not thrown.velocity[-1].any()
    assert np.abs(thrown.angular_velocity[-1]).max() < 1e-15
    assert thrown.dissipated[-1] == pytest.approx(0.5 * 5.3 * speed**2, rel=1e-3)


def test_spun_about_the_vertical_it_stops_after_i_omega_over_mu_d_w_r():
    """Four tips on a circle of r = a / sqrt 2: the friction's moment is mu_d W r, all of it against the spin."""
    start, spin, r = standing(trial()), 0.3, 0.153 / math.sqrt(2)
    spun = simulate(
        trial(mu_s=0.2, mu_d=0.1), duration=6.0, sample_interval=0.01, position=start[0], quaternion=start[1],
        angular_velocity=(0.0, 0.0, spin),
    )  # fmt: skip
    moment = 0.1 * 5.3 * 0.0834 * r
    stopped = next(time for time, touching, sticking in spun.transitions if touching == sticking == 4)
    assert stopped == pytest.approx(0.06 * spin / moment, rel=1e-3)
    early = spun.time < 0.5 * stopped
    expected = spin - moment / 0.06 * spun.time[early]
    assert spun.angular_velocity[early, 2] == pytest.approx(expected, rel=2e-3)
    assert np.abs(spun.position[:, :2]).max() < 1e-9
    assert spun.quaternion[-1] == pytest.approx(spun.quaternion[-50], abs=1e-9)


# Any motion -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
def test_any_fall_keeps_its_books_and_ends(seed):
    """Random platform, law, gravity, friction, attitude, spin, torques: energy accounted for, no loss negative."""
    random = np.random.default_rng(seed)
    platform = find_platform(str(random.choice(["hedgehog", "cubli", "mascot"])))
    gravity = float(random.choice([1e-3, 0.0834, 1.0]))
    torques = tuple(
        TorqueHistory.constant(wheel, float(random.uniform(-1, 1)) * wheel.motor_torque, 0.2)
        for wheel in platform.wheels
        if random.random() < 0.6
    )
    speed = math.sqrt(0.2 * gravity)
    fallen = simulate(
        SpatialTrial(
            platform=platform, gravity=gravity, ground=(name := str(random.choice(list(GROUNDS)))),
            ground_parameters={"loss": 0.9, "loss_speed": 0.05} if GROUNDS[name].has_memory else {},
            mu_s=float(random.choice([0.0, 0.2, 0.5, 2.0])), torques=torques,
        ),
        duration=0.3, sample_interval=0.01, position=(0, 0, platform.reach),
        quaternion=tuple(from_turn(random.normal(size=3))),
        velocity=tuple(0.5 * speed * random.normal(size=3)), angular_velocity=tuple(10 * speed * random.normal(size=3)),
        tolerance=1e-7,
    )  # fmt: skip
    assert fallen.energy_residual < 1e-6
    scale = max(abs(fallen.dissipated).max(), 1e-6 * abs(fallen.energy).max())
    assert np.diff(fallen.dissipated).min() > -1e-5 * scale
    assert fallen.forced_steps == 0


def test_a_tip_that_creeps_along_in_turning_directions_does_not_stall_the_steps():
    """A Cubli on a corner: one tip sticks, its neighbour slips at 1e-6 m/s, and steps had fallen to 1e-7 s for good."""
    cubli = find_platform("cubli")
    thrown = simulate(
        SpatialTrial(
            platform=cubli, gravity=9.8, ground="power", mu_s=1.0,
            torques=(TorqueHistory.constant(cubli.wheel((0, 0, 1)), -0.07743513079767816, 0.4921865359721752),),
        ),
        duration=0.5, sample_interval=0.01, position=(0, 0, 0.1423439882811688),
        quaternion=(0.65724271, -0.04039608, 0.70501239, -0.2633585), velocity=(0.15099243, 0.76149057, 1.13421447),
        angular_velocity=(-2.1897656, -6.23460567, 8.11271502),
    )  # fmt: skip
    assert thrown.stalls > 0
    assert thrown.energy_residual < 1e-6


def test_a_brake_ends_with_its_wheel_at_rest():
    brake = TorqueHistory.constant(HEDGEHOG.wheel(), 2.0, actuator="brake", wheel_speed_0=100.0)
    run = simulate(trial(torques=(brake,), mu_s=3.0), duration=0.2, sample_interval=0.01)
    assert run.wheel_speed[0, 1] == pytest.approx(100.0)
    assert run.wheel_speed[-1, 1] == 0.0
    assert (np.diff(run.wheel_speed[:, 1]) <= 1e-12).all()


# Quaternions and refusals ---------------------------------------------------------------------------------------------


def test_quaternions_turn_as_matrices_do():
    a, b = from_turn((0.3, -0.2, 0.5)), from_turn((-1.0, 0.4, 0.2))
    assert to_matrix(multiply(a, b)) == pytest.approx(to_matrix(a) @ to_matrix(b), abs=1e-15)
    assert to_matrix(from_turn((0, math.pi / 2, 0))) @ (1.0, 0, 0) == pytest.approx([0, 0, -1], abs=1e-15)
    assert from_turn((0, 0, 0)).tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize(
    ("given_", "said"),
    [
        ({"gravity": -1.0}, "gravity"),
        ({"gravity": (0.0, 1.0)}, "gravity"),
        ({"mu_d": 0.9}, "mu_d"),
        ({"counterweight": 6.0}, "counterweight"),
        ({"gravity": (0.0, 0.1, -1.0), "counterweight": 1.0}, "wires"),
        ({"ground": "clay"}, "clay"),
        ({"ground_parameters": {"stiffnes": 1.0}}, "stiffnes"),
        ({"torques": (TorqueHistory.constant(Flywheel(inertia=1e-3, axis=(0.6, 0.8, 0.0)), 0.1),)}, "no wheel about"),
        ({"torques": (TorqueHistory.constant(HEDGEHOG.wheel(), 0.1),) * 2}, "two for one wheel"),
    ],
)
def test_a_trial_that_cannot_be_is_refused_by_name(given_, said):
    with pytest.raises(ValueError, match=said):
        trial(**given_)


@pytest.mark.parametrize(
    ("given_", "said"),
    [({"duration": 0.0}, "duration"), ({"times": [0.2, 0.1]}, "times"), ({"time_step": -1.0}, "time_step"),
     ({"quaternion": (1.0, 0, 0, 0)}, "position"), ({"position": HIGH, "quaternion": (2.0, 0, 0, 0)}, "length 2"),
     ({"position": HIGH, "velocity": (math.nan, 0, 0)}, "finite")],
)  # fmt: skip
def test_a_run_that_cannot_be_is_refused_by_name(given_, said):
    with pytest.raises(ValueError, match=said):
        simulate(trial(), **({"duration": 0.1} | given_))
