"""The time step, from the contact time; and how stiff grains must be for an overlap bound.

All formulas are Hertz's (Johnson 1985, chapters 4 and 11), with the smallest grain of the bed. d is its diameter.
"""

from __future__ import annotations

import math

from .cohesion import jkr_contact
from .contact import effective_moduli
from .materials import Material

__all__ = ["CHAIN", "choose_young", "contact_time", "time_step_for"]

STEPS_PER_CONTACT = 8
FEWEST_STEPS_PER_CONTACT = 5
# The largest of some hundred loaded contacts over their mean: a drive to 20 mm in sand measured 3.4.
CHAIN = 4.0


def contact_time(material: Material, *, diameter: float, max_overlap: float) -> float:
    """Half a period of the stiffest contact that the overlap bound allows [s].

    pi sqrt(m* / S_n), S_n = 2 E* a with a = sqrt(R* delta) (or JKR's) at delta = max_overlap d, for two grains and for
    a grain on a rigid plane, whichever is shorter. A Hertzian collision that reaches this overlap lasts 1.28 times as
    long, and one that reaches a tenth of it 2.3 times.

    Args:
        diameter: of the smallest grain [m].
        max_overlap: overlap over diameter [1].
    """
    mass = material.density * math.pi * diameter**3 / 6
    delta = max_overlap * diameter
    times = []
    for other, radius, reduced in (
        (material.young, diameter / 4, mass / 2),
        (math.inf, diameter / 2, mass),
    ):
        young, _ = effective_moduli(material.young, material.poisson, other, material.poisson)
        a = math.sqrt(radius * delta)
        if material.cohesion == "jkr":
            a, _ = jkr_contact(delta, surface_energy=material.surface_energy, radius=radius, effective_young=young)
        times.append(math.pi * math.sqrt(reduced / (2 * young * a)))
    return min(times)


def time_step_for(material: Material, *, diameter: float, max_overlap: float, wanted: float | None = None) -> float:
    """The time step [s]: an eighth of the shortest contact time, or the one wanted if it is short enough.

    Raises:
        ValueError: the step wanted is not positive, or longer than a fifth of the contact time.
    """
    shortest = contact_time(material, diameter=diameter, max_overlap=max_overlap)
    if wanted is None:
        return shortest / STEPS_PER_CONTACT
    longest = shortest / FEWEST_STEPS_PER_CONTACT
    if not 0 < wanted <= longest:
        raise ValueError(
            f"time_step = {wanted:g} s is outside 0 to {longest:.3g} s, a fifth of the shortest contact time "
            f"({shortest:.3g} s for grains of {diameter:g} m with E = {material.young:.3g} Pa at an overlap of "
            f"{100 * max_overlap:g} %); leave it out to have {shortest / STEPS_PER_CONTACT:.3g} s"
        )
    return wanted


def choose_young(
    material: Material, *, pressure: float, speed: float, max_overlap: float, diameter: float | None = None
) -> float:
    """The softest Young's modulus that keeps overlaps within the bound [Pa]; never above the material's own.

    Two needs, the larger of which rules: a bed under pressure, whose mean contact force is about p d^2 and its largest
    ``CHAIN`` times that (F = 2/3 E* d^2 (delta/d)^1.5), and a collision of two grains
    ((delta/d)^2.5 = 15 pi / 96 rho v^2 / E*).

    Args:
        pressure: the largest on the grains [Pa]. speed: of the fastest collision [m/s].
        max_overlap: the bound, over diameter [1].
        diameter: of the grains [m]; only cohesion needs it, whose pull on a plane, 2 pi gamma d, presses as well.

    Raises:
        ValueError: cohesion, and no diameter.
    """
    pressed = 1.5 * CHAIN * pressure / max_overlap**1.5
    if material.cohesion != "none":
        if diameter is None:
            raise ValueError(f"diameter is needed for grains with cohesion {material.cohesion!r}")
        pressed += 1.5 * (2 * math.pi * material.surface_energy / diameter) / max_overlap**1.5
    struck = 15 * math.pi / 96 * material.density * speed**2 / max_overlap**2.5
    effective = max(pressed, struck)
    return min(material.young, 2 * (1 - material.poisson**2) * effective)
