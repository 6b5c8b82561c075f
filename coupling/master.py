"""The master: steps a body and what it stands on together, and keeps the books of what passes between them.

Over one macro step H the body's twist is held and the footing answers with its mean wrench. The twist is that of the
step's middle, guessed with a wrench that is extrapolated from the steps before (`extrapolation` 0: the last one, 1: on
the straight line through the last two, 2: on the parabola through three). With `iterations` above 1 the step is
repeated, from the footing's saved state, with the wrench that came out, until that changes by less than `tolerance` of
the largest force met.

The books (docs/coupling.md). What the footing takes is its wrench times the twist it saw, what the body gives is the
wrench times the mean of its rates before and after; the difference is the error of the exchange, of second order in H
(Sadjina et al. 2016, Eng. Comput. 33:607, call it the residual of a power bond).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from .footing import Footing, FootReaction
from .poses import Pose, Twist, Wrench

__all__ = ["Body", "Master", "StepBooks"]

_WEIGHTS = ((1.0,), (2.0, -1.0), (3.0, -3.0, 1.0))
"""Of the last wrenches, the newest first, by order of extrapolation."""


@runtime_checkable
class Body(Protocol):
    """Whatever a footing can push: `coupling.PlanarBody`, `coupling.SpatialBody`."""

    @property
    def pose(self) -> Pose:
        """Where it is."""

    @property
    def twist(self) -> Twist:
        """How it moves, half a lag after the time of its pose."""

    def twist_now(self, lag: float) -> Twist:
        """How it moves at the time of its pose."""

    def predict(self, dt: float, guess: Wrench, lag: float) -> Twist:
        """The twist to hold over the next `dt` [s], under the guess at the ground's wrench."""

    def resolve(self, dt: float, twist: Twist, reaction: FootReaction) -> Wrench:
        """The whole wrench of the ground: `reaction` with the friction that its Coulomb bounds leave open."""

    def advance(self, dt: float, twist: Twist, wrench: Wrench) -> None:
        """Take the step: along `twist`, with the impulse of `wrench`."""

    def state(self) -> dict[str, Any]:
        """All that its next steps depend on: a flat dict of numpy arrays."""

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""


@dataclass(slots=True)
class StepBooks:
    """What passed since the books were opened [J]."""

    given: float = 0.0
    """Work of the body on the footing, as the body sees it: by the mean of its rates before and after each step."""
    taken: float = 0.0
    """The same as the footing sees it: by the twist that was held."""
    worst_guess: float = 0.0
    """Largest |force guessed - force found| [N]."""
    largest_force: float = 0.0
    """Largest force of one step [N]."""
    repeats: int = 0
    """Steps of the footing beyond one a macro step."""

    def numbers(self) -> list[float]:
        """As they are kept in a state."""
        return [self.given, self.taken, self.worst_guess, self.largest_force, float(self.repeats)]


