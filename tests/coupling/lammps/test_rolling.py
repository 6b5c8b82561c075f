"""Rolling springs by the load: classes of grains, and that grains in LAMMPS change theirs as loads change."""

import math
from dataclasses import replace

import numpy as np
import pytest

from coupling.lammps import LammpsBed, LammpsMissingError, find_lammps
from coupling.lammps.law import spring_force
from coupling.lammps.rolling import CLASSES, PERIOD, RollingClasses
from dem import SAND, Ball, Bed
from dem.contact.law import pair_row

RADIUS = 2e-3
STEP = 2 ** (1 / 3)  # Ratio of the contact radii of neighbouring classes


def classes_of(stuff=SAND, radii=(RADIUS,)):
    """The classes of grains of these radii."""
    sizes = np.array(radii)
    return RollingClasses(pair_row(stuff), stuff, sizes, stuff.density * 4 / 3 * math.pi * sizes**3)


def rained(gravity):
    """Sand that was rained, and its contacts: grains of each, overlap [m] and R* [m]."""
    bed = Bed.prepare("sand", size=(0.03, 0.03, 0.03), grain=0.004, gravity=gravity, seed=5, threads=1)
    position, radius = bed.grains().position, bed.grains().radius
    first, second = np.triu_indices(len(radius), 1)
    apart = position[first] - position[second]
    apart[:, :2] -= 0.03 * np.round(apart[:, :2] / 0.03)
    overlap = radius[first] + radius[second] - np.linalg.norm(apart, axis=1)
    touching = overlap > 0
    first, second, overlap = first[touching], second[touching], overlap[touching]
    return bed, first, second, overlap, radius[first] * radius[second] / (radius[first] + radius[second])


@pytest.mark.parametrize("gravity", [9.81, 0.0981])
def test_a_rained_bed_has_the_contact_radii_of_its_classes(gravity):
    """Hertz: a^2 = R* d. Contacts count by their force; one constant for all is wrong by 30 % and more."""
    bed, first, second, overlap, reduced = rained(gravity)
    grains, row = bed.grains(), pair_row(bed.material)
    force = spring_force(row, "none", overlap, reduced)
    arm = 0.5 * (grains.radius[first] + grains.radius[second] - overlap) * force
    loads = sum(np.bincount(side, arm, len(grains.radius)) for side in (first, second))
    classes = RollingClasses(row, bed.material, grains.radius, grains.mass)
    kinds, radius = classes.of(loads), np.sqrt(reduced * overlap)
    found = np.array([classes.contact(*pair).radius for pair in zip(kinds[first], kinds[second], strict=True)])
    off = np.log(found / radius)
    mean = np.average(off, weights=force)
    assert abs(mean) < 0.05
    assert math.sqrt(np.average(off**2, weights=force)) < 0.2
    alone = np.log(radius)
    assert math.sqrt(np.average((alone - np.average(alone, weights=force)) ** 2, weights=force)) > 0.3


@pytest.mark.parametrize("count", [4, 6])
def test_equal_contacts_around_a_grain_have_the_spring_of_our_law(count):
    """Where n equal forces F press each grain, S = n F and F = 2 / n times S S / (S + S)."""
    classes, force = classes_of(), 1e-2
    own = (1.5 * 0.5 * RADIUS * force / pair_row(SAND)[0]) ** (1 / 3)  # Hertz' a
    kind = int(classes.of(np.array([RADIUS * count * force]))[0])
    share = (0.59 * count / 2) ** (1 / 3)  # of the assumed share of a contact in the real one
    assert classes.contact(kind, kind).radius / (share * own) == pytest.approx(1.0, abs=math.sqrt(STEP) - 1)


def test_a_weak_neighbour_bounds_the_load_of_a_contact():
    classes = classes_of()
    weak, middle = classes.contact(5, 30).radius, classes.contact(5, 5).radius
    assert middle < weak < 1.27 * middle
    assert classes.contact(30, 5) == classes.contact(5, 30)


