"""Neighbour lists for a GPU: a full list with a thread for each grain, and rows packed without gaps.

A bed of 20 million grains must fit into the memory of one card, so no grain gets the rows that the worst grain needs.
Rows are counted, the counts added up, and the rows filled in. The same code runs on a CPU, for tests. Sums have one
order, so every run on one kind of card is bitwise reproducible.

Those of a grain lie together. (Rows interleaved by 32 grains let the threads of a warp read neighbouring addresses.
Then a step was 9 % slower on an H100, and the rows half as many again: docs/performance.md.)
"""

from typing import Any

import numpy as np

from dem.contact.cohesion import JKR
from dem.contact.law import adhesive_range
from hedgebed_taichi import ti

from .part import Part

__all__ = ["NEAR", "TALLY_BLOCKS", "GpuLists"]

SCANNED = 1024  # blocks in which counts are added up, each by a thread
# Places in ``total``: rows of pairs, rows near bodies.
PAIRS, NEAR = range(2)
TALLY_BLOCKS = 256


@ti.data_oriented
class GpuLists(Part):
    """The part of the engine that finds neighbours, on a GPU."""

    EMPTY = ("pair_start", "near_start", "near_push", "total", "overlap")
    BY_CHUNK = ("overlap",)

    def _make_sort_fields(self, n: int, cell_capacity: int) -> None:
        """Fields for sorting; one grain field after the other passes through the buffers."""
        real = self.real
        self.capacity, self.cell_capacity = n, cell_capacity
        self.buffer4, self.buffer3 = self.store.vector(4, real, n), self.store.vector(3, real, n)
        self.came_from, self.key = (self.store.scalar(ti.i32, n) for _ in range(2))
        self.rank = self.store.scalar(ti.i32, cell_capacity)
        self.cell_start, self.cell_fill = (self.store.scalar(ti.i32, cell_capacity + 1) for _ in range(2))
        self.block_sum, self.block_near = (self.store.scalar(ti.i32, SCANNED) for _ in range(2))

    def _make_list_fields(self, n: int, chunk_capacity: int, rows: int, near: int) -> None:
        """Pair lists and lists of grains near bodies, and those of before."""
        F, real = self.store.vector, self.real
        self.row_capacity, self.near_capacity = rows, near
        self.pair_start, self.old_start = (self.store.scalar(ti.i32, n + 1) for _ in range(2))
        self.pair, self.old_pair = (self.store.scalar(ti.i32, rows) for _ in range(2))
        self.slide, self.old_slide = (F(4, real, rows) for _ in range(2))
        if self.rolling:
            self.roll, self.old_roll = (F(3, real, rows) for _ in range(2))
        self.near_start, self.old_near_start = (self.store.scalar(ti.i32, n + 1) for _ in range(2))
        self.near_grain, self.near_body, self.old_near_body = (self.store.scalar(ti.i32, near) for _ in range(3))
        self.near_slide, self.old_near_slide = (F(4, real, near) for _ in range(2))
        self.near_roll, self.old_near_roll = (F(3, real, near) for _ in range(2))
        # Force and torque of a row on its body, summed since they were last added to ``pushes``.
        self.near_push = F(6, ti.f64, near)
        self.total = self.store.scalar(ti.i32, 2)

    def _make_sums(self, chunk_capacity: int) -> None:
        """Forces on bodies are summed by row, then by block of rows: nothing as large as the bed is read."""
        self.overlap = self.store.scalar(self.real, self.capacity)
        self.pushes = self.store.vector(6, ti.f64, (TALLY_BLOCKS, self.MOST_BODIES))
        self.block_overlap = self.store.scalar(ti.f64, TALLY_BLOCKS)

    # What the host reads and writes of lists, in the order of grains.

    def listed_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs listed for each grain, and their rows."""
        return self._listed(self.pair_start)

    def listed_near(self) -> tuple[np.ndarray, np.ndarray]:
        """Bodies listed for each grain, and their rows."""
        return self._listed(self.near_start)

    def _listed(self, start: Any) -> tuple[np.ndarray, np.ndarray]:
        starts = start.to_numpy()[: self.grain_count + 1]
        return np.diff(starts), np.arange(starts[-1])

    def lay_pairs(self, counts: np.ndarray, *chunks: int) -> np.ndarray:
        """Reserve rows for so many pairs of each grain; return the rows. Raises ValueError where they do not fit."""
        start = np.concatenate(([0], np.cumsum(counts)))
        if start[-1] > self.row_capacity:
            raise ValueError(f"the lists hold {self.row_capacity} pairs, this state has {start[-1]}")
        self.write("pair_start", start)
        self.total[PAIRS] = int(start[-1])
        return np.arange(start[-1])

    lay_history = lay_pairs

    def lay_near(self, grains: np.ndarray, *chunks: int) -> np.ndarray:
        """Reserve rows for these grains near bodies, in the order of memory; return the rows."""
        start = np.searchsorted(grains, np.arange(self.grain_count + 1))
        self.write("near_start", start)
        self.near_push.fill(0)
        self.total[NEAR] = len(grains)
        return np.arange(len(grains))

    @ti.func
    def chunk_range(self, c):
        return c, c + 1

    @ti.func
    def part_of(self, b, n):
        """First and end of the items of block b, of n in all."""
        size = (n + SCANNED - 1) // SCANNED
        return ti.min(b * size, n), ti.min((b + 1) * size, n)

    @ti.func
    def before(self, sums: ti.template(), b):
        """Sum of the blocks before block b."""
        total = 0
        for q in range(b):
            total += sums[q]
        return total

    @ti.kernel
    def sort(
        self, gx: float, gy: float, gz: float, awake: int, anew: int, time: float, slow_time: float,
        rest: ti.template(), balance: ti.template(),
    ):  # fmt: skip
        """Wrap the grains into the box and bring them into the order of the curve; ids break ties."""
        for k in range(self.cell_capacity):
            self.cell_fill[k] = 0
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                if ti.static(balance.on):
                    x, v = self.position[i], self.velocity[i]
                    a = -ti.floor(x.x / self.box[self.PERIOD_X]) * self.box[self.PERIOD_X]
                    b = -ti.floor(x.y / self.box[self.PERIOD_Y]) * self.box[self.PERIOD_Y]
                    if a != 0.0 or b != 0.0:
                        balance.turn(i, balance.outside, v.w * ti.Vector([a, b, 0.0]).cross(v.xyz))
                self.wrap(i)
                ci, cj, ck = self.cell_of(self.position[i])
                r = self.rank[self.cell_index(ci, cj, ck)]
                self.key[i] = r
                ti.atomic_add(self.cell_fill[r], 1)
        for b in range(SCANNED):
            total = 0
            first, end = self.part_of(b, self.count[self.CELLS])
            for r in range(first, end):
                total += self.cell_fill[r]
            self.block_sum[b] = total
        for b in range(SCANNED):
            total = self.before(self.block_sum, b)
            first, end = self.part_of(b, self.count[self.CELLS])
            for r in range(first, end):
                here = self.cell_fill[r]
                self.cell_start[r] = total
                self.cell_fill[r] = total
                total += here
            if b == SCANNED - 1:
                self.cell_start[self.count[self.CELLS]] = total
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.came_from[ti.atomic_add(self.cell_fill[self.key[i]], 1)] = i
        for r in range(self.cell_capacity):
            # Whatever thread came first, the order within a cell is that of the ids.
            if r < self.count[self.CELLS]:
                for a in range(self.cell_start[r] + 1, self.cell_start[r + 1]):
                    moving = self.came_from[a]
                    b = a - 1
                    while b >= self.cell_start[r] and self.id[self.came_from[b]] > self.id[moving]:
                        self.came_from[b + 1] = self.came_from[b]
                        b -= 1
                    self.came_from[b + 1] = moving
        # One field after the other through the buffers.
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.buffer4[i] = self.position[self.came_from[i]]
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.position[i] = self.buffer4[i]
                self.buffer4[i] = self.velocity[self.came_from[i]]
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.velocity[i] = self.buffer4[i]
                self.buffer4[i] = self.spin[self.came_from[i]]
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.spin[i] = self.buffer4[i]
                self.buffer3[i] = self.origin[self.came_from[i]]
                self.key[i] = self.id[self.came_from[i]]
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.origin[i] = self.buffer3[i]
                self.id[i] = self.key[i]
                self.listed[i] = self.position[i].xyz
                self.force[i] = self.velocity[i].w * ti.Vector([gx, gy, gz])
                self.torque[i] = ti.Vector.zero(self.real, 3)

    def keep_lists(self, rest: Any, balance: Any) -> None:
        """Put the lists aside, so that the new ones can take the history over."""
        self.add_pushes()
        self.keep_rows(balance)

    @ti.kernel
    def keep_rows(self, balance: ti.template()):
        for i in range(self.capacity + 1):
            if i <= self.count[self.GRAINS]:
                self.old_start[i] = self.pair_start[i]
                self.old_near_start[i] = self.near_start[i]
        for s in range(self.row_capacity):
            if s < self.total[PAIRS]:
                code = self.pair[s]
                self.old_pair[s] = code
                if code < 0:
                    self.old_slide[s] = self.slide[s]
                    if ti.static(self.rolling):
                        self.old_roll[s] = self.roll[s]
                    if ti.static(balance.on):
                        balance.old_last[s] = balance.last[s]
        for s in range(self.near_capacity):
            if s < self.total[NEAR]:
                self.old_near_body[s] = self.near_body[s]
                self.old_near_slide[s] = self.near_slide[s]
                self.old_near_roll[s] = self.near_roll[s]
                if ti.static(balance.on):
                    balance.old_near_last[s] = balance.near_last[s]

    @ti.kernel
    def add_pushes(self):
        """Add what the rows near bodies did to these since the last time to the sums of their blocks."""
        for block in range(TALLY_BLOCKS):
            size = (self.total[NEAR] + TALLY_BLOCKS - 1) // TALLY_BLOCKS
            for s in range(block * size, ti.min((block + 1) * size, self.total[NEAR])):
                self.pushes[block, self.near_body[s]] = self.pushes[block, self.near_body[s]] + self.near_push[s]
                self.near_push[s] = ti.Vector.zero(ti.f64, 6)

    @ti.kernel
    def make_lists(self, skin: float, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        """New pair and near lists for the sorted grains; history comes over from the lists put aside."""
        for b in range(self.MOST_BODIES):
            self.body_listed[b] = self.body_position[b]
            self.body_listed_turn[b] = self.body_turn[b]
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.pair_start[i] = self.list_pairs(i, ti.cast(skin, self.real), -1, balance)
                self.near_start[i] = self.list_near_bodies(i, ti.cast(skin, self.real), -1, shapes, balance)
        for b in range(SCANNED):
            first, end = self.part_of(b, self.count[self.GRAINS])
            rows, near = 0, 0
            for i in range(first, end):
                rows += self.pair_start[i]
                near += self.near_start[i]
            self.block_sum[b] = rows
            self.block_near[b] = near
        for b in range(SCANNED):
            rows, near = self.before(self.block_sum, b), self.before(self.block_near, b)
            first, end = self.part_of(b, self.count[self.GRAINS])
            for i in range(first, end):
                pairs, bodies = self.pair_start[i], self.near_start[i]
                self.pair_start[i], self.near_start[i] = rows, near
                rows += pairs
                near += bodies
            if b == SCANNED - 1:
                self.pair_start[self.count[self.GRAINS]] = rows
                self.near_start[self.count[self.GRAINS]] = near
                self.total[PAIRS], self.total[NEAR] = rows, near
                if rows > self.row_capacity:
                    self.problem[self.PAIRS_NEEDED] = rows
                if near > self.near_capacity:
                    self.problem[self.NEAR_NEEDED] = near
        for i in range(self.capacity):
            if i < self.count[self.GRAINS] and self.fits():
                self.list_pairs(i, ti.cast(skin, self.real), self.pair_start[i], balance)
                self.list_near_bodies(i, ti.cast(skin, self.real), self.near_start[i], shapes, balance)
        for _ in range(1):
            self.moved[None] = 0
            self.halted[None] = 0
            if not self.fits():
                self.total[PAIRS], self.total[NEAR] = 0, 0

    @ti.func
    def fits(self):
        """Whether all rows fit."""
        return self.total[PAIRS] <= self.row_capacity and self.total[NEAR] <= self.near_capacity

    @ti.func
    def list_pairs(self, i, skin, row, balance: ti.template()):
        """How many neighbours grain i has; they are written into the rows from ``row`` on, where that is not -1."""
        s = row
        found = 0
        x_i = self.position[i]
        ci, cj, ck = self.cell_of(x_i)
        for dk in range(-1, 2):
            k = ck + dk
            if k >= 0 and k < self.count[self.NZ]:
                for dj, di in ti.ndrange((-1, 2), (-1, 2)):
                    # Stepping out on the left means the neighbour's image one period to the left.
                    gi, gj = ci + di, cj + dj
                    mi = ti.select(gi < 0, 1, 0) - ti.select(gi >= self.count[self.NX], 1, 0)
                    mj = ti.select(gj < 0, 1, 0) - ti.select(gj >= self.count[self.NY], 1, 0)
                    r = self.rank[self.cell_index(gi + mi * self.count[self.NX], gj + mj * self.count[self.NY], k)]
                    for j in range(self.cell_start[r], self.cell_start[r + 1]):
                        x_j = self.position[j]
                        d = x_i.xyz - x_j.xyz
                        d.x += ti.cast(mi, self.real) * self.box[self.PERIOD_X]
                        d.y += ti.cast(mj, self.real) * self.box[self.PERIOD_Y]
                        reach = x_i.w + x_j.w + skin
                        if ti.static(self.cohesion == JKR):
                            reach += adhesive_range(self.grain_pair[None], x_i.w * x_j.w / (x_i.w + x_j.w))
                        if j != i and d.norm_sqr() < reach * reach:
                            found += 1
                            if row >= 0:
                                self.put_pair(s, i, j, j | ((mi + 1 + 3 * (mj + 1)) << self.INDEX_BITS), balance)
                                s += 1
        return found

    @ti.func
    def find_old_pair(self, i, j):
        """Row of the old list of i that holds touching pair i, j (old indices), or -1."""
        found = -1
        for s in range(self.old_start[i], self.old_start[i + 1]):
            code = self.old_pair[s]
            if code < 0 and ((~code) & self.INDEX_MASK) == j:
                found = s
        return found

    @ti.func
    def put_pair(self, s, i, j, code, balance: ti.template()):
        """Fill a row in, with the pair's history where it has one."""
        oi, oj = self.came_from[i], self.came_from[j]
        sign = ti.cast(1.0, self.real)
        old = self.find_old_pair(oi, oj)
        if old < 0:  # a bed taken over from a CPU's has each pair once
            old = self.find_old_pair(oj, oi)
            sign = -sign
        if old >= 0:
            self.pair[s] = ~code
            slide = self.old_slide[old]
            slide.xyz = sign * slide.xyz  # its last entry is the same from either side
            self.slide[s] = slide
            if ti.static(self.rolling):
                self.roll[s] = sign * self.old_roll[old]
            if ti.static(balance.on):
                balance.last[s] = balance.seen_from(sign, balance.old_last[old])
        else:
            self.pair[s] = code
            self.slide[s] = ti.Vector.zero(self.real, 4)
            if ti.static(self.rolling):
                self.roll[s] = ti.Vector.zero(self.real, 3)
            if ti.static(balance.on):
                balance.last[s] = balance.nothing()

    @ti.func
    def list_near_bodies(self, i, skin, row, shapes: ti.template(), balance: ti.template()):
        """How many bodies are near grain i; they are written into the rows from ``row`` on, where that is not -1."""
        s = row
        found = 0
        x = self.position[i]
        for b in range(self.body_count[None]):
            reach = x.w + skin + self.body_range(b, x.w, 0.0)
            distance = 2.0 * reach
            if self.from_body(b, x.xyz).norm_sqr() < (self.body_extent[b] + reach) ** 2:
                distance, n, curvature, arm = self.nearest(b, x.xyz, reach, shapes, True)
            if ti.static(shapes.full):
                # A grain in the midst of a mesh is out of its surface's reach: no force would tell of it.
                if distance < -x.w:
                    self.overlap[i] = ti.max(self.overlap[i], (x.w - distance) / (2.0 * x.w))
            if distance < reach:
                found += 1
                if row >= 0:
                    self.near_grain[s] = i
                    self.near_body[s] = b
                    self.near_push[s] = ti.Vector.zero(ti.f64, 6)
                    self.near_slide[s] = ti.Vector.zero(self.real, 4)
                    self.near_roll[s] = ti.Vector.zero(self.real, 3)
                    if ti.static(balance.on):
                        balance.near_last[s] = balance.nothing()
                    o = self.came_from[i]
                    for q in range(self.old_near_start[o], self.old_near_start[o + 1]):
                        if self.old_near_body[q] == b:
                            self.near_slide[s] = self.old_near_slide[q]
                            self.near_roll[s] = self.old_near_roll[q]
                            if ti.static(balance.on):
                                balance.near_last[s] = balance.old_near_last[q]
                    s += 1
        return found
