"""Expected strength of a bed before it is made: friction angle and cohesion of its grains, and the depth of a load.

The force on a tip of area A at the depth z is taken as F = K z + A q. K, of the weight of the grains, is 3D-RFT's for a
flat plate (`softening.bearing_gradient`), times 0.41 and times `strength`. The plate's stands for grains of any rolling
friction; 0.41 is fitted to `sand-weak` (38 of 92 N/m, docs/results/penetrate). q is what grains that stick add; it is
known by measurement for the materials of recipes.toml, and for others `RESISTANCE` times their cohesion.

The effect of another cohesion is Terzaghi's bearing capacity of a circular foot (1943, general shear), q = 1.3 c N_c.
Here N_c = (N_q - 1) cot phi and N_q = exp(pi tan phi) tan^2(45 + phi / 2) (Prandtl 1921, Reissner 1924), phi of the
grains. It is a lower bound here: a cone in `jsc-1a-loose` met some eight times that (docs/notes/bed.md).

In real grains a pressure p rests at the depth z where p = 1.3 c N_c + rho g z N_q + 0.3 rho g D N_gamma, with N_gamma =
(N_q - 1) tan(1.4 phi) (Meyerhof 1963) and the bulk density rho. It is evaluated at every friction angle that a footing
on a material may have (`footing` in recipes.toml).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dem.grains.materials import Material
from rigid.intervals import NORMAL

from .recipes import recipe_of
from .softening import PACKING, bearing_gradient

__all__ = [
    "COHESIONS", "OF_PLATE", "STICKING", "UNSURE", "Bearing", "Cohesion", "bearing_capacity", "bearing_of",
    "cohesion_in_95", "cohesion_of", "enough_cohesion", "footing_angles", "footing_depths", "friction_angle",
    "resistance_of", "sinks_past", "strength",
]  # fmt: skip

COHESIONS = (10.0, 30.0, 100.0, 300.0, 1000.0)
"""Cohesions of regolith for which an answer is given [Pa]."""
_ANGLES = ((0.0, 21.4), (0.1, 25.0), (0.3, 28.9), (0.356, 30.8), (0.8, 36.4), (1.2, 39.9))
"""Rolling friction -> friction angle at large strain of grains with a friction of 0.5 [degrees], in samples of 600
grains (docs/notes/materials.md: triaxial; the last one of a ring shear). In 2,000 grains 0.356 has 30.3."""
_WEAK = 25.0
"""The angle of the grains that K was first fitted to, `sand-weak` [degrees]."""
_PER_DEGREE = 0.092
"""Growth of ln K with the angle: 1.7 times from 25.0 to 30.8 degrees [1/degree] (docs/notes/materials.md); beyond that
it is an extrapolation."""
OF_PLATE = 0.41
"""K of `sand-weak` over that of a flat plate in 3D-RFT: 38 of 92 N/m [1]."""
_RESISTANCE = 450.0
"""What a tip meets for their cohesion in grains that stick, over it [1]: 70 of 79 kPa for 150 Pa: docs/notes/bed.md."""
_OF_ADHESION = 1.2
"""Cohesion over surface energy per diameter [1]: 1.0 to 1.5 in the four materials of JSC-1A (docs/materials.md)."""
STICKING = 1.8
"""By which the largest forces of grains that stick exceed those that chains have in others [1]: in beds of
jsc-1a-loose and -heights of 2,000 grains, four across a flat foot, moduli chosen without it had to rise 1.8 times."""
UNSURE = 2.0
"""Factor either way by which the K of a bed may differ from what is taken here [1]."""


def friction_angle(material: Material) -> float:
    """The friction angle of a material at large strain [degrees]: as measured on it, or by its rolling friction."""
    measured = recipe_of(material).angle
    if measured is not None:
        return measured
    rolling, angles = zip(*_ANGLES, strict=True)
    return float(np.interp(material.rolling_friction, rolling, angles))


def strength(material: Material) -> float:
    """K of a spike in these grains over that in `sand-weak` [1]."""
    return math.exp(_PER_DEGREE * (friction_angle(material) - _WEAK))


def cohesion_of(material: Material, grain: float) -> float:
    """Cohesion of a bed of these grains of a mean diameter [Pa]: as measured, or by their surface energy; 0 without."""
    if material.cohesion == "none":
        return 0.0
    known = recipe_of(material).cohesion
    return known if known is not None else _OF_ADHESION * material.surface_energy / grain


def bearing_capacity(cohesion: float, angle: float) -> float:
    """Bearing capacity of a circular foot at the surface [Pa], from a cohesion [Pa] and an angle [degrees]."""
    phi = math.radians(angle)
    if phi < 1e-6:
        return 1.3 * cohesion * (math.pi + 2)
    passive = math.tan(math.pi / 4 + phi / 2) ** 2
    return 1.3 * cohesion * (math.exp(math.pi * math.tan(phi)) * passive - 1) / math.tan(phi)


def resistance_of(material: Material, grain: float) -> float:
    """What a tip meets for their cohesion in grains of this mean diameter [m], as a pressure [Pa]; 0 without."""
    if material.cohesion == "none":
        return 0.0
    known = recipe_of(material).resistance
    return known if known is not None else _RESISTANCE * cohesion_of(material, grain)


@dataclass(frozen=True)
class Bearing:
    """The expected force F = stiffness z + held."""

    stiffness: float  # K [N/m]
    held: float  # What grains that stick bear at the surface [N]
    resistance: float  # The same as a pressure [Pa]

    def depth(self, load: float) -> float:
        """Depth at which a load [N] comes to rest [m]."""
        return max(0.0, load - self.held) / self.stiffness

    def load(self, depth: float) -> float:
        """Load [N] that comes to rest at a depth [m]."""
        return self.held + self.stiffness * depth


def bearing_of(material: Material, *, grain: float, gravity: float, area: float) -> Bearing:
    """Expected force law of a tip of an area [m2] in grains of this mean diameter [m] under a gravity [m/s2]."""
    plate = bearing_gradient(PACKING * material.density, gravity, material.friction) * area
    resistance = resistance_of(material, grain)
    return Bearing(OF_PLATE * strength(material) * plate, resistance * area, resistance)


def sinks_past(bears: Bearing, load: float, depths: Sequence[float]) -> bool:
    """Whether a `load` [N] sinks past all `depths` [m] even where the bed bears `UNSURE` times what is expected."""
    return all(load > UNSURE * bears.load(depth) for depth in depths)


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
