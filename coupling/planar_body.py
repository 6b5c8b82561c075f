"""The platform of the planar model as a body that a ground pushes: three coordinates, a flywheel, and the rig.

Coordinates and signs are the planar model's (docs/planar.md): x along the surface, z up from it (the model's y), theta
about +y, clockwise. The inertia in z is m + m_b where there is a rig, in x it is m; the weight is (m + m_b) g_sim.

A macro step of length H from the velocity v, s the ground's lag (0 for a law, its own step for a bed):

    u  = v + (H - s) / 2 M^-1 (G + F_guess)      held during the step: a guess at the velocity of its middle
    q' = q + H u
    v' = v + H M^-1 (G + F)                      F: the mean force of the step just done

v belongs to a time s / 2 later than q. Where the ground gives Coulomb bounds, sticking rows share the horizontal force
in proportion to their loads. Their mean slip is zero at the step's end; beyond mu_s N they slide with mu_d N until the
slip passes through zero. Events of friction are found to the step, so they are of first order in H.
"""

import math

import numpy as np
from numpy.typing import NDArray

from hedgebed_renamed import renamed
from rigid.ground.reaction import Contact, Reaction, State
from rigid.model.model import State as MotionState
from rigid.model.trial import Trial
from rigid.terms import EFFECTS, STATE_FIELDS

from .poses import Pose, Twist, Vector, Wrench

__all__ = ["PLACEMENT_STEP", "PLACEMENT_TIME", "PlanarBody", "placement_time"]

PLACEMENT_TIME = 0.002  # Mass over drag of a body during placement [s]
PLACEMENT_STEP = 4e-4  # Macro step up to which that mass is stable [s]; beyond, mass goes with its square
_OPEN = 9  # Mode of a row that does not touch


class PlacedBody:
    """What bodies share: the old names of their placement, and the checks and states of their steps."""

    take_in_hand, let_go = renamed("take_in_hand", "begin_placement"), renamed("let_go", "release")
    hold_more_firmly = renamed("hold_more_firmly", "slow_placement")
    held_by_hand = renamed("held_by_hand", "in_placement")
    _next_touching = False
    _ARRAYS: tuple[str, ...]  # Attributes in a state's vector of numbers, in its order: arrays,
    _NUMBERS: tuple[str, ...]  # then numbers, of which
    _FLAGS = ("touching", "in_placement")  # are true or false

    @staticmethod
    def _spare(dt: float, lag: float) -> float:
        """Half of what of a step `dt` is beyond the ground's lag [s]. Raises ValueError for a shorter step."""
        if lag > dt * (1 + 1e-9):
            raise ValueError(f"dt = {dt} s is shorter than the ground's own step of {lag} s")
        return 0.5 * max(dt - lag, 0.0)

    def _numbers(self) -> Vector:
        numbers = [float(getattr(self, name)) for name in self._NUMBERS]
        return np.concatenate([*(getattr(self, name) for name in self._ARRAYS), numbers])

    def _restore_numbers(self, numbers: Vector) -> None:
        ends = np.cumsum([getattr(self, name).size for name in self._ARRAYS])
        *arrays, rest = np.split(np.asarray(numbers, dtype=float), ends)
        for name, array in zip(self._ARRAYS, arrays, strict=True):
            setattr(self, name, array.copy())
        for name, number in zip(self._NUMBERS, rest, strict=True):
            setattr(self, name, bool(number) if name in self._FLAGS else float(number))


