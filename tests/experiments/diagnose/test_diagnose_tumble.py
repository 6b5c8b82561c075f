"""Diagnosing tumbles: the forward model, fits, the checks of data."""

import math
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from tumble_campaigns import CONDITIONS, campaign

from experiments.campaign import Campaign, Recording, read_model
from experiments.diagnose.core import deciding
from experiments.diagnose.fit.fitting import SEARCH, Model, Whitener, fit, fits, settled
from experiments.diagnose.fit.forms import shapes_of
from experiments.diagnose.tumble.checks import checked
from experiments.diagnose.tumble.data import CHANNELS, ZERO_STD, tumble_data, whiten
from experiments.diagnose.tumble.forms import physical, tumble_forms
from experiments.diagnose.tumble.forward import Forward
from experiments.diagnose.tumble.problem import TumbleProblem, make_problem
from rigid import STATES, Effect


@pytest.mark.parametrize(
    ("effects", "given"),
    [
        ((), {}),
        ((Effect(id="pendulum", parameters={"length": 2.2}),), {"pendulum.length": 2.2}),
        ((Effect(id="slope", parameters={"angle": 0.01}),), {"slope.angle": 0.01}),
        ((Effect(id="com-offset", parameters={"x": 4e-4, "y": -3e-4}),), {"com-offset.x": 4e-4, "com-offset.y": -3e-4}),
        (
            (
                Effect(id="plastic-sinkage", parameters={"share": 0.5, "open": 1.0}),
                Effect(id="adhesion", parameters={"force": 0.1, "reach": 2e-5, "speed": 2e-3}),
            ),
            {
                "plastic-sinkage.share": 0.5,
                "plastic-sinkage.open": 1.0,
                "adhesion.force": 0.1,
                "adhesion.reach": 2e-5,
                "adhesion.speed": 2e-3,
            },
        ),
        (
            (
                Effect(id="bearing-drag", parameters={"torque": 0.01, "excess": 0.6, "speed": 0.3}),
                Effect(id="rig-friction", parameters={"force": 0.05, "excess": 0.4, "speed": 0.01}),
            ),
            {
                "bearing-drag.torque": 0.01,
                "bearing-drag.excess": 0.6,
                "bearing-drag.speed": 0.3,
                "rig-friction.force": 0.05,
                "rig-friction.excess": 0.4,
                "rig-friction.speed": 0.01,
            },
        ),
        (
            (
                Effect(id="clock-offset", parameters={"offset": 0.013, "drift": 0.004}),
                Effect(id="camera-scale", parameters={"scale": 1.02, "bend": 0.3}),
            ),
            {
                "clock-offset.offset": 0.013,
                "clock-offset.drift": 0.004,
                "camera-scale.scale": 1.02,
                "camera-scale.bend": 0.3,
            },
        ),
    ],
)
def test_the_forward_model_reads_what_the_accurate_integrator_and_the_sensors_would(effects, given):
    """Another integrator (order 2, 0.5 ms), another way to the means. Its error adds its mean square, in units of the
    noise, to chi-square per sample: less than a hundredth in every channel of every trial."""
    data = tumble_data(campaign(effects=effects))
    predicted = Forward(data).predict({name: np.array([value]) for name, value in given.items()})
    for trial, found in zip(data.trials, predicted, strict=True):
        gap = (found.value[0] - trial.value) / trial.std
        for name in CHANNELS:
            assert np.mean(gap[trial.of(name)] ** 2) < 0.01, (trial.id, name)


def test_without_a_window_the_specific_force_is_that_of_the_instant():
    data = tumble_data(campaign(window=0.0, conditions=CONDITIONS[:1]))
    (found,) = Forward(data).predict({})
    trial = data.trials[0]
    gap = (found.value[0] - trial.value) / trial.std
    # A sample at the very moment of a contact may fall on either side of the jump.
    assert np.median(np.abs(gap[trial.of("ax")])) < 0.01
    assert np.mean(np.abs(gap[trial.of("ay")]) > 0.5) < 0.03


