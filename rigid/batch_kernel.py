"""The batched integrator, compiled by Taichi: one trial a lane, the same terms as the accurate integrator.

Method: velocity Verlet (kick, drift, kick) with the speed-dependent forces taken at the predicted end speeds, one
evaluation a step, order 2. A step in which a spike touches, leaves, slips through zero or reaches its static bound, or
in which the wheel or the torque stops, is cut at that moment (found to the second order), the modes change, and the
rest of the step follows: so events cost no order. Sticking is the same constraint as in `rigid.dynamics`, its speed
taken out exactly at the end of every step.

Of the spikes only the lowest and its two neighbours are looked at; a trial that sinks so deep that a fourth would touch
is marked (`status`), and left to the accurate integrator.
"""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
import linecache
import math
from functools import lru_cache
from typing import Any

from .model import assemble, parameter_names
from .terms import STATE_FIELDS, Term

__all__ = ["CHANNELS", "FIXED_NUMBERS", "SUMMARY", "batch_kernel"]

FIXED_NUMBERS = (
    "mass", "inertia", "length", "stance", "counterweight", "gravity", "weight", "torque", "torque_until",
    "wheel_inertia", "wheel_sign", "wheel_speed_0", "mu_s", "mu_d",
)  # fmt: skip
"""The first columns of the trials' numbers; those of the ground's law and of the effects follow."""
SUMMARY = (
    "trajectory_angle", "max_speed", "max_angular_velocity", "stand", "pivot", "slip", "hop", "status",
    "x", "y", "theta", "vx", "vy", "omega", "wheel_speed", "splits", "longest_step",
)  # fmt: skip
"""Columns of the summary: launch, largest speeds, theta on entering each state first (NaN: never), status, end, and the
longest step [s] for the coordinate that a term has of its own (NaN: there is none).

Status: 0 done, 1 too deep, 2 no longer finite, 3 cannot stand, 4 the step is too long for a term's own coordinate."""
CHANNELS = ("x", "y", "theta", "vx", "vy", "omega", "ax", "ay", "wheel_speed", "state")
"""Channels of the series."""

MOST_SPLITS = 12
"""Cuts of one step; beyond, modes change at its end."""
_NEAR = 1e-12


