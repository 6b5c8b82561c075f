"""Lines in the spectrum of what a model leaves: a floor that shakes, a wheel out of balance, a mass that is loose.

Method: residuals over the noise, channel by channel and trial by trial, tapered (Hann) against the slow misfit, give
Lomb's periodogram (Lomb 1976, Astrophys. Space Sci. 39:447; Scargle 1982, ApJ 263:835). The rest beside a line has a
colour of its own. So each power is divided by the one that its neighbours in frequency predict (a power law, fitted to
their logarithms). Such ratios are summed over trials and channels, as a line has one frequency but no common phase. The
sums are compared with their own spread over all frequencies, so that a misfit that is large everywhere makes no line.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import signal, stats

from experiments.diagnose.fit.gaps import unit_of
from experiments.diagnose.fit.localise import phases_of
from experiments.diagnose.fit.problem import Array, Form, Problem, Values
from vis.page.numbers import fitted, foldable

__all__ = ["Line", "Part", "Piece", "line_rows", "line_sentence", "lines_of", "spectral_lines"]

_CYCLES = 1.5  # periods that a recording must hold for a frequency to count as a neighbour: slower is a misfit
_OF_RATE, _HIGHEST = 0.49, 150.0  # share of a channel's rate, and frequency [Hz], that are the upper ends
_PER_WIDTH = 3  # frequencies a resolution of the longest recording
_NEIGHBOURS, _LOBE, _BESIDE = 9.0, 2.5, 4.0
"""Resolutions on either side from which the background is taken; those next to a line that are not (Hann's lobe); and
how many there must be on each side."""
_MEAN_LOG = 0.5772  # of an exponential law's logarithm, below that of its mean
_CHANCE = 1e-3  # probability, over all frequencies, below which a line is one
_IN_CHANNEL, _IN_TRIALS = 4.0, 0.5  # mean ratio from which a channel has the line; share of the trials that show it
_ODD = 5.0  # robust standard deviations at which residuals are cut: a touch at another moment is no line
_MOST, _SHOWN, _FEWEST = 3, 3, 60  # lines, channels reported of each, rows that a recording must have


@dataclass(frozen=True)
class Part:
    """A line in one channel: amplitude and its error in the channel's unit; by phase where that lasts two periods."""

    channel: str
    amplitude: float
    std: float
    phases: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Line:
    """A line: frequency and its error [Hz], the probability that noise of that colour shows it, where it is."""

    frequency: float
    std: float
    chance: float
    parts: tuple[Part, ...]  # the plainest channel first


@dataclass(frozen=True)
class Piece:
    """Residuals of one channel of one trial, over the noise, shapes [n]."""

    trial: str
    channel: str
    time: Array
    rest: Array
    unit: float  # the noise in the channel's unit
    phase: Array

    @property
    def span(self) -> float:
        """Seconds from the first row to the last."""
        return float(np.ptp(self.time))

    @property
    def highest(self) -> float:
        """The highest frequency that its rows resolve [Hz]."""
        return _OF_RATE * (len(self.time) - 1) / self.span

    @property
    def taper(self) -> Array:
        """Hann's window."""
        return np.sin(math.pi * (self.time - self.time[0]) / self.span) ** 2


def lines_of(problem: Problem, values: Values, forms: Sequence[Form], trials: Sequence[str]) -> list[Line]:
    """Lines in what the model of these numbers and forms leaves of `trials`, the plainest first; mostly none."""
    pieces = []
    for trial in trials:
        samples, phases = problem.samples(trial), phases_of(problem, values, forms, trial)
        for channel, shown in problem.compare(values, forms, trial).items():
            mine = samples.channel == channel
            if len(shown["t_s"]) == int(mine.sum()):
                rest, unit = (
                    (shown["measured"] - shown["model"]) / samples.std[mine],
                    float(np.median(samples.std[mine])),
                )
                pieces.append(Piece(trial, channel, shown["t_s"], rest, unit, phases[mine]))
    return spectral_lines(pieces)


def spectral_lines(pieces: Sequence[Piece]) -> list[Line]:
    """Lines that the pieces have in common."""
    kept = [cleaned for piece in pieces if (cleaned := _cleaned(piece)) is not None]
    if not kept:
        return []
    longest = max(piece.span for piece in kept)
    lowest = min(_CYCLES / piece.span for piece in kept)
    highest = min(max(piece.highest for piece in kept), _HIGHEST)
    grid = np.arange(lowest, highest, 1 / (_PER_WIDTH * longest))
    if len(grid) < 4 * _NEIGHBOURS * _PER_WIDTH:
        return []
    ratio = np.stack([_ratio(piece, grid) for piece in kept])  # NaN outside a piece's band
    if not np.isfinite(ratio).any():
        return []
    score = _scores(ratio)
    found: list[Line] = []
    free = np.isfinite(score)
    for _ in range(_MOST):
        if not free.any():
            break
        at = int(np.argmax(np.where(free, score, -np.inf)))
        chance = float(min(1.0, len(grid) / _PER_WIDTH * stats.norm.sf(score[at])))
        if chance > _CHANCE:
            break
        if line := _line(kept, ratio, grid, at, chance):
            found.append(line)
        free &= np.abs(grid - grid[at]) > 2 * _LOBE / longest
    return found


def _cleaned(piece: Piece) -> Piece | None:
    """Finite rows, without what is far out; None of too few."""
    good = np.isfinite(piece.rest) & np.isfinite(piece.time)
    if good.sum() < _FEWEST or np.ptp(piece.time[good]) <= 0:
        return None
    time, rest = piece.time[good], piece.rest[good]
    rest = rest - np.polyval(np.polyfit(time, rest, 2), time)
    size = 1.4826 * float(np.median(np.abs(rest)))
    if size == 0:
        return None
    return replace(piece, time=time, rest=np.clip(rest, -_ODD * size, _ODD * size), phase=piece.phase[good])


def _ratio(piece: Piece, grid: Array) -> Array:
    """The piece's power over that of its neighbours in frequency, shape as `grid`; NaN outside its band."""
    found = np.full(len(grid), np.nan)
    inside = np.flatnonzero((grid >= _CYCLES / piece.span) & (grid <= piece.highest))
    if len(inside) < 4 * _NEIGHBOURS * _PER_WIDTH:
        return found
    here = grid[inside]
    power = signal.lombscargle(piece.time, piece.taper * piece.rest, 2 * math.pi * here)
    log_power, log_f = np.log(np.maximum(power, 1e-300)), np.log(here)
    edge = (_LOBE + _BESIDE) / piece.span
    for k, place in enumerate(inside):
        if here[k] - here[0] < edge or here[-1] - here[k] < edge:
            continue
        off = np.abs(here - here[k]) * piece.span
        near = (off > _LOBE) & (off <= _NEIGHBOURS)
        _, level = np.polyfit(log_f[near] - log_f[k], log_power[near], 1)
        found[place] = power[k] / math.exp(level + _MEAN_LOG)
    return found


def _scores(ratio: Array) -> Array:
    """How far the ratios' sum at each frequency stands out, in standard deviations of its spread over frequencies."""
    count = np.isfinite(ratio).sum(axis=0)
    total = np.nansum(ratio, axis=0)
    seen = count > 0
    tail = stats.gamma.logsf(total[seen], count[seen])
    score = np.full(ratio.shape[1], np.nan)
    score[seen] = _normal(tail)
    middle = float(np.nanmedian(score))
    spread = 1.4826 * float(np.nanmedian(np.abs(score - middle)))
    return (score - middle) / max(spread, 1.0)


def _normal(log_tail: Array) -> Array:
    """Standard normal scores of the logarithms of tail probabilities, far out by the tail's asymptote."""
    near = stats.norm.isf(np.exp(np.maximum(log_tail, -600.0)))
    return np.where(log_tail > -600.0, near, np.sqrt(np.maximum(-2 * log_tail, 0.0)))


def _line(pieces: Sequence[Piece], ratio: Array, grid: Array, at: int, chance: float) -> Line | None:
    """The line near one frequency, in the channels that have it; None where no channel has it in half of its trials."""
    having: dict[str, list[int]] = {}
    for channel in dict.fromkeys(piece.channel for piece in pieces):
        own = [k for k, piece in enumerate(pieces) if piece.channel == channel and np.isfinite(ratio[k, at])]
        if own and ratio[own, at].mean() >= _IN_CHANNEL and np.mean(ratio[own, at] > 2.0) >= _IN_TRIALS:
            having[channel] = own
    if not having:
        return None
    every = [k for own in having.values() for k in own]
    fine = grid[at] + np.linspace(-1, 1, 41) / max(pieces[k].span for k in every)
    sizes = {k: _amplitudes(pieces[k], fine) for k in every}
    # The background is power / ratio; power goes with the amplitude's square, 4 times a component's variance.
    noise = {k: max(float(sizes[k][20]) / math.sqrt(2 * max(float(ratio[k, at]), 1e-9)), 1e-12) for k in every}
    best = int(np.argmax(sum((sizes[k] / noise[k]) ** 2 for k in every)))
    # The bound of Cramer and Rao for a sine in noise; a half more for the taper.
    weight = sum((float(sizes[k][best]) / noise[k] * math.pi * pieces[k].span / 3.0) ** 2 for k in every)
    parts = []
    for channel, own in having.items():
        square = [(pieces[k].unit ** 2) * (float(sizes[k][best]) ** 2 - 2 * noise[k] ** 2) for k in own]
        std = math.sqrt(float(np.mean([(pieces[k].unit * noise[k]) ** 2 for k in own])) / len(own))
        by_phase: dict[str, list[tuple[float, int]]] = {}
        for k in own:
            for name, size, count in _by_phase(pieces[k], fine[best]):
                by_phase.setdefault(name, []).append((size * pieces[k].unit, count))
        phases = {name: math.sqrt(sum(n * size * size for size, n in mine) / sum(n for _, n in mine))
                  for name, mine in by_phase.items()}  # fmt: skip
        plain = float(ratio[own, at].mean())
        parts.append((plain, Part(channel, math.sqrt(max(float(np.mean(square)), 0.0)), std, phases)))
    parts.sort(key=lambda pair: -pair[0])
    return Line(float(fine[best]), 1 / math.sqrt(weight), chance, tuple(part for _, part in parts))


def _amplitudes(piece: Piece, frequencies: Array) -> Array:
    """Of sines of these frequencies in the tapered piece."""
    turned = np.exp(-2j * math.pi * frequencies[:, None] * piece.time)
    return 2 * np.abs(turned @ (piece.taper * piece.rest)) / piece.taper.sum()


def _by_phase(piece: Piece, frequency: float) -> list[tuple[str, float, int]]:
    """Amplitude in each stretch of one phase that lasts two periods, beside a straight line: phase, size, rows."""
    found = []
    edges = [0, *(np.flatnonzero(piece.phase[1:] != piece.phase[:-1]) + 1).tolist(), len(piece.time)]
    for low, high in pairwise(edges):
        time = piece.time[low:high]
        if high - low < 12 or np.ptp(time) < 2 / frequency:
            continue
        turn = 2 * math.pi * frequency * time
        columns = np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(time), time - time.mean()])
        answer = np.linalg.lstsq(columns, piece.rest[low:high], rcond=None)[0]
        found.append((str(piece.phase[low]), float(np.hypot(answer[0], answer[1])), high - low))
    return found


