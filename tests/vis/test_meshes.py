"""Meshes are closed, point outwards, and hold the volume of the body they stand for."""

import math
from collections import Counter

import numpy as np
import pytest

from dem import Ball, Box, Capsule, Cone, Cylinder, Mesh, Placed, Plane, Polyhedron, Tube
from vis.pictures.frames import FrameWriter, read_frames
from vis.pictures.meshes import in_place, mesh_volume, shape_mesh, spike_mesh, spike_profile

A, B, LENGTH = 0.006, 0.004, 0.05  # radius of tip and shaft, length [m]


def cap(radius, height):
    """Volume of a spherical cap [m3]: pi h^2 (3 r - h) / 3."""
    return math.pi * height**2 * (3 * radius - height) / 3


def exact(tip, shaft):
    if tip == "sphere":
        height = A + math.sqrt(A**2 - shaft**2)  # where the shaft leaves the ball
        return cap(A, height) + math.pi * shaft**2 * (LENGTH - height)
    if tip == "cone":
        height = A / math.tan(math.radians(30))
        return math.pi * A**2 * height / 3 + math.pi * shaft**2 * (LENGTH - height)
    return math.pi * shaft**2 * LENGTH


CASES = [("sphere", A), ("sphere", B), ("cone", A), ("cone", B), ("flat", A)]


@pytest.mark.parametrize(("tip", "shaft"), CASES)
def test_volume_is_the_analytic_one(tip, shaft):
    # inscribed polygons: the area of a circle is short by 1 - sin(x)/x, x = 2 pi / n, here 0.05 %
    points, triangles = spike_mesh(
        tip, diameter=2 * A, shaft_diameter=2 * shaft, length=LENGTH, cone_angle=60, segments=120
    )
    assert mesh_volume(points, triangles) == pytest.approx(exact(tip, shaft), rel=1.5e-3)
    assert mesh_volume(points, triangles) < exact(tip, shaft)


@pytest.mark.parametrize(("tip", "shaft"), CASES)
def test_mesh_is_closed_and_oriented(tip, shaft):
    """Every edge belongs to two triangles, which run along it in opposite directions; none is degenerate."""
    points, triangles = spike_mesh(tip, diameter=2 * A, shaft_diameter=2 * shaft, length=LENGTH)
    edges = Counter((int(a), int(b)) for t in triangles for a, b in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0])))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(normal, axis=1).min() > 0
    # Euler's formula for a sphere: V - E + F = 2
    assert len(points) - len(edges) // 2 + len(triangles) == 2


def test_lowest_point_is_the_origin_and_the_axis_is_z():
    points, _ = spike_mesh("sphere", diameter=2 * A, length=LENGTH)
    assert points[:, 2].min() == 0.0
    assert points[:, 2].max() == LENGTH
    assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(A)
    assert np.allclose(points[np.argmin(points[:, 2])], 0)


def test_profile_of_a_plain_cylinder_has_no_doubled_points():
    assert np.allclose(spike_profile("flat", diameter=2 * A, length=LENGTH), [[0, 0], [A, 0], [A, LENGTH], [0, LENGTH]])


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"tip": "needle"}, "needle"),
        ({"diameter": -1.0}, "diameter"),
        ({"length": 0.001}, "length"),
        ({"shaft_diameter": 0.02}, "shaft_diameter"),
        ({"tip": "flat", "shaft_diameter": 0.004}, "flat"),
        ({"tip": "cone", "cone_angle": 180.0}, "cone_angle"),
        ({"segments": 2}, "segments"),
    ],
)
def test_what_cannot_be_is_refused_by_name(changed, word):
    given = {"tip": "sphere", "diameter": 2 * A, "length": LENGTH} | changed
    with pytest.raises(ValueError, match=word):
        spike_mesh(**given)


CORNERS = [(0, 0, 0), (0.01, 0, 0), (0, 0.01, 0), (0, 0, 0.01)]
HALF = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
"""A quarter turn about y: z comes to lie along x."""
DISC, CAP = math.pi * 0.003**2, 4 / 3 * math.pi * 0.003**3
SHAPES = {  # its volume, and its lowest and highest corner
    "ball": (Ball((0.001, 0, 0.002), 0.003), CAP, (-0.002, -0.003, -0.001), (0.004, 0.003, 0.005)),
    "box": (Box((0.01, 0.02, 0.03), (0.001, 0, 0)), 6e-6, (-0.004, -0.01, -0.015), (0.006, 0.01, 0.015)),
    "capsule": (Capsule((0, 0, 0), (6e-3, 0, 8e-3), 3e-3), DISC * 0.01 + CAP, (-3e-3,) * 3, (9e-3, 3e-3, 0.011)),
    "capsule down": (Capsule((0, 0, 0.01), (0, 0, 0), 3e-3), DISC * 0.01 + CAP, (-3e-3,) * 3, (3e-3, 3e-3, 0.013)),
    "cone": (Cone(0.0, 0.006, 0.0, 0.003), DISC * 0.002, (-0.003, -0.003, 0), (0.003, 0.003, 0.006)),
    "cylinder": (Cylinder(0.0, 0.006, 0.003), DISC * 0.006, (-0.003, -0.003, 0), (0.003, 0.003, 0.006)),
    "tube": (Tube(0, 0.01, 0.003, 0.005), math.pi * 16e-6 * 0.01, (-0.005, -0.005, 0), (0.005, 0.005, 0.01)),
    "polyhedron": (Polyhedron(CORNERS), 1e-6 / 6, (0, 0, 0), (0.01, 0.01, 0.01)),
    "placed": (
        Placed(Cylinder(0, 6e-3, 3e-3), (0.01, 0, 0), HALF),
        DISC * 6e-3,
        (0.01, -3e-3, -3e-3),
        (0.016, 3e-3, 3e-3),
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_that_grains_touch_is_shown_where_it_is(name):
    """Closed and turned outwards (or dem.Mesh would refuse it), of the shape's volume, between its ends."""
    shape, volume, low, high = SHAPES[name]
    points, triangles = shape_mesh(shape, segments=120)
    shown = Mesh(points, triangles)
    assert shown.volume == pytest.approx(volume, rel=3e-3)
    assert points.min(axis=0) == pytest.approx(low, abs=1e-5) and points.max(axis=0) == pytest.approx(high, abs=1e-5)
    moved = in_place(points, (0.1, 0.0, 0.0), HALF)
    assert moved == pytest.approx(points @ np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]) + (0.1, 0, 0), abs=1e-15)


def test_frames_take_a_body_of_several_shapes(tmp_path):
    body = shape_mesh([Box((0.01, 0.01, 0.01)), Mesh(*shape_mesh(Tube(0.0, 0.01, 0.003, 0.005)))])
    assert mesh_volume(*body) == pytest.approx(1e-6 + math.pi * 16e-8, rel=3e-3)
    FrameWriter(tmp_path).write(0.0, {"position": np.zeros((1, 3))}, {"sieve": body})
    points, triangles = read_frames(tmp_path)[0].bodies["sieve"]
    assert np.array_equal(triangles, body[1]) and points == pytest.approx(body[0], abs=1e-8)


@pytest.mark.parametrize(
    ("shape", "words"), [(Plane(), "shape is a Plane; a surface can be shown of Ball"), ([], "empty")]
)
def test_what_has_no_surface_to_show_is_refused(shape, words):
    with pytest.raises(ValueError, match=words):
        shape_mesh(shape)