def test_a_force_that_was_read_while_the_contact_switched_is_no_misfit():
    """The mean of what is read just before and just after a catch: no motion over stiff contacts has that."""
    made = campaign(seed=2, off=0.5, window=0.0, conditions=CONDITIONS[:2], duration=1.8)
    problem = make_problem(made)
    right = fit(Model(problem, Whitener.white(problem), ("001", "002")))
    values, samples = right.values, problem.samples("001")
    force = np.flatnonzero(samples.channel == "ax")

    def read(late):
        return problem.readings(values, (), ("001",), late)["001"]

    steps = np.linspace(0.0, 0.0099, 34)
    jumps = np.abs(np.diff([read(late)[force] for late in steps], axis=0))
    step, row = np.unravel_index(np.argmax(jumps), jumps.shape)
    low, high = steps[step], steps[step + 1]
    first, last = (read(late)[force[row]] for late in (low, high))
    for _ in range(20):
        middle = 0.5 * (low + high)
        there = read(middle)[force[row]]
        low, high = (low, middle) if abs(there - first) > abs(there - last) else (middle, high)
    columns = {name: column.copy() for name, column in made.recordings["001", "imu"].columns.items()}
    at = int(np.argmin(np.abs(columns["t_s"] - samples.time[force[row]])))
    columns["t_s"][at] += high
    size = 0.0
    for name, column in (("gyro", "gyro_rad_s"), ("ax", "ax_m_s2"), ("ay", "ay_m_s2")):
        (place,) = np.flatnonzero((samples.channel == name) & (samples.time == samples.time[force[row]]))
        before, after = (read(shift)[place] for shift in (low, high))
        columns[column][at] = 0.5 * (before + after) * samples.std[place]
        size = max(size, abs(after - before))
    assert size > 20  # of the sensor's standard deviations
    again = make_problem(replace(made, recordings={**made.recordings, ("001", "imu"): Recording(columns)}))
    plain = fit(Model(again, Whitener.white(again), ("001", "002")), values)
    again.rewhiten(values, ())
    doubted = fit(plain.model, values)
    assert plain.chi_square - doubted.chi_square > 0.1 * size**2
    assert doubted.chi_square < right.chi_square + 20
    gap, count = again.chi_square(doubted.values, (), "001")
    assert gap / count < 1.15 and 0 < len(again.samples("001").time) - count < 12


def test_the_whitened_sum_of_squares_is_that_of_the_noise_with_the_cameras_zero_in_it():
    """r' C^-1 r with C = 1 + s^2 1 1' within each of x, y, theta."""
    data = tumble_data(campaign(seed=1, conditions=CONDITIONS[:1]))
    trial = data.trials[0]
    value = trial.value + trial.std * np.random.default_rng(2).standard_normal(len(trial.value))
    white = whiten(trial, value[None, :])[0]
    raw = (trial.value - value) / trial.std
    for name in CHANNELS:
        r = raw[trial.of(name)]
        zero = ZERO_STD**2 if name in ("x", "y", "theta") else 0.0
        covariance = np.eye(len(r)) + zero * np.ones((len(r), len(r)))
        assert white[trial.of(name)] @ white[trial.of(name)] == pytest.approx(r @ np.linalg.solve(covariance, r))


@pytest.mark.parametrize("seed", [1, 2])
def test_the_base_model_fits_its_own_data_to_the_noise(seed):
    """Parameters one sigma off: after a fit chi-square is the number of samples, within four of its deviations."""
    found = make_problem(campaign(seed=seed, off=1.0))
    ids = tuple(trial.id for trial in found.trials)
    values = found.contacts.guess(Model(found, Whitener.white(found), ids), {})
    (residuals,) = found.evaluate([values], (), ids)
    total = sum(float(r @ r) for r in residuals.values())
    count = sum(len(r) for r in residuals.values())
    assert abs(total - count) < 4 * math.sqrt(2 * count)


def test_growing_horizons_look_at_nothing_that_comes_later():
    data = tumble_data(campaign(seed=1, conditions=CONDITIONS[:1]))
    trial = data.trials[0]
    value = trial.value.copy()
    value[trial.time > 0.5] += 100 * trial.std[trial.time > 0.5]
    early = whiten(trial, value[None, :], until=0.5)
    assert np.abs(early).max() == pytest.approx(0.0, abs=1e-9)


def test_every_effect_off_is_the_base_model_to_rounding():
    """Two kernels, one with all effects compiled in: apart by round-off that a tumble carries on."""
    data = tumble_data(campaign(seed=1, conditions=CONDITIONS[:2]))
    problem = TumbleProblem(data)
    (bare,) = problem.evaluate([{}], (), ("001", "002"))
    (dressed,) = problem.evaluate([{}], problem.forms, ("001", "002"))
    for trial in ("001", "002"):
        np.testing.assert_allclose(bare[trial], dressed[trial], rtol=0, atol=1e-9)


