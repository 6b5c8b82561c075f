"""The motion of the second simulator: one planar platform a lane, written from the shared conventions alone.

Coordinates, terms and signs are those of the design note "planar model". Nothing here comes from `rigid` or `coupling`.
The integrator is a leapfrog with a fixed step (drift, kick, drift). Each row of spikes has a friction spring of its own
(`shear_stiffness`), so two sticking rows share a load by their displacements. Each leg may be compliant along its axis.

A lane is one row of numbers, in the order of `COLUMNS`. All columns that are zero leave their effect out.
"""

# Taichi reads the annotations and the source of kernels: no postponed annotations here.
import math

import numpy as np

from hedgebed_taichi import is_running, ti

__all__ = ["COLUMNS", "ROWS", "STEP", "move"]

COLUMNS = (
    "mass", "inertia", "length", "counterweight", "gravity_sim", "gravity_local", "torque", "torque_until",
    "wheel_inertia", "wheel_sign", "wheel_speed_0", "mu_s", "mu_d", "stiffness", "damping",
    # the structure: compliant legs (0: rigid), friction springs and their dampers
    "leg_stiffness", "leg_time", "shear_stiffness", "shear_damping",
    # effects with a name
    "vibration", "vibration_speed", "wire_curvature", "wire_exact", "offset_x", "offset_y", "slope", "ball",
    "rig_dry", "rig_viscous", "pulley_mass", "fade_speed", "fade_time", "drag", "drag_side", "harden_power",
    "harden_linear", "harden_depth", "plastic", "adhesion", "adhesion_reach", "rate_change", "rate_speed",
    "cable_spring", "cable_drag", "bearing",
    # effects without a name
    "bump", "bump_x", "bump_width", "tremor", "tremor_rate", "slosh_mass", "slosh_rate", "gust", "gust_time",
    # of a test: an initial state in place of the static one
    "free_start", "x_0", "y_0", "theta_0", "vx_0", "vy_0", "omega_0",
)  # fmt: skip
"""Numbers of one lane, SI units."""
ROWS = ("x", "y", "theta", "vx", "vy", "omega", "wheel", "sticking", "touching", "energy")
"""Values of one row of the motion; `energy` [J] is kinetic, of gravity, of surface, legs and friction springs."""
STEP = 5e-5  # of the integration [s]
ROW = 5e-4  # between two rows of the motion [s]
SETTLE = 1.2  # of damped motion before t = 0, in which the platform finds its static equilibrium [s]
_TIPS = 8
_PI = math.pi
_SIN = [math.sin(math.pi / _TIPS + n * 2 * math.pi / _TIPS) for n in range(_TIPS)]  # of a spike at theta = 0
_COS = [math.cos(math.pi / _TIPS + n * 2 * math.pi / _TIPS) for n in range(_TIPS)]
Numbers = ti.types.struct(**dict.fromkeys(COLUMNS, ti.f64))
Tips = ti.types.vector(_TIPS, ti.f64)


@ti.func
def pressed(p: ti.template(), depth, top):
    """Force of the surface on a tip at `depth` that has been at `top`, without the damper, and its work [N], [J]."""
    deep = ti.max(depth, 0.0)
    if p.plastic > 0.0 and depth < top:
        deep = top
    force = p.stiffness * deep
    if p.harden_power != 0.0:
        force *= ti.pow(ti.max(deep, 1e-12) / p.harden_depth, p.harden_power)
    if p.harden_linear != 0.0:
        force *= ti.max(1.0 + p.harden_linear * deep / p.harden_depth, 0.05)
    if p.plastic > 0.0 and depth < top:
        crater = p.plastic * top
        force *= ti.max(depth - crater, 0.0) / (top - crater)
    return force


