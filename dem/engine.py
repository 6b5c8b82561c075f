"""The fields and the time step: everything that runs once a step.

Layout (measured reasons in docs/performance.md):

* Grains lie in memory in the order of a space-filling curve through the cells, so that neighbours are near.
* They are cut into a fixed number of contiguous chunks, whatever the number of threads. A pair inside a chunk is
  computed once, by the chunk's own serial loop, and added to both; a pair across chunks is computed by both sides. So
  no two threads write to one grain, and every sum has one order: the same bits on any number of threads. On a GPU a
  chunk is one grain, and the same code is a full list.
* A step is two parallel loops. ``move`` kicks and drifts (leapfrog: velocities live half a step behind positions);
  ``push`` computes forces. The loop that moves also finds out whether a grain has come further than half the skin;
  if so the later loops of the launch do nothing, and the host makes new lists and goes on from there.
"""

import math

import numpy as np
import taichi as ti

from .contact import PAIR_WIDTH, contact_force, turning_torque
from .shapes import ROW_WIDTH, distance_to

__all__ = ["Engine", "STEPS_PER_LAUNCH"]

STEPS_PER_LAUNCH = 2
GRAINS_PER_CHUNK = 1250
MOST_CHUNKS = 64
ITEMS_PER_THREAD = 512
MOST_BODIES = 8
MOST_PRIMITIVES = 64

# A neighbour's code: its index, and in the upper bits which periodic image is meant. The sign says "touching".
_INDEX_BITS = 26
_INDEX_MASK = (1 << _INDEX_BITS) - 1
_SAME_IMAGE = 1 + 3 * 1  # (0 + 1) + 3 * (0 + 1)


