"""Grains that are poured as they do not stick, and stick once they lie: how a fine powder gets to its density here.

Enlarged grains that keep a powder's strength rain into a gauze far looser than the powder ever is, and neither taps nor
a lid bring them together (docs/bed.md). So they are poured without adhesion, with their own friction or, for a denser
bed, with less of it and no rolling friction; once the bed lies as it should, they touch as their material says, the
contacts with their histories. ``dem.measure.element`` presses its samples, to which materials are calibrated, in the
same way.
"""

from dataclasses import replace

from dem.contact.timestep import time_step_for
from dem.engine import state
from dem.engine.base import FLOOR
from dem.grains.materials import LEAST_ROLLING, Facing, Material

from .specification import B

__all__ = ["poured", "poured_on", "touching_as"]


def poured(material: Material, *, friction: float | None = None) -> Material:
    """The material without adhesion; with this friction and no rolling friction, or its own where None [1]."""
    stuff = replace(material, cohesion="none", surface_energy=0.0)
    if friction is None:
        return stuff
    return replace(stuff, friction=friction, rolling_friction=min(material.rolling_friction, LEAST_ROLLING))


def poured_on(floor: Facing | None) -> Facing | None:
    """The floor while grains are poured on it: they do not stick to it either."""
    return None if floor is None else replace(floor, surface_energy=None)


def touching_as(bed: B, material: Material, *, floor: Facing | None = None) -> B:
    """The same grains where they are, contacts and histories kept, which touch as this material's from now on.

    Args:
        material: of the same density, with or without rolling friction as the bed's own.
        floor: how they touch the floor, where there is one; as one another when None.

    Raises ValueError: a material of which these grains cannot be.
    """
    own = bed.material
    if material.density != own.density or (material.rolling_friction > 0) != (own.rolling_friction > 0):
        raise ValueError(
            f"material = {material.name!r}: density {material.density:g} kg/m3, rolling friction "
            f"{material.rolling_friction:g}, where the grains have {own.density:g} and {own.rolling_friction:g}: the "
            f"same density, and rolling friction in both or in none, would do"
        )
    bed.wake()
    values = bed.state()
    radii = values["position"][values["id"].argsort(), 3].astype(float)
    step = time_step_for(material, diameter=2 * float(radii.min()), max_overlap=bed.settings.max_overlap)
    settings = replace(bed.settings, material=material, gravity=bed.gravity, time_step=min(bed.time_step, step))
    new = bed.alike(settings, radii)
    state.adopt(new, values)
    new.overlap_limit, new.recipe = bed.overlap_limit, bed.recipe
    if new.has_floor:
        new.set_facing(FLOOR, floor or Facing())
    return new