@ti.func
def tip_forces(p: ti.template(), depth, into, slide, top, spring, mode, way, wheel, settling):
    """Press, pull and friction of one tip [N]; its friction spring, mode (0 sticks, 1 slips) and direction after."""
    rate = ti.max(into, 0.0)
    if settling:
        rate = 0.0
    press = ti.max(pressed(p, depth, top) + p.damping * rate + p.drag * rate * rate, 0.0)
    pull = 0.0
    if p.adhesion > 0.0 and depth < top:
        pull = p.adhesion * (1.0 - ti.exp((depth - top) / p.adhesion_reach))
    less = 1.0 - p.vibration * (1.0 - ti.exp(-ti.abs(wheel) / ti.max(p.vibration_speed, 1e-9)))
    bound = less * p.mu_s * press
    sliding = less * p.mu_d * press
    sliding *= 1.0 + p.rate_change * (1.0 - ti.exp(-ti.abs(slide) / ti.max(p.rate_speed, 1e-9)))
    if mode == 1 and slide * way <= 0.0:  # it came to rest: it sticks with the force that it had
        mode = 0
        spring = way * sliding / p.shear_stiffness
    friction = -(p.shear_stiffness * spring + p.shear_damping * slide)
    if mode == 0 and ti.abs(friction) > bound:
        mode = 1
        way = -ti.math.sign(friction)
    if mode == 1:
        friction = -way * sliding
        spring = way * sliding / p.shear_stiffness
    friction -= p.drag_side * ti.abs(slide) * slide
    return press, pull, friction, spring, mode, way


@ti.func
def outer(p: ti.template(), t, x, rise, vx, vy, th, om, tension, settling):
    """Forces (x, y, turn) of gravity, rig, cable, bearing and what has no name; without those of the tips."""
    s, c = ti.sin(p.slope), ti.cos(p.slope)
    # the pair hangs on vertical wires: its net weight pulls straight down, whatever the surface does
    weight = (p.mass + p.counterweight) * p.gravity_sim
    f = ti.Vector([-weight * s, -weight * c, 0.0])
    away = p.offset_x * ti.cos(th) + p.offset_y * ti.sin(th)
    lift = p.offset_y * ti.cos(th) - p.offset_x * ti.sin(th)
    f[2] += p.mass * p.gravity_local * (c * away - s * lift)
    if p.wire_curvature > 0.0:
        L = 1.0 / p.wire_curvature
        if p.wire_exact > 0.5:
            reach = ti.sqrt((L - rise) ** 2 + x * x)
            f += tension * ti.Vector([-x / reach, (L - rise) / reach - 1.0, 0.0])
        else:
            f[0] -= tension * x / L
    if not settling:
        up = vx * s + vy * c
        held = p.rig_dry * ti.tanh(up / 5e-4) + p.rig_viscous * up
        f += ti.Vector([-held * s, -held * c, -p.bearing * ti.tanh(om / 5e-3)])
        f[2] -= p.cable_spring * th + p.cable_drag * om
        if p.gust != 0.0:
            f[0] += p.gust * ti.exp(-0.5 * ((t - p.gust_time) / 0.06) ** 2)
        if p.tremor > 0.0:
            w = 2.0 * _PI * p.tremor_rate
            f[1] += p.tremor * (1.0 - ti.exp(-t / 0.05)) * ti.sin(w * t)
    return f


@ti.func
def accelerate(p: ti.template(), f, th, om):
    """Accelerations (x, y, turn) under generalised forces: a mass matrix with counterweight, slope and offset."""
    s, c = ti.sin(p.slope), ti.cos(p.slope)
    rx = p.offset_x * ti.cos(th) + p.offset_y * ti.sin(th)
    ry = p.offset_y * ti.cos(th) - p.offset_x * ti.sin(th)
    hung = p.counterweight + p.pulley_mass
    m = p.mass
    M = ti.Matrix([
        [m + hung * s * s, hung * s * c, m * ry],
        [hung * s * c, m + hung * c * c, -m * rx],
        [m * ry, -m * rx, p.inertia],
    ])  # fmt: skip
    return M.inverse() @ (f + ti.Vector([m * rx * om * om, m * ry * om * om, 0.0]))


