"""Bodies that turn about any axis on grains in LAMMPS, against those of `dem.Bed` from the same state.

The tests need LAMMPS and mpiexec (`apt install lammps openmpi-bin`), and are skipped where they are missing.
"""

from functools import cache

import numpy as np
import pytest
from spatial_runs import CUBE

from coupling import BedGround, SpatialRun, spatial_members
from coupling.lammps import FreeLammpsBed, LammpsGround, LammpsMissingError, find_lammps
from dem import Ball, Bed, Box, Capsule, Polyhedron
from rigid import SpatialTrial
from rigid.platform.files import find_platform
from rigid.spatial.quaternions import from_turn

try:
    find_lammps()
except LammpsMissingError as missing:
    pytest.skip(str(missing), allow_module_level=True)

SIZE, R = (0.03, 0.03, 0.02), 0.002
ASKEW = from_turn([0.5, -0.7, 0.6])
CORNERS = [(0.006, 0.006, 0.006), (0.006, -0.006, -0.006), (-0.006, 0.006, -0.006), (-0.006, -0.006, 0.006)]
SHAPES = {
    "ball": Ball(radius=0.006), "box": Box(size=(0.012, 0.010, 0.013)),
    "capsule": Capsule(start=(0.0, 0.0, -0.01), end=(0.0, 0.0, 0.01), radius=0.004), "polyhedron": Polyhedron(CORNERS),
}  # fmt: skip


@pytest.fixture
def beds():
    """Makes a bed in LAMMPS of the grains of a bed, and ends it."""
    made = []

    def make(bed, *, ranks=1):
        made.append(FreeLammpsBed(bed, ranks=ranks))
        return made[-1]

    yield make
    for bed in made:
        bed.close()


def single(place=(0.015, 0.015, 0.04)):
    """One grain in the air."""
    return Bed.from_grains("sand", positions=[place], radii=[R], size=SIZE, young=3e7, height=0.08, threads=1)


@pytest.mark.parametrize(
    ("name", "spin"),
    [
        ("ball", (0.0, 0.0, 90.0)),
        pytest.param("ball", (90.0, 0.0, 0.0), marks=pytest.mark.long),
        pytest.param("ball", (0.0, 90.0, 0.0), marks=pytest.mark.long),
        *(pytest.param(name, (30.0, -50.0, 40.0), marks=pytest.mark.long) for name in ("box", "capsule", "polyhedron")),
    ],
)
def test_a_grain_on_a_body_that_spins_about_any_axis_has_the_force_and_motion_of_our_bed(name, spin, beds):
    """A body comes from below, across a side of the bed; with one grain both programs have one law, to rounding."""
    found, place = [], np.array([0.0295, 0.015, 0.04])
    for bed in (single(place), beds(single(place))):
        body = bed.add_body(SHAPES[name], position=place - (0, 0, 0.03), friction=0.4)
        bed.move_body(body, position=place - (0.001, 0.0005, 0.0145), velocity=(0.1, -0.05, 2.0), turn=ASKEW, spin=spin)
        forces = []
        while len(forces) < 72:
            bed.advance(5)
            forces.append(bed.reactions()[body].copy())
        grains = bed.grains(contacts=False)
        assert np.abs(bed.body_turn(body) - ASKEW).max() > 0.01
        found.append((np.array(forces), grains.velocity[0], grains.spin[0], grains.position[0]))
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-12 * np.abs(ours).max())
    forces, velocity, turning, _ = found[0]
    touched = forces[:, 2] < 0
    assert touched.any() and not touched[-1] and velocity[2] > 2.0  # it has left
    assert np.linalg.norm(turning) > 5.0 and np.abs(forces[:, 3:]).max() > 1e-5  # friction has turned it


@cache
def layer():
    """Two layers of large grains at rest: place, velocity, spin, radius, and the height of their surface."""
    d, rows = 5e-3, 12
    x, y = np.meshgrid((np.arange(rows) + 0.5) * d, (np.arange(rows) + 0.5) * d)
    low = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.5 * d)])
    places = np.vstack([low, low + [0.5 * d, 0.5 * d, 0.72 * d]]) % [rows * d, rows * d, 1.0]
    bed = Bed.from_grains(
        "sand", positions=places, radii=np.full(len(places), 0.5 * d), size=(rows * d, rows * d, 0.02), height=0.1,
        young=3e7, max_overlap=0.2, threads=1,
    )  # fmt: skip
    bed.advance(2000, drag_time=2e-3)
    bed.advance(1000)
    return bed.grains()


def laid():
    """A bed of them whose springs of friction are without stretch, as LAMMPS begins."""
    grains = layer()
    bed = Bed.from_grains(
        "sand", positions=grains.position, velocities=grains.velocity, spins=grains.spin, radii=grains.radius,
        size=(0.06, 0.06, 0.02), height=0.1, young=3e7, max_overlap=0.2, threads=1,
    )  # fmt: skip
    bed.surface = float((grains.position[:, 2] + grains.radius).max())
    return bed


def thrown(bed, kind):
    """The cube that ships, thrown askew onto this bed."""
    platform = find_platform(str(CUBE))
    ground = kind(bed, spatial_members(platform), origin=(0.03, 0.03), friction=0.5, bounded_across=True)
    trial = SpatialTrial(platform=platform, gravity=9.81, mu_s=0.5)
    return SpatialRun(
        trial, ground, substeps=4, duration=0.006, energy_interval=2e-3, quaternion=from_turn([0.3, 0.2, 0.1]),
        velocity=(0.05, 0.02, -0.3), angular_velocity=(3.0, 5.0, -4.0),
    )  # fmt: skip


@pytest.mark.long
def test_a_platform_thrown_askew_lands_as_on_our_bed_with_its_exchange_in_balance(beds):
    ours, theirs = thrown(laid(), BedGround), thrown(beds(laid()), LammpsGround)
    rows = [run.run() for run in (ours, theirs)]
    touching = rows[0]["touching"] > 0
    begin = int(np.argmax(touching))
    first = slice(begin, begin + int(2e-3 / (rows[0]["time"][1] - rows[0]["time"][0])))
    forces = [np.column_stack([row[name][first] for name in ("fx", "fy", "fz")]).mean(axis=0) for row in rows]
    assert touching.any() and forces[0][2] > 0.1
    assert np.linalg.norm(forces[1] - forces[0]) < 0.01 * np.linalg.norm(forces[0])
    assert theirs.energy_residual < 1e-4 and theirs.balance_numbers["momentum_residual"][0] < 1e-9
    ours, theirs = (np.column_stack([row[name] for name in ("wx", "wy", "wz")]) for row in rows)
    assert np.abs(theirs - ours).max() < 0.05 * np.abs(ours - ours[0]).max()


@pytest.mark.long
def test_a_stopped_run_goes_on_from_its_state_within_a_thousandth(beds):
    run = thrown(beds(laid()), LammpsGround)
    while run.time < 0.004:
        run.advance()
    assert run.columns["touching"][-1] > 0
    kept = run.state()
    rest = []
    for each in (run, thrown(beds(laid()), LammpsGround)):
        each.restore(kept)
        each.run()
        rest.append(each.columns)
    np.testing.assert_allclose(rest[1]["fz"], rest[0]["fz"], atol=1e-3 * rest[0]["fz"].max())
