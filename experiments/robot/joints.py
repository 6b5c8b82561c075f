"""How far the joints of a robot go beyond their ranges: limits of MuJoCo are soft."""

import numpy as np

from coupling.robot import RobotRun
from coupling.robot.models import joints_of

from . import say

__all__ = ["beyond_range"]

BEYOND = 0.1
"""Share of its range that a joint may go beyond it without a warning [1]: one that rests on its limit gives way a
little."""


def beyond_range(run: RobotRun) -> list[str]:
    """A sentence for each hinge and slide that went beyond its range by more than `BEYOND` of it."""
    model, places = run.robot.model, run.joints["qpos"]
    found = []
    for joint, (name, kind, at, _) in enumerate(joints_of(model)):
        if kind not in ("hinge", "slide") or not model.jnt_limited[joint]:
            continue
        low, high = (float(end) for end in model.jnt_range[joint])
        past = np.maximum(places[:, at] - high, low - places[:, at])
        most = int(past.argmax())
        if past[most] <= BEYOND * (high - low):
            continue
        unit, times = ("°", 180 / np.pi) if kind == "hinge" else (" mm", 1e3)
        words = {"past": float(past[most]), "low": low, "high": high}
        scaled = {key: f"{times * value:.3g}{unit}" for key, value in words.items()}
        found.append(say("joint_beyond", name=name, time=float(run.columns["time"][most]), **scaled))
    return found
