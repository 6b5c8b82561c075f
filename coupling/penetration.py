"""A spike that goes straight down into a ground: driven, dropped or set down.

One macro step H is a whole number of the ground's own steps. Over it the spike moves at a constant velocity and the
ground answers with its mean force F. So F H and F (velocity) H are exact. A free spike of mass m under the load W:

    u     = v + (W - F_before) H / (2 m)       the velocity held during the step, a guess at its middle
    z'    = z + u H
    v'    = v + (W - F) H / m                  F: the mean force of the step just done

which is of second order in H, and exact in free fall. Time is 0 where the tip meets the undisturbed surface, depth 0.
Before that the spike is carried at its speed (phase "free"), from just clear of the grains that stick out. `state` and
`restore` work between any two macro steps: a continued run is bitwise equal to an unbroken one.
"""

import math
from dataclasses import asdict
from typing import Any, Unpack

import numpy as np

from rigid.checks import check_above_zero, check_not_negative
from rigid.ground.reaction import Facts, State
from rigid.platform.spike import Spike

from .bed_ground import BedGround, GrainBed
from .ground import Described, Ground, part_of, prefixed
from .planar_body import PLACEMENT_TIME
from .stepper import LastRows, Reporting, Stepper
from .trajectory import PHASES, Penetration

__all__ = ["Drive", "Drop", "Run", "SetDown", "drive", "drop", "overdamped_below", "set_down"]

SUBSTEPS = 10  # Steps of the ground in a macro step, by default
AT_REST = 0.003  # What of its load may still be missing at rest, and the mean speed there over the lowering speed [1]
FREE, IN, REST, OUT = range(4)


