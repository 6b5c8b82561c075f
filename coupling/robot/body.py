"""A robot of MuJoCo as a body that a ground pushes at its feet: `MujocoRobot`.

MuJoCo computes joints, motors, controllers and the robot's own contacts, in its own steps h; the ground's wrench on
each foot goes in by ``xfrc_applied``. In a macro step H = k h the scheme is that of `coupling.spatial_body`, with the
mass matrix M(q) and the Jacobian J of the feet in place of a mass:

    q' after k steps of MuJoCo under the guess F~: the ground follows the feet along this path, and answers F
    v' = v(F~) + (H - (h + s) / 2) M^-1 J^T (F - F~)

so that the impulse is exactly H F. MuJoCo steps q' = q + h v' with the new velocity: its velocities belong to a time
h / 2 before its positions. Those of the feet that are given here belong to s / 2 after the positions (s: the ground's
lag), w = v + h / 2 a + s / 2 M^-1 J^T F, a all accelerations. The given start velocity counts as w.

Under a Coulomb bound the sticking points of a foot share the holding force in proportion to their loads. So their mean
slip and their turning about the vertical are zero at the step's end, as in `coupling.spatial_body`. Here this holds for
all feet at once, by J M^-1 J^T.
"""

import copy
import math
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from coupling.poses import Pose, Twist, Vector, Wrench
from rigid.ground.reaction import Reaction, State
from rigid.spatial.quaternions import multiply

from .feet import Foot, find_feet, mesh_of, refuse_missing
from .friction import FeetFriction
from .models import check_model, keyframe_of, load_model, refuse_lost, rises, switch_off_floors, travels

__all__ = ["Controller", "MujocoRobot"]

Controller = Callable[[Any, Any], None]  # Called with MjModel and MjData; sets data.ctrl


