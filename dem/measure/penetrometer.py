"""Cone penetrometer: a cone on a thinner shaft goes straight down at constant speed; force against depth.

Cone index: force over the area of the cone's base (ASAE S313.3; ISSMGE's reference test calls it q_c). Its gradient:
what it gains with the depth of the base [Pa/m].
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dem.engine.core import BedCore
from dem.shapes.basic import Cone, Cylinder

from .lid import Tell, refuse_tilted

__all__ = ["SHAFT", "ConePush", "check_cone", "cone_gradient", "cone_length", "push_cone", "standard_speed"]

SHAFT = 15.88 / 20.27
"""Diameter of the shaft over that of the cone [1]: the larger cone of ASAE S313.3, so that the shaft hardly rubs."""
_STANDARD_SPEED, _STANDARD_DIAMETER, _STANDARD_GRAVITY = 0.030, 0.02027, 9.80665
LEAST_GRAINS, LEAST_WIDTH = 3.0, 3.0
"""Least diameter of the cone [mean diameters], and least width of the bed [diameters of the cone]."""
# Nearer to the floor the tip does not go [diameters of the cone]; samples of a push; least depth over the length.
_FLOOR, _SAMPLES, _LEAST_DEPTH = 0.5, 200, 1.25


@dataclass(frozen=True)
class ConePush:
    """One push.

    Attributes:
        depth: of the tip below the surface [m]; force: upwards on the cone [N], mean over the way to that depth from
            the one before; each of shape [n].
        diameter, length: of the cone [m]; angle: full [degrees]. speed: [m/s]. place: x, y [m].
        surface, packing_fraction: of the bed before. max_overlap: over diameter [1].
    """

    depth: np.ndarray
    force: np.ndarray
    diameter: float
    length: float
    angle: float
    speed: float
    place: tuple[float, float]
    surface: float
    packing_fraction: float
    max_overlap: float

    @property
    def index(self) -> np.ndarray:
        """Cone index [Pa], shape [n]."""
        return self.force / (0.25 * math.pi * self.diameter**2)

    @property
    def base_depth(self) -> np.ndarray:
        """Depth of the cone's base [m], negative while it is not all in, shape [n]."""
        return self.depth - self.length


def cone_length(diameter: float, angle: float) -> float:
    """From tip to base [m]; ``angle`` is full, in degrees."""
    return 0.5 * diameter / math.tan(math.radians(0.5 * angle))


def standard_speed(diameter: float, gravity: float) -> float:
    """30 mm/s for the larger cone of ASAE S313.3 on Earth; for others at the same v / sqrt(g D) [m/s]."""
    return _STANDARD_SPEED * math.sqrt(gravity * diameter / (_STANDARD_GRAVITY * _STANDARD_DIAMETER))


