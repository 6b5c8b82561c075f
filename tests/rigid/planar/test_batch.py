"""The batch against the accurate integrator, and what it refuses."""

import math

import numpy as np
import pytest
from rigid_trials import RANGES, drawn, effect, in_rig

from benchmarks.planar_trials.agreement import SHARE_WITHIN, compare
from dem.engine import runtime
from rigid import EFFECTS, Effect, Ground, Trial, simulate, simulate_batch


def random_effects(rng, most=4):
    """One to `most` of the effects."""
    chosen = set(rng.permutation(list(RANGES))[: rng.integers(1, most + 1)])
    return tuple(id for id in RANGES if id in chosen)


def assert_agreement(trials):
    # The published tolerance (docs/planar.md). What lies outside must have been told why: at the edge of a graze or of
    # a bound, which moves the accurate integrator as well, or second order, gone at a quarter of the step.
    found = compare(trials)
    assert found.strangers == 0
    assert found.share("within") >= SHARE_WITHIN
    assert found.share("unexplained") == 0


@pytest.mark.slow
def test_the_batch_keeps_its_published_tolerance_on_1000_random_trials():
    rng = np.random.default_rng(2026)
    assert_agreement([drawn(rng) for _ in range(1000)])


def test_the_batch_keeps_its_published_tolerance_on_100_random_trials():
    rng = np.random.default_rng(7)
    assert_agreement([drawn(rng) for _ in range(100)])


@pytest.mark.long
def test_the_batch_keeps_its_published_tolerance_on_100_trials_with_random_effects():
    rng = np.random.default_rng(12)
    assert_agreement([drawn(rng, random_effects(rng)) for _ in range(100)])


@pytest.mark.slow
def test_the_batch_keeps_its_published_tolerance_with_all_effects_on_at_once():
    rng = np.random.default_rng(9)
    assert_agreement([drawn(rng, tuple(RANGES)) for _ in range(1000)])


def test_a_platform_let_go_above_its_rest_swings_as_far_below_it():
    # Without torque and damping: y - y_rest = (1 - share) W / 2K cos(omega t), omega^2 = 2 K / (m + m_b).
    trial = Trial(gravity_sim=0.0834, counterweight=5.21, stiffness=2000.0, damping=0.0)
    omega = math.sqrt(2 * trial.stiffness / (trial.mass + trial.counterweight))
    rest = trial.spike_length * math.cos(math.pi / 8) - trial.weight / (2 * trial.stiffness)
    times = np.linspace(0, 2 * math.pi / omega, 9)
    for share in (0.5, 1.5):
        run = simulate_batch(trial, duration=0.5, times=times, start_depth=share)
        swing = (1 - share) * trial.weight / (2 * trial.stiffness) * np.cos(omega * times)
        assert run.channel("y")[0] - rest == pytest.approx(swing, abs=1e-3 * np.abs(swing).max())


def test_a_start_off_the_depth_at_rest_is_refused_on_rows_that_do_not_stand_level():
    with pytest.raises(ValueError, match="slope"):
        simulate_batch(in_rig(effects=(effect("slope", angle=0.01),)), duration=0.1, start_depth=0.5)
    with pytest.raises(ValueError, match="start_depth = 0"):
        simulate_batch(in_rig(), duration=0.1, start_depth=0)


def test_two_rows_whose_slip_ends_at_one_moment_slide_back_together():
    # Both rows slide towards +x at speeds 1e-7 m/s apart, and neither can be held where they come to rest.
    common = {"gravity_sim": 0.08336, "counterweight": 0.0}
    trials = [
        Trial(mass=5.366, inertia=0.06931, mu_s=0.1509, stiffness=4950.0, damping=74.47, torque=0.06897,
              torque_until=0.2566, **common | {"counterweight": 5.275}),
        Trial(mass=4.132, inertia=0.04735, mu_s=0.1912, stiffness=15730.0, damping=72.61, torque=0.1016,
              torque_until=0.09428, **common | {"counterweight": 4.062}),
        Trial(mass=6.016, inertia=0.06591, mu_s=0.168, stiffness=7298.0, damping=94.05, torque=0.05795,
              torque_until=0.1121, **common),
    ]  # fmt: skip
    found = compare(trials)
    assert (found.ratios < 0.1).all()


