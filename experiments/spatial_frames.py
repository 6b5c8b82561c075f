"""Frames of a platform in space for ParaView: grains and their surface, the platform as it is, contact forces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedFooting, SpatialRun
from coupling.bed_footing import HULL, Member, spatial_members
from rigid.quaternions import to_matrix
from rigid.solids import Mesh, merge
from vis.frames import GRAIN_FIELDS
from vis.meshes import spike_mesh

from .spatial_settings import SpatialSettings
from .tracked_frames import TrackedFrames

__all__ = ["SpatialFrames"]

class SpatialFrames(TrackedFrames):
    """Writes frames/tumble.pvd.

    A frame has `spikes` and `hull` as meshes, the hull as the platform has it (grains meet the ball inside);
    `row_forces`, the force on each spike that touches, as points with a vector `force` [N]; on a bed `grains`,
    `contact_forces` and `surface` besides, as frames of a planar tumble have them. On the spring-damper `grains` is
    empty.
    """

    def __init__(self, settings: SpatialSettings, run: SpatialRun, folder: Path, *, resumed: bool) -> None:
        super().__init__(
            run, folder, duration=settings.duration, frame_count=settings.frame_count, grain=settings.grain,
            resumed=resumed,
        )  # fmt: skip
        platform = run.trial.platform
        hull = platform.hull()
        self.meshes = {"hull": Mesh(hull.vertices - platform.centre_of_mass, hull.faces)}
        if platform.tip_radius > 0:
            spikes = [_mesh(member) for member in spatial_members(platform) if member.row != HULL]
            self.meshes["spikes"] = merge(spikes)

    def write(self, run: SpatialRun) -> None:
        """One frame of what there is now."""
        pose = run.body.pose
        turn = to_matrix(pose.turn).T
        footing = run.footing
        origin = footing.origin if isinstance(footing, BedFooting) else np.zeros(3)
        grains: dict[str, Any] = {"position": np.zeros((0, 3)), "radius": np.zeros(0)}
        clouds: dict[str, Any] = {"row_forces": self._rows(run, origin)}
        maps = {}
        if isinstance(footing, BedFooting):
            seen = footing.bed.grains()
            grains = {name: seen[name] for name in ("position", *GRAIN_FIELDS)}
            points, pushes = footing.pushes()
            clouds["contact_forces"] = (points + origin, {"force": pushes})
            maps["surface"] = self.surface(footing, seen)
        of_all = run.master.wrench.force
        self.writer.write(
            run.time, grains,
            {name: (origin + pose.position + mesh.vertices @ turn, mesh.faces) for name, mesh in self.meshes.items()},
            values={f"force_{axis}": float(of_all[k]) for k, axis in enumerate("xyz")}, clouds=clouds, maps=maps,
        )  # fmt: skip

    def _rows(self, run: SpatialRun, origin: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The points of the last step's contacts, and the forces there; under a Coulomb bound the normal one."""
        last = run.master.last
        contacts = list(last.contacts.items()) if last is not None else []
        at = [origin + contact.point for _, contact in contacts]
        force = [
            np.array([0.0, 0.0, contact.normal_force])
            + (contact.tangential_force if contact.tangential_force is not None else 0.0)
            for _, contact in contacts
        ]
        numbers = np.array([float(row) for row, _ in contacts])
        return np.array(at).reshape(-1, 3), {"force": np.array(force).reshape(-1, 3), "row": numbers}


def _mesh(member: Member) -> Mesh:
    """A spike in body axes."""
    points, triangles = spike_mesh(
        "sphere", diameter=2 * member.radius, length=member.radius + member.length, segments=16
    )
    points = points - np.array([0.0, 0.0, member.radius])
    return Mesh(member.at + points @ to_matrix(member.turn).T, triangles)
