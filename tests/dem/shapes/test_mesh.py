"""Meshes: nearest points and sides against trying everything; what no grain could touch is refused; files."""

import re

import meshio
import numpy as np
import pytest
import solid_shapes

from dem import Mesh, Polyhedron, mesh_from_file
from dem.engine import runtime
from dem.engine.shape_table import ShapeTable
from dem.shapes.mesh import mesh_tree
from hedgebed_taichi import ti


@pytest.fixture(scope="module")
def look():
    """A function of a mesh, points, a reach and whether to look deep: distance and normal, as the kernels see them."""
    runtime.start()
    table = ShapeTable(primitives=4, triangles=1024, real=ti.f64)

    @ti.kernel
    def each(
        nodes: int,
        points: ti.types.ndarray(dtype=ti.f64, ndim=2),
        out: ti.types.ndarray(dtype=ti.f64, ndim=2),
        reach: float,
        deep: ti.template(),
    ):
        for i in range(points.shape[0]):
            p = ti.Vector([points[i, 0], points[i, 1], points[i, 2]])
            distance, normal = table.mesh_distance(0, nodes, p, ti.cast(reach, ti.f64), deep)
            out[i, 0] = distance
            for k in ti.static(range(3)):
                out[i, 1 + k] = normal[k]

    def ask(mesh, points, reach, deep=False):
        table.fill([mesh])
        out = np.zeros((len(points), 4))
        each(2 * len(mesh.triangles) - 1, np.ascontiguousarray(points), out, reach, deep)
        return out[:, 0], out[:, 1:]

    return ask


MESHES = {
    "box": solid_shapes.box((0.02, 0.03, 0.004), (0.001, 0.002, 0.0)),
    "bracket": solid_shapes.corner_bracket(0.02, 0.006),
    "star": solid_shapes.star(0.015),
}


@pytest.mark.parametrize("name", MESHES)
def test_nearest_points_and_sides_are_those_of_trying_everything(look, name):
    """Points all around and inside, and as near to faces, edges and corners as a grain in contact comes."""
    vertices, triangles = MESHES[name]
    mesh = Mesh(vertices, triangles)
    assert mesh.volume > 0
    rng = np.random.default_rng(3)
    low, high = mesh.bounds()
    points = rng.uniform(low - 0.004, high + 0.004, (60 if name == "star" else 200, 3))
    shares = rng.dirichlet((1, 1, 1), 20)
    shares[5:10, 2] = 0  # on edges
    shares[10:15] = np.eye(3)[rng.integers(0, 3, 5)]  # on corners
    shares /= shares.sum(axis=1)[:, None]
    on = np.einsum("ij,ijk->ik", shares, mesh.vertices[mesh.triangles[rng.integers(0, len(triangles), 20)]])
    points = np.concatenate([points, on + rng.normal(0, 2e-4, on.shape)])
    wanted = [solid_shapes.nearest_by_trying(vertices, triangles, p) for p in points]
    least = np.array([distance for distance, _ in wanted])
    sign = np.array([-1 if solid_shapes.inside(vertices, triangles, p) else 1 for p in points])
    assert (sign < 0).sum() > 10 and (sign > 0).sum() > 10
    distance, normal = look(mesh, points, 1.0)
    assert distance == pytest.approx(sign * least, abs=1e-15)
    assert points - distance[:, None] * normal == pytest.approx(np.array([q for _, q in wanted]), abs=1e-13)
    # What is farther than the reach may be left out, and nothing else; but the inside is known to be inside.
    reach = 0.003
    near, _ = look(mesh, points, reach)
    assert np.array_equal(near[least < reach], distance[least < reach]) and (least < reach).sum() > 20
    assert (near[least > reach] == 1e30).all() and (least > reach).any()
    deep, _ = look(mesh, points, reach, deep=True)
    assert np.array_equal(deep[sign < 0], distance[sign < 0])
    assert np.array_equal(deep[least < reach], distance[least < reach]) and (deep[sign > 0] > 0).all()


def test_the_tree_holds_every_triangle_once_and_boxes_hold_what_is_under_them():
    mesh = Mesh(*MESHES["star"])
    tree = mesh_tree(mesh)
    leaves = tree.leaf[tree.leaf >= 0]
    assert np.array_equal(leaves, np.arange(len(mesh.triangles)))
    corners = tree.corner[:, None] + np.stack([0 * tree.corner, tree.side_ab, tree.side_ac], axis=1)
    assert sorted(map(tuple, corners.mean(1).round(12))) == sorted(
        map(tuple, mesh.vertices[mesh.triangles].mean(1).round(12))
    )
    for node, skip in enumerate(tree.skip):
        below = tree.leaf[node:skip]
        inner = corners[below[below >= 0]]
        assert (inner >= tree.low[node] - 1e-15).all() and (inner <= tree.high[node] + 1e-15).all()
    assert np.linalg.norm(tree.normals, axis=2) == pytest.approx(1.0)


BOX = MESHES["box"]


def changed(rows=slice(None), *, drop=None, flip=None, vertex=None):
    vertices, triangles = BOX[0].copy(), BOX[1].copy()
    if flip is not None:
        triangles[flip] = triangles[flip][:, ::-1]
    if drop is not None:
        triangles = np.delete(triangles, drop, axis=0)
    if vertex is not None:
        vertices[vertex[0]] = vertex[1]
    return vertices, triangles


