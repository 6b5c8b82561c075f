"""A surface law under the feet in MuJoCo's own loop: `FootForces`, for control and learning.

MuJoCo calls it in every step (``mjcb_passive``) and integrates its forces itself. There is no exchange, no energy
balance and no sticking: friction is mu_d N against the slip u, N mu_d u / slip_speed where |u| is below slip_speed. So
a foot at rest on a slope creeps. What it computes is therefore not the bits of a `RobotRun`, which is the reference.
"""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from rigid.checks import check_above_zero
from rigid.ground.laws import find_law

from .feet import Foot, refuse_missing
from .law_feet import refuse_pointless

__all__ = ["FootForces"]


class FootForces(AbstractContextManager["FootForces"]):
    """Adds the forces of a law on `feet` to ``data.qfrc_passive``; `with FootForces(...):` makes MuJoCo call it.

    Parameters
    ----------
    feet : as `find_feet` gives them.
    law, parameters, scales : as `LawFeet` has them.
    mu_d : friction of sliding [1].
    slip_speed : below which friction falls with the slip [m/s]; a step of dt needs mu_d g dt at least.

    One callback serves a whole process: entering another replaces it. `points` counts the points it has evaluated.
    Raises ValueError for a law there is not, a part without points, and numbers that cannot be.
    """

    def __init__(
        self,
        feet: Sequence[Foot],
        *,
        law: str = "spring-damper",
        parameters: Mapping[str, float] | None = None,
        mu_d: float = 0.25,
        slip_speed: float = 0.01,
        scales: Mapping[str, float] | None = None,
    ) -> None:
        mujoco = self._mujoco = refuse_missing()
        check_above_zero("in m/s", slip_speed=slip_speed)
        refuse_pointless(feet)
        found, given, scales = find_law(law), parameters or {}, scales or {}
        self.feet, self.points, self._law = list(feet), 0, found
        self._mu_d, self._slip = float(mu_d), float(slip_speed)
        self._rebound = found.rebound(given) or 1.0
        self._kind = mujoco.mjtObj.mjOBJ_BODY
        self._rates, self._force, self._torque = np.zeros(6), np.zeros(3), np.zeros(3)
        self._plans: list[tuple[Foot, bool, list[list[Any]]]] = []
        for foot in feet:
            numbers = [
                found.numbers(given, count=part.share * scales.get(part.name, 1.0))
                for part in foot.parts
                for _ in part.centres
            ]
            radii = foot.spreads[:, 0, 0]
            balls = bool(np.array_equal(foot.spreads, radii[:, None, None] * np.eye(3)))
            rows = zip(foot.centres.tolist(), radii.tolist(), numbers, strict=True)
            # Of a point: centre, radius, the law's numbers, deepest depth so far.
            self._plans.append((foot, balls, [[*centre, radius, p, 0.0] for centre, radius, p in rows]))

    def __enter__(self) -> "FootForces":
        self._mujoco.set_mjcb_passive(self)
        return self

    def __exit__(self, *_: object) -> None:
        self._mujoco.set_mjcb_passive(None)

    def __call__(self, model: Any, data: Any) -> None:
        """Add the forces of now to ``data.qfrc_passive``; positions and velocities of bodies must be up to date."""
        for foot, balls, points in self._plans:
            body = foot.body
            at = data.xipos[body]
            height = float(at[2])
            if height > foot.reach:
                continue
            matrix = data.xmat[body].tolist()
            arms = None if balls else foot.lowest(data.xmat[body].reshape(3, 3)).tolist()
            if self._push(model, data, body, height, matrix, arms, points):
                self._mujoco.mj_applyFT(model, data, self._force, self._torque, at, body, data.qfrc_passive)

    def _push(
        self, model: Any, data: Any, body: int, height: float, m: list[float], arms: Any, points: list[list[Any]]
    ) -> bool:
        """Force and torque of a foot about its origin into `_force` and `_torque`; whether there are any."""
        law, mu_d, slow = self._law, self._mu_d, self._slip
        self.points += len(points)
        fx = fy = fz = tx = ty = tz = 0.0
        moving: list[float] | None = None
        for k, point in enumerate(points):
            if arms is None:
                cx, cy, cz, radius = point[:4]
                az = m[6] * cx + m[7] * cy + m[8] * cz - radius
                depth = -(height + az)
                if depth > 0.0:
                    ax, ay = m[0] * cx + m[1] * cy + m[2] * cz, m[3] * cx + m[4] * cy + m[5] * cz
            else:
                ax, ay, az = arms[k]
                depth = -(height + az)
            if depth <= 0.0:
                point[5] = 0.0
                continue
            if moving is None:
                self._mujoco.mj_objectVelocity(model, data, self._kind, body, self._rates, 0)
                moving = self._rates.tolist()
            wx, wy, wz, vx, vy, vz = moving
            ux, uy = vx + wy * az - wz * ay, vy + wz * ax - wx * az
            point[5] = top = max(point[5], depth)
            load = law.force(depth, -(vz + wx * ay - wy * ax), point[4], top=top, rebound=self._rebound)
            if load <= 0.0:
                continue
            share = -mu_d * load / max((ux * ux + uy * uy) ** 0.5, slow)
            px, py = share * ux, share * uy
            fx, fy, fz = fx + px, fy + py, fz + load
            tx, ty, tz = tx + ay * load - az * py, ty + az * px - ax * load, tz + ax * py - ay * px
        self._force[:] = fx, fy, fz
        self._torque[:] = tx, ty, tz
        return fz > 0.0
