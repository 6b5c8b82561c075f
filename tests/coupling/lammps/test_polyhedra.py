"""Convex polyhedra in LAMMPS: the force on grains at faces, edges and corners, a push, what is refused.

The tests with grains need LAMMPS and mpiexec, and are skipped where they are missing.
"""

import math
from functools import cache

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from coupling.lammps import LammpsBed, LammpsMissingError, OutOfPlaneError, find_lammps
from coupling.lammps.polyhedra import Facet, Sheet, pyramid_corners
from coupling.lammps.regions import MOST_PIECES, MovingBody, check_count, pieces_of
from coupling.robot.distances import distances
from dem import Bed, Material, Mesh, Polyhedron
from dem.shapes.basic import Cone, Cylinder
from dem.shapes.solids import Placed

STUFF = Material("mine", 2650.0, 1e7, 0.25, 0.3, 0.8)
RADIUS, OVERLAP, CENTRE = 1e-3, 1e-5, np.array([0.03, 0.03, 0.03])
WEDGE = np.array([[-10, -10, 0], [10, -10, 0], [0, -10, -12], [-10, 10, 0], [10, 10, 0], [0, 10, -12]]) * 1e-3
SKEW = Rotation.from_rotvec([0.3, 0.5, 0.7]).as_matrix()


@pytest.fixture(scope="module")
def lammps():
    """Skips where LAMMPS is missing."""
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))


def plate(sides=8, radius=0.012, height=0.006, top=1.0):
    """Corners of a regular plate [m], whose upper face is ``top`` times as wide."""
    angle = 2 * math.pi * (np.arange(sides) + 0.5) / sides
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    ends = ((-0.5 * height, 1.0), (0.5 * height, top))
    return np.concatenate([np.column_stack([wide * ring, np.full(sides, z)]) for z, wide in ends])


TETRAHEDRON = 0.012 * np.array([[1, 1, 1], [-1, -1, 1], [1, -1, -1], [-1, 1, -1]])
SHAPES = {
    "octagonal plate": plate(),
    "wedge": WEDGE,
    "tetrahedron": TETRAHEDRON @ SKEW.T,
    "frustum": plate(4, top=0.5) @ SKEW.T,
    "pointed spike": pyramid_corners(Cone(-0.01, 0.0, 0.0, 0.008), 0.01),
    "leaning block": plate(4) @ np.array([[1.0, 0.3, 0.2], [0.0, 1.2, 0.4], [0.1, 0.0, 1.5]]).T,
}


def turned(angle):
    return np.array([math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0])


@cache
def around(name, angle, count=120):
    """Grains that press on a polyhedron with one overlap, in random places [m], and the directions to them."""
    bed = Bed.from_grains(
        STUFF, positions=[[0.002, 0.002, 0.002]], radii=[RADIUS], size=(0.06, 0.06, 0.06), height=0.3, threads=1
    )
    body = bed.add_body(Polyhedron(SHAPES[name]), position=(0.03, 0.03, 0.2))
    bed.move_body(body, position=CENTRE, turn=turned(angle))
    points = CENTRE + np.random.default_rng(1).uniform(-0.02, 0.02, (6000, 3))
    distance, normal, _ = distances(bed, body, points)
    chosen = []
    for place, away, out in zip(
        points - (distance - RADIUS + OVERLAP)[:, None] * normal, distance, normal, strict=True
    ):
        if away > 1e-3 and all(np.abs(place - other).max() > 2.1 * RADIUS for other, _ in chosen):
            chosen.append((place, out))
    return np.array(chosen[:count])


def in_beds(places, speeds, *, gravity=1e-9, time_step=1e-9):
    """The same grains in our bed and in LAMMPS."""
    given = {"positions": places, "velocities": speeds, "radii": [RADIUS] * len(places), "size": (0.06, 0.06, 0.06)}
    made = [Bed.from_grains(STUFF, **given, height=0.3, gravity=gravity, time_step=time_step, threads=1) for _ in "12"]
    return [made[0], LammpsBed(made[1], ranks=1)]


def put(bed, name, angle, **motion):
    """The polyhedron's body, at CENTRE."""
    body = bed.add_body(Polyhedron(SHAPES[name]), position=(0.03, 0.03, 0.2), rolling_friction=0.0)
    bed.move_body(body, position=CENTRE, turn=turned(angle), **motion)
    return body


