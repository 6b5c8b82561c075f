"""Elastic collisions along the normal: Chung & Ooi's T1 to T3, and the force over the whole of a contact."""

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np

from dem import Bed, Material
from dem.contact.law import effective_moduli
from experiments.runs.types import Json
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, told
from experiments.validate.base.spheres import ALUMINA, CAST_IRON, RADIUS, hertz, mass_of, plane_modulus, row_of_grains

__all__ = ["CASES", "force_curve", "head_on", "on_a_plane"]

Floats = tuple[float, ...]
SMALL, LARGE = 0.01, 0.1  # radii of T1 and T2 [m]
STEPS = 1000  # in a contact
CLOSED_BAND, PUBLISHED_BAND = 1e-5, 5e-4  # of the closed form; of figures with four digits
UNITS = (("largest overlap", "um", 1e6), ("largest force", "kN", 1e-3), ("contact time", "us", 1e6))

T1 = {"glass": (2800.0, 48e9, 0.20, (274.11, 10.697, 40.34)), "limestone": (2500.0, 20e9, 0.25, (368.30, 7.108, 54.20))}
T2 = {
    "aluminium alloy": (2699.0, 70e9, 0.30, (49.72, 11.370, 731.7)),
    "magnesium alloy": (1800.0, 40e9, 0.35, (52.12, 7.233, 767.1)),
}
T3 = {"alumina": (ALUMINA, (8.089, 0.6154, 6.105)), "cast iron": (CAST_IRON, (17.19, 0.5068, 12.97))}


def _table(material: Material, speed_of_pair: float, speed_of_large: float, step: float) -> Bed:
    """Two spheres of 10 mm about to meet head-on, and one of 100 mm about to meet the floor."""
    positions = [(0.3 - SMALL, 0.3, 0.3), (0.3 + SMALL, 0.3, 0.3), (0.6, 0.6, LARGE)]
    velocities = [(speed_of_pair, 0, 0), (-speed_of_pair, 0, 0), (0, 0, -speed_of_large)]
    return Bed.from_grains(
        material, positions=np.array(positions), radii=np.array([SMALL, SMALL, LARGE]),
        velocities=np.array(velocities, dtype=float), size=(0.8, 0.8, 0.4), height=1.0, gravity=0.0, time_step=step,
    )  # fmt: skip


def _met(
    name: str, bed: Bed, grain: int, radius: float, closed: Floats, published: Floats, gap_and_speed: Callable
) -> list[Comparison]:
    """A collision that starts at time 0 against Hertz's closed form, and against the figures as they are quoted.

    The force is read in nine steps about the middle; the end comes from the gap after it, divided by the speed.
    """
    time, step, forces = closed[2], bed.time_step, []
    bed.advance(round(0.5 * time / step) - 4)
    for _ in range(9):
        forces.append(float(np.linalg.norm(bed.grains().force[grain])))
        bed.advance(1)
    bed.advance(round(1.1 * time / step) - bed.steps)
    gap, speed = gap_and_speed(bed.grains())
    measured = (bed.max_overlap * 2 * radius, max(forces), bed.time - gap / speed)
    rows = []
    for (what, unit, scale), found, form, quoted in zip(UNITS, measured, closed, published, strict=True):
        rows.append(Comparison(f"{name}: {what}, closed form", unit, form * scale, found * scale, CLOSED_BAND))
        rows.append(Comparison(f"{name}: {what}, as quoted", unit, quoted, found * scale, PUBLISHED_BAND))
    return rows


def head_on(name: str) -> list[Comparison]:
    """T1: two spheres of 10 mm at +-10 m/s."""
    density, young, poisson, published = T1[name]
    speed = 10.0
    star, _ = effective_moduli(young, poisson, young, poisson)
    closed = hertz(mass_of(density, SMALL) / 2, SMALL / 2, star, 2 * speed)[:3]
    bed = _table(Material(name, density, young, poisson, 0.35, 1.0), speed, 0.0, closed[2] / STEPS)

    def gap(grains):
        apart = np.linalg.norm(grains.position[0] - grains.position[1]) - 2 * SMALL
        return apart, grains.velocity[1, 0] - grains.velocity[0, 0]

    rows = _met(name, bed, 0, SMALL, closed, published, gap)
    after = bed.grains().velocity[:2, 0]
    return [*rows, Comparison(f"{name}: rebound speed", "m/s", speed, 0.5 * (after[1] - after[0]), CLOSED_BAND)]


