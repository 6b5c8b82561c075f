"""Platforms that hop by flywheels: geometry, mass, inertia, wheels, as numbers and as a mesh.

Body axes at rest: x forward, y to the left, z up, the origin at the geometric centre. A turn about +y takes the
platform towards +x, as theta of the planar model does. The platform touches the ground with its *tips*: the ends of its
spikes, or its corners where it has none. It stands on the lowest tips, and tumbles over those of them that are farthest
ahead.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid.checks import check_above_zero

from .actuation import Flywheel
from .inertia import check_inertia
from .solids import Mesh, capped_rod, convex_mesh, merge

__all__ = ["Platform", "Stance"]

Array = NDArray[np.float64]


class Stance(NamedTuple):
    """How a platform stands ready to tumble towards +x, in the terms of the planar model."""

    spike_length: float  # l: from the centre to the tips it tumbles over, in the plane of motion [m]
    lean: float  # Angle of that line from the downward vertical [rad]; pi/8 for the Hedgehog
    row: tuple[int, ...]  # The tips that it tumbles over
    rear: tuple[int, ...]  # The other tips that it stands on


@dataclass(frozen=True, kw_only=True, eq=False)
class Platform:
    """An internally actuated platform. Raises ValueError for a body that cannot be."""

    name: str
    mass: float  # With its wheels [kg]
    inertia: Array
    """About the centre of mass [kg m2], shape [3, 3]: with the wheels' mass, but without J_w about their axes."""
    tips: Array
    """Where it touches the ground: the outermost points of its spikes, or its corners [m], shape [tip_count, 3]."""
    hull_vertices: Array  # Corners of its convex hull, spikes left out [m], shape [n, 3]
    wheels: tuple[Flywheel, ...]
    tip_radius: float = 0.0
    """Radius of the balls at the ends of its spikes, and of their shafts [m]; 0 where it has none."""
    spike_clear: float = 0.0  # How far each spike stands out of the hull, along itself [m]; 0 where it has none
    centre_of_mass: Array = field(default_factory=lambda: np.zeros(3))  # From the geometric centre [m], shape (3,)
    sources: Mapping[str, str] = field(default_factory=dict)  # Where each number comes from

    def __post_init__(self) -> None:
        check_above_zero("kg", mass=self.mass)
        for key in ("tips", "hull_vertices", "centre_of_mass"):
            object.__setattr__(self, key, np.array(getattr(self, key), dtype=float))
        if self.tips.ndim != 2 or self.tips.shape[1] != 3 or len(self.tips) < 3:
            raise ValueError(f"tips has the shape {self.tips.shape}: a platform stands on three at least, each (3,)")
        inertia = check_inertia(self.inertia, self.mass, self.reach + float(np.linalg.norm(self.centre_of_mass)))
        object.__setattr__(self, "inertia", inertia)
        for key, wheel in zip("xyz"[: len(self.wheels)] or "", self.wheels, strict=False):
            axis = np.array(wheel.axis)
            about = float(axis @ inertia @ axis)
            if wheel.inertia >= about:
                raise ValueError(
                    f"inertia of wheel {key} is {wheel.inertia:g} kg m2: the whole platform has only {about:g} about "
                    f"that axis"
                )
        self.stance()

    def __repr__(self) -> str:
        return f"Platform({self.name}, {self.mass:g} kg, {len(self.tips)} tips, {len(self.wheels)} wheels)"

    @property
    def reach(self) -> float:
        """Distance of its outermost point from the geometric centre [m]."""
        return float(np.linalg.norm(np.concatenate([self.tips, self.hull_vertices]), axis=1).max())

    @property
    def spike_count(self) -> int:
        """How many spikes stand out of the hull."""
        return len(self.tips) if self.tip_radius > 0 else 0

    def stance(self, tolerance: float = 1e-6) -> Stance:
        """How it stands on its lowest tips, level within `tolerance` [m]. Raises ValueError if it would fall over."""
        lowest = np.flatnonzero(self.tips[:, 2] < self.tips[:, 2].min() + tolerance)
        ahead = self.tips[lowest, 0]
        row = lowest[ahead > ahead.max() - tolerance]
        x, z = float(self.tips[row[0], 0]), float(self.tips[row[0], 2])
        if x <= 0 or self.tips[lowest, 0].min() >= 0 or z >= 0:
            raise ValueError("tips: the lowest ones must lie on both sides of the centre, or it would fall over")
        rear = tuple(int(k) for k in lowest if k not in row)
        return Stance(math.hypot(x, z), math.atan2(x, -z), tuple(int(k) for k in row), rear)

    def moment(self, axis: ArrayLike = (0.0, 1.0, 0.0)) -> float:
        """Moment of inertia about `axis` through the centre of mass [kg m2]; by default J of the planar model."""
        a = np.asarray(axis, dtype=float)
        return float(a @ self.inertia @ a / (a @ a))

    def wheel(self, axis: ArrayLike = (0.0, 1.0, 0.0)) -> Flywheel:
        """The wheel about `axis`. Raises ValueError where there is none."""
        a = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
        for wheel in self.wheels:
            if abs(float(np.array(wheel.axis) @ a)) > 1 - 1e-9:
                return wheel
        raise ValueError(f"{self.name} has no wheel about {tuple(float(part) for part in a)}")

    def hull(self) -> Mesh:
        """The hull without its spikes: closed, normals outward."""
        return convex_mesh(self.hull_vertices)

    def mesh(self, *, around: int = 24) -> Mesh:
        """Hull and spikes, each closed by itself, normals outward; `around` corners make a shaft round.

        A spike begins in the hull, a tenth of its way to the centre, and ends with a half ball at its tip.
        """
        bodies = [self.hull()]
        if self.tip_radius > 0:
            inner = float(np.linalg.norm(self.hull_vertices, axis=1).min()) * 0.9
            for tip in self.tips:
                start = tip / np.linalg.norm(tip) * inner
                bodies.append(capped_rod(start, tip, self.tip_radius, around=around))
        return merge(bodies)
