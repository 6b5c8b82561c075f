"""The motion of the soft suite: the planar platform in MuJoCo, on MuJoCo's own soft contacts.

Coordinates and signs are those of the design note "planar model"; the base model's equations are not used. MuJoCo
solves for the contact forces and integrates. Only what MuJoCo has no element for is computed here and applied to its
joints: the motor's torque, which acts while a spike touches, and the forces of `_push`.

MuJoCo's force on a tip at depth r that sinks at the speed v is f = (k r + b v - a) / R where it is positive: a is the
tip's acceleration upwards, R = (1 - d) / d times the platform's mean inverse mass, d the impedance [1]. k and b are
such that k / R is K and b / R is `both_ways` C. Three differences to a spring-damper remain: an added mass 1 / R of a
tip that touches, a damper that acts on the way out too, and friction that creeps by its regularisation.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import mujoco

__all__ = ["CONTACT", "ROWS", "Contact", "move"]

Array = NDArray[np.float64]
Numbers = Mapping[str, float]
ROWS = ("x", "y", "theta", "vx", "vy", "omega", "wheel")
"""Values of one row of the motion."""
STEP = 1.25e-4  # of the integration [s]
ROW = 5e-4  # between two rows of the motion [s]
SETTLE = 0.8  # of damped motion before t = 0, in which the platform finds its static equilibrium [s]
_POINT = 1e-5  # radius of a tip that is no ball [m]
_WHEEL_MASS = 0.1  # part of the platform's mass [kg]
_GAMMA = np.pi / 8 + np.arange(8) * np.pi / 4


@dataclass(frozen=True)
class Contact:
    """How soft MuJoCo's contacts are.

    `impedance`: d [1]. `impratio`: of friction over normal [1]. `both_ways`: MuJoCo's damper over the base model's,
    which acts on the way in only: half loses as much in a bounce [1].
    """

    impedance: float = 0.001
    impratio: float = 1000.0
    both_ways: float = 0.5


CONTACT = Contact()
"""The suite's own, chosen before any count: docs/notes/results-diagnose-mujoco.md."""


