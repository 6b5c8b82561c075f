"""Steps of a fit: the damped solution of its normal equations, and moves along a corner of its parameters."""

import numpy as np
from numpy.typing import NDArray

from .problem import Array

__all__ = ["along_corner", "damped_step", "solve"]

_CORNER = 1e-3
"""A number so near to the one that bounds it, relative, is in the corner."""
_ALONG = (0.9, 0.97, 0.99, 1.01, 1.03, 1.1)
"""Factors by which both are changed together there."""


def solve(matrix: Array, right: Array) -> Array:
    """The solution of these normal equations, shape [p]; directions that the matrix does not know stay small."""
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(size, size) + 1e-12 * np.eye(len(size))
    return np.linalg.lstsq(scaled, right / size, rcond=1e-13)[0] / size


def damped_step(
    hessian: Array, gradient: Array, free: NDArray[np.bool_], damping: float,
    at_bounds: tuple[NDArray[np.bool_], NDArray[np.bool_]], times: int,
) -> Array:  # fmt: skip
    """The damped step of the free parameters, found so many `times`, what runs into a bound at once left out."""
    for _ in range(times):
        mine = hessian[np.ix_(free, free)]
        diagonal = np.diag(np.maximum(np.diag(mine), 1e-12))
        step = np.zeros(len(gradient))
        step[free] = -solve(mine + damping * diagonal, gradient[free])
        blocked = free & ((at_bounds[0] & (step < 0)) | (at_bounds[1] & (step > 0)))
        if not blocked.any() or (blocked == free).all():
            break
        free = free & ~blocked
    return step


def along_corner(x: Array, bounded: int, bound: int) -> list[Array]:
    """Points with both parameters changed alike, where the one has reached the other that bounds it; else none.

    There no slope points along the corner: upwards the one alone changes nothing, and the other alone leaves it.
    """
    if x[bounded] < (1 - _CORNER) * x[bound]:
        return []
    moved = [x.copy() for _ in _ALONG]
    for point, factor in zip(moved, _ALONG, strict=True):
        point[[bounded, bound]] = factor * x[bound]
    return moved
