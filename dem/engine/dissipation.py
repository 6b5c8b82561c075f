"""The energy balance of contacts: work against dashpots, friction and turning, summed while the bed runs.

A step carries a pair from one set of forces to the next at one velocity (leapfrog), so what a part of the force takes
over it is minus the mean of the part before and after, times that velocity, times dt: the same sum as that of
``experiments.validate.base.energy`` in another order, of second order in the step, its memory the parts of the step
before. Three parts: the normal dashpot, the tangential force (its spring included), the rolling and twisting torque
(likewise). What the springs hold, ``dem.engine.energy`` reads off; less that, the last two are friction.

Friction is kept contact by contact as well: take the work of a contact's part over a step, less the energy that its
spring gained. It is *lost* where it is positive and *made* where it is negative. A law without a fault makes nothing.

Beside it stands the balance of angular momentum about the bed's origin: the part that the bodies took, and the part
that reaches grains from outside. The latter has four sources. Weight is the first. Contacts across the periodic sides
are the second: the torques on a pair whose neighbour is an image do not cancel but leave the period x F. Grains put
back into the box at its other side are the third. Sleepers are the fourth: the forces of others on them, and the loss
of falling asleep. Leapfrog's x_n x m v_(n+1/2) changes by exactly the sum of these each step.

A bed without a balance has ``ABSENT`` for a table, and its kernels are compiled without all this.
"""

import itertools

import numpy as np

from dem.contact.law import springs_hold
from hedgebed_taichi import ti

from .lists import INDEX_BITS, INDEX_MASK, SAME_IMAGE
from .rows import Rows, Zeroes
from .values import EnginePart, State

__all__ = ["FRICTION", "OUTSIDE", "PARTS", "TURNED", "BalanceKernels", "Balance"]

PARTS = ("damping", "tangential", "turning")
FRICTION = ("tangential_lost", "tangential_made", "turning_lost", "turning_made")
TURNED = ("outside", "first_body", "bodies")
OUTSIDE, FIRST, OTHERS = range(3)
# Of a row of ``last``: the normal dashpot's force, the tangential force, the turning torque, what the springs of the
# last two hold; less than nothing where that is not known.
_WIDTH = 9
_HELD = 7