@lru_cache(maxsize=64)
def batch_kernel(terms: tuple[Term, ...], ground: str, count: int) -> Any:
    """The kernels for these effects on this ground, for platforms with `count` rows of spikes.

    `stand(numbers, poses)` finds y and theta at rest (theta NaN: cannot stand); `advance(numbers, poses, times,
    time_step, steps, end, launch, summary, series)` does the rest. See `rigid.batch`.
    """
    import taichi as ti

    model = assemble(terms, ground, taichi=True)
    names = parameter_names(terms)
    State = ti.types.struct(**dict.fromkeys(STATE_FIELDS, ti.f64))
    Parameters = ti.types.struct(**dict.fromkeys(names, ti.f64))
    LAW = len(FIXED_NUMBERS)
    LAW_SIZE = len(model.law.slots)
    load_parameters = _loader(names, Parameters, LAW + LAW_SIZE)
    vertical, tip_radius, torque_factor = model.vertical, model.tip_radius, model.torque_factor
    inertia, applied, dry_friction = model.inertia, model.applied, model.dry_friction
    inner_start, inner = model.inner_start, model.inner
    crater_of, contact, arms, divide = model.crater, model.contact, model.contact_arms, model.divide_mass
    MEMORY = model.has_memory
    SHEDS = model.law.has_memory or model.has("crater")
    HOLDS = model.has("hold")
    DRY = model.has("vertical_friction", "rotation_friction")
    INNER = model.has("inner_mass")
    BETA = 2 * math.pi / count
    HALF = math.pi / count
    TURN_COS = [math.cos(k * BETA) for k in (-1, 0, 1)]
    TURN_SIN = [math.sin(k * BETA) for k in (-1, 0, 1)]
    TWICE_COS, TWICE_SIN = math.cos(2 * BETA), math.sin(2 * BETA)
    DIAGONAL = not model.has("mass", "up")  # then the mass matrix is the base model's, constant and diagonal
    SINE = [(-1) ** k / math.factorial(2 * k + 1) for k in range(8)]
    COSINE = [(-1) ** k / math.factorial(2 * k) for k in range(9)]
    NAN = math.nan

    @ti.func
    def small_sine(a):
        b = a * a
        value = SINE[7]
        for k in ti.static(range(6, -1, -1)):
            value = value * b + SINE[k]
        return value * a

    @ti.func
    def small_cosine(a):
        b = a * a
        value = COSINE[8]
        for k in ti.static(range(7, -1, -1)):
            value = value * b + COSINE[k]
        return value

    @ti.func
    def state_of(touch, stick):
        state = 3
        if touch != 0:
            state = 2
            if stick != 0:
                state = 1
                if (stick & (stick - 1)) != 0:
                    state = 0
        return state

    @ti.func
    def trial_state(numbers: ti.template(), i):
        s = State(time=0.0)
        s.inner_mode = 1.0
        s.mass = numbers[i, 0]
        s.inertia = numbers[i, 1]
        s.length = numbers[i, 2]
        s.stance = numbers[i, 3]
        s.counterweight = numbers[i, 4]
        s.gravity = numbers[i, 5]
        s.weight = numbers[i, 6]
        return s

    @ti.kernel
    def stand(
        numbers: ti.types.ndarray(dtype=ti.f64, ndim=2),
        poses: ti.types.ndarray(dtype=ti.f64, ndim=2),
    ):
        ti.loop_config(block_dim=64)
        for i in range(numbers.shape[0]):
            s = trial_state(numbers, i)
            p = load_parameters(numbers, i)
            q = ti.Vector([numbers[i, LAW + k] for k in ti.static(range(LAW_SIZE))])
            s.up_x, s.up_y = vertical(p)
            radius = tip_radius(p)
            s.cosine = 1.0
            share = 0.5 * s.weight * s.up_y
            low, high = 0.0, s.length
            for _ in range(200):  # the depth at which a row carries half the weight
                middle = 0.5 * (low + high)
                elastic, lost, stored, side, factor_s, factor_d = contact(
                    p, s, q, middle, 0.0, 0.0, middle, middle
                )
                if elastic < share:
                    low = middle
                else:
                    high = middle
            y = (s.length - radius) * ti.cos(HALF) + radius - high
            theta = 0.0
            depth = high
            error = 1e300
            best_y, best_theta, best, friction, bound = y, theta, 1e300, 0.0, 0.0
            sound = high < 0.999 * s.length
            for _ in range(40):  # Newton on the balance of forces along the normal and of moments
                ry = ti.Vector([0.0, 0.0, 0.0, 0.0, 0.0])
                rt = ti.Vector([0.0, 0.0, 0.0, 0.0, 0.0])
                e = 1e-4 * ti.max(depth, 1e-9)
                least = 1e300
                for m in range(5):
                    at_y, at_theta = y, theta
                    if m == 1:
                        at_y = y + e
                    if m == 2:
                        at_y = y - e
                    if m == 3:
                        at_theta = theta + e / s.length
                    if m == 4:
                        at_theta = theta - e / s.length
                    s.y = at_y
                    s.theta = at_theta
                    s.cosine = ti.cos(at_theta)
                    s.sine = ti.sin(at_theta)
                    if ti.static(INNER):
                        s.inner = inner_start(p, s)
                    fx, fy, ft = applied(p, s)
                    load, mean_h, mu_load = 0.0, 0.0, 0.0
                    for side_of in range(2):
                        angle = at_theta + HALF * (1.0 - 2.0 * side_of)
                        h, d = arms(ti.cos(angle), ti.sin(angle), s.length, radius)
                        z = h - at_y
                        in_z = ti.max(z, 1e-300)
                        elastic, lost, stored, side, factor_s, factor_d = contact(
                            p, s, q, in_z, 0.0, 0.0, in_z, in_z
                        )
                        press = ti.max(elastic, 0.0)
                        fy += elastic
                        ft += elastic * d
                        load += press
                        mean_h += press * h
                        mu_load += factor_s * press
                        if m == 0:
                            least = ti.min(least, z)
                    mean_h = mean_h / ti.max(load, 1e-300)
                    ry[m] = fy
                    rt[m] = ft + fx * mean_h
                    if m == 0:
                        friction = ti.abs(fx)
                        bound = numbers[i, 12] * mu_load
                depth = least
                error = ti.max(ti.abs(ry[0]) / s.weight, ti.abs(rt[0]) / (s.weight * s.length))
                if error < best:
                    best, best_y, best_theta = error, y, theta
                    sound = least > 0.0 and friction <= bound
                if error < 1e-16:
                    break
                a = (ry[1] - ry[2]) / (2.0 * e)
                b = (ry[3] - ry[4]) / (2.0 * e) * s.length
                c = (rt[1] - rt[2]) / (2.0 * e)
                d2 = (rt[3] - rt[4]) / (2.0 * e) * s.length
                det = a * d2 - b * c
                if det == 0.0:
                    break
                dy = -(d2 * ry[0] - b * rt[0]) / det
                dt = -(a * rt[0] - c * ry[0]) / det
                part = 1.0
                if error > 1e-3:
                    part = ti.min(1.0, ti.max(0.5 * depth / (ti.abs(dy) + ti.abs(dt) * s.length), 1e-2))
                y += part * dy
                theta += part * dt
            poses[i, 0] = best_y
            poses[i, 1] = best_theta
            if not sound or best > 1e-9:
                poses[i, 1] = NAN

    @ti.kernel
    def advance(
        numbers: ti.types.ndarray(dtype=ti.f64, ndim=2),
        poses: ti.types.ndarray(dtype=ti.f64, ndim=2),
        times: ti.types.ndarray(dtype=ti.f64, ndim=2),
        time_step: ti.f64,
        steps: ti.i32,
        end: ti.f64,
        launch: ti.f64,
        summary: ti.types.ndarray(dtype=ti.f64, ndim=2),
        series: ti.types.ndarray(dtype=ti.f64, ndim=3),
    ):
        ti.loop_config(block_dim=16)
        for i in range(numbers.shape[0]):
            s = trial_state(numbers, i)
            p = load_parameters(numbers, i)
            q = ti.Vector([numbers[i, LAW + k] for k in ti.static(range(LAW_SIZE))])
            s.up_x, s.up_y = vertical(p)
            mxx, mxy, myy, mxt, myt, mtt = inertia(p, s)
            inverse_x, inverse_y, inverse_t = 1.0 / mxx, 1.0 / myy, 1.0 / mtt
            nominal = numbers[i, 7]
            until = numbers[i, 8]
            spin_up = numbers[i, 10] / numbers[i, 9]
            braking = numbers[i, 10] < 0.0
            mu_s = numbers[i, 12]
            mu_d = numbers[i, 13]
            radius = tip_radius(p)
            crater = crater_of(p)
            top = ti.Vector([0.0 for _ in ti.static(range(count if MEMORY else 1))])
            held = ti.Vector([0.0 for _ in ti.static(range(count if HOLDS else 1))])

            x = 0.0
            y = poses[i, 0]
            theta = poses[i, 1]
            vx = 0.0
            vy = 0.0
            omega = 0.0
            wheel = numbers[i, 11]
            ax = 0.0
            ay = 0.0
            alpha = 0.0
            time = 0.0
            y_start = y
            # The coordinate that a term has of its own.
            own = 0.0
            own_v = 0.0
            own_a = 0.0
            own_v1 = 0.0
            own_a1 = 0.0
            own_holds = 1.0
            own_holds1 = 1.0
            if ti.static(INNER):
                s.x = x
                s.y = y
                s.theta = theta
                own = inner_start(p, s)
            if ti.static(MEMORY):
                for n in ti.static((0, count - 1)):
                    angle = theta + HALF + n * BETA
                    top[n] = ti.max((s.length - radius) * ti.cos(angle) + radius - y, 0.0)
                    if ti.static(HOLDS):
                        held[n] = top[n]
            touch = 1 | (1 << (count - 1))
            stick = touch
            backwards = 0  # bits of the spikes that slide towards -x
            fresh = 0  # bits of the spikes that may stick from now
            slide_v = 0
            slide_r = 0
            over = nominal == 0.0 or until <= 0.0
            margin = 0.0
            pull = 0.0  # the torque at the step's start
            margin_v = 0.0
            margin_r = 0.0
            best_angle = NAN
            largest_speed = 0.0
            largest_spin = 0.0
            theta_stand = NAN
            theta_pivot = NAN
            theta_slip = NAN
            theta_hop = NAN
            status = 0
            splits = 0
            total_splits = 0
            sample = 0
            samples = times.shape[1]
            row = ti.min(i, times.shape[0] - 1)
            step = 0
            dt = 0.0  # the first pass only finds the accelerations
            settle_only = True
            cut = False
            cut_kind = 0
            cut_spike = 0
            step_end = 0.0
            going = not ti.math.isnan(theta)
            if not going:
                status = 3
            longest = NAN
            if ti.static(INNER):
                s.inner = own
                own_mass, at_rest, own_holds = inner(p, s)
                if own_mass > 0.0:  # as `step_bound` has it for the ground
                    s.inner = own + 1e-6 * s.length
                    own_mass, by_place, own_holds = inner(p, s)
                    s.inner = own
                    s.inner_speed = 1e-3
                    own_mass, by_speed, own_holds = inner(p, s)
                    lightest = 1.0 / own_mass + 1.0 / s.mass
                    longest = 0.2 / ti.sqrt(ti.max((at_rest - by_place) / (1e-6 * s.length) * lightest, 1e-12))
                    longest = ti.min(longest, 1.0 / ti.max((at_rest - by_speed) / 1e-3 * lightest, 1e-12))
                    if time_step > longest:
                        status = 4
                        going = False
            while going:
                # -- drift to the end of the step, predict the speeds --
                hx = vx + 0.5 * dt * ax
                hy = vy + 0.5 * dt * ay
                ht = omega + 0.5 * dt * alpha
                x1 = x + dt * hx
                y1 = y + dt * hy
                theta1 = theta + dt * ht
                px = vx + dt * ax
                py = vy + dt * ay
                pt = omega + dt * alpha
                # -- forces there --
                turned = theta1 + HALF
                k = ti.floor(turned / BETA + 0.5)
                low = turned - k * BETA
                lowest = (ti.cast(-k, ti.i32) % count + count) % count
                low_cos = small_cosine(low)
                low_sin = small_sine(low)
                s.time = time + dt
                s.x = x1
                s.y = y1
                s.theta = theta1
                s.vx = px
                s.vy = py
                s.omega = pt
                s.cosine = ti.cos(theta1)
                s.sine = ti.sin(theta1)
                driving = touch != 0 and not over
                s.wheel_speed = wheel + dt * spin_up * pull
                s.torque = 0.0
                if driving:
                    s.torque = nominal * torque_factor(p, s)
                if ti.static(INNER):
                    s.inner = own + dt * (own_v + 0.5 * dt * own_a)
                    s.inner_speed = own_v + dt * own_a
                    own_mass, own_force, own_holds1 = inner(p, s)
                    own_a1 = 0.0
                    if own_mass > 0.0:
                        own_a1 = own_force / own_mass
                    own_v1 = own_v + 0.5 * dt * (own_a + own_a1)
                fx, fy, ft = applied(p, s)
                if ti.static(not DIAGONAL):
                    mxx, mxy, myy, mxt, myt, mtt = inertia(p, s)
                load = 0.0
                bound = 0.0
                mean_h = 0.0
                bias = 0.0
                plain_h = 0.0
                near = 0
                ahead = 1.0  # share of the step at which the first event happens
                kind = 0  # 1 touch, 2 lift, 3 slip through zero, 4 static bound, 5 wheel, 6 to 9 dry friction, 10 inner
                which = 0
                slip_kept = ti.Vector([0.0, 0.0, 0.0])
                h_kept = ti.Vector([0.0, 0.0, 0.0])
                d_kept = ti.Vector([0.0, 0.0, 0.0])
                depth_kept = ti.Vector([0.0, 0.0, 0.0])
                for j in ti.static(range(3)):
                    n = (lowest + j - 1 + count) % count
                    bit = 1 << n
                    near |= bit
                    cosine = low_cos * TURN_COS[j] - low_sin * TURN_SIN[j]
                    sine = low_sin * TURN_COS[j] + low_cos * TURN_SIN[j]
                    h, d = arms(cosine, sine, s.length, radius)
                    depth = h - y1
                    depth_kept[j] = depth
                    deepest = depth
                    if ti.static(MEMORY):
                        deepest = ti.max(top[n], depth)
                    since = deepest
                    if ti.static(HOLDS):
                        since = ti.max(held[n], depth)
                    if (touch & bit) != 0:
                        rate = -(py + pt * d)
                        slip = px - pt * h
                        at = ti.max(depth, crater * deepest * (1.0 + 1e-15) + 1e-300)
                        elastic, lost, stored, side, factor_s, factor_d = contact(
                            p, s, q, at, rate, slip, ti.max(deepest, at), ti.max(since, at)
                        )
                        normal = elastic + lost
                        press = ti.max(normal, 0.0)
                        fx += side
                        fy += normal
                        ft += normal * d - side * h
                        if (stick & bit) != 0:
                            load += press
                            bound += mu_s * factor_s * press
                            mean_h += press * h
                            bias += press * pt * pt * d
                            plain_h = h
                        else:
                            friction = -mu_d * factor_d * press
                            if (backwards & bit) != 0:
                                friction = -friction
                            fx += friction
                            ft -= friction * h
                        slip_kept[j] = slip
                        h_kept[j] = h
                        d_kept[j] = d
                        if dt > 0.0 and depth < crater * deepest:  # gone since depth / (rate of leaving)
                            ago = ti.max(crater * deepest - depth, 0.0)
                            share = 1.0 - ti.min(ago / ti.max(-rate * dt, 1e-300), 1.0)
                            if share < ahead or kind == 0:
                                ahead = share
                                kind = 2
                                which = n
                    elif dt > 0.0 and depth > crater * deepest:
                        rate = -(py + pt * d)
                        if rate > 0.0:
                            share = 1.0 - ti.min((depth - crater * deepest) / (rate * dt), 1.0)
                            if share < ahead or kind == 0:
                                ahead = share
                                kind = 1
                                which = n
                touch &= near
                stick &= touch
                if ti.static(count > 3):  # the fourth lowest tip
                    if y1 < (s.length - radius) * (low_cos * TWICE_COS + ti.abs(low_sin) * TWICE_SIN) + radius:
                        status = 1
                # -- accelerations, with the forces that hold --
                ax1, ay1, alpha1 = fx * inverse_x, fy * inverse_y, ft * inverse_t
                if ti.static(not DIAGONAL):
                    ax1, ay1, alpha1 = divide(mxx, mxy, myy, mxt, myt, mtt, fx, fy, ft)
                holds = stick != 0
                if load > 0.0:
                    mean_h /= load
                    bias /= load
                else:
                    mean_h = plain_h
                tx, ty, tt = 0.0, 0.0, 0.0
                hold = 0.0
                excess = 0.0
                if holds:
                    if ti.static(DIAGONAL):
                        tx, tt = inverse_x, -mean_h * inverse_t
                    else:
                        tx, ty, tt = divide(mxx, mxy, myy, mxt, myt, mtt, 1.0, 0.0, -mean_h)
                hold_v = 0.0
                hold_r = 0.0
                bound_v = 0.0
                bound_r = 0.0
                g_tt = tx - mean_h * tt
                plain = True
                if ti.static(DRY):
                    bound_v, bound_r = dry_friction(p, s)
                    plain = bound_v + bound_r == 0.0
                    if not plain:
                        if slide_v != 0:
                            part = bound_v * slide_v
                            bx, by, bt = divide(mxx, mxy, myy, mxt, myt, mtt, -part * s.up_x, -part * s.up_y, 0.0)
                            ax1 += bx
                            ay1 += by
                            alpha1 += bt
                        if slide_r != 0:
                            bx, by, bt = divide(mxx, mxy, myy, mxt, myt, mtt, 0.0, 0.0, -bound_r * slide_r)
                            ax1 += bx
                            ay1 += by
                            alpha1 += bt
                        wx, wy, wt = divide(mxx, mxy, myy, mxt, myt, mtt, s.up_x, s.up_y, 0.0)
                        rx, ry, rt = divide(mxx, mxy, myy, mxt, myt, mtt, 0.0, 0.0, 1.0)
                        on = ti.Vector([0.0, 0.0, 0.0])
                        if holds:
                            on[0] = 1.0
                        if slide_v == 0 and bound_v > 0.0:
                            on[1] = 1.0
                        if slide_r == 0 and bound_r > 0.0:
                            on[2] = 1.0
                        g = ti.Matrix(
                            [
                                [tx - mean_h * tt, wx - mean_h * wt, rx - mean_h * rt],
                                [s.up_x * tx + s.up_y * ty, s.up_x * wx + s.up_y * wy, s.up_x * rx + s.up_y * ry],
                                [tt, wt, rt],
                            ]
                        )
                        right = ti.Vector(
                            [-(ax1 - mean_h * alpha1 + bias), -(s.up_x * ax1 + s.up_y * ay1), -alpha1]
                        )
                        for a in ti.static(range(3)):
                            right[a] *= on[a]
                            for b in ti.static(range(3)):
                                g[a, b] *= on[a] * on[b]
                            g[a, a] += 1.0 - on[a]
                        push = g.inverse() @ right
                        hold, hold_v, hold_r = push[0], push[1], push[2]
                        ax1 += hold * tx + hold_v * wx + hold_r * rx
                        ay1 += hold * ty + hold_v * wy + hold_r * ry
                        alpha1 += hold * tt + hold_v * wt + hold_r * rt
                        # Speeds that the held directions do not allow.
                        ux1 = hx + 0.5 * dt * ax1
                        uy1 = hy + 0.5 * dt * ay1
                        ut1 = ht + 0.5 * dt * alpha1
                        wrong = ti.Vector(
                            [-(ux1 - mean_h * ut1) * on[0], -(s.up_x * ux1 + s.up_y * uy1) * on[1], -ut1 * on[2]]
                        )
                        back = g.inverse() @ wrong
                        px = ux1 + back[0] * tx + back[1] * wx + back[2] * rx
                        py = uy1 + back[0] * ty + back[1] * wy + back[2] * ry
                        pt = ut1 + back[0] * tt + back[1] * wt + back[2] * rt
                if plain:
                    if holds:
                        hold = -(ax1 - mean_h * alpha1 + bias) / g_tt
                        ax1 += hold * tx
                        ay1 += hold * ty
                        alpha1 += hold * tt
                    px = hx + 0.5 * dt * ax1
                    py = hy + 0.5 * dt * ay1
                    pt = ht + 0.5 * dt * alpha1
                    if holds:
                        excess = (px - mean_h * pt) / g_tt
                        px -= excess * tx
                        py -= excess * ty
                        pt -= excess * tt
                # -- what happened on the way --
                for j in ti.static(range(3)):
                    n = (lowest + j - 1 + count) % count
                    bit = 1 << n
                    if dt > 0.0 and (touch & bit) != 0 and (stick & bit) == 0:
                        slip = px - pt * h_kept[j]
                        sign = 1.0
                        if (backwards & bit) != 0:
                            sign = -1.0
                        if sign * slip < 0.0:
                            change = sign * (ax1 - alpha1 * h_kept[j] + pt * pt * d_kept[j])
                            share = 0.0
                            if change < 0.0:
                                share = 1.0 - ti.min(sign * slip / (change * dt), 1.0)
                            if share < ahead or kind == 0:
                                ahead = share
                                kind = 3
                                which = n
                margin1 = bound - ti.abs(hold)
                if holds and margin1 < 0.0:
                    share = 0.0
                    if margin > 0.0:
                        share = margin / (margin - margin1)
                    if dt == 0.0 and margin1 > -_NEAR * bound:
                        share = 2.0
                    if share < ahead or (kind == 0 and share <= 1.0):
                        ahead = share
                        kind = 4
                wheel1 = wheel
                if driving:
                    wheel1 = wheel + 0.5 * dt * spin_up * (pull + s.torque)
                    if braking and wheel1 < 0.0 and dt > 0.0:
                        share = wheel / (wheel - wheel1)
                        if share < ahead or kind == 0:
                            ahead = share
                            kind = 5
                if ti.static(INNER):
                    if dt > 0.0 and own_holds1 < 0.0:
                        share = 0.0
                        if own_holds > 0.0:
                            share = own_holds / (own_holds - own_holds1)
                        if share < ahead or kind == 0:
                            ahead = share
                            kind = 10
                margin_v1 = bound_v - ti.abs(hold_v)
                margin_r1 = bound_r - ti.abs(hold_r)
                if ti.static(DRY):
                    if slide_v != 0 and dt > 0.0:
                        speed = (s.up_x * px + s.up_y * py) * slide_v
                        change = (s.up_x * ax1 + s.up_y * ay1) * slide_v
                        if speed < 0.0:
                            share = 0.0
                            if change < 0.0:
                                share = 1.0 - ti.min(speed / (change * dt), 1.0)
                            if share < ahead or kind == 0:
                                ahead = share
                                kind = 6
                    if slide_r != 0 and dt > 0.0 and pt * slide_r < 0.0:
                        share = 0.0
                        if alpha1 * slide_r < 0.0:
                            share = 1.0 - ti.min(pt / (alpha1 * dt), 1.0)
                        if share < ahead or kind == 0:
                            ahead = share
                            kind = 7
                    if slide_v == 0 and bound_v > 0.0 and margin_v1 < -_NEAR * bound_v:
                        share = 0.0
                        if margin_v > 0.0:
                            share = margin_v / (margin_v - margin_v1)
                        if share < ahead or kind == 0:
                            ahead = share
                            kind = 8
                    if slide_r == 0 and bound_r > 0.0 and margin_r1 < -_NEAR * bound_r:
                        share = 0.0
                        if margin_r > 0.0:
                            share = margin_r / (margin_r - margin_r1)
                        if share < ahead or kind == 0:
                            ahead = share
                            kind = 9
                # -- an event within the step: go back and come only so far --
                # (again where the shorter step shows that another one comes before the one it was cut at)
                other = not cut or kind != cut_kind or which != cut_spike
                if kind != 0 and dt > 0.0 and other and ahead < 0.999 and splits < MOST_SPLITS:
                    cut = True
                    cut_kind = kind
                    cut_spike = which
                    dt = ti.max(ahead, 0.0) * dt
                    splits += 1
                    total_splits += 1
                    if dt > 0.0:
                        continue
                    kind = cut_kind
                    which = cut_spike
                    # It is over at once: nothing moves.
                    x1 = x
                    y1 = y
                    theta1 = theta
                    px = vx
                    py = vy
                    pt = omega
                    wheel1 = wheel
                    ax1 = ax
                    ay1 = ay
                    alpha1 = alpha
                    if ti.static(INNER):
                        s.inner = own
                        own_v1 = own_v
                        own_a1 = own_a
                elif cut:
                    kind = cut_kind
                    which = cut_spike
                # -- samples, launch, largest speeds --
                if dt > 0.0:
                    while sample < samples and times[row, ti.min(sample, samples - 1)] <= time + dt:
                        u = (times[row, sample] - time) / dt
                        v = 1.0 - u
                        f0 = v * v * (1.0 + 2.0 * u)
                        f1 = u * u * (3.0 - 2.0 * u)
                        g0 = dt * u * v * v
                        g1 = -dt * u * u * v
                        series[i, sample, 0] = f0 * x + f1 * x1 + g0 * vx + g1 * px
                        series[i, sample, 1] = f0 * y + f1 * y1 + g0 * vy + g1 * py
                        series[i, sample, 2] = f0 * theta + f1 * theta1 + g0 * omega + g1 * pt
                        series[i, sample, 3] = vx + u * (dt * ax + u * (px - vx - dt * ax))
                        series[i, sample, 4] = vy + u * (dt * ay + u * (py - vy - dt * ay))
                        series[i, sample, 5] = omega + u * (dt * alpha + u * (pt - omega - dt * alpha))
                        series[i, sample, 6] = v * ax + u * ax1
                        series[i, sample, 7] = v * ay + u * ay1
                        series[i, sample, 8] = v * wheel + u * wheel1
                        series[i, sample, 9] = state_of(touch, stick)
                        sample += 1
                    if ti.math.isnan(best_angle):
                        far = x1 * x1 + (y1 - y_start) * (y1 - y_start)
                        if far >= launch * launch:
                            near_by = ti.sqrt(x * x + (y - y_start) * (y - y_start))
                            u = (launch - near_by) / (ti.sqrt(far) - near_by)
                            best_angle = ti.atan2(y + u * (y1 - y) - y_start, x + u * (x1 - x))
                    largest_speed = ti.max(largest_speed, px * px + py * py)
                    largest_spin = ti.max(largest_spin, ti.abs(pt))
                    if ti.static(MEMORY):
                        for j in ti.static(range(3)):
                            n = (lowest + j - 1 + count) % count
                            if (touch & (1 << n)) != 0:
                                top[n] = ti.max(top[n], depth_kept[j])
                                if ti.static(HOLDS):
                                    held[n] = ti.max(held[n], depth_kept[j])
                            elif depth_kept[j] < 0.0:
                                top[n] = 0.0  # forgotten above the surface
                # -- accept --
                x = x1
                y = y1
                theta = theta1
                vx = px
                vy = py
                omega = pt
                wheel = wheel1
                pull = s.torque
                ax = ax1
                ay = ay1
                alpha = alpha1
                if ti.static(INNER):
                    own = s.inner
                    own_v = own_v1
                    own_a = own_a1
                    own_holds = own_holds1
                margin = margin1
                margin_v = margin_v1
                margin_r = margin_r1
                time += dt
                # -- change the modes --
                again = False
                if kind != 0:
                    again = True
                    bit = 1 << which
                    newcomers = fresh & stick
                    fresh = 0
                    if kind == 1:
                        touch |= bit
                        if ti.static(HOLDS):
                            held[which] = 0.0
                        slip = vx - omega * ((s.length - radius) * ti.cos(theta + HALF + which * BETA) + radius)
                        stick &= ~bit
                        if slip > 0.0:
                            backwards &= ~bit
                        else:
                            backwards |= bit
                    elif kind == 2:
                        touch &= ~bit
                        stick &= ~bit
                        if ti.static(MEMORY and not SHEDS):
                            top[which] = 0.0
                    elif kind == 3:
                        stick |= bit
                        fresh = bit
                    elif kind == 4:
                        leaving = stick
                        if newcomers != 0 and newcomers != stick:
                            leaving = newcomers
                        stick &= ~leaving
                        for j in ti.static(range(3)):
                            n = (lowest + j - 1 + count) % count
                            one = 1 << n
                            if (leaving & one) != 0:
                                sign = -hold
                                slip = vx - omega * h_kept[j]  # what the constraint leaves: not its excess before
                                if ti.abs(slip) > 1e-12:
                                    sign = slip
                                if sign > 0.0:
                                    backwards &= ~one
                                else:
                                    backwards |= one
                    elif kind == 5:
                        wheel = 0.0
                        over = True
                    elif kind == 6:
                        slide_v = 0
                    elif kind == 7:
                        slide_r = 0
                    elif kind == 8:
                        slide_v = 1
                        if hold_v > 0.0:
                            slide_v = -1
                    elif kind == 9:
                        slide_r = 1
                        if hold_r > 0.0:
                            slide_r = -1
                    elif kind == 10:
                        s.inner_mode = 1.0 - s.inner_mode
                elif settle_only:
                    fresh = 0
                if not over and time >= until:
                    over = True
                    again = True
                # -- the next stretch --
                if not again or splits >= MOST_SPLITS + 8:
                    now = state_of(touch, stick)
                    if now == 0 and ti.math.isnan(theta_stand):
                        theta_stand = theta
                    if now == 1 and ti.math.isnan(theta_pivot):
                        theta_pivot = theta
                    if now == 2 and ti.math.isnan(theta_slip):
                        theta_slip = theta
                    if now == 3 and ti.math.isnan(theta_hop):
                        theta_hop = theta
                if again and splits < MOST_SPLITS + 8:
                    dt = 0.0
                    settle_only = True
                    splits += 1
                else:
                    settle_only = False
                    if time >= step_end - 1e-12:
                        step += 1
                        splits = 0
                        step_end = ti.min(step * time_step, end)
                        if step > steps:
                            going = False
                    dt = step_end - time
                    if not over and until < step_end and until > time:
                        dt = until - time
                cut = False
                cut_kind = 0
                if not (ti.abs(x) + ti.abs(y) + ti.abs(theta) < 1e6):
                    status = 2
                    going = False
            # -- the end --
            while sample < samples and times[row, ti.min(sample, samples - 1)] <= end * (1.0 + 1e-12):
                series[i, sample, 0] = x
                series[i, sample, 1] = y
                series[i, sample, 2] = theta
                series[i, sample, 3] = vx
                series[i, sample, 4] = vy
                series[i, sample, 5] = omega
                series[i, sample, 6] = ax
                series[i, sample, 7] = ay
                series[i, sample, 8] = wheel
                series[i, sample, 9] = state_of(touch, stick)
                sample += 1
            summary[i, 0] = best_angle
            summary[i, 1] = ti.sqrt(largest_speed)
            summary[i, 2] = largest_spin
            summary[i, 3] = theta_stand
            summary[i, 4] = theta_pivot
            summary[i, 5] = theta_slip
            summary[i, 6] = theta_hop
            summary[i, 7] = status
            summary[i, 8] = x
            summary[i, 9] = y
            summary[i, 10] = theta
            summary[i, 11] = vx
            summary[i, 12] = vy
            summary[i, 13] = omega
            summary[i, 14] = wheel
            summary[i, 15] = total_splits
            summary[i, 16] = longest

    return stand, advance


def _loader(names: tuple[str, ...], kind: Any, first: int) -> Any:
    """A Taichi function that reads the effects' parameters of trial i."""
    import taichi as ti

    fields = ", ".join(f"{name}=numbers[i, {first + k}]" for k, name in enumerate(names))
    text = f"def load(numbers: ti.template(), i):\n    return Parameters({fields})\n"
    file = f"<parameters {' '.join(names)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    scope: dict[str, Any] = {"ti": ti, "Parameters": kind}
    exec(compile(text, file, "exec"), scope)
    return ti.func(scope["load"])
