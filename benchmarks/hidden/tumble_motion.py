"""The motion behind made-up tumbles: another integrator and other forms of the effects than the library's.

Written from shared conventions alone (docs), not from `rigid`: time stepping at 10 microseconds on the level of speeds
(Moreau's way: every step the impulse that would stop a slip, cut at Coulomb's bound), semi-implicit Euler, all eight
rows of spikes looked at in every step. Nothing is located in time and no effect shares code with `rigid.terms`.

A trial's numbers are a row of the table `p`, in the order of COLUMNS. Every function is inlined into the kernel.
"""

# Taichi reads the annotations and the source of kernels: no postponed annotations here.
import math

import numpy as np

from hedgebed_taichi import ti
from rigid.batch.runtime import ensure

__all__ = ["COLUMNS", "STEP", "move"]

COLUMNS = (
    "mass", "inertia", "length", "counterweight", "gravity_sim", "gravity_at_mass", "torque", "torque_until",
    "wheel_inertia", "wheel_sign", "wheel_speed_0", "mu_s", "mu_d", "stiffness", "damping",
    # what the base model leaves out; all zero: nothing
    "vibration_share", "vibration_speed", "vibration_power",
    "wire_curvature", "offset_x", "offset_y", "slope", "ball", "pulley_mass",
    "rig_dry", "rig_viscous", "bearing_dry", "bearing_stribeck",
    "fade_speed", "fade_speed_square", "fade_time",
    "drag_normal", "drag_side", "drag_power", "harden_bend",
    "plastic", "adhesion", "adhesion_reach", "rate_change", "rate_speed", "cable_spring", "cable_cubic", "cable_drag",
    # outside the library
    "floor_x", "floor_y", "floor_rate", "magnet", "magnet_x", "loose_mass", "loose_rate", "shock_x", "shock_y",
    "shock_turn", "shock_time", "unbalance", "wind", "wind_from", "wind_to",
)  # fmt: skip
"""Numbers of one trial, SI units, in the order of the kernel's table."""
STEP = 1e-5  # of the integration [s]
ROW = 1e-4  # between two rows of the motion that is given back [s]
_COUNT = 8
HALF, TURN = math.pi / _COUNT, 2 * math.pi / _COUNT
Numbers = ti.types.struct(**dict.fromkeys(COLUMNS, ti.f64))


@ti.func
def numbers_of(table: ti.template(), i):
    """Of one trial, by name."""
    return Numbers(*[table[i, k] for k in ti.static(range(len(COLUMNS)))])


@ti.func
def spring(p: ti.template(), depth, top, rate):
    """Normal force of a row, elastic part and all."""
    bend = p.harden_bend  # 1/m: K z (1 + b z)^1.4, then saturating where negative
    loaded = p.stiffness * depth
    if bend > 0.0:
        loaded *= (1.0 + bend * depth) ** 1.4
    if bend < 0.0:
        loaded /= 1.0 - bend * depth
    if p.plastic > 0.0 and depth < top:  # the way back: a parabola from the deepest point down to the crater
        crater = p.plastic * top
        share = ti.max(depth - crater, 0.0) / ti.max(top - crater, 1e-12)
        peak = p.stiffness * top
        if bend > 0.0:
            peak *= (1.0 + bend * top) ** 1.4
        bent = ti.min(0.3, 1.5 * p.plastic)  # with the crater the way back straightens out
        loaded = peak * share * (1.0 - bent + bent * share)
    pull = 0.0
    if p.adhesion > 0.0 and depth < top:
        pull = p.adhesion * ti.tanh((top - depth) / p.adhesion_reach)
    if rate > 0.0:
        loaded += p.damping * rate
        if p.drag_normal > 0.0:
            loaded += p.drag_normal * rate**p.drag_power
    return loaded, pull


@ti.func
def state_of(mode):
    """0 stands, 1 pivots, 2 slips, 3 hops."""
    touches, sticks = 0, 0
    for n in ti.static(range(_COUNT)):
        touches += mode[n] != 0
        sticks += mode[n] == 1
    state = 3
    if touches > 0:
        state = 2
    if sticks == 1:
        state = 1
    if sticks > 1:
        state = 0
    return state


