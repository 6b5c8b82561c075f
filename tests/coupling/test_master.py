"""The master on a surface law: the planar model again, to its tolerance; momentum, rest, order, books, restart."""

import math
from dataclasses import replace

import numpy as np
import pytest

from coupling import MOST_REVERSAL, CoupledTumble, LawGround, Master, PlanarBody
from coupling.law_ground import row_tips
from coupling.poses import Wrench
from experiments.grains.bed_result import unsettled_warning
from rigid import Effect, SpringDamper, Trial, simulate
from rigid.ground.reaction import Contact, Reaction

RIG = {"gravity_sim": 0.0085 * 9.80665, "counterweight": 5.2107}
CASES = {
    "brick": {"stiffness": 1.5e4, "damping": 60.0, "mu_s": 0.5, "torque": 0.22},
    "sand": {"stiffness": 82.2, "damping": 0.713, "mu_s": 0.6, "torque": 0.22},
    "pivot": {"stiffness": 1.5e4, "damping": 60.0, "mu_s": 0.5, "torque": 0.125},
}
TOLERANCE = {"x": 5e-5, "y": 2e-4, "theta": 1.5e-3, "vx": 1e-4, "vy": 4e-4, "omega": 3e-3}
"""What docs/planar.md states for the batch at 1 ms."""


def coupled(trial, macro_step, duration, **options):
    """A tumble on the spring-damper through the master."""
    footing = LawGround.of_trial(trial)
    substeps = round(macro_step / footing.time_step)
    run = CoupledTumble(trial, footing, duration=duration, substeps=substeps, **options)
    return run, run.run()


class GivesBack(SpringDamper):
    """Pushes twice as hard on the way out as its spring and damper do: a ground that makes energy."""

    def step(self, position, velocity, dt):
        given = super().step(position, velocity, dt)
        if velocity[2] <= 0 or not given.contacts:
            return given
        contact = given.contacts[0]
        twice = Contact(contact.point, 2 * contact.normal_force, mu_s=contact.mu_s, mu_d=contact.mu_d)
        return Reaction(2 * given.force, given.torque, (twice,))


@pytest.mark.parametrize("name", list(CASES))
def test_the_spring_damper_through_the_master_is_the_planar_model_to_its_tolerance(name):
    trial = Trial(**RIG, **CASES[name])
    _, found = coupled(trial, 4e-4, 0.9)
    model = simulate(trial, duration=0.9, times=found.time[found.time <= 0.9])
    for channel, most in TOLERANCE.items():
        away = np.abs(getattr(found, channel)[: len(model.time)] - getattr(model, channel)).max()
        assert away < most, (channel, away)
    assert [state for _, state, _ in found.transitions[:1]] == ["stand"]
    assert [state for _, state, _ in found.transitions[1:3]] == [state for _, state, _ in model.transitions[:2]]
    assert found.trajectory_angle == pytest.approx(model.trajectory_angle, abs=1e-5)
    assert found.energy_residual < 3e-7  # of second order in the step (below): 1.5e-7 here, 1e-8 at 0.1 ms


def test_the_error_falls_as_the_square_of_the_macro_step():
    """A pivot, whose one event is early: x, y and theta after 0.5 s against the located integrator."""
    trial = Trial(**RIG, **CASES["pivot"])
    model = simulate(trial, duration=0.5)
    end = np.array([model.x[-1], model.y[-1], model.theta[-1]])
    runs = [coupled(trial, step, 0.5) for step in (2e-3, 4e-4)]
    coarse, fine = (abs(run.body.place - end) for run, _ in runs)
    assert (np.log(coarse / fine) / math.log(5) > 1.8).all()
    # The exchange at the interface likewise: its residual is the only gap in the books.
    gaps = [abs(run.master.exchange.given - run.master.exchange.taken) for run, _ in runs]
    assert math.log(gaps[0] / gaps[1], 5) > 1.8
    assert np.abs(runs[1][0].balance).max() < 1e-6 * trial.weight * trial.spike_length


def test_iterated_steps_leave_nothing_between_what_is_given_and_what_is_taken():
    """The wrench that made the twist is the one found: the mean of the rates is the twist held, so both works agree."""
    trial = Trial(**RIG, **CASES["sand"])
    run, found = coupled(trial, 2e-3, 0.5, iterations=12)
    explicit, _ = coupled(trial, 2e-3, 0.5)
    assert found.energy_residual < 1e-11 < 1e-9 < explicit.trajectory().energy_residual
    assert run.master.exchange.repeats > 0


