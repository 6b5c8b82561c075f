"""Scenes rendered off screen with VTK. Needs OpenGL: use them only in a process that may die.

Grains are exact spheres by ray casting in the shader (a quad per grain, not a mesh): software OpenGL draws 20,000 of
them in about a second. `Scene` is the bed cut open in front of a camera that stands still. `Stage` is a platform on its
ground through a camera that can be moved. The projection is parallel: a length is the same all over the picture, and
scales are square to its edges. The view goes along +y, from a little above, onto the plane of the cut. `place` says
where points lie on the picture, for what is drawn over it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vis.page.plots import Array
from vis.pictures.canvas import BED_SPACE
from vis.pictures.frames import Frame

__all__ = ["FLOOR", "GROUND", "METAL", "OPACITY", "PARTS", "Eye", "Rendered", "Scene", "Stage"]

_OVERSAMPLE = 1.5  # rendered larger and shrunk: smooth edges at a third of the cost of multi-sampling
_LIGHTS = (((-1.0, -1.6, 1.9), 0.72), ((1.6, -1.4, 0.5), 0.26), ((0.1, 1.0, 1.4), 0.22))
_RIM = (0.30, 0.32, 0.35)
FLOOR = (0.55, 0.55, 0.57)
METAL = (0.74, 0.76, 0.79)
GROUND = (0.86, 0.80, 0.70)
_RULED = (0.66, 0.59, 0.48)
"""Lines on a block of ground."""
OPACITY = 0.55
"""Of a block of ground with tips in it: they show through."""
PARTS = {"hull": (0.80, 0.82, 0.85), "spikes": (0.52, 0.55, 0.60)}
"""Colours of the parts of a platform."""


class Rendered:
    """A white picture of a size [pixels] with lights about `centre`, far away for what reaches so far [m]."""

    render: Callable[..., NDArray[np.uint8]]

    def __init__(self, size: tuple[int, int], *, centre: Array, reach: float) -> None:
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        import pyvista

        self._pyvista, self.size = pyvista, size
        window = [round(_OVERSAMPLE * n) for n in size]
        self._plotter = pyvista.Plotter(off_screen=True, window_size=window, lighting="none")
        self._plotter.set_background("white")
        for direction, intensity in _LIGHTS:
            light = pyvista.Light(position=tuple(centre + 10 * reach * np.array(direction)), focal_point=tuple(centre))
            light.positional = False
            light.intensity = intensity
            self._plotter.add_light(light)
        self._actors: list[Any] = []

    def add_block(
        self,
        corners: Sequence[float],
        colour: tuple[float, float, float],
        ambient: float,
        diffuse: float,
        opacity: float = 1.0,
    ) -> None:
        """A box, its corners in VTK's order [m], that stays: ground or floor."""
        # A translucent one without its rear faces: one face is mixed in at each place.
        culling = "back" if opacity < 1.0 else False
        box = self._pyvista.Box(corners)
        self._plotter.add_mesh(
            box, color=colour, ambient=ambient, diffuse=diffuse, opacity=opacity, culling=culling, smooth_shading=False
        )

    def add_grid(self, low: Array, high: Array, step: float) -> None:
        """Lines along x and y, a `step` apart, on top of a box with these corners [m], that stay: they show how what
        is above moves over a ground without grains."""
        ends = []
        for axis in (0, 1):
            at = step * np.arange(np.ceil(low[axis] / step), np.floor(high[axis] / step) + 1.0)
            for edge in (low[1 - axis], high[1 - axis]):
                points = np.full((len(at), 3), high[2] + 1e-3 * step)
                points[:, axis], points[:, 1 - axis] = at, edge
                ends.append(points)
        pairs = np.concatenate([np.stack(ends[:2], axis=1), np.stack(ends[2:], axis=1)])
        if len(pairs):
            lines = self._pyvista.line_segments_from_points(pairs.reshape(-1, 3))
            self._plotter.add_mesh(lines, color=_RULED, line_width=2.0, lighting=False)

    def draw(self, axis: Any, *frame: Any, **more: Any) -> None:
        """Show the picture of a frame on an axes whose limits are 0 to 1; arguments as those of `render`.

        Pixel by pixel, below the axes: `imshow` would compute them anew, which takes a sixth of the time of a picture.
        """
        left, foot = (round(at) for at in axis.bbox.p0)
        axis.patch.set_visible(False)
        axis.figure.figimage(self.render(*frame, **more)[::-1], left, foot, origin="lower", zorder=-1.0)

    def close(self) -> None:
        """Free the window."""
        self._plotter.close()

    def _clear(self) -> None:
        for actor in self._actors:
            self._plotter.remove_actor(actor, render=False)
        self._actors = []

    def _image(self) -> NDArray[np.uint8]:
        """The picture, shape (height, width, 3)."""
        self._plotter.render()  # a screenshot alone would show the frame before
        image = np.asarray(self._plotter.screenshot(None, return_img=True))[..., :3]
        return np.asarray(Image.fromarray(image).resize(self.size, Image.Resampling.LANCZOS))

    def _mesh(self, points: Array, triangles: NDArray[np.int64]) -> Any:
        return self._pyvista.PolyData(points, np.column_stack([np.full(len(triangles), 3), triangles]).ravel())

    def _add_body(
        self, mesh: Any, *, rim: float, smooth: float, line: float, specular: float, colour: Any = METAL
    ) -> None:
        """A body with lines along edges of more than `rim` degrees, smooth over those of less than `smooth`."""
        edges = mesh.extract_feature_edges(feature_angle=rim, boundary_edges=False, non_manifold_edges=False)
        mesh = mesh.compute_normals(feature_angle=smooth, split_vertices=True)
        body = self._plotter.add_mesh(
            mesh, color=colour, smooth_shading=True, ambient=0.35, diffuse=0.75, specular=specular, specular_power=30,
            render=False, reset_camera=False,
        )  # fmt: skip
        self._actors.append(body)
        if edges.n_cells:
            style = {"color": _RIM, "line_width": line, "lighting": False}
            self._actors.append(self._plotter.add_mesh(edges, **style, render=False, reset_camera=False))

    def _add_spheres(self, centres: Array, radius: Array, colours: Array) -> None:
        """Spheres, each of its colour, shape (n, 3) or more, 0 to 1."""
        from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

        cloud = self._pyvista.PolyData(centres.astype(np.float32))
        cloud["radius"] = np.ascontiguousarray(radius, dtype=np.float32)
        cloud["colour"] = np.round(255 * colours[:, :3]).astype(np.uint8)
        mapper = vtkOpenGLSphereMapper()
        mapper.SetInputData(cloud)
        mapper.SetScaleArray("radius")
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("colour")
        mapper.SetColorModeToDirectScalars()
        mapper.SetScalarVisibility(True)
        actor = self._pyvista.Actor()
        actor.SetMapper(mapper)
        light = actor.prop
        light.ambient, light.diffuse, light.specular = 0.40, 0.74, 0.0
        self._plotter.add_actor(actor, render=False, reset_camera=False)
        self._actors.append(actor)


