"""How far points are from a body of a bed, by the shapes that its grains meet."""

from typing import Any

import numpy as np

from coupling.poses import Vector
from hedgebed_taichi import ti

__all__ = ["distances"]

FAR = 1.0  # Of a mesh that is farther away than this no distance is known [m]


@ti.kernel
def _measure(
    engine: ti.template(),
    body: ti.i32,
    points: ti.types.ndarray(dtype=ti.f64, ndim=2),
    found: ti.types.ndarray(dtype=ti.f64, ndim=2),
    shapes: ti.template(),
):
    for i in range(points.shape[0]):
        x = ti.Vector([points[i, 0], points[i, 1], points[i, 2]])
        distance, normal, curvature, _ = engine.nearest(body, ti.cast(x, engine.real), FAR, shapes, True)
        found[i, 0] = distance
        found[i, 1] = curvature
        for k in ti.static(range(3)):
            found[i, 2 + k] = normal[k]


def distances(bed: Any, body: int, points: Vector) -> tuple[Vector, Vector, Vector]:
    """Distance [m], shape (n,), outward normal, shape (n, 3), and curvature [1/m] of a body where it is now.

    ``points``: in the bed [m], shape (n, 3). Negative distances are depths inside.
    """
    found = np.zeros((len(points), 5))
    if len(points):
        _measure(bed.engine, body, np.ascontiguousarray(points, dtype=float), found, bed.engine.shapes)
    return found[:, 0], found[:, 2:], found[:, 1]
