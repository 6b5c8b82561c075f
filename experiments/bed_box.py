"""How high the box over a bed must reach for the grains that leave its surface: those a platform carries up."""

from __future__ import annotations

from dem.materials import Material

__all__ = ["carried_height"]


def carried_height(material: Material, *, reach: float, rise: float, grain: float) -> float:
    """How high over the surface grains that stick ride up on a platform that turns [m]; 0 for those that do not.

    Args:
        reach: from the platform's centre to its farthest point [m]; the centre stands no higher than that.
        rise: of the centre, hops included, at most [m].
        grain: mean diameter [m]; two lie on the tip.

    In JSC-1A at 0.22 N m grains hung on a spike 0.15 m over the surface (grains1-jsc1a-0.0085-0.22, 2026-11-23).
    """
    if material.cohesion == "none":
        return 0.0
    return 2 * reach + max(rise, 0.0) + 2 * grain
