"""Forces between grains that touch: which rows of the pair lists touch, the force of a pair, and its sums.

On a CPU the forces of LANES pairs are computed at a time: their numbers are gathered into local arrays, and one loop
without a branch computes them all. The results are added to the grains in the order of the rows. LLVM turns that loop
into vector instructions, each for two to eight pairs. It cannot do so where fields are read or written in the loop,
since for all it knows they overlap.

The kernels belong to ``dem.engine.engine.Engine``, whose fields they use.
"""

from dem.contact.cohesion import JKR
from dem.contact.law import adhesive_range, contact_force, onset_of, turning_torque
from hedgebed_taichi import ti

from .lists import INDEX_BITS, INDEX_MASK, SAME_IMAGE
from .values import EnginePart

__all__ = ["Pairs"]

LANES = 64


@ti.data_oriented
class Pairs(EnginePart):
    """The part of the engine that computes the forces of pairs of grains."""

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
    def overlap_of(self, i, bits):
        """Of a grain and its neighbour, over their mean diameter [1]."""
        x_i, x_j = self.position[i], self.position[bits & INDEX_MASK]
        return 1.0 - self.apart(x_i, x_j, bits).norm() / (x_i.w + x_j.w)

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
    def sieve(self, c, dt, rest: ti.template(), balance: ti.template()):
        """Put the numbers of a chunk's rows that touch into ``touching``, from the chunk's first row on; their end.

        No branch that a processor would have to guess.
        """
        start, end = self.chunk_range(c)
        base = c * self.count[self.CHUNK_ROOM]
        rows = base
        if end > start:  # with sleepers a chunk may be empty
            rows = self.pair_end[end - 1]
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
            if ti.static(rest.on):
                touching = touching and not self.is_theirs(c, bits & INDEX_MASK)
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
    def pair_force(self, p, d, r_i, r_j, m_i, m_j, v, w_i, w_j, onset, dt, u: ti.template(), q: ti.template()):
        """Force of a pair on its first grain.

        ``p`` has the pair's parameters, ``d`` points from the second to the first [m]. Radii are in m, masses in kg.
        ``v`` is the first's velocity less the second's [m/s], spins are in rad/s. ``onset`` is from ``onset_of``; ``u``
        and ``q`` are the history, updated in place. Returns first (unit normal; normal force [N]; the dashpot's part of
        it [N]; tangential force [N]). Then follow rolling and twisting torque [N m], arm of the first and of the second
        [m] and overlap over diameter.
        """
        length = d.norm()
        sum_r = r_i + r_j
        overlap = sum_r - length
        mass = m_i + m_j
        # One division for three reciprocals.
        inverse = 1.0 / (length * sum_r * mass)
        by_length = sum_r * mass * inverse
        n = d * by_length
        by_sum = length * mass * inverse
        radius = r_i * r_j * by_sum
        mass = m_i * m_j * (length * sum_r * inverse)
        arm_i = r_i - 0.5 * overlap
        arm_j = r_j - 0.5 * overlap
        # The slip as ``dem.contact.law`` says it: across the normal half a step ago, n - h v_t, with the arms of then.
        v_n = v.dot(n)
        v_t = v - v_n * n
        h = 0.5 * dt * by_length
        back = 0.25 * dt * v_n
        turning = (arm_i - back) * w_i + (arm_j - back) * w_j
        closed = dt * (h * v_t.norm_sqr() - v_n)
        middle = n
        if ti.static(self.rescaled):
            lean = (h * (1.0 + 2.0 * h * v_n)) * v_t
            middle = n - lean
            turning += turning.dot(n) * lean
        angle = (0.5 * dt) * (w_i + w_j).dot(middle)
        v_t = (1.0 + h * v_n) * v_t - turning.cross(n)
        f_n, damped, f_t, k_t, a, root, load, grown = contact_force(
            p, n, v_n, v_t, overlap, radius, mass, onset, dt, u, self.tensile, self.cohesion,
            self.rescaled, closed, middle, angle,
        )  # fmt: skip
        turn = d * 0.0
        if ti.static(self.rolling):
            turn = turning_torque(
                p, n, w_i - w_j, load, k_t, a, radius, root, dt, q, self.rescaled, grown, middle, angle
            )
        return n, f_n, damped, f_t, turn, arm_i, arm_j, overlap * by_sum

    @ti.func
    def first_onset(self, d, r_i, r_j, m_i, m_j, v, past, dt):
        """``onset_of`` a pair, as ``pair_force`` takes it: 1, but for a pair without history."""
        onset = r_i * 0.0 + 1.0
        if past == 0.0:
            length, sum_r, mass = d.norm(), r_i + r_j, m_i + m_j
            inverse = 1.0 / (length * sum_r * mass)
            v_n = v.dot(d * (sum_r * mass * inverse))  # to the bit as in ``pair_force``
            onset = onset_of(v_n, sum_r - length, dt, past, self.cohesion)
        return onset

    @ti.func
    def push_lanes(self, c, base, last, dt, rest: ti.template(), balance: ti.template()):
        """Add the forces of the pairs in rows ``base`` to ``last`` of ``touching``, on a CPU.

        Returns the largest overlap over diameter, and the force on sleepers.
        """
        start, end = self.chunk_range(c)
        p = self.grain_pair[None]
        held = ti.Vector.zero(self.real, 3)
        largest = ti.Vector([0.0] * LANES, dt=self.real)
        heavy = ti.cast(1.0, self.real)
        if ti.static(rest.on):
            heavy = self.heaviness(c, rest)
        one = ti.Vector([1.0] * LANES, dt=self.real)  # what lanes without a pair compute with
        # Of each pair: distance, radii, masses, velocity, spins, histories, then what comes out.
        dx, dy, dz, ri, rj, mi, mj, vx, vy, vz = one, one, one, one, one, one, one, one, one, one
        wix, wiy, wiz, wjx, wjy, wjz, onset = one, one, one, one, one, one, one
        ux, uy, uz, uw, qx, qy, qz = one, one, one, one, one, one, one
        nx, ny, nz, fn, damping, fx, fy, fz, tx, ty, tz = one, one, one, one, one, one, one, one, one, one, one
        ai, aj = one, one
        for block in range((last - base + LANES - 1) // LANES):
            first = base + block * LANES
            filled = ti.min(LANES, last - first)
            for k in range(filled):
                s = self.touching[first + k]
                i = self.first[s]
                bits = ~self.pair[s]
                j = bits & INDEX_MASK
                x_i, x_j = self.position[i], self.position[j]
                d = self.apart(x_i, x_j, bits)
                dx[k], dy[k], dz[k], ri[k], rj[k] = d.x, d.y, d.z, x_i.w, x_j.w
                v_i, v_j = self.velocity[i], self.velocity[j]
                if ti.static(rest.on):
                    v_i.w *= heavy
                    v_j.w *= heavy
                v = v_i.xyz - v_j.xyz
                vx[k], vy[k], vz[k], mi[k], mj[k] = v.x, v.y, v.z, v_i.w, v_j.w
                w_i, w_j = self.spin[i], self.spin[j]
                wix[k], wiy[k], wiz[k] = w_i.x, w_i.y, w_i.z
                wjx[k], wjy[k], wjz[k] = w_j.x, w_j.y, w_j.z
                u = self.slide[s]
                ux[k], uy[k], uz[k], uw[k] = u.x, u.y, u.z, u.w
                onset[k] = self.first_onset(d, x_i.w, x_j.w, v_i.w, v_j.w, v, u.w, dt)
                if ti.static(self.rolling):
                    q = self.roll[s]
                    qx[k], qy[k], qz[k] = q.x, q.y, q.z
            for k in range(LANES):
                u = ti.Vector([ux[k], uy[k], uz[k], uw[k]])
                q = ti.Vector([qx[k], qy[k], qz[k]])
                d, v = ti.Vector([dx[k], dy[k], dz[k]]), ti.Vector([vx[k], vy[k], vz[k]])
                w_i, w_j = ti.Vector([wix[k], wiy[k], wiz[k]]), ti.Vector([wjx[k], wjy[k], wjz[k]])
                n, f_n, damped, f_t, turn, arm_i, arm_j, share = self.pair_force(
                    p, d, ri[k], rj[k], mi[k], mj[k], v, w_i, w_j, onset[k], dt, u, q
                )
                ux[k], uy[k], uz[k], uw[k] = u.x, u.y, u.z, u.w
                fx[k], fy[k], fz[k], fn[k] = f_t.x, f_t.y, f_t.z, f_n
                nx[k], ny[k], nz[k], ai[k], aj[k] = n.x, n.y, n.z, arm_i, arm_j
                largest[k] = ti.max(largest[k], ti.select(k < filled, share, largest[k]))
                if ti.static(self.rolling):
                    qx[k], qy[k], qz[k] = q.x, q.y, q.z
                    tx[k], ty[k], tz[k] = turn.x, turn.y, turn.z
                if ti.static(balance.on):
                    damping[k] = damped
            for k in range(filled):
                s = self.touching[first + k]
                self.slide[s] = ti.Vector([ux[k], uy[k], uz[k], uw[k]])
                turn = ti.Vector.zero(self.real, 3)
                if ti.static(self.rolling):
                    self.roll[s] = ti.Vector([qx[k], qy[k], qz[k]])
                    turn = ti.Vector([tx[k], ty[k], tz[k]])
                n, f_t = ti.Vector([nx[k], ny[k], nz[k]]), ti.Vector([fx[k], fy[k], fz[k]])
                held += self.add_pair(
                    c, s, start, end, n, fn[k], damping[k], f_t, turn, ai[k], aj[k], dt, rest, balance
                )
        result = largest[0]
        for k in range(1, LANES):
            result = ti.max(result, largest[k])
        return result, held

    @ti.func
    def add_pair(
        self, c, s, start, end, n, f_n, damped, f_t, turn, arm_i, arm_j, dt, rest: ti.template(), balance: ti.template()
    ):
        """Add a pair's force to its grains, the second only where it is of this chunk too; its force on a sleeper.

        That times the steps of which this one is; and where the second is slow and the first not, it is kept for that.
        """
        i = self.first[s]
        bits = ~self.pair[s]
        j = bits & INDEX_MASK
        f = f_n * n + f_t
        t = f_t.cross(n)
        self.force[i] = self.force[i] + f
        self.torque[i] = self.torque[i] + (arm_i * t + turn)
        if j >= start and j < end:
            self.force[j] = self.force[j] - f
            self.torque[j] = self.torque[j] + (arm_j * t - turn)
        if ti.static(balance.on):
            d = self.apart(self.position[i], self.position[j], bits)
            now = self.pair_row(s, i, j, d, n, damped, f_t, turn, balance)
            self.balance_pair(c, s, i, j, d, now, dt, rest, balance)
            self.balance_turning(c, bits, f, f_t, turn, n, arm_j, dt, rest, balance)
        held = ti.Vector.zero(self.real, 3)
        if ti.static(rest.on):
            if j >= self.count[self.AWAKE]:
                held -= self.steps_of(c, rest) * f
            elif j >= self.alone_from(c):
                self.keep_push(s, f, arm_j * t - turn, rest)
        return held
