"""What the cases with bodies in prepared beds share: the beads, a ball let go, a body driven down, parts that are kept.

The ball is free: it moves in three directions and turns. One of its steps H is ten of the grains',
    u = v + (G + F_before) H / 2 m  held,  v' = v + (G + F) H / m,
F the mean force of the step, G its weight, and likewise its spin. Depth is counted from the undisturbed surface down
to the body's lowest point; the ball starts where it first touches a grain.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dem import Ball, Bed, Material
from dem.files.arrays import read_arrays
from dem.prepare.prepare import cache_folder, fingerprint

__all__ = ["BEADS", "SPREAD", "Drop", "drive_down", "drop", "first_touch", "part", "prepared"]

BEADS = Material("beads", 2580.0, 65e9, 0.2, 0.5, 0.6, 0.05)
"""Glass beads: 1.52 g/cm3 at a packing of 0.59, as Katsuragi & Durian 2007 have them. Friction 0.5 and rolling friction
0.05 are chosen for an internal friction near their tan 24 degrees; restitution 0.6 is a guess."""
SPREAD = 0.15
TOGETHER = 10  # steps of the grains for one of the body
STRUCK = 0.08  # overlap over diameter that is let pass where the ball strikes; the bed itself stays below 0.05


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


def first_touch(
    positions: np.ndarray, radii: np.ndarray, radius: float, at: Sequence[float] = (0.0, 0.0),
    period: Sequence[float] | None = None,
) -> float:  # fmt: skip
    """Height of the centre of a ball of this radius that comes down at (x, y) when it touches the first grain [m]."""
    away = positions[:, :2] - np.asarray(at)
    if period is not None:
        away -= np.asarray(period) * np.round(away / period)
    across, reach = np.hypot(*away.T), radius + radii
    under = across < reach
    return float((positions[under, 2] + np.sqrt(reach[under] ** 2 - across[under] ** 2)).max())


def drop(
    bed: Bed, *, radius: float, density: float, speed: float, at: Sequence[float], longest: float
) -> dict[str, np.ndarray]:
    """A ball let go with `speed` downwards at (x, y), until it stops for the first time. The bed is used up by it.

    Returns time since the first touch [s], depth [m], velocity [m/s], downwards, each of shape [n]; stopped: 0 where
    `longest` [s] was not enough.
    """
    mass = density * 4 / 3 * math.pi * radius**3
    inertia = 0.4 * mass * radius**2
    grains = bed.grains()
    height = first_touch(grains.position, grains.radius, radius, at, bed.size[:2]) + 1e-6 * radius
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
        if time > longest:
            break
    found = np.array(rows)
    return {
        "time": found[:, 0], "depth": found[:, 1], "velocity": found[:, 2], "stopped": np.array(velocity[2] >= 0),
    }  # fmt: skip


@dataclass(frozen=True)
class Drop:
    """A ball let go in a bed of beads of its own; SI units."""

    grain: float  # mean diameter
    ball: float  # diameter
    density: float  # of the ball
    size: tuple[float, float, float]  # of the bed
    gravity: float
    seed: int  # of the bed
    at: tuple[float, float]  # over the bed's sides
    speed: float  # downwards, on touching
    longest: float  # after which the ball is left
    stiffer: float = 1.0  # than the bed would be by itself

    def run(self) -> dict[str, np.ndarray]:
        """What `drop` gives, with the packing fraction and the count of the bed's grains; kept."""

        def compute() -> dict[str, np.ndarray]:
            bed = prepared(grain=self.grain, size=self.size, gravity=self.gravity, seed=self.seed, stiffer=self.stiffer)
            bed.overlap_limit = STRUCK
            at = (self.at[0] * self.size[0], self.at[1] * self.size[1])
            found = drop(bed, radius=self.ball / 2, density=self.density, speed=self.speed, at=at, longest=self.longest)
            return found | {"packing": np.array(bed.packing_fraction), "count": np.array(bed.grain_count)}

        return part("drop", vars(self), compute)


def drive_down(bed: Bed, shape: Any, *, at: Sequence[float], speed: float, depth: float) -> dict[str, np.ndarray]:
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
    return dict(zip(("depth", "force"), np.array(rows).T, strict=True))


def part(
    name: str, settings: Mapping[str, Any], compute: Callable[[], Mapping[str, ArrayLike]]
) -> dict[str, np.ndarray]:
    """What `compute` gives, arrays by name, or what it gave before for the same settings and code.

    A part of a long case is kept in the folder of the cache as it ends. So a case that was stopped continues with the
    missing parts. `settings`: what JSON takes; everything that the result depends on beside the code of the bed and of
    this file.
    """
    own = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    given = json.dumps({"bed": fingerprint(), "own": own, **settings}, sort_keys=True)
    path = cache_folder() / "validate" / f"{name}-{hashlib.sha256(given.encode()).hexdigest()[:24]}.npz"
    if path.exists():
        try:
            return read_arrays(path)
        except (OSError, ValueError):  # ended while it was written by other means; computed anew
            pass
    found = {key: np.asarray(value) for key, value in compute().items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part.npz")
    np.savez(unfinished, **found)  # type: ignore[arg-type]
    unfinished.replace(path)
    return found