def test_a_light_body_on_a_stiff_spring_is_iterated_to_the_implicit_midpoint_where_the_explicit_step_flies_off():
    """K H^2 / m = 5, past the explicit 4: z turns by 2 atan(omega H / 2) a step, its amplitude stays, to round-off."""
    mass, stiffness, steps = 1.0, 100.0, 200
    step = math.sqrt(5.0 * mass / (2 * stiffness))  # two rows carry it
    omega, swing = math.sqrt(2 * stiffness / mass), 0.2 * mass / (2 * stiffness)
    trial = Trial(
        mass=mass, inertia=0.02, spike_length=0.2, gravity_sim=1.0, mu_s=0.6, stiffness=stiffness, damping=0.0,
    )  # fmt: skip
    heights, run = {}, None
    for iterations in (1, 8):
        footing = LawGround.of_trial(trial)
        footing.grounds = [replace(ground, time_step=step) for ground in footing.grounds]
        run = CoupledTumble(trial, footing, duration=steps * step, substeps=1, iterations=iterations)
        run.body.rates[1] = swing * omega
        run.run()
        heights[iterations] = run.columns["y"] - run.columns["y"][0]
    turned = 2 * math.atan(0.5 * omega * step) * np.arange(len(heights[8]))
    assert np.abs(heights[8] - swing * np.sin(turned)).max() < 1e-6 * swing
    assert run.master.exchange.unsettled == 0 and run.master.exchange.repeats < 1.1 * steps  # the step before taught it
    assert np.abs(heights[1]).max() > 100 * swing


def test_steps_that_do_not_settle_are_counted():
    trial = Trial(**RIG, **CASES["sand"])
    run, _ = coupled(trial, 2e-3, 0.1, iterations=2)
    assert 0 < run.master.exchange.unsettled <= run.master.count
    warned = unsettled_warning(run.master)
    assert warned.startswith(f"{run.master.exchange.unsettled} of {run.master.count} ") and "iterations = 2" in warned
    assert unsettled_warning(coupled(trial, 2e-3, 0.1)[0].master) is None


@pytest.mark.parametrize("name", list(CASES))
def test_a_sound_ground_never_gives_dissipated_energy_back(name):
    """From rest: the springs that it stands on, W^2 / 4 K of two rows, are in the books from the start."""
    trial = Trial(**RIG, **CASES[name])
    run, found = coupled(trial, 1e-3, 0.5)
    assert found.stored_energy[0] == pytest.approx(trial.weight**2 / (4 * trial.stiffness), rel=1e-9)
    assert run.dissipated[-1] > 0 and run.dissipation_reversal < 1e-6


def test_at_rest_it_stays_at_rest_for_ten_seconds():
    trial = Trial(**RIG, **(CASES["brick"] | {"torque": 0.0}))
    run, found = coupled(trial, 1e-2, 10.0)
    assert np.abs(np.array([found.x, found.theta, found.vx, found.vy, found.omega])).max() < 1e-13
    assert np.ptp(found.y) < 1e-13
    assert set(run.states) == {"stand"}


def test_flight_keeps_momentum_and_spin_to_round_off():
    """A hop over the surface: vx and omega stay, vz falls by g_sim t, the torque waits, the path is a parabola."""
    trial = Trial(gravity_sim=1e-3, torque=0.22, stiffness=1e3, mu_s=0.5)
    body = PlanarBody(trial, z=1.0)
    body.rates = np.array([0.3, 0.01, 2.0])
    master = Master(body, LawGround.of_trial(trial), substeps=50)
    for _ in range(400):
        master.step()
    time = body.time
    assert body.rates[[0, 2]] == pytest.approx([0.3, 2.0], abs=1e-15)
    assert body.rates[1] == pytest.approx(0.01 - 1e-3 * time, abs=1e-14)
    assert body.place == pytest.approx([0.3 * time, 1.0 + 0.01 * time - 5e-4 * time**2, 2.0 * time], rel=1e-13)
    assert body.wheel_speed == 0.0 and body.torque_work == 0.0


def test_a_brake_gives_its_wheels_momentum_and_no_more():
    trial = Trial(
        **RIG, stiffness=1.5e4, damping=600.0, mu_s=0.5, torque=6.0, actuator="brake", wheel_inertia=1.2e-3,
        wheel_speed_0=40.0,
    )  # fmt: skip
    _, found = coupled(trial, 1e-4, 0.03)
    assert found.wheel_speed[-1] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(found.wheel_speed) <= 0).all()
    assert found.wheel_speed[70] == pytest.approx(40.0 - 6.0 / 1.2e-3 * 0.007, rel=1e-9)  # 8 ms in all


