"""What the cases with bodies in prepared beds share: the beads, a ball let go, a body driven down.

The ball is free: it moves in three directions and turns. One of its steps H is ten of the grains',
    u = v + (G + F_before) H / 2 m  held,  v' = v + (G + F) H / m,
F the mean force of the step, G its weight, and likewise its spin. Depth is counted from the undisturbed surface down
to the body's lowest point; the ball starts where it first touches a grain.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dem import Ball, Bed, Material

from .case import Tell

__all__ = ["BEADS", "SPREAD", "drive_down", "drop", "first_touch", "prepared"]

BEADS = Material("beads", 2580.0, 65e9, 0.2, 0.5, 0.6, 0.05)
"""Glass beads: 1.52 g/cm3 at a packing of 0.59, as Katsuragi & Durian 2007 have them. Friction 0.5 and rolling friction
0.05 are chosen for an internal friction near their tan 24 degrees; restitution 0.6 is a guess."""
SPREAD = 0.15
TOGETHER = 10
"""Steps of the grains for one of the body."""


def prepared(*, grain: float, size: Sequence[float], gravity: float, seed: int, stiffer: float = 1.0) -> Bed:
    """A bed of beads as rained, from the cache where it is there; ``stiffer``: than it would be by itself."""
    from dem.grains.sizes import Uniform
    from dem.prepare.prepare import soft_enough

    bound = 0.05
    young = soft_enough(BEADS, size=size, sizes=Uniform(grain, SPREAD), gravity=gravity, max_overlap=bound)
    return Bed.prepare(
        BEADS, size=tuple(size), grain=grain, spread=SPREAD, gravity=gravity, seed=seed, young=stiffer * young,
        max_overlap=bound,
    )  # fmt: skip


def first_touch(bed: Bed, radius: float, at: Sequence[float]) -> float:
    """Height of the centre of a ball that comes down at (x, y) when it touches the first grain [m]."""
    grains = bed.grains()
    period = np.array(bed.size[:2])
    away = grains.position[:, :2] - np.asarray(at)
    away -= period * np.round(away / period)
    across, reach = np.hypot(*away.T), radius + grains.radius
    under = across < reach
    return float((grains.position[under, 2] + np.sqrt(reach[under] ** 2 - across[under] ** 2)).max())


def drop(
    bed: Bed,
    *,
    radius: float,
    density: float,
    speed: float,
    at: Sequence[float],
    longest: float,
    tell: Tell = lambda share: None,
) -> dict[str, np.ndarray]:
    """A ball let go with `speed` downwards at (x, y), until it stops for the first time. The bed is used up by it.

    Returns time since the first touch [s], depth [m], velocity [m/s], downwards, each of shape [n]; stopped: 0 where
    `longest` [s] was not enough.
    """
    mass = density * 4 / 3 * math.pi * radius**3
    inertia = 0.4 * mass * radius**2
    height = first_touch(bed, radius, at) + 1e-6 * radius
    ball = bed.add_body([Ball(radius=radius)], position=(*at, height))
    weight = mass * np.array(bed.gravity)
    step = TOGETHER * bed.time_step
    velocity, spin = np.array([0.0, 0.0, -speed]), np.zeros(3)
    force, torque = np.zeros(3), np.zeros(3)
    surface = bed.surface
    rows = [(0.0, surface - (height - radius), speed)]
    moved = False
    while not moved or velocity[2] < 0:
        held = velocity + 0.5 * step * (weight + force) / mass
        bed.move_body(ball, velocity=held.tolist(), spin=(spin + 0.5 * step * torque / inertia).tolist())
        bed.advance(TOGETHER)
        force, torque = bed.reaction(ball)
        velocity = velocity + step * (weight + force) / mass
        spin = spin + step * torque / inertia
        moved = moved or velocity[2] < 0
        time = len(rows) * step
        rows.append((time, surface - (float(bed.body_position(ball)[2]) - radius), -float(velocity[2])))
        tell(min(1.0, time / longest))
        if time > longest:
            break
    found = np.array(rows)
    return {
        "time": found[:, 0], "depth": found[:, 1], "velocity": found[:, 2], "stopped": np.array(velocity[2] >= 0),
    }  # fmt: skip


def drive_down(
    bed: Bed, shape: Any, *, at: Sequence[float], speed: float, depth: float, tell: Tell = lambda share: None
) -> dict[str, np.ndarray]:
    """A body whose lowest point is its origin, driven down at (x, y). The bed is used up by it.

    Returns: depth [m] of the lowest point in the middle of each step, mean force upwards over it [N], shape [n].
    """
    grains = bed.grains()
    top = float((grains.position[:, 2] + grains.radius).max())
    body = bed.add_body(shape, position=(*at, top + 1e-6))
    bed.move_body(body, velocity=(0.0, 0.0, -speed))
    step = TOGETHER * bed.time_step * speed
    rows = []
    while (deep := bed.surface - float(bed.body_position(body)[2])) < depth:
        bed.advance(TOGETHER)
        rows.append((deep + 0.5 * step, float(bed.reaction(body)[0][2])))
        tell(min(1.0, max(0.0, deep / depth)))
    return dict(zip(("depth", "force"), np.array(rows).T, strict=True))
