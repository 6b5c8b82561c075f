"""The springs of contacts on the way to LAMMPS: its restart file, with our springs in place of the zeros.

LAMMPS' data file has no springs. So LAMMPS finds its contacts by itself and writes a restart file. `with_springs` puts
our springs into these bytes, and LAMMPS reads them again. Bytes that do not match our contacts in every part are
refused (`LayoutError`). Where LAMMPS says what is in `src/write_restart.cpp`, `src/atom_vec.cpp`,
`src/fix_neigh_history.cpp` and `src/GRANULAR/` (`pair_granular.cpp`, `fix_wall_gran.cpp`, `gran_sub_mod_*.cpp`).

The end of the file has the number of fixes with data of each atom, and for each its id, its style and a size. Then
follow pairs of a number and a value until -1, and for each process a mark, a count and so many doubles. The last is the
file's first word. Each atom has a record: its length, position, id, type, mask, image (whole numbers by their bits),
velocity, radius, mass, spin. Then follow the fixes' parts, each with its own length first:

- `NEIGH_HISTORY_GRANULAR`: the number of partners; for each its id (2021: a double, 2025: by its bits) and its history
- `floor`: the history, zeros without a contact (with JKR one number is before it)

A history, as atom i has it in a contact with j; n is the normal towards i, R* the effective radius:

| numbers | here | in LAMMPS |
|---|---|---|
| 3 | `rescaled`: force of the spring on i, -S_t u; else the stretch u | the same |
| 1, with `rescaled` | contact radius a | the same |
| 3, with rolling | q, the angle turned; torque -S_t R*^2 q across n | r, of torque -k R*^2 n x r: r = S_t / k q x n |
| 1, with rolling | q . n, the twisting angle | the same |

k is the rolling spring of the two classes of load (`.rolling`), or of the floor (`.law`). So torques are the same, and
the stretch is that of the other spring. Seen from j, n changes its sign: the first three change theirs, r and the
twisting angle do not.

LAMMPS of 2021 with `rescaled` has as many numbers at the fourth place as it has atom types, of which it uses the first.
That of 2025 has two more at the end with rolling. Its twisting spring is 1/a times as strong as it should be, so that
the angle goes over times a.
"""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem import Bed
from dem.engine.state import touching_pairs

from .law import contact_radius
from .rolling import RollingClasses

__all__ = ["LayoutError", "Springs", "springs_of", "with_springs"]

Vector = np.ndarray
_MAGIC = b"LammpS RestartT\0"
_PAIRS, _FLOOR = "NEIGH_HISTORY_GRANULAR", "floor"
_ID, _TYPE, _RADIUS, _OWN = 4, 5, 11, 16  # Places in an atom's record, and where the fixes' parts begin
_MOST_FIXES, _BEFORE = 16, 2048  # Fixes with data of each atom; bytes before the last one in which their list begins
_SAME = 1e-12  # Relative difference of radii that count as equal [1]


class LayoutError(ValueError):
    """A restart file of LAMMPS is not as it is known here, or its contacts are not ours."""


@dataclass(frozen=True)
class Springs:
    """The springs of contacts with grains, or with the floor, as LAMMPS has them.

    Attributes:
        first, second: grains by id, from 0, shape [contact]; of the floor `second` is empty
        slide: the first three numbers of a history, as `first` has them, shape [contact, 3]
        radius: contact radius a [m], shape [contact]
        roll: a R* q x n [m2], shape [contact, 3]
        twist: q . n [1], shape [contact]
        overlap: [m], shape [contact]
    """

    first: Vector
    second: Vector
    slide: Vector
    radius: Vector
    roll: Vector
    twist: Vector
    overlap: Vector

    @property
    def stretched(self) -> int:
        """How many contacts have a spring that is stretched."""
        return int((self.slide.any(axis=1) | self.roll.any(axis=1) | (self.twist != 0)).sum())


