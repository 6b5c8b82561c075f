"""Young's modulus of softened grains, from the largest overlap that a run allows.

The time step of a DEM run is proportional to 1 / sqrt(E). So grains are as soft as the largest overlap `max_overlap`
(share of a grain's diameter) allows at the pressures and speeds of *this* run. If not even the real grains are stiff
enough, the run is refused.

1. Pressure under the tip, from 3D-RFT (Agarwal et al. 2023, arXiv 2205.14920), a flat plate going straight down:
       p = 0.876 xi_n z + lambda rho_b v^2,   xi_n = rho_b g (894 mu^3 - 386 mu^2 + 89 mu), mu held to 0.3-0.9,
   rho_b the bulk density, lambda = 1.1. The weight of the bed itself, rho_b g H, is added. The sum is at least load /
   area, which in flight is what the torque presses with (`PUSHED`).
2. Mean contact force from the stress of an assembly (Rothenburg), F = pi d^2 p / (Z phi), which is d^2 p within 5 % at
   Z = 5, phi = 0.6. The distribution of forces in a loaded bed is exponential above the mean. So the largest of n
   loaded contacts is ln n times the mean. Soft grains share the load: `chain` is 1.4 times what was measured. That is
   2.8 among some 400 contacts at 3.9 % of a diameter (ln 400 = 6; docs/results/penetrate; 3.4 in another drive). It is
   5.2 among some 1600 at 1.02 % (ln 1600 = 7.4; ten grains across the tip, at 0.2 m/s).
3. Hertz between two grains, F = (2/3) E* d^2 (delta/d)^1.5, E* = E / (2 (1 - nu^2)), so
       delta/d = (1.5 chain p / E*)^(2/3).
4. Apart from that, a grain of mass m that hits something rigid at speed v: delta = (5 m v^2 / 4 k)^(2/5),
   k = (4/3) E* sqrt(R), E* = E / (1 - nu^2). It is the spike at its speed, within `max_overlap`. It is also the floor
   after the fall in which the bed was rained in, v^2 = 2 g h, within `RAIN_OVERLAP` if that is more. The impact of a
   grain on the floor before there is a bed leaves no trace in it. Counting it would make the grains of a fine run three
   times as stiff.
5. Cohesion presses a grain onto a plane with its pull-off force as well, at most 4 pi gamma R (DMT): as a pressure 2 pi
   gamma / d, which no chain of grains makes larger: it is added in 3 without `chain`.

The estimate is made in advance; the run measures its largest overlap, and the result states it.
"""

import math
from dataclasses import dataclass
from typing import Any

from dem.contact.timestep import CHAIN

from . import say

__all__ = [
    "INERTIA", "PACKING", "PUSHED", "Softening", "bearing_gradient", "chain", "check_young", "drop_depth", "run_limit",
    "soften_material", "stable_overlap",
]  # fmt: skip

RAIN_OVERLAP = 0.05  # Of a grain with the floor at the end of its fall, while the bed is made [of a diameter]
INERTIA = 1.1  # lambda: dynamic pressure over rho v^2 [1] (Agarwal et al. 2023)

PUSHED = {"motor": 1.0, "brake": 3.0}
"""Force on a platform's rows in flight that grains are made stiff enough for, over the spring-damper's largest [1].

0.7 to 0.8 (motor) and 2.9 to 4.9 (brake, whose spring-damper is not yet pressed in when a tip has its speed in grains)
were met (docs/results/grains2-flight-*)."""
SMALL = 0.05
"""Overlap that is small [of a diameter]: the default of `max_overlap`. A run that had more gets a warning."""
STIFF, STIFF_CHAIN = 0.01, 7.4  # Overlap [of a diameter] up to which chains carry as among stiff grains [1]
SOFTEST = 0.1
"""A modulus that is set below this share of the chosen one is refused [1]: grains would overlap 10^(2/3) = 4.6 times as
much. The estimate is some 3 times too stiff, and the softest case that ships has half of what is chosen."""
PACKING = 0.6  # Of a bed, for its bulk density [1]
SOFT = 0.05  # Overlap at and above which grains share the load: `CHAIN`, as `dem` has it


@dataclass(frozen=True)
class Softening:
    """The chosen modulus and its reasons."""

    young: float  # Young's modulus of the softened grains [Pa]
    pressure: float  # Largest pressure expected under the tip [Pa]
    speed: float  # Largest speed of the spike [m/s]
    real: float  # Young's modulus of the real grains [Pa]

    @property
    def factor(self) -> float:
        """How many times softer than the real grains."""
        return self.real / self.young

    def stiffer(self, overlap: float, wanted: float) -> float:
        """Young's modulus [Pa] that changes this overlap to the intended one (Hertz: F ~ E overlap^1.5)."""
        return self.young * (overlap / wanted) ** 1.5

    def overlapping(self, overlap: float, bound: float = SMALL, stable: float | None = None) -> str | None:
        """A warning of overlaps above the intended bound, with the modulus that would keep it; or None.

        ``bound``: `max_overlap`, which a platform's run may pass (`run_limit`); ``stable``: `stable_overlap` of it.
        """
        meant = min(bound, SMALL)
        if overlap <= meant:
            return None
        how = "as max_overlap allowed" if overlap <= bound else f"past max_overlap = {100 * bound:g} %"
        lost = ""
        if stable is not None and overlap > stable:
            lost = say("made_energy", stable=100 * stable)
        are, young = "are small" if meant == SMALL else "were meant", self.stiffer(overlap, meant)
        return say("overlapped", overlap=100 * overlap, how=how, meant=100 * meant, are=are, young=young, lost=lost)


