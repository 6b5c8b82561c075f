"""Default preparation of a bed of each material, what is known of its strength, how densely it rains: recipes.toml."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from dem.grains.materials import Material
from experiments.runs.types import Json

__all__ = ["POURED_DRY", "Recipe", "recipe_of"]

_FILE = Path(__file__).with_suffix(".toml")
POURED_DRY = ("rain:dry", "stick", "level")
"""Stages of any other material whose grains stick: enlarged grains that stick rain into a gauze (docs/bed.md)."""


@dataclass(frozen=True)
class Recipe:
    """The preparation and the strength of a bed of one material."""

    stages: tuple[str, ...] | None = None  # None: rained and levelled
    cohesion: float | None = None  # [Pa]; None: not known
    cohesion_std: float | None = None  # [Pa]; None: not known
    angle: float | None = None  # Friction angle at large strain [degrees]; None: as of the rolling friction
    resistance: float | None = None  # What a tip meets for the cohesion alone [Pa]; None: not known
    footing: tuple[float, ...] | None = None  # Friction angles for a footing, least first [degrees]; None: not known
    packed: float | None = None  # Packing fraction of the real soil, where grains stick [1]; None: not known
    rained: float | None = None  # Packing fraction of one size, rained and levelled; graded beds get it too [1]
    source: str = ""


@cache
def _recipes() -> dict[str, Recipe]:
    tables = tomllib.loads(_FILE.read_text(encoding="utf-8"))
    return {name: Recipe(**_frozen(table)) for name, table in tables.items()}


def _frozen(table: Json) -> Json:
    """A table with tuples in place of lists."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}


def recipe_of(material: Material) -> Recipe:
    """The recipe of a material: its own if it has one; poured dry if its grains stick; else none."""
    other = Recipe() if material.cohesion == "none" else Recipe(stages=POURED_DRY)
    return _recipes().get(material.name, other)
