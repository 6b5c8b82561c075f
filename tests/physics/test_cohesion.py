"""Cohesion: DMT and JKR against their closed forms; the books with cohesion on.

w = 2 gamma is the work of adhesion. Pull-off: DMT 2 pi w R* = 4 pi gamma R*, JKR 3/2 pi w R* = 3 pi gamma R*.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from dem import Bed, Material
from dem.contact.cohesion import jkr_contact, jkr_range, pull_off
from dem.contact.law import effective_moduli
from dem.engine.energy import body_pushes

RADIUS, YOUNG, POISSON, DENSITY, GAMMA = 0.0025, 1e7, 0.25, 2600, 0.5
STAR = {
    "pair": effective_moduli(YOUNG, POISSON, YOUNG, POISSON)[0],
    "plane": effective_moduli(YOUNG, POISSON, math.inf, POISSON)[0],
}
LAWS = ("dmt", "jkr")
I16 = np.arange(16)
SITES = np.column_stack([0.00625 + 0.0125 * (I16 % 4), 0.00625 + 0.0125 * (I16 // 4), 0.0 * I16])


def stuff(cohesion, *, friction=0.5, restitution=0.5, rolling=0.1, surface_energy=GAMMA):
    return Material("sticky", DENSITY, YOUNG, POISSON, friction, restitution, rolling, cohesion, surface_energy)


def make(material, positions, *, radii=None, gravity=0.0, **options):
    options = {"max_overlap": 0.1} | options
    return Bed.from_grains(
        material,
        positions=positions,
        radii=np.full(len(positions), RADIUS) if radii is None else radii,
        size=(0.05, 0.05, 0.05),
        height=0.08,
        gravity=gravity,
        **options,
    )


def mass(radius=RADIUS):
    return DENSITY * 4 / 3 * math.pi * radius**3


def jkr_by_bisection(overlap, radius, young):
    """The force at an overlap, from d = a^2 / R - sqrt(2 pi w a / E*) solved for the contact radius a."""
    w = 2 * GAMMA
    least = (math.pi * w * radius**2 / (8 * young)) ** (1 / 3)  # where d(a) is least
    a = brentq(
        lambda a: a**2 / radius - math.sqrt(2 * math.pi * w * a / young) - overlap, least, 1e3 * least, xtol=1e-18
    )
    return 4 * young * a**3 / (3 * radius) - math.sqrt(8 * math.pi * w * young * a**3)


def jkr_energy(overlap, radius, young):
    """Integral of the force over the overlap from where the pair parts, s^3 = 1/4 [J].

    With d R / a1^2 = s^4 - s, a1^3 = 2 pi w R^2 / E*, F = pi w R (8/3 s^6 - 4 s^3), it is
    pi w a1^2 (16/15 s^10 - 8/3 s^7 + s^4) but for a constant.
    """
    w = 2 * GAMMA
    unit = (2 * math.pi * w * radius**2 / young) ** (1 / 3)
    if overlap <= -3 / 4 * 0.25 ** (1 / 3) * unit**2 / radius:
        return 0.0
    s = brentq(lambda s: s**4 - s - overlap * radius / unit**2, 0.25 ** (1 / 3), 100.0, xtol=1e-15)

    def part(s):
        return 16 / 15 * s**10 - 8 / 3 * s**7 + s**4

    return math.pi * w * unit**2 * (part(s) - part(0.25 ** (1 / 3)))


@pytest.mark.long
def test_the_force_curves_are_dmts_and_jkrs():
    """Grains over the floor, from beyond where JKR's pairs part to ten times that overlap; to round-off."""
    reach = jkr_range(surface_energy=GAMMA, radius=RADIUS, effective_young=STAR["plane"])
    overlap = np.concatenate([[-1.01, -0.999, -0.8, -0.5, -0.1, 0.001, 0.1], np.geomspace(0.2, 10, 9)]) * reach
    positions = SITES + np.outer(RADIUS - overlap, [0, 0, 1])
    k = 4 / 3 * STAR["plane"] * math.sqrt(RADIUS)
    wanted = {
        "dmt": np.where(overlap > 0, k * np.maximum(overlap, 0) ** 1.5 - 4 * math.pi * GAMMA * RADIUS, 0.0),
        "jkr": np.array([0.0] + [jkr_by_bisection(d, RADIUS, STAR["plane"]) for d in overlap[1:]]),
    }
    for law in LAWS:
        bed = make(stuff(law), positions)
        grains = bed.grains()
        assert grains.force[:, 2] == pytest.approx(wanted[law], rel=1e-9, abs=1e-12)
        assert (grains.coordination == (wanted[law] != 0)).all()


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_pushes_on_a_body_have_cohesion_and_their_work_from_no_load_to_parting_is_that_of_pulling_a_grain_off(law):
    """DMT: integral of 2 pi w R - k d^1.5 from 0 to d_0, where it is 0: 1.2 pi w R d_0, k = 4/3 E* sqrt(R).

    JKR: pi w a_1^2 (c(1/4) - c(3/2)), c(s^3) = 16/15 s^10 - 8/3 s^7 + s^4; it is without load at s^3 = 3/2 and parts at
    1/4. Gauss's rule over t, d = d_end + (d_0 - d_end) t^2, which takes the root out of JKR's force where it parts.
    """
    w, young = 2 * GAMMA, STAR["plane"]
    if law == "dmt":
        rest, end = (2 * math.pi * w * RADIUS / (4 / 3 * young * math.sqrt(RADIUS))) ** (2 / 3), 0.0
        work = 1.2 * math.pi * w * RADIUS * rest
    else:
        unit = (2 * math.pi * w * RADIUS**2 / young) ** (1 / 3)
        rest, end = ((s**4 - s) * unit**2 / RADIUS for s in (1.5 ** (1 / 3), 0.25 ** (1 / 3)))
        work = -jkr_energy(rest, RADIUS, young)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    t = 0.5 * (nodes + 1)
    bed = make(stuff(law), SITES + np.outer(RADIUS - end - (rest - end) * t**2, [0, 0, 1]))
    floor = {0: lambda x: (x[:, 2], np.tile([0.0, 0.0, 1.0], (len(x), 1)), np.zeros(len(x)))}
    points, forces = body_pushes(bed, bodies=floor)
    order = np.lexsort((points[:, 0], points[:, 1]))
    pull = forces[order, 2]
    assert points[order] == pytest.approx(SITES, abs=1e-15)
    assert pull == pytest.approx(-bed.grains().force[:, 2], rel=1e-9)
    assert (pull > 0).all() and pull.max() < pull_off(law, surface_energy=GAMMA, radius=RADIUS)
    assert 0.5 * weights @ (pull * 2 * (rest - end) * t) == pytest.approx(work, rel=1e-9)


