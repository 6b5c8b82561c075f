"""Unit quaternions, scalar first, that turn body axes into world axes."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["angle_between", "from_turn", "multiply", "rate", "to_matrix"]

Array = NDArray[np.float64]


def to_matrix(q: ArrayLike) -> Array:
    """Rotation matrix of `q`, normalised, shape [3, 3]: world = matrix @ body."""
    w, x, y, z = (float(part) for part in np.asarray(q, dtype=float))
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )


def multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """The product a b: first b, then a."""
    a0, a1, a2, a3 = (float(part) for part in np.asarray(a, dtype=float))
    b0, b1, b2, b3 = (float(part) for part in np.asarray(b, dtype=float))
    return np.array(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
            a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
            a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
        ]
    )


def rate(q: ArrayLike, spin: ArrayLike) -> Array:
    """dq/dt under the angular velocity `spin` in world axes [rad/s], shape (3,): (0, spin) q / 2."""
    return 0.5 * multiply(np.concatenate([[0.0], np.asarray(spin, dtype=float)]), q)


def from_turn(turn: ArrayLike) -> Array:
    """The quaternion of a turn about `turn`, by its length [rad], shape (3,)."""
    v = np.asarray(turn, dtype=float)
    angle = float(np.linalg.norm(v))
    share = 0.5 * float(np.sinc(0.5 * angle / math.pi))
    return np.concatenate([[math.cos(0.5 * angle)], share * v])


def angle_between(a: ArrayLike, b: ArrayLike) -> Array:
    """Angle of the one turn that leads from `a` to `b` [rad], 0 to pi, shape [n]; unit, shape [n, 4] both.

    2 atan2(|a - b|, |a + b|) of the two signs that lie nearer: small angles keep their digits (Kahan 2006, "How futile
    are mindless assessments of roundoff", section 12).
    """
    first, second = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    apart, along = np.linalg.norm(first - second, axis=-1), np.linalg.norm(first + second, axis=-1)
    return np.asarray(4.0 * np.arctan2(np.minimum(apart, along), np.maximum(apart, along)))
