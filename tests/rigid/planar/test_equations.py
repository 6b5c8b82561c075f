"""The code's accelerations against equations of motion that sympy derives from T, V, D and the virtual work."""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from rigid_trials import INERTIA, LENGTH, MASS, RANGES, G, counterweight, drawn_effect, effect, turned

from rigid import EFFECTS, Trial
from rigid.model.model import assemble
from rigid.planar.dynamics import LOST, WORK, Modes, System

X, Y, A, U, V, W = sp.symbols("x y theta vx vy omega", real=True)
POSE, SPEED = (X, Y, A), (U, V, W)
B, BV = sp.symbols("b b_v", real=True)  # the counterweight's descent, where its wires are springs
TORQUE, TOP = 0.3, 0.02
VALUES = {
    "pendulum": {"length": 2.2, "offset": 0.01, "arc": 0.6},
    "com-offset": {"x": 0.003, "y": -0.002},
    "slope": {"angle": 0.15},
    "pulley-inertia": {"mass": 0.7},
    "umbilical": {"stiffness": 0.3, "drag": 0.2, "spring_power": 1.6, "drag_power": 0.8, "rest": -0.2},
    "tip-radius": {"radius": 0.011},
    "depth-hardening": {"exponent": 1.35, "reference": 2e-3, "bend": 60.0},
    "plastic-sinkage": {"share": 0.25, "bend": 0.6},
    "adhesion": {"force": 0.8, "reach": 3e-3, "sharpness": 0.6, "grip": 0.7},
    "inertial-drag": {"normal": 40.0, "sideways": 7.0, "power": 1.7},
    "wire-compliance": {"stiffness": 3e3, "damping": 25.0},
}

WITH_ENERGY = list(VALUES)