class Run(Stepper):
    """A spike that goes into `ground` (or a bed): what all three runs share, clock, rows and saved state."""

    kind = ""
    lets_go_at_touch = False  # Whether the approach ends where the ground is first felt, above its surface

    def __init__(
        self,
        spike: Spike,
        ground: Any,
        *,
        speed: float,
        substeps: int = SUBSTEPS,
        start_depth: float | None = None,
        max_time: float = 10.0,
    ) -> None:
        super().__init__()
        self.spike = spike
        self.ground: Ground = BedGround(ground, spike) if isinstance(ground, GrainBed) else ground
        check_above_zero(speed=speed, substeps=substeps, max_time=max_time)
        self.speed, self.max_time = float(speed), float(max_time)
        self.macro_step = int(substeps) * self.ground.time_step
        lift = -start_depth if start_depth is not None else self.ground.clearance
        self._approach = max(0, math.ceil(lift / (self.speed * self.macro_step) - 1e-9))
        """Macro steps before it is let go; they end at depth 0 exactly."""
        self._start = -self._approach * self.speed * self.macro_step
        self.count = 0  # Macro steps done
        self.depth = self._start  # Depth of the tip now [m]
        self.velocity = self.speed  # Velocity now, positive downwards [m/s]
        self.ended = ""  # Why it ended; empty while it goes on
        self.expected_time = self.max_time  # How long it may well take [s], for those who show progress
        self._rows: list[tuple[float, float, float, float]] = []
        self._phases: list[int] = []

    def __repr__(self) -> str:
        where = f"{1e3 * self.depth:.3g} mm deep at {self.time:.4g} s"
        return f"{type(self).__name__}({self.spike!r} into {self.ground.name}, {where}{', ' * self.done}{self.ended})"

    @property
    def done(self) -> bool:
        """Whether it has come to its end."""
        return bool(self.ended)

    @property
    def time(self) -> float:
        """Now [s]; 0 at the surface, or where a spike set down is let go above it."""
        return (self.count - self._approach) * self.macro_step

    @property
    def _elapsed(self) -> float:
        return self.count * self.macro_step

    @property
    def position(self) -> tuple[float, float, float]:
        """Where the tip's lowest point is [m], world axes, z up."""
        return (*self.ground.centre, self.ground.surface - self.depth)

    @property
    def last_force(self) -> float:
        """Mean force of the last macro step [N]; 0 before the first."""
        return self._rows[-1][3] if self._rows else 0.0

    @property
    def fraction(self) -> float:
        """How far along it is, from 0 to 1, as well as can be known."""
        return 1.0 if self.done else min(0.99, max(0.0, self.time / self.expected_time))

    def advance(self) -> None:
        """Make one macro step; nothing once it has ended."""
        if self.done:
            return
        approaching = self.count < self._approach
        held = self.speed if approaching else self._held_velocity()
        reaction = self.ground.step(self.position, (0.0, 0.0, -held), self.macro_step)
        force = float(reaction.force[2])
        before = self.depth
        self.count += 1
        # Counted down to the surface, so that the approach ends at depth 0 exactly.
        steps_left = self._approach - self.count
        self.depth = -steps_left * self.speed * self.macro_step if approaching else before + held * self.macro_step
        middle = 0.5 * (before + self.depth)
        self._rows.append((self.time - 0.5 * self.macro_step, middle, held, force))
        self._phases.append(FREE if middle <= 0 else IN if held > 0 else OUT if held < 0 else REST)
        if not approaching:
            self._after(held, force)
        elif self.lets_go_at_touch and force > 0 and steps_left > 0:
            sooner = steps_left * self.macro_step
            self._rows = [(when + sooner, depth, rate, push) for when, depth, rate, push in self._rows]
            self._approach = self.count
            self._after(held, force)
        if not self.done and self.time >= self.max_time - 0.5 * self.macro_step:
            self.ended = "max_time"

    def run(self, **reporting: Unpack[Reporting]) -> Penetration:
        """Go on to the end, with the reports of `Stepper.follow`."""
        self.follow(**reporting)
        return self.result()

    def result(self) -> Penetration:
        """The rows so far."""
        rows = np.array(self._rows, dtype=float).reshape(-1, 4)
        phases = np.array(PHASES)[np.array(self._phases, dtype=int)]
        time, depth, velocity, force = (column.copy() for column in rows.T)
        return Penetration(
            kind=self.kind, time=time, depth=depth, velocity=velocity, force=force, phase=phases,
            macro_step=self.macro_step, ended=self.ended or "unfinished", settings=self.settings(),
        )  # fmt: skip

    def settings(self) -> Facts:
        """What was asked for, SI units."""
        return {
            "ground": self.ground.name,
            "speed": self.speed,
            "start_depth": self._start,
            "substeps": round(self.macro_step / self.ground.time_step),
            "spike": asdict(self.spike),
            "ground_settings": self.ground.describe() if isinstance(self.ground, Described) else {},
        }

    def state(self) -> State:
        """All that the rest of the run depends on: a flat dict of numpy arrays, the ground's under "ground.*"."""
        own = {
            "kind": np.array(self.kind),
            "numbers": np.array([self.depth, self.velocity, *self._memory()], dtype=float),
            "counts": np.array([self.count, self._approach, self._frames], dtype=np.int64),
            "ended": np.array(self.ended),
            "rows": np.array(self._rows, dtype=float).reshape(-1, 4),
            "phases": np.array(self._phases, dtype=np.int8),
        }
        return prefixed("run", own) | prefixed("ground", self.ground.state())

    def restore(self, state: State) -> None:
        """Go back to what `state` gave. Raises ValueError for the state of another kind of run."""
        own = part_of(state, "run")
        if str(own["kind"]) != self.kind:
            raise ValueError(f"the state is of a {own['kind']} run, this one is {self.kind}")
        self.depth, self.velocity, *memory = (float(number) for number in own["numbers"])
        self.count, self._approach, self._frames = (int(number) for number in own["counts"])
        self._recall(memory)
        self.ended = str(own["ended"])
        self._rows = [tuple(row) for row in np.asarray(own["rows"]).tolist()]
        self._phases = [int(code) for code in own["phases"]]
        self.ground.restore(part_of(state, "ground"))

    def _held_velocity(self) -> float:
        """Velocity of the step to come [m/s]."""
        raise NotImplementedError

    def _after(self, held: float, force: float) -> None:
        """Take in what the step did: new velocity, the end."""
        raise NotImplementedError

    def _memory(self) -> list[float]:
        return []

    def _recall(self, memory: list[float]) -> None:
        pass

    def _last(self, seconds: float) -> np.ndarray | None:
        """Rows of the last `seconds` [s], shape [n, 4]; None while fewer have passed since the surface."""
        count = self._row_count(seconds)
        return np.array(self._rows[-count:]) if self.count - self._approach >= count else None

    def _row_count(self, seconds: float) -> int:
        """Rows in which that time passes, at least two."""
        return max(2, round(seconds / self.macro_step))


