"""The frames of one run: the grains and the spike as files for ParaView and for the report."""

import numpy as np

from coupling import BedGround, Run
from experiments.runs.folder import RunFolder

from .settings import PenetrateSettings
from .units import Unit

__all__ = ["Frames"]


class Frames:
    """Writes the frames of one run."""

    def __init__(
        self,
        settings: PenetrateSettings,
        unit: Unit,
        stepper: Run,
        folder: RunFolder,
        *,
        expected: float,
        resumed: bool,
    ) -> None:
        """`expected`: how long the run may well last [s]; `resumed`: it goes on from a checkpoint."""
        from vis.pictures.frames import GRAIN_FIELDS, FrameWriter
        from vis.pictures.meshes import spike_mesh

        wanted = expected / max(1, settings.frame_count)
        self.interval = max(wanted, stepper.macro_step) if settings.frame_count else None
        self.limit = 2 * max(1, settings.frame_count)
        self.fields = tuple(GRAIN_FIELDS)
        if resumed:
            # The frame of the very step of the checkpoint was written after it, if at all: it comes again.
            half = 0.5 * stepper.macro_step
            self.writer = FrameWriter(folder.path, name=unit.id, resume=True, keep_until=stepper.time - half)
        else:
            self.writer = FrameWriter(folder.path, name=unit.id)
        spike = stepper.spike
        self.points, self.triangles = spike_mesh(
            spike.tip, diameter=spike.diameter, length=spike.length, shaft_diameter=spike.shaft,
            cone_angle=spike.cone_angle,
        )  # fmt: skip

    def write(self, stepper: Run) -> None:
        """One frame of what the stepper is doing now; of a run far longer than expected, ever fewer.

        Past the limit every second is kept, past twice that every fourth and so on; the deepest point and the last
        state always are.
        """
        late = max(0, stepper.frames_taken - 1)
        if late % (1 << (late // self.limit).bit_length()) and not (stepper.done or stepper.at_bottom):
            return
        ground = stepper.ground
        assert isinstance(ground, BedGround)
        grains = ground.bed.grains().as_dict()
        self.writer.write(
            stepper.time,
            {name: grains[name] for name in ("position", *self.fields)},
            {"spike": (self.points + np.array(stepper.position), self.triangles)},
            values={"depth": stepper.depth, "velocity": stepper.velocity, "force": stepper.last_force},
        )
