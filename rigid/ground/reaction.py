"""What a ground answers a body with: the forces at its contact points, and their sum.

These are plain values, so that the surface laws here and the bed of grains behind `coupling` speak the same language.
Vectors are in the world's axes, z up, SI units.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Contact", "Facts", "Reaction", "State", "Turned", "Vector"]

Vector = NDArray[np.float64]
Turned = ArrayLike | None  # A quaternion or a spin; None: not turned, not turning
State = dict[str, Any]  # Everything that the next steps depend on: name -> numpy array, flat, as an .npz file holds it
Facts = dict[str, Any]  # Name -> number, text, list or table of these, SI units: what run.toml and result.json can hold


@dataclass(frozen=True, slots=True)
class Contact:
    """One contact point of a body with a ground.

    The ground states *either* the tangential force (a bed of grains computes it) *or* the Coulomb bounds of it. Within
    bounds the body's integrator resolves it: the point sticks while the force is within `mu_s * normal_force`, and
    slips with `mu_d * normal_force`.
    """

    point: Vector  # Where the force acts [m], shape (3,)
    normal_force: float  # Upward force on the body [N]
    tangential_force: Vector | None = None
    """Horizontal force on the body [N], shape (3,); None where a Coulomb bound is given instead."""
    mu_s: float | None = None  # Coefficient of static friction [1]; None where the tangential force is given
    mu_d: float | None = None  # Coefficient of sliding friction [1]; None where the tangential force is given
    member: int = 0  # Of the body that touches: a spike or a row of spikes, or -1, the hull


@dataclass(frozen=True, slots=True)
class Reaction:
    """What the ground did to the body during one step: the mean over the step, so force * dt is the exact impulse."""

    force: Vector  # Total force on the body [N], shape (3,), without what a Coulomb bound leaves open
    torque: Vector  # Total torque on the body about its origin [N m], shape (3,), likewise
    contacts: tuple[Contact, ...] = ()  # One for each member of the body that touches; empty where none does
    sinkage: Mapping[int, float] = field(default_factory=dict)
    """Member -> depth of its lowest point at the step's end [m], of those near the surface."""

    @property
    def by_member(self) -> dict[int, Contact]:
        """Member -> its contact, of those that touch."""
        return {contact.member: contact for contact in self.contacts}
