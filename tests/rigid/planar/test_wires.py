"""Wires that are springs: the counterweight moves on its own, and what a term with a coordinate of its own may be."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rigid_trials import MASS, G, effect, free, in_rig, turned

from rigid import simulate, simulate_batch
from rigid.model.model import assemble
from rigid.planar.dynamics import INNER, LOST, VY, Modes, System, X, Y
from rigid.planar.located import integrate
from rigid.planar.statics import standing
from rigid.terms import EFFECTS, Parameter, Term


def wires(stiffness, damping=0.0):
    return effect("wire-compliance", stiffness=stiffness, damping=damping)


def flown(trial, duration, *, stretch=0.0, rise=0.0, height=0.9, tolerance=1e-11):
    """Accepted steps (time, z) in the air from rest, the wires `stretch` [m] beyond their length at rest."""
    modes, rows = Modes(slip=[0] * 8, top=[0.0] * 8), []
    modes.torque_over = True
    start = [0.0, height, 0.0, 0.0, rise, 0.0, 0.0, 0.0, 0.0, height + stretch, rise]
    integrate(
        System(trial), duration=duration, tolerance=tolerance, start=(start, modes),
        on_step=lambda t0, t1, z1, at, kind: rows.append((t1, *z1, kind.inner)),
    )  # fmt: skip
    return np.array(rows)


def test_in_flight_the_two_masses_swing_at_k_over_their_reduced_mass():
    # s'' = -k s (1/m + 1/m_b) - c s' (1/m + 1/m_b) + W / m, about s = m_b g_sim / k; the pair's centre falls at
    # g_sim: m y + m_b b falls by (m + m_b) g_sim t^2 / 2.
    k, c = 1.5e4, 12.0
    trial = in_rig(effects=(wires(k, c),))
    mb = trial.counterweight
    inverse = 1 / MASS + 1 / mb
    rows = flown(trial, 0.4, stretch=1e-3)
    t, y, b = rows[:, 0], rows[:, 2], rows[:, 1 + INNER]
    centre, decay = mb * trial.gravity_sim / k, 0.5 * c * inverse
    rate = math.sqrt(k * inverse - decay**2)
    swing = np.exp(-decay * t) * (np.cos(rate * t) + decay / rate * np.sin(rate * t))
    assert b - y == pytest.approx(centre + (1e-3 - centre) * swing, abs=2e-12)
    fallen = 0.9 * (MASS + mb) + mb * 1e-3 - 0.5 * trial.weight * t**2
    assert MASS * y + mb * b == pytest.approx(fallen, abs=1e-11)
    assert rate / (2 * math.pi) == pytest.approx(12.0, abs=0.1)  # Hz: well within what the IMU sees


def test_standing_it_swings_at_the_frequencies_of_ground_platform_wire_counterweight():
    # 2K against the ground, k between m and m_b: after a period of its own each form of motion is back.
    k = 8e3
    trial = in_rig(damping=0.0, effects=(wires(k),))
    mb, ground = trial.counterweight, 2 * trial.stiffness
    dynamic = np.array([[(ground + k) / MASS, -k / math.sqrt(MASS * mb)], [-k / math.sqrt(MASS * mb), k / mb]])
    squares, forms = np.linalg.eigh(dynamic)
    for square, form in zip(squares, forms.T, strict=True):
        system, last = System(trial), {}
        z, modes = standing(system)
        modes.torque_over = True
        rest = list(z)
        size = 1e-6
        z[Y] += size * form[0] / math.sqrt(MASS)
        z[INNER] += size * form[1] / math.sqrt(mb)
        begin = list(z)
        integrate(
            system, duration=2 * math.pi / math.sqrt(square), tolerance=1e-12, start=(z, modes),
            on_step=lambda t0, t1, z1, at, kind, last=last: last.update(z=z1),
        )  # fmt: skip
        for i in (Y, INNER):
            assert last["z"][i] - rest[i] == pytest.approx(begin[i] - rest[i], abs=1e-5 * size)
        assert abs(last["z"][VY]) < 1e-5 * size * math.sqrt(square)


def test_slack_wires_pull_nothing_and_go_taut_where_both_have_fallen_apart_again():
    # Thrown with wires slack by a hand's breadth the platform falls at (W + m_b g) / m and the counterweight at g, so
    # the gap closes as (g + (W + m_b g) / m) t^2 / 2; then they catch each other, and energy is lost by c alone.
    gap, k, c = 0.1, 2e4, 30.0
    trial = in_rig(effects=(wires(k, c),))
    mb = trial.counterweight
    rest = mb * G / k
    rows = flown(trial, 0.3, stretch=-rest - gap, rise=1.0)
    own = (trial.weight + mb * G) / MASS
    taut = math.sqrt(2 * gap / (G + own))
    slack = (rows[:, 0] > 1e-9) & (rows[:, 0] < taut * (1 - 1e-9))
    t = rows[slack, 0]
    assert slack.sum() > 5
    assert rows[slack, 2] == pytest.approx(0.9 + t - 0.5 * own * t**2, abs=1e-11)
    assert rows[slack, 1 + INNER] == pytest.approx(0.9 - rest - gap + t + 0.5 * G * t**2, abs=1e-11)
    first = rows[1:][np.diff(rows[:, -1]) > 0][0]  # the first step that begins with taut wires
    assert first[0] - taut < 0.01
    system = System(trial)

    def energy(row):
        modes = Modes(slip=[0] * 8, top=[0.0] * 8)
        return sum(system.energy(row[0], list(row[1:-1]), modes)) + row[1 + LOST]

    assert [energy(row) for row in rows] == pytest.approx([energy(rows[0])] * len(rows), abs=1e-8)
    assert rows[-1, 1 + LOST] > 0.01


def test_stiffer_wires_come_nearer_to_the_rigid_rig_in_the_first_order_of_one_over_k():
    # Wires damped so that they follow (c = sqrt(k m)), a pivot without an impact.
    times = np.linspace(0.0, 0.35, 71)
    rigid = simulate(in_rig(0.125, mu_s=0.9), duration=0.35, times=times, tolerance=1e-11)
    errors = []
    for k in (1e5, 2e5, 4e5):
        trial = in_rig(0.125, mu_s=0.9, effects=(wires(k, math.sqrt(k * MASS)),))
        run = simulate(trial, duration=0.35, times=times, tolerance=1e-11)
        errors.append([np.abs(run.y - rigid.y)[20:].max(), np.abs(run.theta - rigid.theta)[20:].max()])
    ratios = np.array(errors)[:-1] / np.array(errors)[1:]
    assert ratios == pytest.approx(np.full((2, 2), 2.0), rel=0.05)


def slackening(damping):
    """A brake in a rig on a small world, whose wires go slack and taut several times."""
    return in_rig(
        6.0, mu_s=3.0, actuator="brake", wheel_speed_0=300, stiffness=2e4, damping=5.0, counterweight=5.0,
        gravity=0.5, effects=(wires(2e4, damping),),
    )  # fmt: skip


def test_the_books_close_taut_and_slack_to_the_tolerance():
    for trial in (in_rig(0.22, effects=(wires(1.3e4, 20.0),)), slackening(0.0), slackening(40.0)):
        residuals = [simulate(trial, duration=1.0, tolerance=t).energy_residual for t in (1e-8, 1e-10)]
        assert residuals[0] < 5e-6 and residuals[1] < 5e-8
    run = simulate(slackening(40.0), duration=1.0)
    assert run.notes["events"] > 10 and run.notes["forced_steps"] == 0


@pytest.mark.parametrize("hook", ["potential", "loss", "force", "inner_force"])
def test_a_wrong_sign_in_the_wires_opens_the_books(hook, monkeypatch):
    # That of `mass` keeps them closed: it is for the equations (tests/rigid/planar/test_equations.py) to show.
    right = EFFECTS["wire-compliance"]
    wrong = replace(right, hooks={**right.hooks, hook: turned(right.hooks[hook])})
    monkeypatch.setitem(EFFECTS, "wire-compliance", wrong)
    run = simulate(in_rig(0.22, effects=(wires(1.3e4, 20.0),)), duration=0.3, sample_interval=0.01)
    assert run.energy_residual > 5e-5


def test_the_batch_and_the_paper_s_step_converge_at_their_orders_through_slack_and_taut():
    times = np.linspace(0.0, 1.0, 101)
    exact = simulate(slackening(40.0), duration=1.0, times=times, tolerance=1e-11)
    batch, paper = [], []
    for step in (5e-4, 2.5e-4, 1.25e-4):
        many = simulate_batch([slackening(40.0)], duration=1.0, times=times, time_step=step)
        batch.append(np.abs(many.channel("y")[0] - exact.y).max())
        run = simulate(slackening(40.0), duration=1.0, times=times, method="paper", time_step=step)
        paper.append(np.abs(run.y - exact.y).max())
    assert np.polyfit(range(3), -np.log2(batch), 1)[0] == pytest.approx(2.0, abs=0.2)
    assert 0.5 < np.polyfit(range(3), -np.log2(paper), 1)[0] < 1.5
    assert batch[0] < 2e-5 and paper[0] < 1e-3


def test_at_rest_with_springs_for_wires_it_stays_at_rest():
    run = simulate(in_rig(effects=(wires(1.3e4, 20.0),)), duration=1000.0, sample_interval=10.0)
    assert (run.y == run.y[0]).all() and run.notes["steps"] == 1
    bare = simulate(in_rig(), duration=1.0)
    assert run.y[0] == bare.y[0]  # the wires' tension at rest is m_b g, whatever they are
    many = simulate_batch([in_rig(effects=(wires(1.3e4),))], duration=1.0, sample_every=100)
    assert np.ptp(many.channel("y")) < 1e-15


def test_wires_that_do_not_give_are_the_rigid_rig_to_the_bit():
    times = np.linspace(0.0, 0.5, 51)
    bare = simulate(in_rig(0.22), duration=0.5, times=times)
    stiff = simulate(in_rig(0.22, effects=(effect("wire-compliance"),)), duration=0.5, times=times)
    assert np.array_equal(bare.y, stiff.y) and np.array_equal(bare.theta, stiff.theta)
    vary = {"wire-compliance.stiffness": [math.inf, 1e4]}
    many = simulate_batch(in_rig(0.22, effects=(wires(1e4),)), duration=0.5, vary=vary, sample_every=50)
    alone = simulate_batch(in_rig(0.22), duration=0.5, sample_every=50)
    assert np.allclose(many.series[0], alone.series[0], rtol=0, atol=1e-12)
    assert np.abs(many.series[1] - alone.series[0]).max() > 1e-5


def test_a_step_too_long_for_the_wires_is_refused_by_name():
    stiff = in_rig(0.2, effects=(wires(1e6),))
    longest = 0.2 / math.sqrt(1e6 * (1 / MASS + 1 / stiff.counterweight))
    for refused in (
        lambda: simulate(stiff, duration=0.1, method="paper"),
        lambda: simulate_batch([in_rig(0.2, effects=(wires(1e4),)), stiff], duration=0.1),
        lambda: simulate_batch(stiff, duration=0.1, vary={"wire-compliance.damping": [1.0, 2.0]}),
    ):
        with pytest.raises(ValueError, match=f"time_step = 0.001 .*wire-compliance.*{longest:.3g} s"):
            refused()
    with pytest.raises(ValueError, match="needs a rig"):
        free(effects=(wires(1e4),))
    with pytest.raises(ValueError, match="above 0"):
        wires(0.0).values


def test_a_term_s_own_coordinate_comes_whole_and_alone():
    hooks = EFFECTS["wire-compliance"].hooks
    own = (Parameter(name="stiffness", unit="N/m", default=math.inf, summary=""),
           Parameter(name="damping", unit="N s/m", default=0.0, summary=""))  # fmt: skip
    given = {"id": "other", "summary": "", "acts": "", "source": "", "limits": "", "parameters": own}
    with pytest.raises(ValueError, match="inner_mass without the others"):
        Term(**given, hooks={"inner_mass": hooks["inner_mass"]})
    other = Term(**given, hooks={name: hook for name, hook in hooks.items() if name.startswith("inner")})
    with pytest.raises(ValueError, match="'wire-compliance' and 'other'"):
        assemble((EFFECTS["wire-compliance"], other), "spring-damper")


def test_with_the_mass_off_the_shaft_and_a_slope_it_still_starts_at_rest():
    trial = in_rig(effects=(wires(1.3e4), effect("com-offset", x=2e-4), effect("slope", angle=0.02)))
    z, _ = standing(System(trial))
    up = math.sin(0.02), math.cos(0.02)
    assert z[INNER] == pytest.approx(up[0] * z[X] + up[1] * z[Y], abs=1e-16)
    run = simulate(trial, duration=10.0, sample_interval=1.0)
    assert np.ptp(run.y) < 1e-12
