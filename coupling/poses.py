"""Where a rigid body is and how it moves, in space: what passes between a body and what it stands on.

World axes with z up; a turn is a unit quaternion, scalar first, that takes body axes to world axes. A planar body turns
about y alone.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigid.ground.reaction import Reaction, Vector
from rigid.spatial.quaternions import from_turn, multiply, to_matrix

__all__ = ["Pose", "Twist", "Vector", "Wrench", "chord_share", "matrices", "moved"]


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a body is."""

    position: Vector  # Of its origin [m], shape (3,); z counted from the undisturbed surface
    turn: Vector  # Unit quaternion, shape (4,)

    @classmethod
    def of(cls, position: ArrayLike, turn: ArrayLike | None) -> "Pose":
        """At `position` [m]; None: not turned."""
        return cls(np.asarray(position, dtype=float), np.asarray((1.0, 0, 0, 0) if turn is None else turn, dtype=float))


@dataclass(frozen=True, slots=True)
class Twist:
    """How it moves: held over a macro step."""

    velocity: Vector  # Of its origin [m/s], shape (3,)
    spin: Vector  # [rad/s], shape (3,)

    @classmethod
    def of(cls, velocity: ArrayLike, spin: ArrayLike | None) -> "Twist":
        """At `velocity` [m/s]; None: not turning."""
        return cls(np.asarray(velocity, dtype=float), np.zeros(3) if spin is None else np.asarray(spin, dtype=float))


@dataclass(frozen=True, slots=True)
class Wrench:
    """Force on a body and torque about its origin, means over a macro step: times dt the exact impulses."""

    force: Vector  # [N], shape (3,)
    torque: Vector  # [N m], shape (3,)

    @classmethod
    def of(cls, reaction: Reaction) -> "Wrench":
        """What the ground stated."""
        return cls(reaction.force, reaction.torque)

    @classmethod
    def none(cls, size: int = 3) -> "Wrench":
        """No force; `size` numbers of several bodies in one."""
        return cls(np.zeros(size), np.zeros(size))

    def power(self, twist: Twist) -> float:
        """Its power on a body that moves so [W]."""
        return float(self.force @ twist.velocity + self.torque @ twist.spin)


def moved(pose: Pose, twist: Twist, dt: float) -> Pose:
    """The pose `dt` [s] later at a constant velocity and spin."""
    turn = multiply(from_turn(twist.spin * dt), pose.turn)
    return Pose(pose.position + twist.velocity * dt, turn / math.sqrt(float(turn @ turn)))


def chord_share(twist: Twist, dt: float) -> float:
    """sin(phi / 2) / (phi / 2), phi the angle turned in `dt` [1].

    A point with the arm r_m at the step's middle goes along a chord at u + w x r_m times this. Forces on it are taken
    with the arm r_m times this. As force and torque about the origin they then have exactly the power that they have on
    the point.
    """
    half = 0.5 * dt * math.sqrt(float(twist.spin @ twist.spin))
    return math.sin(half) / half if half > 1e-8 else 1.0


def matrices(pose: Pose, twist: Twist, dt: float) -> tuple[Vector, Vector, Vector]:
    """Rotation matrices of the body at the start, the middle and the end of a step, each of shape (3, 3)."""
    start = to_matrix(pose.turn)
    half = to_matrix(from_turn(0.5 * dt * twist.spin))
    middle = half @ start
    return start, middle, half @ middle