def on_a_plane(name: str) -> list[Comparison]:
    """T2: a sphere of 100 mm on a rigid plane at 0.2 m/s, E* = E / (1 - nu^2)."""
    density, young, poisson, published = T2[name]
    speed = 0.2
    closed = hertz(mass_of(density, LARGE), LARGE, young / (1 - poisson**2), speed)[:3]
    bed = _table(Material(name, density, young, poisson, 0.35, 1.0), 0.0, speed, closed[2] / STEPS)

    def gap(grains):
        return grains.position[2, 2] - LARGE, grains.velocity[2, 2]

    return _met(name, bed, 2, LARGE, closed, published, gap)


def _thrown_down(name: str, numbers: Json, speed: float, step: float) -> Bed:
    """Spheres of T3 about to meet the floor."""
    positions, radii, options = row_of_grains()
    return Bed.from_grains(
        Material(name, friction=0.3, restitution=1.0, **numbers), positions=positions, radii=radii,
        velocities=np.tile([0.0, 0.0, -speed], (16, 1)), time_step=step, **options,
    )  # fmt: skip


def small_on_a_plane(name: str) -> list[Comparison]:
    """T3's elastic part: a sphere of 2.5 mm on a rigid plane at 3.9 m/s."""
    numbers, published = T3[name]
    speed = 3.9
    star = plane_modulus(numbers["young"], numbers["poisson"])
    closed = hertz(mass_of(numbers["density"], RADIUS), RADIUS, star, speed)
    bed = _thrown_down(name, numbers, speed, closed[2] / STEPS)

    def gap(grains):
        return grains.position[0, 2] - RADIUS, grains.velocity[0, 2]

    rows = _met(name, bed, 0, RADIUS, closed[:3], published, gap)
    return [*rows, Comparison(f"{name}: rebound speed", "m/s", speed, bed.grains().velocity[0, 2], CLOSED_BAND)]


def force_curve(tell: Tell) -> Outcome:
    """F over delta through a whole collision of T3's alumina sphere, both ways: k delta^1.5."""
    speed = 3.9
    star = plane_modulus(ALUMINA["young"], ALUMINA["poisson"])
    overlap, force, time, k = hertz(mass_of(ALUMINA["density"], RADIUS), RADIUS, star, speed)
    bed = _thrown_down("alumina", ALUMINA, speed, time / 200)
    found = []
    for _ in range(200):
        bed.advance(1)
        grains = bed.grains()
        found.append((RADIUS - grains.position[0, 2], grains.force[0, 2]))
    delta, pushed = np.array(found).T
    delta, pushed = delta[delta > 0], pushed[delta > 0]
    worst = float(np.abs(pushed - k * delta**1.5).max())
    line = np.linspace(0, overlap, 100)
    curves = [Curve("4/3 E* sqrt(R*) delta^1.5", 1e6 * line, k * line**1.5, False), Curve("bed", 1e6 * delta, pushed)]
    return Outcome(
        [near_zero("largest departure from k delta^1.5, over the largest force", worst / force, 1e-9)],
        [Plot("Force over overlap, in and out", "overlap [um]", "force [N]", curves)],
    )


def _all(measure: Callable[[str], list[Comparison]], names: Iterable[str], tell: Tell) -> Outcome:
    return Outcome([row for name in told(names, tell) for row in measure(name)])


CASES = {
    "hertz-force": force_curve,
    "t1": partial(_all, head_on, T1),
    "t2": partial(_all, on_a_plane, T2),
    "t3-elastic": partial(_all, small_on_a_plane, T3),
}
