"""The feet of a robot: geoms and sites of a MuJoCo model as shapes among grains and as points on a surface law.

All named geoms of one MuJoCo body make one foot, a union of shapes that a grain touches once. The frame of a foot has
its origin at the body's centre of mass, where MuJoCo applies forces, and the axes of the body.

A surface law acts on points. Each point is the lowest one of a small ellipsoid c + S u, |u| <= 1 (S = 0: a corner;
S = r: the ball at the end of a capsule; S = r (1 - a a^T): the rim of a wheel about a): c - S S z / |S z|, z upwards.
A mesh has vertices of its convex hull.
"""

import difflib
import fnmatch
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupling.poses import Vector
from rigid.spatial.quaternions import to_matrix

__all__ = ["Foot", "Part", "find_feet", "mesh_of", "refuse_missing"]

ROUND = 32  # Segments around of the picture of a round geom
RIM = 8  # Points on the rim of a cylinder that stands on its end, and most on the face on which a mesh stands
UPRIGHT = math.sqrt(0.5)  # Cosine between axis and vertical from which on a cylinder or capsule stands on its end
FINE = 3  # Subdivisions of the ball that stands for an ellipsoid among grains: 1280 triangles, 0.3 % too small

HULL = 64  # Most points of a mesh
LEVEL = 1e-3  # Points that are that near to a face belong to it, over the size of the mesh [1]

Faces = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Part:
    """One geom or site of a foot, in the foot's frame."""

    name: str
    kind: str  # "sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh", or "site"
    vertices: Vector  # Of its surface, for pictures and sizes [m], shape (n, 3); of a site the point alone
    faces: Faces  # Triangles, shape (m, 3)
    shapes: tuple[Any, ...]  # As `dem.Bed.add_body` takes them; none for a site
    centres: Vector  # Of its points on a law [m], shape (point, 3)
    spreads: Vector  # Their S, shape (point, 3, 3)
    share: float  # Of the law's numbers at each point [1]; those on which it stands sum up to 1
    note: str = ""  # What a person is to know of it


@dataclass(frozen=True, eq=False)
class Foot:
    """All parts on one MuJoCo body."""

    name: str  # Of its one part, or of the MuJoCo body
    body: int  # Number of the MuJoCo body
    parts: tuple[Part, ...] = field(repr=False)

    @cached_property
    def centres(self) -> Vector:
        """Of its points on a law [m], shape (point, 3)."""
        return np.concatenate([part.centres for part in self.parts])

    @cached_property
    def spreads(self) -> Vector:
        """S of its points, shape (point, 3, 3)."""
        return np.concatenate([part.spreads for part in self.parts])

    @property
    def shapes(self) -> list[Any]:
        """As `dem.Bed.add_body` takes them."""
        return [shape for part in self.parts for shape in part.shapes]

    def lowest(self, matrix: Vector) -> Vector:
        """Its points on a law about its origin, world axes [m], shape (point, 3), the foot turned by `matrix`."""
        down = self.spreads @ matrix[2]
        size = np.sqrt((down**2).sum(axis=1))
        steep = np.einsum("pij,pj->pi", self.spreads, down)
        at = self.centres - steep / np.where(size > 1e-300, size, 1.0)[:, None]
        return np.asarray(at @ matrix.T)

    def bottom(self, matrix: Vector) -> float:
        """Height of its lowest point over its origin [m], the foot turned by `matrix`: of shapes and points."""
        heights = [float((part.vertices @ matrix[2]).min()) for part in self.parts]
        if len(self.centres):
            heights.append(float(self.lowest(matrix)[:, 2].min()))
        return min(heights)

    def bottoms(self, ups: Vector) -> Vector:
        """`bottom` of many postures [m], shape (n,); ``ups``: third row of each matrix, shape (n, 3)."""
        heights = [(part.vertices @ ups.T).min(axis=0) for part in self.parts]
        if len(self.centres):
            sizes = np.linalg.norm(np.einsum("pij,nj->npi", self.spreads, ups), axis=2)
            heights.append((ups @ self.centres.T - sizes).min(axis=1))
        return np.asarray(np.min(heights, axis=0))

    @cached_property
    def reach(self) -> float:
        """Largest distance of its surface from its origin [m]."""
        return max(float(np.linalg.norm(part.vertices, axis=1).max()) for part in self.parts)


def refuse_missing() -> Any:
    """The package mujoco. Raises ValueError, with how to install it, where it or trimesh is not there."""
    try:
        import mujoco
        import trimesh  # noqa: F401
    except ImportError as error:
        raise ValueError(
            f"robots of MuJoCo need the Python packages 'mujoco' and 'trimesh', which cannot be imported ({error}): "
            f"pip install 'hedgebed[mujoco]', or pip install mujoco trimesh"
        ) from None
    return mujoco


