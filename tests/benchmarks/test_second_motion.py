"""The second simulator's tumbles: closed forms, energy, and the base model of `rigid`, which it shares no code with."""

import math

import numpy as np
import pytest
from import_graph import FOLDERS, loaded_with

from benchmarks.second.motion import COLUMNS, ROWS, STEP, move

BASE = {
    "mass": 5.3, "inertia": 0.06, "length": 0.2, "gravity_sim": 0.1, "gravity_local": 0.1, "torque_until": 10.0,
    "wheel_inertia": 1.2e-3, "wheel_sign": 1.0, "mu_s": 0.5, "mu_d": 0.25, "stiffness": 1.5e4, "damping": 60.0,
    "shear_stiffness": 1e6, "shear_damping": 1e3,
}  # fmt: skip
RIG = {"counterweight": 5.21, "gravity_sim": 0.0834, "gravity_local": 9.80665}
FLAT = 0.2 * math.cos(math.pi / 8)  # height of the centre where two tips touch [m]


def moved(duration, *, step=STEP, **numbers):
    """One motion as a dict of columns, with its times."""
    given = BASE | numbers
    assert set(given) <= set(COLUMNS)
    time, motions = move(np.array([[given.get(name, 0.0) for name in COLUMNS]]), duration, step=step)
    return {"time": time} | dict(zip(ROWS, motions[0].T, strict=True))


def test_the_simulator_imports_nothing_from_rigid_coupling_or_experiments():
    found = loaded_with("benchmarks.second.push", "benchmarks.second.tumble", "benchmarks.second.forms") & {*FOLDERS}
    assert not found, found


def test_free_fall_is_a_parabola_to_rounding_and_turns_at_one_speed():
    m = moved(0.5, free_start=1.0, y_0=1.0, vx_0=0.3, vy_0=0.2, omega_0=0.7, gravity_sim=1.5)
    t = m["time"]
    assert m["y"] == pytest.approx(1.0 + 0.2 * t - 0.75 * t**2, abs=1e-12)
    assert m["x"] == pytest.approx(0.3 * t, abs=1e-12)
    assert m["theta"] == pytest.approx(0.7 * t, abs=1e-12)


@pytest.mark.parametrize("step", [4e-4, 2e-4, 1e-4])
def test_without_damper_and_friction_energy_is_kept_to_the_square_of_the_step(step):
    """Bounces from 2 cm on single tips: a leapfrog keeps energy to (omega step)^2, omega^2 = K (1/m + d^2/J)."""
    m = moved(1.0, step=step, free_start=1.0, y_0=0.22, theta_0=0.1, damping=0.0, mu_s=0.0, mu_d=0.0, gravity_sim=1.0)
    hops = m["touching"] == 0  # while it touches, a row's depths are of half a step before
    assert (np.diff(hops.astype(int)) == 1).any()
    drift = np.abs(m["energy"] - m["energy"][0])[hops].max() / (5.3 * 1.0 * 0.02)
    assert drift < 1.5e4 * (1 / 5.3 + 0.0576**2 / 0.06) * step**2


def test_a_platform_at_rest_sinks_by_half_its_weight_over_the_stiffness_and_stays():
    m = moved(0.5, **RIG)
    weight = (5.3 + 5.21) * 0.0834
    assert FLAT - m["y"] == pytest.approx(np.full(len(m["y"]), 0.5 * weight / 1.5e4), rel=1e-6)
    assert np.abs(m["theta"]).max() < 1e-9


def test_a_set_down_platform_sinks_as_the_damped_oscillator_does():
    """(5.3 kg) z'' + 2 C z' + 2 K z = m g, z(0) = 0, z'(0) = v, until it comes back: closed form."""
    m = moved(0.03, free_start=1.0, y_0=FLAT, vy_0=-0.05, mu_s=0.0, mu_d=0.0, gravity_sim=1.0)
    a, w0, rest = 60.0 / 5.3, math.sqrt(2 * 1.5e4 / 5.3), 5.3 / (2 * 1.5e4)
    w, t = math.sqrt(w0**2 - a**2), m["time"]
    z = rest + np.exp(-a * t) * (-rest * np.cos(w * t) + (0.05 - a * rest) / w * np.sin(w * t))
    going = t < t[int(np.argmax(z))]
    assert (FLAT - m["y"])[going] == pytest.approx(z[going], abs=2e-7)


def test_a_platform_on_one_sticking_tip_falls_over_as_a_pendulum():
    """(J + m l^2) omega^2 / 2 + m g l cos gamma is kept: from gamma = 0.2 to 0.35 on a surface as good as rigid."""
    stiff = {"stiffness": 1e7, "damping": 2e4, "shear_stiffness": 1e7, "shear_damping": 1e4, "mu_s": 50.0, "mu_d": 25.0}
    start = {"theta_0": 0.2 - math.pi / 8, "y_0": 0.2 * math.cos(0.2) - 5.3 / 1e7}
    m = moved(1.5, step=1e-5, free_start=1.0, gravity_sim=1.0, **stiff, **start)
    gamma = m["theta"] + math.pi / 8
    before = (gamma > 0.22) & (gamma < 0.35)
    assert before.sum() > 50
    assert (m["sticking"][before] == 1).all()
    omega = np.sqrt(2 * 5.3 * 1.0 * 0.2 * (math.cos(0.2) - np.cos(gamma[before])) / (0.06 + 5.3 * 0.04))
    assert m["omega"][before] == pytest.approx(omega, rel=2e-3)


