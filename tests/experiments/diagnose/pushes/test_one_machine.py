"""Pushes of one machine: how its motion is found in a noisy depth column, and the law of a drop with steep friction."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.hidden.suite import make_case
from experiments.campaign import read_campaign, write_campaign
from experiments.diagnose.push.data import prepare
from experiments.diagnose.push.drive import Drive
from experiments.diagnose.push.law import fall
from experiments.diagnose.push.slots import SLOTS, slot_table

GRAVITY, MASS, STIFFNESS, DAMPING = 9.80665, 0.5, 930.0, 4.8


def dropped(friction: float, rise: float, time: np.ndarray, speed: float) -> np.ndarray:
    """Depths [m] of a drop with friction f tanh(v / w), by an implicit method that shares nothing with the law's."""

    def motion(_: float, state: np.ndarray) -> list[float]:
        z, v = state
        force = STIFFNESS * z + DAMPING * max(v, 0.0) + friction * np.tanh(v / rise)
        return [v, GRAVITY - force / MASS]

    return solve_ivp(motion, (0.0, time[-1]), [0.0, speed], "Radau", time, rtol=1e-9, atol=1e-12).y[0]


@pytest.mark.parametrize("rise", [0.1, 0.01, 0.001])
def test_a_drop_with_friction_that_rises_over_a_small_speed_follows_the_equation_of_motion(rise):
    time, speed, friction = np.linspace(0.0, 0.25, 101), 0.3, 6.0
    lane = slot_table(1)
    values = {"mass": MASS, "gravity": GRAVITY, "stiffness": STIFFNESS, "damping": DAMPING,
              "shaft": friction, "shaft_rise": rise}  # fmt: skip
    for name, value in values.items():
        lane[0, SLOTS.index(name)] = value
    ends = np.array([0, len(time)], dtype=np.int32)
    found = fall(lane, np.zeros(1, dtype=np.int32), ends, time, np.array([speed]))[0]
    reference = dropped(friction, rise, time, speed)
    assert reference.max() > 2e-3  # it sinks in, and creeps back where friction does not hold it
    assert found[:, 0] == pytest.approx(reference, abs=8e-8)  # 0.004 of a noise of 20 micrometres


def test_a_friction_steeper_than_the_shortest_step_holds_a_spike_as_a_constant_one_does():
    time = np.linspace(0.0, 0.1, 41)
    lanes = slot_table(2)
    for name, value in {"mass": MASS, "gravity": GRAVITY, "stiffness": STIFFNESS, "damping": DAMPING,
                        "shaft": 60.0}.items():  # fmt: skip
        lanes[:, SLOTS.index(name)] = value
    lanes[1, SLOTS.index("shaft_rise")] = 1e-7
    ends = np.array([0, len(time)], dtype=np.int32)
    constant, steep = fall(lanes, np.zeros(2, dtype=np.int32), ends, time, np.array([0.3]))
    assert steep[:, 0] == pytest.approx(constant[:, 0], abs=2e-5)


def test_a_motion_is_stretched_to_another_record_with_its_holds_as_long_as_they_were():
    own = Drive(0.0, np.array([0.0, 5.0, 0.0]), np.array([0.2, 0.6]), np.array([0.1, 0.1]), False, (True, False, True))
    longer = own.stretched(10.0, 18.0)  # 6 s at rest, 4 s on the way
    assert longer is not None
    assert 18.0 * longer.middles == pytest.approx([2.0, 14.0])
    assert 18.0 * longer.widths == pytest.approx([3.0, 3.0])
    assert longer.resting == own.resting
    assert own.stretched(10.0, 5.0) is None  # its holds alone last longer


def test_a_push_has_the_holds_of_its_machine_although_the_search_lost_them(tmp_path):
    # Alone, push 006 of this campaign gets seven ramps and no hold.
    case = {"seed": 991006, "kind": "shaft-friction", "strength": 8.855, "trials": 6}
    trials, _ = prepare(read_campaign(write_campaign(tmp_path / "made", make_case("second-push", case)[0])))
    holds = {trial.info.id: trial.path.holds for trial in trials}
    assert holds["006"] == holds["002"] == (True, False, True, False, True)
    assert abs(trials[5].path.speed[-5:]).max() < 5e-4  # [m/s]: it is at rest in the end