def run_limit(max_overlap: float) -> float:
    """Overlap past which a platform's run on a bed made for `max_overlap` ends [of a diameter]: twice it, at most 0.2.

    The step is stable for a whole lattice up to `stable_overlap`, some 1.2 times `max_overlap`. Beyond, single contacts
    are still followed: at twice the bound the step is 1/6.7 of the half-period of a grain on a wall, which is lost at
    1/1.6 (`dem.contact.timestep.stable_step`). The result warns where more of them made energy.
    """
    return max(max_overlap, min(2 * max_overlap, 0.2))


def stable_overlap(material: Any, max_overlap: float) -> float:
    """Largest overlap [of a diameter] at which the step of a bed made for `max_overlap` is stable for a whole lattice.

    The longest stable step is proportional to the overlap to the power -1/4 (S_n = 2 E* a, a = sqrt(R* delta)):
    max_overlap (longest / step)^4, by `dem.contact.timestep.longest_step` and `time_step_for`, whatever the
    diameter; never below `max_overlap`.
    """
    from dem.contact.timestep import longest_step, time_step_for

    of_like_grains = {"diameter": 1.0, "max_overlap": max_overlap}
    longest, own = longest_step(material, **of_like_grains), time_step_for(material, **of_like_grains)
    return float(max_overlap * (longest / own) ** 4)


def bearing_gradient(bulk_density: float, gravity: float, friction: float) -> float:
    """Growth of the pressure under a flat plate going straight down [Pa/m] (3D-RFT, see the module)."""
    mu = min(0.9, max(0.3, friction))
    return 0.876 * bulk_density * gravity * (894 * mu**3 - 386 * mu**2 + 89 * mu)


def check_young(young: float | None, *, chosen: float, max_overlap: float) -> None:
    """Raise ValueError for a modulus that is set [Pa] and could not hold the bed; `chosen`: what is without it [Pa]."""
    if young is not None and young < SOFTEST * chosen:
        raise ValueError(say("too_soft", young=young, max_overlap=max_overlap, chosen=chosen))


def drop_depth(speed: float, mass: float, load: float, stiffness: float) -> float:
    """Where a drop stops on a spring: K z^2 / 2 - W z = m v^2 / 2 [m]."""
    return (load + math.sqrt(load**2 + stiffness * mass * speed**2)) / stiffness


def chain(max_overlap: float) -> float:
    """Largest over mean force of the loaded contacts [1], at a bound of the overlap [of a diameter]; measured.

    Between the two overlaps at which it was measured it is linear in the logarithm (see the module, 2).
    """
    share = math.log(SOFT / max_overlap) / math.log(SOFT / STIFF)
    return CHAIN + (STIFF_CHAIN - CHAIN) * min(1.0, max(0.0, share))


def soften_material(
    material: Any,
    *,
    young: float | None = None,
    max_overlap: float,
    grain: float,
    spread: float,
    gravity: float,
    bed_height: float,
    depth: float,
    speed: float,
    pressure: float = 0.0,
    fall: float = 0.0,
    fastest: str = "speed",
    strength: float = 1.0,
    resistance: float = 0.0,
) -> Softening:
    """Young's modulus of the grains of a material that keeps overlaps below `max_overlap` (see the module). All SI.

    Diameters are uniform around `grain` within 1 +- `spread`: where that is wide, the mean grain is held to less than
    `max_overlap`, so that the smallest keep it (`dem.prepare.prepare.bound_of_mean`). `depth` is the deepest the tip
    goes, `speed` its fastest, `pressure` that of the load alone. `fall` is how deep a grain fell when the bed was made,
    `fastest` the key that set the speed. `strength` is the bed's over that of 3D-RFT (`bearing.strength`) [1],
    `resistance` what a tip meets for the cohesion of grains that stick [Pa]. Where `young` [Pa] is set, the result has
    that, with the pressure and the speed. Raises ValueError for an overlap that is no share of a diameter, and where
    the real grains are too soft.
    """
    from dem.grains.sizes import Uniform
    from dem.prepare.prepare import bound_of_mean

    max_overlap = bound_of_mean(Uniform(grain, spread), max_overlap)
    if not 0 < max_overlap <= 0.2:
        raise ValueError(f"max_overlap is {max_overlap}: it must be above 0 and at most 0.2 of a diameter")
    poisson, real = material.poisson, material.young
    bulk = PACKING * material.density
    static_part = strength * bearing_gradient(bulk, gravity, material.friction) * depth + resistance
    under_tip = static_part + INERTIA * bulk * speed**2
    highest = max(under_tip, pressure) + bulk * gravity * bed_height
    pulled = 2 * math.pi * material.surface_energy / grain
    pair = 1.5 * (chain(max_overlap) * highest + pulled) / max_overlap**1.5
    static = 2 * (1 - poisson**2) * pair
    mass = material.density * math.pi * grain**3 / 6
    struck, landed = (
        0.75 * 1.25 * mass * squared / (bound * grain) ** 2.5 / math.sqrt(0.5 * grain) * (1 - poisson**2)
        for squared, bound in ((speed**2, max_overlap), (2 * gravity * fall, max(max_overlap, RAIN_OVERLAP)))
    )
    given = {"max_overlap": max_overlap, "real": real}
    if struck > real:
        most = 0.99 * speed * math.sqrt(real / struck)
        raise ValueError(say("too_fast", **given, fastest=fastest, speed=speed, most=most))
    if static > real:
        would = max_overlap * (static / real) ** (2 / 3)
        raise ValueError(say("too_deep", **given, highest=highest, static=static, would=would))
    return Softening(min(real, max(static, struck, landed)) if young is None else young, highest, speed, real)
