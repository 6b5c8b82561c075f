"""Friction of the points of feet under Coulomb bounds in one step: who sticks, who slides, and the forces.

As in `coupling.spatial_body`, for several feet that the robot's joints connect: the sticking points of each foot have
f_k = N_k (c + b z x (rho_k - mean rho)). Their mean slip and turning about the vertical are zero at the step's end.
"""

from typing import Any

import numpy as np

from coupling.contact_state import StickSlip
from coupling.poses import Twist, Vector
from rigid.ground.reaction import Contact
from rigid.spatial.quaternions import from_turn, to_matrix

__all__ = ["FeetFriction"]

FIXED = 1e-9  # Mobility over that of the most mobile direction below which the robot cannot move that way [1]


class FeetFriction(StickSlip):
    """Friction of `contacts` on the feet of `robot` in a step of `dt` [s].

    ``twist``: of the feet in the step; ``free``: generalised velocities at its end without friction, shape (nv,).
    """

    def __init__(self, robot: Any, dt: float, twist: Twist, free: Vector, contacts: list[Contact]) -> None:
        super().__init__(contacts)
        self.feet = [int(robot.owners[point]) for point in self.points]
        velocities, spins = twist.velocity.reshape(-1, 3), twist.spin.reshape(-1, 3)
        places = robot.pose.position.reshape(-1, 3)
        count = len(places)
        jacobians = {foot: robot.jacobian(robot.feet[foot].body) for foot in set(self.feet)}
        rows, pushes, before = [], [], []
        start = robot.twist
        now, turning = start.velocity.reshape(-1, 3), start.spin.reshape(-1, 3)
        self.arms, self.arms_end = np.zeros((len(contacts), 3)), np.zeros((len(contacts), 3))
        for k, (foot, contact) in enumerate(zip(self.feet, contacts, strict=True)):
            arm = contact.point - (places[foot] + 0.5 * dt * velocities[foot])
            end = to_matrix(from_turn(0.5 * dt * spins[foot])) @ arm
            linear, angular = jacobians[foot]
            rows.append((linear - _crossing(end) @ angular)[:2])
            pushes.append((linear - _crossing(arm) @ angular)[:2])
            before.append((now[foot] - _crossing(arm) @ turning[foot])[:2])
            self.arms[k], self.arms_end[k] = arm, end
        self.count = count
        slips = np.concatenate(rows)  # of generalised velocities, shape (2 point, nv)
        self.free = slips @ free
        self.answer = dt * (slips @ robot.solve(np.concatenate(pushes)).T)  # slips of forces, shape (2 point, 2 point)
        self.begin(np.array(before), robot.sticking, robot.sliding)

    def solve(self) -> Vector:
        """Wrenches of friction on the feet [N, N m], shape (foot, 6)."""
        force = self.settle()
        rows = np.zeros((self.count, 6))
        for foot, (x, y, z), (along, across) in zip(self.feet, self.arms, force, strict=True):
            rows[foot] += (along, across, 0.0, -z * across, z * along, x * across - y * along)
        return rows

    def _slips(self, force: Vector) -> Vector:
        """Horizontal velocity of each point at the step's end [m/s], shape (point, 2)."""
        return np.asarray((self.free + self.answer @ force.ravel()).reshape(-1, 2))

    def _held(self, force: Vector) -> Vector:
        """See `StickSlip`: of each foot the mean slip of those that stick, and their turning, become zero."""
        shapes, means = self._shapes()
        if not len(shapes):
            return force
        free = means @ self._slips(force).ravel()
        answers = means @ self.answer @ shapes.T
        # Where the robot cannot move (a rail) no force is needed. Feet that nothing but a rigid body connects leave
        # forces between them open: the smallest solution.
        own = np.abs(np.diag(answers))
        moves = own > FIXED * own.max()
        if not moves.any():
            return force
        scale = np.sqrt(own[moves])
        matrix = answers[np.ix_(moves, moves)] / np.outer(scale, scale)
        size = np.linalg.lstsq(matrix, -free[moves] / scale, rcond=1e-10)[0] / scale
        return np.asarray(force + (size @ shapes[moves]).reshape(-1, 2))

    def _shapes(self) -> tuple[Vector, Vector]:
        """Forces of one unit of each multiplier, and the mean slips that they make zero, shape (shape, 2 point)."""
        shapes, means = [], []
        for foot in sorted(set(self.feet)):
            held = [k for k, point in enumerate(self.points) if self.feet[k] == foot and point in self.sticking]
            if not held:
                continue
            total = self.loads[held].sum()
            share = self.loads[held] / total if total > 0 else np.full(len(held), 1 / len(held))
            pairs = np.zeros((2 if len(held) == 1 else 3, len(self.points), 2))
            along = pairs.copy()
            pairs[0, held, 0] = pairs[1, held, 1] = along[0, held, 0] = along[1, held, 1] = share
            if len(held) > 1:
                for target, arms in ((pairs, self.arms[held]), (along, self.arms_end[held])):
                    away = arms - share @ arms
                    target[2, held] = share[:, None] * np.column_stack([-away[:, 1], away[:, 0]])
            shapes.append(pairs.reshape(len(pairs), -1))
            means.append(along.reshape(len(along), -1))
        if not shapes:
            return np.zeros((0, 0)), np.zeros((0, 0))
        return np.concatenate(shapes), np.concatenate(means)


def _crossing(arm: Vector) -> Vector:
    """The matrix of arm x, shape (3, 3)."""
    x, y, z = arm
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
