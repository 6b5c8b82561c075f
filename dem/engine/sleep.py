"""Slow grains and sleeping grains: quiet grains are computed less often, resting grains not at all.

A **slow** grain takes one long step every ``pace`` steps of the bed. Its weight, its contacts and, with the defaults,
its mass stay unchanged: quiet contacts are soft enough for so long a step. Rotation is nearer to the limit of
stability, so the moment of inertia is multiplied by (pace / spin_stretch)^2. The mass is multiplied by
(pace / stretch)^2 where that is more than 1. A **sleeper** stands still: to the others it is a fixed grain. Its
contacts with other sleepers keep their springs. All other grains are **fast**.

The rules, in numbers of ``Sleep``; d is the mean diameter, m the mean mass, g gravity, all of the bed:

* A fast grain becomes slow when four conditions hold. Its speed and its surface's turning have been below ``speed``
  sqrt(g d) at every check for ``calm`` sqrt(d / g). At the start of a bed this time is ``settling`` times as long. No
  fast grain that it touches moves faster. No body but the floor is within ``reach`` d. No other grain overlaps it by
  more than a long step allows (``Sleeper.firm``).
* A slow grain becomes fast again when a body comes within ``reach`` d, or when another grain overlaps it by more than
  that. It also becomes fast when it moves faster than ``own`` sqrt(g d), or when the force on it is out of balance. The
  last means: more than ``unbalanced`` of the mean force of its contacts, or of m g where that is more. The slow grains
  that it touches become fast with it.
* A slow grain falls asleep when it has moved below ``still`` sqrt(g d) for as long. The grains that it touches must
  have done so too, and none of them may be fast. Only every fourth check applies this rule.
* A sleeper wakes, and is slow, when the sum of the forces on it has changed since it fell asleep: by ``change`` of its
  contacts' mean force (or of m g). It also wakes when a grain awake that is listed with it moves faster than
  ``waking_speed`` sqrt(g d). All sleepers in its cell of the grid and the 26 around it wake with it. So do the sleepers
  near a body.

The rules are checked every ``every`` steps, a multiple of ``pace``: then slow and fast grains are at the same time. A
bed of one chunk has no slow grains, and its fast ones fall asleep by the first rule with the speed of the third.

The forces of fast grains on a slow one are summed over its step and applied as a whole, so action equals reaction. The
remainder acts on the floor. ``Bed.reaction`` of the floor contains the sleepers' weight, the force of the others on
them, and the momentum of changes of pace. ``Bed.momentum`` counts slow grains with the mass that they move with. A
grain that changes its pace keeps its speed. The energy of this change, and of falling asleep, is counted with the
dashpots' (``Bed.contact_work``).

In memory the fast grains come first, then the slow, then the sleepers, the first two in chunks of their own. The step
knows nothing else of them. A grain changes its class when lists are made, on steps that do not depend on how a run is
cut. Flags are raised and never lowered within a check, and sums are of whole numbers, so results are bitwise equal on
any number of threads.
"""

import math
from dataclasses import astuple
from typing import Protocol

import numpy as np

from dem.contact.timestep import contact_time, stable_step
from dem.grains.materials import Material

from .engine import Engine
from .lists import INDEX_MASK
from .rows import Rows, put_rows, read_fields, row_numbers, take_rows, write_fields
from .sleep_kernels import FALL_ASLEEP, FULL, SLEEPING, SLOW_DOWN, SLOWING, WOKEN
from .values import BedFailure, Sleep, State

__all__ = ["Sleeper"]

# A check for grains at rest is worth new lists when this share of those awake can fall asleep.
_WORTH = 0.02
_CALM_CHECKS = 4
_UNITS = 2.0**24  # Whole numbers in which forces are summed, for a grain's weight


class SleepyBed(Protocol):
    """What the sleep of grains needs of a bed (``dem.engine.base.BedBase``)."""

    engine: Engine
    material: Material
    gravity: tuple[float, float, float]
    time_step: float
    grain_count: int
    mean_diameter: float
    steps: int
    grain_steps: int