def test_a_bound_that_is_reached_before_another_event_of_the_step_comes_first():
    # A row lifts off and the one that sticks reaches its bound just before: after the lift it would hold.
    def trial(force, friction, **numbers):
        both = (effect("adhesion", force=force), effect("rig-friction", force=friction))
        return Trial(gravity_sim=0.0834, effects=both, **numbers)

    trials = [
        trial(0.355, 0.0324, mass=5.78, counterweight=5.68, inertia=0.0654, mu_s=0.335, stiffness=14800.0,
              damping=15.0, torque=0.182, torque_until=0.118),
        trial(0.0349, 0.0234, mass=5.7, counterweight=5.6, inertia=0.0811, mu_s=0.304, stiffness=7150.0, damping=3.5,
              torque=0.088, torque_until=0.0991),
        trial(0.0235, 0.0324, mass=5.98, counterweight=5.88, inertia=0.0583, mu_s=0.326, stiffness=12700.0,
              damping=4.25, torque=0.0575, torque_until=0.291),
        # The accurate integrator, too, has to see a bound that is passed and kept again within its step.
        trial(0.273, 0.0602, mass=6.34, counterweight=6.23, inertia=0.0656, mu_s=0.372, stiffness=10900.0, damping=4.29,
              torque=0.203, torque_until=0.0535),
    ]  # fmt: skip
    found = compare(trials)
    assert (found.ratios < 0.5).all()


def test_a_graze_is_told_from_the_error_of_the_step():
    graze = [  # a slip speed that comes within 1e-6 m/s of zero, and a second landing that is nearly level
        Trial(mass=4.80029, inertia=0.045515, gravity_sim=0.1471, counterweight=4.65841, mu_s=0.63667,
              stiffness=10637.6, damping=106.76, torque=0.333801),
        Trial(mass=4.057, inertia=0.06368, gravity_sim=0.08336, counterweight=0.0, mu_s=0.3007, stiffness=17920.0,
              damping=4.108, torque=0.2129),
    ]  # fmt: skip
    landing = Trial(mass=4.281, inertia=0.04402, gravity_sim=0.1471, counterweight=4.155, mu_s=0.6438,
                    stiffness=19720.0, damping=83.01, torque=6.0, actuator="brake", wheel_speed_0=50.09,
                    torque_until=0.2981)  # fmt: skip
    assert compare([*graze, landing, in_rig(0.22)]).kinds == ("branch", "branch", "step", "within")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hunt-crossley", "power", "katsuragi-durian", "bekker", "rft"])
def test_the_batch_agrees_on_the_other_grounds(name):
    trials = [in_rig(torque, mu_s=mu, ground=Ground(name=name, spikes_per_row=2)) for torque in (0.1, 0.2, 0.3)
              for mu in (0.3, 0.6)]  # fmt: skip
    assert compare(trials, time_step=2.5e-4).share("within") == 1


@pytest.mark.parametrize("name", ["power-irreversible", "rft"])
def test_the_batch_agrees_where_the_springback_loses_energy(name):
    """With and without loss, which changes the motion; the accurate integrator's energy balance holds with it."""
    angles = []
    for loss in (0.0, 0.9):
        ground = Ground(name=name, parameters={"loss": loss, "loss_speed": 0.02}, spikes_per_row=2)
        trials = [in_rig(torque, mu_s=0.5, ground=ground) for torque in (0.1, 0.3)]
        assert compare(trials, time_step=2.5e-4).share("within") == 1
        run = simulate(trials[1], duration=1.0)
        assert run.energy_residual < 1e-6
        angles.append(run.theta[-1])
    assert abs(angles[1] - angles[0]) > 1e-4