class Drive(Run):
    """Straight down at `speed` to `depth`, held for `hold`, and pulled out at `retreat_speed` up to the surface."""

    kind = "driven"

    def __init__(
        self,
        spike: Spike,
        ground: Any,
        *,
        speed: float,
        depth: float,
        hold: float = 0.02,
        retreat: bool = True,
        retreat_speed: float | None = None,
        **common: Any,
    ) -> None:
        self.target, self.hold = float(depth), float(hold)
        self.retreat_speed = float(retreat_speed if retreat_speed is not None else speed)
        check_above_zero("in m", depth=self.target)
        check_not_negative("in s", hold=self.hold)
        check_above_zero("in m/s", retreat_speed=self.retreat_speed)
        back = self.target / self.retreat_speed if retreat else 0.0
        total = self.target / max(float(speed), 1e-9) + self.hold + back
        super().__init__(spike, ground, speed=speed, max_time=max(2 * total, 1e-9), **common)
        if self.target > self.ground.depth_limit:
            raise ValueError(
                f"depth is {depth}: this ground takes the spike down to {self.ground.depth_limit:.4g} m at most"
            )
        self._retreat = retreat
        reach = self.target / self.macro_step
        self._in = max(1, math.ceil(reach / self.speed - 1e-9))
        self._hold = round(self.hold / self.macro_step)
        self._out = max(1, math.ceil(reach / self.retreat_speed - 1e-9)) if retreat else 0

    @property
    def fraction(self) -> float:
        """Fraction of its macro steps that are done, 0 to 1."""
        whole = self._approach + self._in + self._hold + self._out
        return 1.0 if self.done else self.count / whole

    @property
    def at_bottom(self) -> bool:
        """Whether the last step ended the loading."""
        return self.count - self._approach == self._in

    def settings(self) -> Facts:
        """What was asked for, SI units."""
        return super().settings() | {
            "depth": self.target, "hold": self.hold, "retreat": self._retreat, "retreat_speed": self.retreat_speed
        }  # fmt: skip

    def _held_velocity(self) -> float:
        done = self.count - self._approach
        if done < self._in:  # the last step of each way ends where it was to end
            return self.speed if done < self._in - 1 else (self.target - self.depth) / self.macro_step
        if done < self._in + self._hold:
            return 0.0
        left = self._in + self._hold + self._out - done
        return -self.retreat_speed if left > 1 else -self.depth / self.macro_step

    def _after(self, held: float, force: float) -> None:
        self.velocity = held
        if self.count - self._approach >= self._in + self._hold + self._out:
            self.ended = "done"


