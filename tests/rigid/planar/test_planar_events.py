"""Stick and slip, impacts, simultaneous events, and what could chatter or hang."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rigid_trials import LENGTH, MASS, G, counterweight, drawn, drawn_effect, effect, free, in_rig

from rigid import EFFECTS, GROUNDS, Effect, Ground, Trial, simulate
from rigid.planar.dynamics import Modes, System
from rigid.planar.located import integrate

ACTING = [id for id, term in EFFECTS.items() if not term.sensor]


def from_pose(trial, z, duration, *, top=None, tolerance=1e-9):
    """Integrate from any state, no spike in the ground; the history of accepted steps."""
    system, rows = System(trial), []
    modes = Modes(slip=[0] * 8, top=[0.0] * 8)
    modes.torque_over = True
    told = integrate(
        system, duration=duration, tolerance=tolerance, start=([*z, 0.0, 0.0, 0.0], modes),
        on_step=lambda t0, t1, z1, at, kind: rows.append((t1, *z1, len(kind.touching))),
    )  # fmt: skip
    return told, np.array(rows)


def test_a_spike_that_sticks_stays_where_it_is():
    run = simulate(in_rig(0.125, mu_s=2.0), duration=1.0, tolerance=1e-9)
    pivot = run.state == 1
    assert pivot.sum() > 500
    tip = run.x - LENGTH * np.sin(run.theta + math.pi / 8 - math.pi / 4)
    assert np.ptp(tip[pivot][5:]) < 1e-13
    slip = run.vx - run.omega * LENGTH * np.cos(run.theta - math.pi / 8)
    assert np.abs(slip[pivot]).max() < 1e-9  # samples lie on the interpolant


def test_it_slips_when_the_force_to_hold_passes_mu_s_n_and_not_before():
    # One spike sticks in a pivot; the force that holds it is m ax, its load (m + m_b)(ay + g_sim).
    trial = in_rig(0.125, mu_s=0.5)
    run = simulate(trial, duration=2.0, tolerance=1e-9)
    begins = [t for t, name, _ in run.transitions if name == "slip"]
    into = begins[1]  # the first is the torque's jerk at t = 0
    held = (run.state == 1) & (run.time < into)
    load = (MASS + trial.counterweight) * (run.ay + trial.gravity_sim)
    ratio = MASS * np.abs(run.ax) / np.where(run.state == 3, np.inf, load)
    assert (ratio[held] <= trial.mu_s * (1 + 1e-6)).all()
    assert ratio[held][-1] == pytest.approx(trial.mu_s, rel=0.02)
    sliding = (run.state == 2) & (run.time > into) & (run.time < into + 0.01)
    assert ratio[sliding] == pytest.approx(0.5 * trial.mu_s, rel=1e-6)


def test_the_torque_s_jerk_on_two_soft_feet_is_m_h_tau_over_j_plus_m_h_squared():
    # At t = 0 the springs have not moved: the platform turns about the line of its feet, h below the centre, and the
    # force to hold them is m h tau / (J + m h^2) whatever K. So steel slips at once at 0.125 N m in this model too.
    h = LENGTH * math.cos(math.pi / 8)
    for mu_s, expected in ((0.25, "slip"), (0.5, "slip"), (0.62, "stand")):
        trial = in_rig(0.125, mu_s=mu_s)
        needed = MASS * h * 0.125 / (trial.inertia + MASS * h * h)
        assert (needed > mu_s * trial.weight) == (expected == "slip")
        assert simulate(trial, duration=0.01).transitions[0][1] == expected


def test_the_wheel_s_stop_ends_the_torque_at_its_moment():
    trial = in_rig(6.0, actuator="brake", wheel_speed_0=10.0, mu_s=0.25)
    stop = 10.0 * 1.2e-3 / 6.0
    run = simulate(trial, duration=0.05)
    assert run.wheel_speed[run.time > stop].max() == 0.0
    assert run.wheel_speed[1] == pytest.approx(10 - 1e-3 * 6.0 / 1.2e-3, rel=1e-12)
    assert run.torque_work[-1] == pytest.approx(np.interp(stop, run.time, run.torque_work), rel=1e-6)


def test_the_torque_ends_when_it_should_and_resumes_at_the_next_contact():
    until = 0.31234
    run = simulate(in_rig(0.22, torque_until=until), duration=0.6)
    assert run.wheel_speed[-1] == pytest.approx(0.22 * until / 1.2e-3, rel=1e-12)
    longer = simulate(in_rig(0.22), duration=2.0)
    assert [name for _, name, _ in longer.transitions].count("hop") >= 1
    touched = sum(
        t1 - t0
        for (t0, name, _), (t1, _, _) in zip(
            longer.transitions, [*longer.transitions[1:], (2.0, "end", 0.0)], strict=True
        )
        if name != "hop"
    )
    assert longer.wheel_speed[-1] == pytest.approx(0.22 * touched / 1.2e-3, rel=1e-9)


def test_a_drop_on_two_rows_at_once_is_one_moment_and_stays_level():
    trial = free()
    told, rows = from_pose(trial, [0.0, LENGTH * math.cos(math.pi / 8) + 0.05, 0.0, 0.0, 0.0, 0.0], 3.0)
    assert told.forced_steps == 0
    first = told.transitions[1]
    assert first[0] == pytest.approx(math.sqrt(2 * 0.05 / trial.gravity_sim), rel=1e-9)
    # Two touch-downs without a step between them; theta and x stay where they are but for rounding.
    assert np.abs(rows[:, 3]).max() < 1e-12 and np.abs(rows[:, 1]).max() < 1e-12


def test_bounces_die_out_and_end_in_a_stand():
    # Each rebound is lower; the contact lasts pi sqrt(M / 2K) at least, so there is no infinity of them.
    trial = free(damping=200.0, mu_s=1.0)
    told, rows = from_pose(trial, [0.0, LENGTH * math.cos(math.pi / 8) + 0.01, 0.0, 0.0, 0.0, 0.0], 20.0)
    assert told.forced_steps == 0 and told.events < 400
    assert rows[-1][-1] == 2
    sinkage = trial.weight / (2 * trial.stiffness)
    assert rows[-1][2] == pytest.approx(LENGTH * math.cos(math.pi / 8) - sinkage, abs=1e-7)


def test_a_grazing_touch_between_two_steps_is_found():
    # A tip that dips 1e-9 m into the ground at the bottom of a fast turn, seen by no step's end.
    trial = free(stiffness=1e3, damping=0.0, mu_s=0.0)
    omega, dip = 4.0, 1e-9
    angle = math.pi / 8
    z = [0.0, LENGTH - dip, -angle - 0.04, 0.0, 0.5 * trial.gravity_sim * 0.02, omega]
    # The lowest tip passes the vertical after 0.01 s; then y is back at its start + g t^2 / 2 of the rise.
    rise = 0.5 * trial.gravity_sim * 0.02 * 0.01 - 0.5 * trial.gravity_sim * 0.01**2
    z[1] -= rise
    told, _ = from_pose(trial, z, 0.03)
    names = [name for _, name, _ in told.transitions]
    assert names == ["hop", "slip", "hop"]
    shy = list(z)
    shy[1] += 3 * dip
    told, _ = from_pose(trial, shy, 0.03)
    assert [name for _, name, _ in told.transitions] == ["hop"]


@pytest.mark.parametrize("damping", [0.0, 60.0, 3e3])
@pytest.mark.parametrize("stiffness", [1e3, 1e6])
def test_a_long_tumble_over_many_spikes_neither_hangs_nor_loses_its_books(stiffness, damping):
    trial = in_rig(0.4, mu_s=0.6, stiffness=stiffness, damping=damping)
    run = simulate(trial, duration=4.0, sample_interval=0.01)
    assert run.notes["forced_steps"] == 0
    assert run.notes["events"] < 2000
    assert run.energy_residual < 1e-6


def test_equal_static_and_sliding_friction_does_not_chatter():
    trial = in_rig(0.125, mu_s=0.3, mu_d=0.3)
    run = simulate(trial, duration=2.0)
    assert run.notes["forced_steps"] == 0 and run.notes["events"] < 300
    assert run.energy_residual < 1e-8


def test_no_friction_at_all_slides_and_never_moves_sideways():
    run = simulate(in_rig(0.2, mu_s=0.0), duration=1.0)
    assert np.abs(run.x).max() == 0.0
    assert {name for _, name, _ in run.transitions} <= {"slip", "hop"}


def test_events_crowded_by_force_are_answered_with_a_counted_step(monkeypatch):
    # Should the modes ever alternate without time passing, the fallback moves on and says so.
    import rigid.planar.located as located

    trial = in_rig(0.125, mu_s=0.5)
    real, calls = located._switch, [0]

    def stubborn(system, time, z, modes, event, forced):
        calls[0] += 1
        rate = real(system, time, z, modes, event, forced)
        if not forced and calls[0] < 60 and modes.touching:  # undo what was decided: the same event again
            for n in modes.touching:
                modes.slip[n] = -1 if z[3] > 0 else 1
            rate = system.derivative(time, z, modes)
        return rate

    monkeypatch.setattr(located, "_switch", stubborn)
    run = simulate(trial, duration=0.3)
    assert run.notes["forced_steps"] >= 1
    assert np.isfinite(run.x).all() and run.time[-1] == 0.3


def test_a_spike_that_a_counted_step_leaves_out_of_the_ground_books_what_the_ground_still_held():
    # Adhesive ground holds A (back - d (1 - exp(-back / d))) of a tip drawn back from its deepest depth; pulled free of
    # the surface within the step, that energy is no longer the ground's: it is lost, as where a lift-off is located.
    import rigid.planar.located as located

    force, reach, deepest, above = 0.8, 1e-4, 4e-4, 1e-6
    trial = in_rig(effects=(effect("adhesion", force=force, reach=reach),))
    system = System(trial)
    modes = Modes(touching=[0, 7], slip=[1] * 8, top=[deepest] * 8, held=[deepest] * 8)
    z = [0.0, LENGTH * math.cos(math.pi / 8) + above, 0.0, 0.01, 0.1, 0.0, 0.0, 0.0, 0.0]
    before = sum(system.energy(0.0, z, modes))
    located._set_by_speeds(system, z, modes)
    assert modes.touching == [] and modes.state == "hop"
    held = 2 * force * (deepest - reach * (1 - math.exp(-deepest / reach)))
    assert z[8] == pytest.approx(held, rel=1e-12)
    assert sum(system.energy(0.0, z, modes)) + z[8] == pytest.approx(before, rel=1e-12)


def test_bearing_drag_holds_the_platform_against_a_smaller_torque_while_the_wheel_speeds_up():
    trial = in_rig(0.05, effects=(effect("bearing-drag", torque=0.06),))
    run = simulate(trial, duration=10.0, sample_interval=0.1)
    assert (run.theta == 0.0).all() and (run.omega == 0.0).all()
    assert run.wheel_speed == pytest.approx(0.05 * run.time / 1.2e-3, rel=1e-12)  # J_w w' = tau
    stepped = simulate(trial, duration=1.0, method="paper")
    assert stepped.wheel_speed[-1] == pytest.approx(0.05 / 1.2e-3, rel=1e-9)


def test_a_brake_that_the_bearing_bears_ends_when_its_wheel_stands():
    # At rest all along: w = w_0 - tau t / J_w down to 0 at 1.2 s.
    trial = in_rig(0.05, actuator="brake", wheel_speed_0=50.0, effects=(effect("bearing-drag", torque=0.06),))
    for method, slack in (("located", 1e-12), ("paper", 1e-9)):
        run = simulate(trial, duration=2.0, method=method)
        assert run.wheel_speed == pytest.approx(np.maximum(50.0 - 0.05 * run.time / 1.2e-3, 0.0), abs=50 * slack + 5e-9)
        assert (run.theta == 0.0).all()


def test_bearing_drag_slows_a_hop_at_drag_over_j_and_stops_it():
    # J alpha = -T until it stops, then nothing turns: T / J = 0.5 rad/s2.
    trial = free(effects=(effect("bearing-drag", torque=0.03),))
    _, rows = from_pose(trial, [0.0, 0.5, 0.0, 0.0, 0.0, 0.2], 1.0)
    t, omega = rows[:, 0], rows[:, 6]
    assert np.interp(0.2, t, omega) == pytest.approx(0.2 - 0.5 * 0.2, rel=1e-9)
    assert omega[-1] == 0.0
    assert rows[-1][3] == pytest.approx(0.2**2 / (2 * 0.5), rel=1e-9)


def test_rig_friction_slows_the_rise_and_the_fall_of_a_hop():
    # (m + m_b) ay = -W -+ F.
    trial = in_rig(effects=(effect("rig-friction", force=0.2),))
    inertia = MASS + trial.counterweight
    _, rows = from_pose(trial, [0.0, 0.5, 0.0, 0.0, 0.1, 0.0], 3.0)
    t, vy = rows[:, 0], rows[:, 5]
    up = 0.1 / ((trial.weight + 0.2) / inertia)
    assert np.interp(0.5 * up, t, vy) == pytest.approx(0.05, rel=1e-6)
    falling = (trial.weight - 0.2) / inertia
    assert vy[-1] == pytest.approx(-falling * (3.0 - up), rel=1e-6)


def test_bearing_drag_that_is_more_near_rest_stops_a_hop_after_the_angle_of_its_closed_form():
    # J omega d(omega)/d(theta) = -T (1 + a exp(-(omega / w0)^2)), so theta = J w0^2 / 2 T ln((exp(u) + a) / (1 + a)),
    # u = (omega_0 / w0)^2: Stribeck's curve as in Armstrong-Helouvry et al. 1994, Automatica 30:1083.
    torque, a, w0 = 0.03, 0.8, 0.15
    trial = free(effects=(effect("bearing-drag", torque=torque, excess=a, speed=w0),))
    _, rows = from_pose(trial, [0.0, 0.5, 0.0, 0.0, 0.0, -0.2], 1.0)
    turned = trial.inertia * w0**2 / (2 * torque) * math.log((math.exp((0.2 / w0) ** 2) + a) / (1 + a))
    assert rows[-1][6] == 0.0
    assert rows[-1][3] == pytest.approx(-turned, rel=1e-8)
    assert turned < 0.2**2 * trial.inertia / (2 * torque)  # less far than with the level alone


def test_rig_friction_that_is_more_near_rest_lowers_a_hop_as_its_closed_form_says():
    # (m + m_b) v dv/dy = -(W + F) (1 + b exp(-(v / v0)^2)), b = F a / (W + F).
    force, a, v0 = 0.2, 1.5, 0.04
    trial = in_rig(effects=(effect("rig-friction", force=force, excess=a, speed=v0),))
    _, rows = from_pose(trial, [0.0, 0.5, 0.0, 0.0, 0.1, 0.0], 3.0)
    level = trial.weight + force
    b = force * a / level
    risen = (MASS + trial.counterweight) * v0**2 / (2 * level) * math.log((math.exp((0.1 / v0) ** 2) + b) / (1 + b))
    assert rows[:, 2].max() == pytest.approx(0.5 + risen, rel=1e-6)


@pytest.mark.parametrize(("excess", "held"), [(0.0, False), (0.2, False), (0.3, True)])
def test_a_bearing_at_rest_bears_its_level_and_the_excess(excess, held):
    # It holds 0.05 N m as long as 0.04 (1 + excess) is more.
    trial = in_rig(0.05, effects=(effect("bearing-drag", torque=0.04, excess=excess, speed=0.05),))
    run = simulate(trial, duration=2.0, sample_interval=0.1)
    assert (run.theta == 0.0).all() == held


@pytest.mark.parametrize("way", [1, -1])
def test_friction_that_has_only_just_begun_to_slide_opposes_the_motion_with_all_its_excess(way):
    both = (effect("bearing-drag", torque=0.04, excess=0.5), effect("rig-friction", force=0.2, excess=0.5))
    trial = in_rig(effects=both)
    modes = Modes(slip=[0] * 8, top=[0.0] * 8, dry=[way, way])
    modes.torque_over = True
    told = System(trial).derivative(0.0, [0.0, 0.5, 0.0, 0.0, way * 1e-9, way * 1e-9, 0.0, 0.0, 0.0], modes)
    assert told[5] * trial.inertia == pytest.approx(-way * 0.06, rel=1e-9)
    rises = (MASS + trial.counterweight) * told[4]
    assert rises == pytest.approx(-trial.weight - way * 0.3, rel=1e-9)


def test_pulleys_that_rub_harder_than_the_weight_hold_it_in_the_air():
    trial = in_rig(effects=(effect("rig-friction", force=1.0),))
    _, rows = from_pose(trial, [0.0, 0.5, 0.0, 0.0, 0.1, 0.0], 5.0)
    assert rows[-1][5] == 0.0 and rows[-1][2] > 0.5


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    seed=st.integers(0, 10**6),
    effects=st.lists(st.sampled_from(ACTING), max_size=4, unique=True),
    ground=st.sampled_from([None, None, *GROUNDS]),
    mu_s=st.sampled_from([None, None, None, 0.0, 0.02, 3.0]),
    damping=st.sampled_from([None, None, 0.0, 1e3]),
)
def test_any_trial_with_any_effects_on_any_ground_ends_with_its_books_closed(seed, effects, ground, mu_s, damping):
    rng = np.random.default_rng(seed)
    changes = {"ground": None if ground is None else Ground(name=ground, spikes_per_row=2)}
    changes |= {key: value for key, value in (("mu_s", mu_s), ("damping", damping)) if value is not None}
    trial = drawn(rng, tuple(effects))
    try:
        run = simulate(replace(trial, **changes), duration=0.8, sample_interval=0.01)
    except ValueError as problem:
        assert "cannot stand" in str(problem) or "plastic-sinkage." in str(problem)
        return
    # Without friction, under a torque that begins at zero, nothing tells sticking from sliding: one such step.
    assert run.notes["forced_steps"] <= (mu_s == 0.0 and "torque-rise" in effects)
    assert run.energy_residual < 1e-6
    assert (np.diff(run.dissipated) > -1e-9).all()
    depths = [LENGTH * np.cos(run.theta + (n + 0.5) * math.pi / 4) - run.y for n in range(8)]
    touching = np.max(depths, axis=0) > 0
    moves = {"tip-radius", "plastic-sinkage", "slip-sinkage", "relaxation"}  # the point or the depth of touching
    if ground in (None, "spring-damper") and not moves & set(effects):
        sure = np.abs(np.max(depths, axis=0)) > 1e-9
        assert ((run.state != 3) == touching)[sure].all()


def test_an_effect_with_its_defaults_changes_nothing_to_the_bit():
    bare = simulate(in_rig(0.22, mu_s=0.5), duration=0.9)
    braked = simulate(in_rig(6.0, actuator="brake", wheel_speed_0=300.0), duration=0.3)
    for id in ACTING:
        run = simulate(in_rig(0.22, mu_s=0.5, effects=(Effect(id=id),)), duration=0.9)
        fast = simulate(in_rig(6.0, actuator="brake", wheel_speed_0=300.0, effects=(Effect(id=id),)), duration=0.3)
        for channel in ("x", "y", "theta", "vx", "vy", "omega", "wheel_speed"):
            assert np.array_equal(getattr(run, channel), getattr(bare, channel)), (id, channel)
            assert np.array_equal(getattr(fast, channel), getattr(braked, channel)), (id, channel)


@pytest.mark.parametrize("id", ACTING)
def test_every_effect_moves_the_motion_and_keeps_the_books(id):
    rng = np.random.default_rng(11)
    ground = {"stiffness": 82.2, "damping": 0.713} if id == "ploughing" else {}  # acts by the depth squared: in sand
    bare = simulate(in_rig(0.22, mu_s=0.5, **ground), duration=1.6, sample_interval=0.01)
    given = {"effects": (drawn_effect(id, rng),), **ground}
    run = simulate(in_rig(0.22, mu_s=0.5, **given), duration=1.6, sample_interval=0.01)
    assert np.abs(run.theta - bare.theta).max() > 1e-4
    assert run.energy_residual < 1e-6


def test_the_rest_of_the_numbers_are_refused_by_name():
    good = {"gravity_sim": 0.0834, "counterweight": counterweight(0.0834)}
    for changes, word in (
        ({"mass": -1.0}, "mass"),
        ({"mass": math.nan}, "mass"),
        ({"inertia": 0.0}, "inertia"),
        ({"inertia": 5.3 * 0.04 * 1.001}, "inertia"),
        ({"inertia": 1e-6}, "inertia = 1e-06 kg m2 must exceed wheel_inertia = 0.0012"),
        ({"wheel_inertia": 0.06, "inertia": 0.06}, "must exceed wheel_inertia"),
        ({"wheel_inertia": 5.0}, "wheel_inertia = 5 kg m2 must be below mass spike_length"),
        ({"counterweight": 5.3}, "counterweight"),
        ({"mu_s": 0.3, "mu_d": 0.31}, "mu_d"),
        ({"actuator": "brake", "torque": 6.0}, "wheel_speed_0"),
        ({"actuator": "rocket"}, "actuator"),
        ({"gravity_sim": 9.9}, "gravity_sim"),
        ({"spike_count": 2}, "spike_count"),
        ({"torque": -0.1}, "torque"),
        ({"effects": (effect("pendulum", length=2.0),) * 2}, "twice"),
        ({"effects": (effect("com-offset", x=0.05, y=0.05), effect("tip-radius"))}, None),
    ):
        if word is None:
            Trial(**(good | {"inertia": 0.06} | changes))
            continue
        with pytest.raises(ValueError, match=word):
            Trial(**(good | changes))
    with pytest.raises(ValueError, match="needs a rig"):
        Trial(gravity_sim=0.08, effects=(effect("pendulum", length=2.0),))
    for id, parameters, word in (
        ("pendulum", {"length": -1.0}, "pendulum.length"),
        ("pendulum", {"lenght": 1.0}, "lenght"),
        ("pendulums", {}, "pendulums"),
        ("plastic-sinkage", {"share": 1.0}, "plastic-sinkage.share"),
        ("slope", {"angle": math.inf}, "slope.angle"),
    ):
        with pytest.raises(ValueError, match=word):
            Effect(id=id, parameters=parameters)


def test_a_step_too_long_for_the_ground_is_refused_by_name():
    with pytest.raises(ValueError, match="stiffness = 1e"):
        simulate(in_rig(0.2, stiffness=1e6), duration=0.1, method="paper")
    with pytest.raises(ValueError, match="time_step"):
        simulate(in_rig(0.2), duration=0.1, method="paper", time_step=3e-3)
    with pytest.raises(ValueError, match="duration"):
        simulate(in_rig(0.2), duration=math.inf)
    with pytest.raises(ValueError, match="method"):
        simulate(in_rig(0.2), duration=0.1, method="euler")
    with pytest.raises(ValueError, match="times"):
        simulate(in_rig(0.2), duration=0.1, times=[0.0, 0.2])


OWN = """
from math import cos

