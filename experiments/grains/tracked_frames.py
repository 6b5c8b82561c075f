"""Frames of a platform for ParaView: the bed and its surface, the platform, contact forces, one file a moment.

A frame has the meshes `spikes` and `hull`. `row_forces` is the force on each row or spike that touches, as points with
a vector `force` [N]. On a bed it has the grains and `contact_forces` (of each grain on a spike, that of the normal
spring). `surface` is a height map on a grid of half a grain with `height` and `change` [m] since the first frame. One
further frame is near the moment of the largest force, as far as a kind of run has it (`PlatformFrames.push`).
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from coupling import BedGround, CoupledTumble, SpatialRun
from coupling.members import HULL, Member
from coupling.robot import RobotRun
from dem import Grains
from experiments.runs.types import Json
from rigid.platform.solids import Mesh
from rigid.spatial.quaternions import to_matrix
from vis.pictures.frames import GRAIN_FIELDS, FrameWriter, HeightMap, frames_of, read_frames
from vis.pictures.meshes import revolve, spike_mesh
from vis.pictures.tracks import height_map, lying

from .settings import GrainsSettings

__all__ = ["HARDER", "PlatformFrames", "member_mesh"]

HARDER = 1.05
"""Over the largest force of all frames so far: from there on a moment gets the frame of its own [1]."""

Array = NDArray[np.float64]
Run = TypeVar("Run", bound=CoupledTumble | SpatialRun | RobotRun)


class PlatformFrames(ABC, Generic[Run]):
    """Writes frames/tumble.pvd, or of another `name`, and continues it after a stop."""

    name = "tumble"

    def __init__(self, run: Run, folder: Path, settings: GrainsSettings, *, resumed: bool) -> None:
        self.interval = max(run.duration / max(1, settings.frame_count), run.master.macro_step)
        self.meshes = self.body_meshes(run)
        self._untouched: HeightMap | None = None
        self._spacing = 0.5 * settings.grain
        keep_until = max(run.time, 0.0) - 0.5 * run.master.macro_step if resumed else None
        name = (frames_of(folder) if resumed else None) or self.name  # a run may have begun under an earlier name
        self.writer = FrameWriter(folder, name=name, resume=resumed, keep_until=keep_until)
        self._hardest = self.least_push(run)
        if resumed and self.writer.times:
            frames = read_frames(folder, name)
            self._untouched = frames[0].maps.get("surface")
            self._hardest = max(self._hardest, *(self.push(frame.values) for frame in frames))
            self.watch(run)  # The moment of the checkpoint itself, whose frame was removed

    @abstractmethod
    def body_meshes(self, run: Run) -> dict[str, Mesh]:
        """`spikes` and `hull`, as far as there are any, in body axes."""

    @abstractmethod
    def values(self, run: Run) -> dict[str, float]:
        """Numbers of a frame."""

    @abstractmethod
    def row_forces(self, run: Run, origin: Array) -> tuple[Array, dict[str, Array]]:
        """Where rows or spikes touch [m], with `origin` of the bed, and `force` [N] and `row` there."""

    def push(self, values: Mapping[str, float]) -> float:
        """The force of a frame by its `values` [N], whose largest has a frame of its own; 0 where none has."""
        return 0.0

    def least_push(self, run: Run) -> float:
        """The force from which on a moment can have a frame of its own [N]."""
        return 0.0

    def watch(self, run: Run) -> None:
        """Write a frame where the force is by `HARDER` larger than in all frames before."""
        if self.push(self.values(run)) > HARDER * self._hardest:
            self.write(run, own_moment=True)

    def write(self, run: Run, *, own_moment: bool = False) -> None:
        """One frame of what there is now; without a bed it has no grains."""
        values = self.values(run)
        self._hardest = max(self._hardest, self.push(values))
        ground = run.ground
        origin = ground.origin if isinstance(ground, BedGround) else np.zeros(3)
        grains: Json = {"position": np.zeros((0, 3)), "radius": np.zeros(0)}
        clouds: Json = {"row_forces": self.row_forces(run, origin)}
        maps = {}
        if isinstance(ground, BedGround):
            seen = ground.bed.grains()
            arrays = seen.as_dict()
            grains = {name: arrays[name] for name in ("position", *GRAIN_FIELDS)}
            points, pushes = ground.pushes()
            clouds["contact_forces"] = (points + origin, {"force": pushes})
            maps["surface"] = self._surface(ground, seen)
        self.writer.write(
            run.time, grains, self.placed(run, origin), values=values, clouds=clouds, maps=maps, own_moment=own_moment,
        )  # fmt: skip

    def placed(self, run: Run, origin: Array) -> Mapping[str, tuple[Array, NDArray[np.int64]]]:
        """The meshes where they are now: name -> points [m], shape (n, 3), and triangles; `origin` of the bed."""
        pose = run.body.pose
        turn = to_matrix(pose.turn).T
        return {name: (origin + pose.position + mesh.vertices @ turn, mesh.faces) for name, mesh in self.meshes.items()}

    def _surface(self, ground: BedGround, grains: Grains) -> HeightMap:
        """The height map of what there is now."""
        size = ground.bed.size
        found = height_map(
            grains.position, grains.radius, (float(size[0]), float(size[1])), spacing=self._spacing,
            lies=lying(grains.position, grains.radius),
        )  # fmt: skip
        # A resumed run reads the first map from its frame, which keeps float32: both runs take the change from that.
        found.fields["height"] = found.fields["height"].astype(np.float32)
        if self._untouched is None:
            self._untouched = found
        found.fields["change"] = found.fields["height"] - self._untouched.fields["height"]
        return found


def member_mesh(member: Member, *, segments: int) -> Mesh:
    """A spike, of `segments` around, or the hull's cylinder, in body axes."""
    if member.row == HULL:
        ends = (-member.below, member.length)
        profile = [(0.0, ends[0]), (member.radius, ends[0]), (member.radius, ends[1]), (0.0, ends[1])]
        points, triangles = revolve(np.array(profile), segments=64)
    else:
        length = member.radius + member.length
        points, triangles = spike_mesh("sphere", diameter=2 * member.radius, length=length, segments=segments)
        points = points - np.array([0.0, 0.0, member.radius])
    return Mesh(member.at + points @ to_matrix(member.turn).T, triangles)
