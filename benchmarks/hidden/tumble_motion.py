"""The motion behind made-up tumbles: another integrator and other forms of the effects than the library's.

Written from shared conventions alone (docs), not from `rigid`: time stepping at 10 microseconds on the level of speeds
(Moreau's way: every step the impulse that would stop a slip, cut at Coulomb's bound), semi-implicit Euler, all eight
rows of spikes looked at in every step. Nothing is located in time and no effect shares code with `rigid.terms`.

A trial's numbers are a row of the table `p`, in the order of COLUMNS. Every function is inlined into the kernel.
"""

# Taichi reads the annotations and the source of kernels: no postponed annotations here.
import math

import numpy as np
import taichi as ti

from rigid.batch.runtime import ensure

__all__ = ["COLUMNS", "STEP", "move"]

COLUMNS = (
    "mass", "inertia", "length", "counterweight", "gravity_sim", "gravity_at_mass", "torque", "torque_until",
    "wheel_inertia", "wheel_sign", "wheel_speed_0", "mu_s", "mu_d", "stiffness", "damping",
    # what the base model leaves out; all zero: nothing
    "vibration_share", "vibration_speed", "vibration_power",
    "wire_curvature", "offset_x", "offset_y", "slope", "slope_bend", "ball", "pulley_mass",
    "rig_dry", "rig_viscous", "bearing_dry", "bearing_stribeck",
    "fade_speed", "fade_speed_square", "fade_time",
    "drag_normal", "drag_side", "drag_power", "harden_bend", "harden_power",
    "plastic", "adhesion", "adhesion_reach", "rate_change", "rate_speed", "cable_spring", "cable_cubic", "cable_drag",
    # outside the library
    "floor_x", "floor_y", "floor_rate", "magnet", "magnet_x", "loose_mass", "loose_rate", "shock_x", "shock_y",
    "shock_turn", "shock_time", "unbalance", "wind", "wind_from", "wind_to",
)  # fmt: skip
"""Numbers of one trial, SI units, in the order of the kernel's table."""
STEP = 1e-5
"""Of the integration [s]."""
ROW = 1e-4
"""Between two rows of the motion that is given back [s]."""
_COUNT = 8
NUMBER = {name: k for k, name in enumerate(COLUMNS)}
HALF, TURN = math.pi / _COUNT, 2 * math.pi / _COUNT


@ti.func
def spring(p: ti.template(), i, depth, top, rate):
    """Normal force of a row, elastic part and all."""
    K = p[i, NUMBER["stiffness"]]
    C = p[i, NUMBER["damping"]]
    bend = p[i, NUMBER["harden_bend"]]  # 1/m: K z (1 + b z)^1.4, then saturating where negative
    loaded = K * depth
    if bend > 0.0:
        loaded = K * depth * (1.0 + bend * depth) ** 1.4
    if bend < 0.0:
        loaded = K * depth / (1.0 - bend * depth)
    power = p[i, NUMBER["harden_power"]]
    if power > 0.0:  # K z0 (z / z0)^n about a depth of 0.1 mm
        loaded = K * 1e-4 * (depth / 1e-4) ** power
    plastic = p[i, NUMBER["plastic"]]
    if plastic > 0.0 and depth < top:  # the way back: a parabola from the deepest point down to the crater
        crater = plastic * top
        share = ti.max(depth - crater, 0.0) / ti.max(top - crater, 1e-12)
        peak = K * top
        if bend > 0.0:
            peak = K * top * (1.0 + bend * top) ** 1.4
        bent = ti.min(0.3, 1.5 * plastic)  # with the crater the way back straightens out
        loaded = peak * share * (1.0 - bent + bent * share)
    pull = 0.0
    A = p[i, NUMBER["adhesion"]]
    if A > 0.0 and depth < top:
        pull = A * ti.tanh((top - depth) / p[i, NUMBER["adhesion_reach"]])
    normal = loaded
    if rate > 0.0:
        normal += C * rate
        b = p[i, NUMBER["drag_normal"]]
        if b > 0.0:
            normal += b * rate ** p[i, NUMBER["drag_power"]]
    return normal, pull


@ti.func
def state_of(mode):
    """0 stands, 1 pivots, 2 slips, 3 hops."""
    touches = 0
    sticks = 0
    for n in ti.static(range(_COUNT)):
        if mode[n] != 0:
            touches += 1
        if mode[n] == 1:
            sticks += 1
    state = 3
    if touches > 0:
        state = 2
    if sticks == 1:
        state = 1
    if sticks > 1:
        state = 0
    return state