class MujocoRobot:
    """A robot of MuJoCo with feet; a `coupling.Body` whose poses, twists and wrenches have its feet one behind another.

    Parameters
    ----------
    model : mujoco.MjModel (a copy is used), the path of its MJCF or URDF file, or the name of an
        example (`load_model`).
    feet : names of geoms, or of sites, or patterns of them (``spike_*``).
    keyframe : name of the keyframe where it starts; None: where the model has it.
    controller : called with model and data once per time step of the model as given; sets ``data.ctrl``. What it
        remembers must be in ``data.userdata``, so that a continued run is bitwise equal. None: the keyframe's ctrl.
    height : height of its lowest foot over the surface at the start [m]; None: as the model has it.

    Its world has z upwards and the undisturbed surface at z = 0. Planes and height fields of MuJoCo's world no longer
    touch anything (`floors`): the ground here takes their place. Raises ValueError, naming what is wrong: a missing
    foot, gravity that is not straight down, or the integrator RK4. It also refuses a height where the robot has neither
    a free joint nor an upright rail.
    """

    def __init__(
        self,
        model: Any,
        feet: Sequence[str],
        *,
        keyframe: str | None = None,
        controller: Controller | None = None,
        height: float | None = None,
    ) -> None:
        mujoco = self._mujoco = refuse_missing()
        self.model = copy.copy(load_model(model) if isinstance(model, str | Path) else model)
        self.controller = controller
        self.control_step = float(self.model.opt.timestep)  # Between two calls of the controller [s]
        check_model(self.model)
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # which hides a state that is lost
        self.data = mujoco.MjData(self.model)
        if keyframe is not None:
            mujoco.mj_resetDataKeyframe(self.model, self.data, keyframe_of(self.model, keyframe))
        mujoco.mj_forward(self.model, self.data)
        self.feet: list[Foot] = find_feet(self.model, self.data, [feet] if isinstance(feet, str) else feet)
        self.floors = switch_off_floors(self.model)
        self._bodies = np.array([foot.body for foot in self.feet])
        self.owners = np.repeat(np.arange(len(self.feet)), [len(foot.centres) for foot in self.feet])
        """Foot of each point on a law, shape (point,)."""
        self.time = self.torque_work = self.actuator_work = 0.0  # [s], [J]; works of all but gravity, springs, ground
        self.sliding: dict[int, Vector] = {}  # Point under a Coulomb bound that slides -> unit vector of its slip
        self.sticking: frozenset[int] = frozenset()
        self._last = np.zeros((len(self.feet), 6))  # The wrench of the last step
        self._guess = self._last
        self._step = 0.0  # MuJoCo's [s]; 0: it has not begun
        self._lag = 0.0
        self._own = np.zeros(self.model.nv)  # Accelerations but for the ground's
        self._calls = 0  # Of the controller
        self._surfaces: dict[int, Vector] = {}  # Vertices of geoms that are no feet, once they come near the ground
        self._works = np.zeros(3)  # Steps of MuJoCo so far; all work and that of actuators [J], half a step behind
        self._rates: Vector  # w
        if height is not None:
            self.lift(height - self.clearance)
        self.start()

    # What it is -------------------------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        names = ", ".join(foot.name for foot in self.feet)
        return f"MujocoRobot({self.name} of {self.mass:g} kg on {names} at {self.time:g} s)"

    @property
    def name(self) -> str:
        """As the model says."""
        return bytes(self.model.names).split(b"\0")[0].decode() or "robot"

    @property
    def gravity(self) -> float:
        """Downwards [m/s2]."""
        return -float(self.model.opt.gravity[2])

    @cached_property
    def moving(self) -> Vector:
        """Which MuJoCo bodies can move, shape (body,), bool."""
        return np.asarray(self.model.body_weldid != 0)

    @cached_property
    def mass(self) -> float:
        """Of all that moves [kg]."""
        return float(self.model.body_mass[self.moving].sum())

    @property
    def floats(self) -> bool:
        """Whether nothing but gravity and the ground can change its momentum."""
        model, free = self.model, int(self._mujoco.mjtJoint.mjJNT_FREE)
        roots = [
            k for k in range(1, model.nbody) if model.body_weldid[k] and not model.body_weldid[model.body_parentid[k]]
        ]
        held = any(model.jnt_type[model.body_jntadr[k]] != free for k in roots)
        medium = bool(model.opt.density or model.opt.viscosity or np.any(model.body_gravcomp))
        walls = any(model.geom_contype[k] or model.geom_conaffinity[k] for k in np.flatnonzero(self._static_geoms))
        return not (held or medium or model.neq or walls)

    @property
    def hangs(self) -> bool:
        """Whether the world holds it: it has neither a free joint nor an upright rail at a root."""
        return not rises(self.model, self.data)

    @property
    def travels(self) -> bool:
        """Whether its root can move along the ground: it has a free joint or a slide there that is not upright."""
        return travels(self.model, self.data)

    @property
    def _static_geoms(self) -> Vector:
        return np.asarray(self.model.body_weldid[self.model.geom_bodyid] == 0)

    @property
    def clearance(self) -> float:
        """Height of its lowest foot over the surface [m]."""
        return min(self._foot_heights().values())

    def _foot_heights(self) -> dict[int, float]:
        """Height of the lowest point of each foot [m], by its body."""
        data = self.data
        return {
            foot.body: float(data.xipos[foot.body, 2]) + foot.bottom(data.xmat[foot.body].reshape(3, 3))
            for foot in self.feet
        }

    @cached_property
    def other_geoms(self) -> list[int]:
        """Numbers of the geoms of what moves that are no feet."""
        named = {part.name for foot in self.feet for part in foot.parts}
        mujoco, model = self._mujoco, self.model
        return [
            k
            for k in np.flatnonzero(self.moving[self.model.geom_bodyid]).tolist()
            if mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, k) not in named
        ]

    def lowest_other(self) -> tuple[float, str]:
        """Height of the lowest point of what is no foot [m], infinite where that is above the surface, and its geom.

        What is fixed to a foot counts from the foot's own lowest point, where that is below the surface: a spike goes
        into the ground with the point at its end that is its foot.
        """
        worst, data, feet = (math.inf, ""), self.data, self._foot_heights()
        for k in self.other_geoms:
            if float(data.geom_xpos[k, 2]) - float(self.model.geom_rbound[k]) < min(worst[0], 0.0):
                if k not in self._surfaces:
                    self._surfaces[k] = mesh_of(self.model, k)[0]
                up = data.geom_xmat[k].reshape(3, 3)[2]
                low = float(data.geom_xpos[k, 2]) + float((self._surfaces[k] @ up).min())
                low -= min(0.0, feet.get(int(self.model.geom_bodyid[k]), 0.0))
                name = self._mujoco.mj_id2name(self.model, self._mujoco.mjtObj.mjOBJ_GEOM, k) or f"geom {k}"
                worst = min(worst, (low, name))
        return worst

    @property
    def step(self) -> float:
        """Time step of MuJoCo here [s]; 0 before the first."""
        return self._step

    def lift(self, height: float) -> None:
        """Raise it by `height` [m], along its free joints or upright rails.

        Raises ValueError where there are none at its root.
        """
        ways = rises(self.model, self.data)
        if not ways:
            raise ValueError(
                "height is given, but the robot has no free joint or upright rail to be raised by. Leave it out, or "
                'free the robot. In a URDF file a joint of type "floating" to a link "world" does so'
            )
        for place, up in ways:
            self.data.qpos[place] += height / up
        self.start()

    def start(self) -> None:
        """Take positions and velocities of `data` as those that it starts with; they may be changed before."""
        self._mujoco.mj_forward(self.model, self.data)
        self._rates = np.array(self.data.qvel)
        self._read_pose()

    # Stepping ---------------------------------------------------------------------------------------------------------

    @property
    def pose(self) -> Pose:
        """Of its feet: positions [m], shape (3 foot,), and unit quaternions, shape (4 foot,)."""
        return self._pose

    @property
    def twist(self) -> Twist:
        """Of its feet, half a lag after the pose: by the ground's last force and by all its other forces."""
        half = 0.5 * self._lag
        return Twist(
            self._twist.velocity + half * self._speeding.velocity, self._twist.spin + half * self._speeding.spin
        )

    def twist_now(self, lag: float) -> Twist:
        """Of its feet at the time of the pose."""
        return self._twist_of(self._rates - 0.5 * lag * self.response(self._last))

    def begin(self, dt: float, lag: float) -> None:
        """Get ready for macro steps of `dt` [s] on a ground of this lag [s]: the velocity is that of its pose."""
        count = max(1, math.ceil(dt / self.control_step * (1 - 1e-9)))
        self._count, self._lag = count, lag
        step = dt / count
        if step != self._step:
            self.model.opt.timestep = step
            if not self._step:
                self._mujoco.mj_forward(self.model, self.data)
                self._own = np.array(self.data.qacc)
                self._speeding = self._twist_of(self._own)
                self.data.qvel[:] = self._rates - 0.5 * step * self._own
            self._step = step

    def predict(self, dt: float, guess: Wrench, lag: float) -> Twist:
        """Step MuJoCo by `dt` [s] under the guess at the wrenches; the mean twist of its feet on the way."""
        self.begin(dt, lag)
        mujoco, model, data = self._mujoco, self.model, self.data
        rows = np.hstack([guess.force.reshape(-1, 3), guess.torque.reshape(-1, 3)])
        if np.any(rows != self._last):
            data.qvel[:] -= 0.5 * (self._step + lag) * self.response(rows - self._last)
        self._guess = rows
        data.xfrc_applied[self._bodies] = rows
        for _ in range(self._count):
            before = np.array(data.qvel)
            mujoco.mj_step1(model, data)
            if self.controller is not None and data.time >= (self._calls - 1e-6) * self.control_step:
                self.controller(model, data)
                self._calls += 1
            mujoco.mj_step2(model, data)
            self._count_work(before)
            refuse_lost(data)
        mujoco.mj_fwdPosition(model, data)
        start = self._pose
        self._end = self._pose_now()
        turns = [
            _turn_between(a, b) / dt
            for a, b in zip(start.turn.reshape(-1, 4), self._end.turn.reshape(-1, 4), strict=True)
        ]
        return Twist((self._end.position - start.position) / dt, np.concatenate(turns))

    def _count_work(self, before: Vector) -> None:
        """Work of what is neither gravity nor springs nor ground in the step just made: M dv / h less the others.

        The forces of now act along the way before and along the way just made, half on each.
        """
        data, step = self.data, self._step
        gained = np.zeros(self.model.nv)
        self._mujoco.mj_mulM(self.model, data, gained, data.qvel - before)
        other = gained / step - data.qfrc_smooth + data.qfrc_passive - data.qfrc_spring + data.qfrc_applied
        way = 0.5 * step * (data.qvel + before if self._works[0] else data.qvel)
        self._works += (1.0, (other + data.qfrc_actuator) @ way, data.qfrc_actuator @ way)

    def _read_works(self) -> None:
        """The works up to the time of the pose: half a step more than has been counted."""
        data, way = self.data, 0.5 * self._step * self.data.qvel
        other = data.qfrc_passive - data.qfrc_spring + data.qfrc_applied + data.qfrc_constraint + data.qfrc_actuator
        self.torque_work = float(self._works[1] + other @ way)
        self.actuator_work = float(self._works[2] + data.qfrc_actuator @ way)

    def resolve(self, dt: float, twist: Twist, reaction: Reaction) -> Wrench:
        """The ground's whole wrench: `reaction` over `dt` [s] plus the friction that its Coulomb bounds allow."""
        bounded = [contact for contact in reaction.contacts if contact.tangential_force is None]
        self._next_sliding, self._next_sticking = dict[int, Vector](), frozenset[int]()
        if not bounded:
            return Wrench.of(reaction)
        normal = np.hstack([reaction.force.reshape(-1, 3), reaction.torque.reshape(-1, 3)])
        free = self.data.qvel + 0.5 * self._step * self._own + self.response(
            dt * (normal - self._guess) + 0.5 * (self._step + self._lag) * self._guess
        )  # fmt: skip
        friction = FeetFriction(self, dt, twist, free, bounded)
        rows = friction.solve()
        self._next_sliding, self._next_sticking = friction.sliding, frozenset(friction.sticking)
        return Wrench(reaction.force + rows[:, :3].ravel(), reaction.torque + rows[:, 3:].ravel())

    def advance(self, dt: float, twist: Twist, wrench: Wrench) -> None:
        """Take the step that `predict` made, with the impulse of `wrench` in place of the guess's."""
        mujoco, model, data = self._mujoco, self.model, self.data
        rows = np.hstack([wrench.force.reshape(-1, 3), wrench.torque.reshape(-1, 3)])
        data.qvel[:] += (dt - 0.5 * (self._step + self._lag)) * self.response(rows - self._guess)
        data.xfrc_applied[self._bodies] = rows
        self._last, self._pose = rows, self._end
        self.sliding, self.sticking = self._next_sliding, self._next_sticking
        self.time += dt
        mujoco.mj_forward(model, data)
        by_ground = self.response(rows)
        self._own = data.qacc - by_ground
        self._read_works()
        self._rates = data.qvel + 0.5 * self._step * data.qacc + 0.5 * self._lag * by_ground
        self._twist, self._speeding = self._twist_of(self._rates), self._twist_of(self._own)

    def response(self, rows: Vector) -> Vector:
        """M^-1 J^T of wrenches on the feet [N, N m], shape (foot, 6): accelerations [m/s2, rad/s2], shape (nv,)."""
        pushed = np.zeros(self.model.nv)
        for body, row in zip(self._bodies, rows, strict=True):
            if row.any():
                linear, angular = self.jacobian(body)
                pushed += linear.T @ row[:3] + angular.T @ row[3:]
        return self.solve(pushed)

    def solve(self, forces: Vector) -> Vector:
        """M^-1 of generalised forces, shape (nv,) or (n, nv)."""
        rows = np.ascontiguousarray(np.atleast_2d(forces))
        found = np.zeros_like(rows)
        self._mujoco.mj_solveM(self.model, self.data, found, rows)
        return found.reshape(np.shape(forces))

    def jacobian(self, body: int) -> tuple[Vector, Vector]:
        """Of a MuJoCo body's centre of mass and of its turning, shape (3, nv) both."""
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        self._mujoco.mj_jacBodyCom(self.model, self.data, linear, angular, int(body))
        return linear, angular

    _pose: Pose

    def _read_pose(self) -> None:
        self._pose = self._end = self._pose_now()
        # With the ground's last force alone half a lag after the pose; and the acceleration by all other forces.
        self._twist, self._speeding = self._twist_of(self._rates), self._twist_of(self._own)

    def _pose_now(self) -> Pose:
        return Pose(self.data.xipos[self._bodies].ravel(), self.data.xquat[self._bodies].ravel())

    def _twist_of(self, rates: Vector) -> Twist:
        found = [self.jacobian(body) for body in self._bodies]
        return Twist(
            np.concatenate([linear @ rates for linear, _ in found]),
            np.concatenate([angular @ rates for _, angular in found]),
        )

    # What it has ------------------------------------------------------------------------------------------------------

    @property
    def rates(self) -> Vector:
        """Generalised velocities half a lag after the pose, shape (nv,)."""
        return self._rates

    def kinetic_energy(self, lag: float) -> float:
        """At the time of the pose [J]."""
        rates = self._rates - 0.5 * lag * self.response(self._last)
        moved = np.zeros_like(rates)
        self._mujoco.mj_mulM(self.model, self.data, moved, rates)
        return 0.5 * float(rates @ moved)

    @property
    def potential_energy(self) -> float:
        """Of gravity and of the springs in it [J]."""
        self._mujoco.mj_energyPos(self.model, self.data)
        return float(self.data.energy[0])

    @property
    def centre(self) -> Vector:
        """Centre of mass [m], shape (3,)."""
        return np.asarray(self._masses @ self.data.xipos / self.mass)

    @cached_property
    def _masses(self) -> Vector:
        """Of the MuJoCo bodies that can move, 0 of the others [kg], shape (body,)."""
        return np.where(self.moving, self.model.body_mass, 0.0)

    def onward(self, most_steps: int = 100_000) -> tuple[float, float, Vector] | None:
        """How a flight goes on without the ground, until the lowest foot is at the surface.

        Three numbers are returned: rise of the centre of mass from here [m], 0 where it falls; time [s]; and way of the
        centre of mass along the ground by then [m], shape (2,).

        MuJoCo steps a copy, with the joints' friction and the controls of now; the controller is not called. None where
        no foot comes to the surface within `most_steps`.
        """
        copied = copy.copy(self)
        copied.data = copy.copy(self.data)
        copied.data.xfrc_applied[:] = 0.0
        here, above, step = np.array(self.centre), self.clearance, self.model.opt.timestep
        start, before = float(here[2]), here
        highest = start
        for count in range(most_steps):
            self._mujoco.mj_step(self.model, copied.data)  # leaves the places of bodies as before the step
            there, low = np.array(copied.centre), copied.clearance
            height = float(there[2])
            if not math.isfinite(height):
                return None
            highest = max(highest, height)
            if height < highest and low <= 0:
                past = low / (low - above) if above > 0 else 0.0  # of the last step, where it crossed the surface in it
                return highest - start, step * (count - past), (there + past * (before - there) - here)[:2]
            above, before = low, there
        return None

    @property
    def momentum(self) -> Vector:
        """[N s], shape (3,), half a lag after the pose."""
        found = np.zeros(3)
        for body in np.flatnonzero(self.moving).tolist():
            found += self.model.body_mass[body] * (self.jacobian(body)[0] @ self._rates)
        return found

    @property
    def angular_momentum(self) -> Vector:
        """About (0, 0, 0) [N m s], shape (3,), half a lag after the pose."""
        found, data = np.zeros(3), self.data
        for body in np.flatnonzero(self.moving).tolist():
            linear, angular = (jacobian @ self._rates for jacobian in self.jacobian(body))
            axes = data.ximat[body].reshape(3, 3)
            found += np.cross(data.xipos[body], self.model.body_mass[body] * linear)
            found += axes @ (self.model.body_inertia[body] * (axes.T @ angular))
        return found

    def state(self) -> State:
        """All that its next steps depend on."""
        kind = self._mujoco.mjtState.mjSTATE_INTEGRATION
        inner = np.zeros(self._mujoco.mj_stateSize(self.model, kind))
        self._mujoco.mj_getState(self.model, self.data, inner, kind)
        slides = sorted(self.sliding)
        counts = (self.time, self.torque_work, self.actuator_work, self._step, self._lag, self._calls)
        return {
            "inner": inner,
            "works": self._works.copy(),
            "last": self._last.copy(),
            "own": self._own.copy(),
            "rates": self._rates.copy(),
            "numbers": np.array(counts),
            "sliding": np.array([[point, *self.sliding[point]] for point in slides], dtype=float).reshape(-1, 3),
            "sticking": np.array(sorted(self.sticking), dtype=np.int64),
        }

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        mujoco, kind = self._mujoco, self._mujoco.mjtState.mjSTATE_INTEGRATION
        inner = np.array(state["inner"], dtype=float)
        numbers = [float(number) for number in state["numbers"]]
        self.time, self.torque_work, self.actuator_work, self._step, self._lag, calls = numbers
        self._calls = int(calls)
        if self._step:
            self.model.opt.timestep = self._step
        mujoco.mj_setState(self.model, self.data, inner, kind)
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, inner, kind)
        kept = (np.array(state[name], dtype=float) for name in ("last", "own", "rates", "works"))
        self._last, self._own, self._rates, self._works = kept
        rows = np.asarray(state["sliding"], dtype=float).reshape(-1, 3)
        self.sliding = {int(row[0]): row[1:].copy() for row in rows}
        self.sticking = frozenset(int(point) for point in np.asarray(state["sticking"]))
        self._read_pose()

    _next_sliding: dict[int, Vector]
    _next_sticking: frozenset[int]
    _count = 1


def _turn_between(before: Vector, after: Vector) -> Vector:
    """The one turn from a unit quaternion to another [rad], shape (3,), by less than half a turn."""
    w, *axis = multiply(after, before * (1.0, -1.0, -1.0, -1.0))
    if w < 0:
        w, axis = -w, [-part for part in axis]
    size = math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    share = 2.0 * math.atan2(size, w) / size if size > 1e-12 else 2.0
    return np.array(axis) * share