def springs_of(bed: Bed, rows: Sequence[Vector | Sequence[float]]) -> tuple[Springs, Springs]:
    """The springs of a bed between its grains, and on its floor. ``rows``: pair parameters of both."""
    state, stuff = bed.state(), bed.material
    ids, x = state["id"].astype(np.int64), state["position"].astype(float)
    first, second, back = touching_pairs(state)
    low, high = np.minimum(first, second), np.maximum(first, second)
    once = np.unique(low * len(ids) + high, return_index=True)[1]  # a pair across chunks is listed by both
    first, second, back = (each[once] for each in (first, second, back))
    apart = x[first, :3] - x[second, :3]
    apart[:, :2] += back * np.array(bed.size[:2])
    length = np.linalg.norm(apart, axis=1)
    r_1, r_2 = x[first, 3], x[second, 3]
    near = state["near_grain"].astype(np.int64)
    on_floor = (state["near_body"] == 0) & (x[near, 2] < x[near, 3])
    near = near[on_floor]
    up = np.tile([0.0, 0.0, 1.0], (len(near), 1))
    geometry: tuple[tuple[Any, ...], ...] = (
        (ids[first], ids[second], r_1 * r_2 / (r_1 + r_2), r_1 + r_2 - length, apart / length[:, None]),
        (ids[near], ids[:0], x[near, 3], x[near, 3] - x[near, 2], up),
    )
    slides = state["slide"][once], state["near_slide"][on_floor]
    rolls = state["roll"][once] if "roll" in state else np.zeros((len(first), 3)), state["near_roll"][on_floor]
    found = []
    for row, (one, other, reduced, overlap, n), slide, roll in zip(rows, geometry, slides, rolls, strict=True):
        a = contact_radius(row, stuff.cohesion, overlap, reduced)
        u, q = slide[:, :3].astype(float), roll.astype(float)
        if stuff.tangential == "rescaled":
            u = -float(row[1]) * a[:, None] * u
        turned = (a * reduced)[:, None] * np.cross(q, n)
        found.append(Springs(one, other, u, a, turned, (q * n).sum(axis=1), overlap))
    return found[0], found[1]


@dataclass(frozen=True)
class _Layout:
    """Where the numbers of a history are.

    ``before``, ``radii``, ``after``: how many there are before the first three, for the contact radius and after the
    twisting angle. ``twist_by_radius``: whether the angle is times a.
    """

    before: int
    radii: int
    rolling: bool
    after: int
    twist_by_radius: bool

    @property
    def width(self) -> int:
        """How many numbers there are."""
        return self.before + 3 + self.radii + (4 + self.after) * self.rolling

    @property
    def used(self) -> list[int]:
        """Places of the numbers of `histories`."""
        turning = range(self.before + 3 + self.radii, self.before + 7 + self.radii)
        return [*range(self.before, self.before + 3 + (self.radii > 0)), *(turning if self.rolling else ())]

    def histories(self, springs: "Springs", roll: Vector) -> Vector:
        """The numbers of these contacts as `first` has them, shape [contact, number]."""
        twist = springs.twist * (springs.radius if self.twist_by_radius else 1.0)
        columns = [springs.slide]
        if self.radii:
            columns.append(springs.radius[:, None])
        if self.rolling:
            columns += [roll, twist[:, None]]
        return np.hstack(columns)

    def put(self, values: Vector, at: Vector, rows: Vector) -> None:
        """Put these histories into ``values`` from these places on. Raises LayoutError where one is there already.

        But for the twisting angle, which may slide in LAMMPS' setup already.
        """
        twist = self.used[-1] if self.rolling else -1
        if any(values[at + k].any() for k in range(self.before, self.width) if k != twist):
            raise LayoutError("its contacts have a history already")
        for k, column in zip(self.used, rows.T, strict=True):
            values[at + k] = column


