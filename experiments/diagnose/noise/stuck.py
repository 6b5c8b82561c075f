"""Readings that are stuck or clipped: a sensor that repeats a number many times where it otherwise never does."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from experiments.check.words import row_noise
from experiments.grains.spells import spells

__all__ = ["Clipped", "clipped", "clipped_wheel", "cut_rows", "stuck_rows", "unsigned_rows"]

_LONG = 12  # equal readings in a row that noise does not make
_USUAL = 0.05  # share of equal neighbours elsewhere up to which a run is odd: coarse or held readings repeat always
_AT_THE_END, _IN_A_ROW = 8, 4  # readings at the end of a channel's range, and in a row, from which on it clips there
_NEXT = 2  # readings at the value next to that: with more, it is a coarse channel that turns there
_BESIDE, _SLIGHT = 7, 6.0  # rows on either side of a zero, and standard deviations, within which readings belong to it
_NOISY = 0.2  # share of the stated noise that a wheel's speed must have below where it clips
_UNSIGNED = 20  # readings near zero that decide on a sign: the chance that noise makes none of these negative is 1e-6
_NEAR = 2.5  # standard deviations below which a reading is near zero: above it the lost sign changes less than 0.01
_SPREAD = 0.3  # standard deviations by which readings near zero differ from it and each other; of sizes 0.8 and 0.6
_ROWS = 9  # whose median decides whether the value is near zero


@dataclass(frozen=True)
class Clipped:
    """Readings at one end of a channel's range, beyond which it cannot read."""

    rows: NDArray[np.int64]
    value: float
    highest: bool  # whether it is the highest; else the lowest

    @property
    def words(self) -> str:
        """As in: 30 readings of force ..."""
        end, more = ("highest", "more") if self.highest else ("lowest", "less")
        return (
            f"stand at {self.value:.6g}, the {end} that it ever reads: the sensor clips there (its range ends, it is "
            f"saturated) and the true value is {more}; they are set aside"
        )


def clipped(values: NDArray[np.float64]) -> list[Clipped]:
    """The ends of a channel's range at which it clips; `values`: NaN in gaps, shape [n]. Zeros do not count: a sensor
    reads them at rest, or is cut off there (`cut_rows`)."""
    known = np.flatnonzero(np.isfinite(values))
    own = values[known]
    if len(own) < 3 * _AT_THE_END:
        return []
    found = []
    for highest in (True, False):
        end = own.max() if highest else own.min()
        at = own == end
        others = own[~at]
        if end == 0 or at.sum() < _AT_THE_END or not len(others):
            continue
        near = others.max() if highest else others.min()
        longest = max(last - first for first, last in spells(at))
        repeats = float(np.mean(np.diff(own)[~(at[1:] & at[:-1])] == 0)) if not at.all() else 1.0
        if longest >= _IN_A_ROW and int((own == near).sum()) <= _NEXT and repeats <= _USUAL:
            found.append(Clipped(known[at], float(end), highest))
    return found


def clipped_wheel(values: NDArray[np.float64], std: float) -> list[Clipped]:
    """The same of a wheel's speed, noise `std` as stated [rad/s]: only its highest readings, and only where it is noisy
    below them, as a wheel without a torque turns evenly in a simulation."""
    found = [end for end in clipped(values) if end.highest]
    below = np.delete(values, found[0].rows) if found else values[:0]
    below = below[np.isfinite(below)]
    if len(below) < 3 * _AT_THE_END:
        return []
    return found if row_noise(below) > _NOISY * std else []


def cut_rows(recordings: Sequence[NDArray[np.float64]], std: float) -> list[NDArray[np.int64]]:
    """Rows, recording by recording, at which one sensor is cut off at exactly 0: it never reads less in any of them,
    although its noise `std` would. [n], NaN in gaps -> [m]. Rows beside a zero that read no more than the noise are
    included: those that noise takes below 0 are missing there, so that the others are too high on the mean."""
    none = [np.zeros(0, dtype=np.int64) for _ in recordings]
    known = [values[np.isfinite(values)] for values in recordings]
    everything = np.concatenate(known) if known else np.zeros(0)
    if (everything == 0).sum() < _AT_THE_END or len(everything) < 3 * _AT_THE_END or everything.min() < 0:
        return none
    if np.mean([_repeats(own) for own in known if len(own)]) > _USUAL:  # held, or so coarse that 0 is a step of it
        return none
    found = []
    for values in recordings:
        cut = np.convolve((values == 0).astype(float), np.ones(2 * _BESIDE + 1), mode="same") > 0.5
        found.append(np.flatnonzero(cut & (values < _SLIGHT * std)))
    return found


def unsigned_rows(recordings: Sequence[NDArray[np.float64]], std: float) -> list[NDArray[np.int64]]:
    """Rows, recording by recording, at which one sensor without a sign is near zero: it reads |value + noise|, so that
    the noise `std` alone makes a reading of 0.8 std at rest. [n], NaN in gaps -> [m].

    None where a reading is negative, where too few are near zero, or where these do not look like sizes of noise."""
    known = [np.flatnonzero(np.isfinite(values)) for values in recordings]
    own = [values[rows] / std for values, rows in zip(recordings, known, strict=True)]
    near = [median_filter(one, _ROWS, mode="nearest") < _NEAR if len(one) else one > 0 for one in own]
    sizes = np.concatenate([one[rows] for one, rows in zip(own, near, strict=True)]) if own else np.zeros(0)
    negative = any(bool((one < 0).any()) for one in own)
    if negative or len(sizes) < _UNSIGNED or min(float(sizes.mean()), float(sizes.std())) < _SPREAD:
        return [rows[:0] for rows in known]
    return [rows[mine] for rows, mine in zip(known, near, strict=True)]


def _repeats(known: NDArray[np.float64]) -> float:
    """Share of readings that repeat the one before, zeros left out."""
    return float(np.mean((np.diff(known) == 0) & (known[1:] != 0))) if len(known) > 1 else 0.0


def stuck_rows(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows after the first of every run of `_LONG` equal readings and more; NaN are skipped, shape [n] -> [m]. Zeros do
    not count: a sensor reads them at rest, or where it is cut off."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 3 * _LONG:
        return known[:0]
    same = (np.diff(values[known]) == 0) & (values[known][1:] != 0)
    stuck = np.zeros(len(same), dtype=bool)
    for low, high in spells(same):
        stuck[low:high] = high - low >= _LONG - 1
    if not stuck.any() or stuck.all() or same[~stuck].mean() > _USUAL:
        return known[:0]
    return known[1:][stuck]
