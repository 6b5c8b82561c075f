"""What the error of a smoothed depth leaves in doubt of a driven trial's force: at the surface, and where it turns."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.problem import Array
from experiments.grains.spells import spells

from .data import Prepared
from .depth import SmoothDepth

__all__ = [
    "bounded", "jumping", "off_rest", "off_surface", "path_error", "reversing", "touching", "turning", "with_jumps",
]  # fmt: skip

_BESIDE = 5  # rows before and after a turn that show the force there
_AT_TURN = 6
"""Rows that a turn may last; where a spike is slow for longer it is held, or eased, and its direction is what it is."""
_AT_END = 2  # rows at either end of a hold in which the motion may not have stopped, or may have begun again
_FAILED = 1e3  # residual over the noise where a model is no number


def bounded(rest: Array) -> Array:
    """Residuals over the noise that a sum of squares can hold."""
    if np.abs(rest).max(initial=0.0) <= 1e5:  # false of what is no number
        return rest
    return np.where(np.isfinite(rest), np.clip(rest, -1e5, 1e5), _FAILED)


def path_error(smooth: SmoothDepth, by_depth: Array, by_row: Array) -> Array:
    """What the error of a smoothed depth makes of the force [N], shape [n, error_count].

    The force of a withdrawal depends on the present depth and on the greatest depth, whose errors differ. A crater with
    a steep unloading is sensitive to their difference.
    """
    so_far = np.maximum.accumulate(smooth.depth)
    deepest = np.maximum.accumulate(np.where(smooth.depth >= so_far, np.arange(len(so_far)), 0))
    far = (by_depth - by_row)[:, None] * smooth.depth_error[deepest]
    return by_row[:, None] * smooth.depth_error + far


def touching(trial: Prepared) -> NDArray[np.bool_]:
    """Rows of a driven trial that may lie on either side of the surface."""
    return np.abs(trial.path.depth) < off_surface(trial)


def off_surface(trial: Prepared) -> Array:
    """How far from the surface [m] a row may be and yet lie on its other side: the depth's error, and the way of one
    row, since depth and force are not read at one and the same instant."""
    smooth = trial.path
    return 3 * smooth.depth_std + np.abs(smooth.speed) * np.gradient(trial.time)


def off_rest(trial: Prepared) -> Array:
    """How far from rest [m/s] a row may be and yet move the other way: the speed's error, and what it changes by within
    a row."""
    return 3 * trial.path.speed_std + np.abs(np.gradient(trial.path.speed))


def reversing(trial: Prepared) -> NDArray[np.bool_]:
    """The few rows at which a driven spike may already come back or still go on; none of those where it is held."""
    speed, off = trial.path.speed, off_rest(trial)
    found = np.zeros(len(speed), dtype=bool)
    for low, high in spells(np.abs(speed) < off):
        low, high = max(0, low - 1), min(len(speed) - 1, high)
        if high - low <= _AT_TURN and speed[low] * speed[high] < 0:
            found[low + 1 : high] = True
    for k in np.flatnonzero(speed[1:] * speed[:-1] < 0):  # between two rows, neither of which is in doubt
        found[k + int(abs(speed[k + 1]) < abs(speed[k]))] = True
    return found


def jumping(trial: Prepared, by_depth: Array, by_speed: Array, shallow: float) -> Array:
    """By how much the force is in doubt where its error may cross the surface or the turning point, as a variance [N2],
    shape [n]: there it is no linear function of the depth's. `shallow`: depth [m] up to which a tip counts as just
    below the surface."""
    smooth = trial.path
    bend = np.abs(by_speed).max() * smooth.speed_std * (np.abs(smooth.speed) < 3 * smooth.speed_std)
    jump = float(np.abs(by_speed).max() * np.abs(smooth.speed).max())
    # An effect may begin with a jump at the surface: as large as the force is measured to be just below it.
    here = (smooth.depth > 0) & (smooth.depth < np.maximum(8 * smooth.depth_std, shallow)) & trial.has_other
    below = float(np.median(np.abs(trial.other[here]))) if here.any() else 0.0
    start = max(jump, below) + np.abs(by_depth).max() * smooth.depth_std
    return bend**2 + (start * touching(trial)) ** 2


def with_jumps(trial: Prepared, doubt: Array, force_at: Callable[[tuple[float, float, float]], Array]) -> Array:
    """The doubt of a driven force [N] where it jumps: at the surface, and with friction where the motion turns. It is
    half of what the path leaves open. `force_at`: the force with the path shifted, as `push` takes shifts."""
    turn = np.maximum(off_rest(trial), np.abs(trial.path.speed))
    for rows, off, speed in ((touching(trial), off_surface(trial), 0.0), (reversing(trial), turn, 1.0)):
        if rows.any():
            ways = [side * float(off[rows].max()) for side in (1, -1)]
            up, down = (force_at((way * (1 - speed), way * speed, 0.0)) for way in ways)
            doubt = np.where(rows, np.maximum(doubt, 0.5 * np.abs(up - down)), doubt)
    return doubt


def turning(speed: Array, std: Array, force: Array, noise: float) -> tuple[Array, Array]:
    """How far the force is in doubt where the direction of motion is: by its jump from before to after [N], shape
    [row_count]; and, shape [row_count, hold_count], the same of holds, one column for each.

    Dry friction changes sign where a spike turns; the smoothed depth shows when to within some rows only. While a spike
    is held, a friction that may be of either sign is one number for all rows of the hold: what changes with time there
    is not in doubt, as where the force relaxes.
    """
    doubt = np.zeros(len(speed))
    held = []
    for low, high in spells(np.abs(speed) < 3 * std):
        before, after = force[max(0, low - _BESIDE) : low], force[high : high + _BESIDE]
        if len(before) < _BESIDE or len(after) < _BESIDE:
            continue
        jump = abs(float(np.median(after) - np.median(before)))
        if jump <= 3 * noise:
            continue
        first, last = max(0, low - 1), high + 1
        if high - low <= _AT_TURN:
            doubt[first:last] = jump
            continue
        doubt[first : first + _AT_END] = doubt[last - _AT_END : last] = jump
        column = np.zeros(len(speed))
        column[first + _AT_END : last - _AT_END] = jump
        held.append(column)
    return doubt, np.column_stack(held) if held else np.zeros((len(speed), 0))
