"""Where the tips of a platform's rows are."""

import math

import numpy as np
from numpy.typing import NDArray

from rigid.model.model import contact_arms
from rigid.model.trial import Trial
from rigid.planar.dynamics import System

__all__ = ["ball_radius", "tip_angles", "tip_depth"]

Array = NDArray[np.float64]


def tip_angles(count: int, theta: Array) -> Array:
    """Angle of each of `count` rows' spikes from straight down, clockwise [rad], shape [step, row]; theta as [step]."""
    half = math.pi / count
    return np.asarray(theta[:, None] + half + 2 * half * np.arange(count))


def tip_depth(theta: Array, y: Array, *, count: int, length: float, radius: float = 0.0) -> Array:
    """Depth of each row's lowest point below the undisturbed surface [m], negative above it, shape [step, row].

    The model's own (`rigid.model.model`), on a slope too, whose y is normal to the surface. theta [rad] and y
    [m] have shape [step]; `radius` [m] is that of balls which spikes of `length` end in, 0 where they end in points.
    """
    angles = tip_angles(count, theta)
    height, _ = contact_arms(np.cos(angles), np.sin(angles), length, radius)
    return np.asarray(height - y[:, None])


def ball_radius(trial: Trial) -> float:
    """Radius of the balls that its effects put on the tips [m]; 0 without."""
    return float(System(trial).radius)