@ti.func
def torque_now(p: ti.template(), t, wheel, touching):
    """Torque on the platform [N m]: while a spike touches, up to its end, of a brake while the wheel turns."""
    torque = 0.0
    if touching > 0 and 0.0 <= t < p.torque_until and not (p.wheel_sign < 0.0 and wheel <= 0.0):
        torque = p.torque * ti.exp(-p.fade_time * t) * ti.max(0.0, 1.0 - p.fade_speed * wheel)
    return torque


@ti.func
def energy_of(p: ti.template(), x, y, th, vx, vy, om, legs, springs, depths):
    """Kinetic energy and what gravity, surface, legs and friction springs hold [J]; base model with its structure."""
    rise = vx * ti.sin(p.slope) + vy * ti.cos(p.slope)
    E = 0.5 * (p.mass * (vx**2 + vy**2) + p.counterweight * rise**2 + p.inertia * om**2)
    E += (p.mass + p.counterweight) * p.gravity_sim * (x * ti.sin(p.slope) + y * ti.cos(p.slope))
    for n in ti.static(range(_TIPS)):
        if depths[n] > 0.0:
            E += 0.5 * p.stiffness * depths[n] ** 2 + 0.5 * p.shear_stiffness * springs[n] ** 2
        E += 0.5 * p.leg_stiffness * legs[n] ** 2
    return E


