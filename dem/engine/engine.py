"""The fields and the time step: everything that runs once a step.

Layout (measured reasons in docs/performance.md):

* Grains lie in memory in the order of a space-filling curve through the cells, so that neighbours are near.
* They are cut into a fixed number of contiguous chunks, whatever the number of threads. A pair inside a chunk is
  computed once, by the chunk's own serial loop, and added to both. A pair across chunks is computed by both sides. So
  no two threads write to one grain, and every sum has one order: results are bitwise equal on any number of threads. On
  a GPU every grain has a thread and a full list of its own (``dem.gpu``).
* A step has two phases. ``move`` kicks and drifts (leapfrog: velocities live half a step behind positions); ``push``
  computes forces. Moving also finds out whether a grain has come further than half the skin. If so the launch ends
  there, and the host makes new lists and continues. On a CPU all steps of a launch are one parallel loop (``run``).
* Sums into a field are written as x = x + y, because Taichi's x += y is an atomic operation.

An engine is compiled for a capacity, not for a number of grains, and is used again by the next bed that fits:
``take_engine`` keeps those that no bed holds any more. Lists begin with the rows that a settled bed needs. Where more
are needed the bed continues in an engine with longer lists (``Engine.with_room``); the results are bitwise equal.
"""

import math
import weakref
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from dem.contact.law import PAIR_WIDTH
from dem.gpu.lists import GpuLists
from dem.gpu.steps import GpuSteps
from dem.grains.packing import curve_ranks
from dem.shapes.basic import ROW_WIDTH
from hedgebed_taichi import ti

from . import runtime
from .dissipation import Balance, BalanceKernels
from .lists import ABSENT, CACHE_LINE, ITEMS_PER_THREAD, MOST_BODIES, SCAN_BLOCKS, Lists
from .pairs import Pairs
from .readings import Readings
from .rows import FieldStore, Zeroes, chunk_starts, copy_fields, put_rows, row_numbers, twins_of
from .shape_table import PLAIN, Shapes
from .sleep_kernels import Rest, Sleepers
from .steps import Steps

__all__ = ["Engine", "MOST_BODIES", "MOST_PRIMITIVES", "STEPS_PER_LAUNCH", "take_engine"]

# A launch is a good part of a tenth of a second: short enough for a thread that left to come back soon and for Ctrl-C,
# and long enough for threads that seldom wait. A virtual machine whose processors are idle for a moment a hundred times
# a second may be given two halves of one core instead of two cores (docs/performance.md).
STEPS_PER_LAUNCH, MOST_STEPS_PER_LAUNCH = 20, 200
GRAIN_STEPS_PER_LAUNCH = 3_000_000
GRAINS_PER_CHUNK = 1250
MOST_CHUNKS = 64
AWAKE_SHARE = 0.64
MOST_PRIMITIVES = 64
LARGE = 1 << 18

# Lists that have to grow get more than they need now, by this factor: what grows once may grow on.
_SPARE = 1.25
_MOST_ROWS = 2**31 - 1  # rows are counted with 32 bits

_free: dict[tuple, list] = {}
_grown: dict["Build", "Build"] = {}  # builds whose lists were too small for a bed, and what such a bed went on with


@dataclass(frozen=True, kw_only=True)
class Build:
    """What an engine is compiled for.

    Attributes:
        capacity: most grains that fit, at most 2^26. cell_capacity, chunk_capacity: likewise.
        neighbours_per_grain: rows of the pair lists for each. near_per_grain: of the lists of grains near bodies.
        rolling: whether contacts carry a rolling spring. tensile: whether a contact's damping may pull at its end.
        rescaled: whether a contact's springs are (``dem.contact.law``).
        cohesion: a law of ``dem.contact.cohesion.COHESIONS``. real: ti.f64 or ti.f32.
        gpu: one grain a chunk. threads: of the CPU.
    """

    capacity: int
    cell_capacity: int
    chunk_capacity: int
    neighbours_per_grain: float = 16.0
    near_per_grain: float = 2.0
    rolling: bool
    tensile: bool
    rescaled: bool
    cohesion: int
    real: Any
    gpu: bool
    threads: int

    @property
    def spare(self) -> int:
        """Rows that lists have beside those of the grains."""
        return 4096 if self.gpu else 8 * self.chunk_capacity

    @property
    def rows(self) -> tuple[int, int]:
        """Rows of the pair lists, and of the lists of grains near bodies."""
        pairs, near = (int(self.capacity * share) for share in (self.neighbours_per_grain, self.near_per_grain))
        return pairs + self.spare, near + self.spare


