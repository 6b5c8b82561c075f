"""Six degrees of freedom with flywheels: the equations of motion in one set of modes.

State vector z: position r of the centre of mass, quaternion, momentum P, angular momentum L about the centre of mass
(platform and wheels), the wheels' spins h_i, and three works. World axes, z up, the ground at z = 0. Momentum and
angular momentum are states themselves, so that in flight they are kept to round-off whatever the step:

    dP/dt = W + sum F_k,   dL/dt = sum rho_k x F_k,   dh_i/dt = -tau_i,   I omega = L - sum h_i a_i

with tau_i the torque of wheel i on the platform about its axis a_i. P = (m v_x, m v_y, (m + m_b) v_z).

Friction. A tip slides, with mu_d N against its slip u_k, or sticks. Those that stick share the force that holds them in
proportion to their loads, as the planar model has it: f_k = N_k (c + b z x (rho_k - mean rho)). So the load-weighted
mean of their slips is held at rest and, if they are several, that of their turning about the vertical. The force is
that of these constraints, from the equations of motion: no spring, and nothing that creeps. Within a step the weights
are those of its beginning.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rigid.ground.laws import SurfaceLaw, retreat_share, springback
from rigid.platform.platform import Platform

from .quaternions import rate as quaternion_rate
from .quaternions import to_matrix

__all__ = ["Modes", "Motion", "Tip"]

Array = NDArray[np.float64]
R, Q, P, L, H = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13), slice(13, 16)
TORQUE_WORK, GROUND_WORK, FRICTION_WORK = 16, 17, 18
STATE_COUNT = 19


@dataclass(slots=True)
class Modes:
    """Who touches, who sticks, which way the others slide."""

    touching: list[int] = field(default_factory=list)
    sticking: list[int] = field(default_factory=list)
    direction: dict[int, Array] = field(default_factory=dict)
    """Of each touching tip that slides: the unit vector of its slip, shape (2,)."""
    frozen: set[int] = field(default_factory=set)
    """Those that slide so slowly that their direction is kept instead of followed (see `rigid.spatial.steps`)."""
    weight: dict[int, float] = field(default_factory=dict)  # Share of each sticking tip in the load of all
    top: dict[int, float] = field(default_factory=dict)
    """Deepest depth of each touching tip [m], where the law remembers it; negative while it is on new ground."""
    torque: tuple[float, ...] = (0.0, 0.0, 0.0)  # Of each wheel on the platform [N m]


@dataclass(slots=True)
class Tip:
    """One touching tip, as last evaluated."""

    index: int
    arm: Array  # From the centre of mass [m]
    depth: float
    rate: float
    slip: Array  # Horizontal velocity [m/s], shape (2,)
    load: float  # Normal force [N]
    friction: Array  # Force along the ground [N], shape (2,)


class Motion:
    """Evaluates the equations of motion; keeps what the last evaluation found."""

    def __init__(
        self,
        platform: Platform,
        *,
        law: SurfaceLaw,
        numbers: tuple[float, ...],
        rebound: float,
        loss: tuple[float, float],
        mu_s: float,
        mu_d: float,
        weight: Array,
        counterweight: float,
    ) -> None:
        self.platform, self.law, self.numbers, self.rebound = platform, law, numbers, rebound
        self.loss = loss
        self.mu_s, self.mu_d, self.weight = mu_s, mu_d, weight
        self.masses = np.array([platform.mass, platform.mass, platform.mass + counterweight])
        self.tips = platform.tips - platform.centre_of_mass
        self.axes = np.zeros((3, 3))
        for k, wheel in enumerate(platform.wheels):
            self.axes[k] = wheel.axis
        self.inverse = np.linalg.inv(platform.inertia)
        self.found: list[Tip] = []
        self.spin = np.zeros(3)  # Angular velocity [rad/s], world axes, as last evaluated

    def tip(self, index: int) -> Tip:
        """The touching tip of this index, as last evaluated."""
        return next(tip for tip in self.found if tip.index == index)

    def turning(self, z: Array) -> tuple[Array, Array]:
        """Rotation matrix and angular velocity in world axes [rad/s]."""
        turn = to_matrix(z[Q])
        body = turn.T @ z[L] - self.axes.T @ z[H]
        return turn, turn @ (self.inverse @ body)

    def depths(self, z: Array) -> Array:
        """Depth of every tip [m], shape [tip_count]."""
        return -(z[2] + self.tips @ to_matrix(z[Q])[2])

    def energy(self, z: Array, modes: Modes) -> tuple[float, float, float]:
        """Kinetic (without the wheels' own), potential (weight), and stored in the ground [J]."""
        turn, spin = self.turning(z)
        body = turn.T @ spin
        kinetic = 0.5 * float((z[P] ** 2 / self.masses).sum() + body @ self.platform.inertia @ body)
        depths, stored = self.depths(z), 0.0
        for k in modes.touching:
            stored += self.law.stored(float(depths[k]), self.numbers, top=modes.top.get(k), rebound=self.rebound)
        return kinetic, -float(self.weight @ z[R]), stored

    def normal(self, depth: float, rate: float, top: float) -> float:
        """Force of the ground on a touching tip [N], never negative."""
        depth = max(depth, 0.0)
        top = max(top, depth) if self.law.has_memory else depth
        force = self.law.loading(top, self.numbers) * springback(depth, top, self.rebound)
        force *= retreat_share(rate, *self.loss)
        # A tip that moves out may be above the surface by the error of a step: nothing acts there.
        return max(0.0, float(force + self.law.rate_force(depth, rate, self.numbers)))

    def rates(self, z: Array, modes: Modes) -> Array:
        """dz/dt, shape [19]; `found` holds the touching tips."""
        turn, spin = self.turning(z)
        velocity = z[P] / self.masses
        force, moment = self.weight.copy(), np.zeros(3)
        found: list[Tip] = []
        ground_work = friction_work = 0.0
        if modes.touching:
            arms = self.tips[modes.touching] @ turn.T
            speeds = velocity + _cross(spin, arms)
            pushes = np.zeros_like(arms)
            for n, k in enumerate(modes.touching):
                depth, rate, slip = -float(z[2] + arms[n, 2]), -float(speeds[n, 2]), speeds[n, :2]
                load = self.normal(depth, rate, modes.top.get(k, 0.0))
                if k in modes.direction:
                    ahead = modes.direction[k]
                    pushes[n, :2] = -self.mu_d * load * (ahead if k in modes.frozen else self._along(slip, ahead))
                pushes[n, 2] = load
                ground_work -= load * rate
                found.append(Tip(k, arms[n], depth, rate, slip, load, pushes[n, :2]))
            force += pushes.sum(axis=0)
            moment = _cross(arms, pushes).sum(axis=0)
            friction_work = float((pushes[:, :2] * speeds[:, :2]).sum())
        self.found, self.spin = found, spin
        torque = turn @ (self.axes.T @ np.array(modes.torque)) if any(modes.torque) else np.zeros(3)
        if modes.sticking:
            hold_force, hold_moment = self._hold(z, turn, spin, force, moment, torque, modes)
            force, moment = force + hold_force, moment + hold_moment
            friction_work += sum(float(tip.friction @ tip.slip) for tip in found if tip.index in modes.weight)
        out = np.empty(STATE_COUNT)
        out[R], out[Q], out[P], out[L] = velocity, quaternion_rate(z[Q], spin), force, moment
        out[H] = [-t for t in modes.torque]
        out[TORQUE_WORK], out[GROUND_WORK], out[FRICTION_WORK] = torque @ spin, ground_work, friction_work
        return out

    @staticmethod
    def _along(slip: Array, direction: Array) -> Array:
        """Unit vector of a slip that began along `direction`; carried on smoothly where the slip runs through 0."""
        size = math.hypot(slip[0], slip[1])
        if size < 1e-13:
            return direction
        ahead = float(slip @ direction)
        return slip / size if ahead >= 0 else -slip / size

    def rows(self, modes: Modes) -> tuple[Array, list[Tip], Array]:
        """The sticking tips' constraints on (velocity, angular velocity), shape [2 or 3, 6]; the tips; their shares.

        The force of tip k under the multipliers c (2 or 3) is share_k (c_x, c_y) + share_k c_z z x (rho_k - mean).
        """
        held = [tip for tip in self.found if tip.index in modes.weight]
        share = np.array([modes.weight[tip.index] for tip in held])
        arms = np.array([tip.arm for tip in held])
        mean = share @ arms
        out = np.zeros((2 if len(held) == 1 else 3, 6))
        # (omega x rho)_x = wy rz - wz ry, (omega x rho)_y = wz rx - wx rz.
        out[0, 0], out[0, 4], out[0, 5] = 1.0, mean[2], -mean[1]
        out[1, 1], out[1, 3], out[1, 5] = 1.0, -mean[2], mean[0]
        if len(held) > 1:
            dx, dy = arms[:, 0] - mean[0], arms[:, 1] - mean[1]
            # sum share (dx u_y - dy u_x)
            out[2, 3] = -float(share @ (dx * arms[:, 2]))
            out[2, 4] = -float(share @ (dy * arms[:, 2]))
            out[2, 5] = float(share @ (dx * arms[:, 0] + dy * arms[:, 1]))
        return out, held, share

    def answer(self, turn: Array, rows: Array) -> Array:
        """What one unit of each multiplier makes of (dv/dt, d omega/dt): M^-1 rows^T, shape [6, n]."""
        inverse = turn @ self.inverse @ turn.T
        return np.vstack([rows[:, :3].T / self.masses[:, None], inverse @ rows[:, 3:].T])

    def _hold(
        self, z: Array, turn: Array, spin: Array, force: Array, moment: Array, torque: Array, modes: Modes
    ) -> tuple[Array, Array]:
        """Force and moment that keep the sticking tips where they are; written into the tips found."""
        rows, held, share = self.rows(modes)
        inverse = turn @ self.inverse @ turn.T
        free = np.concatenate([force / self.masses, inverse @ (moment + torque - _cross(spin, z[L]))])
        arms = np.array([tip.arm for tip in held])
        swing = _cross(spin, _cross(spin, arms))[:, :2]
        bias = list(share @ swing)
        if len(rows) == 3:
            d = arms - share @ arms
            slip = np.array([tip.slip for tip in held])
            turned = _cross(spin, d)[:, :2]  # how the arms themselves change
            bias.append(
                float(share @ (d[:, 0] * swing[:, 1] - d[:, 1] * swing[:, 0]))
                + float(share @ (turned[:, 0] * slip[:, 1] - turned[:, 1] * slip[:, 0]))
            )
        matrix = rows @ self.answer(turn, rows)
        right = -(rows @ free + np.array(bias))
        multiplier = _solve(matrix, right)
        total = rows.T @ multiplier
        mean = share @ arms
        for tip, part in zip(held, share, strict=True):
            tip.friction = part * multiplier[:2]
            if len(rows) == 3:
                d = tip.arm - mean
                tip.friction = tip.friction + part * multiplier[2] * np.array([-d[1], d[0]])
        return total[:3], total[3:]

    def hold_still(self, z: Array, modes: Modes) -> None:
        """Take out of the speeds what the sticking tips do not allow; the impulse's work counts as friction's.

        Uses what the last evaluation found, which must have been at `z` in `modes`.
        """
        if not modes.sticking:
            return
        turn, spin = self.turning(z)
        rows, _, _ = self.rows(modes)
        speeds = np.concatenate([z[P] / self.masses, spin])
        excess = rows @ speeds
        if not excess.any():
            return
        matrix = rows @ self.answer(turn, rows)
        push = _solve(matrix, -excess)
        z[P] += rows[:, :3].T @ push
        z[L] += rows[:, 3:].T @ push
        z[FRICTION_WORK] += 0.5 * float(push @ excess)


def _cross(a: Array, b: Array) -> Array:
    """a x b along the last axis; numpy's own takes far longer for so few."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)


def _solve(matrix: Array, right: Array) -> Array:
    """Solution of the symmetric system, the smallest one where tips in a line leave a turn undetermined."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    if np.linalg.cond(scaled) < 1e10:
        return np.linalg.solve(scaled, right / scale) / scale
    return np.linalg.lstsq(scaled, right / scale, rcond=1e-10)[0] / scale