def find_feet(model: Any, data: Any, names: Sequence[str]) -> list[Foot]:
    """The feet that `names` mean: geoms or sites of the model, by name or pattern (``spike_*``).

    ``data`` has the robot where it starts: a cylinder or capsule whose axis is within 45 degrees of the vertical there
    stands on its end, and lies otherwise. Raises ValueError, naming the geom: there is none of that name; it does not
    move; its kind cannot be a foot; its name is given twice.
    """
    mujoco = refuse_missing()
    kinds = {"geom": mujoco.mjtObj.mjOBJ_GEOM, "site": mujoco.mjtObj.mjOBJ_SITE}
    counts = {"geom": model.ngeom, "site": model.nsite}
    known = {
        name: (sort, k)
        for sort, kind in kinds.items()
        for k in range(counts[sort])
        if (name := mujoco.mj_id2name(model, kind, k))
    }
    wanted: dict[str, None] = {}
    for k, name in enumerate(names):
        if name in names[:k]:
            raise ValueError(f"feet contains {name!r} twice: give each name once")
        found = [name] if name in known else fnmatch.filter(known, name)
        if not found:
            raise ValueError(_no_such(name, known, model.ngeom))
        wanted |= dict.fromkeys(found)
    if not wanted:
        raise ValueError(f"feet is empty: name geoms of the model; {_listed(known)}")
    parts: dict[int, list[Part]] = {}
    for name in wanted:
        sort, k = known[name]
        body = int((model.geom_bodyid if sort == "geom" else model.site_bodyid)[k])
        if model.body_weldid[body] == 0:
            raise ValueError(f"feet: {name!r} does not move, it belongs to the world: name a geom of a moving body")
        made = _geom(model, data, k, name) if sort == "geom" else _site(model, k, name)
        parts.setdefault(body, []).append(made)
    feet = []
    for body, pieces in parts.items():
        own = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body {body}"
        feet.append(Foot(pieces[0].name if len(pieces) == 1 else own, body, tuple(pieces)))
    return feet


def _no_such(name: str, known: Iterable[str], count: int) -> str:
    near = difflib.get_close_matches(name, list(known), n=1)
    meant = f" (did you mean {near[0]!r}?)" if near else ""
    if not list(known):
        return f"feet: there is no geom {name!r}: none of the model's {count} geoms has a name; give it one in the file"
    return f"feet: there is no geom or site {name!r}{meant}; {_listed(known)}"


def _listed(known: Iterable[str]) -> str:
    names = list(known)
    return f"the model has {', '.join(names[:20])}" + (f" and {len(names) - 20} more" if len(names) > 20 else "")


def _site(model: Any, k: int, name: str) -> Part:
    """A site is a point on a law."""
    at = (model.site_pos[k] - model.body_ipos[model.site_bodyid[k]]).reshape(1, 3)
    return Part(name, "site", at, np.zeros((0, 3), dtype=np.int64), (), at, np.zeros((1, 3, 3)), 1.0)


def _geom(model: Any, data: Any, k: int, name: str) -> Part:
    from dem.shapes.basic import Ball, Cylinder
    from dem.shapes.mesh import Mesh
    from dem.shapes.solids import Box, Capsule, Placed

    mujoco = refuse_missing()
    kind = mujoco.mjtGeom(int(model.geom_type[k])).name.removeprefix("mjGEOM_").lower()
    size, turn = model.geom_size[k].astype(float), model.geom_quat[k].astype(float)
    at = (model.geom_pos[k] - model.body_ipos[model.geom_bodyid[k]]).astype(float)
    matrix = to_matrix(turn)
    place = {"position": tuple(at.tolist()), "turn": tuple(turn.tolist())}
    vertices, faces = mesh_of(model, k)
    vertices = at + vertices @ matrix.T
    points, spreads, share, note = np.zeros((0, 3)), np.zeros((0, 3, 3)), 1.0, ""
    upright = abs(float(data.geom_xmat[k].reshape(3, 3)[2, 2])) > UPRIGHT
    if kind == "sphere":
        shape: Any = Ball(center=tuple(at.tolist()), radius=size[0])
        points, spreads = at.reshape(1, 3), size[0] * np.eye(3).reshape(1, 3, 3)
    elif kind == "capsule":
        points = at + np.outer([-size[1], size[1]], matrix[:, 2])
        shape = Capsule(start=tuple(points[0].tolist()), end=tuple(points[1].tolist()), radius=size[0])
        spreads = np.tile(size[0] * np.eye(3), (2, 1, 1))
        share = 1.0 if upright else 0.5
    elif kind == "cylinder":
        shape = Placed(Cylinder(bottom=-size[1], top=size[1], radius=size[0]), **place)
        axis = matrix[:, 2]
        ends = at + np.outer([-size[1], size[1]], axis)
        if upright:
            angles = 2 * math.pi / RIM * np.arange(RIM)
            ring = size[0] * (np.outer(np.cos(angles), matrix[:, 0]) + np.outer(np.sin(angles), matrix[:, 1]))
            points, share = np.concatenate([end + ring for end in ends]), 1 / RIM
            spreads = np.zeros((2 * RIM, 3, 3))
        else:
            points, share = ends, 0.5
            spreads = np.tile(size[0] * (np.eye(3) - np.outer(axis, axis)), (2, 1, 1))
    elif kind == "box":
        shape = Placed(Box(size=tuple((2 * size).tolist())), **place)
        points, spreads, share = vertices, np.zeros((8, 3, 3)), 0.25
    elif kind == "ellipsoid":
        shape = Mesh(vertices, faces)
        points, spreads = at.reshape(1, 3), (matrix @ np.diag(size) @ matrix.T).reshape(1, 3, 3)
    elif kind == "mesh":
        vertices, faces, note = _closed(name, vertices, faces)
        shape = Mesh(vertices, faces)
        points, share = _hull_points(vertices, data.xmat[model.geom_bodyid[k]].reshape(3, 3)[2])
        spreads = np.zeros((len(points), 3, 3))
    else:
        raise ValueError(
            f"feet: {name!r} is a {kind}, which no foot can be: expected sphere, capsule, cylinder, box, "
            f"ellipsoid or mesh"
        )
    return Part(name, kind, vertices, faces, (shape,), points, spreads, share, note)


