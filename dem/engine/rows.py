"""Some rows of a field as a numpy array. A field has many times the rows in use, and copying unused rows costs time."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hedgebed_taichi import ti

__all__ = [
    "FieldStore",
    "Zeroes",
    "chunk_starts",
    "copy_fields",
    "layout_of",
    "put_rows",
    "read_fields",
    "row_numbers",
    "take_rows",
    "twins_of",
    "write_fields",
]

Rows = np.ndarray | slice


@ti.data_oriented
class Zeroes:
    """Sets several fields to zero by one kernel: `fill` of a field compiles one for each field."""

    def __init__(self, *fields: Any):
        self.scalars = [field for field in fields if isinstance(field, ti.ScalarField)]
        self.vectors = [field for field in fields if not isinstance(field, ti.ScalarField)]

    @ti.kernel
    def put(self):
        # Not `ti.zero`, which is zero times what is there: not a number stays one.
        for field in ti.static(self.scalars):
            for row in ti.grouped(field):
                field[row] = 0
        for field in ti.static(self.vectors):
            for row in ti.grouped(field):
                field[row] = ti.Vector.zero(field.dtype, field.n)


# What lists are made with, and what a step makes anew: nothing of it is read before it is written.
_SCRATCH = ("old_", "cell_", "block_", "buffer", "came_from", "key", "near_first", "touching", "rank", "ticket",
            "claim", "problem")  # fmt: skip


class FieldStore:
    """Makes fields that share one block of memory, and frees them together; ``planned``: counts their memory only.

    Attributes:
        bytes: memory that they take.
    """

    def __init__(self, *, planned: bool = False) -> None:
        self.bytes = 0
        self._builder: Any = None if planned else ti.FieldsBuilder()
        self._tree: Any = None

    def scalar(self, kind: Any, shape: int | tuple[int, ...]) -> Any:
        """As ``ti.field``, but it can be used after ``lay_out`` only."""
        return self._placed(kind, 1, shape)

    def vector(self, width: int, kind: Any, shape: int | tuple[int, ...]) -> Any:
        """As ``ti.Vector.field``, likewise."""
        return self._placed(kind, width, shape)

    def _placed(self, kind: Any, width: int, shape: int | tuple[int, ...]) -> Any:
        sizes = (shape,) if isinstance(shape, int) else shape
        self.bytes += math.prod(sizes) * width * np.dtype(ti.lang.util.to_numpy_type(kind)).itemsize
        if self._builder is None:
            return None
        field = ti.field(kind) if width == 1 else ti.Vector.field(width, kind)
        at = self._builder.dense((ti.i, ti.ij)[len(sizes) - 1], sizes) if sizes else self._builder
        at.place(field)
        return field

    def lay_out(self) -> None:
        """Take the memory."""
        self._tree = self._builder.finalize()

    def free(self) -> None:
        """Give the memory back: the fields, and kernels that use them, must not be used any more."""
        self._tree.destroy()


def twins_of(table: Any) -> dict[str, Any]:
    """A field beside each of a table's, of its shape, but for scratch; as many as there are by now."""
    twins: dict[str, Any] = table.__dict__.setdefault("twins", {})
    for name, field in list(vars(table).items()):
        if isinstance(field, ti.Field) and not name.startswith(_SCRATCH) and name not in twins:
            kind = ti.Vector.field(field.n, field.dtype, field.shape) if isinstance(field, ti.MatrixField) else None
            twins[name] = kind if kind is not None else ti.field(field.dtype, field.shape)
    return twins


