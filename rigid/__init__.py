"""The platform and the surface laws of the paper's model; knows nothing of grains.

The planar model is loaded with the package. The platforms, hop theory and the spatial model are loaded when first asked
for, since scipy takes longer to load than a tumble to integrate.

Imports nothing of ours outside itself.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import hedgebed_renamed  # noqa: F401  (old names of modules)

from .batch.simulate import BatchTrajectory, simulate_batch
from .ground.grounds import SpringDamper, SurfaceGround
from .ground.laws import GROUNDS
from .ground.reaction import Contact, Reaction
from .model.trial import Effect, Ground, Trial
from .planar.simulate import simulate
from .planar.trajectory import STATES, Trajectory
from .platform.spike import Section, Spike
from .terms import EFFECTS, Term

if TYPE_CHECKING:
    from .ground_file import GroundFile, read_ground
    from .hop import (
        Flight,
        Launch,
        Tumbler,
        brake_launch,
        escape_speed,
        flight,
        impulsive_launch,
        launch,
        launch_speed_for,
        least_viable_angle,
    )
    from .platform.actuation import Flywheel, TorqueHistory
    from .platform.files import find_platform, platform_names, read_platform
    from .platform.platform import Platform, Stance
    from .spatial.spatial import SpatialTrajectory, SpatialTrial
    from .spatial.spatial import simulate as simulate_spatial

__all__ = [
    "EFFECTS", "GROUNDS", "STATES", "BatchTrajectory", "Contact", "Effect", "Flight", "Flywheel", "Ground",
    "GroundFile", "Launch",
    "Platform", "Reaction", "Section", "SpatialTrajectory", "SpatialTrial", "SpringDamper", "Spike", "Stance",
    "SurfaceGround", "Term", "TorqueHistory", "Trajectory", "Trial", "Tumbler", "brake_launch", "escape_speed",
    "find_platform", "flight", "impulsive_launch", "launch", "launch_speed_for", "least_viable_angle", "platform_names",
    "read_ground", "read_platform", "simulate", "simulate_batch", "simulate_spatial",
]  # fmt: skip

_LATER = {
    "ground_file": ("GroundFile", "read_ground"),
    "platform.actuation": ("Flywheel", "TorqueHistory"),
    "hop": (
        "Flight", "Launch", "Tumbler", "brake_launch", "escape_speed", "flight", "impulsive_launch", "launch",
        "launch_speed_for", "least_viable_angle",
    ),
    "platform.platform": ("Platform", "Stance"),
    "platform.files": ("find_platform", "platform_names", "read_platform"),
    "spatial.spatial": ("SpatialTrajectory", "SpatialTrial", "simulate_spatial"),
}  # fmt: skip
_HOME = {name: module for module, names in _LATER.items() for name in names}
_NAME_AT_HOME = {"simulate_spatial": "simulate"}


def __getattr__(name: str) -> Any:
    """Load what comes later, or the module that holds it."""
    if name in _LATER:
        return import_module(f".{name}", __name__)
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), _NAME_AT_HOME.get(name, name))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
