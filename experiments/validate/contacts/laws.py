"""What the codes do where a contact slides, written again in numpy: each law of sliding on the same assembly.

All have Hertz's spring with the dashpot of Tsuji et al. 1992 along the normal, and sideways Mindlin's no-slip spring
(8 G* a) with a dashpot and history. With k u the spring's pull, c v the dashpot's and N = mu |F_n|, the dashpot's part
in F_n included, they differ in this:

- LIGGGHTS (``tangential history``; its manual, gran_tangential_history: Ft_spring is held at cof Fn): where k |u| > N
  the force is N along the spring, which is set back to N / k, without the dashpot; else k u + c v, unbounded.
- the bed (docs/bed.md): the same, but the sum k u + c v is held within N, too. The spring is not set back for that.
- LAMMPS (``pair_style granular``, ``tangential mindlin``; its manual has the two formulas): where |k u + c v| > N the
  force is N along that sum (nothing where the spring has no length yet), and the spring is set back to
  u = -(F_t + c v) / k: to N less the dashpot's part. Moreover c is that of the normal dashpot, the spring is turned
  into the contact's plane at its full length before the step's slip is added, and spins slip with the whole radius.

The motion is that of both codes: velocity Verlet, whose forces see the velocities of half a step before, the slip taken
across the normal of the step's end. It is of first order in the step, so that the peers are met to rounding and the bed
to first order.
"""

import math

import numpy as np

from dem.contact.law import damping_factor, effective_moduli
from experiments.validate.base.energy import flat, within
from experiments.validate.base.peers import Assembly

__all__ = ["SLIDING", "written_again"]

Array = np.ndarray
SLIDING = ("bed", "liggghts", "lammps")


def written_again(
    law: str, assembly: Assembly, *, young: float, poisson: float, density: float, restitution: float, friction: float
) -> Array:
    """Position, velocity, spin and force of each grain at each sample, shape [samples, grain_count, 12].

    ``law``: of sliding, one of ``SLIDING``. Raises ValueError for an unknown law.
    """
    if law not in SLIDING:
        raise ValueError(f"law = {law!r} is unknown; use one of {', '.join(SLIDING)}")
    grains = _Grains(law, assembly, young, poisson, density, restitution, friction)
    found = []
    for step in range(assembly.steps + 1):
        if step:
            grains.step()
        if step % assembly.every == 0:
            found.append(np.hstack([grains.x, grains.v, grains.w, grains.f]))
    return np.array(found)


class _Grains:
    """Grains in a box periodic in x and y, in the air."""

    def __init__(self, law: str, assembly: Assembly, young, poisson, density, restitution, friction) -> None:
        self.law, self.dt, self.r = law, assembly.step, assembly.radii
        self.x, self.v, self.w = assembly.positions.copy(), assembly.velocities.copy(), assembly.spins.copy()
        self.m = density * 4 / 3 * math.pi * self.r**3
        self.inertia = 0.4 * self.m * self.r**2
        self.weight = np.outer(self.m, [0.0, 0.0, -assembly.gravity])
        self.period = np.array([*assembly.period, math.inf])
        self.star, self.shear = effective_moduli(young, poisson, young, poisson)
        self.factor, self.mu = damping_factor(restitution, tensile=True), friction
        self.i, self.j = np.triu_indices(len(self.r), 1)
        self.stretch = np.zeros((len(self.i), 3))
        self.push(0.0)

    def step(self) -> None:
        """One of velocity Verlet; contacts see the velocities in its middle."""
        self.kick()
        self.x = self.x + self.dt * self.v
        self.push(self.dt)
        self.kick()

    def kick(self) -> None:
        self.v = self.v + 0.5 * self.dt / self.m[:, None] * self.f
        self.w = self.w + 0.5 * self.dt / self.inertia[:, None] * self.torque

    def push(self, dt: float) -> None:
        """Forces where the grains are; ``dt`` is how long they have slid since the last."""
        d = self.x[self.i] - self.x[self.j]
        d[:, :2] -= self.period[:2] * np.round(d[:, :2] / self.period[:2])
        length = np.linalg.norm(d, axis=1)
        overlap = self.r[self.i] + self.r[self.j] - length
        k = np.flatnonzero(overlap > 0)
        self.stretch[overlap <= 0] = 0.0
        i, j, n, overlap = self.i[k], self.j[k], (d / length[:, None])[k], overlap[k]
        mass = self.m[i] * self.m[j] / (self.m[i] + self.m[j])
        a = np.sqrt(self.r[i] * self.r[j] / (self.r[i] + self.r[j]) * overlap)
        s_n, k_t = 2 * self.star * a, 8 * self.shear * a
        arms = [self.r[g] - 0.5 * overlap for g in (i, j)]
        path = self.v[i] - self.v[j]
        v_n = (path * n).sum(axis=1)
        turn_i, turn_j = (self.r[i], self.r[j]) if self.law == "lammps" else arms
        slip = path - v_n[:, None] * n - np.cross(turn_i[:, None] * self.w[i] + turn_j[:, None] * self.w[j], n)
        f_n = 2 / 3 * s_n * overlap - self.factor * np.sqrt(mass * s_n) * v_n
        if self.law == "lammps":
            c_t = self.factor * np.sqrt(mass * s_n)
        else:
            c_t = self.factor * np.sqrt(mass * k_t)
        u = self.turned(self.stretch[k], n, slip * dt)
        f_t, self.stretch[k] = self.sideways(u, slip, k_t, c_t, self.mu * np.abs(f_n))
        force = f_n[:, None] * n + f_t
        self.f, self.torque = self.weight.copy(), np.zeros_like(self.w)
        np.add.at(self.f, i, force)
        np.add.at(self.f, j, -force)
        turning = np.cross(n, f_t)
        np.add.at(self.torque, i, -arms[0][:, None] * turning)
        np.add.at(self.torque, j, -arms[1][:, None] * turning)

    def turned(self, u: Array, n: Array, slid: Array) -> Array:
        """The springs in the contacts' planes, with what has been slid since."""
        if self.law != "lammps":
            return flat(u + slid, n)
        across = flat(u, n)
        was, now = np.linalg.norm(u, axis=1), np.linalg.norm(across, axis=1)
        return across * np.where(now > 0, was / np.where(now > 0, now, 1.0), 1.0)[:, None] + slid

    def sideways(self, u: Array, slip: Array, k_t: Array, c_t: Array, bound: Array) -> tuple[Array, Array]:
        """Force on the first of each pair, and the springs as they are left."""
        spring, dashpot = -k_t[:, None] * u, -c_t[:, None] * slip
        if self.law == "lammps":
            force = spring + dashpot
            held = within(force, bound)
            slides = (np.abs(held - force) > 0).any(axis=1)[:, None]
            fresh = (np.abs(u) == 0).all(axis=1)[:, None]  # grains in touch at the start, which have not slid yet
            return np.where(slides & fresh, 0.0, held), np.where(slides & ~fresh, -(held - dashpot) / k_t[:, None], u)
        held = within(spring, bound)
        slides = (np.abs(held - spring) > 0).any(axis=1)[:, None]
        left = np.where(slides, -held / k_t[:, None], u)
        force = np.where(slides, held, spring + dashpot)
        return (force if self.law == "liggghts" else within(force, bound)), left
