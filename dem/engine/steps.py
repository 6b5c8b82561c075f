"""The time step: kick and drift, forces between grains and on bodies, and the loops over chunks of grains.

With sleep (``dem.engine.sleep``) a slow grain has the row of its pair with another slow grain or a sleeper, but not
with a fast one: that is the fast grain's. The impulse of the fast grain's steps is summed in that row (``keep_push``).
It is taken out where the slow grain moves, or where lists are made (``gather_pushes``).

The kernels belong to ``dem.engine.engine.Engine``, whose fields they use.
"""

from dem.contact.law import contact_force, onset_of, springs_hold, turning_torque
from hedgebed_taichi import ti

from .lists import CACHE_LINE, FINISHED, FLOOR, INDEX_MASK, ITEMS_PER_THREAD, QUEUE
from .values import EnginePart

__all__ = ["Steps"]

# Looks at a counter, per grain of a chunk, before a thread gives up waiting: some milliseconds.
PATIENCE = 100


@ti.data_oriented
class Steps(EnginePart):
    """The part of the engine that moves grains and bodies and computes forces."""

    @ti.func
    def move(self, c, dt, limit, gravity, keep, rest: ti.template()):
        """Kick and drift the grains of a chunk, with chunk 0 the bodies; drag leaves ``keep`` of a grain's speed."""
        start, end = self.chunk_range(c)
        far = 0
        step, kept, many, rounder = dt, keep, 1, ti.cast(2.5, self.real)
        if ti.static(rest.on):
            many = self.steps_of(c, rest)
            if c >= self.count[self.FAST_CHUNKS]:
                self.gather_pushes(c, rest)
                kept = ti.pow(keep, many)
            step = dt * many
            rounder *= self.heaviness(c, rest) / self.stoutness(c, rest)
        for i in range(start, end):
            x, v, w = self.position[i], self.velocity[i], self.spin[i]
            f, t = self.force[i], self.torque[i]
            inverse = step / v.w
            if ti.static(rest.on):
                inverse /= self.heaviness(c, rest)
            v.xyz = kept * v.xyz + f * inverse
            w.xyz = kept * w.xyz + t * (rounder * inverse / (x.w * x.w))
            x.xyz += v.xyz * step
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
    def steps_of(self, c, rest: ti.template()):
        """Of how many steps one of chunk c is."""
        return ti.select(c < self.count[self.FAST_CHUNKS], 1, rest.pace[None])

    @ti.func
    def heaviness(self, c, rest: ti.template()):
        """How many times their mass the grains of chunk c move with."""
        return ti.cast(ti.select(c < self.count[self.FAST_CHUNKS], 1.0, rest.heavy[None]), self.real)

    @ti.func
    def stoutness(self, c, rest: ti.template()):
        """How many times their moment of inertia."""
        return ti.cast(ti.select(c < self.count[self.FAST_CHUNKS], 1.0, rest.stout[None]), self.real)

    @ti.func
    def is_due(self, c, step, rest: ti.template()):
        """Whether chunk c takes this step, before which so many were made."""
        return c < self.count[self.FAST_CHUNKS] or step % rest.pace[None] == 0

    @ti.func
    def alone_from(self, c):
        """From which grain on the pairs of chunk c are in its lists alone."""
        return ti.select(c < self.count[self.FAST_CHUNKS], self.count[self.FAST], self.count[self.AWAKE])

    @ti.func
    def is_theirs(self, c, j):
        """Whether the pair of a grain of chunk c with j is j's, which is fast, and the grain slow."""
        return c >= self.count[self.FAST_CHUNKS] and j < self.count[self.FAST]

    @ti.func
    def keep_push(self, s, f, t, rest: ti.template()):
        """Of a step of a fast grain: force -f and torque t on the slow one of its row."""
        rest.push[s] = rest.push[s] - f
        rest.turn[s] = rest.turn[s] + t

    @ti.func
    def gather_pushes(self, c, rest: ti.template()):
        """Put what fast grains did to the slow ones of chunk c, over the steps of one of theirs, into their forces."""
        if c >= self.count[self.FAST_CHUNKS]:
            start, end = self.chunk_range(c)
            share = 1.0 / ti.cast(rest.pace[None], self.real)
            for i in range(start, end):
                f, t = self.force[i], self.torque[i]
                for s in range(self.pair_start[i], self.pair_end[i]):
                    code = self.pair[s]
                    j = ti.select(code < 0, ~code, code) & INDEX_MASK
                    if j < self.count[self.FAST]:
                        for o in range(self.pair_start[j], self.pair_end[j]):
                            theirs = self.pair[o]
                            if (ti.select(theirs < 0, ~theirs, theirs) & INDEX_MASK) == i:
                                f += share * rest.push[o]
                                t += share * rest.turn[o]
                                rest.push[o] = ti.Vector.zero(self.real, 3)
                                rest.turn[o] = ti.Vector.zero(self.real, 3)
                self.force[i] = f
                self.torque[i] = t

    @ti.func
    def change_pace(self, c, i, dt, rest: ti.template(), balance: ti.template()):
        """Let a grain of chunk c become what its flags say, and book what its motion loses or gains by it.

        It keeps its speed, whatever its mass is then: most of it is the sand's own.
        """
        k = self.id[i]
        slow = i >= self.count[self.FAST]
        step = ti.cast(dt, self.real)
        p, turning, energy = self.motion_of(i, slow, step, rest)
        after, turning_after, energy_after = p * 0.0, p * 0.0, energy * 0.0
        rest.quiet[k] = 0
        v, w = self.velocity[i], self.spin[i]
        if rest.leaves[k] == 1 and self.next_sleep(i, rest):
            rest.asleep[k] = 1
            rest.slow[k] = 0
            v.xyz = ti.Vector.zero(self.real, 3)
            w = ti.Vector.zero(self.real, 4)
            self.velocity[i] = v
            self.spin[i] = w
            self.force[i] = ti.Vector.zero(self.real, 3)
            self.torque[i] = ti.Vector.zero(self.real, 3)
        else:
            rest.slow[k] = 1 - rest.slow[k]
            after, turning_after, energy_after = self.motion_of(i, not slow, step, rest)
        rest.held[c] = rest.held[c] + (p - after) / step
        if ti.static(balance.on):
            balance.turn(c, balance.outside, turning_after - turning)
            balance.lose(c, energy - energy_after)

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
    def push(self, c, dt, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        """Forces between the grains of a chunk and all that they touch."""
        # Of how many steps this one is, and how many times their mass grains count.
        many, heavy = 1, ti.cast(1.0, self.real)
        if ti.static(rest.on):
            many, heavy = self.steps_of(c, rest), self.heaviness(c, rest)
            dt *= many
        # First find out which pairs touch, then their forces.
        base = c * self.count[self.CHUNK_ROOM]
        last = self.sieve(c, dt, rest, balance)
        if ti.static(balance.on):
            self.balance_weight(c, dt, balance)
        largest, held = self.push_lanes(c, base, last, dt, rest, balance)
        on_floor = self.pushes[c, FLOOR]
        for s in range(c * self.count[self.NEAR_ROOM], self.near_end[c]):
            largest = ti.max(largest, self.push_near(c, s, dt, many, heavy, shapes, balance))
        self.overlap[c] = ti.max(self.overlap[c], largest)
        if ti.static(rest.on):
            rest.held[c] = rest.held[c] + held
            on_floor = self.pushes[c, FLOOR] - on_floor
            for k in ti.static(range(3)):
                on_floor[k] += held[k]
            rest.floor[c] = on_floor / many

    @ti.func
    def push_near(self, c, s, dt, many, heavy, shapes: ti.template(), balance: ti.template()):
        """Force between a grain, so ``heavy``, and a body, in a step of so ``many``; returns overlap over diameter."""
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
            v_n, v_t, spin, parting, middle = self.near_rates(i, b, n, curvature, arm, arm_i, dt)
            angle = (0.5 * dt) * (self.spin[i].xyz + self.body_spin[b]).dot(middle)
            radius = x.w / (1.0 + x.w * curvature)
            p = self.body_pair[b]
            u = self.near_slide[s]
            onset = onset_of(v_n, overlap, dt, u.w, self.cohesion)
            mass = heavy * self.velocity[i].w
            f_n, damped, f_t, k_t, a, root, load, grown = contact_force(
                p, n, v_n, v_t, overlap, radius, mass, onset, dt, u, self.tensile, self.cohesion,
                self.rescaled, -dt * parting, middle, angle,
            )  # fmt: skip
            self.near_slide[s] = u
            f = f_n * n + f_t
            t = arm_i * f_t.cross(n)
            t_body = -arm.cross(f)
            turn = ti.Vector.zero(self.real, 3)
            if ti.static(self.rolling):
                q = self.near_roll[s]
                turn = turning_torque(
                    p, n, spin, load, k_t, a, radius, root, dt, q, self.rescaled, grown, middle, angle
                )
                self.near_roll[s] = q
                t += turn
                t_body -= turn
            self.force[i] = self.force[i] + (f)
            self.torque[i] = self.torque[i] + (t)
            self.push_body(c, s, b, many * f, many * t_body)
            result = overlap / (2.0 * x.w)
            if ti.static(balance.on):
                held_t, held_r = springs_hold(p, n, overlap, radius, u, self.near_roll[s], self.cohesion)
                now, before = balance.parts(damped, f_t, turn, held_t, held_r), balance.near_last[s]
                balance.add(c, 1.0, before, now, balance.took(before, now, parting, v_t, spin, dt))
                balance.near_last[s] = now
                self.balance_body(c, i, b, f, t_body, n, arm, arm_i, dt, balance)
        else:
            if ti.static(balance.on):
                before = balance.near_last[s]
                if before.norm_sqr() > 0.0:
                    v_n, v_t, spin, parting, _ = self.near_rates(i, b, n, curvature, arm, x.w - overlap, dt)
                    now = balance.nothing()
                    balance.add(c, 1.0, before, now, balance.took(before, now, parting, v_t, spin, dt))
                    balance.near_last[s] = now
            self.near_slide[s] = ti.Vector.zero(self.real, 4)
            self.near_roll[s] = ti.Vector.zero(self.real, 3)
        return result

    @ti.func
    def push_body(self, c, s, b, f, t_body):
        """Sum what row s does to body b, chunk by chunk: force and torque."""
        for k in ti.static(range(3)):
            self.pushes[c, b][k] = self.pushes[c, b][k] - f[k]
            self.pushes[c, b][k + 3] = self.pushes[c, b][k + 3] + t_body[k]

    @ti.func
    def near_rates(self, i, b, n, curvature, arm, arm_i, dt):
        """How fast a grain parts from a body, slides on it and turns, the first across the middle normal, and that.

        As the body sees the grain; then half a step ago, where the velocities are: the normal, and the arms.
        """
        w_i = self.spin[i].xyz
        body_spin = self.body_spin[b]
        path = self.velocity[i].xyz - self.body_velocity[b]
        v = path - body_spin.cross(arm + arm_i * n)
        v_n = v.dot(n)
        bent = curvature / (1.0 + curvature * arm_i)
        turning = body_spin.cross(n) + bent * (v - v_n * n)
        middle = n - 0.5 * dt * turning
        v += 0.5 * dt * body_spin.cross(path)
        # To second order, for springs that turn with the normal; the middle one is right to first.
        turning = body_spin.cross(n) + (bent * (1.0 + dt * bent * v_n)) * (v - v.dot(n) * n)
        lean = 0.5 * dt * (turning - 0.5 * dt * body_spin.cross(turning))
        v -= (arm_i - 0.5 * dt * v_n) * (w_i - body_spin).cross(middle)
        v_t = v - v.dot(n) * middle
        return v_n, v_t, w_i - body_spin, v.dot(middle), n - lean + lean.dot(n) * n

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
        before: int,
        shapes: ti.template(),
        rest: ti.template(),
        balance: ti.template(),
    ):
        """Up to ``steps`` steps on a CPU, ``before`` of which were made; stops by itself where new lists are needed.

        Then halted is 1, done says how many steps are whole, and the forces of the next one are still to come.

        One parallel loop for all the steps, because waking threads costs more than a small bed's step. Phase p moves
        (even p) or pushes (odd p) every chunk, and opens when all chunks of the one before are finished. A thread takes
        those of its own range first, so that a chunk mostly stays in one core's cache, then those that are left.
        Whoever raises a chunk's claim past p has it, so nobody waits for a thread that has not started.
        """
        for c in range(self.count[self.CHUNKS]):
            self.claim[c * CACHE_LINE] = 0
        for _ in range(1):
            self.ticket[FINISHED] = 0
            self.done[None] = steps
        for w in range(self.cpu_items):
            if w % ITEMS_PER_THREAD == 0:
                chunks = self.count[self.CHUNKS]
                own = w // ITEMS_PER_THREAD * chunks // (self.cpu_items // ITEMS_PER_THREAD)
                patience = PATIENCE * (1 + self.count[self.GRAINS] // chunks)
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
                                rests = False
                                if ti.atomic_max(self.claim[c * CACHE_LINE], phase + 1) <= phase:
                                    if ti.static(rest.on):
                                        rests = not self.is_due(c, before + phase // 2, rest)
                                    if rests:
                                        pass
                                    elif phase % 2 == 0:
                                        self.move(c, dt, limit, ti.Vector([gx, gy, gz]), keep, rest)
                                    else:
                                        self.push(c, dt, shapes, rest, balance)
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
    def push_all(self, dt: float, before: int, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        """The forces of the step that was interrupted by new lists, ``before`` which so many were made."""
        for _ in range(1):
            self.ticket[QUEUE] = 0
        for w in range(self.cpu_items):
            c = self.next_chunk(w)
            while c < self.count[self.CHUNKS]:
                if ti.static(rest.on):
                    if dt == 0.0 or self.is_due(c, before, rest):
                        self.push(c, dt, shapes, rest, balance)
                else:
                    self.push(c, dt, shapes, rest, balance)
                c = self.next_chunk(w)
