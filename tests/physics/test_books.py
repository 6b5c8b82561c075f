"""Many grains: the books of momentum, angular momentum and energy; the floor carries the weight."""

import math

import cloud
import numpy as np
import pytest

from dem import Bed, Material
from dem.contact import effective_moduli

RADIUS = 0.0025


def test_momentum_is_conserved_to_round_off():
    """A cloud with friction and rolling resistance, no gravity, no floor, in touch across the boundaries."""
    bed = cloud.make(gravity=0.0, floor=False, shift=(0, 0, 0.03))
    before = bed.grains()
    bed.advance(500)
    after = bed.grains()
    scale = before["mass"] @ np.linalg.norm(before["velocity"], axis=1)
    change = before["mass"] @ (after["velocity"] - before["velocity"])
    assert np.abs(change).max() < 1e-13 * scale
    assert np.linalg.norm(after["velocity"] - before["velocity"], axis=1).min() > 0.01


def cluster(material, *, flat=False, **options):
    """Sixteen grains of 2.5 mm near the middle of the box that fly at one another; ``flat``: a gas in one plane."""
    rng = np.random.default_rng(5)
    i = np.arange(16)
    if flat:
        positions = np.column_stack([0.00625 + 0.0125 * (i % 4), 0.00625 + 0.0125 * (i // 4), np.full(16, 0.03)])
        positions[:, :2] += rng.uniform(-0.003, 0.003, (16, 2))
        velocities = rng.normal(0, 1.0, (16, 3)) * [1, 1, 0]
        spins = None
    else:
        lattice = np.column_stack([i % 2, i // 2 % 2, i // 4]) * 0.0052
        positions = lattice + [0.0224, 0.0224, 0.02] + rng.uniform(0, 1e-4, (16, 3))
        velocities = (positions.mean(axis=0) - positions) * 40 + rng.normal(0, 0.1, (16, 3))
        spins = rng.normal(0, 100, (16, 3))
    return Bed.from_grains(
        material,
        positions=positions,
        radii=np.full(16, RADIUS),
        velocities=velocities,
        spins=spins,
        size=(0.05, 0.05, 0.05),
        height=0.08,
        gravity=0.0,
        floor=False,
        max_overlap=0.2,
        **options,
    )


def test_angular_momentum_is_conserved_to_round_off():
    """The sum of x x m v + I w of a cluster that reaches no boundary; pairs' torques balance at the contact point."""
    bed = cluster(Material("grain", 2600, 1e7, 0.25, 0.5, 0.6, 0.15), time_step=4e-6)

    def moments():
        g = bed.grains()
        orbital = np.cross(g["position"], g["mass"][:, None] * g["velocity"])
        own = 0.4 * (g["mass"] * g["radius"] ** 2)[:, None] * g["spin"]
        return orbital, own

    orbital, own = moments()
    coordination = 0.0
    for _ in range(5):
        bed.advance(200)
        coordination = max(coordination, bed.coordination_number)
    later = moments()
    assert coordination > 1
    assert np.abs(later[1] - own).max() > 0.1 * np.abs(own).max()
    assert np.abs((later[0] + later[1] - orbital - own).sum(axis=0)).max() < 1e-13 * np.abs(orbital).sum()


def hertz_energy(bed, young, poisson):
    """2/5 k delta^2.5 over the pairs of like grains of a bed [J], by a plain double loop."""
    x = bed.grains()["position"]
    i, j = np.triu_indices(len(x), 1)
    d = x[i] - x[j]
    d[:, :2] -= np.array(bed.size[:2]) * np.round(d[:, :2] / bed.size[:2])
    overlap = np.maximum(0, 2 * RADIUS - np.linalg.norm(d, axis=1))
    k = 4 / 3 * effective_moduli(young, poisson, young, poisson)[0] * math.sqrt(RADIUS / 2)
    return 0.4 * k * (overlap**2.5).sum()


def test_energy_of_an_elastic_gas_is_conserved_to_the_order_of_the_integrator():
    """Frictionless, restitution 1: kinetic and Hertz energy together; the error falls as dt^2."""
    stuff = Material("gas", 2600, 1e6, 0.25, 0.0, 1.0)
    worst = []
    for step in (2e-5, 1e-5, 5e-6):
        bed = cluster(stuff, flat=True, time_step=step)
        first, last = bed.kinetic_energy, bed.grains()["velocity"]
        drift = []
        for _ in range(20):
            bed.advance(round(1e-3 / step))
            drift.append(abs((bed.kinetic_energy + hertz_energy(bed, 1e6, 0.25)) / first - 1))
        turned = (np.abs(bed.grains()["velocity"] - last) > 0.1).any(axis=1)
        assert turned.sum() >= 10
        assert bed.grains()["position"][:, 2] == pytest.approx(0.03, abs=1e-15)
        worst.append(max(drift))
    slope = np.polyfit(np.log([4, 2, 1]), np.log(worst), 1)[0]
    assert worst[-1] < 1e-4
    assert 1.7 < slope < 2.5


def test_energy_never_grows_in_a_dissipative_cluster():
    """Kinetic and Hertz energy with friction, rolling resistance and damping, from collision to dispersal."""
    bed = cluster(Material("grain", 2600, 1e7, 0.25, 0.5, 0.6, 0.15), time_step=4e-6)
    energy = [bed.kinetic_energy]
    for _ in range(150):
        bed.advance(20)
        energy.append(bed.kinetic_energy + hertz_energy(bed, 1e7, 0.25))
    growth = np.diff(energy).max() / energy[0]
    assert energy[-1] < 0.5 * energy[0]
    assert growth < 1e-4  # springs of friction and rolling may give back what this sum does not hold
    assert max(energy) == energy[0]


def test_the_floor_carries_the_weight_of_a_settled_bed():
    """In the mean over a tenth of a second, once it is at rest: a grain may slide late, so rest is waited for."""
    bed = cloud.make(time_step=None)
    for time, drag in ((0.4, 0.02), (0.1, 0.005), (0.4, np.inf)):
        bed.advance(round(time / bed.time_step), drag_time=drag)
    for _ in range(20):
        bed.advance(round(0.1 / bed.time_step))
        if bed.kinetic_energy < 1e-9 * bed.weight * 0.004:
            break
    bed.advance(round(0.1 / bed.time_step))
    assert bed.floor_force == pytest.approx(bed.weight, rel=1e-4)
    grains = bed.grains()
    assert bed.weight == pytest.approx(2600 * 4 / 3 * math.pi * (grains["radius"] ** 3).sum() * 9.81)
    assert np.abs(grains["force"]).max() < 1e-2 * bed.weight / 64
    assert bed.coordination_number > 3
