"""What is said of a tumble in the end: the way through its states, and when it was fastest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rigid.trajectory import Trajectory, Transition

if TYPE_CHECKING:
    from coupling import Master

__all__ = [
    "MOST", "residual_warning", "reversal_warning", "stayed_words", "tumble_sentences", "unsettled_warning",
    "way_through",
]  # fmt: skip

MOST = 8
"""Changes of state that are told one by one."""
MOST_RESIDUAL = 0.01
"""A larger energy_residual is worth a warning [1]."""


def tumble_sentences(trajectory: Trajectory) -> list[str]:
    """The states in their order, each with when and at which angle it was entered; and when the centre was fastest."""
    said = [way_through(trajectory.transitions)]
    said += _does_not_tip(trajectory)
    if trajectory.max_speed > 0:
        when = trajectory.time_of_max_speed
        state = [name for time, name, _ in trajectory.transitions if time < when or time == 0][-1]
        said.append(f"Fastest at {when:.4g} s ({state}): {trajectory.max_speed:.4g} m/s.")
    return said


def way_through(transitions: Sequence[Transition]) -> str:
    """The states in their order, each with when and at which angle it was entered; the first few of them."""
    told = [
        f"{state} at {time:.4g} s, {_degrees(angle)}" if time > 0 else f"{state} at once"
        for time, state, angle in transitions[:MOST]
    ]
    more = len(transitions) - MOST
    rest = f" -> {more} more change{'s' if more > 1 else ''} of state (in result.json)" if more > 0 else ""
    return f"{' -> '.join(told)}{rest}."


def stayed_words(trajectory: Trajectory) -> str:
    """That there is no trajectory angle, and how far the centre got instead, and which way."""
    along, up = (values - values[0] for values in (trajectory.x, trajectory.y))
    far = int(np.argmax(np.hypot(along, up)))
    return (
        f"the centre never got 10 mm away from its start: there is no trajectory angle; at most it was "
        f"{1e3 * math.hypot(along[far], up[far]):.3g} mm away, {1e3 * along[far]:+.3g} mm along and "
        f"{1e3 * up[far]:+.3g} mm up, at {trajectory.time[far]:.4g} s"
    )


def residual_warning(residual: float) -> str | None:
    """That the books of energy do not close, where `energy_residual` is too large."""
    if residual <= MOST_RESIDUAL:
        return None
    return (
        f"energy_residual = {_above(residual, MOST_RESIDUAL)} is above {MOST_RESIDUAL:g}: the books do not close; "
        "fewer substeps, or iterations, tell whether it is the coupling, stiffer grains (young) whether the bed's step"
    )


def reversal_warning(made: float) -> str | None:
    """That the bed made energy, where `dissipation_reversal` is too large."""
    from coupling import MOST_REVERSAL

    if made <= MOST_REVERSAL:
        return None
    return (
        f"dissipation_reversal = {_above(made, MOST_REVERSAL)} is above {MOST_REVERSAL:g}: the bed made energy, so "
        f"this run's numbers are not to be trusted; fewer substeps tell whether it is the coupling"
    )


def unsettled_warning(master: Master) -> str | None:
    """That macro steps were iterated as often as allowed without coming to an end, where some were."""
    many = master.books.unsettled
    if not many:
        return None
    return (
        f"{many} of {master.count} macro steps did not settle in iterations = {master.iterations}: more of them, or "
        f"fewer substeps, would do"
    )


def _above(value: float, limit: float) -> str:
    """A value with as many digits, two at least, as show that it is above the limit."""
    texts = (f"{value:.{digits}g}" for digits in range(2, 18))
    return next((text for text in texts if float(text) > limit), f"{value:g}")


def _does_not_tip(trajectory: Trajectory) -> list[str]:
    """Whether it stayed on the rows it stood on: a pivot may be no more than a rocking."""
    trial, most = trajectory.trial, float(abs(trajectory.theta).max())
    if most >= math.pi / trial.spike_count or any(state == "hop" for _, state, _ in trajectory.transitions):
        return []
    below = trial.actuator == "motor" and not trial.effects and trial.torque < trial.tipping_torque
    why = f": {trial.torque:g} N m is below the {trial.tipping_torque:.4g} N m that tip it" if below else ""
    return [f"It does not tip in this time, it turns by {_degrees(most)} at most{why}."]


def _degrees(theta: float) -> str:
    return f"{math.degrees(theta):.3g} degrees"
