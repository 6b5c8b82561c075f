"""Forms that are bent from where the plain ones end: closed forms, and campaigns in which the plain ones are not
enough."""

import math

import numpy as np
import pytest
from penetration_campaigns import (
    DAMPING,
    DEPTH_STD,
    FORCE_STD,
    GRAVITY,
    MASS,
    STIFFNESS,
    campaign_of,
    driven_trial,
)  # fmt: skip

from experiments.campaign import Recording
from experiments.diagnose.core.candidate_fits import CandidateFits
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.core.renoised import whitened_fit
from experiments.diagnose.fit.evidence import Hypothesis, best_starts
from experiments.diagnose.fit.fitting import Model, Whitener
from experiments.diagnose.fit.forms import shapes_of
from experiments.diagnose.noise.replicates import split_trials
from experiments.diagnose.push.forms import push_forms
from experiments.diagnose.push.law import fall, push
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.push.slots import SLOTS, slot_table

ONSET = 1e-3


def lane(**numbers):
    table = slot_table(1)
    known = {"mass": MASS, "gravity": GRAVITY, "stiffness": STIFFNESS, "damping": DAMPING, "speed_scale": 1e-9}
    for name, value in (known | numbers).items():
        table[0, SLOTS.index(name)] = value
    return table


def pushed(depth, **numbers):
    speed = np.gradient(depth)
    ends = np.array([0, len(depth)], dtype=np.int32)
    return speed, push(lane(**numbers), np.zeros(1, dtype=np.int32), ends, depth, speed)[0]


def in_out_and_in_again():
    return np.concatenate([np.linspace(1e-4, 0.02, 100), np.linspace(0.02, 0.005, 60)[1:],
                           np.linspace(0.005, 0.02, 60)[1:]])  # fmt: skip


def test_in_an_empty_crater_nothing_is_felt_and_beside_a_full_one_the_damper():
    # Half of the depth stays: above 10 mm there is no spring, and the damper is there or not.
    depth = in_out_and_in_again()
    again = np.flatnonzero((np.arange(len(depth)) > 157) & (depth < 0.01))
    speed, full = pushed(depth, crater_share=0.5)
    _, empty = pushed(depth, crater_share=0.5, crater_open=1.0)
    assert full[again] == pytest.approx(DAMPING * speed[again], abs=1e-12)
    assert np.all(empty[again] == 0.0) and len(again) > 10
    assert np.delete(full, again) == pytest.approx(np.delete(empty, again), abs=1e-12)


def test_a_pull_of_the_way_out_only_is_gone_where_the_spike_sinks_again():
    depth = in_out_and_in_again()
    speed, held = pushed(depth, pull=1.0, pull_reach=1e-4, pull_sharpness=5.0)
    _, out_only = pushed(depth, pull=1.0, pull_reach=1e-4, pull_sharpness=5.0, pull_out=1.0)
    base = STIFFNESS * depth + DAMPING * np.maximum(speed, 0.0)
    again = np.flatnonzero((np.arange(len(depth)) > 161) & (depth < 0.0195))
    assert base[again] - held[again] == pytest.approx(1.0, abs=0.01)
    assert out_only[again] == pytest.approx(base[again], abs=1e-9)
    assert np.array_equal(held[:150], out_only[:150])


def test_a_drop_into_its_own_empty_crater_falls_freely_to_the_floor_of_it():
    # It leaves the crater's floor, z_f = share z_m, at v, rises v^2 / 2 g and is back at it after 2 v / g.
    time = np.arange(0.0, 0.5, 2.5e-4)
    ends = np.array([0, len(time)], dtype=np.int32)
    numbers = lane(crater_share=0.75, crater_open=1.0)
    motion = fall(numbers, np.zeros(1, dtype=np.int32), ends, time, np.array([1.0]))[0]
    depth, accel = motion[:, 0], motion[:, 2]
    free = (np.abs(accel - GRAVITY) < 1e-9) & (np.arange(len(time)) > int(np.argmin(accel)))
    first = int(np.argmax(free))
    assert first > 0
    last = first + int(np.argmin(free[first:]))
    floor = 0.75 * depth[:first].max()
    rise = motion[first, 1]
    assert rise < 0 and depth[first] == pytest.approx(floor, abs=abs(rise) * 3e-4)
    assert time[last] - time[first] == pytest.approx(2 * abs(rise) / GRAVITY, abs=6e-4)
    assert depth[first:last].min() == pytest.approx(depth[first] - rise**2 / (2 * GRAVITY), rel=1e-3)


