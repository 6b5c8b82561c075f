"""Grains in LAMMPS against those of `dem.Bed` from the same state: forces, ranks, restarts, a rank that is killed.

The tests need LAMMPS and mpiexec (`apt install lammps openmpi-bin`), and are skipped where they are missing.
"""

import math
import os
import signal
import tempfile
from contextlib import suppress
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from faults.test_disk import small_disk

from coupling import BedGround, CoupledTumble, platform_members
from coupling.ground import part_of
from coupling.lammps import LammpsBed, LammpsEndedError, LammpsGround, LammpsMissingError, find_lammps
from coupling.lammps.law import OVERLAP
from coupling.members import Member
from dem import Ball, Bed, Cylinder, Facing, Material, Polyhedron
from dem.contact.law import pair_row
from dem.grains.materials import material
from experiments.grains.lammps import moved_to_lammps
from rigid import Trial

try:
    find_lammps()
except LammpsMissingError as missing:
    pytest.skip(str(missing), allow_module_level=True)

SIZE, GRAIN = (0.03, 0.03, 0.02), 0.004


@cache
def fallen(*, seed=3, count=7):
    """Grains of sand that have fallen into a small bed."""
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    radii = 0.5 * GRAIN * (1 + 0.1 * rng.uniform(-1, 1, len(places)))
    positions = SIZE[0] / count * (places + 0.5) + 1e-4 * rng.uniform(-1, 1, places.shape)
    bed = Bed.from_grains("sand", positions=positions, radii=radii, size=SIZE, young=3e7, height=0.06)
    bed.advance(5000, drag_time=5e-3)
    bed.advance(2000)
    return bed.grains()


def at_rest(stuff="sand"):
    """A bed of them whose springs of friction are without stretch, as LAMMPS begins."""
    grains = fallen()
    return Bed.from_grains(
        stuff, positions=grains.position, velocities=grains.velocity, spins=grains.spin, radii=grains.radius,
        size=SIZE, young=3e7, height=0.06,
    )  # fmt: skip


def height_over_grains(radius):
    """Height at which the middle of a ball of this radius in the middle of the bed touches no grain yet [m]."""
    grains = fallen()
    away = np.hypot(*(grains.position[:, :2] - 0.5 * SIZE[0]).T)
    near = away < radius + grains.radius
    reach = np.sqrt((radius + grains.radius[near]) ** 2 - away[near] ** 2)
    return float((grains.position[near, 2] + reach).max())


@pytest.fixture(scope="module")
def bed():
    return at_rest()


@pytest.fixture
def in_lammps(bed):
    """Makes beds in LAMMPS, and ends them."""
    made = []

    def make(**options):
        made.append(LammpsBed(bed, **{"ranks": 1} | options))
        return made[-1]

    yield make
    for each in made:
        each.close()


def with_spike(bed, radius=0.004):
    """A spike's body that goes down from the surface at 0.2 m/s."""
    position = (0.5 * SIZE[0], 0.5 * SIZE[1], height_over_grains(radius))
    body = bed.add_body(
        [Ball(radius=radius), Cylinder(bottom=0.0, top=0.04, radius=radius)], position=position, friction=0.4
    )
    bed.move_body(body, velocity=(0.0, 0.0, -0.2))
    return body


def pushed(bed, body, parts, steps=10):
    """Mean force and moment on the body in each part, shape [parts, 6]."""
    found = []
    for _ in range(parts):
        bed.advance(steps)
        found.append(bed.reactions()[body].copy())
    return np.array(found)


@pytest.mark.long
def test_a_spike_feels_the_force_of_our_bed_within_one_percent_in_the_first_milliseconds(in_lammps):
    ours = at_rest()
    theirs = in_lammps()
    forces = [pushed(each, with_spike(each), 12) for each in (ours, theirs)]
    assert 1.5e-3 < ours.time < 4e-3
    mean = [force.mean(axis=0) for force in forces]
    assert mean[0][2] > 0.05
    np.testing.assert_allclose(mean[1][2], mean[0][2], rtol=0.01)
    assert np.abs(forces[0][:, 2] - forces[1][:, 2]).max() < 0.02 * forces[0][:, 2].max()


