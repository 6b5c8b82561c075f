"""What can be hidden in tumbles of the second simulator: each effect as numbers of `motion.COLUMNS` at an amplitude.

An effect of size 1 is the largest that a rig could show. The suite goes down from there until its signature is the
requested one. Effects with a name have one of two forms, drawn by the seed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .drawing import Numbers

__all__ = ["FREE", "NAMED", "OUTSIDE", "RIG", "Form", "draw_form"]

FREE = (
    "wheel-vibration", "com-offset", "slope", "tip-radius", "torque-fade", "inertial-drag", "depth-hardening",
    "plastic-sinkage", "adhesion", "rate-friction", "umbilical", "bearing-drag", "clock-offset", "camera-scale",
)  # fmt: skip
"""Effects of a free platform."""
RIG = (*FREE, "pendulum", "rig-friction", "pulley-inertia")
"""Effects of a platform in the rig."""
OUTSIDE = ("bump", "tremor", "sloshing", "gust", "gyro-drift")
"""What no library has: a rise of the surface, a shaken weight, a loose mass, a push of air, a gyro that drifts."""
NAMED = {
    "pendulum": {"pendulum.length": lambda s: 1.0 / s["wire_curvature"]},
    "com-offset": {"com-offset.x": lambda s: s["offset_x"], "com-offset.y": lambda s: s["offset_y"]},
    "slope": {"slope.angle": lambda s: s["slope"]},
    "tip-radius": {"tip-radius.radius": lambda s: s["ball"]},
    "pulley-inertia": {"pulley-inertia.mass": lambda s: s["pulley_mass"]},
    "rig-friction": {"rig-friction.force": lambda s: s["rig_dry"]},
    "bearing-drag": {"bearing-drag.torque": lambda s: s["bearing"]},
    "clock-offset": {"clock-offset.offset": lambda s: s["clock"]},
    "camera-scale": {"camera-scale.scale": lambda s: 1.0 + s["scale"]},
}
"""Parameters with a fixed name, from the numbers of `Form.at`."""


@dataclass(frozen=True)
class Form:
    """One effect: its id, and its numbers at an amplitude from 0 to 1."""

    id: str
    at: Callable[[float], Numbers]


def draw_form(
    random: np.random.Generator, name: str, *, weight: float, sinkage: float, torque: float, spin: float, rig: bool,
    moment: float,
) -> Form:  # fmt: skip
    """The effect `name`, with what is its own drawn.

    `weight`: on the surface, of the lightest trial [N]. `sinkage`: at rest [m]. `torque`: the least [N m]. `spin`: the
    wheel's typical speed [rad/s]. `moment`: of a centre of mass 1 m off the shaft [N m/m]. A size of 1 still lets the
    platform stand at rest.
    """
    sign, second = float(random.choice((-1.0, 1.0))), bool(random.random() < 0.5)
    share, turn = float(random.uniform(0.3, 1.0)), float(random.uniform(0.0, 2.0 * math.pi))
    lean = 0.35 * weight * 0.0765 / moment  # a third of what would tip it over at rest
    table: dict[str, Callable[[float], Numbers]] = {
        "wheel-vibration": lambda a: {"vibration": 0.9 * a, "vibration_speed": spin * (0.3 + share)},
        "com-offset": lambda a: {"offset_x": lean * a * math.cos(turn), "offset_y": 2.0 * lean * a * math.sin(turn)},
        "slope": lambda a: {"slope": sign * 0.1 * a},
        "tip-radius": lambda a: {"ball": 0.03 * a},
        "torque-fade": lambda a: {"fade_time": 3.0 * a} if second else {"fade_speed": 0.5 * a / spin},
        "inertial-drag": lambda a: {"drag": 2000.0 * a, "drag_side": 200.0 * a * share * second},
        "depth-hardening": lambda a: {"harden_depth": sinkage, **(
            {"harden_power": 1.2 * a} if second else {"harden_linear": (2.5 if sign > 0 else -0.25) * a})},
        "plastic-sinkage": lambda a: {"plastic": 0.95 * a},
        "adhesion": lambda a: {"adhesion": 1.5 * weight * a, "adhesion_reach": (0.3 + share) * sinkage},
        "rate-friction": lambda a: {"rate_change": (2.0 if sign > 0 else -0.8) * a, "rate_speed": 0.15 * share},
        "umbilical": lambda a: {"cable_spring": 0.4 * torque * a} if second else {"cable_drag": 0.4 * torque * a},
        "bearing-drag": lambda a: {"bearing": 0.45 * torque * a},
        "clock-offset": lambda a: {"clock": sign * 0.15 * a},
        "camera-scale": lambda a: {"scale": sign * 0.15 * a},
        "pendulum": lambda a: {"wire_curvature": 1.2 * a, "wire_exact": float(second)},
        "rig-friction": lambda a: {"rig_dry": 0.35 * weight * a, "rig_viscous": 3.0 * a * second},
        "pulley-inertia": lambda a: {"pulley_mass": 6.0 * a},
        "bump": lambda a: {"bump": 0.02 * a, "bump_x": 0.07 + 0.1 * share, "bump_width": 0.01 + 0.02 * share},
        "tremor": lambda a: {"tremor": 2.0 * weight * a, "tremor_rate": 4.0 + 12.0 * share},
        "sloshing": lambda a: {"slosh_mass": 2.0 * a, "slosh_rate": 1.0 + 3.0 * share},
        "gust": lambda a: {"gust": sign * 1.5 * weight * a, "gust_time": 0.2 + 0.6 * share},
        "gyro-drift": lambda a: {"drift": sign * 1.0 * a},
    }  # fmt: skip
    return Form(name, table[name])