class Scene(Rendered):
    """A camera on a bed; the same for every frame it renders.

    ``size``: Width and height of the image [pixels]. ``low``, ``high``: Corners of the undisturbed bed [m]. ``cut``:
    Grains with y below this [m], and the part of a body in front of it, are left out. ``radius``: Typical radius of a
    grain [m], for the shading of the gaps between them. ``tilt``: Slope at which the view goes down [1].
    """

    def __init__(
        self, size: tuple[int, int], low: Array, high: Array, *, cut: float, radius: float, tilt: float = 0.40
    ) -> None:
        width, height = high[0] - low[0], high[2] - low[2]
        reach = float(max(width, 1.25 * height))
        centre = np.array([0.5 * (low[0] + high[0]), cut, 0.5 * (low[2] + high[2])])
        super().__init__(size, centre=centre, reach=reach)
        self.cut = cut
        floor = (low[0], high[0], cut, cut + 4.0 * radius, low[2] - 0.03 * height, low[2] - 1e-6)
        self.add_block(floor, FLOOR, 0.25, 0.8)
        self._plotter.enable_ssao(radius=3.0 * radius, bias=0.12 * radius, kernel_size=48, blur=True)
        self._plotter.enable_parallel_projection()
        camera = self._plotter.camera
        view = np.array([0.0, -1.0, tilt])  # from straight ahead: a depth on the ruler is the same all across the cut
        camera.focal_point = tuple(centre)
        camera.position = tuple(centre + view / np.linalg.norm(view) * 1.3 * reach)
        camera.up = (0.0, 0.0, 1.0)
        # From near: the shading of gaps stripes what is flat where the camera is far away (`Stage.render`).
        camera.clipping_range = (0.1 * reach, 2.5 * reach)
        corners = [(x, y, z) for x in (low[0], high[0]) for y in (cut, high[1]) for z in (low[2], high[2])]
        self._fit(np.array(corners))

    def render(self, frame: Frame, colours: Array) -> NDArray[np.uint8]:
        """Image of a frame, shape (height, width, 3).

        ``frame``: The frame. ``colours``: A colour per grain, shape (n, 3 or 4), 0 to 1.
        """
        self._clear()
        position = frame.grains["position"]
        shown = position[:, 1] >= self.cut
        self._add_spheres(position[shown], frame.grains["radius"][shown], colours[shown])
        for points, triangles in frame.bodies.values():
            mesh = self._mesh(points, triangles)
            # What lies behind the cut, closed by its section: in front its rim would be nearer the camera, and the tip
            # would not meet the scale of depth.
            if points[:, 1].min() < self.cut < points[:, 1].max():
                mesh = mesh.clip_closed_surface(normal=(0.0, 1.0, 0.0), origin=(0.0, self.cut, 0.0))
            self._add_body(mesh, rim=60.0, smooth=40.0, line=2.5, specular=0.5)
        return self._image()

    def place(self, points: Array) -> Array:
        """Where points [m], shape (n, 3), lie on the image: fractions from the lower left corner, shape (n, 2)."""
        camera = self._plotter.camera
        aspect = self.size[0] / self.size[1]
        matrix = camera.GetCompositeProjectionTransformMatrix(aspect, -1.0, 1.0)
        full = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
        clip = np.column_stack([points, np.ones(len(points))]) @ full.T
        return 0.5 + 0.5 * clip[:, :2] / clip[:, 3:]

    def _fit(self, points: Array) -> None:
        """Zoom and shift so that these points fill the space of a bed on the page."""
        left, right, foot, head = BED_SPACE
        camera = self._plotter.camera
        low, high = (edge(self.place(points), axis=0) for edge in (np.min, np.max))
        zoom = min((right - left) / (high[0] - low[0]), (head - foot) / (high[1] - low[1]))
        camera.parallel_scale /= zoom
        low, high = (edge(self.place(points), axis=0) for edge in (np.min, np.max))
        shift = 0.5 * (low + high) - 0.5 * np.array([left + right, foot + head])
        camera.SetWindowCenter(*(2.0 * shift))


