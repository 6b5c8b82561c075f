"""A surface law under the feet in MuJoCo's own loop: `FootForces`, for control and learning.

MuJoCo calls it in every step (``mjcb_passive``) and integrates its forces itself. There is no exchange, no energy
balance and no sticking: friction is mu_d N against the slip u, N mu_d u / slip_speed where |u| is below slip_speed. So
a foot at rest on a slope creeps. What it computes is therefore not the bits of a `RobotRun`, which is the reference.
"""

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from rigid.checks import check_above_zero, warn_user
from rigid.ground.laws import SurfaceLaw, find_law
from rigid.ground.soles import of_one_foot
from rigid.ground.specialised import written

from .body import MujocoRobot
from .feet import Foot, refuse_missing
from .law_feet import LawFeet
from .pushes import Memory, PartLaw, write_push
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
        its law was compared with grains [m/s]. The first part that is deeper warns once, and so does the first that is
        faster.
    mu_d : friction of sliding [1].
    slip_speed : below which friction falls with the slip [m/s]; a step of dt needs mu_d g dt at least.

    Several may be entered at once, one for each model; they take the place of any other ``mjcb_passive``. `points`
    counts the points evaluated. A force sensor of MuJoCo does not see passive forces: `forces` returns them. Each
    MjData of the model has its own deepest depths. They are forgotten where its time goes back or jumps by more than
    a step (``mj_resetData``, another state). A second call at the same time does not count. It keeps the last MjData
    alive. Raises ValueError for an unknown law and for impossible numbers. It also does so for numbers of one foot or
    gravity that are neither given nor known, such as K of spring-damper. On entry it also refuses a step at which the
    exchange of a run would be unstable.
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
        self.model, self._data, self.feet, self.points = model, data, list(feet), 0
        self._remembers = found.has_memory
        self._make_ground = partial(LawFeet, self.feet, law=law, parameters=given, scales=scales, under=under)
        memory = _springback_of(found, [under.get(p.name, given) for f in feet for p in f.parts])
        self._force = np.zeros(3)
        names = {
            "model": model, "apply": mujoco.mj_applyFT, "force": self._force, "torque": np.zeros(3),
            "warn": self._warn, "warn_fast": self._warn_fast,
        }  # fmt: skip
        self._depths: WeakKeyDictionary[Any, _Depths] = WeakKeyDictionary()
        self._pushes: list[Callable[..., int]] = []
        count = 0
        for foot in feet:
            laws = []
            for part in foot.parts:
                own = found.numbers(under.get(part.name, given), count=part.share * scales.get(part.name, 1.0))
                limit, fastest = (float((each or {}).get(part.name, math.inf)) for each in (depths, speeds))
                laws.append(PartLaw(law=written(found, own), first=count, limit=limit, fastest=fastest))
                count += len(part.centres)
            push = write_push(foot, laws, memory, mu_d=float(mu_d), slip_speed=float(slip_speed), names=names)
            self._pushes.append(push)
        self._zeros, self._warned, self._warned_fast = [0.0] * count, False, False
        self._forgotten = _Depths(self._zeros, self._zeros)  # of a law without memory
        self._seen: Any = None
        self._views: list[tuple[Any, ...]] = []

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

    def _look_at(self, data: Any) -> None:
        """Make the views of an MjData that a call needs: reading one from `data` takes as long as a point of a foot."""
        self._views = []
        for foot, push in zip(self.feet, self._pushes, strict=True):
            body, root = foot.body, int(self.model.body_rootid[foot.body])
            rows = data.xipos[body], data.xmat[body], data.cvel[body], data.subtree_com[root]
            self._views.append((push, *rows))
        self._total, self._seen, self._own = data.qfrc_passive, data, self._forgotten
        if self._remembers:
            if (own := self._depths.get(data)) is None:
                own = self._depths[data] = _Depths(self._zeros)
            self._own = own

    def __call__(self, model: Any, data: Any) -> None:
        """Add the forces of now to ``data.qfrc_passive``; positions and velocities of bodies must be up to date."""
        if model is not self.model:
            return
        if data is not self._seen:
            self._look_at(data)
        depths = self._own
        if self._remembers:
            if (time := data.time) != depths.time:
                follows = depths.time < time <= depths.time + 1.5 * float(model.opt.timestep)
                depths.before, depths.time = depths.now if follows else self._zeros, time
            depths.now = self._zeros.copy()
        before, now, total = depths.before, depths.now, self._total
        for push, place, turn, moving, middle in self._views:
            self.points += push(data, place, turn, moving, middle, total, before, now)

    def forces(self, data: Any) -> dict[str, np.ndarray]:
        """Force of the ground on each foot [N], world axes, shape (3,), by the name of the foot; 0 in the air.

        It is that of the last call, where bodies were then (as MuJoCo's sensors after ``mj_step``). Changes nothing.
        """
        if data is not self._seen:
            self._look_at(data)
        found, unused = {}, np.zeros_like(self._total)
        for foot, (push, *rows) in zip(self.feet, self._views, strict=True):
            self._force[:] = 0.0
            push(data, *rows, unused, self._own.before, list(self._own.now))
            found[foot.name] = self._force.copy()
        return found

    def _warn(self, depth: float, name: str, limit: float) -> None:
        """Warn that a part goes deeper than its parameters hold [m], once."""
        if self._warned:
            return
        self._warned = True
        warn_user(
            f"foot {name!r} goes {1e3 * depth:.3g} mm deep, and the parameters of its law hold to "
            f"{1e3 * limit:.3g} mm: the force is extrapolated"
        )

    def _warn_fast(self, speed: float, name: str, fastest: float) -> None:
        """Warn that a part goes into the ground faster than its law was compared with grains [m/s], once."""
        if self._warned_fast:
            return
        self._warned_fast = True
        warn_user(
            f"foot {name!r} goes into the ground at {speed:.3g} m/s, and laws of sand were compared with grains up to "
            f"{fastest:.3g} m/s ({FASTEST} sqrt(g D)): faster, grains push harder, and a launch is faster"
        )


def _springback_of(law: SurfaceLaw, parts: Sequence[Mapping[str, float]]) -> Memory | None:
    """How `law` springs back; None without memory. Raises ValueError, naming the parameter, where parts differ."""
    if not law.has_memory:
        return None
    for name in ("rebound", "loss", "loss_speed"):
        if len(several := {law.values(own)[name] for own in parts}) > 1:
            raise ValueError(f"under has several values of {name}, {sorted(several)}: all feet must have the same")
    own = parts[0] if parts else {}
    loss, loss_speed = law.loss(own)
    return Memory(rebound=float(law.rebound(own) or 1.0), loss=float(loss), loss_speed=float(loss_speed))
