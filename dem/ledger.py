"""The book of what contacts take: work against dashpots, friction and turning, summed while the bed runs.

A step carries a pair from one set of forces to the next at one velocity (leapfrog), so what a part of the force takes
over it is minus the mean of the part before and after, times that velocity, times dt: the same sum as that of
``experiments.validate.energy`` in another order, of second order in the step and without a memory but the parts of the
step before. Three parts: the normal dashpot, the tangential force (its spring included), the rolling and twisting
torque (likewise). What the springs hold, ``dem.energy`` reads off; less that, the last two are friction.

A bed without a book has ``NO_LEDGER`` for a table, and its kernels are compiled without all this.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import taichi as ti

from .lists import AWAKE

__all__ = ["NO_LEDGER", "PARTS", "Bookkeeping", "Ledger"]

PARTS = ("damping", "tangential", "turning")
# Of a row of ``last``: the normal dashpot's force, the tangential force, the turning torque.
_WIDTH = 7


@ti.data_oriented
class _NoLedger:
    """Stands where no book is kept."""

    on = False


NO_LEDGER = _NoLedger()


@ti.data_oriented
class Ledger:
    """Parts of the forces of the last step, by row of the pair lists and the near lists, and the sums of chunks."""

    on = True

    def __init__(self, *, rows: int, near: int, chunks: int, real):
        self.real = real
        F = ti.Vector.field
        self.last = F(_WIDTH, real, rows)
        self.old_last = F(_WIDTH, real, rows)
        self.near_last = F(_WIDTH, real, near)
        self.old_near_last = F(_WIDTH, real, near)
        self.taken = F(len(PARTS), ti.f64, chunks)

    def clear(self) -> None:
        """A new book: no sums, nothing remembered."""
        for field in (self.last, self.near_last, self.taken):
            field.fill(0)

    def sums(self) -> np.ndarray:
        """Over all chunks, in their order, shape [3] [J]."""
        return np.asarray(np.cumsum(self.taken.to_numpy(), axis=0)[-1])

    def state(self, rows: np.ndarray, near: np.ndarray) -> dict[str, np.ndarray]:
        """All that the book's next step depends on; ``rows``, ``near``: of the lists, those in use."""
        return {
            "ledger_last": self.last.to_numpy()[rows],
            "ledger_near_last": self.near_last.to_numpy()[near],
            "ledger_taken": self.taken.to_numpy(),
        }

    def restore(self, state: dict[str, np.ndarray], rows: np.ndarray, near: np.ndarray) -> None:
        """Go back to what ``state`` gave; the lists are already as they were."""
        for field, name, where in (
            (self.last, "ledger_last", rows), (self.near_last, "ledger_near_last", near),
            (self.taken, "ledger_taken", slice(None)),
        ):  # fmt: skip
            array = np.zeros_like(field.to_numpy())
            array[where] = state[name]
            field.from_numpy(array)

    @ti.func
    def nothing(self):
        """A row of ``last`` of a pair apart."""
        return ti.Vector.zero(self.real, _WIDTH)

    @ti.func
    def parts(self, damped, f_t, turn):
        """A row of ``last``."""
        return ti.Vector([damped, f_t.x, f_t.y, f_t.z, turn.x, turn.y, turn.z])

    @ti.func
    def took(self, before, now, v_n, v_t, spin, dt):
        """What the parts took [J] over a step in which the pair parted at v_n, slid at v_t and turned at ``spin``."""
        p = -0.5 * dt * (before + now)
        return ti.Vector(
            [
                p[0] * v_n,
                p[1] * v_t.x + p[2] * v_t.y + p[3] * v_t.z,
                p[4] * spin.x + p[5] * spin.y + p[6] * spin.z,
            ]
        )

    @ti.func
    def add(self, c, took):
        """To a chunk's sums."""
        self.taken[c] = self.taken[c] + ti.cast(took, ti.f64)


@ti.data_oriented
class Bookkeeping:
    """The part of the engine that keeps the book of pairs."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    @ti.func
    def book_pair(self, c, s, i, j, d, now, dt, rest: ti.template(), ledger: ti.template()):
        """What a pair's row took over the step; ``now`` the parts of its force."""
        start, end = self.chunk_range(c)
        length = d.norm()
        n = d / length
        v = self.velocity[i].xyz - self.velocity[j].xyz
        v_n = v.dot(n)
        v_t = v - v_n * n
        h = 0.5 * dt / length
        half = 0.5 * (self.position[i].w + self.position[j].w - length) + 0.25 * dt * v_n
        w_i, w_j = self.spin[i].xyz, self.spin[j].xyz
        turning = (self.position[i].w - half) * w_i + (self.position[j].w - half) * w_j
        took = ledger.took(
            ledger.last[s], now, v_n - h * v_t.norm_sqr(), (1.0 + h * v_n) * v_t - turning.cross(n), w_i - w_j, dt
        )
        ledger.last[s] = now
        # Across chunks both sides have a row; a sleeper has none.
        share = ti.cast(0.5, self.real)
        if j >= start and j < end:
            share = ti.cast(1.0, self.real)
        if ti.static(rest.on):
            if j >= self.count[AWAKE]:
                share = ti.cast(1.0, self.real)
        ledger.add(c, share * took)
