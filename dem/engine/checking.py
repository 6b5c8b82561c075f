"""The lists of a bed against brute force: what ``BedBase.debug`` does at every step and whenever lists are made.

Every pair of grains within reach is found anew on the host, by a tree over all grains in the periodic box. Every
distance to a body is found by trying all grains with all bodies. Three faults are mistakes of the program. A list has a
pair too few, too many, twice or through a wrong image. A list is out of date. A contact has lost its history. Then
BedFailure says which grains, at which step. Of two sleepers nothing is listed, and nothing is looked for.

Costs many times what the step itself does: for tests, and for a bed that is not believed.
"""

import os
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from dem.contact.cohesion import jkr_range
from dem.contact.law import effective_moduli
from dem.grains.materials import Material

from .engine import Engine
from .lists import INDEX_BITS, INDEX_MASK, SAME_IMAGE
from .rows import chunk_starts, layout_of
from .values import BedFailure, State

__all__ = ["Histories", "check_lists", "check_step", "debug_wanted", "keep_histories"]

Array = np.ndarray
# Histories of contacts, sorted by a number for each pair of ids: the numbers, and slide and roll, seven of a row.
Histories = tuple[Array, Array]

# A distance in the kernels may be off by this many roundings of the box's size: nothing is said of pairs as near to
# the edge of their reach as that.
_ROUNDINGS = 8
_IMAGES = 9
_SHOWN = 3


class CheckedBed(Protocol):
    """What the check needs of a bed (``dem.engine.state.BedState``)."""

    engine: Engine
    material: Material
    size: tuple[float, float, float]
    skin: float
    steps: int
    grain_count: int

    @property
    def awake_count(self) -> int: ...

    def state(self) -> State: ...


def debug_wanted() -> bool:
    """Whether HEDGEBED_DEBUG=1 asks for a check of every list. Raises ValueError: it is neither 1 nor 0."""
    given = os.environ.get("HEDGEBED_DEBUG", "")
    if given not in ("", "0", "1"):
        raise ValueError(f"HEDGEBED_DEBUG = {given!r} in the environment must be 1 (check every list) or 0")
    return given == "1"


def check_step(bed: CheckedBed) -> None:
    """After a step: the lists are not out of date, and who touches is in them, as touching, and nobody else.

    Raises BedFailure.
    """
    state = bed.state()
    _check_age(bed, state)
    rows, wanted, possible = _pairs(bed, state, skin=0.0, touch=True)
    _compare(bed, state, rows[state["pair"] < 0], wanted, possible, "touch")
    listed, apart, slack = _near(bed, state, plane=0)
    _compare_near(bed, state, listed, apart < -slack, "touch", possible=None)


def keep_histories(bed: CheckedBed) -> Histories:
    """What contacts remember, before new lists are made."""
    return _histories(bed, bed.state(), back=True)


def check_lists(bed: CheckedBed, before: Histories) -> None:
    """After new lists: all within reach are in them, nobody else, and contacts remember what they did before.

    Raises BedFailure.
    """
    state = bed.state()
    rows, wanted, possible = _pairs(bed, state, skin=bed.skin)
    _compare(bed, state, rows, wanted, possible, "are within reach")
    listed, apart, slack = _near(bed, state, plane=1)
    reach = apart - bed.skin
    _compare_near(bed, state, listed, reach < -slack, "are within reach", possible=reach < slack)
    _compare_histories(bed, before, _histories(bed, state, back=False))


def _check_age(bed: CheckedBed, state: State) -> None:
    """Nothing has gone farther than half the skin since the lists were made."""
    limit, awake = 0.5 * bed.skin, slice(0, bed.awake_count)
    slack = _slack(bed, state)
    path = np.linalg.norm(state["position"][awake, :3] - state["listed"][awake], axis=1).astype(float)
    bodies = int(state["numbers"][1])
    turned = 2 * np.linalg.norm(state["body_turn"][:bodies] - state["body_listed_turn"][:bodies], axis=1)
    gone = np.linalg.norm(state["body_position"][:bodies] - state["body_listed"][:bodies], axis=1)
    gone = gone + np.where(turned > 0, turned * state["body_extent"][:bodies], 0.0)
    late = [f"grain {state['id'][i]} has gone {path[i]:.4g} m" for i in np.flatnonzero(path > limit + slack)]
    late += [f"body {b} has gone {gone[b]:.4g} m" for b in np.flatnonzero(gone > limit + slack)]
    if late:
        _fail(bed, late, f"since the lists were made; new ones are due at {limit:.4g} m, half the skin")


def _slack(bed: CheckedBed, state: State) -> float:
    """Below which a difference of two lengths says nothing [m]."""
    largest = max(*bed.size[:2], float(np.abs(state["position"][:, :3]).max()))
    return float(_ROUNDINGS * np.finfo(state["position"].dtype).eps * largest)


