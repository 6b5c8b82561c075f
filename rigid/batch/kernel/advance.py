"""The motion of a batch from its start to the end; the package's docstring describes the method."""

from types import SimpleNamespace
from typing import Any

from .events import make_events
from .forces import make_contacts, make_hold

__all__ = ["make_advance"]

MOST_SPLITS = 12  # Cuts of one step; beyond, modes change at its end


def make_advance(parts: SimpleNamespace) -> Any:
    """The kernel `advance(numbers, poses, times, time_step, steps, end, launch, summary, series)`."""
    from hedgebed_taichi import ti

    start_inner, advance_inner = make_inner(parts)
    push_spikes, hold = make_contacts(parts), make_hold(parts)
    find_events, switch = make_events(parts)
    begin_memory, remember = make_memory(parts)
    record, follow, enter, summarise = make_records(parts)

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
            s = parts.trial_state(numbers, i)
            p = parts.load_parameters(numbers, i)
            q = ti.Vector([numbers[i, parts.LAW + k] for k in ti.static(range(parts.LAW_SIZE))])
            s.up_x, s.up_y = parts.vertical(p)
            c = parts.trial_numbers(numbers, i, s, p)
            top = ti.Vector([0.0 for _ in ti.static(range(parts.count if parts.MEMORY else 1))])
            held = ti.Vector([0.0 for _ in ti.static(range(parts.count if parts.HOLDS else 1))])
            # How far the ground under each tip has given way by each term, how fast it does, where the tip left.
            gone = ti.Vector([0.0 for _ in ti.static(range(parts.count * parts.SETTLES or 1))])
            settling = ti.Vector([0.0 for _ in ti.static(range(parts.count * parts.SETTLES or 1))])
            place = ti.Vector([0.0 for _ in ti.static(range(parts.count if parts.WALLS else 1))])
            y_start = poses[i, 0]
            now = parts.Motion(y=y_start, theta=poses[i, 1], wheel=numbers[i, 11])
            then = parts.Motion(y=y_start)
            last = parts.Forces(own_holds=1.0)  # of the step before
            f = parts.Forces(own_holds=1.0)
            spikes = parts.Spikes()
            e = parts.Event()
            both = 1 | (1 << (parts.count - 1))
            m = parts.Modes(touch=both, stick=both)
            t = parts.Tally(
                best_angle=parts.NAN, stand=parts.NAN, pivot=parts.NAN, slip=parts.NAN, hop=parts.NAN, longest=parts.NAN
            )
            if c.nominal == 0.0 or c.until <= 0.0:
                m.over = 1
            begin_memory(s, p, c, now, top, held, gone)
            time = 0.0
            pull = 0.0  # the torque at the step's start
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
            going = not ti.math.isnan(now.theta)
            if not going:
                status = 3
            if ti.static(parts.INNER):
                start_inner(s, p, now, last, t)
                if time_step > t.longest:
                    status = 4
                    going = False
            while going:
                # -- drift to the end of the step, predict the speeds --
                hx = now.vx + 0.5 * dt * now.ax
                hy = now.vy + 0.5 * dt * now.ay
                ht = now.omega + 0.5 * dt * now.alpha
                then.x, then.y, then.theta = now.x + dt * hx, now.y + dt * hy, now.theta + dt * ht
                then.vx, then.vy, then.omega = now.vx + dt * now.ax, now.vy + dt * now.ay, now.omega + dt * now.alpha
                # -- forces there --
                s.time = time + dt
                s.x, s.y, s.theta = then.x, then.y, then.theta
                s.vx, s.vy, s.omega = then.vx, then.vy, then.omega
                s.cosine = ti.cos(then.theta)
                s.sine = ti.sin(then.theta)
                driving = m.touch != 0 and m.over == 0
                s.wheel_speed = now.wheel + dt * c.spin_up * pull
                s.torque = 0.0
                if driving:
                    s.torque = c.nominal * parts.torque_factor(p, s)
                f = parts.Forces(own_holds=1.0)
                if ti.static(parts.INNER):
                    advance_inner(s, p, now, then, f, dt)
                f.fx, f.fy, f.ft = parts.applied(p, s)
                if ti.static(not parts.DIAGONAL):
                    parts.set_mass(c, p, s)
                e = parts.Event(ahead=1.0)
                spikes = parts.Spikes()
                status = push_spikes(s, p, q, c, then, dt, f, m, e, spikes, top, held, gone, settling, place, status)
                hold(s, p, c, then, f, m, hx, hy, ht, dt)
                find_events(s, c, now, then, f, last, m, e, spikes, dt, driving, pull)
                kind, which = e.kind, e.which
                # -- an event within the step: go back and come only so far --
                # (again where the shorter step shows that another one comes before the one it was cut at)
                other = not cut or kind != cut_kind or which != cut_spike
                if kind != 0 and dt > 0.0 and other and e.ahead < 0.999 and splits < MOST_SPLITS:
                    cut = True
                    cut_kind = kind
                    cut_spike = which
                    dt = ti.max(e.ahead, 0.0) * dt
                    splits += 1
                    total_splits += 1
                    if dt > 0.0:
                        continue
                    then = now  # it is over at once: nothing moves
                elif cut:
                    kind = cut_kind
                    which = cut_spike
                # -- samples, launch, largest speeds --
                if dt > 0.0:
                    while sample < samples and times[row, ti.min(sample, samples - 1)] <= time + dt:
                        share = (times[row, sample] - time) / dt
                        record(series, i, sample, share, dt, now, then, parts.state_of(m.touch, m.stick))
                        sample += 1
                    follow(t, now, then, y_start, launch)
                remember(m, spikes, dt, top, held, gone, settling, c)
                # -- accept --
                now = then
                last = f
                pull = s.torque
                time += dt
                # -- change the modes --
                again = False
                if kind != 0:
                    again = True
                    switch(kind, which, m, now, s, c, f, spikes, top, held, gone, place)
                elif settle_only:
                    m.fresh = 0
                if m.over == 0 and time >= c.until:
                    m.over = 1
                    again = True
                # -- the next stretch --
                if not again or splits >= MOST_SPLITS + 8:
                    enter(t, parts.state_of(m.touch, m.stick), now.theta)
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
                    if m.over == 0 and c.until < step_end and c.until > time:
                        dt = c.until - time
                cut = False
                cut_kind = 0
                if not (ti.abs(now.x) + ti.abs(now.y) + ti.abs(now.theta) < 1e6):
                    status = 2
                    going = False
            # -- the end --
            while sample < samples and times[row, ti.min(sample, samples - 1)] <= end * (1.0 + 1e-12):
                record(series, i, sample, 0.0, 0.0, now, now, parts.state_of(m.touch, m.stick))
                sample += 1
            t.status, t.splits = status, total_splits
            summarise(summary, i, t, now)

    return advance


