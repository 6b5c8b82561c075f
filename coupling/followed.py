"""What all runs of a body on a footing share: how far they are, the loop to the end, the hand that sets a body down."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .books import Books
from .footing import FootReaction
from .poses import Vector

__all__ = ["AT_REST", "REST_TIME", "Followed"]

AT_REST = 0.005
"""What a platform at rest may still lack of its weight, and its mean speed over the lowering speed [1]."""
SWINGS = math.sqrt(AT_REST)
"""Root of the mean square of the same in the last quarter of the time, at most [1]: what comes to rest from one side
has less once its mean is at rest; what bounces in the hand does not."""
FIRMER = 4.0
"""By how much the hand holds what swings more firmly [1]."""
REST_TIME = 0.04
"""For how long the signs of rest must hold [s]."""
PLACING_WAY = 0.02
"""Lowering speed times the time that setting down took in the first runs, without REST_TIME [m]; for progress only."""
LONGEST_PLACING = 3.0
"""A platform that has not come to rest after this [s] is an error."""


class Followed(Books):
    """A run that can be saved between any two macro steps. Whoever has it gives `advance`, `_begin` and `_weight`."""

    body: Any
    duration: float
    lowering_speed: float | None
    placed: bool
    """Whether the hand has let go."""
    _extrapolation: int
    pace = 1.0
    """The hand's times over those on grains at 1 g (`lowered_gravity.pace_under`) [1]."""

    def _not_begun(self) -> None:
        self.placing_steps = 0
        """Macro steps that the hand took."""
        self._settling: list[Vector] = []
        self._frames = 0
        self._no_samples()

    @property
    def done(self) -> bool:
        """Whether it has come to its end."""
        return self.placed and self.body.time >= self.duration - 0.5 * self.master.macro_step

    @property
    def time(self) -> float:
        """Now [s]; before 0 while the hand holds it: how long it has been held, negative."""
        return self.body.time if self.placed else -self.body.time

    @property
    def fraction(self) -> float:
        """How far it is along, 0 to 1, the setting down, as long as it was guessed to take, included."""
        hand = self._hand_time
        done = hand + self.body.time if self.placed else min(hand, self.body.time)
        return min(1.0, done / (hand + self.duration))

    @property
    def held_long(self) -> bool:
        """Whether it is still in the hand, for longer than was guessed."""
        return not self.placed and self.body.time > self._hand_time

    @property
    def _hand_time(self) -> float:
        """How long setting down was guessed to take [s]; 0 without a hand."""
        return self.pace * REST_TIME + PLACING_WAY / self.lowering_speed if self.lowering_speed is not None else 0.0

    def _order(self) -> None:
        """In the hand, where the body is light, the guess at the next force is the last one, whatever is asked for."""
        self.master.extrapolation = self._extrapolation if self.placed else 0

    def advance(self) -> None:
        """One macro step; nothing once it is done."""
        raise NotImplementedError

    def _begin(self) -> None:
        """Time is 0."""
        raise NotImplementedError

    @property
    def _weight(self) -> float:
        """[N]"""
        raise NotImplementedError

    def _follow(
        self,
        on_step: Callable[[Any], None] | None,
        on_frame: Callable[[Any], None] | None,
        frame_interval: float | None,
    ) -> None:
        """Go on to the end, with a frame every `frame_interval` [s] and at the end."""
        while True:
            if on_frame and frame_interval and self.placed:
                due = self.body.time >= self._frames * frame_interval - 0.5 * self.master.macro_step
                self._frames += due
                if due or self.done:
                    on_frame(self)
            if self.done:
                return
            self.advance()
            if on_step:
                on_step(self)

    def _settle(self, reaction: FootReaction, lacking: Vector, moving: Vector) -> None:
        """A step in the hand: what of the weight the ground does not carry yet [N], and the speeds [m/s]. At rest the
        hand lets go. What bounces in the hand (a light body, whose hand is light against the contacts' stiffness), so
        that it rests on the mean alone or not for half the time there is, is held more firmly. Raises RuntimeError
        where it takes too long."""
        assert self.lowering_speed is not None
        mean = self._mean_of_late(lacking, moving)
        longest = self.pace * LONGEST_PLACING
        if mean is not None:
            scale = np.array([self._weight] * len(lacking) + [self.lowering_speed] * len(moving))
            rests = bool(reaction.contacts) and bool((mean <= AT_REST * scale).all())
            late = self._settling[-max(2, len(self._settling) // 4) :]
            calm = bool((np.sqrt(np.mean(np.square(late), axis=0)) <= SWINGS * scale).all())
            if rests and calm:
                self._lies()
            elif rests or (
                self.body.time > 0.5 * longest and bool((np.std(self._settling, axis=0) > SWINGS * scale).any())
            ):
                self.body.hold_more_firmly(FIRMER)
                self._settling = []
        if self.body.time > longest:  # 0 once it is let go
            raise RuntimeError(
                f"the platform did not come to rest within {longest:.3g} s of being set down: the ground carried "
                f"{self.master.wrench.force[2]:.3g} of {self._weight:.3g} N at the end"
            )

    def _mean_of_late(self, lacking: Vector, moving: Vector) -> Vector | None:
        """Size of the mean over the last REST_TIME of what lacks and moves; None as long as there is less of it."""
        self.placing_steps = self.master.count
        count = max(2, round(self.pace * REST_TIME / self.master.macro_step))
        self._settling = [*self._settling, np.concatenate([lacking, moving])][-count:]
        return np.abs(np.mean(self._settling, axis=0)) if len(self._settling) == count else None

    def _lies(self) -> None:
        """It lies where it was set down: the hand lets go."""
        self.body.let_go()
        self.placed = True
        self._order()
        self._begin()
