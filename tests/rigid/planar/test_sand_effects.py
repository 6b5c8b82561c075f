"""Effects of sand against closed forms: ground that gives way, that is carried along, that keeps its craters."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rigid_trials import LENGTH, MASS, G, effect, free, in_rig
from scipy.integrate import solve_ivp

from benchmarks.planar_trials.agreement import compare
from rigid import EFFECTS, Trial, simulate
from rigid.planar.dynamics import Modes, System
from rigid.planar.located import integrate
from rigid.planar.statics import standing

G0 = math.pi / 8
STILL = {"stiffness": 2e3, "damping": 20.0}  # Its damper bears 0.2 % of the load while it sinks


def moved(trial, duration, *, change=None, start=None):
    """Accepted steps (time, z) from rest, whose state `change` sets moving, or from `start`; and the transitions."""
    system, rows = System(trial), []
    z, modes = standing(system) if start is None else start
    for place, value in (change or {}).items():
        z[place] = value
        modes.slip = [1] * 8
    went = integrate(
        system, duration=duration, tolerance=1e-10, start=(z, modes),
        on_step=lambda t0, t1, z1, at, kind: rows.append((t1, *z1[:11])),
    )  # fmt: skip
    return rows, went.transitions


def test_a_tip_that_slides_under_a_load_sinks_to_its_depth_at_rest_over_one_less_the_share():
    # Under a constant load z - e stays z_0, and e = q z_0 / (1 - q) (1 - exp(-(1 - q) s / j)) after a slide s.
    q, j, speed = 0.6, 0.018, 0.01
    trial = in_rig(mu_s=0.0, effects=(effect("slip-sinkage", share=q, way=j),), **STILL)
    rows, _ = moved(trial, 12.0, change={3: speed})
    rest = 0.5 * trial.weight / trial.stiffness
    for t, x, y, *_ in rows[:: len(rows) // 7]:
        assert x == pytest.approx(speed * t, rel=1e-9)
        given = q * rest / (1 - q) * (1 - math.exp(-(1 - q) * x / j))
        assert LENGTH * math.cos(G0) - y == pytest.approx(rest + given, rel=5e-3)
    depth = LENGTH * math.cos(G0) - rows[-1][2]
    assert 2.0 * rest < depth < rest / (1 - q)


def test_a_tip_that_slides_ahead_of_its_shaft_sinks_more_than_one_that_trails():
    speed = EFFECTS["slip-sinkage"].hooks["settle"]
    s = System(in_rig()).s
    ahead, behind = (speed(s, 0.01, 0.1, lean, 0.0, 0.6, 0.018, 1.0) for lean in (-0.38, 0.38))
    assert ahead / behind == pytest.approx(1.38 / 0.62)
    assert speed(s, 0.01, 0.1, 0.38, 0.0, 0.6, 0.018, 0.0) == pytest.approx(0.1 * 0.6 * 0.01 / 0.018)
    assert speed(s, 0.01, 0.1, 0.38, 0.006, 0.6, 0.018, 0.0) == 0.0  # all that gives way has


def test_a_platform_that_stands_sinks_with_the_logarithm_of_time():
    # Under a constant load z = z_0 + e and e' = c z / tau exp(-e / (c z)); at a constant depth e = c z ln(1 + t / tau).
    c, tau = 0.03, 0.05
    trial = in_rig(effects=(effect("relaxation", share=c, soon=tau, stood=0.0),), **STILL)
    rest = 0.5 * trial.weight / trial.stiffness
    exact = solve_ivp(lambda t, e: c * (rest + e) / tau * np.exp(-e / (c * (rest + e))), (0, 8), [0.0], rtol=1e-10,
                      atol=1e-14, dense_output=True)  # fmt: skip
    run = simulate(trial, duration=8.0, sample_interval=0.5)
    sunk = LENGTH * math.cos(G0) - run.y - rest
    assert sunk[8:] == pytest.approx(exact.sol(run.time)[0][8:], rel=3e-3)  # once the first swing has died away
    speed = EFFECTS["relaxation"].hooks["settle"]
    s = System(trial).s
    for t in (0.0, 0.1, 30.0):
        gone = c * 0.01 * math.log(1 + t / tau)
        assert speed(s, 0.01, 0.0, 0.0, gone, c, tau) == pytest.approx(c * 0.01 / (tau + t), rel=1e-12)


def test_a_platform_that_has_stood_for_long_starts_deeper_and_hardly_sinks():
    c, tau, stood = 0.03, 0.05, 100.0
    trial = in_rig(effects=(effect("relaxation", share=c, soon=tau, stood=stood),), **STILL)
    run = simulate(trial, duration=2.0, sample_interval=0.5)
    left = 1 - c * math.log(1 + stood / tau)
    assert LENGTH * math.cos(G0) - run.y[0] == pytest.approx(0.5 * trial.weight / trial.stiffness / left, rel=1e-9)
    assert 0 < run.y[0] - run.y[-1] < 1e-3 * 0.5 * trial.weight / trial.stiffness
    leaned = simulate(trial, duration=0.01, lean=0.2)
    assert LENGTH * math.cos(0.2 - G0) - leaned.y[0] == pytest.approx(trial.weight / trial.stiffness / left, rel=1e-9)


def sliding_on_ground_that_also_relaxes(stood=0.0):
    """A trial that slides at 10 mm/s on ground with slip-sinkage and relaxation, and its sinkage over time.

    Each takes its share of the force that the other leaves. Under a constant load this force, and so z - e_s - e_r, is
    constant: each then has its own closed form, and the sinkages add up. z_0 + e_r = z_0 / (1 - r) after a rest with
    r = c ln(1 + T / tau).
    """
    q, j, c, tau = 0.4, 0.018, 0.03, 0.05
    effects = (effect("slip-sinkage", share=q, way=j), effect("relaxation", share=c, soon=tau, stood=stood))
    trial = in_rig(mu_s=0.0, effects=effects, **STILL)
    rest = 0.5 * trial.weight / trial.stiffness
    rested = c * math.log(1 + stood / tau)
    start = rest * rested / (1 - rested)
    crept = solve_ivp(lambda t, e: c * (rest + e) / tau * np.exp(-e / (c * (rest + e))), (0, 9), [start],
                      rtol=1e-10, atol=1e-14, dense_output=True)  # fmt: skip

    def sunk(t, x):
        return rest + q * rest / (1 - q) * (1 - np.exp(-(1 - q) * np.asarray(x) / j)) + crept.sol(t)[0]

    return trial, sunk


@pytest.mark.parametrize("stood", [0.0, 60.0])
def test_slip_sinkage_and_relaxation_at_once_add_up_under_a_constant_load(stood):
    trial, sunk = sliding_on_ground_that_also_relaxes(stood)
    rows, _ = moved(trial, 8.0, change={3: 0.01})
    assert LENGTH * math.cos(G0) - rows[0][2] == pytest.approx(sunk(0.0, 0.0), rel=2e-3)  # with what it has stood
    for t, x, y, *_ in rows[len(rows) // 3 :: len(rows) // 9]:
        assert LENGTH * math.cos(G0) - y == pytest.approx(sunk(t, x), rel=5e-3)
    assert sunk(8.0, 0.08) - sunk(8.0, 0.0) > 0.3 * sunk(0.0, 0.0)  # a slide sinks beside what relaxes


def test_the_order_of_two_effects_that_give_way_does_not_matter():
    trial, _ = sliding_on_ground_that_also_relaxes(60.0)
    one, other = (System(replace(trial, effects=effects)) for effects in (trial.effects, trial.effects[::-1]))
    assert one.settled_share == other.settled_share > 0
    (z, modes), (z2, _) = standing(one), standing(other)
    assert one.given_way(0, z) == other.given_way(0, z2) > 0
    z[3] = z2[3] = 0.1
    modes.slip = [1] * 8
    assert one.derivative(0.0, z, modes)[:9] == pytest.approx(other.derivative(0.0, z2, modes)[:9], rel=1e-12)


def test_ground_that_a_tip_carries_along_shares_its_momentum():
    # Nothing but the added mass a b z of each of two rows: (M + 2 b z) v = M v_0, so M z + b z^2 = M v_0 t.
    b, v = 40.0, 0.3
    trial = free(damping=0.0, mu_s=0.0, level=1e-6, stiffness=1e-3,
                 effects=(effect("inertial-drag", normal=b, added=1.0),))  # fmt: skip
    start = ([0.0, LENGTH * math.cos(G0), 0.0, 0.0, -v, 0.0, 0.0, 0.0, 0.0],
             Modes(touching=[0, 7], slip=[1] * 8, top=[0.0] * 8))  # fmt: skip
    rows, _ = moved(trial, 0.2, start=start)
    for t, _, y, _, _, vy, *_ in rows[:: len(rows) // 5]:
        z = (math.sqrt(1 + 4 * b * v * t / MASS) - 1) * MASS / (2 * b)
        assert LENGTH * math.cos(G0) - y == pytest.approx(z, rel=1e-5)
        assert -vy == pytest.approx(MASS * v / (MASS + 2 * b * z), rel=1e-5)


@pytest.mark.parametrize(("aside", "left"), [(0.0, 1.0), (0.004, None), (-0.004, None), (0.5, 0.0)])
def test_a_tip_finds_its_crater_where_it_left_it_less_deep_by_the_slope_of_its_walls(aside, left):
    # A drop leaves a crater of f z_max. The tip comes back `aside` and touches at f z_max - wall |aside|.
    f, wall, v, gravity = 0.6, 0.5, 0.3, 0.5
    crater = effect("plastic-sinkage", share=f, wall=wall)
    trial = free(damping=0.0, mu_s=0.0, level=gravity / G, stiffness=2e3, effects=(crater,))
    weight, k = MASS * gravity, trial.stiffness  # M v^2 / 2 + M g z = K z^2 of two rows
    z_max = (weight + math.sqrt(weight**2 + 2 * k * MASS * v**2)) / (2 * k)
    drift = aside / (2 * v * math.sqrt(1 - f) / gravity)  # over the flight
    start = ([0.0, LENGTH * math.cos(G0), 0.0, drift, -v, 0.0, 0.0, 0.0, 0.0],
             Modes(touching=[0, 7], slip=[-1 if drift < 0 else 1] * 8, top=[0.0] * 8))  # fmt: skip
    rows, transitions = moved(trial, 1.4, start=start)
    off, on = [t for t, state, _ in transitions if t > 0][:2]
    there, back = ([(row[1], LENGTH * math.cos(G0) - row[2]) for row in rows if row[0] <= t][-1] for t in (off, on))
    deepest = max(LENGTH * math.cos(G0) - row[2] for row in rows if row[0] < off)
    assert deepest == pytest.approx(z_max, rel=1e-3)
    assert there[1] == pytest.approx(f * deepest, rel=1e-6)
    expected = max(f * deepest - wall * abs(back[0] - there[0]), 0.0)
    assert back[1] == pytest.approx(expected, abs=1e-9)
    if left is not None:
        assert back[1] == pytest.approx(left * f * deepest, abs=1e-9)
    else:
        assert 0.3 < back[1] / (f * deepest) < 0.95


def test_a_crater_without_walls_is_forgotten_above_the_surface():
    assert System(free(effects=(effect("plastic-sinkage", share=0.5),))).wall == 0.0
    with pytest.raises(ValueError, match=r"plastic-sinkage\.wall"):
        free(effects=(effect("plastic-sinkage", share=0.5, wall=-1.0),))


ON_SAND = {
    "ploughing": {"strength": (300.0, 5000.0), "power": (1.0, 2.5)},
    "slip-sinkage": {"share": (0.1, 0.8), "way": (0.003, 0.05), "bias": (-1.0, 1.0)},
    "relaxation": {"share": (0.005, 0.05), "soon": (0.02, 0.2)},
    "inertial-drag": {"normal": (5.0, 80.0), "added": (0.0, 1.0)},
    "plastic-sinkage": {"share": (0.05, 0.9), "wall": (0.3, 1.5)},
}


def on_sand(rng, ids):
    """A random trial on soft ground."""
    level, mass, brake = rng.choice([0.0085, 0.015]) * G, rng.uniform(4.5, 6.5), rng.random() < 0.3
    return Trial(
        mass=mass, inertia=rng.uniform(0.04, 0.09), gravity_sim=level,
        counterweight=mass * (G - level) / (G + level) if rng.random() < 0.6 else 0.0, mu_s=rng.uniform(0.3, 0.8),
        stiffness=10 ** rng.uniform(1.9, 3.0), damping=10 ** rng.uniform(-0.2, 1.2),
        torque=6.0 if brake else rng.uniform(0.1, 0.35), actuator="brake" if brake else "motor",
        wheel_speed_0=rng.uniform(50, 300) if brake else 0.0,
        effects=tuple(effect(id, **{k: rng.uniform(*v) for k, v in ON_SAND[id].items()}) for id in ids),
    )  # fmt: skip


BOTH = ("slip-sinkage", "relaxation")


@pytest.mark.parametrize("ids", [*((id,) for id in ON_SAND), BOTH, tuple(ON_SAND)], ids="+".join)
@pytest.mark.long
def test_on_sand_the_batch_keeps_its_published_tolerance(ids):
    rng = np.random.default_rng(5)
    found = compare([on_sand(rng, ids) for _ in range(20)])
    assert found.strangers == 0
    assert found.share("unexplained") == 0
    assert found.share("within") >= 0.85
    assert found.energy_residual < 1e-6


def test_all_effects_of_sand_at_once_close_the_energy_balance():
    rng = np.random.default_rng(6)
    trial = on_sand(rng, tuple(ON_SAND))
    run = simulate(trial, duration=1.0)
    assert run.energy_residual < 1e-6
    assert (np.diff(run.dissipated) > -1e-9).all()
