"""A bed whose grains live in LAMMPS, under bodies that turn freely: their contacts are computed here, step by step.

LAMMPS makes one time step at a time. Before each, the grains near a body are read. Where they are at its end follows
from their velocities and forces, as LAMMPS' Verlet has it. With these places, and the velocities half a step before,
`BodyTouches` finds the forces, and LAMMPS adds them to its own in that step. A grain's torque by bodies is a change of
its spin between two steps, with which the spin is the same half a step later.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dem import Bed
from dem.contact.law import pair_row
from dem.grains.materials import Facing
from rigid.ground.reaction import State

from .bed import FLOOR, LammpsBed
from .touches import BodyTouches
from .words import digits

__all__ = ["FreeLammpsBed"]

Vector = np.ndarray
_COLUMNS = "id x y z vx vy vz omegax omegay omegaz fx fy fz tqx tqy tqz"
_SLACK = 0.5  # How far beyond a body's reach grains are read, for what else moves them in the meantime [d]
_PUSHED = (
    "group near empty", "fix pushed all property/atom d_bx d_by d_bz d_load",
    "compute pushed all property/atom d_bx d_by d_bz d_load",
    *(f"variable pushed{axis} atom c_pushed[{k}]" for k, axis in enumerate("xyz", 1)),
    "fix pushes all addforce v_pushedx v_pushedy v_pushedz",
)  # fmt: skip


class FreeLammpsBed(LammpsBed):
    """A `LammpsBed` whose bodies take any shape of `dem`, in any attitude. Parameters as of `LammpsBed`.

    The law of grains on bodies is our own, with all of its terms. Raises ValueError as `LammpsBed` does, but for the
    shapes of bodies.
    """

    more_loads = "+c_pushed[4]"

    def __init__(self, bed: Bed, *, ranks: int, begin: float = 0.0) -> None:
        self._turning = np.zeros((0, 4))  # Grains, by id, and the torques of bodies in the last step [N m]
        super().__init__(bed, ranks=ranks, begin=begin)
        self._touches = BodyTouches(self)

    def _interactions(self) -> list[str]:
        return [*_PUSHED, *super()._interactions()]

    # The bodies

    def add_body(self, shape: Any, *, position: Sequence[float], **facing: Any) -> int:
        """Put a body into the bed and return its number (`dem.Bed.add_body`)."""
        faced = Facing(**facing)
        number = self._touches.add_body(shape, position, faced)
        self._rows.append(np.array(pair_row(self.material, faced, tensile=self.tensile)))
        self._reactions = np.zeros((number + 1, 6))
        return number

    def move_body(self, body: int, **changes: Any) -> None:
        """Set a body's pose and motion, of which what is not given stays (`dem.Bed.move_body`)."""
        row = self._pose(body)
        parts = {"position": row[:3], "velocity": row[3:6], "turn": row[6:10], "spin": row[10:]} | changes
        position, velocity, turn, spin = (
            np.array([parts[name]], dtype=float) for name in ("position", "velocity", "turn", "spin")
        )
        self._touches.move([body], positions=position, velocities=velocity, turns=turn, spins=spin)

    def move_bodies(
        self, bodies: Sequence[int], *, positions: Vector, velocities: Vector, turns: Vector, spins: Vector
    ) -> None:
        """Set the pose and motion of several bodies at once (`dem.Bed.move_bodies`)."""
        self._touches.move(bodies, positions=positions, velocities=velocities, turns=turns, spins=spins)

    def _pose(self, body: int) -> Vector:
        if not 1 <= body < self._touches.count:
            raise ValueError(f"body = {body}: there is no such body in the bed")
        return np.array(self._touches.poses()[body])

    def body_position(self, body: int) -> Vector:
        """Position of a body's origin [m], shape [3]."""
        return self._pose(body)[:3]

    def body_turn(self, body: int) -> Vector:
        """Rotation of a body: a unit quaternion, scalar first, shape [4]."""
        return self._pose(body)[6:10]

    # Time

    def advance(self, steps: int = 1, *, drag_time: float = math.inf) -> None:
        """Advance by a number of time steps (`LammpsBed.advance`)."""
        if self._touches.count == 1:
            super().advance(steps, drag_time=drag_time)
            return
        if math.isfinite(drag_time):
            raise ValueError(f"drag_time = {drag_time} s: a bed in LAMMPS has no drag")
        self._prepare()
        on_bodies = np.zeros((self._touches.count, 6))
        if self._choose(steps * self.time_step):
            for _ in range(steps):
                on_bodies += self._step()
        else:
            self._release()
            self._lammps.tell(self._classes.runs(self.steps, steps, self._followed))
            for _ in range(steps):
                self._touches.go_on(self.time_step)
            self.steps += steps
        self.grain_steps += steps * self.grain_count
        before, self._sums = self._sums, self._read_sums()
        on_bodies[FLOOR] = steps * self._by_body((self._sums - before) / max(1, steps))[FLOOR]
        self._reactions = on_bodies / max(1, steps)

    def _choose(self, duration: float) -> bool:
        """Have LAMMPS name the grains that a body may touch in the next ``duration`` [s]; whether there are any."""
        margin = float(self.radius.max()) + _SLACK * self.mean_diameter
        low, high = np.array([self.begin, 0.0, -math.inf]), np.array([self.begin, 0.0, 0.0])
        high = high + (*self.size[:2], self.height + 2 * margin)
        lines = ["group near clear"]
        for box in self._touches.boxes(duration, margin):
            for shift in ((x, y, 0.0) for x in (-1, 0, 1) for y in (-1, 0, 1)):
                sides = box + np.array(shift) * (*self.size[:2], 0.0)
                if (sides[0] < high).all() and (sides[1] > low).all():
                    lines += [f"region near block {digits(sides.T.ravel())} units box", "group near region near",
                              "region near delete"]  # fmt: skip
        if len(lines) == 1:
            return False
        self._lammps.tell(lines)
        rows = self._near()
        ids = rows[:, 0].astype(int)
        reach = margin - float(self.radius.max()) + duration * np.linalg.norm(rows[:, 4:7], axis=1)
        chosen = ids[self._touches.gaps(rows[:, 1:4], duration) < self.radius[ids - 1] + reach]
        self._lammps.tell(["group near clear", *(f"group near id {some}" for some in _in_parts(chosen))])
        return bool(len(chosen))

    def _near(self) -> Vector:
        """Rows of _COLUMNS of the grains near bodies, by id, shape [grain, 16]."""
        return self._lammps.dump("near", _COLUMNS)

    def _step(self) -> Vector:
        """One time step; force and torque on each body in it, shape [body, 6]."""
        dt, rows = self.time_step, self._near()
        ids = rows[:, 0].astype(int)
        radius, mass = self.radius[ids - 1], self.mass[ids - 1]
        turned = rows[:, 7:10] + self._kick(ids)
        velocity = rows[:, 4:7] + (0.5 * dt / mass)[:, None] * rows[:, 10:13]
        spin = turned + (0.5 * dt / (0.4 * mass * radius**2))[:, None] * rows[:, 13:16]
        self._touches.go_on(dt)
        grains = np.column_stack([rows[:, 1:4] + dt * velocity, radius, velocity, mass, spin])
        touched = self._touches.push(ids, grains, dt)
        pushes = np.zeros((len(ids), 4))
        pushes[touched.which] = np.column_stack([touched.force, touched.load])
        before = np.isin(ids, self._turning[:, 0])
        self._turning = np.column_stack([ids[touched.which], touched.torque])
        self._seen = max(self._seen, touched.overlap)
        changed = np.flatnonzero(before | np.isin(ids, self._turning[:, 0]))
        self._lammps.tell([
            *(f"set atom {ids[k]} {_pushed(pushes[k])} omega {digits(turned[k])}" for k in changed),
            *self._classes.runs(self.steps, 1, self._followed),
        ])  # fmt: skip
        self.steps += 1
        return touched.sums

    def _kick(self, ids: Vector) -> Vector:
        """What the torques of the last step change in the spins of these grains over a step [rad/s], shape [n, 3]."""
        kick, own = np.zeros((len(ids), 3)), self._turning[:, 0].astype(int)
        inertia = 0.4 * self.mass[own - 1] * self.radius[own - 1] ** 2
        there = np.isin(own, ids)
        kick[np.searchsorted(ids, own[there])] = (self.time_step * self._turning[:, 1:] / inertia[:, None])[there]
        return kick

    def _release(self) -> None:
        """Nothing is near a body: end what bodies did."""
        held = self._turning[:, 0].astype(int)
        self._lammps.tell([f"set atom {k} {_pushed(np.zeros(4))}" for k in held])
        self._turning = self._turning[:0]
        self._touches.forget()

    def _dumped(self) -> Vector:
        rows = super()._dumped()
        rows[:, 10:13] += 0.5 * self._kick(rows[:, 0].astype(int))  # LAMMPS has it half a step later
        return rows

    # What is kept

    def state(self) -> State:
        """As of `LammpsBed.state`, with the bodies and the springs of their contacts."""
        own = {f"free_{name}": value for name, value in self._touches.state().items()}
        return super().state() | own | {"free_turning": self._turning.copy()}

    def restore(self, state: State) -> None:
        """Go on from what `state` gave. Raises ValueError for the state of other bodies."""
        self._touches.restore(*(np.asarray(state[f"free_{name}"]) for name in ("poses", "keys", "springs")))
        self._turning = np.array(state["free_turning"], dtype=float).reshape(-1, 4)
        super().restore(state)


def _in_parts(ids: Vector, most: int = 100) -> list[str]:
    """Numbers for commands, of so many at most."""
    return [" ".join(map(str, ids[k : k + most])) for k in range(0, len(ids), most)]


def _pushed(values: Vector) -> str:
    return " ".join(f"d_{name} {value:.17g}" for name, value in zip(("bx", "by", "bz", "load"), values, strict=True))