def test_fits_that_are_carried_out_together_end_where_each_ends_alone():
    """To the bit, for lanes share nothing; one starts at growing shares of the time, one with a scan at all of it."""
    found = make_problem(campaign(seed=1, off=1.0, conditions=CONDITIONS[:2]))
    bare = Model(found, Whitener.none(found), ("001", "002"))
    rules = (replace(SEARCH, rounds=3, shares=(0.4, 1.0)), replace(SEARCH, rounds=2, scan=True))
    starts = [(bare, {"mu_s": 0.5}, rule) for rule in rules]
    for one, start in zip(fits(starts), starts, strict=True):
        (alone,) = fits([start])
        assert one.values == alone.values and one.objective == alone.objective
        np.testing.assert_array_equal(one.modes, alone.modes)


@pytest.mark.long
def test_a_pendulum_is_found_with_its_length_and_beats_a_slope():
    length = 1.5
    found = make_problem(campaign(effects=(Effect(id="pendulum", parameters={"length": length}),), seed=4, off=0.5))
    bare = Model(found, Whitener.none(found), tuple(trial.id for trial in found.trials))
    assert bare.trials == ("001", "002", "003", "004")
    rule = replace(SEARCH, scan=True, shares=(0.3, 0.6, 1.0), keeps=True)
    by_id = {form.id: form for form in found.forms}
    costs = {}
    for name in ("pendulum:centred", "slope:plane"):
        form = by_id[name]
        starts = [(bare.with_forms([form]), point, rule) for point in form.starts]
        costs[name] = min(fits(starts), key=lambda fit: fit.objective)
    best = costs["pendulum:centred"]
    assert best.objective < costs["slope:plane"].objective - 50
    place = [p.name for p in best.model.parameters].index("pendulum.curvature")
    curvature, error = best.values["pendulum.curvature"], math.sqrt(settled(best).covariance()[place, place])
    assert abs(curvature - 1 / length) < 4 * error
    reported = found.reported(best.values, by_id["pendulum:centred"])
    assert reported["length"][0] == pytest.approx(1 / curvature)


@pytest.mark.long
def test_a_plain_effect_is_found_where_the_base_model_ends_on_branches_of_its_own():
    """A centre of mass 0.58 mm off the shaft, half of what cancels the whole restoring moment at 0.0085 g."""
    truth = {"x": -5e-4, "y": 3e-4}
    found = make_problem(campaign(effects=(Effect(id="com-offset", parameters=truth),), seed=4, off=0.5))
    ids = tuple(trial.id for trial in found.trials)
    forms = {form.id: form for form in found.forms}
    guesser, bare = found.contacts, Model(found, Whitener.white(found), ids)
    guesser.forms = (forms["com-offset:both"], forms["slope:plane"])
    base = guesser.guess(bare, {})
    values = guesser.guess(bare.with_forms([forms["com-offset:both"]]), base)
    (residuals,) = found.evaluate([base], (), ids)
    assert np.mean(np.concatenate(list(residuals.values())) ** 2) > 5
    (residuals,) = found.evaluate([values], (forms["com-offset:both"],), ids)
    assert np.mean(np.concatenate(list(residuals.values())) ** 2) < 1.1
    for name, value in truth.items():
        assert values[f"com-offset.{name}"] == pytest.approx(value, abs=3e-5)


