"""The kernels of sleep (``dem.engine.sleep`` has the rules): they belong to ``dem.engine.engine.Engine``, whose
fields they use.

A bed whose grains do not sleep has ``ABSENT`` for a table, and its kernels are compiled without all this.
"""

from hedgebed_taichi import ti

from .lists import BUILT, INDEX_MASK
from .rows import Zeroes
from .values import EnginePart

__all__ = ["FULL", "LEAVING", "Rest", "Sleepers", "WOKEN"]

# Frozen contacts that there is room for, of a grain: both sides may keep a contact.
_STORE_ROOM = 8
# Sleepers lie in the order of the curve from so many blocks of cells behind the bodies on: what wakes and falls asleep
# there leaves those that come after it in memory where they are. A block is as much of x as the curve does at a time.
_BEHIND = 2
_BLOCK = 32
# Places of the numbers in Rest.near: where bodies are along x, and how far to both sides; below them.
_MIDDLE, _HALF, _BELOW = range(3)
# Places of what a check found, in Rest.news.
WOKEN, LEAVING, FULL = 0, 1, 3  # and lists.BUILT


@ti.data_oriented
class Rest:
    """Who sleeps, and the contacts of sleepers with one another. Arrays of grains are by id."""

    on = True
    sets = 2

    def __init__(self, *, grains: int, cells: int, chunks: int, rows: int, real):
        F = ti.Vector.field
        # ``was``: before the lists were last made. ``quiet``: checks in a row at which it was slow.
        self.asleep, self.was, self.woken, self.leaves, self.quiet, self.busy = (
            ti.field(ti.i32, grains) for _ in range(6)
        )
        self.cell = ti.field(ti.i32, grains)  # a sleeper's
        self.flagged = ti.field(ti.i32, cells)
        # Of a row of the pair lists whose neighbour sleeps: the spring force that it had when the two were last alike.
        self.force, self.old_force = (F(3, real, rows) for _ in range(2))
        # Frozen contacts, by the id of the grain that keeps them; the other's id, or -1 less a body's number. There
        # are two stores, and ``side`` says which one holds: the other is filled when grains fall asleep.
        self.side = ti.field(ti.i32, ())
        self.start, self.end = (ti.field(ti.i32, (2, grains)) for _ in range(2))
        self.who = ti.field(ti.i32, (2, _STORE_ROOM * grains))
        self.slide = F(4, real, (2, _STORE_ROOM * grains))
        self.roll = F(3, real, (2, _STORE_ROOM * grains))
        self.held = F(3, real, chunks)  # force of those awake on sleepers, summed over steps
        self.mass = ti.field(ti.f64, ())  # of the sleepers [kg]
        self.total = ti.field(ti.f64, ())  # of all grains [kg]
        # Which sleepers the next lists pass over: 1 in ``whole`` is none. Else those of the cells behind that of rank
        # ``last``, whose places stay; and of rows of those behind how many were awake then nothing is to be cleared.
        self.whole, self.last, self.kept, self.made = (ti.field(ti.i32, ()) for _ in range(4))
        self.news = ti.field(ti.i32, 4)
        self.begins = ti.field(ti.i32, ())  # rank of the cell whose sleepers come first in memory
        self.block = ti.field(ti.i32, ())  # its block along x
        self.near = ti.field(real, 3)
        self._zeroes = Zeroes(
            self.asleep, self.was, self.woken, self.leaves, self.quiet, self.start, self.end,
            self.side, self.mass, self.news, self.held, self.begins, self.block, self.force,
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

    @ti.func
    def spring_force(self, x_i, x_j, bits, u):
        """What the springs of a pair do to the first [N], by ``dem.contact.law`` without dashpots; 0 apart."""
        d = self.apart(x_i, x_j, bits)
        length = d.norm()
        overlap = x_i.w + x_j.w - length
        f = d * 0.0
        if overlap > 0.0:
            p = self.grain_pair[None]
            a = ti.sqrt(x_i.w * x_j.w / (x_i.w + x_j.w) * overlap)
            f = (2.0 / 3.0) * p[0] * a * overlap / length * d - p[1] * a * u.xyz
        return f

    @ti.func
    def close_to_body(self, i, reach, shapes: ti.template()):
        """Whether a body other than the floor is within ``reach`` [m] of a grain's surface."""
        x = self.position[i]
        within = x.w + reach
        found = False
        for b in range(1, self.body_count[None]):
            beyond = self.body_extent[b] + within
            if not found and ti.abs(x.z - self.body_position[b].z) < beyond:  # most bodies are far above
                if self.from_body(b, x.xyz).norm_sqr() < beyond**2:
                    distance, n, curvature, arm = self.nearest(b, x.xyz, within, shapes, True)
                    if distance < within:
                        found = True
        return found

    @ti.kernel
    def check_contacts(self, limit: float, share: float, fast: float, rest: ti.template()):
        """Raise the flags of sleepers that are to wake: a contact's force changed by ``limit`` [N] and this share of
        it, a ``fast`` [m/s] neighbour."""
        for i in range(self.count[self.AWAKE]):
            force, part, speed = ti.cast(limit, self.real), ti.cast(share, self.real), ti.cast(fast, self.real)
            quick = self.velocity[i].xyz.norm_sqr() > speed * speed
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                bits = ti.select(code < 0, ~code, code)
                j = bits & INDEX_MASK
                if j >= self.count[self.AWAKE]:
                    f = self.spring_force(self.position[i], self.position[j], bits, self.slide[s])
                    before = rest.force[s]
                    least = ti.max(force * force, part * part * before.norm_sqr())
                    if quick or (f - before).norm_sqr() > least:
                        rest.woken[self.id[j]] = 1
                        rest.news[WOKEN] = 1

    @ti.kernel
    def find_calm(self, slow: float, patience: int, reach: float, rest: ti.template(), shapes: ti.template()):
        """Mark who may fall asleep, and count them."""
        for _ in range(1):
            rest.news[LEAVING] = 0
        for i in range(self.count[self.AWAKE]):
            k = self.id[i]
            r = self.position[i].w
            square = ti.cast(slow * slow, self.real)
            still = self.velocity[i].xyz.norm_sqr() < square and r * r * self.spin[i].xyz.norm_sqr() < square
            rest.quiet[k] = ti.select(still, rest.quiet[k] + 1, 0)
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
                        if rest.quiet[a] == 0:
                            rest.busy[b] = 1
                        if rest.quiet[b] == 0:
                            rest.busy[a] = 1
        for i in range(self.count[self.AWAKE]):
            k = self.id[i]
            if rest.quiet[k] >= patience and rest.busy[k] == 0:
                if not self.close_to_body(i, ti.cast(reach, self.real), shapes):
                    rest.leaves[k] = 1
                    ti.atomic_add(rest.news[LEAVING], 1)

    @ti.kernel
    def stir(
        self, dt: float, reach: float, leaving: int, rest: ti.template(), shapes: ti.template(), balance: ti.template()
    ):
        """Wake those flagged, those around them and those near a body; let fall asleep who may. Before ``sort``."""
        for _ in range(1):
            if leaving == 1:
                rest.whole[None] = 1
            self.find_bodies(rest)
        for r in range(self.count[self.CELLS]):
            rest.flagged[r] = 0
        for k in range(self.count[self.GRAINS]):
            rest.was[k] = rest.asleep[k]
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
                rest.quiet[k] = 0
                place = self.place_asleep(self.rank[rest.cell[k]], rest)
                ti.atomic_max(rest.last[None], place - self.count[self.CELLS])
        for c in range(self.count[self.CHUNKS]):
            if leaving == 1:
                start, end = self.chunk_range(c)
                for i in range(start, end):
                    k = self.id[i]
                    if rest.leaves[k] == 1:
                        v = self.velocity[i]
                        if ti.static(balance.on):
                            self.balance_leaving(c, i, balance)
                        rest.asleep[k] = 1
                        rest.held[c] = rest.held[c] + v.xyz * (v.w / ti.cast(dt, self.real))
                        v.xyz = ti.Vector.zero(self.real, 3)
                        self.velocity[i] = v
                        self.spin[i] = ti.Vector.zero(self.real, 4)
        for k in range(self.count[self.GRAINS]):
            rest.woken[k] = 0

    @ti.func
    def find_bodies(self, rest: ti.template()):
        """Where the bodies but the floor are along x, and below which height none is: for ``may_be_close``.

        And where sleepers begin in memory: that changes when the bodies have gone two blocks on.
        """
        first, last, below = ti.cast(0.0, self.real), ti.cast(0.0, self.real), ti.cast(1e30, self.real)
        at, period = self.body_position[1].x, self.box[self.PERIOD_X]
        for b in range(1, self.body_count[None]):
            x, extent = self.body_position[b], self.body_extent[b]
            ahead = x.x - at
            ahead -= period * ti.round(ahead / period)
            first = ti.min(first, ahead - extent)
            last = ti.max(last, ahead + extent)
            below = ti.min(below, x.z - extent)
        middle = at + 0.5 * (first + last)
        middle -= period * ti.floor(middle / period)
        rest.near[_MIDDLE] = middle
        rest.near[_HALF] = 0.5 * (last - first)
        rest.near[_BELOW] = below
        blocks = self.count[self.NX] // _BLOCK
        if self.body_count[None] > 1 and last - first < period and blocks > 2 * _BEHIND:
            block = ti.floor(middle / self.box[self.CELL_X], ti.i32) // _BLOCK - _BEHIND
            block += ti.select(block < 0, blocks, 0)
            if ti.abs(block - rest.block[None]) > 1:
                rest.block[None] = block
                rest.whole[None] = 1
                rest.begins[None] = self.rank[self.cell_index(block * _BLOCK, 0, 0)]

    @ti.func
    def may_be_close(self, i, reach, rest: ti.template()):
        """False where no body can be within ``reach`` [m] of a grain's surface: most lie beside or below them all."""
        x = self.position[i]
        within = 1.01 * (x.w + reach)  # round-off decides nothing
        ahead = ti.abs(x.x - rest.near[_MIDDLE])
        ahead = ti.min(ahead, self.box[self.PERIOD_X] - ahead)
        return x.z > rest.near[_BELOW] - within and ahead < rest.near[_HALF] + within

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
    def list_sleeper(self, s, i, j, code, old, rest: ti.template()):
        """Springs out of the store and the force to compare with, of a row that was ``old`` (-1: none) before."""
        a, b = self.id[i], self.id[j]
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
        f = self.position[i].xyz * 0.0
        if j >= self.count[self.AWAKE] and self.pair[s] < 0:
            if rest.was[a] == 0 and rest.was[b] == 1:
                f = rest.old_force[old]
            else:
                f = self.spring_force(self.position[i], self.position[j], code, self.slide[s])
        rest.force[s] = f

    @ti.func
    def wake_near(self, s, i, b, rest: ti.template()):
        """The springs of a grain that slept on body b, for a row of the near list."""
        a = self.id[i]
        if rest.was[a] == 1:
            kept = rest.find(a, -1 - b)
            if kept >= 0:
                self.near_slide[s] = rest.slide[rest.side[None], kept]
                self.near_roll[s] = rest.roll[rest.side[None], kept]

    @ti.kernel
    def recount(self, grains_per_chunk: int, rest: ti.template()):
        """How many are awake, in how many chunks; the mass of the others; how many are to be sorted."""
        for _ in range(1):
            sets = 2 * self.count[self.CELLS]
            cells = ti.select(rest.whole[None] == 1, sets, self.count[self.CELLS] + rest.last[None] + 1)
            until = self.count[self.GRAINS]
            if cells < sets:
                until = self.cell_start[cells]
            awake = 0
            mass = ti.cast(0.0, ti.f64)
            for i in range(until):
                if rest.asleep[self.id[i]] == 0:
                    mass += ti.cast(self.velocity[i].w, ti.f64)
                    awake += 1
            rest.mass[None] = rest.total[None] - mass
            self.count[self.SORTED], self.count[self.SORTED_CELLS] = until, cells
            self.count[self.AWAKE] = awake
            chunks = (awake + grains_per_chunk - 1) // grains_per_chunk
            self.count[self.CHUNKS] = ti.max(1, ti.min(self.count[self.ALL_CHUNKS], chunks))