def setting_in(size):
    """A ring's friction: nothing at the surface, 0.8 N a diameter from a millimetre on."""

    def force(z, v, top=0.0):
        rub = 0.8 * size * min(1.0, z / ONSET)
        return size * (STIFFNESS * z + DAMPING * max(v, 0.0)) + math.copysign(rub, v)

    return force


@pytest.mark.long
def test_friction_that_sets_in_over_a_millimetre_is_named_over_two_diameters():
    trials = []
    for k, (size, speed) in enumerate((s, v) for s in (1.0, 2.0) for v in (0.01, 0.03, 0.06)):
        rows = driven_trial(setting_in(size), speed=speed, retreat=True, seed=40 + k)
        trials.append((f"{k}", "driven", speed, rows, {"diameter": 0.012 * size}))
    found = diagnose(make_problem(campaign_of(trials, doubt=(2.0, 2.0))))
    assert found.verdict == "named" and found.effects == ("shaft-friction",)
    (form,) = found.forms
    assert form.name.endswith("setting in")


def held_on_the_way_out(speed, legs, seed):
    """Rows along straight legs [m] at a speed: 2 N of pull within 0.2 mm of the way back, none where it sinks."""
    random = np.random.default_rng(seed)
    ends = np.cumsum([0.0, *np.abs(legs)]) / speed
    time = np.linspace(0.0, ends[-1], 400)
    z = np.interp(time, ends, np.cumsum([0.0, *legs]))
    way = np.sign(legs)[np.clip(np.searchsorted(ends, time) - 1, 0, len(legs) - 1)]
    pull = np.where(way < 0, 2.0 * np.minimum((np.maximum.accumulate(z) - z) / 2e-4, 1.0), 0.0)
    force = np.where(z > 0, STIFFNESS * z + DAMPING * speed * (way > 0) - pull, 0.0)
    return Recording({"t_s": time, "depth_m": z + DEPTH_STD * random.standard_normal(len(z)),
                      "force_N": force + FORCE_STD * random.standard_normal(len(z))})  # fmt: skip


@pytest.mark.long
def test_what_no_fitted_trial_shows_of_a_form_is_learnt_from_those_held_out_and_others_judge():
    # Two pushes go in again for 1.2 mm on their way out, and are held out (else they are like their replicates).
    trials, plain, again = [], (0.02, -0.016), (0.02, -0.008, 0.0012, -0.0092)
    for k, speed in enumerate((0.01, 0.02, 0.04, 0.08)):
        for copy, legs in enumerate((plain, again if k in (0, 2) else plain)):
            rows = held_on_the_way_out(speed, legs, seed=60 + 2 * k + copy)
            trials.append((f"{k}{copy}", "driven", speed, rows))
    problem = make_problem(campaign_of(trials))
    assert split_trials(problem.trials)[1] == ("01", "21")
    found = diagnose(problem)
    assert found.verdict == "named" and found.effects == ("adhesion",)
    assert found.held_out == ("00", "20")
    assert found.after.held_out < 1.3 and found.forms[0].name.endswith("on the way out")


def test_a_pull_lets_go_over_another_way_than_it_is_taken_up():
    depth = np.concatenate([np.linspace(1e-4, 0.02, 400), np.linspace(0.02, 0.001, 400)[1:]])
    speed, force = pushed(depth, pull=2.0, pull_reach=1e-4, pull_sharpness=5.0, pull_let=4e-3)
    pull = STIFFNESS * depth + DAMPING * np.maximum(speed, 0.0) - force
    back = 0.02 - depth
    gone = (np.arange(len(depth)) > 400) & (back > 5e-4)
    assert pull[gone] == pytest.approx(2.0 * np.exp(-back[gone] / 4e-3), rel=1e-3)
    assert pull[:400] == pytest.approx(0.0, abs=1e-12)


def test_a_drag_that_grows_until_the_tip_is_in_has_a_corner_there():
    depth = np.linspace(1e-4, 0.02, 400)
    speed, force = pushed(depth, drag_onset=1e4, drag_reach=6e-3, drag_sharpness=8.0)
    drag = (force - STIFFNESS * depth - DAMPING * speed) / (1e4 * speed**2)
    away = np.abs(depth - 6e-3) > 2e-3
    assert drag[away] == pytest.approx(np.minimum(1.0, depth / 6e-3)[away], abs=0.015)


