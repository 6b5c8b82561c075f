"""Forces on the spikes of a batched trial, and the accelerations that follow.

`make_contacts`: the lowest spike and its two neighbours, and when within the step one of them touches or leaves.
`make_hold`: what holds, spikes that stick and dry friction of the pulleys and the bearing.
"""

from types import SimpleNamespace
from typing import Any

__all__ = ["make_contacts", "make_hold"]


def make_contacts(parts: SimpleNamespace) -> Any:
    """The Taichi function `push_spikes`, which adds the contacts to the forces `f`; what it changes are templates.

    It returns the trial's status: 1 where a fourth spike would touch, otherwise the one given.
    """
    from hedgebed_taichi import ti

    crater_left = parts.crater_left

    @ti.func
    def push_spikes(
        s: ti.template(), p: ti.template(), q: ti.template(), c: ti.template(), then: ti.template(), dt,
        f: ti.template(), m: ti.template(), e: ti.template(), spikes: ti.template(), top: ti.template(),
        held: ti.template(), gone: ti.template(), settling: ti.template(), place: ti.template(), given,
    ):  # fmt: skip
        status = given
        turned = then.theta + parts.HALF
        k = ti.floor(turned / parts.BETA + 0.5)
        low = turned - k * parts.BETA
        m.lowest = (ti.cast(-k, ti.i32) % parts.count + parts.count) % parts.count
        low_cos = parts.small_cosine(low)
        low_sin = parts.small_sine(low)
        near = 0
        for j in ti.static(range(3)):
            n = (m.lowest + j - 1 + parts.count) % parts.count
            bit = 1 << n
            near |= bit
            cosine = low_cos * parts.TURN_COS[j] - low_sin * parts.TURN_SIN[j]
            sine = low_sin * parts.TURN_COS[j] + low_cos * parts.TURN_SIN[j]
            h, d = parts.arms(cosine, sine, s.length, c.radius)
            depth = h - then.y
            s.given_way = 0.0
            for k in ti.static(range(parts.SETTLES)):
                s.given_way += gone[parts.count * k + n] + dt * settling[parts.count * k + n]
                spikes.settling[3 * k + j] = 0.0
            if ti.static(parts.SETTLES):  # the depth that the ground's law reads
                depth -= s.given_way
            spikes.depth[j] = depth
            deepest = depth
            if ti.static(parts.MEMORY):
                deepest = ti.max(top[n], depth)
            since = deepest
            if ti.static(parts.HOLDS):
                since = ti.max(held[n], depth)
            if (m.touch & bit) != 0:
                rate = -(then.vy + then.omega * d)
                slip = then.vx - then.omega * h
                at = ti.max(depth, c.crater * deepest * (1.0 + 1e-15) + 1e-300)
                elastic, lost, stored, side, factor_s, factor_d, grip = parts.contact(
                    p, s, q, at, rate, slip, ti.max(deepest, at), ti.max(since, at)
                )
                into = rate
                for k in ti.static(range(parts.SETTLES)):
                    own = gone[parts.count * k + n] + dt * settling[parts.count * k + n]
                    spikes.settling[3 * k + j] = parts.settle[k](p, s, at + own, slip, d / s.length, own)
                    into -= spikes.settling[3 * k + j]
                if ti.static(parts.CARRIES):
                    if rate > 0.0:
                        more, slope = parts.added(p, at - c.crater * deepest)
                        c.myy += more
                        c.myt += more * d
                        c.mtt += more * d * d
                        down = more * then.omega * then.omega * (h - c.radius)
                        f.fy -= down
                        f.ft -= down * d
                normal = elastic + lost
                press = ti.max(normal + grip, 0.0)
                f.fx += side
                f.fy += normal
                f.ft += normal * d - side * h
                if (m.stick & bit) != 0:
                    f.load += press
                    f.bound += c.mu_s * factor_s * press
                    f.mean_h += press * h
                    f.bias += press * then.omega * then.omega * d
                    f.plain_h = h
                else:
                    friction = -c.mu_d * factor_d * press
                    if (m.backwards & bit) != 0:
                        friction = -friction
                    f.fx += friction
                    f.ft -= friction * h
                spikes.h[j] = h
                spikes.d[j] = d
                if dt > 0.0 and depth < c.crater * deepest:  # gone since depth / (rate of leaving)
                    ago = ti.max(c.crater * deepest - depth, 0.0)
                    share = 1.0 - ti.min(ago / ti.max(-into * dt, 1e-300), 1.0)
                    parts.earlier(e, share, 2, n)
            elif dt > 0.0:
                bottom, steep = c.crater * deepest, 0.0
                if ti.static(parts.WALLS):
                    left, fall = crater_left(c, m.out & bit, then.x - d, deepest, s.given_way, place[n])
                    bottom = left * (bottom + s.given_way) - s.given_way
                    steep = fall * (c.crater * deepest + s.given_way)
                if depth > bottom:
                    rate = -(then.vy + then.omega * d) - steep * (then.vx - then.omega * h)
                    if rate > 0.0:
                        share = 1.0 - ti.min((depth - bottom) / (rate * dt), 1.0)
                        parts.earlier(e, share, 1, n)
        m.touch &= near
        m.stick &= m.touch
        if ti.static(parts.count > 3):  # the fourth lowest tip
            fourth = low_cos * parts.TWICE_COS + ti.abs(low_sin) * parts.TWICE_SIN
            if then.y < (s.length - c.radius) * fourth + c.radius:
                status = 1
        return status

    return push_spikes