def _pairs(bed: CheckedBed, state: State, *, skin: float, touch: bool = False) -> tuple[Array, Array, Array]:
    """Pairs as sorted numbers (``_number``): those listed, row by row; those that must be; those that may be.

    ``skin``: within how far of touching [m]. ``touch``: as they are in a step, where a slow grain's row with a fast one
    never touches: that is the fast one's.
    """
    count, slack = bed.grain_count, _slack(bed, state)
    first = np.repeat(np.arange(count), state["pair_count"])
    bits = np.where(state["pair"] < 0, ~state["pair"], state["pair"]).astype(np.int64)
    listed = _number(count, first, bits & INDEX_MASK, bits >> INDEX_BITS)
    i, j, image, gap = _close(bed, state, skin + slack)
    awake, chunk = bed.awake_count, _chunks(bed, state)
    # A pair of one chunk has one row, one across chunks two, one of a sleeper that of the grain awake.
    i, j, image, gap = (np.concatenate(both) for both in ((i, j), (j, i), (image, _IMAGES - 1 - image), (gap, gap)))
    mine = (i < awake) & ((j >= awake) | (chunk[i] != chunk[j]) | (i < j))
    if touch and "sleep_numbers" in state:
        fast = int(state["sleep_numbers"][3])
        mine &= (i < fast) | (j >= fast)
    numbers = _number(count, i, j, image)[mine]
    return listed, np.sort(numbers[gap[mine] < skin - slack]), np.sort(numbers)


def _number(count: int, i: Array, j: Array, image: Array) -> Array:
    return (i.astype(np.int64) * count + j) * _IMAGES + image


def _close(bed: CheckedBed, state: State, within: float) -> tuple[Array, Array, Array, Array]:
    """Pairs i < j (places in memory) closer than ``within`` [m] to feeling one another, by a tree over all grains.

    Returns places, the image's number as the lists have it, and the gap that is left between the two [m].
    """
    from scipy.spatial import cKDTree  # here, since it is slow to import

    position = state["position"].astype(float)
    x, radius = position[:, :3], position[:, 3]
    period = np.array([*bed.size[:2], 0.0])
    inside = x.copy()
    for k in range(2):
        inside[:, k] = np.mod(x[:, k], period[k])
        inside[inside[:, k] >= period[k], k] = 0.0
    farthest = 2 * float(radius.max()) + within + float(_felt(bed, radius.max(keepdims=True) / 2)[0])
    i, j = cKDTree(inside, boxsize=period).query_pairs(farthest, output_type="ndarray").astype(np.int64).T
    d = x[i] - x[j]
    back = np.zeros((len(i), 2))
    for k in range(2):
        back[:, k] = -np.round(d[:, k] / period[k])
        d[:, k] += back[:, k] * period[k]
    sums = radius[i] + radius[j]
    gap = np.linalg.norm(d, axis=1) - sums - _felt(bed, radius[i] * radius[j] / sums)
    near = gap < within
    image = (back[:, 0] + 1 + 3 * (back[:, 1] + 1)).astype(np.int64)
    return i[near], j[near], image[near], gap[near]


def _felt(bed: CheckedBed, radius: Array) -> Array:
    """How far apart grains of these effective radii [m] feel one another [m]."""
    stuff = bed.material
    if stuff.cohesion != "jkr":
        return np.zeros_like(radius)
    young, _ = effective_moduli(stuff.young, stuff.poisson, stuff.young, stuff.poisson)
    unit = jkr_range(surface_energy=stuff.surface_energy, radius=1.0, effective_young=young)
    return np.asarray(unit * np.cbrt(radius))


def _chunks(bed: CheckedBed, state: State) -> Array:
    """The chunk of every grain, by place; of sleepers the last."""
    ends = chunk_starts(*layout_of(state))[1:]
    return np.minimum(np.searchsorted(ends, np.arange(bed.grain_count), side="right"), len(ends) - 1)


def _compare(bed: CheckedBed, state: State, listed: Array, wanted: Array, possible: Array, what: str) -> None:
    ids, count = state["id"], bed.grain_count

    def name(number: int) -> str:
        pair, image = divmod(int(number), _IMAGES)
        through = "" if image == SAME_IMAGE else f" through image ({image % 3 - 1}, {image // 3 - 1})"
        return f"grains {ids[pair // count]} and {ids[pair % count]}{through}"

    numbers, times = np.unique(listed, return_counts=True)
    wrong = [f"{name(n)} {what} and are not listed" for n in np.setdiff1d(wanted, numbers)]
    wrong += [f"{name(n)} are listed {k} times" for n, k in zip(numbers, times, strict=True) if k > 1]
    wrong += [f"{name(n)} are listed as if they did: no such pair does" for n in np.setdiff1d(numbers, possible)]
    if wrong:
        _fail(bed, wrong, f"of {len(wanted)} rows of pairs that {what}")


