"""The longest flight of a body after it first touched, continued as a parabola over level ground."""

import math

import numpy as np
from numpy.typing import ArrayLike

from experiments.grains.spells import spells
from rigid.hop import flight

from . import say

__all__ = ["Numbers", "leap_of"]

Numbers = dict[str, tuple[float | None, str, str]]
"""Name -> value (None: there is none), unit, note."""


def leap_of(touching: ArrayLike, velocity: ArrayLike, *, gravity: float, lasting: int) -> Numbers:
    """Launch and parabola of the longest flight that begins upwards.

    `touching`: number of contacts, shape [row]; `velocity` of the centre of mass [m/s], shape [row, 3]; `gravity` of
    the body [m/s2]; `lasting`: rows that a flight has at least.
    """
    free, speeds = np.asarray(touching) == 0, np.asarray(velocity, dtype=float)
    first = len(free) if free.all() else int(np.argmin(free))
    flights = [(first + low, first + high) for low, high in spells(free[first:]) if high - low >= lasting]
    rising = [(low, high) for low, high in flights if speeds[low, 2] > 0]
    names = {"hop_velocity_x": "m/s", "hop_velocity_y": "m/s", "hop_velocity_z": "m/s", "hop_angle": "rad",
             "hop_distance": "m", "hop_height": "m"}  # fmt: skip
    if not rising or gravity <= 0:
        return {name: (None, unit, say("no_leap")) for name, unit in names.items()}
    low, _ = max(rising, key=lambda each: each[1] - each[0])
    x, y, z = (float(part) for part in speeds[low])
    angle = math.atan2(z, math.hypot(x, y))
    flown = flight(math.sqrt(x * x + y * y + z * z), angle, gravity=gravity)
    assert flown is not None  # flat ground
    values = (x, y, z, angle, flown.distance, flown.height)
    notes = [say("leap_start")] * 4 + [say("leap")] * 2
    return {name: (value, unit, note) for (name, unit), value, note in zip(names.items(), values, notes, strict=True)}