@pytest.mark.parametrize("more", [{}, {"leg_stiffness": 2e5, "leg_time": 2e-3}])
def test_on_a_slope_it_sticks_up_to_what_two_independent_rows_hold_and_slides_beyond(more):
    """Both rows hold half of the force each; the upper one has the load N (1 - tan(a) cot(pi / 8)) / 2 and slips first.
    Up to there nothing moves. Beyond what the lower one holds beside it (tan(a) = (mu_s + mu_d) / (2 - cot(pi / 8)
    (mu_s - mu_d))) all slides. Between the two it depends on how the load was put on."""
    cot = 1.0 / math.tan(math.pi / 8)
    first, edge = 0.3 / (1.0 + 0.3 * cot), 0.45 / (2.0 - 0.15 * cot)
    below, above = (
        moved(0.5, slope=math.atan(lean), mu_s=0.3, mu_d=0.15, gravity_sim=1.0, **more)
        for lean in (0.98 * first, 1.03 * edge)
    )
    assert np.abs(below["x"]).max() < 1e-5
    lean = math.atan(1.03 * edge)
    slides = -(math.sin(lean) - 0.15 * math.cos(lean))
    late = above["time"] > 0.1
    assert np.polyfit(above["time"][late], above["vx"][late], 1)[0] == pytest.approx(slides, rel=0.01)


def test_the_least_torque_that_tips_it_is_weight_times_lever():
    """W l sin(pi / 8), to first order in W / (K l)."""
    least = 5.3 * 0.1 * 0.2 * math.sin(math.pi / 8)
    stiff = {"stiffness": 1e5, "damping": 500.0, "mu_s": 5.0, "mu_d": 2.5}
    assert np.abs(moved(3.0, torque=0.98 * least, **stiff)["theta"]).max() < 1e-3
    assert np.abs(moved(3.0, torque=1.03 * least, **stiff)["theta"]).max() > 0.02


def test_a_compliant_leg_gives_way_by_its_load_over_its_stiffness():
    """Static: half the weight on each of two legs, its part cos(pi/8) along the leg, without friction."""
    m = moved(0.2, leg_stiffness=5e3, leg_time=2e-3, mu_s=0.0, mu_d=0.0, shear_stiffness=1e-3, shear_damping=0.0)
    half = 0.5 * 5.3 * 0.1
    shorter = half * math.cos(math.pi / 8) / 5e3
    expected = (0.2 - shorter) * math.cos(math.pi / 8) - half / 1.5e4
    assert m["y"][-1] == pytest.approx(expected, abs=1e-7)


def test_the_wheel_takes_up_what_the_torque_gives_and_a_brake_ends_when_it_stands():
    motor = moved(0.2, torque=0.22, **RIG)
    assert motor["wheel"] == pytest.approx(0.22 / 1.2e-3 * motor["time"], rel=1e-9, abs=1e-9)
    brake = moved(0.2, torque=6.0, wheel_sign=-1.0, wheel_speed_0=300.0, **RIG)
    assert brake["wheel"][-1] == 0.0
    assert brake["omega"][-1] > 0.5


@pytest.mark.parametrize(
    "numbers",
    [{"torque": 0.125}, {"torque": 0.22, "mu_s": 0.25, "mu_d": 0.125}, {"torque": 0.22},
     {"torque": 0.22, "counterweight": 0.0, "gravity_sim": 0.05, "gravity_local": 0.05}],
)  # fmt: skip
def test_with_stiff_legs_it_moves_as_the_base_model_of_rigid(numbers):
    """Two codes written apart agree to a hundredth of the camera's noise (0.5 mm, 3 mrad)."""
    from rigid import Trial, simulate

    mine = moved(1.2, **(RIG | numbers))
    given = {"counterweight": 5.21, "gravity_sim": 0.0834, "mu_s": 0.5, "mu_d": 0.25} | numbers
    given.pop("gravity_local", None)
    exact = simulate(
        Trial(mass=5.3, inertia=0.06, actuator="motor", **given),
        duration=1.2,
        times=np.minimum(mine["time"], 1.2)[::50],
    )
    shown = {name: mine[name][::50][: len(exact.time)] for name in ("x", "y", "theta")}
    assert shown["x"] == pytest.approx(exact.x, abs=5e-6)
    assert shown["y"] == pytest.approx(exact.y, abs=5e-6)
    assert shown["theta"] == pytest.approx(exact.theta, abs=5e-4)


def test_a_table_of_another_shape_is_refused():
    with pytest.raises(ValueError, match="lane_count"):
        move(np.zeros((1, 3)), 0.1)
