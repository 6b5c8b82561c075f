"""What runs of a platform on a ground share: rows, state and balance, and the placement before time begins.

Placement lowers the platform onto the ground against a drag until the ground carries it.
"""

import math
from typing import Any

import numpy as np

from hedgebed_renamed import renamed
from rigid.checks import check_above_zero
from rigid.checks.unfit import UnfitSettingsError
from rigid.ground.reaction import Reaction, State
from rigid.planar.trajectory import STATES

from .balance import EnergyBalance
from .bed_ground import BedGround
from .contact_state import ContactReader, feet_of
from .ground import Ground, part_of, prefixed
from .law_ground import LawGround
from .lowered_gravity import pace_under
from .master import Master
from .poses import Twist, Vector
from .stepper import Stepper

__all__ = ["AT_REST", "REST_TIME", "PlatformRun"]

AT_REST = 0.005  # What of its weight may still be missing at rest, and the mean speed there over the lowering speed [1]
SWINGS = math.sqrt(AT_REST)  # Of the same, largest root mean square in the last quarter of the time [1]
FIRMER = 4.0  # Factor on drag and mass of the placement of what swings [1]
REST_TIME = 0.04  # For how long the signs of rest must hold [s]
PLACING_WAY = 0.02  # Lowering speed times the usual time of a placement [m]; for progress only
LONGEST_PLACING = 3.0  # A platform that has not come to rest after this [s] is an error


