"""Grain materials: the numbers of single grains, each with where it comes from; and those of what grains meet."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, field, replace

__all__ = ["COHESIONS", "Facing", "MATERIALS", "Material", "SAND", "material"]

COHESIONS = ("none", "dmt", "jkr")
"""The laws of cohesion, see ``dem.cohesion``."""
LEAST_RESTITUTION = 0.01


@dataclass(frozen=True)
class Material:
    """What a grain is made of, and how two grains of it touch. SI units; ratios are dimensionless.

    Attributes:
        friction, restitution, rolling_friction: of two grains on one another.
        cohesion: "none", "dmt" or "jkr" (``dem.cohesion``).
        surface_energy: gamma [J/m2], half the work of adhesion of two grains; 0 without cohesion.

    Raises:
        ValueError: a number that no material can have, with the key and what would do.
    """

    name: str
    density: float
    young: float
    poisson: float
    friction: float
    restitution: float
    rolling_friction: float = 0.0
    cohesion: str = "none"
    surface_energy: float = 0.0
    sources: dict[str, str] = field(default_factory=dict, compare=False)

    def __post_init__(self):
        def refuse(key, bounds):
            raise ValueError(f"material {self.name!r}: {key} = {getattr(self, key)} must be {bounds}")

        for key in ("density", "young"):
            if not getattr(self, key) > 0:
                refuse(key, "positive")
            if math.isinf(getattr(self, key)):
                refuse(key, "finite")
        if not 0 <= self.poisson < 0.5:
            refuse("poisson", "at least 0 and below 0.5")
        if not LEAST_RESTITUTION <= self.restitution <= 1:
            refuse("restitution", f"between {LEAST_RESTITUTION} and 1")
        for key in ("friction", "rolling_friction"):
            if not 0 <= getattr(self, key) < math.inf:
                refuse(key, "0 or more")
        if self.cohesion not in COHESIONS:
            near = difflib.get_close_matches(str(self.cohesion).lower(), COHESIONS, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(
                f"material {self.name!r}: cohesion = {self.cohesion!r} is no law; there is {', '.join(COHESIONS)}{hint}"
            )
        if self.cohesion == "none":
            if self.surface_energy != 0:
                refuse("surface_energy", "0 without a law of cohesion; set cohesion to 'dmt' or 'jkr' [J/m2]")
        elif not 0 < self.surface_energy < math.inf:
            refuse("surface_energy", f"positive with cohesion {self.cohesion!r} [J/m2]")

    def softened(self, young: float) -> Material:
        """The same material with another Young's modulus [Pa]."""
        return replace(self, young=young)


@dataclass(frozen=True)
class Facing:
    """How a grain touches something else than a grain: the floor, a wall, a body. None: as two grains touch.

    Attributes:
        friction, restitution, rolling_friction: of a grain on it [1].
        young: of what it is made of [Pa]; rigid when None. poisson: [1].
        surface_energy: of the pair [J/m2], half its work of adhesion; 0 for what grains do not stick to.

    Raises:
        ValueError: a number that no pair can have, with the key and what would do.
    """

    friction: float | None = None
    restitution: float | None = None
    rolling_friction: float | None = None
    young: float | None = None
    poisson: float = 0.3
    surface_energy: float | None = None

    def __post_init__(self):
        def refuse(key, bounds):
            raise ValueError(f"{key} = {getattr(self, key)} must {bounds}")

        for key in ("friction", "rolling_friction", "surface_energy"):
            value = getattr(self, key)
            if value is not None and not 0 <= value < math.inf:
                refuse(key, "be 0 or more")
        if self.restitution is not None and not LEAST_RESTITUTION <= self.restitution <= 1:
            refuse("restitution", f"lie between {LEAST_RESTITUTION} and 1")
        if self.young is not None and not self.young > 0:
            refuse("young", "be positive [Pa], or None for what is rigid")
        if not 0 <= self.poisson < 0.5:
            refuse("poisson", "be at least 0 and below 0.5")

    def refuse_for(self, material: Material) -> None:
        """Raise ValueError for a surface energy, where the material has no law of cohesion."""
        if self.surface_energy and material.cohesion == "none":
            raise ValueError(
                f"surface_energy = {self.surface_energy} J/m2 needs a law: the material {material.name!r} has cohesion "
                f"'none'; give it 'dmt' or 'jkr'"
            )


SAND = Material(
    name="sand",
    density=2650.0,
    young=70e9,
    poisson=0.25,
    friction=0.5,
    restitution=0.5,
    rolling_friction=0.1,
    sources={
        "density": "quartz; Toyoura and F-75 Ottawa sand",
        "young": "quartz, lower end of 70 to 90 GPa; runs soften it and say by how much",
        "poisson": "within the usual 0.2 to 0.3",
        "friction": "Bhattacharya & Lee 2021 use 0.5 for Toyoura sand",
        "restitution": "a guess, lower end of the usual 0.5 to 0.8",
        "rolling_friction": "a guess within the usual 0.05 to 0.3, not calibrated to a friction angle yet",
    },
)
"""Fine silica sand. Its rolling friction and restitution are guesses within the field's usual range."""

MATERIALS = {SAND.name: SAND}


def material(name: str | Material) -> Material:
    """The material of that name, or the material itself.

    Raises:
        ValueError: no material of that name; the message lists those there are.
    """
    if isinstance(name, Material):
        return name
    found = MATERIALS.get(str(name).lower())
    if found is None:
        near = difflib.get_close_matches(str(name).lower(), MATERIALS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"material = {name!r} is not known; there is {', '.join(sorted(MATERIALS))}{hint}")
    return found
