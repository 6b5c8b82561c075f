"""What a ground answers a body with: the forces at its contact points, and their sum.

These are plain values, so that the surface laws here and the bed of grains behind `coupling` speak the same language.
Vectors are in the world's axes, z up, SI units.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["Contact", "Reaction"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Contact:
    """One contact point of a body with a ground.

    The ground says *either* what the tangential force is (a bed of grains knows it) *or* between which Coulomb bounds
    it lies, and then the body's integrator resolves it: it sticks while the force is within `mu_s * normal_force` and
    slips with `mu_d * normal_force`.
    """

    point: Vector
    """Where the force acts [m], shape (3,)."""
    normal_force: float
    """Upward force on the body [N]."""
    tangential_force: Vector | None = None
    """Horizontal force on the body [N], shape (3,); None where a Coulomb bound is given instead."""
    mu_s: float | None = None
    """Coefficient of static friction [1]; None where the tangential force is given."""
    mu_d: float | None = None
    """Coefficient of sliding friction [1]; None where the tangential force is given."""


@dataclass(frozen=True, slots=True)
class Reaction:
    """What the ground did to the body during one step: the mean over the step, so force * dt is the exact impulse."""

    force: Vector
    """Total force on the body [N], shape (3,), without what a Coulomb bound leaves open."""
    torque: Vector
    """Total torque on the body about its origin [N m], shape (3,)."""
    contacts: tuple[Contact, ...] = field(default=())
    """One entry per contact point; empty where the body does not touch."""
