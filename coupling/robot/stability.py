"""Whether the exchange of forces between a robot and its ground is stable: `check_exchange`.

The points on which all feet stand at once have the vertical Jacobian J, the stiffnesses K and the dampings C. An
explicit exchange every H is stable while L(K) H^2 / 4 + L(C) H < 1 (docs/coupling.md; the damping acts one step late).
L(D) is the largest eigenvalue of D J M^-1 J^T. It is K / m and C / m for one foot with the effective mass m along z.
The iterated exchange settles up to some ten times that (`ITERATED`).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupling.poses import Vector

from .bed_feet import BedFeet
from .law_feet import LawFeet
from .soles import plan_area

__all__ = ["ITERATED", "ExchangeLoad", "ExpectedBed", "Load", "check_exchange"]

ITERATED = 10.0
"""Load up to which the iterated exchange settles: K H^2 / m = 40 is the largest that did (docs/coupling.md)."""
SPEED = 0.5  # At which the damping of a law is taken [m/s]
COVER = 0.8  # Share of a plate's area under which one layer of grains lies [1]
TOGETHER = 0.5  # A part stands if it is that near to the lowest point of its foot, over the foot's reach [1]
SAMPLED = 16  # Vertices of a part that stand for its surface among grains


@dataclass(frozen=True)
class Load:
    """How much the explicit exchange asks of the feet: it is stable up to 1."""

    foot: str  # The one that moves most in the fastest vibration
    mass: float  # Effective, along z, of that vibration [kg]
    stiffness: float  # Of the contacts under that foot [N/m]
    damping: float  # [N s/m]

    def at(self, macro_step: float) -> float:
        """K H^2 / 4 m + C H / m [1]."""
        return (0.25 * self.stiffness * macro_step**2 + self.damping * macro_step) / self.mass

    def longest(self) -> float:
        """The macro step at which it is 1 [s]."""
        a, b = 0.25 * self.stiffness, self.damping
        return 2 * self.mass / (b + math.sqrt(b * b + 4 * a * self.mass))

    def growth(self, macro_step: float, duration: float) -> float:
        """Times that a swing on the contacts grows in `duration` [s] by explicit exchanges [1]; below 1 it dies out.

        The feet stay in the ground: an upper bound for feet that leave it. As in the spring-damper, the damping acts
        in half of a swing: while the foot sinks.
        """
        k, c = self.stiffness * macro_step**2 / self.mass, self.damping * macro_step / self.mass
        rate = 0.5 * (math.log(_amplified(k, c)) + math.log(_amplified(k, 0.0)))
        return math.exp(min(rate * duration / macro_step, 500.0))


@dataclass(frozen=True)
class ExpectedBed:
    """Numbers that the exchange with a bed depends on and that are known before the bed is made."""

    radius: float  # of a grain, mean [m]
    overlap_limit: float  # [of a diameter]
    material: Any  # dem.Material, softened
    time_step: float  # [s]
    repeatable: bool = True  # Whether its steps can be taken back, for an iterated exchange


class ExchangeLoad:
    """The `Load` of `robot` on `ground`, wherever the robot is."""

    def __init__(self, robot: Any, ground: LawFeet | BedFeet | ExpectedBed) -> None:
        self.robot, self.ground = robot, ground
        self._laws: list[list[tuple[float, float]]] = []
        self._grain = 0.0, 0.0  # Radius [m], stiffness of its contact [N/m]
        if isinstance(ground, BedFeet):
            bed = ground.bed
            radius = float(np.mean(bed.grains(contacts=False).radius))
            ground = ExpectedBed(radius, float(bed.overlap_limit), bed.material, float(bed.time_step))
        if isinstance(ground, ExpectedBed):
            self._grain = ground.radius, _of_grain(ground)
            return
        weight = robot.mass * max(robot.gravity, 1e-3)
        for foot, laws in zip(robot.feet, ground.grounds, strict=True):
            firsts = np.cumsum([0, *(len(part.centres) for part in foot.parts[:-1])])
            self._laws.append([_of_law(laws[j], weight * p.share) for j, p in zip(firsts, foot.parts, strict=True)])

    def now(self) -> Load:
        """Of all points on which the feet can stand at once, in the robot's present posture."""
        robot = self.robot
        arms, stiffness, damping, owners = self._points()
        rows = np.zeros((len(owners), robot.model.nv))
        for k, foot in enumerate(robot.feet):
            linear, angular = robot.jacobian(foot.body)
            rows[owners == k] = linear[2] + np.cross(arms[owners == k], [0.0, 0.0, 1.0]) @ angular
        softness = rows @ robot.solve(rows).T
        by_stiffness, shares = _largest(softness, stiffness)
        by_damping, others = _largest(softness, damping)
        size = shares if by_stiffness > 0 else others
        worst = int(np.argmax(np.bincount(owners, weights=size, minlength=len(robot.feet))))
        own = owners == worst
        if by_stiffness > 0:
            mass = float(stiffness[own].sum()) / by_stiffness
        else:
            mass = float(damping[own].sum()) / by_damping if by_damping > 0 else 1.0  # 1: whatever it is
        return Load(robot.feet[worst].name, mass, by_stiffness * mass, by_damping * mass)

    def _points(self) -> tuple[Vector, Vector, Vector, NDArray[np.intp]]:
        """Arms about the origins of the feet [m], stiffness [N/m], damping [N s/m] and foot of each point."""
        found: list[tuple[Vector, float, float, int]] = []
        for k, foot in enumerate(self.robot.feet):
            matrix = self.robot.data.xmat[foot.body].reshape(3, 3)
            parts = self._on_law(k, foot, matrix) if self._laws else self._on_grains(foot, matrix)
            bottom = min(float(arms[:, 2].min()) for arms, *_ in parts)
            for arms, stiffness, damping in parts:
                if float(arms[:, 2].min()) <= bottom + TOGETHER * foot.reach:
                    found += [(arm, stiffness, damping, k) for arm in arms]
        at, strengths, dampings, owners = zip(*found, strict=True)
        return np.array(at), np.maximum(strengths, 0.0), np.maximum(dampings, 0.0), np.array(owners, dtype=np.intp)

    def _on_law(self, k: int, foot: Any, matrix: Vector) -> list[tuple[Vector, float, float]]:
        """Of each part: the arms of the points on which it stands, stiffness and damping of one point."""
        every = np.split(foot.lowest(matrix), np.cumsum([len(part.centres) for part in foot.parts])[:-1])
        return [
            (arms[np.argsort(arms[:, 2], kind="stable")[: round(1 / part.share)]], *law)
            for part, arms, law in zip(foot.parts, every, self._laws[k], strict=True)
        ]

    def _on_grains(self, foot: Any, matrix: Vector) -> list[tuple[Vector, float, float]]:
        """Likewise, of some vertices of each part."""
        (radius, each), parts = self._grain, []
        for part in foot.parts:
            turned = part.vertices @ matrix.T
            arms = turned[:: max(1, len(turned) // SAMPLED)]
            grains = max(1.0, COVER * plan_area(turned) / (math.pi * radius**2))
            parts.append((arms, grains * each / len(arms), 0.0))
        return parts


def _largest(softness: Vector, strengths: Vector) -> tuple[float, Vector]:
    """Largest eigenvalue of diag(strengths) times softness, and the share of each point in its vibration [1]."""
    roots = np.sqrt(strengths)
    values, vectors = np.linalg.eigh(roots[:, None] * (0.5 * (softness + softness.T)) * roots)
    return max(0.0, float(values[-1])), np.asarray(vectors[:, -1] ** 2)


def _amplified(k: float, c: float) -> float:
    """Factor by which one explicit exchange multiplies a swing: the spectral radius of the step of docs/coupling.md.

    ``k``: K H^2 / m; ``c``: C H / m. The state is q / H, the rate v, and the last force, over m / H.
    """
    place, rate, last = np.eye(3)
    held = rate + 0.5 * last
    force = -k * (place + 0.5 * held) - c * held  # The law's mean over the held path
    return float(np.abs(np.linalg.eigvals(np.array([place + held, rate + force, force]))).max())


def _of_law(law: Any, load: float) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] of a law where it carries `load` [N], or at 0.1 m if it never does."""
    depth = 1e-7
    while float(law.force(depth, 0.0)) < load and depth < 0.1:
        depth *= 1.5
    step, rate = 1e-4 * depth, 1e-4 * SPEED
    stiffness = float(law.force(depth + step, 0.0) - law.force(depth, 0.0)) / step
    damping = float(law.force(depth, SPEED + rate) - law.force(depth, SPEED)) / rate
    return stiffness, max(damping, law.retreat_damping * float(law.force(depth, 0.0)))


def _of_grain(bed: ExpectedBed) -> float:
    """Stiffness of the contact of a grain with a foot [N/m].

    The contact is at half the overlap d that the bed is made for. With the effective radius R of a grain on a plane its
    stiffness is 2 E* a, a = sqrt(R d) (Hertz).
    """
    overlap = 0.5 * bed.overlap_limit * 2 * bed.radius
    pair = bed.material.young / (1 - bed.material.poisson**2)  # a rigid foot
    return float(2 * pair * math.sqrt(bed.radius * overlap))


def check_exchange(robot: Any, ground: LawFeet | BedFeet | ExpectedBed, *, substeps: int, iterations: int = 1) -> float:
    """The load of the robot where it is now over what is stable [1], with `substeps` of the ground in a macro step.

    Raises ValueError, naming the foot, where it is above 1, or with `iterations` above 1 above `ITERATED`.
    """
    step = substeps * ground.time_step
    worst = ExchangeLoad(robot, ground).now()
    found, most = worst.at(step), 1.0 if iterations == 1 else ITERATED
    if found > most:
        fits = int(worst.longest() / ground.time_step)
        remedies = [f"substeps = {fits}"] if fits >= 1 else ["a smaller time step of the ground"]
        if ground.repeatable and iterations == 1 and found <= ITERATED:
            remedies.append("iterations = 20")
        remedies.append("a heavier foot (or joint armature)")
        raise ValueError(
            f"feet: {worst.foot!r} is too light for this ground: its effective mass of {worst.mass:.3g} kg on contacts "
            f"of {worst.stiffness:.3g} N/m and {worst.damping:.3g} N s/m is unstable with substeps = {substeps}, an "
            f"exchange every {1e6 * step:.4g} us ({found:.3g} times what is stable"
            f"{'' if iterations == 1 else ' explicitly'}); "
            f"use {', or '.join(remedies)}"
        )
    return found
