"""A small platform on a small bed in the plane, for tests: a tumble of seconds."""

import math
from contextlib import contextmanager
from itertools import count
from typing import Any

import numpy as np

from dem import SAND_WEAK, Bed
from experiments.grains import following

__all__ = ["SMALL", "prepare_small", "small_bed", "stop_at"]

SMALL: dict[str, Any] = {
    "surface": "sand-weak", "ground": "bed", "mass": 0.3, "inertia": 2e-4, "spike_length": 0.04, "wheel_inertia": 1e-5,
    "rig": 0.03, "torque": 0.01, "duration": 0.06, "bed_size": (0.2, 0.036, 0.03), "grain": 0.006, "frame_count": 3,
    "spike_diameter": 0.008, "spike_clear": 0.015, "substeps": 8, "lowering_speed": 0.04, "stiffness": 500.0,
    "damping": 2.0, "threads": 1,
}  # fmt: skip


def prepare_small(on_bed, *_):
    """In place of `PlanarOnBed.prepare`."""
    return small_bed(on_bed.settings)


def small_bed(settings, stuff=SAND_WEAK):
    """Two layers of large grains, almost at rest."""
    d, rows, columns = 6e-3, 32 // settings.bed_repeats, 6
    low = [((i + 0.5) * d, (j + 0.5) * d, 0.5 * d) for i in range(rows) for j in range(columns)]
    high = [((i + 1.0) * d, (j + 1.0) * d, 0.5 * d + d * math.sqrt(0.5)) for i in range(rows) for j in range(columns)]
    bed = Bed.from_grains(
        stuff, positions=np.array(low + high), radii=np.full(2 * rows * columns, 0.5 * d), young=1e7, max_overlap=0.1,
        size=(rows * d, columns * d, 0.03), height=0.3, threads=1, gravity=9.80665,
    )  # fmt: skip
    bed.advance(1000)
    bed.surface = float((bed.grains().position[:, 2] + 0.5 * d).max())
    return bed


def stop_at(monkeypatch, call):
    """A run on grains finds, when it asks for the `call`-th time, that it was told to stop."""
    asked = count(1)

    @contextmanager
    def stopping():
        yield lambda: next(asked) == call

    monkeypatch.setattr(following, "held_back", stopping)