@ti.kernel
def run(table: ti.types.ndarray(), step: ti.f64, every: ti.i32, settle: ti.i32, rows: ti.i32, out: ti.types.ndarray()):
    for lane in range(table.shape[0]):
        p = Numbers(*[table[lane, k] for k in ti.static(range(len(COLUMNS)))])
        legs, springs, tops, modes, ways, depths = (
            Tips(0.0), Tips(0.0), Tips(0.0), Tips(0.0), Tips(1.0), Tips(0.0)
        )  # fmt: skip
        weight = (p.mass + p.counterweight) * p.gravity_sim
        x, th, wheel = 0.0, 0.0, p.wheel_speed_0
        y = (p.length - p.ball) * _COS[0] + p.ball - 0.5 * weight / p.stiffness
        vx, vy, om = 0.0, 0.0, 0.0
        begin, touching, sticking, row = settle, 2, 2, 0
        if p.free_start > 0.5:
            begin, touching, sticking = 0, 0, 0
            x, y, th = p.x_0, p.y_0, p.theta_0
            vx, vy, om = p.vx_0, p.vy_0, p.omega_0
        start = y
        slosh, slosh_speed, fall = 0.0, 0.0, 0.0
        # Critical for sinking, and, in x and turn together, for rocking; the damper of the surface is off meanwhile.
        sink = 2.0 * ti.sqrt(2.0 * p.stiffness * (p.mass + p.counterweight))
        rock = _SIN[0] * p.length * ti.sqrt(2.0 * p.stiffness * (p.inertia + p.mass * p.length**2))
        k = -begin
        while row < rows:
            if k == 0 and begin > 0:
                vx, vy, om = 0.0, 0.0, 0.0
                start = y
                x = 0.0  # the camera's x is from the start
            if k >= 0 and k % every == 0:
                values = ti.Vector([x, y, th, vx, vy, om, wheel, float(sticking), float(touching),
                                    energy_of(p, x, y, th, vx, vy, om, legs, springs, depths)])  # fmt: skip
                for j in ti.static(range(10)):
                    out[lane, row, j] = values[j]
                row += 1
            t = (k + 0.5) * step
            settling = k < 0
            x += 0.5 * step * vx
            y += 0.5 * step * vy
            th += 0.5 * step * om
            tension = p.counterweight * (p.gravity_local - fall)
            f = outer(p, t, x, y - start, vx, vy, th, om, tension, settling)
            touching, sticking = 0, 0
            s0, c0 = ti.sin(th), ti.cos(th)
            for n in ti.static(range(_TIPS)):
                sg = s0 * _COS[n] + c0 * _SIN[n]
                cg = c0 * _COS[n] - s0 * _SIN[n]
                arm = p.length - p.ball - legs[n]
                h, d = arm * cg + p.ball, arm * sg
                depth = h - y
                if p.bump != 0.0:
                    depth += p.bump * ti.exp(-0.5 * ((x - d - p.bump_x) / p.bump_width) ** 2)
                depths[n] = depth
                squeeze = 0.0
                if depth > 0.0:
                    tops[n] = ti.max(tops[n], depth)
                    touching += 1
                    into, slide = -(vy + d * om), vx - h * om
                    mode, way = int(modes[n]), ways[n]
                    spring = springs[n] + slide * step
                    press, pull, friction, spring_1, mode_1, way_1 = tip_forces(
                        p, depth, into, slide, tops[n], spring, mode, way, wheel, settling)  # fmt: skip
                    if p.leg_stiffness > 0.0:  # a massless leg, its speed implicit in the dampers beside it
                        along = (press - pull) * cg + friction * sg
                        against = p.leg_stiffness * p.leg_time + p.damping * cg * cg * (into > 0.0)
                        against += p.shear_damping * sg * sg * (mode_1 == 0)
                        squeeze = (along - p.leg_stiffness * legs[n]) / against
                        into -= squeeze * cg
                        slide += squeeze * sg
                        spring = springs[n] + slide * step
                        press, pull, friction, spring_1, mode_1, way_1 = tip_forces(
                            p, depth, into, slide, tops[n], spring, mode, way, wheel, settling)  # fmt: skip
                    springs[n], modes[n], ways[n] = spring_1, float(mode_1), way_1
                    sticking += mode_1 == 0
                    f += ti.Vector([friction, press - pull, d * (press - pull) - h * friction])
                else:
                    tops[n], springs[n], modes[n] = 0.0, 0.0, 0.0
                    if p.leg_stiffness > 0.0:
                        squeeze = -legs[n] / p.leg_time
                legs[n] += step * squeeze
            torque = torque_now(p, t, wheel, touching)
            if not settling:
                wheel = ti.max(0.0, wheel + p.wheel_sign * torque / p.wheel_inertia * step)
                f[2] += torque
            else:
                f -= ti.Vector([rock * vx / y**2, sink * vy, rock * om])
            if p.slosh_mass > 0.0 and not settling:  # a mass on a spring along x, felt by the platform
                w = 2.0 * _PI * p.slosh_rate
                pull_of = w * w * slosh + 0.1 * w * slosh_speed
                f[0] += p.slosh_mass * pull_of
                slosh_speed += step * (-pull_of - f[0] / p.mass)
                slosh += step * slosh_speed
            a = accelerate(p, f, th, om)
            fall = a[1]
            vx += step * a[0]
            vy += step * a[1]
            om += step * a[2]
            x += 0.5 * step * vx
            y += 0.5 * step * vy
            th += 0.5 * step * om
            k += 1


def move(numbers: np.ndarray, duration: float, *, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """Times [s], shape [row_count], and motions, shape [lane_count, row_count, 10], the last axis as `ROWS`.

    `numbers`: shape [lane_count, column_count], the columns as `COLUMNS`. `duration`: after t = 0 [s]. Raises
    ValueError for a table of another shape, RuntimeError where a motion is not finite.
    """
    numbers = np.ascontiguousarray(numbers, dtype=float)
    if numbers.ndim != 2 or numbers.shape[1] != len(COLUMNS):
        raise ValueError(f"numbers has shape {numbers.shape}: [lane_count, {len(COLUMNS)}] was expected")
    if not is_running():
        ti.init(arch=ti.cpu, default_fp=ti.f64, offline_cache=True)
    every = max(1, round(ROW / step))
    rows = math.ceil(duration / (step * every)) + 1
    out = np.full((len(numbers), rows, len(ROWS)), np.nan)
    run(numbers, step, every, round(SETTLE / step), rows, out)
    if not np.isfinite(out).all():
        raise RuntimeError(f"the motion of lane {int(np.argmin(np.isfinite(out).all(axis=(1, 2))))} is not finite")
    return np.arange(rows) * step * every, out
