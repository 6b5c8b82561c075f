"""A surface law under the feet in MuJoCo's own loop: `FootForces`, for control and learning.

MuJoCo calls it in every step (``mjcb_passive``) and integrates its forces itself. There is no exchange, no energy
balance and no sticking: friction is mu_d N against the slip u, N mu_d u / slip_speed where |u| is below slip_speed. So
a foot at rest on a slope creeps. What it computes is therefore not the bits of a `RobotRun`, which is the reference.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from rigid.checks import check_above_zero
from rigid.ground.laws import find_law, springback

from .body import MujocoRobot
from .feet import Foot, refuse_missing
from .law_feet import LawFeet, refuse_pointless
from .stability import check_exchange

__all__ = ["FootForces"]

_entered: dict[int, "FootForces"] = {}
"""By the id of the model, which each of them keeps alive."""


def _call_entered(model: Any, data: Any) -> None:
    """MuJoCo's callback: the forces that belong to this model, if any."""
    if (forces := _entered.get(id(model))) is not None:
        forces(model, data)


@dataclass
class _Depths:
    """Deepest depth of every point of one MjData since it last left the ground [m], shape (point,)."""

    now: list[float]  # At the time of the last call
    before: list[float] = field(default_factory=list)  # At the time before that
    time: float = math.inf  # Of the last call [s]
    until: float = -math.inf  # Where the next step ends at the latest [s]


