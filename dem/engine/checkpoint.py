"""A bed held for a moment: all that its next steps depend on, copied and put back where it lies, on the device.

``Bed.state`` gives the same as arrays of the host, packed, for files; a step of a coupling that is repeated wants it
often, and on a GPU without the bed leaving the device.
"""

from dataclasses import dataclass
from typing import Any

import taichi as ti

from dem.grains.sizes import Json

from .base import BedBase

__all__ = ["Checkpoint", "roll_back", "take"]

# What lists are made with, and what a step makes anew: nothing of it is read before it is written.
_SCRATCH = ("old_", "cell_", "block_", "came_from", "key", "near_first", "touching", "rank", "ticket", "claim",
            "problem")  # fmt: skip
_NUMBERS = ("steps", "list_count", "grain_steps", "steps_since_lists", "reaction_steps", "skin", "tallied")
_SLEEPERS_NUMBERS = ("awake", "mass", "slept", "leaving")


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What ``Bed.checkpoint`` gave; a bed has room for one, so the next one ends it."""

    tables: tuple[Any, ...]  # The engine, those that sleep, the balance: whose fields were copied
    numbers: Json
    sleeper: Json | None
    under: tuple[Any, ...]
    """Gravity, and who lets grains sleep by which rules: what a bed may not have changed meanwhile."""


def take(bed: BedBase) -> Checkpoint:
    """Copy it. Room of the bed's own size is taken the first time, and kept."""
    e = bed.engine
    held = Checkpoint(
        tables=(e, *(table for table in (e.rest, e.balance) if table.on)),
        numbers={name: getattr(bed, name) for name in _NUMBERS},
        sleeper=None if bed.sleeper is None else {name: getattr(bed.sleeper, name) for name in _SLEEPERS_NUMBERS},
        under=_under(bed),
    )
    for table in held.tables:
        for name, twin in _twins(table).items():
            twin.copy_from(getattr(table, name))
    e.held = held
    return held


def roll_back(bed: BedBase, held: Checkpoint) -> None:
    """Bring the bed back.

    Raises ValueError for what is not the last that was held, or where sleep, its rules, gravity or balance changed.
    """
    e = bed.engine
    if e.held is not held or held.tables != (e, *(table for table in (e.rest, e.balance) if table.on)):
        raise ValueError("this bed holds another state by now: only the last one that was held can be taken back")
    if held.under != _under(bed):
        raise ValueError("gravity or the rules of sleep are others by now than when this bed was held")
    for table in held.tables:
        for name, twin in _twins(table).items():
            getattr(table, name).copy_from(twin)
    if e.rest.on:
        e.rest.whole[None] = 1  # of what lists were made with nothing is held
    for name, value in held.numbers.items():
        setattr(bed, name, value)
    for name, value in (held.sleeper or {}).items():
        setattr(bed.sleeper, name, value)


def _under(bed: BedBase) -> tuple[Any, ...]:
    return (*(float(part) for part in bed.gravity), bed.sleeper)


def _twins(table: Any) -> dict[str, ti.Field]:
    """A field beside each of a table's, of its shape; as many as there are by now."""
    twins: dict[str, ti.Field] = table.__dict__.setdefault("twins", {})
    for name, field in list(vars(table).items()):
        if isinstance(field, ti.Field) and not name.startswith(_SCRATCH) and name not in twins:
            kind = ti.Vector.field(field.n, field.dtype, field.shape) if isinstance(field, ti.MatrixField) else None
            twins[name] = kind if kind is not None else ti.field(field.dtype, field.shape)
    return twins