def make_memory(parts: SimpleNamespace) -> Any:
    """Two Taichi functions for what the ground remembers of each spike.

    `begin_memory` sets it for a platform at rest; `remember` keeps what a step of `dt` [s] leaves: deepest depths, how
    far the ground has given way (`gone`) and how fast it does (`settling`).
    """
    from hedgebed_taichi import ti

    @ti.func
    def begin_memory(
        s: ti.template(), p: ti.template(), c: ti.template(), now: ti.template(), top: ti.template(),
        held: ti.template(), gone: ti.template(),
    ):  # fmt: skip
        share = parts.settled_share(p, s)
        for n in ti.static((0, parts.count - 1)):
            angle = now.theta + parts.HALF + n * parts.BETA
            depth = ti.max((s.length - c.radius) * ti.cos(angle) + c.radius - now.y, 0.0)
            for k in ti.static(range(parts.SETTLES)):
                gone[parts.count * k + n] = parts.settled[k](p, s) * depth
            if ti.static(parts.MEMORY):
                top[n] = (1.0 - share) * depth
            if ti.static(parts.HOLDS):
                held[n] = (1.0 - share) * depth

    @ti.func
    def remember(
        m: ti.template(), spikes: ti.template(), dt, top: ti.template(), held: ti.template(), gone: ti.template(),
        settling: ti.template(), c: ti.template(),
    ):  # fmt: skip
        if ti.static(parts.MEMORY or parts.SETTLES):
            for j in ti.static(range(3)):
                n = (m.lowest + j - 1 + parts.count) % parts.count
                if dt > 0.0:
                    whole = spikes.depth[j]
                    for k in ti.static(range(parts.SETTLES)):
                        at = parts.count * k + n
                        whole += gone[at] + dt * settling[at]
                        gone[at] += 0.5 * dt * (settling[at] + spikes.settling[3 * k + j])
                    if (m.touch & (1 << n)) != 0:
                        if ti.static(parts.MEMORY):
                            top[n] = ti.max(top[n], spikes.depth[j])
                        if ti.static(parts.HOLDS):
                            held[n] = ti.max(held[n], spikes.depth[j])
                    elif whole < 0.0:  # forgotten above the surface, unless the crater has walls
                        if c.wall > 0.0:
                            m.out |= 1 << n
                        else:
                            forget(n, top, gone)
                for k in ti.static(range(parts.SETTLES)):
                    settling[parts.count * k + n] = spikes.settling[3 * k + j]

    @ti.func
    def forget(n, top: ti.template(), gone: ti.template()):
        if ti.static(parts.MEMORY):
            top[n] = 0.0
        for k in ti.static(range(parts.SETTLES)):
            gone[parts.count * k + n] = 0.0

    return begin_memory, remember


