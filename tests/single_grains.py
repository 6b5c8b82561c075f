"""A few grains that meet a body in the air, for tests of shapes."""

import numpy as np

from dem import Bed, Material

STUFF = Material("grain", 2600, 1e8, 0.25, 0.5, 1.0)
RADIUS = 0.002
SIZE = (0.045, 0.045, 0.04)


def grains_at(positions, velocities=None, **options):
    """Grains of ``STUFF`` there, without gravity and floor; options are those of ``Bed.from_grains``."""
    positions = np.atleast_2d(np.array(positions, dtype=float))
    return Bed.from_grains(
        options.pop("material", STUFF),
        positions=positions,
        radii=np.full(len(positions), RADIUS),
        velocities=None if velocities is None else np.atleast_2d(np.array(velocities, dtype=float)),
        size=SIZE,
        height=0.06,
        **{"gravity": 0.0, "floor": False} | options,
    )


def rotated(q, x):
    """Points x turned by the unit quaternion q."""
    axis = np.array(q[1:])
    t = 2 * np.cross(axis, x)
    return np.asarray(x) + q[0] * t + np.cross(axis, t)
