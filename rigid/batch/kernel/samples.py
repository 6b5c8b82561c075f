"""What a batched trial leaves: rows of its series, within a step, and its row of the summary."""

from types import SimpleNamespace
from typing import Any

__all__ = ["make_records"]


def make_records(parts: SimpleNamespace) -> Any:
    """Four Taichi functions.

    `record` writes the state at the share `u` of a step of `dt` [s] from `now` to `then`, by cubics; `follow` keeps the
    launch and the largest speeds in the tally `t`, `enter` theta on the first entry into each state; `summarise` writes
    the trial's row of the summary.
    """
    import taichi as ti

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
