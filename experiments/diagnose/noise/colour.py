"""Noise that is coloured, or larger than stated: seen in the faster modes of a channel, where little motion reaches.

An autoregressive law of order one is fitted to the power of the modes of all trials (Whittle, Arkiv foer Matematik 2
(1953), 423): S(f) = s^2 (1 - a^2) / (1 - 2 a cos(pi f) + a^2), f from 0 to 1 at half the sampling rate. Where the data
do not call for it, the noise stays as stated.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.fft import dct, idct
from scipy.optimize import minimize

from experiments.diagnose.fit.fitting import Fit, Whitener
from experiments.diagnose.fit.problem import Array

__all__ = ["Colour", "colour_of", "find_colours", "find_white_noise", "together", "whitener_for"]

_FAST = 0.15  # share of the band that counts as slow and is left out
_FASTER = 0.5  # the same where a model leaves much: what a motion leaves falls with the frequency
_QUIET, _LARGE = 0.25, 1.5  # share of all pieces that count as quiet, and their mean square over the stated one
_SURE = 16.0  # twice the log likelihood that two more numbers must gain: chance 3e-4 under white noise
_PIECES, _PIECE = 8, 24  # pieces of a recording, and samples of one at least, over which noise has to be alike
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
        a = self.persistence
        return self.std**2 * (1 - a**2) / (1 - 2 * a * np.cos(np.pi * frequency) + a**2)


def find_colours(found: Fit) -> dict[str, Colour]:
    """Channels whose noise is not as stated. `found` must have been fitted with `Whitener.white`.

    Noise is there all the time. What a model omits comes in some trials and at some times, in touches of the ground
    most of all, and reaches the fast modes as well: a law that fewer than half of all pieces show is not the noise's.
    """
    modes: dict[str, list[Array]] = {}
    for _, name, rows in found.model.channel_rows():
        modes.setdefault(name, []).append(found.modes[rows])
    colours = {name: _fitted(name, own, [idct(one, norm="ortho") for one in own]) for name, own in modes.items()}
    return {name: colour for name, colour in colours.items() if colour is not None}


def colour_of(channel: str, residuals: Sequence[Array]) -> Colour | None:
    """The colour of one channel's noise; None where the noise is as stated. ``residuals``: what smooth curves leave of
    it over the stated noise, an array a recording."""
    return _fitted(channel, [dct(rest, norm="ortho") for rest in residuals], residuals) if residuals else None


def _fitted(channel: str, modes: Sequence[Array], residuals: Sequence[Array]) -> Colour | None:
    """The law of the fast modes, where they call for one and all the time shows it."""
    places = [np.arange(len(own)) / len(own) for own in modes]
    frequency = np.concatenate([place[place > _FAST] for place in places])
    power = np.concatenate([own[place > _FAST] ** 2 for own, place in zip(modes, places, strict=True)])
    if len(power) < _FEWEST:
        return None

    def twice(numbers: Array) -> float:
        std = float(np.exp(numbers[1])) if len(numbers) > 1 else 1.0
        law = Colour(channel, std, float(np.tanh(numbers[0]))).power(frequency)
        if not law.min() > 0:  # a correlation that rounds to 1: such a law has no power, and no reading is likely
            return math.inf
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


def find_white_noise(found: Fit) -> dict[str, Colour]:
    """Channels with more white noise than stated, where the model may leave much: in the upper half of the band, in the
    quiet pieces of the recordings. What a model omits does not fill these all the time, noise does."""
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
    white = {}
    for name, own in squares.items():
        dof = float(np.median(freedom[name]))
        level = float(np.quantile(own, _QUIET)) / (float(stats.chi2.ppf(_QUIET, dof)) / dof)
        if level > _LARGE:
            white[name] = Colour(name, math.sqrt(level), 0.0)
    return white


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


def whitener_for(found: Fit, colours: Mapping[str, Colour]) -> Whitener:
    """The whitener that these colours call for; never below the stated noise in the slow modes."""
    problem = found.model.problem
    white = Whitener.white(problem)
    weights = {trial: whole.copy() for trial, whole in white.weights.items()}
    for trial, whole in weights.items():
        for name, block in white.channel_blocks(problem, trial):
            if name in colours:
                count = block.stop - block.start
                whole[block] /= np.sqrt(colours[name].power((np.arange(count) + 0.5) / count))
    return Whitener(white.blocks, weights)


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
