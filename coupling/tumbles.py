"""Several tumbles in a row on one ground, and a landing: `CoupledTumble` with another beginning or end.

Several tumbles: the torque acts until the platform has turned by `turn` times half the angle between two rows. At 1 its
middle is over the leading row, from where it falls by itself. Then the platform comes to rest, which is noted, and the
next tumble begins. The wheel keeps its speed. A landing starts just clear of the ground with the velocities of its
fall.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hedgebed_renamed import renamed_keywords
from rigid.ground.reaction import State
from rigid.model.trial import Trial
from rigid.planar.trajectory import STATES

from .bed_ground import BedGround
from .ground import Ground, part_of, prefixed
from .law_ground import LawGround
from .lowered_gravity import pace_under
from .tumbling import CoupledTumble

__all__ = ["Landing", "Rest", "TumblesInARow"]

REST_SPEED = 2e-3  # Centre and tips of a platform at rest are slower [m/s]: as fast as a row that slides
REST_LASTS = 0.1  # For how long [s]
LONGEST_WAIT = 3.0  # After the torque's end the next begins at the latest [s], at rest or not, which is noted


class Rest(NamedTuple):
    """What counts as lying at rest, and how long it is waited for."""

    speed: float  # Centre and tips are slower [m/s],
    lasts: float  # for this long [s]
    longest_wait: float  # [s]

    @classmethod
    def of(cls, trial: Trial) -> "Rest":
        """Those above in the rig and at 1 g; in flight speeds go as sqrt(g), times as its inverse: lengths stay."""
        pace = 1.0 if trial.counterweight > 0 else pace_under(trial.gravity_sim)
        return cls(REST_SPEED / pace, REST_LASTS * pace, LONGEST_WAIT * pace)


NOTED = ("time", "x", "y", "theta", "sinkage", "deepest", "at_rest", "rows_turned")
"""Of `TumblesInARow.rests`: when and where [s, m, m, rad]; mean depth of the rows that carry, and the largest of any
since the rest before [m]; whether it was at rest; rows turned by since then."""


class TumblesInARow(CoupledTumble):
    """`tumbles` of them, one after the other; it is over after the last rest, or after `duration` [s].

    `turn` says where each torque ends, over pi / rows [1].

    The other parameters as `CoupledTumble`. Raises ValueError for a brake, whose wheel turns the platform once.
    """

    @renamed_keywords(footing="ground")
    def __init__(self, trial: Trial, ground: Ground, *, tumbles: int, turn: float = 1.0, **options: Any) -> None:
        if trial.actuator == "brake":
            raise ValueError("tumbles in a row need a motor: a brake stops its wheel in the first")
        self.tumbles, self.turn = tumbles, turn
        self.rest = Rest.of(trial)
        self._rests: list[list[float]] = []
        self._on, self._from, self._quiet_since, self._ended, self._seen = True, 0.0, 0.0, 0.0, 0
        super().__init__(trial, ground, **options)

    @property
    def done(self) -> bool:
        """Whether the last has come to rest, or the time is over."""
        return len(self._rests) > self.tumbles or super().done

    @property
    def rests(self) -> dict[str, np.ndarray]:
        """Where it lay before the first tumble and after each, by NOTED: arrays of shape [rest]."""
        table = np.array(self._rests, dtype=float).reshape(-1, len(NOTED))
        return dict(zip(NOTED, table.T, strict=True))

    @property
    def ended(self) -> int:
        """How many torques have ended, that of a tumble which nothing was noted of yet included."""
        noted = max(len(self._rests) - 1, 0)
        return noted + (not self._on and noted < self.tumbles)

    def advance(self) -> None:
        """One macro step, and what follows from where the platform is then."""
        super().advance()
        if self.placed and len(self._rests) <= self.tumbles:
            self._watch()

    def _watch(self) -> None:
        body = self.body
        if not self._rests:
            self._note(at_rest=True)
        if self._on:
            if body.place[2] - self._from >= self.turn * math.pi / self.trial.spike_count:
                self._switch(False)
                self._ended = self._quiet_since = body.time
            return
        fastest = max(math.hypot(*body.rates[:2]), abs(body.rates[2]) * self.trial.spike_length)
        touches = self.master.last is not None and bool(self.master.last.contacts)
        if fastest > self.rest.speed or not touches:
            self._quiet_since = body.time
        rests = body.time - self._quiet_since >= self.rest.lasts
        if rests or (body.time - self._ended >= self.rest.longest_wait and touches):
            self._note(at_rest=rests)
            self._from = float(body.place[2])
            if len(self._rests) <= self.tumbles:
                self._switch(True)

    def _note(self, *, at_rest: bool) -> None:
        body, feet = self.body, np.array(self._feet[self._seen :])
        carried = feet[-1, 0] > 0.05 * self.trial.weight
        sinkage = np.maximum(0.0, self._reach(float(body.place[2])) - float(body.place[1]))
        mean = float(sinkage[carried].mean()) if carried.any() else 0.0
        before = self._rests[-1][3] if self._rests else float(body.place[2])
        turned = round((float(body.place[2]) - before) / (2 * math.pi / self.trial.spike_count))
        deepest = max(float(feet[:, 3].max()), float(sinkage.max()))
        self._rests.append([body.time, *body.place.tolist(), mean, deepest, float(at_rest), float(turned)])
        self._seen = len(self._feet)

    def _switch(self, on: bool) -> None:
        self._on = on
        self.body.trial = replace(self.trial, torque_until=math.inf if on else self.body.time)

    def state(self) -> State:
        """All that the rest of the run depends on."""
        numbers = [self._on, self._from, self._quiet_since, self._ended, self._seen]
        rests = np.array(self._rests, dtype=float).reshape(-1, len(NOTED))
        return super().state() | prefixed("row", {"numbers": np.array(numbers, dtype=float), "rests": rests})

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        super().restore(state)
        own = part_of(state, "row")
        on, self._from, self._quiet_since, self._ended, seen = (float(value) for value in own["numbers"])
        self._on, self._seen, self._rests = bool(on), int(seen), np.asarray(own["rests"], dtype=float).tolist()
        self.body.trial = replace(self.trial, torque_until=math.inf if on else self._ended)


class Landing(CoupledTumble):
    """The platform comes down at `speed` [m/s], moving `along` [m/s], turned by `theta` [rad] and with `spin` [rad/s].

    The other parameters as `CoupledTumble`, without a placement or a height; of the torque nothing acts.
    """

    @renamed_keywords(footing="ground")
    def __init__(
        self,
        trial: Trial,
        ground: Ground,
        *,
        speed: float,
        along: float = 0.0,
        spin: float = 0.0,
        theta: float = 0.0,
        **options: Any,
    ) -> None:
        if not (math.isfinite(speed) and speed > 0):
            raise ValueError(f"drop_speed is {speed}: it must be above 0 (in m/s, downwards)")
        self._comes = np.array([along, -speed, spin])
        self._turned = theta
        high = trial.spike_length + 0.05  # above the grains, whatever is turned down; `_begin` takes it to them
        super().__init__(replace(trial, torque=0.0), ground, height=high, **options)

    def _begin(self) -> None:
        body = self.body
        body.place = np.array([0.0, self._reach(self._turned).max(), self._turned])
        if isinstance(self.ground, BedGround | LawGround):
            body.lift(self.ground.clear_height(body.pose))
            self.ground.place(body.pose)
        body.start(self._comes, self.ground.lag)
        super()._begin()
        self._states[0] = STATES.index("hop")
