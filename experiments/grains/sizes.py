"""Sizes of grains and beds: how many grains fill a bed, what adhesion becomes in other grains, what reports say."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from dem.grains.materials import Material
from dem.grains.sizes import Sieve, Sizes
from experiments.runs.types import Json

from . import say

__all__ = [
    "KEPT", "Distribution", "Kept", "bond_number", "carried_height", "expected_grain_count", "in_grains_of",
    "scaling_told", "sizes_table",
]  # fmt: skip

Distribution = Literal["uniform", "normal", "log-normal", "sieve"]
Kept = Literal["strength", "bond", "surface-energy"]
KEPT: dict[str, tuple[str, int]] = {
    "strength": ("strength (pull-off over d^2)", 1),
    "bond": ("Bond number (pull-off over weight)", 2),
    "surface-energy": ("surface energy", 0),
}
"""What can stay the same of grains that stick: in words; the power of d with which surface energy goes."""
_SHARES = (0.1, 0.3, 0.5, 0.6, 0.9)


def in_grains_of(stuff: Material, diameter: float, *, keep: str, own: float) -> Material:
    """`stuff`, whose surface energy holds for grains of `own` [m], in grains of `diameter` [m]."""
    power = KEPT[keep][1]
    return replace(stuff, surface_energy=stuff.surface_energy * (diameter / own) ** power, grain=diameter)


def bond_number(stuff: Material, *, diameter: float, gravity: float) -> float:
    """Pull-off force of two like grains over one's weight [1]: DMT 4 pi gamma R*, JKR 3 pi gamma R*, R* = d / 4."""
    pull = np.pi * stuff.surface_energy * diameter * (0.75 if stuff.cohesion == "jkr" else 1.0)
    return float(pull / (stuff.density * np.pi / 6 * diameter**3 * gravity))


def scaling_told(before: Material, now: Material, *, diameter: float, gravity: float, keep: str) -> str:
    """A sentence: what is kept of the adhesion of grains that are larger or smaller than those it was found for."""
    bond = f"Bond number {bond_number(now, diameter=diameter, gravity=gravity):.3g}"
    if before.grain is None:
        return say("taken_as_it_stands", now=now, bond=bond)
    times, grain = diameter / before.grain, 1e3 * before.grain
    return say("scaled", times=times, before=before, grain=grain, kept=KEPT[keep][0], now=now, bond=bond)


def sizes_table(radii: np.ndarray, sizes: Sizes) -> Json:
    """The bed's grading by mass, from the grains' `radii` [m]: beside the sieve table if there is one, or D10-D90."""
    diameters = np.sort(2 * np.asarray(radii, dtype=float))
    mass = np.cumsum(diameters**3)
    mass /= mass[-1]
    if isinstance(sizes, Sieve):
        openings = sizes.scale * np.array(sizes.openings)
        found = np.append(0.0, mass)[np.searchsorted(diameters, openings, side="right")]
        rows = [
            [f"{1e3 * real:.4g}", f"{1e3 * opening:.4g}", f"{100 * wanted:.3g}", f"{100 * share:.3g}"]
            for real, opening, wanted, share in zip(sizes.openings, openings, sizes.passing, found, strict=True)
        ]
        head = ["sieve [mm]", "enlarged [mm]", "passing, wanted [%]", "passing, of this bed [%]"]
        return {"title": f"Grading by mass, grains {sizes.scale:.4g} times the table's", "head": head, "rows": rows}
    at = {share: float(np.interp(share, mass, diameters)) for share in _SHARES}
    rows = [[f"D{100 * share:.0f} [mm]", f"{1e3 * value:.4g}"] for share, value in at.items()]
    rows.append(["D60 / D10", f"{at[0.6] / at[0.1]:.3g}"])
    return {"title": "Grading by mass", "head": ["finer by mass", ""], "rows": rows}


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
