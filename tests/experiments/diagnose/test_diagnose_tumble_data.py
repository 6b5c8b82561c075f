"""Diagnosing tumbles: clocks that jump, what differs between replicates, effects from files in the forward model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import slow_drive
from tumble_campaigns import CONDITIONS, NOMINAL, campaign

from experiments.campaign import Campaign, Recording
from experiments.diagnose.fit.fitting import Model, Whitener, fit
from experiments.diagnose.fit.forms import load_own
from experiments.diagnose.noise.replicates import find_scatter
from experiments.diagnose.tumble.checks import checked, spikes
from experiments.diagnose.tumble.data import CHANNELS, tumble_data
from experiments.diagnose.tumble.forward import Forward
from experiments.diagnose.tumble.problem import TumbleProblem
from rigid import Effect

SLOW = Path(slow_drive.__file__)


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


@pytest.mark.parametrize(
    ("sensor", "begins", "said"), [("wheel", 0.0, False), ("wheel", 0.3, True), ("imu", 0.0, True)]
)
def test_a_wheel_that_is_read_from_the_torques_start_on_misses_nothing(sensor, begins, said):
    """Before t = 0 it turns as the campaign states; what the others read then tells their zero."""
    made = campaign(seed=1, conditions=CONDITIONS[:1])
    recording = made.recordings["001", sensor]
    kept = recording.time >= begins
    columns = {name: np.asarray(column)[kept] for name, column in recording.columns.items()}
    _, findings = checked(tumble_data(changed(made, sensor, columns)))
    assert any("no valid row" in finding.what for finding in findings) == said


def test_a_trials_own_friction_and_bed_are_factors_on_what_all_share():
    data = tumble_data(campaign(conditions=CONDITIONS[:2]))
    problem = TumbleProblem(data)
    ids = [trial.id for trial in problem.trials]
    one = {"friction[001]": -0.2, "static_friction[001]": 0.1, "bed[001]": 0.3}
    other = {"mu_s": 0.88 * NOMINAL["mu_s"], "mu_d": 0.8 * NOMINAL["mu_d"], "stiffness": 1.3 * NOMINAL["stiffness"],
             "damping": 1.3 * NOMINAL["damping"]}  # fmt: skip
    own, shared, none = problem.evaluate([one, other, {}], (), ids)
    np.testing.assert_allclose(own["001"], shared["001"], atol=1e-9)
    np.testing.assert_array_equal(own["002"], none["002"])
    assert {p.trial for p in problem.scatter["friction"]} == set(ids)


@pytest.mark.long
def test_replicates_whose_friction_scatters_are_told_from_replicates_that_do_not():
    """Factors with a std of 9 % about each condition's mean; torque and bed are the same in all."""
    factors = (1.1, 0.92, 1.0, 0.95, 1.12, 0.93)
    conditions = [CONDITIONS[k] for k in (0, 0, 0, 1, 1, 1)]
    for friction, kinds in ((factors, {"friction"}), ((), set())):
        problem = TumbleProblem(tumble_data(campaign(seed=5, off=0.5, conditions=conditions, friction=friction)))
        ids = tuple(trial.id for trial in problem.trials)
        found = find_scatter(fit(Model(problem, Whitener.white(problem), ids)))
        assert set(found.model_std) == kinds
        assert not kinds or 0.05 < found.model_std["friction"] < 0.15


@pytest.mark.parametrize("name", ["gyro", "ax", "wheel"])
def test_a_single_reading_that_neighbours_and_replicates_do_not_share_is_set_aside(name):
    """15 std off at 0.6 s; with the same in a replicate it is kept, and touches of the ground are no such readings."""
    data = tumble_data(campaign(seed=3, conditions=[CONDITIONS[3]] * 2))
    assert not spikes(data.trials)[1]
    spoilt = []
    for trial in data.trials:
        rows = trial.of(name).nonzero()[0]
        odd = rows[np.searchsorted(trial.time[rows], 0.6)]
        value = trial.value.copy()
        value[odd] += 15 * trial.std[odd]
        spoilt.append(replace(trial, value=value))
    clean, (said,) = checked(replace(data, trials=(spoilt[0], data.trials[1])))
    assert said.set_aside and said.channel == name and said.from_s == said.to_s == pytest.approx(0.6, abs=0.02)
    assert len(clean.trials[0].time) == len(data.trials[0].time) - 1
    assert not spikes(spoilt)[1]


