"""Pushes and drops in a bed that relaxes and that a spike carries along: closed forms, and whole diagnoses."""

import math

import numpy as np
import pytest
from penetration_campaigns import (
    ACCEL_STD,
    DAMPING,
    DEPTH_STD,
    FORCE_STD,
    GRAVITY,
    MASS,
    STIFFNESS,
    campaign_of,
    driven_trial,
)  # fmt: skip
from scipy.integrate import solve_ivp

from experiments.campaign import Recording
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.fit.forms import load_own
from experiments.diagnose.push.law import fall, given_way, push
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.push.slots import SLOTS, slot_places, slot_table

C_RELAX, SOON, B = 0.04, 0.1, 8.0


def lane(**numbers):
    table = slot_table(1)
    given = {"mass": MASS, "gravity": GRAVITY, "stiffness": STIFFNESS, "reference": 0.015, "radius_depth": 0.006}
    for name, value in (given | numbers).items():
        table[0, SLOTS.index(name)] = value
    return table


def path_of(rows):
    return np.zeros(1, dtype=np.int32), np.array([0, rows], dtype=np.int32)


def test_a_spike_that_is_held_loses_force_with_the_logarithm_of_time():
    # F = K z (1 - c ln(1 + t / tau)) at a depth reached in no time.
    time, depth = np.linspace(0, 20, 401), np.full(401, 0.02)
    numbers = lane(relax_share=C_RELAX, relax_soon=SOON)
    force = push(numbers, *path_of(401), depth, np.zeros(401), times=time)[0]
    assert force == pytest.approx(STIFFNESS * 0.02 * (1 - C_RELAX * np.log(1 + time / SOON)), rel=1e-9)
    coarse = push(numbers, *path_of(2), depth[:2], np.zeros(2), times=time[[0, -1]])[0]
    assert coarse[-1] == pytest.approx(force[-1], rel=1e-12)  # whatever the rows
    assert (push(numbers, *path_of(401), depth, np.zeros(401))[0] == STIFFNESS * 0.02).all()  # no time, no loss
    (gone,) = given_way(numbers[0], None, 0.02, 20.0)
    assert gone == pytest.approx(C_RELAX * 0.02 * math.log(201), rel=1e-12)
    numbers[0, SLOTS.index("given_way")] = gone  # as a ground that is stepped has it
    assert push(numbers, *path_of(2), depth[:2], np.zeros(2))[0, 1] == pytest.approx(force[-1], rel=1e-12)


def test_a_bed_with_one_time_constant_is_a_standard_linear_solid():
    # In at v: K z + f K v tau (1 - exp(-t / tau)); held from t_1 on, the second part fades with exp(-(t - t_1) / tau).
    f, tau, v = 0.5, 0.2, 0.04
    time = np.linspace(0, 2.0, 4001)
    depth, speed = np.minimum(v * time, 0.02), np.where(time <= 0.5, v, 0.0)
    force = push(lane(relax_fast=f, relax_soon=tau), *path_of(4001), depth, speed, times=time)[0]
    grown, faded = 1 - np.exp(-np.minimum(time, 0.5) / tau), np.exp(-np.maximum(time - 0.5, 0) / tau)
    assert force == pytest.approx(STIFFNESS * (depth + f * v * tau * grown * faded), rel=1e-4, abs=1e-4)


SLOWLY = '''
from math import exp

from rigid.terms.candidate import Candidate, Form, Push, amplitude
from rigid.terms.term import Parameter, Term


def flowing(gone, z, span, flow_rate):
    """de/dt = r (z - e): the bed flows away as honey does."""
    return z + (gone - z) * exp(-flow_rate * span)


TERM = Term(id="flow", summary="the bed flows", acts="contact", source="a test", limits="none",
            parameters=(Parameter("rate", "1/s", 0.0, "r", lowest=0.0),))
CANDIDATE = Candidate(
    meaning="the bed flows", confirm="hold it",
    push=Push(law={"settle": flowing}, forms=(Form("flow", (amplitude("flow_rate", "plain", 0.1, 0.0, 9.0),), ()),)),
)
'''