@ti.func
def wires(p: ti.template(), x, rise, f):
    """Forces (x, y, theta) with those of wires that are a true pendulum."""
    if p.wire_curvature > 0.0:
        L = 1.0 / p.wire_curvature - rise
        reach = ti.sqrt(L * L + x * x)
        f += p.counterweight * p.gravity_at_mass * ti.Vector([-x / reach, L / reach - 1.0, 0.0])
    return f


@ti.func
def shaken_floor(p: ti.template(), t, settling):
    """Height, vertical and level speed of a floor that shakes, softly at first."""
    fade_in = 0.0
    if not settling:
        fade_in = 1.0 - ti.exp(-t / 0.05)
    angle = 2.0 * math.pi * p.floor_rate * t
    swing = fade_in * 2.0 * math.pi * p.floor_rate * ti.cos(angle)
    return fade_in * p.floor_y * ti.sin(angle), swing * p.floor_y, swing * p.floor_x


@ti.func
def contacts(p: ti.template(), y, th, vx, vy, om, floor, floor_speed, belt, arm, top, mode, settling, f):
    """Normal forces and heights of the rows, what touches, and the forces with them."""
    N = ti.Vector([0.0 for _ in range(_COUNT)])
    H = ti.Vector([0.0 for _ in range(_COUNT)])
    touching = 0
    for n in ti.static(range(_COUNT)):
        gamma = th + HALF + n * TURN
        h = arm * ti.cos(gamma) + p.ball
        d = arm * ti.sin(gamma)
        depth = h - y + floor
        H[n] = h
        if mode[n] == 0 and depth <= 0.0:
            top[n] = 0.0
        crater = p.plastic * top[n]
        if depth > crater or (depth > 0.0 and top[n] > 0.0 and p.adhesion > 0.0):
            top[n] = ti.max(top[n], depth)
            rate = floor_speed - (vy + om * d)
            if settling:
                rate = 0.0
            press, pull = spring(p, depth, top[n], rate)
            N[n] = ti.max(press, 0.0)
            f += (N[n] - pull) * ti.Vector([0.0, 1.0, d])
            if mode[n] == 0:
                mode[n] = 2
            touching += 1
            if p.drag_side > 0.0 and not settling:
                u = vx - om * h - belt
                f += p.drag_side * ti.abs(u) * u * ti.Vector([-1.0, 0.0, h])
        else:
            mode[n] = 0
    return N, H, top, mode, touching, f


@ti.func
def motor(p: ti.template(), t, w, touching, settling):
    """Torque on the platform."""
    torque = 0.0
    alive = touching > 0 and not settling and t < p.torque_until
    if p.wheel_sign < 0.0 and w <= 0.0:
        alive = False
    if alive:
        torque = p.torque
        ratio = p.fade_speed_square * ti.abs(w)
        torque *= ti.max(0.0, 1.0 - ratio * ratio) / (1.0 + p.fade_speed * ti.abs(w))
        torque *= ti.exp(-p.fade_time * t)
    return torque


@ti.func
def dry_friction(p: ti.template(), vx, vy, om, th, ux, uy, f):
    """Forces with those of rig, bearing and cable: smooth dry friction."""
    rise = vx * ux + vy * uy
    hold = p.rig_dry * ti.tanh(rise / 2e-4) + p.rig_viscous * rise
    turn = -p.bearing_dry * ti.tanh(om / 2e-3) * (1.0 + p.bearing_stribeck * ti.exp(-ti.abs(om) / 0.3))
    # softening: a spring that goes with sin(theta) would be a centre of mass off the shaft, to the letter
    f += ti.Vector([-hold * ux, -hold * uy, turn])
    f[2] -= p.cable_spring * th / (1.0 + 0.2 * ti.abs(th))
    f[2] -= p.cable_cubic * th * ti.abs(th)
    f[2] -= p.cable_drag * ti.abs(om) ** 0.7 * ti.math.sign(om)
    return f


@ti.func
def outside(p: ti.template(), t, x, c, s, w, q, qd, phase, settling, f):
    """Forces with those that are in no library of effects."""
    A = p.magnet
    if A > 0.0 and not settling:
        away = x - p.magnet_x
        square = away * away + 0.04 * 0.04
        f -= ti.Vector([A * away / square**2 * 0.04**3, A * 0.04 / square**2 * 0.04**3, 0.0])
    if p.loose_mass > 0.0 and not settling:
        rate0 = 2.0 * math.pi * p.loose_rate
        push = p.loose_mass * (rate0 * rate0 * q + 2.0 * 0.03 * rate0 * qd)
        f += push * ti.Vector([c, -s, 0.0])
    at = (t - p.shock_time) / 0.012
    if ti.abs(at) < 6.0 and not settling:
        pulse = ti.exp(-0.5 * at * at) / (0.012 * 2.5066282746310002)
        f += pulse * ti.Vector([p.shock_x, p.shock_y, p.shock_turn])
    if p.unbalance > 0.0 and not settling:
        strength = p.unbalance * (w / 100.0) ** 2
        f += strength * ti.Vector([ti.cos(phase), ti.sin(phase), 0.0])
    if not settling and t > p.wind_from and t < p.wind_to:
        f[0] += p.wind
    return f


