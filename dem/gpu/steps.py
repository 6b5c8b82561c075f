"""The time step on a GPU: a thread for each grain, which computes all its contacts by itself.

A step has three loops: move; the forces between grains, each pair computed by both; the forces on bodies. A thread
first finds which of its rows touch and keeps them as bits of a number. The threads of a warp then compute contacts side
by side. No sum uses atomic operations, so every run on one kind of card is bitwise reproducible. The same code runs on
a CPU, for tests.
"""

import numpy as np

from dem.contact.cohesion import JKR
from dem.contact.law import adhesive_range
from hedgebed_taichi import ti

from .lists import NEAR, TALLY_BLOCKS
from .part import Part

__all__ = ["GpuSteps"]

BITS = 32
STEPS_PER_LOOK = 20
# Starting a kernel from Python takes as long as a step of 50,000 grains: where many are wanted, a kernel has several.
MANY, STEPS_PER_KERNEL = 200, 5
# Threads of a block that computes forces: small ones leave fewer of a multiprocessor's registers unused.
BLOCK = 64


@ti.data_oriented
class GpuSteps(Part):
    """The part of the engine that moves grains and bodies and computes forces, on a GPU."""

    def launch(
        self,
        most: int,
        before: int,
        dt: float,
        limit: float,
        gravity: tuple[float, float, float],
        keep: float,
        awake: int,
    ) -> tuple[int, bool]:
        """As ``Engine.launch``; looks whether new lists are needed once for STEPS_PER_LOOK steps."""
        self.done[None] = 0
        at_once = STEPS_PER_KERNEL if most >= MANY else 1
        for _ in range(min(most, STEPS_PER_LOOK) // at_once):
            self.run_on_gpu(dt, limit, *gravity, keep, at_once, self.shapes, self.rest, self.balance)
        done, halted = self.progress_so_far()
        return int(done), bool(halted)

    @ti.kernel
    def progress_so_far(self) -> ti.types.vector(2, ti.i32):
        return ti.Vector([self.done[None], self.halted[None]])

    @ti.kernel
    def run_on_gpu(
        self,
        dt: float,
        limit: float,
        gx: float,
        gy: float,
        gz: float,
        keep: float,
        steps: ti.template(),
        shapes: ti.template(),
        rest: ti.template(),
        balance: ti.template(),
    ):
        """Some steps; nothing from where new lists are needed on, as in ``Engine.run``."""
        for _ in ti.static(range(steps)):
            for i in range(self.capacity):
                if i < self.count[self.GRAINS] and self.halted[None] == 0:
                    self.move(i, dt, limit, ti.Vector([gx, gy, gz]), keep, rest)
            ti.loop_config(block_dim=BLOCK)
            for i in range(self.capacity):
                if i < self.count[self.GRAINS] and self.moved[None] == 0:
                    self.push_pairs(i, dt, rest, balance)
            for s in range(self.near_capacity):
                if self.moved[None] == 0:
                    self.push_bodies(s, dt, shapes, balance)
                    if s == 0:
                        self.done[None] = self.done[None] + 1
                elif s == 0:
                    self.halted[None] = 1

    @ti.kernel
    def push_all(self, dt: float, before: int, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        """The forces of the step that was interrupted by new lists."""
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                self.push_pairs(i, dt, rest, balance)
        for s in range(self.near_capacity):
            self.push_bodies(s, dt, shapes, balance)

    @ti.func
    def push_pairs(self, i, dt, rest: ti.template(), balance: ti.template()):
        """Forces on grain i of all grains that it touches; its weight stands in the field already."""
        x_i, v_i, w_i = self.position[i], self.velocity[i], self.spin[i]
        p = self.grain_pair[None]
        force, torque = self.force[i], self.torque[i]
        largest = ti.cast(0.0, self.real)
        if ti.static(balance.on):
            self.balance_weight(i, dt, balance)
        first, end = self.pair_start[i], self.pair_start[i + 1]
        while first < end:
            touching = ti.cast(0, ti.u32)
            for s in range(first, ti.min(first + BITS, end)):
                code = self.pair[s]
                bits = ti.select(code < 0, ~code, code)
                x_j = self.position[bits & self.INDEX_MASK]
                sum_r = x_i.w + x_j.w
                d = self.apart(x_i, x_j, bits)
                if ti.static(self.cohesion == JKR):
                    sum_r += adhesive_range(p, x_i.w * x_j.w / sum_r)
                touches = d.norm_sqr() < sum_r * sum_r
                if touches:
                    touching |= ti.cast(1, ti.u32) << ti.cast(s - first, ti.u32)
                if touches != (code < 0):
                    self.pair[s] = ~code
                    if code < 0:
                        if ti.static(balance.on):
                            self.balance_pair(i, s, i, bits & self.INDEX_MASK, d, balance.nothing(), dt, rest, balance)
                        self.slide[s] = ti.Vector.zero(self.real, 4)
                        if ti.static(self.rolling):
                            self.roll[s] = ti.Vector.zero(self.real, 3)
            while touching != 0:
                # The lowest bit's place: of the bits below it there are as many.
                lowest = touching & (~touching + ti.cast(1, ti.u32))
                s = first + ti.cast(ti.math.popcnt(lowest - ti.cast(1, ti.u32)), ti.i32)
                touching = touching & (touching - ti.cast(1, ti.u32))
                bits = ~self.pair[s]
                f, t, share = self.push_pair(i, s, bits, x_i, v_i, w_i, p, dt, rest, balance)
                force += f
                torque += t
                largest = ti.max(largest, share)
            first += BITS
        self.force[i] = force
        self.torque[i] = torque
        if not (largest <= self.overlap[i]):  # a NaN goes through
            self.overlap[i] = largest

    @ti.func
    def push_pair(self, i, s, bits, x_i, v_i, w_i, p, dt, rest: ti.template(), balance: ti.template()):
        """Force and torque on grain i of the neighbour in row s, and their overlap over the mean diameter."""
        j = bits & self.INDEX_MASK
        x_j, v_j, w_j = self.position[j], self.velocity[j], self.spin[j]
        d, v = self.apart(x_i, x_j, bits), v_i.xyz - v_j.xyz
        u, q = self.slide[s], ti.Vector.zero(self.real, 3)
        if ti.static(self.rolling):
            q = self.roll[s]
        onset = self.first_onset(d, x_i.w, x_j.w, v_i.w, v_j.w, v, u.w, dt)
        n, f_n, damped, f_t, turn, arm_i, arm_j, share = self.pair_force(
            p, d, x_i.w, x_j.w, v_i.w, v_j.w, v, w_i.xyz, w_j.xyz, onset, dt, u, q
        )
        self.slide[s] = u
        if ti.static(self.rolling):
            self.roll[s] = q
        f = f_n * n + f_t
        if ti.static(balance.on):
            now = self.pair_row(s, i, j, d, n, damped, f_t, turn, balance)
            self.balance_pair(i, s, i, j, d, now, dt, rest, balance)
            self.balance_turning(i, bits, f, f_t, turn, n, arm_j, dt, rest, balance)
        return f, arm_i * f_t.cross(n) + turn, share

    @ti.func
    def push_bodies(self, s, dt, shapes: ti.template(), balance: ti.template()):
        """Forces between bodies and the grain whose rows begin with row s; nothing where none's do."""
        if s < self.total[NEAR]:
            i = self.near_grain[s]
            if s == self.near_start[i]:
                largest = self.overlap[i]
                for row in range(s, self.near_start[i + 1]):
                    largest = ti.max(largest, self.push_near(i, row, dt, 1, 1.0, shapes, balance))
                self.overlap[i] = largest

    @ti.func
    def push_body(self, c, s, b, f, t_body):
        """Sum what row s does to body b: force and torque."""
        push = self.near_push[s]
        for k in ti.static(range(3)):
            push[k] -= ti.cast(f[k], ti.f64)
            push[k + 3] += ti.cast(t_body[k], ti.f64)
        self.near_push[s] = push

    @ti.kernel
    def clear_pushes(self):
        for block, b in ti.ndrange(TALLY_BLOCKS, self.MOST_BODIES):
            self.pushes[block, b] = ti.Vector.zero(ti.f64, 6)
        for s in range(self.near_capacity):
            if s < self.total[NEAR]:
                self.near_push[s] = ti.Vector.zero(ti.f64, 6)

    def tally(self, rows: np.ndarray) -> None:
        """As ``Readings.tally``: sums over blocks first, so that the host reads no more than of a small bed."""
        self.add_pushes()
        self.sum_blocks(rows)

    @ti.kernel
    def sum_blocks(self, rows: ti.types.ndarray(dtype=ti.f64, ndim=2)):
        for block in range(TALLY_BLOCKS):
            size = (self.count[self.GRAINS] + TALLY_BLOCKS - 1) // TALLY_BLOCKS
            end = ti.min((block + 1) * size, self.count[self.GRAINS])
            self.block_overlap[block] = self.largest_overlap(self.overlap, block * size, end)
        for b in range(self.MOST_BODIES + 1):
            self.put_tally(rows, b, self.pushes, self.block_overlap, TALLY_BLOCKS)

    @ti.kernel
    def count_contacts(self, counts: ti.types.ndarray(dtype=ti.i32, ndim=1), shapes: ti.template()):
        """Contacts of each grain, by id."""
        for i in range(self.capacity):
            if i < self.count[self.GRAINS]:
                found = 0
                for s in range(self.pair_start[i], self.pair_start[i + 1]):
                    if self.pair[s] < 0:
                        found += 1
                r = self.position[i].w
                for s in range(self.near_start[i], self.near_start[i + 1]):
                    b = self.near_body[s]
                    reach = r
                    if ti.static(shapes.full):
                        reach += self.body_range(b, r, 0.0)
                    distance, n, curvature, arm = self.nearest(b, self.position[i].xyz, reach, shapes, False)
                    if distance < r + self.body_range(b, r, curvature):
                        found += 1
                counts[self.id[i]] = found
