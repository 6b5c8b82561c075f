"""The kernels of sleep: who is fast, slow or asleep (``dem.engine.sleep`` has the rules; how slow grains step is in
``dem.engine.steps``). They belong to ``dem.engine.engine.Engine``, whose fields they use.

Sums over the contacts of a grain are made by whoever has the row, in any order: in whole numbers, so that they have the
same bits.

A bed whose grains do not sleep has ``ABSENT`` for a table, and its kernels are compiled without all this.
"""

from hedgebed_taichi import ti

from .lists import BUILT, INDEX_MASK
from .rows import Zeroes
from .values import EnginePart

__all__ = ["FALL_ASLEEP", "FULL", "Rest", "SLEEPING", "SLOWING", "SLOW_DOWN", "Sleepers", "WOKEN"]

# Frozen contacts that there is room for, of a grain: both sides may keep a contact.
_STORE_ROOM = 8
# Places of what was found, in Rest.news, beside lists.BUILT; and what is to be done of it.
WOKEN, SLOWING, FULL, SLEEPING = 0, 1, 3, 4
SLOW_DOWN, FALL_ASLEEP = 1, 2


@ti.data_oriented
class Rest:
    """Who sleeps, and the contacts of sleepers with one another. Arrays of grains are by id."""

    on = True
    sets = 3  # of cells: of the fast, the slow, and the sleepers

    def __init__(self, *, grains: int, cells: int, chunks: int, rows: int, real):
        F = ti.Vector.field
        # ``was``: before the lists were last made. ``quiet``: looks in a row at which it was slow.
        self.asleep, self.was, self.woken, self.leaves, self.quiet, self.busy = (
            ti.field(ti.i32, grains) for _ in range(6)
        )
        self.cell = ti.field(ti.i32, grains)  # a sleeper's
        self.flagged = ti.field(ti.i32, cells)
        # Slow grains, now and before the lists were last made; whether anybody has changed since then.
        self.slow, self.was_slow = (ti.field(ti.i32, grains) for _ in range(2))
        self.changed, self.pace = (ti.field(ti.i32, ()) for _ in range(2))
        # How many times its mass, and its moment of inertia, a slow grain moves with.
        self.heavy, self.stout = (ti.field(ti.f64, ()) for _ in range(2))
        # Of a fast grain's row whose neighbour is slow: force and torque on that, summed over steps.
        self.push, self.turn = (F(3, real, rows) for _ in range(2))
        self.buffer_force, self.buffer_torque = (F(3, real, grains) for _ in range(2))
        # In whole numbers, ``per_unit`` of them a newton: the force on a sleeper by those awake, less what it was when
        # it fell asleep (this while lists are made and looked at; else less what it is). What a sleeper's contacts bear
        # on average; what those of a grain bear now, and how many they are.
        self.per_unit = ti.field(ti.f64, ())
        self.sum = F(3, ti.i64, grains)
        self.bears = ti.field(ti.f64, grains)
        self.load, self.contacts = ti.field(ti.i64, grains), ti.field(ti.i32, grains)
        # Frozen contacts, by the id of the grain that keeps them; the other's id, or -1 less a body's number. There
        # are two stores, and ``side`` says which one holds: the other is filled when grains fall asleep.
        self.side = ti.field(ti.i32, ())
        self.start, self.end = (ti.field(ti.i32, (2, grains)) for _ in range(2))
        self.who = ti.field(ti.i32, (2, _STORE_ROOM * grains))
        self.slide = F(4, real, (2, _STORE_ROOM * grains))
        self.roll = F(3, real, (2, _STORE_ROOM * grains))
        self.held = F(3, real, chunks)  # force of those awake on sleepers, summed over steps
        self.floor = F(6, real, chunks)  # in a chunk's last step, on the floor and on sleepers
        self.mass = ti.field(ti.f64, ())  # of the sleepers [kg]
        self.total = ti.field(ti.f64, ())  # of all grains [kg]
        # Which sleepers the next lists pass over: 1 in ``whole`` is none. Else those of the cells behind that of rank
        # ``last``, whose places stay; and of rows of those behind how many were awake then nothing is to be cleared.
        self.whole, self.last, self.kept, self.made = (ti.field(ti.i32, ()) for _ in range(4))
        self.news = ti.field(ti.i32, 5)
        self.begins = ti.field(ti.i32, ())  # rank of the cell whose sleepers come first in memory
        self.block = ti.field(ti.i32, ())  # its block along x
        self.near = ti.field(real, 3)
        self._zeroes = Zeroes(
            self.asleep, self.was, self.woken, self.leaves, self.quiet, self.start, self.end,
            self.side, self.mass, self.news, self.held, self.begins, self.block, self.push,
            self.turn, self.floor, self.slow, self.was_slow, self.changed, self.sum, self.bears,
        )  # fmt: skip

    def clear(self) -> None:
        """All are awake."""
        self._zeroes.put()
        self.whole[None] = 1
        self.last[None] = -1

    @ti.func
    def before(self, awake, grains):
        """Where sleepers begin that had no rows when as many as ``awake`` were awake."""
        return ti.select(self.whole[None] == 1, grains, awake[None])

    @ti.func
    def find(self, a, b):
        """Row of the store in which grain a keeps its contact with b (ids; of a body -1 less its number), or -1."""
        found = -1
        side = self.side[None]
        for k in range(self.start[side, a], self.end[side, a]):
            if self.who[side, k] == b:
                found = k
        return found


