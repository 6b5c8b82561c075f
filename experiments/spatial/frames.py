"""Frames of a platform in space for ParaView: all of its spikes, and its hull (grains meet the ball inside)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupling import SpatialRun
from coupling.members import HULL, spatial_members
from experiments.grains.tracked_frames import PlatformFrames, member_mesh
from rigid.platform.solids import Mesh, merge

from .settings import SpatialSettings

__all__ = ["SpatialFrames"]

Array = NDArray[np.float64]


class SpatialFrames(PlatformFrames[SpatialRun]):
    """As `PlatformFrames`; `row_forces` are of each spike that touches. On the spring-damper `grains` is empty."""

    def __init__(self, settings: SpatialSettings, run: SpatialRun, folder: Path, *, resumed: bool) -> None:
        super().__init__(run, folder, settings, duration=settings.duration, resumed=resumed)
        platform = run.trial.platform
        hull = platform.hull()
        self.meshes = {"hull": Mesh(hull.vertices - platform.centre_of_mass, hull.faces)}
        if platform.tip_radius > 0:
            spikes = [member for member in spatial_members(platform) if member.row != HULL]
            self.meshes["spikes"] = merge([member_mesh(spike, segments=16) for spike in spikes])

    def values(self, run: SpatialRun) -> dict[str, float]:
        """The ground's force on the platform [N]."""
        return {f"force_{axis}": float(run.master.wrench.force[k]) for k, axis in enumerate("xyz")}

    def row_forces(self, run: SpatialRun, origin: Array) -> tuple[Array, dict[str, Array]]:
        """At the points of the last step's contacts; under a Coulomb bound the normal force alone."""
        last = run.master.last
        contacts = list(last.by_member.items()) if last is not None else []
        at = [origin + contact.point for _, contact in contacts]
        force = [
            np.array([0.0, 0.0, contact.normal_force])
            + (contact.tangential_force if contact.tangential_force is not None else 0.0)
            for _, contact in contacts
        ]
        numbers = np.array([float(row) for row, _ in contacts])
        return np.array(at).reshape(-1, 3), {"force": np.array(force).reshape(-1, 3), "row": numbers}