def times_to_rock_back(weight):
    """Time until a grain on the floor has rocked to and fro on its rolling spring [s], in our bed and in LAMMPS.

    ``weight``: of the grain, over that which presses it into the floor by the overlap of `MeanContact`.
    """
    stuff, r = replace(material("sand"), young=3e7, restitution=0.8), 0.5 * GRAIN
    two_e, eight_g = pair_row(stuff, Facing())[:2]
    mass, overlap = stuff.density * 4 / 3 * math.pi * r**3, OVERLAP * r * weight ** (2 / 3)
    a = math.sqrt(r * overlap)
    turns = math.sqrt(eight_g * a / (1.4 * mass))  # [rad/s] of a ball that rolls without slip, I = 7/5 m R^2
    # A fifth of the angle at which the spring would be at its bound mu_r F R
    spin = 0.2 * stuff.rolling_friction * (2 / 3) * two_e * overlap / (eight_g * r) * turns
    bed = Bed.from_grains(
        stuff, positions=[(0.015, 0.015, r - overlap)], velocities=[(spin * (r - overlap), 0.0, 0.0)],
        spins=[(0.0, spin, 0.0)], radii=[r], size=SIZE, height=0.06, gravity=2 / 3 * two_e * a * overlap / mass,
    )  # fmt: skip
    theirs, found = LammpsBed(bed, ranks=1), []
    for each in (bed, theirs):
        steps, speeds = max(1, round(0.3 / turns / bed.time_step)), [1.0]
        while speeds[-1] < 0 or len(speeds) < 12:
            each.advance(steps)
            speeds.append(each.grains(contacts=False).velocity[0, 0])
        before, after = speeds[-2:]
        found.append((len(speeds) - 1 - after / (after - before)) * steps * bed.time_step)
    theirs.close()
    return found


def test_a_grain_rolls_on_the_spring_of_our_law_at_the_load_of_the_mean_contact_and_at_no_other():
    ours, theirs = times_to_rock_back(1.0)
    assert theirs == pytest.approx(ours, rel=0.02)
    ours, theirs = times_to_rock_back(8.0)  # the contact radius is twice as large, and LAMMPS' spring is the same
    assert theirs > 1.15 * ours


@pytest.mark.long
def test_an_octagonal_plate_feels_the_force_of_our_bed_on_one_rank_on_two_and_from_a_kept_state():
    """12 mm across, pushed askew at 0.2 m/s while it turns: a face, edges and corners among grains of 4 mm.

    Without rolling friction, whose spring in LAMMPS does not follow the load.
    """
    stuff = replace(material("sand"), rolling_friction=0.0)
    angle = np.pi / 8 + np.pi / 4 * np.arange(8)
    plate = Polyhedron([(0.006 * np.cos(a), 0.006 * np.sin(a), z) for a in angle for z in (0.0, 0.006)])
    grains = fallen()
    near = np.hypot(*(grains.position[:, :2] - 0.5 * SIZE[0]).T) < 0.006
    place = (0.5 * SIZE[0], 0.5 * SIZE[1], float((grains.position[:, 2] + grains.radius)[near].max()) + 0.0003)
    turn = (np.cos(0.05), 0.0, np.sin(0.05), 0.0)
    found, (bed, on_two) = [], [LammpsBed(at_rest(stuff), ranks=ranks) for ranks in (1, 2)]
    for each in (at_rest(stuff), on_two, bed):
        body = each.add_body(plate, position=(*place[:2], 0.05), friction=0.4, rolling_friction=0.0)
        each.move_body(body, position=place, turn=turn, velocity=(0.02, 0.0, -0.2), spin=(0.0, 2.0, 0.0))
        found.append(pushed(each, body, 50))
    ours, two, one = found
    assert ours[:, 2].mean() > 0.05
    assert one[:, 2].mean() == pytest.approx(ours[:, 2].mean(), rel=0.01)
    assert np.abs(one - two).max() < 1e-9 * np.abs(one).max()
    kept, after = bed.state(), pushed(bed, body, 4)
    bed.restore(kept)
    again = pushed(bed, body, 4)
    for each in (bed, on_two):
        each.close()
    assert np.abs(again - after).max() < 0.01 * np.abs(after).max()


