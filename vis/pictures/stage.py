"""A platform on its ground through a camera that can be moved: with OpenGL (`Stage`), or drawn flat (`FlatStage`).

Parallel projection, so that a length is the same all over the picture: the view goes along +y, from a little above,
onto the plane of the cut. `place` says where points lie on the picture, for what is drawn over it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from vis.page.plots import Array
from vis.pictures.frames import Frame
from vis.pictures.scene import FLOOR, METAL, Rendered
from vis.pictures.sections import SLAB, discs, facing

__all__ = ["Eye", "FlatStage", "Stage"]

_GROUND = (0.86, 0.80, 0.70)
_COLOURS = {"hull": (0.80, 0.82, 0.85), "spikes": (0.52, 0.55, 0.60)}


class Eye:
    """Where a point lies on a picture of `width` [m] across whose middle is at the focus.

    ``size``: Of the picture [pixels]. ``width``: What it shows across [m]. ``cut``: y of the plane that is looked at
    [m]. ``pitch``: How far the view goes downwards [radians].
    """

    def __init__(self, size: tuple[int, int], *, width: float, cut: float, pitch: float = 0.0) -> None:
        self.size, self.width, self.cut = size, width, cut
        self.height = width * size[1] / size[0]
        self.pitch = pitch

    def place(self, points: Array, focus: tuple[float, float]) -> Array:
        """Fractions of the picture from its lower left corner, shape (n, 2), of points [m], shape (n, 3)."""
        at = np.asarray(points, dtype=float).reshape(-1, 3)
        up = (at[:, 2] - focus[1]) * np.cos(self.pitch) + (at[:, 1] - self.cut) * np.sin(self.pitch)
        return np.column_stack([0.5 + (at[:, 0] - focus[0]) / self.width, 0.5 + up / self.height])

    def _near(self, position: Array, focus: tuple[float, float]) -> NDArray[np.bool_]:
        """Which grains the picture may show."""
        return np.abs(position[:, 0] - focus[0]) < 0.6 * self.width


class Stage(Eye, Rendered):
    """Renders frames with VTK. Needs OpenGL: use it only in a process that may die.

    ``low``, ``high``: Corners of the bed [m]; without grains, of a block of ground. ``radius``: Typical radius of a
    grain [m], for the shading of gaps; None: a block of ground in place of grains. (the others as `Eye`)
    """

    def __init__(
        self,
        size: tuple[int, int],
        *,
        width: float,
        cut: float,
        low: Array,
        high: Array,
        radius: float | None,
        pitch: float = 0.24,
    ) -> None:
        Eye.__init__(self, size, width=width, cut=cut, pitch=pitch)
        Rendered.__init__(self, size, centre=np.zeros(3), reach=1.0)
        thick = 0.03 * float(high[2] - low[2])
        if radius is None:
            self.add_block((low[0], high[0], cut, high[1], low[2], high[2]), _GROUND, 0.4, 0.7)
        else:
            self.add_block((low[0], high[0], cut, high[1], low[2] - thick, low[2] - 1e-6), FLOOR, 0.25, 0.8)
            if radius / width * size[0] > 4.0:  # on smaller grains the shading of gaps does not show
                self._plotter.enable_ssao(radius=3.0 * radius, bias=0.3 * radius, kernel_size=32, blur=True)
        self._plotter.enable_parallel_projection()
        self.reach = 0.5 * width + 2.0 * float(high[1] - low[1])

    def render(self, frame: Frame, colours: Array, focus: tuple[float, float]) -> NDArray[np.uint8]:
        """Image of a frame with `focus` (x, z) [m] in its middle, shape (height, width, 3)."""
        self._clear()
        position = frame.grains["position"]
        shown = self._near(position, focus) & (position[:, 1] >= self.cut)
        if shown.any():
            self._add_spheres(position[shown], frame.grains["radius"][shown], colours[shown])
        for name, body in frame.bodies.items():
            colour = _COLOURS.get(name, METAL)
            self._add_body(self._mesh(*body), rim=40.0, smooth=35.0, line=2.0, specular=0.4, colour=colour)
        camera = self._plotter.camera
        far = 1.05 * self.reach
        middle = np.array([focus[0], self.cut, focus[1]])
        camera.focal_point = tuple(middle)
        camera.position = tuple(middle + far * np.array([0.0, -np.cos(self.pitch), np.sin(self.pitch)]))
        camera.up = (0.0, 0.0, 1.0)
        camera.parallel_scale = 0.5 * self.height
        # As near as it can be: the shading of gaps reads distances from the camera off half-precision numbers (a part
        # in 2048), and coarse ones stripe what is flat.
        camera.clipping_range = (far - self.reach, far + self.reach)
        return self._image()


class FlatStage(Eye):
    """Draws frames with matplotlib: a slab of grains behind the cut as discs, bodies as their silhouettes.

    Arguments as `Stage`.
    """

    def __init__(
        self, size: tuple[int, int], *, width: float, cut: float, low: Array, high: Array, radius: float | None
    ) -> None:
        super().__init__(size, width=width, cut=cut)
        self.low, self.high, self.radius = low, high, radius

    def draw(self, axis: Any, frame: Frame, colours: Array, focus: tuple[float, float]) -> None:
        """Draw on an axes whose limits are 0 to 1."""
        (left, foot), (right, top) = self.place(np.array([self.low, self.high]), focus)
        if self.radius is None:
            axis.add_patch(Rectangle((left, foot), right - left, top - foot, color=_GROUND))
        else:
            thick = 0.02 * (top - foot)
            axis.add_patch(Rectangle((left, foot - thick), right - left, thick, color=FLOOR))
            position, radius = frame.grains["position"], frame.grains["radius"]
            discs(
                axis, self.place(position, focus), (2.0 * radius / self.width, 2.0 * radius / self.height), colours,
                behind=position[:, 1] - self.cut, thick=SLAB * self.radius, shown=self._near(position, focus),
                edge=0.4, line=0.3,
            )  # fmt: skip
        for name in sorted(frame.bodies, reverse=True):  # spikes first: the hull hides their upper ends
            corners, _ = facing(*frame.bodies[name])
            flat = self.place(corners.reshape(-1, 3), focus).reshape(-1, 3, 2)
            colour = _COLOURS.get(name, METAL)
            axis.add_collection(PolyCollection(list(flat), facecolors=[colour], edgecolors=[colour], linewidths=0.4))
