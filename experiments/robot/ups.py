"""The world's upward direction in turned axes."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "ups"]

Array = NDArray[np.float64]


def ups(turns: Array) -> Array:
    """The world's upward direction in axes turned by unit quaternions, shape (n, 4): the third row of each matrix."""
    w, x, y, z = turns.T
    return np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