@pytest.mark.long
def test_grains_rebound_from_floor_bodies_and_grains_as_fast_as_their_restitution_says():
    """Rebound over approach is the restitution, by its definition, whatever bodies were added in between.

    Within 0.5 %, as LAMMPS' dashpot is of first order in the step. LAMMPS of 2021 puts the number of a wall's dashpot
    through its polynomial once more at each setup: restitution 0.8 was 0.85 at the floor and 0.40 at a body.
    """
    radius, speed = 1.5e-3, 0.1
    stuff = Material("mine", 2650.0, 1e8, 0.25, 0.3, 0.8)
    places = [
        [0.04, 0.04, radius],
        [0.02, 0.02, 0.02 + 6e-3 + radius],
        [0.01, 0.04, 0.03],
        [0.01, 0.04, 0.03 + 2 * radius],
    ]
    speeds = [-speed, -speed, speed / 2, -speed / 2]
    bed = Bed.from_grains(
        stuff, positions=np.add(places, [0.0, 0.0, 1e-7]), radii=[radius] * 4, velocities=[[0, 0, v] for v in speeds],
        size=(0.05, 0.05, 0.05), height=0.08, gravity=1e-9,
    )  # fmt: skip
    theirs = LammpsBed(bed, ranks=1)
    theirs.add_body(Ball(radius=6e-3), position=(0.02, 0.02, 0.02))
    theirs.advance(1)
    theirs.add_body(Ball(radius=2e-3), position=(0.04, 0.015, 0.03))
    theirs.advance(400)
    v = theirs.grains().velocity[:, 2]
    theirs.close()
    np.testing.assert_allclose([v[0], v[1], v[3] - v[2]], 0.8 * speed, rtol=0.005)


def test_a_body_that_is_added_takes_nothing_from_the_springs_that_hold_grains_on_a_slope():
    radius, slope = 1.5e-3, math.atan(0.2)
    stuff = Material("mine", 2650.0, 1e8, 0.25, 0.5, 0.6, rolling_friction=0.5)
    bed = Bed.from_grains(
        stuff, positions=[[0.02, 0.02, radius - 1e-7], [0.03, 0.03, radius - 1e-7]], radii=[radius] * 2,
        size=(0.05, 0.05, 0.05), height=0.08, gravity=(9.81 * math.sin(slope), 0.0, -9.81 * math.cos(slope)),
    )  # fmt: skip
    theirs = LammpsBed(bed, ranks=1)
    theirs.advance(5000)
    theirs.advance(100)
    before, places = theirs.reactions()[0, :3], theirs.grains().position
    np.testing.assert_allclose(before, theirs.weight * np.array([math.sin(slope), 0, -math.cos(slope)]), atol=1e-12)
    theirs.add_body(Ball(radius=6e-3), position=(0.02, 0.02, 0.04))
    theirs.advance(100)
    assert np.abs(theirs.reactions()[0, :3] - before).max() < 1e-9 * theirs.weight
    assert np.abs(theirs.grains().position - places).max() < 1e-15
    theirs.close()


@pytest.mark.long
@pytest.mark.parametrize("cohesion", ["dmt", "jkr"])
def test_cohesive_grains_push_back_as_ours_do(cohesion):
    stuff = replace(material("sand"), cohesion=cohesion, surface_energy=0.02)
    beds = [at_rest(stuff), LammpsBed(at_rest(stuff), ranks=1)]
    ours, theirs = (pushed(bed, with_spike(bed), 16)[:, 2].mean() for bed in beds)
    beds[1].close()
    assert ours > 0.05
    assert theirs == pytest.approx(ours, rel=0.01)


