"""A platform with six degrees of freedom and up to three flywheels as a body that a ground pushes.

World axes, z up from the undisturbed surface; the origin is the centre of mass. A step changes momentum P and angular
momentum L about it (platform and wheels); I omega = L - sum h_i a_i, as in `rigid.spatial.motion`. A macro step of
length H, s the ground's lag (0 for a law, its own step for a bed):

    u, w  of  P + (H - s) / 2 (W + F_guess),  L + (H - s) / 2 T_guess,  turned half way     held during the step
    r' = r + H u,   q' = exp(H w) q
    P' = P + H (W + F),   L' = L + H T,   h_i' = h_i - H tau_i

P and L belong to a time s / 2 later than r and q. Under a Coulomb bound the sticking tips share the holding force in
proportion to their loads, f_k = N_k (c + b z x (rho_k - mean rho)). So at the step's end their mean slip and their
turning about the vertical are zero. A tip beyond mu_s N_k slides with mu_d N_k until its slip turns back
(docs/platform.md). Events of friction are of first order in H.
"""

import math
from collections.abc import Sequence

import numpy as np

from rigid.ground.reaction import Contact, Reaction, State
from rigid.spatial.quaternions import from_turn, multiply, to_matrix
from rigid.spatial.spatial import SpatialTrial

from .contact_state import StickSlip
from .planar_body import PlacedBody, placement_time
from .poses import Pose, Twist, Vector, Wrench, moved

__all__ = ["SpatialBody"]

_ROUNDS = 20  # Iterations for the spin of a step's middle: each leaves H |w| of the error


