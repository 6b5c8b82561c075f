"""The contract between a body and whatever pushes on it.

A body does not know what it stands on. It hands a ground its pose and velocity, and the ground answers with the mean
reaction over the step. A ground may remember (a bed of grains does), so it can be saved and restored, to the bit.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from rigid.reaction import Contact, Reaction

__all__ = ["Contact", "Ground", "Reaction"]


@runtime_checkable
class Ground(Protocol):
    """Whatever can push on a body."""

    @property
    def name(self) -> str:
        """What a report calls it."""

    @property
    def time_step(self) -> float:
        """The step it wants to be driven at [s]; where it is the ground's own, dt of `step` is a whole multiple."""

    @property
    def surface(self) -> float:
        """Height of the undisturbed surface [m]: depth is counted down from here."""

    @property
    def centre(self) -> tuple[float, float]:
        """Where a body is put by default, (x, y) [m]."""

    @property
    def clearance(self) -> float:
        """How far above `surface` the body it was made for touches nothing yet [m]; grains stick out of a bed."""

    @property
    def depth_limit(self) -> float:
        """How deep the body it was made for may go [m]; infinite where there is no floor."""

    def step(self, position: ArrayLike, velocity: ArrayLike, dt: float) -> Reaction:
        """Advance by `dt` [s] under a body at `position` [m] (at the start) that moves at constant `velocity` [m/s].

        Both have shape (3,), world axes, z up. Returns the mean over the step: force * dt is the exact impulse.
        """

    def state(self) -> dict[str, Any]:
        """Everything that the next steps depend on: a flat dict of numpy arrays."""

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave; the steps that follow repeat to the bit."""
