"""The size of a bed: how many grains fill it, and how high its box must be for grains that leave the surface."""

import math

from dem.grains.materials import Material

__all__ = ["carried_height", "expected_grain_count"]


def carried_height(material: Material, *, reach: float, rise: float, grain: float) -> float:
    """How high over the surface grains that stick ride up on a platform that turns [m]; 0 for those that do not.

    `reach` from the platform's centre to its farthest point [m], `rise` of the centre, hops included, at most [m];
    `grain`: mean diameter [m]; two lie on the tip. In JSC-1A at 0.22 N m grains hung on a spike 0.15 m over the surface
    (grains1-jsc1a-0.0085-0.22, 2026-11-23).
    """
    return 0.0 if material.cohesion == "none" else 2 * reach + max(rise, 0.0) + 2 * grain


def expected_grain_count(bed_size: tuple[float, float, float], grain: float, spread: float) -> float:
    """About how many grains fill the bed, at a packing fraction of 0.6; diameters uniform within 1 +- spread."""
    return 0.57 * math.prod(bed_size) / (math.pi / 6 * grain**3 * (1 + spread**2))
