"""Friction under Coulomb bounds of a body in space, found so that it holds at the step's end.

Tips that stick share what holds them in proportion to their loads (docs/platform.md); see `coupling.spatial_body`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rigid.quaternions import from_turn, multiply, to_matrix
from rigid.reaction import Contact

from .poses import Twist, Vector, Wrench

if TYPE_CHECKING:
    from .spatial_body import SpatialBody

__all__ = ["SpatialFriction"]


class SpatialFriction:
    """The friction of tips under Coulomb bounds in one step."""

    def __init__(
        self, body: SpatialBody, dt: float, twist: Twist, wrench: Wrench, contacts: dict[int, Contact]
    ) -> None:
        self.dt, self.tips = dt, sorted(contacts)
        self.loads = np.array([contacts[tip].normal_force for tip in self.tips])
        self.mu_s = np.array([float(contacts[tip].mu_s or 0.0) for tip in self.tips])
        self.mu_d = np.array([float(contacts[tip].mu_d or 0.0) for tip in self.tips])
        centre = body.place + 0.5 * dt * twist.velocity
        self.arms = np.array([contacts[tip].point - centre for tip in self.tips])
        half = to_matrix(from_turn(0.5 * dt * twist.spin))
        self.arms_end = self.arms @ half.T
        turn = multiply(from_turn(dt * twist.spin), body.turn)
        matrix = to_matrix(turn)
        self.masses, self.inverse = body._masses, matrix @ np.linalg.inv(body._inertia) @ matrix.T
        slowed = 1 + dt * body._drag / np.array([body._masses[0], body._inertia[0, 0]])
        momentum = (body.momentum + dt * (body.trial.weight + wrench.force)) / slowed[0]
        wheels = matrix @ (body.axes.T @ (body.wheels - dt * body._torques))
        self.velocity = momentum / self.masses
        """After the step without friction; likewise:"""
        self.spin = self.inverse @ (body.angular_momentum + dt * wrench.torque - wheels) / slowed[1]
        self.masses, self.inverse = self.masses * slowed[0], self.inverse / slowed[1]
        before = body.twist
        slips = (before.velocity + np.cross(before.spin, self.arms))[:, :2]
        self.sticking = {tip for tip in self.tips if tip in body.sticking}
        self.sliding: dict[int, Vector] = {}
        for k, tip in enumerate(self.tips):
            size = float(np.linalg.norm(slips[k]))
            if tip in self.sticking:
                continue
            if tip in body.sliding and float(slips[k] @ body.sliding[tip]) <= 0:
                self.sticking.add(tip)  # it has turned back, and sticks where its bound allows it
            elif size > 0:
                self.sliding[tip] = slips[k] / size
            else:
                self.sticking.add(tip)

    def solve(self) -> tuple[Vector, Vector]:
        """Force [N] and torque [N m] of friction; who slides and who sticks is in `sliding` and `sticking` then."""
        for _ in range(6 * len(self.tips) + 6):
            force = self._with()
            over = [
                k for k, tip in enumerate(self.tips)
                if tip in self.sticking and math.hypot(*force[k]) > self.mu_s[k] * self.loads[k] * (1 + 1e-12)
            ]  # fmt: skip
            slips = self._slips(force)
            back = [k for k, tip in enumerate(self.tips) if tip in self.sliding and slips[k] @ self.sliding[tip] < 0]
            if not over and not back:
                break
            for k in over:
                self.sticking.discard(self.tips[k])
                self.sliding[self.tips[k]] = -force[k] / math.hypot(*force[k])
            for k in back:
                del self.sliding[self.tips[k]]
                self.sticking.add(self.tips[k])
        pushes = np.column_stack([force, np.zeros(len(force))])
        return pushes.sum(axis=0), np.cross(self.arms, pushes).sum(axis=0)

    def _slips(self, force: Vector) -> Vector:
        """Horizontal velocity of each tip at the step's end [m/s], shape [tip, 2]."""
        pushes = np.column_stack([force, np.zeros(len(force))])
        velocity = self.velocity + self.dt * pushes.sum(axis=0) / self.masses
        spin = self.spin + self.dt * self.inverse @ np.cross(self.arms, pushes).sum(axis=0)
        return np.asarray((velocity + np.cross(spin, self.arms_end))[:, :2])

    def _with(self) -> Vector:
        """Friction of each tip in these modes [N], shape [tip, 2]."""
        force = np.zeros((len(self.tips), 2))
        for k, tip in enumerate(self.tips):
            if tip in self.sliding:
                force[k] = -self.mu_d[k] * self.loads[k] * self.sliding[tip]
        held = [k for k, tip in enumerate(self.tips) if tip in self.sticking]
        if not held:
            return force
        loads = self.loads[held]
        share = loads / loads.sum() if loads.sum() > 0 else np.full(len(held), 1 / len(held))
        shapes = self._shapes(held, share)
        free = self._held_slip(self._slips(force), held, share)
        answers = np.array(
            [self._held_slip(self._slips(force + shape) - self._slips(force), held, share) for shape in shapes]
        )
        # Tips in a line leave a turn about it open: the smallest solution.
        scale = np.sqrt(np.maximum(np.abs(np.diag(answers)), 1e-300))
        size = np.linalg.lstsq(answers.T / np.outer(scale, scale), -free / scale, rcond=1e-10)[0] / scale
        return force + np.tensordot(size, shapes, axes=1)

    def _shapes(self, held: list[int], share: Vector) -> Vector:
        """Forces of one unit of each multiplier, shape [2 or 3, tip, 2]."""
        shapes = np.zeros((2 if len(held) == 1 else 3, len(self.tips), 2))
        shapes[0, held, 0] = shapes[1, held, 1] = share
        if len(held) > 1:
            away = self.arms[held] - share @ self.arms[held]
            shapes[2, held] = share[:, None] * np.column_stack([-away[:, 1], away[:, 0]])
        return shapes

    def _held_slip(self, slips: Vector, held: list[int], share: Vector) -> Vector:
        """Mean slip of those that stick, and their turning about the vertical, shape [2 or 3]."""
        mean = share @ slips[held]
        if len(held) == 1:
            return np.asarray(mean)
        away = self.arms_end[held] - share @ self.arms_end[held]
        turning = share @ (away[:, 0] * slips[held, 1] - away[:, 1] * slips[held, 0])
        return np.array([*mean, turning])