def test_the_summary_is_that_of_the_accurate_integrator():
    braked = in_rig(6.0, mu_s=0.25, actuator="brake", wheel_speed_0=300)
    trials = [in_rig(0.22, mu_s=0.5), in_rig(0.125, mu_s=0.5), braked]
    batch = simulate_batch(trials, duration=1.0)
    for i, trial in enumerate(trials):
        run = simulate(trial, duration=1.0)
        assert batch.trajectory_angle[i] == pytest.approx(run.trajectory_angle, abs=2e-5)
        assert batch.max_speed[i] == pytest.approx(run.max_speed, rel=5e-4)
        assert batch.max_angular_velocity[i] == pytest.approx(run.max_angular_velocity, rel=1e-3)
        for state in ("slip", "hop", "pivot"):
            angle = run.transition_angle(state)
            ours = batch.transition_angles[state][i]
            assert math.isnan(ours) if angle is None else ours == pytest.approx(angle, abs=2e-4)
        assert batch.final["theta"][i] == pytest.approx(run.theta[-1], abs=2e-3)


def test_numbers_may_vary_without_a_trial_for_each():
    base = in_rig(0.2, effects=(effect("pendulum", length=2.0),))
    mu, length = np.array([0.3, 0.5, 0.7]), np.array([1.5, 2.5, math.inf])
    varied = simulate_batch(base, duration=0.5, vary={"mu_s": mu, "pendulum.length": length}, sample_every=50)
    each = simulate_batch(
        [in_rig(0.2, mu_s=m, effects=(Effect(id="pendulum", parameters={"length": w}),))
         for m, w in zip(mu, length, strict=True)],
        duration=0.5, sample_every=50,
    )  # fmt: skip
    assert np.array_equal(varied.series, each.series)
    assert varied.series.shape == (3, 11, 10)


def test_samples_may_be_at_any_times_of_each_trial_s_own():
    trials = [in_rig(0.2), in_rig(0.25)]
    times = np.array([[0.0, 0.1234, 0.3], [0.05, 0.05, 0.2987]])
    batch = simulate_batch(trials, duration=0.3, times=times)
    for i, trial in enumerate(trials):
        run = simulate(trial, duration=0.3, times=times[i])
        assert np.allclose(batch.channel("theta")[i], run.theta, atol=5e-6)
        assert np.allclose(batch.channel("vy")[i], run.vy, atol=1e-5)
        assert np.allclose(batch.channel("ay")[i], run.ay, atol=5e-4)


def test_the_same_batch_gives_the_same_bits_in_any_company():
    rng = np.random.default_rng(3)
    trials = [drawn(rng) for _ in range(30)]
    alone = simulate_batch(trials[7:8], duration=0.5, sample_every=100).series[0]
    among = simulate_batch(trials, duration=0.5, sample_every=100).series[7]
    assert np.array_equal(alone, among)


def test_at_rest_the_batch_rests():
    batch = simulate_batch([in_rig(0.0)], duration=2.0, sample_every=100)
    assert np.abs(batch.channel("theta")).max() < 1e-15 and np.abs(batch.channel("x")).max() < 1e-15
    assert np.ptp(batch.channel("y")) < 1e-15
    assert (batch.channel("state") == 0).all()


def test_a_trial_that_cannot_stand_is_marked():
    base = in_rig(0.1, mu_s=1.0, effects=(effect("com-offset"),))
    batch = simulate_batch(base, duration=0.1, vary={"com-offset.x": np.array([0.0, 2e-3])})
    assert batch.stands.tolist() == [True, False]
    assert np.isnan(batch.max_speed[1]) and not np.isnan(batch.max_speed[0])