def make_inner(parts: SimpleNamespace) -> Any:
    """Two Taichi functions for the coordinate that a term has of its own.

    `start_inner` puts it where it rests, and the longest step for it [s] into the tally; `advance_inner` finds it at
    the step's end.
    """
    from hedgebed_taichi import ti

    @ti.func
    def start_inner(s: ti.template(), p: ti.template(), now: ti.template(), last: ti.template(), t: ti.template()):
        s.x = now.x
        s.y = now.y
        s.theta = now.theta
        now.own = parts.inner_start(p, s)
        s.inner = now.own
        mass, at_rest, last.own_holds = parts.inner(p, s)
        if mass > 0.0:  # as `step_bound` has it for the ground
            s.inner = now.own + 1e-6 * s.length
            mass, by_place, last.own_holds = parts.inner(p, s)
            s.inner = now.own
            s.inner_speed = 1e-3
            mass, by_speed, last.own_holds = parts.inner(p, s)
            lightest = 1.0 / mass + 1.0 / s.mass
            t.longest = 0.2 / ti.sqrt(ti.max((at_rest - by_place) / (1e-6 * s.length) * lightest, 1e-12))
            t.longest = ti.min(t.longest, 1.0 / ti.max((at_rest - by_speed) / 1e-3 * lightest, 1e-12))

    @ti.func
    def advance_inner(
        s: ti.template(), p: ti.template(), now: ti.template(), then: ti.template(), f: ti.template(), dt
    ):  # fmt: skip
        s.inner = now.own + dt * (now.own_v + 0.5 * dt * now.own_a)
        s.inner_speed = now.own_v + dt * now.own_a
        then.own = s.inner
        mass, force, f.own_holds = parts.inner(p, s)
        then.own_a = 0.0
        if mass > 0.0:
            then.own_a = force / mass
        then.own_v = now.own_v + 0.5 * dt * (now.own_a + then.own_a)

    return start_inner, advance_inner


def make_records(parts: SimpleNamespace) -> Any:
    """Four Taichi functions.

    `record` writes the state at the share `u` of a step of `dt` [s] from `now` to `then`, by cubics. `follow` keeps the
    launch and the largest speeds in the tally `t`. `enter` keeps theta on the first entry into each state. `summarise`
    writes the trial's row of the summary.
    """
    from hedgebed_taichi import ti

    @ti.func
    def record(series: ti.template(), i, sample, u, dt, now: ti.template(), then: ti.template(), state):
        v = 1.0 - u
        f0 = v * v * (1.0 + 2.0 * u)
        f1 = u * u * (3.0 - 2.0 * u)
        g0 = dt * u * v * v
        g1 = -dt * u * u * v
        series[i, sample, 0] = f0 * now.x + f1 * then.x + g0 * now.vx + g1 * then.vx
        series[i, sample, 1] = f0 * now.y + f1 * then.y + g0 * now.vy + g1 * then.vy
        series[i, sample, 2] = f0 * now.theta + f1 * then.theta + g0 * now.omega + g1 * then.omega
        series[i, sample, 3] = now.vx + u * (dt * now.ax + u * (then.vx - now.vx - dt * now.ax))
        series[i, sample, 4] = now.vy + u * (dt * now.ay + u * (then.vy - now.vy - dt * now.ay))
        series[i, sample, 5] = now.omega + u * (dt * now.alpha + u * (then.omega - now.omega - dt * now.alpha))
        series[i, sample, 6] = v * now.ax + u * then.ax
        series[i, sample, 7] = v * now.ay + u * then.ay
        series[i, sample, 8] = v * now.wheel + u * then.wheel
        series[i, sample, 9] = state

    @ti.func
    def follow(t: ti.template(), now: ti.template(), then: ti.template(), y_start, launch):
        if ti.math.isnan(t.best_angle):
            far = then.x * then.x + (then.y - y_start) * (then.y - y_start)
            if far >= launch * launch:
                near_by = ti.sqrt(now.x * now.x + (now.y - y_start) * (now.y - y_start))
                u = (launch - near_by) / (ti.sqrt(far) - near_by)
                t.best_angle = ti.atan2(now.y + u * (then.y - now.y) - y_start, now.x + u * (then.x - now.x))
        t.largest_speed = ti.max(t.largest_speed, then.vx * then.vx + then.vy * then.vy)
        t.largest_spin = ti.max(t.largest_spin, ti.abs(then.omega))

    @ti.func
    def enter(t: ti.template(), state, theta):
        if state == 0 and ti.math.isnan(t.stand):
            t.stand = theta
        if state == 1 and ti.math.isnan(t.pivot):
            t.pivot = theta
        if state == 2 and ti.math.isnan(t.slip):
            t.slip = theta
        if state == 3 and ti.math.isnan(t.hop):
            t.hop = theta

    @ti.func
    def summarise(summary: ti.template(), i, t: ti.template(), now: ti.template()):
        values = ti.static(
            (
                t.best_angle, ti.sqrt(t.largest_speed), t.largest_spin, t.stand, t.pivot, t.slip, t.hop, t.status,
                now.x, now.y, now.theta, now.vx, now.vy, now.omega, now.wheel, t.splits, t.longest,
            )
        )  # fmt: skip
        for k in ti.static(range(len(values))):
            summary[i, k] = values[k]

    return record, follow, enter, summarise