def with_springs(
    raw: bytes, pairs: Springs, floor: Springs, *, radii: Vector, classes: RollingClasses, floor_radius: float
) -> bytearray:
    """A restart file of LAMMPS whose contacts have no history, with these springs.

    Args:
        raw: its bytes
        radii: of the grains, by id [m]
        classes: of load, whose rolling springs the grains have
        floor_radius: contact radius of the floor's rolling spring [m]

    Raises LayoutError for bytes of another layout, and for contacts that are not those of the springs.
    """
    out = bytearray(raw)
    names, blocks = _blocks(raw)
    grains = [_Grains(np.frombuffer(out, dtype=float, count=count, offset=at), names) for at, count in blocks]
    ids = np.concatenate([each.ids for each in grains])
    if len(ids) != len(radii) or (np.sort(ids) != np.arange(1, len(radii) + 1)).any():
        raise LayoutError(f"it has {len(ids)} grains, which are not those of the bed's {len(radii)}")
    kinds = np.zeros(len(radii) + 1, dtype=np.int64)
    for each in grains:
        kinds[each.ids] = each.kinds
        if (np.abs(each.radii - radii[each.ids - 1]) > _SAME * each.radii).any():
            raise LayoutError("its radii are not those of the bed")
    stuff = classes.material
    rolling, rescaled = stuff.rolling_friction > 0, int(stuff.tangential == "rescaled")
    jkr = int(stuff.cohesion == "jkr")
    known = [  # of a pair and of the floor, in LAMMPS of 2021 and of 2025
        tuple(_Layout(before, radii * rescaled, rolling, after, after > 0) for before, radii in ((0, many), (jkr, 1)))
        for many, after in ((classes.count, 0), (1, 2))
    ]
    widths = {(each.width, each.floor_width) for each in grains if each.ids.size}
    for of_pair, of_floor in known:
        if widths <= {(of_pair.width, of_floor.width), (None, of_floor.width)}:
            break
    else:
        raise LayoutError(f"a contact has {sorted(map(str, widths))} numbers, which no known version of LAMMPS has")
    _put_pairs(grains, of_pair, pairs, kinds, classes, parted=bool(jkr))
    values = of_floor.histories(floor, floor.roll / floor_radius)
    row = np.full(len(radii) + 1, -1)
    row[floor.first + 1] = np.arange(len(floor.first))
    for each in grains:
        rows = row[each.ids]
        of_floor.put(each.values, each.floor_at[rows >= 0] + 1, values[rows[rows >= 0]])
    return out


def _put_pairs(
    grains: list["_Grains"], layout: _Layout, springs: Springs, kinds: Vector, classes: RollingClasses, *, parted: bool
) -> None:
    """Give each contact its history; ``parted``: a contact of ours that does not overlap may be missing."""
    one, other = springs.first + 1, springs.second + 1
    roll = springs.roll / classes.radius(kinds[one], kinds[other])[:, None] if len(one) else springs.roll
    values = layout.histories(springs, roll)
    seen_from_other = values.copy()
    seen_from_other[:, :3] *= -1
    values = np.concatenate([values, seen_from_other])
    base = len(kinds)
    keys = np.concatenate([one * base + other, other * base + one])
    order = np.argsort(keys)
    keys = keys[order]
    theirs = [each.ids[each.owner] * base + each.partner for each in grains]
    found = np.sort(np.concatenate(theirs))
    expected = keys
    if parted:
        overlaps = np.tile(springs.overlap, 2)[order] > 0
        expected = keys[overlaps | np.isin(keys, found)]
    if len(found) != len(expected) or (found != expected).any() or (np.diff(keys) == 0).any():
        raise LayoutError(f"its {len(found) // 2} contacts are not the bed's {len(expected) // 2}")
    for each, own in zip(grains, theirs, strict=True):
        layout.put(each.values, each.pair_at + 1, values[order[np.searchsorted(keys, own)]])