def _near(bed: CheckedBed, state: State, *, plane: int) -> tuple[Array, Array, float]:
    """How often each grain awake is listed with each body; how far each is from feeling it [m]; slack [m].

    The first two of shape [awake, body]. ``plane``: 0 where grains feel bodies in a step, 1 where they are listed.
    """
    e, awake, bodies = bed.engine, bed.awake_count, int(state["numbers"][1])
    gaps = np.full((awake, max(1, bodies), 2), np.inf)
    e.body_gaps(gaps, bed.skin, e.shapes)
    listed = np.zeros((awake, max(1, bodies)), dtype=int)
    np.add.at(listed, (state["near_grain"], state["near_body"]), 1)
    return listed, gaps[:, :, plane], _slack(bed, state)


def _compare_near(
    bed: CheckedBed, state: State, listed: Array, wanted: Array, what: str, *, possible: Array | None
) -> None:
    ids = state["id"]
    wrong = [f"grain {ids[i]} and body {b} {what} and are not listed" for i, b in np.argwhere(wanted & (listed == 0))]
    wrong += [f"grain {ids[i]} and body {b} are listed {listed[i, b]} times" for i, b in np.argwhere(listed > 1)]
    if possible is not None:
        wrong += [
            f"grain {ids[i]} and body {b} are listed: they are not" for i, b in np.argwhere(~possible & (listed > 0))
        ]
    if wrong:
        _fail(bed, wrong, f"of {int(wanted.sum())} grains and bodies that {what}")


def _histories(bed: CheckedBed, state: State, *, back: bool) -> Histories:
    """Slide and roll by pair of ids; of a body the id is ``grain_count`` and its number.

    ``back``: with a row for the other side of each contact that only one side has.
    """
    ids, count = state["id"].astype(np.int64), bed.grain_count
    touching = state["pair"] < 0
    first = np.repeat(np.arange(count), state["pair_count"])[touching]
    second = (~state["pair"][touching]).astype(np.int64) & INDEX_MASK
    parts = [(ids[first], ids[second], _seven(state, ""))]
    near = _seven(state, "near_")
    parts.append((ids[state["near_grain"]], count + state["near_body"].astype(np.int64), near))
    if "sleep_store_who" in state:
        owner, who = (state[f"sleep_store_{name}"].astype(np.int64) for name in ("owner", "who"))
        parts.append((owner, np.where(who < 0, count - 1 - who, who), _seven(state, "sleep_store_")))
    a, b, values = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    most = count + 64
    numbers = a * most + b
    if back:
        # The last number of slide is the same from either side.
        sign = np.array([-1.0, -1, -1, 1, -1, -1, -1], dtype=values.dtype)
        other = (b < count) & ~np.isin(b * most + a, numbers)
        numbers = np.concatenate([numbers, b[other] * most + a[other]])
        values = np.concatenate([values, sign * values[other]])
    order = np.argsort(numbers, kind="stable")
    return numbers[order], values[order]


def _seven(state: Mapping[str, Any], prefix: str) -> Array:
    slide = state[f"{prefix}slide"]
    roll = state.get(f"{prefix}roll", np.zeros((len(slide), 3), dtype=slide.dtype))
    return np.hstack([slide, roll[:, :3]])


def _compare_histories(bed: CheckedBed, before: Histories, after: Histories) -> None:
    """Raise BedFailure unless the new lists hold exactly the contact histories of the old ones."""
    most = bed.grain_count + 64

    def name(number: int) -> str:
        a, b = divmod(int(number), most)
        return f"grain {a} and {f'grain {b}' if b < bed.grain_count else f'body {b - bed.grain_count}'}"

    place = np.minimum(np.searchsorted(before[0], after[0]), max(0, len(before[0]) - 1))
    known = before[0][place] == after[0] if len(before[0]) else np.zeros(len(after[0]), dtype=bool)
    was = np.where(known[:, None], before[1][place] if len(before[0]) else 0.0, 0.0)
    wrong = [f"the history of {name(after[0][k])} is another" for k in np.flatnonzero((was != after[1]).any(axis=1))]
    bodiless = after[0] % most < bed.grain_count
    wrong += [f"{name(after[0][k])} have a history but never touched" for k in np.flatnonzero(~known & bodiless)]
    # Each contact that was is there still, from one side at least: nothing parts by a whole skin in a step.
    a, b = np.divmod(before[0], most)
    there = np.isin(before[0], after[0]) | np.isin(b * most + a, after[0]) | (b >= bed.grain_count)
    wrong += [f"the contact of {name(before[0][k])} is forgotten" for k in np.flatnonzero(~there)]
    if wrong:
        _fail(bed, wrong, f"of {len(after[0])} rows of contacts carried over to new lists")


def _fail(bed: CheckedBed, wrong: list[str], what: str) -> None:
    shown = "; ".join(wrong[:_SHOWN])
    more = f"; and {len(wrong) - _SHOWN} more" if len(wrong) > _SHOWN else ""
    raise BedFailure(f"debug, step {bed.steps}: {shown}{more} ({what}); a mistake of the program, please report it")