class Derived:
    """Lagrange's equations of a trial whose spikes `touching` press, all sinking (`sinking`) or all on the way up.

    `slack`: the wires are, where they are springs.
    """

    def __init__(self, trial: Trial, touching, slip, sinking, slack=False):
        on = {e.id: e.values for e in trial.effects}
        m, J, mb, length = trial.mass, trial.inertia, trial.counterweight, trial.spike_length
        lean = on.get("slope", {"angle": 0})["angle"]
        up = sp.Matrix([sp.sin(lean), sp.cos(lean)])
        r = on.get("tip-radius", {"radius": 0})["radius"]
        height = X * up[0] + Y * up[1]
        wires = on.get("wire-compliance")
        pose, speed = ((*POSE, B), (*SPEED, BV)) if wires else (POSE, SPEED)
        rate = dict(zip(pose, speed, strict=True))
        size = len(pose)

        def dot(expression):
            return sum(sp.diff(expression, q) * v for q, v in rate.items())

        T = m * (U**2 + V**2) / 2 + J * W**2 / 2 + mb * (BV if wires else dot(height)) ** 2 / 2
        energy = (m + mb) * trial.gravity_sim * height
        D = sp.Integer(0)
        work = [sp.Integer(0), sp.Integer(0), sp.Float(TORQUE), sp.Integer(0)]  # the flywheel's: tau d theta
        true = trial.gravity if mb else trial.gravity_sim
        if wires:  # beyond the stretch at rest, at which they carry m_b g
            stretch = B - height
            energy += -mb * true * stretch if slack else wires["stiffness"] * stretch**2 / 2
            D += 0 if slack else wires["damping"] * dot(stretch) ** 2 / 2
        if "com-offset" in on:
            ex, ey = on["com-offset"]["x"], on["com-offset"]["y"]
            e = sp.Matrix([ex * sp.cos(A) + ey * sp.sin(A), -ex * sp.sin(A) + ey * sp.cos(A)])
            T += m * (U * dot(e[0]) + V * dot(e[1]))
            energy += m * true * (e[0] * up[0] + e[1] * up[1])
        if "pulley-inertia" in on:
            T += on["pulley-inertia"]["mass"] * dot(height) ** 2 / 2
        if "pendulum" in on:
            d = X * up[1] - (Y - length * math.cos(math.pi / 8)) * up[0] - on["pendulum"]["offset"]
            wires, arc = on["pendulum"]["length"], on["pendulum"]["arc"]
            above = wires - (height - length * math.cos(math.pi / 8) * up[1])
            energy += mb * true * (1 - arc) * d**2 / (2 * wires)
            energy += mb * true * arc * (sp.sqrt(above**2 + d**2) - above)
        if "umbilical" in on:
            power, rate_power = on["umbilical"]["spring_power"] + 1, on["umbilical"]["drag_power"] + 1
            energy += on["umbilical"]["stiffness"] * sp.Abs(A - on["umbilical"]["rest"]) ** power / power
            D += on["umbilical"]["drag"] * sp.Abs(W) ** rate_power / rate_power
        self.slips, self.loads = {}, {}
        for n in touching:
            gamma = A + sp.pi / 8 + n * sp.pi / 4
            depth = (length - r) * sp.cos(gamma) + r - Y
            sink = dot(depth)
            z, a = depth, 0
            if "plastic-sinkage" in on:
                f = on["plastic-sinkage"]["share"]
                a = on["plastic-sinkage"]["bend"] * (1 - math.exp(-20 * f))
                z = (depth - f * TOP) / (1 - f)
            z0, e, b = 1, 0, 0
            if "depth-hardening" in on:
                z0, e = on["depth-hardening"]["reference"], on["depth-hardening"]["exponent"] - 1
                b = on["depth-hardening"]["bend"]
            e += a
            stored = trial.stiffness * (z ** (2 + e) / (2 + e) + b * z ** (3 + e) / (3 + e)) / (z0 ** (e - a) * TOP**a)
            if "plastic-sinkage" in on:
                stored *= 1 - f
            force, grip = -sp.diff(stored, Y), sp.Integer(0)  # on y, of depth alone; what friction sees beside it
            if "adhesion" in on:
                a, reach, m_s = on["adhesion"]["force"], on["adhesion"]["reach"], on["adhesion"]["sharpness"]
                x = (TOP - depth) / reach
                held = a * reach * ((1 - m_s) * (x - 1 + sp.exp(-x)) + m_s * sp.log(sp.cosh(x)))
                stored += held
                force += -sp.diff(held, Y)
                grip = on["adhesion"]["grip"] * sp.diff(held, Y)
            energy += stored
            drag = on.get("inertial-drag", {"normal": 0, "sideways": 0, "power": 2})
            lost = sp.Integer(0)
            if sinking:
                D += trial.damping * sink**2 / 2
                inert = drag["normal"] * sink ** drag["power"]
                lost = trial.damping * sink + inert
                for k in range(3):
                    work[k] -= inert * sp.diff(sink, SPEED[k])
            # The horizontal speed of the material point that touches: the ball turns with the platform.
            slide = U - W * ((length - r) * sp.cos(gamma) + r)
            side = -drag["sideways"] * sp.Abs(slide) * slide - slip.get(n, 0) * trial.sliding_friction * (
                force + lost + grip
            )
            for k in range(3):
                work[k] += side * sp.diff(slide, SPEED[k])
            self.slips[n], self.loads[n] = slide, force + lost + grip
        M = sp.Matrix(size, size, lambda i, k: sp.diff(T, speed[i], speed[k]))
        right = sp.Matrix(
            [sp.diff(T, pose[k]) - dot(sp.diff(T, speed[k])) - sp.diff(energy, pose[k]) - sp.diff(D, speed[k]) + work[k]
             for k in range(size)]
        )  # fmt: skip
        given = (*POSE, *SPEED, B, BV)[: 2 * size]
        self.numbers = sp.lambdify(given, [M, right], "numpy")
        stuck = [n for n in touching if n not in slip]
        # A spike that sticks: d(slip)/dt = 0, a row J a + bias = 0.
        self.stuck = None
        if stuck:
            s = self.slips[stuck[0]]
            row = [sp.diff(s, v) for v in speed]
            self.stuck = sp.lambdify(given, [*row, dot(s)], "numpy")

    def acceleration(self, state):
        M, right = self.numbers(*state)
        M, right = np.array(M, dtype=float), np.array(right, dtype=float).ravel()
        if self.stuck is None:
            return np.linalg.solve(M, right)
        *row, bias = (float(value) for value in self.stuck(*state))
        size = len(right)
        full = np.zeros((size + 1, size + 1))
        full[:size, :size], full[:size, size], full[size, :size] = M, [-value for value in row], row
        return np.linalg.solve(full, np.append(right, -bias))[:size]


def code(trial: Trial, state, touching, slip, slack=False, terms=None):
    """The code's accelerations, of the counterweight too where its wires are springs; `terms` for its own."""
    system = System(trial)
    if terms is not None:
        system.model = assemble(terms, trial.surface.name)
    modes = Modes(touching=list(touching), slip=[slip.get(n, 0) for n in range(8)], top=[TOP] * 8)
    modes.inner = 0 if slack else 1
    rate = system.derivative(0.1, [*state[:6], 0.0, 0.0, 0.0, *state[6:]], modes)
    return np.array([*system.acceleration, *rate[10:]]), system


