"""A spike: a round shaft with a ball, a cone or a flat end, pointing down.

The body's origin is the lowest point of its tip, its axis is z (up). The spike offers its shape as sections of
revolution in plain numbers; what they touch is not its business.
"""

import math
from dataclasses import dataclass
from typing import Literal

from rigid.checks import check_above_zero, check_not_negative

__all__ = ["Section", "Spike"]

Tip = Literal["sphere", "cone", "flat"]


@dataclass(frozen=True, slots=True)
class Section:
    """One primitive of revolution about the spike's axis, heights measured up from the tip's lowest point [m]."""

    shape: Literal["ball", "cylinder", "cone"]
    bottom: float  # Lowest height [m]
    top: float  # Highest height [m]
    bottom_radius: float  # Radius at the bottom [m]; a ball's radius
    top_radius: float  # Radius at the top [m]; a ball's radius

    def radius_at(self, height: float) -> float | None:
        """Radius [m] at `height` [m], None where the section has no matter."""
        if not self.bottom <= height <= self.top:
            return None
        if self.shape == "ball":
            above = height - 0.5 * (self.bottom + self.top)
            return math.sqrt(max(0.0, self.top_radius**2 - above**2))
        part = (height - self.bottom) / (self.top - self.bottom)
        return self.bottom_radius + part * (self.top_radius - self.bottom_radius)


@dataclass(frozen=True, kw_only=True)
class Spike:
    """A spike of the platform, or a penetrometer: geometry, mass and surface.

    Raises ValueError, naming the parameter, its value and what is allowed, for a body that cannot be.

    >>> spike = Spike(tip="cone", diameter=0.012, cone_angle=60)
    >>> [(section.shape, round(1e3 * section.top, 1)) for section in spike.sections]
    [('cone', 10.4), ('cylinder', 60.0)]
    """

    tip: Tip = "sphere"  # Shape of the end: "sphere", "cone" or "flat"
    diameter: float = 0.012  # Diameter of the tip [m]
    shaft_diameter: float | None = None  # Diameter of the shaft [m]; None: as the tip. Never thicker than the tip.
    length: float = 0.06  # From the tip's lowest point to the shaft's upper end [m]
    cone_angle: float = 60.0  # Full angle of a conical tip [degrees]
    mass: float = 0.5  # Mass [kg]: what falls in a drop
    friction: float = 0.5  # Coefficient of friction of its surface [1]
    restitution: float = 0.5  # Coefficient of restitution of its surface [1]

    def __post_init__(self) -> None:
        if self.tip not in ("sphere", "cone", "flat"):
            raise ValueError(f"tip is {self.tip!r}: it must be 'sphere', 'cone' or 'flat'")
        check_above_zero(diameter=self.diameter, length=self.length, mass=self.mass)
        if not 0 < self.shaft <= self.diameter:
            raise ValueError(
                f"shaft_diameter is {self.shaft_diameter}: it must be above 0 and at most the tip's diameter "
                f"{self.diameter}"
            )
        if self.tip == "flat" and self.shaft != self.diameter:
            raise ValueError(
                f"shaft_diameter is {self.shaft_diameter}: a flat tip ends the shaft itself, so it must be the tip's "
                f"diameter {self.diameter} (or left out)"
            )
        if self.tip == "cone" and not 1 <= self.cone_angle < 180:
            raise ValueError(f"cone_angle is {self.cone_angle}: the full angle must be from 1 to below 180 degrees")
        if self.length <= self.tip_height:
            raise ValueError(f"length is {self.length}: it must exceed the tip's own height, {self.tip_height:.6g} m")
        check_not_negative(friction=self.friction)
        if not 0.01 <= self.restitution <= 1:
            raise ValueError(f"restitution is {self.restitution}: it must be from 0.01 to 1")

    def __repr__(self) -> str:
        end = f"cone of {self.cone_angle:g} degrees" if self.tip == "cone" else self.tip
        return f"Spike({end}, {1e3 * self.diameter:g} mm thick, {1e3 * self.length:g} mm long, {self.mass:g} kg)"

    @property
    def shaft(self) -> float:
        """Diameter of the shaft [m], as given or by default."""
        return self.diameter if self.shaft_diameter is None else self.shaft_diameter

    @property
    def tip_height(self) -> float:
        """Height over which the tip widens to its full diameter [m]: R of a ball, that of a cone, 0 of a flat end."""
        if self.tip == "sphere":
            return 0.5 * self.diameter
        if self.tip == "cone":
            return 0.5 * self.diameter / math.tan(math.radians(0.5 * self.cone_angle))
        return 0.0

    @property
    def sections(self) -> tuple[Section, ...]:
        """The primitives that make the spike up, tip first; they touch or overlap, and their union is the body."""
        tip, shaft, height = 0.5 * self.diameter, 0.5 * self.shaft, self.tip_height
        column = Section("cylinder", height, self.length, shaft, shaft)
        if self.tip == "sphere":
            return (Section("ball", 0.0, self.diameter, tip, tip), column)
        if self.tip == "cone":
            return (Section("cone", 0.0, height, 0.0, tip), column)
        return (column,)

    def radius_at(self, height: float) -> float:
        """Radius of the body [m] at `height` above the lowest point [m]; 0 above its upper end."""
        radii = [radius for section in self.sections if (radius := section.radius_at(height)) is not None]
        return max(radii, default=0.0)

    def area_at(self, depth: float) -> float:
        """Cross-section [m2] in the plane of the surface when the lowest point is `depth` [m] below it.

        The widest below the surface counts: behind a thinner shaft the tip still presses with its own full section.
        """
        if depth <= 0:
            return 0.0
        below = 0.5 * self.diameter if depth >= self.tip_height else self.radius_at(depth)
        return math.pi * below**2