@ti.func
def wires(p: ti.template(), i, x, rise, fx, fy):
    """Forces with those of wires that are a true pendulum."""
    curvature = p[i, NUMBER["wire_curvature"]]
    mb = p[i, NUMBER["counterweight"]]
    g = p[i, NUMBER["gravity_at_mass"]]
    if curvature > 0.0:
        L = 1.0 / curvature - rise
        reach = ti.sqrt(L * L + x * x)
        tension = mb * g
        fx -= tension * x / reach
        fy += tension * (L / reach - 1.0)
    return fx, fy


@ti.func
def shaken_floor(p: ti.template(), i, t, settling):
    """Height, vertical and level speed of a floor that shakes, softly at first."""
    fade_in = 0.0
    if not settling:
        fade_in = 1.0 - ti.exp(-t / 0.05)
    angle = 2.0 * math.pi * p[i, NUMBER["floor_rate"]] * t
    floor = fade_in * p[i, NUMBER["floor_y"]] * ti.sin(angle)
    swing = fade_in * 2.0 * math.pi * p[i, NUMBER["floor_rate"]] * ti.cos(angle)
    floor_speed = swing * p[i, NUMBER["floor_y"]]
    belt = swing * p[i, NUMBER["floor_x"]]
    return floor, floor_speed, belt


@ti.func
def contacts(
    p: ti.template(), i, y, th, vx, vy, om, floor, floor_speed, belt, arm, ball, top, mode, settling, fx, fy, ft
):
    """Normal forces and heights of the rows, what touches, and the forces with them."""
    N = ti.Vector([0.0 for _ in range(_COUNT)])
    H = ti.Vector([0.0 for _ in range(_COUNT)])
    touching = 0
    for n in ti.static(range(_COUNT)):
        gamma = th + HALF + n * TURN
        h = arm * ti.cos(gamma) + ball
        d = arm * ti.sin(gamma)
        depth = h - y + floor
        H[n] = h
        if mode[n] == 0 and depth <= 0.0:
            top[n] = 0.0
        crater = p[i, NUMBER["plastic"]] * top[n]
        if depth > crater or (depth > 0.0 and top[n] > 0.0 and p[i, NUMBER["adhesion"]] > 0.0):
            top[n] = ti.max(top[n], depth)
            rate = floor_speed - (vy + om * d)
            if settling:
                rate = 0.0
            press, pull = spring(p, i, depth, top[n], rate)
            N[n] = ti.max(press, 0.0)
            fy += N[n] - pull
            ft += (N[n] - pull) * d
            if mode[n] == 0:
                mode[n] = 2
            touching += 1
            side = p[i, NUMBER["drag_side"]]
            if side > 0.0 and not settling:
                u = vx - om * h - belt
                fx -= side * ti.abs(u) * u
                ft += side * ti.abs(u) * u * h
        else:
            mode[n] = 0
    return N, H, top, mode, touching, fx, fy, ft


@ti.func
def motor(p: ti.template(), i, t, w, touching, settling):
    """Torque on the platform."""
    torque = 0.0
    alive = touching > 0 and not settling and t < p[i, NUMBER["torque_until"]]
    if p[i, NUMBER["wheel_sign"]] < 0.0 and w <= 0.0:
        alive = False
    if alive:
        torque = p[i, NUMBER["torque"]]
        ratio = p[i, NUMBER["fade_speed_square"]] * ti.abs(w)
        torque *= ti.max(0.0, 1.0 - ratio * ratio) / (1.0 + p[i, NUMBER["fade_speed"]] * ti.abs(w))
        torque *= ti.exp(-p[i, NUMBER["fade_time"]] * t)
    return torque