class Drop(Run):
    """Let go at the surface with `speed` downwards, under the constant `load`, until it has come to rest.

    A bed of soft grains lets a spike that has stopped bob for long: the run ends `after_stop` [s] after the first stop
    where that comes sooner. It rests when two conditions held over the last `rest_time`: the depth within
    `rest_tolerance` of the largest depth, and the mean force within 5 % of the load. The rows of that time get the
    phase "rest".
    """

    kind = "drop"

    def __init__(
        self,
        spike: Spike,
        ground: Any,
        *,
        speed: float,
        mass: float | None = None,
        load: float | None = None,
        gravity: float = 9.80665,
        rest_time: float = 0.04,
        rest_tolerance: float = 0.005,
        after_stop: float = math.inf,
        max_depth: float | None = None,
        **common: Any,
    ) -> None:
        self.mass = float(spike.mass if mass is None else mass)
        self.load = float(self.mass * gravity if load is None else load)
        check_above_zero(mass=self.mass, load=self.load)
        super().__init__(spike, ground, speed=speed, **common)
        self.rest_time, self.rest_tolerance = float(rest_time), float(rest_tolerance)
        limit = self.ground.depth_limit
        self.max_depth = limit if max_depth is None else min(limit, float(max_depth))
        self.after_stop = float(after_stop)
        self._force = 0.0
        self._stopped_at = math.inf
        self._at_rest: LastRows | None = None  # Not of its state: made anew from the rows

    @property
    def at_bottom(self) -> bool:
        """Whether the spike first stopped in the step just done."""
        return self._stopped_at == self.time

    def settings(self) -> Facts:
        """What was asked for, SI units."""
        return super().settings() | {
            "mass": self.mass, "load": self.load, "rest_time": self.rest_time, "rest_tolerance": self.rest_tolerance,
            "after_stop": self.after_stop if math.isfinite(self.after_stop) else None, "max_time": self.max_time,
        }  # fmt: skip

    def _held_velocity(self) -> float:
        return self.velocity + 0.5 * self.macro_step * (self.load - self._force) / self.mass

    def _after(self, held: float, force: float) -> None:
        self.velocity += self.macro_step * (self.load - force) / self.mass
        self._force = force
        if self.velocity <= 0:
            self._stopped_at = min(self._stopped_at, self.time)
        if self.depth > self.max_depth:
            self.ended = "max_depth"
        elif self._may_rest() and (last := self._last(self.rest_time)) is not None and self._rests(last):
            self.ended = "rest"
            self._phases[-len(last) :] = [REST] * len(last)
        elif self.time - self._stopped_at >= self.after_stop:
            self.ended = "stopped"

    def _followed(self) -> LastRows:
        """The rows of the last `rest_time`."""
        count = self._row_count(self.rest_time)
        if self._at_rest is None or not self._at_rest.is_of(self._rows, count):
            self._at_rest = LastRows(self._rows, count, bounded=1, summed=(2, 3))
        self._at_rest.follow()
        return self._at_rest

    def _may_rest(self) -> bool:
        """False where `_rests` would be, at the cost of one row."""
        last = self._followed()
        least, most = last.extremes
        still = most - least <= self.rest_tolerance * max(self.depth, most)
        return still and last.may_be(3, self.load, 0.05 * self.load)

    def _rests(self, last: np.ndarray) -> bool:
        deepest = max(self.depth, float(last[:, 1].max()))
        still = float(np.ptp(last[:, 1])) <= self.rest_tolerance * deepest
        return still and abs(float(last[:, 3].mean()) - self.load) <= 0.05 * self.load

    def _memory(self) -> list[float]:
        return [self._force, self._stopped_at]

    def _recall(self, memory: list[float]) -> None:
        self._force, self._stopped_at = memory


class SetDown(Drop):
    """Placed against a drag: m dv/dt = W - F - c v with c = W / lowering_speed.

    The placement begins where the spike first touches, which grains that stick out of a bed make sooner than depth 0:
    time counts from there. Free of the ground it sinks at `lowering_speed`; the drag carries the rest of the load. So
    the ground's force rises to the load from below, and the spike comes to rest where the bed first carries it. `mass`
    is by default c times 2 ms. That is so light that the motion is overdamped on any ground softer than W / (8 ms
    lowering_speed) (`overdamped_below`), and cannot overshoot. It ends when two means over the last `rest_time` are
    met: a speed below 0.3 % of the lowering speed, and a force within 0.3 % of the load. On a spring the sinkage is too
    small by the missing force, 0.3 % at most.
    """

    kind = "set_down"
    lets_go_at_touch = True

    def __init__(
        self,
        spike: Spike,
        ground: Any,
        *,
        load: float,
        lowering_speed: float = 0.03,
        mass: float | None = None,
        **common: Any,
    ) -> None:
        check_above_zero("in m/s", lowering_speed=lowering_speed)
        self.drag = float(load) / lowering_speed  # c [N s/m]
        mass = self.drag * PLACEMENT_TIME if mass is None else mass
        super().__init__(spike, ground, speed=lowering_speed, mass=mass, load=load, **common)

    @property
    def at_bottom(self) -> bool:
        """Always False: a spike set down is deepest at the end of the run."""
        return False

    def settings(self) -> Facts:
        """What was asked for, SI units."""
        return super().settings() | {"lowering_speed": self.speed}

    def _held_velocity(self) -> float:
        half = 0.5 * self.macro_step
        # The drag is taken implicitly, so that a light spike stays stable at any step.
        return (self.mass * self.velocity + half * (self.load - self._force)) / (self.mass + half * self.drag)

    def _after(self, held: float, force: float) -> None:
        before = self.velocity
        super()._after(held, force)
        step = self.macro_step
        self.velocity = (self.mass * before + step * (self.load - force)) / (self.mass + step * self.drag)

    def _may_rest(self) -> bool:
        last = self._followed()
        return last.may_be(2, 0.0, AT_REST * self.speed) and last.may_be(3, self.load, AT_REST * self.load)

    def _rests(self, last: np.ndarray) -> bool:
        slow = abs(float(last[:, 2].mean())) <= AT_REST * self.speed
        return slow and abs(float(last[:, 3].mean()) - self.load) <= AT_REST * self.load