def test_the_momentum_of_grains_is_the_impulse_of_weight_floor_and_spike(in_lammps):
    bed = in_lammps()
    body = with_spike(bed)
    bed.advance(5)
    before, duration = bed.momentum(), 200 * bed.time_step
    bed.advance(200)
    weight = float(bed.mass.sum()) * np.array(bed.gravity)
    impulse = duration * (weight - bed.reactions()[0, :3] - bed.reactions()[body, :3])
    assert np.abs(impulse).max() > 1e-6
    np.testing.assert_allclose(bed.momentum() - before, impulse, atol=1e-9 * duration * np.abs(weight).max())


def test_grains_that_come_to_rest_tell_how_far_they_are(in_lammps):
    grains, told = in_lammps(), []
    taken = grains.settle(lambda time, energy: told.append((time, energy)))
    assert [time for time, _ in told] == sorted(time for time, _ in told) and told[-1][0] == pytest.approx(taken)
    assert told[-1][1] < 1 and all(energy >= 1 for _, energy in told[:-1])


@pytest.mark.long
def test_two_ranks_give_the_forces_of_one_to_rounding(in_lammps):
    one, two = (pushed(each, with_spike(each), 8) for each in (in_lammps(ranks=1), in_lammps(ranks=2)))
    assert np.abs(one).max() > 0.01
    assert np.abs(one - two).max() < 1e-9 * np.abs(one).max()


def test_a_turning_cylinder_across_the_bed_drags_grains_as_ours_does(in_lammps):
    # Without rolling friction on it: LAMMPS' walls leave their own spin out of it.
    half = np.sqrt(0.5)
    turn, found = (half, half, 0.0, 0.0), []
    for bed in (at_rest(), in_lammps()):
        shape = Cylinder(bottom=-0.5 * SIZE[1], top=0.5 * SIZE[1], radius=0.005)
        body = bed.add_body(shape, position=(0.015, 0.015, bed.surface + 0.02), rolling_friction=0.0)
        place = (0.015, 0.015, float((fallen().position[:, 2] + fallen().radius).max()) + 0.0048)
        bed.move_body(body, position=place, turn=turn, spin=(0.0, 20.0, 0.0), velocity=(0.0, 0.0, -0.2))
        found.append(pushed(bed, body, 20)[8:].mean(axis=0))
    assert found[0][0] > 1e-3
    assert found[0][4] < -1e-5
    np.testing.assert_allclose(found[1][2], found[0][2], rtol=0.02)
    # Where contacts slide, LAMMPS bounds spring and dashpot together, ours the spring alone.
    np.testing.assert_allclose(found[1][[0, 4]], found[0][[0, 4]], rtol=0.15)


def test_to_keep_the_state_changes_no_bit_and_a_restored_run_goes_on_within_a_percent(in_lammps):
    one, other = in_lammps(), in_lammps()
    body = with_spike(one)
    with_spike(other)
    pushed(one, body, 20)
    pushed(other, body, 20)
    kept = one.state()
    after = pushed(one, body, 5)
    assert np.array_equal(pushed(other, body, 5), after)
    one.restore(kept)
    assert one.steps == 200
    # The dashpots of the first step see the velocities of its end: LAMMPS keeps no others in a restart file.
    again = pushed(one, body, 5)
    assert np.abs(again - after).max() < 0.01 * np.abs(after).max()


