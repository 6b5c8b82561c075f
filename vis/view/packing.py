"""Arrays over time as text for a page: rounded to whole numbers, differences between frames, compressed.

A page decodes them in `vis/templates/scene/data.js`, without a library.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["LEVELS", "Codes", "Entry", "pack", "packed_size", "scale_of", "to_codes", "to_text", "unpack"]

LEVELS = 65535
"""Largest code of a position."""
_DTYPES: dict[int, np.dtype[Any]] = {1: np.dtype("<u1"), 2: np.dtype("<u2"), 4: np.dtype("<u4")}


class Entry(TypedDict):
    """What a page must know to decode an array: its shape, and the bytes of a number."""

    name: str
    frames: int
    count: int
    parts: int
    bytes: int


@dataclass(frozen=True)
class Codes:
    """Whole numbers over time.

    ``name``: What they are. ``values``: uint8, uint16 or uint32, shape (frames, count, parts).
    """

    name: str
    values: NDArray[Any]

    def entry(self) -> Entry:
        """What a page must know to decode them."""
        frames, count, parts = self.values.shape
        return {"name": self.name, "frames": frames, "count": count, "parts": parts, "bytes": self.values.itemsize}


def scale_of(low: ArrayLike, high: ArrayLike) -> float:
    """Length of a step [m], the same along all axes, so that a box of these corners takes `LEVELS` of them at most."""
    return max(float(np.max(np.subtract(high, low))), 1e-12) / LEVELS


def to_codes(points: NDArray[Any], low: NDArray[Any], step: float) -> NDArray[np.uint16]:
    """The whole steps from `low` to points [m], both of the same last dimension; what lies outside is moved inside."""
    return np.clip(np.rint((points - low) / step), 0, LEVELS).astype(np.uint16)


def pack(arrays: Sequence[Codes]) -> bytes:
    """All arrays one after another, compressed.

    A frame is stored as its difference from the one before it, modulo the type's range. Of each frame and part, the
    lowest bytes of all its numbers come first, then the next higher ones.
    """
    return zlib.compress(b"".join(_planes(array.values) for array in arrays), 6)


def packed_size(blob: bytes) -> int:
    """Bytes that it takes on a page, as base64."""
    return 4 * -(-len(blob) // 3)


def to_text(blob: bytes) -> str:
    """As a page holds it."""
    return base64.b64encode(blob).decode("ascii")


def unpack(blob: bytes, entries: Sequence[Entry]) -> dict[str, NDArray[Any]]:
    """What `pack` has packed, by name, as a page decodes it. Raises ValueError for a blob of another length."""
    raw = np.frombuffer(zlib.decompress(blob), dtype=np.uint8)
    wanted = sum(e["frames"] * e["count"] * e["parts"] * e["bytes"] for e in entries)
    if len(raw) != wanted:
        raise ValueError(f"the data of a scene has {len(raw)} bytes; its entries describe {wanted}")
    found, start = {}, 0
    for entry in entries:
        frames, count, parts, size = entry["frames"], entry["count"], entry["parts"], entry["bytes"]
        stop = start + frames * count * parts * size
        planes = raw[start:stop].reshape(frames, parts, size, count)
        steps = np.ascontiguousarray(planes.transpose(0, 3, 1, 2)).view(_DTYPES[size])[..., 0]
        found[entry["name"]] = np.cumsum(steps, axis=0, dtype=_DTYPES[size])
        start = stop
    return found


def _planes(values: NDArray[Any]) -> bytes:
    dtype = _DTYPES[values.itemsize]
    steps = values.astype(dtype, copy=True)
    steps[1:] -= values[:-1]
    split = steps[..., None].view(np.uint8).reshape(*steps.shape, dtype.itemsize)
    return np.ascontiguousarray(split.transpose(0, 2, 3, 1)).tobytes()
