"""The soles of a robot's feet, and a surface law that follows them: `sole_of`, `law_under_feet`."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NotRequired, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from coupling.poses import Vector
from rigid.ground.laws import find_law
from rigid.ground.rft_foot import FLAT, LYING, ROUND
from rigid.ground.soles import Sole, ill_sized, of_one_foot, sized_law

from .feet import Foot, Part

__all__ = [
    "FASTEST", "TIP", "FeetLaw", "compared_speeds", "default_law", "foot_matrices", "law_under_feet", "outline",
    "plan_area", "refuse_defaults", "sole_of",
]  # fmt: skip

TIP = 0.012
"""Diameter of the tip that the defaults of the laws of grains are of [m] (`rigid.ground.laws`)."""
FASTEST = 2.6
"""Speed of a foot in the ground over sqrt(g D) up to which laws of sand were compared with grains [1]
(docs/results/mujoco-laws/flat-foot.json); D: diameter of the circle with the area of the foot from above."""
LEAST = 1e-3
"""Area of a part over that of the tip below which it counts as that much: of a plate that stands on its edge."""


class FeetLaw(TypedDict):
    """Arguments of `LawFeet` and `FootForces`: a law as each part of the feet has it."""

    law: str
    under: dict[str, Mapping[str, float]]  # Name of a part -> its parameters
    scales: dict[str, float]  # Name of a part -> how many times the law it has [1]
    depths: dict[str, float]  # Name of a part -> depth to which its parameters hold [m]; empty where that is not known
    speeds: NotRequired[dict[str, float]]  # Name of a part -> speed to which its law was compared with grains [m/s]


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
    radius of an upright cylinder, sphere, capsule or ellipsoid (of the circle of the same area). For other shapes it is
    the smallest width from above.
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
    matrices: ArrayLike,
    law: str,
    parameters: Mapping[str, float],
    *,
    of: float,
    given: Collection[str] = (),
    depth: float | None = None,
) -> FeetLaw:
    """A law of a tip of diameter `of` [m] as each part of `feet` has it: arguments of `LawFeet` and `FootForces`.

    ``matrices``: rotation of each foot from its own axes to the world's, shape (foot, 3, 3), as `foot_matrices` returns
    them. The size of a foot is taken in this posture. ``parameters``, ``given``: as `rigid.ground.soles.sized_law` has
    them. ``depth``: to which the parameters hold under the tip [m], such as ``range["depth"][1]`` of a ground file. Of
    a foot it is as many of its diameters. Raises ValueError as `sized_law`, and where the law takes a gravity that is
    not in ``parameters``.

    A law of a fitted tip under a round plate of 60 mm, which has 25 times the area of the tip:

    >>> import mujoco
    >>> from coupling.robot import FootForces, LawFeet, find_feet, foot_matrices, law_under_feet, load_model
    >>> from rigid.ground_file import read_ground
    >>> model = load_model("hopper")
    >>> data = mujoco.MjData(model)
    >>> mujoco.mj_forward(model, data)
    >>> feet = find_feet(model, data, ["foot"])
    >>> sand = read_ground("docs/results/calibrate-sand-1mm/ground.toml")
    >>> matrices = foot_matrices(data, feet)  # from the axes of each foot to the world's
    >>> matrices.shape
    (1, 3, 3)
    >>> own = law_under_feet(feet, matrices, sand.law, sand.values, of=sand.foot.diameter)
    >>> sorted(own)
    ['depths', 'law', 'scales', 'under']
    >>> round(own["under"]["foot"]["stiffness"] / sand.values["stiffness"])
    25
    >>> FootForces(model, data, feet, **own, mu_d=0.3).points  # evaluated so far
    0
    >>> LawFeet(feet, **own, mu_s=0.6).name
    'spring-damper'
    """
    if "gravity" in of_one_foot(law) and "gravity" not in parameters:
        raise ValueError(f"law = {law!r} takes the gravity of the grains [m/s2]: give gravity in parameters")
    under: dict[str, Mapping[str, float]] = {}
    scales: dict[str, float] = {}
    depths: dict[str, float] = {}
    name = law
    for foot, matrix in zip(feet, np.asarray(matrices, dtype=float), strict=True):
        for part in foot.parts:
            sole = sole_of(part, matrix, of=of)
            own = sized_law(law, parameters, sole, of=of, given=given)
            if depth is not None:
                depths[part.name] = depth * sole.diameter / of
            name, under[part.name], scales[part.name] = own.law, own.parameters, own.count
    return {"law": name, "under": under, "scales": scales, "depths": depths}


def compared_speeds(feet: Sequence[Foot], matrices: ArrayLike, *, gravity: float) -> dict[str, float]:
    """Name of each part -> speed of its foot to which laws of sand were compared with grains [m/s].

    It is `FASTEST` sqrt(g D), D of the largest part of a foot. ``matrices``: as of `law_under_feet`. Empty without
    ``gravity`` [m/s2].
    """
    found: dict[str, float] = {}
    for foot, matrix in zip(feet, np.asarray(matrices, dtype=float), strict=True):
        diameter = max(sole_of(part, matrix, of=TIP).diameter for part in foot.parts)
        found |= dict.fromkeys((part.name for part in foot.parts), FASTEST * math.sqrt(gravity * diameter))
    return found if gravity > 0 else {}


def foot_matrices(data: Any, feet: Sequence[Foot]) -> Vector:
    """Rotation of each foot in an MjData from its own axes to the world's, shape (foot, 3, 3); after ``mj_forward``."""
    return np.array([data.xmat[foot.body] for foot in feet]).reshape(-1, 3, 3)


def default_law(
    feet: Sequence[Foot], matrices: ArrayLike, law: str, given: Mapping[str, float], *, gravity: float
) -> FeetLaw:
    """`law` under `feet` with what is not `given` from its defaults: in this gravity [m/s2], of the size of each foot.

    The defaults are those of a tip of `TIP`; what is given is of one foot. Raises ValueError, naming them, for
    parameters of which there is no default for a foot: those of brick, or of another exponent or gravity.
    """
    found, hard = find_law(law), law == "spring-damper"
    ill = [name for name in of_one_foot(law) if name not in given] if hard else ill_sized(law, given)
    if ill:
        raise ValueError(
            f"law = {law!r}: {' and '.join(ill)} must be given in parameters, of one foot: there is no default for "
            f"feet in sand"
        )
    values = found.values(found.in_gravity(gravity, given))
    own = law_under_feet(feet, matrices, law, values, of=TIP, given=tuple(given))
    return own if hard else {**own, "speeds": compared_speeds(feet, matrices, gravity=gravity)}


def refuse_defaults(
    feet: Sequence[Foot], law: str, parameters: Mapping[str, float], under: Mapping[str, Mapping[str, float]]
) -> None:
    """Raise ValueError, naming part and parameter, where a part takes a default that is of another foot or gravity."""
    for part in (part for foot in feet for part in foot.parts):
        own = under.get(part.name, parameters)
        if missing := [name for name in of_one_foot(law) if name not in own]:
            raise ValueError(
                f"law = {law!r}: {' and '.join(missing)} of foot {part.name!r} is not given, and its default is of "
                f"another foot or gravity: give it in parameters, or take law_under_feet(...)"
            )