def mesh_of(model: Any, k: int) -> tuple[Vector, Faces]:
    """The surface of a geom in its own frame: vertices [m], shape (n, 3), and triangles, shape (m, 3).

    Raises ValueError for a kind that has none (plane, height field).
    """
    import trimesh

    mujoco = refuse_missing()
    kind = mujoco.mjtGeom(int(model.geom_type[k])).name.removeprefix("mjGEOM_").lower()
    size = model.geom_size[k].astype(float)
    if kind == "mesh":
        which = int(model.geom_dataid[k])
        first, count = int(model.mesh_vertadr[which]), int(model.mesh_vertnum[which])
        begin, many = int(model.mesh_faceadr[which]), int(model.mesh_facenum[which])
        vertices = np.array(model.mesh_vert[first : first + count], dtype=float)
        return vertices, np.array(model.mesh_face[begin : begin + many], dtype=np.int64)
    if kind in ("sphere", "ellipsoid"):
        made = trimesh.creation.icosphere(subdivisions=FINE)
        made.vertices = np.asarray(made.vertices) * (size if kind == "ellipsoid" else size[0])
    elif kind == "capsule":
        made = trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=[ROUND, ROUND])
        made.apply_translation([0.0, 0.0, -made.bounds.mean(axis=0)[2]])
    elif kind == "cylinder":
        made = trimesh.creation.cylinder(height=2 * size[1], radius=size[0], sections=ROUND)
    elif kind == "box":
        made = trimesh.creation.box(extents=2 * size)
    else:
        return np.zeros((1, 3)), np.zeros((0, 3), dtype=np.int64)
    return np.array(made.vertices, dtype=float), np.array(made.faces, dtype=np.int64)


def _hull_points(vertices: Vector, up: Vector) -> tuple[Vector, float]:
    """Vertices of the convex hull [m], at most `HULL`, shape (n, 3), and the share of the law that each has.

    It stands on those of the face that looks down most, at most `RIM`; ``up``: in its axes.
    """
    from scipy.spatial import ConvexHull

    hull = np.asarray(vertices[ConvexHull(vertices).vertices])
    points = hull[_apart(hull, HULL)]
    planes = ConvexHull(points).equations
    *normal, offset = planes[np.argmin(planes[:, :3] @ up)]
    face = np.flatnonzero(np.abs(points @ normal + offset) <= LEVEL * float(np.ptp(points, axis=0).max()))
    stands = face[_apart(points[face], RIM)]
    return np.delete(points, np.setdiff1d(face, stands), axis=0), 1 / len(stands)


def _apart(points: Vector, most: int) -> NDArray[np.int64]:
    """Numbers of at most so many points, each as far from those before as can be, in their order."""
    chosen = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    apart = np.full(len(points), np.inf)
    for _ in range(min(most, len(points)) - 1):
        apart = np.minimum(apart, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(apart)))
    return np.array(sorted(chosen))


def _closed(name: str, vertices: Vector, faces: Faces) -> tuple[Vector, Faces, str]:
    """A closed mesh for grains to touch: this one, or its convex hull where it is open, and a note of that.

    Raises ValueError where not even a hull encloses anything.
    """
    import trimesh

    made = trimesh.Trimesh(vertices, faces, process=True)
    note = ""
    if not (made.is_watertight and made.is_winding_consistent):
        try:
            made = made.convex_hull
        except Exception as error:
            raise ValueError(
                f"feet: the mesh of {name!r} encloses no volume ({error}): expected a closed one"
            ) from None
        note = f"the mesh of {name!r} is not closed: its convex hull is used, as MuJoCo does for contacts"
    if made.volume < 0:
        made.invert()
    return np.array(made.vertices, dtype=float), np.array(made.faces, dtype=np.int64), note