def test_jkrs_closed_solution_has_its_landmarks():
    """Pull-off -3/2 pi w R at a^3 = 9 pi w R^2 / 8 E*; it parts at 5/9 of that; at no load a^3 is four times that."""
    radius, young, w = 1e-3, 1e7, 2 * GAMMA
    given = {"surface_energy": GAMMA, "radius": radius, "effective_young": young}
    assert pull_off("jkr", surface_energy=GAMMA, radius=radius) == pytest.approx(3 * math.pi * GAMMA * radius)
    assert pull_off("dmt", surface_energy=GAMMA, radius=radius) == pytest.approx(4 * math.pi * GAMMA * radius)
    assert pull_off("none", surface_energy=GAMMA, radius=radius) == 0
    critical = (9 * math.pi * w * radius**2 / (8 * young)) ** (1 / 3)
    assert jkr_contact(-(critical**2) / (3 * radius), **given) == pytest.approx((critical, -1.5 * math.pi * w * radius))
    end = jkr_range(**given)
    assert jkr_contact(-end * (1 - 1e-12), **given)[1] == pytest.approx(-5 / 6 * math.pi * w * radius, rel=1e-5)
    with pytest.raises(ValueError, match="a JKR pair parts at"):
        jkr_contact(-1.001 * end, **given)
    free = (9 * math.pi * w * radius**2 / (2 * young)) ** (1 / 3)
    a, force = jkr_contact(free**2 / (3 * radius), **given)
    assert a == pytest.approx(free) and abs(force) < 1e-12 * math.pi * w * radius
    assert jkr_contact(1.0, **given)[1] == pytest.approx(4 / 3 * young * math.sqrt(radius), rel=1e-3)  # Hertz


