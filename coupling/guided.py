"""A spike that is moved along straight legs through a ground: down, up and sideways, each at a constant velocity."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid.checks import check_above_zero
from rigid.platform.spike import Spike

from .bed_ground import BedGround, GrainBed
from .ground import Ground
from .penetration import SUBSTEPS

__all__ = ["Leg", "guide"]


@dataclass(frozen=True)
class Leg:
    """One leg of the way: `down` (negative: up) and `along` x [m], at `speed` [m/s]."""

    speed: float
    down: float = 0.0
    along: float = 0.0

    @property
    def length(self) -> float:
        """[m]"""
        return math.hypot(self.down, self.along)


def guide(
    spike: Spike,
    ground: Any,
    legs: Sequence[Leg],
    *,
    substeps: int = SUBSTEPS,
    on_step: Callable[[float], None] | None = None,
) -> dict[str, NDArray[np.float64]]:
    """Move `spike` along `legs` from the surface of `ground` (or a bed), and return a row for each macro step.

    Columns, shape [row_count]: "leg" (number of the leg), "t_s", "depth_m", "along_m" (at the middle of the step),
    "velocity_m_s" (positive downwards), "force_N" (upwards) and "side_force_N" (against the motion along x). Both
    forces are means of the step. The spike comes from just clear of the grains at the speed of the first leg; those
    rows are left out. The last step of each leg ends where the leg ends. `on_step` is called with the share that is
    done [1].

    Raises ValueError for a leg without length or speed, and for a depth below what the ground allows.
    """
    on: Ground = BedGround(ground, spike) if isinstance(ground, GrainBed) else ground
    for leg in legs:
        check_above_zero(speed=leg.speed, length=leg.length)
    deepest = max(np.cumsum([leg.down for leg in legs]))
    if deepest > on.depth_limit:
        raise ValueError(f"depth = {deepest:g} m: this ground takes the spike down to {on.depth_limit:.4g} m at most")
    step = substeps * on.time_step
    approach = math.ceil(max(on.clearance, 0.0) / (legs[0].speed * step) - 1e-9)
    depth, along, time = -approach * legs[0].speed * step, 0.0, -approach * step
    for _ in range(approach):
        on.step((on.centre[0], on.centre[1], on.surface - depth), (0.0, 0.0, -legs[0].speed), step)
        depth, time = depth + legs[0].speed * step, time + step
    counts = [max(1, math.ceil(leg.length / (leg.speed * step) - 1e-9)) for leg in legs]
    rows: list[tuple[float, ...]] = []
    for number, (leg, count) in enumerate(zip(legs, counts, strict=True)):
        down, sideways = leg.down / (count * step), leg.along / (count * step)
        for _ in range(count):
            at = (on.centre[0] + along, on.centre[1], on.surface - depth)
            force = on.step(at, (sideways, 0.0, -down), step).force
            middle = (time + 0.5 * step, depth + 0.5 * down * step, along + 0.5 * sideways * step)
            rows.append((number, *middle, down, float(force[2]), -float(force[0])))
            depth, along, time = depth + down * step, along + sideways * step, time + step
            if on_step is not None:
                on_step(len(rows) / sum(counts))
    names = ("leg", "t_s", "depth_m", "along_m", "velocity_m_s", "force_N", "side_force_N")
    return dict(zip(names, np.array(rows).T.copy(), strict=True))
