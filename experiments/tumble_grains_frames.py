"""Frames of a tumble on grains for ParaView: the bed and its surface, what of the platform is in it, contact forces."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from coupling import BedFooting, CoupledTumble
from coupling.bed_footing import HULL, Member
from rigid.quaternions import to_matrix
from rigid.solids import Mesh, merge
from vis.frames import GRAIN_FIELDS
from vis.meshes import revolve, spike_mesh

from .tracked_frames import TrackedFrames
from .tumble_settings import TumbleSettings

__all__ = ["TumbleFrames"]

class TumbleFrames(TrackedFrames):
    """Writes frames/tumble.pvd; the platform is its simulated slice, one spike a row and the hull's cylinder.

    Beside the grains a frame has `spikes` and `hull` as meshes; as points with a vector `force` [N] `row_forces` (on
    each row that touches, of all its spikes, mean of the last macro step) and `contact_forces` (of each grain on a
    simulated spike, that of the normal spring); and `surface`, a height map on a grid of half a grain with `height` and
    `change` [m], what the platform has left since the first frame.
    """

    def __init__(self, settings: TumbleSettings, run: CoupledTumble, folder: Path, *, resumed: bool) -> None:
        super().__init__(
            run, folder, duration=settings.duration, frame_count=settings.frame_count, grain=settings.grain,
            resumed=resumed,
        )  # fmt: skip
        footing = run.footing
        assert isinstance(footing, BedFooting)
        self.meshes = {
            name: merge([_mesh(member) for member in footing.members if (member.row == HULL) == (name == "hull")])
            for name in ("spikes", "hull")
            if any((member.row == HULL) == (name == "hull") for member in footing.members)
        }

    def write(self, run: CoupledTumble) -> None:
        """One frame of what there is now."""
        footing = run.footing
        assert isinstance(footing, BedFooting)
        pose = run.body.pose
        grains = footing.bed.grains()
        turn = to_matrix(pose.turn).T
        place = footing.origin + pose.position
        points, pushes = footing.pushes()
        rows, at, force = self._rows(run, place, turn)
        of_all = run.master.wrench.force
        self.writer.write(
            run.time,
            {name: grains[name] for name in ("position", *GRAIN_FIELDS)},
            {name: (place + mesh.vertices @ turn, mesh.faces) for name, mesh in self.meshes.items()},
            values={"theta_deg": math.degrees(float(run.body.place[2])), "force_x": of_all[0], "force_z": of_all[2]},
            clouds={
                "row_forces": (at, {"force": force, "row": rows}),
                "contact_forces": (points + footing.origin, {"force": pushes}),
            },
            maps={"surface": self.surface(footing, grains)},
        )

    def _rows(
        self, run: CoupledTumble, place: np.ndarray, turn: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers of the rows that touch, their lowest points in the bed [m], the forces on them [N]."""
        members = {member.row: member for member in run.footing.members}  # type: ignore[attr-defined]
        normal, along, _, _ = run.feet[-1]
        rows = np.flatnonzero(normal)
        at = [place + members[row].at @ turn - [0.0, 0.0, members[row].radius] for row in rows]
        force = np.column_stack([along[rows], np.zeros(len(rows)), normal[rows]])
        return rows.astype(float), np.array(at).reshape(-1, 3), force


def _mesh(member: Member) -> Mesh:
    """A member in body axes."""
    if member.row == HULL:
        ends = (-member.below, member.length)
        profile = [(0.0, ends[0]), (member.radius, ends[0]), (member.radius, ends[1]), (0.0, ends[1])]
        points, triangles = revolve(np.array(profile), segments=64)
    else:
        points, triangles = spike_mesh(
            "sphere", diameter=2 * member.radius, length=member.radius + member.length, segments=24
        )
        points = points - np.array([0.0, 0.0, member.radius])
    return Mesh(member.at + points @ to_matrix(member.turn).T, triangles)
