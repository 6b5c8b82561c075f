"""Springs of friction and rolling: what they make or take as the contact's stiffness changes, and as the pair turns.

With S the stiffness, a spring at rest in a contact that closes or opens does no work, whatever S does. The rescaled one
keeps its force as S grows and its stretch as S falls (Thornton, Cummins & Cleary 2013), so that it holds less after
either; the displacement spring keeps its stretch.
"""

import numpy as np
import pytest
from driven_pair import POISSON, RADIUS, STEP, STILL, YOUNG, DrivenPair, GrainOnBody
from scipy.spatial.transform import Rotation

from dem.contact.law import effective_moduli

DEPTH, WAY = 1e-4, 1e-6  # [m]
SHEAR = effective_moduli(YOUNG, POISSON, YOUNG, POISSON)[1]
ROOT = 1.5**0.5  # stiffness of friction's spring at 1.2 DEPTH over that at 0.8 DEPTH


def tangential_stiffness(overlap):
    return 8 * SHEAR * np.sqrt(RADIUS / 2 * overlap)


@pytest.mark.parametrize(("tangential", "made"), [("displacement", ROOT - 1), ("rescaled", 1 / ROOT - 1)])
def test_a_cycle_of_sliding_and_closing_makes_energy_with_a_displacement_spring_only(tangential, made):
    """Slip by u at 0.8 of the overlap, closed to 1.2, slip back until no force is left, opened again.

    The first takes S u^2 / 2. A displacement spring then gives S' u^2 / 2, a rescaled one (S u)^2 / 2 S'.
    """
    pair = DrivenPair(0.8 * DEPTH, tangential=tangential)
    stiffness = tangential_stiffness(0.8 * DEPTH)
    start = pair.work
    pair.slip(np.array([0.0, WAY, 0.0]))
    pair.close(0.4 * DEPTH, 200)
    force = stiffness * WAY * (ROOT if tangential == "displacement" else 1)
    pull = pair.force[0] - (pair.force[0] @ pair.normal) * pair.normal
    assert -pull[1] == pytest.approx(force, rel=1e-4)
    pair.slip(np.array([0.0, -force / (ROOT * stiffness), 0.0]))
    pair.close(-0.4 * DEPTH, 200)
    assert start - pair.work == pytest.approx(made * stiffness * WAY**2 / 2, rel=1e-3)


@pytest.mark.parametrize(("opened", "kept"), [(False, 1.0), (True, 1 / ROOT)])
def test_a_rescaled_spring_keeps_its_force_as_the_contact_grows_and_its_stretch_as_it_falls(opened, kept):
    pair = DrivenPair((1.2 if opened else 0.8) * DEPTH, tangential="rescaled")
    pair.slip(np.array([0.0, WAY, 0.0]))
    force, stretch = np.linalg.norm(pair.force[0] - (pair.force[0] @ pair.normal) * pair.normal), pair.springs()[0]
    pair.close((-0.4 if opened else 0.4) * DEPTH, 200)
    pull = pair.force[0] - (pair.force[0] @ pair.normal) * pair.normal
    assert np.linalg.norm(pull) == pytest.approx(kept * force, rel=1e-5)
    left = 1.0 if opened else 1 / ROOT
    assert np.linalg.norm(pair.springs()[0]) == pytest.approx(left * np.linalg.norm(stretch), rel=1e-5)


