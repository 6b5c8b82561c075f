"""Capsules, boxes, tubes, meshes among grains: one contact a grain, no edge felt twice, nothing leaks through."""

import math
import warnings

import numpy as np
import pytest
import solid_shapes
from single_grains import RADIUS, STUFF, grains_at, rotated

from dem import Ball, Box, Capsule, Cone, Cylinder, Facing, Material, Mesh, Placed, Plane, Polyhedron, Tube
from dem.contact.law import effective_moduli
from dem.engine import runtime
from dem.engine.shape_table import ShapeTable
from hedgebed_taichi import ti

TURN = (math.cos(0.35), 0.6 * math.sin(0.35), 0.0, 0.8 * math.sin(0.35))
"""A turn by 0.7 rad about (0.6, 0, 0.8)."""


def back(q):
    return (q[0], *(-v for v in q[1:]))


# ---------------------------------------------------------------------------- distances

CAPSULE = Capsule((0.001, -0.002, 0.0), (0.004, 0.002, 0.005), 0.002)
BOX = Box((0.006, 0.008, 0.003), center=(0.001, 0.0, -0.001))
TUBE = Tube(-0.003, 0.004, 0.004, 0.006)


@pytest.fixture(scope="module")
def distances():
    """A function of a shape and points: distance, normal, curvature at each, as the kernels see them."""
    runtime.start()
    table = ShapeTable(primitives=1, triangles=16, real=ti.f64)

    @ti.kernel
    def look(
        kind: int,
        row: ti.types.vector(6, ti.f64),
        points: ti.types.ndarray(dtype=ti.f64, ndim=2),
        out: ti.types.ndarray(dtype=ti.f64, ndim=2),
    ):
        for i in range(points.shape[0]):
            p = ti.Vector([points[i, 0], points[i, 1], points[i, 2]])
            distance, normal, curvature = table.distance_to(0, kind, row, p, ti.cast(1.0, ti.f64), False)
            out[i, 0] = distance
            for k in ti.static(range(3)):
                out[i, 1 + k] = normal[k]
            out[i, 4] = curvature

    def ask(shape, points):
        table.place[0] = shape.place()
        points = np.ascontiguousarray(points, dtype=float)
        out = np.zeros((len(points), 5))
        look(shape.kind, ti.Vector(shape.bare.row(), dt=ti.f64), points, out)
        return out[:, 0], out[:, 1:4], out[:, 4]

    return ask


def points_around(count=400):
    points = np.random.default_rng(2).uniform(-0.008, 0.009, (count, 3))
    points[0] = (0.0, 0.0, 0.003)  # on a tube's axis
    points[1] = BOX.center
    return points


def signed(shape, p):
    """The same by other means: a capsule's segment sampled, a box and a tube by which of their slabs a point is in."""
    if isinstance(shape, Capsule):
        t = np.linspace(0, 1, 20_001)[:, None]
        axis = np.array(shape.start) + t * (np.array(shape.end) - shape.start)
        return np.linalg.norm(axis - p, axis=1).min() - shape.radius
    if isinstance(shape, Box):
        low, high = np.array(shape.center) - np.array(shape.size) / 2, np.array(shape.center) + np.array(shape.size) / 2
    else:
        p = np.array([np.hypot(p[0], p[1]), p[2]])
        low, high = np.array([shape.inner_radius, shape.bottom]), np.array([shape.outer_radius, shape.top])
    if ((p > low) & (p < high)).all():
        return -min((p - low).min(), (high - p).min())
    return np.linalg.norm(p - np.clip(p, low, high))


@pytest.mark.parametrize(
    ("shape", "tight"),
    [
        (CAPSULE, True), (BOX, True), (TUBE, True), (Placed(BOX, (0.001, -0.002, 0.0), TURN), False),
        (Ball((0.001, 0.0, 0.0), 0.004), True), (Cylinder(-0.002, 0.006, 0.003), True),
        (Cone(0.0, 0.005, 0.0, 0.004), True),
    ],
)  # fmt: skip
def test_all_of_a_shape_is_within_its_bounds(distances, shape, tight):
    low, high = shape.bounds()
    points = np.random.default_rng(3).uniform(low - 0.002, high + 0.002, (60_000, 3))
    inside = points[distances(shape, points)[0] <= 0]
    assert (inside > low - 1e-12).all() and (inside < high + 1e-12).all()
    left = np.maximum(inside.min(axis=0) - low, high - inside.max(axis=0))
    assert left.max() < (6e-4 if tight else 2.5e-3)  # some of it is near every side; of a turned box, its corners


