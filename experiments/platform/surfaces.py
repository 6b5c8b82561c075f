"""The materials behind ``--surface``: stiffness, damping and friction of each, with where the numbers come from."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hedgebed_renamed import material_of_today
from rigid.checks import nearest

__all__ = ["DEFAULT_SURFACE", "Surface", "find_surface", "surface_names", "surface_of_grains"]

FILE = Path(__file__).parent / "surfaces.toml"
DEFAULT_SURFACE = "brick"
"""The surface of every command that is given none: of the paper's two hard ones the rougher, as rock is, and that
on which most of what the paper states comes out (docs/tumble.md)."""


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Numbers of one material, per row of two spikes."""

    name: str
    stiffness: float  # K [N/m]
    damping: float  # C [N s/m], while going in
    mu_s: float  # coefficient of static friction [1]
    mu_d: float  # coefficient of sliding friction [1]
    source: str
    granular: bool = False
    grains: str | None = None  # the material of `dem` whose grains a bed of it is made of
    packing: float | None = None
    """Packing fraction of the samples that those grains were calibrated with [1]; None: of no certain one."""
    spike: float | None = None
    """Diameter of the spikes with ball tips that K and C are of [m]; None: of no certain ones."""
    guess: bool = False  # whether nothing but judgement stands behind the numbers
    stiffness_std: float | None = None  # standard deviation of K [N/m]; None: not known
    damping_std: float | None = None  # of C [N s/m]
    stiffness_range: tuple[float, float] | None = None
    """Within which K may lie [N/m], where runs leave it that open; None: `source` states what is known."""


@cache
def _surfaces() -> dict[str, Surface]:
    tables = tomllib.loads(FILE.read_text(encoding="utf-8"))
    return {name: Surface(name=name, **_tuples(table)) for name, table in tables.items()}


def _tuples(table: dict[str, Any]) -> dict[str, Any]:
    """The same with tuples for lists."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}


def surface_names() -> list[str]:
    """The names there are."""
    return list(_surfaces())


def surface_of_grains(material: str) -> str | None:
    """The surface whose beds are made of these grains; None where there is none."""
    return next((name for name, surface in _surfaces().items() if surface.grains == material), None)


def find_surface(name: str) -> Surface:
    """The surface called `name`, by an earlier name with a FutureWarning. Raises ValueError naming those there are."""
    surfaces, name = _surfaces(), material_of_today(name)
    if name not in surfaces:
        of_it = surface_of_grains(name)
        hint = f"did you mean {of_it!r}, the surface of these grains?" if of_it else nearest(name, surfaces)
        raise ValueError(f"surface = {name!r} is not known; {hint}")
    return surfaces[name]
