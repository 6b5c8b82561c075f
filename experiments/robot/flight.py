"""How long a robot flies: from the speed of its first launch, and from where it is when a run ends.

In flight the centre of mass of a free robot has the acceleration of gravity alone, whatever its joints do. A launch
with the speed v upwards rises by v^2 / 2 g and is back at its height after 2 v / g. A rail with friction takes from it.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.robot import MujocoRobot, RobotRun
from experiments.grains.spells import spells

from . import say
from .settings import RobotSettings

__all__ = [
    "APART", "REST", "Flights", "Left", "at_end", "at_rest", "fall_warning", "find_flights", "launched", "pushes_off",
    "rising", "stays", "to_landing", "touch_words",
]  # fmt: skip

APART = 5e-3  # A flight lasts at least that long [s]
REST = 1e-3  # Rise that the speed of a robot at rest could still give its centre of mass [m]
IN_CRATER = 1e-3  # Depth of the lowest foot from which on a launch is said to be in its crater [m]

Array = NDArray[np.float64]


class Left(NamedTuple):
    """What is left of a flight at the end of a run."""

    rise: float  # Of the centre of mass from there [m]
    speed: float  # Upwards, at the end of the run [m/s]
    fall: float  # Time to the landing [s]
    along: tuple[float, float]  # Way of the centre of mass along the ground by then [m]


@dataclass(frozen=True)
class Flights:
    """When a robot flies, in rows of its run."""

    rows: tuple[tuple[int, int], ...]
    """From and to which."""
    touched: int | None
    """Of the first touch; None where nothing touches."""
    at_end: bool
    """Whether the run ends in a flight."""
    longest: float
    """Duration of the longest [s], 0 without any."""
    left: Left | None = None
    """What is left of the flight that the end of the run cuts off, as of `at_end`."""


def find_flights(run: RobotRun, heights: Array) -> Flights:
    """The flights of a run. ``heights``: as of `to_landing`.

    A robot flies while nothing touches, after the first touch, for `APART` at least, if at some time of it all feet are
    above the undisturbed surface: a foot that loses contact in its own crater does not fly. Where the end of the run
    cuts off that time, the continued flight counts: a launch is the same whenever the run ends.
    """
    free = run.columns["touching"] == 0
    if free.all():
        return Flights((), None, at_end=False, longest=0.0)
    touched, lasting = int(np.argmin(free)), max(1, round(APART / run.macro_step))
    lowest = heights.min(axis=1)
    found = [(touched + low, touched + high) for low, high in spells(free[touched:]) if high - low >= lasting]
    left = at_end(run, heights) if found and found[-1][1] == len(free) else None
    reached = [lowest[low:high].max() for low, high in found]
    if left is not None:
        reached[-1] = max(reached[-1], lowest[-1] + left.rise)  # the feet rise as the centre of mass does
    rows = tuple(one for one, height in zip(found, reached, strict=True) if height > 0.0)
    longest = max((end - begin for begin, end in rows), default=0) * run.macro_step
    cut = bool(rows) and rows[-1][1] == len(free)
    return Flights(rows, touched, at_end=cut, longest=longest, left=left if cut else None)


def launched(run: RobotRun, heights: Array, begin: int) -> list[str]:
    """When and how fast the first flight begins, at row `begin`, in a sentence; none where it begins downwards.

    ``heights``: as of `to_landing`. A flight may begin below the undisturbed surface, in the crater of the last foot.
    """
    speed, height = float(_upwards(run)[begin]), float(heights[begin].min())
    if speed <= 0:
        return []
    where = say("in_its_crater", depth=-1e3 * height) if height < -IN_CRATER else ""
    return [say("launched", time=float(run.columns["time"][begin]), speed=speed, where=where)]


def to_landing(run: RobotRun, heights: Array, left: Left | None) -> str:
    """How much longer a run must be that ends in the air, in a sentence. ``left``: as of `at_end`.

    ``heights``: of the lowest point of each foot at every row [m], shape (row, foot), as of
    `experiments.robot.feet.heights_of`.
    """
    gravity, height, speed = run.robot.gravity, max(0.0, float(heights[-1].min())), float(_upwards(run)[-1])
    if run.robot.hangs or (gravity <= 0 and speed >= 0):
        return say("no_landing")
    end, low = float(run.columns["time"][-1]), float(heights[-1].min())
    fall = -height / speed if left is None else left.fall
    where = say("in_crater" if low < 0 else "above_surface", height=1e3 * abs(low))
    return say("landing", fall=fall, where=where, wanted=_above(end + fall))


def at_end(run: RobotRun, heights: Array) -> Left | None:
    """What is left of a flight at the end of a run. None where gravity alone does not bring the robot back.

    ``heights``: as of `to_landing`. MuJoCo continues the flight; where that takes too long it is a parabola, whose rise
    is v^2 / 2 g, 0 where the robot already falls.
    """
    gravity = run.robot.gravity
    if run.robot.hangs or not gravity > 0:
        return None
    speed = float(_upwards(run)[-1])
    if (continued := run.robot.onward()) is not None:
        rise, fall, along = continued
        return Left(rise, speed, fall, (float(along[0]), float(along[1])))
    fall = _fall(max(0.0, float(heights[-1].min())), speed, gravity)
    way = [fall * float(np.gradient(run.columns[name][-3:], run.columns["time"][-3:])[-1]) for name in "xy"]
    return Left(max(0.0, speed) ** 2 / (2 * gravity), speed, fall, (way[0], way[1]))


def at_rest(run: RobotRun, seconds: float) -> bool:
    """Whether the centre of mass moved neither up nor down in the last `seconds`, within what rises by `REST`."""
    count = max(2, round(seconds / run.macro_step))
    return bool(np.abs(_upwards(run)[-count:]).max() <= _slow(run))


def rising(run: RobotRun, flights: Flights) -> bool:
    """Whether a run ends while the robot pushes off: on its way up, not yet in a flight.

    Its speed alone would take the centre of mass above all heights so far. Or it is on its first way up: what ground
    and joints still add is not known. A swing in the ground that decays does not push off.
    """
    gravity = run.robot.gravity
    if flights.touched is None or flights.at_end or run.robot.hangs or not gravity > 0:
        return False
    z, speeds = run.columns["z"][flights.touched :], _upwards(run)[flights.touched :]
    if speeds[-1] <= _slow(run):
        return False
    first = int(np.argmax(speeds > _slow(run)))
    return bool(speeds[first:].min() >= -_slow(run) or z[-1] + speeds[-1] ** 2 / (2 * gravity) > z.max() + REST)


def stays(run: RobotRun, flights: Flights) -> bool:
    """Whether a robot stays on the ground from its first touch to the end: its rise is then none of a hop.

    After a fall onto the ground its largest height is that of the first touch. A run that ends while the robot is
    `rising` does not say it.
    """
    return flights.touched is not None and not flights.rows and not rising(run, flights)


def pushes_off(run: RobotRun, flights: Flights) -> str | None:
    """The warning of a run that ends while the robot is `rising`; None of another."""
    return say("pushes_off", speed=float(_upwards(run)[-1])) if rising(run, flights) else None


def _slow(run: RobotRun) -> float:
    """Speed that rises by `REST` [m/s]."""
    return math.sqrt(2 * run.robot.gravity * REST)


def fall_warning(settings: RobotSettings, robot: MujocoRobot) -> list[str]:
    """Before a run: the warning that a robot at rest is still in free fall when it ends; none if it is not."""
    height, gravity, fall = robot.clearance, robot.gravity, _to_touch(robot)
    if fall is None or fall < settings.duration:
        return []
    return [say("still_falls", s=settings, height=1e3 * height, fall=fall, gravity=gravity, wanted=_above(fall))]


def touch_words(settings: RobotSettings, robot: MujocoRobot) -> list[str]:
    """Before a run: when a robot that starts at rest first touches, in a sentence; none if it starts on the ground.

    Grains stick out of the surface: on a bed also the time to half a grain above it.
    """
    height, gravity, fall = robot.clearance, robot.gravity, _to_touch(robot)
    if fall is None or fall >= settings.duration:
        return []
    early = _fall(max(0.0, height - 0.5 * settings.grain), 0.0, gravity)
    grains = say("grains_earlier", early=early) if settings.on_grains else ""
    return [say("touches_after", height=1e3 * height, gravity=gravity, fall=fall, grains=grains)]


def _to_touch(robot: MujocoRobot) -> float | None:
    """Time of free fall of a robot at rest until its lowest foot is at the surface [s]; None where it does not fall."""
    if robot.clearance <= 0 or robot.gravity <= 0 or robot.hangs or np.any(robot.data.qvel):
        return None
    return _fall(robot.clearance, 0.0, robot.gravity)


def _fall(height: float, speed: float, gravity: float) -> float:
    """Time until a body `height` [m] up with this speed upwards [m/s] is down [s]."""
    return (speed + math.sqrt(speed**2 + 2 * gravity * height)) / gravity


def _upwards(run: RobotRun) -> Array:
    """Speed of the centre of mass upwards at every row [m/s]; exact in a flight, which is a parabola."""
    z, time = run.columns["z"], run.columns["time"]
    if len(time) < 3:
        return np.zeros(len(time))
    return np.asarray(np.gradient(z, time, edge_order=2))


def _above(seconds: float) -> float:
    """A duration above this one, in two figures [s]."""
    step = 10.0 ** (math.floor(math.log10(seconds)) - 1) if seconds > 0 else 0.1
    return step * math.ceil(1.02 * seconds / step)