class Sleeper:
    """What a bed needs to let its grains sleep: the rules in its own units, the checks, and its part of the state."""

    def __init__(self, bed: SleepyBed, rules: Sleep):
        self.bed, self.rules = bed, rules
        e = bed.engine
        self.gravity = g = math.hypot(*bed.gravity)
        d = bed.mean_diameter
        # The same to the bit in whatever order the grains lie.
        total = math.fsum(e.read("velocity")[:, 3])
        e.rest.total[None] = total
        e.rest.per_unit[None] = _UNITS / (g * total / bed.grain_count)
        # Slow grains take chunks of their own.
        self.pace = int(rules.pace) if e.chunk_count > 1 else 1
        e.rest.pace[None] = self.pace
        self.heavy, self.stout = rules.heaviness(self.pace)
        e.rest.heavy[None], e.rest.stout[None] = self.heavy, self.stout
        self.reach = rules.reach * d
        speeds = (rules.waking_speed, rules.speed if self.pace > 1 else rules.still, rules.own, rules.still)
        self.quick, self.slow, self.own, self.still = (share * math.sqrt(g * d) for share in speeds)
        self.firm = self._firm()
        checks = rules.calm * math.sqrt(d / g) / bed.time_step / rules.every / _CALM_CHECKS
        self.rest_every = max(1, round(checks)) * rules.every
        # Below 0: looks at which all counts as quiet.
        more = (rules.settling - 1) * _CALM_CHECKS * checks * rules.every / self.rest_every
        e.rest.quiet.fill(-max(0, round(more)))
        self.awake = self.fast = bed.grain_count
        self.mass = 0.0
        self.slept = 0.0  # Mass asleep, summed over the steps of the last advance [kg]
        self.leaving = 0
        self.begun_ahead = np.zeros(6)  # ``floor_ahead`` when the last advance began

    def _firm(self) -> float:
        """The largest overlap over diameter at which a slow grain's step is stable with six neighbours [1]."""
        bed = self.bed
        if self.pace == 1:
            return math.inf
        radius = float(bed.engine.read("position")[:, 3].min())
        some = 0.01
        time = contact_time(bed.material, diameter=2 * radius, max_overlap=some)
        normal, spin = (stable_step(bed.material.restitution, neighbours=6, sticking=s) for s in (False, True))
        steps = min(math.sqrt(self.heavy) * normal, math.sqrt(self.stout) * spin)
        return some * (steps * time / (self.pace * bed.time_step)) ** 4  # a contact's time goes with its root's root

    def check(self) -> bool:
        """The check of this step, if one is due: whether lists are to be made for it."""
        e, rest, rules, steps = self.bed.engine, self.bed.engine.rest, self.rules, self.bed.steps
        if steps % rules.every:
            return False
        if self.fast < self.bed.grain_count:
            e.check_balance(
                rules.unbalanced,
                rules.change,
                self.own,
                self.quick,
                self.reach,
                self.firm,
                self.gravity,
                rest,
                e.shapes,
            )
        self.leaving = 0
        if steps % self.rest_every == 0:
            e.find_calm(self.slow, self.still, _CALM_CHECKS, self.reach, self.firm, rest, e.shapes)
        news = rest.news.to_numpy()
        due = bool(news[WOKEN])
        if steps % self.rest_every == 0:
            # Falling asleep stores the contacts of all sleepers, so that it is not for every look.
            dozing = steps % (_CALM_CHECKS * self.rest_every) == 0 and int(news[SLEEPING]) > _WORTH * self.awake
            slowing = int(news[SLOWING]) > (0 if due or dozing else _WORTH * self.fast)
            self.leaving = SLOW_DOWN * slowing + FALL_ASLEEP * dozing
        return due or self.leaving > 0

    def rearrange(self, *, all_awake: bool) -> None:
        """Who is fast, slow and asleep from here on; between ``keep_lists`` and ``sort``, and ``settle`` after it."""
        e, rest = self.bed.engine, self.bed.engine.rest
        if all_awake:
            rest.woken.fill(1)
        else:
            e.change_balance(1.0, rest)
            if self.leaving & FALL_ASLEEP:
                e.sum_bearing(rest)
        e.stir(self.bed.time_step, self.reach, self.leaving, int(all_awake), rest, e.shapes, e.balance)
        rest.news.fill(0)
        if self.leaving & FALL_ASLEEP:
            e.store_contacts(rest)
            needed = int(rest.news[FULL])
            if needed:
                raise BedFailure(f"{rest.who.shape[1]} contacts of sleepers fit and {needed} are needed")
        self.leaving = 0

    def recount(self) -> None:
        """Count those awake, who are to be sorted."""
        e, rest = self.bed.engine, self.bed.engine.rest
        e.recount(e.awake_per_chunk, rest)
        self.awake, self.fast, self.mass = int(e.count[e.AWAKE]), int(e.count[e.FAST]), float(rest.mass[None])

    def settle(self) -> None:
        """After lists for which ``rearrange`` was called."""
        self.bed.engine.change_balance(-1.0, self.bed.engine.rest)
        self.bed.engine.forget_dashpots(self.bed.engine.rest)

    def computed(self, steps: int) -> int:
        """Grains computed over so many steps from now on, summed over the steps."""
        now = self.bed.steps
        turns = -(-(now + steps) // self.pace) + (-now // self.pace)  # multiples of the pace among these steps
        return steps * self.fast + turns * (self.awake - self.fast)

    def of_slow(self, number: float) -> np.ndarray:
        """1 of each fast grain, ``number`` of each slow one, in the order of memory, shape [awake]."""
        return np.where(np.arange(self.awake) < self.fast, 1.0, number)

    def pushes(self) -> tuple[np.ndarray, np.ndarray]:
        """What fast grains' steps did that has still to reach slow ones: sums over steps of force [N] and of moment
        about the bed's origin [N m], shape [3] each."""
        found = np.zeros(6)
        self.bed.engine.pushes_kept(self.bed.engine.rest, found)
        return found[:3], found[3:]

    def times_ahead(self, *, between: bool) -> tuple[float, float]:
        """For which the forces that a fast grain and a slow one have now will act [s]: ``between`` two steps, or when
        the next one has moved who takes part in it, for which forces are still to come."""
        step, due = self.bed.time_step, self.bed.steps % self.pace == 0
        return step if between else 0.0, step * self.pace if between or not due else 0.0

    def _steps_ahead(self) -> int:
        """Steps of the bed that slow grains have gone already and the fast have not."""
        return -self.bed.steps % self.pace

    def impulse_ahead(self) -> np.ndarray:
        """Of gravity, floor and sleepers on slow grains: what these have had already, over the time step [N], [3]."""
        mass = float(self.bed.engine.read("velocity")[self.fast : self.awake, 3].sum())
        return self._steps_ahead() * mass * np.array(self.bed.gravity) - self.floor_ahead()[:3]

    def floor_ahead(self) -> np.ndarray:
        """What slow grains have done already to the floor and to sleepers: force and torque, times steps, shape [6]."""
        e = self.bed.engine
        chunks = slice(int(e.count[e.FAST_CHUNKS]), int(e.count[e.CHUNKS]))
        return self._steps_ahead() * e.rest.floor.to_numpy()[chunks].astype(float).sum(axis=0)

    def on_floor(self) -> np.ndarray:
        """What sleepers, and steps of slow grains, add to force and torque on the floor over the last advance, times
        steps, shape [6]."""
        found = self.begun_ahead - self.floor_ahead()
        found[:3] += np.cumsum(self.bed.engine.rest.held.to_numpy().astype(float), axis=0)[-1]
        found[:3] += self.slept * np.array(self.bed.gravity)
        return found

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
        owner = np.repeat(np.arange(self.awake), end - start)
        others = ~pair & INDEX_MASK
        # Those of which the other side has no row.
        alone = (pair < 0) & (others >= np.where(owner < self.fast, self.fast, self.awake))
        return np.asarray(counts + np.bincount(ids[others[alone]], minlength=n), dtype=np.int32)

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
        of_grains: dict[str, Rows] = dict.fromkeys(("asleep", "slow", "quiet", "sum", "bears"), grains)
        chunks = slice(self.bed.engine.chunk_count)
        return of_grains | {"push": pairs, "turn": pairs, "held": chunks, "floor": chunks}

    def state(self, rows: np.ndarray) -> State:
        """All that the next steps depend on; ``rows``: of the pair lists, those in use."""
        e, rest = self.bed.engine, self.bed.engine.rest
        return {
            "sleep_rules": np.array(astuple(self.rules), dtype=float),
            **read_fields(rest, self._rows(rows), "sleep_"),
            "sleep_numbers": np.array(
                [self.awake, int(e.count[e.CHUNKS]), self.bed.grain_steps, self.fast, int(e.count[e.FAST_CHUNKS])]
            ),
            "sleep_reals": np.array([self.mass, self.slept, *self.begun_ahead]),
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
        for field in (rest.side, rest.news, rest.woken, rest.leaves, rest.changed):
            field.fill(0)
        self.mass, self.slept, *ahead = (float(value) for value in state["sleep_reals"])
        self.begun_ahead = np.array(ahead)
        self.awake, _, self.bed.grain_steps, self.fast, _ = (int(number) for number in state["sleep_numbers"])
        rest.begins[None], rest.block[None] = (int(number) for number in state.get("sleep_order", (0, 0)))
        e.find_cells(rest)
        rest.mass[None] = self.mass
        rest.whole[None] = 1