def test_parts_that_no_grain_can_meet_are_warned_of():
    """A grain is sought within half the period of the body's origin (as images in molecular dynamics)."""
    bed = grains_at((0.01, 0.01, 0.05))
    far = Capsule((0.030, -0.005, 0.0), (0.030, 0.005, 0.0), 0.001)
    with pytest.warns(UserWarning, match=r"a Capsule of body \d+ reaches 0\.031 m along x .*period, 0\.0225 m"):
        bed.add_body([Ball(radius=0.003), far], position=(0.02, 0.02, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bed.add_body(Box((0.045, 0.06, 0.002)), position=(0.02, 0.02, 0.0))  # spans the period along y
        bed.add_body([Cylinder(0.0, 0.3, 0.003), Plane()], position=(0.02, 0.02, 0.03))


@pytest.mark.parametrize("shape", [CAPSULE, BOX, TUBE])
def test_distance_normal_and_curvature_are_theirs_wherever_they_are_put(distances, shape):
    points, h = points_around(), 1e-8
    distance, normal, curvature = distances(shape, points)
    assert (distance < 0).sum() > 3
    assert distance == pytest.approx([signed(shape, p) for p in points], abs=3e-9 if shape is CAPSULE else 1e-17)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-12)
    gradient = np.column_stack(
        [(distances(shape, points + step)[0] - distances(shape, points - step)[0]) / (2 * h) for step in h * np.eye(3)]
    )
    smooth = np.abs(np.linalg.norm(gradient, axis=1) - 1) < 1e-6  # not where two parts are equally near, within
    assert smooth.sum() > 390
    assert normal[smooth] == pytest.approx(gradient[smooth], abs=1e-5)
    on = distances(shape, points - distance[:, None] * normal)
    assert np.abs(on[0]).max() < 1e-12 and np.linalg.norm(on[1], axis=1) == pytest.approx(1.0)
    if shape is CAPSULE:
        along = np.array(CAPSULE.end) - CAPSULE.start
        share = (points - CAPSULE.start) @ along / (along @ along)
        assert curvature == pytest.approx(np.where((share > 0) & (share < 1), 0.0, 1 / CAPSULE.radius))
    else:
        assert (curvature == 0).all()
    at = np.array([0.003, -0.001, 0.002])
    there = distances(Placed(shape, tuple(at), TURN), at + rotated(TURN, points))
    assert there[0] == pytest.approx(distance, abs=1e-15)
    assert there[1][smooth] == pytest.approx(rotated(TURN, normal)[smooth], abs=1e-9)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Capsule((0, 0, 0), (0, 0, 1), 0.0), "Capsule: radius = 0.0 must be a positive length"),
        (lambda: Capsule((0, 0, 1), (0, 0, 1), 0.1), "Capsule: end = .* must be another point than start; use a Ball"),
        (lambda: Capsule((0, 0, math.nan), (0, 0, 1), 0.1), "Capsule: start = .* must be 3 finite numbers"),
        (lambda: Box((1.0, 0.0, 1.0)), "Box: size = .* must be three positive lengths"),
        (lambda: Box((1.0, 1.0, 1.0), center=(0.0, 0.0)), "Box: center = .* must be 3 finite numbers"),
        (lambda: Tube(0.0, 1.0, 0.5, 0.4), "Tube: outer_radius = 0.4 must be larger than inner_radius = 0.5"),
        (lambda: Tube(1.0, 0.0, 0.4, 0.5), "Tube: top = 0.0 must lie above bottom = 1.0"),
        (lambda: Placed(BOX, turn=(0.0, 0.0, 0.0, 0.0)), "Placed: turn = .* must be a quaternion"),
        (lambda: Placed(Placed(BOX)), "Placed: shape is itself a Placed"),
    ],
)
def test_a_solid_that_cannot_be_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


