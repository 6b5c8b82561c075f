"""What the paper's text states in numbers, with our J = 0.06, J_w = 1.2e-3, K = 1.5e4, C = 60 (docs/planar.md)."""

import math

import pytest
from rigid_trials import LENGTH, MASS, G, in_rig

from rigid import Effect, simulate
from rigid.planar.dynamics import Modes, System

STEEL, BRICK = 0.25, 0.5
LEVELS = pytest.mark.parametrize("level", [0.0085, 0.015])


def tumble(torque, mu_s, level=0.0085, duration=2.0, mu_d=None, rise=None):
    spinning = {"actuator": "brake", "wheel_speed_0": 300.0} if torque == 6.0 else {}
    if rise is not None:
        spinning["effects"] = (Effect(id="torque-rise", parameters={"rise": rise}),)
    trial = in_rig(torque, mu_s=mu_s, mu_d=mu_d, level=level, **spinning)
    return simulate(trial, duration=duration, sample_interval=5e-3)


def degrees(run):
    return math.degrees(run.trajectory_angle)


@LEVELS
def test_tumbles_at_low_torque_on_brick_start_at_about_22_5_degrees(level):
    # 22.5 degrees is the tangent of the pivot's circle at the start; the chord to the first point 10 mm away is
    # 10 mm / 2 l = 1.43 degrees lower.
    run = tumble(0.125, BRICK, level)
    assert degrees(run) == pytest.approx(22.5 - math.degrees(0.01 / (2 * LENGTH)), abs=0.5)
    assert run.transition_angle("pivot") < math.radians(0.2)


@LEVELS
@pytest.mark.parametrize("mu_s", [STEEL, BRICK])
def test_the_angle_grows_with_torque(mu_s, level):
    angles = [degrees(tumble(torque, mu_s, level)) for torque in (0.125, 0.22, 6.0)]
    assert angles[0] < angles[1] < angles[2]


def sliding(mu_d):
    """Launch angle [degrees] of one that slides throughout, under a strong torque: tan = m / ((m + m_b) mu_d)."""
    counterweight = in_rig(6.0, mu_s=STEEL).counterweight
    return math.degrees(math.atan2(MASS, (MASS + counterweight) * mu_d))


def test_at_6_nm_on_steel_the_angle_is_the_closed_forms_76_degrees_and_not_the_papers_60():
    # tan = m / (M_y mu_d) with mu_d = mu_s / 2, to which the paper fixed it. The weight is small beside the load; it
    # and the turn over the first 10 mm take half a degree.
    # "To a maximum of about 60 degrees" is said of steel at 0.0085 g.
    angle = degrees(tumble(6.0, STEEL))
    assert sliding(0.5 * STEEL) == pytest.approx(76.1, abs=0.05)
    assert angle == pytest.approx(sliding(0.5 * STEEL), abs=1)
    assert not 55 < angle < 65


def test_no_friction_within_the_papers_ten_percent_brings_steel_to_60_degrees_within_five():
    # By the closed form that takes mu_d of 0.235 to 0.36, nearly twice the 0.1125 to 0.1375 of the band.
    assert min(sliding(share * 0.5 * STEEL) for share in (0.9, 1.0, 1.1)) > 74
    assert sliding(0.235) == pytest.approx(65, abs=0.2)


def test_at_6_nm_on_brick_the_angle_is_the_closed_forms_63_degrees():
    assert degrees(tumble(6.0, BRICK)) == pytest.approx(sliding(0.5 * BRICK), abs=1)


def test_at_0_22_nm_on_steel_the_angle_lies_between_those_of_the_other_torques():
    # Of Figure 5, steel, the paper says that the angle grows with torque, to about 60 degrees at the largest. Ours is
    # at the end of that already: 61.6, a sign that steel slides too easily here under a step of the torque.
    low, middle, high = (degrees(tumble(torque, STEEL)) for torque in (0.125, 0.22, 6.0))
    assert low < middle < high
    assert middle == pytest.approx(61.6, abs=0.1)


PIVOT = 22.5 - math.degrees(0.01 / (2 * LENGTH))
"""Chord of the first 10 mm of a pure pivot [degrees], which starts at 22.5."""


