"""Trajectory angles of the cases that were computed on grains, kept beside the code (grains.toml)."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

__all__ = ["KeptAngle", "kept_angles"]


@dataclass(frozen=True, kw_only=True)
class KeptAngle:
    """One case on grains."""

    case: str  # Its folder under docs/results
    surface: str
    rig: float  # g_sim [9.80665 m/s2]
    torque: float  # [N m]
    angle: float  # Of the first 10 mm [degrees]


def kept_angles() -> tuple[KeptAngle, ...]:
    """All that are kept."""
    file = Path(__file__).with_name("grains.toml")
    return tuple(KeptAngle(**entry) for entry in tomllib.loads(file.read_text(encoding="utf-8"))["case"])
