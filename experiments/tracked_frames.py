"""What frames of a platform on grains share: a series that goes on where it was stopped, and the tracks in the bed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from coupling import BedFooting, CoupledTumble, SpatialRun
from vis.frames import FrameWriter, HeightMap, read_frames
from vis.tracks import height_map, lying

__all__ = ["NAME", "TrackedFrames"]

NAME = "tumble"


class TrackedFrames:
    """Opens frames/tumble.pvd; `surface` is the bed's height map, with `change` [m] since the first frame."""

    def __init__(
        self, run: CoupledTumble | SpatialRun, folder: Path, *, duration: float, frame_count: int, grain: float,
        resumed: bool,
    ) -> None:  # fmt: skip
        self.interval = max(duration / max(1, frame_count), run.master.macro_step)
        self._untouched: HeightMap | None = None
        self._spacing = 0.5 * grain
        if resumed:
            half = 0.5 * run.master.macro_step
            self.writer = FrameWriter(folder, name=NAME, resume=True, keep_until=max(run.time, 0.0) - half)
            if self.writer.times:
                self._untouched = read_frames(folder, NAME)[0].maps.get("surface")
        else:
            self.writer = FrameWriter(folder, name=NAME)

    def surface(self, footing: BedFooting, grains: dict[str, np.ndarray]) -> HeightMap:
        """The height map of what there is now."""
        size = footing.bed.size
        found = height_map(
            grains["position"], grains["radius"], (float(size[0]), float(size[1])), spacing=self._spacing,
            lies=lying(grains["position"], grains["radius"]),
        )  # fmt: skip
        if self._untouched is None:
            self._untouched = found
        found.fields["change"] = found.fields["height"] - self._untouched.fields["height"]
        return found
