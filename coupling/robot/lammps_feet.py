"""Grains in LAMMPS under the feet of a robot that moves in the plane: `LammpsFeet`."""

from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coupling.lammps import LammpsGround, OutOfPlaneError, check_count, check_plane
from dem import Bed
from rigid.ground.reaction import Reaction, Turned

from .bed_feet import BedFeet, Surface
from .body import MujocoRobot
from .distances import distances
from .models import LostRobotError

__all__ = ["LammpsFeet", "refuse_in_lammps"]

STILL = 1e-9  # Turning about another axis than y over that of a joint [1]


class LammpsFeet(BedFeet, LammpsGround):
    """A `coupling.lammps.LammpsBed` under the feet of a robot; parameters as of `BedFeet`.

    Feet are made of spheres, capsules, cylinders, boxes and convex meshes, and turn about y alone: LAMMPS' regions have
    one constant axis. A grain in the corner of two geoms of a foot touches both; on a `dem.Bed` it touches the nearest.
    Of energies see `LammpsGround`.
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
            (body, self._ruler.add_body(shape, position=(0.0, 0.0, bed.height)))
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


def refuse_in_lammps(robot: MujocoRobot) -> None:
    """Raise ValueError, naming it, for a geom that LAMMPS has no region for, and a foot that can leave the plane."""
    pieces = []
    for foot, turn in zip(robot.feet, robot.pose.turn.reshape(-1, 4), strict=True):
        out_of_plane = np.abs(robot.jacobian(foot.body)[1][[0, 2]]).max(axis=0) > STILL
        if out_of_plane.any():
            joint = robot.model.joint(int(robot.model.dof_jntid[np.argmax(out_of_plane)]))
            raise ValueError(
                f"feet: the joint {joint.name or joint.id!r} can turn {foot.name!r} out of the plane of x and z; in "
                f"LAMMPS a foot turns about y alone: ground = 'bed' takes this robot"
            )
        for part in foot.parts:
            try:
                pieces += check_plane(part.shapes, turn)
            except OutOfPlaneError:
                raise ValueError(
                    f"feet: {part.name!r} stands askew: in LAMMPS an axis of it lies in the plane of x and z, or along "
                    f"y; ground = 'bed' takes it"
                ) from None
            except ValueError as error:
                raise ValueError(
                    f"feet: {part.name!r} is of the kind {part.kind}, which ground = 'bed' alone takes here: {error}"
                ) from None
    try:
        check_count(pieces)
    except ValueError as error:
        raise ValueError(f"feet: {error}") from None
