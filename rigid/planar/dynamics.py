"""The equations of motion of one trial in one set of modes: what both integrators for single trials evaluate.

A *mode* states which spikes touch, which of them stick, and in which direction the others slide. It also states whether
the dry frictions of rig and bearing hold, and whether the torque acts. Within a mode the right-hand side is smooth;
modes change at events only.

Sticking is a constraint, its force comes from the equations of motion. One spike that sticks: its slip speed is zero.
Several share the horizontal force F in proportion to their loads N_n (docs/planar.md). So the virtual work of F is that
of sum N_n slip_n / sum N_n, and this mean stays zero: sticking takes no energy, and when all load but one spike's is
gone the constraint has become that spike's own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from rigid.model.model import State, assemble, make_parameters
from rigid.model.trial import Trial
from rigid.terms import STATE_FIELDS

__all__ = ["Contact", "Modes", "System"]

X, Y, THETA, VX, VY, OMEGA, WHEEL, WORK, LOST = range(9)
"""Entries of the state vector z: pose, speeds, speed of the wheel, work of the torque, energy dissipated."""
INNER, INNER_SPEED = 9, 10  # Two more where a term has a coordinate of its own (`System.inner`)

Triple = tuple[float, float, float]
Row = tuple[Triple, float, Triple]  # A, b and B of a constraint A a + b = 0 whose force is along B
_SLIGHT = 1e-300
_SHIFTING = 0.1
"""Where loads vanish, shares of them shift without bound as they end; `hold_still` then keeps the constraint alone."""


@dataclass(slots=True)
class Modes:
    """The modes of a moment (see the module)."""

    touching: list[int] = field(default_factory=list)
    slip: list[int] = field(default_factory=list)  # Of each spike: 0 sticks, +1 and -1 slides towards +x and -x
    top: list[float] = field(default_factory=list)  # Deepest depth of each spike [m] since it entered the ground
    held: list[float] = field(default_factory=list)  # Deepest depth of each spike [m] since it touched; empty: as `top`
    place: dict[int, float] = field(default_factory=dict)  # Where each spike last lifted off: x of the tip [m]
    out: set[int] = field(default_factory=set)  # Spikes that have since been above the undisturbed surface
    dry: list[int] = field(default_factory=lambda: [0, 0])
    """Dry friction of the rig and of the bearing: 0 holds; +1 and -1 slides up and down, turns clockwise and back."""
    torque_over: bool = False  # Whether the torque has ended for good
    resting: bool = False  # Whether nothing moves and nothing will
    inner: int = 1  # Mode of the term that has a coordinate of its own: 1 at the start, else 0

    def copy(self) -> "Modes":
        """A copy that can be changed."""
        return replace(
            self, touching=[*self.touching], slip=[*self.slip], top=[*self.top], held=[*self.held], dry=[*self.dry],
            place={**self.place}, out={*self.out},
        )  # fmt: skip

    def deepest(self, spike: int, depth: float) -> tuple[float, float]:
        """Deepest depths [m] since the spike entered the ground, and since it touched, with `depth` reached now."""
        top = max(self.top[spike], depth)
        return top, (max(self.held[spike], depth) if self.held else top)

    def remember(self, spike: int, depth: float) -> None:
        """The spike is at `depth` now."""
        self.top[spike] = max(self.top[spike], depth)
        if self.held:
            self.held[spike] = max(self.held[spike], depth)

    def touch(self, spike: int, depth: float, slip: float) -> None:
        """The spike touches, at `depth` (in a crater of its own above 0), and slides the way its `slip` goes."""
        self.touching = sorted([*self.touching, spike])
        self.slip[spike] = 1 if slip > 0 else -1
        self.top[spike] = max(self.top[spike], 0.0)
        if not self.held:
            self.held = [0.0] * len(self.top)
        self.held[spike] = depth

    @property
    def state(self) -> str:
        """`stand`, `pivot`, `slip` or `hop` (docs/planar.md)."""
        if not self.touching:
            return "hop"
        sticking = sum(self.slip[n] == 0 for n in self.touching)
        return "slip" if sticking == 0 else "pivot" if sticking == 1 else "stand"


@dataclass(slots=True)
class Contact:
    """One touching spike at the state last evaluated."""

    spike: int
    depth: float
    rate: float
    slip: float
    load: float  # Normal force that presses [N], as friction sees it; 0 where the ground pulls
    h: float
    d: float
    friction_bound: float  # mu_s load [N]
    given_way: float  # How far the ground under it has given way [m], and how fast it does [m/s]; `depth` is the rest
    settling: float


class System:
    """Evaluates one trial's equations of motion. Not thread-safe: it keeps what the last evaluation found."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        ground = trial.surface
        self.model = model = assemble(trial.terms, ground.name)
        self.q = ground.numbers
        self.p = make_parameters(trial.terms)()
        for name, value in trial.effect_numbers().items():
            setattr(self.p, name, value)
        self.s = State()
        for name in STATE_FIELDS:
            setattr(self.s, name, 0.0)
        count, s = trial.spike_count, self.s
        half = math.pi / count
        angles = [half + 2 * half * (n if n < count / 2 else n - count) for n in range(count)]
        self.cosines, self.sines = [math.cos(a) for a in angles], [math.sin(a) for a in angles]
        s.mass, s.inertia, s.length = trial.mass, trial.inertia, trial.spike_length
        s.counterweight = trial.counterweight
        s.stance, s.gravity, s.weight = trial.spike_length * math.cos(half), trial.pull_at_mass, trial.weight
        s.up_x, s.up_y = model.vertical(self.p)
        self.radius = model.tip_radius(self.p)
        if self.radius >= trial.spike_length:
            raise ValueError(
                f"tip-radius.radius = {self.radius:g} m must be below spike_length = {trial.spike_length:g} m"
            )
        self.crater = model.crater(self.p)
        self.has_memory = self._remembers()
        self.sheds = self.has_memory and (ground.law.has_memory or model.has("crater", "unload"))
        self.has_dry = model.has("vertical_friction", "rotation_friction")
        self.dry_axes: tuple[Triple, Triple] = ((s.up_x, s.up_y, 0.0), (0.0, 0.0, 1.0))
        self.settles = model.settles
        self.carries = model.has("added_mass")
        self.wall = model.wall(self.p)
        self.kept = max(self.crater, model.plastic_share(self.p))  # Of the deepest depth, in the crater that stays
        s.inner_mode = 1.0
        self.inner = bool(model.has("inner_mass") and model.inner(self.p, s)[0] > 0)
        self.first = INNER_SPEED + 1 if self.inner else INNER
        """Where in z begins how far the ground has given way: for each term that makes it do so, one a spike."""
        self.size = self.first + trial.spike_count * model.settles
        self.settled_shares = [share(self.p, s) for share in model.settled]
        self.settled_share = model.settled_share(self.p, s)
        self.mu_s, self.mu_d = trial.mu_s, trial.sliding_friction
        self.wheel_sign = 1.0 if trial.actuator == "motor" else -1.0
        # What the last evaluation found.
        self.contacts: list[Contact] = []
        self.stick_force = self.stick_load = self.stick_bound = 0.0
        self.dry_forces: Sequence[float] = (0.0, 0.0)  # Of the dry frictions that hold
        self.dry_bounds: Sequence[float] = (0.0, 0.0)
        self.inner_holds = 1.0
        self.implicit: Any = None  # Makes implicit steps, where the ground asks for them (`rigid.planar.methods`)
        self.acceleration = (0.0, 0.0, 0.0)
        self.mass = model.inertia(self.p, s)  # With what tips carry along

    def _remembers(self) -> bool:
        """Whether the deepest depth matters: not where the effects that look at it have no amplitude."""
        if not self.model.has_memory:
            return False
        depth = 1e-3
        fresh = self.model.contact(self.p, self.s, self.q, depth, -1.0, 0.0, depth, depth)
        again = self.model.contact(self.p, self.s, self.q, depth, -1.0, 0.0, 2 * depth, 2 * depth)
        return bool(self.crater != 0.0 or fresh != again)

    def arms(self, spike: int, z: Sequence[float]) -> tuple[float, float]:
        """h and d of `spike` (see `rigid.model.model`)."""
        c, s = math.cos(z[THETA]), math.sin(z[THETA])
        cosine = c * self.cosines[spike] - s * self.sines[spike]
        sine = s * self.cosines[spike] + c * self.sines[spike]
        return self.model.contact_arms(cosine, sine, self.s.length, self.radius)

    def given_way(self, spike: int, z: Sequence[float]) -> float:
        """How far the ground under the tip has given way [m]."""
        return sum(z[k] for k in self.settling(spike))

    def settling(self, spike: int) -> range:
        """Where in z stands how far the ground under the tip has given way, term by term."""
        return range(self.first + spike, self.size, self.trial.spike_count)

    def depth(self, spike: int, z: Sequence[float]) -> float:
        """How deep the tip is below the surface [m], which is where it has given way to."""
        return self.arms(spike, z)[0] - z[Y] - self.given_way(spike, z)

    def depth_and_slip(self, spike: int, z: Sequence[float]) -> tuple[float, float]:
        """Depth of the tip [m], and its speed along the ground [m/s]."""
        h, _ = self.arms(spike, z)
        return h - z[Y] - self.given_way(spike, z), z[VX] - z[OMEGA] * h

    def _crater_left(self, spike: int, z: Sequence[float], modes: Modes) -> tuple[float, float]:
        """What is left, at the tip's x, of the crater of a spike that left it: its depth there over the deepest one
        [1], and the slope of that over x [1/m]. Its walls slope evenly to a point."""
        deepest = self.kept * modes.top[spike] + self.given_way(spike, z)
        if spike not in modes.out or deepest <= 0:
            return 1.0, 0.0
        aside = z[X] - self.arms(spike, z)[1] - modes.place[spike]
        share = 1.0 - self.wall * abs(aside) / deepest
        return (share, -math.copysign(self.wall, aside) / deepest) if share > 0 else (0.0, 0.0)

    def bottom(self, spike: int, z: Sequence[float], modes: Modes) -> tuple[float, float]:
        """Depth below the undisturbed surface at which a spike in the air touches [m], and its slope over x [1]."""
        free = self.crater * modes.top[spike] + self.given_way(spike, z)
        share, slope = self._crater_left(spike, z, modes)
        return share * free, slope * free

    def inside(self, spike: int, z: Sequence[float], modes: Modes) -> bool:
        """Whether the tip is in the ground: below the bottom of its crater."""
        depth = self.depth(spike, z)
        if spike in modes.touching:
            return depth > self.crater * max(modes.top[spike], depth)
        return depth + self.given_way(spike, z) > self.bottom(spike, z, modes)[0]

    def leave(self, spike: int, z: Sequence[float], modes: Modes) -> None:
        """The spike lifts off; its crater stays at this place."""
        modes.touching = [m for m in modes.touching if m != spike]
        modes.slip[spike] = 0
        modes.place[spike] = z[X] - self.arms(spike, z)[1]

    def enter(self, spike: int, z: list[float], modes: Modes) -> None:
        """The spike touches: of the crater that it left there stays what is left at the tip's x."""
        share, _ = self._crater_left(spike, z, modes)
        modes.top[spike] *= share
        for k in self.settling(spike):
            z[k] *= share
        modes.out.discard(spike)
        modes.touch(spike, *self.depth_and_slip(spike, z))

    def forget(self, spike: int, z: list[float], modes: Modes) -> None:
        """The tip is above the undisturbed surface: its crater is forgotten, unless it has walls."""
        if self.wall > 0 and spike in modes.place:
            modes.out.add(spike)
        else:
            modes.top[spike] = 0.0
            for k in self.settling(spike):
                z[k] = 0.0

    def dry_speeds(self, z: Sequence[float]) -> list[float]:
        """Speeds that the dry frictions resist: vertical [m/s], rotation [rad/s]."""
        return [x * z[VX] + y * z[VY] + turn * z[OMEGA] for x, y, turn in self.dry_axes]

    def _set(self, time: float, z: Sequence[float]) -> None:
        s = self.s
        s.time = time
        s.x, s.y, s.theta, s.vx, s.vy, s.omega, s.wheel_speed = z[0], z[1], z[2], z[3], z[4], z[5], z[6]
        s.cosine, s.sine = math.cos(z[THETA]), math.sin(z[THETA])
        if self.inner:
            s.inner, s.inner_speed = z[INNER], z[INNER_SPEED]

    def inner_at_rest(self, z: Sequence[float]) -> float:
        """Where a term's own coordinate is in equilibrium in the pose of `z`."""
        self.s.x, self.s.y, self.s.theta = z[X], z[Y], z[THETA]
        return float(self.model.inner_start(self.p, self.s))

    def derivative(self, time: float, z: Sequence[float], modes: Modes) -> list[float]:
        """dz/dt at `time` [s] in these modes; what it finds on the way is kept (`contacts`, `stick_force` ...)."""
        if modes.resting:
            self.contacts, self.acceleration = [], (0.0, 0.0, 0.0)
            return [0.0] * len(z)
        s, p, model = self.s, self.p, self.model
        self._set(time, z)
        s.inner_mode = float(modes.inner)
        y, vx, vy, omega = z[Y], z[VX], z[VY], z[OMEGA]
        driving = bool(modes.touching) and not modes.torque_over
        s.torque = self.trial.torque * model.torque_factor(p, s) if driving else 0.0
        fx, fy, ft = model.applied(p, s)
        power = model.losses(p, s)
        mass = model.inertia(p, s)
        c, sn, crater = s.cosine, s.sine, self.crater
        contacts: list[Contact] = []
        sticking: list[tuple[Contact, float, float, float]] = []
        settling = [0.0] * (self.size - self.first)
        for n in modes.touching:
            cosine = c * self.cosines[n] - sn * self.sines[n]
            sine = sn * self.cosines[n] + c * self.sines[n]
            h, d = model.contact_arms(cosine, sine, s.length, self.radius)
            s.given_way = self.given_way(n, z)
            depth, rate, slip = h - y - s.given_way, -(vy + omega * d), vx - omega * h
            top, held = modes.deepest(n, depth)
            at = max(depth, crater * top * (1 + 1e-15) + _SLIGHT)  # touching: on the ground's side of the surface
            top, held = max(top, at), max(held, at)
            elastic, lost, _, side, factor_s, factor_d, grip = model.contact(p, s, self.q, at, rate, slip, top, held)
            normal = elastic + lost
            load = max(normal + grip, 0.0)
            power += lost * rate - side * slip
            into = rate  # the speed at which the spring is pressed
            for speed_of, k in zip(model.settle, self.settling(n), strict=True):
                speed = settling[k - self.first] = speed_of(p, s, at + z[k], slip, d / s.length, z[k])
                power += elastic * speed
                into -= speed
            if self.sheds and at >= top and into > 0:
                power += self._shed(at, slip, elastic) * into
            if self.carries and rate > 0:
                more, slope = model.added(p, at - crater * top)
                mass = _with_tip(mass, more, d)
                down = more * omega * omega * (h - self.radius)
                fy, ft = fy - down, ft - down * d
                power -= 0.5 * slope * into * (1 - crater if at >= top else 1.0) * rate * rate
            fx, fy, ft = fx + side, fy + normal, ft + normal * d - side * h
            contact = Contact(n, depth, rate, slip, load, h, d, self.mu_s * factor_s * load, s.given_way, rate - into)
            contacts.append(contact)
            if modes.slip[n]:
                friction = -modes.slip[n] * self.mu_d * factor_d * load
                fx, ft = fx + friction, ft - friction * h
                power -= friction * slip
            else:
                sticking.append((contact, at, top, held))
        rows: list[Row] = []
        if sticking:
            rows.append(self._stick_row(sticking, omega))
        bounds = model.dry_friction(p, s) if self.has_dry else (0.0, 0.0)
        for axis, bound, way in zip(self.dry_axes, bounds, modes.dry, strict=True):
            if bound > 0 and way:
                push = way * bound
                fx, fy, ft = fx - push * axis[0], fy - push * axis[1], ft - push * axis[2]
                power += push * (axis[0] * vx + axis[1] * vy + axis[2] * omega)
            elif bound > 0:
                rows.append((axis, 0.0, axis))
        a, forces = self._constrained(mass, (fx, fy, ft), rows)
        self.contacts, self.acceleration, self.mass = contacts, a, mass
        found = iter(forces)
        self.stick_force = next(found) if sticking else 0.0
        self.dry_bounds = bounds
        self.dry_forces = [next(found) if b > 0 and not way else 0.0 for b, way in zip(bounds, modes.dry, strict=True)]
        spin = self.wheel_sign * s.torque / self.trial.wheel_inertia
        rate = [vx, vy, omega, a[0], a[1], a[2], spin, s.torque * omega, power]
        if self.inner:
            own_mass, own_force, self.inner_holds = model.inner(p, s)
            rate += [s.inner_speed, own_force / own_mass]
        return [*rate, *settling] if settling else rate

    def _stick_row(self, sticking: list[tuple[Contact, float, float, float]], omega: float) -> Row:
        """The constraint A a + b = 0 of the spikes that stick, and the direction B of its force: (A, b, B)."""
        self.stick_load = sum(contact.load for contact, *_ in sticking)
        self.stick_bound = sum(contact.friction_bound for contact, *_ in sticking)
        if len(sticking) == 1:
            only = sticking[0][0]
            return (1.0, 0.0, -only.h), omega * omega * only.d, (1.0, 0.0, -only.h)
        total, mean, ay, at, b = self.stick_load, 0.0, 0.0, 0.0, 0.0
        for contact, depth, top, held in sticking:
            share = contact.load / total if total > 0 else 1.0 / len(sticking)
            mean += share * contact.h
            b += share * omega * omega * contact.d
            if contact.slip != 0.0 and total > 0:
                by_depth, by_rate = self._load_slopes(depth, contact, top, held)
                by_depth, by_rate = by_depth * contact.slip / total, by_rate * contact.slip / total
                if abs(by_rate) > _SHIFTING:
                    continue
                ay -= by_rate
                at -= by_rate * contact.d
                b += by_depth * (contact.rate - contact.settling) - by_rate * omega * omega * (contact.h - self.radius)
        return (1.0, ay, at - mean), b, (1.0, 0.0, -mean)

    def _load_slopes(self, depth: float, contact: Contact, top: float, held: float) -> tuple[float, float]:
        """d load / d depth [N/m] and d load / d rate [N s/m], by differences; in depth on the side it moves to."""
        if contact.load == 0.0:
            return 0.0, 0.0
        self.s.given_way = contact.given_way

        def load(z: float, rate: float) -> float:
            elastic, lost, *_, grip = self.model.contact(
                self.p, self.s, self.q, z, rate, contact.slip, max(top, z), max(held, z)
            )
            return elastic + lost + grip

        rate, dr = contact.rate, 1e-6 * abs(contact.rate) + 1e-12
        by_rate = (load(depth, rate + dr) - load(depth, rate - dr)) / (2 * dr)
        if depth < 1e-12:
            return 0.0, by_rate
        dz = math.copysign(1e-6 * depth, rate)  # where a spike is at its deepest, loading and unloading differ
        by_depth = (4 * load(depth + dz, rate) - load(depth + 2 * dz, rate) - 3 * load(depth, rate)) / (2 * dz)
        return by_depth, by_rate

    def _shed(self, depth: float, slip: float, elastic: float) -> float:
        """Work that the elastic force does not store, per depth, on new ground [N]: F - d(stored)/d(depth)."""
        if not self.model.law.has_memory and not self.model.has("unload"):
            return self.crater * elastic
        e = 1e-3 * depth

        def stored(z: float) -> float:
            return float(self.model.contact(self.p, self.s, self.q, z, 0.0, slip, z, z)[2])

        near, far = stored(depth + e) - stored(depth - e), stored(depth + 2 * e) - stored(depth - 2 * e)
        return elastic - (8 * near - far) / (12 * e) if e > 0 else 0.0

    def _constrained(self, mass: tuple[float, ...], force: Triple, rows: list[Row]) -> tuple[Triple, list[float]]:
        """Accelerations under `force` and the forces of the constraints A a + b = 0."""
        divide = self.model.divide_mass
        a = divide(*mass, *force)
        if not rows:
            return a, []
        answers = [divide(*mass, *row[2]) for row in rows]
        if len(rows) == 1:
            (A, b, _), m = rows[0], answers[0]
            push = -(A[0] * a[0] + A[1] * a[1] + A[2] * a[2] + b) / (A[0] * m[0] + A[1] * m[1] + A[2] * m[2])
            return (a[0] + push * m[0], a[1] + push * m[1], a[2] + push * m[2]), [push]
        matrix = [[sum(A[k] * m[k] for k in range(3)) for m in answers] for A, _, _ in rows]
        right = [-(sum(A[k] * a[k] for k in range(3)) + b) for A, b, _ in rows]
        pushes = _solve(matrix, right)
        a = tuple(a[k] + sum(push * m[k] for push, m in zip(pushes, answers, strict=True)) for k in range(3))
        return a, pushes

    def energy(self, time: float, z: Sequence[float], modes: Modes) -> Triple:
        """Kinetic energy, potential energy (weight, wires, springs) and energy stored in the ground [J]."""
        s, p, model = self.s, self.p, self.model
        self._set(time, z)
        xx, xy, yy, xt, yt, tt = model.inertia(p, s)
        vx, vy, w = z[VX], z[VY], z[OMEGA]
        kinetic = 0.5 * (xx * vx * vx + yy * vy * vy + tt * w * w) + xy * vx * vy + (xt * vx + yt * vy) * w
        if self.inner:
            kinetic += 0.5 * model.inner(p, s)[0] * s.inner_speed * s.inner_speed
        stored = 0.0
        for n in modes.touching:
            depth = max(self.depth(n, z), 0.0)
            _, d = self.arms(n, z)
            rate = -(vy + w * d)
            if self.carries and rate > 0:
                kinetic += 0.5 * model.added(p, depth - self.crater * modes.deepest(n, depth)[0])[0] * rate * rate
            stored += model.contact(p, s, self.q, depth, 0.0, 0.0, *modes.deepest(n, depth))[2]
        return kinetic, model.potential(p, s), stored

    def stored(self, spike: int, z: Sequence[float], modes: Modes) -> float:
        """Energy [J] that the ground stores under one spike."""
        depth = max(self.depth(spike, z), 0.0)
        return float(self.model.contact(self.p, self.s, self.q, depth, 0.0, 0.0, *modes.deepest(spike, depth))[2])

    def hold_still(self, z: list[float], modes: Modes) -> None:
        """Take from the speeds in `z` what the constraints of the spikes that stick do not allow.

        The change is the constraint's own impulse, so its energy, missing from the balance, is added to what is lost.
        """
        contacts = [contact for contact in self.contacts if modes.slip[contact.spike] == 0]
        rows: list[Triple] = []
        if contacts:
            total = sum(contact.load for contact in contacts)
            shares = [contact.load / total if total > 0 else 1 / len(contacts) for contact in contacts]
            rows.append((1.0, 0.0, -sum(share * c.h for share, c in zip(shares, contacts, strict=True))))
        holding = zip(self.dry_axes, self.dry_bounds, modes.dry, strict=True)
        rows += [axis for axis, bound, way in holding if bound > 0 and not way]
        if not rows:
            return
        v = (z[VX], z[VY], z[OMEGA])
        excess = [sum(A[k] * v[k] for k in range(3)) for A in rows]
        if all(e == 0.0 for e in excess):
            return
        answers = [self.model.divide_mass(*self.mass, *A) for A in rows]
        matrix = [[sum(A[k] * m[k] for k in range(3)) for m in answers] for A in rows]
        pushes = _solve(matrix, [-e for e in excess])
        for k in range(3):
            z[VX + k] += sum(push * m[k] for push, m in zip(pushes, answers, strict=True))
        # The impulse's work: push (u before + u after) / 2, and after it u = 0.
        z[LOST] -= 0.5 * sum(push * e for push, e in zip(pushes, excess, strict=True))


def _with_tip(mass: tuple[float, ...], more: float, d: float) -> tuple[float, ...]:
    """The mass matrix with `more` [kg] that moves down with a tip at `d`: it adds more J J^T, J = (0, -1, -d)."""
    xx, xy, yy, xt, yt, tt = mass
    return xx, xy, yy + more, xt, yt + more * d, tt + more * d * d


def _solve(matrix: list[list[float]], right: list[float]) -> list[float]:
    """Gauss with pivoting, up to 3 x 3."""
    count = len(right)
    rows = [[*matrix[i], right[i]] for i in range(count)]
    for i in range(count):
        pivot = max(range(i, count), key=lambda k: abs(rows[k][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for k in range(i + 1, count):
            factor = rows[k][i] / rows[i][i]
            rows[k] = [a - factor * b for a, b in zip(rows[k], rows[i], strict=True)]
    out = [0.0] * count
    for i in reversed(range(count)):
        out[i] = (rows[i][count] - sum(rows[i][k] * out[k] for k in range(i + 1, count))) / rows[i][i]
    return out