def test_a_motor_whose_wheel_comes_to_its_limit_ends_there_and_says_when():
    """From rest under a torque tau the wheel has 1 rad/s after J_w / tau, with the platform on its feet."""
    trial = Trial(**RIG, **CASES["pivot"])
    run = CoupledTumble(trial, LawGround.of_trial(trial), duration=0.03, max_wheel_speed=1.0)
    middle = None
    while not run.done:
        run.advance()
        middle = run.state() if run.master.count == 20 else middle
    assert run.body.wheel_at_limit == pytest.approx(trial.wheel_inertia / trial.torque, rel=1e-12)
    speed, work = run.columns["wheel_speed"], run.columns["torque_work"]
    assert speed[-1] == pytest.approx(1.0, rel=1e-12) and np.ptp(work[speed >= 1 - 1e-9]) < 1e-12 * work[-1]
    again = CoupledTumble(trial, LawGround.of_trial(trial), duration=0.03, max_wheel_speed=1.0)
    again.restore(middle)
    assert again.body.wheel_at_limit == run.body.wheel_at_limit
    free = CoupledTumble(trial, LawGround.of_trial(trial), duration=0.03)
    free.run()
    assert free.body.wheel_at_limit is None and free.body.wheel_speed > 2.0
    ended = CoupledTumble(replace(trial, torque_until=0.002), LawGround.of_trial(trial), duration=0.03)
    ended.body.max_wheel_speed = 1.0
    ended.run()
    assert ended.body.wheel_at_limit is None


def test_a_ground_that_makes_energy_is_seen_by_the_reversal_though_not_by_the_residual():
    """Dropped by a fiftieth of l without a torque: what the ground holds cancels in the residual."""
    trial = Trial(gravity_sim=9.80665, stiffness=1.5e4, damping=60.0, mu_s=0.5)
    tips = row_tips(trial.spike_length, trial.spike_count)
    found = {}
    for law in (SpringDamper, GivesBack):
        grounds = [law(stiffness=trial.stiffness, damping=trial.damping, mu_s=0.5) for _ in tips]
        height = trial.spike_length * (math.cos(math.pi / 8) + 0.02)
        found[law] = CoupledTumble(trial, LawGround(tips, grounds), duration=0.2, height=height)
        assert found[law].run().energy_residual < 1e-3
    sound, false = found[SpringDamper], found[GivesBack]
    assert sound.dissipated[-1] > 1e-3 * sound.energy_scale  # it did strike
    assert sound.dissipation_reversal < 1e-9
    assert false.dissipation_reversal > 5 * MOST_REVERSAL


def test_the_guess_follows_a_line_and_a_parabola():
    trial = Trial(**RIG, **CASES["brick"])
    for order in (0, 1, 2):
        master = Master(PlanarBody(trial, z=0.2), LawGround.of_trial(trial), extrapolation=order)
        for k in range(3):
            master._wrenches.appendleft(Wrench(np.array([0.0, 0.0, float(k**order)]), np.zeros(3)))
        assert master.guess().force[2] == pytest.approx(3.0**order if order else 1.0)


