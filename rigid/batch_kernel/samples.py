"""What a batched trial leaves: rows of its series, within a step, and its row of the summary."""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
from typing import Any

__all__ = ["make_records"]


def make_records() -> Any:
    """Two Taichi functions: `record` writes the state at the share `u` of a step of `dt` [s], by cubics;
    `summarise` the trial's row of the summary.
    """
    import taichi as ti

    @ti.func
    def record(
        series: ti.template(), i, sample, u, dt, x, y, theta, vx, vy, omega, ax, ay, alpha, wheel,
        x1, y1, theta1, px, py, pt, ax1, ay1, alpha1, wheel1, state,
    ):  # fmt: skip
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
        series[i, sample, 9] = state

    @ti.func
    def summarise(
        summary: ti.template(), i, best_angle, largest_speed, largest_spin, theta_stand, theta_pivot, theta_slip,
        theta_hop, status, x, y, theta, vx, vy, omega, wheel, total_splits, longest,
    ):  # fmt: skip
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

    return record, summarise
