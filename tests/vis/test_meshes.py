"""Meshes are closed, point outwards, and hold the volume of the body they stand for."""

import math
from collections import Counter

import numpy as np
import pytest

from vis.meshes import mesh_volume, spike_mesh, spike_profile

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
