"""An energy balance kept outside the bed: its motion as the bed has it, the forces written again.

Leapfrog makes it exact: the kinetic energy of the half-step velocities changes by F (v- + v+) / 2 dt over a step. So
whatever the law, the change is the sum of the works of the parts of each contact's force. The normal spring's work is
held against 2/5 k delta^2.5, which it meets to second order in the step; what dashpots and friction take is summed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dem import Bed
from dem.contact.law import TURNING_DAMPING_RATIO, damping_factor, effective_moduli

__all__ = ["EnergyRecord", "flat", "record_energy", "within"]

Array = np.ndarray


@dataclass(frozen=True)
class EnergyRecord:
    """What became of the energy of a cluster, shapes [n].

    The parts [J] are: kinetic; stored in springs (normal, tangential, turning); lost since the start (damped: to the
    normal dashpots; rubbed, turned: the work against tangential forces and turning torques less what their springs
    hold); under gravity also potential, from the start.
    """

    time: Array  # [s]
    parts: dict[str, Array]
    force_error: float  # largest difference of a grain's force from the bed's, over the largest force

    @property
    def total(self) -> Array:
        """All of it, which should stay."""
        return np.sum(list(self.parts.values()), axis=0)

    @property
    def gap(self) -> Array:
        """What the balance does not account for."""
        return self.total - self.total[0]

    def largest_return(self, part: str) -> float:
        """The largest fall of what is lost, which only grows where nothing makes energy [J]."""
        lost = self.parts[part]
        return float((np.maximum.accumulate(lost) - lost).max())


def flat(u: Array, normals: Array) -> Array:
    """The parts of vectors across normals, shape [n, 3]."""
    return u - (u * normals).sum(axis=1)[:, None] * normals


def within(force: Array, bound: Array) -> Array:
    """Forces cut to bounds, shape [n, 3]."""
    size = np.linalg.norm(force, axis=1)
    return force * np.where(size > bound, bound / np.where(size > 0, size, 1.0), 1.0)[:, None]


class _Springs:
    """A spring, a dashpot and a bound for each pair, vectors of shape [pair, 3]."""

    def __init__(self, count: int):
        self.stretch = np.zeros((count, 3))
        self.stiffness = np.zeros(count)

    @property
    def stored(self) -> float:
        return 0.5 * float(self.stiffness @ (self.stretch**2).sum(axis=1))

    def turn(self, grown: Array, turned: Callable[[Array], Array], rate: Array, dt: float) -> None:
        """Rescaled and turned over a step, with half of what is added to it by ``load`` in it."""
        half = 0.5 * dt * rate
        self.stretch = grown[:, None] * turned(self.stretch + half) - half

    def load(self, stiffness: Array, damping: Array, rate: Array, bound: Array, dt: float) -> Array:
        """A step on: the force of each, shape [pair, 3]."""
        self.stiffness = stiffness
        self.stretch = self.stretch + rate * dt
        pull = stiffness * np.linalg.norm(self.stretch, axis=1)
        slides = pull > bound
        self.stretch *= np.where(slides, bound / np.where(slides, pull, 1.0), 1.0)[:, None]
        self.stretch[stiffness == 0] = 0.0
        force = -stiffness[:, None] * self.stretch
        return within(force - np.where(slides, 0.0, damping)[:, None] * rate, bound)


@dataclass(frozen=True)
class _Turn:
    """How pairs turn over a step, to second order: their normals by twice ``lean``, and about them by the mean of both
    spins; ``turned``: the sum of the spins times the step, shape [pair, 3] as all."""

    normals: Array
    lean: Array
    turned: Array

    @property
    def angle(self) -> Array:
        """About the normals, shape [pair, 1]."""
        return 0.5 * np.asarray((self.turned * (self.normals - self.lean)).sum(axis=1))[:, None]

    def about(self, u: Array) -> Array:
        """Vectors across the normals, turned about them."""
        return (1 - 0.5 * self.angle**2) * u + self.angle * np.cross(self.normals, u)

    def whole(self, u: Array) -> Array:
        """Turned with the normals: by reflections across the middle ones and the present ones."""
        middle = self.normals - self.lean
        u = u - 2 * (u * middle).sum(axis=1)[:, None] / (middle**2).sum(axis=1)[:, None] * middle
        return u - 2 * (u * self.normals).sum(axis=1)[:, None] * self.normals

    def across(self, u: Array) -> Array:
        """Vectors across the normals, turned with and about them."""
        with_them = u - (u * self.normals).sum(axis=1)[:, None] * (self.normals - self.lean)
        return (1 - 0.5 * self.angle**2) * with_them + self.angle * np.cross(self.normals, u)


class _Dashpot:
    """The normal dashpot of each pair, which sees the velocity at the time of its force, shapes [pair].

    In the step of the first touch it is the mean over the time from the touch to half a step later.
    """

    def __init__(self, count: int, mass: float, *, tensile: bool):
        self.mass, self.least = mass, -math.inf if tensile else 0.0
        self.rate, self.force = np.zeros(count), np.zeros(count)
        self.touched = np.zeros(count, dtype=bool)

    def load(self, spring: Array, damping: Array, rate: Array, overlap: Array, dt: float) -> Array:
        """A step on: the normal force of each. ``rate`` [m/s] of the distance, half a step before."""
        touching = overlap > 0
        came = np.where(rate < 0, -rate * dt, 0.0)
        fresh = touching & ~self.touched & (overlap < 1.001 * came)
        share = np.where(fresh, overlap, 1.0) / np.where(fresh, came, 1.0)
        damping = damping * np.where(fresh, 0.8 * (share + 0.5) ** 1.25 / share**0.25, 1.0)
        last = np.where(self.touched, self.rate, rate)
        ahead = rate + 0.5 * (rate - last) - 0.5 * dt / self.mass * np.where(self.touched, self.force, 0.0)
        force = (spring - damping * ahead) / (1 + 0.5 * dt / self.mass * damping)
        self.force = np.where(touching, np.maximum(self.least, force), 0.0)
        self.rate, self.touched = rate, touching
        return self.force


class _Contacts:
    """The law of docs/bed.md between like grains: the contact forces of one moment, and what its springs hold."""

    def __init__(self, bed: Bed, r: float, m: float, *, tensile: bool):
        stuff = bed.material
        self.r, self.radius, self.mass = r, r / 2, m / 2
        self.star, self.shear = effective_moduli(stuff.young, stuff.poisson, stuff.young, stuff.poisson)
        self.factor = damping_factor(stuff.restitution, tensile=tensile)
        self.mu, self.mu_r = stuff.friction, stuff.rolling_friction
        self.rescaled = stuff.tangential == "rescaled"
        self.period = np.array(bed.size[:2])
        self.i, self.j = np.triu_indices(bed.grain_count, 1)
        self.slide, self.roll, self.twist = (_Springs(len(self.i)) for _ in range(3))
        self.dashpot = _Dashpot(len(self.i), self.mass, tensile=tensile)

    def load(self, x: Array, v: Array, w: Array, took: float) -> None:
        """A step of ``took`` [s] on: the forces at places ``x``, the velocities those of half a step before."""
        i, j, mu, factor = self.i, self.j, self.mu, self.factor
        d = x[i] - x[j]
        d[:, :2] -= self.period * np.round(d[:, :2] / self.period)
        length = np.linalg.norm(d, axis=1)
        self.overlap, self.normals = np.maximum(0.0, 2 * self.r - length), d / length[:, None]
        overlap, normals, touching = self.overlap, self.normals, self.overlap > 0
        arm, a = self.r - overlap / 2, np.sqrt(self.radius * overlap)
        s_n, k_t = 2 * self.star * a, 8 * self.shear * a
        root = np.sqrt(self.mass * s_n)
        path = v[i] - v[j]
        v_n = (path * normals).sum(axis=1)
        elastic = 2 / 3 * s_n * overlap
        f_n = self.dashpot.load(elastic, factor * root, v_n, overlap, took)
        self.arm, self.normal, self.damped = arm, f_n, f_n - elastic
        self.f_t, self.torque = np.zeros((2, *normals.shape))
        # Half a step ago, where the velocities are, the normal was this and the arm longer by what it has lost since.
        lean = 0.5 * took * (path - v_n[:, None] * normals) / length[:, None]
        middle, turn = normals - lean, _Turn(normals, lean * (1 + took * v_n / length)[:, None], took * (w[i] + w[j]))
        # What the overlap was a step ago, where it has grown; the share is that of contact radii.
        closed = 2 * length * (lean**2).sum(axis=1) - took * v_n
        before = np.maximum(0.0, overlap - np.maximum(0.0, closed))
        grown = (overlap + 3 * before) / np.where(touching, 3 * overlap + before, 1.0)
        if mu > 0:
            back = arm - 0.25 * took * v_n
            slid = path - v_n[:, None] * middle
            v_t = slid - np.cross(back[:, None] * (w[i] + w[j]), normals - turn.lean if self.rescaled else normals)
            v_t = np.where(touching[:, None], flat(v_t, normals) if self.rescaled else v_t, 0.0)
            damping = factor * math.sqrt(4 * self.shear / self.star) * root
            if self.rescaled:
                self.slide.turn(grown, turn.across, v_t, took)
            else:
                self.slide.stretch = flat(self.slide.stretch, normals)
            self.f_t = self.slide.load(k_t, damping, v_t, mu * np.abs(f_n), took)
        if self.mu_r > 0:
            spin = np.where(touching[:, None], w[i] - w[j], 0.0)
            along = (spin * normals).sum(axis=1)[:, None] * normals
            share = 2 * TURNING_DAMPING_RATIO * math.sqrt(0.4 * self.mass) * self.radius
            k_r, k_w = k_t * self.radius**2, 0.5 * k_t * a * a
            if self.rescaled:
                whole = turn.whole(self.roll.stretch + self.twist.stretch + 0.5 * took * spin)
                twisted = (whole * normals).sum(axis=1)[:, None] * normals
                self.roll.stretch = grown[:, None] * turn.about(whole - twisted) - 0.5 * took * (spin - along)
                self.twist.stretch = grown[:, None] ** 3 * twisted - 0.5 * took * along
            else:  # one angle is kept for both, so that what the normal turns into changes hands
                angle = self.roll.stretch + self.twist.stretch
                self.twist.stretch = (angle * normals).sum(axis=1)[:, None] * normals
                self.roll.stretch = angle - self.twist.stretch
            bound = self.mu_r * self.radius * np.abs(f_n)
            self.torque = self.roll.load(k_r, share * np.sqrt(k_r), spin - along, bound, took)
            bound = 3 * math.pi / 16 * mu * a * np.abs(f_n)
            self.torque += self.twist.load(k_w, share * np.sqrt(k_w), along, bound, took)

    def losses(self, v: Array, w: Array) -> Array:
        """What the normal dashpots, the tangential forces and the torques take at these velocities [W], shape [3]."""
        i, j = self.i, self.j
        speed = v[i] - v[j] - np.cross(self.arm[:, None] * (w[i] + w[j]), self.normals)
        taken = (self.damped @ (speed * self.normals).sum(axis=1), (self.f_t * speed).sum())
        return -np.array([*taken, (self.torque * (w[i] - w[j])).sum()])

    def total(self, weight: Array, count: int) -> Array:
        """On each grain [N], shape [count, 3]."""
        total = np.tile(weight, (count, 1))
        np.add.at(total, self.i, self.normal[:, None] * self.normals + self.f_t)
        np.add.at(total, self.j, -self.normal[:, None] * self.normals - self.f_t)
        return total

    def stored(self) -> tuple[float, float, float]:
        """In normal, tangential and turning springs [J]."""
        normal = 0.4 * float((4 / 3 * self.star * math.sqrt(self.radius) * self.overlap**2.5).sum())
        return normal, self.slide.stored, self.roll.stored + self.twist.stored


def record_energy(bed: Bed, steps: int, *, every: int = 20, tensile: bool = False) -> EnergyRecord:
    """Advance a bed of like grains without a floor by ``steps``, recording where its energy goes.

    The law is that of docs/bed.md without cohesion, cut at zero unless ``tensile``. Grains must start apart, and under
    gravity reach no boundary.
    """
    dt, start = bed.time_step, bed.grains()
    r, m = float(start.radius[0]), float(start.mass[0])
    contacts = _Contacts(bed, r, m, tensile=tensile)
    inertia, weight = 0.4 * m * r * r, m * np.array(bed.gravity)
    lost, v, w, half_w = np.zeros(3), start.velocity, start.spin, start.spin
    worst = largest = 0.0
    rows: list[list[float]] = []
    for step in range(steps + 1):
        if step:
            bed.advance(1)
        g = bed.grains()
        # The bed's own velocities, half a step behind; ``grains`` has brought them to the time of the positions.
        old_v, old_w, v, w = v, w, g.velocity - 0.5 * dt / m * g.force, half_w
        half_w = 2 * g.spin - half_w
        if step:
            lost += dt * contacts.losses(0.5 * (old_v + v), 0.5 * (old_w + w))
        contacts.load(g.position, v, w, dt if step else 0.0)
        largest = max(largest, float(np.abs(g.force).max()))
        worst = max(worst, float(np.abs(g.force - contacts.total(weight, bed.grain_count)).max()))
        if step % every == 0:
            # The velocities of now hold half a step of the forces of now.
            so_far = lost + 0.5 * dt * contacts.losses(0.5 * (v + g.velocity), 0.5 * (w + g.spin))
            kinetic = 0.5 * m * float((g.velocity**2).sum()) + 0.5 * inertia * float((g.spin**2).sum())
            stored, held, turned = contacts.stored()
            fallen = -float(weight @ (g.position - start.position).sum(axis=0))
            losses = [so_far[0], so_far[1] - held, so_far[2] - turned]
            rows.append([step * dt, kinetic, stored, held, turned, *losses, fallen])
    names = ("kinetic", "normal", "tangential", "turning", "damped", "rubbed", "turned", "potential")
    columns = np.array(rows).T
    parts = dict(zip(names, columns[1:], strict=True))
    if not weight.any():
        del parts["potential"]
    return EnergyRecord(columns[0], parts, worst / largest if largest else 0.0)