def move(numbers: Numbers, duration: float, *, contact: Contact = CONTACT, step: float = STEP) -> tuple[Array, Array]:
    """Times [s], shape [row_count], and the motion, shape [row_count, 7], the last axis as `ROWS`.

    `numbers`: of the platform, the trial and what is hidden, by name. `duration`: after t = 0 [s]. Raises RuntimeError
    where the motion is not stable, ImportError without MuJoCo.
    """
    import mujoco

    p = {"length": 0.2, "wheel_inertia": 1.2e-3} | dict(numbers)
    model = mujoco.MjModel.from_xml_string(_mjcf(p, contact, step))
    tips = np.flatnonzero(model.geom_priority == 1)
    _soften(model, tips, p, contact)
    data = mujoco.MjData(model)
    data.qpos[1] = p["length"] * math.cos(math.pi / 8) - 0.5 * p["mass"] * p["gravity_sim"] / p["stiffness"]
    _settle(model, data, p, step)
    start = data.qpos[:3].copy()
    data.qpos[0], data.qvel[:], data.time = 0.0, 0.0, 0.0
    data.qvel[3] = p["wheel_speed_0"] if p["wheel_sign"] < 0.0 else -p["wheel_speed_0"]
    model.jnt_stiffness[2], model.dof_damping[2] = p.get("cable_spring", 0.0), p.get("cable_drag", 0.0)
    model.qpos_spring[2], model.dof_frictionloss[2] = start[2], p.get("bearing", 0.0)
    mujoco.mj_forward(model, data)
    every = max(1, round(ROW / step))
    count = math.ceil(duration / (step * every)) + 1
    out = np.full((count, len(ROWS)), np.nan)
    mu = p["mu_s"]
    busy = any(p.get(name) for name in ("drag", "vibration", "rate_change", "gust"))
    for k in range((count - 1) * every + 1):
        wheel = data.qvel[3] + data.qvel[2]
        if k % every == 0:
            out[k // every] = (*data.qpos[:3], *data.qvel[:3], abs(wheel))
        data.qfrc_applied[3] = -_torque(p, k * step, wheel, data.ncon)
        if busy:
            data.qfrc_applied[:3], model.geom_friction[tips, 0] = _push(p, k * step, data, mu)
        mujoco.mj_step(model, data)
    if not np.isfinite(out).all() or any(warning.number for warning in data.warning):
        raise RuntimeError("the motion is not stable: MuJoCo warned, and began it again")
    return np.arange(count) * step * every, out


def _mjcf(p: Numbers, contact: Contact, step: float) -> str:
    """The model: joints x, y, turn of the platform and the wheel's, a tip for each row of spikes."""
    radius = max(p.get("ball", 0.0), _POINT)
    arm = p["length"] - radius
    tips = "".join(
        f'<geom type="sphere" size="{radius!r}" mass="0" priority="1" contype="1" conaffinity="0" condim="3" '
        f'pos="{-arm * math.sin(g)!r} 0 {-arm * math.cos(g)!r}"/>'
        for g in _GAMMA.tolist()
    )
    loose, ridge, lean = p.get("loose_mass", 0.0), "", p.get("slope", 0.0)
    own = p["mass"] - _WHEEL_MASS - loose
    away = [p["mass"] / own * p.get(name, 0.0) for name in ("offset_x", "offset_y")]  # of what the hull itself weighs
    if p.get("ridge"):  # a log across the way, whose top is above the surface
        thick, place = p["ridge_radius"], p["ridge_x"]
        ridge = (f'<geom type="capsule" size="{thick!r}" fromto="{place!r} -1 {p["ridge"] - thick!r} {place!r} 1 '
                 f'{p["ridge"] - thick!r}" contype="0" conaffinity="1"/>')  # fmt: skip
    inside = ""
    if loose:  # a mass on a spring along the platform's own x
        w = 2.0 * math.pi * p["loose_rate"]
        inside = (
            f'<body><joint type="slide" axis="1 0 0" stiffness="{loose * w * w!r}" damping="{0.1 * loose * w!r}"/>'
            f'<inertial pos="0 0 0" mass="{loose!r}" diaginertia="1e-6 1e-6 1e-6"/></body>'
        )
    j, jw = p["inertia"] - own * (away[0] ** 2 + away[1] ** 2), p["wheel_inertia"]  # p's is about the shaft
    pull = p["gravity_sim"]
    return f"""<mujoco><option timestep="{step!r}" cone="elliptic" impratio="{contact.impratio!r}" tolerance="1e-12"
      iterations="50" gravity="{-pull * math.sin(lean)!r} 0 {-pull * math.cos(lean)!r}"/>
    <worldbody><geom type="plane" size="9 9 1" contype="0" conaffinity="1"/>{ridge}
    <body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/>
      <inertial pos="{away[0]!r} 0 {away[1]!r}" mass="{own!r}"
        diaginertia="{j!r} {j!r} {j!r}"/>{tips}
      <body><joint type="hinge" axis="0 1 0"/><inertial pos="0 0 0" mass="{_WHEEL_MASS!r}"
        diaginertia="{jw!r} {jw!r} {jw!r}"/></body>{inside}
    </body></worldbody></mujoco>"""


def _soften(model: "mujoco.MjModel", tips: NDArray[np.intp], p: Numbers, contact: Contact) -> None:
    """Give the tips the stiffness and damping of a row of spikes at depth 0, and their friction.

    MuJoCo's direct format: k = d stiffness / d_max^2, b = damping / d_max. An impedance that grows with depth hardens.
    """
    d, ease = contact.impedance, float(model.body_invweight0[1, 0])
    most = d * (1.0 + p.get("harden", 0.0))
    model.geom_solimp[tips] = (d, most, p.get("harden_depth", 1e-3), 0.5, 1.0)
    stiffness = p["stiffness"] * ease * (1.0 - d) * (most / d) ** 2
    damping = contact.both_ways * p["damping"] * ease * (1.0 - d) * most / d
    model.geom_solref[tips] = (-stiffness, -damping)
    model.geom_friction[tips, 0] = p["mu_s"]


def _settle(model: "mujoco.MjModel", data: "mujoco.MjData", p: Numbers, step: float) -> None:
    """Let the platform come to rest under critical dampers of its joints."""
    import mujoco

    sink = 2.0 * math.sqrt(2.0 * p["stiffness"] * p["mass"])
    rock = 0.0765 * 2.0 * math.sqrt(2.0 * p["stiffness"] * (p["inertia"] + p["mass"] * p["length"] ** 2))
    model.dof_damping[:3] = (0.5 * sink, sink, rock)
    mujoco.mj_step(model, data, nstep=round(SETTLE / step))
    model.dof_damping[:3] = 0.0


def _torque(p: Numbers, t: float, wheel: float, touching: int) -> float:
    """Torque on the platform [N m]: while a spike touches, up to its end, of a brake while the wheel turns."""
    if touching == 0 or t >= p["torque_until"] or (p["wheel_sign"] < 0.0 and wheel <= 0.0):
        return 0.0
    fade = math.exp(-p.get("fade_time", 0.0) * t) * max(0.0, 1.0 - p.get("fade_speed", 0.0) * abs(wheel))
    rise = p.get("rise", 0.0)
    return p["torque"] * fade * (-math.expm1(-t / rise) if rise else 1.0)


def _push(p: Numbers, t: float, data: "mujoco.MjData", mu: float) -> tuple[tuple[float, float, float], Any]:
    """Forces on x, y and turn that MuJoCo has no element for, and the friction of each tip."""
    y, turn = data.qpos[1:3].tolist()
    vx, vy, omega = data.qvel[:3].tolist()
    wheel = abs(data.qvel[3] + omega)
    radius = max(p.get("ball", 0.0), _POINT)
    arm = p["length"] - radius  # to the centre of a tip's ball
    high, away = arm * np.cos(_GAMMA + turn) + radius, arm * np.sin(_GAMMA + turn)
    touching, into, slide = high > y, np.maximum(-(vy + away * omega), 0.0), vx - high * omega
    press = np.where(touching, p.get("drag", 0.0) * into**2, 0.0)
    friction = mu * (1.0 - p.get("vibration", 0.0) * (1.0 - math.exp(-wheel / p.get("vibration_speed", 1.0))))
    friction = friction * (1.0 + p.get("rate_change", 0.0) * (1.0 - np.exp(-np.abs(slide) / p.get("rate_speed", 1.0))))
    gust = p.get("gust", 0.0) * math.exp(-0.5 * ((t - p.get("gust_time", 0.0)) / 0.06) ** 2)
    return (gust, float(press.sum()), float((away * press).sum())), friction
