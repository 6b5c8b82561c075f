"""Collisions along the normal: Chung & Ooi's T1 to T3, the force over the whole of a contact, and the restitution.

T1 to T3 are elastic; then T3's sphere with the restitution asked for, at any speed: with fine steps and with the bed's
own, cut at zero and tensile.
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from dem import Bed, Material
from dem.contact.timestep import time_step_for
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, tracked, worst
from experiments.validate.base.spheres import ALUMINA, CAST_IRON, RADIUS, SIXTEEN, contact_of, row_of_grains

from . import say
from .law_alone import staggered_rebound

__all__ = ["CASES", "force_curve", "rebound"]

STEPS = 1000  # in a contact
CLOSED_BAND, PUBLISHED_BAND = 1e-5, 5e-4  # of the closed form; of figures with four digits
UNITS = (("largest overlap", "um", 1e6), ("largest force", "kN", 1e-3), ("contact time", "us", 1e6))


class Test(NamedTuple):
    """Spheres of one radius [m] that meet a rigid plane, or each other head-on, at a speed each [m/s].

    ``materials``: density, Young's modulus, Poisson's ratio and the figures as quoted, in ``UNITS``. ``row``: sixteen
    spheres in a row do the same. ``rebounds``: whether the speed afterwards is compared, too.
    """

    radius: float
    speed: float
    materials: dict[str, tuple[float, float, float, tuple[float, ...]]]
    pair: bool = False
    row: bool = False
    rebounds: bool = True

    def bed(self, stuff: Material, step: float) -> Bed:
        """The spheres about to meet."""
        positions, radii, options = row_of_grains()
        if not self.row:
            r = self.radius
            pair = [(0.3 - r, 0.3, 0.3), (0.3 + r, 0.3, 0.3)]
            positions = np.array(pair if self.pair else [(0.6, 0.6, r)])
            radii, options = np.full(len(positions), r), {"size": (0.8, 0.8, 0.4), "height": 1.0, "gravity": 0.0}
        velocities = [(self.speed, 0, 0), (-self.speed, 0, 0)] if self.pair else [(0, 0, -self.speed)] * len(radii)
        return Bed.from_grains(
            stuff, positions=positions, radii=radii, velocities=np.array(velocities, dtype=float), time_step=step,
            **options,
        )  # fmt: skip

    def gap_and_speed(self, bed: Bed) -> tuple[float, float]:
        """How far the first sphere is from what it met [m], and how fast it goes away from it [m/s]."""
        x, v = bed.grains().position, bed.grains().velocity
        if self.pair:
            return float(np.linalg.norm(x[0] - x[1])) - 2 * self.radius, float(v[1, 0] - v[0, 0])
        return float(x[0, 2]) - self.radius, float(v[0, 2])


T1 = Test(
    0.01, 10.0,
    {"glass": (2800.0, 48e9, 0.20, (274.11, 10.697, 40.34)),
     "limestone": (2500.0, 20e9, 0.25, (368.30, 7.108, 54.20))}, pair=True,
)  # fmt: skip
T2 = Test(
    0.1, 0.2,
    {"aluminium alloy": (2699.0, 70e9, 0.30, (49.72, 11.370, 731.7)),
     "magnesium alloy": (1800.0, 40e9, 0.35, (52.12, 7.233, 767.1))}, rebounds=False,
)  # fmt: skip
T3 = Test(
    RADIUS, 3.9,
    {"alumina": (*ALUMINA.values(), (8.089, 0.6154, 6.105)),
     "cast iron": (*CAST_IRON.values(), (17.19, 0.5068, 12.97))}, row=True,
)  # fmt: skip


def _compared(test: Test, name: str) -> list[Comparison]:
    """A collision that starts at time 0 against Hertz's closed form, and against the figures as they are quoted.

    The force is read in nine steps about the middle; the end comes from the gap after it, divided by the speed.
    """
    density, young, poisson, published = test.materials[name]
    stuff, closing = Material(name, density, young, poisson, 0.3, 1.0), test.speed * (2 if test.pair else 1)
    closed = contact_of(stuff, test.radius, closing, pair=test.pair)[:3]
    step, forces = closed[2] / STEPS, []
    bed = test.bed(stuff, step)
    bed.advance(STEPS // 2 - 4)
    for _ in range(9):
        forces.append(float(np.linalg.norm(bed.grains().force[0])))
        bed.advance(1)
    bed.advance(round(1.1 * STEPS) - bed.steps)
    gap, speed = test.gap_and_speed(bed)
    measured = (bed.max_overlap * 2 * test.radius, max(forces), bed.time - gap / speed)
    rows = []
    for (what, unit, scale), found, form, quoted in zip(UNITS, measured, closed, published, strict=True):
        rows.append(Comparison(f"{name}: {what}, closed form", unit, form * scale, found * scale, CLOSED_BAND))
        rows.append(Comparison(f"{name}: {what}, as quoted", unit, quoted, found * scale, PUBLISHED_BAND))
    rebound = Comparison(f"{name}: rebound speed", "m/s", test.speed, speed * test.speed / closing, CLOSED_BAND)
    return [*rows, rebound] if test.rebounds else rows


def force_curve(tell: Tell) -> Outcome:
    """F over delta through a whole collision of T3's alumina sphere, both ways: k delta^1.5."""
    stuff = Material("alumina", friction=0.3, restitution=1.0, **ALUMINA)
    overlap, force, time, k = contact_of(stuff, RADIUS, T3.speed)
    bed = T3.bed(stuff, time / 200)
    found = []
    for _ in range(200):
        bed.advance(1)
        grains = bed.grains()
        found.append((RADIUS - grains.position[0, 2], grains.force[0, 2]))
    delta, pushed = np.array(found).T
    delta, pushed = delta[delta > 0], pushed[delta > 0]
    off = float(np.abs(pushed - k * delta**1.5).max())
    line = np.linspace(0, overlap, 100)
    curves = [Curve("4/3 E* sqrt(R*) delta^1.5", 1e6 * line, k * line**1.5, False), Curve("bed", 1e6 * delta, pushed)]
    return Outcome(
        [near_zero("largest departure from k delta^1.5, over the largest force", off / force, 1e-9)],
        [Plot("Force over overlap, in and out", "overlap [um]", "force [N]", curves)],
    )