@pytest.mark.parametrize("law", LAWS)
def test_a_grain_hangs_as_long_as_its_weight_is_below_the_pull_off_force(law):
    """Gravity upwards: c pi gamma r = 4/3 pi r^3 rho g, c = 4 (DMT) or 3 (JKR), parts the grains that fall off."""
    pull = 4.0 if law == "dmt" else 3.0
    critical = RADIUS
    g = pull * GAMMA / (4 / 3 * critical**2 * DENSITY)
    share = np.concatenate([np.linspace(0.9, 0.996, 8), np.linspace(1.004, 1.1, 8)])
    radii = critical * share
    load = -(4 / 3) * math.pi * radii**3 * DENSITY * g
    peak = -pull * math.pi * GAMMA * radii
    heights = []
    for r, f, least in zip(radii, load, peak, strict=True):
        if law == "dmt":
            k = 4 / 3 * STAR["plane"] * math.sqrt(r)
            overlap = max(0.0, (f - least) / k) ** (2 / 3)
        else:
            # Johnson, Kendall & Roberts 1971, eq. 17: the contact radius under a load; at pull-off where there is none.
            root = math.sqrt(max(0.0, least * (least - f)))
            a = (3 * r / (4 * STAR["plane"]) * (max(f, least) - 2 * least + 2 * root)) ** (1 / 3)
            overlap = a**2 / r - math.sqrt(4 * math.pi * GAMMA * a / STAR["plane"])
        heights.append(r - overlap)
    bed = make(stuff(law), SITES + np.outer(heights, [0, 0, 1]), radii=radii, gravity=(0, 0, g))
    bed.advance(round(0.02 / bed.time_step))
    moved = bed.grains().displacement[:, 2]
    assert np.abs(moved[:8]).max() < 1e-9
    assert moved[8:].min() > 2e-5
    # Those that stay are held by the floor with their weight.
    assert bed.grains().force[:8, 2] == pytest.approx(0.0, abs=1e-6 * -peak.max())


@pytest.mark.parametrize("law", LAWS)
def test_pairs_that_touch_come_to_rest_at_the_overlap_of_no_load(law):
    """DMT: (2 pi w R* / k)^(2/3), k = 4/3 E* sqrt(R*). JKR: a^2 / 3 R*, a^3 = 9 pi w R*^2 / 2 E*.

    JKR's pairs start apart, within reach of one another; grains on the floor and pairs of grains.
    """
    reach = jkr_range(surface_energy=GAMMA, radius=RADIUS / 2, effective_young=STAR["pair"])
    gap = 0.5 * reach if law == "jkr" else -1e-9
    positions = SITES + [0, 0, RADIUS + gap]
    # Four pairs: the odd ones of the first eight stand on the even ones' sites, one over the other.
    positions[:8:2, 2] = 0.02
    positions[1:8:2] = positions[:8:2] + [0, 0, 2 * RADIUS + gap]
    bed = make(stuff(law, restitution=0.05), positions)
    bed.advance(round(0.05 / bed.time_step))
    z = bed.grains().position[:, 2]
    w = 2 * GAMMA
    for name, radius, overlap in (
        ("pair", RADIUS / 2, 2 * RADIUS - (z[1:8:2] - z[:8:2])),
        ("plane", RADIUS, RADIUS - z[8:]),
    ):
        if law == "dmt":
            wanted = (2 * math.pi * w * radius / (4 / 3 * STAR[name] * math.sqrt(radius))) ** (2 / 3)
        else:
            wanted = (9 * math.pi * w * radius**2 / (2 * STAR[name])) ** (2 / 3) / (3 * radius)
        assert overlap == pytest.approx(wanted, rel=1e-6), name
    assert np.abs(bed.grains().velocity).max() < 1e-8


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_cohesion_holds_a_weightless_grain_against_sliding(law):
    """Coulomb's bound with the load F_n + 2 pi w R (DMT), F_n + 3 pi w R (JKR): x'' = g_x - mu load / m beyond it.

    Rolling friction is so high that the grains slide.
    """
    mu, w = 0.2, 2 * GAMMA
    load = (2 if law == "dmt" else 3) * math.pi * w * RADIUS
    if law == "dmt":
        overlap = (load / (4 / 3 * STAR["plane"] * math.sqrt(RADIUS))) ** (2 / 3)
    else:
        overlap = (9 * math.pi * w * RADIUS**2 / (2 * STAR["plane"])) ** (2 / 3) / (3 * RADIUS)
    pulls = {}
    for share in (0.98, 1.5):
        gravity = share * mu * load / mass()
        bed = make(stuff(law, friction=mu, rolling=5.0), SITES + [0, 0, RADIUS - overlap], gravity=(gravity, 0.0, 0.0))
        bed.advance(round(0.02 / bed.time_step))
        first, start = bed.grains(), bed.time
        bed.advance(round(0.02 / bed.time_step))
        pulls[share] = (bed.grains().velocity - first.velocity)[:, 0] / (bed.time - start) / gravity
    assert pulls[1.5] == pytest.approx(1 - 1 / 1.5, rel=2e-3)
    assert np.abs(pulls[0.98]).max() < 0.02


