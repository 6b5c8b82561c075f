"""The bed cut open, drawn with matplotlib: what stands in for `vis.pictures.scene` where there is no OpenGL.

Grains in a slab behind the cut are discs, the far ones first; a body is its own silhouette, shaded by its normals.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection, PolyCollection
from numpy.typing import NDArray

from vis.pictures.frames import Frame

__all__ = ["Section"]

_METAL = np.array([0.74, 0.76, 0.79])


class Section:
    """A view along +y on the plane of the cut, in proportion.

    Args:
        size: Width and height of the page [pixels].
        low, high: Corners of the undisturbed bed [m].
        cut: The plane's y [m].
        radius: Typical radius of a grain [m]; the slab is eight of them thick.
    """

    def __init__(
        self,
        size: tuple[int, int],
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        *,
        cut: float,
        radius: float,
    ) -> None:
        left, right, foot, head = 0.125, 0.865, 0.13, 0.90
        self._low, self._high = low, high
        self._cut, self._depth = cut, 8.0 * radius
        height = 1.55 * (high[2] - low[2])
        aspect = size[0] / size[1]
        across = min((right - left) / (high[0] - low[0]), (head - foot) / (height * aspect))
        self._scale = np.array([across, across * aspect])  # page fractions per metre
        middle = 0.5 * np.array([low[0] + high[0], 2.0 * low[2] + height])
        self._shift = 0.5 * np.array([left + right, foot + head]) - self._scale * middle

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where points [m], shape (n, 3), lie on the page: fractions from the lower left corner, shape (n, 2)."""
        return np.asarray(points)[:, [0, 2]] * self._scale + self._shift

    def draw(self, frame: Frame, colours: NDArray[np.float64]) -> Callable[[Any], None]:
        """A function that draws the frame on an axes in page fractions; arguments as
        `vis.pictures.scene.Scene.render`."""
        position, radius = frame.grains["position"], frame.grains["radius"]
        behind = position[:, 1] - self._cut
        slab = np.flatnonzero((behind >= 0.0) & (behind <= self._depth))
        slab = slab[np.argsort(-behind[slab])]
        tone = 1.0 - 0.6 * behind[slab] / self._depth  # farther is darker
        faces = np.column_stack([colours[slab, :3] * tone[:, None], np.ones(len(slab))])

        def on(axis: Any) -> None:
            floor = self.place(
                np.array([[x, 0.0, z] for x, z in self._corners(self._low[2], 0.03 * (self._high[2] - self._low[2]))])
            )
            axis.add_collection(PolyCollection([floor], facecolors="#8c8c91", edgecolors="none"))
            axis.add_collection(
                EllipseCollection(
                    2.0 * radius[slab] * self._scale[0],
                    2.0 * radius[slab] * self._scale[1],
                    np.zeros(len(slab)),
                    units="xy",
                    offsets=self.place(position[slab]),
                    offset_transform=axis.transData,
                    facecolors=faces,
                    edgecolors=(0.0, 0.0, 0.0, 0.45),
                    linewidths=0.35,
                )
            )
            for points, triangles in frame.bodies.values():
                axis.add_collection(self._body(points, triangles))

        return on

    def _corners(self, top: float, thickness: float) -> list[tuple[float, float]]:
        left, right = float(self._low[0]), float(self._high[0])
        return [(left, top - thickness), (right, top - thickness), (right, top), (left, top)]

    def _body(self, points: NDArray[np.float64], triangles: NDArray[np.int64]) -> PolyCollection:
        corners = points[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        facing = normal[:, 1] < 0.0
        light = np.array([-0.45, -0.75, 0.48])
        shade = 0.45 + 0.6 * np.clip(normal[facing] @ light, 0.0, 1.0)
        faces = np.clip(shade[:, None] * _METAL, 0.0, 1.0)
        flat = self.place(corners[facing].reshape(-1, 3)).reshape(-1, 3, 2)
        order = np.argsort(-corners[facing][:, :, 1].mean(axis=1))
        return PolyCollection(list(flat[order]), facecolors=faces[order], edgecolors=faces[order], linewidths=0.4)
