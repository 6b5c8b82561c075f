"""Terzaghi's circular foot in real grains: the cohesion that supports a load at the surface, and the depth without it.

A pressure p rests at the depth z where (Terzaghi 1943, general shear)

    p = 1.3 c N_c + rho g z N_q + 0.3 rho g D N_gamma,

N_q and N_c of Prandtl and Reissner (`bearing`), N_gamma = (N_q - 1) tan(1.4 phi) of Meyerhof (1963), rho the bulk
density. It is evaluated at every friction angle of a material that a footing may have (`footing` in recipes.toml).
"""

import math
from dataclasses import dataclass

from dem.grains.materials import Material
from rigid.intervals import NORMAL

from .bearing import bearing_capacity, friction_angle
from .recipes import recipe_of
from .softening import PACKING

__all__ = ["Cohesion", "cohesion_in_95", "enough_cohesion", "footing_angles", "footing_depths"]


@dataclass(frozen=True)
class Cohesion:
    """The cohesion of a material with the ends of its 95 % interval, which is not below 0 [Pa]."""

    value: float
    least: float
    most: float


def cohesion_in_95(material: Material) -> Cohesion | None:
    """The cohesion of a material [Pa]; None where its error is not known."""
    recipe = recipe_of(material)
    if recipe.cohesion is None or recipe.cohesion_std is None:
        return None
    half = NORMAL * recipe.cohesion_std
    return Cohesion(recipe.cohesion, max(0.0, recipe.cohesion - half), recipe.cohesion + half)


def footing_angles(material: Material) -> tuple[float, ...]:
    """Friction angles for a footing [degrees], least first; the one at large strain where no others are known."""
    return recipe_of(material).footing or (friction_angle(material),)


def enough_cohesion(pressure: float, angle: float) -> float:
    """Cohesion that supports a pressure [Pa] at the surface by itself, at a friction angle [degrees]."""
    return pressure / bearing_capacity(1.0, angle)


def footing_depths(
    material: Material, pressure: float, *, gravity: float, diameter: float, cohesion: float = 0.0
) -> tuple[float, float]:
    """Least and largest depth [m] at which a pressure [Pa] rests, over the friction angles of the material.

    ``gravity``: [m/s2]. ``diameter``: Of the foot [m]. ``cohesion``: Of the soil [Pa].
    """
    recipe = recipe_of(material)
    weight = (recipe.rained or recipe.packed or PACKING) * material.density * gravity
    depths = [_depth(pressure, weight, diameter, cohesion, angle) for angle in footing_angles(material)]
    return min(depths), max(depths)


def _depth(pressure: float, weight: float, diameter: float, cohesion: float, angle: float) -> float:
    """The same at one friction angle [degrees]; ``weight``: of the soil [N/m3]."""
    phi = math.radians(angle)
    of_depth = math.exp(math.pi * math.tan(phi)) * math.tan(math.pi / 4 + phi / 2) ** 2
    of_width = (of_depth - 1) * math.tan(1.4 * phi)
    held = bearing_capacity(cohesion, angle) + 0.3 * weight * diameter * of_width
    return max(0.0, pressure - held) / (weight * of_depth)
