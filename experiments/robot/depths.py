"""How deep the parts of a robot's feet go, over the depth to which their law holds."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupling.robot import LawFeet, RobotRun
from coupling.robot.feet import Part

from .laws import DEEPEST

__all__ = ["Array", "Deepest", "deepest_part", "depths_of_parts", "ups"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Deepest:
    """The part of a foot that went deepest over the depth to which its law holds."""

    name: str
    depth: float  # Of its lowest point [m]
    limit: float  # To which the law holds under it [m]
    diameter: float  # Of the circle with its area from above [m]

    @property
    def beyond(self) -> bool:
        """Whether it went deeper than its law holds."""
        return self.depth > self.limit


def ups(turns: Array) -> Array:
    """The world's upward direction in axes turned by unit quaternions, shape (n, 4): the third row of each matrix."""
    w, x, y, z = turns.T
    return np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def depths_of_parts(run: RobotRun, end: int | None = None) -> Iterator[tuple[Part, float]]:
    """Each part of a foot, with the largest depth of its lowest point [m], until row `end`."""
    feet = run.feet[:end]
    for k, foot in enumerate(run.robot.feet):
        turned = ups(feet[:, k, 3:7])
        for part in foot.parts:
            yield part, -float(_lowest(feet[:, k, 2], part, turned).min())


def deepest_part(run: RobotRun, diameters: Mapping[str, float], end: int | None = None) -> Deepest | None:
    """Of a run on a law, until row `end`; None where none goes into the ground. ``diameters``: of each part [m].

    A law without a depth of its own holds as deep as `rft` was compared with grains.
    """
    limits = run.ground.depths if isinstance(run.ground, LawFeet) else {}
    found = [
        Deepest(
            name=part.name, depth=depth, diameter=diameters[part.name],
            limit=limits.get(part.name, DEEPEST["rft"] * diameters[part.name]),
        )
        for part, depth in depths_of_parts(run, end)
        if depth > 0
    ]  # fmt: skip
    return max(found, key=lambda one: one.depth / one.limit, default=None)


def _lowest(height: Array, part: Part, turned: Array) -> Array:
    return np.asarray(height + (part.vertices @ turned.T).min(axis=0))
