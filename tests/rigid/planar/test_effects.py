"""Each effect beyond the paper's model against a closed form of its own."""

import math

import numpy as np
import pytest
from rigid_trials import INERTIA, LENGTH, MASS, G, effect, free, in_rig

from rigid import simulate
from rigid.planar.dynamics import Modes, System
from rigid.planar.located import integrate

G0 = math.pi / 8


def thrown(trial, z, duration, **options):
    """Accepted steps (time, z) of a platform let go in the air at `z` = x, y, theta, vx, vy, omega."""
    modes, rows = Modes(slip=[0] * 8, top=[0.0] * 8), []
    modes.torque_over = True
    integrate(
        System(trial), duration=duration, tolerance=1e-10, start=([*z, 0.0, 0.0, 0.0], modes),
        on_step=lambda t0, t1, z1, at, kind: rows.append((t1, *z1)), **options,
    )  # fmt: skip
    return np.array(rows)


def test_pendulum_in_the_air_the_platform_swings_at_sqrt_of_m_b_g_over_m_length():
    trial = in_rig(effects=(effect("pendulum", length=2.2),))
    rows = thrown(trial, [0.01, 0.9, 0.0, 0.0, 0.0, 0.0], 1.2)
    rate = math.sqrt(trial.counterweight * G / (MASS * 2.2))
    assert rows[:, 1] == pytest.approx(0.01 * np.cos(rate * rows[:, 0]), abs=1e-10)


def test_pendulum_on_its_arc_the_wires_carry_less():
    # On the arc the wires' upward pull is m_b g cos(angle): at rest aside, y'' = -g_sim - m_b g (1 - cos) / (m + m_b).
    length, aside, rise = 2.2, 0.3, 0.4
    trial = in_rig(effects=(effect("pendulum", length=length, arc=1.0),))
    rows = thrown(trial, [aside, System(trial).s.stance + rise, 0.0, 0.0, 0.0, 0.0], 1e-3)
    above = length - rise
    reach = math.hypot(above, aside)
    pull = trial.counterweight * G
    x_rate, y_rate = rows[-1, 4] / 1e-3, rows[-1, 5] / 1e-3
    assert x_rate == pytest.approx(-pull * aside / reach / MASS, rel=1e-5)
    total = MASS + trial.counterweight
    assert y_rate == pytest.approx(-0.0085 * G - pull * (1 - above / reach) / total, rel=1e-5)


def test_slope_gravity_leans_and_so_do_the_wires():
    a = 0.2
    rows = thrown(free(effects=(effect("slope", angle=a),)), [0.0, 0.9, 0.0, 0.0, 0.0, 0.0], 0.8)
    fall = 0.5 * 0.0085 * G * rows[:, 0] ** 2
    assert rows[:, 1] == pytest.approx(-fall * math.sin(a), abs=1e-13)
    assert rows[:, 2] == pytest.approx(0.9 - fall * math.cos(a), abs=1e-13)
    # In the rig the pair falls along the vertical at g_sim: along and normal to the surface as without.
    rig = thrown(in_rig(effects=(effect("slope", angle=a),)), [0.0, 0.9, 0.0, 0.0, 0.0, 0.0], 0.8)
    assert rig[-1, 1:3] == pytest.approx(rows[-1, 1:3], abs=1e-12)


def test_com_offset_in_free_flight_the_centre_of_mass_flies_a_parabola():
    # J is about the shaft: about the centre of mass it is J - m e^2, and omega is constant.
    e = np.array([0.004, -0.003])
    trial = free(effects=(effect("com-offset", x=e[0], y=e[1]),))
    rows = thrown(trial, [0.0, 0.9, 0.3, 0.05, 0.02, 1.5], 0.5)
    t, theta = rows[:, 0], rows[:, 3]
    x = rows[:, 1] + e[0] * np.cos(theta) + e[1] * np.sin(theta)
    y = rows[:, 2] - e[0] * np.sin(theta) + e[1] * np.cos(theta)
    assert np.ptp(rows[:, 6]) < 1e-9
    # The velocity of the centre of mass at the start: that of the shaft and omega (e_y, -e_x).
    c, s = math.cos(0.3), math.sin(0.3)
    vx, vy = 0.05 + 1.5 * (e[1] * c - e[0] * s), 0.02 - 1.5 * (e[0] * c + e[1] * s)
    x0, y0 = e[0] * c + e[1] * s, 0.9 - e[0] * s + e[1] * c
    assert x == pytest.approx(x0 + vx * t, abs=1e-10)
    assert y == pytest.approx(y0 + vy * t - 0.5 * trial.gravity_sim * t**2, abs=1e-10)


def test_com_offset_the_feet_carry_what_statics_says():
    # In the rig W acts at the shaft and m g e about it: N_7 - N_0 = m g e / (l sin(pi/8)).
    e = 5e-4
    trial = in_rig(effects=(effect("com-offset", x=e),))
    start = simulate(trial, duration=1e-3)
    depths = [LENGTH * math.cos(start.theta[0] + sign * G0) - start.y[0] for sign in (1, -1)]
    loads = [trial.stiffness * depth for depth in depths]
    assert sum(loads) == pytest.approx(trial.weight, rel=1e-9)
    assert loads[1] - loads[0] == pytest.approx(MASS * G * e / (LENGTH * math.sin(G0)), rel=2e-3)
    assert start.theta[0] > 0 and (start.theta == start.theta[0]).all()