def states(rng, touching, sinking, count=6, trial=None):
    """Random states in which just these spikes are 5 to 15 mm deep, with speeds of the sign wanted.

    Where the wires of `trial` are springs, the counterweight moves too.
    """
    system = System(trial) if trial else None
    found = []
    while len(found) < count:
        theta = rng.uniform(-0.02, 0.02) if len(touching) > 1 else rng.uniform(-0.3, 0.3)
        angles = [theta + math.pi / 8 + n * math.pi / 4 for n in touching]
        y = min(LENGTH * math.cos(g) for g in angles) - rng.uniform(0.008, 0.012)
        vx, vy, omega = rng.uniform(-0.3, 0.3), rng.uniform(0.02, 0.3) * (-1 if sinking else 1), rng.uniform(-0.2, 0.2)
        rates = [-(vy + omega * LENGTH * math.sin(g)) for g in angles]
        if all((rate > 0) == sinking for rate in rates):
            x = rng.uniform(-0.1, 0.1)
            own = ()
            if system and system.inner:
                own = (system.inner_at_rest((x, y, theta)) + rng.uniform(-0.01, 0.01), rng.uniform(-0.3, 0.3))
            found.append((x, y, theta, vx, vy, omega, *own))
    return found


def make(effects, rig=True):
    return Trial(
        gravity_sim=0.0085 * G, counterweight=counterweight(0.0085 * G) if rig else 0.0, torque=TORQUE, mu_s=0.7,
        mu_d=0.3, stiffness=900.0, damping=12.0, effects=tuple(effect(id, **VALUES[id]) for id in effects),
    )  # fmt: skip


CASES = [((), False), ((), True), *(((id,), True) for id in WITH_ENERGY),
         (("com-offset",), False), (("slope",), False), (tuple(WITH_ENERGY), True)]  # fmt: skip