@ti.func
def sliding(p: ti.template(), v, mode, N, H, Mi, vx, om, belt, factor, dt):
    """Speeds after the friction of the rows that slide."""
    for n in ti.static(range(_COUNT)):
        if mode[n] == 2:
            u = vx - om * H[n] - belt
            growth = 1.0
            if p.rate_change != 0.0:
                growth = 1.0 + p.rate_change * (1.0 - ti.exp(-ti.abs(u) / p.rate_speed))
            bound = p.mu_d * factor * growth * N[n]
            effect = Mi @ ti.Vector([1.0, 0.0, -H[n]])
            compliance = effect[0] - H[n] * effect[2]
            slip = v[0] - v[2] * H[n] - belt
            need = -slip / (compliance * dt)
            force = 0.0
            if ti.abs(need) <= bound:  # it comes to rest within this step
                force = need
                mode[n] = 1
            else:
                force = bound
                if u > 0.0 or (u == 0.0 and slip > 0.0):
                    force = -bound
            v += dt * force * effect
    return v, mode


@ti.func
def sticking(p: ti.template(), v, mode, N, H, Mi, load, mean_h, belt, factor, dt):
    """Speeds after the friction of the rows that stick, together."""
    count = 0
    for n in ti.static(range(_COUNT)):
        if mode[n] == 1:
            load += N[n]
            mean_h += N[n] * H[n]
            count += 1
    if count > 0:
        if load > 0.0:
            mean_h /= load
        else:
            for n in ti.static(range(_COUNT)):
                if mode[n] == 1:
                    mean_h = H[n]
        effect = Mi @ ti.Vector([1.0, 0.0, -mean_h])
        compliance = effect[0] - mean_h * effect[2]
        need = -(v[0] - v[2] * mean_h - belt) / (compliance * dt)
        bound = p.mu_s * factor * load
        if ti.abs(need) > bound:
            need = p.mu_d * factor * load * ti.math.sign(need)
            for n in ti.static(range(_COUNT)):
                if mode[n] == 1:
                    mode[n] = 2
        v += dt * need * effect
    return v, mode