class Eye:
    """Where a point lies on a picture of `width` [m] across whose middle is at the focus.

    ``size``: Of the picture [pixels]. ``width``: Visible width [m]. ``cut``: y of the plane in view [m]. ``pitch``:
    Angle of the view below the horizontal [radians]. Its `reach` is the largest distance of visible things from the
    focus [m].
    """

    def __init__(self, size: tuple[int, int], *, width: float, cut: float, pitch: float = 0.0) -> None:
        self.size, self.width, self.cut = size, width, cut
        self.height = width * size[1] / size[0]
        self.pitch, self.reach = pitch, 0.5 * width

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
    grain [m], for the shading of gaps; None: a block of ground in place of grains. ``opacity``: Of that block.
    ``ruled``: Distance of the lines on it [m]; 0: it has none. (the others as `Eye`)
    """

    def __init__(
        self,
        size: tuple[int, int],
        *,
        low: Array,
        high: Array,
        radius: float | None,
        opacity: float = 1.0,
        ruled: float = 0.0,
        **view: float,
    ) -> None:
        Eye.__init__(self, size, **({"pitch": 0.24} | view))
        Rendered.__init__(self, size, centre=np.zeros(3), reach=1.0)
        thick = 0.03 * float(high[2] - low[2])
        if radius is None:
            self.add_block((low[0], high[0], self.cut, high[1], low[2], high[2]), GROUND, 0.4, 0.7, opacity)
            if ruled > 0.0:
                self.add_grid(low, high, ruled)
        else:
            self.add_block((low[0], high[0], self.cut, high[1], low[2] - thick, low[2] - 1e-6), FLOOR, 0.25, 0.8)
            if radius / self.width * size[0] > 4.0:  # on smaller grains the shading of gaps does not show
                self._plotter.enable_ssao(radius=3.0 * radius, bias=0.3 * radius, kernel_size=32, blur=True)
        self._plotter.enable_parallel_projection()
        self.reach = 0.5 * self.width + 2.0 * float(high[1] - low[1])

    def render(self, frame: Frame, colours: Array, focus: tuple[float, float]) -> NDArray[np.uint8]:
        """Image of a frame with `focus` (x, z) [m] in its middle, shape (height, width, 3)."""
        self._clear()
        position = frame.grains["position"]
        shown = self._near(position, focus) & (position[:, 1] >= self.cut)
        if shown.any():
            self._add_spheres(position[shown], frame.grains["radius"][shown], colours[shown])
        for name, body in frame.bodies.items():
            colour = PARTS.get(name, METAL)
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
