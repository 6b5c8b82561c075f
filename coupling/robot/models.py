"""Models of MuJoCo: reading them, what is refused of them, the names in them."""

from pathlib import Path
from typing import Any

import numpy as np

from rigid.checks import alike, nearest
from rigid.checks.shipped import find_shipped
from rigid.checks.unfit import UnfitSettingsError

from .feet import refuse_missing

__all__ = [
    "LostRobotError", "actuators_of", "check_model", "examples", "find_model", "joints_of", "keyframe_of",
    "load_model", "refuse_lost", "rises", "switch_off_floors", "travels",
]  # fmt: skip

EXAMPLES = Path(__file__).parent / "examples"  # NAME is in mujoco-NAME: its model, and for some a controller
SOFTER = "use a smaller time step of the model, or softer gains"


class LostRobotError(UnfitSettingsError):
    """A robot cannot go on: its state or control is no number, or its controller fails. `remedy`: what to change."""

    def __init__(self, message: str, *, remedy: str) -> None:
        super().__init__(message)
        self.remedy = remedy


def examples(suffix: str) -> dict[str, Path]:
    """The examples that ship, by name: of each its one file with `suffix`."""
    files = sorted(EXAMPLES.glob(f"mujoco-*/*{suffix}"))
    return {file.parent.name.removeprefix("mujoco-"): file for file in files}


def find_model(name: str | Path) -> Path:
    """The file of a model: a path, or the name of an example that ships. Raises ValueError for neither."""
    shipped = examples(".xml")
    if found := find_shipped(name, shipped):
        return found
    beside = alike(name) if Path(name).suffix else ""
    raise ValueError(
        f"model = {str(name)!r}: there is no such file{beside}; an MJCF or URDF file is accepted, or an "
        f"example that ships: {nearest(str(name), shipped)}"
    )


def load_model(path: str | Path) -> Any:
    """The MuJoCo model in an MJCF or URDF file, or of an example that ships: hedgehog, hopper or wheel.

    Raises ValueError for a file that is not there or no model.
    """
    mujoco, path = refuse_missing(), find_model(path)
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        said = " ".join(str(error).split())
        if "package:" in said:
            said += "; MuJoCo finds no ROS packages: write the file's place from the folder of the model instead"
        raise ValueError(f"model = {str(path)!r} is no model that MuJoCo reads: {said}") from None


def check_model(model: Any) -> None:
    """Raise ValueError for an integrator that cannot be stepped in halves and for gravity that is not straight down."""
    if int(model.opt.integrator) == int(refuse_missing().mjtIntegrator.mjINT_RK4):
        raise ValueError(
            "the model's integrator is RK4, which cannot be stepped in halves: expected implicitfast or Euler"
        )
    gravity = np.asarray(model.opt.gravity)
    if gravity[0] or gravity[1] or gravity[2] > 0:
        raise ValueError(f"the model's gravity is {gravity.tolist()} m/s2: expected straight down (0, 0, -g)")


def keyframe_of(model: Any, name: str) -> int:
    """The number of a keyframe. Raises ValueError, naming those there are, for another."""
    mujoco = refuse_missing()
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_KEY, k) for k in range(model.nkey)]
    if name not in names:
        raise ValueError(f"keyframe = {name!r}: the model has {', '.join(filter(None, names)) or 'no keyframes'}")
    return names.index(name)


def switch_off_floors(model: Any) -> tuple[str, ...]:
    """Planes and height fields of the world touch nothing from now on; their names."""
    mujoco = refuse_missing()
    flat = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
    found = []
    for k in range(model.ngeom):
        if int(model.geom_type[k]) in flat and (model.geom_contype[k] or model.geom_conaffinity[k]):
            model.geom_contype[k] = model.geom_conaffinity[k] = 0
            found.append(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, k) or f"geom {k}")
    return tuple(found)


def rises(model: Any, data: Any) -> list[tuple[int, float]]:
    """The free joints and upright rails at the roots: the place of their height in qpos, and its sense, 1 or -1."""
    kinds, found = refuse_missing().mjtJoint, []
    for joint in range(model.njnt):
        place, up = int(model.jnt_qposadr[joint]), float(data.xaxis[joint, 2])
        rooted = model.body_weldid[model.body_parentid[model.jnt_bodyid[joint]]] == 0
        if model.jnt_type[joint] == int(kinds.mjJNT_FREE):
            found.append((place + 2, 1.0))
        elif rooted and model.jnt_type[joint] == int(kinds.mjJNT_SLIDE) and abs(up) > 1 - 1e-9:
            found.append((place, up))
    return found


def travels(model: Any, data: Any) -> bool:
    """Whether a root can move along the ground: by a free joint, or a slide that is not upright."""
    kinds = refuse_missing().mjtJoint
    for joint in range(model.njnt):
        rooted = model.body_weldid[model.body_parentid[model.jnt_bodyid[joint]]] == 0
        level = np.hypot(*data.xaxis[joint, :2]) > 1e-3
        if model.jnt_type[joint] == int(kinds.mjJNT_FREE):
            return True
        if rooted and model.jnt_type[joint] == int(kinds.mjJNT_SLIDE) and level:
            return True
    return False


def refuse_lost(data: Any) -> None:
    """Raise LostRobotError where MuJoCo has found a state or a control that is no number, or too large for it."""
    kinds = refuse_missing().mjtWarning
    for kind, what in (
        (kinds.mjWARN_BADCTRL, "control (data.ctrl)"),
        (kinds.mjWARN_BADQPOS, "position (data.qpos)"),
        (kinds.mjWARN_BADQVEL, "velocity (data.qvel)"),
        (kinds.mjWARN_BADQACC, "acceleration (data.qacc)"),
    ):
        warning = data.warning[int(kind)]
        if warning.number:
            by_control = kind == kinds.mjWARN_BADCTRL
            raise LostRobotError(
                f"the robot is lost at {data.time:g} s: MuJoCo found a {what} that is no number or too large, "
                f"number {warning.lastinfo}",
                remedy="mend the controller" if by_control else SOFTER,
            )
    if not np.isfinite(data.qpos).all():
        raise LostRobotError(f"the robot is lost at {data.time:g} s: its position is no number", remedy=SOFTER)


def joints_of(model: Any) -> list[tuple[str, str, int, int]]:
    """Name, kind (free, ball, slide, hinge) and first place in qpos and qvel of every joint."""
    mujoco = refuse_missing()
    return [
        (
            mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, k) or f"joint_{k}",
            mujoco.mjtJoint(int(model.jnt_type[k])).name.removeprefix("mjJNT_").lower(),
            int(model.jnt_qposadr[k]),
            int(model.jnt_dofadr[k]),
        )
        for k in range(model.njnt)
    ]


def actuators_of(model: Any) -> list[str]:
    """The names of the actuators."""
    mujoco = refuse_missing()
    return [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) or f"actuator_{k}" for k in range(model.nu)]