@ti.kernel
def run(
    table: ti.types.ndarray(dtype=ti.f64, ndim=2),
    dt: ti.f64,
    every: ti.i32,
    steps: ti.i32,
    out: ti.types.ndarray(dtype=ti.f64, ndim=3),
):
    ti.loop_config(block_dim=1)
    for i in range(table.shape[0]):
        p = numbers_of(table, i)
        m = p.mass
        W = (m + p.counterweight) * p.gravity_sim
        arm = p.length - p.ball
        lifted = p.counterweight + p.pulley_mass
        x, th, vx, vy, om = 0.0, 0.0, 0.0, 0.0, 0.0
        y = arm * ti.cos(HALF) + p.ball - 0.5 * W / p.stiffness
        y0 = y
        w = p.wheel_speed_0
        phase = 0.0
        q, qd = 0.0, 0.0  # the loose mass along body x
        top = ti.Vector([0.0 for _ in range(_COUNT)])
        mode = ti.Vector([0 for _ in range(_COUNT)])  # 0 away, 1 sticks, 2 slides
        run_time = 0.0
        rest = 20000
        # At rest first: the platform sinks into its balance slowly, held by friction (x does not move).
        for k in range(rest + steps + 1):
            settling = k < rest
            if not settling and (k - rest) % every == 0:
                row = (k - rest) // every
                now = ti.Vector([x, y, th, vx, vy, om, w, state_of(mode)])
                for column in ti.static(range(8)):
                    out[i, row, column] = now[column]
            t = run_time
            ux, uy = ti.sin(p.slope), ti.cos(p.slope)
            c, s = ti.cos(th), ti.sin(th)
            ex, ey = p.offset_x * c + p.offset_y * s, p.offset_y * c - p.offset_x * s
            turn = m * p.gravity_at_mass * (ex * uy - ey * ux)
            f = wires(p, x, y - y0, ti.Vector([-W * ux + m * om * om * ex, -W * uy + m * om * om * ey, turn]))
            floor, floor_speed, belt = shaken_floor(p, t, settling)
            load, mean_h = 0.0, 0.0
            N, H, top, mode, touching, f = contacts(
                p, y, th, vx, vy, om, floor, floor_speed, belt, arm, top, mode, settling, f
            )
            torque = motor(p, t, w, touching, settling)
            f[2] += torque
            w_before = w
            w += p.wheel_sign * torque / p.wheel_inertia * dt
            if p.wheel_sign < 0.0:
                w = ti.max(w, 0.0)
            if not settling:
                phase += w_before * dt
            f = dry_friction(p, vx, vy, om, th, ux, uy, f)
            f = outside(p, t, x, c, s, w, q, qd, phase, settling, f)
            if settling:
                # Overdamped: forces move it, friction holds x through the mean height of the tips.
                for n in ti.static(range(_COUNT)):
                    load += N[n]
                    mean_h += N[n] * H[n]
                mean_h /= ti.max(load, 1e-12)
                f[2] += f[0] * mean_h
                K = p.stiffness * (1.0 + ti.abs(p.harden_bend) * 1e-3)
                y += 0.02 * f[1] / K
                th += 0.02 * f[2] / (K * 0.006)
                for n in ti.static(range(_COUNT)):
                    if mode[n] != 0:
                        mode[n] = 1
                        depth = arm * ti.cos(th + HALF + n * TURN) + p.ball - y
                        if k < rest - 2:
                            top[n] = depth
                continue
            # free speeds at the end of the step
            xx, xy, yy = m + lifted * ux * ux, lifted * ux * uy, m + lifted * uy * uy
            M = ti.Matrix([[xx, xy, m * ey], [xy, yy, -m * ex], [m * ey, -m * ex, p.inertia]])
            Mi = M.inverse()
            v = ti.Vector([vx, vy, om]) + dt * (Mi @ f)
            factor = 1.0
            if p.vibration_share > 0.0:
                r = ti.abs(w) / p.vibration_speed
                factor = 1.0 - p.vibration_share * ti.min(1.0, r**p.vibration_power)
            v, mode = sliding(p, v, mode, N, H, Mi, vx, om, belt, factor, dt)
            v, mode = sticking(p, v, mode, N, H, Mi, load, mean_h, belt, factor, dt)
            if p.loose_mass > 0.0:
                ax = (v[0] - vx) / dt
                ay = (v[1] - vy) / dt
                rate0 = 2.0 * math.pi * p.loose_rate
                qd += dt * (-rate0 * rate0 * q - 2.0 * 0.03 * rate0 * qd - (ax * c - ay * s))
                q += dt * qd
            vx, vy, om = v[0], v[1], v[2]
            x += dt * vx
            y += dt * vy
            th += dt * om
            run_time += dt


def move(numbers: np.ndarray, duration: float, *, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """Times [s], shape [row_count], and motions, shape [trial_count, row_count, 8].

    Columns of a motion: x, y, theta, vx, vy, omega, wheel speed, state (0 stand, 1 pivot, 2 slip, 3 hop).

    ``numbers``: of every trial, shape [trial_count, len(COLUMNS)]. ``duration``: [s]. ``step``: of the integration [s];
    a longer one where the answer need not be good. Raises ValueError for a table of another width, RuntimeError where a
    motion is no longer finite.
    """
    numbers = np.ascontiguousarray(numbers, dtype=float)
    if numbers.ndim != 2 or numbers.shape[1] != len(COLUMNS):
        raise ValueError(f"numbers has shape {numbers.shape}: [trial_count, {len(COLUMNS)}] was expected")
    ensure()
    every = max(1, round(ROW / step))
    rows = math.ceil(duration / (step * every)) + 1
    out = np.full((len(numbers), rows, 8), np.nan)
    run(numbers, step, every, (rows - 1) * every, out)
    if not np.isfinite(out).all():
        raise RuntimeError(f"the motion of trial {int(np.argmin(np.isfinite(out).all(axis=(1, 2))))} is not finite")
    return np.arange(rows) * step * every, out
