"""The bed cut open, rendered off screen with VTK. Needs OpenGL: call it only in a process that may die.

Grains are exact spheres by ray casting in the shader (a quad per grain, not a mesh): software OpenGL draws 20,000 of
them in about a second.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vis.pictures.frames import Frame

__all__ = ["Scene", "add_spheres"]

_OVERSAMPLE = 1.5  # rendered larger and shrunk: smooth edges at a third of the cost of multi-sampling
_METAL = (0.74, 0.76, 0.79)
_RIM = (0.30, 0.32, 0.35)


class Scene:
    """A camera on a bed; the same for every frame it renders.

    Args:
        size: Width and height of the image [pixels].
        low, high: Corners of the undisturbed bed [m].
        cut: Grains with y below this [m], and the part of a body in front of it, are left out.
        radius: Typical radius of a grain [m], for the shading of the gaps between them.
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
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        import pyvista

        self._pyvista = pyvista
        self.size = size
        self.cut = cut
        plotter = pyvista.Plotter(off_screen=True, window_size=[round(_OVERSAMPLE * n) for n in size], lighting="none")
        self._plotter = plotter
        plotter.set_background("white")
        width, height = high[0] - low[0], high[2] - low[2]
        reach = float(max(width, 1.25 * height))
        centre = np.array([0.5 * (low[0] + high[0]), cut, 0.5 * (low[2] + high[2])])
        for direction, intensity in (((-1.0, -1.6, 1.9), 0.72), ((1.6, -1.4, 0.5), 0.26), ((0.1, 1.0, 1.4), 0.22)):
            light = pyvista.Light(position=tuple(centre + 10 * reach * np.array(direction)), focal_point=tuple(centre))
            light.positional = False
            light.intensity = intensity
            plotter.add_light(light)
        # The floor: a thin slab
        slab = pyvista.Box((low[0], high[0], cut, high[1], low[2] - 0.03 * height, low[2] - 1e-6))
        plotter.add_mesh(slab, color=(0.55, 0.55, 0.57), ambient=0.25, diffuse=0.8)
        plotter.enable_ssao(radius=3.0 * radius, bias=0.12 * radius, kernel_size=48, blur=True)
        camera = plotter.camera
        view = np.array([0.0, -1.0, 0.40])  # from straight ahead: a depth on the ruler is the same all across the cut
        camera.focal_point = tuple(centre)
        camera.position = tuple(centre + view / np.linalg.norm(view) * 5.0 * reach)
        camera.up = (0.0, 0.0, 1.0)
        camera.view_angle = 21.0
        camera.clipping_range = (0.5 * reach, 12.0 * reach)
        corners = [(x, y, z) for x in (low[0], high[0]) for y in (cut, high[1]) for z in (low[2], high[2])]
        self._fit(np.array([*corners, (centre[0], cut, high[2] + 0.55 * height)]))
        self._actors: list[Any] = []

    def render(self, frame: Frame, colours: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Image of a frame, shape (height, width, 3).

        Args:
            frame: The frame.
            colours: A colour per grain, shape (n, 3 or 4), 0 to 1.
        """
        for actor in self._actors:
            self._plotter.remove_actor(actor, render=False)
        position = frame.grains["position"]
        shown = position[:, 1] >= self.cut
        self._actors = [add_spheres(self._plotter, position[shown], frame.grains["radius"][shown], colours[shown])]
        for points, triangles in frame.bodies.values():
            self._actors += self._body(points, triangles)
        self._plotter.render()  # a screenshot alone would show the frame before
        image = np.asarray(self._plotter.screenshot(None, return_img=True))[..., :3]
        return np.asarray(Image.fromarray(image).resize(self.size, Image.Resampling.LANCZOS))

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where points [m], shape (n, 3), lie on the image: fractions from the lower left corner, shape (n, 2)."""
        camera = self._plotter.camera
        aspect = self.size[0] / self.size[1]
        matrix = camera.GetCompositeProjectionTransformMatrix(aspect, -1.0, 1.0)
        full = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
        clip = np.column_stack([points, np.ones(len(points))]) @ full.T
        return 0.5 + 0.5 * clip[:, :2] / clip[:, 3:]

    def close(self) -> None:
        """Free the window."""
        self._plotter.close()

    def _fit(self, points: NDArray[np.float64]) -> None:
        """Zoom and shift so that these points fill the page between the depth scale and the colour bar."""
        left, right, foot, head = 0.125, 0.865, 0.12, 0.90
        camera = self._plotter.camera
        low, high = (edge(self.place(points), axis=0) for edge in (np.min, np.max))
        zoom = min((right - left) / (high[0] - low[0]), (head - foot) / (high[1] - low[1]))
        camera.view_angle = np.degrees(2.0 * np.arctan(np.tan(np.radians(0.5 * camera.view_angle)) / zoom))
        low, high = (edge(self.place(points), axis=0) for edge in (np.min, np.max))
        shift = 0.5 * (low + high) - 0.5 * np.array([left + right, foot + head])
        camera.SetWindowCenter(*(2.0 * shift))

    def _body(self, points: NDArray[np.float64], triangles: NDArray[np.int64]) -> list[Any]:
        """What of a body lies behind the cut, closed by its section: in front its rim would be nearer the camera, and
        the tip would not meet the scale of depth."""
        faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
        mesh = self._pyvista.PolyData(points, faces)
        if points[:, 1].min() < self.cut < points[:, 1].max():
            mesh = mesh.clip_closed_surface(normal=(0.0, 1.0, 0.0), origin=(0.0, self.cut, 0.0))
        rim = mesh.extract_feature_edges(feature_angle=60.0, boundary_edges=False, non_manifold_edges=False)
        mesh = mesh.compute_normals(feature_angle=40.0, split_vertices=True)
        body = self._plotter.add_mesh(
            mesh, color=_METAL, smooth_shading=True, ambient=0.35, diffuse=0.75, specular=0.5, specular_power=30,
            render=False, reset_camera=False,
        )  # fmt: skip
        if not rim.n_cells:
            return [body]
        line = self._plotter.add_mesh(rim, color=_RIM, line_width=2.5, lighting=False, render=False, reset_camera=False)
        return [body, line]


def add_spheres(
    plotter: Any, centres: NDArray[np.float64], radius: NDArray[np.float64], colours: NDArray[np.float64]
) -> Any:
    """Add spheres to a plotter, each of its colour, shape (n, 3) or more, 0 to 1; return the actor."""
    import pyvista
    from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

    cloud = pyvista.PolyData(centres.astype(np.float32))
    cloud["radius"] = np.ascontiguousarray(radius, dtype=np.float32)
    cloud["colour"] = np.round(255 * colours[:, :3]).astype(np.uint8)
    mapper = vtkOpenGLSphereMapper()
    mapper.SetInputData(cloud)
    mapper.SetScaleArray("radius")
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("colour")
    mapper.SetColorModeToDirectScalars()
    mapper.SetScalarVisibility(True)
    actor = pyvista.Actor()
    actor.SetMapper(mapper)
    light = actor.prop
    light.ambient, light.diffuse, light.specular = 0.40, 0.74, 0.0
    plotter.add_actor(actor, render=False, reset_camera=False)
    return actor
