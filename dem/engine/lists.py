"""Who is near whom: sorting the grains by cell, pair lists, the grains near bodies, and the history carried over.

Runs every hundred steps or so. The kernels belong to ``dem.engine.engine.Engine``, whose fields they use.
"""

from dem.contact.cohesion import JKR
from dem.contact.law import adhesive_range
from hedgebed_taichi import ti

from .values import EnginePart

__all__ = ["ABSENT", "FLOOR", "INDEX_BITS", "INDEX_MASK", "ITEMS_PER_THREAD", "Lists", "MOST_BODIES", "SAME_IMAGE"]

ITEMS_PER_THREAD = 512
# Places of the counters in Engine.ticket: of a plain loop over chunks; of ``Engine.run``.
CACHE_LINE = 16
QUEUE, FINISHED = 0, CACHE_LINE
BUILT = 2  # place of a number of ``dem.engine.sleep.Rest.news``: the other store of frozen contacts is filled
# Places in Engine.problem: 1 + the id of a grain that has left the box; rows that a chunk's lists need, where they have
# fewer.
LOST, PAIRS_NEEDED, NEAR_NEEDED = range(3)
SCAN_BLOCKS = 64  # in which cells are added up
FLOOR = 0  # The body that is the floor, where there is one
MOST_BODIES = 32  # the floor, a platform's 24 spikes and hull, and some more

# A neighbour's code: its index, and in the upper bits which periodic image is meant. The sign means "touching".
INDEX_BITS = 26
INDEX_MASK = (1 << INDEX_BITS) - 1
SAME_IMAGE = 1 + 3 * 1  # (0 + 1) + 3 * (0 + 1)


@ti.data_oriented
class Absent:
    """Stands for the table of sleepers or of the energy balance where a bed has none; kernels are compiled without."""

    on = False
    sets = 1  # of cells: that of the grains awake


ABSENT = Absent()


