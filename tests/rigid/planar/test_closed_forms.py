"""The closed forms of docs/planar.md, one test each. All of them on the located integrator."""

import math

import numpy as np
import pytest
from rigid_trials import INERTIA, LENGTH, MASS, effect, free, in_rig

from rigid import simulate

G0 = math.pi / 8
H_ARM, D_ARM = LENGTH * math.cos(G0), LENGTH * math.sin(G0)
BOTH = pytest.mark.parametrize("place", [free, in_rig], ids=["free", "rig"])


@BOTH
def test_on_two_rows_the_static_sinkage_is_w_over_2k(place):
    for stiffness in (900.0, 1.5e4):
        trial = place(stiffness=stiffness)
        start = simulate(trial, duration=1e-3)
        sinkage = trial.weight / (2 * stiffness)
        assert start.y[0] == pytest.approx(H_ARM - sinkage, abs=1e-16)
        assert (start.x[0], start.theta[0]) == (0.0, 0.0)
        # Energy stored: two springs, each K (W / 2K)^2 / 2.
        assert start.stored_energy[0] == pytest.approx(stiffness * sinkage**2, rel=1e-12)


@BOTH
def test_without_torque_it_rests_for_ever_to_the_bit(place):
    trial = place()
    rest = simulate(trial, duration=1e6, sample_interval=1e5)
    for channel in ("x", "y", "theta", "vx", "vy", "omega", "dissipated", "torque_work"):
        values = getattr(rest, channel)
        assert (values == values[0]).all()
    assert rest.notes["steps"] == 1 and [name for _, name, _ in rest.transitions] == ["stand"]


def test_on_a_slope_below_mu_s_it_rests_for_ever_and_above_it_cannot_stand():
    # atan(mu_s) bounds the slope (below the tipping angle, 22.5 degrees).
    steep = math.atan(0.3)
    held = simulate(free(mu_s=0.3, effects=(effect("slope", angle=0.999 * steep),)), duration=1e6, sample_interval=1e5)
    assert (held.x == 0.0).all() and (held.theta == held.theta[0]).all() and (held.vx == 0.0).all()
    with pytest.raises(ValueError, match="slides before the torque starts"):
        simulate(free(mu_s=0.3, effects=(effect("slope", angle=1.001 * steep),)), duration=1.0)
    with pytest.raises(ValueError, match="tips over before the torque starts"):
        simulate(free(mu_s=1.0, effects=(effect("slope", angle=1.01 * math.pi / 8),)), duration=1.0)


@BOTH
def test_the_least_torque_that_tips_is_w_l_sin_22_5_degrees(place):
    # To first order in W / (K l), and applied at once: its jerk rocks the platform by W / (K l) or so, with an energy
    # of W^2 / K, which must stay below the barrier left at 99 %, 2e-5 W l. So a hard ground, W / (K l) = 4e-6.
    least = place().weight * D_ARM

    def angle_after(share):
        trial = place(share * least, mu_s=2.0, stiffness=1e6, damping=500.0)
        return simulate(trial, duration=4.0, sample_interval=0.1, tolerance=1e-6).theta

    assert abs(angle_after(0.99)[-1]) < 1e-4
    assert angle_after(1.01)[-1] > 0.008


@BOTH
@pytest.mark.parametrize(("mu_d", "angles"), [(0.125, (82.9, 76.1)), (0.25, (76.0, 63.6)), (0.5, (63.4, 45.2))])
def test_the_sliding_launch_angle_under_a_strong_torque(place, mu_d, angles):
    # tan(angle) = m / (M_y mu_d): the weight counts for W / N of it, here a 100th.
    trial = place(100.0, mu_s=2 * mu_d, mu_d=mu_d)
    run = simulate(trial, duration=0.1)
    inertia_y = MASS + trial.counterweight
    expected = math.atan(MASS / (inertia_y * mu_d))
    assert math.degrees(expected) == pytest.approx(angles[place is in_rig], abs=0.06)
    assert math.degrees(run.trajectory_angle) == pytest.approx(math.degrees(expected), abs=0.25)
    assert run.transition_angle("slip") == 0.0


def brake(place, momentum, *, torque=600.0, damping=1e6, stiffness=1.5e4, mu=3.0, mu_d=None):
    return place(
        torque, actuator="brake", wheel_speed_0=momentum / 1.2e-3, mu_s=mu, mu_d=mu if mu_d is None else mu_d,
        damping=damping, stiffness=stiffness,
    )  # fmt: skip


