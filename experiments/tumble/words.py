"""What is said of a tumble in the end: the way through its states, and when it was fastest."""

import math
from collections.abc import Sequence

import numpy as np

from rigid.planar.trajectory import Trajectory, Transition

from . import say

__all__ = ["MOST", "stayed_words", "tumble_sentences", "way_through"]

MOST = 8  # Changes of state that are stated one by one


def tumble_sentences(trajectory: Trajectory) -> list[str]:
    """The states in their order, each with when and at which angle it was entered; and when the centre was fastest."""
    said = [way_through(trajectory.transitions)]
    said += _does_not_tip(trajectory)
    if trajectory.max_speed > 0:
        when = trajectory.time_of_max_speed
        state = [name for time, name, _ in trajectory.transitions if time < when or time == 0][-1]
        said.append(say("fastest", when=when, state=state, speed=trajectory.max_speed))
    return said


def way_through(transitions: Sequence[Transition]) -> str:
    """The states in their order, each with when and at which angle it was entered; the first few of them."""
    told = [
        f"{state} at {time:.4g} s, {_degrees(angle)}" if time > 0 else f"{state} at once"
        for time, state, angle in transitions[:MOST]
    ]
    more = len(transitions) - MOST
    rest = say("more_changes", more=more, s="s" if more > 1 else "") if more > 0 else ""
    return f"{' -> '.join(told)}{rest}."


def stayed_words(trajectory: Trajectory) -> str:
    """That there is no trajectory angle, and how far the centre got instead, and which way."""
    along, up = (values - values[0] for values in (trajectory.x, trajectory.y))
    k = int(np.argmax(np.hypot(along, up)))
    far = 1e3 * math.hypot(along[k], up[k])
    return say("stayed", far=far, along=1e3 * along[k], up=1e3 * up[k], time=trajectory.time[k])


def _does_not_tip(trajectory: Trajectory) -> list[str]:
    """Whether it stayed on the rows it stood on: a pivot may be no more than a rocking."""
    trial, most = trajectory.trial, float(abs(trajectory.theta).max())
    if most >= math.pi / trial.spike_count or any(state == "hop" for _, state, _ in trajectory.transitions):
        return []
    below = trial.actuator == "motor" and not trial.effects and trial.torque < trial.tipping_torque
    return [say("does_not_tip", most=_degrees(most), why=say("below_tipping", trial=trial) if below else "")]


def _degrees(theta: float) -> str:
    return f"{math.degrees(theta):.3g} degrees"
