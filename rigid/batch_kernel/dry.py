"""Dry friction of a batched trial's pulleys and bearing, which holds together with the spikes that stick."""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
from types import SimpleNamespace
from typing import Any

__all__ = ["make_dry"]


def make_dry(parts: SimpleNamespace) -> Any:
    """Two Taichi functions, which change what they take as templates.

    `hold_dry`: the forces that hold, accelerations and end speeds under them. `dry_events`: at what share of the step a
    sliding direction comes to a stop or a held one gives way, if that comes first.
    """
    import taichi as ti

    divide, NEAR = parts.divide, parts.NEAR

    @ti.func
    def hold_dry(
        s, mxx, mxy, myy, mxt, myt, mtt, bound_v, bound_r, slide_v, slide_r, holds, mean_h, bias, tx, ty, tt, hx, hy,
        ht, dt, ax1: ti.template(), ay1: ti.template(), alpha1: ti.template(), px: ti.template(), py: ti.template(),
        pt: ti.template(), hold: ti.template(), hold_v: ti.template(), hold_r: ti.template(),
    ):  # fmt: skip
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
        right = ti.Vector([-(ax1 - mean_h * alpha1 + bias), -(s.up_x * ax1 + s.up_y * ay1), -alpha1])
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
        wrong = ti.Vector([-(ux1 - mean_h * ut1) * on[0], -(s.up_x * ux1 + s.up_y * uy1) * on[1], -ut1 * on[2]])
        back = g.inverse() @ wrong
        px = ux1 + back[0] * tx + back[1] * wx + back[2] * rx
        py = uy1 + back[0] * ty + back[1] * wy + back[2] * ry
        pt = ut1 + back[0] * tt + back[1] * wt + back[2] * rt

    @ti.func
    def dry_events(
        s, dt, slide_v, slide_r, bound_v, bound_r, margin_v, margin_r, margin_v1, margin_r1, px, py, pt, ax1, ay1,
        alpha1, ahead: ti.template(), kind: ti.template(),
    ):  # fmt: skip
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
        if slide_v == 0 and bound_v > 0.0 and margin_v1 < -NEAR * bound_v:
            share = 0.0
            if margin_v > 0.0:
                share = margin_v / (margin_v - margin_v1)
            if share < ahead or kind == 0:
                ahead = share
                kind = 8
        if slide_r == 0 and bound_r > 0.0 and margin_r1 < -NEAR * bound_r:
            share = 0.0
            if margin_r > 0.0:
                share = margin_r / (margin_r - margin_r1)
            if share < ahead or kind == 0:
                ahead = share
                kind = 9

    return hold_dry, dry_events
