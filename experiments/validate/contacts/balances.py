"""Many grains: the balances of momentum, angular momentum and energy; the floor carries the weight."""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from dem import Bed, Material
from dem.contact.law import effective_moduli
from experiments.validate.base import cloud
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, tracked
from experiments.validate.base.energy import EnergyRecord, record_energy
from experiments.validate.base.spheres import RADIUS, SIXTEEN, row_of_grains

__all__ = ["CASES", "PARTS", "ROUGH", "cluster", "hertz_energy", "moments", "shares"]

ROUGH = Material("grain", 2600, 1e7, 0.25, 0.5, 0.6, 0.15)
GAS = Material("gas", 2600, 1e6, 0.25, 0.0, 1.0)


def cluster(material: Material, *, flat: bool = False, gravity: Any = 0.0, spin: float = 100.0, **options: Any) -> Bed:
    """Sixteen grains of 2.5 mm near the middle of the box that fly at one another; ``flat``: a gas in one plane.

    ``spin``: standard deviation of each component [rad/s].
    """
    rng, spins = np.random.default_rng(5), None
    if flat:
        positions, _, _ = row_of_grains(0.03)
        positions[:, :2] += rng.uniform(-0.003, 0.003, (16, 2))
        velocities = rng.normal(0, 1.0, (16, 3)) * [1, 1, 0]
    else:
        i = np.arange(SIXTEEN)
        lattice = np.column_stack([i % 2, i // 2 % 2, i // 4]) * 0.0052
        positions = lattice + [0.0224, 0.0224, 0.02] + rng.uniform(0, 1e-4, (16, 3))
        velocities = (positions.mean(axis=0) - positions) * 40 + rng.normal(0, 0.1, (16, 3))
        spins = rng.normal(0, spin, (16, 3)) if spin else None
    return Bed.from_grains(
        material, positions=positions, radii=np.full(SIXTEEN, RADIUS), velocities=velocities, spins=spins,
        size=(0.05, 0.05, 0.05), height=0.08, gravity=gravity, floor=False, max_overlap=0.2, **options,
    )  # fmt: skip


def hertz_energy(bed: Bed, young: float, poisson: float) -> float:
    """2/5 k delta^2.5 over the pairs of like grains of a cluster [J], by a plain double loop."""
    x = bed.grains().position
    i, j = np.triu_indices(len(x), 1)
    d = x[i] - x[j]
    d[:, :2] -= np.array(bed.size[:2]) * np.round(d[:, :2] / bed.size[:2])
    overlap = np.maximum(0, 2 * RADIUS - np.linalg.norm(d, axis=1))
    k = 4 / 3 * effective_moduli(young, poisson, young, poisson)[0] * math.sqrt(RADIUS / 2)
    return float(0.4 * k * (overlap**2.5).sum())


def _momentum(tell: Tell) -> Outcome:
    """A cloud with friction and rolling resistance, no gravity, no floor, in touch across the boundaries."""
    bed = cloud.make(gravity=0.0, floor=False, shift=(0, 0, 0.03))
    before = bed.grains()
    bed.advance(500)
    gained = bed.grains().velocity - before.velocity
    scale, change = before.mass @ np.linalg.norm(before.velocity, axis=1), before.mass @ gained
    slowest = np.linalg.norm(gained, axis=1).min()
    return Outcome(
        [near_zero("change over the sum of m v", np.abs(change).max() / scale, 1e-13)],
        remarks=[f"In these 500 steps every one of the 64 grains changes its velocity by at least {slowest:.2g} m/s."],
    )


def moments(bed: Bed) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Momentum, angular momentum about the origin and own angular momentum of each grain, SI, [grain_count, 3]."""
    g = bed.grains()
    momentum = g.mass[:, None] * g.velocity
    return momentum, np.cross(g.position, momentum), 0.4 * (g.mass * g.radius**2)[:, None] * g.spin


def _angular_momentum(tell: Tell) -> Outcome:
    """The sum of x x m v + I w of a cluster that reaches no boundary; pairs' torques balance at the contact point."""
    bed = cluster(ROUGH, time_step=4e-6)
    _, orbital, own = moments(bed)
    for _ in tracked(range(5), tell):
        bed.advance(200)
    _, later, own_later = moments(bed)
    change = (later + own_later - orbital - own).sum(axis=0)
    moved = np.abs(own_later - own).max() / np.abs(own).max()
    return Outcome(
        [near_zero("change over the sum of |x x m v|", np.abs(change).max() / np.abs(orbital).sum(), 1e-13)],
        remarks=[f"The grains' own angular momenta change by up to {100 * moved:.0f} % of the largest."],
    )


def _elastic_gas(tell: Tell) -> Outcome:
    """Frictionless, restitution 1: kinetic and Hertz energy together; the error falls as dt^2."""
    steps, worst, curves = (2e-5, 1e-5, 5e-6), [], []
    for step in tracked(steps, tell):
        bed = cluster(GAS, flat=True, time_step=step)
        first, drift, times = bed.kinetic_energy, [], []
        for _ in range(20):
            bed.advance(round(1e-3 / step))
            drift.append((bed.kinetic_energy + hertz_energy(bed, GAS.young, GAS.poisson)) / first - 1)
            times.append(1e3 * bed.time)
        worst.append(float(np.abs(drift).max()))
        curves.append(Curve(f"dt = {1e6 * step:g} us", times, drift))
    slope = float(np.polyfit(np.log(steps), np.log(worst), 1)[0])
    rows = [
        Comparison("order of the drift", "1", 2.0, slope, 0.5, False),
        near_zero("largest drift at dt = 5 us, over the energy", worst[-1], 1e-4),
    ]
    return Outcome(rows, [Plot("Energy of an elastic gas", "time [ms]", "change of the energy, relative", curves)])


PARTS = {
    "kinetic": "kinetic",
    "normal": "in Hertz springs",
    "tangential": "in tangential springs",
    "turning": "in rolling and twisting springs",
    "damped": "lost to normal dashpots",
    "rubbed": "lost to tangential forces",
    "turned": "lost to rolling and twisting",
    "potential": "in height",
}
_DURATION = 0.004  # from the first collision to dispersal [s]
_STRONG = (30.0, 0.0, -100.0)  # gravity that does as much work in that time as the collisions [m/s2]


def _energy(material: Material, tell: Tell, *, gravity: Any = 0.0, tensile: bool = False) -> Outcome:
    records: list[EnergyRecord] = []
    for k, step in enumerate((4e-6, 2e-6)):
        bed = cluster(material, gravity=gravity, time_step=step, tensile=tensile)
        records.append(record_energy(bed, round(_DURATION / step), tensile=tensile))
        tell((1 + 2 * k) / 3)
    fine = records[1]
    first = fine.parts["kinetic"][0]
    gaps = [float(np.abs(record.gap).max() / first) for record in records]
    off = max(record.force_error for record in records)
    back = max(fine.largest_return(part) for part in ("damped", "rubbed", "turned")) / first
    rows = [
        near_zero("gap of the book over the first energy, steps of 4 us", gaps[0], 1e-3),
        Comparison("order of the gap in the step", "1", 2.0, math.log2(gaps[0] / gaps[1]), 0.5, False),
        near_zero("force on a grain: the bed's less the law's, over the largest", off, 1e-9),
        near_zero("what a dashpot or friction gives back, over the first energy", back, 1e-3),
    ]
    named = {key: name for key, name in PARTS.items() if key in fine.parts}
    curves, said = shares({name: fine.parts[key] for key, name in named.items()}, 1e3 * fine.time, first)
    plot = Plot("Where the energy goes", "time [ms]", "share of the first energy [1]", curves)
    return Outcome(rows, [plot], [f"Of the first energy at the end: {said}."])


def shares(parts: Mapping[str, np.ndarray], time: np.ndarray, first: float) -> tuple[list[Curve], str]:
    """Curves of the parts of an energy, over the first, and of their sum; the shares at the end in words."""
    curves = [Curve(name, time, part / first, False) for name, part in parts.items()]
    curves.append(Curve("sum", time, np.sum(list(parts.values()), axis=0) / first))
    return curves, ", ".join(f"{100 * (part[-1] / first):.2f} % {name}" for name, part in parts.items())


def _floor_weight(tell: Tell) -> Outcome:
    """The cloud after it has fallen and come to rest, weighed over the last tenth of a second."""
    bed = cloud.make(time_step=None)
    for time, drag in ((0.4, 0.02), (0.1, 0.005), (0.4, math.inf)):
        bed.advance(round(time / bed.time_step), drag_time=drag)
    for _ in range(20):  # a grain may slide late, so rest is waited for
        bed.advance(round(0.1 / bed.time_step))
        if bed.kinetic_energy < 1e-9 * bed.weight * cloud.DIAMETER:
            break
    bed.advance(round(0.1 / bed.time_step))
    grains = bed.grains()
    weight = cloud.STUFF.density * 4 / 3 * math.pi * float((grains.radius**3).sum()) * 9.81
    uneven = np.abs(grains.force).max() / (weight / bed.grain_count)
    rows = [
        Comparison("floor force", "N", weight, bed.floor_force, 1e-4),
        near_zero("largest force left on a grain over its weight", uneven, 1e-2),
    ]
    remark = f"64 grains, coordination number {bed.coordination_number:.2f}. The bulk band of the design is 1 %."
    return Outcome(rows, remarks=[remark])


_ROUGH_WITHOUT_ROLLING = {"energy-hertz": (0.0, 0.6), "energy-undamped": (0.5, 1.0), "energy-friction": (0.5, 0.6)}
"""Friction and restitution [1]."""
CASES = {
    "momentum": _momentum,
    "angular-momentum": _angular_momentum,
    "energy-elastic": _elastic_gas,
    **{id: partial(_energy, Material(id, 2600, 1e7, 0.25, *given)) for id, given in _ROUGH_WITHOUT_ROLLING.items()},
    "energy-rolling": partial(_energy, ROUGH),
    "energy-tensile": partial(_energy, Material("tensile", 2600, 1e7, 0.25, 0.5, 0.6), tensile=True),
    "energy-gravity": partial(_energy, ROUGH, gravity=_STRONG),
    "floor-weight": _floor_weight,
}
