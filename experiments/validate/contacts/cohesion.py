"""Cohesion: force, pull-off, separation and the overlap at no load of DMT's and JKR's laws; their balances.

w = 2 gamma is the work of adhesion. The closed forms are written anew here, JKR's from the contact radius a:
    DMT: F = 4/3 E* sqrt(R) d^1.5 - 2 pi w R;
    JKR: F = 4 E* a^3 / 3 R - sqrt(8 pi w E* a^3), d = a^2 / R - sqrt(2 pi w a / E*).
"""

import math
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq

from dem import Bed, Material
from dem.contact.law import effective_moduli
from dem.engine.energy import bed_energies
from experiments.runs.types import Json
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, worst
from experiments.validate.base.spheres import RADIUS, SIXTEEN, mass_of, plane_modulus, row_of_grains

from .balances import PARTS, cluster, moments, shares

__all__ = ["CASES", "Law"]

YOUNG, POISSON, DENSITY, GAMMA = 1e7, 0.25, 2600.0, 0.5
W = 2 * GAMMA
STAR = {"plane": plane_modulus(YOUNG, POISSON), "pair": effective_moduli(YOUNG, POISSON, YOUNG, POISSON)[0]}
REDUCED = {"plane": RADIUS, "pair": RADIUS / 2}
MASS = mass_of(DENSITY, RADIUS)


class Law:
    """A law's closed forms for a pair of effective radius [m] and modulus [Pa].

    Pull-off force and what it adds to the load in the bound of friction [N]; overlaps at no load (`free`) and at which
    it parts (`end`) [m].
    """

    def __init__(self, name: str, radius: float, young: float):
        self.name, self.radius, self.young = name, radius, young
        self.stiffness = 4 / 3 * young * math.sqrt(radius)
        if name == "dmt":
            self.pull = self.load = 2 * math.pi * W * radius
            self.free, self.end = (self.pull / self.stiffness) ** (2 / 3), 0.0
        else:
            self.pull = 1.5 * math.pi * W * radius
            self.load = 2 * self.pull
            self.free = (9 * math.pi * W * radius**2 / (2 * young)) ** (2 / 3) / (3 * radius)
            self._least = (math.pi * W * radius**2 / (8 * young)) ** (1 / 3)  # where d(a) is least
            self.end = self._overlap(self._least)

    def _overlap(self, a: float) -> float:
        return a * a / self.radius - math.sqrt(2 * math.pi * W * a / self.young)

    def force(self, overlap: float) -> float:
        """At rest [N], positive where it pushes; 0 past the end."""
        if overlap <= self.end:
            return 0.0
        if self.name == "dmt":
            return self.stiffness * overlap**1.5 - self.pull
        a = brentq(lambda a: self._overlap(a) - overlap, self._least, 1e3 * self._least, xtol=1e-18)
        return 4 * self.young * a**3 / (3 * self.radius) - math.sqrt(8 * math.pi * W * self.young * a**3)

    def stored(self, overlap: np.ndarray) -> float:
        """Sum over pairs of the work since they met [J], elastic and of the surfaces, shape [pair]."""
        if self.name == "dmt":
            d = np.maximum(overlap, 0)
            return float((0.4 * self.stiffness * d**2.5 - self.pull * d).sum())
        # d R / a1^2 = s^4 - s and F = pi w R (8/3 s^6 - 4 s^3), a1^3 = 2 pi w R^2 / E*: integrated over d.
        unit = (2 * math.pi * W * self.radius**2 / self.young) ** (1 / 3)

        def part(s: float) -> float:
            return 16 / 15 * s**10 - 8 / 3 * s**7 + s**4

        first, total = 0.25 ** (1 / 3), 0.0
        for d in overlap[overlap > self.end]:
            s = brentq(lambda s: s**4 - s - d * self.radius / unit**2, first, 100.0, xtol=1e-15)  # noqa: B023
            total += math.pi * W * unit**2 * (part(s) - part(first))
        return total


def _stuff(law: str, **changed: Any) -> Material:
    given = {"friction": 0.5, "restitution": 0.5, "rolling_friction": 0.1} | changed
    return Material("sticky", DENSITY, YOUNG, POISSON, cohesion=law, surface_energy=GAMMA, **given)


def _bed(material: Material, heights: np.ndarray, **options: Any) -> Bed:
    positions, radii, given = row_of_grains()
    positions[:, 2] = heights
    chosen: Json = {"radii": radii, "max_overlap": 0.1} | given | options
    return Bed.from_grains(material, positions=positions, **chosen)


