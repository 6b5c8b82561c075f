"""What the host reads of grains and bodies: sums over chunks, contacts counted, and small changes to all grains.

The kernels belong to ``dem.engine.engine.Engine``, whose fields they use.
"""

from hedgebed_taichi import ti

from .lists import INDEX_MASK, MOST_BODIES
from .values import EnginePart

__all__ = ["Readings"]


@ti.data_oriented
class Readings(EnginePart):
    """The part of the engine that the host reads sums and counts from."""

    @ti.kernel
    def clear_pushes(self):
        for c, b in ti.ndrange(self.count[self.ALL_CHUNKS], MOST_BODIES):
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

        A row of six for each body, and one more whose first number is the overlap.
        """
        for b in range(MOST_BODIES + 1):
            self.put_tally(rows, b, self.pushes, self.overlap, self.count[self.ALL_CHUNKS])

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
    def body_gaps(self, gaps: ti.types.ndarray(dtype=ti.f64, ndim=3), skin: float, shapes: ti.template()):
        """How far each grain awake is from feeling each body [m], and from where lists say that it does, less a skin.

        Every grain with every body: for ``dem.engine.checking``.
        """
        for i in range(self.count[self.AWAKE]):
            x = self.position[i]
            for b in range(self.body_count[None]):
                felt = self.body_range(b, x.w, 0.0)
                distance, n, curvature, arm = self.nearest(b, x.xyz, x.w + felt + skin, shapes, True)
                gaps[i, b, 0] = ti.cast(distance - x.w - self.body_range(b, x.w, curvature), ti.f64)
                gaps[i, b, 1] = ti.cast(distance - x.w - felt, ti.f64)

    @ti.kernel
    def mark_origin(self):
        """Count displacements from here."""
        for i in range(self.count[self.GRAINS]):
            self.origin[i] = self.position[i].xyz

    @ti.kernel
    def shift_velocities(self, time: float):
        """Kick all grains by the present forces for a time of either sign."""
        for i in range(self.count[self.GRAINS]):
            r = self.position[i].w
            share = ti.cast(time, self.real) / self.velocity[i].w
            for k in ti.static(range(3)):
                self.velocity[i][k] = self.velocity[i][k] + self.force[i][k] * share
                self.spin[i][k] = self.spin[i][k] + self.torque[i][k] * (2.5 * share / (r * r))

    @ti.kernel
    def count_contacts(self, counts: ti.types.ndarray(dtype=ti.i32, ndim=1), shapes: ti.template()):
        """Contacts of each grain, by id."""
        for i in range(self.count[self.GRAINS]):
            counts[self.id[i]] = 0
        for i in range(self.count[self.GRAINS]):
            c = self.chunk_of(i)
            start, end = self.chunk_range(c)
            for s in range(self.pair_start[i], self.pair_end[i]):
                code = self.pair[s]
                if code < 0:
                    j = (~code) & INDEX_MASK
                    ti.atomic_add(counts[self.id[i]], 1)
                    if j >= start and j < end:
                        ti.atomic_add(counts[self.id[j]], 1)
        for c in range(self.count[self.CHUNKS]):
            for s in range(c * self.count[self.NEAR_ROOM], self.near_end[c]):
                i, b = self.near_grain[s], self.near_body[s]
                r = self.position[i].w
                reach = r
                if ti.static(shapes.full):
                    reach += self.body_range(b, r, 0.0)
                distance, n, curvature, arm = self.nearest(b, self.position[i].xyz, reach, shapes, False)
                if distance < r + self.body_range(b, r, curvature):
                    ti.atomic_add(counts[self.id[i]], 1)

    @ti.kernel
    def pushes_kept(self, rest: ti.template(), found: ti.types.ndarray(dtype=ti.f64, ndim=1)):
        """Sums of what is still to reach slow grains: force, and moment about the bed's origin."""
        for _ in range(1):  # one thread: the sum has one order
            total, moment = ti.Vector.zero(ti.f64, 3), ti.Vector.zero(ti.f64, 3)
            for i in range(self.count[self.FAST]):
                for s in range(self.pair_start[i], self.pair_end[i]):
                    code = self.pair[s]
                    j = ti.select(code < 0, ~code, code) & INDEX_MASK
                    if j >= self.count[self.FAST] and j < self.count[self.AWAKE]:
                        f = ti.cast(rest.push[s], ti.f64)
                        total += f
                        moment += ti.cast(self.position[j].xyz, ti.f64).cross(f) + ti.cast(rest.turn[s], ti.f64)
            for k in ti.static(range(3)):
                found[k] = total[k]
                found[k + 3] = moment[k]

    @ti.func
    def surface_speed(self, i):
        """The larger of a grain's speed and of what its surface has by its spin [m/s]."""
        return ti.max(self.velocity[i].xyz.norm(), self.position[i].w * self.spin[i].xyz.norm())

    @ti.func
    def motion_of(self, i, slow, dt, rest: ti.template()):
        """What a grain has, ``slow`` or not, the force to come included: momentum, angular momentum, energy."""
        x, v, w = self.position[i], self.velocity[i], self.spin[i]
        own = ti.cast(0.4, self.real) * x.w * x.w
        many = ti.select(slow, rest.pace[None], 1)
        mass = ti.cast(ti.select(slow, rest.heavy[None], 1.0), self.real) * v.w
        inertia = ti.cast(ti.select(slow, rest.stout[None], 1.0), self.real) * own * v.w
        p = mass * v.xyz + (many * dt) * self.force[i]
        turning = x.xyz.cross(p) + inertia * w.xyz + (many * dt) * self.torque[i]
        return p, turning, 0.5 * (mass * v.xyz.norm_sqr() + inertia * w.xyz.norm_sqr())

    @ti.func
    def momentum_of(self, i, slow, time, slow_time, rest: ti.template()):
        """Momentum of a grain, as ``motion_of`` has it, whose force will act for a time [s]."""
        heavy = ti.cast(ti.select(slow == 1, rest.heavy[None], 1.0), self.real)
        acts = ti.cast(ti.select(slow == 1, slow_time, time), self.real)
        return heavy * self.velocity[i].w * self.velocity[i].xyz + acts * self.force[i]
