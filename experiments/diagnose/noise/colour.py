"""Noise that is not white, or louder than stated: seen in the faster modes of a channel, where little motion reaches.

An autoregressive law of order one is fitted to the power of the modes of all trials (Whittle, Arkiv foer Matematik 2
(1953), 423): S(f) = s^2 (1 - a^2) / (1 - 2 a cos(pi f) + a^2), f from 0 to 1 at half the sampling rate. Where the data
do not call for it, the noise stays as stated.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.fft import dct, idct
from scipy.optimize import minimize

from experiments.diagnose.fit.fitting import Fit, Whitener
from experiments.diagnose.fit.problem import Array

__all__ = ["Colour", "colour_of", "find_colours", "find_loud", "together", "whitener_for"]

_FAST = 0.15  # share of the band that counts as slow and is left out
_FASTER = 0.5  # the same where a model leaves much: what a motion leaves falls with the frequency
_QUIET, _LOUD = 0.25, 1.5
"""Share of all pieces that count as the quiet ones, and how loud these must be, in mean square."""
_SURE = 16.0  # twice the log likelihood that two more numbers must gain: chance 3e-4 under white noise
_PIECES, _PIECE = 8, 24
"""Pieces of a recording, and samples of one at least, over which noise has to be alike."""
_FEWEST = 100  # fast modes from which on a law is fitted
_ONE_NUMBER = 0.05  # spread up to which one number stands for all of them
_ALIKE = 0.5  # share of the excess, and of the correlation, that half of all pieces must show


@dataclass(frozen=True)
class Colour:
    """The noise of one channel."""

    channel: str
    std: float  # over the stated one
    persistence: float  # correlation of neighbouring samples, a

    def power(self, frequency: Array) -> Array:
        """S at frequencies 0..1 of half the sampling rate."""
        return _power(frequency, self.std, self.persistence)


def find_colours(found: Fit) -> dict[str, Colour]:
    """Channels whose noise is not as stated. `found` must have been fitted with `Whitener.white`.

    Noise is there all the time. What a model lacks comes in some trials and at some times, in touches of the ground
    most of all, and reaches the fast modes as well: a law that not half of all pieces show is no noise's.
    """
    powers: dict[str, list[Array]] = {}
    places: dict[str, list[Array]] = {}
    for _, name, rows in found.model.channel_rows():
        modes = found.modes[rows]
        frequency = np.arange(len(modes)) / len(modes)
        fast = frequency > _FAST
        powers.setdefault(name, []).append(modes[fast] ** 2)
        places.setdefault(name, []).append(frequency[fast])
    colours = {}
    for name, parts in powers.items():
        mine = [own for _, other, own in found.model.channel_rows() if other == name]
        residuals = [idct(found.modes[own], norm="ortho") for own in mine]
        colour = _fitted(name, np.concatenate(parts), np.concatenate(places[name]), residuals)
        if colour is not None:
            colours[name] = colour
    return colours


def colour_of(channel: str, residuals: Sequence[Array]) -> Colour | None:
    """The colour of one channel's noise from what smooth curves leave of it, an array a recording, over the stated
    noise; None where the noise is as stated."""
    powers, places = [], []
    for rest in residuals:
        frequency = np.arange(len(rest)) / len(rest)
        powers.append(dct(rest, norm="ortho")[frequency > _FAST] ** 2)
        places.append(frequency[frequency > _FAST])
    return _fitted(channel, np.concatenate(powers), np.concatenate(places), residuals) if powers else None


def _fitted(channel: str, power: Array, frequency: Array, residuals: Sequence[Array]) -> Colour | None:
    """The law of the fast modes, where they call for one and all the time shows it."""
    if len(power) < _FEWEST:
        return None

    def twice(numbers: Array) -> float:
        std = float(np.exp(numbers[1])) if len(numbers) > 1 else 1.0
        law = _power(frequency, std, float(np.tanh(numbers[0])))
        return float((np.log(law) + power / law).sum())

    white = float(power.sum())
    pieces = _pieces(residuals)
    stated = min((minimize(twice, [a], method="Nelder-Mead") for a in (0.0, 0.8)), key=lambda r: r.fun)
    louder = minimize(twice, [stated.x[0], 0.0], method="Nelder-Mead")
    for best in (louder, stated) if stated.fun - louder.fun > _SURE else (stated,):
        std = float(np.exp(best.x[1])) if len(best.x) > 1 else 1.0
        colour = Colour(channel, std, float(np.clip(np.tanh(best.x[0]), -0.5, 0.97)))
        if white - best.fun > _SURE and _steady(colour, *pieces):
            return colour
    return None


def find_loud(found: Fit) -> dict[str, Colour]:
    """Channels that are louder than stated, white, where the model may leave much: looked for in the upper half of the
    band, in the quiet pieces of the recordings. What a model lacks does not fill that all the time, noise does."""
    squares: dict[str, list[float]] = {}
    freedom: dict[str, list[float]] = {}
    for _, name, rows in found.model.channel_rows():
        modes = found.modes[rows]
        fast = np.arange(len(modes)) / max(len(modes), 1) > _FASTER
        if fast.sum() < _PIECE:
            continue
        for piece in _cut(idct(np.where(fast, modes, 0.0), norm="ortho")):
            squares.setdefault(name, []).append(float(np.mean(piece**2)) / (1 - _FASTER))
            freedom.setdefault(name, []).append((1 - _FASTER) * len(piece))
    loud = {}
    for name, own in squares.items():
        dof = float(np.median(freedom[name]))
        level = float(np.quantile(own, _QUIET)) / (float(stats.chi2.ppf(_QUIET, dof)) / dof)
        if level > _LOUD:
            loud[name] = Colour(name, math.sqrt(level), 0.0)
    return loud


def _pieces(residuals: Sequence[Array]) -> tuple[float, float]:
    """Medians, over the pieces of all recordings of a channel, of the mean square and the lag-one correlation."""
    squares, lags = [], []
    for residual in residuals:
        for piece in _cut(residual) if len(residual) > 1 else ():
            square = float(np.mean(piece**2))
            squares.append(square)
            lags.append(float(np.mean(piece[1:] * piece[:-1])) / max(square, 1e-300))
    return float(np.median(squares)), float(np.median(lags))


def _cut(residual: Array) -> list[Array]:
    """The pieces of one recording of a channel."""
    return np.array_split(residual, max(1, min(_PIECES, len(residual) // _PIECE)))


def _steady(colour: Colour, square: float, lag: float) -> bool:
    """Whether pieces of this median mean square and correlation are what the colour would make."""
    louder = colour.std**2 - 1
    if louder > 0.1 and square - 1 < _ALIKE * louder:
        return False
    return abs(colour.persistence) < 0.1 or lag * np.sign(colour.persistence) > _ALIKE * abs(colour.persistence)


def whitener_for(found: Fit, colours: dict[str, Colour]) -> Whitener:
    """The whitener that these colours call for; never below the stated noise in the slow modes."""
    model = found.model
    white = Whitener.white(model.problem)
    weights = {}
    for trial in white.weights:
        whole = white.weights[trial].copy()
        for name, block in white.channel_blocks(model.problem, trial):
            if name in colours:
                count = block.stop - block.start
                power = colours[name].power((np.arange(count) + 0.5) / count)
                whole[block] /= np.sqrt(power)
        weights[trial] = whole
    return Whitener(white.blocks, weights)


def _power(frequency: Array, std: float, persistence: float) -> Array:
    a = persistence
    return std**2 * (1 - a**2) / (1 - 2 * a * np.cos(np.pi * frequency) + a**2)


def together(colours: Sequence[Colour]) -> str:
    """One sentence on the noise of a channel, of which `colours` are what was found at its rates."""
    stds, persistences = [colour.std for colour in colours], [colour.persistence for colour in colours]
    as_stated = max(abs(std - 1.0) for std in stds) < _ONE_NUMBER
    size = "as large as is stated" if as_stated else f"{_range(stds)} times what is stated"
    white = max(abs(persistence) for persistence in persistences) < _ONE_NUMBER
    colour = "" if white else f" and a sample correlates with the next by {_range(persistences)}"
    rates = f", at {len(colours)} sampling rates" if len(colours) > 1 else ""
    return f"the noise of {colours[0].channel} is {size}{colour}{rates}: taken into account"


def _range(numbers: Sequence[float]) -> str:
    low, high = min(numbers), max(numbers)
    return f"{0.5 * (low + high):.2f}" if high - low <= _ONE_NUMBER else f"{low:.2f} to {high:.2f}"