@ti.data_oriented
class Balance:
    """Parts of the forces of the last step, by row of the pair lists and the near lists, and the sums of chunks."""

    on = True
    outside = OUTSIDE

    def __init__(self, *, rows: int, near: int, chunks: int, real):
        self.real = real
        F = ti.Vector.field
        self.last, self.old_last = (F(_WIDTH, real, rows) for _ in range(2))
        self.near_last, self.old_near_last = (F(_WIDTH, real, near) for _ in range(2))
        self.taken = F(len(PARTS), ti.f64, chunks)
        self.rubbed = F(len(FRICTION), ti.f64, chunks)
        # Angular impulses about the bed's origin: from outside, to the first body (the floor, where there is one), to
        # the other bodies; and gravity.
        self.turned = F(3, ti.f64, (chunks, len(TURNED)))
        self.pull = F(3, ti.f64, ())
        self._zeroes = Zeroes(self.last, self.near_last, self.taken, self.rubbed, self.turned)

    def clear(self) -> None:
        """A new balance: no sums, nothing remembered."""
        self._zeroes.put()

    def sums(self) -> dict[str, np.ndarray]:
        """Over all chunks, in their order: work by ``PARTS`` and ``FRICTION`` [J], and angular impulses by ``TURNED``
        [N m s], [3]."""
        found = (np.cumsum(field.to_numpy(), axis=0)[-1] for field in (self.taken, self.rubbed, self.turned))
        return dict(zip(PARTS + FRICTION + TURNED, itertools.chain(*found), strict=True))

    @staticmethod
    def rows(pairs: np.ndarray, near: np.ndarray) -> dict[str, Rows]:
        """Rows of the fields that its next step depends on; ``pairs``, ``near``: those of the lists in use."""
        whole = dict.fromkeys(("taken", "rubbed", "turned"), slice(None))
        return {"last": pairs, "near_last": near, **whole}

    @staticmethod
    def of_today(values: State, *, prefix: str) -> State:
        """The fields of a state; of one from before friction was kept by contact, with what springs held unknown."""
        found = dict(values)
        for name in (f"{prefix}last", f"{prefix}near_last"):
            missing = _WIDTH - found[name].shape[1]
            found[name] = np.pad(found[name], ((0, 0), (0, missing)), constant_values=-1.0)
        found.setdefault(f"{prefix}rubbed", np.zeros((len(found[f"{prefix}taken"]), len(FRICTION))))
        return found

    @ti.func
    def nothing(self):
        """A row of ``last`` of a pair apart."""
        return ti.Vector.zero(self.real, _WIDTH)

    @ti.func
    def parts(self, damped, f_t, turn, held_t, held_r):
        """A row of ``last``."""
        return ti.Vector([damped, f_t.x, f_t.y, f_t.z, turn.x, turn.y, turn.z, held_t, held_r])

    @ti.func
    def seen_from(self, sign, row):
        """A row of ``last`` as the second grain of a pair has it, where ``sign`` is -1."""
        other = sign * row
        for k in ti.static((0, _HELD, _HELD + 1)):
            other[k] = row[k]
        return other

    @ti.func
    def took(self, before, now, v_n, v_t, spin, dt):
        """What the parts took [J] over a step in which the pair parted at v_n, slid at v_t and turned at ``spin``."""
        p = -0.5 * dt * (before + now)
        return ti.Vector(
            [p[0] * v_n, p[1] * v_t.x + p[2] * v_t.y + p[3] * v_t.z, p[4] * spin.x + p[5] * spin.y + p[6] * spin.z]
        )

    @ti.func
    def add(self, c, share, before, now, took):
        """To a chunk's sums: ``share`` of what the parts of a row took."""
        self.taken[c] = self.taken[c] + ti.cast(share * took, ti.f64)
        # All zero: a contact that has just begun, or woken; of the second what it held before is not known.
        known = before[_HELD] >= 0.0 and before.norm_sqr() > 0.0
        for k in ti.static(range(2)):
            lost = ti.cast(share * (took[1 + k] - (now[_HELD + k] - before[_HELD + k])), ti.f64)
            self.rubbed[c][2 * k] = self.rubbed[c][2 * k] + ti.max(lost, 0.0)
            self.rubbed[c][2 * k + 1] = self.rubbed[c][2 * k + 1] + ti.select(known, ti.max(-lost, 0.0), 0.0)

    @ti.func
    def lose(self, c, energy):
        """To a chunk's sums: kinetic energy [J] that is lost as in a dashpot, of grains that change their pace."""
        self.taken[c][0] = self.taken[c][0] + ti.cast(energy, ti.f64)

    @ti.func
    def turn(self, c, which: ti.template(), impulse):
        """To a chunk's angular impulses."""
        self.turned[c, which] = self.turned[c, which] + ti.cast(impulse, ti.f64)