@ti.data_oriented
class Lists(EnginePart):
    """The part of the engine that finds neighbours."""

    # Places of the numbers in ``count`` and ``box``. CHUNKS are those of the grains AWAKE (``dem.engine.sleep``: all,
    # unless a bed lets its grains sleep), of ALL_CHUNKS that there is room for; the first FAST_CHUNKS of them are of
    # the FAST grains, which come first. SORTED of the grains are sorted, into SORTED_CELLS cells: all, but for sleepers
    # that stay where they are.
    GRAINS, CHUNKS, CHUNK_ROOM, NEAR_ROOM, NX, NY, NZ, CELLS, AWAKE, ALL_CHUNKS, SORTED, SORTED_CELLS = range(12)
    FAST, FAST_CHUNKS, NUMBERS = range(12, 15)
    PERIOD_X, PERIOD_Y, BOTTOM, TOP, CELL_X, CELL_Y, CELL_Z = range(7)
    # For ``dem.gpu``, which knows of no module here.
    INDEX_BITS, INDEX_MASK, MOST_BODIES = INDEX_BITS, INDEX_MASK, MOST_BODIES
    PAIRS_NEEDED, NEAR_NEEDED = PAIRS_NEEDED, NEAR_NEEDED

    @ti.func
    def next_chunk(self, w):
        """The next chunk for work item w, or chunk_count where nothing is left.

        Taichi gives a CPU thread at least 512 items of a loop, so each thread has that many and one of them works.
        Which thread takes a chunk does not matter to the result.
        """
        c = self.count[self.CHUNKS]
        if w % ITEMS_PER_THREAD == 0:
            c = ti.atomic_add(self.ticket[QUEUE], 1)
        return c

    @ti.func
    def chunk_range(self, c):
        n, m, first, k = self.count[self.FAST], self.count[self.FAST_CHUNKS], 0, c
        if c >= m:
            first, k = n, c - m
            n, m = self.count[self.AWAKE] - n, ti.max(1, self.count[self.CHUNKS] - m)
        base = n // m
        rest = n - base * m
        start = first + k * base + ti.min(k, rest)
        return start, start + base + ti.select(k < rest, 1, 0)

    @ti.func
    def chunk_of(self, i):
        n, m, first, k = self.count[self.FAST], self.count[self.FAST_CHUNKS], 0, i
        if i >= n:
            first, k = m, i - n
            n, m = self.count[self.AWAKE] - n, ti.max(1, self.count[self.CHUNKS] - m)
        base = n // m
        rest = n - base * m
        wide = rest * (base + 1)
        return first + ti.select(k < wide, k // (base + 1), rest + (k - wide) // ti.max(base, 1))

    @ti.func
    def cell_of(self, x):
        """Cell of a position inside the box, as three integers."""
        i = ti.min(self.count[self.NX] - 1, ti.max(0, ti.floor(x.x / self.box[self.CELL_X], ti.i32)))
        j = ti.min(self.count[self.NY] - 1, ti.max(0, ti.floor(x.y / self.box[self.CELL_Y], ti.i32)))
        k = ti.min(
            self.count[self.NZ] - 1, ti.max(0, ti.floor((x.z - self.box[self.BOTTOM]) / self.box[self.CELL_Z], ti.i32))
        )
        return i, j, k

    @ti.func
    def cell_index(self, i, j, k):
        return (k * self.count[self.NY] + j) * self.count[self.NX] + i

    @ti.kernel
    def sort(
        self, gx: float, gy: float, gz: float, awake: int, anew: int, time: float, slow_time: float,
        rest: ti.template(), balance: ti.template(),
    ):  # fmt: skip
        """Wrap the grains into the box and bring them into the order of the curve; ids break ties.

        Those that are slow come behind the fast, and behind them those that sleep: each set has the cells for itself.
        ``awake``: how many did not sleep, until now; the others have not moved. A sleeper whose place in memory stays
        is left where it is, and few change it: the order of sleepers begins where grains wake and fall asleep
        (``place_asleep``), and from SORTED on, behind the last that wakes, nothing changes: of the grains from its cell
        on as many lie before it as did. ``anew``: forces are to be computed anew; else they stay where there is sleep.
        ``time``, ``slow_time``: for which those will act that a fast grain, and a slow one, has now [s].
        """
        for k in range(self.count[self.SORTED_CELLS]):
            self.cell_fill[k] = 0
        if ti.static(balance.on):
            for _ in range(1):  # one thread: the sum has one order
                for i in range(awake):
                    x, v = self.position[i], self.velocity[i]
                    a = -ti.floor(x.x / self.box[self.PERIOD_X]) * self.box[self.PERIOD_X]
                    b = -ti.floor(x.y / self.box[self.PERIOD_Y]) * self.box[self.PERIOD_Y]
                    if a != 0.0 or b != 0.0:
                        p = v.w * v.xyz
                        if ti.static(rest.on):
                            p = self.momentum_of(i, rest.slow[self.id[i]], time, slow_time, rest)
                        balance.turn(0, balance.outside, ti.Vector([a, b, 0.0]).cross(p))
        for i in range(self.count[self.SORTED]):
            cell = 0
            if i < awake:
                self.wrap(i)
                ci, cj, ck = self.cell_of(self.position[i])
                cell = self.cell_index(ci, cj, ck)
            elif ti.static(rest.on):
                cell = rest.cell[self.id[i]]
            r = self.rank[cell]
            if ti.static(rest.on):
                if rest.asleep[self.id[i]] == 1:
                    if i < awake:
                        rest.cell[self.id[i]] = cell
                    r = self.place_asleep(r, rest)
                elif rest.slow[self.id[i]] == 1:
                    r += self.count[self.CELLS]
            self.key[i] = r
            ti.atomic_add(self.cell_fill[r], 1)
        for w in range(self.cpu_items):
            b = self.first_block(w)
            while b < SCAN_BLOCKS:
                self.block_sum[b] = self.scan(b, 0, self.count[self.SORTED_CELLS], False)
                b += self.block_stride
        for _ in range(1):
            total = 0
            for b in range(SCAN_BLOCKS):
                kept = self.block_sum[b]
                self.block_sum[b] = total
                total += kept
            self.cell_start[self.count[self.SORTED_CELLS]] = total
        for w in range(self.cpu_items):
            b = self.first_block(w)
            while b < SCAN_BLOCKS:
                self.scan(b, self.block_sum[b], self.count[self.SORTED_CELLS], True)
                b += self.block_stride
        for i in range(self.count[self.SORTED]):
            slot = ti.atomic_add(self.cell_fill[self.key[i]], 1)
            self.came_from[slot] = i
        if ti.static(rest.on):
            for i in range(self.count[self.SORTED], self.count[self.GRAINS]):
                self.came_from[i] = i
        for r in range(self.count[self.SORTED_CELLS]):
            # Whatever thread came first, the order within a cell is that of the ids.
            for a in range(self.cell_start[r] + 1, self.cell_start[r + 1]):
                moving = self.came_from[a]
                b = a - 1
                while b >= self.cell_start[r] and self.id[self.came_from[b]] > self.id[moving]:
                    self.came_from[b + 1] = self.came_from[b]
                    b -= 1
                self.came_from[b + 1] = moving
        # On the way they are in the histories, which are free: those of the old lists have been put aside.
        for i in range(self.count[self.SORTED]):
            o = self.came_from[i]
            if not self.lies_on(i, awake, rest):
                self.slide[4 * i] = self.position[o]
                self.slide[4 * i + 1] = self.velocity[o]
                self.slide[4 * i + 2] = self.spin[o]
                self.slide[4 * i + 3].xyz = self.origin[o]
                self.buffer_id[i] = self.id[o]
                if ti.static(rest.on):
                    rest.buffer_force[i] = self.force[o]
                    rest.buffer_torque[i] = self.torque[o]
        for i in range(self.count[self.SORTED]):
            if not self.lies_on(i, awake, rest):
                self.position[i] = self.slide[4 * i]
                self.velocity[i] = self.slide[4 * i + 1]
                self.spin[i] = self.slide[4 * i + 2]
                self.origin[i] = self.slide[4 * i + 3].xyz
                self.id[i] = self.buffer_id[i]
                self.listed[i] = self.slide[4 * i].xyz
                self.force[i] = self.slide[4 * i + 1].w * ti.Vector([gx, gy, gz])
                self.torque[i] = ti.Vector.zero(self.real, 3)
                if ti.static(rest.on):
                    if i >= self.count[self.AWAKE]:
                        self.force[i] = ti.Vector.zero(self.real, 3)
                    elif anew == 0:
                        self.force[i] = rest.buffer_force[i]
                        self.torque[i] = rest.buffer_torque[i]

    @ti.func
    def wrap(self, i):
        """Put a grain back into the box, its origin with it; one that has left it for good is a problem."""
        x = self.position[i]
        inside = x.z >= self.box[self.BOTTOM] and x.z <= self.box[self.TOP]
        inside = inside and ti.abs(x.x) < 1e6 * self.box[self.PERIOD_X] and ti.abs(x.y) < 1e6 * self.box[self.PERIOD_Y]
        if not inside:
            # Any of the lost ones will do; the host looks for the first id.
            self.problem[LOST] = 1 + self.id[i]
        else:
            a = -ti.floor(x.x / self.box[self.PERIOD_X]) * self.box[self.PERIOD_X]
            b = -ti.floor(x.y / self.box[self.PERIOD_Y]) * self.box[self.PERIOD_Y]
            self.position[i].x = self.position[i].x + a
            self.position[i].y = self.position[i].y + b
            self.origin[i].x = self.origin[i].x + a
            self.origin[i].y = self.origin[i].y + b

    @ti.func
    def lies_on(self, i, awake, rest: ti.template()):
        """Whether the grain for this place is a sleeper that has been in it."""
        result = False
        if ti.static(rest.on):
            result = i >= self.count[self.AWAKE] and i >= awake and self.came_from[i] == i
        return result

    @ti.func
    def first_block(self, w):
        """Of what item w of a loop scans, SCAN_BLOCKS where that is nothing; ``next_chunk`` says why."""
        return ti.select(w % ITEMS_PER_THREAD == 0, w // ITEMS_PER_THREAD, SCAN_BLOCKS)

    @ti.func
    def scan(self, b, total, n, write: ti.template()):
        """Grains in block b of n cells; ``write``: where each cell's begin, too, ``total`` being before them."""
        size = (n + SCAN_BLOCKS - 1) // SCAN_BLOCKS
        for r in range(b * size, ti.min((b + 1) * size, n)):
            here = self.cell_fill[r]
            if ti.static(write):
                self.cell_start[r] = total
                self.cell_fill[r] = total
            total += here
        return total

    @ti.kernel
    def keep_lists(self, rest: ti.template(), balance: ti.template()):
        """Put the lists aside, so that the new ones can take the history over."""
        for _ in range(1):
            self.ticket[QUEUE] = 0
            self.old_near_room[None] = self.count[self.NEAR_ROOM]  # lists that grow have more by the time it is used
        for w in range(self.cpu_items):
            c = self.next_chunk(w)
            while c < self.count[self.CHUNKS]:
                self.keep_chunk(c, rest, balance)
                c = self.next_chunk(w)
        if ti.static(rest.on):
            for i in range(self.count[self.AWAKE], rest.before(rest.kept, self.count[self.GRAINS])):
                self.old_start[i] = 0
                self.old_end[i] = 0
                self.near_first[i] = -1
            for _ in range(1):
                rest.kept[None] = self.count[self.AWAKE]

    @ti.func
    def keep_chunk(self, c, rest: ti.template(), balance: ti.template()):
        start, end = self.chunk_range(c)
        if ti.static(rest.on):
            self.gather_pushes(c, rest)
        for i in range(start, end):
            self.old_start[i] = self.pair_start[i]
            self.old_end[i] = self.pair_end[i]
            self.near_first[i] = -1
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                self.old_pair[s] = code
                if code < 0:
                    self.old_slide[s] = self.slide[s]
                    if ti.static(self.rolling):
                        self.old_roll[s] = self.roll[s]
                    if ti.static(balance.on):
                        balance.old_last[s] = balance.last[s]
        self.old_near_end[c] = self.near_end[c]
        base = c * self.count[self.NEAR_ROOM]
        for k in range(self.near_end[c] - base):
            s = self.near_end[c] - 1 - k
            i = self.near_grain[s]
            self.near_first[i] = s
            self.old_near_grain[s] = i
            self.old_near_body[s] = self.near_body[s]
            self.old_near_slide[s] = self.near_slide[s]
            self.old_near_roll[s] = self.near_roll[s]
            if ti.static(balance.on):
                balance.old_near_last[s] = balance.near_last[s]

    @ti.func
    def find_old(self, i, j):
        """Row of the old list that holds touching pair i, j (old indices), or -1."""
        found = -1
        for s in range(self.old_start[i], self.old_end[i]):
            code = self.old_pair[s]
            if code < 0 and ((~code) & INDEX_MASK) == j:
                found = s
        return found

    @ti.kernel
    def make_lists(self, skin: float, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        """New pair and near lists for the sorted grains; history comes over from the lists put aside."""
        for b in range(MOST_BODIES):
            self.body_listed[b] = self.body_position[b]
            self.body_listed_turn[b] = self.body_turn[b]
        for _ in range(1):
            self.ticket[QUEUE] = 0
        for w in range(self.cpu_items):
            c = self.next_chunk(w)
            while c < self.count[self.CHUNKS]:
                self.list_chunk(c, ti.cast(skin, self.real), shapes, rest, balance)
                c = self.next_chunk(w)
        if ti.static(rest.on):
            for i in range(self.count[self.AWAKE], rest.before(rest.made, self.count[self.GRAINS])):
                self.pair_start[i] = 0
                self.pair_end[i] = 0
            for c in range(self.count[self.CHUNKS], self.count[self.ALL_CHUNKS]):
                self.near_end[c] = c * self.count[self.NEAR_ROOM]
            for _ in range(1):
                # Lists without room enough are made once more.
                if rest.news[BUILT] == 1 and self.problem[PAIRS_NEEDED] + self.problem[NEAR_NEEDED] == 0:
                    rest.side[None] = 1 - rest.side[None]
                    rest.news[BUILT] = 0
                rest.made[None] = self.count[self.AWAKE]
                rest.whole[None] = 0
                if self.problem[PAIRS_NEEDED] + self.problem[NEAR_NEEDED] == 0:
                    rest.changed[None] = 0
                rest.last[None] = -1
        for _ in range(1):
            self.moved[None] = 0
            self.halted[None] = 0

    @ti.func
    def list_chunk(self, c, skin, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        start, end = self.chunk_range(c)
        base = c * self.count[self.CHUNK_ROOM]
        s = base
        for i in range(start, end):
            x_i = self.position[i]
            self.pair_start[i] = s
            ci, cj, ck = self.cell_of(x_i)
            for dk in range(-1, 2):
                k = ck + dk
                if k >= 0 and k < self.count[self.NZ]:
                    for dj, di in ti.ndrange((-1, 2), (-1, 2)):
                        # Stepping out on the left means the neighbour's image one period to the left.
                        gi, gj = ci + di, cj + dj
                        mi = ti.select(gi < 0, 1, 0) - ti.select(gi >= self.count[self.NX], 1, 0)
                        mj = ti.select(gj < 0, 1, 0) - ti.select(gj >= self.count[self.NY], 1, 0)
                        gi, gj = gi + mi * self.count[self.NX], gj + mj * self.count[self.NY]
                        r = self.rank[self.cell_index(gi, gj, k)]
                        for part in range(rest.sets):
                            if ti.static(rest.on):
                                if part == 1:
                                    r += self.count[self.CELLS]
                                if part == 2:
                                    r = self.place_asleep(r - self.count[self.CELLS], rest)
                            first, behind = self.cell_start[r], self.cell_start[r + 1]
                            if first >= start and behind <= i:  # grains of this chunk, whose pairs with i are theirs
                                first = behind
                            for j in range(first, behind):
                                own = j >= start and j < end
                                if j != i and (j > i or not own):
                                    x_j = self.position[j]
                                    d = x_i.xyz - x_j.xyz
                                    d.x += ti.cast(mi, self.real) * self.box[self.PERIOD_X]
                                    d.y += ti.cast(mj, self.real) * self.box[self.PERIOD_Y]
                                    reach = x_i.w + x_j.w + skin
                                    if ti.static(self.cohesion == JKR):
                                        reach += adhesive_range(self.grain_pair[None], x_i.w * x_j.w / (x_i.w + x_j.w))
                                    if d.norm_sqr() < reach * reach:
                                        if s < base + self.count[self.CHUNK_ROOM]:
                                            image = (mi + 1 + 3 * (mj + 1)) << INDEX_BITS
                                            self.list_pair(s, i, j, j | image, rest, balance)
                                        s += 1
            self.pair_end[i] = ti.min(s, base + self.count[self.CHUNK_ROOM])
        if s > base + self.count[self.CHUNK_ROOM]:
            ti.atomic_max(self.problem[PAIRS_NEEDED], s - base)
        self.list_near(c, start, end, skin, shapes, rest, balance)

    @ti.func
    def list_pair(self, s, i, j, code, rest: ti.template(), balance: ti.template()):
        oi, oj = self.came_from[i], self.came_from[j]
        self.first[s] = i
        sign = ti.cast(1.0, self.real)
        old = self.find_old(oi, oj)
        if old < 0:
            old = self.find_old(oj, oi)
            sign = -sign
        if old >= 0:
            self.pair[s] = ~code
            slide = self.old_slide[old]
            slide.xyz = sign * slide.xyz  # its last entry is the same from either side
            self.slide[s] = slide
            if ti.static(self.rolling):
                self.roll[s] = sign * self.old_roll[old]
        else:
            self.pair[s] = code
            self.slide[s] = ti.Vector.zero(self.real, 4)
            if ti.static(self.rolling):
                self.roll[s] = ti.Vector.zero(self.real, 3)
        if ti.static(rest.on):
            self.list_sleeper(s, i, j, code, rest)
        if ti.static(balance.on):
            balance.last[s] = balance.nothing()
            if old >= 0:
                balance.last[s] = balance.seen_from(sign, balance.old_last[old])

    @ti.func
    def list_near(self, c, start, end, skin, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        base = c * self.count[self.NEAR_ROOM]
        s = base
        for i in range(start, end):
            x = self.position[i]
            for b in range(self.body_count[None]):
                reach = x.w + skin + self.body_range(b, x.w, 0.0)
                distance = 2.0 * reach
                if self.from_body(b, x.xyz).norm_sqr() < (self.body_extent[b] + reach) ** 2:
                    distance, n, curvature, arm = self.nearest(b, x.xyz, reach, shapes, True)
                if ti.static(shapes.full):
                    # A grain in the midst of a mesh is out of its surface's reach: no force would tell of it.
                    if distance < -x.w:
                        self.overlap[c] = ti.max(self.overlap[c], (x.w - distance) / (2.0 * x.w))
                if distance < reach:
                    if s < base + self.count[self.NEAR_ROOM]:
                        self.near_grain[s] = i
                        self.near_body[s] = b
                        self.near_slide[s] = ti.Vector.zero(self.real, 4)
                        self.near_roll[s] = ti.Vector.zero(self.real, 3)
                        if ti.static(balance.on):
                            balance.near_last[s] = balance.nothing()
                        o = self.near_first[self.came_from[i]]
                        while o >= 0:
                            if self.old_near_body[o] == b:
                                self.near_slide[s] = self.old_near_slide[o]
                                self.near_roll[s] = self.old_near_roll[o]
                                if ti.static(balance.on):
                                    balance.near_last[s] = balance.old_near_last[o]
                            o = self.next_near(o, self.came_from[i])
                        if ti.static(rest.on):
                            self.wake_near(s, i, b, rest)
                    s += 1
        self.near_end[c] = ti.min(s, base + self.count[self.NEAR_ROOM])
        if s > base + self.count[self.NEAR_ROOM]:
            ti.atomic_max(self.problem[NEAR_NEEDED], s - base)

    @ti.func
    def next_near(self, o, i):
        """The row of the old near list behind row o if it is of the same grain (i, its old index), or -1."""
        result = o + 1
        room = self.old_near_room[None]
        if result % room == 0 or result >= self.old_near_end[result // room]:
            result = -1
        elif self.old_near_grain[result] != i:
            result = -1
        return result
