"""Whether the exchange of forces between a robot and its ground is stable: `check_exchange`.

In an explicit exchange every H a foot of the effective mass m = 1 / (J M^-1 J^T), along z, on contacts of the stiffness
K and the damping C is stable while K H^2 / 4 m + C H / m < 1 (docs/coupling.md; the damping acts one step late). Of a
part that stands on several points 1 / m is their mean, which bounds the fastest of its vibrations. The iterated
exchange settles up to some ten times that (`ITERATED`).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .bed_feet import BedFeet
from .law_feet import LawFeet

__all__ = ["ITERATED", "Load", "check_exchange", "exchange_loads", "plan_area"]

ITERATED = 10.0
"""Load up to which the iterated exchange settles: K H^2 / m = 40 is the largest that did (docs/coupling.md)."""
SPEED = 0.5  # At which the damping of a law is taken [m/s]
COVER = 0.8  # Share of a plate's area under which one layer of grains lies [1]


@dataclass(frozen=True)
class Load:
    """How much the explicit exchange asks of one foot: it is stable up to 1."""

    foot: str
    part: str
    mass: float  # Effective, along z [kg]
    stiffness: float  # Of the contacts under it [N/m]
    damping: float  # [N s/m]

    def at(self, macro_step: float) -> float:
        """K H^2 / 4 m + C H / m [1]."""
        return (0.25 * self.stiffness * macro_step**2 + self.damping * macro_step) / self.mass

    def longest(self) -> float:
        """The macro step at which it is 1 [s]."""
        a, b = 0.25 * self.stiffness, self.damping
        return 2 * self.mass / (b + math.sqrt(b * b + 4 * a * self.mass))


def exchange_loads(robot: Any, ground: LawFeet | BedFeet) -> list[Load]:
    """Of every part of every foot, where the robot is now."""
    loads = []
    weight = robot.mass * max(robot.gravity, 1e-3)
    for k, foot in enumerate(robot.feet):
        linear, angular = robot.jacobian(foot.body)
        matrix = robot.data.xmat[foot.body].reshape(3, 3)
        first = 0
        for part in foot.parts:
            points = part.centres if isinstance(ground, LawFeet) else part.vertices[:: max(1, len(part.vertices) // 16)]
            arms = points @ matrix.T
            rows = linear[2] + np.cross(arms, [0.0, 0.0, 1.0]) @ angular
            softest = float((rows * robot.solve(rows)).sum(axis=1).mean())
            if isinstance(ground, LawFeet):
                law = ground.grounds[k][first]
                first += len(part.centres)
                stiffness, damping = _of_law(law, weight * part.share)
                stiffness, damping = stiffness / part.share, damping / part.share
            else:
                stiffness, damping = _of_bed(ground.bed, plan_area(part.vertices @ matrix.T)), 0.0
            loads.append(Load(foot.name, part.name, 1 / max(softest, 1e-300), stiffness, damping))
    return loads


def _of_law(law: Any, load: float) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] of a law where it carries `load` [N], or at 0.1 m if it never does."""
    depth = 1e-7
    while float(law.force(depth, 0.0)) < load and depth < 0.1:
        depth *= 1.5
    step, rate = 1e-4 * depth, 1e-4 * SPEED
    stiffness = float(law.force(depth + step, 0.0) - law.force(depth, 0.0)) / step
    return stiffness, float(law.force(depth, SPEED + rate) - law.force(depth, SPEED)) / rate


def _of_bed(bed: Any, area: float) -> float:
    """Stiffness of the grains under a plate of this area [N/m], each at half the overlap that the bed is made for.

    Of a contact with the effective radius of a grain R on a plane it is 2 E* a, a = sqrt(R d) (Hertz).
    """
    radius = float(np.mean(bed.grains(contacts=False).radius))
    overlap = 0.5 * float(bed.overlap_limit) * 2 * radius
    material = bed.material
    pair = material.young / (1 - material.poisson**2)  # a rigid foot
    each = 2 * pair * math.sqrt(radius * overlap)
    return max(1.0, COVER * area / (math.pi * radius**2)) * each


def plan_area(vertices: Any) -> float:
    """Area of a part seen from above [m2]; 0 of a point."""
    from scipy.spatial import ConvexHull, QhullError

    if len(vertices) < 3:
        return 0.0
    try:
        return float(ConvexHull(vertices[:, :2]).volume)
    except QhullError:
        return 0.0


def check_exchange(robot: Any, ground: LawFeet | BedFeet, *, substeps: int, iterations: int = 1) -> float:
    """The largest load of any foot over what is stable [1], with `substeps` of the ground in a macro step.

    Raises ValueError, naming the foot, where it is above 1, or with `iterations` above 1 above `ITERATED`.
    """
    step = substeps * ground.time_step
    worst = max(exchange_loads(robot, ground), key=lambda load: load.at(step))
    found, most = worst.at(step), 1.0 if iterations == 1 else ITERATED
    if found > most:
        fits = int(worst.longest() / ground.time_step)
        remedies = [f"substeps = {fits}"] if fits >= 1 else ["a smaller time step of the ground"]
        if iterations == 1 and found <= ITERATED:
            remedies.append("iterations = 20")
        remedies.append("a heavier foot (or joint armature)")
        raise ValueError(
            f"feet: {worst.part!r} is too light for this ground: its effective mass of {worst.mass:.3g} kg on contacts "
            f"of {worst.stiffness:.3g} N/m and {worst.damping:.3g} N s/m is unstable with substeps = {substeps}, an "
            f"exchange every {1e6 * step:.4g} us ({found:.3g} times what is stable"
            f"{'' if iterations == 1 else ' explicitly'}); "
            f"{', or '.join(remedies)} would do"
        )
    return found