def after(run, time):
    k = int(np.searchsorted(run.time, time))
    return run.omega[k], math.hypot(run.vx[k], run.vy[k]), math.atan2(run.vy[k], run.vx[k])


def test_an_impulsive_brake_that_sticks_turns_the_free_platform_about_its_tip():
    # omega = H / (J + m l^2), v = l omega, at 22.5 degrees; holds for mu >= cot(pi/8) = 2.41.
    momentum = 0.36
    run = simulate(brake(free, momentum), duration=0.01, sample_interval=1e-4)
    omega, speed, angle = after(run, momentum / 600 + 1e-3)
    assert omega == pytest.approx(momentum / (INERTIA + MASS * LENGTH**2), rel=2e-3)
    assert speed == pytest.approx(LENGTH * omega, rel=2e-3)
    assert math.degrees(angle) == pytest.approx(22.5, abs=0.1)


def test_an_impulsive_brake_in_the_rig_lifts_the_counterweight_too():
    # The same with the energies of the rig: J + m l^2 + m_b l^2 sin^2(pi/8); sticks from mu = 1.22.
    momentum = 0.36
    trial = brake(in_rig, momentum)
    run = simulate(trial, duration=0.01, sample_interval=1e-4)
    omega, _, angle = after(run, momentum / 600 + 1e-3)
    inertia = INERTIA + MASS * LENGTH**2 + trial.counterweight * D_ARM**2
    assert omega == pytest.approx(momentum / inertia, rel=2e-3)
    assert math.degrees(angle) == pytest.approx(22.5, abs=0.1)


@pytest.mark.parametrize(("place", "least"), [(free, 2.41), (in_rig, 1.22)], ids=["free", "rig"])
def test_the_impulsive_brake_sticks_from_the_friction_that_planar_model_md_gives(place, least):
    # Horizontal over vertical impulse while it sticks: m / (M_y tan(pi/8)).
    trial = brake(place, 0.36)
    assert MASS / ((MASS + trial.counterweight) * math.tan(G0)) == pytest.approx(least, abs=0.005)

    def slid(mu):
        run = simulate(brake(place, 0.36, mu=mu), duration=0.004, sample_interval=1e-3)
        k = len(run.time) - 1
        return run.vx[k] - run.omega[k] * LENGTH * math.cos(run.theta[k] - G0) < -1e-3

    assert slid(0.97 * least) and not slid(1.03 * least)


@pytest.mark.parametrize("mu_d", [0.125, 0.25, 0.5])
def test_an_impulsive_brake_that_slides(mu_d):
    # omega = H / [J + m l^2 sin g0 (sin g0 + mu cos g0)], up along atan(1 / mu).
    momentum = 0.36
    run = simulate(brake(free, momentum, mu=2 * mu_d, mu_d=mu_d), duration=0.01, sample_interval=1e-4)
    omega, _, angle = after(run, momentum / 600 + 5e-4)
    s, c = math.sin(G0), math.cos(G0)
    assert omega == pytest.approx(momentum / (INERTIA + MASS * LENGTH**2 * s * (s + mu_d * c)), rel=4e-3)
    assert math.degrees(angle) == pytest.approx(math.degrees(math.atan(1 / mu_d)), abs=0.2)


@pytest.mark.parametrize(("ratio", "steep"), [(0.0, 43.6), (0.1, 40.8)])
def test_a_springy_contact_gives_its_energy_back_and_launches_steeper(ratio, steep):
    # Sticking, the impulse at the spring (1 + e) times the plastic one, e = exp(-ratio pi / 2) with a damper that acts
    # on the way in only; with h, d the tip's arms: tan = (1 + e) d w_p / (h [w_0 - (1 + e)(w_0 - w_p)]),
    # w_0 = H / (J + m h^2), w_p = H / (J + m l^2). docs/planar.md: 41 degrees at a damping ratio of 0.1.
    momentum, stiffness = 0.36, 1e7
    at_tip = 1 / (1 / MASS + D_ARM**2 / (INERTIA + MASS * H_ARM**2))
    damping = 2 * ratio * math.sqrt(stiffness * at_tip)
    run = simulate(
        brake(free, momentum, torque=6e4, damping=damping, stiffness=stiffness, mu=1e3), duration=0.01,
        sample_interval=1e-4,
    )  # fmt: skip
    _, _, angle = after(run, run.transition_time("hop") + 1e-4)
    e = math.exp(-0.5 * math.pi * ratio)
    w0, wp = momentum / (INERTIA + MASS * H_ARM**2), momentum / (INERTIA + MASS * LENGTH**2)
    expected = math.atan2((1 + e) * D_ARM * wp, H_ARM * (w0 - (1 + e) * (w0 - wp)))
    assert math.degrees(expected) == pytest.approx(steep, abs=0.05)
    assert math.degrees(angle) == pytest.approx(math.degrees(expected), abs=0.3)


