"""What a platform gives a tumble: its numbers in the plane, and a motor's torque that ends at the wheel's limit.

The wheel's limit is one rule, here as in `rigid.spatial.spatial`: a start above it is refused, and a motor whose
wheel comes to it gives no more torque.
"""

import math
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.runs.given import keep_given, kept_copy
from rigid.model.model import contact_arms
from rigid.model.trial import Trial
from rigid.planar.dynamics import System
from rigid.planar.simulate import simulate
from rigid.planar.trajectory import Trajectory
from rigid.platform.files import find_platform, platform_file
from rigid.platform.platform import Platform

from . import say

__all__ = ["PLATFORM_COPY", "PlatformNumbers", "keep_platform", "platform_numbers", "tip_angles", "tip_depth"]

SPIKE_LENGTHS = {"hedgehog": 0.2}
"""l [m] where the paper gives it: its octagon is 0.4 m across, and the edge of 0.153 m is rounded."""


@dataclass(frozen=True)
class PlatformNumbers:
    """What the planar model takes from a platform, and what its wheel can do."""

    name: str
    mass: float
    inertia: float
    spike_length: float
    lean: float  # angle from the vertical of the line from the leading tips to the centre, at rest [rad]
    spike_count: int | None  # rows of tips at equal angles; None where they are not
    wheel_inertia: float
    max_motor_torque: float
    brake_torque: float
    brake_time: float | None  # in which the brake stops the wheel from any speed [s]; None: it has a torque
    max_wheel_speed: float
    spike_diameter: float  # of shafts and ball tips [m]; 0 where it has no spikes
    spike_clear: float  # how far a spike stands out of the hull, along itself [m]; 0 where it has none

    @property
    def brake_words(self) -> str:
        """What slows the platform's wheel: a platform file without a brake_torque lets the motor do it."""
        own = self.brake_torque > self.max_motor_torque or math.isinf(self.brake_torque) or self.brake_time is not None
        return "the brake" if own else "the motor"


def platform_numbers(name: str, *, file: Path | None = None, in_plane: bool = True) -> PlatformNumbers:
    """The numbers of a platform that ships, by name, or of the TOML file `name`; `file` stands in for a copied one.

    Raises ValueError for none and, unless `in_plane` is false, for one that is no regular polygon seen from the side.
    """
    platform = find_platform(name if file is None else file)
    wheel, stance = platform.wheel(), platform.stance()
    count: int | None = None
    with nullcontext() if in_plane else suppress(ValueError):
        count = _spike_count(name, platform)
    return PlatformNumbers(
        name=name,
        mass=platform.mass,
        inertia=platform.moment(),
        spike_length=SPIKE_LENGTHS.get(name, stance.spike_length),
        lean=stance.lean,
        spike_count=count,
        wheel_inertia=wheel.inertia,
        max_motor_torque=wheel.motor_torque,
        brake_torque=wheel.brake_torque,
        brake_time=wheel.brake_time,
        max_wheel_speed=wheel.max_speed,
        spike_diameter=2 * platform.tip_radius,
        spike_clear=platform.spike_clear,
    )


def _spike_count(name: str, platform: Platform) -> int:
    """Rows of tips on the circle about the wheel's axis. Raises ValueError where they are not at equal angles."""
    across, lean = platform.tips[:, [0, 2]], platform.stance().lean
    far = np.hypot(across[:, 0], across[:, 1])
    reach = float(far.max())
    rows = np.unique(np.round(np.degrees(np.arctan2(across[:, 0], -across[:, 1]))[far > reach * (1 - 1e-6)] % 360, 6))
    apart = np.diff([*rows, rows[0] + 360])
    if np.abs(apart - 2 * math.degrees(lean)).max() > 1e-4:
        gaps = " and ".join(f"{gap:.3g}" for gap in dict.fromkeys(np.round(apart, 3)))
        raise ValueError(say("uneven_rows", name=name, rows=len(rows), gaps=gaps))
    between = far[far <= reach * (1 - 1e-6)]
    if len(between) and between.max() > reach * math.cos(lean):
        raise ValueError(say("tips_between", name=name, between=between.max(), reach=reach))
    return len(rows)