def overdamped_below(load: float, lowering_speed: float) -> float:
    """Stiffness of a ground [N/m] up to which a spike set down by default is damped beyond critical."""
    return load / (4 * PLACEMENT_TIME * lowering_speed)


def drive(spike: Spike, *, into: Any, speed: float, depth: float, **options: Any) -> Penetration:
    """Drive `spike` straight down `into` a ground (or a bed) at `speed` [m/s] to `depth` [m], hold it, pull it out.

    Options: hold [s] (0.02); retreat (True); retreat_speed [m/s] (as speed); substeps of the ground in a macro step
    (10); start_depth [m, negative] (just clear of the grains). `on_step`, `on_frame`, `frame_interval` and `progress`
    are those of `Stepper.follow`. Raises ValueError, naming key and value, for what cannot be, and what the ground
    raises.

    On the spring-damper, the force is K z + C v while the spike goes in:

    >>> from rigid import SpringDamper
    >>> run = drive(Spike(), into=SpringDamper(stiffness=1875, damping=7.5), speed=0.1, depth=0.01)
    >>> print(f"{run.force.max():.1f} N at most; {1e3 * run.work_in:.1f} mJ in, {1e3 * run.work_out:.1f} mJ recovered")
    19.4 N at most; 101.3 mJ in, 93.8 mJ recovered
    """
    return _done(Drive, spike, into, speed=speed, depth=depth, **options)


def drop(spike: Spike, *, into: Any, speed: float, **options: Any) -> Penetration:
    """Drop `spike` `into` a ground (or a bed): at the surface it has `speed` [m/s], and then it is free.

    Options: mass [kg] (the spike's), load [N] (mass * gravity), gravity [m/s2] (9.80665), rest_time [s], rest_tolerance
    [1], max_depth [m] and max_time [s]. Further options are those of `drive` that do not concern the withdrawal.

    >>> from rigid import SpringDamper
    >>> run = drop(Spike(mass=0.5), into=SpringDamper(stiffness=1875, damping=7.5), speed=0.1)
    >>> print(f"{1e3 * run.depth.max():.1f} mm at the deepest, {1e3 * run.depth[-1]:.1f} mm at rest")
    4.7 mm at the deepest, 2.6 mm at rest
    """
    return _done(Drop, spike, into, speed=speed, **options)


def set_down(spike: Spike, *, onto: Any, load: float, **options: Any) -> Penetration:
    """Place `spike` `onto` a ground (or a bed) under `load` [N], slowed by a drag, to the resting sinkage.

    Options: lowering_speed [m/s] (0.03), mass [kg] that counts during placement, and those of `drop`.

    >>> from rigid import SpringDamper
    >>> run = set_down(Spike(), onto=SpringDamper(stiffness=1875, damping=7.5), load=0.5)
    >>> print(f"{1e3 * run.depth[-1]:.2f} mm")  # load / K = 0.27 mm
    0.27 mm
    """
    return _done(SetDown, spike, onto, load=load, **options)


def _done(kind: type[Run], spike: Spike, ground: Any, **options: Any) -> Penetration:
    reporting = {key: options.pop(key) for key in Reporting.__annotations__ if key in options}
    return kind(spike, ground, **options).run(**reporting)
