"""The pieces of a body that grains can touch: balls and rods of a platform, the sections of a spike.

A row of spikes of a planar platform is one spike in the bed. The bed is periodic across (y) and as wide as the spacing
of the spikes. Rows that face each other share one body of the bed (`slot`), since only the lower can be near the sand.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigid.platform.platform import Platform
from rigid.platform.spike import Section, Spike

from .law_ground import row_tips
from .poses import Vector

__all__ = [
    "FEWEST_SLOTS", "HULL", "Member", "ball_member", "platform_members", "slots_of", "spatial_members", "spike_member",
]  # fmt: skip

HULL = -1  # Row number of what is no spike
FEWEST_SLOTS = 3  # Bodies of the bed that rows share in turn, with which those that share one are far enough apart
STILL = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True)
class Member:
    """One piece of the platform that grains can touch: a ball, or a rod with a round end at its lower end."""

    row: int  # Of the planar model's rows; HULL for the hull
    at: Vector  # Its origin in body axes [m], shape (3,)
    turn: Vector  # Unit quaternion from its axes (z along the rod) to the body's, shape (4,)
    radius: float  # [m]
    length: float = 0.0  # Of the rod above its origin [m]; 0: a ball
    below: float = 0.0  # Of the rod below its origin [m]; only where there is no ball
    slot: int = 0  # The DEM body that stands for it: that of a slot is its lowest member
    sections: tuple[Section, ...] = ()  # Of a spike of other shape, in place of ball and rod

    def shapes(self) -> list[Any]:
        """As `dem.shapes.basic` has it, in its own axes."""
        from dem.shapes.basic import Ball, Cylinder

        if self.sections:
            return [_section_shape(section) for section in self.sections]
        parts: list[Any] = [] if self.below else [Ball(radius=self.radius)]
        if self.length:
            parts.append(Cylinder(bottom=-self.below, top=self.length, radius=self.radius))
        return parts


def ball_member(radius: float) -> Member:
    """A ball at the body's origin."""
    return Member(row=0, at=np.zeros(3), turn=STILL, radius=radius)


def spike_member(spike: Spike) -> Member:
    """A spike that stands upright, its tip's lowest point at the body's origin."""
    return Member(row=0, at=np.zeros(3), turn=STILL, radius=0.0, sections=tuple(spike.sections))


def _section_shape(section: Section) -> Any:
    from dem.shapes.basic import Ball, Cone, Cylinder

    if section.shape == "ball":
        return Ball(center=(0.0, 0.0, 0.5 * (section.bottom + section.top)), radius=section.top_radius)
    if section.shape == "cylinder":
        return Cylinder(bottom=section.bottom, top=section.top, radius=section.top_radius)
    radii = {"bottom_radius": section.bottom_radius, "top_radius": section.top_radius}
    return Cone(bottom=section.bottom, top=section.top, **radii)


def slots_of(count: int) -> int:
    """How many bodies of the bed the `count` rows of a platform in the plane share in turn; `FEWEST_SLOTS` will do."""
    return next(n for n in (6, 5, 4, 3, 2, 1) if count % n == 0 and (n < count or n == 1))


def platform_members(
    *, spike_length: float, count: int, diameter: float, clear: float, hull_radius: float = 0.0, width: float = 0.0
) -> list[Member]:
    """`count` rows of spikes that end `spike_length` [m] from the centre, and a hull that rolls inside the octagon.

    A spike is a rod of this `diameter` [m] with a ball at its end, `clear` [m] long. It lies in the plane of motion
    (the Hedgehog's own lean sideways by 21 degrees). The hull is a cylinder about the axis of rotation, `hull_radius`
    [m] thick and as wide as the bed, `width` [m]; 0: none. Rods go on into it, however long `clear` is, so that no
    grain gets between shaft and hull. Raises ValueError for a spike thicker than long.
    """
    radius = 0.5 * diameter
    if not 0 < diameter < clear <= spike_length:
        raise ValueError(
            f"spike_diameter = {diameter} m, spike_clear = {clear} m: it must be thinner than it is long, and no "
            f"longer than spike_length = {spike_length} m"
        )
    slots = slots_of(count)
    if slots < FEWEST_SLOTS:
        raise ValueError(f"spike_count = {count}: rows that share a body must be far apart: expected 6, 8 or 16")
    inner = row_tips(spike_length - radius, count)
    shaft = max(clear, spike_length - hull_radius + radius) if hull_radius > 0 else clear
    members = []
    for row, at in enumerate(inner):
        up = -at / np.linalg.norm(at)  # along the shaft, towards the centre
        angle = math.atan2(up[0], up[2])
        turn = np.array([math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0])
        members.append(Member(row=row, at=at, turn=turn, radius=radius, length=shaft - radius, slot=row % slots))
    if hull_radius > 0:
        half = math.sqrt(0.5)
        members.append(
            Member(
                row=HULL, at=np.zeros(3), turn=np.array([half, half, 0.0, 0.0]), radius=hull_radius,
                length=0.5 * width, below=0.5 * width, slot=slots,
            )
        )  # fmt: skip
    return members


def spatial_members(platform: Platform) -> list[Member]:
    """Each spike of `platform` by itself, where it is, and the ball inside its hull, about its centre of mass.

    A spike is a rod with a ball at its end, as thick as the platform says, that goes on into the hull. Of the hull
    grains meet the largest ball about the centre that fits into it, later than a face or a corner. Raises ValueError
    for a platform without spikes.
    """
    radius = platform.tip_radius
    if radius <= 0:
        raise ValueError(
            f"tip_radius of {platform.name} is 0: grains can touch a platform on spikes with round ends; give it some"
        )
    hull = platform.hull()
    corners = hull.vertices[hull.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    inside = float(np.abs((normals * corners[:, 0]).sum(axis=1)).min())
    members = []
    for row, tip in enumerate(platform.tips):
        reach = float(np.linalg.norm(tip))
        up = -tip / reach
        # The shortest turn from z to `up`.
        half = np.array([1.0 + up[2], -up[1], up[0], 0.0])
        turn = half / np.linalg.norm(half) if up[2] > -1 + 1e-9 else np.array([0.0, 1.0, 0.0, 0.0])
        at = tip * (1 - radius / reach) - platform.centre_of_mass
        length = max(reach - inside, radius)
        members.append(Member(row=row, at=at, turn=turn, radius=radius, length=length, slot=row))
    members.append(Member(row=HULL, at=-platform.centre_of_mass, turn=STILL, radius=inside, slot=len(members)))
    return members