def cluster(material, *, step, spin=100.0):
    """Sixteen grains that fly at one another near the middle of the box; no gravity, no floor."""
    rng = np.random.default_rng(5)
    lattice = np.column_stack([I16 % 2, I16 // 2 % 2, I16 // 4]) * 0.0052
    positions = lattice + [0.0224, 0.0224, 0.02] + rng.uniform(0, 1e-4, (16, 3))
    velocities = (positions.mean(axis=0) - positions) * 40 + rng.normal(0, 0.1, (16, 3))
    return make(
        material,
        positions,
        velocities=velocities,
        spins=rng.normal(0, spin, (16, 3)) if spin else None,
        floor=False,
        max_overlap=0.2,
        time_step=step,
    )


def stored(bed, law):
    """Elastic and surface energy of all pairs of like grains [J], by a double loop."""
    x = bed.grains().position
    i, j = np.triu_indices(len(x), 1)
    overlap = 2 * RADIUS - np.linalg.norm(x[i] - x[j], axis=1)
    if law == "jkr":
        return sum(jkr_energy(d, RADIUS / 2, STAR["pair"]) for d in overlap if d > -1e-3)
    d = np.maximum(overlap, 0)
    k = 4 / 3 * STAR["pair"] * math.sqrt(RADIUS / 2)
    return float((0.4 * k * d**2.5 - 4 * math.pi * GAMMA * RADIUS / 2 * d).sum())


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_momentum_and_angular_momentum_close_with_cohesion(law):
    """To round-off, with friction, rolling resistance and damping; and energy only falls."""
    bed = cluster(stuff(law), step=4e-6)

    def books():
        g = bed.grains()
        moment = np.cross(g.position, g.mass[:, None] * g.velocity)
        own = 0.4 * (g.mass * g.radius**2)[:, None] * g.spin
        return (g.mass[:, None] * g.velocity).sum(axis=0), (moment + own).sum(axis=0), np.abs(moment).sum()

    before = books()
    energy, coordination = [bed.kinetic_energy], 0.0
    for _ in range(40):
        bed.advance(25)
        coordination = max(coordination, bed.coordination_number)
        energy.append(bed.kinetic_energy + stored(bed, law))
    after = books()
    assert coordination > 1
    assert np.abs(after[0] - before[0]).max() < 1e-13 * mass() * 16
    assert np.abs(after[1] - before[1]).max() < 1e-13 * before[2]
    assert np.diff(energy).max() < 1e-3 * energy[0]  # springs of friction and rolling give back a little
    assert energy[-1] < 0.5 * energy[0]


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_energy_of_elastic_cohesive_grains_is_conserved(law):
    """Frictionless, restitution 1: kinetic energy and the integral of the law; separation has no history, no loss."""
    bed = cluster(stuff(law, friction=0.0, restitution=1.0, rolling=1e-9), step=1e-6, spin=0.0)
    first = bed.kinetic_energy + stored(bed, law)
    drift, depth = [], 0.0
    for _ in range(30):
        bed.advance(100)
        held = stored(bed, law)
        depth = max(depth, abs(held))
        drift.append(abs(bed.kinetic_energy + held - first))
    assert depth > 0.1 * first
    assert max(drift) < (2e-3 if law == "jkr" else 1e-3) * first