def copy_fields(old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    """Copy fields by name into others that have as many rows, or more, of which the first are written then."""
    for name, field in old.items():
        if isinstance(field, ti.Field):
            if field.shape == new[name].shape:
                new[name].copy_from(field)
            else:
                _copy_head(field, new[name])


@ti.kernel
def _copy_head(old: ti.template(), new: ti.template()):
    for i in old:
        new[i] = old[i]


def row_numbers(start: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Numbers of the rows of several runs, one after the other: ``counts`` rows from each ``start`` on."""
    return np.repeat(start - (np.cumsum(counts) - counts), counts) + np.arange(int(counts.sum()))


def take_rows(field: Any, rows: Rows, *, part: int | None = None) -> np.ndarray:
    """``field.to_numpy()[rows]``, or of a field with two indices ``field.to_numpy()[part][rows]``."""
    if isinstance(rows, slice):
        return np.asarray(field.to_numpy()[rows])
    width = () if isinstance(field, ti.ScalarField) else (field.n,)
    values = np.zeros((len(rows), *(width or (1,))), dtype=ti.lang.util.to_numpy_type(field.dtype))
    if len(rows):
        which = (0 if part is None else part, part is not None)
        _take(field, np.ascontiguousarray(rows, dtype=np.int32), values, bool(width), *which)
    return values.reshape(len(rows), *width)


def put_rows(field: Any, values: np.ndarray, where: Any) -> None:
    """Put values into some rows of a field; the others become zero. ``where`` is an index of its numpy array."""
    width = () if isinstance(field, ti.ScalarField) else (field.n,)
    array = np.zeros((*field.shape, *width), dtype=ti.lang.util.to_numpy_type(field.dtype))
    array[where] = values
    field.from_numpy(array)


def read_fields(table: Any, rows: Mapping[str, Rows], prefix: str) -> dict[str, np.ndarray]:
    """These rows of the fields of a table, by the field's name behind ``prefix``."""
    return {prefix + name: take_rows(getattr(table, name), where) for name, where in rows.items()}


def write_fields(table: Any, rows: Mapping[str, Rows], prefix: str, state: Mapping[str, np.ndarray]) -> None:
    """Put back what ``read_fields`` returned; all other rows become zero."""
    for name, where in rows.items():
        put_rows(getattr(table, name), state[prefix + name], where)


def chunk_starts(awake: int, chunks: int, fast: int | None = None, fast_chunks: int = 0) -> np.ndarray:
    """First grain of each chunk and the end, shape [chunks + 1]; as ``Engine.chunk_range`` has it.

    ``awake`` grains in so many ``chunks``; the ``fast`` in the first ``fast_chunks`` of them: all of them when None.
    """
    if fast is None or chunks == fast_chunks:
        return _even_starts(awake, chunks)
    return np.concatenate(
        [_even_starts(fast, fast_chunks)[:-1], fast + _even_starts(awake - fast, chunks - fast_chunks)]
    )


def layout_of(state: Mapping[str, np.ndarray]) -> tuple[int, ...]:
    """Of a bed's state, what ``chunk_starts`` takes: grains awake, chunks, and with sleep the fast and their chunks."""
    if "sleep_numbers" not in state:
        return len(state["id"]), len(state["near_count"])
    awake, chunks, _, fast, fast_chunks = (int(number) for number in state["sleep_numbers"])
    return awake, chunks, fast, fast_chunks


def _even_starts(count: int, chunks: int) -> np.ndarray:
    base, rest = divmod(count, chunks)
    c = np.arange(chunks + 1)
    return c * base + np.minimum(c, rest)


@ti.kernel
def _take(
    field: ti.template(),
    rows: ti.types.ndarray(dtype=ti.i32, ndim=1),
    values: ti.types.ndarray(ndim=2),
    vectors: ti.template(),
    part: int,
    parted: ti.template(),
):
    for k in range(rows.shape[0]):
        if ti.static(vectors):
            for d in ti.static(range(field.n)):
                if ti.static(parted):
                    values[k, d] = field[part, rows[k]][d]
                else:
                    values[k, d] = field[rows[k]][d]
        elif ti.static(parted):
            values[k, 0] = field[part, rows[k]]
        else:
            values[k, 0] = field[rows[k]]
