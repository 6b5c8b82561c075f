"""Checkpoint and rollback: all that the next steps of a bed depend on, copied where it lies, on the device.

``Bed.state`` gives the same as arrays of the host, packed, for files; a step of a coupling that is repeated needs it
often, and on a GPU without the bed leaving the device.
"""

from dataclasses import dataclass
from typing import Any

import taichi as ti

from .base import BedBase

__all__ = ["Checkpoint", "roll_back", "take"]

# What lists are made with, and what a step makes anew: nothing of it is read before it is written.
_SCRATCH = ("old_", "cell_", "block_", "came_from", "key", "near_first", "touching", "rank", "ticket", "claim",
            "problem")  # fmt: skip
_BED_NUMBERS = ("steps", "list_count", "grain_steps", "steps_since_lists", "reaction_steps", "skin", "tallied")
_SLEEP_NUMBERS = ("awake", "mass", "slept", "leaving")


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What ``Bed.checkpoint`` returned; a bed has room for one, so the next one ends it.

    Attributes:
        tables: whose fields were copied: the engine, the sleepers, the balance.
        numbers: (owner, attribute, value) of what no field holds.
        conditions: gravity, and the rules of sleep at work, which must be the same at a rollback.
    """

    tables: tuple[Any, ...]
    numbers: list[tuple[Any, str, Any]]
    conditions: tuple[Any, ...]


def take(bed: BedBase) -> Checkpoint:
    """Copy it. Room of the bed's own size is taken the first time, and kept."""
    owners: list[tuple[Any, tuple[str, ...]]] = [(bed, _BED_NUMBERS)]
    if bed.sleeper is not None:
        owners.append((bed.sleeper, _SLEEP_NUMBERS))
    numbers = [(owner, name, getattr(owner, name)) for owner, names in owners for name in names]
    kept = Checkpoint(_tables(bed), numbers, (*map(float, bed.gravity), bed.sleeper))
    for table in kept.tables:
        for name, twin in _twins(table).items():
            twin.copy_from(getattr(table, name))
    bed.engine.held = kept
    return kept


def roll_back(bed: BedBase, kept: Checkpoint) -> None:
    """Bring the bed back.

    Raises ValueError for what is not the last checkpoint, or where sleep, its rules, gravity or balance changed.
    """
    e = bed.engine
    if e.held is not kept or kept.tables != _tables(bed):
        raise ValueError("this bed holds another state by now: only the last one that was held can be taken back")
    if kept.conditions != (*map(float, bed.gravity), bed.sleeper):
        raise ValueError("gravity or the rules of sleep are others by now than when this bed was held")
    for table in kept.tables:
        for name, twin in _twins(table).items():
            getattr(table, name).copy_from(twin)
    if e.rest.on:
        e.rest.whole[None] = 1  # of what lists were made with nothing is kept
    for owner, name, value in kept.numbers:
        setattr(owner, name, value)


def _tables(bed: BedBase) -> tuple[Any, ...]:
    e = bed.engine
    return (e, *(table for table in (e.rest, e.balance) if table.on))


def _twins(table: Any) -> dict[str, ti.Field]:
    """A field beside each of a table's, of its shape; as many as there are by now."""
    twins: dict[str, ti.Field] = table.__dict__.setdefault("twins", {})
    for name, field in list(vars(table).items()):
        if isinstance(field, ti.Field) and not name.startswith(_SCRATCH) and name not in twins:
            kind = ti.Vector.field(field.n, field.dtype, field.shape) if isinstance(field, ti.MatrixField) else None
            twins[name] = kind if kind is not None else ti.field(field.dtype, field.shape)
    return twins
