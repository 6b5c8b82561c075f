"""Grains in LAMMPS as a ground: `BedGround` with the energies that LAMMPS reports."""

import math
from typing import Any

import numpy as np

from coupling.bed_ground import BedGround
from coupling.poses import Vector
from rigid.ground.reaction import Facts

from .bed import LammpsBed
from .law import kinetic_energy, spring_energy, spring_force

__all__ = ["LammpsGround"]


class LammpsGround(BedGround):
    """A `LammpsBed` under a body; parameters as of `BedGround`.

    Only explicit coupling is possible, because a step cannot be taken back. LAMMPS reports the kinetic energy. The
    energies of height and of the normal springs, with DMT's cohesion, follow from the grains' places. The energy of
    friction's springs and the losses are not reported. With JKR neither are the normal springs: whether a stretched
    contact holds depends on its history. Nor are they under a spike with a cone: it is a pyramid in LAMMPS
    (`polyhedra.pyramid_corners`), not the cone whose distance to the grains is known. There `pushes` are refused.
    """

    bed: LammpsBed

    def __repr__(self) -> str:
        return f"LammpsGround({self.bed!r} under {self.spike or f'{len(self.members)} members'})"

    def describe(self) -> Facts:
        """As `BedGround.describe`, with the program and the number of its processes."""
        return super().describe() | {"engine": "LAMMPS", "ranks": self.bed.ranks}

    def checkpoint(self) -> Any:
        """Raises ValueError: steps in LAMMPS are not repeated."""
        raise ValueError(
            "iterations is above 1: a bed in LAMMPS takes explicit coupling alone: expected iterations = 1"
        )

    def energies(self) -> dict[str, float]:
        """Kinetic energy, height and, but for JKR and a cone, normal springs of the grains, `copies` times [J]."""
        bed = self.bed
        grains = bed.grains(contacts=False)
        moving = kinetic_energy(grains.mass, grains.radius, grains.velocity, grains.spin)
        height = -float(grains.mass @ (grains.position @ np.array(bed.gravity)))
        found = {"kinetic": moving, "potential": height}
        law = bed.material.cohesion
        if law != "jkr" and not self._is_cone:
            found["normal"] = bed.spring_energy(grains.position)
            for body, surface in self._pieces():
                distance, _, curvature = surface(grains.position.copy())
                pressed = np.maximum(0.0, grains.radius - distance)
                radius = grains.radius / (1 + grains.radius * curvature)
                found["normal"] += spring_energy(bed.pair_of(body), law, pressed, radius)
        return {name: self.copies * value for name, value in found.items()}

    @property
    def _is_cone(self) -> bool:
        return self.spike is not None and self.spike.tip == "cone"

    def _pieces(self) -> list[tuple[int, Any]]:
        """Bodies and their surfaces, several of a body where a grain can touch several at once."""
        return list(self._surfaces().items())

    def work_taken(self) -> dict[str, float]:
        """Nothing: LAMMPS does not sum what contacts take."""
        return {}

    def pushes(self) -> tuple[Vector, Vector]:
        """As `BedGround.pushes`, from the grains' places, with the cohesion of grains that touch.

        Raises ValueError for a spike with a cone.
        """
        if self._is_cone:
            raise ValueError(
                f"{self.spike}: in LAMMPS a cone is a pyramid, on which the pushes of grains are not known"
            )
        bed, grains = self.bed, self.bed.grains(contacts=False)
        points, forces = [np.zeros((0, 3))], [np.zeros((0, 3))]
        for body, surface in self._pieces():
            distance, normal, curvature = surface(grains.position.copy())
            overlap = grains.radius - distance
            touching = overlap > 0
            radius = (grains.radius / (1 + grains.radius * curvature))[touching]
            push = spring_force(bed.pair_of(body), bed.material.cohesion, overlap[touching], radius)
            points.append(grains.position[touching] - distance[touching, None] * normal[touching])
            forces.append(-push[:, None] * normal[touching])
        return np.concatenate(points) - self.origin, np.concatenate(forces)

    def angular_momentum(self) -> Vector:
        """Not a number: LAMMPS does not report what crosses the periodic sides."""
        return np.full(3, math.nan)
