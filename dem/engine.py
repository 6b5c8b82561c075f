"""The fields and the time step: everything that runs once a step.

Layout (measured reasons in docs/performance.md):

* Grains lie in memory in the order of a space-filling curve through the cells, so that neighbours are near.
* They are cut into a fixed number of contiguous chunks, whatever the number of threads. A pair inside a chunk is
  computed once, by the chunk's own serial loop, and added to both; a pair across chunks is computed by both sides. So
  no two threads write to one grain, and every sum has one order: the same bits on any number of threads. On a GPU a
  chunk is one grain, and the same code is a full list.
* A step has two phases. ``move`` kicks and drifts (leapfrog: velocities live half a step behind positions); ``push``
  computes forces. Moving also finds out whether a grain has come further than half the skin; if so the launch ends
  there, and the host makes new lists and goes on. On a CPU all steps of a launch are one parallel loop (``run``).
* Sums into a field are written as x = x + y, because Taichi's x += y is an atomic operation.

An engine is compiled for a capacity, not for a number of grains, and is used again by the next bed that fits:
``take_engine`` keeps those that no bed holds any more.
"""

import math
import weakref
from typing import Any

import numpy as np
import taichi as ti

from . import runtime
from .cohesion import JKR
from .contact import PAIR_WIDTH, adhesive_range, contact_force, turning_torque
from .ledger import NO_LEDGER, Bookkeeping, Ledger
from .lists import (
    ALL_CHUNKS,
    AWAKE,
    BOTTOM,
    CACHE_LINE,
    CELLS,
    CHUNK_ROOM,
    CHUNKS,
    FINISHED,
    GRAINS,
    INDEX_BITS,
    INDEX_MASK,
    ITEMS_PER_THREAD,
    MOST_BODIES,
    NEAR_ROOM,
    PERIOD_X,
    PERIOD_Y,
    QUEUE,
    SAME_IMAGE,
    SCAN_BLOCKS,
    SORTED,
    SORTED_CELLS,
    Lists,
    curve_ranks,
)
from .shape_table import PLAIN, Shapes
from .shapes import ROW_WIDTH
from .sleep_kernels import EVERYONE, Rest, Sleepers

__all__ = ["Engine", "MOST_BODIES", "MOST_PRIMITIVES", "STEPS_PER_LAUNCH", "take_engine"]

# A launch is short enough for a thread that left to come back soon, and for Ctrl-C.
STEPS_PER_LAUNCH = 20
GRAINS_PER_CHUNK = 1250
MOST_CHUNKS = 64
AWAKE_SHARE = 0.64
# Looks at a counter, per grain of a chunk, before a thread gives up waiting: some milliseconds.
PATIENCE = 100
MOST_PRIMITIVES = 64
TALLY_BLOCKS = 256

_free: dict[tuple, list] = {}


def take_engine(owner: Any, **settings: Any) -> "Engine":
    """An engine for ``owner``, set up by ``settings`` (those of ``Engine.set_up``, and ``rolling``, ``tensile``,
    ``cohesion``, ``real``, ``gpu``, ``threads``); one that an earlier owner has left, where there is one of the shape.

    Raises:
        ValueError: a bed less than three grains wide.
    """
    fixed = {key: settings.pop(key) for key in ("rolling", "tensile", "cohesion", "real", "gpu", "threads")}
    plan = Engine.plan(gpu=fixed["gpu"], **settings)
    shape = {key: plan.pop(key) for key in ("capacity", "cell_capacity", "chunk_capacity", "neighbours_per_grain")}
    key = (runtime.generation(), *shape.values(), *(str(value) for value in fixed.values()))
    for old in [k for k in _free if k[0] != key[0]]:
        del _free[old]
    idle = _free.setdefault(key, [])
    engine = idle.pop() if idle else Engine(**shape, **fixed)
    engine.set_up(**plan)
    weakref.finalize(owner, idle.append, engine).atexit = False
    return engine


def _roomy(count: int, *, least: int) -> int:
    """The next of 1 and 1.5 times a power of two: few shapes to compile, and little room wasted."""
    power = least
    while power < count:
        if power * 3 // 2 >= count:
            return power * 3 // 2
        power *= 2
    return power