def test_pulley_inertia_slows_the_fall():
    trial = in_rig(effects=(effect("pulley-inertia", mass=2.0),))
    rows = thrown(trial, [0.0, 0.9, 0.0, 0.0, 0.0, 0.0], 0.8)
    a = trial.weight / (MASS + trial.counterweight + 2.0)
    assert rows[:, 2] == pytest.approx(0.9 - 0.5 * a * rows[:, 0] ** 2, abs=1e-12)


def test_umbilical_in_the_air_is_a_damped_torsion_spring():
    k, c = 0.4, 0.02
    trial = free(effects=(effect("umbilical", stiffness=k, drag=c),))
    rows = thrown(trial, [0.0, 2.0, 0.2, 0.0, 0.0, 0.0], 3.0)
    decay, rate = c / (2 * INERTIA), math.sqrt(k / INERTIA - (c / (2 * INERTIA)) ** 2)
    t = rows[:, 0]
    expected = 0.2 * np.exp(-decay * t) * (np.cos(rate * t) + decay / rate * np.sin(rate * t))
    assert rows[:, 3] == pytest.approx(expected, abs=1e-9)


def test_torque_fade_the_wheel_nears_its_no_load_speed():
    # J_w w' = tau (1 - a w): w = (1 - exp(-a tau t / J_w)) / a while the platform is held at rest by its bearing.
    a, tau = 5e-3, 0.05
    trial = in_rig(tau, effects=(effect("torque-fade", speed_loss=a), effect("bearing-drag", torque=0.06)))
    run = simulate(trial, duration=4.0, sample_interval=0.1)
    assert run.wheel_speed == pytest.approx((1 - np.exp(-a * tau * run.time / 1.2e-3)) / a, abs=1e-4)
    assert np.abs(run.theta).max() < 1e-9
    slower = in_rig(tau, effects=(effect("torque-fade", time_loss=0.5), effect("bearing-drag", torque=0.06)))
    run = simulate(slower, duration=4.0, sample_interval=0.1)
    t = np.minimum(run.time, 2.0)
    assert run.wheel_speed == pytest.approx(tau * (t - 0.25 * t**2) / 1.2e-3, abs=1e-4)


@pytest.mark.parametrize("id", ["wheel-vibration", "rate-friction"])
def test_friction_while_sliding_is_the_law_s(id):
    own = {"wheel-vibration": {"reduction": 0.6, "speed": 80.0}, "rate-friction": {"change": 0.8, "speed": 0.1}}[id]
    trial = in_rig(0.3, mu_s=0.5, effects=(effect(id, **own),))
    run = simulate(trial, duration=0.5, tolerance=1e-9)
    sliding = (run.state == 2) & (run.time > 0.05)
    assert sliding.sum() > 200
    load = (MASS + trial.counterweight) * (run.ay + trial.gravity_sim)
    ratio = (MASS * np.abs(run.ax) / load)[sliding]
    slip = (run.vx - run.omega * LENGTH * np.cos(run.theta - G0))[sliding]
    wheel = run.wheel_speed[sliding]
    if id == "wheel-vibration":
        expected = 0.25 * (1 - 0.6 * wheel**2 / (wheel**2 + 80.0**2))
    else:
        expected = 0.25 * (1 + 0.8 * np.abs(slip) / (np.abs(slip) + 0.1))
    assert ratio == pytest.approx(expected, rel=1e-6)


def test_tip_radius_a_ball_that_sticks_rolls():
    r = 0.01
    run = simulate(in_rig(0.125, mu_s=3.0, effects=(effect("tip-radius", radius=r),)), duration=1.0, tolerance=1e-9)
    pivot = run.state == 1
    assert pivot.sum() > 500
    rolled = run.x - (LENGTH - r) * np.sin(run.theta - G0) - r * run.theta
    assert np.ptp(rolled[pivot][3:]) < 1e-12
    sinkage = run.trial.weight / (2 * run.trial.stiffness)
    assert run.y[0] == pytest.approx((LENGTH - r) * math.cos(G0) + r - sinkage, abs=1e-15)


def test_inertial_drag_is_b_v_squared_at_the_moment_of_touching():
    b, v = 50.0, 0.3
    system = System(free(damping=0.0, mu_s=0.0, effects=(effect("inertial-drag", normal=b),)))
    z = [0.0, LENGTH * math.cos(G0), 0.0, 0.0, -v, 0.0, 0.0, 0.0, 0.0]
    system.derivative(0.0, z, Modes(touching=[0, 7], slip=[1] * 8, top=[0.0] * 8))
    assert system.acceleration[1] == pytest.approx(2 * b * v * v / MASS - system.trial.gravity_sim, rel=1e-12)
    z[4] = v  # on the way out, nothing
    system.derivative(0.0, z, Modes(touching=[0, 7], slip=[1] * 8, top=[0.0] * 8))
    assert system.acceleration[1] == pytest.approx(-system.trial.gravity_sim, rel=1e-12)


