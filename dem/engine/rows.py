"""Some rows of a field as a numpy array: fields have room for many times the rows in use, and copying room costs."""

from typing import Any

import numpy as np
import taichi as ti
from taichi.lang.util import to_numpy_type

__all__ = ["put_rows", "take_rows"]


def take_rows(field: Any, rows: np.ndarray, *, part: int | None = None) -> np.ndarray:
    """``field.to_numpy()[rows]``, or of a field with two indices ``field.to_numpy()[part][rows]``."""
    width = () if isinstance(field, ti.ScalarField) else (field.n,)
    values = np.zeros((len(rows), *width), dtype=to_numpy_type(field.dtype))
    if len(rows):
        whole = (0 if part is None else part, part is not None)
        (_take_vectors if width else _take_numbers)(field, np.ascontiguousarray(rows, dtype=np.int32), values, *whole)
    return values


def put_rows(field: Any, values: np.ndarray, where: Any) -> None:
    """Put values into some rows of a field; the others become zero. ``where`` is an index of its numpy array."""
    width = () if isinstance(field, ti.ScalarField) else (field.n,)
    array = np.zeros((*field.shape, *width), dtype=to_numpy_type(field.dtype))
    array[where] = values
    field.from_numpy(array)


@ti.kernel
def _take_numbers(
    field: ti.template(),
    rows: ti.types.ndarray(dtype=ti.i32, ndim=1),
    values: ti.types.ndarray(ndim=1),
    part: int,
    parted: ti.template(),
):
    for k in range(rows.shape[0]):
        if ti.static(parted):
            values[k] = field[part, rows[k]]
        else:
            values[k] = field[rows[k]]


@ti.kernel
def _take_vectors(
    field: ti.template(),
    rows: ti.types.ndarray(dtype=ti.i32, ndim=1),
    values: ti.types.ndarray(ndim=2),
    part: int,
    parted: ti.template(),
):
    for k in range(rows.shape[0]):
        for d in ti.static(range(field.n)):
            if ti.static(parted):
                values[k, d] = field[part, rows[k]][d]
            else:
                values[k, d] = field[rows[k]][d]
