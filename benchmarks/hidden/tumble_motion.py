"""The motion behind made-up tumbles: another integrator and other forms of the effects than the library's.

Written from shared conventions alone (docs), not from `rigid`: time stepping at 10 microseconds on the level of speeds
(Moreau's way: every step the impulse that would stop a slip, cut at Coulomb's bound), semi-implicit Euler, all eight
rows of spikes looked at in every step. Nothing is located in time and no effect shares code with `rigid.terms`.
"""

import math

import numpy as np

from .tumble_columns import COLUMNS

__all__ = ["COLUMNS", "STEP", "move"]

STEP = 1e-5
"""Of the integration [s]."""
ROW = 1e-4
"""Between two rows of the motion that is given back [s]."""


def move(numbers: np.ndarray, duration: float, *, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """Times [s], shape [row_count], and motions, shape [trial_count, row_count, 8].

    Columns of a motion: x, y, theta, vx, vy, omega, wheel speed, state (0 stand, 1 pivot, 2 slip, 3 hop).

    ``numbers``: of every trial, shape [trial_count, len(COLUMNS)]. ``duration``: [s]. ``step``: of the integration [s];
    a longer one where the answer need not be good. Raises ValueError for a table of another width, RuntimeError where a
    motion is no longer finite.
    """
    from rigid.batch.runtime import ensure

    from .tumble_kernel import run

    numbers = np.ascontiguousarray(numbers, dtype=float)
    if numbers.ndim != 2 or numbers.shape[1] != len(COLUMNS):
        raise ValueError(f"numbers has shape {numbers.shape}: [trial_count, {len(COLUMNS)}] was expected")
    ensure()
    every = max(1, round(ROW / step))
    rows = math.ceil(duration / (step * every)) + 1
    out = np.full((len(numbers), rows, 8), np.nan)
    run(numbers, step, every, (rows - 1) * every, out)
    if not np.isfinite(out).all():
        raise RuntimeError(f"the motion of trial {int(np.argmin(np.isfinite(out).all(axis=(1, 2))))} is not finite")
    return np.arange(rows) * step * every, out
