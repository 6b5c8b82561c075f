"""Shapes: distances and normals against densely sampled surfaces; forces and torques between grains and bodies."""

import itertools
import math

import numpy as np
import pytest
from single_grains import RADIUS, SIZE, grains_at, rotated

from dem import Ball, Cone, Cylinder, Plane
from dem.contact.law import effective_moduli
from dem.engine import runtime
from dem.shapes.basic import distance_to
from hedgebed_taichi import ti

BALL = Ball(center=(0.001, -0.002, 0.003), radius=0.004)
CYLINDER = Cylinder(-0.002, 0.006, 0.003)
CONE = Cone(0.0, 0.006, 0.0, 0.003)
FRUSTUM = Cone(-0.001, 0.004, 0.004, 0.0015)
PLANE = Plane(point=(0.0, 0.0, 0.002), normal=(0.3, -0.4, 1.2))


@pytest.fixture(scope="module")
def distances():
    """A function of a primitive and points: distance, normal, curvature at each, as the kernels see them."""
    runtime.start()

    @ti.kernel
    def look(
        kind: int,
        row: ti.types.vector(6, ti.f64),
        points: ti.types.ndarray(dtype=ti.f64, ndim=2),
        out: ti.types.ndarray(dtype=ti.f64, ndim=2),
    ):
        for i in range(points.shape[0]):
            p = ti.Vector([points[i, 0], points[i, 1], points[i, 2]])
            distance, normal, curvature = distance_to(kind, row, p)
            out[i, 0] = distance
            for k in ti.static(range(3)):
                out[i, 1 + k] = normal[k]
            out[i, 4] = curvature

    def ask(shape, points):
        points = np.ascontiguousarray(points, dtype=float)
        out = np.zeros((len(points), 5))
        look(shape.kind, ti.Vector(shape.row(), dt=ti.f64), points, out)
        return out[:, 0], out[:, 1:4], out[:, 4]

    return ask


def points_around(count=400):
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.008, 0.01, (count, 3))
    points[0] = (0.0, 0.0, 0.009)  # on the axis
    points[1] = (0.0, 0.0, 0.0015)
    return points


def profile_of(shape):
    """Corners of the profile of a body of revolution, (rho, z)."""
    row = shape.row()
    return np.array([(0, row[0]), (row[2], row[0]), (row[3], row[1]), (0, row[1])])


@pytest.mark.parametrize("shape", [CYLINDER, CONE, FRUSTUM])
def test_distance_to_a_body_of_revolution_is_that_of_its_sampled_profile(distances, shape):
    """The nearest of 60,000 points of the profile; the sign by whether the point is in the profile."""
    corners = profile_of(shape)
    t = np.linspace(0, 1, 20_001)[:, None]
    samples = np.concatenate([a + t * (b - a) for a, b in itertools.pairwise(corners)])
    points = points_around()
    flat = np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])
    apart = np.array([np.sqrt(((samples - p) ** 2).sum(axis=1).min()) for p in flat])
    share = (flat[:, 1] - corners[1, 1]) / (corners[2, 1] - corners[1, 1])
    inside = (share > 0) & (share < 1) & (flat[:, 0] < corners[1, 0] + share * (corners[2, 0] - corners[1, 0]))
    assert inside.sum() > 2 and (~inside).sum() > 100
    distance, _, curvature = distances(shape, points)
    assert distance == pytest.approx(np.where(inside, -apart, apart), abs=2e-7)
    assert (curvature == 0).all()


def test_distance_to_ball_and_plane_is_theirs(distances):
    points = points_around()
    distance, normal, curvature = distances(BALL, points)
    offset = points - np.array(BALL.center)
    length = np.linalg.norm(offset, axis=1)
    assert distance == pytest.approx(length - BALL.radius, abs=1e-16)
    assert normal == pytest.approx(offset / length[:, None], abs=1e-14)
    assert curvature == pytest.approx(1 / BALL.radius)
    distance, normal, curvature = distances(PLANE, points)
    n = np.array(PLANE.normal) / np.linalg.norm(PLANE.normal)
    assert distance == pytest.approx((points - PLANE.point) @ n, abs=1e-16)
    assert normal == pytest.approx(np.tile(n, (len(points), 1)))
    assert (curvature == 0).all()


@pytest.mark.parametrize("shape", [BALL, CYLINDER, CONE, FRUSTUM, PLANE])
def test_the_normal_is_the_gradient_of_the_distance(distances, shape):
    points, h = points_around(), 1e-8
    distance, normal, _ = distances(shape, points)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-12)
    gradient = np.column_stack(
        [(distances(shape, points + step)[0] - distances(shape, points - step)[0]) / (2 * h) for step in h * np.eye(3)]
    )
    # Not where two parts of the surface are equally near, within the body.
    smooth = np.abs(np.linalg.norm(gradient, axis=1) - 1) < 1e-6
    assert smooth.sum() > 380 and smooth[distance > 0].sum() >= (distance > 0).sum() - 1
    assert normal[smooth] == pytest.approx(gradient[smooth], abs=1e-5)


