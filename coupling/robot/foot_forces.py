"""A surface law under the feet in MuJoCo's own loop: `FootForces`, for control and learning.

MuJoCo calls it in every step (``mjcb_passive``) and integrates its forces itself. There is no exchange, no energy
balance and no sticking: friction is mu_d N against the slip u, N mu_d u / slip_speed where |u| is below slip_speed. So
a foot at rest on a slope creeps. What it computes is therefore not the bits of a `RobotRun`, which is the reference.
"""

import copy
import math
import warnings
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from rigid.checks import check_above_zero
from rigid.ground.laws import SurfaceLaw, find_law
from rigid.ground.soles import of_one_foot
from rigid.ground.specialised import Specialised, specialised

from .body import MujocoRobot
from .feet import Foot, Part, refuse_missing
from .law_feet import LawFeet
from .soles import FASTEST, default_law, foot_matrices, refuse_defaults
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


class FootForces(AbstractContextManager["FootForces"]):
    """Adds the forces of a law on `feet` to ``data.qfrc_passive``; `with FootForces(...):` makes MuJoCo call it.

    Parameters
    ----------
    model, data : of MuJoCo. Calls with any other model do nothing; the stability is checked where `data` is.
    feet : as `find_feet` gives them.
    law, parameters, scales, under : as `LawFeet` has them; rebound and loss are the same in all parts. With neither
        `scales` nor `under`, a law of grains takes its defaults for sand where `parameters` has no value. These hold
        for the gravity of `model` and the shape and size of each foot in the posture of `data`, as in `hedgebed
        mujoco`.
    depths, speeds : name of a part -> largest depth of its parameters [m], and largest speed into the ground at which
        its law was compared with grains [m/s]; the first part that is deeper, and the first that is faster, warns,
        once.
    mu_d : friction of sliding [1].
    slip_speed : below which friction falls with the slip [m/s]; a step of dt needs mu_d g dt at least.

    Several may be entered at once, one for each model; they take the place of any other ``mjcb_passive``. `points`
    counts the points evaluated. Each MjData of the model has its own deepest depths. They are forgotten where its time
    goes back or jumps by more than a step (``mj_resetData``, another state); a second call at the same time does not
    count. Raises ValueError for an unknown law and for impossible numbers. It also does so for numbers of one foot or
    gravity that are neither given nor known, such as K of spring-damper; on entry also for a step at which the exchange
    of a run would be unstable.
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
        under: Mapping[str, Mapping[str, float]] | None = None,
        depths: Mapping[str, float] | None = None,
        speeds: Mapping[str, float] | None = None,
    ) -> None:
        mujoco = self._mujoco = refuse_missing()
        check_above_zero("in m/s", slip_speed=slip_speed)
        given = parameters or {}
        if not scales and not under and any(name not in given for name in of_one_foot(law)):
            gravity = float(np.linalg.norm(model.opt.gravity))
            full = default_law(feet, foot_matrices(data, feet), law, given, gravity=gravity)
            law, scales, under = full["law"], full["scales"], full["under"]
            speeds = full.get("speeds") if speeds is None else speeds
        scales, under = scales or {}, under or {}
        refuse_defaults(feet, law, given, under)
        found = find_law(law)
        self.model, self._data, self.feet, self.points, self._law = model, data, list(feet), 0, found
        self._make_ground = partial(LawFeet, self.feet, law=law, parameters=given, scales=scales, under=under)
        self._mu_d, self._slip = float(mu_d), float(slip_speed)
        self._rebound, self._loss = _springback_of(found, [under.get(p.name, given) for f in feet for p in f.parts])
        self._kind = int(mujoco.mjtObj.mjOBJ_BODY)  # an int takes 0.1 us less than the enumeration
        self._rates, self._force, self._torque = np.zeros(6), np.zeros(3), np.zeros(3)
        self._depths: WeakKeyDictionary[Any, _Depths] = WeakKeyDictionary()
        self._plans: list[tuple[Foot, list[_Group]]] = []
        count = 0
        for foot in feet:
            groups = []
            for part in foot.parts:
                own = under.get(part.name, given)
                numbers = found.numbers(own, count=part.share * scales.get(part.name, 1.0))
                limit = (depths or {}).get(part.name, math.inf)
                fastest = (speeds or {}).get(part.name, math.inf)
                groups += _groups(part, specialised(found, numbers), count, limit, fastest)
                count += len(part.centres)
            self._plans.append((foot, groups))
        self._zeros, self._warned, self._warned_fast = [0.0] * count, False, False
        self._forgotten = _Depths(self._zeros, self._zeros)  # of a law without memory
        self._apply, self._velocity = mujoco.mj_applyFT, mujoco.mj_objectVelocity

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
                f"model.opt.timestep = {step:g} s is too long for this law: use a shorter one or a softer law. "
                f"In words of the check of runs: {error}"
            ) from None

    def _remembered(self, model: Any, data: Any) -> _Depths:
        """Depths of this MjData, made ready for a call at its time."""
        depths = self._depths.get(data)
        if depths is None:
            depths = self._depths[data] = _Depths(self._zeros)
        time = float(data.time)
        if time != depths.time:  # reading the time step takes as long as a point of a foot
            follows = depths.time < time <= depths.time + 1.5 * float(model.opt.timestep)
            depths.before, depths.time = depths.now if follows else self._zeros, time
        depths.now = self._zeros.copy()
        return depths

    def __call__(self, model: Any, data: Any) -> None:
        """Add the forces of now to ``data.qfrc_passive``; positions and velocities of bodies must be up to date."""
        if model is not self.model:
            return
        depths = self._remembered(model, data) if self._law.has_memory else self._forgotten
        places, turns = data.xipos, data.xmat
        for foot, groups in self._plans:
            body = foot.body
            height = places.item(body, 2)
            if height > foot.reach:
                continue
            if self._push(data, body, height, turns[body].tolist(), groups, depths):
                self._apply(model, data, self._force, self._torque, places[body], body, data.qfrc_passive)

    def _warn(self, depth: float, name: str, limit: float) -> None:
        """Warn that a part goes deeper than its parameters hold [m], once."""
        self._warned = True
        warnings.warn(
            f"foot {name!r} goes {1e3 * depth:.3g} mm deep, and the parameters of its law hold to "
            f"{1e3 * limit:.3g} mm: the force is extrapolated",
            stacklevel=2,
        )

    def _warn_fast(self, speed: float, name: str, fastest: float) -> None:
        """Warn that a part goes into the ground faster than its law was compared with grains [m/s], once."""
        self._warned_fast = True
        warnings.warn(
            f"foot {name!r} goes into the ground at {speed:.3g} m/s, and laws of sand were compared with grains up to "
            f"{fastest:.3g} m/s ({FASTEST} sqrt(g D)): faster, grains push harder, and a launch is faster",
            stacklevel=2,
        )

    def _push(self, data: Any, body: int, height: float, m: list[float], groups: Any, depths: _Depths) -> bool:
        """Force and torque of a foot about its origin into `_force` and `_torque`; whether there are any."""
        mu_d, slow, remembers, rebound = self._mu_d, self._slip, self._law.has_memory, self._rebound
        loss, loss_speed = self._loss
        before, now, sqrt = depths.before, depths.now, math.sqrt
        m0, m1, m2, m3, m4, m5, m6, m7, m8 = m
        fx = fy = fz = tx = ty = tz = 0.0
        moving = None
        for gx, gy, gz, ex, ey, ez, law, radius, spreads, points, limit, fastest, name in groups:
            if height + m6 * gx + m7 * gy + m8 * gz > abs(m6) * ex + abs(m7) * ey + abs(m8) * ez:
                continue
            self.points += len(points)
            new_depth, low = law.force, radius - height
            for cx, cy, cz, place in points:  # tuples of two or more are not assigned: that takes longer
                depth = low - m6 * cx - m7 * cy - m8 * cz
                if spreads:  # the lowest point of an ellipsoid: c - S S z / |S z|
                    s0, s1, s2, s3, s4, s5 = spreads[place]
                    dx, dy, dz = s0 * m6 + s1 * m7 + s2 * m8, s1 * m6 + s3 * m7 + s4 * m8, s2 * m6 + s4 * m7 + s5 * m8
                    size = sqrt(dx * dx + dy * dy + dz * dz)
                    depth += size
                if depth <= 0.0:
                    continue
                if depth > limit and not self._warned:
                    self._warn(depth, name, limit)
                if spreads:
                    size = size if size > 1e-300 else 1.0
                    cx -= (s0 * dx + s1 * dy + s2 * dz) / size
                    cy -= (s1 * dx + s3 * dy + s4 * dz) / size
                    cz -= (s2 * dx + s4 * dy + s5 * dz) / size
                ax = m0 * cx + m1 * cy + m2 * cz
                ay = m3 * cx + m4 * cy + m5 * cz
                if moving is None:
                    self._velocity(self.model, data, self._kind, body, self._rates, 0)
                    moving = wx, wy, wz, vx, vy, vz = self._rates.tolist()
                rate = wy * ax - wx * ay - vz
                if rate > fastest and not self._warned_fast:
                    self._warn_fast(rate, name, fastest)
                if not remembers:
                    load = new_depth(depth, rate)
                elif depth < (top := before[place]):  # `SurfaceLaw.force`, written out as it takes most of the time
                    now[place] = top
                    share = 1.0 - (top - depth) / (rebound * top)
                    if rate < 0.0:
                        share *= 1.0 - loss * rate / (rate - loss_speed)
                    load = (law.loading(top) * share if share > 0.0 else 0.0) + law.rate_force(depth, rate)
                else:
                    now[place] = depth
                    load = new_depth(depth, rate)
                    if rate < 0.0:
                        load -= law.loading(depth) * loss * rate / (rate - loss_speed)
                if load <= 0.0:
                    continue
                az = -height - depth
                ux = vx + wy * az - wz * ay
                uy = vy + wz * ax - wx * az
                size = sqrt(ux * ux + uy * uy)
                share = -mu_d * load / (size if size > slow else slow)
                px = share * ux
                py = share * uy
                fx += px
                fy += py
                fz += load
                tx += ay * load - az * py
                ty += az * px - ax * load
                tz += ax * py - ay * px
        force, torque = self._force, self._torque  # one by one: NumPy takes three times as long for a tuple
        force[0], force[1], force[2] = fx, fy, fz
        torque[0], torque[1], torque[2] = tx, ty, tz
        return fz > 0.0


def _springback_of(law: SurfaceLaw, parts: Sequence[Mapping[str, float]]) -> tuple[float, tuple[float, float]]:
    """`rebound` and `loss` of `law`, which all parts must share. Raises ValueError, naming the parameter, if not."""
    for name in ("rebound", "loss", "loss_speed") if law.has_memory else ():
        if len(several := {law.values(own)[name] for own in parts}) > 1:
            raise ValueError(f"under has several values of {name}, {sorted(several)}: all feet must have the same")
    own = parts[0] if parts else {}
    return law.rebound(own) or 1.0, law.loss(own)


_Group = tuple[
    float, float, float, float, float, float, Specialised, float, dict[int, list[float]], list[tuple[Any, ...]], float,
    float, str,
]  # fmt: skip
"""Points of a part. Of all: the middle and half the sides of a box around them [m], the law, the radius of the
balls that they are the lowest points of [m], or 0. Of each on an ellipsoid: its S as xx, xy, xz, yy, yz, zz [m]. Of
each: its centre [m], its place among all points of the feet. Of all: the depth to which the law holds [m], the speed to
which it was compared with grains [m/s], the name."""


def _groups(part: Part, law: Specialised, first: int, limit: float, fastest: float) -> list[_Group]:
    """The points of a part, the `first`th and on, in a lower and an upper half: mostly one of them is in the air.

    A part has balls of one radius, or ellipsoids.
    """
    radius = float(part.spreads[0, 0, 0])
    round_ = bool(np.array_equal(part.spreads, np.broadcast_to(radius * np.eye(3), part.spreads.shape)))
    sides = part.centres[:, 2] < part.centres[:, 2].mean()
    found = []
    for some in (np.flatnonzero(sides), np.flatnonzero(~sides)):
        if not len(some):
            continue
        sizes = np.linalg.norm(part.spreads[some], axis=2)  # half the sides of a box around each ball or ellipsoid
        low, high = (part.centres[some] - sizes).min(axis=0), (part.centres[some] + sizes).max(axis=0)
        middle, half = 0.5 * (low + high), 0.5 * (high - low) * (1 + 1e-12)
        spreads = {first + int(k): part.spreads[k][np.triu_indices(3)].tolist() for k in some}
        rows = [(*part.centres[k].tolist(), first + int(k)) for k in some]
        own = (radius, {}) if round_ else (0.0, spreads)
        found.append((*middle.tolist(), *half.tolist(), law, *own, rows, limit, fastest, part.name))
    return found