@pytest.mark.long
@pytest.mark.usefixtures("lammps")
@pytest.mark.parametrize("name", [*SHAPES])
def test_grains_at_faces_edges_and_corners_have_the_closed_form_at_rest_and_the_force_of_our_bed_in_motion(name):
    """Hertz: F = 4/3 E* sqrt(R) d^3/2 at faces, edges and corners alike, whose R* is the grain's radius."""
    angle = 0.4
    places, out = around(name, angle).transpose(1, 0, 2)
    axes = out @ Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
    on_faces = (np.abs(axes[:, None] - facing(name)).max(axis=2) < 1e-4).any(axis=1)
    assert 10 < on_faces.sum() < len(places) - 30
    random = np.random.default_rng(2).uniform(-0.05, 0.05, places.shape)
    for speeds, motion in ((0 * random, {}), (random, {"velocity": (0.02, 0.01, 0.03), "spin": (0.0, 5.0, 0.0)})):
        ours, theirs = in_beds(places, speeds)
        bodies = [put(bed, name, angle, **motion) for bed in (ours, theirs)]
        for bed in (ours, theirs):
            bed.advance(200 if motion else 1)
        forces, sums = zip(*((bed.grains().force, bed.reactions()[1]) for bed in (ours, theirs)), strict=True)
        hertz = 4 / 3 * (theirs.pair_of(bodies[1])[0] / 2) * math.sqrt(RADIUS) * OVERLAP**1.5
        theirs.close()
        np.testing.assert_allclose(forces[1], forces[0], atol=2e-5 * np.abs(forces[0]).max(), rtol=0)
        np.testing.assert_allclose(sums[1], sums[0], atol=2e-5 * np.abs(sums[0][:3]).max(), rtol=0)
        if not motion:
            np.testing.assert_allclose(forces[1], hertz * out, atol=1e-4 * hertz, rtol=0)


def facing(name):
    """The different outward normals of the faces, shape [face, 3]."""
    mesh = Polyhedron(SHAPES[name]).mesh
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    return np.unique(np.round(normals / np.linalg.norm(normals, axis=1)[:, None], 9), axis=0)


@pytest.mark.long
@pytest.mark.usefixtures("lammps")
def test_no_grain_goes_through_an_edge_or_a_corner_and_all_rebound_as_on_our_bed():
    """Grains that fall at 0.5 m/s upon a corner, three edges and a face of a tetrahedron, exactly and beside them."""
    turn = Rotation.align_vectors([[0.0, 0.0, 1.0]], [[1.0, 1.0, 1.0]])[0].as_matrix()
    top, *low = SHAPES["tetrahedron"] @ SKEW @ turn.T
    aims = [top, *(top + share * (end - top) for end in low for share in (0.3, 0.6)), (top + low[0] + low[1]) / 3]
    places = np.array(aims) + CENTRE + [0.0, 0.0, 4 * RADIUS] + [[2e-5 * k, -1e-5 * k, 0.0] for k in range(len(aims))]
    speeds = np.tile([0.0, 0.0, -0.5], (len(aims), 1))
    beds, found, nearest = in_beds(places, speeds, time_step=1e-6), [], np.full(len(aims), np.inf)
    for bed in beds:
        body = bed.add_body(Polyhedron(SHAPES["tetrahedron"] @ SKEW @ turn.T), position=CENTRE)
        for _ in range(80):
            bed.advance(200)
            if bed is beds[0]:
                nearest = np.minimum(nearest, distances(bed, body, bed.grains().position)[0])
        found.append(bed.grains())
    beds[1].close()
    assert nearest.min() > 0.9 * RADIUS and nearest.max() < RADIUS
    assert (found[1].velocity[:, 2] > -0.4).all()
    np.testing.assert_allclose(found[1].velocity, found[0].velocity, atol=5e-3 * 0.5)
    np.testing.assert_allclose(found[1].spin, found[0].spin, atol=0.02 * np.abs(found[0].spin).max())


def seated(name, turn):
    body = MovingBody(1, pieces_of(Polyhedron(SHAPES[name])), "law", np.zeros(3))
    body.place(np.zeros(3), np.zeros(3), turn, np.zeros(3))
    return body


@pytest.mark.parametrize("name", [*SHAPES])
def test_the_prisms_of_edges_end_at_their_corners_in_any_turn_of_the_body(name):
    """LAMMPS' prism: from (x, y, z) along (a, 0, 0), (b_x, b_y, 0) and c, its last three numbers b_x, c_x and c_y."""
    for turn in (turned(0.0), turned(2.0), Rotation.from_rotvec([1.0, 2.0, 0.5]).as_quat()[[3, 0, 1, 2]]):
        body = seated(name, turn)
        matrix = Rotation.from_quat(np.asarray(turn)[[1, 2, 3, 0]]).as_matrix()
        for piece, seat in zip(body.pieces, body.seats, strict=True):
            if isinstance(piece, Facet):
                continue
            x, x_end, y, y_end, z, z_end, b_x, c_x, c_y = map(float, piece.words(seat).split()[1:])
            assert x < x_end and y < y_end and z < z_end
            edges = np.array([[x_end - x, 0, 0], [b_x, y_end - y, 0], [c_x, c_y, z_end - z]])
            shares = np.array(np.meshgrid(*[[0, 1]] * 3)).reshape(3, -1).T
            back = Rotation.from_rotvec([0.0, seat.angle, 0.0]).as_matrix()
            corners = (np.array([x, y, z]) + shares @ edges) @ back.T @ matrix
            for wanted in piece.corners():
                assert np.linalg.norm(corners - wanted, axis=1).min() < 1e-9


