"""The time step: kick and drift, forces between grains and on bodies, and the loops over chunks of grains.

The kernels belong to ``dem.engine.engine.Engine``, whose fields they use.
"""

from dem.contact.cohesion import JKR
from dem.contact.law import adhesive_range, contact_force, turning_torque
from hedgebed_taichi import ti

from .lists import CACHE_LINE, FINISHED, INDEX_BITS, INDEX_MASK, ITEMS_PER_THREAD, QUEUE, SAME_IMAGE
from .values import EnginePart

__all__ = ["Steps"]

LANES = 16
# Looks at a counter, per grain of a chunk, before a thread gives up waiting: some milliseconds.
PATIENCE = 100


@ti.data_oriented
class Steps(EnginePart):
    """The part of the engine that moves grains and bodies and computes forces."""

    @ti.func
    def move(self, c, dt, limit, gravity, keep):
        """Kick and drift the grains of a chunk, with chunk 0 the bodies; drag leaves ``keep`` of a grain's speed."""
        start, end = self.chunk_range(c)
        far = 0
        for i in range(start, end):
            x, v, w = self.position[i], self.velocity[i], self.spin[i]
            f, t = self.force[i], self.torque[i]
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
    def push(self, c, dt, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        """Forces between the grains of a chunk and all that they touch."""
        start, end = self.chunk_range(c)
        base = c * self.count[self.CHUNK_ROOM]
        rows = base
        if end > start:  # with sleepers a chunk may be empty
            rows = self.pair_end[end - 1]
        last = self.sieve(c, base, rows, dt, rest, balance)
        if ti.static(balance.on):
            self.balance_weight(c, dt, balance)
        largest, held = self.push_touching(c, base, last, dt, rest, balance)
        for s in range(c * self.count[self.NEAR_ROOM], self.near_end[c]):
            largest = ti.max(largest, self.push_near(c, s, dt, shapes, balance))
        self.overlap[c] = ti.max(self.overlap[c], largest)
        if ti.static(rest.on):
            rest.held[c] = rest.held[c] + held

    @ti.func
    def sieve(self, c, base, rows, dt, rest: ti.template(), balance: ti.template()):
        """Put the numbers of a chunk's rows that touch in ``touching``; the end of them.

        No branch that a processor would have to guess.
        """
        last = base
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
                    if ti.static(balance.on):
                        self.balance_pair(c, s, i, bits & INDEX_MASK, d, balance.nothing(), dt, rest, balance)
                    self.slide[s] = ti.Vector.zero(self.real, 4)
                    if ti.static(self.rolling):
                        self.roll[s] = ti.Vector.zero(self.real, 3)
        return last

    @ti.func
    def push_touching(self, c, base, last, dt, rest: ti.template(), balance: ti.template()):
        """Forces of the touching pairs of a chunk, LANES at a time; (largest overlap over diameter, force on sleepers).

        The middle loop has plain local arrays and no branch, so that LLVM computes several pairs with one instruction.
        """
        start, end = self.chunk_range(c)
        p = self.grain_pair[None]
        largest = ti.cast(0.0, self.real)
        held = ti.Vector.zero(self.real, 3)
        one = ti.Vector([1.0] * LANES, dt=self.real)
        dx, dy, dz, ri, rj, mi, mj = one, one, one, one, one, one, one
        vx, vy, vz, wix, wiy, wiz, wjx, wjy, wjz = one, one, one, one, one, one, one, one, one
        ux, uy, uz, uw = one, one, one, one
        qx, qy, qz = one, one, one
        fx, fy, fz, tx, ty, tz, hx, hy, hz, share = one, one, one, one, one, one, one, one, one, one
        ai, aj = one, one
        for block in range((last - base + LANES - 1) // LANES):
            first = base + block * LANES
            m = ti.min(LANES, last - first)
            for l in range(m):
                s = self.touching[first + l]
                i = self.first[s]
                bits = ~self.pair[s]
                j = bits & INDEX_MASK
                x_i, x_j = self.position[i], self.position[j]
                d = self.apart(x_i, x_j, bits)
                dx[l], dy[l], dz[l], ri[l], rj[l] = d.x, d.y, d.z, x_i.w, x_j.w
                v_i, v_j = self.velocity[i], self.velocity[j]
                v = v_i.xyz - v_j.xyz
                vx[l], vy[l], vz[l], mi[l], mj[l] = v.x, v.y, v.z, v_i.w, v_j.w
                w_i, w_j = self.spin[i], self.spin[j]
                wix[l], wiy[l], wiz[l] = w_i.x, w_i.y, w_i.z
                wjx[l], wjy[l], wjz[l] = w_j.x, w_j.y, w_j.z
                u = self.slide[s]
                ux[l], uy[l], uz[l], uw[l] = u.x, u.y, u.z, u.w
                if ti.static(self.rolling):
                    q = self.roll[s]
                    qx[l], qy[l], qz[l] = q.x, q.y, q.z
            for l in range(LANES):
                d = ti.Vector([dx[l], dy[l], dz[l]])
                length = d.norm()
                sum_r = ri[l] + rj[l]
                overlap = sum_r - length
                mass = mi[l] + mj[l]
                # One division for three reciprocals.
                inverse = 1.0 / (length * sum_r * mass)
                by_length = sum_r * mass * inverse
                n = d * by_length
                by_sum = length * mass * inverse
                radius = ri[l] * rj[l] * by_sum
                mass = mi[l] * mj[l] * (length * sum_r * inverse)
                arm_i = ri[l] - 0.5 * overlap
                arm_j = rj[l] - 0.5 * overlap
                # The slip as ``dem.contact.law`` says it: across the normal half a step ago, n - h v_t, with the arms
                # of then.
                v = ti.Vector([vx[l], vy[l], vz[l]])
                v_n = v.dot(n)
                v_t = v - v_n * n
                h = 0.5 * dt * by_length
                back = 0.25 * dt * v_n
                w_i = ti.Vector([wix[l], wiy[l], wiz[l]])
                w_j = ti.Vector([wjx[l], wjy[l], wjz[l]])
                turning = (arm_i - back) * w_i + (arm_j - back) * w_j
                v_t = (1.0 + h * v_n) * v_t - turning.cross(n)
                u = ti.Vector([ux[l], uy[l], uz[l], uw[l]])
                f_n, damped, f_t, k_t, a, root, load = contact_force(
                    p, n, v_n, v_t, overlap, radius, mass, dt, u, self.tensile, self.cohesion
                )
                ux[l], uy[l], uz[l], uw[l] = u.x, u.y, u.z, u.w
                f = f_n * n + f_t
                t = f_t.cross(n)
                fx[l], fy[l], fz[l] = f.x, f.y, f.z
                tx[l], ty[l], tz[l] = t.x, t.y, t.z
                ai[l], aj[l] = arm_i, arm_j
                share[l] = overlap * by_sum
                if ti.static(self.rolling):
                    q = ti.Vector([qx[l], qy[l], qz[l]])
                    turn = turning_torque(p, n, w_i - w_j, load, k_t, a, radius, root, dt, q)
                    qx[l], qy[l], qz[l] = q.x, q.y, q.z
                    hx[l], hy[l], hz[l] = turn.x, turn.y, turn.z
            for l in range(m):
                s = self.touching[first + l]
                i = self.first[s]
                bits = ~self.pair[s]
                j = bits & INDEX_MASK
                self.slide[s] = ti.Vector([ux[l], uy[l], uz[l], uw[l]])
                f = ti.Vector([fx[l], fy[l], fz[l]])
                t = ti.Vector([tx[l], ty[l], tz[l]])
                turn = ti.Vector.zero(self.real, 3)
                if ti.static(self.rolling):
                    self.roll[s] = ti.Vector([qx[l], qy[l], qz[l]])
                    turn = ti.Vector([hx[l], hy[l], hz[l]])
                self.force[i] = self.force[i] + f
                self.torque[i] = self.torque[i] + (ai[l] * t + turn)
                if j >= start and j < end:
                    self.force[j] = self.force[j] - f
                    self.torque[j] = self.torque[j] + (aj[l] * t - turn)
                if ti.static(rest.on):
                    if j >= self.count[self.AWAKE]:
                        held -= f
                largest = ti.max(largest, share[l])
        return largest, held

    @ti.func
    def apart(self, x_i, x_j, bits):
        """From the neighbour, or its image that the upper bits mean, to the grain."""
        d = x_i.xyz - x_j.xyz
        image = bits >> INDEX_BITS
        if image != SAME_IMAGE:
            d.x += ti.cast(image % 3 - 1, self.real) * self.box[self.PERIOD_X]
            d.y += ti.cast(image // 3 - 1, self.real) * self.box[self.PERIOD_Y]
        return d

    @ti.func
    def push_near(self, c, s, dt, shapes: ti.template(), balance: ti.template()):
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
            if ti.static(balance.on):
                now = balance.parts(damped, f_t, turn)
                balance.add(c, balance.took(balance.near_last[s], now, parting, v_t, spin, dt))
                balance.near_last[s] = now
                self.balance_body(c, i, b, f, t_body, n, arm, arm_i, dt, balance)
        else:
            if ti.static(balance.on):
                before = balance.near_last[s]
                if before.norm_sqr() > 0.0:
                    v_n, v_t, spin, parting = self.near_rates(i, b, n, curvature, arm, x.w - overlap, dt)
                    balance.add(c, balance.took(before, balance.nothing(), parting, v_t, spin, dt))
                    balance.near_last[s] = balance.nothing()
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
        balance: ti.template(),
    ):
        """Up to ``steps`` steps on a CPU; stops by itself where new lists are needed.

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
                                if ti.atomic_max(self.claim[c * CACHE_LINE], phase + 1) <= phase:
                                    if phase % 2 == 0:
                                        self.move(c, dt, limit, ti.Vector([gx, gy, gz]), keep)
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
        balance: ti.template(),
    ):
        """One step on a GPU, where every grain is a chunk; nothing where new lists are needed, as in ``run``."""
        for c in range(self.count[self.CHUNKS]):
            if self.halted[None] == 0:
                self.move(c, dt, limit, ti.Vector([gx, gy, gz]), keep)
        for c in range(self.count[self.CHUNKS]):
            if self.moved[None] == 0:
                self.push(c, dt, shapes, rest, balance)
                if c == 0:
                    self.done[None] = self.done[None] + 1
            elif c == 0:
                self.halted[None] = 1

    @ti.kernel
    def push_all(self, dt: float, shapes: ti.template(), rest: ti.template(), balance: ti.template()):
        """The forces of the step that was interrupted by new lists."""
        for _ in range(1):
            self.ticket[QUEUE] = 0
        for w in range(self.cpu_items if ti.static(not self.gpu) else self.count[self.CHUNKS]):
            c = self.next_chunk(w, True)
            while c < self.count[self.CHUNKS]:
                self.push(c, dt, shapes, rest, balance)
                c = self.next_chunk(w, False)