@pytest.mark.parametrize("shape", [CYLINDER, CONE, FRUSTUM, BALL, PLANE])
def test_the_normal_on_the_surface_is_a_unit_vector(distances, shape):
    """Where the distance is zero, or the point is on the axis, nothing is divided by zero."""
    points = points_around()
    distance, normal, _ = distances(shape, points)
    on = points - distance[:, None] * normal
    left, normal, _ = distances(shape, on)
    assert np.abs(left).max() < 1e-12
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-9)
    if not isinstance(shape, (Ball, Plane)):
        ends = np.array([[0, 0, shape.bottom], [0, 0, shape.top]])
        _, normal, _ = distances(shape, ends)
        assert np.isfinite(normal).all() and np.linalg.norm(normal, axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Ball(radius=0.0), "Ball: radius = 0.0 must be a positive length"),
        (lambda: Ball(radius=math.nan), "Ball: radius = nan"),
        (lambda: Cylinder(0.0, 1.0, -1.0), "Cylinder: radius = -1.0"),
        (lambda: Cylinder(1.0, 1.0, 1.0), "Cylinder: top = 1.0 must lie above"),
        (lambda: Cone(0.0, 1.0, 0.0, 0.0), "not both 0"),
        (lambda: Cone(0.0, math.nan, 0.0, 1.0), "Cone: top = nan"),
        (lambda: Plane(normal=(0.0, 0.0, 0.0)), "must be 3 finite numbers, not all zero"),
        (lambda: Plane(normal=(math.inf, 0.0, 1.0)), "must be 3 finite numbers, not all zero"),
        (lambda: Plane(point=(math.nan, 0.0, 0.0)), "Plane: point = .* must be 3 finite numbers"),
        (lambda: Plane(point=(0.0, 0.0)), "Plane: point = .* must be 3 finite numbers"),
        (lambda: Ball(center=(math.nan, 0.0, 0.0), radius=1.0), "Ball: center = .* must be 3 finite numbers"),
        (lambda: Cone(0.0, 1.0, math.nan, 0.1), "Cone: bottom_radius = nan, top_radius = 0.1 must be finite"),
        (lambda: Cone(0.0, 1.0, 0.1, math.inf), "Cone: .* must be finite, 0 or more and not both 0"),
        (lambda: Cone(0.0, math.inf, 0.1, 0.1), "Cone: top = inf must lie above bottom = 0.0, both finite"),
        (lambda: Cylinder(-math.inf, 0.0, 0.1), "Cylinder: top = 0.0 must lie above bottom = -inf, both finite"),
    ],
)
def test_a_shape_that_cannot_be_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


# ---------------------------------------------------------------------------- grains on bodies


@pytest.mark.parametrize(("young", "poisson"), [(None, 0.3), (3e8, 0.3)])
def test_a_grain_on_a_ball_reproduces_hertz(young, poisson):
    """R* = r R / (r + R), E* with the ball's moduli, m* the grain's mass: overlap, contact time."""
    ball, speed = 0.006, 0.5
    star, _ = effective_moduli(1e8, 0.25, math.inf if young is None else young, poisson)
    radius = RADIUS * ball / (RADIUS + ball)
    mass = 2600 * 4 / 3 * math.pi * RADIUS**3
    k = 4 / 3 * star * math.sqrt(radius)
    overlap = (5 * mass * speed**2 / (4 * k)) ** 0.4
    time = 2.943275 * overlap / speed
    n = np.array([0.6, 0.0, 0.8])
    center = np.array([0.03, 0.03, 0.02])
    bed = grains_at(center + n * (ball + RADIUS), -speed * n, time_step=time / 1000)
    bed.add_body([Ball(radius=ball)], position=center, young=young, poisson=poisson)
    bed.advance(500)
    assert bed.max_overlap * 2 * RADIUS == pytest.approx(overlap, rel=1e-5)
    grains = bed.grains()
    assert grains.force[0] == pytest.approx(k * overlap**1.5 * n, rel=1e-4, abs=1e-6)
    bed.advance(550)
    grains = bed.grains()
    assert grains.velocity[0] == pytest.approx(speed * n, rel=1e-5, abs=1e-9)
    gap = np.linalg.norm(grains.position[0] - center) - ball - RADIUS
    assert bed.time - gap / speed == pytest.approx(time, rel=1e-4)