class SpatialBody(PlacedBody):
    """The platform of `trial` at `position` [m] with the turn `quaternion`; a `coupling.Body`.

    Of the trial, the ground is not used.

    Parameters
    ----------
    trial : rigid.SpatialTrial; torques act as it says, from t = 0, while anything touches (`torque_in_flight`: always).
    position : of the centre of mass [m], z from the undisturbed surface.
    quaternion : unit, scalar first, body to world.
    velocity, angular_velocity : [m/s], [rad/s], world axes.

    Raises ValueError, naming the key, for what is not finite or no unit quaternion.
    """

    _ARRAYS = (
        "place", "turn", "momentum", "angular_momentum", "wheels", "_force", "_moment", "_torques", "_masses", "_drag",
    )  # fmt: skip
    _NUMBERS = ("time", "torque_work", "_lag", "touching", "in_placement")

    def __init__(
        self,
        trial: SpatialTrial,
        *,
        position: Sequence[float],
        quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        velocity: Sequence[float] = (0.0, 0.0, 0.0),
        angular_velocity: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        given = {"position": position, "velocity": velocity, "angular_velocity": angular_velocity}
        for key, value in given.items():
            if np.shape(value) != (3,) or not np.isfinite(np.asarray(value, dtype=float)).all():
                raise ValueError(f"{key} is {value}: it must be three finite numbers")
        turn = np.asarray(quaternion, dtype=float)
        if turn.shape != (4,) or not abs(float(np.linalg.norm(turn)) - 1.0) < 1e-6:
            raise ValueError(f"quaternion is {quaternion}: it must be four numbers of length 1")
        self.trial = trial
        platform = trial.platform
        self.place = np.array(position, dtype=float)  # Of the centre of mass [m], shape (3,)
        self.turn = turn / float(np.linalg.norm(turn))  # Unit quaternion, shape (4,)
        self.axes = np.zeros((3, 3))
        for k, wheel in enumerate(platform.wheels):
            self.axes[k] = wheel.axis
        self.wheels = np.array([history.spin if history is not None else 0.0 for history in trial.histories])
        """Angular momentum of each wheel along its axis [N m s], shape (3,)."""
        self.time = 0.0
        self.torque_work = 0.0  # Work of the torques since its release [J]
        self.touching = False  # Whether anything touched in the last step
        self.sliding: dict[int, Vector] = {}
        """Tip under a Coulomb bound that slides -> the unit vector of its slip, shape (2,)."""
        self.sticking: frozenset[int] = frozenset()  # Those that stick
        self._free()
        self.momentum = self._masses * np.asarray(velocity, dtype=float)
        """(m v_x, m v_y, (m + m_b) v_z) [N s], shape (3,)."""
        self.angular_momentum = self._spin_to_momentum(np.asarray(angular_velocity, dtype=float))
        """Of platform and wheels about the centre of mass [N m s], shape (3,)."""

    def _free(self) -> None:
        platform = self.trial.platform
        self._masses = np.array([1.0, 1.0, 1.0]) * platform.mass + (0.0, 0.0, self.trial.counterweight)
        self._inertia = np.array(platform.inertia)
        self._drag = np.zeros(2)
        self.in_placement = False

    def begin_placement(self, lowering_speed: float, *, pace: float = 1.0, step: float = 0.0) -> None:
        """It is lowered from here on at `lowering_speed` [m/s], as with `PlanarBody.begin_placement`. Torques wait."""
        weight, reach = float(np.linalg.norm(self.trial.weight)), self.trial.platform.reach
        drag = weight / lowering_speed
        velocity, spin = self.twist.velocity, self.twist.spin
        time = placement_time(step, pace)
        self._masses, self._inertia = time * drag * np.ones(3), time * drag * reach**2 * np.eye(3)
        self._drag = np.array([drag, drag * reach**2])
        self.in_placement = True
        self.momentum, self.angular_momentum = self._masses * velocity, self._spin_to_momentum(spin)

    def slow_placement(self, factor: float) -> None:
        """Multiply drag and mass of the placement by `factor` [1], as `PlanarBody.slow_placement`."""
        wheels = self._wheels_at(self.wheels, self.turn)
        self._masses, self._inertia, self._drag = (factor * held for held in (self._masses, self._inertia, self._drag))
        self.momentum = factor * self.momentum
        self.angular_momentum = wheels + factor * (self.angular_momentum - wheels)

    def release(self) -> None:
        """The placement ends: at rest from here, its time is 0 and the torques begin."""
        self._free()
        self.momentum, self.angular_momentum = np.zeros(3), self._spin_to_momentum(np.zeros(3))
        self._force, self._moment = np.zeros(3), np.zeros(3)
        self.time = self.torque_work = 0.0

    def lift(self, height: float) -> None:
        """Raise it by `height` [m]."""
        self.place[2] += height

    def start(self, lag: float) -> None:
        """Free of contact, its velocity given for the time of its pose: the momentum is brought to its own time."""
        self._lag, self._force = lag, self.trial.weight.copy()
        self.momentum = self.momentum + 0.5 * lag * self._force

    @property
    def masses(self) -> Vector:
        """(m, m, m + m_b) [kg], shape (3,); those of its placement while that lasts."""
        return self._masses

    @property
    def pose(self) -> Pose:
        """Position of the centre of mass [m] and orientation."""
        return Pose(self.place, self.turn)

    def predict(self, dt: float, guess: Wrench, lag: float) -> Twist:
        """The twist to hold over the next `dt` [s], under the guess at the ground's wrench, whose lag is `lag` [s]."""
        self._lag, half = lag, self._spare(dt, lag)
        self._torques = self._mean_torques(dt)
        drag = self._drag
        momentum = (self.momentum + half * (self.trial.weight + guess.force)) / (1 + half * drag[0] / self._masses)
        about = self.angular_momentum + half * guess.torque
        wheels = self.wheels - half * self._torques
        spin = self._spin_of(about, wheels, self.turn)
        for _ in range(_ROUNDS):
            middle = moved(self.pose, Twist(np.zeros(3), spin), 0.5 * dt).turn
            found = self._spin_of(about, wheels, middle) / (1 + half * drag[1] / self._inertia[0, 0])
            done = bool(np.abs(found - spin).max() <= 4e-16 * np.abs(found).max())
            spin = found
            if done:
                break
        return Twist(momentum / self._masses, spin)

    def resolve(self, dt: float, twist: Twist, reaction: Reaction) -> Wrench:
        """The ground's whole wrench: `reaction` over `dt` [s] plus the friction that its Coulomb bounds allow."""
        bounded = {tip: contact for tip, contact in reaction.by_member.items() if contact.tangential_force is None}
        self._next_sliding, self._next_sticking = dict[int, Vector](), frozenset[int]()
        self._next_touching = bool(reaction.contacts)
        if not bounded:
            return Wrench.of(reaction)
        friction = _Friction(self, dt, twist, Wrench.of(reaction), bounded)
        force, torque = friction.solve()
        self._next_sliding, self._next_sticking = friction.sliding, frozenset(friction.sticking)
        return Wrench(reaction.force + force, reaction.torque + torque)

    def advance(self, dt: float, twist: Twist, wrench: Wrench) -> None:
        """Make the step of `dt` [s]: move along `twist`, with the impulse of `wrench`."""
        middle = to_matrix(moved(self.pose, twist, 0.5 * dt).turn)
        self.torque_work += dt * float(self._torques @ (self.axes @ (middle.T @ twist.spin)))
        end = moved(self.pose, twist, dt)
        self.place, self.turn = end.position, end.turn
        self._force, self._moment = self.trial.weight + wrench.force, wrench.torque
        slowed = 1 + dt * self._drag / np.array([self._masses[0], self._inertia[0, 0]])
        self.momentum = (self.momentum + dt * self._force) / slowed[0]
        if self.in_placement:  # the wheels' share is not slowed
            own = self.angular_momentum - self._wheels_at(self.wheels, self.turn)
            self.angular_momentum = self._wheels_at(self.wheels, self.turn) + (own + dt * self._moment) / slowed[1]
        else:
            self.angular_momentum = self.angular_momentum + dt * self._moment
        self.wheels = self.wheels - dt * self._torques
        self.touching, self.sliding, self.sticking = self._next_touching, self._next_sliding, self._next_sticking
        self.time += dt

    def __repr__(self) -> str:
        x, y, z = self.place
        return (
            f"SpatialBody({self.trial.platform.name} of {self.trial.platform.mass:g} kg at {x:.4g}, {y:.4g}, {z:.4g} m)"
        )

    @property
    def twist(self) -> Twist:
        """How it moves at the time of its momentum, half a lag after the pose."""
        turn = self.turn
        if self._lag:
            spin = self._spin_of(self.angular_momentum, self.wheels, turn)
            turn = moved(self.pose, Twist(np.zeros(3), spin), 0.5 * self._lag).turn
        return Twist(self.momentum / self._masses, self._spin_of(self.angular_momentum, self.wheels, turn))

    def twist_now(self, lag: float) -> Twist:
        """How it moves at the time of the pose."""
        momentum = self.momentum - 0.5 * lag * self._force
        about = self.angular_momentum - 0.5 * lag * self._moment
        return Twist(momentum / self._masses, self._spin_of(about, self.wheels + 0.5 * lag * self._torques, self.turn))

    def kinetic_energy(self, lag: float) -> float:
        """Of platform and counterweight [J], without the wheels' own spin."""
        now = self.twist_now(lag)
        body = to_matrix(self.turn).T @ now.spin
        return 0.5 * float(self._masses @ now.velocity**2 + body @ self._inertia @ body)

    @property
    def potential_energy(self) -> float:
        """- W . r [J]."""
        return -float(self.trial.weight @ self.place)

    @property
    def wheel_speed(self) -> Vector:
        """Absolute, of each wheel along its axis [rad/s], shape (3,); 0 where there is none."""
        inertias = [wheel.inertia for wheel in self.trial.platform.wheels] + [math.inf] * 3
        return self.wheels / np.array(inertias[:3])

    def state(self) -> State:
        """All that its next steps depend on."""
        slides = sorted(self.sliding)
        return {
            "numbers": self._numbers(),
            "inertia": self._inertia.copy(),
            "sliding": np.array([[tip, *self.sliding[tip]] for tip in slides], dtype=float).reshape(-1, 3),
            "sticking": np.array(sorted(self.sticking), dtype=np.int64),
        }

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        self._restore_numbers(state["numbers"])
        self._inertia = np.array(state["inertia"], dtype=float)
        rows = np.asarray(state["sliding"], dtype=float).reshape(-1, 3)
        self.sliding = {int(row[0]): row[1:].copy() for row in rows}
        self.sticking = frozenset(int(tip) for tip in np.asarray(state["sticking"]))

    _lag = 0.0
    _force: Vector = np.zeros(3)
    _moment: Vector = np.zeros(3)
    _torques: Vector = np.zeros(3)
    _next_sliding: dict[int, Vector]
    _next_sticking: frozenset[int]

    def _wheels_at(self, wheels: Vector, turn: Vector) -> Vector:
        return to_matrix(turn) @ (self.axes.T @ wheels)

    def _spin_of(self, about: Vector, wheels: Vector, turn: Vector) -> Vector:
        matrix = to_matrix(turn)
        return np.asarray(matrix @ np.linalg.solve(self._inertia, matrix.T @ about - self.axes.T @ wheels))

    def _spin_to_momentum(self, spin: Vector) -> Vector:
        matrix = to_matrix(self.turn)
        return np.asarray(matrix @ (self._inertia @ (matrix.T @ spin) + self.axes.T @ self.wheels))

    def _mean_torques(self, dt: float) -> Vector:
        """Mean torque of each wheel on the platform over the next step [N m]; cut at a wheel's end to what is left."""
        torques = np.zeros(3)
        if self.in_placement or not (self.touching or self.trial.torque_in_flight):
            return torques
        for k, history in enumerate(self.trial.histories):
            if history is None:
                continue
            start, impulse = self.time, 0.0
            for until in [*(t for t in history.times if self.time < t < self.time + dt), self.time + dt]:
                impulse += history.demanded(0.5 * (start + until)) * (until - start)
                start = until
            low, high = (speed * history.wheel.inertia for speed in history.limits())
            impulse = min(max(impulse, min(self.wheels[k] - high, 0.0)), max(self.wheels[k] - low, 0.0))
            torques[k] = impulse / dt
        return torques


class _Friction(StickSlip):
    """The friction of tips under Coulomb bounds in one step."""

    def __init__(
        self, body: SpatialBody, dt: float, twist: Twist, wrench: Wrench, contacts: dict[int, Contact]
    ) -> None:
        super().__init__(contacts[tip] for tip in sorted(contacts))
        self.dt = dt
        centre = body.place + 0.5 * dt * twist.velocity
        self.arms = np.array([contacts[tip].point - centre for tip in self.points])
        half = to_matrix(from_turn(0.5 * dt * twist.spin))
        self.arms_end = self.arms @ half.T
        turn = multiply(from_turn(dt * twist.spin), body.turn)
        matrix = to_matrix(turn)
        self.masses, self.inverse = body._masses, matrix @ np.linalg.inv(body._inertia) @ matrix.T
        slowed = 1 + dt * body._drag / np.array([body._masses[0], body._inertia[0, 0]])
        momentum = (body.momentum + dt * (body.trial.weight + wrench.force)) / slowed[0]
        wheels = matrix @ (body.axes.T @ (body.wheels - dt * body._torques))
        self.velocity = momentum / self.masses  # After the step without friction; likewise:
        self.spin = self.inverse @ (body.angular_momentum + dt * wrench.torque - wheels) / slowed[1]
        self.masses, self.inverse = self.masses * slowed[0], self.inverse / slowed[1]
        before = body.twist
        slips = (before.velocity + np.cross(before.spin, self.arms))[:, :2]
        self.begin(slips, body.sticking, body.sliding)

    def solve(self) -> tuple[Vector, Vector]:
        """Force [N] and torque [N m] of friction; who slides and who sticks is in `sliding` and `sticking` then."""
        force = self.settle()
        pushes = np.column_stack([force, np.zeros(len(force))])
        return pushes.sum(axis=0), np.cross(self.arms, pushes).sum(axis=0)

    def _slips(self, force: Vector) -> Vector:
        """Horizontal velocity of each tip at the step's end [m/s], shape [tip, 2]."""
        pushes = np.column_stack([force, np.zeros(len(force))])
        velocity = self.velocity + self.dt * pushes.sum(axis=0) / self.masses
        spin = self.spin + self.dt * self.inverse @ np.cross(self.arms, pushes).sum(axis=0)
        return np.asarray((velocity + np.cross(spin, self.arms_end))[:, :2])

    def _held(self, force: Vector) -> Vector:
        """See `StickSlip`: the mean slip of those that stick, and their turning, become zero."""
        held = [k for k, tip in enumerate(self.points) if tip in self.sticking]
        if not held:
            return force
        loads = self.loads[held]
        share = loads / loads.sum() if loads.sum() > 0 else np.full(len(held), 1 / len(held))
        shapes = self._shapes(held, share)
        free = self._held_slip(self._slips(force), held, share)
        answers = np.array(
            [self._held_slip(self._slips(force + shape) - self._slips(force), held, share) for shape in shapes]
        )
        # Tips in a line leave a turn about it open: the smallest solution.
        scale = np.sqrt(np.maximum(np.abs(np.diag(answers)), 1e-300))
        size = np.linalg.lstsq(answers.T / np.outer(scale, scale), -free / scale, rcond=1e-10)[0] / scale
        return force + np.tensordot(size, shapes, axes=1)

    def _shapes(self, held: list[int], share: Vector) -> Vector:
        """Forces of one unit of each multiplier, shape [2 or 3, tip, 2]."""
        shapes = np.zeros((2 if len(held) == 1 else 3, len(self.points), 2))
        shapes[0, held, 0] = shapes[1, held, 1] = share
        if len(held) > 1:
            away = self.arms[held] - share @ self.arms[held]
            shapes[2, held] = share[:, None] * np.column_stack([-away[:, 1], away[:, 0]])
        return shapes

    def _held_slip(self, slips: Vector, held: list[int], share: Vector) -> Vector:
        """Mean slip of those that stick, and their turning about the vertical, shape [2 or 3]."""
        mean = share @ slips[held]
        if len(held) == 1:
            return np.asarray(mean)
        away = self.arms_end[held] - share @ self.arms_end[held]
        turning = share @ (away[:, 0] * slips[held, 1] - away[:, 1] * slips[held, 0])
        return np.array([*mean, turning])