class FootForces(AbstractContextManager["FootForces"]):
    """Adds the forces of a law on `feet` to ``data.qfrc_passive``; `with FootForces(...):` makes MuJoCo call it.

    Parameters
    ----------
    model, data : of MuJoCo. Calls with any other model do nothing; the stability is checked where `data` is.
    feet : as `find_feet` gives them.
    law, parameters, scales : as `LawFeet` has them.
    mu_d : friction of sliding [1].
    slip_speed : below which friction falls with the slip [m/s]; a step of dt needs mu_d g dt at least.

    Several may be entered at once, one for each model; they take the place of any other ``mjcb_passive``. `points`
    counts the points evaluated. Each MjData of the model has its own deepest depths. They are forgotten where its time
    goes back or jumps by more than a step (``mj_resetData``, another state); a second call at the same time does not
    count. Raises ValueError for a law there is not, a part without points, and numbers that cannot be; on entry also
    for a step at which the exchange of a run would be unstable.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
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
        self.model, self._data, self.feet, self.points, self._law = model, data, list(feet), 0, found
        self._make_ground = partial(LawFeet, self.feet, law=law, parameters=given, scales=scales)
        self._mu_d, self._slip = float(mu_d), float(slip_speed)
        self._rebound = found.rebound(given) or 1.0
        self._kind = mujoco.mjtObj.mjOBJ_BODY
        self._rates, self._force, self._torque = np.zeros(6), np.zeros(3), np.zeros(3)
        self._depths: WeakKeyDictionary[Any, _Depths] = WeakKeyDictionary()
        self._plans: list[tuple[Foot, bool, list[tuple[Any, ...]]]] = []
        count = 0
        for foot in feet:
            numbers = [
                found.numbers(given, count=part.share * scales.get(part.name, 1.0))
                for part in foot.parts
                for _ in part.centres
            ]
            radii = foot.spreads[:, 0, 0]
            balls = bool(np.array_equal(foot.spreads, radii[:, None, None] * np.eye(3)))
            rows = zip(foot.centres.tolist(), radii.tolist(), numbers, strict=True)
            # Of a point: centre, radius, the law's numbers, its place among all.
            points = [(*centre, radius, p, count + k) for k, (centre, radius, p) in enumerate(rows)]
            self._plans.append((foot, balls, points))
            count += len(points)
        self._zeros = [0.0] * count

    def __enter__(self) -> "FootForces":
        self._refuse_unstable()
        _entered[id(self.model)] = self
        self._mujoco.set_mjcb_passive(_call_entered)
        return self

    def __exit__(self, *_: object) -> None:
        if _entered.get(id(self.model)) is self:
            del _entered[id(self.model)]
        if not _entered:
            self._mujoco.set_mjcb_passive(None)

    def _refuse_unstable(self) -> None:
        """Raise ValueError, naming the foot, where a run that exchanges forces once a time step would be unstable."""
        model = copy.copy(self.model)
        step = float(model.opt.timestep)
        model.opt.integrator = int(self._mujoco.mjtIntegrator.mjINT_EULER)
        model.opt.gravity[:] = 0.0, 0.0, -float(np.linalg.norm(model.opt.gravity))
        robot = MujocoRobot(model, [part.name for foot in self.feet for part in foot.parts])
        robot.feet = self.feet  # a cylinder's points depend on the posture in which it was found
        robot.owners = np.repeat(np.arange(len(self.feet)), [len(foot.centres) for foot in self.feet])
        robot.data.qpos[:] = self._data.qpos
        robot.start()
        try:
            check_exchange(robot, self._make_ground(time_step=step), substeps=1)
        except ValueError as error:
            raise ValueError(
                f"model.opt.timestep = {step:g} s is too long for this law: a shorter one or a softer law would do. "
                f"In words of the check of runs: {error}"
            ) from None

    def _remembered(self, model: Any, data: Any) -> _Depths:
        """Depths of this MjData, made ready for a call at its time."""
        depths = self._depths.get(data)
        if depths is None:
            depths = self._depths[data] = _Depths(self._zeros)
        time = float(data.time)
        if not depths.time <= time <= depths.until:
            depths.before = self._zeros
        elif time > depths.time:
            depths.before = depths.now
        depths.now, depths.time = self._zeros.copy(), time
        depths.until = time + 1.5 * float(model.opt.timestep)
        return depths

    def __call__(self, model: Any, data: Any) -> None:
        """Add the forces of now to ``data.qfrc_passive``; positions and velocities of bodies must be up to date."""
        if model is not self.model:
            return
        depths = self._remembered(model, data)
        for foot, balls, points in self._plans:
            body = foot.body
            at = data.xipos[body]
            height = float(at[2])
            if height > foot.reach:
                continue
            matrix = data.xmat[body].tolist()
            arms = None if balls else foot.lowest(data.xmat[body].reshape(3, 3)).tolist()
            if self._push(data, body, height, matrix, arms, points, depths):
                self._mujoco.mj_applyFT(model, data, self._force, self._torque, at, body, data.qfrc_passive)

    def _push(
        self, data: Any, body: int, height: float, m: list[float], arms: Any, points: Any, depths: _Depths
    ) -> bool:
        """Force and torque of a foot about its origin into `_force` and `_torque`; whether there are any."""
        loading, rate_force, mu_d, slow = self._law.loading, self._law.rate_force, self._mu_d, self._slip
        linear, remembers, rebound = self._law.name == "spring-damper", self._law.has_memory, self._rebound
        before, now, sqrt = depths.before, depths.now, math.sqrt
        self.points += len(points)
        fx = fy = fz = tx = ty = tz = 0.0
        moving: list[float] | None = None
        for k, (cx, cy, cz, radius, numbers, place) in enumerate(points):
            if arms is None:
                az = m[6] * cx + m[7] * cy + m[8] * cz - radius
                depth = -(height + az)
                if depth > 0.0:
                    ax, ay = m[0] * cx + m[1] * cy + m[2] * cz, m[3] * cx + m[4] * cy + m[5] * cz
            else:
                ax, ay, az = arms[k]
                depth = -(height + az)
            if depth <= 0.0:
                continue
            if moving is None:
                self._mujoco.mj_objectVelocity(self.model, data, self._kind, body, self._rates, 0)
                moving = self._rates.tolist()
            wx, wy, wz, vx, vy, vz = moving
            ux, uy = vx + wy * az - wz * ay, vy + wz * ax - wx * az
            rate = wy * ax - wx * ay - vz
            if linear:  # the spring-damper without two calls, a fifth of the time of a foot on many points
                load = numbers[0] * depth + (numbers[1] * rate if rate > 0.0 else 0.0)
            elif remembers and depth < before[place]:  # `SurfaceLaw.force`, written out as it takes most of the time
                now[place] = before[place]
                load = loading(before[place], numbers) * springback(depth, before[place], rebound)
                load += rate_force(depth, rate, numbers)
            else:
                now[place] = depth
                load = loading(depth, numbers) + rate_force(depth, rate, numbers)
            if load <= 0.0:
                continue
            size = sqrt(ux * ux + uy * uy)
            share = -mu_d * load / (size if size > slow else slow)
            px, py = share * ux, share * uy
            fx, fy, fz = fx + px, fy + py, fz + load
            tx, ty, tz = tx + ay * load - az * py, ty + az * px - ax * load, tz + ax * py - ay * px
        force, torque = self._force, self._torque  # one by one: NumPy takes three times as long for a tuple
        force[0], force[1], force[2] = fx, fy, fz
        torque[0], torque[1], torque[2] = tx, ty, tz
        return fz > 0.0