@pytest.mark.parametrize("steps", [37, 800])
def test_a_run_taken_up_again_gives_the_same_bits(steps, tmp_path):
    trial = Trial(**RIG, **CASES["sand"])
    options = {"duration": 0.9, "substeps": 10, "extrapolation": 1}
    whole = CoupledTumble(trial, LawGround.of_trial(trial), **options)
    expected = whole.run()
    broken = CoupledTumble(trial, LawGround.of_trial(trial), **options)
    for _ in range(steps):
        broken.advance()
    np.savez(tmp_path / "state.npz", **broken.state())
    other = CoupledTumble(trial, LawGround.of_trial(trial), **options)
    with np.load(tmp_path / "state.npz") as kept:
        other.restore(dict(kept))
    found = other.run()
    for name in ("x", "y", "theta", "vx", "omega", "state", "stored_energy", "dissipated"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    assert found.transitions == expected.transitions
    assert np.array_equal(other.feet, whole.feet)


@pytest.mark.parametrize(
    "effect",
    [Effect(id="torque-rise", parameters={"rise": 0.2}), Effect(id="torque-fade", parameters={"speed_loss": 4e-3})],
    ids=lambda effect: effect.id,
)
def test_an_effect_on_the_torque_alone_acts_as_in_the_planar_model(effect):
    """Motion within the tolerance of docs/planar.md; the wheel has the impulse that the platform got."""
    trial = Trial(**RIG, **CASES["sand"], effects=(effect,))
    _, found = coupled(trial, 4e-4, 0.5)
    expected = simulate(trial, duration=0.501, times=found.time)
    for name, tolerance in TOLERANCE.items():
        assert np.abs(getattr(found, name) - getattr(expected, name)).max() < tolerance, name
    step = simulate(replace(trial, effects=()), duration=0.501, times=found.time)
    assert np.abs(step.omega - expected.omega).max() > 5 * TOLERANCE["omega"]
    assert found.wheel_speed[-1] == pytest.approx(expected.wheel_speed[-1], rel=1e-4)
    assert found.energy_residual < 1e-5


def test_what_cannot_be_is_refused_by_name():
    trial = Trial(**RIG, **CASES["brick"])
    footing = LawGround.of_trial(trial)
    body = PlanarBody(trial, z=0.2)
    for key, value in {"substeps": 0, "iterations": 0, "extrapolation": 3, "tolerance": 0.0}.items():
        with pytest.raises(ValueError, match=key):
            Master(body, footing, **{key: value})
    for key, value in {"duration": 0.0, "energy_interval": -1.0, "lowering_speed": 0.0}.items():
        with pytest.raises(ValueError, match=key):
            CoupledTumble(trial, footing, **({"duration": 1.0} | {key: value}))
    with pytest.raises(ValueError, match="effects = pendulum"):
        PlanarBody(Trial(**RIG, effects=(Effect(id="pendulum", parameters={"length": 2.2}),)), z=0.2)
    with pytest.raises(ValueError, match="grounds has 1 entries: there are 8"):
        LawGround(row_tips(0.2, 8), footing.grounds[:1])


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_hand_sets_down_on_stiff_ground_in_long_steps_whatever_the_order_of_the_guess(order):
    """Brick in steps of 1 ms: at rest on W / 2 K a row when it lets go, and for 30 ms after; then the order is kept."""
    trial = Trial(**RIG, **(CASES["brick"] | {"torque": 0.0}))
    footing = LawGround.of_trial(trial)
    substeps = round(1e-3 / footing.time_step)
    run = CoupledTumble(
        trial, footing, duration=0.03, substeps=substeps, extrapolation=order, lowering_speed=0.05, height=0.186
    )
    while not run.placed:
        run.advance()
        assert run.placing_steps < 3000
    loads = [float(run.master.wrench.force[2])]
    assert run.master.extrapolation == order
    while not run.done:
        run.advance()
        loads.append(float(run.master.wrench.force[2]))
    assert np.abs(np.array(loads) - trial.weight).max() < 0.01 * trial.weight
    depth = 0.2 * math.cos(math.pi / 8) - float(run.body.place[1])
    assert depth == pytest.approx(0.5 * trial.weight / trial.stiffness, rel=0.01)


@pytest.mark.parametrize(
    ("mass", "stiffness", "damping"),
    [
        pytest.param(5.3, 1.5e4, 60.0, id="Hedgehog on brick"),  # let go with 0.75 W carried
        pytest.param(0.1, 3e3, 0.5, id="light"),  # with 3.6 W
        pytest.param(0.1, 1.5e4, 60.0, id="light on brick"),  # never came to rest
    ],
)
def test_what_bounces_in_the_hand_is_held_more_firmly_until_it_rests(mass, stiffness, damping):
    """Its hand is light against K. Let go it stands on W, W / 2 K deep, and stays."""
    length, inertia = (0.2, 0.06) if mass > 1 else (0.03, 1.2e-5)
    trial = Trial(
        mass=mass, inertia=inertia, spike_length=length, wheel_inertia=1e-6, torque=0.0, stiffness=stiffness,
        damping=damping, mu_s=0.5, gravity_sim=0.0834, counterweight=mass * (9.80665 - 0.0834) / (9.80665 + 0.0834),
    )  # fmt: skip
    footing = LawGround.of_trial(trial)
    footing.grounds = [replace(ground, time_step=4e-5) for ground in footing.grounds]
    run = CoupledTumble(trial, footing, duration=0.05, lowering_speed=0.2, energy_interval=1e-3)
    run.run()
    rows = run.columns
    depth = length * math.cos(math.pi / 8) - rows["y"][0]
    assert run.feet[0, 0].sum() == pytest.approx(trial.weight, rel=5e-3)
    assert depth == pytest.approx(0.5 * trial.weight / stiffness, rel=5e-3)
    assert np.abs(rows["vy"]).max() < 2e-6 and np.abs(rows["omega"]).max() * length < 2e-6
    assert run.energy_residual < 1e-12
