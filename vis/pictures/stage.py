"""A platform on its ground through a camera that can be moved: with OpenGL (`Stage`), or drawn flat (`FlatStage`).

Parallel projection, so that a length is the same all over the picture: the view goes along +y, from a little above,
onto the plane of the cut. `place` says where points lie on the picture, for what is drawn over it.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from PIL import Image

from vis.pictures.frames import Frame
from vis.pictures.scene import add_spheres

__all__ = ["Eye", "FlatStage", "Stage"]

Array = NDArray[np.float64]
_OVERSAMPLE = 1.5
_GROUND = (0.86, 0.80, 0.70)
_FLOOR = (0.55, 0.55, 0.57)
_COLOURS = {"hull": (0.80, 0.82, 0.85), "spikes": (0.52, 0.55, 0.60)}
_BODY = (0.74, 0.76, 0.79)


class Eye:
    """Where a point lies on a picture of `width` [m] across whose middle is at the focus.

    Args:
        size: Of the picture [pixels].
        width: What it shows across [m].
        cut: y of the plane that is looked at [m].
        pitch: How far the view goes downwards [radians].
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


class Stage(Eye):
    """Renders frames with VTK. Needs OpenGL: use it only in a process that may die.

    Args:
        low, high: Corners of the bed [m]; without grains, of a block of ground.
        radius: Typical radius of a grain [m], for the shading of gaps; None: a block of ground in place of grains.
        (the others as `Eye`)
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
        super().__init__(size, width=width, cut=cut, pitch=pitch)
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        import pyvista

        self._pyvista = pyvista
        plotter = pyvista.Plotter(off_screen=True, window_size=[round(_OVERSAMPLE * n) for n in size], lighting="none")
        self._plotter = plotter
        plotter.set_background("white")
        for direction, intensity in (((-1.0, -1.6, 1.9), 0.72), ((1.6, -1.4, 0.5), 0.26), ((0.1, 1.0, 1.4), 0.22)):
            light = pyvista.Light(position=tuple(10 * np.array(direction)), focal_point=(0.0, 0.0, 0.0))
            light.positional = False
            light.intensity = intensity
            plotter.add_light(light)
        thick = 0.03 * float(high[2] - low[2])
        if radius is None:
            block = (low[0], high[0], cut, high[1], low[2], high[2])
            plotter.add_mesh(pyvista.Box(block), color=_GROUND, ambient=0.4, diffuse=0.7)
        else:
            slab = pyvista.Box((low[0], high[0], cut, high[1], low[2] - thick, low[2] - 1e-6))
            plotter.add_mesh(slab, color=_FLOOR, ambient=0.25, diffuse=0.8)
            if radius / width * size[0] > 4.0:  # on smaller grains the shading of gaps does not show
                plotter.enable_ssao(radius=3.0 * radius, bias=0.3 * radius, kernel_size=32, blur=True)
        plotter.enable_parallel_projection()
        self.reach = 0.5 * width + 2.0 * float(high[1] - low[1])
        self._actors: list[Any] = []

    def render(self, frame: Frame, colours: Array, focus: tuple[float, float]) -> NDArray[np.uint8]:
        """Image of a frame with `focus` (x, z) [m] in its middle, shape (height, width, 3)."""
        for actor in self._actors:
            self._plotter.remove_actor(actor, render=False)
        self._actors = []
        position = frame.grains["position"]
        if len(position):
            near = np.abs(position[:, 0] - focus[0]) < 0.6 * self.width
            shown = near & (position[:, 1] >= self.cut)
            if shown.any():
                self._actors.append(
                    add_spheres(self._plotter, position[shown], frame.grains["radius"][shown], colours[shown])
                )
        for name, (points, triangles) in frame.bodies.items():
            self._actors += self._body(name, points, triangles)
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
        self._plotter.render()
        image = np.asarray(self._plotter.screenshot(None, return_img=True))[..., :3]
        return np.asarray(Image.fromarray(image).resize(self.size, Image.Resampling.LANCZOS))

    def close(self) -> None:
        """Free the window."""
        self._plotter.close()

    def _body(self, name: str, points: Array, triangles: NDArray[np.int64]) -> list[Any]:
        faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
        mesh = self._pyvista.PolyData(points, faces)
        rim = mesh.extract_feature_edges(feature_angle=40.0, boundary_edges=False, non_manifold_edges=False)
        mesh = mesh.compute_normals(feature_angle=35.0, split_vertices=True)
        body = self._plotter.add_mesh(
            mesh, color=_COLOURS.get(name, _BODY), smooth_shading=True, ambient=0.35, diffuse=0.75, specular=0.4,
            specular_power=30, render=False, reset_camera=False,
        )  # fmt: skip
        if not rim.n_cells:
            return [body]
        line = self._plotter.add_mesh(
            rim, color=(0.30, 0.32, 0.35), line_width=2.0, lighting=False, render=False, reset_camera=False
        )
        return [body, line]


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
            axis.add_patch(Rectangle((left, foot - thick), right - left, thick, color=_FLOOR))
            self._grains(axis, frame, colours, focus)
        for name in sorted(frame.bodies, reverse=True):  # spikes first: the hull hides their upper ends
            points, triangles = frame.bodies[name]
            normal = np.cross(
                points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
            )
            facing = triangles[normal[:, 1] < 0]
            corners = self.place(points[facing].reshape(-1, 3), focus).reshape(-1, 3, 2)
            colour = _COLOURS.get(name, _BODY)
            axis.add_collection(PolyCollection(list(corners), facecolors=[colour], edgecolors=[colour], linewidths=0.4))

    def _grains(self, axis: Any, frame: Frame, colours: Array, focus: tuple[float, float]) -> None:
        position, radius = frame.grains["position"], frame.grains["radius"]
        assert self.radius is not None
        behind, thick = position[:, 1] - self.cut, 8.0 * self.radius
        near = np.abs(position[:, 0] - focus[0]) < 0.6 * self.width
        slab = np.flatnonzero(near & (behind >= 0.0) & (behind <= thick))
        slab = slab[np.argsort(-behind[slab])]
        tone = 1.0 - 0.6 * behind[slab] / thick
        discs = EllipseCollection(
            2.0 * radius[slab] / self.width, 2.0 * radius[slab] / self.height, np.zeros(len(slab)), units="xy",
            offsets=self.place(position[slab], focus), offset_transform=axis.transData,
            facecolors=np.column_stack([colours[slab, :3] * tone[:, None], np.ones(len(slab))]),
            edgecolors=(0.0, 0.0, 0.0, 0.4), linewidths=0.3,
        )  # fmt: skip
        axis.add_collection(discs)
