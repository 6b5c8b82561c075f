"""Grains that sleep: those at rest far from the bodies are not computed until something reaches them.

The rules, in numbers of ``Sleep``; d is the mean diameter, m the mean mass, g gravity, all of the bed:

* A grain falls asleep when its speed and its surface's turning have been below ``speed`` sqrt(g d) at every check for
  ``calm`` sqrt(d / g), no grain that it touches moves faster, and no body but the floor is within ``reach`` d.
* Asleep it stands still, an unmovable grain to those awake, and its contacts with other sleepers keep their springs.
* It wakes when a body comes within ``reach`` d; when the spring force of a contact with a grain awake has changed by
  ``force`` m g, and by ``share`` of what it was, since the two last were alike, be it that the contact opens or closes;
  when a grain awake that is listed with it moves faster than ``waking_speed`` sqrt(g d). For the last two all sleepers
  in its cell of the grid and the 26 around it wake with it. Checked every ``every`` steps, and when lists are made.

Whether a packing that carries F yields under a change of F goes by their ratio, for friction has no force of its own;
hence ``share``. ``force`` is for contacts that carry next to nothing.

In memory those awake come first, in the order of the curve, and chunks, lists and loops are theirs alone; that is all
that the step knows of sleep. Who sleeps changes when lists are made, on steps that do not depend on how a run is cut,
by flags that are raised and never lowered within a check: the same bits on any number of threads.

What a sleeper would have passed on is held by nobody but the floor: ``Bed.reaction`` of the floor has their weight, the
force of those awake on them, and the momentum that falling asleep took.
"""

import math
from dataclasses import asdict, astuple, dataclass
from typing import Protocol

import numpy as np

from .engine import Engine
from .lists import INDEX_MASK
from .rows import Rows, put_rows, read_fields, row_numbers, take_rows, write_fields
from .sleep_kernels import FULL, LEAVING, WOKEN
from .values import BedFailure, State

__all__ = ["Sleep", "Sleeper"]

# A check for grains at rest is worth new lists when this share of those awake can fall asleep.
_WORTH = 0.02
_CALM_CHECKS = 4


class SleepyBed(Protocol):
    """What the sleep of grains needs of a bed (``dem.engine.base.BedBase``)."""

    engine: Engine
    gravity: tuple[float, float, float]
    time_step: float
    grain_count: int
    mean_diameter: float
    steps: int
    grain_steps: int


@dataclass(frozen=True)
class Sleep:
    """When grains sleep and wake; the module has what the numbers are shares of. Raises ValueError: not above 0."""

    speed: float = 5e-3  # A grain slower than this may fall asleep [sqrt(g d)]
    calm: float = 1.0  # For how long it must be [sqrt(d / g)]
    reach: float = 3.0  # No grain this near to a body sleeps [d]
    force: float = 1.0  # Change of a contact's force that wakes [m g], and
    share: float = 0.5  # the least of it over the force itself [1]; both must be reached
    waking_speed: float = 5e-2  # Speed of a neighbour that wakes [sqrt(g d)]
    every: int = 50
    """Steps between two checks: what wakes makes new lists, and those cost as much as four steps of all grains."""

    def __post_init__(self):
        for name, value in asdict(self).items():
            if not 0 < value < math.inf:
                raise ValueError(f"Sleep: {name} = {value} must be above 0")
        if int(self.every) != self.every:
            raise ValueError(f"Sleep: every = {self.every} must be a whole number of steps")
        if self.waking_speed <= self.speed:
            raise ValueError(
                f"Sleep: waking_speed = {self.waking_speed} must be above speed = {self.speed}, or no neighbour of one "
                f"that may sleep could"
            )


