"""A DEM bed as a ground: one spike among the grains, stepped, saved and restored.

The spike's sections become the shapes that grains can touch; the bed does the rest.
"""

from __future__ import annotations

import math
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from rigid import Contact, Reaction, Section, Spike

__all__ = ["BedGround"]

OUT_OF_REACH = 100.0
"""How far above the surface a spike waits that is not in use [m]."""
_placed: WeakKeyDictionary[Any, dict[Spike, int]] = WeakKeyDictionary()
"""Bed -> spike -> number of its body."""


class BedGround:
    """`bed` as seen by `spike`, which it puts above the surface, free of contact.

    Parameters
    ----------
    bed : dem.Bed (or whatever has its interface).
    at : (x, y) of the spike's axis [m]; None: the middle of the bed.

    A spike that was in this bed before is taken up again, another one that is still in it is put out of reach. Raises
    ValueError where the bed is too narrow for the spike.
    """

    name = "bed"

    def __init__(self, bed: Any, spike: Spike, *, at: tuple[float, float] | None = None) -> None:
        self.bed, self.spike = bed, spike
        self.centre: tuple[float, float] = at if at is not None else (0.5 * bed.size[0], 0.5 * bed.size[1])
        if min(bed.size[0], bed.size[1]) < 2 * spike.diameter:
            raise ValueError(
                f"size of the bed is {tuple(bed.size)} m: a spike of diameter {spike.diameter} m needs at least "
                f"{2 * spike.diameter:.6g} m both ways"
            )
        self.surface = float(bed.surface)
        self.clearance = _clear_height(bed.grains(), spike, self.centre, bed.size, self.surface) - self.surface
        start = (*self.centre, self.surface + self.clearance)
        placed = _placed.setdefault(bed, {})
        for other, body in placed.items():
            if other != spike:
                bed.move_body(body, position=(*self.centre, self.surface + OUT_OF_REACH), velocity=(0.0, 0.0, 0.0))
        if spike in placed:
            bed.move_body(placed[spike], position=start, velocity=(0.0, 0.0, 0.0))
        else:
            placed[spike] = bed.add_body(
                [_shape(section) for section in spike.sections],
                position=start,
                friction=spike.friction,
                restitution=spike.restitution,
            )
        self.body = placed[spike]

    @property
    def time_step(self) -> float:
        """The bed's own step [s]."""
        return float(self.bed.time_step)

    @property
    def depth_limit(self) -> float:
        """How deep the tip may go [m]: half its diameter above the floor."""
        return self.surface - 0.5 * self.spike.diameter

    def describe(self) -> dict[str, Any]:
        """What it is, in plain numbers, for run.toml."""
        found: dict[str, Any] = {"material": getattr(getattr(self.bed, "material", None), "name", None)}
        for name in ("size", "grain_count", "packing_fraction", "gravity", "surface", "seed", "time_step", "precision"):
            value = getattr(self.bed, name, None)
            if value is not None:
                found[name] = value if isinstance(value, str) else np.asarray(value).tolist()
        recipe = getattr(self.bed, "recipe", {})
        found |= {name: recipe.get(name) for name in ("grain", "spread", "packing", "young", "max_overlap", "code")}
        return {name: value for name, value in found.items() if value is not None}

    def step(self, position: ArrayLike, velocity: ArrayLike, dt: float) -> Reaction:
        """Advance the grains by `dt` [s], a whole number of the bed's steps, under the moving spike.

        The pose is set at the start and the velocity held; the answer is the exact impulse over dt. Raises ValueError
        where dt is no multiple of the bed's step, and whatever the bed raises.
        """
        steps = round(dt / self.time_step)
        if steps < 1 or not math.isclose(steps * self.time_step, dt, rel_tol=1e-9):
            raise ValueError(f"dt is {dt} s: it must be a whole multiple of the bed's step, {self.time_step} s")
        at, rate = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
        self.bed.move_body(self.body, position=tuple(at), velocity=tuple(rate))
        self.bed.advance(steps)
        force, torque = (np.asarray(part, dtype=float) for part in self.bed.reaction(self.body))
        if not force.any():
            return Reaction(force, torque)
        along = np.array([force[0], force[1], 0.0])
        return Reaction(force, torque, (Contact(at, float(force[2]), tangential_force=along),))

    def state(self) -> dict[str, Any]:
        """The bed's state, which contains the body and its contact history."""
        return dict(self.bed.state())

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        self.bed.restore(state)


def _shape(section: Section) -> Any:
    """The grains' shape that is this section of the spike."""
    from dem.shapes import Ball, Cone, Cylinder

    if section.shape == "ball":
        return Ball(center=(0.0, 0.0, 0.5 * (section.bottom + section.top)), radius=section.top_radius)
    if section.shape == "cylinder":
        return Cylinder(bottom=section.bottom, top=section.top, radius=section.top_radius)
    return Cone(
        bottom=section.bottom,
        top=section.top,
        bottom_radius=section.bottom_radius,
        top_radius=section.top_radius,
    )


def _clear_height(
    grains: dict[str, Any], spike: Spike, centre: tuple[float, float], size: ArrayLike, surface: float
) -> float:
    """Lowest height of the tip [m] at which no grain touches the spike, never below the surface.

    A ball's distance is taken exactly; cones and flat ends as stacks of discs, which errs by a grain's radius at most,
    upwards. A hundredth of a grain is added, so that rounding makes no contact.
    """
    position, radius = np.asarray(grains["position"], dtype=float), np.asarray(grains["radius"], dtype=float)
    away = position[:, :2] - np.asarray(centre)
    width = np.asarray(size, dtype=float)[:2]
    away -= width * np.round(away / width)  # the bed is periodic
    distance = np.hypot(away[:, 0], away[:, 1])
    near = distance < 0.5 * spike.diameter + radius
    if not near.any():
        return surface
    distance, grain_radius, height = distance[near], radius[near], position[near, 2]
    heights = [surface]
    if spike.tip == "sphere":
        ball = 0.5 * spike.diameter
        heights.append(float(np.max(height + np.sqrt((ball + grain_radius) ** 2 - distance**2) - ball)))
    else:
        for level in np.linspace(0.0, max(spike.tip_height, 1e-12), 33):
            under = distance < spike.radius_at(float(level)) + grain_radius
            if under.any():
                heights.append(float(np.max(height[under] + grain_radius[under])) - float(level))
    return max(heights) + 0.01 * float(radius.mean())