TWO = solid_shapes.box((0.01, 0.01, 0.01), (0.1, 0.0, 0.0))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((np.zeros((0, 3)), np.zeros((0, 3), dtype=int)), "triangles is empty"),
        ((BOX[0], np.zeros((0, 3), dtype=int)), "triangles is empty"),
        ((BOX[0][:, :2], BOX[1]), r"vertices has shape \(8, 2\)"),
        ((BOX[0], BOX[1].astype(float)), "triangles has shape .* of float64"),
        ((BOX[0], BOX[1] + 1), r"triangle 2 = \[5, 6, 8\] names a vertex beyond the 8"),
        (changed(vertex=(2, (np.nan, 0, 0))), "vertex 2 = .* must be finite"),
        (changed(vertex=(3, tuple(BOX[0][1]))), r"triangle 1 has no area \(2 in all\).*joining the vertices"),
        (changed(drop=[4]), r"open: 3 of 18 edges have one triangle only, the first from \(.* close the surface"),
        ((BOX[0], np.concatenate([BOX[1], BOX[1][:1]])), "3 edges have more than two triangles"),
        (changed(flip=[7]), r"disagree on which side is out \(3 such edges\); order"),
        (changed(flip=slice(None)), r"inverted: the volume is -2\.4e-06 m3.*turn the triangles round"),
        (
            (np.concatenate([BOX[0], TWO[0]]), np.concatenate([BOX[1], TWO[1][:, ::-1] + 8])),
            "inverted: the part with the vertex .* has a volume of -1e-06 m3 and is no cavity",
        ),
    ],
)
def test_a_mesh_that_no_grain_could_touch_is_refused(given, words):
    with pytest.raises(ValueError, match=words):
        Mesh(*given)


def test_a_cavity_is_no_inverted_part(look):
    small = solid_shapes.box((0.01, 0.01, 0.002), (0.001, 0.002, 0.0))
    mesh = Mesh(np.concatenate([BOX[0], small[0]]), np.concatenate([BOX[1], small[1][:, ::-1] + 8]))
    assert mesh.volume == pytest.approx(2.4e-6 - 2e-7)
    distance, normal = look(mesh, np.array([[0.001, 0.002, 0.0005], [0.001, 0.002, 0.0015]]), 1.0)
    assert distance == pytest.approx([0.0005, -0.0005]) and normal[0] == pytest.approx([0, 0, -1])


@pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
def test_a_file_gives_the_mesh_that_was_written(tmp_path, ending):
    """STL repeats every vertex, OBJ may have quadrilaterals; a scale of 0.001 takes millimetres."""
    vertices, triangles = MESHES["star"]
    path = tmp_path / f"star.{ending}"
    meshio.Mesh(1000 * vertices, [("triangle", triangles)]).write(path)
    mesh = mesh_from_file(path, scale=0.001)
    assert len(mesh.vertices) == len(vertices) and len(mesh.triangles) == len(triangles)
    assert mesh.volume == pytest.approx(Mesh(vertices, triangles).volume, rel=1e-6)  # STL may hold single precision
    turned = tmp_path / f"turned.{ending}"
    meshio.Mesh(vertices, [("triangle", triangles[:, ::-1])]).write(turned)
    with pytest.raises(ValueError, match=rf"turned\.{ending}: Mesh: inverted"):
        mesh_from_file(turned)
    assert mesh_from_file(turned, flip=True).volume > 0


def test_a_file_of_quadrilaterals_is_cut_into_triangles(tmp_path):
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    meshio.Mesh(BOX[0], [("quad", quads)]).write(tmp_path / "box.obj")
    mesh = mesh_from_file(tmp_path / "box.obj")
    assert len(mesh.triangles) == 12 and mesh.volume == pytest.approx(2.4e-6)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("absent.stl", None, "absent.stl: no such file"),
        ("words.stl", "not a mesh", "words.stl is no mesh that meshio can read"),
        ("words.xyzzy", "not a mesh", "words.xyzzy is no mesh that meshio can read"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "points.obj holds nothing; triangles"),
        ("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "open.obj: Mesh: open: 3 of 3 edges"),
    ],
)
def test_a_file_without_a_closed_surface_is_refused(tmp_path, capsys, name, content, words):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=re.escape(words)):
        mesh_from_file(tmp_path / name)
    assert capsys.readouterr().out == ""
    with pytest.raises(ValueError, match="scale = 0"):
        mesh_from_file(tmp_path / name, scale=0)


def test_a_polyhedron_is_the_hull_of_its_corners(look):
    """A regular tetrahedron of side a: a^3 / 6 sqrt(2); inscribed radius a / 2 sqrt(6)."""
    corners = 0.01 * np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    side = 0.02 * np.sqrt(2)
    solid = Polyhedron(corners)
    assert len(solid.mesh.triangles) == 4
    assert solid.mesh.volume == pytest.approx(side**3 / (6 * np.sqrt(2)))
    distance, _ = look(solid.mesh, np.array([[0.0, 0.0, 0.0], [0.02, 0.02, 0.02]]), 1.0)
    assert distance == pytest.approx([-side / (2 * np.sqrt(6)), 0.01 * np.sqrt(3)])
    assert solid.extent() == pytest.approx(0.01 * np.sqrt(3))
    assert len(Polyhedron(BOX[0]).mesh.triangles) == 12
    with pytest.raises(ValueError, match=r"vertex 4 at \(0\.0, 0\.0, 0\.001\) m lies inside the hull"):
        Polyhedron([*corners, (0.0, 0.0, 0.001)])
    with pytest.raises(ValueError, match="the 4 vertices lie in one plane"):
        Polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)])
    with pytest.raises(ValueError, match=r"vertices has shape \(3, 3\)"):
        Polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
