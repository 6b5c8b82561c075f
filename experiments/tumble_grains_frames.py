"""Frames of a tumble on grains: the bed, and what of the platform is in it, for ParaView."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from coupling import BedFooting, CoupledTumble
from coupling.bed_footing import HULL
from rigid.quaternions import to_matrix
from rigid.solids import Mesh, merge
from vis.frames import GRAIN_FIELDS, FrameWriter
from vis.meshes import revolve, spike_mesh

from .tumble_settings import TumbleSettings

__all__ = ["TumbleFrames"]


class TumbleFrames:
    """Writes frames/tumble.pvd; the platform is its simulated slice, one spike a row and the hull's cylinder."""

    def __init__(self, settings: TumbleSettings, run: CoupledTumble, folder: Path, *, resumed: bool) -> None:
        self.interval = max(settings.duration / max(1, settings.frame_count), run.master.macro_step)
        if resumed:
            half = 0.5 * run.master.macro_step
            self.writer = FrameWriter(folder, name="tumble", resume=True, keep_until=max(run.time, 0.0) - half)
        else:
            self.writer = FrameWriter(folder, name="tumble")
        footing = run.footing
        assert isinstance(footing, BedFooting)
        parts = []
        for member in footing.members:
            if member.row == HULL:
                ends = (-member.below, member.length)
                profile = [(0.0, ends[0]), (member.radius, ends[0]), (member.radius, ends[1]), (0.0, ends[1])]
                points, triangles = revolve(np.array(profile), segments=64)
            else:
                points, triangles = spike_mesh(
                    "sphere", diameter=2 * member.radius, length=member.radius + member.length, segments=24
                )
                points = points - np.array([0.0, 0.0, member.radius])
            parts.append(Mesh(member.at + points @ to_matrix(member.turn).T, triangles))
        self.mesh = merge(parts)

    def write(self, run: CoupledTumble) -> None:
        """One frame of what there is now."""
        footing = run.footing
        assert isinstance(footing, BedFooting)
        pose = run.body.pose
        grains = footing.bed.grains()
        points = footing.origin + pose.position + self.mesh.vertices @ to_matrix(pose.turn).T
        force = run.master.wrench.force
        self.writer.write(
            run.time,
            {name: grains[name] for name in ("position", *GRAIN_FIELDS)},
            {"platform": (points, self.mesh.faces)},
            values={"theta_deg": math.degrees(float(run.body.place[2])), "force_x": force[0], "force_z": force[2]},
        )