@ti.func
def dry_friction(p: ti.template(), i, vx, vy, om, th, ux, uy, fx, fy, ft):
    """Forces with those of rig, bearing and cable: smooth dry friction."""
    rise = vx * ux + vy * uy
    hold = p[i, NUMBER["rig_dry"]] * ti.tanh(rise / 2e-4) + p[i, NUMBER["rig_viscous"]] * rise
    fx -= hold * ux
    fy -= hold * uy
    dry = p[i, NUMBER["bearing_dry"]]
    ft -= dry * ti.tanh(om / 2e-3) * (1.0 + p[i, NUMBER["bearing_stribeck"]] * ti.exp(-ti.abs(om) / 0.3))
    # softening: a spring that goes with sin(theta) would be a centre of mass off the shaft, to the letter
    ft -= p[i, NUMBER["cable_spring"]] * th / (1.0 + 0.2 * ti.abs(th))
    ft -= p[i, NUMBER["cable_cubic"]] * th * ti.abs(th)
    ft -= p[i, NUMBER["cable_drag"]] * ti.abs(om) ** 0.7 * ti.math.sign(om)
    return fx, fy, ft


@ti.func
def outside(p: ti.template(), i, t, x, c, s, w, q, qd, phase, settling, fx, fy, ft):
    """Forces with those that are in no library of effects."""
    A = p[i, NUMBER["magnet"]]
    if A > 0.0 and not settling:
        away = x - p[i, NUMBER["magnet_x"]]
        square = away * away + 0.04 * 0.04
        fx -= A * away / square**2 * 0.04**3
        fy -= A * 0.04 / square**2 * 0.04**3
    ml = p[i, NUMBER["loose_mass"]]
    if ml > 0.0 and not settling:
        rate0 = 2.0 * math.pi * p[i, NUMBER["loose_rate"]]
        push = ml * (rate0 * rate0 * q + 2.0 * 0.03 * rate0 * qd)
        fx += push * c
        fy -= push * s
    at = (t - p[i, NUMBER["shock_time"]]) / 0.012
    if ti.abs(at) < 6.0 and not settling:
        pulse = ti.exp(-0.5 * at * at) / (0.012 * 2.5066282746310002)
        fx += p[i, NUMBER["shock_x"]] * pulse
        fy += p[i, NUMBER["shock_y"]] * pulse
        ft += p[i, NUMBER["shock_turn"]] * pulse
    u0 = p[i, NUMBER["unbalance"]]
    if u0 > 0.0 and not settling:
        strength = u0 * (w / 100.0) ** 2
        fx += strength * ti.cos(phase)
        fy += strength * ti.sin(phase)
    if not settling and t > p[i, NUMBER["wind_from"]] and t < p[i, NUMBER["wind_to"]]:
        fx += p[i, NUMBER["wind"]]
    return fx, fy, ft


@ti.func
def sliding(p: ti.template(), i, v, mode, N, H, Mi, vx, om, belt, factor, dt):
    """Speeds after the friction of the rows that slide."""
    mu_d = p[i, NUMBER["mu_d"]]
    for n in ti.static(range(_COUNT)):
        if mode[n] == 2:
            u = vx - om * H[n] - belt
            growth = 1.0
            change = p[i, NUMBER["rate_change"]]
            if change != 0.0:
                growth = 1.0 + change * (1.0 - ti.exp(-ti.abs(u) / p[i, NUMBER["rate_speed"]]))
            bound = mu_d * factor * growth * N[n]
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
def sticking(p: ti.template(), i, v, mode, N, H, Mi, load, mean_h, belt, factor, dt):
    """Speeds after the friction of the rows that stick, together."""
    mu_s = p[i, NUMBER["mu_s"]]
    mu_d = p[i, NUMBER["mu_d"]]
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
        bound = mu_s * factor * load
        if ti.abs(need) > bound:
            need = mu_d * factor * load * ti.math.sign(need)
            for n in ti.static(range(_COUNT)):
                if mode[n] == 1:
                    mode[n] = 2
        v += dt * need * effect
    return v, mode