def make_hold(parts: SimpleNamespace) -> Any:
    """The Taichi function `hold`: accelerations and end speeds `then` under the forces `f`, which get those that hold.

    `hx`, `hy`, `ht` are the speeds of the step's middle.
    """
    from hedgebed_taichi import ti

    @ti.func
    def hold(
        s: ti.template(), p: ti.template(), c: ti.template(), then: ti.template(), f: ti.template(), m: ti.template(),
        hx, hy, ht, dt,
    ):  # fmt: skip
        then.ax, then.ay, then.alpha = f.fx * c.inverse_x, f.fy * c.inverse_y, f.ft * c.inverse_t
        if ti.static(not parts.DIAGONAL):
            then.ax, then.ay, then.alpha = parts.divide(c, f.fx, f.fy, f.ft)
        holds = m.stick != 0
        if f.load > 0.0:
            f.mean_h /= f.load
            f.bias /= f.load
        else:
            f.mean_h = f.plain_h
        tx, ty, tt = 0.0, 0.0, 0.0
        if holds:
            if ti.static(parts.DIAGONAL):
                tx, tt = c.inverse_x, -f.mean_h * c.inverse_t
            else:
                tx, ty, tt = parts.divide(c, 1.0, 0.0, -f.mean_h)
        plain = True
        if ti.static(parts.DRY):
            f.dry_bound[0], f.dry_bound[1] = parts.dry_friction(p, s)
            plain = f.dry_bound[0] + f.dry_bound[1] == 0.0
            if not plain:
                hold_dry(s, c, then, f, m, tx, ty, tt, hx, hy, ht, dt)
        if plain:
            g_tt = tx - f.mean_h * tt
            if holds:
                f.hold = -(then.ax - f.mean_h * then.alpha + f.bias) / g_tt
                then.ax += f.hold * tx
                then.ay += f.hold * ty
                then.alpha += f.hold * tt
            then.vx = hx + 0.5 * dt * then.ax
            then.vy = hy + 0.5 * dt * then.ay
            then.omega = ht + 0.5 * dt * then.alpha
            if holds:
                excess = (then.vx - f.mean_h * then.omega) / g_tt
                then.vx -= excess * tx
                then.vy -= excess * ty
                then.omega -= excess * tt

    @ti.func
    def hold_dry(
        s: ti.template(), c: ti.template(), then: ti.template(), f: ti.template(), m: ti.template(), tx, ty, tt,
        hx, hy, ht, dt,
    ):  # fmt: skip
        x, y, turn = ti.Vector([s.up_x, 0.0]), ti.Vector([s.up_y, 0.0]), ti.Vector([0.0, 1.0])
        on = ti.Vector([0.0, 0.0, 0.0])
        if m.stick != 0:
            on[0] = 1.0
        for k in ti.static(range(2)):
            if m.slide[k] != 0:
                part = -f.dry_bound[k] * m.slide[k]
                bx, by, bt = parts.divide(c, part * x[k], part * y[k], part * turn[k])
                then.ax += bx
                then.ay += by
                then.alpha += bt
            elif f.dry_bound[k] > 0.0:
                on[1 + k] = 1.0
        wx, wy, wt = parts.divide(c, s.up_x, s.up_y, 0.0)
        rx, ry, rt = parts.divide(c, 0.0, 0.0, 1.0)
        g = ti.Matrix(
            [
                [tx - f.mean_h * tt, wx - f.mean_h * wt, rx - f.mean_h * rt],
                [s.up_x * tx + s.up_y * ty, s.up_x * wx + s.up_y * wy, s.up_x * rx + s.up_y * ry],
                [tt, wt, rt],
            ]
        )
        sticking = -(then.ax - f.mean_h * then.alpha + f.bias)
        right = ti.Vector([sticking, -(s.up_x * then.ax + s.up_y * then.ay), -then.alpha])
        for a in ti.static(range(3)):
            right[a] *= on[a]
            for b in ti.static(range(3)):
                g[a, b] *= on[a] * on[b]
            g[a, a] += 1.0 - on[a]
        push = g.inverse() @ right
        f.hold, f.dry_hold[0], f.dry_hold[1] = push[0], push[1], push[2]
        then.ax += f.hold * tx + f.dry_hold[0] * wx + f.dry_hold[1] * rx
        then.ay += f.hold * ty + f.dry_hold[0] * wy + f.dry_hold[1] * ry
        then.alpha += f.hold * tt + f.dry_hold[0] * wt + f.dry_hold[1] * rt
        # Speeds that the held directions do not allow.
        ux1 = hx + 0.5 * dt * then.ax
        uy1 = hy + 0.5 * dt * then.ay
        ut1 = ht + 0.5 * dt * then.alpha
        wrong = ti.Vector([-(ux1 - f.mean_h * ut1) * on[0], -(s.up_x * ux1 + s.up_y * uy1) * on[1], -ut1 * on[2]])
        back = g.inverse() @ wrong
        then.vx = ux1 + back[0] * tx + back[1] * wx + back[2] * rx
        then.vy = uy1 + back[0] * ty + back[1] * wy + back[2] * ry
        then.omega = ut1 + back[0] * tt + back[1] * wt + back[2] * rt

    return hold