class PlanarBody(PlacedBody):
    """The platform of `trial`, at rest at (`x`, `z`) [m] and `theta` [rad]; a `coupling.Body`.

    Raises ValueError for a trial with effects on anything but the torque: the master has the base model only.
    """

    _ARRAYS = ("place", "rates", "acceleration", "inertia", "_drag")
    _NUMBERS = ("wheel_speed", "time", "torque_work", "touching", "in_placement", "_at_limit")

    def __init__(self, trial: Trial, *, z: float, x: float = 0.0, theta: float = 0.0) -> None:
        other = [effect.id for effect in trial.effects if not effect.term.on_torque_alone]
        if other:
            raise ValueError(
                f"effects = {', '.join(other)}: on grains there is the base model with effects on the torque alone "
                f"({', '.join(id for id, term in EFFECTS.items() if term.on_torque_alone)}); leave the others out"
            )
        self.trial = trial
        self.place = np.array([x, z, theta], dtype=float)  # x, z [m], theta [rad]
        self.rates = np.zeros(3)  # Their rates, at a time lag / 2 later
        self.wheel_speed = trial.wheel_speed_0
        self.time = 0.0
        self.torque_work = 0.0  # Work of the torque since its release [J]
        self.max_wheel_speed = math.inf
        self._at_limit = math.nan
        self.modes: NDArray[np.int8] = np.full(trial.spike_count, _OPEN, dtype=np.int8)
        """Of each row under a Coulomb bound: 0 sticks, +1 and -1 slides towards +x and -x, 9 does not touch."""
        self.touching = False  # Whether anything touched in the last step, which is when the torque acts
        self._free()

    def _free(self) -> None:
        trial = self.trial
        self.inertia = np.array([trial.mass, trial.mass + trial.counterweight, trial.inertia])
        self._drag = np.zeros(3)
        self.in_placement = False

    @property
    def wheel_at_limit(self) -> float | None:
        """When a motor's wheel came to `max_wheel_speed` [s], counted as `time`; None if it has not."""
        return None if math.isnan(self._at_limit) else self._at_limit

    @wheel_at_limit.setter
    def wheel_at_limit(self, time: float | None) -> None:
        self._at_limit = math.nan if time is None else time

    def begin_placement(self, lowering_speed: float, *, pace: float = 1.0, step: float = 0.0) -> None:
        """It is lowered from here on: c = W / lowering_speed [m/s] resists, and its mass is 2 ms c.

        The same in all directions, and about the axis with l^2: it sinks until the ground carries it, and cannot bounce
        on a ground softer than W / (8 ms lowering_speed). The torque waits. `pace` times 2 ms where all is slower; more
        where `step`, the macro step [s], is long (`placement_time`).
        """
        scale = np.array([1.0, 1.0, self.trial.spike_length**2])
        drag = self.trial.weight / lowering_speed
        self.inertia, self._drag = placement_time(step, pace) * drag * scale, drag * scale
        self.in_placement = True

    def slow_placement(self, factor: float) -> None:
        """Drag and mass of the placement times `factor`: slower by that, and as little apt to bounce."""
        self.inertia, self._drag = factor * self.inertia, factor * self._drag

    def release(self) -> None:
        """The placement ends: at rest from here, its time is 0 and the torque begins."""
        self._free()
        self.rates = np.zeros(3)
        self.time = self.torque_work = 0.0

    def lift(self, height: float) -> None:
        """Put it higher by this [m]."""
        self.place[1] += height

    def start(self, rates: Vector, lag: float) -> None:
        """Free of contact, with `rates` at the time of its pose: brought to their own time."""
        self.acceleration = np.array([0.0, -self.trial.weight, 0.0]) / self.inertia
        self.rates = rates + 0.5 * lag * self.acceleration

    @property
    def pose(self) -> Pose:
        """Where it is; y is 0."""
        x, z, theta = self.place
        return Pose(np.array([x, 0.0, z]), np.array([math.cos(0.5 * theta), 0.0, math.sin(0.5 * theta), 0.0]))

    def predict(self, dt: float, guess: Wrench, lag: float) -> Twist:
        """The twist to hold over the next `dt` [s], under the guess at the ground's wrench, whose lag is `lag` [s]."""
        half = self._spare(dt, lag)
        self._torque = self._mean_torque(dt)
        push = self._applied() + _generalised(guess)
        held = (self.inertia * self.rates + half * push) / (self.inertia + half * self._drag)
        return _twist(held)

    def resolve(self, dt: float, twist: Twist, reaction: Reaction) -> Wrench:
        """The ground's whole wrench: `reaction` over `dt` [s] plus the friction that its Coulomb bounds allow."""
        bounded = {row: contact for row, contact in reaction.by_member.items() if contact.tangential_force is None}
        self._next_modes = np.full(len(self.modes), _OPEN, dtype=np.int8)
        self._next_touching = bool(reaction.contacts)
        if not bounded:
            return Wrench.of(reaction)
        force = _Friction(self, dt, twist, Wrench.of(reaction), bounded).solve(self._next_modes)
        return Wrench(reaction.force + force[0], reaction.torque + force[1])

    def advance(self, dt: float, twist: Twist, wrench: Wrench) -> None:
        """Make the step of `dt` [s]: move along `twist`, with the impulse of `wrench`."""
        held = np.array([twist.velocity[0], twist.velocity[2], twist.spin[1]])
        push = self._applied() + _generalised(wrench)
        self.place = self.place + dt * held
        self.rates = (self.inertia * self.rates + dt * push) / (self.inertia + dt * self._drag)
        self.acceleration = push / self.inertia
        self.torque_work += self._torque * held[2] * dt
        if self.wheel_at_limit is None and self._until_limit <= dt:
            self.wheel_at_limit = self.time + max(0.0, self._until_limit)
        sign = 1.0 if self.trial.actuator == "motor" else -1.0
        self.wheel_speed += sign * self._torque * dt / self.trial.wheel_inertia
        self.modes, self.touching = self._next_modes, self._next_touching
        self.time += dt

    def __repr__(self) -> str:
        x, z, theta = self.place
        return f"PlanarBody({self.trial.mass:g} kg at x = {x:.4g} m, z = {z:.4g} m, theta = {theta:.4g} rad)"

    @property
    def twist(self) -> Twist:
        """`rates` in space."""
        return _twist(self.rates)

    def twist_now(self, lag: float) -> Twist:
        """`rates_now` in space."""
        return _twist(self.rates_now(lag))

    def rates_now(self, lag: float) -> Vector:
        """Rates of x, z and theta at the time of the pose, shape (3,)."""
        return self.rates - 0.5 * lag * self.acceleration

    @property
    def masses(self) -> Vector:
        """Along x, y and z [kg], shape (3,); those of its placement while that lasts."""
        return self.inertia[[0, 0, 1]]

    @property
    def momentum(self) -> Vector:
        """Of platform and counterweight, at the time of the rates [N s], shape (3,)."""
        along, up = self.inertia[:2] * self.rates[:2]
        return np.array([along, 0.0, up])

    def kinetic_energy(self, lag: float) -> float:
        """Of platform and counterweight [J], without the wheel's spin."""
        now = self.rates_now(lag)
        return float(0.5 * (self.inertia * now) @ now)

    @property
    def potential_energy(self) -> float:
        """(m + m_b) g_sim z [J]."""
        return self.trial.weight * float(self.place[1])

    def state(self) -> State:
        """All that its next steps depend on."""
        return {"numbers": self._numbers(), "modes": self.modes.copy()}

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        self._restore_numbers(state["numbers"])
        self.modes = np.array(state["modes"], dtype=np.int8)

    acceleration: Vector = np.zeros(3)  # Of x, z and theta, the mean of the last step
    _torque = 0.0
    _until_limit = math.inf  # From the start of this step until a motor's wheel is at its limit [s]
    _next_modes: NDArray[np.int8] = np.zeros(0, dtype=np.int8)

    def _applied(self) -> Vector:
        return np.array([0.0, -self.trial.weight, self._torque])

    def _torque_factor(self, dt: float) -> float:
        """What the trial's effects make of the torque [1] in the middle of the next step of `dt` [s]."""
        state, factor, sign = MotionState(), 1.0, 1.0 if self.trial.actuator == "motor" else -1.0
        for name in STATE_FIELDS:
            setattr(state, name, 0.0)
        state.torque = self.trial.torque
        state.x, state.y, state.theta = (float(value) for value in self.place)
        state.vx, state.vy, state.omega = (float(value) for value in self.rates)
        for half in (0.0, 0.5 * dt):  # at the start first, for the wheel's speed in the middle
            state.time = self.time + half
            state.wheel_speed = self.wheel_speed + sign * half * factor * self.trial.torque / self.trial.wheel_inertia
            factor = 1.0
            for effect in self.trial.effects:
                own = [effect.values[name] for name in effect.term.arguments("torque_factor")]
                factor *= effect.term.hooks["torque_factor"](state, *own)
        return factor

    def _mean_torque(self, dt: float) -> float:
        """Mean torque of the next step [N m]: it acts while anything touches, until its end or the wheel's."""
        trial = self.trial
        self._until_limit = math.inf
        if self.in_placement or not self.touching or trial.torque == 0:
            return 0.0
        torque = trial.torque
        if trial.effects:
            torque *= self._torque_factor(dt)
            if torque == 0:
                return 0.0
        left = trial.torque_until - self.time
        room = self.wheel_speed if trial.actuator == "brake" else self.max_wheel_speed - self.wheel_speed
        until = room * trial.wheel_inertia / torque
        if trial.actuator == "motor" and until <= left:
            self._until_limit = until
        left = min(left, until)
        return torque * min(1.0, max(0.0, left / dt))