@ti.kernel
def run(
    p: ti.types.ndarray(dtype=ti.f64, ndim=2),
    dt: ti.f64,
    every: ti.i32,
    steps: ti.i32,
    out: ti.types.ndarray(dtype=ti.f64, ndim=3),
):
    ti.loop_config(block_dim=1)
    for i in range(p.shape[0]):
        m = p[i, NUMBER["mass"]]
        J = p[i, NUMBER["inertia"]]
        length = p[i, NUMBER["length"]]
        mb = p[i, NUMBER["counterweight"]]
        W = (m + mb) * p[i, NUMBER["gravity_sim"]]
        g = p[i, NUMBER["gravity_at_mass"]]
        ball = p[i, NUMBER["ball"]]
        arm = length - ball
        lifted = mb + p[i, NUMBER["pulley_mass"]]
        ex0 = p[i, NUMBER["offset_x"]]
        ey0 = p[i, NUMBER["offset_y"]]
        x, th, vx, vy, om = 0.0, 0.0, 0.0, 0.0, 0.0
        y = arm * ti.cos(HALF) + ball - 0.5 * W / p[i, NUMBER["stiffness"]]
        y0 = y
        w = p[i, NUMBER["wheel_speed_0"]]
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
                if row < out.shape[1]:
                    out[i, row, 0] = x
                    out[i, row, 1] = y
                    out[i, row, 2] = th
                    out[i, row, 3] = vx
                    out[i, row, 4] = vy
                    out[i, row, 5] = om
                    out[i, row, 6] = w
                    out[i, row, 7] = state_of(mode)
            t = run_time
            lean = p[i, NUMBER["slope"]] + p[i, NUMBER["slope_bend"]] * x
            ux, uy = ti.sin(lean), ti.cos(lean)
            c, s = ti.cos(th), ti.sin(th)
            ex, ey = ex0 * c + ey0 * s, ey0 * c - ex0 * s
            fx = -W * ux + m * om * om * ex
            fy = -W * uy + m * om * om * ey
            ft = m * g * (ex * uy - ey * ux)
            fx, fy = wires(p, i, x, y - y0, fx, fy)
            floor, floor_speed, belt = shaken_floor(p, i, t, settling)
            # contacts
            load, mean_h = 0.0, 0.0
            N, H, top, mode, touching, fx, fy, ft = contacts(
                p, i, y, th, vx, vy, om, floor, floor_speed, belt, arm, ball, top, mode, settling, fx, fy, ft
            )
            # torque
            torque = motor(p, i, t, w, touching, settling)
            ft += torque
            w_before = w
            w += p[i, NUMBER["wheel_sign"]] * torque / p[i, NUMBER["wheel_inertia"]] * dt
            if p[i, NUMBER["wheel_sign"]] < 0.0:
                w = ti.max(w, 0.0)
            if not settling:
                phase += w_before * dt
            fx, fy, ft = dry_friction(p, i, vx, vy, om, th, ux, uy, fx, fy, ft)
            # outside the library
            fx, fy, ft = outside(p, i, t, x, c, s, w, q, qd, phase, settling, fx, fy, ft)
            ml = p[i, NUMBER["loose_mass"]]
            if settling:
                # Overdamped: forces move it, friction holds x through the mean height of the tips.
                for n in ti.static(range(_COUNT)):
                    load += N[n]
                    mean_h += N[n] * H[n]
                mean_h /= ti.max(load, 1e-12)
                ft += fx * mean_h
                K = p[i, NUMBER["stiffness"]] * (1.0 + ti.abs(p[i, NUMBER["harden_bend"]]) * 1e-3)
                y += 0.02 * fy / K
                th += 0.02 * ft / (K * 0.006)
                for n in ti.static(range(_COUNT)):
                    if mode[n] != 0:
                        mode[n] = 1
                        depth = arm * ti.cos(th + HALF + n * TURN) + ball - y
                        if k < rest - 2:
                            top[n] = depth
                continue
            # free speeds at the end of the step
            xx, xy, yy = m + lifted * ux * ux, lifted * ux * uy, m + lifted * uy * uy
            M = ti.Matrix([[xx, xy, m * ey], [xy, yy, -m * ex], [m * ey, -m * ex, J]])
            Mi = M.inverse()
            v = ti.Vector([vx, vy, om]) + dt * (Mi @ ti.Vector([fx, fy, ft]))
            factor = 1.0
            share = p[i, NUMBER["vibration_share"]]
            if share > 0.0:
                r = ti.abs(w) / p[i, NUMBER["vibration_speed"]]
                factor = 1.0 - share * ti.min(1.0, r ** p[i, NUMBER["vibration_power"]])
            # those that slide
            v, mode = sliding(p, i, v, mode, N, H, Mi, vx, om, belt, factor, dt)
            # those that stick, together
            v, mode = sticking(p, i, v, mode, N, H, Mi, load, mean_h, belt, factor, dt)
            if ml > 0.0:
                ax = (v[0] - vx) / dt
                ay = (v[1] - vy) / dt
                rate0 = 2.0 * math.pi * p[i, NUMBER["loose_rate"]]
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