def test_a_run_that_is_resumed_goes_on_at_once_as_if_its_grains_had_come_to_rest_again_first(bed, in_lammps):
    one = in_lammps()
    assert one.settle() > 0 and one.surface != bed.surface
    body = with_spike(one)
    pushed(one, body, 5)
    kept = {f"ground.bed.{name}": value for name, value in one.state().items()}
    after, told = [], []
    for known in (None, kept):
        moved = moved_to_lammps(bed, SimpleNamespace(ranks=1), SimpleNamespace(message=told.append), kept=known)
        try:
            assert (moved.surface, moved.packing_fraction) == (one.surface, one.packing_fraction)
            body = with_spike(moved)
            moved.restore(part_of(part_of(kept, "ground"), "bed"))
            after.append(pushed(moved, body, 5))
        finally:
            moved.close()
        rests = [said for said in told if "surface moved" in said]
    assert len(rests) == 1 and told[-1] == rests[0]  # of the first alone
    assert np.array_equal(*after) and np.abs(after[0]).max() > 0


def test_a_grain_that_has_just_crossed_a_periodic_side_is_in_the_restored_state():
    bed = Bed.from_grains(
        "sand", positions=[[0.029999, 0.01, 0.005], [0.01, 0.01, 0.005]], radii=[2e-3, 2e-3], size=SIZE, young=3e7,
        velocities=[[0.1, 0.0, 0.0], [0.0, 0.0, 0.0]], height=0.06,
    )  # fmt: skip
    crossed = LammpsBed(bed, ranks=1)
    crossed.advance(10)
    crossed.restore(crossed.state())
    crossed.advance(10)
    assert crossed.grains().position[0, 0] < 1e-3
    crossed.close()


def test_a_killed_rank_is_an_error_with_a_sentence_and_the_state_before_can_be_gone_on_with(bed, in_lammps):
    first = in_lammps()
    body = with_spike(first)
    pushed(first, body, 3)
    kept = first.state()
    expected = pushed(first, body, 2)
    os.kill(first.processes[-1], signal.SIGKILL)
    with pytest.raises(LammpsEndedError, match="LAMMPS on 1 ranks has ended") as ended:
        pushed(first, body, 50)
    assert not ended.value.refused
    with pytest.raises(LammpsEndedError):
        first.state()
    second = in_lammps()
    with_spike(second)
    second.restore(kept)
    found = pushed(second, body, 2)
    assert np.abs(found - expected).max() < 0.01 * np.abs(expected).max()


def test_on_a_full_disk_neither_numbers_nor_a_state_are_taken_and_the_file_is_named(bed, tmp_path, monkeypatch):
    """LAMMPS of 2021 tells nothing of a dump that it could not write, and ends at a restart file."""
    with small_disk(tmp_path / "disk", 2**22) as disk:
        monkeypatch.setattr(tempfile, "tempdir", str(disk))
        theirs = LammpsBed(bed, ranks=1)
        for path in disk.glob("*/all.txt"):  # which leaves no room either
            path.unlink()
        with suppress(OSError), (disk / "filled").open("wb", buffering=0) as file:
            while True:
                file.write(bytes(512))
        for asked, name in ((theirs.grains, "all.txt"), (theirs.state, "kept.restart")):
            with pytest.raises(OSError, match="disk full") as caught:
                asked()
            assert caught.value.filename.endswith(name)
        (disk / "filled").unlink()
        theirs.close()


@pytest.mark.long
def test_the_energies_of_grains_and_springs_are_those_of_our_bed(in_lammps):
    rod = Member(row=0, at=np.zeros(3), turn=np.array([1.0, 0.0, 0.0, 0.0]), radius=0.0035, length=0.03)
    place = {"origin": (0.015, 0.015), "bounded": False}
    grounds = [BedGround(at_rest(), [rod], **place), LammpsGround(in_lammps(), [rod], **place)]
    start = height_over_grains(0.0035) - at_rest().surface
    for ground in grounds:
        for k in range(15):
            height = start - 0.2 * ground.time_step * 10 * k
            ground.step((0.0, 0.0, height), (0.0, 0.0, -0.2), 10 * ground.time_step)
    ours, theirs = (ground.energies() for ground in grounds)
    assert theirs["kinetic"] == pytest.approx(ours["kinetic"], rel=0.02)
    assert theirs["potential"] == pytest.approx(ours["potential"], rel=1e-4)
    assert theirs["normal"] == pytest.approx(ours["normal"], rel=0.02)
    assert grounds[1].work_taken() == {}
    with pytest.raises(ValueError, match="iterations"):
        grounds[1].checkpoint()
    (points, pushes), (_, ours_pushes) = grounds[1].pushes(), grounds[0].pushes()
    assert len(points) == len(pushes) > 0
    np.testing.assert_allclose(pushes.sum(axis=0)[2], ours_pushes.sum(axis=0)[2], rtol=0.05)