from rigid.terms import Parameter, Term


def potential(s, strength, at):
    return -strength * cos(s.theta - at)


def force(s, strength, at):
    back = 0.0
    if strength != 0.0:
        back = -strength * (s.theta - at)
    return 0.0, 0.0, back


TERM = Term(
    id="magnet",
    summary="a magnet that pulls back",
    acts="V",
    parameters=(
        Parameter(name="strength", unit="N m", default=0.0, summary="of the pull"),
        Parameter(name="at", unit="rad", default=0.0, summary="where it rests"),
    ),
    source="a test",
    limits="small angles",
    hooks={"force": force},
)
"""


def test_a_tip_that_touches_in_its_own_crater_is_held_by_nothing_yet():
    # Adhesion is mobilised by the retreat since the tip touched: what broke at the last lift-off does not come back.
    both = (effect("plastic-sinkage", share=0.5), effect("adhesion", force=0.3))
    trial = free(damping=0.0, mu_s=0.0, stiffness=1e3, effects=both)
    told, rows = from_pose(trial, [0.0, LENGTH * math.cos(math.pi / 8) + 0.01, 0.0, 0.0, 0.0, 0.0], 6.0)
    assert [name for _, name, _ in told.transitions].count("hop") >= 1
    run = simulate(replace(in_rig(0.2, mu_s=2.0), effects=both), duration=3.0, sample_interval=0.01)
    assert run.energy_residual < 1e-7
    assert (np.diff(rows[:, 9]) > -1e-12).all()


def test_an_effect_of_one_s_own_comes_from_a_file(tmp_path):
    file = tmp_path / "magnet.py"
    file.write_text(OWN, encoding="utf-8")
    own = Effect(id="magnet", parameters={"strength": 0.05}, file=file)
    # -k theta with no energy of its own is the umbilical's stiffness: the same motion, to the bit.
    run = simulate(in_rig(0.22, effects=(own,)), duration=0.6)
    same = simulate(in_rig(0.22, effects=(effect("umbilical", stiffness=0.05),)), duration=0.6)
    assert np.allclose(run.theta, same.theta, atol=1e-13)
    with pytest.raises(ValueError, match="no TERM"):
        (tmp_path / "empty.py").write_text("x = 1\n", encoding="utf-8")
        Effect(id="magnet", file=tmp_path / "empty.py")
    with pytest.raises(ValueError, match="not there"):
        Effect(id="magnet", file=tmp_path / "nowhere.py")
    with pytest.raises(ValueError, match="strength"):
        Effect(id="magnet", parameters={"strenght": 1.0}, file=file)


def test_gravity_is_the_local_one_at_the_centre_of_mass_in_the_rig():
    # docs/planar.md: at 0.0085 g, 1.3 mm cancels the whole restoring moment W l sin(pi/8), since the moment is m g e.
    trial = in_rig()
    cancels = trial.weight * LENGTH * math.sin(math.pi / 8) / (MASS * G)
    assert cancels == pytest.approx(1.3e-3, abs=5e-5)
    simulate(in_rig(mu_s=1.0, effects=(effect("com-offset", x=0.98 * cancels),)), duration=0.1)
    with pytest.raises(ValueError, match="tips over"):
        simulate(in_rig(mu_s=1.0, effects=(effect("com-offset", x=1.02 * cancels),)), duration=0.1)