@pytest.mark.parametrize(("name", "noisy"), [("gyro", True), ("wheel", True), ("wheel", False)])
def test_a_channel_that_clips_is_said_but_not_a_wheel_that_turns_evenly_without_noise(name, noisy):
    """All above nine tenths of the largest reading stands there; a wheel without noise may well turn so in a hop."""
    data = tumble_data(campaign(seed=3, conditions=CONDITIONS[:1]))
    (trial,) = data.trials
    rows = trial.of(name).nonzero()[0]
    value = trial.value.copy()
    if not noisy:
        value[rows] = np.linspace(value[rows[0]], value[rows[-1]], len(rows))
    highest = 0.9 * value[rows].max()
    value[rows] = np.minimum(value[rows], highest)
    clean, findings = checked(replace(data, trials=(replace(trial, value=value),)))
    told = [finding for finding in findings if finding.channel == name and "clips there" in finding.what]
    assert len(told) == int(noisy)
    if noisy:
        rest = clean.trials[0].value[clean.trials[0].of(name)]
        assert told[0].set_aside and rest.max() < highest and len(rest) > 0.5 * len(rows)


@pytest.mark.parametrize("sensor", ["no sign", "sign", "silent at rest"])
def test_a_wheel_without_a_sign_is_not_heard_at_rest(sensor):
    """|noise| of a wheel at rest is 0.8 std on the mean, not 0: such readings are left out, and no other sensor's.

    A motor's wheel stands until t = 0; a sensor with a dead band reads exactly 0 there."""
    data = tumble_data(campaign(seed=3, conditions=CONDITIONS[:2]))
    trials = []
    for trial in data.trials:
        value, wheel = trial.value.copy(), trial.of("wheel")
        value[wheel] = np.abs(value[wheel]) if sensor != "sign" else value[wheel]
        if sensor == "silent at rest":
            value[wheel & (trial.time < 0)] = 0.0
        trials.append(replace(trial, value=value))
    clean, findings = checked(replace(data, trials=tuple(trials)))
    said = [finding for finding in findings if finding.channel == "wheel" and finding.set_aside]
    assert len(said) == (len(trials) if sensor == "no sign" else 0)
    for before, after in zip(trials, clean.trials, strict=True):
        lost = before.of("wheel").sum() - after.of("wheel").sum()
        assert not lost if sensor != "no sign" else lost > 20
        if lost:
            assert after.time[after.of("wheel")].min() >= 0
            assert lost < (before.time[before.of("wheel")] < 0.1).sum()


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_the_first_share_of_a_motion_is_what_the_whole_motion_begins_with(share):
    """What is looked at in part is simulated in part: camera's zero put aside, it reads the same up to there."""
    data = tumble_data(campaign(seed=3, conditions=CONDITIONS[:2]))
    problem = TumbleProblem(data)
    ids = tuple(trial.id for trial in data.trials)
    (whole,), (part,) = (problem.evaluate([{}], (), ids, share) for share in (1.0, share))
    for trial in data.trials:
        early = trial.time <= share * trial.end
        for name in ("gyro", "ax", "ay", "wheel"):
            mine = trial.of(name)
            np.testing.assert_allclose(part[trial.id][mine & early], whole[trial.id][mine & early], atol=1e-9)
        assert not part[trial.id][~early].any()
    model = Model(problem, Whitener.white(problem), ids).until(share, ids)
    kept = np.concatenate([part[id] * model.whitener.kept[id] for id in ids])
    (modes,) = model.evaluate([{}])
    assert modes @ modes == pytest.approx(kept @ kept)


@pytest.mark.long
def test_an_effect_from_a_file_moves_the_batch_as_it_moves_the_accurate_integrator():
    """Mean square of the difference over the noise below a hundredth, as for the effects of the library."""
    rise = Effect(id="slow-drive", parameters={"rise": 0.16}, file=SLOW)
    data = tumble_data(campaign(effects=(rise,), conditions=CONDITIONS[:1], duration=0.8))
    forward = Forward(data, own=[load_own(SLOW)])
    trial = data.trials[0]
    gaps = {}
    for value in (0.16, forward.neutral["slow-drive.rise"]):
        (found,) = forward.predict({"slow-drive.rise": np.array([value])})
        gap = (found.value[0] - trial.value) / trial.std
        gaps[value] = max(np.mean(gap[trial.of(name)] ** 2) for name in CHANNELS)
    assert gaps[0.16] < 0.01 < 1 < gaps[1e-4]
