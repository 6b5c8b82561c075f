"""Events of a batched trial: when within a step the first one happens, and what changes then.

Kinds 1 to 5: touch, lift, slip through zero, static bound, the wheel stops. Kinds 6 and 7: pulleys and bearing come to
a stop. Kinds 8 and 9: they give way. Kind 10: a term's own coordinate changes its mode.
"""

from types import SimpleNamespace
from typing import Any

__all__ = ["make_events"]


def make_events(parts: SimpleNamespace) -> Any:
    """Two Taichi functions, which change what they take as templates.

    `find_events` finds the share of the step at which friction, wheel or a term's own coordinate change first. It
    writes this into `e`, where that is earlier than the present value. `switch` changes the modes at an event.
    """
    from hedgebed_taichi import ti

    earlier = parts.earlier

    @ti.func
    def used_up(before, after):
        share = 0.0
        if before > 0.0:
            share = before / (before - after)
        return share

    @ti.func
    def find_events(
        s: ti.template(), c: ti.template(), now: ti.template(), then: ti.template(), f: ti.template(),
        last: ti.template(), m: ti.template(), e: ti.template(), spikes: ti.template(), dt, driving, pull,
    ):  # fmt: skip
        for j in ti.static(range(3)):
            n = (m.lowest + j - 1 + parts.count) % parts.count
            bit = 1 << n
            if dt > 0.0 and (m.touch & bit) != 0 and (m.stick & bit) == 0:
                slip = then.vx - then.omega * spikes.h[j]
                sign = 1.0
                if (m.backwards & bit) != 0:
                    sign = -1.0
                if sign * slip < 0.0:
                    change = sign * (then.ax - then.alpha * spikes.h[j] + then.omega * then.omega * spikes.d[j])
                    share = 0.0
                    if change < 0.0:
                        share = 1.0 - ti.min(sign * slip / (change * dt), 1.0)
                    earlier(e, share, 3, n)
        f.margin = f.bound - ti.abs(f.hold)
        if m.stick != 0 and f.margin < 0.0:
            share = used_up(last.margin, f.margin)
            if dt == 0.0 and f.margin > -parts.NEAR * f.bound:
                share = 2.0
            if share < e.ahead or (e.kind == 0 and share <= 1.0):
                e.ahead, e.kind = share, 4
        then.wheel = now.wheel
        if driving:
            then.wheel = now.wheel + 0.5 * dt * c.spin_up * (pull + s.torque)
            if c.braking != 0.0 and then.wheel < 0.0 and dt > 0.0:
                earlier(e, now.wheel / (now.wheel - then.wheel), 5, e.which)
        if ti.static(parts.INNER):
            if dt > 0.0 and f.own_holds < 0.0:
                earlier(e, used_up(last.own_holds, f.own_holds), 10, e.which)
        f.dry_margin = f.dry_bound - ti.abs(f.dry_hold)
        if ti.static(parts.DRY):
            find_dry_events(s, then, f, last, m, e, dt)

    @ti.func
    def find_dry_events(
        s: ti.template(), then: ti.template(), f: ti.template(), last: ti.template(), m: ti.template(),
        e: ti.template(), dt,
    ):  # fmt: skip
        speed = parts.dry_along(s, then.vx, then.vy, then.omega) * m.slide
        change = parts.dry_along(s, then.ax, then.ay, then.alpha) * m.slide
        for k in ti.static(range(2)):
            if m.slide[k] != 0 and dt > 0.0 and speed[k] < 0.0:
                share = 0.0
                if change[k] < 0.0:
                    share = 1.0 - ti.min(speed[k] / (change[k] * dt), 1.0)
                earlier(e, share, 6 + k, e.which)
        for k in ti.static(range(2)):
            if m.slide[k] == 0 and f.dry_bound[k] > 0.0 and f.dry_margin[k] < -parts.NEAR * f.dry_bound[k]:
                earlier(e, used_up(last.dry_margin[k], f.dry_margin[k]), 8 + k, e.which)

    @ti.func
    def switch(
        kind, which, m: ti.template(), now: ti.template(), s: ti.template(), c: ti.template(), f: ti.template(),
        spikes: ti.template(), top: ti.template(), held: ti.template(), gone: ti.template(), place: ti.template(),
    ):  # fmt: skip
        bit = 1 << which
        newcomers = m.fresh & m.stick
        m.fresh = 0
        if kind == 1:
            m.touch |= bit
            if ti.static(parts.WALLS):
                angle = now.theta + parts.HALF + which * parts.BETA
                given_way = 0.0
                for k in ti.static(range(parts.SETTLES)):
                    given_way += gone[parts.count * k + which]
                x = now.x - (s.length - c.radius) * ti.sin(angle)
                left, fall = parts.crater_left(c, m.out & bit, x, top[which], given_way, place[which])
                top[which] *= left
                for k in ti.static(range(parts.SETTLES)):
                    gone[parts.count * k + which] *= left
                m.out &= ~bit
            if ti.static(parts.HOLDS):
                held[which] = 0.0
            reach = (s.length - c.radius) * ti.cos(now.theta + parts.HALF + which * parts.BETA) + c.radius
            slip = now.vx - now.omega * reach
            m.stick &= ~bit
            if slip > 0.0:
                m.backwards &= ~bit
            else:
                m.backwards |= bit
        elif kind == 2:
            m.touch &= ~bit
            m.stick &= ~bit
            if ti.static(parts.WALLS):
                angle = now.theta + parts.HALF + which * parts.BETA
                place[which] = now.x - (s.length - c.radius) * ti.sin(angle)
            if ti.static(parts.MEMORY and not parts.SHEDS):
                top[which] = 0.0
        elif kind == 3:
            m.stick |= bit
            m.fresh = bit
        elif kind == 4:
            leaving = m.stick
            if newcomers != 0 and newcomers != m.stick:
                leaving = newcomers
            m.stick &= ~leaving
            for j in ti.static(range(3)):
                one = 1 << ((m.lowest + j - 1 + parts.count) % parts.count)
                if (leaving & one) != 0:
                    sign = -f.hold
                    slip = now.vx - now.omega * spikes.h[j]  # what the constraint leaves: not its excess before
                    if ti.abs(slip) > 1e-12:
                        sign = slip
                    if sign > 0.0:
                        m.backwards &= ~one
                    else:
                        m.backwards |= one
        elif kind == 5:
            now.wheel = 0.0
            m.over = 1
        elif kind == 10:
            s.inner_mode = 1.0 - s.inner_mode
        for k in ti.static(range(2)):
            if kind == 6 + k:
                m.slide[k] = 0
            elif kind == 8 + k:
                m.slide[k] = 1
                if f.dry_hold[k] > 0.0:
                    m.slide[k] = -1

    return find_events, switch