@ti.data_oriented
class Engine(Lists, Shapes, Sleepers, Bookkeeping):
    """Grains, lists and bodies in Taichi fields, and the kernels that advance them.

    Args:
        capacity: grains that there is room for, at most 2^26.
        cell_capacity, chunk_capacity: likewise.
        neighbours_per_grain: rows of the pair lists for each.
        rolling: whether contacts carry a rolling spring.
        tensile: whether a contact's damping may pull at its end.
        cohesion: a law of ``dem.cohesion.COHESIONS``.
        real: ti.f64 or ti.f32.
        gpu: one grain a chunk.
        threads: of the CPU.
    """

    # Fields with a row for each grain: ``read`` and ``write`` see those in use.
    GRAIN_FIELDS = (
        "position",
        "velocity",
        "spin",
        "force",
        "torque",
        "origin",
        "listed",
        "id",
        "pair_start",
        "pair_end",
    )

    @staticmethod
    def plan(
        *,
        grain_count: int,
        period: tuple[float, float],
        bottom: float,
        height: float,
        largest_diameter: float,
        largest_skin: float,
        gpu: bool = False,
        neighbours_per_grain: int = 16,
        chunk_count: int | None = None,
    ) -> dict[str, Any]:
        """The shape to compile and the numbers to set up.

        Args:
            grain_count: number of grains.
            period: lateral period (x, y) [m].
            bottom, height: z of the box's bottom and top [m].
            largest_diameter: of the grains [m]. largest_skin: of the lists [m].
            gpu: one grain a chunk.
            neighbours_per_grain: room in the lists.
            chunk_count: chosen when None.
        """
        cell = largest_diameter + largest_skin
        cells = (
            max(1, int(period[0] / cell)),
            max(1, int(period[1] / cell)),
            max(1, int((height - bottom) / cell) + 1),
        )
        if min(cells[:2]) < 3:
            # With fewer the same neighbour would be met through two images.
            raise ValueError(
                f"the bed is {min(period):g} m across, less than three grains of {largest_diameter:g} m; "
                f"make it at least {3 * cell:.3g} m wide"
            )
        if chunk_count is None:
            chunk_count = grain_count if gpu else max(1, min(MOST_CHUNKS, round(grain_count / GRAINS_PER_CHUNK)))
        return {
            "capacity": _roomy(grain_count, least=64),
            "cell_capacity": _roomy(math.prod(cells), least=1024),
            "chunk_capacity": _roomy(chunk_count, least=MOST_CHUNKS),
            "neighbours_per_grain": neighbours_per_grain,
            "grain_count": grain_count,
            "chunk_count": chunk_count,
            "cells": cells,
            "box": (*period, bottom, height, period[0] / cells[0], period[1] / cells[1], cell),
        }

    def __init__(
        self,
        *,
        capacity: int,
        cell_capacity: int,
        chunk_capacity: int,
        neighbours_per_grain: int,
        rolling: bool,
        tensile: bool,
        cohesion: int,
        real,
        gpu: bool = False,
        threads: int = 1,
    ):
        n = capacity
        self.real = real
        self.rolling = rolling
        self.tensile = tensile
        self.cohesion = cohesion
        self.gpu = gpu
        F = ti.Vector.field
        self.count = ti.field(ti.i32, 12)
        self.box = ti.field(real, 7)
        # Per grain. position: x y z radius; velocity: x y z mass (half a step behind); spin: x y z and nothing.
        self.position = F(4, real, n)
        self.velocity = F(4, real, n)
        self.spin = F(4, real, n)
        self.force = F(3, real, n)
        self.torque = F(3, real, n)
        self.origin = F(3, real, n)
        self.listed = F(3, real, n)
        self.id = ti.field(ti.i32, n)
        # Room for sorting.
        self.buffer4 = [F(4, real, n) for _ in range(3)]
        self.buffer3 = F(3, real, n)
        self.buffer_id = ti.field(ti.i32, n)
        self.came_from = ti.field(ti.i32, n)
        self.key = ti.field(ti.i32, n)
        self.rank = ti.field(ti.i32, cell_capacity)
        self.cell_start = ti.field(ti.i32, 2 * cell_capacity + 1)
        self.cell_fill = ti.field(ti.i32, 2 * cell_capacity)
        self.block_sum = ti.field(ti.i32, SCAN_BLOCKS)
        self.block_stride = SCAN_BLOCKS if gpu else threads
        # Pair lists: chunk c owns the rows from c times its room, those of a grain lie together. ``first`` is the
        # grain a row belongs to, ``pair`` its neighbour's code, ``touching`` the rows in contact in this step,
        # ``slide`` the contact's history: x y z of the tangential spring, and what the normal dashpot remembers.
        room = n * neighbours_per_grain + 8 * chunk_capacity
        self.pair_start = ti.field(ti.i32, n)
        self.pair_end = ti.field(ti.i32, n)
        self.pair = ti.field(ti.i32, room)
        self.first = ti.field(ti.i32, room)
        self.touching = ti.field(ti.i32, room)
        self.slide = F(4, real, room)
        self.old_start = ti.field(ti.i32, n)
        self.old_end = ti.field(ti.i32, n)
        self.old_pair = ti.field(ti.i32, room)
        self.old_slide = F(4, real, room)
        if rolling:
            self.roll = F(3, real, room)
            self.old_roll = F(3, real, room)
        # Grains near bodies, likewise.
        near = 2 * n + 8 * chunk_capacity
        self.near_end = ti.field(ti.i32, chunk_capacity)
        self.near_grain = ti.field(ti.i32, near)
        self.near_body = ti.field(ti.i32, near)
        self.near_slide = F(4, real, near)
        self.near_roll = F(3, real, near)
        self.near_first = ti.field(ti.i32, n)
        self.old_near_end = ti.field(ti.i32, chunk_capacity)
        self.old_near_grain = ti.field(ti.i32, near)
        self.old_near_body = ti.field(ti.i32, near)
        self.old_near_slide = F(4, real, near)
        self.old_near_roll = F(3, real, near)
        # Who computes which chunk, each counter in a cache line of its own.
        self.cpu_items = threads * ITEMS_PER_THREAD
        self.ticket = ti.field(ti.i32, 2 * CACHE_LINE)
        self.claim = ti.field(ti.i32, chunk_capacity * CACHE_LINE if not gpu else 1)
        # Per chunk.
        self.overlap = ti.field(real, chunk_capacity)
        self.pushes = F(6, real, (chunk_capacity, MOST_BODIES))
        if gpu:  # sums over blocks of chunks, so that nothing of the bed's size is summed by one thread or read
            self.block_pushes = F(6, ti.f64, (TALLY_BLOCKS, MOST_BODIES))
            self.block_overlap = ti.field(ti.f64, TALLY_BLOCKS)
        # Bodies. The velocity is held by the host; the engine moves and turns the body.
        self.body_count = ti.field(ti.i32, ())
        self.body_position = F(3, real, MOST_BODIES)
        self.body_velocity = F(3, real, MOST_BODIES)
        self.body_spin = F(3, real, MOST_BODIES)
        self.body_turn = F(4, real, MOST_BODIES)  # unit quaternion, scalar first
        self.body_listed = F(3, real, MOST_BODIES)
        self.body_listed_turn = F(4, real, MOST_BODIES)
        self.body_extent = ti.field(real, MOST_BODIES)
        self.body_primitives = F(2, ti.i32, MOST_BODIES)
        self.body_pair = F(PAIR_WIDTH, real, MOST_BODIES)
        self.primitive_kind = ti.field(ti.i32, MOST_PRIMITIVES)
        self.primitive_row = F(ROW_WIDTH, real, MOST_PRIMITIVES)
        self.shapes = PLAIN  # the table of the shapes that need one; kernels are compiled anew for another
        self._kept = None
        self._meshes = []
        self.rest: Any = EVERYONE  # the table of those that sleep, likewise
        self._kept_rest: Rest | None = None
        self.held: Any = None  # what `dem.holding` copied last
        self.ledger: Any = NO_LEDGER  # the table of the book of dissipation, likewise
        self._kept_ledger: Ledger | None = None
        self.grain_pair = F(PAIR_WIDTH, real, ())
        # Step control: moved is written by move and read by push; halted is written by push and read by move.
        self.moved = ti.field(ti.i32, ())
        self.halted = ti.field(ti.i32, ())
        self.done = ti.field(ti.i32, ())
        self.problem = F(2, ti.i32, ())

    def set_up(
        self, *, grain_count: int, chunk_count: int, cells: tuple[int, int, int], box: tuple[float, ...]
    ) -> None:
        """Make it new for a bed: sizes set, lists and bodies empty."""
        self.grain_count = grain_count
        self.chunk_count = chunk_count
        self.nx, self.ny, self.nz = cells
        self.bottom = box[BOTTOM]
        self.chunk_room = self.pair.shape[0] // chunk_count
        self.near_room = self.near_grain.shape[0] // chunk_count
        # Fewer awake have smaller chunks, so that all threads have some.
        self.awake_per_chunk = max(1, round(AWAKE_SHARE * GRAINS_PER_CHUNK))
        sizes = (grain_count, chunk_count, self.chunk_room, self.near_room, *cells, math.prod(cells))
        self.count.from_numpy(np.array([*sizes, grain_count, chunk_count, grain_count, sizes[-1]], dtype=np.int32))
        for k, value in enumerate(box):
            self.box[k] = value
        self.write("rank", curve_ranks(*cells))
        bodies = (self.body_position, self.body_velocity, self.body_spin, self.body_turn, self.body_listed,
            self.body_listed_turn, self.body_extent, self.body_primitives, self.body_pair, self.primitive_kind,
            self.primitive_row)  # fmt: skip
        for field in (self.pair_start, self.pair_end, self.overlap, self.ticket, self.near_end, *bodies):
            field.fill(0)
        for counter in (self.body_count, self.moved, self.halted, self.done):
            counter[None] = 0
        self.problem[None] = [0, 0]
        self.clear_pushes()
        self.clear_shapes()
        self.held = None
        self.rest = EVERYONE
        self.ledger = NO_LEDGER

    def let_sleep(self) -> None:
        """From here on kernels know of sleep; all are awake still."""
        if self._kept_rest is None:
            self._kept_rest = Rest(
                grains=self.id.shape[0], cells=self.rank.shape[0], chunks=self.overlap.shape[0],
                rows=self.pair.shape[0], real=self.real,
            )  # fmt: skip
        self.rest = rest = self._kept_rest
        for field in (rest.asleep, rest.was, rest.woken, rest.leaves, rest.quiet, rest.start, rest.end):
            field.fill(0)
        for field in (rest.side, rest.mass, rest.news, rest.held, rest.begins, rest.block, rest.force):
            field.fill(0)
        rest.whole[None] = 1
        rest.last[None] = -1

    def wake_all(self) -> None:
        """All are awake, and the kernels are those that know of no sleep."""
        self.rest = EVERYONE
        self.count[AWAKE], self.count[CHUNKS] = self.grain_count, self.chunk_count
        self.count[SORTED], self.count[SORTED_CELLS] = self.grain_count, self.count[CELLS]

    def open_ledger(self, gravity: tuple[float, float, float]) -> None:
        """From here on kernels keep the book of what contacts take."""
        if self._kept_ledger is None:
            self._kept_ledger = Ledger(
                rows=self.pair.shape[0], near=self.near_grain.shape[0], chunks=self.overlap.shape[0], real=self.real
            )
        self.ledger = self._kept_ledger
        self.ledger.clear()
        self.ledger.pull[None] = gravity

    def close_ledger(self) -> None:
        """The kernels are those that keep no book."""
        self.ledger = NO_LEDGER

    def read(self, name: str) -> np.ndarray:
        """A field as a numpy array: the rows of the grains or chunks there are, or all of them."""
        array = getattr(self, name).to_numpy()
        if name in self.GRAIN_FIELDS:
            return array[: self.grain_count]
        if name in ("overlap", "pushes", "near_end"):
            return array[: self.chunk_count]
        return array

    def write(self, name: str, values: np.ndarray, rows: np.ndarray | None = None) -> None:
        """Put values into the first rows of a field, or into the rows given; the others become zero."""
        field = getattr(self, name)
        values = np.asarray(values)
        shape = (*field.shape, *values.shape[len(field.shape) :])
        array = np.zeros(shape, dtype=values.dtype)
        if rows is None:
            array[tuple(slice(count) for count in values.shape[: len(field.shape)])] = values
        else:
            array[rows] = values
        field.from_numpy(array)

    # ------------------------------------------------------------------ the step

    def launch(
        self, most: int, dt: float, limit: float, gravity: tuple[float, float, float], keep: float
    ) -> tuple[int, bool]:
        """Up to ``most`` steps, or a few where that is many: (steps done, whether new lists are needed)."""
        if self.gpu:
            self.done[None] = 0
            for _ in range(min(most, STEPS_PER_LAUNCH)):
                self.run_on_gpu(dt, limit, *gravity, keep, self.shapes, self.rest, self.ledger)
        else:
            self.run(dt, limit, *gravity, keep, min(most, STEPS_PER_LAUNCH), self.shapes, self.rest, self.ledger)
        return int(self.done[None]), bool(self.halted[None])

    @ti.func
    def move(self, c, dt, limit, gravity, keep):
        """Kick and drift the grains of a chunk; chunk 0 moves the bodies as well.

        ``keep`` is the share of its speed that drag leaves a grain in a step; 1 without drag.
        """
        start, end = self.chunk_range(c)
        far = 0
        for i in range(start, end):
            x = self.position[i]
            v = self.velocity[i]
            f = self.force[i]
            w = self.spin[i]
            t = self.torque[i]
            inverse = dt / v.w
            v.xyz = keep * v.xyz + f * inverse
            w.xyz = keep * w.xyz + t * (2.5 * inverse / (x.w * x.w))
            x.xyz += v.xyz * dt
            self.position[i] = x
            self.velocity[i] = v
            self.spin[i] = w
            self.force[i] = v.w * gravity
            self.torque[i] = ti.Vector.zero(self.real, 3)
            # Written so that a NaN counts as far.
            if not ((x.xyz - self.listed[i]).norm_sqr() <= limit * limit):
                far = 1
        if c == 0:
            for b in range(self.body_count[None]):
                self.body_position[b] = self.body_position[b] + (self.body_velocity[b] * dt)
                self.turn_body(b, dt)
                # The surface's farthest point moves with the origin and turns by at most this much.
                path = (self.body_position[b] - self.body_listed[b]).norm()
                path += 2.0 * (self.body_turn[b] - self.body_listed_turn[b]).norm() * self.body_extent[b]
                if not (path <= limit):
                    far = 1
        if far == 1:
            self.moved[None] = 1

    @ti.func
    def turn_body(self, b, dt):
        w = self.body_spin[b]
        if w.norm_sqr() > 0.0:
            q = self.body_turn[b]
            h = 0.5 * dt * w
            s = ti.Vector(
                [
                    q[0] - h.x * q[1] - h.y * q[2] - h.z * q[3],
                    q[1] + h.x * q[0] + h.y * q[3] - h.z * q[2],
                    q[2] - h.x * q[3] + h.y * q[0] + h.z * q[1],
                    q[3] + h.x * q[2] - h.y * q[1] + h.z * q[0],
                ]
            )
            self.body_turn[b] = s / s.norm()

    @ti.func
    def push(self, c, dt, shapes: ti.template(), rest: ti.template(), ledger: ti.template()):
        """Forces between the grains of a chunk and all that they touch."""
        start, end = self.chunk_range(c)
        # First find out which pairs touch, without a branch that a processor would have to guess; then their forces.
        base = c * self.count[CHUNK_ROOM]
        last = base
        rows = base
        if ti.static(rest.on):
            if end > start:
                rows = self.pair_end[end - 1]
        else:
            rows = self.pair_end[end - 1]
        for s in range(base, rows):
            code = self.pair[s]
            i = self.first[s]
            bits = ti.select(code < 0, ~code, code)
            x_i = self.position[i]
            x_j = self.position[bits & INDEX_MASK]
            sum_r = x_i.w + x_j.w
            d = self.apart(x_i, x_j, bits)
            if ti.static(self.cohesion == JKR):
                sum_r += adhesive_range(self.grain_pair[None], x_i.w * x_j.w / sum_r)
            touching = d.norm_sqr() < sum_r * sum_r
            self.touching[last] = s
            last += ti.select(touching, 1, 0)
            if touching != (code < 0):
                self.pair[s] = ~code
                if code < 0:
                    if ti.static(ledger.on):
                        self.book_pair(c, s, i, bits & INDEX_MASK, d, ledger.nothing(), dt, rest, ledger)
                    self.slide[s] = ti.Vector.zero(self.real, 4)
                    if ti.static(self.rolling):
                        self.roll[s] = ti.Vector.zero(self.real, 3)
        if ti.static(ledger.on):
            self.book_weight(c, dt, ledger)
        p = self.grain_pair[None]
        largest = ti.cast(0.0, self.real)
        held = ti.Vector.zero(self.real, 3)
        for k in range(base, last):
            s = self.touching[k]
            i = self.first[s]
            bits = ~self.pair[s]
            j = bits & INDEX_MASK
            x_i = self.position[i]
            x_j = self.position[j]
            v_i = self.velocity[i]
            v_j = self.velocity[j]
            w_i = self.spin[i]
            w_j = self.spin[j]
            d = self.apart(x_i, x_j, bits)
            length = d.norm()
            sum_r = x_i.w + x_j.w
            overlap = sum_r - length
            mass = v_i.w + v_j.w
            # One division for three reciprocals.
            inverse = 1.0 / (length * sum_r * mass)
            by_length = sum_r * mass * inverse
            n = d * by_length
            by_sum = length * mass * inverse
            radius = x_i.w * x_j.w * by_sum
            mass = v_i.w * v_j.w * (length * sum_r * inverse)
            arm_i = x_i.w - 0.5 * overlap
            arm_j = x_j.w - 0.5 * overlap
            # The slip as ``dem.contact`` says it: across the normal half a step ago, n - h v_t, with the arms of then.
            v = v_i.xyz - v_j.xyz
            v_n = v.dot(n)
            v_t = v - v_n * n
            h = 0.5 * dt * by_length
            back = 0.25 * dt * v_n
            turning = (arm_i - back) * w_i.xyz + (arm_j - back) * w_j.xyz
            v_t = (1.0 + h * v_n) * v_t - turning.cross(n)
            u = self.slide[s]
            f_n, damped, f_t, k_t, a, root, load = contact_force(
                p, n, v_n, v_t, overlap, radius, mass, dt, u, self.tensile, self.cohesion
            )
            self.slide[s] = u
            f = f_n * n + f_t
            t = f_t.cross(n)
            turn = ti.Vector.zero(self.real, 3)
            if ti.static(self.rolling):
                q = self.roll[s]
                turn = turning_torque(p, n, w_i.xyz - w_j.xyz, load, k_t, a, radius, root, dt, q)
                self.roll[s] = q
            self.force[i] = self.force[i] + f
            self.torque[i] = self.torque[i] + (arm_i * t + turn)
            if ti.static(not self.gpu):
                if j >= start and j < end:
                    self.force[j] = self.force[j] - f
                    self.torque[j] = self.torque[j] + (arm_j * t - turn)
            if ti.static(rest.on):
                if j >= self.count[AWAKE]:
                    held -= f
            if ti.static(ledger.on):
                self.book_pair(c, s, i, j, d, ledger.parts(damped, f_t, turn), dt, rest, ledger)
                self.book_turning(c, bits, f, f_t, turn, n, arm_j, dt, rest, ledger)
            largest = ti.max(largest, overlap * by_sum)
        for s in range(c * self.count[NEAR_ROOM], self.near_end[c]):
            largest = ti.max(largest, self.push_near(c, s, dt, shapes, ledger))
        self.overlap[c] = ti.max(self.overlap[c], largest)
        if ti.static(rest.on):
            rest.held[c] = rest.held[c] + held

    @ti.func
    def apart(self, x_i, x_j, bits):
        """From the neighbour, or its image that the upper bits mean, to the grain."""
        d = x_i.xyz - x_j.xyz
        image = bits >> INDEX_BITS
        if image != SAME_IMAGE:
            d.x += ti.cast(image % 3 - 1, self.real) * self.box[PERIOD_X]
            d.y += ti.cast(image // 3 - 1, self.real) * self.box[PERIOD_Y]
        return d

    @ti.func
    def push_near(self, c, s, dt, shapes: ti.template(), ledger: ti.template()):
        """Force between a grain and a body; returns overlap over diameter."""
        i = self.near_grain[s]
        b = self.near_body[s]
        x = self.position[i]
        reach = x.w
        if ti.static(shapes.full):
            reach += self.body_range(b, x.w, 0.0)
        distance, n, curvature, arm = self.nearest(b, x.xyz, reach, shapes, False)
        overlap = x.w - distance
        result = ti.cast(0.0, self.real)
        if overlap > -self.body_range(b, x.w, curvature):
            arm_i = x.w - overlap
            v_n, v_t, spin, parting = self.near_rates(i, b, n, curvature, arm, arm_i, dt)
            radius = x.w / (1.0 + x.w * curvature)
            p = self.body_pair[b]
            u = self.near_slide[s]
            f_n, damped, f_t, k_t, a, root, load = contact_force(
                p, n, v_n, v_t, overlap, radius, self.velocity[i].w, dt, u, self.tensile, self.cohesion
            )
            self.near_slide[s] = u
            f = f_n * n + f_t
            t = arm_i * f_t.cross(n)
            t_body = -arm.cross(f)
            turn = ti.Vector.zero(self.real, 3)
            if ti.static(self.rolling):
                q = self.near_roll[s]
                turn = turning_torque(p, n, spin, load, k_t, a, radius, root, dt, q)
                self.near_roll[s] = q
                t += turn
                t_body -= turn
            self.force[i] = self.force[i] + (f)
            self.torque[i] = self.torque[i] + (t)
            for k in ti.static(range(3)):
                self.pushes[c, b][k] = self.pushes[c, b][k] - f[k]
                self.pushes[c, b][k + 3] = self.pushes[c, b][k + 3] + t_body[k]
            result = overlap / (2.0 * x.w)
            if ti.static(ledger.on):
                now = ledger.parts(damped, f_t, turn)
                ledger.add(c, ledger.took(ledger.near_last[s], now, parting, v_t, spin, dt))
                ledger.near_last[s] = now
                self.book_body(c, i, b, f, t_body, n, arm, arm_i, dt, ledger)
        else:
            if ti.static(ledger.on):
                before = ledger.near_last[s]
                if before.norm_sqr() > 0.0:
                    v_n, v_t, spin, parting = self.near_rates(i, b, n, curvature, arm, x.w - overlap, dt)
                    ledger.add(c, ledger.took(before, ledger.nothing(), parting, v_t, spin, dt))
                    ledger.near_last[s] = ledger.nothing()
            self.near_slide[s] = ti.Vector.zero(self.real, 4)
            self.near_roll[s] = ti.Vector.zero(self.real, 3)
        return result

    @ti.func
    def near_rates(self, i, b, n, curvature, arm, arm_i, dt):
        """How fast a grain parts from a body, slides on it and turns, and the first across the middle normal.

        As the body sees the grain; then half a step ago, where the velocities are: the normal, and the arms.
        """
        w_i = self.spin[i].xyz
        body_spin = self.body_spin[b]
        path = self.velocity[i].xyz - self.body_velocity[b]
        v = path - body_spin.cross(arm + arm_i * n)
        v_n = v.dot(n)
        turning = body_spin.cross(n) + (curvature / (1.0 + curvature * arm_i)) * (v - v_n * n)
        middle = n - 0.5 * dt * turning
        v += 0.5 * dt * body_spin.cross(path)
        v -= (arm_i - 0.5 * dt * v_n) * (w_i - body_spin).cross(middle)
        v_t = v - v.dot(n) * middle
        return v_n, v_t, w_i - body_spin, v.dot(middle)

    @ti.kernel
    def run(
        self,
        dt: float,
        limit: float,
        gx: float,
        gy: float,
        gz: float,
        keep: float,
        steps: int,
        shapes: ti.template(),
        rest: ti.template(),
        ledger: ti.template(),
    ):
        """Up to ``steps`` steps on a CPU; stops by itself where new lists are needed.

        Then halted is 1, done says how many steps are whole, and the forces of the next one are still to come.

        One parallel loop for all the steps, because waking threads costs more than a small bed's step. Phase p moves
        (even p) or pushes (odd p) every chunk, and opens when all chunks of the one before are finished. A thread takes
        those of its own range first, so that a chunk mostly stays in one core's cache, then those that are left.
        Whoever raises a chunk's claim past p has it, so nobody waits for a thread that has not started.
        """
        for c in range(self.count[CHUNKS]):
            self.claim[c * CACHE_LINE] = 0
        for _ in range(1):
            self.ticket[FINISHED] = 0
            self.done[None] = steps
        for w in range(self.cpu_items):
            if w % ITEMS_PER_THREAD == 0:
                chunks = self.count[CHUNKS]
                own = w // ITEMS_PER_THREAD * chunks // (self.cpu_items // ITEMS_PER_THREAD)
                patience = PATIENCE * (1 + self.count[GRAINS] // chunks)
                phase = 0
                while phase < 2 * steps:
                    # In this order: who comes late to a phase that is over must not take the next move's word for it.
                    far = ti.atomic_add(self.moved[None], 0)
                    now = ti.atomic_add(self.ticket[FINISHED], 0) // chunks
                    if now > phase:
                        phase = now
                    elif phase % 2 == 1 and far == 1:
                        self.halted[None] = 1
                        self.done[None] = phase // 2
                        phase = 2 * steps
                    else:
                        for k in range(chunks):
                            c = ti.select(own + k < chunks, own + k, own + k - chunks)
                            if self.claim[c * CACHE_LINE] <= phase:
                                if ti.atomic_max(self.claim[c * CACHE_LINE], phase + 1) <= phase:
                                    if phase % 2 == 0:
                                        self.move(c, dt, limit, ti.Vector([gx, gy, gz]), keep)
                                    else:
                                        self.push(c, dt, shapes, rest, ledger)
                                    ti.atomic_add(self.ticket[FINISHED], 1)
                        phase += 1
                        # Leave when it takes long (another program has the core of whom we wait for): the rest is done
                        # by those who stay.
                        looks = 0
                        while ti.atomic_add(self.ticket[FINISHED], 0) < phase * chunks and looks < patience:
                            looks += 1
                        if looks == patience:
                            phase = 2 * steps

    @ti.kernel
    def run_on_gpu(
        self,
        dt: float,
        limit: float,
        gx: float,
        gy: float,
        gz: float,
        keep: float,
        shapes: ti.template(),
        rest: ti.template(),
        ledger: ti.template(),
    ):
        """One step on a GPU, where every grain is a chunk; nothing where new lists are needed, as in ``run``."""
        for c in range(self.count[CHUNKS]):
            if self.halted[None] == 0:
                self.move(c, dt, limit, ti.Vector([gx, gy, gz]), keep)
        for c in range(self.count[CHUNKS]):
            if self.moved[None] == 0:
                self.push(c, dt, shapes, rest, ledger)
                if c == 0:
                    self.done[None] = self.done[None] + 1
            elif c == 0:
                self.halted[None] = 1

    @ti.kernel
    def push_all(self, dt: float, shapes: ti.template(), rest: ti.template(), ledger: ti.template()):
        """The forces of the step that was interrupted by new lists."""
        for _ in range(1):
            self.ticket[QUEUE] = 0
        for w in range(self.cpu_items if ti.static(not self.gpu) else self.count[CHUNKS]):
            c = self.next_chunk(w, True)
            while c < self.count[CHUNKS]:
                self.push(c, dt, shapes, rest, ledger)
                c = self.next_chunk(w, False)

    # ------------------------------------------------------------------ what the host reads

    @ti.kernel
    def clear_pushes(self):
        for c, b in ti.ndrange(self.count[ALL_CHUNKS], MOST_BODIES):
            self.pushes[c, b] = ti.Vector.zero(self.real, 6)

    @ti.kernel
    def place_bodies(
        self, bodies: ti.types.ndarray(dtype=ti.i32, ndim=1), rows: ti.types.ndarray(dtype=ti.f64, ndim=2)
    ):
        """Pose and motion of several bodies: position, velocity, turn, spin in a row of 13."""
        for _ in range(1):
            for k in range(bodies.shape[0]):
                b = bodies[k]
                for d in ti.static(range(3)):
                    self.body_position[b][d] = ti.cast(rows[k, d], self.real)
                    self.body_velocity[b][d] = ti.cast(rows[k, 3 + d], self.real)
                    self.body_spin[b][d] = ti.cast(rows[k, 10 + d], self.real)
                for d in ti.static(range(4)):
                    self.body_turn[b][d] = ti.cast(rows[k, 6 + d], self.real)

    @ti.kernel
    def tally(self, rows: ti.types.ndarray(dtype=ti.f64, ndim=2)):
        """Sums over the chunks, in their order: of what grains do to each body; and the largest overlap, or NaN.

        A row of six for each body, and one more whose first number is the overlap. On a GPU, where a chunk is a grain,
        over blocks of chunks first: what the host gets is as small as from a CPU.
        """
        if ti.static(self.gpu):
            for block, b in ti.ndrange(TALLY_BLOCKS, MOST_BODIES + 1):
                size = (self.count[ALL_CHUNKS] + TALLY_BLOCKS - 1) // TALLY_BLOCKS
                first = block * size
                end = ti.min(first + size, self.count[ALL_CHUNKS])
                if b == MOST_BODIES:
                    self.block_overlap[block] = self.largest_overlap(self.overlap, first, end)
                elif b < self.body_count[None]:
                    self.block_pushes[block, b] = self.sum_of_pushes(self.pushes, b, first, end)
                else:
                    self.block_pushes[block, b] = ti.Vector.zero(ti.f64, 6)
            for b in range(MOST_BODIES + 1):
                self.put_tally(rows, b, self.block_pushes, self.block_overlap, TALLY_BLOCKS)
        else:
            for b in range(MOST_BODIES + 1):
                self.put_tally(rows, b, self.pushes, self.overlap, self.count[ALL_CHUNKS])

    @ti.func
    def put_tally(self, rows: ti.template(), b, pushes: ti.template(), overlaps: ti.template(), parts):
        if b < MOST_BODIES:
            total = self.sum_of_pushes(pushes, b, 0, parts)
            for k in ti.static(range(6)):
                rows[b, k] = total[k]
        else:
            rows[b, 0] = self.largest_overlap(overlaps, 0, parts)

    @ti.func
    def sum_of_pushes(self, pushes: ti.template(), b, first, end):
        total = ti.Vector.zero(ti.f64, 6)
        for c in range(first, end):
            total += ti.cast(pushes[c, b], ti.f64)
        return total

    @ti.func
    def largest_overlap(self, overlaps: ti.template(), first, end):
        largest = ti.cast(0.0, ti.f64)
        for c in range(first, end):
            overlap = ti.cast(overlaps[c], ti.f64)
            if not (overlap <= largest) and largest == largest:
                largest = overlap
        return largest

    @ti.kernel
    def mark_origin(self):
        """Count displacements from here."""
        for i in range(self.count[GRAINS]):
            self.origin[i] = self.position[i].xyz

    @ti.kernel
    def shift_velocities(self, time: float):
        """Kick all grains by the present forces for a time of either sign."""
        for i in range(self.count[GRAINS]):
            r = self.position[i].w
            share = ti.cast(time, self.real) / self.velocity[i].w
            for k in ti.static(range(3)):
                self.velocity[i][k] = self.velocity[i][k] + self.force[i][k] * share
                self.spin[i][k] = self.spin[i][k] + self.torque[i][k] * (2.5 * share / (r * r))

    @ti.kernel
    def count_contacts(self, counts: ti.types.ndarray(dtype=ti.i32, ndim=1), shapes: ti.template()):
        """Contacts of each grain, by id."""
        for i in range(self.count[GRAINS]):
            counts[self.id[i]] = 0
        for i in range(self.count[GRAINS]):
            c = self.chunk_of(i)
            start, end = self.chunk_range(c)
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                if code < 0:
                    j = (~code) & INDEX_MASK
                    ti.atomic_add(counts[self.id[i]], 1)
                    if j >= start and j < end:
                        ti.atomic_add(counts[self.id[j]], 1)
        for c in range(self.count[CHUNKS]):
            for s in range(c * self.count[NEAR_ROOM], self.near_end[c]):
                i = self.near_grain[s]
                r = self.position[i].w
                reach = r
                if ti.static(shapes.full):
                    reach += self.body_range(self.near_body[s], r, 0.0)
                distance, n, curvature, arm = self.nearest(
                    self.near_body[s], self.position[i].xyz, reach, shapes, False
                )
                if distance < r + self.body_range(self.near_body[s], r, curvature):
                    ti.atomic_add(counts[self.id[i]], 1)
