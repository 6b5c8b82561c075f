"""Trajectory angles of the cases that were computed on grains, kept beside the code (grains.toml)."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = ["AngleOfBeds", "KeptAngle", "SpringAngle", "angles_of_beds", "kept_angles", "packed_angles", "spring_angles"]


@dataclass(frozen=True, kw_only=True)
class KeptAngle:
    """One case on grains."""

    case: str  # Its folder under docs/results
    surface: str  # Of `hedgebed paper`, beside which it stands
    grains: str  # Today's name of the material that was computed
    rig: float  # g_sim [9.80665 m/s2]
    torque: float  # [N m]
    angle: float  # Of the first 10 mm [degrees]


@dataclass(frozen=True, kw_only=True)
class AngleOfBeds:
    """The same tumble on one or several beds of one grain size (docs/results/tumble-sand and paper-signs)."""

    surface: str  # Of `hedgebed paper`, beside which it stands
    grains: str  # The material that was computed
    rig: float  # g_sim [9.80665 m/s2]
    torque: float  # [N m]
    grain: float  # Mean diameter [mm]
    angles: list[float]  # Of the first 10 mm, one a bed [degrees]


@dataclass(frozen=True, kw_only=True)
class SpringAngle:
    """An angle on the spring-damper with its error by those of K and C (docs/notes/calibrate.md)."""

    surface: str
    rig: float  # g_sim [9.80665 m/s2]
    torque: float  # [N m]
    angle: float  # Of the first 10 mm [degrees]
    std: float  # Standard deviation by those of K and C [degrees]


def kept_angles() -> tuple[KeptAngle, ...]:
    """Those of one bed each."""
    return tuple(KeptAngle(**entry) for entry in _tables("case"))


def angles_of_beds() -> tuple[AngleOfBeds, ...]:
    """Those of several beds each."""
    return tuple(AngleOfBeds(**entry) for entry in _tables("beds"))


def packed_angles() -> tuple[AngleOfBeds, ...]:
    """Those of JSC-1A of the right cohesion and density, one bed each."""
    return tuple(AngleOfBeds(**entry) for entry in _tables("packed"))


def spring_angles() -> tuple[SpringAngle, ...]:
    """Those on the spring-damper whose error by K and C was computed."""
    return tuple(SpringAngle(**entry) for entry in _tables("spring"))


def _tables(name: str) -> Any:
    """The tables of grains.toml with a name."""
    return tomllib.loads(Path(__file__).with_name("grains.toml").read_text(encoding="utf-8"))[name]
