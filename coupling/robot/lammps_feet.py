"""Grains in LAMMPS under the feet of a robot: `LammpsFeet`."""

from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coupling.lammps import LammpsGround, OutOfPlaneError, check_count, check_plane
from dem import Bed, Facing
from rigid.ground.reaction import Reaction, Turned

from .bed_feet import BedFeet, Surface
from .body import MujocoRobot
from .distances import distances
from .models import LostRobotError

__all__ = ["LammpsFeet", "by_regions"]

STILL = 1e-9  # Turning about another axis than y over that of a joint [1]


class LammpsFeet(BedFeet, LammpsGround):
    """A bed in LAMMPS under the feet of a robot; parameters as of `BedFeet`.

    On a `coupling.lammps.LammpsBed` feet are made of spheres, capsules, cylinders, boxes and convex meshes, and turn
    about y alone: LAMMPS' regions have one constant axis. There a grain in the corner of two geoms of a foot touches
    both; on a `dem.Bed` it touches the nearest. A `FreeLammpsBed` takes any feet. Of energies see `LammpsGround`.
    """

    repeatable = False

    def __init__(self, bed: Any, *given: Any, **options: Any) -> None:
        super().__init__(bed, *given, **options)
        grain = 0.5 * bed.mean_diameter
        # A bed of one grain, which is never stepped: for the distances to the feet's shapes.
        self._ruler = Bed.from_grains(
            bed.material, positions=np.full((1, 3), grain), radii=np.array([grain]), size=bed.size, height=bed.height,
            **asdict(bed.runtime),
        )  # fmt: skip
        self._shapes = [
            (body, self._ruler.place_body(shape, (0.0, 0.0, bed.height), Facing()))
            for body, foot in zip(self.bodies, self.feet, strict=True)
            for shape in foot.shapes
        ]

    def __repr__(self) -> str:
        return f"LammpsFeet({self.bed!r} under {', '.join(foot.name for foot in self.feet)})"

    def step(
        self, position: ArrayLike, velocity: ArrayLike, dt: float, turn: Turned = None, spin: Turned = None
    ) -> Reaction:
        """As `BedFeet.step`. Raises LostRobotError for a foot that turns out of the plane of motion."""
        try:
            return super().step(position, velocity, dt, turn, spin)
        except OutOfPlaneError as error:
            raise LostRobotError(
                f"feet: {error}", remedy="hold the robot in the plane, or take ground = 'bed'"
            ) from None

    def _pieces(self) -> list[tuple[int, Surface]]:
        """Each shape of each foot."""
        still = np.zeros((len(self._shapes), 3))
        self._ruler.move_bodies(
            [shape for _, shape in self._shapes],
            positions=np.array([self.bed.body_position(body) for body, _ in self._shapes]), velocities=still,
            turns=np.array([self.bed.body_turn(body) for body, _ in self._shapes]), spins=still,
        )  # fmt: skip
        return [(body, partial(distances, self._ruler, shape)) for body, shape in self._shapes]


def by_regions(robot: MujocoRobot) -> bool:
    """Whether all feet can be regions of LAMMPS (`coupling.lammps.LammpsBed`), which turn about y alone.

    Otherwise, as with a free root, an askew foot or a shape that LAMMPS has no region for, they need a
    `coupling.lammps.FreeLammpsBed`.
    """
    pieces = []
    for foot, turn in zip(robot.feet, robot.pose.turn.reshape(-1, 4), strict=True):
        if (np.abs(robot.jacobian(foot.body)[1][[0, 2]]) > STILL).any():
            return False
        try:
            pieces += [piece for part in foot.parts for piece in check_plane(part.shapes, turn)]
            check_count(pieces)
        except ValueError:
            return False
    return True