def push_cone(
    bed: BedCore,
    *,
    diameter: float,
    angle: float = 60.0,
    depth: float | None = None,
    speed: float | None = None,
    place: Sequence[float] | None = None,
    shaft: float | None = None,
    friction: float | None = None,
    tell: Tell = lambda share: None,
) -> ConePush:
    """Push a cone down at constant speed. The bed is used up by it.

    Args:
        diameter: of the cone's base [m]. angle: full angle of the cone [degrees].
        depth: of the tip at the end [m]; half the bed's when None, for which its grains are stiff enough.
        speed: [m/s]; ``standard_speed`` when None.
        place: x, y [m]; the bed's middle when None. A bed is periodic: all places are alike but for chance.
        shaft: its diameter [m]; ``SHAFT`` times the cone's when None.
        friction: of grains on cone and shaft; the grains' own when None.
        tell: called with the share done, 0 to 1.

    Raises ValueError: a tilted bed; a cone thinner than three grains, or wider than a third of the bed. The depth must
    be so large that all of the cone is in, and not too near the floor. BedFailure: the bed's own reasons, as an overlap
    past its bound.
    """
    grains = bed.grains()
    grain = 2 * float(grains.radius.mean())
    place = (0.5 * bed.size[0], 0.5 * bed.size[1]) if place is None else (float(place[0]), float(place[1]))
    refuse_tilted(bed)
    depth = 0.5 * bed.surface if depth is None else depth
    shaft = SHAFT * diameter if shaft is None else shaft
    check_cone(
        size=bed.size, surface=bed.surface, grain=grain, diameter=diameter, angle=angle, depth=depth, shaft=shaft
    )
    length = cone_length(diameter, angle)
    speed = standard_speed(diameter, -bed.gravity[2]) if speed is None else speed
    if not 0 < speed < math.inf:
        raise ValueError(f"speed = {speed} m/s must be positive")
    away = grains.position[:, :2] - np.array(place)
    width = np.array(bed.size[:2])
    away -= width * np.round(away / width)
    near = np.hypot(away[:, 0], away[:, 1]) < 0.5 * diameter + grains.radius
    top = float((grains.position[near, 2] + grains.radius[near]).max()) if near.any() else bed.surface
    start = max(top, bed.surface) + 0.01 * grain
    surface, packing = bed.surface, bed.packing_fraction
    cone = Cone(bottom=0.0, top=length, bottom_radius=0.0, top_radius=0.5 * diameter)
    rod = Cylinder(bottom=length * shaft / diameter, top=depth + diameter, radius=0.5 * shaft)
    body = bed.add_body([cone, rod], position=(*place, start), friction=friction)
    bed.move_body(body, velocity=(0.0, 0.0, -speed))
    total = math.ceil((start - surface + depth) / (speed * bed.time_step))
    done, rows = 0, []
    for end in np.linspace(0, total, _SAMPLES + 1).round().astype(int)[1:]:
        bed.advance(int(end) - done)
        done = int(end)
        rows.append((surface - float(bed.body_position(body)[2]), float(bed.reaction(body)[0][2])))
        tell(done / total)
    depths, forces = np.array(rows).T
    return ConePush(
        depths, forces, diameter, length, angle, speed, (place[0], place[1]), surface, packing, bed.max_overlap
    )


def check_cone(
    *,
    size: Sequence[float],
    surface: float,
    grain: float,
    diameter: float,
    angle: float,
    depth: float | None,
    shaft: float | None,
) -> None:
    """Refuse a cone that cannot go into a bed of that size and surface [m]. Raises ValueError as ``push_cone`` does."""
    depth = 0.5 * surface if depth is None else depth
    shaft = SHAFT * diameter if shaft is None else shaft
    least, most = LEAST_GRAINS * grain, min(size[:2]) / LEAST_WIDTH
    if not least <= diameter <= most:
        narrow = f"; the bed is too narrow for any, a width of {LEAST_WIDTH * least:.4g} m is needed"
        raise ValueError(
            f"diameter = {diameter:g} m: give three grains, {least:.4g} m, to a third of the bed's width, "
            f"{most:.4g} m{narrow if most < least else ''}"
        )
    if not 10 <= angle <= 150:
        raise ValueError(f"angle = {angle:g} degrees: give a full angle of 10 to 150")
    if not grain <= shaft <= diameter:
        raise ValueError(f"shaft = {shaft:g} m: give a grain, {grain:.4g} m, to the cone's {diameter:g} m")
    length = cone_length(diameter, angle)
    least, most = _LEAST_DEPTH * length, surface - _FLOOR * diameter
    if not least <= depth <= most:
        raise ValueError(
            f"depth = {depth:.4g} m: a cone of {length:.4g} m in a bed of {surface:.4g} m goes from {least:.4g} m, "
            f"where it is all in, to {most:.4g} m, half its diameter above the floor"
            + ("; a deeper bed, or a smaller or a blunter cone" if least > most else "")
        )


def cone_gradient(push: ConePush) -> tuple[float, float]:
    """Gradient of the cone index [Pa/m] and its value at the surface [Pa]: least squares where the cone is all in."""
    inside = push.base_depth >= 0
    slope, start = np.polyfit(push.base_depth[inside], push.index[inside], 1)
    return float(slope), float(start)
