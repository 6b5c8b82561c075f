"""Scenes drawn with matplotlib: what stands in for `vis.pictures.scene` where there is no OpenGL.

`Section` is the bed cut open, `FlatStage` a platform on its ground. Grains in a slab behind the cut are discs, the far
ones first; a body is its own silhouette.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from vis.page.plots import Array
from vis.pictures.canvas import BED_SPACE
from vis.pictures.frames import Frame
from vis.pictures.scene import FLOOR, GROUND, METAL, PARTS, Eye

__all__ = ["FlatStage", "Section"]

SLAB = 8.0
"""Thickness of what is shown of the bed, over a grain's radius."""
_LIGHT = np.array([-0.45, -0.75, 0.48])


class Section:
    """A view along +y on the plane of the cut, in proportion.

    ``size``: Width and height of the page [pixels]. ``low``, ``high``: Corners of the undisturbed bed [m]. ``cut``: The
    plane's y [m]. ``radius``: Typical radius of a grain [m]; the slab is eight of them thick. ``tilt``: Of the camera
    of `Scene`; this view is level.
    """

    def __init__(
        self, size: tuple[int, int], low: Array, high: Array, *, cut: float, radius: float, tilt: float = 0.0
    ) -> None:
        left, right, foot, head = BED_SPACE
        self._low, self._high = low, high
        self._cut, self._depth = cut, SLAB * radius
        height = high[2] - low[2]
        aspect = size[0] / size[1]
        across = min((right - left) / (high[0] - low[0]), (head - foot) / (height * aspect))
        self._scale = np.array([across, across * aspect])  # page fractions per metre
        middle = 0.5 * np.array([low[0] + high[0], 2.0 * low[2] + height])
        self._shift = 0.5 * np.array([left + right, foot + head]) - self._scale * middle

    def place(self, points: Array) -> Array:
        """Where points [m], shape (n, 3), lie on the page: fractions from the lower left corner, shape (n, 2)."""
        return np.asarray(points)[:, [0, 2]] * self._scale + self._shift

    def draw(self, axis: Any, frame: Frame, colours: Array) -> None:
        """Draw the frame on an axes in page fractions; arguments as those of `vis.pictures.scene.Scene.render`."""
        (left, _, top), right = (float(edge) for edge in self._low), float(self._high[0])
        foot = top - 0.03 * (self._high[2] - self._low[2])
        floor = np.array([[x, 0.0, z] for x, z in ((left, foot), (right, foot), (right, top), (left, top))])
        position, radius = frame.grains["position"], frame.grains["radius"]
        axis.add_collection(PolyCollection([self.place(floor)], facecolors="#8c8c91", edgecolors="none"))
        _discs(
            axis, self.place(position), (2.0 * radius * self._scale[0], 2.0 * radius * self._scale[1]), colours,
            behind=position[:, 1] - self._cut, thick=self._depth, edge=0.45, line=0.35,
        )  # fmt: skip
        for points, triangles in frame.bodies.values():
            axis.add_collection(self._body(points, triangles))

    def close(self) -> None:
        """There is no window to free."""

    def _body(self, points: Array, triangles: NDArray[np.int64]) -> PolyCollection:
        corners, normal = _facing(points, triangles)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        shade = 0.45 + 0.6 * np.clip(normal @ _LIGHT, 0.0, 1.0)
        faces = np.clip(shade[:, None] * np.array(METAL), 0.0, 1.0)
        flat = self.place(corners.reshape(-1, 3)).reshape(-1, 3, 2)
        order = np.argsort(-corners[:, :, 1].mean(axis=1))
        return PolyCollection(list(flat[order]), facecolors=faces[order], edgecolors=faces[order], linewidths=0.4)


class FlatStage(Eye):
    """Draws frames with matplotlib: a slab of grains behind the cut as discs, bodies as their silhouettes.

    Arguments as `Stage`.
    """

    def __init__(self, size: tuple[int, int], *, low: Array, high: Array, radius: float | None, **view: float) -> None:
        super().__init__(size, **view)
        self.low, self.high, self.radius = low, high, radius

    def close(self) -> None:
        """There is no window to free."""

    def draw(self, axis: Any, frame: Frame, colours: Array, focus: tuple[float, float]) -> None:
        """Draw on an axes whose limits are 0 to 1."""
        (left, foot), (right, top) = self.place(np.array([self.low, self.high]), focus)
        if self.radius is None:
            axis.add_patch(Rectangle((left, foot), right - left, top - foot, color=GROUND))
        else:
            thick = 0.02 * (top - foot)
            axis.add_patch(Rectangle((left, foot - thick), right - left, thick, color=FLOOR))
            position, radius = frame.grains["position"], frame.grains["radius"]
            _discs(
                axis, self.place(position, focus), (2.0 * radius / self.width, 2.0 * radius / self.height), colours,
                behind=position[:, 1] - self.cut, thick=SLAB * self.radius, shown=self._near(position, focus),
                edge=0.4, line=0.3,
            )  # fmt: skip
        for name in sorted(frame.bodies, reverse=True):  # spikes first: the hull hides their upper ends
            corners, _ = _facing(*frame.bodies[name])
            flat = self.place(corners.reshape(-1, 3), focus).reshape(-1, 3, 2)
            colour = PARTS.get(name, METAL)
            axis.add_collection(PolyCollection(list(flat), facecolors=[colour], edgecolors=[colour], linewidths=0.4))


def _discs(
    axis: Any,
    places: Array,
    sizes: tuple[Array, Array],
    colours: Array,
    *,
    behind: Array,
    thick: float,
    edge: float,
    line: float,
    shown: Any = True,
) -> None:
    """Grains as discs, those up to `thick` behind the cut, the far ones first and darker.

    ``places``, ``sizes``: In fractions of the page, shape (n, 2), and across and up, shape (n,). ``behind``: How far
    each is behind the cut [m]. shown: Which may be seen. ``edge``, ``line``: Opacity and width of the rims.
    """
    slab = np.flatnonzero(shown & (behind >= 0.0) & (behind <= thick))
    slab = slab[np.argsort(-behind[slab])]
    tone = 1.0 - 0.6 * behind[slab] / thick
    axis.add_collection(EllipseCollection(
        sizes[0][slab], sizes[1][slab], np.zeros(len(slab)), units="xy", offsets=places[slab],
        offset_transform=axis.transData, edgecolors=(0.0, 0.0, 0.0, edge), linewidths=line,
        facecolors=np.column_stack([colours[slab, :3] * tone[:, None], np.ones(len(slab))]),
    ))  # fmt: skip


def _facing(points: Array, triangles: NDArray[np.int64]) -> tuple[Array, Array]:
    """Corners [m], shape (m, 3, 3), and normals, shape (m, 3), of the triangles that are seen along +y."""
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = normal[:, 1] < 0.0
    return corners[seen], normal[seen]