# ---------------------------------------------------------------------------- grains on bodies


def box_mesh(size, center=(0.0, 0.0, 0.0), *, cuts=0):
    vertices, triangles = solid_shapes.box(size, center)
    for _ in range(cuts):
        vertices, triangles = solid_shapes.finer(vertices, triangles)
    return Mesh(vertices, triangles)


BLOCK = (0.016, 0.012, 0.006)
AT = np.array([0.022, 0.023, 0.02])


def drop_onto(shape, directions, *, turn=TURN, steps=600, spin=(4.0, -3.0, 5.0)):
    """Grains shot at a moving, turning block from these directions; forces and where they are, at each of 30 looks."""
    local = np.array(directions) * (0.5 * np.array(BLOCK))
    outwards = np.where(np.abs(directions) == 1, np.sign(directions), 0.0)
    outwards /= np.linalg.norm(outwards, axis=1)[:, None]
    bed = grains_at(
        AT + rotated(turn, local + 1.03 * RADIUS * outwards),
        rotated(turn, -0.2 * outwards) + np.random.default_rng(4).normal(0, 0.02, local.shape),
        time_step=2e-6,
    )
    body = bed.add_body(shape, position=AT + (0, 0, 0.2))
    bed.move_body(body, position=AT, turn=turn, velocity=(0.01, 0.02, -0.01), spin=spin)
    bed.make_lists()
    looks, touched = [], 0
    for _ in range(30):
        bed.advance(steps // 30)
        grains = bed.grains()
        touched += grains.coordination
        assert grains.coordination.max() <= 1
        looks.append([grains.force, grains.velocity, grains.spin, *map(np.atleast_2d, bed.reaction(body))])
    assert (touched > 0).all()
    return looks


# At faces, at edges, at corners, and at points where the triangles of the mesh meet.
DIRECTIONS = [
    (0.3, 0.2, 1), (-0.5, 0.4, -1), (1, -0.3, 0.2), (-1, 0, 0.1), (0.3, 1, 0), (0, -1, -0.3),
    (1, 1, 0.2), (-0.4, 1, 1), (1, 0.2, -1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1),
]  # fmt: skip


@pytest.mark.parametrize("cuts", [0, 2])
def test_the_mesh_of_a_box_is_the_box(cuts):
    """Grains that hit faces, edges and corners of a turning block: the same forces, to round-off, at every look."""
    wanted = drop_onto(Box(BLOCK), DIRECTIONS)
    found = drop_onto(box_mesh(BLOCK, cuts=cuts), DIRECTIONS)
    for here, there in zip(found, wanted, strict=True):
        for ours, theirs in zip(here, there, strict=True):
            assert np.abs(ours - theirs).max() <= 1e-8 * np.abs(theirs).max()
    assert max(np.abs(look[0]).max() for look in wanted) > 0.2


def test_a_polyhedron_and_a_placed_box_are_the_box():
    wanted = drop_onto(Box(BLOCK), DIRECTIONS)
    put = (0.002, -0.001, 0.001)
    other = Placed(Box(BLOCK, center=tuple(rotated(back(TURN), -np.array(put)))), put, TURN)
    shapes = [Polyhedron(solid_shapes.box(BLOCK)[0])]
    turned_back = solid_shapes.box(BLOCK)[0]
    shapes.append(Placed(Polyhedron(rotated(back(TURN), turned_back - np.array(put))), put, TURN))
    assert other.extent() >= Box(BLOCK).extent()
    for shape in shapes:
        for here, there in zip(drop_onto(shape, DIRECTIONS), wanted, strict=True):
            for ours, theirs in zip(here, there, strict=True):
                assert np.abs(ours - theirs).max() <= 1e-8 * np.abs(theirs).max()


def test_a_grain_rolls_over_the_edge_between_two_triangles_without_a_bump():
    """Once at rest in the normal direction it stays at its height, across the diagonal of a square and along it.

    m g = 4/3 E* sqrt(r) d^1.5; the diagonal from (-, -) to (+, +) of the slab's upper face is shared by two triangles.
    """
    star, _ = effective_moduli(STUFF.young, STUFF.poisson, math.inf, 0.3)
    mass = STUFF.density * 4 / 3 * math.pi * RADIUS**3
    rest = (mass * 9.81 / (4 / 3 * star * math.sqrt(RADIUS))) ** (2 / 3)
    starts = [(-0.002, 0.001), (-0.006, -0.006)]
    positions = [(0.022 + x, 0.022 + y, 0.01 + RADIUS - rest) for x, y in starts]
    looks = []
    for shape in (Box((0.04, 0.04, 0.01)), box_mesh((0.04, 0.04, 0.01))):
        bed = grains_at(positions, [(0.4, -0.1, 0.0), (0.3, 0.3, 0.0)], gravity=9.81)
        bed.add_body(shape, position=(0.022, 0.022, 0.005), restitution=0.2)
        heights, forces = [], []
        for _ in range(40):
            bed.advance(40)
            grains = bed.grains()
            heights.append(grains.position[:, 2])
            forces.append(grains.force)
        looks.append((np.array(heights), np.array(forces), grains.position))
        assert np.abs(np.array(heights[15:]) - positions[0][2]).max() < 1e-9 * RADIUS
    assert np.abs(looks[0][1] - looks[1][1]).max() < 1e-9 * mass * 9.81
    moved = looks[1][2] - positions
    assert moved[0, 0] - moved[0, 1] > 0.005 and (moved[1, :2] > 0.003).all()  # one across the diagonal, one along it


@pytest.mark.parametrize("thickness", [RADIUS / 20, RADIUS / 2])
def test_a_grain_fired_at_a_thin_plate_rebounds_from_it(thickness):
    """Plates thinner than the grain's overlap with them: at every place, also beside the rim, as from a thick one."""
    speed, wide = 4.0, 0.024
    places = [(0.0, 0.0), (0.005, 0.005), (-0.006, 0.003), (0.0118, 0.0), (0.0119, -0.0119), (-0.0125, 0.0)]
    n = np.array([0.0, 0.0, 1.0])
    ends = []
    for depth in (thickness, 0.01):
        bed = grains_at(
            [
                AT + (x, y, side * (1.02 * RADIUS)) + (0, 0, 0 if side > 0 else -thickness)
                for x, y in places
                for side in (1,)
            ],
            [-speed * n] * len(places),
            material=Material("soft", 2600, 2e7, 0.25, 0.5, 1.0),
            max_overlap=0.1,
            time_step=2e-6,
        )
        bed.add_body(box_mesh((wide, wide, depth), (0, 0, -depth / 2)), position=AT)
        deepest = 0.0
        for _ in range(10):
            bed.advance(20)
            deepest = max(deepest, bed.max_overlap)
        grains = bed.grains()
        ends.append(grains.velocity)
        assert (grains.velocity[:, 2] > 0.3 * speed).all()
        assert deepest * 2 * RADIUS > RADIUS / 20
    assert ends[0] == pytest.approx(ends[1], rel=1e-9, abs=1e-9)


def test_a_capsule_is_a_cylinder_and_two_balls():
    """Grains on its side, at its seams and on its ends: the same forces, velocities and reaction."""
    reach = 0.003 + 1.01 * RADIUS
    local = [(reach, 0, 0.001), (0, -reach, 0.0042), (0, 0, 0.005 + reach), (0.6 * reach, 0, -0.005 - 0.8 * reach)]
    local.append((-reach * math.cos(0.1), 0.0, 0.005 + reach * math.sin(0.1)))
    ends = []
    for shape in (
        Capsule((0, 0, -0.005), (0, 0, 0.005), 0.003),
        [Cylinder(-0.005, 0.005, 0.003), Ball((0, 0, -0.005), 0.003), Ball((0, 0, 0.005), 0.003)],
    ):
        bed = grains_at(
            AT + rotated(TURN, local),
            rotated(TURN, -0.3 * np.array(local) / np.linalg.norm(local, axis=1)[:, None]),
            time_step=2e-6,
        )
        body = bed.add_body(shape, position=AT)
        bed.move_body(body, turn=TURN, velocity=(0.01, 0.0, 0.02), spin=(2.0, 3.0, 1.0))
        bed.make_lists()
        found = []
        for _ in range(10):
            bed.advance(15)
            grains = bed.grains()
            found += [grains.force, grains.velocity, grains.spin, *bed.reaction(body)]
        ends.append(found)
        assert bed.max_overlap > 1e-3
    for ours, theirs in zip(*ends, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-12)


def test_a_tube_holds_a_bed_and_carries_with_its_floor_the_weight():
    """Grains in a tube on the floor stay inside; floor and wall together carry what they weigh, nothing sideways."""
    rng = np.random.default_rng(1)
    ring = [(0.0, 0.0)] + [(0.0048 * math.cos(k), 0.0048 * math.sin(k)) for k in 2 * math.pi * np.arange(6) / 6]
    positions = [
        (0.0225 + x + dx, 0.0225 + y + dy, RADIUS * 1.05 + 0.0046 * layer)
        for layer in range(9)
        for (x, y), (dx, dy) in zip(ring, rng.uniform(-2e-4, 2e-4, (7, 2)), strict=True)
    ]
    wall = 0.0076
    bed = grains_at(
        positions, gravity=9.81, floor=Facing(), material=Material("sand", 2600, 1e7, 0.25, 0.5, 0.5), max_overlap=0.1
    )
    tube = bed.add_body(Tube(0.0, 0.05, wall, 0.009), position=(0.0225, 0.0225, 0.0), friction=0.5)
    bed.advance(round(0.3 / bed.time_step), drag_time=0.02)
    bed.advance(round(0.1 / bed.time_step))
    bed.advance(round(0.05 / bed.time_step))
    grains = bed.grains()
    away = np.hypot(*(grains.position[:, :2] - 0.0225).T)
    assert (away < wall - 0.99 * RADIUS).all() and (away > wall - RADIUS).any()
    wall_force, floor_force = bed.reaction(tube)[0], bed.reaction(0)[0]
    assert wall_force + floor_force == pytest.approx([0.0, 0.0, -bed.weight], abs=0.01 * bed.weight)
    assert wall_force[2] < -0.05 * bed.weight  # Janssen: the wall's friction bears its share


@pytest.mark.parametrize(
    "shape",
    [Box(BLOCK), box_mesh(BLOCK), Capsule((0, 0, -0.004), (0, 0, 0.004), 0.004), Tube(-0.01, 0.01, 0.004, 0.012)],
)
def test_a_body_over_a_grain_is_refused_and_leaves_no_trace(shape):
    """In the midst of a block, where the surface is out of reach, as well as at its side."""
    deep = grains_at([AT if not isinstance(shape, Tube) else AT + (0.008, 0, 0), AT + (0, 0.018, 0)], time_step=2e-6)
    before = deep.state()
    with pytest.raises(ValueError, match=r"starts in overlap with a grain by .* start it higher"):
        deep.add_body(shape, position=AT)
    for name, values in deep.state().items():
        if not name.startswith(("body_", "primitive_")) and name not in ("pushes", "numbers"):
            assert np.array_equal(values, before[name]), name
    assert deep.add_body(shape, position=AT + (0.0, 0.0, 0.03)) == 0


def test_a_grain_in_the_midst_of_a_large_mesh_is_found_though_no_surface_is_near():
    bed = grains_at([AT], time_step=2e-6)
    with pytest.raises(ValueError, match="starts in overlap with a grain"):
        bed.add_body(box_mesh((0.03, 0.03, 0.03), cuts=2), position=AT)
    body = bed.add_body(box_mesh((0.03, 0.03, 0.03), cuts=2), position=AT + (0, 0, 0.03))
    bed.move_body(body, position=AT)
    bed.make_lists()
    assert bed.max_overlap > 3


def test_what_is_no_shape_is_refused():
    with pytest.raises(ValueError, match="shape holds 'box', which is no shape; use Ball"):
        grains_at([AT]).add_body(["box"], position=AT)