def _pull_off(name: str, tell: Tell) -> Outcome:
    law = Law(name, RADIUS, STAR["plane"])
    reach = law.free if name == "dmt" else -law.end
    overlap = reach * np.concatenate([[-0.98, -0.9, -0.7, -0.4, -0.1, 0.01, 0.1], np.geomspace(0.2, 10, 9)])
    found = _bed(_stuff(name), RADIUS - overlap).grains().force[:, 2]
    closed = np.array([law.force(d) for d in overlap])
    off = np.abs(found - closed).max() / law.pull
    rows = [near_zero("force over the floor, 16 overlaps: largest difference over the pull-off force", off, 1e-9)]
    tell(0.2)
    rows += [_parting(name, law), _hanging(name)]
    tell(0.6)
    rows += _no_load(name)
    tell(0.8)
    rows += _sliding(name, law)
    line = np.linspace(law.end - 0.1 * reach, 10 * reach, 300)
    curves = [
        Curve("closed form", 1e6 * line, [1e3 * law.force(d) for d in line], False),
        Curve("bed", 1e6 * overlap, 1e3 * found),
    ]
    return Outcome(rows, [Plot("Force of a grain on the floor", "overlap [um]", "force [mN]", curves)])


def _parting(name: str, law: Law) -> Comparison:
    """Grains at overlaps about the end: halfway between the last that is held and the first that is not."""
    scale = -law.end or law.free
    overlap = law.end + scale * np.linspace(-4e-4, 4.1e-4, SIXTEEN)
    held = np.abs(_bed(_stuff(name), RADIUS - overlap).grains().force[:, 2]) > 0
    least = 0.5 * (overlap[held].min() + overlap[~held].max())
    if name == "dmt":
        return near_zero("overlap at which it parts, over that at no load", least / law.free, 1e-4)
    return Comparison("distance at which it parts", "um", -1e6 * law.end, -1e6 * least, 1e-4)


def _hanging(name: str) -> Comparison:
    """Gravity upwards: sixteen radii about that whose weight is the pull-off force, each at rest where it has one."""
    pull = 4.0 if name == "dmt" else 3.0
    g = pull * GAMMA / (4 / 3 * RADIUS**2 * DENSITY)
    share = 1 + 2e-3 * (np.arange(SIXTEEN) - 7.5)
    radii = RADIUS * share
    heights = [r - _hung(Law(name, r, STAR["plane"]), -(4 / 3) * math.pi * r**3 * DENSITY * g) for r in radii]
    bed = _bed(_stuff(name), np.array(heights), radii=radii, gravity=(0.0, 0.0, g))
    bed.advance(round(0.02 / bed.time_step))
    fell = bed.grains().displacement[:, 2] > 1e-5
    load = share**2  # of the weight over the pull-off force, as r^3 / r
    found = 0.5 * float(load[~fell].max() + load[fell].min()) if fell.any() and not fell.all() else math.nan
    closed = pull * math.pi * GAMMA * RADIUS
    about = "pull-off, by the heaviest that hangs and the lightest that falls"
    return Comparison(about, "mN", 1e3 * closed, 1e3 * closed * found, 3e-3)


def _hung(law: Law, force: float) -> float:
    """The overlap at a pull [N] that is stable; that of the strongest pull where there is none."""
    a = (9 * math.pi * W * law.radius**2 / (8 * law.young)) ** (1 / 3)
    peak = 0.0 if law.name == "dmt" else a * a / law.radius - math.sqrt(2 * math.pi * W * a / law.young)
    least = peak + 1e-12 * law.free
    return brentq(lambda d: law.force(d) - force, least, law.free) if law.force(least) < force else least


def _no_load(name: str) -> list[Comparison]:
    """Grains on the floor, and pairs one over the other, that touch and come to rest."""
    pair, plane = (Law(name, REDUCED[what], STAR[what]) for what in ("pair", "plane"))
    gap = -0.5 * pair.end if name == "jkr" else -1e-9
    positions, radii, given = row_of_grains()
    positions[:, 2] = RADIUS + gap
    positions[:8:2, 2] = 0.02
    positions[1:8:2] = positions[:8:2] + [0, 0, 2 * RADIUS + gap]
    bed = Bed.from_grains(_stuff(name, restitution=0.3), positions=positions, radii=radii, max_overlap=0.1, **given)
    bed.advance(round(0.08 / bed.time_step))
    z = bed.grains().position[:, 2]
    found = {"pair": 2 * RADIUS - (z[1:8:2] - z[:8:2]), "plane": RADIUS - z[8:]}
    return [
        Comparison(f"overlap at no load, {text}", "um", 1e6 * law.free, 1e6 * worst(found[what], law.free), 1e-5)
        for what, law, text in (("pair", pair, "two grains"), ("plane", plane, "grain and floor"))
    ]