def test_a_body_that_leaves_the_plane_the_box_or_the_bed_is_refused(in_lammps):
    bed = in_lammps()
    body = bed.add_body(Cylinder(bottom=0.0, top=0.02, radius=0.003), position=(0.015, 0.015, 0.05))
    with pytest.raises(ValueError, match="out of the plane"):
        bed.move_body(body, spin=(1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="out of the plane"):
        bed.move_body(body, turn=(np.cos(0.2), np.sin(0.2), 0.0, 0.0))
    with pytest.raises(ValueError, match="drag_time"):
        bed.advance(1, drag_time=1e-2)
    lying, leaning = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0), (np.cos(0.5), 0.0, np.sin(0.5), 0.0)
    roller = bed.add_body(Cylinder(bottom=-0.015, top=0.015, radius=0.003), position=(0.015, 0.015, 0.05))
    for number, place, turn, axis in (
        (body, (0.001, 0.015, bed.surface), (1.0, 0.0, 0.0, 0.0), "x"),
        (body, (0.015, 0.004, bed.surface), (1.0, 0.0, 0.0, 0.0), "y"),
        (body, (0.015, 0.015, 0.003), leaning, "x"),  # its upper end
        (roller, (0.0005, 0.015, bed.surface), lying, "x"),
        (roller, (0.015, 0.016, bed.surface), lying, "y"),
    ):
        bed.move_body(number, position=place, turn=turn)
        with pytest.raises(RuntimeError, match=f"a body at {axis} = .* across the end"):
            bed.advance(1)
        bed.move_body(number, position=(0.015, 0.015, 0.05))
    bed.move_body(roller, position=(0.0, 0.015, 0.05), turn=lying)
    bed.move_body(body, position=(0.015, 0.015, bed.surface), turn=leaning)
    bed.advance(1)  # what is above the grains may reach out
    with pytest.raises(ValueError, match="no such body"):
        bed.move_body(7, position=(0.0, 0.0, 0.0))
    bed.overlap_limit = 1e-9
    with pytest.raises(RuntimeError, match=r"an overlap of [0-9.e+-]+ % of a diameter went past"):
        bed.grains()


def test_a_bed_with_a_body_in_it_is_refused():
    bed = at_rest()
    with_spike(bed)
    with pytest.raises(ValueError, match="2 bodies"):
        LammpsBed(bed, ranks=1)


@pytest.mark.long
def test_a_platform_tumbles_on_grains_in_lammps_with_its_exchange_in_balance(in_lammps):
    trial = Trial(
        gravity_sim=9.81, counterweight=0.0, mass=0.05, inertia=2e-6, wheel_inertia=1e-7, spike_length=0.01,
        torque=5e-4, mu_s=0.6, stiffness=82.2, damping=0.713,
    )  # fmt: skip
    members = platform_members(spike_length=0.01, count=8, diameter=0.003, clear=0.006)
    ground = LammpsGround(in_lammps(), members, origin=(0.015, 0.015), touch=1e-3 * trial.weight, bounded=False)
    run = CoupledTumble(trial, ground, duration=0.01, tip_radius=0.0015, energy_interval=2e-3)
    rows = run.run()
    assert rows.energy_residual < 1e-4
    assert run.balance_numbers["momentum_residual"][0] < 1e-9
    assert run.samples["normal"][-1] > 0