def _all(test: Test, tell: Tell) -> Outcome:
    return Outcome([row for name in tracked(test.materials, tell) for row in _compared(test, name)])


SPEEDS = np.geomspace(0.05, 5.0, SIXTEEN)
RESTITUTIONS = (0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
FINE_STEP = 2e-8  # A 300th of T3's contact time [s]
_CONTACT_TIME = 6.105e-6  # of T3's alumina sphere at 3.9 m/s [s]
_FINE_BAND, _OWN_BAND = 1e-3, 0.015
_PHASES, _LOW = 8, 0.2


def rebound(restitution: float, tensile: bool, step: float | None = None, *, phase: float = 0.0) -> np.ndarray:
    """Rebound over approach speed of an alumina sphere on the floor, at sixteen speeds, shape [16].

    ``step``: [s]; the bed's own when None. ``phase``: where in a step the contact begins, 0 to 1.
    """
    positions, radii, options = row_of_grains(tensile=tensile)
    stuff = Material("t3", friction=0.3, restitution=restitution, **ALUMINA)
    taken = time_step_for(stuff, diameter=2 * RADIUS, max_overlap=0.004, wanted=step)
    positions[:, 2] += phase * taken * SPEEDS
    bed = Bed.from_grains(
        stuff, positions=positions, radii=radii, velocities=np.outer(-SPEEDS, [0.0, 0.0, 1.0]), max_overlap=0.004,
        time_step=step, **options,
    )  # fmt: skip
    longest = _CONTACT_TIME * (3.9 / SPEEDS[0]) ** 0.2  # t_c goes with v^(-1/5)
    bed.advance(math.ceil((4 if restitution < 0.5 else 2) * longest / bed.time_step))
    grains = bed.grains()
    if not (grains.position[:, 2] > RADIUS).all() or np.abs(grains.velocity[:, :2]).max() > 0:
        raise RuntimeError("a grain has not left the floor, or left it sideways")
    return grains.velocity[:, 2] / SPEEDS


def _fine(tensile: bool, tell: Tell) -> Outcome:
    rows, curves = [], []
    for asked in tracked(RESTITUTIONS, tell):
        found = rebound(asked, tensile, FINE_STEP)
        about = f"worst of 16 speeds, {asked} asked for"
        rows.append(Comparison(about, "1", asked, worst(found, asked), _FINE_BAND, False))
        curves.append(Curve(f"{asked:g}", SPEEDS, found - asked))
    plot = Plot("Rebound less what was asked for", "speed [m/s]", "difference [1]", curves, log="x")
    return Outcome(rows, [plot])


def _own_step(tell: Tell) -> Outcome:
    """With the step that the bed takes by itself, wherever in a step the contact begins, and the scheme alone."""
    rows, curves, means, highest, lowest = [], [], [], 0.0, 0.0
    for done, asked in enumerate(RESTITUTIONS, 1):
        found = np.array([rebound(asked, False, phase=phase) for phase in np.arange(_PHASES) / _PHASES]) - asked
        about = f"worst of 16 speeds, 8 phases, {asked} asked for"
        rows.append(Comparison(about, "1", asked, asked + worst(found, 0.0), _OWN_BAND, False))
        curves.append(Curve(f"{asked:g}", np.tile(SPEEDS, _PHASES), found.ravel()))
        means.append(f"{found.mean():+.4f} at {asked:g}")
        highest, lowest = max(highest, found.max()), min(lowest, found.min())
        tell(0.5 * done / len(RESTITUTIONS))
    counts, phase = np.array([10, 14, 20, 40, 80, 160]), (np.arange(100) + 0.5) / 100
    schemes = {"half-step velocity": {"synchronised": False, "first_touch": False}, "as the bed has it": {}}
    errors = {label: np.empty((2, len(counts))) for label in schemes}
    for done, count in enumerate(counts):
        for label, options in schemes.items():
            off = staggered_rebound(_LOW, count, phase, **options) - _LOW
            errors[label][:, done] = abs(off.mean()), np.abs(off).max()
        tell(0.5 + 0.5 * (done + 1) / len(counts))
    old, new = errors.values()
    remarks = [
        say("own_step", lowest=lowest, highest=highest, means=", ".join(means)),
        say("scheme_alone", asked=_LOW, mean=new[0, 1], most=new[1, 1], old_mean=old[0, 1], old_most=old[1, 1]),
    ]
    own = "Rebound less what was asked for, the bed's own step"
    alone = f"The scheme alone, e = {_LOW:g}: largest error over the phases"
    lines = [Curve(label, counts, found[1]) for label, found in errors.items()]
    plots = [
        Plot(own, "speed [m/s]", "difference [1]", curves, "x"),
        Plot(alone, "steps in a contact", "error of the restitution [1]", lines, "xy"),
    ]
    return Outcome(rows, plots, remarks)


CASES = {
    "hertz-force": force_curve,
    "t3-restitution": partial(_fine, False),
    "restitution-tensile": partial(_fine, True),
    "restitution-own-step": _own_step,
    **{id: partial(_all, test) for id, test in (("t1", T1), ("t2", T2), ("t3-elastic", T3))},
}
