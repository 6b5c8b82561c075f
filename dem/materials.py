"""Grain materials: the numbers of single grains, each with where it comes from."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, field, replace

__all__ = ["MATERIALS", "Material", "SAND", "material"]


@dataclass(frozen=True)
class Material:
    """What a grain is made of. SI units; ratios are dimensionless.

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
        if not 0.01 <= self.restitution <= 1:
            refuse("restitution", "between 0.01 and 1")
        for key in ("friction", "rolling_friction"):
            if not 0 <= getattr(self, key) < math.inf:
                refuse(key, "0 or more")

    def softened(self, young: float) -> Material:
        """The same material with another Young's modulus [Pa]."""
        return replace(self, young=young)


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