@ti.data_oriented
class BalanceKernels(EnginePart):
    """The part of the engine that sums the balance of pairs."""

    @ti.func
    def balance_pair(self, c, s, i, j, d, now, dt, rest: ti.template(), balance: ti.template()):
        """What a pair's row took over the step; ``now`` the parts of its force."""
        length = d.norm()
        n = d / length
        v = self.velocity[i].xyz - self.velocity[j].xyz
        v_n = v.dot(n)
        v_t = v - v_n * n
        h = 0.5 * dt / length
        half = 0.5 * (self.position[i].w + self.position[j].w - length) + 0.25 * dt * v_n
        w_i, w_j = self.spin[i].xyz, self.spin[j].xyz
        turning = (self.position[i].w - half) * w_i + (self.position[j].w - half) * w_j
        if ti.static(self.rescaled):
            turning += turning.dot(n) * h * v_t
        before = balance.last[s]
        took = balance.took(
            before, now, v_n - h * v_t.norm_sqr(), (1.0 + h * v_n) * v_t - turning.cross(n), w_i - w_j, dt
        )
        balance.last[s] = now
        balance.add(c, self.share_of_row(c, j, rest), before, now, took)

    @ti.func
    def share_of_row(self, c, j, rest: ti.template()):
        """Of a pair, what chunk c counts: half of it where the other side has a row too."""
        start, end = self.chunk_range(c)
        share = ti.cast(0.5, self.real)
        if j >= start and j < end:
            share = ti.cast(1.0, self.real)
        if ti.static(rest.on):
            if j >= self.alone_from(c):
                share = ti.cast(1.0, self.real)
        return share

    @ti.func
    def pair_row(self, s, i, j, d, n, damped, f_t, turn, balance: ti.template()):
        """A row of ``Balance.last``: of the pair in row ``s``."""
        r_i, r_j = self.position[i].w, self.position[j].w
        q = d * 0.0
        if ti.static(self.rolling):
            q = self.roll[s]
        held_t, held_r = springs_hold(
            self.grain_pair[None], n, r_i + r_j - d.norm(), r_i * r_j / (r_i + r_j), self.slide[s], q, self.cohesion
        )
        return balance.parts(damped, f_t, turn, held_t, held_r)

    @ti.func
    def balance_weight(self, c, dt, balance: ti.template()):
        """Gravity's angular impulse on the grains of a chunk."""
        start, end = self.chunk_range(c)
        moment = ti.Vector.zero(ti.f64, 3)
        for i in range(start, end):
            moment += ti.cast(self.velocity[i].w * self.position[i].xyz, ti.f64)
        balance.turn(c, OUTSIDE, ti.cast(dt, ti.f64) * moment.cross(balance.pull[None]))

    @ti.func
    def balance_turning(self, c, bits, f, f_t, turn, n, arm_j, dt, rest: ti.template(), balance: ti.template()):
        """Of a touching pair's force: what crosses the periodic sides, and what a sleeper takes."""
        j = bits & INDEX_MASK
        image = bits >> INDEX_BITS
        sleeps = False
        if ti.static(rest.on):
            sleeps = j >= self.count[self.AWAKE]
        if image != SAME_IMAGE or sleeps:
            shift = ti.Vector.zero(self.real, 3)
            shift.x = ti.cast(image % 3 - 1, self.real) * self.box[self.PERIOD_X]
            shift.y = ti.cast(image // 3 - 1, self.real) * self.box[self.PERIOD_Y]
            out = -self.share_of_row(c, j, rest) * shift.cross(f)
            if sleeps:
                out -= arm_j * f_t.cross(n) - turn - self.position[j].xyz.cross(f)
            balance.turn(c, OUTSIDE, dt * out)

    @ti.func
    def balance_body(self, c, i, b, f, t_body, n, arm, arm_i, dt, balance: ti.template()):
        """Of a grain's force on a body's row: what the body took, and what crosses the periodic sides."""
        at = self.body_position[b]
        # From the grain to where the body has the contact: a period where an image of the body is met.
        off = at + arm + arm_i * n - self.position[i].xyz
        shift = ti.Vector.zero(self.real, 3)
        shift.x = ti.round(off.x / self.box[self.PERIOD_X]) * self.box[self.PERIOD_X]
        shift.y = ti.round(off.y / self.box[self.PERIOD_Y]) * self.box[self.PERIOD_Y]
        balance.turn(c, OUTSIDE, -dt * shift.cross(f))
        taken = dt * (t_body - at.cross(f))
        if b == 0:
            balance.turn(c, FIRST, taken)
        else:
            balance.turn(c, OTHERS, taken)