def placement_time(step: float, pace: float = 1.0) -> float:
    """Mass over drag of a body during placement [s]. Forces are exchanged every `step` [s], and all is `pace` times
    slower than at 1 g."""
    return pace * PLACEMENT_TIME * max(1.0, step / (pace * PLACEMENT_STEP)) ** 2


class _Friction:
    """The friction of rows under Coulomb bounds in one step."""

    def __init__(self, body: PlanarBody, dt: float, twist: Twist, wrench: Wrench, contacts: dict[int, Contact]) -> None:
        self.body, self.dt = body, dt
        self.rows = sorted(contacts)
        self.loads = np.array([contacts[row].normal_force for row in self.rows])
        self.mu_s = np.array([float(contacts[row].mu_s or 0.0) for row in self.rows])
        self.mu_d = np.array([float(contacts[row].mu_d or 0.0) for row in self.rows])
        centre = body.pose.position + 0.5 * dt * twist.velocity
        arms = np.array([contacts[row].point - centre for row in self.rows])
        half = 0.5 * dt * float(twist.spin[1])
        self.h = -arms[:, 2]  # How far below the centre each touches at the step's middle [m]; at its end:
        self.h_end = -(arms[:, 2] * math.cos(half) - arms[:, 0] * math.sin(half))
        self.push = body._applied() + _generalised(wrench)
        self.weight = body.inertia + dt * body._drag

    def solve(self, modes: NDArray[np.int8]) -> tuple[Vector, Vector]:
        """Force [N] and torque [N m] of friction; writes the rows' modes into `modes`."""
        rates = self.body.rates
        slips = rates[0] - rates[2] * self.h
        now = np.array([self.body.modes[row] for row in self.rows])
        now = np.where(now == _OPEN, np.sign(slips), now).astype(int)
        for _ in range(4 * len(self.rows) + 4):
            sticks = now == 0
            force, after = self._with(now, sticks)
            beyond = sticks & (abs(force.sum(where=sticks)) > (self.mu_s * self.loads).sum(where=sticks))
            slip = after[0] - after[2] * self.h_end
            caught = ~sticks & (slip * now < 0)
            if not beyond.any() and not caught.any():
                break
            now = np.where(beyond, -np.sign(force.sum(where=sticks)), np.where(caught, 0, now)).astype(int)
        modes[self.rows] = now
        return np.array([force.sum(), 0.0, 0.0]), np.array([0.0, -float(force @ self.h), 0.0])

    def _with(self, now: NDArray[np.int64], sticks: NDArray[np.bool_]) -> tuple[Vector, Vector]:
        """Friction of each row [N] and the rates at the end, with these modes."""
        body, dt = self.body, self.dt
        force = np.where(sticks, 0.0, -now * self.mu_d * self.loads)
        push = self.push + np.array([force.sum(), 0.0, -float(force @ self.h)])
        after = (body.inertia * body.rates + dt * push) / self.weight
        if sticks.any():
            total = self.loads.sum(where=sticks)
            share = np.where(sticks, self.loads, 0.0) / total if total > 0 else sticks / sticks.sum()
            mean, mean_end = float(share @ self.h), float(share @ self.h_end)
            answer = dt / self.weight * np.array([1.0, 0.0, -mean])
            held = -(after[0] - mean_end * after[2]) / (answer[0] - mean_end * answer[2])
            after = after + held * answer
            force = force + held * share
        return force, after


def _generalised(wrench: Wrench) -> Vector:
    return np.array([wrench.force[0], wrench.force[2], wrench.torque[1]])


def _twist(rates: Vector) -> Twist:
    return Twist(np.array([rates[0], 0.0, rates[1]]), np.array([0.0, rates[2], 0.0]))
