"""How long a robot is followed on a surface law: until it has left the ground, or is at rest.

A push may launch the robot from grains. On a softer law it may then be in its crater still at the end of the run, on
its way up. Its rise would be that of the crater. A law costs little, so that the robot goes on there by parts of the
duration. In flight MuJoCo continues it without the ground (`experiments.robot.flight`).
"""

from coupling.robot import RobotRun

from .depths import deepest_part
from .feet import feet_reached, heights_of, too_fast
from .flight import REST, Array, Flights, at_rest, find_flights, rising, stays
from .forms import OnLaw
from .plan import RobotPlan
from .pushes import foot_speed_at_push
from .result import quantities_of
from .sure import answer_of

__all__ = ["LONGEST", "answer_of_run", "follow_on", "on_law"]

LONGEST = 4.0  # Longest time on a law over the duration of the run [1]
PARTS = 4  # Of a duration, after each of which a robot may have come to its end [1]


def answer_of_run(run: RobotRun) -> dict[str, float]:
    """The answer of a run."""
    return _answer(run)[0]


def follow_on(run: RobotRun) -> None:
    """Step a run on a law to its end, and on until the robot flies, has hopped or is at rest.

    It goes on by parts of the duration, to `LONGEST` of it at most. A controller that fails after the duration ends it
    at the part before.
    """
    part = run.duration / PARTS
    run.run()
    for _ in range(round((LONGEST - 1) * PARTS)):
        if _finished(run, part):
            return
        before = run.state()
        run.duration += part
        try:
            run.run()
        except (RuntimeError, ValueError):  # of the controller, which may know the duration alone
            run.restore(before)
            run.duration -= part
            return


def on_law(run: RobotRun, plan: RobotPlan) -> OnLaw:
    """What a run on a law leaves for the range over the laws."""
    answer, heights, flights = _answer(run)
    launch = flights.rows[0][0] + 1 if flights.rows else None
    return OnLaw(
        answer=answer, time=run.time, rising=rising(run, flights), deepest=deepest_part(run, plan.diameters),
        deepest_before=deepest_part(run, plan.diameters, launch),
        push_speed=foot_speed_at_push(run, heights, flights), fast=bool(too_fast(plan, run, heights)),
    )  # fmt: skip


def _answer(run: RobotRun) -> tuple[dict[str, float], Array, Flights]:
    """The answer of a run, with heights and flights as of `find_flights`."""
    heights = heights_of(run)
    flights = find_flights(run, heights)
    hop = not stays(run, flights)
    answer = answer_of(quantities_of(run, heights, flights), feet_reached(run, heights), hop=hop)
    return answer, heights, flights


def _finished(run: RobotRun, part: float) -> bool:
    """Whether the rise is known: in flight, at rest, or after a hop, unless the robot pushes off higher. So it is where
    nothing touches, and where nothing falls.

    ``part``: time for which a robot at rest has not moved [s].
    """
    if run.robot.hangs or not run.robot.gravity > 0 or not run.columns["touching"].any() or at_rest(run, part):
        return True
    flights = find_flights(run, heights_of(run))
    since = run.columns["z"][flights.touched :]
    return flights.at_end or (since.max() > since[0] + REST and not rising(run, flights))