@pytest.mark.parametrize("size", [0.0, 0.4])
def test_a_slow_misfit_shows_where_the_noise_is_less_than_stated(size):
    """Noise of 0.9 of what is stated leaves 0.81 a sample; a wave of 0.4 of it over depth adds 0.08: less than 1."""

    def wavy(z, v, top=0.0):
        return STIFFNESS * z + DAMPING * max(v, 0.0) + size * FORCE_STD * math.sin(1e3 * z)

    trials = [(f"{k:02d}", "driven", speed, driven_trial(wavy, speed=speed, seed=90 + k, force_std=0.9 * FORCE_STD))
              for k, speed in enumerate((0.01, 0.03, 0.06, 0.03))]  # fmt: skip
    problem = make_problem(campaign_of(trials))
    base = whitened_fit(Model(problem, Whitener.white(problem), tuple(t.id for t in problem.trials)))
    assert base.chi_square < base.count
    fits = CandidateFits(base, tell=lambda what, done: None)
    assert fits.leaves_nothing(Hypothesis.of(base)) == (not size)


def test_what_is_bent_may_be_bent_once_more_each_way_once():
    shapes = shapes_of(push_forms(retreats=True, speeds_differ=True, drops=True), again=True)
    (twice,) = shapes["shaft-friction:by a power of depth, setting in"]
    assert twice.id == "shaft-friction:by a power of depth, setting in, rising with speed"
    names = {p.name.partition(".")[2] for p in twice.parameters}
    assert {"shaft_power", "shaft_growth", "shaft_onset", "shaft_rise"} <= names
    assert twice.id not in shapes and "shaft-friction:by a power of depth, rising with speed" not in shapes


def lets_go(z, v, top=0.0):
    back = top - z
    pull = 2.5 * math.exp(-back / 4e-3) * (1 - math.exp(-back / 2e-4)) if v < 0 else 0.0
    return STIFFNESS * z + DAMPING * max(v, 0.0) - pull


@pytest.mark.long
def test_a_pull_that_is_there_at_once_and_lets_go_over_millimetres_is_adhesion():
    trials = []
    for k, speed in enumerate((0.01, 0.03, 0.06) * 2):
        trials.append((f"{k:02d}", "driven", speed, driven_trial(lets_go, speed=speed, retreat=True, seed=60 + k)))
    found = diagnose(make_problem(campaign_of(trials)))
    assert (found.verdict, found.effects) == ("named", ("adhesion",))
    assert found.before.held_out > 20 and found.after.held_out < 1.2


def locking(z, v, top=0.0):
    return STIFFNESS * z / (1 - z / 0.035) + DAMPING * max(v, 0.0)


@pytest.mark.long
def test_a_bed_that_locks_is_hardening_and_no_layer():
    trials = [(f"{k:02d}", "driven", speed, driven_trial(locking, speed=speed, seed=70 + k))
              for k, speed in enumerate((0.01, 0.03, 0.06) * 2)]  # fmt: skip
    found = diagnose(make_problem(campaign_of(trials)))
    assert (found.verdict, found.effects) == ("named", ("depth-hardening",))
    assert found.after.held_out < 1.2


def test_a_small_step_is_found_from_the_side_on_which_it_lies():
    # From a step down it would have to go through none at all, where its place and width say nothing.
    def step(z, v, top=0.0):
        return STIFFNESS * z + DAMPING * max(v, 0.0) + 0.5 / (1 + math.exp(-(z - 0.01) / 6e-4))

    trials = [(f"{k:02d}", "driven", speed, driven_trial(step, speed=speed, seed=80 + k))
              for k, speed in enumerate((0.01, 0.03, 0.06, 0.03))]  # fmt: skip
    problem = make_problem(campaign_of(trials))
    base = whitened_fit(Model(problem, Whitener.white(problem), tuple(t.id for t in problem.trials)))
    form = next(form for form in problem.forms if form.id == "layering:step")
    (found,) = best_starts(base.model, [form], base.values)
    assert problem.reported(found.values, form)["layer_step"][0] == pytest.approx(0.5, rel=0.1)
    assert problem.reported(found.values, form)["layer_depth"][0] == pytest.approx(0.01, rel=0.03)
    assert found.chi_square / found.count < 1.1
    other = next(form for form in problem.forms if form.effect == "depth-hardening")
    _, again = best_starts(base.model, [other, form], base.values)  # the same bits beside another one's fits
    assert (again.values, again.chi_square) == (found.values, found.chi_square)
