"""Who sticks and who slides of points under Coulomb bounds in one step: what bodies of any kind share."""

import math
from collections.abc import Iterable, Mapping, Set

import numpy as np

from rigid.ground.reaction import Contact

from .poses import Vector

__all__ = ["StickSlip"]


class StickSlip:
    """The modes of points in contact; how forces move the points is what a subclass states.

    `points` are the members of the contacts. `sticking` holds those that stick, `sliding` the others with the
    direction in which they slide, shape (2,). A point that sticks has at most mu_s times its load. A point that slides
    has mu_d times its load, against its direction, until its slip turns back.
    """

    def __init__(self, contacts: Iterable[Contact]) -> None:
        held = list(contacts)
        self.points = [contact.member for contact in held]
        self.loads = np.array([contact.normal_force for contact in held])
        self.mu_s = np.array([float(contact.mu_s or 0.0) for contact in held])
        self.mu_d = np.array([float(contact.mu_d or 0.0) for contact in held])
        self.sticking: set[int] = set()
        self.sliding: dict[int, Vector] = {}

    def begin(self, slips: Vector, sticking: Set[int], sliding: Mapping[int, Vector]) -> None:
        """Start from the modes of the step before and the slips before this step [m/s], shape (point, 2)."""
        self.sticking = {point for point in self.points if point in sticking}
        for point, slip in zip(self.points, slips, strict=True):
            if point in self.sticking:
                continue
            size = float(np.linalg.norm(slip))
            if size == 0 or (point in sliding and float(slip @ sliding[point]) <= 0):
                self.sticking.add(point)  # it has turned back, and sticks where its bound allows it
            else:
                self.sliding[point] = slip / size

    def settle(self) -> Vector:
        """Change modes until each agrees with its force and slip; the forces of friction [N], shape (point, 2)."""
        force = np.zeros((len(self.points), 2))
        for _ in range(6 * len(self.points) + 6):
            force = np.zeros_like(force)
            for k, point in enumerate(self.points):
                if point in self.sliding:
                    force[k] = -self.mu_d[k] * self.loads[k] * self.sliding[point]
            force = self._held(force)
            slips = self._slips(force)
            over = [
                k for k, point in enumerate(self.points)
                if point in self.sticking and math.hypot(*force[k]) > self.mu_s[k] * self.loads[k] * (1 + 1e-12)
            ]  # fmt: skip
            back = [
                k for k, point in enumerate(self.points) if point in self.sliding and slips[k] @ self.sliding[point] < 0
            ]
            if not over and not back:
                return force
            for k in over:
                self.sticking.discard(self.points[k])
                self.sliding[self.points[k]] = -force[k] / math.hypot(*force[k])
            for k in back:
                del self.sliding[self.points[k]]
                self.sticking.add(self.points[k])
        # Not settled who sticks: nobody is held by more than the bound.
        size = np.maximum(np.hypot(force[:, 0], force[:, 1]), 1e-300)
        return np.asarray(force * np.minimum(1.0, self.mu_s * self.loads / size)[:, None])

    def _held(self, force: Vector) -> Vector:
        """`force` of the points that slide [N] with the forces that hold those that stick, shape (point, 2)."""
        raise NotImplementedError

    def _slips(self, force: Vector) -> Vector:
        """Horizontal velocity of each point at the step's end under `force` [m/s], shape (point, 2)."""
        raise NotImplementedError