def test_bad_input_is_refused_by_name():
    base = in_rig(0.2)
    for changes, word in (
        ({"vary": {"mas": np.ones(3)}}, "mas"),
        ({"vary": {"mass": np.array([5.3, -1.0])}}, "mass"),
        ({"vary": {"mass": np.ones(2), "mu_s": np.ones(3)}}, "one length"),
        ({"vary": {"inertia": np.array([0.06, 0.3])}}, "inertia"),
        ({"vary": {"inertia": np.array([0.06, 1e-3])}}, "wheel_inertia"),
        ({"vary": {"inertia": np.array([0.06, 0.05]), "wheel_inertia": np.array([1e-3, 0.055])}}, "trial 1"),
        ({"vary": {"mu_s": np.array([0.5, 0.2]), "mu_d": np.array([0.3, 0.3])}}, "mu_d"),
        ({"vary": {"stiffness": np.array([1e4, 1e6])}}, "time_step"),
        ({"time_step": 5e-3}, "time_step"),
        ({"times": [0.0, 2.0]}, "times"),
        ({"sample_every": 0}, "sample_every"),
    ):
        with pytest.raises(ValueError, match=word):
            simulate_batch(base, **({"duration": 0.5} | changes))
    with pytest.raises(ValueError, match="empty"):
        simulate_batch([], duration=0.5)
    with pytest.raises(ValueError, match="other effects"):
        simulate_batch([base, in_rig(0.2, effects=(effect("slope"),))], duration=0.5)


def test_the_batch_and_a_bed_s_runtime_live_in_one_process():
    # A bed that starts Taichi anew takes nothing from the batch, which is compiled again and gives the same bits.
    from hedgebed_taichi import ti

    trials = [in_rig(0.2), in_rig(0.3)]
    before = simulate_batch(trials, duration=0.2, sample_every=20).series
    runtime.start(threads=1)
    here = np.zeros(3)

    @ti.kernel
    def count(out: ti.types.ndarray(dtype=ti.f64, ndim=1)):
        for i in out:
            out[i] = 1.0 + i

    count(here)
    assert np.array_equal(simulate_batch(trials, duration=0.2, sample_every=20).series, before)
    assert here.tolist() == [1.0, 2.0, 3.0]
    runtime.start(precision="float32")
    try:
        with pytest.raises(RuntimeError, match="single precision"):
            simulate_batch(trials, duration=0.2)
    finally:
        runtime.start()


OWN = """
from math import exp, sin

from rigid.terms import Parameter, Term


def force(s, strength, reach):
    turn = 0.0
    if s.theta > 0.0:
        turn = -strength * sin(3.0 * s.theta) * exp(-abs(s.x) / reach)
    return 0.0, 0.0, turn


def factor(s, slip, strength):
    return 1.0, 1.0 - strength * min(1.0, abs(slip))


TERM = Term(
    id="my-magnet", summary="pulls back near the start", acts="virtual work and mu_d",
    parameters=(
        Parameter(name="strength", unit="N m", default=0.0, summary="of the pull"),
        Parameter(name="reach", unit="m", default=0.01, summary="where it fades"),
    ),
    source="a test", limits="none", hooks={"force": force, "friction_factor": factor},
)
"""


def test_an_effect_of_one_s_own_file_runs_in_the_batch_as_well(tmp_path):
    file = tmp_path / "my_magnet.py"
    file.write_text(OWN, encoding="utf-8")
    trial = in_rig(0.22, effects=(Effect(id="my-magnet", parameters={"strength": 0.05}, file=file),))
    run = simulate(trial, duration=0.7, sample_interval=0.01)
    batch = simulate_batch([trial], duration=0.7, sample_every=10)
    assert np.abs(batch.channel("theta")[0] - run.theta).max() < 2e-4
    bare = simulate(in_rig(0.22), duration=0.7, sample_interval=0.01)
    assert np.abs(bare.theta - run.theta).max() > 5e-3


@pytest.mark.long
def test_every_hook_of_every_term_compiles_for_taichi():
    # One kernel with all effects on: if a term's source were no Taichi, this would not compile.
    every = tuple(Effect(id=id) for id, term in EFFECTS.items() if not term.sensor)
    bare = simulate_batch([in_rig(0.22)], duration=0.5, sample_every=50)
    full = simulate_batch([in_rig(0.22, effects=every)], duration=0.5, sample_every=50)
    assert np.allclose(bare.series, full.series, rtol=0, atol=1e-10)