@pytest.mark.long
def test_a_trial_on_a_branch_that_was_not_measured_does_not_keep_the_base_model_away_from_the_others():
    """From the stated numbers the fit ends with mu_s 4.7 sigma off, where trials stick that slipped."""
    nominal = {"mass": 5.177, "inertia": 0.05967, "stiffness": 4455.0, "damping": 16.42, "mu_s": 0.4725, "mu_d": 0.2786}
    sigma = {"mass": 0.01, "inertia": 0.05, "stiffness": 0.2, "damping": 0.3, "mu_s": 0.1, "mu_d": 0.1}
    away = {"mass": -0.73, "inertia": -0.72, "stiffness": -1.91, "damping": -0.19, "mu_s": -0.65, "mu_d": -0.96}
    light = {"gravity_sim": 0.0834, "counterweight": 5.0897}
    heavy = {"gravity_sim": 0.2942, "counterweight": 4.8754}
    conditions = (
        heavy | {"torque": 0.6932, "torque_until": 0.5},
        light | {"torque": 0.2025, "torque_until": 0.5},
        heavy | {"torque": 0.7217},
        heavy | {"torque": 0.7304},
        light | {"torque": 0.0769, "torque_until": 0.9},
        light | {"torque": 0.1673},
    )
    made = campaign(seed=1, conditions=conditions, duration=1.6, window=0.008, nominal=nominal, sigma=sigma, away=away)
    found = make_problem(made)
    ids = tuple(trial.id for trial in found.trials)
    base = found.contacts.guess(Model(found, Whitener.white(found), ids), {})
    (residuals,) = found.evaluate([base], (), ids)
    assert np.mean(np.concatenate(list(residuals.values())) ** 2) < 1.1
    assert base["mu_s"] == pytest.approx(nominal["mu_s"] * (1 + away["mu_s"] * sigma["mu_s"]), rel=0.02)


def test_the_latent_force_of_a_missing_pendulum_is_that_of_the_wires():
    """In a hop the model has no force along the surface, so what is left is F_x = -m_b g x / L at the measured x."""
    length = 2.2
    effect = Effect(id="pendulum", parameters={"length": length})
    found = make_problem(campaign(effects=(effect,), seed=1, conditions=CONDITIONS[2:3], duration=0.6))
    latent = found.latent({}, (), "001")
    trial = found.data.trials[0]
    x = np.interp(latent["t_s"], trial.time[trial.of("x")], trial.value[trial.of("x")])
    hop = (latent["state"] == STATES.index("hop")) & (latent["t_s"] > 0.1)
    slope = (x[hop] @ latent["latent_force_x_N"][hop]) / (x[hop] @ x[hop])
    error = 5.3 * 0.02 / np.sqrt(x[hop] @ x[hop])
    assert abs(slope + 5.2 * 9.80665 / length) < 4 * error + 0.05 * 5.2 * 9.80665 / length


def test_a_marker_that_jumps_is_set_aside_and_said():
    made = campaign(seed=1, conditions=CONDITIONS[:1])
    pose = made.recordings["001", "pose"]
    x = pose["x_m"].copy()
    x[60] += 0.05
    columns = dict(pose.columns) | {"x_m": x}
    data = tumble_data(Campaign(made.tables, dict(made.recordings) | {("001", "pose"): Recording(columns)}))
    clean, findings = checked(data)
    lost = set(data.trials[0].time[data.trials[0].of("x")]) - set(clean.trials[0].time[clean.trials[0].of("x")])
    assert lost == {pose.time[60]}
    assert pose.time[60] not in clean.trials[0].time[clean.trials[0].of("theta")]
    assert [f.set_aside for f in findings] == [True]
    assert checked(tumble_data(made))[1] == []


def test_a_marker_that_is_lost_for_a_while_or_for_good_is_set_aside():
    made = campaign(seed=1, conditions=CONDITIONS[2:3])
    pose = made.recordings["001", "pose"]
    for lost in (slice(60, 75), slice(40, 115), slice(130, None)):
        y = pose["y_m"].copy()
        y[lost] -= 0.03
        columns = dict(pose.columns) | {"y_m": y}
        data = tumble_data(Campaign(made.tables, dict(made.recordings) | {("001", "pose"): Recording(columns)}))
        clean, findings = checked(data)
        rest = clean.trials[0].time[clean.trials[0].of("y")]
        assert set(pose.time) - set(rest) == set(pose.time[lost])
        assert [f.set_aside for f in findings] == [True]


def test_the_gap_puts_the_cameras_zero_at_its_most_probable_value():
    data = tumble_data(campaign(conditions=CONDITIONS[:1]))
    trial = data.trials[0]
    shifted = replace(trial, value=trial.value + np.where(trial.of("x"), 2 * trial.std, 0.0))
    total, count = TumbleProblem(replace(data, trials=(shifted,))).chi_square({}, (), "001")
    assert total / count < 0.01


def test_the_model_that_was_fitted_reads_back(tmp_path):
    found = make_problem(campaign(seed=1, conditions=CONDITIONS[:1]))
    form = next(form for form in found.forms if form.id == "pendulum:centred")
    values = {"mu_s": 0.48, "pendulum.curvature": 0.5, "gravity_sim[001]": 0.085}
    found.write_model(tmp_path / "model.toml", values, [form])
    model = read_model(tmp_path / "model.toml")
    assert model.surface.mu_s == 0.48
    assert model.trial[0].gravity_sim == 0.085
    assert model.effect[0].id == "pendulum"
    assert model.effect[0].parameters == {"length": 2.0}


