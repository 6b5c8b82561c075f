"""Flight: the depth of a platform on grains under the same low gravity, and the bed that this needs.

Without cohesion the strength of grains is proportional to gravity, as the weight is (Kang et al. 2018, Nat. Commun.
9:1101: F linear in depth, K(phi) rho g V; Altshuler et al. 2014: the final depth of a body that sinks from rest is
independent of g). So in flight a platform lies as deep as on Earth with all of its weight. Spikes support the force
of the surface's K, measured at 1 g, times g / g0. If that is too small, the hull supports the rest: a cylinder, by the
pressure of 3D-RFT under a flat plate (`experiments.grains.softening`) over its width in the bed:

    W = 2 K (g / g0) z + (4/3) w p' d sqrt(2 R d),   z the tips' depth, d the hull's.

While a torque acts, a row may point straight down, and no tip is faster than on a platform that spins freely.
"""

import math
from dataclasses import dataclass

from dem.grains.materials import Material
from experiments.platform.surfaces import find_surface
from rigid.model.trial import Trial
from rigid.platform.rig import STANDARD_GRAVITY

from . import say
from .softening import PACKING, bearing_gradient

__all__ = ["Lying", "lies_in_flight"]


@dataclass(frozen=True)
class Lying:
    """Depth and contacts of a platform on grains in flight."""

    sunk: float  # Depth of the tips that it stands on [m]
    deepest: float  # Depth of a tip that points straight down, the centre as high as at rest [m]
    reach: float  # How far ahead of the centre, and behind it, tips go through the surface [m]
    fastest: float  # Largest speed of a tip, the platform spinning freely [m/s]
    on_hull: bool  # Whether its spikes alone do not carry it


def lies_in_flight(
    trial: Trial,
    *,
    surface: str,
    material: Material,
    hull_radius: float,
    width: float,
    duration: float,
    max_wheel_speed: float = math.inf,
) -> Lying:
    """`trial` on the grains of `surface`, its hull a cylinder of `hull_radius` and `width` [m], for `duration` [s].

    Raises ValueError if even the hull would sink in by its radius.
    """
    gravity, length = trial.gravity_sim, trial.spike_length
    level = length * math.cos(math.pi / trial.spike_count)
    stiffness = 2 * find_surface(surface).stiffness * gravity / STANDARD_GRAVITY
    gradient = bearing_gradient(PACKING * material.density, gravity, material.friction)

    def carried(sunk: float) -> float:
        hull = max(0.0, sunk - (level - hull_radius)) if hull_radius > 0 else 0.0
        return stiffness * sunk + 4 / 3 * width * gradient * hull * math.sqrt(2 * hull_radius * hull)

    low, high = 0.0, level
    if carried(high) < trial.weight:
        raise ValueError(say("sinks_to_its_middle", trial=trial))
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if carried(middle) < trial.weight else (low, middle)
    centre = level - high
    given = trial.torque * min(duration, trial.torque_until)
    room = trial.wheel_speed_0 if trial.actuator == "brake" else max_wheel_speed - trial.wheel_speed_0
    spin = min(given, room * trial.wheel_inertia) / trial.inertia
    return Lying(
        sunk=high, deepest=length - centre, reach=math.sqrt(length**2 - centre**2), fastest=spin * length,
        on_hull=stiffness * high < 0.999 * trial.weight,
    )  # fmt: skip