def low_torque_angles(rise, duration):
    cases = [(mu_s, level, torque) for mu_s in (STEEL, BRICK) for level in (0.0085, 0.015) for torque in (0.125, 0.22)]
    return {case: degrees(tumble(case[2], case[0], case[1], duration, rise=rise)) for case in cases}


def test_under_a_step_four_of_eight_low_torques_start_near_22_5_and_four_of_steel_and_brick_exceed_it():
    # "Most of the low-torque experiments ... identified by the ~22.5 degree initial trajectory angle. Five experiments
    # exceed this angle ... Four of these used the brakes": on all four surfaces one low torque of sixteen does.
    angles = low_torque_angles(None, 3.5)
    beyond = {case for case, angle in angles.items() if angle > 27.5}
    assert beyond == {(STEEL, 0.0085, 0.125), (STEEL, 0.0085, 0.22), (STEEL, 0.015, 0.22), (BRICK, 0.0085, 0.22)}
    assert all(angle == pytest.approx(PIVOT, abs=0.5) for case, angle in angles.items() if case not in beyond)


def test_under_a_torque_that_rises_over_a_quarter_of_a_second_seven_of_eight_pivot_and_one_exceeds_22_5():
    angles = low_torque_angles(0.25, 4.0)
    assert [case for case, angle in angles.items() if angle > 27.5] == [(STEEL, 0.0085, 0.22)]
    near = [angle for case, angle in angles.items() if case != (STEEL, 0.0085, 0.22)]
    assert all(20.7 < angle < 21.0 for angle in near)
    assert first_that_lasts(tumble(0.125, STEEL, rise=0.25)) == "pivot"


def first_that_lasts(run):
    """The first state but stand that lasts 0.1 s."""
    ends = [time for time, _, _ in run.transitions[1:]] + [math.inf]
    pairs = zip(run.transitions, ends, strict=True)
    return next(name for (begin, name, _), end in pairs if name != "stand" and end - begin >= 0.1)


def test_steel_at_0_125_nm_slips_where_the_paper_saw_a_pivot_unless_sliding_takes_no_friction_away():
    assert first_that_lasts(tumble(0.125, STEEL)) == "slip"
    held = tumble(0.125, STEEL, mu_d=STEEL)
    assert first_that_lasts(held) == "pivot"
    assert degrees(held) == pytest.approx(22.5 - math.degrees(0.01 / (2 * LENGTH)), abs=0.5)


@LEVELS
@pytest.mark.parametrize("mu_s", [STEEL, BRICK])
def test_at_6_nm_the_platform_slips_at_once_and_until_it_hops(mu_s, level):
    names = [name for _, name, _ in tumble(6.0, mu_s, level, duration=0.2).transitions]
    assert names == ["slip", "hop"]


HOPS = {
    # (mu_s, torque): theta of the first hop [degrees], contact before it, and its length [s] where it lands in 2.5 s
    (BRICK, 0.125): (20.0, 1.65, 0.65),
    (BRICK, 0.22): (15.35, 0.74, 0.71),
    (BRICK, 6.0): (8.1, 0.08, None),
    (STEEL, 0.125): (17.5, 1.20, 0.69),
    (STEEL, 0.22): (14.3, 0.63, 0.74),
    (STEEL, 6.0): (9.9, 0.09, None),
}
"""At 0.0085 g; the table of docs/notes/planar.md has the angles."""


@pytest.fixture(scope="module")
def runs():
    """The six cases of Figure 6, 2.5 s long."""
    return {(mu_s, torque): tumble(torque, mu_s, duration=2.5) for mu_s, torque in HOPS}


def first_hop(run):
    """Theta [degrees], beginning and end [s] of the first hop; no end where the run ends in it."""
    k = next(k for k, (_, name, _) in enumerate(run.transitions) if name == "hop")
    begin, _, theta = run.transitions[k]
    return math.degrees(theta), begin, run.transitions[k + 1][0] if k + 1 < len(run.transitions) else None


def test_the_six_cases_at_0_0085_g_hop_first_at_the_documented_angles_and_for_the_documented_times(runs):
    for case, (angle, contact, length) in HOPS.items():
        theta, begin, end = first_hop(runs[case])
        assert theta == pytest.approx(angle, abs=0.1)
        assert begin == pytest.approx(contact, abs=0.01)
        assert (end is None) == (length is None)
        if length is not None:
            assert end - begin == pytest.approx(length, abs=0.01)