def test_a_sensor_without_noise_is_refused():
    made = campaign(conditions=CONDITIONS[:1])
    wheel = made.tables.sensors.wheel.model_copy(update={"std": (0.0,)})
    tables = made.tables.model_copy(update={"sensors": made.tables.sensors.model_copy(update={"wheel": wheel})})
    with pytest.raises(ValueError, match=r"\[sensors.wheel\] std = \[0.0\]"):
        tumble_data(Campaign(tables, made.recordings))


def test_a_cable_may_hang_wound_up_with_drag_of_any_power_beside():
    forms = tumble_forms(rig=True, sinkage=3e-5, weight=0.88)
    bent = {form.name: form for form in shapes_of(forms)["umbilical:both"]}
    assert set(bent) == {"both, of any shape", "both, wound up", "both, wound up, of any shape"}
    form = bent["both, wound up, of any shape"]
    values = {p.name: np.zeros(1) for p in form.parameters} | {"umbilical.rest_change": np.array([-0.3])}
    told = physical(form, values)
    assert told["umbilical.rest"] == -0.3 and told["umbilical.drag_power"] == 1.0
    names = [f"umbilical.{name}_change" for name in ("rest", "drag_power")]
    assert {tuple(start[name] > 0 for name in names) for start in form.starts} == set(product((False, True), repeat=2))


def test_a_friction_of_the_rig_above_the_weight_on_the_surface_is_said_to_be_hard_to_believe():
    """(5.3 + 5.2) kg under 0.0834 m/s2 weigh 0.876 N, the least of the four."""
    problem = make_problem(campaign())
    form = next(form for form in problem.forms if form.id == "rig-friction:dry")
    assert problem.remarks({"rig-friction.force": 0.8}, [form]) == ()
    (said,) = problem.remarks({"rig-friction.force": 1.84}, [form])
    assert all(number in said for number in ("1.84 N", "0.876 N", "trial 001"))
    assert problem.remarks({}, []) == ()


@pytest.mark.parametrize(("effect", "level"), [("bearing-drag", "torque"), ("rig-friction", "force")])
def test_dry_friction_may_be_more_near_rest_from_none_at_all(effect, level):
    forms = tumble_forms(rig=True, sinkage=3e-5, weight=0.88)
    (form,) = shapes_of(forms)[f"{effect}:dry"]
    assert form.name == "dry, more near rest" and form.amplitude == f"{effect}.{level}"
    plain = {p.name: np.zeros(1) for p in form.parameters} | {form.amplitude: np.array([0.02])}
    told = physical(form, plain)
    assert told[f"{effect}.excess"] == 0.0 and told[f"{effect}.{level}"] == 0.02
    faster = physical(form, plain | {f"{effect}.log_speed": np.array([1.0])})
    assert faster[f"{effect}.speed"] == pytest.approx(math.e * told[f"{effect}.speed"], rel=1e-12)
    assert all(start[f"{effect}.excess_change"] > 0 for start in form.starts)
    assert next(p for p in form.parameters if p.name.endswith("excess_change")).lowest == 0.0


@pytest.mark.parametrize(
    ("before", "after", "nothing"),
    [
        ((1.01, 0.95), (1.015, 1.04), True),
        ((1.01, 0.95), (1.005, 1.04), False),  # something is taken away of those that were fitted
        ((1.01, 1.10), (1.015, 1.04), False),  # or of those held out
        ((1.10, 0.95), (1.11, 1.04), False),  # more than chance is left
        ((1.01, 1.50), (1.015, 1.60), False),
    ],
)
def test_a_name_that_takes_nothing_away_of_what_is_noise_is_none(monkeypatch, before, after, nothing):
    base, best = (SimpleNamespace(gap=gap, count=10_000) for gap in (before, after))
    monkeypatch.setattr(deciding, "gap_of", lambda found, held_out: deciding.Gap(*found.gap))
    choice = SimpleNamespace(base=SimpleNamespace(fit=base), best=SimpleNamespace(fit=best))
    assert deciding.explains_nothing(choice, ("002",)) == nothing
