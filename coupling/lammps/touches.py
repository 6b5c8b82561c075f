"""Contacts between bodies in any attitude and grains that live in LAMMPS, by the kernels of our own bed.

LAMMPS' regions turn about one constant axis, and its unions of regions take no motion. So a body that turns freely has
no counterpart there. Its shapes are in a `dem.Bed` of idle grains instead, whose law, distances and histories it
shares. The rows of that bed are lent to the grains of LAMMPS for one step at a time.
"""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from dem import Bed
from dem.engine.lists import MOST_BODIES
from dem.grains.materials import Facing
from hedgebed_taichi import ti

__all__ = ["BodyTouches", "Touched"]

Vector = np.ndarray
ROWS = 256  # Contacts of one call of the kernel; more take several calls
FAR = 1.0  # Farther from a body than this no distance to it is known [m]
_REACH = 1.25  # Up to how many radii from a body a grain is tried, for cohesion that holds across a gap [1]


@ti.kernel
def _move(engine: ti.template(), dt: float):
    """Let all bodies go on for one step, as the bed lets them."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        for b in range(1, engine.body_count[None]):
            engine.body_position[b] = engine.body_position[b] + dt * engine.body_velocity[b]
            engine.turn_body(b, dt)


@ti.kernel
def _gaps(
    engine: ti.template(),
    points: ti.types.ndarray(dtype=ti.f64, ndim=2),
    found: ti.types.ndarray(dtype=ti.f64, ndim=2),
    shapes: ti.template(),
):
    """From a point to the nearest body [m]."""
    ti.loop_config(serialize=True)
    for i in range(points.shape[0]):
        x = ti.cast(ti.Vector([points[i, 0], points[i, 1], points[i, 2]]), engine.real)
        nearest = ti.cast(1e30, engine.real)
        for b in range(1, engine.body_count[None]):
            if engine.from_body(b, x).norm() - engine.body_extent[b] < nearest:
                nearest = ti.min(nearest, engine.nearest(b, x, FAR, shapes, True)[0])
        found[i, 0] = nearest


@ti.kernel
def _push(
    engine: ti.template(),
    bodies: ti.types.ndarray(dtype=ti.i32, ndim=1),
    grains: ti.types.ndarray(dtype=ti.f64, ndim=2),
    springs: ti.types.ndarray(dtype=ti.f64, ndim=2),
    found: ti.types.ndarray(dtype=ti.f64, ndim=2),
    sums: ti.types.ndarray(dtype=ti.f64, ndim=2),
    dt: float,
    shapes: ti.template(),
    balance: ti.template(),
):
    """One contact a row, in their order: `grains` are place, radius, velocity, mass and spin, `springs` the history.

    `found`: force, torque, share of the load and overlap over diameter of the grain; `sums`: of each body.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        for b in range(sums.shape[0]):
            engine.pushes[0, b] = ti.Vector.zero(engine.real, 6)
        for s in range(bodies.shape[0]):
            b = bodies[s]
            for k in ti.static(range(4)):
                engine.position[s][k] = grains[s, k]
                engine.velocity[s][k] = grains[s, 4 + k]
                engine.near_slide[s][k] = springs[s, k]
            for k in ti.static(range(3)):
                engine.spin[s][k] = grains[s, 8 + k]
                engine.near_roll[s][k] = springs[s, 4 + k]
            engine.force[s] = ti.Vector.zero(engine.real, 3)
            engine.torque[s] = ti.Vector.zero(engine.real, 3)
            engine.near_grain[s] = s
            engine.near_body[s] = b
            found[s, 7] = engine.push_near(0, s, dt, 1, ti.cast(1.0, engine.real), shapes, balance)
            x = engine.position[s]
            near = engine.nearest(b, x.xyz, _REACH * x.w, shapes, False)  # distance, normal, curvature, arm
            for k in ti.static(range(4)):
                springs[s, k] = engine.near_slide[s][k]
            for k in ti.static(range(3)):
                springs[s, 4 + k] = engine.near_roll[s][k]
                found[s, k] = engine.force[s][k]
                found[s, 3 + k] = engine.torque[s][k]
            found[s, 6] = ti.select(found[s, 7] != 0.0, near[0] * near[1].dot(engine.force[s]), 0.0)
        for b in range(sums.shape[0]):
            for k in ti.static(range(6)):
                sums[b, k] = engine.pushes[0, b][k]


class Touched:
    """What bodies do to grains in one step: of each of these grains, and of all bodies.

    ``which``: the grains' rows; ``force`` [N], ``torque`` [N m], shape [n, 3]; ``load`` as of `.rolling` [N m],
    shape [n]. ``sums``: force and torque about its origin on each body, shape [body, 6]. ``overlap``: the largest, over
    the diameter [1].
    """

    def __init__(self, count: int, rows: Vector, found: Vector, sums: Vector) -> None:
        of_grains = np.zeros((count, 7))
        np.add.at(of_grains, rows, found[:, :7])
        self.which = np.unique(rows[found[:, :7].any(axis=1)])
        chosen = of_grains[self.which]
        self.force, self.torque, self.load = chosen[:, :3], chosen[:, 3:6], chosen[:, 6]
        self.sums, self.overlap = sums, float(found[:, 7].max(initial=0.0))


