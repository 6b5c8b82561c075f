"""The engine of a bed on a GPU."""

import numpy as np

from dem.engine.engine import Engine
from hedgebed_taichi import ti

from .lists import GpuLists
from .steps import GpuSteps

__all__ = ["GpuEngine"]


@ti.data_oriented
class GpuEngine(GpuLists, GpuSteps, Engine):
    """An engine whose every grain is a chunk, with the lists, loops and sums of a GPU."""

    EMPTY = ("pair_start", "near_start", "near_push", "total", "overlap")

    def read(self, name: str) -> np.ndarray:
        """As ``Engine.read``; the forces on bodies are summed by blocks of rows, of which there are always as many."""
        return np.asarray(self.pushes.to_numpy()) if name == "pushes" else super().read(name)