def test_two_effects_that_give_way_keep_a_state_each_on_pushes_and_drops(tmp_path):
    (tmp_path / "flow.py").write_text(SLOWLY)
    own = (load_own(tmp_path / "flow.py"),)
    table = slot_table(1, own)
    table[0, : len(SLOTS)] = lane(relax_share=C_RELAX, relax_soon=SOON, damping=DAMPING)[0]
    table[0, slot_places(own)["flow_rate"]] = rate = 0.3

    def rates(z, e):
        flown, crept = e  # each gives way by its share of what the other leaves
        size = C_RELAX * np.maximum(z - flown, 1e-12)
        return [rate * (z - crept - flown), size / SOON * np.exp(-crept / size)]

    time, depth = np.linspace(0, 8, 2001), np.full(2001, 0.02)
    force = push(table, *path_of(2001), depth, np.zeros(2001), own, time)[0]
    exact = solve_ivp(lambda t, e: rates(0.02, e), (0, 8), [0.0, 0.0], t_eval=time, rtol=1e-10, atol=1e-14)
    left = 0.02 - exact.y.sum(axis=0)
    assert force == pytest.approx(STIFFNESS * left, rel=2e-4)
    assert left[-1] < 0.8 * min(0.02 - exact.y[0, -1], 0.02 - exact.y[1, -1])  # both act
    gone = None
    for _ in range(2000):  # as a ground that is stepped has it, bit by bit
        gone = given_way(table[0], gone, 0.02, 8 / 2000, own)
    assert gone.shape == (2,)
    assert STIFFNESS * (0.02 - gone.sum()) == pytest.approx(force[-1], rel=1e-6)  # in steps of half and of whole rows

    time = np.linspace(0, 0.15, 151)
    found = fall(table, *path_of(151), time, np.array([0.5]), own)[0]

    def falling(t, y):
        z, v = y[:2]
        bed = max(STIFFNESS * (z - y[2] - y[3]), 0.0) + DAMPING * max(v, 0.0) if z > 0 else 0.0
        return [v, GRAVITY - bed / MASS, *(rates(z, y[2:]) if z > 0 else (0.0, 0.0))]

    exact = solve_ivp(falling, (0, 0.15), [0.0, 0.5, 0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12, max_step=1e-4)
    inside = exact.y[0] > 1e-3
    assert found[inside, 0] == pytest.approx(exact.y[0][inside], abs=2e-7)


def test_a_drop_into_a_bed_that_relaxes_is_that_of_its_equations():
    time = np.linspace(0, 0.15, 151)
    found = fall(lane(relax_share=C_RELAX, relax_soon=SOON, damping=DAMPING), *path_of(151), time, np.array([0.5]))[0]

    def rates(t, y):
        z, v, e = y
        force = max(STIFFNESS * (z - e), 0.0) + DAMPING * max(v, 0.0) if z > 0 else 0.0
        size = C_RELAX * max(z, 1e-12)
        return [v, GRAVITY - force / MASS, size / SOON * math.exp(-e / size) if z > 0 else 0.0]

    exact = solve_ivp(rates, (0, 0.15), [0.0, 0.5, 0.0], t_eval=time, rtol=1e-9, atol=1e-12, max_step=1e-4)
    inside = exact.y[0] > 1e-3
    assert found[inside, 0] == pytest.approx(exact.y[0][inside], abs=2e-7)


def test_a_drop_that_carries_its_ground_along_shares_its_momentum():
    # Without spring, damper and weight: (m + b z) v = m v_0, so m z + b z^2 / 2 = m v_0 t.
    time = np.linspace(0, 0.15, 151)
    numbers = lane(stiffness=0.0, gravity=0.0, drag_carried=B)
    z, v, a, _ = fall(numbers, *path_of(151), time, np.array([0.5]))[0].T
    exact = (np.sqrt(MASS**2 + 2 * B * MASS * 0.5 * time) - MASS) / B
    assert z == pytest.approx(exact, abs=1e-9)
    assert v == pytest.approx(MASS * 0.5 / (MASS + B * exact), abs=1e-8)
    assert a[1:] == pytest.approx((-B * v**2 / (MASS + B * z))[1:], rel=1e-6)


def relaxing(*, speed, hold, seed):
    """Rows of a push to 20 mm and a hold, in a bed that relaxes."""
    random = np.random.default_rng(seed)
    reach = 0.02 / speed
    time = np.linspace(0, reach + hold, 500)
    z, v = np.minimum(speed * time, 0.02), np.where(time < reach, speed, 0.0)
    numbers = lane(relax_share=C_RELAX, relax_soon=SOON, damping=DAMPING, speed_scale=1e-6)
    force = push(numbers, *path_of(500), z, v, times=time)[0]
    return Recording({"t_s": time, "depth_m": z + DEPTH_STD * random.standard_normal(500),
                      "force_N": force + FORCE_STD * random.standard_normal(500)})  # fmt: skip


@pytest.mark.long
def test_a_bed_that_relaxes_is_named():
    trials = [(f"{k}", "driven", v, relaxing(speed=v, hold=hold, seed=k))
              for k, (v, hold) in enumerate(((0.01, 5.0), (0.05, 20.0), (0.01, 20.0), (0.05, 5.0)))]  # fmt: skip
    found = diagnose(make_problem(campaign_of(trials)))
    assert (found.verdict, found.effects) == ("named", ("relaxation",))
    assert found.after.held_out < 1.2
    assert found.parameters("relaxation")["relax_share"]["value"] == pytest.approx(C_RELAX, abs=0.004)


@pytest.mark.long
def test_holds_in_a_bed_that_does_not_relax_are_no_effect():
    trials = []
    for k, (v, hold) in enumerate(((0.01, 5.0), (0.05, 20.0), (0.01, 20.0), (0.05, 5.0))):
        random, time = np.random.default_rng(k), np.linspace(0, 0.02 / v + hold, 500)
        z = np.minimum(v * time, 0.02)
        force = STIFFNESS * z + DAMPING * np.where(z < 0.02, v, 0.0)
        noise = {"depth_m": z + DEPTH_STD * random.standard_normal(500),
                 "force_N": force + FORCE_STD * random.standard_normal(500)}  # fmt: skip
        trials.append((f"{k}", "driven", v, Recording({"t_s": time, **noise})))
    assert diagnose(make_problem(campaign_of(trials))).verdict == "none"


@pytest.mark.long
def test_ground_that_drops_carry_along_is_named_as_drag():
    # By scipy: m' = b v, so (m + b z) a = m g - F - b v^2 while it sinks.
    def drop(speed, seed):
        random, time = np.random.default_rng(seed), np.linspace(0, 0.15, 151)

        def accel(z, v):
            sinks = v > 0 and z > 0
            force = STIFFNESS * z + DAMPING * max(v, 0.0) + B * max(v, 0.0) ** 2 if z > 0 else 0.0
            return (GRAVITY - force / MASS) / (1 + (B * z / MASS if sinks else 0.0))

        y = solve_ivp(lambda t, y: [y[1], accel(*y)], (0, 0.15), [0.0, speed], t_eval=time, rtol=1e-9, atol=1e-11,
                      max_step=2e-4).y  # fmt: skip
        a = np.array([accel(*row) for row in y.T])
        return Recording({"t_s": time, "depth_m": y[0] + DEPTH_STD * random.standard_normal(151),
                          "accel_m_s2": a + ACCEL_STD * random.standard_normal(151)})  # fmt: skip

    def plain(z, v, top):
        return STIFFNESS * z + DAMPING * max(v, 0.0) + B * max(v, 0.0) ** 2

    trials = [(f"d{k}", "drop", v, drop(v, k)) for k, v in enumerate((0.3, 0.6, 0.9, 0.6))]
    trials += [(f"p{k}", "driven", 0.05, driven_trial(plain, speed=0.05, seed=10 + k)) for k in range(2)]
    found = diagnose(make_problem(campaign_of(trials)))
    assert (found.verdict, found.effects) == ("named", ("inertial-drag",))
    assert found.after.held_out < 1.2
    assert "drag_carried" in found.parameters("inertial-drag")
