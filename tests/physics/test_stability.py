"""How long a step is stable: closed forms, the amplification matrix of whole lattices, and the bed itself."""

import math

import numpy as np
import pytest

from dem import Bed, Material, Plane
from dem.contact.law import damping_factor
from dem.contact.timestep import contact_time, stable_step

FCC = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / math.sqrt(2)


def lattice(neighbours):
    """How many grains, and bonds (i, j, n from j to i), of a periodic crystal of unit diameters with 12 or 6 each.

    The period is the cube of the face-centred one, which its fastest mode fits, and two cells of the simple cubic one.
    """
    sites = FCC if neighbours == 12 else np.array(list(np.ndindex(2, 2, 2)), dtype=float)
    period = math.sqrt(2) if neighbours == 12 else 2.0
    bonds = []
    for i, a in enumerate(sites):
        for shift in period * (np.array(list(np.ndindex(3, 3, 3))) - 1):
            for j, b in enumerate(sites + shift):
                d = a - b
                # Each once: the half space of d with a positive first component that is not zero.
                first = next((v for v in d if abs(v) > 1e-9), 0.0)
                if abs(np.linalg.norm(d) - 1) < 1e-9 and first > 0:
                    bonds.append((i, j, d))
    assert len(bonds) == neighbours / 2 * len(sites)
    return len(sites), bonds


def across(n):
    """Matrices that take what is across n, and that turn w into w x n."""
    return np.eye(3) - np.outer(n, n), np.array([[0, n[2], -n[1]], [-n[2], 0, n[0]], [n[1], -n[0], 0]])


def amplification(neighbours, restitution, share, *, sticking, poisson=0.25):
    """Spectral radius of one step of all grains; ``share`` the step over the contacts' half-period.

    m = 2, m* = S_n = 1, r = 1/2. State: places, turns, their rates half a step before, the contacts' normal forces.
    """
    q, c = math.pi * share, damping_factor(restitution)
    ratio = 2 * (1 - poisson) / (2 - poisson) if sticking else 0.0
    count, bonds = lattice(neighbours)
    size = 12 * count + len(bonds)
    state = np.eye(size)
    x, turn, v, spin = (state[k * 3 * count : (k + 1) * 3 * count].reshape(count, 3, size) for k in range(4))
    force = state[12 * count :]
    push, torque = np.zeros((count, 3, size)), np.zeros((count, 3, size))
    for k, (i, j, n) in enumerate(bonds):
        flat, cross = across(n)
        slip = flat @ (x[i] - x[j]) - 0.5 * cross @ (turn[i] + turn[j])
        rate = flat @ (v[i] - v[j]) - 0.5 * cross @ (spin[i] + spin[j])
        tangential = -ratio * slip - c * math.sqrt(ratio) * rate
        push[i] += np.outer(n, force[k]) + tangential
        push[j] -= np.outer(n, force[k]) + tangential
        moment = 0.5 * cross @ tangential  # r f_t x n
        torque[i] += moment
        torque[j] += moment
    faster, whirling = v + q * push / 2, spin + q * torque / (0.4 * 2 * 0.25)
    moved, turned = x + q * faster, turn + q * whirling
    rows = []
    for k, (i, j, n) in enumerate(bonds):
        now, before = n @ (faster[i] - faster[j]), n @ (v[i] - v[j])
        past = (before + q * force[k]) / 2
        rows.append((-(n @ (moved[i] - moved[j])) - c * (1.5 * now - past)) / (1 + q * c / 2))
    parts = [y.reshape(3 * count, size) for y in (moved, turned, faster, whirling)]
    return np.abs(np.linalg.eigvals(np.vstack([*parts, rows]))).max()


@pytest.mark.parametrize(("neighbours", "sticking"), [(12, False), (6, True)])
def test_a_lattice_is_stable_up_to_the_closed_form(neighbours, sticking):
    """N q^2 + 4 (N - 1) c q = 4, N = z / 3; 5/3 z (K q^2 + 2 c sqrt(K) q) = 4 for contacts that stick."""
    for e in (0.2, 0.9):
        bound = stable_step(e, neighbours=neighbours, sticking=sticking)
        # The uniform motion is neutral: an eigenvalue 1, twice, which round-off splits by its root.
        assert amplification(neighbours, e, 0.99 * bound, sticking=sticking) < 1 + 1e-6
        assert amplification(neighbours, e, 1.01 * bound, sticking=sticking) > 1.005


def test_the_closed_form_has_its_limits():
    """Undamped q = 2 / sqrt(N); a pair alone q = 2 with any damping."""
    assert stable_step(1.0, neighbours=12) == pytest.approx(1 / math.pi)
    for e in (0.05, 0.5, 1.0):
        assert stable_step(e, neighbours=3) == pytest.approx(2 / math.pi)
    for e in (0.02, 0.3, 0.8):
        c, q = damping_factor(e), math.pi * stable_step(e)
        assert 4 * q**2 + 12 * c * q == pytest.approx(4)


DIAMETER, OVERLAP = 0.004, 0.04


def crystal(restitution, share, monkeypatch):
    """96 grains in a close packing between the floor and a plate, all overlapping by the bound, with a given step."""
    stuff = Material("dead", 2600, 1e7, 0.25, 0.0, restitution)
    pitch, r = DIAMETER * (1 - OVERLAP), DIAMETER / 2
    # Four contacts at 45 degrees carry what the floor does at the same overlap: k_floor = 2 sqrt(2) k_pair.
    floor = OVERLAP * DIAMETER
    layer, i, j = (a.ravel() for a in np.meshgrid(range(6), range(4), range(4), indexing="ij"))
    shift = 0.25 + 0.5 * (layer % 2)
    positions = np.column_stack([pitch * (i + shift), pitch * (j + shift), r - floor + layer * pitch / math.sqrt(2)])
    step = share * contact_time(stuff, diameter=DIAMETER, max_overlap=OVERLAP)
    monkeypatch.setattr("dem.engine.core.time_step_for", lambda *args, **options: step)
    bed = Bed.from_grains(
        stuff,
        positions=positions,
        radii=np.full(96, r),
        velocities=np.random.default_rng(0).normal(0, 1e-9, (96, 3)),
        size=(4 * pitch, 4 * pitch, 0.02),
        height=0.05,
        gravity=0.0,
        max_overlap=0.2,
    )
    bed.add_body([Plane(normal=(0, 0, -1))], position=(0, 0, positions[:, 2].max() + r - floor))
    return bed


def test_strongly_damped_grains_are_at_rest_at_the_beds_own_step_and_not_at_an_eighth(monkeypatch):
    """e = 0.2, twelve neighbours at the overlap bound: stable to 0.0893 of the contact time."""
    longest = 2**0.25 * stable_step(0.2)
    assert longest == pytest.approx(0.0893, abs=1e-4)
    for share, most, left in ((0.9 * longest, 0.02, 1e-5), (0.125, 1.0, 1.0)):
        bed = crystal(0.2, share, monkeypatch)
        speeds = []
        for _ in range(30):  # the plate's arrival is felt for some steps
            bed.advance(10)
            v = bed.grains().velocity
            speeds.append(np.abs(v - v.mean(axis=0)).max())
        assert max(speeds) < most and speeds[-1] < left
    assert max(speeds) > 0.05