class PlatformRun(EnergyBalance, Stepper):
    """A platform on a ground, placed on it if asked to and followed from where time begins.

    It can be saved and restored between any two macro steps; every macro step leaves one row.

    Parameters
    ----------
    duration : how long it is followed from where time begins [s].
    lift : whether the body is lifted until it is clear of grains. Raises ValueError for a start in overlap with grains.
    weight : as a force on the body [N], shape (3,).
    members : of the body, where each is about its origin [m], shape [member, 3], in space; in the plane their number.
    lowering_speed : of a placement before time begins [m/s]; None: none.
    energy_interval : between measurements of what the ground holds [s].
    options : of `Master`.
    """

    _prefix: str  # Of the keys of a state
    _hull = 0  # Members that are no spikes
    trial: Any
    pace = 1.0  # The placement's times over those on grains at 1 g (`lowered_gravity.pace_under`) [1]

    def __init__(
        self,
        trial: Any,
        ground: Ground,
        body: Any,
        *,
        duration: float,
        lift: bool,
        weight: Vector,
        members: Vector | int,
        lowering_speed: float | None = None,
        energy_interval: float = 0.02,
        **options: Any,
    ) -> None:
        super().__init__()
        check_above_zero("in s", duration=duration, energy_interval=energy_interval)
        if lowering_speed is not None:
            check_above_zero("in m/s", lowering_speed=lowering_speed)
        self._pull = weight
        self.trial, self.ground, self.body, self.duration = trial, ground, body, float(duration)
        if isinstance(ground, BedGround | LawGround):
            if lift:
                body.lift(ground.clear_height(body.pose))
            ground.place(body.pose)
        self.master = Master(body, ground, **options)
        self.macro_step, self._extrapolation = self.master.macro_step, self.master.extrapolation
        places, count = (None, members) if isinstance(members, int) else (members, len(members))
        self.reader = ContactReader(
            count, weight=self._weight, mu_d=trial.sliding_friction, macro_step=self.macro_step, places=places
        )
        self._every = max(1, round(energy_interval / self.macro_step))
        self.energy_interval = self._every * self.macro_step  # Between measurements of what the ground holds [s]
        self.lowering_speed = lowering_speed
        self.placed = lowering_speed is None  # Whether the placement is over
        self.placing_steps = 0  # Macro steps that the placement took
        self._members = count
        self._settling: list[Vector] = []
        self._states: list[int] = []
        self._feet: list[Vector] = []
        self._order()

    held_long, footing = renamed("held_long", "placement_is_long"), renamed("footing", "ground")

    def __repr__(self) -> str:
        when = f"{self.time:.4g} of {self.duration:g} s" if self.placed else f"being placed for {self.body.time:.4g} s"
        return f"{type(self).__name__}({self.body!r} on {self.ground!r}, {when})"

    @property
    def done(self) -> bool:
        """Whether it has come to its end."""
        return self.placed and bool(self.body.time >= self.duration - 0.5 * self.macro_step)

    @property
    def time(self) -> float:
        """Now [s]; before 0 during placement: how long that has taken, negative."""
        return float(self.body.time if self.placed else -self.body.time)

    @property
    def _elapsed(self) -> float:
        return float(self.body.time) if self.placed else -1.0

    @property
    def fraction(self) -> float:
        """Share of the run that is done, 0 to 1; the placement counts with its expected duration.

        One that takes longer nears that ever more slowly.
        """
        placing = self._placement_time
        passed = self.body.time / placing if placing > 0 else 0.0
        done = placing + self.body.time if self.placed else placing * (passed if passed <= 0.8 else 1 - 0.16 / passed)
        return float(min(1.0, done / (placing + self.duration)))

    @property
    def placement_is_long(self) -> bool:
        """Whether the placement still goes on, for longer than was expected."""
        return not self.placed and bool(self.body.time > self._placement_time)

    @property
    def _placement_time(self) -> float:
        """How long the placement is expected to take [s]; 0 without one."""
        return self.pace * REST_TIME + PLACING_WAY / self.lowering_speed if self.lowering_speed is not None else 0.0

    def _order(self) -> None:
        """During placement, where the body is light, the guess at the next force is the last one."""
        self.master.extrapolation = self._extrapolation if self.placed else 0

    def advance(self) -> None:
        """One macro step; nothing once it is done. Raises RuntimeError where a placement does not come to rest."""
        if self.done:
            return
        before = self.body.pose.position
        reaction = self.master.step()
        if not self.placed:
            self._lower(reaction)
            return
        self._record_moment(before)
        self._keep(reaction)
        if (self.master.count - self.placing_steps) % self._every == 0 or self.done:
            self._sample()

    def _begin(self) -> None:
        self._start_balance()
        self._keep(self.master.last)
        self._sample()

    def _keep(self, reaction: Reaction | None) -> None:
        now = self.body.twist_now(self.ground.lag)
        self._rows.append(self._row(reaction, now))
        centre = self.body.pose.position - 0.5 * self.macro_step * now.velocity
        feet = feet_of(reaction, centre, now, self._members - self._hull, hull=bool(self._hull))
        self._keep_feet(feet)
        self._states.append(STATES.index(self._state_now(feet)))

    def _start_placement(self) -> None:
        if isinstance(self.ground, BedGround):
            self.pace = pace_under(self.ground.gravity)
        self.body.begin_placement(self.lowering_speed, pace=self.pace, step=self.macro_step)

    @property
    def _weight(self) -> float:
        """[N]"""
        return float(np.linalg.norm(self._pull))

    def _out_of_balance(self) -> tuple[Vector, Vector]:
        """What of the weight the ground does not carry yet [N], and the speeds [m/s]."""
        raise NotImplementedError

    def _row(self, reaction: Reaction | None, now: Twist) -> list[float]:
        """By COLUMNS."""
        raise NotImplementedError

    def _keep_feet(self, feet: Vector) -> None:
        """Keep what each member feels (`contact_state.feet_of`)."""
        raise NotImplementedError

    def _state_now(self, feet: Vector) -> str:
        """The state: on grains from their forces, on a law from who sticks and who slides."""
        raise NotImplementedError

    @property
    def states(self) -> list[str]:
        """The state at every row: on grains as `coupling.contact_state` reads it, on a law by who sticks and slides."""
        return [STATES[code] for code in self._states]

    @property
    def _feet_table(self) -> Vector:
        """What is kept of the feet, as an array."""
        raise NotImplementedError

    def state(self) -> State:
        """All that the rest of the run depends on: a flat dict of numpy arrays."""
        width = sum(part.size for part in self._out_of_balance())
        own: State = {
            "counts": np.array([self.placed, self.placing_steps, self._frames], dtype=np.int64),
            "settling": np.array(self._settling, dtype=float).reshape(-1, width),
            "rows": self._row_table,
            "states": np.array(self._states, dtype=np.int8),
            "feet": self._feet_table,
        }
        parts = {self._prefix: own, "reader": self.reader.state(), "balance": self._balance_state()}
        found = self.master.state()
        for name, part in parts.items():
            found |= prefixed(name, part)
        return found

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        own = part_of(state, self._prefix)
        placed, self.placing_steps, self._frames = (int(number) for number in own["counts"])
        self.placed = bool(placed)
        self._settling = list(np.array(own["settling"], dtype=float))
        self._rows = np.asarray(own["rows"]).tolist()
        self._states = [int(code) for code in own["states"]]
        self._feet = list(np.array(own["feet"], dtype=float))
        self._restore_balance(part_of(state, "balance"))
        self.reader.restore(part_of(state, "reader"))
        self.master.restore(state)
        self._order()

    def _lower(self, reaction: Reaction) -> None:
        """A step of the placement, which ends at rest.

        A body that bounces (its mass during placement is small against the contacts' stiffness), so that it rests on
        the mean alone or not for half the time there is, is placed more slowly. Raises RuntimeError where it takes too
        long.
        """
        assert self.lowering_speed is not None
        missing, moving = self._out_of_balance()
        mean = self._mean_of_late(missing, moving)
        longest = self.pace * LONGEST_PLACING
        if mean is not None:
            scale = np.array([self._weight] * len(missing) + [self.lowering_speed] * len(moving))
            rests = bool(reaction.contacts) and bool((mean <= AT_REST * scale).all())
            late = self._settling[-max(2, len(self._settling) // 4) :]
            calm = bool((np.sqrt(np.mean(np.square(late), axis=0)) <= SWINGS * scale).all())
            if rests and calm:
                self._end_placement()
            elif rests or (
                self.body.time > 0.5 * longest and bool((np.std(self._settling, axis=0) > SWINGS * scale).any())
            ):
                self.body.slow_placement(FIRMER)
                self._settling = []
        if self.body.time > longest:  # 0 after its release
            raise UnfitSettingsError(
                f"the platform did not come to rest within {longest:.3g} s of being set down: the ground carried "
                f"{self.master.wrench.force[2]:.3g} of {self._weight:.3g} N at the end"
            )

    def _mean_of_late(self, missing: Vector, moving: Vector) -> Vector | None:
        """Size of the mean over the last REST_TIME of missing weight and speeds; None while there is less time."""
        self.placing_steps = self.master.count
        count = max(2, round(self.pace * REST_TIME / self.master.macro_step))
        self._settling = [*self._settling, np.concatenate([missing, moving])][-count:]
        return np.abs(np.mean(self._settling, axis=0)) if len(self._settling) == count else None

    def _end_placement(self) -> None:
        """It lies where it was set down: the placement ends."""
        self.body.release()
        self.placed = True
        self._order()
        self._begin()
