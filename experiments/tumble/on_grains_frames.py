"""Frames of a tumble on grains for ParaView: the simulated slice, one spike a row and the hull's cylinder."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupling import BedGround, CoupledTumble
from coupling.members import HULL
from experiments.grains.tracked_frames import PlatformFrames, member_mesh
from rigid.platform.solids import merge
from rigid.spatial.quaternions import to_matrix

from .settings import TumbleSettings

__all__ = ["TumbleFrames"]

Array = NDArray[np.float64]


class TumbleFrames(PlatformFrames[CoupledTumble]):
    """As `PlatformFrames`; `row_forces` are of all spikes of a row, means of the last macro step."""

    def __init__(self, settings: TumbleSettings, run: CoupledTumble, folder: Path, *, resumed: bool) -> None:
        super().__init__(run, folder, settings, duration=settings.duration, resumed=resumed)
        parts = {
            name: [member_mesh(member, segments=24) for member in _ground(run).members if (member.row == HULL) == hull]
            for name, hull in (("spikes", False), ("hull", True))
        }
        self.meshes = {name: merge(meshes) for name, meshes in parts.items() if meshes}

    def values(self, run: CoupledTumble) -> dict[str, float]:
        """The angle, and the ground's force on the platform [N]."""
        force = run.master.wrench.force
        return {"theta_deg": math.degrees(float(run.body.place[2])), "force_x": force[0], "force_z": force[2]}

    def row_forces(self, run: CoupledTumble, origin: Array) -> tuple[Array, dict[str, Array]]:
        """At the lowest points of the rows that touch."""
        pose = run.body.pose
        place, turn = origin + pose.position, to_matrix(pose.turn).T
        members = {member.row: member for member in _ground(run).members}
        normal, along, _, _ = run.feet[-1]
        rows = np.flatnonzero(normal)
        touching = [members[int(row)] for row in rows]
        at = [place + member.at @ turn - [0.0, 0.0, member.radius] for member in touching]
        force = np.column_stack([along[rows], np.zeros(len(rows)), normal[rows]])
        return np.array(at).reshape(-1, 3), {"force": force, "row": rows.astype(float)}


def _ground(run: CoupledTumble) -> BedGround:
    assert isinstance(run.ground, BedGround)
    return run.ground