@ti.data_oriented
class Engine:
    """Grains, lists and bodies in Taichi fields, and the kernels that advance them.

    Args:
        grain_count: number of grains, at most 2^26.
        period: lateral period (x, y) [m].
        height: top of the box [m]; its bottom is z = ``bottom``.
        largest_diameter: of the grains [m].
        largest_skin: upper bound of the neighbour lists' skin [m].
        rolling: whether contacts carry a rolling spring.
        tensile: whether a contact's damping may pull at its end.
        real: ti.f64 or ti.f32.
        gpu: one grain a chunk.
        neighbours_per_grain: room in the lists.
    """

    def __init__(
        self,
        *,
        grain_count: int,
        period: tuple[float, float],
        bottom: float,
        height: float,
        largest_diameter: float,
        largest_skin: float,
        rolling: bool,
        tensile: bool,
        real,
        gpu: bool = False,
        threads: int = 1,
        neighbours_per_grain: int = 16,
        chunk_count: int | None = None,
    ):
        n = grain_count
        self.grain_count = n
        self.index_mask = _INDEX_MASK
        self.real = real
        self.rolling = rolling
        self.tensile = tensile
        self.gpu = gpu
        if chunk_count is None:
            chunk_count = n if gpu else max(1, min(MOST_CHUNKS, round(n / GRAINS_PER_CHUNK)))
        self.chunk_count = chunk_count
        self.period = period
        self.bottom = bottom
        cell = largest_diameter + largest_skin
        # Fewer than three cells across would count a pair twice; then one cell spans and images are looked at singly.
        self.nx = max(1, int(period[0] / cell))
        self.ny = max(1, int(period[1] / cell))
        self.nz = max(1, int((height - bottom) / cell) + 1)
        self.height = height
        if min(self.nx, self.ny) < 3:
            raise ValueError(
                f"the bed is {min(period):g} m across, less than three grains of {largest_diameter:g} m; "
                f"make it at least {3 * cell:.3g} m wide"
            )
        self.cell_size = (period[0] / self.nx, period[1] / self.ny, cell)
        self.cell_count = self.nx * self.ny * self.nz

        vec3 = ti.types.vector(3, real)
        self.vec3 = vec3
        F = ti.Vector.field
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
        self.rank = ti.field(ti.i32, self.cell_count)
        self.cell_start = ti.field(ti.i32, self.cell_count + 1)
        self.cell_fill = ti.field(ti.i32, self.cell_count)
        # Pair lists: chunk c owns rows from chunk_room * c; offsets per grain.
        self.chunk_room = -(-n // chunk_count) * neighbours_per_grain + 8
        room = self.chunk_room * chunk_count
        self.pair_start = ti.field(ti.i32, n)
        self.pair_end = ti.field(ti.i32, n)
        self.pair = ti.field(ti.i32, room)
        self.slide = F(3, real, room)
        self.old_start = ti.field(ti.i32, n)
        self.old_end = ti.field(ti.i32, n)
        self.old_pair = ti.field(ti.i32, room)
        self.old_slide = F(3, real, room)
        if rolling:
            self.roll = F(3, real, room)
            self.old_roll = F(3, real, room)
        # Grains near bodies, likewise.
        self.near_room = max(8, 2 * -(-n // chunk_count))
        near = self.near_room * chunk_count
        self.near_end = ti.field(ti.i32, chunk_count)
        self.near_grain = ti.field(ti.i32, near)
        self.near_body = ti.field(ti.i32, near)
        self.near_slide = F(3, real, near)
        self.near_roll = F(3, real, near)
        self.near_first = ti.field(ti.i32, n)
        self.old_near_end = ti.field(ti.i32, chunk_count)
        self.old_near_grain = ti.field(ti.i32, near)
        self.old_near_body = ti.field(ti.i32, near)
        self.old_near_slide = F(3, real, near)
        self.old_near_roll = F(3, real, near)
        # Who computes which chunk: one counter for each of the two loops of a step.
        self.work_items = chunk_count if gpu else threads * ITEMS_PER_THREAD
        self.ticket = ti.field(ti.i32, 2)
        # Per chunk.
        self.overlap = ti.field(real, chunk_count)
        self.pushes = F(6, real, (chunk_count, MOST_BODIES))
        self.contact_count = ti.field(ti.i32, chunk_count)
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
        self.grain_pair = F(PAIR_WIDTH, real, ())
        # Step control: moved is written by move and read by push; halted is written by push and read by move.
        self.moved = ti.field(ti.i32, ())
        self.halted = ti.field(ti.i32, ())
        self.done = ti.field(ti.i32, ())
        self.problem = F(2, ti.i32, ())

        self.rank.from_numpy(_curve(self.nx, self.ny, self.nz))

    # ------------------------------------------------------------------ the step

    @ti.func
    def next_chunk(self, w, queue, first: ti.template()):
        """The next chunk for work item w, or chunk_count where nothing is left.

        Taichi gives a CPU thread at least 512 items of a loop, so each thread has that many and one of them works.
        Which thread takes a chunk does not matter to the result.
        """
        c = self.chunk_count
        if ti.static(self.gpu):
            if ti.static(first):
                c = w
        elif w % ITEMS_PER_THREAD == 0:
            c = ti.atomic_add(self.ticket[queue], 1)
        return c

    @ti.func
    def chunk_range(self, c):
        n = self.grain_count
        m = ti.static(self.chunk_count)
        if ti.static(self.gpu):
            return c, c + 1
        base = n // m
        rest = n - base * m
        start = c * base + ti.min(c, rest)
        return start, start + base + ti.select(c < rest, 1, 0)

    @ti.func
    def move(self, c, dt, limit, gravity, keep):
        """Kick and drift the grains of a chunk; chunk 0 moves the bodies as well.

        ``keep`` is the share of its speed that drag leaves a grain in a step; 1 without drag.
        """
        if self.halted[None] == 0:
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
    def push(self, c, dt):
        """Forces between the grains of a chunk and all that they touch."""
        start, end = self.chunk_range(c)
        p = self.grain_pair[None]
        largest = ti.cast(0.0, self.real)
        for i in range(start, end):
            x_i = self.position[i]
            v_i = self.velocity[i]
            w_i = self.spin[i]
            sum_f = ti.Vector.zero(self.real, 3)
            sum_t = ti.Vector.zero(self.real, 3)
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                touching = code < 0
                bits = ti.select(touching, ~code, code)
                j = bits & _INDEX_MASK
                image = bits >> _INDEX_BITS
                x_j = self.position[j]
                d = x_i.xyz - x_j.xyz
                if image != _SAME_IMAGE:
                    d.x += ti.cast(image % 3 - 1, self.real) * self.period[0]
                    d.y += ti.cast(image // 3 - 1, self.real) * self.period[1]
                square = d.norm_sqr()
                sum_r = x_i.w + x_j.w
                if square < sum_r * sum_r:
                    v_j = self.velocity[j]
                    w_j = self.spin[j]
                    length = ti.sqrt(square)
                    overlap = sum_r - length
                    mass = v_i.w + v_j.w
                    # One division for three reciprocals.
                    inverse = 1.0 / (length * sum_r * mass)
                    n = d * (sum_r * mass * inverse)
                    by_sum = length * mass * inverse
                    radius = x_i.w * x_j.w * by_sum
                    mass = v_i.w * v_j.w * (length * sum_r * inverse)
                    arm_i = x_i.w - 0.5 * overlap
                    arm_j = x_j.w - 0.5 * overlap
                    v = v_i.xyz - v_j.xyz - (arm_i * w_i.xyz + arm_j * w_j.xyz).cross(n)
                    u = self.slide[s]
                    f_n, f_t, k_t, a, root = contact_force(p, n, v, overlap, radius, mass, dt, u, self.tensile)
                    self.slide[s] = u
                    f = f_n * n + f_t
                    t = f_t.cross(n)
                    sum_f += f
                    sum_t += arm_i * t
                    turn = ti.Vector.zero(self.real, 3)
                    if ti.static(self.rolling):
                        q = self.roll[s]
                        turn = turning_torque(p, n, w_i.xyz - w_j.xyz, f_n, k_t, a, radius, root, dt, q)
                        self.roll[s] = q
                        sum_t += turn
                    if ti.static(not self.gpu):
                        if j >= start and j < end:
                            self.force[j] = self.force[j] - (f)
                            self.torque[j] = self.torque[j] + (arm_j * t - turn)
                    largest = ti.max(largest, overlap * by_sum)
                    if not touching:
                        self.pair[s] = ~code
                elif touching:
                    self.pair[s] = bits
                    self.slide[s] = ti.Vector.zero(self.real, 3)
                    if ti.static(self.rolling):
                        self.roll[s] = ti.Vector.zero(self.real, 3)
            self.force[i] = self.force[i] + (sum_f)
            self.torque[i] = self.torque[i] + (sum_t)
        base = c * self.near_room
        for s in range(base, self.near_end[c]):
            largest = ti.max(largest, self.push_near(c, s, dt))
        self.overlap[c] = ti.max(self.overlap[c], largest)

    @ti.func
    def push_near(self, c, s, dt):
        """Force between a grain and a body; returns overlap over diameter."""
        i = self.near_grain[s]
        b = self.near_body[s]
        x = self.position[i]
        distance, n, curvature, arm = self.nearest(b, x.xyz)
        overlap = x.w - distance
        result = ti.cast(0.0, self.real)
        if overlap > 0.0:
            v_i = self.velocity[i]
            w_i = self.spin[i]
            arm_i = x.w - overlap
            body_spin = self.body_spin[b]
            v = v_i.xyz - arm_i * w_i.xyz.cross(n) - self.body_velocity[b] - body_spin.cross(arm)
            radius = x.w / (1.0 + x.w * curvature)
            p = self.body_pair[b]
            u = self.near_slide[s]
            f_n, f_t, k_t, a, root = contact_force(p, n, v, overlap, radius, v_i.w, dt, u, self.tensile)
            self.near_slide[s] = u
            f = f_n * n + f_t
            t = arm_i * f_t.cross(n)
            t_body = -arm.cross(f)
            if ti.static(self.rolling):
                q = self.near_roll[s]
                turn = turning_torque(p, n, w_i.xyz - body_spin, f_n, k_t, a, radius, root, dt, q)
                self.near_roll[s] = q
                t += turn
                t_body -= turn
            self.force[i] = self.force[i] + (f)
            self.torque[i] = self.torque[i] + (t)
            for k in ti.static(range(3)):
                self.pushes[c, b][k] = self.pushes[c, b][k] - f[k]
                self.pushes[c, b][k + 3] += t_body[k]
            result = overlap / (2.0 * x.w)
        else:
            self.near_slide[s] = ti.Vector.zero(self.real, 3)
            self.near_roll[s] = ti.Vector.zero(self.real, 3)
        return result

    @ti.func
    def nearest(self, b, x):
        """Distance, normal and curvature of body b at a point, and the arm from its origin to the nearest point."""
        d = x - self.body_position[b]
        if self.body_extent[b] < 1e30:
            d.x -= self.period[0] * ti.round(d.x / self.period[0])
            d.y -= self.period[1] * ti.round(d.y / self.period[1])
        q = self.body_turn[b]
        local = rotate(ti.Vector([q[0], -q[1], -q[2], -q[3]]), d)
        best = ti.cast(1e30, self.real)
        normal = local * 0.0
        curvature = best * 0.0
        primitives = self.body_primitives[b]
        for k in range(primitives[0], primitives[1]):
            row = self.primitive_row[k]
            distance, n_k, c_k = distance_to(self.primitive_kind[k], row, local)
            if distance < best:
                best = distance
                normal = n_k
                curvature = c_k
        normal = rotate(q, normal)
        return best, normal, curvature, d - best * normal

    @ti.func
    def push_if_listed(self, c, dt):
        """Forces, unless the lists are too old; then stop this launch and say so."""
        if self.moved[None] == 0:
            self.push(c, dt)
            if c == 0:
                self.done[None] = self.done[None] + 1
        elif c == 0:
            self.halted[None] = 1

    @ti.kernel
    def run(self, dt: float, limit: float, gx: float, gy: float, gz: float, keep: float, steps: ti.template()):
        """Up to ``steps`` steps; stops by itself where new lists are needed (halted = 1, the forces still to come)."""
        for _ in ti.static(range(steps)):
            for w in range(self.work_items):
                self.ticket[1] = 0
                c = self.next_chunk(w, 0, True)
                while c < self.chunk_count:
                    gravity = ti.Vector([gx, gy, gz])
                    self.move(c, ti.cast(dt, self.real), ti.cast(limit, self.real), gravity, ti.cast(keep, self.real))
                    c = self.next_chunk(w, 0, False)
            for w in range(self.work_items):
                self.ticket[0] = 0
                c = self.next_chunk(w, 1, True)
                while c < self.chunk_count:
                    self.push_if_listed(c, ti.cast(dt, self.real))
                    c = self.next_chunk(w, 1, False)

    @ti.kernel
    def push_all(self, dt: float):
        """The forces of the step that was interrupted by new lists."""
        for _ in range(1):
            self.ticket[1] = 0
        for w in range(self.work_items):
            self.ticket[0] = 0
            c = self.next_chunk(w, 1, True)
            while c < self.chunk_count:
                self.push(c, ti.cast(dt, self.real))
                c = self.next_chunk(w, 1, False)

    # ------------------------------------------------------------------ the lists

    @ti.func
    def cell_of(self, x):
        """Cell of a position inside the box, as three integers."""
        i = ti.min(self.nx - 1, ti.max(0, ti.floor(x.x / self.cell_size[0], ti.i32)))
        j = ti.min(self.ny - 1, ti.max(0, ti.floor(x.y / self.cell_size[1], ti.i32)))
        k = ti.min(self.nz - 1, ti.max(0, ti.floor((x.z - self.bottom) / self.cell_size[2], ti.i32)))
        return i, j, k

    @ti.func
    def cell_index(self, i, j, k):
        return (k * self.ny + j) * self.nx + i

    @ti.kernel
    def sort(self, gx: float, gy: float, gz: float):
        """Wrap the grains into the box and bring them into the order of the curve; ids break ties."""
        for k in range(self.cell_count):
            self.cell_fill[k] = 0
        for i in range(self.grain_count):
            x = self.position[i]
            inside = x.z >= self.bottom and x.z <= self.height
            inside = inside and ti.abs(x.x) < 1e6 * self.period[0] and ti.abs(x.y) < 1e6 * self.period[1]
            if not inside:
                # Any of the lost ones will do; the host looks for the first id.
                self.problem[None] = ti.Vector([1, self.id[i]])
            else:
                a = -ti.floor(x.x / self.period[0]) * self.period[0]
                b = -ti.floor(x.y / self.period[1]) * self.period[1]
                self.position[i].x += a
                self.position[i].y += b
                self.origin[i].x += a
                self.origin[i].y += b
            ci, cj, ck = self.cell_of(self.position[i])
            r = self.rank[self.cell_index(ci, cj, ck)]
            self.key[i] = r
            ti.atomic_add(self.cell_fill[r], 1)
        for _ in range(1):
            total = 0
            for r in range(self.cell_count):
                self.cell_start[r] = total
                total += self.cell_fill[r]
                self.cell_fill[r] = self.cell_start[r]
            self.cell_start[self.cell_count] = total
        for i in range(self.grain_count):
            slot = ti.atomic_add(self.cell_fill[self.key[i]], 1)
            self.came_from[slot] = i
        for r in range(self.cell_count):
            # Whatever thread came first, the order within a cell is that of the ids.
            for a in range(self.cell_start[r] + 1, self.cell_start[r + 1]):
                moving = self.came_from[a]
                b = a - 1
                while b >= self.cell_start[r] and self.id[self.came_from[b]] > self.id[moving]:
                    self.came_from[b + 1] = self.came_from[b]
                    b -= 1
                self.came_from[b + 1] = moving
        for i in range(self.grain_count):
            o = self.came_from[i]
            self.buffer4[0][i] = self.position[o]
            self.buffer4[1][i] = self.velocity[o]
            self.buffer4[2][i] = self.spin[o]
            self.buffer3[i] = self.origin[o]
            self.buffer_id[i] = self.id[o]
        for i in range(self.grain_count):
            self.position[i] = self.buffer4[0][i]
            self.velocity[i] = self.buffer4[1][i]
            self.spin[i] = self.buffer4[2][i]
            self.origin[i] = self.buffer3[i]
            self.id[i] = self.buffer_id[i]
            self.listed[i] = self.buffer4[0][i].xyz
            self.force[i] = self.buffer4[1][i].w * ti.Vector([gx, gy, gz])
            self.torque[i] = ti.Vector.zero(self.real, 3)

    @ti.kernel
    def keep_lists(self):
        """Put the lists aside, so that the new ones can take the history over."""
        for _ in range(1):
            self.ticket[0] = 0
        for w in range(self.work_items):
            c = self.next_chunk(w, 0, True)
            while c < self.chunk_count:
                self.keep_chunk(c)
                c = self.next_chunk(w, 0, False)

    @ti.func
    def keep_chunk(self, c):
        start, end = self.chunk_range(c)
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
        self.old_near_end[c] = self.near_end[c]
        base = c * self.near_room
        for k in range(self.near_end[c] - base):
            s = self.near_end[c] - 1 - k
            i = self.near_grain[s]
            self.near_first[i] = s
            self.old_near_grain[s] = i
            self.old_near_body[s] = self.near_body[s]
            self.old_near_slide[s] = self.near_slide[s]
            self.old_near_roll[s] = self.near_roll[s]

    @ti.func
    def find_old(self, i, j):
        """Row of the old list that holds touching pair i, j (old indices), or -1."""
        found = -1
        for s in range(self.old_start[i], self.old_end[i]):
            code = self.old_pair[s]
            if code < 0 and ((~code) & _INDEX_MASK) == j:
                found = s
        return found

    @ti.kernel
    def make_lists(self, skin: float):
        """New pair and near lists for the sorted grains; history comes over from the lists put aside."""
        for b in range(MOST_BODIES):
            self.body_listed[b] = self.body_position[b]
            self.body_listed_turn[b] = self.body_turn[b]
        for _ in range(1):
            self.ticket[0] = 0
        for w in range(self.work_items):
            c = self.next_chunk(w, 0, True)
            while c < self.chunk_count:
                self.list_chunk(c, ti.cast(skin, self.real))
                c = self.next_chunk(w, 0, False)
        for _ in range(1):
            self.moved[None] = 0
            self.halted[None] = 0

    @ti.func
    def list_chunk(self, c, skin):
        start, end = self.chunk_range(c)
        base = c * self.chunk_room
        s = base
        for i in range(start, end):
            x_i = self.position[i]
            self.pair_start[i] = s
            ci, cj, ck = self.cell_of(x_i)
            for dk in range(-1, 2):
                k = ck + dk
                if k >= 0 and k < self.nz:
                    for dj, di in ti.ndrange((-1, 2), (-1, 2)):
                        # Stepping out on the left means the neighbour's image one period to the left.
                        gi, gj = ci + di, cj + dj
                        mi, mj = 0, 0
                        if gi < 0:
                            gi += self.nx
                            mi = 1
                        elif gi >= self.nx:
                            gi -= self.nx
                            mi = -1
                        if gj < 0:
                            gj += self.ny
                            mj = 1
                        elif gj >= self.ny:
                            gj -= self.ny
                            mj = -1
                        r = self.rank[self.cell_index(gi, gj, k)]
                        for j in range(self.cell_start[r], self.cell_start[r + 1]):
                            own = j >= start and j < end
                            if j != i and (j > i or not own):
                                x_j = self.position[j]
                                d = x_i.xyz - x_j.xyz
                                d.x += ti.cast(mi, self.real) * self.period[0]
                                d.y += ti.cast(mj, self.real) * self.period[1]
                                reach = x_i.w + x_j.w + skin
                                if d.norm_sqr() < reach * reach:
                                    if s < base + self.chunk_room:
                                        self.list_pair(s, i, j, j | ((mi + 1 + 3 * (mj + 1)) << _INDEX_BITS))
                                    s += 1
            self.pair_end[i] = ti.min(s, base + self.chunk_room)
        if s > base + self.chunk_room:
            self.problem[None] = ti.Vector([2, s - base])
        self.list_near(c, start, end, skin)

    @ti.func
    def list_pair(self, s, i, j, code):
        oi, oj = self.came_from[i], self.came_from[j]
        sign = ti.cast(1.0, self.real)
        old = self.find_old(oi, oj)
        if old < 0:
            old = self.find_old(oj, oi)
            sign = -sign
        if old >= 0:
            self.pair[s] = ~code
            self.slide[s] = sign * self.old_slide[old]
            if ti.static(self.rolling):
                self.roll[s] = sign * self.old_roll[old]
        else:
            self.pair[s] = code
            self.slide[s] = ti.Vector.zero(self.real, 3)
            if ti.static(self.rolling):
                self.roll[s] = ti.Vector.zero(self.real, 3)

    @ti.func
    def list_near(self, c, start, end, skin):
        base = c * self.near_room
        s = base
        for i in range(start, end):
            x = self.position[i]
            for b in range(self.body_count[None]):
                distance, n, curvature, arm = self.nearest(b, x.xyz)
                if distance < x.w + skin:
                    if s < base + self.near_room:
                        self.near_grain[s] = i
                        self.near_body[s] = b
                        self.near_slide[s] = ti.Vector.zero(self.real, 3)
                        self.near_roll[s] = ti.Vector.zero(self.real, 3)
                        o = self.near_first[self.came_from[i]]
                        while o >= 0:
                            if self.old_near_grain[o] == self.came_from[i]:
                                if self.old_near_body[o] == b:
                                    self.near_slide[s] = self.old_near_slide[o]
                                    self.near_roll[s] = self.old_near_roll[o]
                                o += 1
                                if o % self.near_room == 0 or o >= self.old_near_end[o // self.near_room]:
                                    o = -1
                            else:
                                o = -1
                    s += 1
        self.near_end[c] = ti.min(s, base + self.near_room)
        if s > base + self.near_room:
            self.problem[None] = ti.Vector([3, s - base])

    # ------------------------------------------------------------------ what the host reads

    @ti.kernel
    def clear_pushes(self):
        for c, b in self.pushes:
            self.pushes[c, b] = ti.Vector.zero(self.real, 6)

    @ti.kernel
    def mark_origin(self):
        """Count displacements from here."""
        for i in range(self.grain_count):
            self.origin[i] = self.position[i].xyz

    @ti.kernel
    def shift_velocities(self, time: float):
        """Kick all grains by the present forces for a time of either sign."""
        for i in range(self.grain_count):
            r = self.position[i].w
            share = ti.cast(time, self.real) / self.velocity[i].w
            for k in ti.static(range(3)):
                self.velocity[i][k] = self.velocity[i][k] + self.force[i][k] * share
                self.spin[i][k] = self.spin[i][k] + self.torque[i][k] * (2.5 * share / (r * r))

    @ti.kernel
    def count_contacts(self, counts: ti.types.ndarray(dtype=ti.i32, ndim=1)):
        """Contacts of each grain, by id."""
        for i in range(self.grain_count):
            counts[self.id[i]] = 0
        for i in range(self.grain_count):
            c = self.chunk_of(i)
            start, end = self.chunk_range(c)
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                if code < 0:
                    j = (~code) & _INDEX_MASK
                    ti.atomic_add(counts[self.id[i]], 1)
                    if j >= start and j < end:
                        ti.atomic_add(counts[self.id[j]], 1)
        for c in range(self.chunk_count):
            for s in range(c * self.near_room, self.near_end[c]):
                i = self.near_grain[s]
                distance, n, curvature, arm = self.nearest(self.near_body[s], self.position[i].xyz)
                if distance < self.position[i].w:
                    ti.atomic_add(counts[self.id[i]], 1)

    @ti.func
    def chunk_of(self, i):
        result = i
        if ti.static(not self.gpu):
            m = ti.static(self.chunk_count)
            base = self.grain_count // m
            rest = self.grain_count - base * m
            wide = rest * (base + 1)
            result = ti.select(i < wide, i // (base + 1), rest + (i - wide) // ti.max(base, 1))
        return result


@ti.func
def rotate(q, x):
    """x turned by the unit quaternion q (scalar first)."""
    axis = ti.Vector([q[1], q[2], q[3]])
    t = 2.0 * axis.cross(x)
    return x + q[0] * t + axis.cross(t)


def _curve(nx: int, ny: int, nz: int) -> np.ndarray:
    """Rank of each cell on a Morton curve, shape [nx ny nz], x fastest."""
    bits = max(1, math.ceil(math.log2(max(nx, ny, nz, 2))))

    def spread(a):
        result = np.zeros_like(a)
        for bit in range(bits):
            result |= ((a >> bit) & 1) << (3 * bit)
        return result

    k, j, i = np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
    code = spread(i.ravel().astype(np.int64)) | spread(j.ravel().astype(np.int64)) << 1
    code |= spread(k.ravel().astype(np.int64)) << 2
    rank = np.empty(code.size, dtype=np.int32)
    rank[np.argsort(code, kind="stable")] = np.arange(code.size, dtype=np.int32)
    return rank