def take_engine(
    owner: Any,
    *,
    grain_count: int,
    period: tuple[float, float],
    bottom: float,
    height: float,
    largest_diameter: float,
    largest_skin: float,
    chunk_count: int | None = None,
    **build: Any,
) -> "Engine":
    """An engine set up for ``owner``: one that an earlier owner has left, where there is one of the same build.

    Args:
        grain_count: number of grains. period: lateral period (x, y) [m].
        bottom, height: z of the box's bottom and top [m].
        largest_diameter: of the grains [m]. largest_skin: of the lists [m].
        chunk_count: chosen when None. build: the attributes of ``Build``, but for its capacities.

    Raises ValueError: a bed less than three grains wide, or with more grains than there is memory for.
    """
    cell = largest_diameter + largest_skin
    nx, ny = (max(1, int(length / cell)) for length in period)
    cells = (nx, ny, max(1, int((height - bottom) / cell) + 1))
    if min(nx, ny) < 3:
        # With fewer the same neighbour would be met through two images.
        raise ValueError(
            f"the bed is {min(period):g} m across, less than three grains of {largest_diameter:g} m; "
            f"make it at least {3 * cell:.3g} m wide"
        )
    gpu = bool(build["gpu"])
    if chunk_count is None:
        chunk_count = grain_count if gpu else max(1, min(MOST_CHUNKS, round(grain_count / GRAINS_PER_CHUNK)))
    build |= capacities(grain_count, math.prod(cells), chunk_count, gpu=gpu)
    shape = Build(**build)
    while shape in _grown:
        shape = _grown[shape]
    try:
        engine = _engine(shape, owner)
    except MemoryError as problem:
        raise ValueError(f"a bed of {grain_count} grains {problem}; take fewer grains, or larger ones") from None
    box = (*period, bottom, height, period[0] / nx, period[1] / ny, cell)
    engine.set_up(grain_count=grain_count, chunk_count=chunk_count, cells=cells, box=box)
    return engine


def _engine(shape: Build, owner: Any) -> "Engine":
    """An engine of this build for ``owner``, who gives it back in the end. Raises MemoryError."""
    key = (runtime.generation(), shape)
    for old in [k for k in _free if k[0] != key[0]]:
        del _free[old]
    idle = _free.setdefault(key, [])
    engine: Engine = idle.pop() if idle else (GpuEngine if shape.gpu else Engine)(shape)
    engine.owner = weakref.finalize(owner, idle.append, engine)
    engine.owner.atexit = False
    return engine


def capacities(grain_count: int, cell_count: int, chunk_count: int, *, gpu: bool) -> dict[str, int]:
    """How many grains, cells and chunks an engine is compiled for that has to hold these; a GPU's has no chunks."""
    return {
        "capacity": _roomy(grain_count, least=64),
        "cell_capacity": _roomy(cell_count, least=1024),
        "chunk_capacity": 1 if gpu else _roomy(chunk_count, least=MOST_CHUNKS),
    }