def test_each_place_outside_is_in_one_cell():
    places = np.random.default_rng(3).uniform(-0.03, 0.03, (5000, 3))
    for name in SHAPES:
        body, inside = seated(name, turned(0.0)), np.ones(len(places), dtype=bool)
        for point, normal in zip(*supports(name), strict=True):
            inside &= (places - point) @ normal < 0
        count = np.zeros(len(places), dtype=int)
        for cell in (cell for piece in body.pieces for cell in piece.cells()):
            held = np.ones(len(places), dtype=bool)
            for half in cell:
                held &= ((places - half.point) @ half.normal >= 0) != half.other
            count += held
        assert (count[~inside] == 1).all()


def supports(name):
    mesh = Polyhedron(SHAPES[name]).mesh
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    return a, np.cross(b - a, c - a)


def test_a_prism_has_a_piece_for_each_face_and_a_tetrahedron_for_each_face_and_edge():
    kinds = {name: [type(piece) for piece in pieces_of(Polyhedron(SHAPES[name]))] for name in SHAPES}
    assert {name: (found.count(Facet), found.count(Sheet)) for name, found in kinds.items()} == {
        "octagonal plate": (2, 8), "wedge": (2, 3), "tetrahedron": (4, 6), "frustum": (4, 6),
        "leaning block": (2, 4), "pointed spike": (10, 18),
    }  # fmt: skip
    assert len(pieces_of(Polyhedron(plate(28)))) == MOST_PIECES
    with pytest.raises(ValueError, match=r"31 pieces, 31 of them faces and edges .* at most 30"):
        check_count(pieces_of(Polyhedron(plate(29))))


@pytest.mark.parametrize("upright", [True, False])
def test_a_cone_that_ends_in_a_point_is_a_pyramid_with_sections_as_large(upright):
    radius, height, length = 0.006, 0.01, 0.05
    cone = Cone(0.0, height, 0.0, radius) if upright else Cone(0.0, height, radius, 0.0)
    alone = np.concatenate([piece.corners() for piece in pieces_of([cone])])
    assert np.ptp(alone[:, 2]) == pytest.approx(height)
    hull = ConvexHull(alone)
    assert hull.volume == pytest.approx(math.pi * radius**2 * height / 3, rel=1e-12)
    point = alone[np.argmin(alone[:, 2]) if upright else np.argmax(alone[:, 2])]
    np.testing.assert_allclose(point, [0.0, 0.0, 0.0 if upright else height], atol=1e-15)
    if upright:
        whole = ConvexHull(np.concatenate([p.corners() for p in pieces_of([cone, Cylinder(height, length, radius)])]))
        assert whole.volume - hull.volume == pytest.approx(math.pi * radius**2 * (length - height), rel=1e-12)
    moved = pieces_of([Placed(cone, position=(0.0, 0.0, 1.0))])
    assert len(moved) == 28 and min(piece.corners()[:, 2].min() for piece in moved) == pytest.approx(1.0)


def test_a_mesh_of_a_convex_body_in_single_precision_has_the_pieces_of_its_hull_and_another_is_refused():
    single = Polyhedron((plate() @ SKEW.T).astype(np.float32)).mesh
    assert len(single.triangles) == 28
    assert len(pieces_of(Placed(single, position=(0.0, 0.0, 0.1)))) == 10
    dented = single.vertices.copy()
    dented[0] *= 0.7
    with pytest.raises(ValueError, match="Mesh of 28 triangles is not convex: its hull has"):
        pieces_of(Mesh(dented, single.triangles))


def test_a_face_that_stands_askew_along_y_is_refused_in_that_turn_only():
    """A rhombus in the plane of y and z whose sides are along neither: no turn about y makes it LAMMPS' prism."""
    rhombus = (
        np.array([[0, 1, 2], [0, -1, 2], [0, -1, -2], [0, 1, -2]])
        @ Rotation.from_euler("x", 30, degrees=True).as_matrix()
    )
    rhombus[[1, 3]] *= 0.5
    body = Polyhedron(np.concatenate([rhombus, rhombus + [0.5, 0, 0]]) * 0.01)
    assert pieces_of(body)[0].seat(SKEW).angle != 0
    with pytest.raises(OutOfPlaneError):
        MovingBody(1, pieces_of(body), "law", np.zeros(3)).place(np.zeros(3), np.zeros(3), turned(0.3), np.zeros(3))
