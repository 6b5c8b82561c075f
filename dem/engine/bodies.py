"""The bodies in a bed: putting them in, moving them, and the forces of the grains on them."""

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from dem.contact.law import pair_row
from dem.grains.materials import Facing
from dem.shapes.basic import Plane, Shape

from .base import FLOOR, BedBase, check_array
from .engine import MOST_PRIMITIVES
from .lists import MOST_BODIES

__all__ = ["BedBodies"]

Array = np.ndarray


class BedBodies(BedBase):
    """A bed into which bodies are put; they move as they are set to, and the grains give way."""

    def add_body(self, shape: Shape | Sequence[Shape], *, position: Sequence[float], **facing: Any) -> int:
        """Put a body among the grains and return its number. ``move_body`` sets how it moves.

        Args:
            shape: one or several of dem's Ball, Cylinder, Cone, Capsule, Box, Tube, Polyhedron, Mesh, Plane and Placed,
                in the body's frame. Their union is the body, and touches a grain once. What lies farther sideways from
                the body's origin than half the bed's period touches nothing. It is warned of
                (UserWarning) as the body is put in, before it turns.
            position: of the body's origin [m].
            facing: as ``dem.Facing`` has it: friction, restitution, rolling_friction of a grain on the body, young [Pa]
                and poisson of the body, surface_energy of the two [J/m2]. What is not given is the grains' own; without
                young the body is rigid.

        Raises ValueError: no shape, a number that no pair can have, too many bodies, a grain already in contact by more
        than the overlap bound.
        """
        self.check_valid()
        body = self.place_body(shape, position, Facing(**facing))
        self._warn_of_far_parts(shape, body)
        kept = self.max_overlap
        self.max_overlap = 0.0
        self.make_lists()
        self.compute_forces()
        found = self.max_overlap
        if found > self.overlap_limit:
            self.engine.body_count[None] = body
            self.engine.drop_shapes(int(self.engine.body_primitives[body][0]))
            self.make_lists()
            self.max_overlap = kept
            self.compute_forces()
            raise ValueError(
                f"the body at {tuple(position)} m starts in overlap with a grain by {100 * found:.2g} % of its "
                f"diameter (the bound is {100 * self.overlap_limit:g} %); start it higher"
            )
        self.max_overlap = max(kept, found)
        return body

    def _warn_of_far_parts(self, shape: Shape | Sequence[Shape], body: int) -> None:
        """Warn of parts that no grain meets, because they lie farther sideways than half the bed's period.

        What spans the whole period lacks nothing.
        """
        for part in [shape] if isinstance(shape, Shape) else shape:
            for name, low, high, period in zip("xy", *part.bounds(), self.size, strict=False):
                half, far = 0.5 * period * (1 + 1e-6), max(-low, high)
                if far > half and min(-low, high) < half:
                    warnings.warn(
                        f"a {type(part.bare).__name__} of body {body} reaches {far:.4g} m along {name} from the body's "
                        f"origin. Beyond half the bed's period, {half:.4g} m, no grain touches it: use a wider bed, or "
                        f"put the origin in the middle of the body",
                        stacklevel=3,
                    )

    def place_body(self, shape: Shape | Sequence[Shape], position: Sequence[float], facing: Facing) -> int:
        """``add_body`` without new lists, and without a check of the grains that it overlaps."""
        e = self.engine
        parts: list[Any] = [shape] if isinstance(shape, Shape) else list(shape)
        body = int(e.body_count[None])
        used = int(e.body_primitives[body - 1][1]) if body else 0
        if not parts:
            raise ValueError("shape is empty; a body needs at least one primitive")
        for part in parts:
            if not isinstance(part, Shape):
                names = "Ball, Cylinder, Cone, Capsule, Box, Tube, Polyhedron, Mesh, Plane or Placed"
                raise ValueError(f"shape holds {part!r}, which is no shape; use {names}")
        if len(position) != 3 or not all(math.isfinite(p) for p in position):
            raise ValueError(f"position = {tuple(position)} must be 3 finite numbers [m]")
        if body >= MOST_BODIES or used + len(parts) > MOST_PRIMITIVES:
            raise ValueError(f"a bed takes at most {MOST_BODIES} bodies of {MOST_PRIMITIVES} primitives in all")
        self.set_facing(body, facing)
        e.put_shapes(used, parts)
        e.body_primitives[body] = [used, used + len(parts)]
        e.body_extent[body] = min(1e35, max(p.extent() for p in parts))
        e.body_count[None] = body + 1
        self.move_body(body, position=position, velocity=(0, 0, 0), turn=(1, 0, 0, 0), spin=(0, 0, 0))
        if body == FLOOR and any(isinstance(p, Plane) for p in parts):
            self.has_floor = True
        return body

    def set_facing(self, body: int, facing: Facing) -> None:
        """How grains touch a body, from now on. Raises ValueError as ``Facing.refuse_for`` does."""
        facing.refuse_for(self.material)
        self.engine.body_pair[body] = pair_row(self.material, facing, tensile=self.settings.tensile)

    def move_body(
        self,
        body: int,
        *,
        position: Sequence[float] | None = None,
        velocity: Sequence[float] | None = None,
        turn: Sequence[float] | None = None,
        spin: Sequence[float] | None = None,
    ) -> None:
        """Set a body's pose and the velocity that it holds while the bed advances.

        Args:
            position: of its origin [m]. velocity: [m/s].
            turn: unit quaternion, scalar first. spin: angular velocity [rad/s].

        Raises ValueError: a body that is not there, numbers that are not finite, a turn that is not of length 1.
        """
        self.check_body(body)
        given = {"position": position, "velocity": velocity, "turn": turn, "spin": spin}
        for name, value in given.items():
            if value is None:
                continue
            numbers, width = [float(v) for v in value], 4 if name == "turn" else 3
            if len(numbers) != width or not all(map(math.isfinite, numbers)):
                raise ValueError(f"{name} = {tuple(value)} must be {width} finite numbers")
            if name == "turn":
                _refuse_turns("turn", np.array([numbers]))
            getattr(self.engine, f"body_{name}")[body] = numbers

    def move_bodies(
        self, bodies: Sequence[int], *, positions: Array, velocities: Array, turns: Array, spins: Array
    ) -> None:
        """Set the pose and motion of several bodies at once: faster than ``move_body``, where a platform has many.

        Args:
            bodies: their numbers. positions, velocities, spins: [m], [m/s], [rad/s], each of shape [body, 3].
            turns: unit quaternions, scalar first, shape [body, 4].

        Raises ValueError: a body that is not there, numbers that are not finite, a wrong shape, a turn not of length 1.
        """
        self.check_valid()
        count = int(self.engine.body_count[None])
        if not all(0 <= body < count for body in bodies):
            raise ValueError(f"bodies = {list(bodies)}: the bed has bodies 0 to {count - 1}")
        given = {"positions": positions, "velocities": velocities, "turns": turns, "spins": spins}
        for name, values in given.items():
            check_array(name, np.asarray(values, dtype=float), (len(bodies), 4 if name == "turns" else 3))
        _refuse_turns("turns", np.asarray(turns, dtype=float))
        self.engine.place_bodies(np.array(bodies, dtype=np.int32), np.hstack(list(given.values())).astype(float))

    def body_position(self, body: int) -> np.ndarray:
        """Position of a body's origin [m], shape [3]."""
        self.check_body(body)
        return np.array(self.engine.body_position[body], dtype=float)

    def body_turn(self, body: int) -> np.ndarray:
        """Rotation of a body: a unit quaternion, scalar first, shape [4]."""
        self.check_body(body)
        return np.array(self.engine.body_turn[body], dtype=float)

    def reaction(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean force [N] and torque about its origin [N m] by the grains in the last ``advance``, each of shape [3]."""
        self.check_body(body)
        row = self.reactions()[body]
        return row[:3], row[3:]

    def reactions(self) -> np.ndarray:
        """Force [N] and torque [N m] as ``reaction`` has them, of every body there may be, shape [body, 6]."""
        if self.tallied is None:
            self.tallied = self.tally()[0]
        total = self.tallied
        if self.sleeper is not None:
            total = total.copy()
            total[FLOOR] += self.sleeper.on_floor()
        return total / max(1, self.reaction_steps)


def _refuse_turns(name: str, turns: np.ndarray) -> None:
    """Raise ValueError where a quaternion of shape [n, 4] is not of length 1, which would stretch the body."""
    for turn in turns[~(np.abs((turns**2).sum(axis=1) - 1) < 1e-3)]:
        raise ValueError(f"{name} = {tuple(map(float, turn))} must be of length 1 (a unit quaternion, scalar first)")