def test_depth_hardening_changes_the_sinkage():
    # W / 2 = K z (z / z_0)^(n - 1).
    trial = in_rig(stiffness=900.0, effects=(effect("depth-hardening", exponent=1.5, reference=1e-3),))
    start = simulate(trial, duration=1e-3)
    z = LENGTH * math.cos(G0) - start.y[0]
    assert 900.0 * z * (z / 1e-3) ** 0.5 == pytest.approx(0.5 * trial.weight, rel=1e-9)


@pytest.mark.parametrize("bend", [0.0, 1.5])
def test_plastic_sinkage_leaves_a_crater_and_takes_its_share_of_the_work(bend):
    # A drop on two rows without any damper: the crater keeps f of the depth, the ground f of the work, so the platform
    # leaves with sqrt(1 - f) of its speed, but for the weight. Where the way back goes with the power 1 + a of what is
    # left of the depth, it gives back 2 / (2 + a) of that.
    f, v = 0.4, 0.3
    kept = (1 - f) * 2 / (2 + bend * (1 - math.exp(-20 * f)))
    trial = free(damping=0.0, mu_s=0.0, level=1e-5, effects=(effect("plastic-sinkage", share=f, bend=bend),))
    rows = thrown(trial, [0.0, LENGTH * math.cos(G0) + 1e-4, 0.0, 0.0, -v, 0.0], 0.2)
    deepest = LENGTH * math.cos(G0) - rows[:, 2].min()
    assert deepest == pytest.approx(v * math.sqrt(MASS / (2 * trial.stiffness)), rel=1e-3)
    assert rows[-1, 5] == pytest.approx(v * math.sqrt(kept), rel=1e-3)
    assert rows[-1, 9] == pytest.approx((1 - kept) * 0.5 * MASS * v**2, rel=2e-3)
    assert rows[-1, 9] == pytest.approx(0.5 * MASS * (v**2 - rows[-1, 5] ** 2), rel=2e-3)


def test_a_tip_in_an_open_crater_touches_without_a_load_until_it_is_above_the_undisturbed_surface():
    # The same drop gives back the same work; but the tip still touches on the way from f z to 0, at its last speed.
    f, v = 0.4, 0.3
    contact = {}
    for hollow in (0.0, 1.0):
        trial = free(damping=0.0, mu_s=0.0, level=1e-5, effects=(effect("plastic-sinkage", share=f, open=hollow),))
        rows = thrown(trial, [0.0, LENGTH * math.cos(G0) + 1e-4, 0.0, 0.0, -v, 0.0], 0.2)
        depth = LENGTH * math.cos(G0) - rows[:, 2]
        assert rows[-1, 5] == pytest.approx(v * math.sqrt(1 - f), rel=1e-3)
        assert rows[-1, 9] == pytest.approx(f * 0.5 * MASS * v**2, rel=2e-3)
        contact[hollow] = depth.max()
    assert contact[1.0] == pytest.approx(contact[0.0], rel=1e-6)
    system = System(free(effects=(effect("plastic-sinkage", share=f, open=1.0),)))
    assert system.crater == 0.0
    elastic, lost, *_ = system.model.contact(system.p, system.s, system.q, 2e-4, 0.1, 0.0, 1e-3, 1e-3)
    assert elastic == 0.0 and lost == pytest.approx(0.1 * system.trial.damping)


def test_adhesion_by_speed_takes_its_force_times_the_way_out_from_a_fast_rebound():
    # Far above the speed that mobilises it, A acts on the whole way out: the work A z_max a row is lost.
    A, v = 2.0, 0.3
    trial = free(damping=0.0, mu_s=0.0, level=1e-5, effects=(effect("adhesion", force=A, reach=1e-6, speed=1e-4),))
    rows = thrown(trial, [0.0, LENGTH * math.cos(G0) + 1e-4, 0.0, 0.0, -v, 0.0], 0.2)
    lost = 2 * A * (LENGTH * math.cos(G0) - rows[:, 2].min())
    assert rows[-1, 9] == pytest.approx(lost, rel=2e-3)
    assert 0.5 * MASS * (v**2 - rows[-1, 5] ** 2) == pytest.approx(lost, rel=1e-2)


def test_adhesion_takes_force_times_the_retreat_from_a_rebound():
    # Mobilised over far less than the retreat: the work A (z_max - reach) a row is lost when the tips break free.
    A, v, reach = 2.0, 0.3, 1e-5
    trial = free(damping=0.0, mu_s=0.0, level=1e-5, effects=(effect("adhesion", force=A, reach=reach),))
    rows = thrown(trial, [0.0, LENGTH * math.cos(G0) + 1e-4, 0.0, 0.0, -v, 0.0], 0.2)
    deepest = LENGTH * math.cos(G0) - rows[:, 2].min()
    lost = 2 * A * (deepest - reach)
    assert rows[-1, 9] == pytest.approx(lost, rel=1e-4)
    assert 0.5 * MASS * (v**2 - rows[-1, 5] ** 2) == pytest.approx(lost, rel=1e-2)
