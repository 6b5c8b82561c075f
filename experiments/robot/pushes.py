"""The push of a robot: from where its actuators give most of their work, until its first flight."""

import numpy as np

from coupling.robot import RobotRun

from .flight import Array, Flights

__all__ = ["foot_speed_at_push", "push_begin"]

PUSHES = 1e-3
"""Share of the largest power of the actuators above which they push [1]: a leg that rests on its stop gives none."""


def push_begin(run: RobotRun, flights: Flights) -> int | None:
    """The last row before the push: before the spell, after the first touch and until the first flight, in which the
    actuators give their largest power. None where they give no work, or nothing touches.
    """
    first = flights.touched
    if first is None or len(run.columns["time"]) < 3:
        return None
    end = flights.rows[0][0] if flights.rows else len(run.columns["time"])
    power = np.gradient(run.columns["actuator_work"], run.columns["time"])[first : end + 1]
    if len(power) == 0 or power.max() <= 0:
        return None
    most = int(power.argmax())
    idle = np.flatnonzero(power[:most] <= PUSHES * power[most])
    return first + (int(idle[-1]) if len(idle) else 0)


def foot_speed_at_push(run: RobotRun, heights: Array, flights: Flights) -> float | None:
    """Speed of the fastest foot in the ground when the push begins [m/s]; None without a push, or without such a foot.

    ``heights``: of the lowest point of each foot at every row [m], shape (row, foot).
    """
    begin = push_begin(run, flights)
    if begin is None or begin < 1:
        return None
    step = run.columns["time"][begin] - run.columns["time"][begin - 1]
    speeds = np.abs(heights[begin] - heights[begin - 1]) / step
    return float(speeds[heights[begin] < 0].max()) if (heights[begin] < 0).any() else None