def test_grains_under_cohesion_alone_have_the_contact_of_cohesion():
    """DMT: at no outer force the spring carries 2 pi w R*; JKR: a^3 = 9 pi w R*^2 / (2 E*) (Johnson et al. 1971)."""
    for law, pull in (("dmt", 2.0), ("jkr", 6.0)):
        stuff = replace(SAND, cohesion=law, surface_energy=0.02)
        two_e, pi_w = pair_row(stuff)[0], pair_row(stuff)[-1]
        own = (1.5 * 0.5 * RADIUS * pull * pi_w * 0.5 * RADIUS / two_e) ** (1 / 3)
        classes = classes_of(stuff)
        kind = int(classes.of(np.zeros(1))[0])
        assert classes.contact(kind, kind).radius == pytest.approx(own, rel=math.sqrt(STEP) - 1)


def test_loads_beyond_the_first_and_last_class_take_these():
    classes = classes_of()
    assert list(classes.of(np.array([-1.0, 0.0, 1e9]))) == [1, 1, CLASSES]
    assert len(classes.pairs(tensile=False)) == CLASSES * (CLASSES + 1) // 2


def test_the_exchanges_of_a_run_do_not_move_the_changes_of_type():
    def followed(parts):
        classes, at, changes = classes_of(), 0, []
        for steps in parts:
            for line in classes.runs(at, steps, 3):
                words = line.split()
                if words[0] == "set":
                    changes.append(at)
                else:
                    at += int(words[1])
        return at, changes

    whole = followed([7 * PERIOD + 3])
    assert whole == (7 * PERIOD + 3, [k * PERIOD - 1 for k in range(2, 8)])
    assert followed([4] * 18 + [1]) == followed([1] * 73) == whole
    assert [line.split()[:2] for line in classes_of(replace(SAND, rolling_friction=0.0)).runs(0, 55, 0)] == [
        ["run", "55"]
    ]


def test_grains_in_lammps_change_their_class_with_the_load_of_a_spike():
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    bed = rained(9.81)[0]
    grains = bed.grains()
    theirs = LammpsBed(bed, ranks=1)
    try:
        top = float(grains.position[:, 2].max() + grains.radius.max()) + 3e-3
        body = theirs.add_body(Ball(radius=6e-3), position=(0.015, 0.015, top))
        theirs.move_body(body, velocity=(0.0, 0.0, -0.1))
        theirs.advance(PERIOD)
        theirs.advance(PERIOD * round(0.01 / 0.1 / theirs.time_step / PERIOD))
        pressed = theirs.reaction(body)[0][2]
        theirs.advance(PERIOD)
        theirs._lammps.tell(["write_dump all custom kinds id type modify sort id"])
        theirs._lammps.wait()
        kinds = np.loadtxt(theirs._lammps.folder / "kinds", skiprows=9, dtype=int)[:, 1]
        now, classes = theirs.grains(contacts=False), theirs._classes
        away = np.linalg.norm(now.position - theirs.body_position(body), axis=1)
        overlap = np.maximum(0.0, 6e-3 + now.radius - away)
        spike = spring_force(theirs.pair_of(body), "none", overlap, now.radius * 6e-3 / (now.radius + 6e-3))
        load = theirs._loads(now) + now.radius * spike
        own, before = classes.of(load), classes.of(theirs._loads(grains))
        carries = load > 0.1 * load.mean()
        near = (away < 12e-3) & carries
    finally:
        theirs.close()
    assert pressed > 0.1
    assert np.mean(np.abs(own - before)[near] >= 2) > 0.5  # the contact radius of 1.6 times, or less than 1 / 1.6
    assert np.mean(np.abs(kinds - own)[near] <= 1) > 0.8
    assert np.mean(np.abs(kinds - own)[~near & carries] <= 1) > 0.9