def line_rows(lines: Sequence[Line]) -> list[dict[str, Any]]:
    """``latent.lines`` of diagnosis.json, amplitudes in the units that reports use."""

    def row(part: Part) -> dict[str, Any]:
        unit, factor = unit_of(part.channel)
        phases = {name: factor * size for name, size in part.phases.items()}
        return {"channel": part.channel, "amplitude": factor * part.amplitude, "std": factor * part.std, "unit": unit,
                "phases": phases}  # fmt: skip

    return [
        {"frequency_hz": line.frequency, "std_hz": line.std, "chance": line.chance, "channels": [*map(row, line.parts)]}
        for line in lines
    ]


def line_sentence(row: Mapping[str, Any]) -> str:
    """A row of ``latent.lines`` in words."""
    shown = row["channels"][:_SHOWN]
    sizes = ", ".join(f"{p['channel']} {_with_error(p['amplitude'], p['std'])} {p['unit']}".rstrip() for p in shown)
    more = len(row["channels"]) - len(shown)
    also = f" and in {more} more" if more else ""
    phases = sorted(shown[0]["phases"].items(), key=lambda pair: -pair[1])
    where = ", ".join(f"{size:.2g} in phase {name}" for name, size in phases) if len(phases) > 1 else ""
    odds = "below 1e-6" if row["chance"] < 1e-6 else f"{row['chance']:.1g}"
    return (
        f"Its spectrum has a line at {_with_error(row['frequency_hz'], row['std_hz'])} Hz: amplitudes {sizes}{also}"
        + (f" ({shown[0]['channel']}: {where})" if where else "")
        + f"; by chance, in noise of that colour, {odds}."
    )


def _with_error(value: float, std: float) -> str:
    """With half of the 95 % interval, to the digits that it allows: 12.34 ± 0.08."""
    return foldable(fitted({"value": value, "std": std, "unit": "1"}))
