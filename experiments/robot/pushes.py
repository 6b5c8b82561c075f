"""The push of a robot: from where its actuators give most of their work, until its first flight."""

import numpy as np

from coupling.robot import RobotRun

from . import say
from .flight import Array, Flights
from .plan import RobotPlan

__all__ = ["foot_speed_at_push", "force_of", "push_begin", "push_numbers", "push_words", "swing_warning", "swings"]

PUSHES = 1e-3
"""Share of the largest power of the actuators above which they push [1]: a leg that rests on its stop gives none."""

SWING = 0.01  # Share of its largest depth by which a foot must go back to be said to turn [1]
SEVERAL = 4  # Turns from which on a foot is said to swing [1]: a landing with one rebound has three


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


def push_numbers(run: RobotRun, flights: Flights) -> dict[str, tuple[float | None, str, str]]:
    """Name of a quantity -> value, unit and note: when depth and force are largest, and both until the first flight."""
    rows, force = run.columns, force_of(run)
    time, sinkage = rows["time"], rows["sinkage"]
    found: dict[str, tuple[float | None, str, str]] = {
        "sinkage_largest_time": (float(time[sinkage.argmax()]), "s", say("when")),
        "largest_force_time": (float(time[force.argmax()]), "s", say("when")),
    }
    if flights.rows:
        end = flights.rows[0][0] + 1
        deepest, hardest = int(sinkage[:end].argmax()), int(force[:end].argmax())
        found |= {
            "push_sinkage": (float(sinkage[deepest]), "m", say("of_push")),
            "push_sinkage_time": (float(time[deepest]), "s", say("when")),
            "push_force": (float(force[hardest]), "N", say("of_push")),
            "push_force_time": (float(time[hardest]), "s", say("when")),
        }
    return found


def push_words(run: RobotRun, flights: Flights) -> list[str]:
    """The largest force, and depth and force of the push where the rest of the run has larger ones, in sentences."""
    found = {name: value or 0.0 for name, (value, _, _) in push_numbers(run, flights).items()}
    told = [say("largest_force", force=float(force_of(run).max()), time=found["largest_force_time"])]
    if flights.rows:
        launch = float(run.columns["time"][flights.rows[0][0]])
        if max(found["sinkage_largest_time"], found["largest_force_time"]) > launch:
            told.append(say("in_push", launch=launch, depth=1e3 * found["push_sinkage"], **found))
    return told


def force_of(run: RobotRun) -> Array:
    """Force of the ground on all feet at every row [N]."""
    return np.asarray(np.linalg.norm([run.columns[name] for name in ("fx", "fy", "fz")], axis=0))


def swings(run: RobotRun, heights: Array, flights: Flights) -> int:
    """How often the deepest foot turns in the ground until the first flight, by more than `SWING` of its depth."""
    if flights.touched is None:
        return 0
    end = flights.rows[0][0] if flights.rows else len(heights)
    depth = -heights[flights.touched : end, heights.min(axis=0).argmin()]
    depth = depth[depth > 0]
    if not len(depth):
        return 0
    least, turns, way, extreme = SWING * depth.max(), 0, 1.0, depth[0]
    for value in depth:
        if way * (value - extreme) > 0:
            extreme = value
        elif way * (extreme - value) > least:
            turns, way, extreme = turns + 1, -way, value
    return turns


def swing_warning(run: RobotRun, heights: Array, flights: Flights, plan: RobotPlan) -> list[str]:
    """The warning that a foot swings on `rft` without loss, which sand damps; none of another law or of fewer turns."""
    loss = plan.numbers.get("loss")
    if plan.settings.on_grains or plan.law != "rft" or loss is None or loss.value > 0:
        return []
    count = swings(run, heights, flights)
    return [say("swings", count=count)] if count >= SEVERAL else []
