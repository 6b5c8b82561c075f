"""Set-ups that the cases share: Hertz's closed forms, grains in a row, two grains that meet.

delta = (5 m* v^2 / 4 k)^(2/5), k = 4/3 E* sqrt(R*), F = k delta^1.5, t_c = 2.943275 delta / v (Johnson 1985, chapters 4
and 11).
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from dem import Bed, Grains, Material, Plane
from dem.contact.law import effective_moduli
from experiments.runs.types import Json

__all__ = [
    "ALUMINA", "CAST_IRON", "HERTZ_TIME", "RADIUS", "SIXTEEN", "contact_of", "hertz", "mass_of", "meet_floor",
    "plane_modulus", "row_of_grains", "upright_walls",
]  # fmt: skip

HERTZ_TIME = 2.943275
RADIUS = 0.0025  # of the spheres of Chung & Ooi's T3 and T4 [m]
SIXTEEN = 16
ALUMINA: Json = {"density": 4000, "young": 380e9, "poisson": 0.23}
CAST_IRON: Json = {"density": 7000, "young": 100e9, "poisson": 0.25}


def hertz(reduced_mass: float, radius: float, young: float, speed: float) -> tuple[float, float, float, float]:
    """Largest overlap [m], largest force [N], contact time [s], stiffness k [N/m^1.5] of an elastic collision.

    ``reduced_mass``: m* [kg]. ``radius``: R* [m]. ``young``: E* [Pa]. ``speed``: of approach [m/s].
    """
    k = 4 / 3 * young * math.sqrt(radius)
    overlap = (5 * reduced_mass * speed**2 / (4 * k)) ** 0.4
    return overlap, k * overlap**1.5, HERTZ_TIME * overlap / speed, k


def mass_of(density: float, radius: float) -> float:
    """Of a sphere [kg]."""
    return density * 4 / 3 * math.pi * radius**3


def plane_modulus(young: float, poisson: float) -> float:
    """E* on a rigid plane [Pa]."""
    return effective_moduli(young, poisson, math.inf, poisson)[0]


def contact_of(
    stuff: Material, radius: float, speed: float, *, pair: bool = False
) -> tuple[float, float, float, float]:
    """`hertz` of a sphere [m] that meets a rigid plane, or one like it, at this speed of approach [m/s]."""
    mass, young, poisson = mass_of(stuff.density, radius), stuff.young, stuff.poisson
    if pair:
        return hertz(mass / 2, radius / 2, effective_moduli(young, poisson, young, poisson)[0], speed)
    return hertz(mass, radius, plane_modulus(young, poisson), speed)


def upright_walls(width: float, depth: float, margin: float) -> Iterator[tuple[int, int, Plane, tuple[float, ...]]]:
    """Axis, side, shape and place of four plane walls that face one another, a margin inside the box [m]."""
    for axis, side in enumerate((width, depth)):
        for sign in (1, -1):
            at = [margin, margin, 0.0]
            at[axis] += 0.0 if sign > 0 else side
            yield axis, sign, Plane(normal=(sign * (axis == 0), sign * (axis == 1), 0)), tuple(at)


def row_of_grains(height: float = RADIUS, **options: Any) -> tuple[np.ndarray, np.ndarray, Json]:
    """Positions, radii and options of sixteen grains of 2.5 mm that touch the floor but for nothing, 12.5 mm apart."""
    i = np.arange(SIXTEEN)
    positions = np.column_stack([0.00625 + 0.0125 * (i % 4), 0.00625 + 0.0125 * (i // 4), np.full(SIXTEEN, height)])
    options = {"size": (0.05, 0.05, 0.05), "height": 0.08, "gravity": 0.0} | options
    return positions, np.full(SIXTEEN, RADIUS), options


def meet_floor(
    material: Material,
    velocities: np.ndarray,
    *,
    spins: np.ndarray | None = None,
    radius: float = RADIUS,
    step: float,
    time: float,
    **options: Any,
) -> Grains:
    """What becomes of grains of one radius, well apart, that touch the floor at time 0 with these velocities.

    ``velocities``, ``spins``: shape [grain_count, 3] [m/s, rad/s]. ``radius``: [m]. ``step``: time step [s]. ``time``:
    after which they are looked at [s].
    """
    count = len(velocities)
    side = max(4, math.ceil(math.sqrt(count)))
    pitch = 5 * radius
    i = np.arange(count)
    positions = np.column_stack([pitch * (0.5 + i % side), pitch * (0.5 + i // side), np.full(count, radius)])
    bed = Bed.from_grains(
        material, positions=positions, radii=np.full(count, radius), velocities=velocities, spins=spins,
        size=(side * pitch, side * pitch, 10 * radius), height=32 * radius, gravity=0.0, time_step=step, **options,
    )  # fmt: skip
    bed.advance(round(time / step))
    return bed.grains()
