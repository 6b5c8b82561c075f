"""The soles of a robot's feet, and a surface law that follows them: `sole_of`, `law_under_feet`."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypedDict

import numpy as np

from coupling.poses import Vector
from rigid.ground.rft_foot import FLAT, LYING, ROUND
from rigid.ground.soles import Sole, sized_law

from .feet import Foot, Part

__all__ = ["FeetLaw", "law_under_feet", "outline", "plan_area", "sole_of"]

LEAST = 1e-3
"""Area of a part over that of the tip below which it counts as that much: of a plate that stands on its edge."""


class FeetLaw(TypedDict):
    """Arguments of `LawFeet` and `FootForces`: a law as each part of the feet has it."""

    law: str
    under: dict[str, Mapping[str, float]]  # Name of a part -> its parameters
    scales: dict[str, float]  # Name of a part -> how many times the law it has [1]


def plan_area(vertices: Any) -> float:
    """Area of a part seen from above [m2]; 0 of a point."""
    return outline(vertices)[0]


def outline(vertices: Any) -> tuple[float, float, float]:
    """Area [m2], perimeter [m] and smallest width [m] of points [m], shape (n, 3), seen from above; 0 of a point."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.asarray(vertices, dtype=float)[:, :2]
    if len(points) < 3:
        return 0.0, 0.0, 0.0
    try:
        hull = ConvexHull(points)
    except QhullError:
        return 0.0, 0.0, 0.0
    widths = np.ptp(points[hull.vertices] @ hull.equations[:, :2].T, axis=0)
    return float(hull.volume), float(hull.area), float(widths.min())


def sole_of(part: Part, matrix: Vector, *, of: float) -> Sole:
    """The sole of a part that is turned by `matrix`; a site, a point, has that of a spike of diameter `of` [m].

    A box, an upright cylinder and a mesh are flat: the points on which they stand share the law. A sphere, an ellipsoid
    and the end of an upright capsule are round; a cylinder or capsule that lies is a lying cylinder. The width is the
    radius of an upright cylinder, sphere, capsule or ellipsoid (of the circle of the same area), else the smallest
    width from above.
    """
    if part.kind == "site":
        return Sole.of_spike(of)
    area, perimeter, narrow = outline(part.vertices @ matrix.T)
    area = max(area, LEAST * 0.25 * math.pi * of**2)
    radius = math.sqrt(area / math.pi)
    lies = part.kind in ("cylinder", "capsule") and part.share == 0.5
    if part.kind in ("box", "mesh") or (part.kind == "cylinder" and not lies):
        width = radius if part.kind == "cylinder" else max(narrow, 1e-6)
        return Sole(area=area, width=width, roundness=FLAT, perimeter=perimeter)
    height = float(np.linalg.norm(part.spreads[0] @ matrix[2]))
    if lies:
        height = float(np.linalg.norm(part.spreads[0], 2))
        return Sole(area=area, width=max(narrow, 1e-6), height=height, roundness=LYING)
    shaft = 2 * math.pi * height if part.kind == "capsule" else 0.0
    return Sole(area=area, width=radius, height=height, roundness=ROUND, perimeter=shaft)


def law_under_feet(
    feet: Sequence[Foot],
    matrices: Sequence[Vector],
    law: str,
    parameters: Mapping[str, float],
    *,
    of: float,
    given: Collection[str] = (),
) -> FeetLaw:
    """A law of a tip of diameter `of` [m] as each part of `feet` has it: arguments of `LawFeet` and `FootForces`.

    ``matrices``: rotation of each foot in the posture in which its size counts. ``parameters``, ``given``: as
    `rigid.ground.soles.sized_law` has them. Raises ValueError as it.
    """
    under: dict[str, Mapping[str, float]] = {}
    scales: dict[str, float] = {}
    name = law
    for foot, matrix in zip(feet, matrices, strict=True):
        for part in foot.parts:
            own = sized_law(law, parameters, sole_of(part, matrix, of=of), of=of, given=given)
            name, under[part.name], scales[part.name] = own.law, own.parameters, own.count
    return {"law": name, "under": under, "scales": scales}