@pytest.mark.parametrize(("axis", "power"), [(1, 1), (0, 3)])
def test_rolling_and_twisting_springs_keep_their_torque_as_the_contact_grows(axis, power):
    """Their stiffnesses go with a and with a^3; a cycle of turning, closing, turning back takes 1 - (S / S')."""
    pair = DrivenPair(0.8 * DEPTH, tangential="rescaled", rolling=1e6)
    angle = np.zeros(3)
    angle[axis] = 1e-4
    pair.turn(angle)
    held, torque = pair.energies()[2], pair.torque[0]
    assert pair.work == pytest.approx(held, rel=1e-9)
    pair.close(0.4 * DEPTH, 200)
    assert pair.torque[0] == pytest.approx(torque, rel=1e-4, abs=1e-9 * np.abs(torque).max())
    assert pair.energies()[2] == pytest.approx(held / ROOT**power, rel=1e-4)
    pair.close(-0.4 * DEPTH, 200)
    assert pair.energies()[2] == pytest.approx(held / ROOT ** (2 * power), rel=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("friction", [1e6, 0.2])
def test_no_order_of_sliding_turning_and_closing_makes_energy_with_rescaled_springs(friction):
    """The work done, less what all springs hold, never falls; with displacement springs it does."""
    falls = {}
    for tangential in ("rescaled", "displacement"):
        pair = DrivenPair(DEPTH, tangential=tangential, friction=friction, rolling=friction)
        rng, lost, held = np.random.default_rng(3), [], []
        for _ in range(80):
            kind, size = rng.integers(3), rng.normal()
            if kind == 0:
                pair.close((1 + 0.2 * np.sin(3 * size)) * DEPTH - pair_overlap(pair), 10)
            elif kind == 1:
                way = np.cross(pair.normal, rng.normal(size=3))
                pair.slip(3e-6 * size * way, 10)
            else:
                pair.turn(1e-3 * rng.normal(size=3), 10)
            normal, *springs = pair.energies()
            lost.append(pair.work - normal - sum(springs))
            held.append(sum(springs))
        falls[tangential] = -np.diff(lost).min() / np.max(held)
    assert falls["rescaled"] < 1e-4
    assert falls["displacement"] > 0.03


def pair_overlap(pair):
    return pair.radii.sum() - np.linalg.norm(pair.x[0] - pair.x[1])


TURN = np.array([1.1, -0.7, 1.6])  # [rad]


def turned_pair(steps, tangential="rescaled"):
    """Relative errors of both springs, and of what they hold, as a pair is turned as one."""
    pair = DrivenPair(DEPTH, tangential=tangential, rolling=1e6, axis=(1, 0.5, -0.3), second=0.7 * RADIUS)
    pair.slip(1e-4 * np.cross(pair.normal, [0.3, 0.2, 0.9]), 5)
    pair.turn(np.array([0.004, -0.003, 0.006]), 5)
    springs, held = pair.springs(), pair.energies()[1:]
    start, centre = pair.x, pair.x.mean(axis=0) + [1e-3, 2e-3, 0.0]
    for k in range(1, steps + 1):
        there = centre + (start - centre) @ Rotation.from_rotvec(TURN * k / steps).as_matrix().T
        pair.step((there - pair.x) / STEP, np.tile(TURN / steps / STEP, (2, 1)))
    return errors(springs, pair.springs()), np.abs(pair.energies()[1:] / held - 1).max()


def errors(before, after):
    """Of springs that should have turned by ``TURN``, relative."""
    turn = Rotation.from_rotvec(TURN).as_matrix()
    return np.array([np.linalg.norm(b - turn @ a) / np.linalg.norm(a) for a, b in zip(before, after, strict=True)])


def test_springs_turn_with_their_pair_at_their_length_to_second_order():
    """A pair turned as one about an axis that is oblique to it and outside it: in its frame nothing changes."""
    (coarse, _), (fine, energy) = turned_pair(100), turned_pair(400)
    assert fine[0] < 1e-3 and fine[1] < 1e-6 and energy < 2e-3  # the stretch, 5e-5 m, has its slip on an arm of 2 mm
    assert coarse / fine == pytest.approx(16, rel=0.1)
    assert turned_pair(400, "displacement")[0].min() > 0.05


@pytest.mark.parametrize("shape", ["plane", "ball"])
def test_springs_on_a_body_turn_with_it(shape):
    def found(steps):
        both = GrainOnBody(shape, tangential="rescaled")
        springs, x, at = both.springs(), both.x, both.at
        centre = x + [1e-3, 2e-3, 0.0]
        for k in range(1, steps + 1):
            turn = Rotation.from_rotvec(TURN * k / steps)
            there, body = centre + turn.apply(x - centre), centre + turn.apply(at - centre)
            rates, spin = [(there - both.x) / STEP, (body - both.at) / STEP], TURN / steps / STEP
            both.x, both.at = there, body
            both.set(rates[0], spin, rates[1], spin, np.roll(turn.as_quat(), 1))
        return errors(springs, both.springs())

    coarse, fine = found(100), found(400)
    assert fine[0] < 2e-2 and fine[1] < 1e-5  # of a stretch of 5e-7 m, on an arm of 2.5 mm
    assert coarse / fine == pytest.approx(16, rel=0.1)


def test_a_pair_that_stands_still_keeps_its_springs():
    """Forces computed anew, with no time between, leave history and force alone."""
    pair = DrivenPair(DEPTH, tangential="rescaled", rolling=1e6)
    pair.slip(np.array([0.0, WAY, 0.0]))
    pair.turn(np.array([1e-4, 2e-4, 0.0]))
    springs, torque = np.array(pair.springs()), pair.torque
    pair.bed.compute_forces()
    assert np.array_equal(np.array(pair.springs()), springs)
    for _ in range(3):
        pair.step(STILL, STILL)
    assert np.allclose(np.array(pair.springs()), springs, rtol=1e-12, atol=1e-18)
    assert np.allclose(pair.torque, torque, rtol=1e-6)  # but for the dashpots of turning