def torque_within_limit(
    trial: Trial, *, max_wheel_speed: float, duration: float, method: Any = "located"
) -> tuple[Trial, float | None]:
    """`trial` with its torque ended where a motor's wheel comes to `max_wheel_speed` [rad/s], and when that is [s].

    None, and the unchanged trial, where the wheel does not reach it within `duration` [s]. The wheel only gains speed,
    so ending the torque then equals a motor without torque.
    """
    gain = trial.torque / trial.wheel_inertia
    if trial.actuator != "motor" or trial.wheel_speed_0 + gain * min(duration, trial.torque_until) <= max_wheel_speed:
        return trial, None
    run = simulate(trial, duration=duration, method=method, sample_interval=min(1e-3, duration))
    if run.wheel_speed[-1] <= max_wheel_speed:
        return trial, None
    time = _when(run, max_wheel_speed)
    return replace(trial, torque_until=time), time


def _when(run: Trajectory, speed: float) -> float:
    """When the wheel comes to `speed` [s]. Between two rows it gains evenly while a spike touches, and nothing else."""
    last = int(np.argmax(run.wheel_speed > speed))
    first = max(last - 1, 0)
    changes = [(float(time), state) for time, state, _ in run.transitions if time < run.time[last]]
    state = next((state for time, state in reversed(changes) if time <= run.time[first]), "stand")
    later = [(time, state) for time, state in changes if time > run.time[first]]
    edges = [float(run.time[first]), *(time for time, _ in later)]
    touching = [one != "hop" for one in (state, *(after for _, after in later))]
    spans = np.diff([*edges, float(run.time[last])]) * touching
    gained = run.wheel_speed[last] - run.wheel_speed[first]
    left = (speed - run.wheel_speed[first]) / gained * float(spans.sum())
    for edge, span in zip(edges, spans, strict=True):
        if left <= span and span > 0:
            return edge + float(left)
        left -= span
    return float(run.time[last])


Array = NDArray[np.float64]


def tip_angles(count: int, theta: Array) -> Array:
    """Angle of each of `count` rows' spikes from straight down, clockwise [rad], shape [step, row]; theta as [step]."""
    half = math.pi / count
    return np.asarray(theta[:, None] + half + 2 * half * np.arange(count))


def tip_depth(theta: Array, y: Array, *, count: int, length: float, radius: float = 0.0) -> Array:
    """Depth of each row's lowest point below the undisturbed surface [m], negative above it, shape [step, row].

    The model's own (`rigid.model.model`), on a slope too, whose y is normal to the surface. theta [rad] and y
    [m] have shape [step]; `radius` [m] is that of balls which spikes of `length` end in, 0 where they end in points.
    """
    angles = tip_angles(count, theta)
    height, _ = contact_arms(np.cos(angles), np.sin(angles), length, radius)
    return np.asarray(height - y[:, None])


def ball_radius(trial: Trial) -> float:
    """Radius of the balls that its effects put on the tips [m]; 0 without."""
    return float(System(trial).radius)


PLATFORM_COPY = "platform.toml"
"""The copy's name in the run's folder."""


def keep_platform(name: str, folder: Path, message: Callable[[str], object] | None = None) -> Path | None:
    """The copy in ``folder`` of the platform's file ``name``, made if missing; None for a platform that ships.

    ``message`` is called where the file differs from the copy. Raises ValueError for a bad file without a copy, and for
    a damaged copy.
    """
    kept = kept_copy(folder, PLATFORM_COPY)
    if kept is None:
        if platform_file(name) != Path(name):
            return None
        find_platform(name)
        kept = keep_given(folder, PLATFORM_COPY, Path(name).read_bytes())
    elif message is not None and not _same(Path(name), kept):
        message(say("changed", name=name, kept=kept))
    return kept


def _same(file: Path, kept: Path) -> bool:
    try:
        return file.read_text(encoding="utf-8") == kept.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
