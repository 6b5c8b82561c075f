"""What can be hidden in tumbles of the soft suite: each effect as numbers of `motion.move` at an amplitude from 0 to 1.

Where MuJoCo has an element for an effect, it is that: gravity, inertial frame, geometry, a joint's spring, damper and
friction loss, an impedance that grows with depth, a body on a spring. MuJoCo's contacts have no memory and no pull, so
plastic sinkage, adhesion, relaxation and slip-sinkage are missing.
"""

import math
from collections.abc import Callable

import numpy as np

from benchmarks.second.drawing import Numbers

__all__ = ["EFFECTS", "OUTSIDE", "SENSED", "draw_form"]

EFFECTS = (
    "slope", "com-offset", "tip-radius", "bearing-drag", "umbilical", "torque-fade", "torque-rise", "inertial-drag",
    "depth-hardening", "wheel-vibration", "rate-friction", "clock-offset", "camera-scale",
)  # fmt: skip
"""Effects of a free platform that have a name."""
OUTSIDE = ("ridge", "loose-mass", "gust", "gyro-drift")
"""What no library has: a log across the way, a mass on a spring inside, a push of air, a gyro that drifts."""
SENSED = ("clock", "scale", "drift")
"""Numbers of the sensors, which move nothing."""


def draw_form(
    random: np.random.Generator, name: str, *, weight: float, sinkage: float, torque: float, spin: float,
) -> Callable[[float], Numbers]:  # fmt: skip
    """The numbers of the effect `name` at an amplitude, with what is its own drawn; 1 still lets the platform stand.

    `weight`: of the lightest trial [N]. `sinkage`: its sinkage at rest [m]. `torque`: the least [N m]. `spin`: the
    wheel's typical speed [rad/s].
    """
    sign, second = float(random.choice((-1.0, 1.0))), bool(random.random() < 0.5)
    share, turn = float(random.uniform(0.3, 1.0)), float(random.uniform(0.0, 2.0 * math.pi))
    lean = 0.35 * 0.0765  # a third of what would tip it over at rest [m]
    table: dict[str, Callable[[float], Numbers]] = {
        "slope": lambda a: {"slope": sign * 0.1 * a},
        "com-offset": lambda a: {"offset_x": lean * a * math.cos(turn), "offset_y": 2.0 * lean * a * math.sin(turn)},
        "tip-radius": lambda a: {"ball": 0.03 * a},
        "bearing-drag": lambda a: {"bearing": 0.45 * torque * a},
        "umbilical": lambda a: {"cable_spring": 0.4 * torque * a} if second else {"cable_drag": 0.4 * torque * a},
        "torque-fade": lambda a: {"fade_time": 3.0 * a} if second else {"fade_speed": 0.5 * a / spin},
        "torque-rise": lambda a: {"rise": 0.4 * a},
        "inertial-drag": lambda a: {"drag": 2000.0 * a},
        "depth-hardening": lambda a: {"harden": 2.0 * a, "harden_depth": (2.0 + 4.0 * share) * sinkage},
        "wheel-vibration": lambda a: {"vibration": 0.9 * a, "vibration_speed": spin * (0.3 + share)},
        "rate-friction": lambda a: {"rate_change": (2.0 if sign > 0 else -0.8) * a, "rate_speed": 0.15 * share},
        "clock-offset": lambda a: {"clock": sign * 0.15 * a},
        "camera-scale": lambda a: {"scale": sign * 0.15 * a},
        "ridge": lambda a: {"ridge": 0.02 * a, "ridge_x": 0.2 + 0.04 * share, "ridge_radius": 0.05},
        "loose-mass": lambda a: {"loose_mass": 2.0 * a, "loose_rate": 1.0 + 3.0 * share},
        "gust": lambda a: {"gust": sign * 1.5 * weight * a, "gust_time": 0.2 + 0.6 * share},
        "gyro-drift": lambda a: {"drift": sign * 1.0 * a},
    }  # fmt: skip
    return table[name]
