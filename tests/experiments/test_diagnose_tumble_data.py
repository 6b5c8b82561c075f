"""Diagnosing tumbles: clocks that jump, what differs between replicates, effects from files in the forward model."""

from pathlib import Path

import numpy as np
import pytest
from tumble_campaigns import CONDITIONS, NOMINAL, campaign

import experiments
from experiments.campaign import Campaign, Recording
from experiments.diagnose.own import load_own
from experiments.diagnose.tumble_checks import checked
from experiments.diagnose.tumble_data import CHANNELS, tumble_data
from experiments.diagnose.tumble_forward import Forward
from experiments.diagnose.tumble_problem import TumbleProblem
from rigid import Effect

RISES = Path(experiments.__file__).parent / "terms" / "torque_rise.py"


def changed(made: Campaign, sensor: str, columns: dict) -> Campaign:
    recording = made.recordings["001", sensor]
    return Campaign(
        made.tables,
        dict(made.recordings) | {("001", sensor): Recording(dict(recording.columns) | columns)},
    )


@pytest.mark.parametrize(
    ("sensor", "channels", "share"), [("pose", ("x", "y", "theta"), 0.75), ("wheel", ("wheel",), 0.5)]
)
def test_a_clock_that_jumps_forward_ends_its_sensor_and_is_said(sensor, channels, share):
    """Times are 0.3 s late from a moment on, the rows go on: the platform turns by then, the wheel gains 180 rad/s2."""
    made = campaign(seed=1, conditions=CONDITIONS[:1])
    time = made.recordings["001", sensor].time.copy()
    late = int(share * len(time))
    at = time[late]
    time[late:] += 0.3
    clean, findings = checked(tumble_data(changed(made, sensor, {"t_s": time})))
    (said,) = [finding for finding in findings if "clock" in finding.what and finding.set_aside]
    assert said.from_s == pytest.approx(at + 0.3)
    for name in CHANNELS:
        rest = clean.trials[0].time[clean.trials[0].of(name)]
        assert rest.max() < at if name in channels else rest.max() > 1.1


@pytest.mark.parametrize("window", [0.0, 0.004])
def test_a_force_read_at_the_instant_at_which_the_torque_sets_in_tells_nothing(window):
    """There it jumps by torque / (inertia about the tip) x length: a clock 10 us off would seem to explain it."""
    made = campaign(seed=1, conditions=CONDITIONS[:1])
    imu = made.tables.sensors.imu.model_copy(update={"window": window})
    tables = made.tables.model_copy(update={"sensors": made.tables.sensors.model_copy(update={"imu": imu})})
    (trial,) = tumble_data(Campaign(tables, made.recordings)).trials
    at = np.abs(made.recordings["001", "imu"].time) < 1e-9
    assert at.sum() == 1
    for name, left in (("gyro", 1), ("ax", int(window > 0)), ("ay", int(window > 0))):
        assert (np.abs(trial.time[trial.of(name)]) < 1e-3).sum() == left


def test_rows_that_were_lost_are_a_gap_and_no_jump_of_the_clock():
    made = campaign(seed=1, conditions=CONDITIONS[:1])
    recording = made.recordings["001", "pose"]
    kept = np.ones(len(recording.time), dtype=bool)
    kept[len(kept) // 2 : len(kept) // 2 + 30] = False
    columns = {name: np.asarray(column)[kept] for name, column in recording.columns.items()}
    _, findings = checked(tumble_data(changed(made, "pose", columns)))
    assert findings and not any(finding.set_aside for finding in findings)


def test_a_trials_own_friction_and_bed_are_factors_on_what_all_share():
    data = tumble_data(campaign(conditions=CONDITIONS[:2]))
    problem = TumbleProblem(data)
    ids = [trial.id for trial in problem.trials]
    one = {"friction[001]": -0.2, "bed[001]": 0.3}
    other = {"mu_s": 0.8 * NOMINAL["mu_s"], "mu_d": 0.8 * NOMINAL["mu_d"], "stiffness": 1.3 * NOMINAL["stiffness"],
             "damping": 1.3 * NOMINAL["damping"]}  # fmt: skip
    own, shared, none = problem.evaluate([one, other, {}], (), ids)
    np.testing.assert_allclose(own["001"], shared["001"], atol=1e-9)
    np.testing.assert_array_equal(own["002"], none["002"])
    assert {p.trial for p in problem.scatter["friction"]} == set(ids)


def test_an_effect_from_a_file_moves_the_batch_as_it_moves_the_accurate_integrator():
    """Mean square of the difference over the noise below a hundredth, as for the effects of the library."""
    rise = Effect(id="torque-rise", parameters={"rise": 0.08}, file=RISES)
    data = tumble_data(campaign(effects=(rise,), conditions=CONDITIONS[:1], duration=0.8))
    forward = Forward(data, own=[load_own(RISES)])
    trial = data.trials[0]
    gaps = {}
    for value in (0.08, forward.neutral("torque-rise.rise")):
        (found,) = forward.predict({"torque-rise.rise": np.array([value])})
        gap = (found.value[0] - trial.value) / trial.std
        gaps[value] = max(np.mean(gap[trial.of(name)] ** 2) for name in CHANNELS)
    assert gaps[0.08] < 0.01 < 1 < gaps[1e-4]