class _Grains:
    """The grains that one process wrote: views into its doubles. ``names``: of the fixes, in order."""

    def __init__(self, values: Vector, names: list[str]) -> None:
        self.values = values
        at = _beginnings(values)
        self.ids, self.kinds = (self._whole(at + k) for k in (_ID, _TYPE))
        self.radii = values[at + _RADIUS]
        end, part = at + values[at].astype(np.int64), at + _OWN
        parts = {}
        for name in names:
            if (part >= end).any():
                raise LayoutError("the record of a grain ends too early")
            length = values[part]
            if not ((length >= 1) & (length <= end - part) & (length % 1 == 0)).all():
                raise LayoutError(f"the part of {name} in the record of a grain has no possible length")
            parts[name] = part, length.astype(np.int64)
            part = part + parts[name][1]
        if (part != end).any():
            raise LayoutError("the record of a grain has more than its fixes wrote")
        self.floor_at, lengths = parts[_FLOOR]
        self.floor_width = _only(lengths - 1)
        begin, length = parts[_PAIRS]
        count = values[np.minimum(begin + 1, len(values) - 1)]
        if (length < 2).any() or not ((count >= 0) & (count % 1 == 0)).all():
            raise LayoutError("the number of contacts of a grain is not a whole number")
        many = count.astype(np.int64)
        some = many > 0
        share = (length[some] - 2) / many[some]
        if (length[~some] != 2).any() or (share % 1 != 0).any():
            raise LayoutError("the contacts of a grain have no possible length")
        self.width = _only(share.astype(np.int64) - 1)
        self.owner = np.repeat(np.arange(len(at)), many)
        place = np.arange(len(self.owner)) - np.repeat(np.cumsum(many) - many, many)
        self.pair_at = begin[self.owner] + 2 + place * (1 + (self.width or 0))
        self.partner = self._partners()

    def _whole(self, at: Vector) -> Vector:
        """Whole numbers that lie there by their bits."""
        return np.ascontiguousarray(self.values[at]).view(np.int64)

    def _partners(self) -> Vector:
        """Ids of partners: doubles, or whole numbers by their bits, which as doubles are almost 0."""
        as_doubles = self.values[self.pair_at]
        if (as_doubles >= 1).all():
            return as_doubles.astype(np.int64)
        return self._whole(self.pair_at)


def _only(lengths: Vector) -> int | None:
    """The one number that all these are; None where there is none."""
    if len(lengths) and (lengths != lengths[0]).any():
        raise LayoutError("contacts have histories of several lengths")
    return int(lengths[0]) if len(lengths) else None


def _beginnings(values: Vector) -> Vector:
    """Where the records of the grains begin, which follow one another to the end."""
    found, at, end = [], 0, len(values)
    while at < end:
        length = float(values[at])
        if not (length % 1 == 0 and _OWN < length <= end - at):
            raise LayoutError("the records of the grains do not follow one another")
        found.append(at)
        at += int(length)
    return np.array(found, dtype=np.int64)


def _blocks(raw: bytes) -> tuple[list[str], list[tuple[int, int]]]:
    """Names of the fixes with data of each atom, and for each process where its doubles begin and how many they are."""
    last = raw.rfind(_PAIRS.encode() + b"\0")
    if not raw.startswith(_MAGIC) or last < 0:
        raise LayoutError("it does not begin as such a file, or has no history of contacts")
    for begin in range(max(0, last - _BEFORE), last):
        try:
            names, at = _fixes(raw, begin)
            if _PAIRS in names and _FLOOR in names:
                return names, _doubles(raw, at)
        except (LayoutError, struct.error):
            continue
    raise LayoutError("its end is not as that of a known version")


def _fixes(raw: bytes, at: int) -> tuple[list[str], int]:
    """Ids of the fixes that a list here has, and where it ends."""
    (count,) = struct.unpack_from("=i", raw, at)
    if not 1 <= count <= _MOST_FIXES:
        raise LayoutError("no list of fixes")
    names, at = [], at + 4
    for _ in range(count):
        texts = []
        for _ in range(2):
            (length,) = struct.unpack_from("=i", raw, at)
            text = raw[at + 4 : at + 4 + max(0, length)]
            if not re.fullmatch(rb"[\w/]+\0", text):
                raise LayoutError("no list of fixes")
            texts.append(text[:-1].decode("ascii"))
            at += 4 + length
        names.append(texts[0])
        at += 4
    return names, at


def _doubles(raw: bytes, at: int) -> list[tuple[int, int]]:
    """Where the doubles of each process begin, and how many they are, up to the end of the file."""
    for _ in range(4):
        (mark,) = struct.unpack_from("=i", raw, at)
        at += 4
        if mark == -1:
            break
        at += 4
    else:
        raise LayoutError("no end of the header")
    found, (own,) = [], struct.unpack_from("=i", raw, at)
    while at < len(raw) - len(_MAGIC):
        mark, count = struct.unpack_from("=ii", raw, at)
        if mark != own or count < 0:
            raise LayoutError("no doubles of a process")
        found.append((at + 8, count))
        at += 8 + 8 * count
    if not found or raw[at:] != _MAGIC:
        raise LayoutError("no end of the file")
    return found