class BodyTouches:
    """The bodies, and the springs of their contacts. Parameters as of a `LammpsBed`, whose grains they touch."""

    def __init__(self, like: Any) -> None:
        radius = float(like.radius.max())
        across = [max(1, int(side / (2.2 * radius))) for side in like.size[:2]]
        layers = -(-ROWS // (across[0] * across[1]))
        ways = (np.arange(count) for count in (*across, layers))
        idle = (np.stack(np.meshgrid(*ways, indexing="ij"), axis=-1).reshape(-1, 3)[:ROWS] + 0.5) * 2.2 * radius
        self._bed = Bed.from_grains(
            like.material, positions=idle, radii=np.full(ROWS, radius), size=like.size, gravity=like.gravity,
            height=max(like.height, 2.2 * radius * (layers + 1)), max_overlap=0.2, tensile=like.tensile,
            **asdict(like.runtime),
        )  # fmt: skip
        self.period = np.array(like.size[:2], dtype=float)
        self._keys, self._springs = np.zeros(0, dtype=np.int64), np.zeros((0, 7))
        self._places, self._speeds, self._extents = np.zeros((1, 3)), np.zeros((1, 6)), np.zeros(1)

    @property
    def count(self) -> int:
        """How many bodies there are, the floor, which touches nothing here, included."""
        return len(self._extents)

    def add_body(self, shape: Any, position: Sequence[float], facing: Facing) -> int:
        """As `dem.Bed.add_body`, which says what is refused."""
        body = int(self._bed.place_body(shape, position, facing))
        self._places = np.vstack([self._places, position])
        self._speeds = np.vstack([self._speeds, np.zeros(6)])
        self._extents = np.append(self._extents, float(self._bed.engine.body_extent[body]))
        return body

    def move(
        self, bodies: Sequence[int], *, positions: Vector, velocities: Vector, turns: Vector, spins: Vector
    ) -> None:
        """As `dem.Bed.move_bodies`."""
        self._bed.move_bodies(bodies, positions=positions, velocities=velocities, turns=turns, spins=spins)
        self._places[bodies], self._speeds[bodies] = positions, np.hstack([velocities, spins])

    def poses(self) -> Vector:
        """Position, velocity, turn and spin of all bodies, shape [body, 13]."""
        turns = self._bed.engine.read("body_turn")[: self.count].astype(float)
        return np.hstack([self._places, self._speeds[:, :3], turns, self._speeds[:, 3:]])

    def go_on(self, dt: float) -> None:
        """Let the bodies go on for this time step [s]."""
        _move(self._bed.engine, dt)
        self._places[1:] += dt * self._speeds[1:, :3]

    def boxes(self, duration: float, margin: float) -> Vector:
        """Lower and upper corner of a box around each body in the next ``duration`` [s], shape [body, 2, 3]."""
        travel = duration * np.abs(self._speeds[1:, :3]) + (self._extents[1:] + margin)[:, None]
        return np.stack([self._places[1:] - travel, self._places[1:] + travel], axis=1)

    def gaps(self, points: Vector, duration: float) -> Vector:
        """From points [m], shape [n, 3], to where the nearest body may be within ``duration`` [s], shape [n]."""
        found = np.zeros((len(points), 1))
        if len(points):
            _gaps(self._bed.engine, np.ascontiguousarray(points), found, self._bed.engine.shapes)
        speed, spin = (np.linalg.norm(part, axis=1) for part in (self._speeds[:, :3], self._speeds[:, 3:]))
        return np.asarray(found[:, 0] - duration * float((speed + self._extents * spin).max()))

    def push(self, ids: Vector, grains: Vector, dt: float) -> Touched:
        """What the bodies do to these grains in a step of ``dt`` [s], with the velocities half a step behind.

        ``ids``: rising, shape [n]; ``grains``: as of `_push`, shape [n, 11]. Springs of contacts with others end.
        """
        e, away = self._bed.engine, grains[:, None, :3] - self._places
        away[..., :2] -= self.period * np.round(away[..., :2] / self.period)
        near = np.linalg.norm(away, axis=2) < self._extents + _REACH * grains[:, 3, None]
        near[:, 0] = False  # the floor
        rows, bodies = np.nonzero(near)
        keys, springs = ids[rows].astype(np.int64) * MOST_BODIES + bodies, np.zeros((len(rows), 7))
        if len(self._keys) and len(keys):
            at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
            old = self._keys[at] == keys
            springs[old] = self._springs[at[old]]
        found, sums = np.zeros((len(rows), 8)), np.zeros((self.count, 6))
        for k in range(0, len(rows), ROWS):
            part, here = slice(k, k + ROWS), np.zeros_like(sums)
            kept, pushed = np.ascontiguousarray(springs[part]), np.zeros_like(found[part])
            _push(e, bodies[part].astype(np.int32), np.ascontiguousarray(grains[rows[part]]), kept, pushed, here, dt,
                  e.shapes, e.balance)  # fmt: skip
            springs[part], found[part], sums = kept, pushed, sums + here
        held = springs.any(axis=1)
        self._keys, self._springs = keys[held], springs[held]
        return Touched(len(ids), rows, found, sums)

    def forget(self) -> None:
        """End all contacts."""
        self._keys, self._springs = self._keys[:0], self._springs[:0]

    def state(self) -> dict[str, Vector]:
        """Poses, and the springs by grain and body."""
        return {"poses": self.poses(), "keys": self._keys.copy(), "springs": self._springs.copy()}

    def restore(self, poses: Vector, keys: Vector, springs: Vector) -> None:
        """Go on from what `state` gave."""
        rows = np.asarray(poses, dtype=float)
        if len(rows) != self.count:
            raise ValueError(f"the state has {len(rows) - 1} bodies, this bed has {self.count - 1}")
        position, velocity, turn, spin = np.split(rows, [3, 6, 10], axis=1)
        self.move(range(self.count), positions=position, velocities=velocity, turns=turn, spins=spin)
        self._keys = np.array(keys, dtype=np.int64)
        self._springs = np.array(springs, dtype=float).reshape(-1, 7)
