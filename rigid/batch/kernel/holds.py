"""Accelerations with the forces that hold: spikes that stick, and dry friction of the pulleys and the bearing."""

from types import SimpleNamespace
from typing import Any

__all__ = ["make_hold"]


def make_hold(parts: SimpleNamespace) -> Any:
    """The Taichi function `hold`: accelerations and end speeds `then` under the forces `f`, which get those that hold.

    `hx`, `hy`, `ht` are the speeds of the step's middle.
    """
    import taichi as ti

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
