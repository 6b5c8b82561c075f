"""Inertia of a body: put together from its parts, and refused where no body could have it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid.checks import check_above_zero

__all__ = ["Part", "check_inertia", "combine"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Part:
    """One homogeneous part of a body, its axes along the body's."""

    mass: float  # Mass [kg]
    shape: Literal["point", "ball", "box", "cylinder", "ring", "shell"] = "point"
    """A shell is an empty ball; a cylinder and a (thin) ring have their axis along `axis`."""
    size: tuple[float, ...] = ()
    """Ball, shell, ring: (radius,); cylinder: (radius, length); box: lengths along x, y, z [m]."""
    axis: Literal["x", "y", "z"] = "z"  # Axis of a cylinder or a ring
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # Where its centre is, from the body's geometric centre [m]

    def __post_init__(self) -> None:
        check_above_zero(f"kg, of a {self.shape}", mass=self.mass)
        wanted = {"point": 0, "ball": 1, "shell": 1, "ring": 1, "cylinder": 2, "box": 3}
        if self.shape not in wanted:
            raise ValueError(f"shape of a part is {self.shape!r}: there is {', '.join(wanted)}")
        if len(self.size) != wanted[self.shape] or not all(math.isfinite(s) and s > 0 for s in self.size):
            raise ValueError(
                f"size of a {self.shape} is {self.size}: it takes {wanted[self.shape]} lengths above 0 (in m)"
            )
        if self.axis not in ("x", "y", "z"):
            raise ValueError(f"axis of a {self.shape} is {self.axis!r}: it must be x, y or z")

    def inertia(self) -> Array:
        """Tensor about its own centre [kg m2], shape [3, 3]."""
        m, s = self.mass, self.size
        if self.shape == "box":
            x, y, z = s
            moments = np.array([y * y + z * z, x * x + z * z, x * x + y * y]) * m / 12
        elif self.shape in ("ball", "shell"):
            moments = np.full(3, (2 / 5 if self.shape == "ball" else 2 / 3) * m * s[0] ** 2)
        elif self.shape in ("cylinder", "ring"):
            along = (0.5 if self.shape == "cylinder" else 1.0) * m * s[0] ** 2
            length = s[1] if self.shape == "cylinder" else 0.0
            moments = np.full(3, 0.5 * along + m * length**2 / 12)
            moments["xyz".index(self.axis)] = along
        else:
            moments = np.zeros(3)
        return np.diag(moments)


def combine(parts: Sequence[Part]) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m], shape (3,), and inertia about it [kg m2], shape [3, 3], of `parts` together.

    Steiner: I = sum of I_k + m_k (r_k^2 E - r_k r_k^T). Raises ValueError without parts.
    """
    if not parts:
        raise ValueError("parts is empty: a body has at least one")
    mass = sum(part.mass for part in parts)
    centre = sum((part.mass * np.array(part.position) for part in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        r = np.array(part.position) - centre
        tensor += part.inertia() + part.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return mass, centre, tensor


def check_inertia(tensor: ArrayLike, mass: float, reach: float, *, called: str = "inertia") -> Array:
    """`tensor` [kg m2] as an array [3, 3], if a body of `mass` [kg] with no matter farther out than `reach` [m] has it.

    Raises ValueError for a tensor that is not symmetric, and for a principal moment of 0 or less or above the sum of
    the other two. No moment may exceed m r^2, that of all the mass at `reach` r, and their sum 2 m r^2.
    """
    inertia = np.asarray(tensor, dtype=float)
    if inertia.shape != (3, 3) or not np.isfinite(inertia).all():
        raise ValueError(f"{called} must be a tensor of 3 x 3 numbers (kg m2)")
    if not np.allclose(inertia, inertia.T, rtol=1e-9, atol=1e-12 * abs(inertia).max()):
        raise ValueError(f"{called} = {inertia.tolist()}: it must be symmetric")
    a, b, c = (float(moment) for moment in np.linalg.eigvalsh(inertia))  # in ascending order
    shown = f"{called} has the principal moments {a:.4g}, {b:.4g}, {c:.4g} kg m2"
    if a <= 0:
        raise ValueError(f"{shown}: each must be above 0")
    if c > (a + b) * (1 + 1e-9):
        raise ValueError(f"{shown}: no body has one above the sum of the other two")
    most = mass * reach**2
    if c > most * (1 + 1e-9) or a + b + c > 2 * most * (1 + 1e-9):
        raise ValueError(
            f"{shown}: with {mass:g} kg of which nothing is farther than {reach:.4g} m from the centre none can exceed "
            f"m r^2 = {most:.4g} kg m2, nor all three together {2 * most:.4g}"
        )
    return inertia
