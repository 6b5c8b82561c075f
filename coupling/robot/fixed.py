"""Geoms that are fixed to a foot and are no feet, such as a shank: the ground does not push them (`FixedGeoms`)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from coupling.poses import Vector

from .feet import Foot, mesh_of, refuse_missing

__all__ = ["Buried", "FixedGeoms"]

SHARE = 0.1  # Depth that counts, over the narrowest side of a geom [1]; also the shell around a foot that belongs to it
LEAST = 1e-3  # Least depth that counts [m]
POINTS = 2000  # On the surface of a geom


@dataclass(frozen=True, order=True)
class Buried:
    """A geom below the surface that the ground does not push."""

    depth: float  # Of its lowest point outside all feet [m]
    name: str = ""

    def __bool__(self) -> bool:
        return self.depth > 0


class FixedGeoms:
    """The geoms of `model` that cannot move against a foot of solid geoms, and are no feet.

    Those that are only to be seen (contype and conaffinity 0) do not count, and neither does what lies inside a foot.
    A site as a foot is the tip of a whole spike, whose law has the shaft in it: what is fixed to it does not count.
    """

    def __init__(self, model: Any, feet: list[Foot], others: list[int]) -> None:
        self._model = model
        solid = [foot for foot in feet if any(part.shapes for part in foot.parts)]
        roots = {int(model.body_weldid[foot.body]) for foot in solid}
        self._feet = solid
        self._geoms = [
            k
            for k in others
            if int(model.body_weldid[model.geom_bodyid[k]]) in roots
            and (model.geom_contype[k] or model.geom_conaffinity[k])
        ]
        self._points: dict[int, tuple[Vector, float]] = {}  # Of a geom: points outside all feet, and depth that counts

    def deepest(self, data: Any) -> Buried:
        """The deepest of them below z = 0, or nothing: a depth of 0 where none is deep enough to count."""
        found = Buried(0.0)
        for k in self._geoms:
            if float(data.geom_xpos[k, 2]) > float(self._model.geom_rbound[k]):
                continue
            if k not in self._points:
                self._points[k] = self._outside(data, k)
            points, least = self._points[k]
            if not len(points):
                continue
            depth = -float(data.geom_xpos[k, 2]) - float((points @ data.geom_xmat[k].reshape(3, 3)[2]).min())
            if depth > max(least, found.depth):
                found = Buried(depth, self._name(k))
        return found

    def _name(self, k: int) -> str:
        mujoco, model = refuse_missing(), self._model
        body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, int(model.geom_bodyid[k])) or "?"
        return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, k) or f"geom {k} of body {body}, which has no name"

    def _outside(self, data: Any, k: int) -> tuple[Vector, float]:
        """Points on the surface of a geom, in its own frame [m], that are outside all feet that are fixed to it, and
        the depth that counts [m]. Geom and feet move as one, so that they are outside for ever."""
        import trimesh
        from scipy.spatial import ConvexHull

        vertices, faces = mesh_of(self._model, k)
        points = vertices
        if len(faces):
            drawn, _ = trimesh.sample.sample_surface(trimesh.Trimesh(vertices, faces, process=False), POINTS, seed=1)
            points = np.concatenate([vertices, np.asarray(drawn)])
        places = data.geom_xpos[k] + points @ data.geom_xmat[k].reshape(3, 3).T
        outside = np.ones(len(points), dtype=bool)
        root = int(self._model.body_weldid[self._model.geom_bodyid[k]])
        for foot in self._feet:
            if int(self._model.body_weldid[foot.body]) != root:
                continue
            own = (places - data.xipos[foot.body]) @ data.xmat[foot.body].reshape(3, 3)
            for part in foot.parts:
                if part.shapes:
                    shell = SHARE * float(np.ptp(part.vertices, axis=0).min())
                    planes = ConvexHull(part.vertices).equations
                    outside &= (own @ planes[:, :3].T + planes[:, 3]).max(axis=1) > shell
        return points[outside], max(LEAST, SHARE * float(np.ptp(vertices, axis=0).min()))
