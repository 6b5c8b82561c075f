"""How a trial starts: at rest, and under a torque that is there at once or takes a while.

A motor whose torque takes a while: with it the platform pivots first on steel, as the paper saw at 0.125 N m.

From static equilibrium under a torque that is there at once, the springs have not yet moved the load to the leading
row: both rows hold the tips, and sticking asks for F = m l c tau / (J + m l^2 c^2), c = cos(pi / 8): 0.51 N where
mu_s W = 0.22 N. So it slips, and half the friction does not catch it again. Once the load has moved, pivoting asks for
less than a fifth of the weight.
"""

import math

import pytest
from rigid_trials import MASS, G, free, in_rig

from rigid import Effect, Trial, simulate


def steel(*, rise: float | None, reading: str = "pair") -> Trial:
    given: dict = {"mu_s": 0.25, "torque_until": 100.0}
    if rise is not None:
        given["effects"] = (Effect(id="torque-rise", parameters={"rise": rise}),)
    if reading == "weight":
        given["counterweight"] = MASS * (1 - 0.0085)
        given["gravity_sim"] = G * (MASS - given["counterweight"]) / (MASS + given["counterweight"])
    return in_rig(0.125, **given)


def states(trial: Trial) -> list[str]:
    return [state for _, state, _ in simulate(trial, duration=1.5).transitions]


def test_a_torque_that_is_there_at_once_makes_it_slip_at_once():
    trial = steel(rise=None)
    arm = trial.spike_length * math.cos(math.pi / 8)
    held = MASS * arm * trial.torque / (trial.inertia + MASS * arm**2)
    assert held > trial.mu_s * trial.weight
    assert states(trial)[0] == "slip"


def test_with_a_torque_that_takes_a_tenth_of_a_second_it_stands_then_pivots():
    trajectory = simulate(steel(rise=0.1), duration=1.5)
    assert [state for _, state, _ in trajectory.transitions][:2] == ["stand", "pivot"]
    assert math.degrees(trajectory.trajectory_angle) == pytest.approx(22.5, abs=2.5)


def test_by_the_other_reading_of_the_gravity_it_slips_all_the_same():
    assert states(steel(rise=0.1, reading="weight"))[:2] == ["stand", "slip"]


def test_a_stand_is_not_taken_for_rest_while_the_torque_rises():
    trajectory = simulate(steel(rise=0.1), duration=1.5)
    assert trajectory.transitions[1][0] > 0.05
    assert trajectory.theta[-1] > 0.02


@pytest.mark.parametrize(("gravity", "stiffness"), [(1e-5, 1.5e4), (1e-6, 1.5e4), (1e-3, 1e6), (1e-2, 1e8)])
def test_it_stands_at_rest_where_the_sinkage_is_a_nanometre_or_less(gravity, stiffness):
    """W / 2K of 2e-10 to 3e-9 m, of a height of 0.2 m that a number tells to 3e-17 m."""
    trial = free(stiffness=stiffness, gravity_sim=gravity, gravity=gravity, torque_until=1.0)
    trajectory = simulate(trial, duration=1000.0, sample_interval=10.0)
    assert [state for _, state, _ in trajectory.transitions] == ["stand"]
    assert (trajectory.y == trajectory.y[0]).all() and (trajectory.theta == 0.0).all()
    depth = 0.2 * math.cos(math.pi / 8) - trajectory.y[0]
    assert depth == pytest.approx(MASS * gravity / (2 * stiffness), rel=1e-6, abs=6e-17)