def spike_and_grains(shift):
    """A turned spike, ball and cylinder, that moves and spins among grains which touch its side and tip."""
    at = np.array([0.02, 0.03, 0.02]) + shift
    turn = (math.cos(0.2), 0.6 * math.sin(0.2), 0.8 * math.sin(0.2), 0.0)
    reach = 0.004 + RADIUS * 0.98
    local = [
        [0, 0, 0.004 - reach],
        [reach * 0.8, 0, 0.004 - 0.6 * reach],
        [reach, 0, 0.012],
        [0, -reach, 0.009],
        [-reach * 0.6, reach * 0.8, 0.015],
    ]
    positions = at + rotated(turn, local)
    bed = grains_at(positions, np.random.default_rng(4).normal(0, 0.05, (5, 3)), time_step=2e-6)
    body = bed.add_body([Ball(center=(0, 0, 0.004), radius=0.004), Cylinder(0.004, 0.02, 0.004)], position=(0, 0, 0.3))
    bed.move_body(body, position=at, turn=turn, velocity=(0.02, -0.01, -0.1), spin=(3.0, 0.0, 10.0))
    bed.make_lists()
    bed.advance(20)
    return bed, body


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.026, 0.0, 0.0), (0.023, 0.016, 0.0)])
def test_the_reaction_is_minus_the_forces_on_the_grains(shift):
    """Force and torque about the origin, wherever the body lies across the boundary of the box."""
    bed, body = spike_and_grains(np.array(shift))
    bed.advance(1)
    grains = bed.grains()
    assert (np.linalg.norm(grains.force, axis=1) > 1e-4).all()
    force, torque = bed.reaction(body)
    assert force == pytest.approx(-grains.force.sum(axis=0), rel=1e-12)
    # The contact point lies on the line of the normal force; each grain touches the body alone. Torque on a grain and
    # on the body balance: sum of x_i x f_i + t_i over the grains is minus the torque on the body about its origin.
    order = np.argsort(bed.engine.read("id"))
    own = bed.engine.read("torque")[order]
    arm = grains.position - bed.body_position(body)
    arm[:, :2] -= np.array(SIZE[:2]) * np.round(arm[:, :2] / SIZE[:2])
    wanted = -(np.cross(arm, grains.force) + own).sum(axis=0)
    assert torque == pytest.approx(wanted, rel=1e-9, abs=1e-14)
    if shift == (0.0, 0.0, 0.0):
        return
    del bed  # its engine serves the next
    plain, body = spike_and_grains(np.zeros(3))
    plain.advance(1)
    for here, there in zip((force, torque), plain.reaction(body), strict=True):
        assert here == pytest.approx(there, rel=1e-8, abs=1e-12)


def test_a_grain_that_slides_over_a_body_drags_it_along_and_turns_it():
    """Torque sign: a grain that slides in +y over the side at +x pushes the body to +y and turns it about +z."""
    bed = grains_at([[0.03 + 0.004 + 0.99 * RADIUS, 0.03, 0.02]], [[0.0, 0.5, 0.0]], time_step=2e-6)
    body = bed.add_body([Cylinder(-0.005, 0.005, 0.004)], position=(0.03, 0.03, 0.02))
    bed.advance(3)
    force, torque = bed.reaction(body)
    assert force[0] < 0 < force[1] and abs(force[2]) < 1e-12
    assert torque[2] == pytest.approx(0.004 * force[1], rel=1e-2)
    assert bed.grains().spin[0, 2] > 0  # and friction rolls the grain: its near side is held back


@pytest.mark.long
def test_a_union_touches_a_grain_once():
    """Where ball and cylinder meet, a grain feels one contact; also where one is within the other."""
    at = (0.03, 0.03, 0.02)
    positions = [[0.03 + 0.004 + 0.98 * RADIUS, 0.03, 0.024], [0.03 - 0.004 - 0.98 * RADIUS, 0.03, 0.0245]]
    forces = []
    for shape in (
        [Cylinder(0.0, 0.02, 0.004)],
        [Ball(center=(0, 0, 0.004), radius=0.004), Cylinder(0.004, 0.02, 0.004)],
        [Cylinder(0.0, 0.02, 0.004), Cylinder(0.001, 0.015, 0.004), Ball(center=(0, 0, 0.008), radius=0.003)],
    ):
        bed = grains_at(positions, time_step=2e-6)
        bed.add_body(shape, position=at)
        grains = bed.grains()
        assert (grains.coordination == 1).all()
        forces.append(grains.force)
    star, _ = effective_moduli(1e8, 0.25, math.inf, 0.3)
    flat = 4 / 3 * star * math.sqrt(RADIUS) * (0.02 * RADIUS) ** 1.5
    assert forces[0][:, 0] == pytest.approx([flat, -flat], rel=1e-9)
    assert forces[2] == pytest.approx(forces[0], rel=1e-9, abs=1e-12)
    round_ = flat * math.sqrt(0.004 / (0.004 + RADIUS))  # the first grain lies at the seam: either curvature will do
    assert forces[1][0, 0] in (pytest.approx(flat, rel=1e-9), pytest.approx(round_, rel=1e-9))
    assert forces[1][1, 0] == pytest.approx(-flat, rel=1e-9)


def test_a_moving_body_is_where_its_velocity_takes_it():
    bed = grains_at([[0.01, 0.01, 0.03]], time_step=1e-5)
    body = bed.add_body([Ball(radius=0.003)], position=(0.05, 0.05, 0.02))
    bed.move_body(body, velocity=(0.5, -0.25, 0.1))
    bed.advance(3000)
    assert bed.body_position(body) == pytest.approx(np.array([0.05, 0.05, 0.02]) + 0.03 * np.array([0.5, -0.25, 0.1]))
