"""Contact by contact and along the trajectory against LIGGGHTS and LAMMPS, where they are installed.

The law that all three have: Hertz along the normal, Mindlin's no-slip spring with history sideways, dashpots of Tsuji
et al. 1992, which may pull at a contact's end. They differ where a contact slides with a dashpot, and in small terms.
LAMMPS takes the whole radius as the arm of the spin, and keeps the length of the spring as it turns it. So every
assembly is run without friction; without dashpots; and with a friction that slides only where the normal force changes
its sign.

In time the peers are of first order: their dashpots see the velocity of half a step before, and their slip is taken
across the normal of the step's end. Where nothing else differs, the difference has to fall with the step.

Where a contact slides with a dashpot, each code is held against its own law, written here in numpy with one switch for
the three. Suppose a peer meets its own law to rounding, and the bed its own as well as where nothing slides. Then both
differ in that switch alone. How much it changes stands in the remarks, and is no error of either. With k u the spring's
pull, c v the dashpot's and N = mu |F_n|, the dashpot's part in F_n included, the laws are:

- LIGGGHTS (``tangential history``; its manual, gran_tangential_history: Ft_spring is held at cof Fn): where k |u| > N
  the force is N along the spring, which is set back to N / k, without the dashpot; else k u + c v, unbounded.
- the bed (docs/bed.md): the same, but the sum k u + c v is held within N, too. The spring is not set back for that.
- LAMMPS (``pair_style granular``, ``tangential mindlin``; its manual has the two formulas): where |k u + c v| > N the
  force is N along that sum (nothing where the spring has no length yet), and the spring is set back to
  u = -(F_t + c v) / k: to N less the dashpot's part. Moreover c is that of the normal dashpot. The spring is turned
  into the contact's plane at its full length before the step's slip is added. Spins slip with the whole radius.

The motion of the written law is that of both peers: velocity Verlet, whose forces see the velocities of half a step
before. So the peers are met to rounding and the bed to first order.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dem import Bed, Material
from dem.contact.law import damping_factor, effective_moduli
from experiments.validate.base import cloud, peers
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, tracked
from experiments.validate.base.energy import flat, within

__all__ = ["CASES", "Assembly", "dense", "pairs"]

Array = np.ndarray
_SMOOTH, _UNDAMPED = "e = 0.5, no friction", "e = 1, friction 0.5"
_STICKING, _SLIDING = "e = 0.5, friction 50", "e = 0.5, friction 0.5"
_GRAIN = partial(Material, "peers", 2600.0, 5e7, 0.3, tangential="displacement")  # as `history` and `mindlin` are
LAWS = {
    _SMOOTH: _GRAIN(friction=0.0, restitution=0.5),
    _UNDAMPED: _GRAIN(friction=0.5, restitution=1.0),
    _STICKING: _GRAIN(friction=50.0, restitution=0.5),
    _SLIDING: _GRAIN(friction=0.5, restitution=0.5),
}
STEP, LIMIT = 1e-6, 120.0  # [s], and for a peer's run [s]
COLUMNS = "id x y z vx vy vz omegax omegay omegaz fx fy fz"
_WHAT = (
    ("force", slice(9, 12), "force on a grain over the largest"),
    ("velocity", slice(3, 6), "velocity over the largest"),
    ("place", slice(0, 3), "place over a diameter"),
)
_FINER = 8


@dataclass(frozen=True)
class Assembly:
    """Grains in a box periodic in x and y: shapes [grain_count, 3] or [grain_count], SI units."""

    positions: Array
    radii: Array
    velocities: Array
    spins: Array
    period: tuple[float, float]
    height: float
    gravity: float
    steps: int
    every: int
    step: float = STEP

    @property
    def samples(self) -> int:
        """How often it is looked at, the start included."""
        return self.steps // self.every + 1

    def refined(self, times: int) -> "Assembly":
        """The same with steps this many times finer, looked at when it was."""
        return replace(self, step=self.step / times, steps=self.steps * times, every=self.every * times)

    def nearest(self, apart: Array) -> Array:
        """Differences of places [m], shape [..., 3], to the nearest image in x and y."""
        period = np.array(self.period)
        apart[..., :2] -= period * np.round(apart[..., :2] / period)
        return apart


def pairs(count: int = 32) -> Assembly:
    """Pairs of unlike grains, each far from the others, that meet obliquely and spinning: a contact for each force."""
    rng = np.random.default_rng(11)
    pitch, side = 0.012, 8
    i = np.arange(count)
    centers = np.column_stack([pitch * (0.5 + i % side), pitch * (0.5 + i // side), np.full(count, 0.01)])
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    radii = 0.002 * (1 + 0.3 * rng.uniform(-1, 1, (2, count)))
    gap = 1e-6 * rng.uniform(0.1, 1.0, count)
    half = 0.5 * (radii.sum(axis=0) + gap)[:, None] * normal
    closing = rng.uniform(0.3, 1.5, count)[:, None] * normal
    slip = rng.normal(0, 0.5, (count, 3))
    velocities = np.concatenate([-0.5 * closing + slip, 0.5 * closing])
    return Assembly(
        np.concatenate([centers + half, centers - half]), radii.ravel(), velocities, rng.normal(0, 100, (2 * count, 3)),
        (pitch * side, pitch * (count // side)), 0.02, 0.0, 300, 5,
    )  # fmt: skip


def dense() -> Assembly:
    """The cloud of 64 grains, in touch across every boundary, that falls."""
    positions, radii, velocities, spins = cloud.initial()
    positions[:, :2] %= cloud.PERIOD
    return Assembly(positions + [0.0, 0.0, 5e-3], radii, velocities, spins, cloud.PERIOD, 0.03, 9.81, 400, 20)


def ours(assembly: Assembly, stuff: Material) -> Array:
    """Position, velocity, spin and force of each grain at each sample, shape [samples, grain_count, 12]."""
    bed = Bed.from_grains(
        stuff, positions=assembly.positions, radii=assembly.radii, velocities=assembly.velocities, spins=assembly.spins,
        size=(*assembly.period, assembly.height), height=3 * assembly.height, gravity=assembly.gravity, floor=False,
        tensile=True, time_step=assembly.step, max_overlap=0.2,
    )  # fmt: skip
    found = []
    for sample in range(assembly.samples):
        if sample:
            bed.advance(assembly.every)
        grains = bed.grains().as_dict()
        found.append(np.hstack([grains[name] for name in ("position", "velocity", "spin", "force")]))
    return np.array(found)


def theirs(peer: str, assembly: Assembly, stuff: Material) -> Array:
    """The same by a peer, in one process. Raises RuntimeError with its last lines where it fails."""
    atoms = peers.spheres(assembly.radii, assembly.positions, stuff.density)
    moving = [peers.digits(row) for row in np.hstack([assembly.velocities, assembly.spins])]
    data = peers.data_file(peers.box_of(*assembly.period, assembly.height), atoms, moving)
    text = peers.run_peer(peer, data, _deck(peer, assembly, stuff), "dump.txt", limit=LIMIT)
    blocks = text.split("ITEM: ATOMS")[1:]
    if len(blocks) != assembly.samples:
        raise RuntimeError(f"the dump holds {len(blocks)} samples, {assembly.samples} were wanted")
    rows = [[line.split() for line in block.splitlines()[1:] if not line.startswith("ITEM")] for block in blocks]
    return np.array([[[float(v) for v in row[1:13]] for row in block[: len(atoms)]] for block in rows])


def _deck(peer: str, assembly: Assembly, stuff: Material) -> str:
    young, poisson, friction, restitution = stuff.young, stuff.poisson, stuff.friction, stuff.restitution
    if peer == "liggghts":
        contact = [
            f"fix young all property/global youngsModulus peratomtype {young:g}",
            f"fix poisson all property/global poissonsRatio peratomtype {poisson:g}",
            f"fix rebound all property/global coefficientRestitution peratomtypepair 1 {restitution:g}",
            f"fix friction all property/global coefficientFriction peratomtypepair 1 {friction:g}",
            "pair_style gran model hertz tangential history",
            "pair_coeff * *",
        ]
        exact = 'id format "%d' + 12 * " %.17g" + '"'
    else:
        asked = f"{peers.lammps_restitution(restitution):.16g}"
        spring = peers.LAMMPS_TANGENTIAL[stuff.tangential]
        law = f"hertz/material {young:g} {asked} {poisson:g} tangential {spring} NULL 1.0 {friction:g} damping tsuji"
        contact = ["pair_style granular", f"pair_coeff * * {law}"]
        exact = "id format float %.17g"
    weight = [f"fix weight all gravity {assembly.gravity:g} vector 0.0 0.0 -1.0"] if assembly.gravity else []
    lines = [
        *contact, *weight, "fix motion all nve/sphere", f"timestep {assembly.step:.17g}",
        f"dump now all custom {assembly.every} dump.txt {COLUMNS}", f"dump_modify now sort {exact}", "thermo 100",
        f"run {assembly.steps}",
    ]  # fmt: skip
    return peers.deck_of(peer, lines, boundary="p p f")


class _Written:
    """The grains of an assembly under the law of "bed", "liggghts" or "lammps", written again."""

    def __init__(self, law: str, assembly: Assembly, stuff: Material) -> None:
        self.law, self.assembly, self.r = law, assembly, assembly.radii
        self.x, self.v, self.w = assembly.positions.copy(), assembly.velocities.copy(), assembly.spins.copy()
        self.m = stuff.density * 4 / 3 * math.pi * self.r**3
        self.weight = np.outer(self.m, [0.0, 0.0, -assembly.gravity])
        self.star, self.shear = effective_moduli(stuff.young, stuff.poisson, stuff.young, stuff.poisson)
        self.factor, self.mu = damping_factor(stuff.restitution, tensile=True), stuff.friction
        self.i, self.j = np.triu_indices(len(self.r), 1)
        self.stretch = np.zeros((len(self.i), 3))

    def run(self) -> Array:
        """Position, velocity, spin and force of each grain at each sample, shape [samples, grain_count, 12]."""
        self.push(0.0)
        found = [np.hstack([self.x, self.v, self.w, self.f])]
        for step in range(1, self.assembly.steps + 1):  # of velocity Verlet; contacts see the velocities in its middle
            self.kick()
            self.x = self.x + self.assembly.step * self.v
            self.push(self.assembly.step)
            self.kick()
            if step % self.assembly.every == 0:
                found.append(np.hstack([self.x, self.v, self.w, self.f]))
        return np.array(found)

    def kick(self) -> None:
        half = 0.5 * self.assembly.step
        self.v = self.v + half / self.m[:, None] * self.f
        self.w = self.w + half / (0.4 * self.m * self.r**2)[:, None] * self.torque

    def push(self, dt: float) -> None:
        """Forces where the grains are; ``dt`` is how long they have slid since the last."""
        d = self.assembly.nearest(self.x[self.i] - self.x[self.j])
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
        c_t = self.factor * np.sqrt(mass * (s_n if self.law == "lammps" else k_t))
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


Differences = dict[str, Array]


def _differences(here: Array, there: Array, assembly: Assembly) -> Differences:
    """Largest at each sample, shape [samples], for each of ``_WHAT``. Our forces hold gravity, theirs as well."""
    off = assembly.nearest(here - there)
    scale = {name: np.abs(there[..., part]).max() for name, part, _ in _WHAT} | {"place": 2 * assembly.radii.mean()}
    return {name: np.abs(off[..., part]).max(axis=(1, 2)) / scale[name] for name, part, _ in _WHAT}


def _order(quantity: str, coarse: Differences, fine: Differences) -> Comparison:
    """At what power of the step the velocities come together."""
    order = math.log(coarse["velocity"].max() / fine["velocity"].max()) / math.log(_FINER)
    return Comparison(quantity, "1", 1.0, order, 0.1, False)


def _compute(peer: str, make: Callable[[], Assembly], bands: Mapping[str, float | None], tell: Tell) -> Outcome:
    """Bed and peer beside one another within a band, or, where it is None, each beside its own written law."""
    about = peers.PEERS[peer]
    if about.find() is None:
        return about.skipped()
    assembly = make()
    fine = assembly.refined(_FINER)
    rows: list[Comparison] = []
    curves: list[Curve] = []
    remarks: list[str] = []

    def compare(quantity: str, curve: str, found: Differences, band: float) -> None:
        rows.extend(near_zero(f"{quantity}{what}", found[name].max(), band) for name, _, what in _WHAT)
        draw(curve, found)

    def draw(label: str, found: Differences, *, of_bed: bool = True) -> None:
        time = 1e6 * assembly.step * assembly.every * np.arange(assembly.samples)
        curves.append(Curve(label, time, np.maximum(found["force"], 1e-17), of_bed))

    for label, band in tracked(bands.items(), tell):
        stuff = LAWS[label]
        bed, other = ours(assembly, stuff), theirs(peer, assembly, stuff)
        apart = _differences(bed, other, assembly)
        if band is not None:
            compare(f"{label}: difference of the ", label, apart, band)
            if label in _ONE_LAW[peer]:
                finer = _differences(ours(fine, stuff), theirs(peer, fine, stuff), fine)
                rows.append(_order(f"{label}: order at which the velocities' difference falls", apart, finer))
            continue
        beside = _differences(bed, _Written("bed", assembly, stuff).run(), assembly)
        compare(f"{label}, bed beside its law: ", f"{label}: bed, its law", beside, _AS_UNSLID)
        its_own = _differences(other, _Written(peer, assembly, stuff).run(), assembly)
        compare(f"{label}, {about.name} beside its law: ", f"{label}: {about.name}, its law", its_own, _ROUNDING)
        if label == _SLIDING:
            finer = _differences(ours(fine, stuff), _Written("bed", fine, stuff).run(), fine)
            quantity = f"{label}, bed beside its law: order at which velocities come together"
            rows.append(_order(quantity, beside, finer))
        draw(f"{label}: bed, {about.name}", apart, of_bed=False)
        most_apart = ", ".join(f"{apart[name].max():.2g} ({what})" for name, _, what in _WHAT)
        remarks.append(f"{label}: with a law each, bed and {about.name} differ by up to {most_apart}.")
    title = "Largest difference of a force, over the largest force"
    return Outcome(rows, [Plot(title, "time [us]", "difference [1]", curves, "y")], remarks)


_ONE_LAW = {"liggghts": (_SMOOTH, _UNDAMPED), "lammps": (_SMOOTH,)}
"""The laws in which a peer differs from the bed in nothing but its order in time."""
# Where the normal force changes its sign friction slides for a moment, even at 50. LAMMPS' small terms are of the order
# of overlap over radius, 5 % here. Without a dashpot the step's first order is some 1e-4.
_SIGN, _SMALL_TERMS, _FIRST_ORDER = 0.03, 0.05, 1e-3
# What the bed's better order in time makes where nothing slides (case liggghts-contacts), and rounding over some
# hundred steps; LAMMPS leaves out turns of the spring below 1e-10 of the bound.
_AS_UNSLID, _ROUNDING = 0.03, 1e-8
_CASES: tuple[tuple[str, Callable[[], Assembly], dict[str, float | None]], ...] = (
    ("liggghts-contacts", pairs, {_SMOOTH: _SIGN, _UNDAMPED: _FIRST_ORDER, _STICKING: _SIGN}),
    ("liggghts-cloud", dense, {_UNDAMPED: _FIRST_ORDER}),
    ("lammps-contacts", pairs, {_SMOOTH: _SIGN, _UNDAMPED: _SMALL_TERMS, _STICKING: _SMALL_TERMS}),
    ("lammps-cloud", dense, {_SMOOTH: _SIGN, _UNDAMPED: _SMALL_TERMS}),
    ("liggghts-contacts-sliding", pairs, {_SLIDING: None}),
    ("liggghts-cloud-sliding", dense, {_SLIDING: None}),
    ("lammps-contacts-sliding", pairs, {_STICKING: None, _SLIDING: None}),
    ("lammps-cloud-sliding", dense, {_STICKING: None, _SLIDING: None}),
)
CASES = {name: partial(_compute, name.partition("-")[0], make, bands) for name, make, bands in _CASES}