@ti.data_oriented
class Sleepers(EnginePart):
    """The part of the engine that lets grains sleep."""

    @ti.kernel
    def stir(
        self, dt: float, reach: float, leaving: int, all_of_them: int, rest: ti.template(), shapes: ti.template(),
        balance: ti.template(),
    ):  # fmt: skip
        """Wake those flagged, those around them and those near a body; let others change their pace, or fall asleep.

        Before ``sort``. Who wakes is slow, where there are slow grains.
        """
        for _ in range(1):
            if leaving & FALL_ASLEEP != 0:
                rest.whole[None] = 1
            rest.changed[None] = 1
            self.find_bodies(rest)
        for r in range(self.count[self.CELLS]):
            rest.flagged[r] = 0
        for k in range(self.count[self.GRAINS]):
            rest.was[k] = rest.asleep[k]
            rest.was_slow[k] = rest.slow[k]
        for i in range(self.count[self.AWAKE], self.count[self.GRAINS]):
            if rest.woken[self.id[i]] == 1:
                self.flag_around(rest.cell[self.id[i]], rest)
        for i in range(self.count[self.AWAKE], self.count[self.GRAINS]):
            k = self.id[i]
            flagged = rest.flagged[rest.cell[k]] == 1
            if not flagged and self.may_be_close(i, ti.cast(reach, self.real), rest):
                flagged = self.close_to_body(i, ti.cast(reach, self.real), shapes)
            if flagged:
                rest.asleep[k] = 0
                rest.slow[k] = ti.select(rest.pace[None] > 1 and all_of_them == 0, 1, 0)
                rest.quiet[k] = 0
                place = self.place_asleep(self.rank[rest.cell[k]], rest)
                ti.atomic_max(rest.last[None], place - 2 * self.count[self.CELLS])
        for c in range(self.count[self.CHUNKS]):
            start, end = self.chunk_range(c)
            for i in range(start, end):
                k = self.id[i]
                wakes = rest.slow[k] == 1 and rest.woken[k] == 1
                if wakes:
                    rest.leaves[k] = 0
                due = leaving & ti.select(self.next_sleep(i, rest), FALL_ASLEEP, SLOW_DOWN)
                if wakes or (due != 0 and rest.leaves[k] == 1):
                    self.change_pace(c, i, dt, rest, balance)
        for k in range(self.count[self.GRAINS]):
            rest.woken[k] = 0

    @ti.func
    def flag_around(self, cell, rest: ti.template()):
        """Flag a cell and those around it."""
        row = cell // self.count[self.NX]
        ci, cj, ck = cell - row * self.count[self.NX], row % self.count[self.NY], row // self.count[self.NY]
        for dk, dj, di in ti.ndrange((-1, 2), (-1, 2), (-1, 2)):
            k = ck + dk
            if k >= 0 and k < self.count[self.NZ]:
                i = (ci + di + self.count[self.NX]) % self.count[self.NX]
                j = (cj + dj + self.count[self.NY]) % self.count[self.NY]
                rest.flagged[self.cell_index(i, j, k)] = 1

    @ti.kernel
    def find_cells(self, rest: ti.template()):
        """The cells of the sleepers, of a state that was put back."""
        for i in range(self.count[self.AWAKE], self.count[self.GRAINS]):
            ci, cj, ck = self.cell_of(self.position[i])
            rest.cell[self.id[i]] = self.cell_index(ci, cj, ck)

    @ti.kernel
    def store_contacts(self, rest: ti.template()):
        """Fill the other store: contacts of sleepers with one another and with the floor, old and new."""
        for i in range(self.count[self.GRAINS]):
            k = self.id[i]
            rest.end[1 - rest.side[None], k] = self.freeze(i, 0, False, rest)
        for _ in range(1):
            side = 1 - rest.side[None]
            total = 0
            for k in range(self.count[self.GRAINS]):
                kept = rest.end[side, k]
                rest.start[side, k] = total
                total += kept
                rest.end[side, k] = total
            rest.news[BUILT] = 1
            if total > rest.who.shape[1]:
                rest.news[FULL] = total
        for i in range(self.count[self.GRAINS]):
            if rest.news[FULL] == 0:
                self.freeze(i, rest.start[1 - rest.side[None], self.id[i]], True, rest)

    @ti.func
    def freeze(self, i, first, write: ti.template(), rest: ti.template()):
        """Count the contacts that a grain keeps asleep, or write them into the rows from ``first`` on."""
        k = self.id[i]
        n = 0
        old = rest.side[None]
        new = 1 - old
        if rest.asleep[k] == 1:
            if rest.was[k] == 1:
                for s in range(rest.start[old, k], rest.end[old, k]):
                    who = rest.who[old, s]
                    stays = who < 0
                    if not stays:
                        stays = rest.asleep[who] == 1 and rest.was[who] == 1
                    if stays:
                        if ti.static(write):
                            rest.who[new, first + n] = who
                            rest.slide[new, first + n] = rest.slide[old, s]
                            rest.roll[new, first + n] = rest.roll[old, s]
                        n += 1
            else:
                for s in range(self.pair_start[i], self.pair_end[i]):
                    code = self.pair[s]
                    if code < 0:
                        who = self.id[(~code) & INDEX_MASK]
                        if rest.asleep[who] == 1:
                            if ti.static(write):
                                rest.who[new, first + n] = who
                                rest.slide[new, first + n] = self.slide[s]
                                if ti.static(self.rolling):
                                    rest.roll[new, first + n] = self.roll[s]
                            n += 1
                o = self.near_first[i]
                while o >= 0:
                    if ti.static(write):
                        rest.who[new, first + n] = -1 - self.old_near_body[o]
                        rest.slide[new, first + n] = self.old_near_slide[o]
                        rest.roll[new, first + n] = self.old_near_roll[o]
                    n += 1
                    o = self.next_near(o, i)
        return n

    @ti.func
    def list_sleeper(self, s, i, j, code, rest: ti.template()):
        """Springs out of the store for a row; and nothing for that of a slow grain with a fast one, who has them."""
        a, b = self.id[i], self.id[j]
        if rest.changed[None] == 1:
            if rest.was[a] == 1 and rest.was[b] == 1:
                sign = ti.cast(1.0, self.real)
                side = rest.side[None]
                kept = rest.find(a, b)
                if kept < 0:
                    kept = rest.find(b, a)
                    sign = -sign
                if kept >= 0:
                    self.pair[s] = ~code
                    slide = rest.slide[side, kept]
                    slide.xyz = sign * slide.xyz
                    self.slide[s] = slide
                    if ti.static(self.rolling):
                        self.roll[s] = sign * rest.roll[side, kept]
        if i >= self.count[self.FAST] and j < self.count[self.FAST]:
            self.pair[s] = code
            self.slide[s] = ti.Vector.zero(self.real, 4)
            if ti.static(self.rolling):
                self.roll[s] = ti.Vector.zero(self.real, 3)
        rest.push[s] = ti.Vector.zero(self.real, 3)
        rest.turn[s] = ti.Vector.zero(self.real, 3)

    @ti.func
    def place_asleep(self, r, rest: ti.template()):
        """Where the sleepers of the cell of rank r are listed: in the curve's order too, but begun elsewhere."""
        turned = r - rest.begins[None]
        return 2 * self.count[self.CELLS] + ti.select(turned < 0, turned + self.count[self.CELLS], turned)

    @ti.func
    def wake_near(self, s, i, b, rest: ti.template()):
        """The springs of a grain that slept on body b, for a row of the near list."""
        a = self.id[i]
        if rest.changed[None] == 1 and rest.was[a] == 1:
            kept = rest.find(a, -1 - b)
            if kept >= 0:
                self.near_slide[s] = rest.slide[rest.side[None], kept]
                self.near_roll[s] = rest.roll[rest.side[None], kept]

    @ti.kernel
    def recount(self, grains_per_chunk: int, rest: ti.template()):
        """How many are awake and fast, in how many chunks; the mass of the sleepers; how many are to be sorted."""
        for _ in range(1):
            sets = 3 * self.count[self.CELLS]
            cells = ti.select(rest.whole[None] == 1, sets, 2 * self.count[self.CELLS] + rest.last[None] + 1)
            until = self.count[self.GRAINS]
            if cells < sets:
                until = self.cell_start[cells]
            awake, slow = 0, 0
            mass = ti.cast(0.0, ti.f64)
            for i in range(until):
                if rest.asleep[self.id[i]] == 0:
                    mass += ti.cast(self.velocity[i].w, ti.f64)
                    awake += 1
                    slow += rest.slow[self.id[i]]
            rest.mass[None] = rest.total[None] - mass
            self.count[self.SORTED], self.count[self.SORTED_CELLS] = until, cells
            self.count[self.AWAKE], self.count[self.FAST] = awake, awake - slow
            room = self.count[self.ALL_CHUNKS] - ti.min(slow, 1)
            # An even number: so few chunks are shared out evenly between two threads.
            chunks = ti.max(1, (awake - slow + grains_per_chunk - 1) // grains_per_chunk)
            chunks = ti.min(room, chunks + chunks % 2)
            self.count[self.FAST_CHUNKS] = chunks
            room = self.count[self.ALL_CHUNKS] - chunks
            self.count[self.CHUNKS] = chunks + ti.min(room, (slow + grains_per_chunk - 1) // grains_per_chunk)

    @ti.func
    def whole_number(self, value, rest: ti.template()):
        """A force in units so small that no grain feels one."""
        return ti.cast(ti.round(ti.cast(value, ti.f64) * rest.per_unit[None]), ti.i64)

    @ti.func
    def sum_on_sleepers(self, sign: ti.template(), rest: ti.template()):
        """Add what those awake do to sleepers, ``sign`` times, to the sums that say how far these are from balance."""
        for i in range(self.count[self.AWAKE]):
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                if code < 0:
                    j = (~code) & INDEX_MASK
                    if j >= self.count[self.AWAKE]:
                        f = self.spring_force(self.position[i], self.position[j], ~code, self.slide[s])
                        for d in ti.static(range(3)):
                            ti.atomic_add(rest.sum[self.id[j]][d], self.whole_number(-sign * f[d], rest))

    @ti.kernel
    def change_balance(self, sign: ti.template(), rest: ti.template()):
        """``sum_on_sleepers``: added before who sleeps changes and taken off after it, so that the sums go on."""
        self.sum_on_sleepers(sign, rest)

    @ti.kernel
    def forget_dashpots(self, rest: ti.template()):
        """Of pairs with a grain whose pace has changed: what their dashpots remember is of other masses and steps."""
        for i in range(self.count[self.AWAKE]):
            a = self.id[i]
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                b = self.id[ti.select(code < 0, ~code, code) & INDEX_MASK]
                if rest.was_slow[a] != rest.slow[a] or rest.was_slow[b] != rest.slow[b]:
                    self.slide[s].w = 0.0

    @ti.func
    def sum_loads(self, rest: ti.template()):
        """Of those that are marked in ``rest.busy``: sum and number of their contacts' forces."""
        for i in range(self.count[self.AWAKE]):
            a = self.id[i]
            start, end = self.chunk_range(self.chunk_of(i))
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                if code < 0:
                    j = (~code) & INDEX_MASK
                    b = self.id[j]
                    both = (j >= start and j < end) or j >= self.alone_from(self.chunk_of(i))
                    if rest.busy[a] == 1 or (both and rest.busy[b] == 1):
                        f = self.spring_force(self.position[i], self.position[j], ~code, self.slide[s]).norm()
                        ti.atomic_add(rest.load[a], self.whole_number(f, rest))
                        ti.atomic_add(rest.contacts[a], 1)
                        if both:
                            ti.atomic_add(rest.load[b], self.whole_number(f, rest))
                            ti.atomic_add(rest.contacts[b], 1)

    @ti.func
    def mean_load(self, k, rest: ti.template()):
        """Mean force of a grain's contacts, as whole numbers are."""
        return ti.cast(rest.load[k], ti.f64) / ti.max(1, rest.contacts[k])

    @ti.kernel
    def check_balance(
        self, unbalanced: float, change: float, own: float, quick: float, reach: float, firm: float, gravity: float,
        rest: ti.template(), shapes: ti.template(),
    ):  # fmt: skip
        """Raise the flags of slow grains that are to be fast, and of sleepers that are to wake.

        ``unbalanced``, ``change``: of the force on a slow grain, and of its change on a sleeper, over the mean force of
        its contacts. ``own``: speed of a slow grain, ``quick``: of a sleeper's neighbour [m/s]. ``reach``: distance of
        a body from a slow grain [m]. ``firm``: the most that a slow grain may overlap another, over their diameter [1].
        """
        for _ in range(1):
            self.find_bodies(rest)
        for c in range(self.count[self.FAST_CHUNKS], self.count[self.CHUNKS]):
            self.gather_pushes(c, rest)
        for i in range(self.count[self.AWAKE]):
            k, v = self.id[i], self.velocity[i]
            rest.load[k] = 0
            rest.contacts[k] = 0
            rest.busy[k] = 0
            if i >= self.count[self.FAST]:
                if self.force[i].norm() > unbalanced * v.w * gravity:
                    rest.busy[k] = 1
                if self.surface_speed(i) > own or self.may_be_close(i, ti.cast(reach, self.real), rest):
                    near = self.surface_speed(i) > own
                    if not near:
                        near = self.close_to_body(i, ti.cast(reach, self.real), shapes)
                    if near:
                        rest.woken[k] = 1
        self.sum_loads(rest)
        self.sum_on_sleepers(1.0, rest)
        for i in range(self.count[self.FAST], self.count[self.AWAKE]):
            k = self.id[i]
            if rest.busy[k] == 1:
                if rest.per_unit[None] * self.force[i].norm() > unbalanced * self.mean_load(k, rest):
                    rest.woken[k] = 1
            for s in range(self.pair_start[i], self.pair_end[i]):
                bits = ti.select(self.pair[s] < 0, ~self.pair[s], self.pair[s])
                if self.overlap_of(i, bits) > firm:
                    j = bits & INDEX_MASK
                    rest.woken[k] = 1
                    if j >= self.count[self.FAST] and j < self.count[self.AWAKE]:
                        rest.woken[self.id[j]] = 1
        for i in range(self.count[self.AWAKE]):
            rest.busy[self.id[i]] = 0
        for i in range(self.count[self.AWAKE]):
            goes = self.surface_speed(i) > quick
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                j = ti.select(code < 0, ~code, code) & INDEX_MASK
                b = self.id[j]
                if j >= self.count[self.AWAKE]:
                    u = ti.Vector([ti.cast(rest.sum[b][d], ti.f64) for d in range(3)])
                    least = ti.max(rest.bears[b], rest.per_unit[None] * self.velocity[j].w * gravity)
                    if goes or u.norm() > change * least:
                        rest.woken[b] = 1
                        rest.news[WOKEN] = 1
                elif code < 0 and i >= self.count[self.FAST]:
                    # Those that one touches come with it.
                    if rest.woken[self.id[i]] == 1:
                        rest.busy[b] = 1
                    if rest.woken[b] == 1 and j >= self.count[self.FAST]:
                        rest.busy[self.id[i]] = 1
        self.sum_on_sleepers(-1.0, rest)
        for i in range(self.count[self.FAST], self.count[self.AWAKE]):
            k = self.id[i]
            if rest.busy[k] == 1:
                rest.woken[k] = 1
            if rest.woken[k] == 1:
                rest.news[WOKEN] = 1

    @ti.kernel
    def find_calm(
        self, slow: float, still: float, patience: int, reach: float, firm: float, rest: ti.template(),
        shapes: ti.template(),
    ):  # fmt: skip
        """Mark who may become slow, or fall asleep, and count them.

        ``slow``, ``still``: speeds [m/s] below which a fast grain, and a slow one, must have been ``patience`` times.
        ``firm``: as in ``check_balance``.
        """
        for _ in range(1):
            rest.news[SLOWING] = 0
            rest.news[SLEEPING] = 0
        for i in range(self.count[self.AWAKE]):
            k = self.id[i]
            limit = ti.cast(ti.select(i < self.count[self.FAST], slow, still), self.real)
            counts = rest.quiet[k] < 0 or self.surface_speed(i) < limit
            rest.quiet[k] = ti.select(counts, rest.quiet[k] + 1, 0)
            rest.busy[k] = 0
            rest.leaves[k] = 0
        for i in range(self.count[self.AWAKE]):
            a = self.id[i]
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                if code < 0:
                    j = (~code) & INDEX_MASK
                    if j < self.count[self.AWAKE]:
                        b = self.id[j]
                        pressed = self.overlap_of(i, ~code) > firm
                        if pressed or self.keeps_up(j, i, rest):
                            rest.busy[a] = 1
                        if pressed or self.keeps_up(i, j, rest):
                            rest.busy[b] = 1
        for i in range(self.count[self.AWAKE]):
            k = self.id[i]
            if rest.quiet[k] >= patience and rest.busy[k] == 0:
                if i >= self.count[self.FAST] or not self.close_to_body(i, ti.cast(reach, self.real), shapes):
                    rest.leaves[k] = 1
                    ti.atomic_add(rest.news[ti.select(self.next_sleep(i, rest), SLEEPING, SLOWING)], 1)

    @ti.func
    def next_sleep(self, i, rest: ti.template()):
        """Whether what is next for a grain that is quiet is to sleep."""
        return i >= self.count[self.FAST] or rest.pace[None] == 1

    @ti.func
    def keeps_up(self, i, j, rest: ti.template()):
        """Whether grain i keeps its neighbour j from what is next: it is not quiet; it is fast, and j slow."""
        fast = i < self.count[self.FAST]
        result = fast and rest.quiet[self.id[i]] <= 0
        if j >= self.count[self.FAST]:
            result = fast or rest.quiet[self.id[i]] <= 0
        return result

    @ti.kernel
    def sum_bearing(self, rest: ti.template()):
        """What sleepers-to-be bear: the mean force of their contacts."""
        for i in range(self.count[self.AWAKE]):
            k = self.id[i]
            rest.load[k] = 0
            rest.contacts[k] = 0
            rest.busy[k] = rest.leaves[k]
        self.sum_loads(rest)
        for i in range(self.count[self.AWAKE]):
            k = self.id[i]
            if rest.leaves[k] == 1:
                rest.bears[k] = self.mean_load(k, rest)
                rest.sum[k] = ti.Vector.zero(ti.i64, 3)
