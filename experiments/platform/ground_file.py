"""A law from a ground file under a platform: the file that a run keeps, and whether a tumble leaves its range."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import BaseModel

from experiments.runs.given import keep_given, kept_copy
from rigid.ground_file import GroundFile, is_ground_file, read_ground
from rigid.model.trial import Trial
from rigid.planar.trajectory import Trajectory
from rigid.platform.rig import STANDARD_GRAVITY

from . import say
from .numbers import ball_radius, tip_angles, tip_depth

__all__ = [
    "GROUND_COPY", "SPIKES_PER_ROW", "fitted_ground", "law_warnings", "naming_gravity", "range_warnings", "reached",
    "with_kept_ground",
]  # fmt: skip

GROUND_COPY = "ground.toml"
"""The copy's name in the run's folder."""
SPIKES_PER_ROW = 2.0  # The platform stands on two rows of two
Settings = TypeVar("Settings", bound=BaseModel)


def fitted_ground(ground: str | None) -> GroundFile | None:
    """The file that a setting `ground` names; None where it names a law, a bed or nothing.

    Raises ValueError, naming the file and each fault in it.
    """
    return read_ground(ground) if ground is not None and is_ground_file(ground) else None


def with_kept_ground(settings: Settings, folder: Path) -> Settings:
    """`settings` whose `ground`, if it is a file, is the copy of it in the run's folder, made if missing."""
    ground: str | None = settings.ground  # type: ignore[attr-defined]
    if ground is None or not is_ground_file(ground):
        return settings
    copy = kept_copy(folder, GROUND_COPY)
    if copy is None:
        read_ground(ground)
        copy = keep_given(folder, GROUND_COPY, Path(ground).read_bytes())
    return settings.model_copy(update={"ground": str(copy)})


def reached(trajectory: Trajectory, *, spikes_per_row: float = SPIKES_PER_ROW) -> dict[str, float]:
    """Largest load on one spike [N], depth of a tip [m] and speed at which a tip goes in [m/s] at the samples.

    The load is that of the trial's law at each depth and speed, without its effects. All are 0 if nothing touches.
    """
    trial = trajectory.trial
    radius = ball_radius(trial)
    depth = tip_depth(trajectory.theta, trajectory.y, count=trial.spike_count, length=trial.spike_length, radius=radius)
    arms = (trial.spike_length - radius) * np.sin(tip_angles(trial.spike_count, trajectory.theta))
    rate = -arms * trajectory.omega[:, None] - trajectory.vy[:, None]
    touching = depth > 0
    if not touching.any():
        return {"load": 0.0, "depth": 0.0, "speed": 0.0}
    law, numbers = trial.surface.law, trial.surface.numbers
    pairs = zip(depth[touching].tolist(), rate[touching].tolist(), strict=True)
    load = max(law.force(z, v, numbers) for z, v in pairs) / spikes_per_row
    return {"load": load, "depth": float(depth.max()), "speed": max(0.0, float(rate[touching].max()))}


def range_warnings(
    fitted: GroundFile | None, trajectory: Trajectory, *, gravity: float, diameter: float, count: float = SPIKES_PER_ROW
) -> list[str]:
    """One warning for each number of a tumble outside the range of the law; `gravity` [m/s2] is that of the grains.

    `diameter` [m] is that of the tips, of which `count` press side by side. What stays below a range is not reported
    for load, depth and speed: every landing begins there.
    """
    if fitted is None:
        return []
    most = {
        name: max(value, fitted.range[name][0])
        for name, value in reached(trajectory, spikes_per_row=count).items()
    }  # fmt: skip
    other = _other_gravity(fitted, gravity, in_rig=trajectory.trial.counterweight > 0)
    return ([other] if other else []) + [
        say("beyond_range", sentence=sentence, fitted=fitted) for sentence in fitted.beyond(**most, diameter=diameter)
    ]


@contextmanager
def naming_gravity(fitted: GroundFile | None, trial: Trial) -> Iterator[None]:
    """Put before the ValueError of a trial that the law of `fitted` is of grains under another gravity, if it is."""
    try:
        yield
    except ValueError as error:
        other = fitted and _other_gravity(fitted, trial.gravity, in_rig=trial.counterweight > 0)
        if not other:
            raise
        raise ValueError(f"{other}. {str(error)[:1].upper()}{str(error)[1:]}") from None


def _other_gravity(fitted: GroundFile, gravity: float, *, in_rig: bool) -> str:
    """Of which gravity the file is, if not of that of the grains [m/s2], and how to get the right one; else ""."""
    if not fitted.beyond(gravity=gravity):
        return ""
    low, high = (f"{limit / STANDARD_GRAVITY:.4g} g" for limit in fitted.range["gravity"])
    was, here = low if low == high else f"{low} to {high}", f"{gravity / STANDARD_GRAVITY:.4g}"
    return say("other_gravity_rig" if in_rig else "other_gravity", was=was, here=here, fitted=fitted)


def law_warnings(fitted: GroundFile | None) -> list[str]:
    """Warnings: what a law under a platform cannot predict for grains, and whether the answer has an uncertainty."""
    if fitted is None:
        return []
    sure = [name for name, estimate in fitted.parameters.items() if estimate.std == 0]
    said = [say("law_knows_not", fitted=fitted)]
    return said + ([say("law_is_exact", fitted=fitted)] if len(sure) == len(fitted.parameters) else [])