class Master:
    """`body` and `footing`, in macro steps of `substeps` of the footing's own steps.

    Parameters
    ----------
    substeps : of the footing in a macro step [1].
    extrapolation : order of the guess at the next wrench, 0 to 2.
    iterations : how often a macro step is computed at most; 1: explicit.
    tolerance : change of the force between two iterations that ends them, over the largest force so far [1].
    first_guess : the wrench before the first step; none if not given.

    Raises ValueError, naming the key, for what cannot be.
    """

    def __init__(
        self,
        body: Body,
        footing: Footing,
        *,
        substeps: int = 10,
        extrapolation: int = 0,
        iterations: int = 1,
        tolerance: float = 1e-9,
        first_guess: Wrench | None = None,
    ) -> None:
        for key, value in {"substeps": substeps, "iterations": iterations}.items():
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"{key} is {value!r}: it must be a whole number of 1 or more")
        if extrapolation not in (0, 1, 2):
            raise ValueError(f"extrapolation is {extrapolation!r}: it must be 0, 1 or 2")
        if not tolerance > 0:
            raise ValueError(f"tolerance is {tolerance!r}: it must be above 0")
        self.body, self.footing = body, footing
        self.macro_step = substeps * footing.time_step
        self.extrapolation, self.iterations, self.tolerance = extrapolation, iterations, tolerance
        self.count = 0
        """Macro steps done."""
        self._wrenches: deque[Wrench] = deque([first_guess] if first_guess is not None else [], maxlen=3)
        self._held: Twist | None = None
        self.books = StepBooks()
        self.last: FootReaction | None = None
        """The footing's answer in the last step."""
        self.wrench = Wrench.none()
        """The whole wrench of the last step, friction included."""

    def open_books(self) -> None:
        """Count from here."""
        self.books = StepBooks()
        self._held = None

    def guess(self) -> Wrench:
        """The wrench expected in the step to come."""
        if not self._wrenches:
            return Wrench.none()
        weights = _WEIGHTS[min(self.extrapolation, len(self._wrenches) - 1)]
        force = sum(w * past.force for w, past in zip(weights, self._wrenches, strict=False))
        torque = sum(w * past.torque for w, past in zip(weights, self._wrenches, strict=False))
        return Wrench(np.asarray(force), np.asarray(torque))

    def step(self) -> FootReaction:
        """One macro step; the footing's answer."""
        body, footing, dt, books = self.body, self.footing, self.macro_step, self.books
        expected = self.guess()
        kept = footing.state() if self.iterations > 1 else None
        trial = expected
        for turn in range(self.iterations):
            if turn:
                assert kept is not None
                footing.restore(kept)
                books.repeats += 1
            held = body.predict(dt, trial, footing.lag)
            reaction = footing.step(body.pose, held, dt)
            wrench = body.resolve(dt, held, reaction)
            books.largest_force = max(books.largest_force, _size(wrench))
            if _apart(wrench, trial) <= self.tolerance * books.largest_force:
                break
            trial = wrench
        before = body.twist
        body.advance(dt, held, wrench)
        self._book(held, wrench, before)
        books.worst_guess = max(books.worst_guess, _apart(wrench, expected))
        self._wrenches.appendleft(wrench)
        self._held, self.wrench, self.last = held, wrench, reaction
        self.count += 1
        return reaction

    def _book(self, held: Twist, wrench: Wrench, before: Twist) -> None:
        dt, lag = self.macro_step, self.footing.lag
        self.books.given -= dt * wrench.power(_mean(before, self.body.twist))
        self.books.taken -= dt * wrench.power(held)
        if lag and self._held is not None:
            # The last force of the step before was met by grains half with its twist, half with the one now held.
            change = Twist(held.velocity - self._held.velocity, held.spin - self._held.spin)
            self.books.taken -= 0.5 * lag * self.wrench.power(change)

    def exchanged(self) -> tuple[float, float]:
        """Work on the footing up to the time of the pose [J], as the body sees it and as the footing sees it.

        A bed's last force acts half before that time and half after it; the books hold all of it.
        """
        lag, books = self.footing.lag, self.books
        if not lag or self._held is None:
            return books.given, books.taken
        return (
            books.given + 0.5 * lag * self.wrench.power(_mean(self.body.twist, self.body.twist_now(lag))),
            books.taken + 0.5 * lag * self.wrench.power(self._held),
        )

    def state(self) -> dict[str, Any]:
        """All that the next steps depend on, body and footing included: a flat dict of numpy arrays."""
        past = [np.concatenate([wrench.force, wrench.torque]) for wrench in self._wrenches]
        held = self._held
        own: dict[str, Any] = {
            "master.count": np.array(self.count),
            "master.wrenches": np.array(past).reshape(-1, 6),
            "master.wrench": np.concatenate([self.wrench.force, self.wrench.torque]),
            "master.held": np.concatenate([held.velocity, held.spin]) if held is not None else np.zeros(0),
            "master.books": np.array(self.books.numbers()),
        }
        own |= {f"body.{key}": value for key, value in self.body.state().items()}
        return own | {f"footing.{key}": value for key, value in self.footing.state().items()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        self.count = int(state["master.count"])
        self._wrenches.clear()
        self._wrenches.extend(_unpack(row) for row in np.asarray(state["master.wrenches"], dtype=float))
        self.wrench = _unpack(np.asarray(state["master.wrench"], dtype=float))
        held = np.asarray(state["master.held"], dtype=float)
        self._held = Twist(held[:3].copy(), held[3:].copy()) if held.size else None
        given, taken, worst, largest, repeats = (float(number) for number in state["master.books"])
        self.books = StepBooks(given, taken, worst, largest, int(repeats))
        for name, part in (("body.", self.body), ("footing.", self.footing)):
            part.restore({key[len(name) :]: value for key, value in state.items() if key.startswith(name)})


def _unpack(row: np.ndarray) -> Wrench:
    return Wrench(row[:3].copy(), row[3:].copy())


def _mean(one: Twist, other: Twist) -> Twist:
    return Twist(0.5 * (one.velocity + other.velocity), 0.5 * (one.spin + other.spin))


def _size(wrench: Wrench) -> float:
    return float(np.linalg.norm(wrench.force))


def _apart(one: Wrench, other: Wrench) -> float:
    return float(np.linalg.norm(one.force - other.force))
