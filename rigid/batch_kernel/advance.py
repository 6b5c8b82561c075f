"""The motion of a batch from its start to the end; the method is told in the package's docstring."""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
from types import SimpleNamespace
from typing import Any

from .changes import make_switch
from .dry import make_dry
from .samples import make_records

__all__ = ["make_advance"]

MOST_SPLITS = 12
"""Cuts of one step; beyond, modes change at its end."""


def make_advance(parts: SimpleNamespace) -> Any:
    """The kernel `advance(numbers, poses, times, time_step, steps, end, launch, summary, series)`."""
    import taichi as ti

    vertical, tip_radius, torque_factor = parts.vertical, parts.tip_radius, parts.torque_factor
    inertia, applied, dry_friction, inner_start = parts.inertia, parts.applied, parts.dry_friction, parts.inner_start
    inner, crater_of, contact, arms, divide = parts.inner, parts.crater_of, parts.contact, parts.arms, parts.divide
    MEMORY, HOLDS, DRY, INNER, BETA, HALF = parts.MEMORY, parts.HOLDS, parts.DRY, parts.INNER, parts.BETA, parts.HALF
    TURN_COS, TURN_SIN, TWICE_COS, TWICE_SIN = parts.TURN_COS, parts.TURN_SIN, parts.TWICE_COS, parts.TWICE_SIN
    DIAGONAL, NAN, NEAR, LAW, LAW_SIZE = parts.DIAGONAL, parts.NAN, parts.NEAR, parts.LAW, parts.LAW_SIZE
    load_parameters, small_sine, small_cosine = parts.load_parameters, parts.small_sine, parts.small_cosine
    state_of, trial_state, count = parts.state_of, parts.trial_state, parts.count
    switch = make_switch(parts)
    record, summarise = make_records()
    hold_dry, dry_events = make_dry(parts)

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
        ti.loop_config(block_dim=4)
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
                        elastic, lost, stored, side, factor_s, factor_d, grip = contact(
                            p, s, q, at, rate, slip, ti.max(deepest, at), ti.max(since, at)
                        )
                        normal = elastic + lost
                        press = ti.max(normal + grip, 0.0)
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
                        hold_dry(
                            s, mxx, mxy, myy, mxt, myt, mtt, bound_v, bound_r, slide_v, slide_r, holds, mean_h, bias,
                            tx, ty, tt, hx, hy, ht, dt, ax1, ay1, alpha1, px, py, pt, hold, hold_v, hold_r,
                        )  # fmt: skip
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
                    if dt == 0.0 and margin1 > -NEAR * bound:
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
                    dry_events(
                        s, dt, slide_v, slide_r, bound_v, bound_r, margin_v, margin_r, margin_v1, margin_r1, px, py, pt,
                        ax1, ay1, alpha1, ahead, kind,
                    )  # fmt: skip
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
                        record(
                            series, i, sample, (times[row, sample] - time) / dt, dt, x, y, theta, vx, vy, omega, ax, ay,
                            alpha, wheel, x1, y1, theta1, px, py, pt, ax1, ay1, alpha1, wheel1, state_of(touch, stick),
                        )  # fmt: skip
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
                    switch(
                        kind, which, lowest, touch, stick, backwards, fresh, slide_v, slide_r, over, wheel, s, top,
                        held, theta, vx, omega, radius, h_kept, hold, hold_v, hold_r,
                    )  # fmt: skip
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
                record(
                    series, i, sample, 0.0, 0.0, x, y, theta, vx, vy, omega, ax, ay, alpha, wheel, x, y, theta, vx, vy,
                    omega, ax, ay, alpha, wheel, state_of(touch, stick),
                )  # fmt: skip
                sample += 1
            summarise(
                summary, i, best_angle, largest_speed, largest_spin, theta_stand, theta_pivot, theta_slip, theta_hop,
                status, x, y, theta, vx, vy, omega, wheel, total_splits, longest,
            )  # fmt: skip

    return advance