def test_all_six_hop_as_the_papers_simulation_does_where_its_video_saw_five(runs):
    # "Even for a short tumble in 0.0085 g the simulation predicts the platform will ... perform a brief hop ...
    # high-speed video confirms this in 5 of 6 cases." How brief is not said; ours are longer with the brakes.
    assert all(first_hop(run) is not None for run in runs.values())
    for mu_s in (STEEL, BRICK):
        _, begin, end = first_hop(runs[mu_s, 6.0])
        assert end is None and 2.5 - begin > 20 * begin


def test_on_brick_at_0_125_nm_the_pivot_becomes_a_slip_at_11_5_degrees(runs):
    names = [name for _, name, _ in runs[BRICK, 0.125].transitions]
    assert names[:4] == ["slip", "pivot", "slip", "hop"]  # the first slip is the jerk of the torque, 0.05 degrees
    assert math.degrees(runs[BRICK, 0.125].transitions[2][2]) == pytest.approx(11.5, abs=0.1)


def test_ten_percent_of_friction_moves_a_sliding_start_and_not_a_pivot():
    def spread(torque, mu_s):
        return degrees(tumble(torque, 0.9 * mu_s)) - degrees(tumble(torque, 1.1 * mu_s))

    assert abs(spread(0.125, BRICK)) < 0.2
    assert 2 < spread(6.0, BRICK) < 8
    assert 2 < spread(0.22, STEEL) < 10


def held_share(trial):
    """Force that holds over load, of the leading spike alone, at the start of a pivot whose spring has settled.

    Settled: the tip's own vertical acceleration is zero, found by its depth.
    """
    system = System(trial)
    low, high = 0.0, 1e-2
    for _ in range(100):
        depth = 0.5 * (low + high)
        z = [0.0, LENGTH * math.cos(math.pi / 8) - depth, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        system.derivative(0.0, z, Modes(touching=[7], slip=[0] * 8, top=[0.0] * 8))
        _, ay, alpha = system.acceleration
        tip = ay - alpha * LENGTH * math.sin(math.pi / 8)
        low, high = (low, depth) if tip > 0 else (depth, high)
    return abs(system.stick_force) / system.contacts[0].load


def weight_reading(torque):
    """Trial on steel with 0.0085 g read as the weight left per mass of the platform."""
    counterweight = MASS * (1 - 0.0085)
    weight = MASS * 0.0085 * G
    return in_rig(torque, mu_s=STEEL, counterweight=counterweight, gravity_sim=weight / (MASS + counterweight))


def test_a_pivot_on_steel_whose_spring_has_settled_would_be_held_by_the_pair_s_weight_and_not_by_the_weight_s():
    # A state set by hand, no run: once the tip's spring has settled, a pivot at 0.125 N m asks for 0.18 of the load
    # with W = (m + m_b) g_sim, and for more than mu_s = 0.25 with half of it. No run on a step of the torque gets
    # there: the next test.
    assert held_share(in_rig(0.125, mu_s=STEEL)) == pytest.approx(0.18, abs=0.01)
    assert held_share(weight_reading(0.125)) > STEEL


@pytest.mark.parametrize("trial", [in_rig(0.125, mu_s=STEEL), weight_reading(0.125)], ids=["pair", "weight"])
def test_runs_on_steel_at_0_125_nm_slip_at_once_in_either_reading_of_0_0085_g(trial):
    # Erratum of docs/planar.md: m h tau / (J + m h^2) = 0.51 N is asked of friction before a spring has moved, h = l
    # cos(pi/8); mu_s W is 0.22 N in the pair's reading, 0.11 N in the weight's.
    height = LENGTH * math.cos(math.pi / 8)
    asked = MASS * height * 0.125 / (trial.inertia + MASS * height**2)
    assert asked == pytest.approx(0.51, abs=0.005) and asked > 2 * STEEL * trial.weight
    time, name, theta = simulate(trial, duration=0.1).transitions[0]
    assert (time, name, theta) == (0.0, "slip", 0.0)
