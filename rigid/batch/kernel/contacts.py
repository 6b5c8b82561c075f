"""Forces on the lowest spike and its two neighbours, and when within the step one of them touches or leaves."""

from types import SimpleNamespace
from typing import Any

__all__ = ["make_contacts"]


def make_contacts(parts: SimpleNamespace) -> Any:
    """The Taichi function `push_spikes`, which adds the contacts to the forces `f`; what it changes are templates.

    It returns the trial's status: 1 where a fourth spike would touch, otherwise the one given.
    """
    import taichi as ti

    @ti.func
    def push_spikes(
        s: ti.template(), p: ti.template(), q: ti.template(), c: ti.template(), then: ti.template(), dt,
        f: ti.template(), m: ti.template(), e: ti.template(), spikes: ti.template(), top: ti.template(),
        held: ti.template(), given,
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
                    share = 1.0 - ti.min(ago / ti.max(-rate * dt, 1e-300), 1.0)
                    if share < e.ahead or e.kind == 0:
                        e.ahead, e.kind, e.which = share, 2, n
            elif dt > 0.0 and depth > c.crater * deepest:
                rate = -(then.vy + then.omega * d)
                if rate > 0.0:
                    share = 1.0 - ti.min((depth - c.crater * deepest) / (rate * dt), 1.0)
                    if share < e.ahead or e.kind == 0:
                        e.ahead, e.kind, e.which = share, 1, n
        m.touch &= near
        m.stick &= m.touch
        if ti.static(parts.count > 3):  # the fourth lowest tip
            fourth = low_cos * parts.TWICE_COS + ti.abs(low_sin) * parts.TWICE_SIN
            if then.y < (s.length - c.radius) * fourth + c.radius:
                status = 1
        return status

    return push_spikes