def _roomy(count: int, *, least: int) -> int:
    """The next of 1 and 1.5 times a power of two: few shapes to compile, and little memory wasted.

    Large beds take at most a sixteenth of a power of two more, because memory limits them.
    """
    power = least
    while power < count:
        if power * 3 // 2 >= count:
            power = power * 3 // 2
            break
        power *= 2
    if power <= LARGE:
        return power
    part = 1 << (count.bit_length() - 5)
    return -(-count // part) * part


@ti.data_oriented
class Engine(Lists, Pairs, Steps, Readings, Shapes, Sleepers, BalanceKernels):
    """Grains, lists and bodies in Taichi fields, and the kernels that advance them."""

    # Fields of the state: with a row for each grain, and of the bodies and their shapes.
    GRAIN_FIELDS = ("position", "velocity", "spin", "force", "torque", "origin", "listed", "id")
    BODY_FIELDS = (
        *(f"body_{name}" for name in ("position", "velocity", "spin", "turn", "listed", "listed_turn", "extent")),
        *("body_primitives", "body_pair", "primitive_kind", "primitive_row"),
    )
    # What is in no field.
    _OWN = ("grain_count", "chunk_count", "nx", "ny", "nz", "bottom", "awake_per_chunk", "shapes", "_kept", "_meshes")
    # Zero where nothing is listed.
    EMPTY: tuple[str, ...] = ("pair_start", "pair_end", "overlap", "near_end")
    BY_CHUNK: tuple[str, ...] = ("overlap", "pushes", "near_end")

    def __init__(self, build: Build):
        self.build = build
        self.owner: Any = None  # the bed's end, which gives the engine back
        self.real = build.real
        self.rolling, self.tensile, self.cohesion, self.gpu = build.rolling, build.tensile, build.cohesion, build.gpu
        self.rescaled = build.rescaled
        self.cpu_items = build.threads * ITEMS_PER_THREAD
        self.block_stride = build.threads
        self.store = FieldStore(planned=True)  # fields that are made cannot be left unused: count their memory first
        self._make_fields(build)
        runtime.refuse_memory(self.store.bytes)
        self.store = FieldStore()
        self._make_fields(build)
        self.store.lay_out()
        self.shapes = PLAIN  # the table of the shapes that need one; kernels are compiled anew for another
        self._kept = None
        self._meshes = []
        self.rest: Any = ABSENT  # the table of those that sleep, likewise
        self.held: Any = None  # the last checkpoint
        self.balance: Any = ABSENT  # the table of the energy balance, likewise
        counters = (self.body_count, self.moved, self.halted, self.done, self.problem)
        empty = (getattr(self, name) for name in ("ticket", *self.EMPTY, *self.BODY_FIELDS))
        self._zeroes = Zeroes(*empty, *counters)

    def _make_fields(self, build: Build) -> None:
        capacity, chunk_capacity = build.capacity, build.chunk_capacity
        self.count = self.store.scalar(ti.i32, self.NUMBERS)
        self.box = self.store.scalar(build.real, 7)
        self._make_grain_fields(capacity)
        self._make_sort_fields(capacity, build.cell_capacity)
        self._make_list_fields(capacity, chunk_capacity, *build.rows)
        self._make_sums(chunk_capacity)
        self._make_body_fields()
        # Who computes which chunk, each counter in a cache line of its own.
        self.ticket = self.store.scalar(ti.i32, 2 * CACHE_LINE)
        self.claim = self.store.scalar(ti.i32, chunk_capacity * CACHE_LINE)
        # Step control: moved is written by move and read by push; halted is written by push and read by move.
        self.moved, self.halted, self.done = (self.store.scalar(ti.i32, ()) for _ in range(3))
        self.problem = self.store.scalar(ti.i32, 3)

    def _make_grain_fields(self, n: int) -> None:
        """A row for each grain."""
        F, real = self.store.vector, self.real
        # position: x y z radius; velocity: x y z mass (half a step behind); spin: x y z and nothing.
        self.position, self.velocity, self.spin = (F(4, real, n) for _ in range(3))
        self.force, self.torque, self.origin, self.listed = (F(3, real, n) for _ in range(4))
        self.id = self.store.scalar(ti.i32, n)

    def _make_sort_fields(self, n: int, cell_capacity: int) -> None:
        """Fields for sorting."""
        self.buffer_id, self.came_from, self.key = (self.store.scalar(ti.i32, n) for _ in range(3))
        self.rank = self.store.scalar(ti.i32, cell_capacity)
        self.cell_start = self.store.scalar(ti.i32, 3 * cell_capacity + 1)
        self.cell_fill = self.store.scalar(ti.i32, 3 * cell_capacity)
        self.block_sum = self.store.scalar(ti.i32, SCAN_BLOCKS)

    def _make_list_fields(self, n: int, chunk_capacity: int, rows: int, near: int) -> None:
        """Pair lists and lists of grains near bodies.

        Chunk c owns the rows from c times its capacity. The rows of a grain lie together. ``first`` is the grain a row
        belongs to, ``pair`` its neighbour's code, ``touching`` the rows in contact in this step. ``slide`` is the
        contact's history: x y z of the tangential spring, and the state of the normal dashpot.
        """
        F, real = self.store.vector, self.real
        self.pair_start, self.pair_end, self.old_start, self.old_end = (self.store.scalar(ti.i32, n) for _ in range(4))
        self.pair, self.first, self.touching, self.old_pair = (self.store.scalar(ti.i32, rows) for _ in range(4))
        self.slide, self.old_slide = F(4, real, max(rows, 4 * n)), F(4, real, rows)  # ``sort`` has four rows a grain
        if self.rolling:
            self.roll, self.old_roll = F(3, real, rows), F(3, real, rows)
        self.near_end, self.old_near_end = (self.store.scalar(ti.i32, chunk_capacity) for _ in range(2))
        self.near_grain, self.near_body, self.old_near_grain, self.old_near_body = (
            self.store.scalar(ti.i32, near) for _ in range(4)
        )
        self.near_slide, self.old_near_slide = F(4, real, near), F(4, real, near)
        self.near_roll, self.old_near_roll = F(3, real, near), F(3, real, near)
        self.near_first, self.old_near_room = self.store.scalar(ti.i32, n), self.store.scalar(ti.i32, ())

    def _make_sums(self, chunk_capacity: int) -> None:
        """What chunks add up: the largest overlap, the forces on bodies."""
        self.overlap = self.store.scalar(self.real, chunk_capacity)
        self.pushes = self.store.vector(6, self.real, (chunk_capacity, MOST_BODIES))

    def _make_body_fields(self) -> None:
        """Bodies, whose velocities the host sets, and their shapes."""
        F, real = self.store.vector, self.real
        self.body_count = self.store.scalar(ti.i32, ())
        self.body_position, self.body_velocity, self.body_spin, self.body_listed = (
            F(3, real, MOST_BODIES) for _ in range(4)
        )
        self.body_turn, self.body_listed_turn = (F(4, real, MOST_BODIES) for _ in range(2))  # quaternions, scalar first
        self.body_extent = self.store.scalar(real, MOST_BODIES)
        self.body_primitives = F(2, ti.i32, MOST_BODIES)
        self.body_pair = F(PAIR_WIDTH, real, MOST_BODIES)
        self.primitive_kind = self.store.scalar(ti.i32, MOST_PRIMITIVES)
        self.primitive_row = F(ROW_WIDTH, real, MOST_PRIMITIVES)
        self.grain_pair = F(PAIR_WIDTH, real, ())

    def set_up(
        self, *, grain_count: int, chunk_count: int, cells: tuple[int, int, int], box: tuple[float, ...]
    ) -> None:
        """Make it new for a bed: sizes set, lists and bodies empty."""
        self.grain_count = grain_count
        self.chunk_count = chunk_count
        self.nx, self.ny, self.nz = cells
        self.bottom = box[self.BOTTOM]
        # Fewer awake have smaller chunks, so that all threads have some.
        self.awake_per_chunk = max(1, round(AWAKE_SHARE * GRAINS_PER_CHUNK))
        sizes = (grain_count, chunk_count, *self._most_rooms(), *cells, math.prod(cells))
        sizes += (grain_count, chunk_count, grain_count, sizes[-1], grain_count, chunk_count)
        self.count.from_numpy(np.array(sizes, dtype=np.int32))
        for k, value in enumerate(box):
            self.box[k] = value
        self.write("rank", curve_ranks(*cells))
        self._zeroes.put()
        self.clear_pushes()
        self.clear_shapes()
        self.held = None
        self.rest = ABSENT
        self.balance = ABSENT

    @property
    def chunk_room(self) -> int:
        """Rows of the pair lists that a chunk has."""
        return int(self.count[self.CHUNK_ROOM])

    @property
    def near_room(self) -> int:
        """Rows of the list of grains near bodies that a chunk has."""
        return int(self.count[self.NEAR_ROOM])

    def _most_rooms(self) -> tuple[int, int]:
        """The most rows that a chunk can have, of both lists."""
        return self.pair.shape[0] // self._shares, self.near_grain.shape[0] // self._shares

    @property
    def _shares(self) -> int:
        """Number of parts that the rows of lists are divided into; one on a GPU, where rows are packed."""
        return 1 if self.gpu else self.chunk_count

    def with_room(self, owner: Any, pairs: int, near: int) -> "Engine":
        """An engine in the same state whose lists hold so many rows a chunk: this one, or a new one.

        After a new one this engine is empty and its memory free. Lists put aside stay valid; the caller makes new ones.
        Raises MemoryError: such lists do not fit.
        """
        rooms = self._most_rooms()
        if pairs <= rooms[0] and near <= rooms[1]:
            self.count[self.CHUNK_ROOM], self.count[self.NEAR_ROOM] = rooms
            return self
        shares = (self.build.neighbours_per_grain, self.build.near_per_grain)
        pair_share, near_share = (
            share if need <= room else self._share_for(need)
            for share, need, room in zip(shares, (pairs, near), rooms, strict=True)
        )
        larger = replace(self.build, neighbours_per_grain=pair_share, near_per_grain=near_share)
        if max(larger.rows) > _MOST_ROWS:
            raise MemoryError(f"needs {max(larger.rows)} rows of lists, of {_MOST_ROWS} that can be counted")
        new = _engine(larger, owner)
        for name in self._OWN:
            setattr(new, name, getattr(self, name))
        tables: list[tuple[Any, Any]] = [(self, new)]
        new.rest, new.balance = (ABSENT, ABSENT)
        if self.rest.on:
            new.rest = new._own_rest
            tables.append((self.rest, new.rest))
        if self.balance.on:
            new.balance = new._own_balance
            tables.append((self.balance, new.balance))
        for old_table, table in tables:
            copy_fields(vars(old_table), vars(table))
            if "twins" in vars(old_table):
                copy_fields(old_table.twins, twins_of(table))
        new.held = self.held
        if new.held is not None:
            new.held.tables = tuple(dict(tables).get(table, table) for table in new.held.tables)
        new.count[self.CHUNK_ROOM], new.count[self.NEAR_ROOM] = new._most_rooms()
        _grown[self.build] = larger
        self.owner.detach()
        self.store.free()
        return new

    def _share_for(self, room: int) -> float:
        """Rows for each grain, so that a chunk holds so many rows and some more."""
        needed = (_SPARE * room + 1) * self._shares - self.build.spare
        return math.ceil(4 * needed / self.build.capacity) / 4

    # What the host reads and writes of lists, in the order of grains, or of chunks near bodies.

    def listed_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs listed for each grain, and their rows."""
        start, end = self.read("pair_start"), self.read("pair_end")
        return end - start, row_numbers(start, end - start)

    def lay_pairs(self, counts: np.ndarray, *layout: int) -> np.ndarray:
        """Reserve rows for so many pairs of each grain, in the chunks of ``rows.chunk_starts``; return the rows."""
        chunk = chunk_starts(*layout)
        awake, chunks = chunk[-1], len(chunk) - 1
        before = np.concatenate(([0], np.cumsum(counts)))
        which = np.repeat(np.arange(chunks), np.diff(chunk))
        start = np.zeros(self.grain_count, dtype=np.int32)
        start[:awake] = before[:awake] - before[chunk[which]] + which * self.chunk_room
        self.write("pair_start", start)
        self.write("pair_end", start + counts)
        rows = row_numbers(start, counts)
        self.write("first", np.repeat(np.arange(self.grain_count), counts), rows)
        return rows

    def rooms_for(self, pairs: np.ndarray, near: np.ndarray, *layout: int) -> tuple[int, int]:
        """Rows a chunk that so many pairs of each grain, and these grains near bodies, need; for ``with_room``."""
        starts = np.array([0, self.grain_count]) if self.gpu else chunk_starts(*layout)
        counts = (pairs, np.bincount(near, minlength=self.grain_count))
        most = [int(np.diff(np.concatenate(([0], np.cumsum(each)))[starts]).max()) for each in counts]
        return most[0], most[1]

    def lay_history(self, counts: np.ndarray) -> np.ndarray:
        """Reserve rows for so many pairs of each grain, in sequence, which ``make_lists`` reads as the history."""
        start = np.cumsum(counts) - counts
        self.write("pair_start", start)
        self.write("pair_end", start + counts)
        return row_numbers(start, counts)

    def listed_near(self) -> tuple[np.ndarray, np.ndarray]:
        """Grains near bodies in each chunk, and their rows."""
        start = np.arange(self.chunk_count) * self.near_room
        counts = self.read("near_end") - start
        return counts, row_numbers(start, counts)

    def lay_near(self, grains: np.ndarray, *layout: int) -> np.ndarray:
        """Reserve rows for these grains near bodies, in the order of memory, in the same chunks; return the rows."""
        chunk = np.searchsorted(chunk_starts(*layout), grains, side="right") - 1
        counts = np.bincount(chunk, minlength=self.chunk_count)
        start = np.arange(self.chunk_count) * self.near_room
        self.write("near_end", (start + counts).astype(np.int32))
        return row_numbers(start, counts)

    def let_sleep(self) -> None:
        """From here on kernels know of sleep; all are awake still."""
        self.rest = self._own_rest
        self.rest.clear()

    @cached_property
    def _own_rest(self) -> Rest:
        rows, chunks = self.pair.shape[0], self.overlap.shape[0]
        return Rest(grains=self.id.shape[0], cells=self.rank.shape[0], chunks=chunks, rows=rows, real=self.real)

    def wake_all(self) -> None:
        """All are awake, and the kernels are those that know of no sleep."""
        self.rest = ABSENT
        self.count[self.AWAKE], self.count[self.CHUNKS] = self.grain_count, self.chunk_count
        self.count[self.FAST], self.count[self.FAST_CHUNKS] = self.grain_count, self.chunk_count
        self.count[self.SORTED], self.count[self.SORTED_CELLS] = self.grain_count, self.count[self.CELLS]

    def open_balance(self, gravity: tuple[float, float, float]) -> None:
        """From here on kernels sum what contacts take."""
        self.balance = self._own_balance
        self.balance.clear()
        self.balance.pull[None] = gravity

    @cached_property
    def _own_balance(self) -> Balance:
        rows, near, chunks = self.pair.shape[0], self.near_grain.shape[0], self.overlap.shape[0]
        return Balance(rows=rows, near=near, chunks=chunks, real=self.real)

    def read(self, name: str) -> np.ndarray:
        """A field as a numpy array: the rows of the grains or chunks there are, or all of them."""
        array = getattr(self, name).to_numpy()
        if name in (*self.GRAIN_FIELDS, "pair_start", "pair_end"):
            return array[: self.grain_count]
        return array[: self.chunk_count] if name in self.BY_CHUNK else array

    def write(self, name: str, values: np.ndarray, rows: np.ndarray | None = None) -> None:
        """Put values into the first rows of a field, or into the rows given; the others become zero."""
        field, values = getattr(self, name), np.asarray(values)
        first = tuple(slice(count) for count in values.shape[: len(field.shape)])
        put_rows(field, values, first if rows is None else rows)

    def launch(
        self, most: int, before: int, dt: float, limit: float, gravity: tuple[float, float, float], keep: float,
        awake: int,
    ) -> tuple[int, bool]:  # fmt: skip
        """Up to ``most`` steps of the grains awake, fewer where that is many: (steps done, whether lists are due).

        ``before``: how many steps were made.
        """
        steps = GRAIN_STEPS_PER_LAUNCH // max(1, awake)
        steps = min(most, MOST_STEPS_PER_LAUNCH, max(STEPS_PER_LAUNCH, steps))
        self.run(dt, limit, *gravity, keep, steps, before, self.shapes, self.rest, self.balance)
        return int(self.done[None]), bool(self.halted[None])


@ti.data_oriented
class GpuEngine(GpuLists, GpuSteps, Engine):
    """An engine whose every grain is a chunk, with the lists, loops and sums of a GPU."""