def _sliding(name: str, law: Law) -> list[Comparison]:
    """A weightless grain, pulled along the floor: it stays below mu times the load, x'' = g - mu load / m beyond."""
    mu, rows = 0.2, []
    for share, band in ((0.98, 0.02), (1.5, 2e-3)):
        pull = share * mu * law.load / MASS
        stuff = _stuff(name, friction=mu, rolling_friction=5.0)
        bed = _bed(stuff, np.full(SIXTEEN, RADIUS - law.free), gravity=(pull, 0.0, 0.0))
        bed.advance(round(0.02 / bed.time_step))
        first, start = bed.grains().velocity, bed.time
        bed.advance(round(0.02 / bed.time_step))
        found = (bed.grains().velocity - first)[:, 0] / (bed.time - start) / pull
        closed = max(0.0, 1 - 1 / share)
        about = f"acceleration at {share:g} of mu load, over the pull's"
        rows.append(Comparison(about, "1", closed, worst(found, closed), band, False))
    return rows


def _energies(bed: Bed, law: Law, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Times [ms] and energies with that of the surfaces [J], now and after each of so many tenths of a millisecond."""
    rows = []
    for k in range(count + 1):
        if k:
            bed.advance(round(1e-4 / bed.time_step))
        x = bed.grains().position
        i, j = np.triu_indices(len(x), 1)
        stored = law.stored(2 * RADIUS - np.linalg.norm(x[i] - x[j], axis=1))
        rows.append((1e3 * bed.time, bed.kinetic_energy + stored))
    times, energies = np.array(rows).T
    return times, energies


def _balances(name: str, tell: Tell) -> Outcome:
    law, curves, rows = Law(name, REDUCED["pair"], STAR["pair"]), [], []
    for k, step in enumerate((2e-6, 1e-6), 1):
        bed = cluster(_stuff(name, friction=0.0, restitution=1.0, rolling_friction=0.0), time_step=step, spin=0.0)
        times, energies = _energies(bed, law, 30)
        change = energies[1:] / energies[0] - 1
        about = f"elastic: largest drift at dt = {1e6 * step:g} us, over the energy"
        rows.append(near_zero(about, np.abs(change).max(), 2e-4 * step / 1e-6))
        curves.append(Curve(f"elastic, dt = {1e6 * step:g} us", times[1:], change))
        tell(0.4 * k)
    bed = cluster(_stuff(name), time_step=4e-6)
    before = moments(bed)
    speed = float((bed.grains().mass * np.linalg.norm(bed.grains().velocity, axis=1)).sum())
    times, energies = _energies(bed, law, 40)
    after = moments(bed)
    curves.append(Curve("rough and damped", times, energies / energies[0] - 1))
    orbital = np.abs(before[1]).sum()
    pushed = float(np.abs(after[0].sum(axis=0) - before[0].sum(axis=0)).max()) / speed
    turned = np.abs((after[1] + after[2]).sum(axis=0) - (before[1] + before[2]).sum(axis=0)).max() / orbital
    rise = max(0.0, float(np.diff(energies).max() / energies[0]))
    rows += [
        near_zero("rough: change of momentum over the sum of m v", pushed, 1e-13),
        near_zero("rough: change of angular momentum over the sum of |x x m v|", turned, 1e-13),
        near_zero("rough: largest rise of the energy in 0.1 ms, over the first", rise, 1e-3),
    ]
    closed, more, remark = _closed(name, tell)
    return Outcome(
        rows + closed,
        [Plot("Kinetic, elastic and surface energy", "time [ms]", "change over the first", curves), more],
        [remark],
    )


def _closed(name: str, tell: Tell) -> tuple[list[Comparison], Plot, str]:
    """The bed's own energy balance of the rough cluster: what is held and what contacts took is the first energy."""
    found = []
    for k, step in enumerate((4e-6, 2e-6), 1):
        bed = cluster(_stuff(name), time_step=step)
        bed.track_contact_work()
        rows = []
        for _ in range(41):
            held, taken = bed_energies(bed, bodies={}), bed.contact_work
            springs = held["tangential"], held["turning"]
            lost = taken["damping"], taken["tangential"] - springs[0], taken["turning"] - springs[1]
            rows.append([1e3 * bed.time, held["kinetic"], held["normal"], *springs, *lost])
            bed.advance(round(1e-4 / step))
        time, *parts = np.array(rows).T
        total = np.sum(parts, axis=0)
        about = f"rough: gap of the book over the first energy, steps of {1e6 * step:g} us"
        found.append(near_zero(about, np.abs(total - total[0]).max() / total[0], 2e-4 * (step / 4e-6) ** 2))
        tell(0.9 + 0.05 * k)
    curves, ends = shares(dict(zip(_PARTS, parts, strict=True)), time, total[0])
    remark = f"Of the rough grains' first energy at the end (the surfaces' counted from where pairs part): {ends}."
    return found, Plot("Book of the rough cluster, steps of 2 us", "time [ms]", "over the first energy", curves), remark


_PARTS = ["kinetic", "in normal springs and surfaces", *list(PARTS.values())[2:7]]

CASES = {
    **{law: partial(_pull_off, law) for law in ("dmt", "jkr")},
    **{f"energy-{law}": partial(_balances, law) for law in ("dmt", "jkr")},
}