@pytest.mark.parametrize(("effects", "rig"), CASES, ids=lambda v: "+".join(v) if isinstance(v, tuple) else str(v))
@pytest.mark.parametrize("sinking", [True, False], ids=["sinking", "rising"])
def test_sliding_accelerations_are_those_that_lagrange_s_equations_give(effects, rig, sinking):
    trial, rng = make(effects, rig), np.random.default_rng(3)
    touching = [0, 7]
    slip = {0: 1, 7: -1}  # the sign is the mode's, here at odds with the speeds: a harder test
    derived = Derived(trial, touching, slip, sinking)
    for state in states(rng, touching, sinking, trial=trial):
        ours, _ = code(trial, state, touching, slip)
        assert ours == pytest.approx(derived.acceleration(state), rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("slack", [False, True], ids=["taut", "slack"])
def test_a_wrong_sign_in_the_wires_shows_taut_and_slack(slack):
    # The same comparison, and with the sign of one of the term's hooks turned: none of them passes.
    trial, rng, touching, slip = make(("wire-compliance", "slope")), np.random.default_rng(8), [0, 7], {0: 1, 7: -1}
    derived = Derived(trial, touching, slip, True, slack)
    right = trial.terms[0]
    for state in states(rng, touching, True, trial=trial):
        expected = derived.acceleration(state)
        ours, _ = code(trial, state, touching, slip, slack)
        assert ours == pytest.approx(expected, rel=1e-9, abs=1e-9)
        for hook in ("mass", "force", "inner_mass", "inner_force"):
            wrong = replace(right, hooks={**right.hooks, hook: turned(right.hooks[hook])})
            ours, _ = code(trial, state, touching, slip, slack, (wrong, trial.terms[1]))
            assert np.abs(ours - expected).max() > 1e-3, hook


@pytest.mark.parametrize(("effects", "rig"), CASES, ids=lambda v: "+".join(v) if isinstance(v, tuple) else str(v))
def test_a_spike_that_sticks_is_a_constraint_whose_force_follows_from_the_equations(effects, rig):
    trial, rng = make(effects, rig), np.random.default_rng(4)
    touching = [0, 7]
    slip = {0: 1}  # 7 sticks while 0 slides
    derived = Derived(trial, touching, slip, True)
    for state in states(rng, touching, True, trial=trial):
        ours, _ = code(trial, state, touching, slip)
        assert ours == pytest.approx(derived.acceleration(state), rel=1e-9, abs=1e-9)


def test_three_rows_may_touch():
    trial, rng = make(()), np.random.default_rng(5)
    state = (0.0, 0.07, 0.01, 0.1, -0.2, 0.05)  # so deep that 0, 7 and the next ones touch
    for touching in ([0, 1, 7], [0, 1, 6, 7]):
        slip = {n: rng.choice([-1, 1]) for n in touching}
        derived = Derived(trial, touching, slip, False)
        up = (*state[:4], 0.2, state[5])
        ours, _ = code(trial, up, touching, slip)
        assert ours == pytest.approx(derived.acceleration(up), rel=1e-10)


def test_two_that_stick_share_the_force_by_their_loads_and_sticking_takes_no_power():
    # F acts with the generalised direction sum N_n dslip_n / sum N_n, and sum N_n slip_n stays 0 (docs/planar.md).
    trial, rng = make(()), np.random.default_rng(6)
    touching = [0, 7]
    derived = Derived(trial, touching, {}, True)
    slips = sp.lambdify((*POSE, *SPEED), [derived.slips[n] for n in touching])
    loads = sp.lambdify((*POSE, *SPEED), [derived.loads[n] for n in touching])
    for state in states(rng, touching, True):
        state = np.array(state)
        arms = -(np.array(slips(0, state[1], state[2], 0, 0, 1.0)))  # slip = vx - h omega
        share = np.array(loads(*state)) / sum(loads(*state))
        state[3] = state[5] * (share @ arms)  # now sum N_n slip_n = 0
        assert abs(share @ np.array(slips(*state))) < 1e-15
        a, system = code(trial, state, touching, {})
        # Its time derivative, from a step along the motion, is zero too.
        e = 1e-6

        def mean_slip(t, state=state, a=a):
            q = state[:3] + t * state[3:] + 0.5 * t * t * a
            v = state[3:] + t * a
            n = np.array(loads(*q, *v))
            return n @ np.array(slips(*q, *v)) / n.sum()

        assert abs(mean_slip(e) - mean_slip(-e)) / (2 * e) < 1e-6 * abs(a).max()
        assert system.stick_force != 0.0


def test_pivoting_in_the_rig_obeys_the_corrected_equations_15_and_16():
    # docs/planar.md, Errata: (m + m_b)[y_c'' - l sin(g) th'' - l cos(g) th'^2] + C y_c'[in] + K y_c + W = 0 and
    # (m l^2 + J + m_b l^2 sin^2 g) th'' + m_b l^2 sin g cos g th'^2 - (m + m_b) l sin g y_c'' - W l sin g = tau,
    # for one spike that sticks: x = l sin(g) + const, y = y_c + l cos(g).
    trial = make(())
    m, mb, J, r = MASS, trial.counterweight, INERTIA, LENGTH
    rng = np.random.default_rng(7)
    for _ in range(5):
        theta, omega = rng.uniform(0, 0.6), rng.uniform(0.1, 2)
        yc, yc_rate = -rng.uniform(2e-3, 8e-3), -rng.uniform(0.01, 0.2)
        g = theta + math.pi / 8 - math.pi / 4  # the leading spike, n = 7
        s, c = math.sin(g), math.cos(g)
        state = (0.0, yc + r * c, theta, r * c * omega, yc_rate - r * s * omega, omega)
        (ax, ay, alpha), _ = code(trial, state, [7], {})
        yc_2 = ay + r * s * alpha + r * c * omega**2
        contact = trial.damping * yc_rate + trial.stiffness * yc
        left = (m + mb) * (yc_2 - r * s * alpha - r * c * omega**2) + contact + trial.weight
        assert left == pytest.approx(0, abs=1e-9)
        left = (m * r**2 + J + mb * r**2 * s**2) * alpha + mb * r**2 * s * c * omega**2
        assert left - (m + mb) * r * s * yc_2 - trial.weight * r * s == pytest.approx(TORQUE, rel=1e-9)
        assert ax == pytest.approx(r * c * alpha - r * s * omega**2, rel=1e-9)


@pytest.mark.parametrize("sinking", [True, False], ids=["sinking", "rising"])
@pytest.mark.parametrize("id", [id for id, term in EFFECTS.items() if not term.sensor])
def test_the_energy_of_any_effect_changes_by_the_work_done_and_the_power_lost(id, sinking):
    # d(T + V + stored)/dt along the motion, by differences, is torque * omega - the power that is dissipated. Effects
    # are found by themselves, with the sizes that their own files call visible.
    rng = np.random.default_rng(9)
    trial = replace(make(()), effects=(drawn_effect(id, rng),))
    for state in states(rng, [0, 7], sinking, count=3, trial=trial):
        system = System(trial)
        modes = Modes(touching=[0, 7], slip=[1 if n == 0 else -1 for n in range(8)], top=[TOP] * 8)
        modes.dry = [-1 if sinking else 1, 1 if state[5] > 0 else -1]  # dry frictions slide
        z = [*state[:6], 50.0, 0.0, 0.0, *state[6:]]
        z += [1e-3 * (1 + n) for n in range(system.size - system.first)]  # how far the ground has given way
        system.derivative(0.1, z, modes)
        modes.inner = 1 if system.inner_holds > 0 else 0
        rate, step = np.array(system.derivative(0.1, z, modes)), 1e-6
        ahead, behind = (sum(system.energy(0.1, list(z + way * step * rate), modes)) for way in (1, -1))
        assert (ahead - behind) / (2 * step) == pytest.approx(rate[WORK] - rate[LOST], rel=1e-5, abs=1e-6)


def test_every_effect_names_sizes_that_can_be_seen():
    assert all(RANGES[id] for id, term in EFFECTS.items() if not term.sensor)