class Sleeper:
    """What a bed needs to let its grains sleep: the rules in its own units, the checks, and its part of the state."""

    def __init__(self, bed: SleepyBed, rules: Sleep):
        self.bed, self.rules = bed, rules
        g = math.hypot(*bed.gravity)
        d = bed.mean_diameter
        # The same to the bit in whatever order the grains lie.
        total = math.fsum(bed.engine.read("velocity")[:, 3])
        bed.engine.rest.total[None] = total
        weight = g * total / bed.grain_count
        self.limit, self.reach = rules.force * weight, rules.reach * d
        self.fast, self.slow = (share * math.sqrt(g * d) for share in (rules.waking_speed, rules.speed))
        checks = rules.calm * math.sqrt(d / g) / bed.time_step / rules.every / _CALM_CHECKS
        self.rest_every = max(1, round(checks)) * rules.every
        self.awake = bed.grain_count
        self.mass = 0.0
        self.slept = 0.0  # Mass asleep, summed over the steps of the last advance [kg]
        self.leaving = False

    def check(self) -> bool:
        """The check of this step, if one is due: whether lists are to be made for it."""
        e, rest, steps = self.bed.engine, self.bed.engine.rest, self.bed.steps
        if steps % self.rules.every:
            return False
        if self.awake < self.bed.grain_count:
            e.check_contacts(self.limit, self.rules.share, self.fast, rest)
        self.leaving = False
        if steps % self.rest_every == 0:
            e.find_calm(self.slow, _CALM_CHECKS, self.reach, rest, e.shapes)
        news = rest.news.to_numpy()
        self.leaving = steps % self.rest_every == 0 and int(news[LEAVING]) > _WORTH * self.awake
        return bool(news[WOKEN]) or self.leaving

    def rearrange(self, *, all_awake: bool = False) -> None:
        """Who sleeps from here on; between ``keep_lists`` and ``sort``."""
        e, rest = self.bed.engine, self.bed.engine.rest
        if all_awake:
            rest.woken.fill(1)
        elif self.awake < self.bed.grain_count:
            e.check_contacts(self.limit, self.rules.share, self.fast, rest)
        e.stir(self.bed.time_step, self.reach, int(self.leaving), rest, e.shapes, e.balance)
        rest.news.fill(0)
        if self.leaving:
            e.store_contacts(rest)
            needed = int(rest.news[FULL])
            if needed:
                raise BedFailure(f"there is room for {rest.who.shape[1]} contacts of sleepers and {needed} are needed")
        e.recount(e.awake_per_chunk, rest)
        self.leaving = False
        self.awake, self.mass = int(e.count[e.AWAKE]), float(rest.mass[None])

    def on_floor(self) -> np.ndarray:
        """What sleepers add to the impulse on the floor over the last advance, over the time step [N], shape [3]."""
        held = np.cumsum(self.bed.engine.rest.held.to_numpy().astype(float), axis=0)[-1]
        return held + self.slept * np.array(self.bed.gravity)

    def contact_counts(self) -> np.ndarray:
        """Contacts of each sleeper, by id, shape [grain_count]; 0 for those awake."""
        e, n = self.bed.engine, self.bed.grain_count
        ids = e.read("id")
        frozen = self.frozen()
        owner, who = frozen["owner"].astype(np.int64), frozen["who"].astype(np.int64)
        grains = who >= 0
        first, second = owner[grains], who[grains]
        pairs = np.unique(np.minimum(first, second) * n + np.maximum(first, second))  # kept by both, or by one
        counts = np.bincount(pairs // n, minlength=n) + np.bincount(pairs % n, minlength=n)
        touches = frozen["slide"][:, 3] != 0  # of a body's rows: what only is near it remembers nothing
        counts += np.bincount(owner[~grains & touches], minlength=n)
        start, end = e.read("pair_start")[: self.awake], e.read("pair_end")[: self.awake]
        pair = take_rows(e.pair, row_numbers(start, end - start))
        others = ~pair[pair < 0] & INDEX_MASK
        return np.asarray(counts + np.bincount(ids[others[others >= self.awake]], minlength=n), dtype=np.int32)

    def frozen(self) -> State:
        """Contacts of sleepers with one another and the floor: owner and who (ids; a body's number as -1 less it),
        slide, roll, in the order of owners."""
        rest, n = self.bed.engine.rest, self.bed.grain_count
        side = int(rest.side[None])
        start, end = (field.to_numpy()[side, :n] for field in (rest.start, rest.end))
        # The store is as of the last time that grains fell asleep: those that have woken since are passed over.
        asleep = rest.asleep.to_numpy()[:n] == 1
        counts = np.where(asleep, end - start, 0)
        owner = np.repeat(np.arange(n), counts)
        rows = row_numbers(start, counts)
        who = take_rows(rest.who, rows, part=side)
        stays = (who < 0) | asleep[np.maximum(who, 0)]
        rows = rows[stays]
        parts = {name: take_rows(getattr(rest, name), rows, part=side) for name in ("slide", "roll")}
        return {"owner": owner[stays].astype(np.int32), "who": who[stays], **parts}

    def _rows(self, pairs: np.ndarray) -> dict[str, Rows]:
        """Rows of the fields that the next steps depend on; ``pairs``: those of the pair lists in use."""
        grains = slice(self.bed.grain_count)
        return {"asleep": grains, "quiet": grains, "force": pairs, "held": slice(self.bed.engine.chunk_count)}

    def state(self, rows: np.ndarray) -> State:
        """All that the next steps depend on; ``rows``: of the pair lists, those in use."""
        e, rest = self.bed.engine, self.bed.engine.rest
        return {
            "sleep_rules": np.array(astuple(self.rules), dtype=float),
            **read_fields(rest, self._rows(rows), "sleep_"),
            "sleep_numbers": np.array([self.awake, int(e.count[e.CHUNKS]), self.bed.grain_steps]),
            "sleep_reals": np.array([self.mass, self.slept]),
            "sleep_order": np.array([int(rest.begins[None]), int(rest.block[None])]),
            **{f"sleep_store_{name}": values for name, values in self.frozen().items()},
        }

    def restore(self, state: State, rows: np.ndarray) -> None:
        """Go back to what ``state`` returned; the lists are already as they were."""
        e, rest, n = self.bed.engine, self.bed.engine.rest, self.bed.grain_count
        write_fields(rest, self._rows(rows), "sleep_", state)
        owner = state["sleep_store_owner"]
        counts = np.bincount(owner, minlength=n)
        end = np.cumsum(counts)
        put_rows(rest.start, end - counts, (0, slice(n)))
        put_rows(rest.end, end, (0, slice(n)))
        for name in ("who", "slide", "roll"):
            put_rows(getattr(rest, name), state[f"sleep_store_{name}"], (0, slice(len(owner))))
        for field in (rest.side, rest.news, rest.woken, rest.leaves):
            field.fill(0)
        self.mass, self.slept = (float(value) for value in state["sleep_reals"])
        self.awake, _, self.bed.grain_steps = (int(number) for number in state["sleep_numbers"])
        rest.begins[None], rest.block[None] = (int(number) for number in state.get("sleep_order", (0, 0)))
        e.find_cells(rest)
        rest.mass[None] = self.mass
        rest.whole[None] = 1