@BOTH
def test_without_damping_and_friction_the_energy_balances_to_the_tolerance(place):
    for tolerance, most in ((1e-6, 1e-6), (1e-9, 1e-9), (1e-11, 2e-11)):
        run = simulate(place(0.22, mu_s=0.0, damping=0.0), duration=1.0, tolerance=tolerance)
        assert (run.dissipated == 0.0).all()
        assert run.energy_residual < most


@BOTH
def test_a_hop_is_a_parabola_at_constant_spin(place):
    trial = place(6.0, actuator="brake", wheel_speed_0=300.0, mu_s=0.25)
    run = simulate(trial, duration=0.6)
    begin = run.transition_time("hop")
    hop = (run.state == 3) & (run.time > begin)
    assert hop.sum() > 200
    t = run.time[hop] - run.time[hop][0]
    x, y, vx, vy = (getattr(run, name)[hop] for name in ("x", "y", "vx", "vy"))
    assert np.allclose(y, y[0] + vy[0] * t - 0.5 * trial.gravity_sim * t**2, atol=1e-12)
    assert np.allclose(x, x[0] + vx[0] * t, atol=1e-12)
    assert np.ptp(run.omega[hop]) < 1e-14 and np.ptp(run.wheel_speed[hop]) == 0.0


def test_the_wheel_takes_the_angular_momentum_that_it_gives():
    # J_w |d omega_w/dt| = tau while a spike touches, 0 in a hop; and the torque's work is the integral of tau omega.
    trial = in_rig(0.22)
    run = simulate(trial, duration=1.0)
    begin = run.transition_time("hop")
    k = int(np.searchsorted(run.time, begin))
    assert run.wheel_speed[k] == pytest.approx(0.22 * begin / 1.2e-3, rel=1e-12)
    assert run.wheel_speed[-1] == run.wheel_speed[k]
    assert run.torque_work[-1] == pytest.approx(0.22 * np.interp(begin, run.time, run.theta), rel=1e-5)


@BOTH
def test_the_forces_that_move_the_centre_also_turn_the_platform(place):
    # Newton and Euler over one touching spike: F = m ax, N = M_y (ay + g_sim), J alpha = tau + N d - F h; and the
    # angular momentum that the torque and these moments give is J omega, summed over the motion.
    trial = place(0.3, mu_s=0.7)
    run = simulate(trial, duration=1.0, sample_interval=5e-4, tolerance=1e-10)
    angle = run.theta + G0 - math.pi / 4  # spike 7
    h, d = LENGTH * np.cos(angle), LENGTH * np.sin(angle)
    force, load = MASS * run.ax, (MASS + trial.counterweight) * (run.ay + trial.gravity_sim)
    alone = (run.state != 3) & (run.time > 0.05)  # the other row has left by then
    moment = 0.3 + load * d - force * h
    assert alone.sum() > 500
    assert np.allclose(INERTIA * run.alpha[alone], moment[alone], atol=1e-9)
    total = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(run.time) * (moment[1:] + moment[:-1]))])
    first, last = np.flatnonzero(alone)[[0, -1]]
    gained = INERTIA * (run.omega[last] - run.omega[first])
    assert gained == pytest.approx(total[last] - total[first], rel=2e-4)


def test_the_energies_are_those_of_the_pose():
    # E by hand at every sample: platform, counterweight, weight, springs of whatever spikes are in.
    trial = in_rig(0.3, mu_s=0.3)
    run = simulate(trial, duration=1.5, sample_interval=0.01)
    kinetic = 0.5 * (MASS * (run.vx**2 + run.vy**2) + trial.counterweight * run.vy**2 + INERTIA * run.omega**2)
    stored = np.zeros(len(run.time))
    for n in range(8):
        depth = LENGTH * np.cos(run.theta + G0 + n * math.pi / 4) - run.y
        stored += 0.5 * trial.stiffness * np.clip(depth, 0, None) ** 2
    assert np.allclose(run.kinetic_energy, kinetic, rtol=1e-12)
    assert np.allclose(run.potential_energy, trial.weight * run.y, rtol=1e-12)
    assert np.allclose(run.stored_energy, stored, rtol=1e-9, atol=1e-15)
