"""What replicates do each in its own way, beyond the sensors: the scatter of a bed that no number of a trial describes.

Grains jam and give way otherwise in each bed, so curves of one condition wander apart slowly. What a law of the mean
bed must explain is what replicates have in common; how far they wander is the pure error of a test for lack of fit
(Draper and Smith, Applied Regression Analysis, 3rd ed. 1998, section 2.1), taken mode by mode. Mode k of a channel has
the variance 1 + A / (1 + (k / b)^p) in units of the noise, b and p of the channel, A of the condition (Whittle's
likelihood of the differences within conditions); a condition without replicates has the median A.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.diagnose.fit.fitting import Fit, Whitener
from experiments.diagnose.fit.problem import Array, Problem

from .replicates import groups_of

__all__ = ["Unrest", "find_unrest"]

_SURE = 30.0  # twice the log likelihood that wandering must gain in a channel
_SHARE = 0.5  # share of the conditions with replicates that must wander
_LEAST = 3.0  # variance of the slowest mode, in units of the noise, from which on a condition wanders
_SHARES = np.linspace(0.0, 1.0, 201)
_BENDS, _POWERS = np.geomspace(0.5, 128.0, 9), (1.0, 1.5, 2.0, 3.0, 4.0, 8.0)
_AMPLITUDES = np.concatenate([[0.0], np.geomspace(0.1, 1e8, 61)])


@dataclass(frozen=True)
class Law:
    """How replicates wander in one channel."""

    bend: float  # b, in modes
    power: float  # p
    amplitudes: Mapping[tuple[object, ...], float]
    """A of each condition, for one row: modes of a given wander grow with the root of the number of rows."""
    other: float  # A of a condition without replicates
    std: float  # by how much replicates differ beyond the sensor, root mean square of all rows [the channel's unit]


@dataclass(frozen=True)
class Unrest:
    """How replicates of a campaign wander apart; nothing by default."""

    laws: Mapping[str, Law]  # by channel

    def __bool__(self) -> bool:
        return bool(self.laws)

    def weights(self, problem: Problem) -> dict[str, Array]:
        """One over the std of each mode, trial by trial, as `Whitener.weights`."""
        bare = Whitener.bare(problem)
        found = {}
        for trial in problem.trials:
            whole = np.ones(len(bare.weights[trial.id]))
            for name, block in bare.channel_blocks(problem, trial.id):
                if name in self.laws:
                    law = self.laws[name]
                    amplitude = law.amplitudes.get(trial.condition, law.other)
                    count = block.stop - block.start
                    whole[block] = 1 / np.sqrt(1.0 + amplitude * count * _shape(law.bend, law.power, count))
            found[trial.id] = whole
        return found

    @property
    def model_std(self) -> dict[str, float]:
        """By how much replicates differ beyond the sensors, root mean square [the channel's unit]."""
        return {name: law.std for name, law in self.laws.items()}

    def other_than(self, known: Unrest) -> bool:
        """Whether a channel wanders in one and not in the other, or by twice as much."""
        if self.laws.keys() != known.laws.keys():
            return True
        pairs = [(law.other, known.laws[name].other) for name, law in self.laws.items()]
        return any(max(a, b) > 4 * max(min(a, b), 1e-9) for a, b in pairs)


def find_unrest(found: Fit, values: Mapping[str, float], trials: Sequence[str]) -> Unrest:
    """How the replicates among `trials` wander apart at `values`, which hold each trial's own numbers."""
    problem = found.model.problem
    model = replace(found.model.on(trials), whitener=Whitener.bare(problem))
    (modes,) = model.evaluate([values])
    inside = [trial for trial in problem.trials if trial.id in trials]
    groups = {condition: ids for condition, ids in groups_of(inside).items() if len(ids) > 1}
    rows = {(trial, name): block for trial, name, block in model.channel_rows()}
    laws = {}
    for name in dict.fromkeys(name for _, name in rows):
        squares, freedom, sizes = {}, {}, {}
        for condition, ids in groups.items():
            blocks = [modes[rows[(id, name)]] for id in ids if (id, name) in rows]
            if len(blocks) < 2 or (count := min(len(block) for block in blocks)) < 2:
                continue
            sizes[condition] = float(np.mean([len(block) for block in blocks]))
            together = np.stack([block[:count] * math.sqrt(sizes[condition] / len(block)) for block in blocks])
            squares[condition] = ((together - together.mean(axis=0)) ** 2).sum(axis=0)
            freedom[condition] = len(blocks) - 1
        if squares and (law := _law(squares, freedom)) is not None:
            amplitudes = {condition: a / sizes[condition] for condition, a in law.amplitudes.items()}
            std = _std(found, values, [groups[condition] for condition in squares], name)
            laws[name] = replace(
                law, amplitudes=amplitudes, other=float(np.median(list(amplitudes.values()))),
                # Where louder noise is all that rows show, what the law itself makes of slow modes.
                std=std or _std_of(law, sizes) * _noise(problem, [id for ids in groups.values() for id in ids], name),
            )  # fmt: skip
    return Unrest(laws)


def _law(squares: Mapping[tuple[object, ...], Array], freedom: Mapping[tuple[object, ...], int]) -> Law | None:
    """The likeliest; None where replicates do not wander for sure."""
    best: tuple[float, float, float, dict[tuple[object, ...], float]] = (math.inf, 0.0, 0.0, {})
    for bend, power in itertools.product(_BENDS, _POWERS):
        total, amplitudes = 0.0, {}
        for condition, square in squares.items():
            shape = _shape(float(bend), power, len(square))
            amplitudes[condition], cost = _amplitude(square, freedom[condition], shape)
            total += cost
        if total < best[0]:
            best = total, float(bend), power, amplitudes
    quiet = sum(float(square.sum()) for square in squares.values())
    least, chosen, steep, amplitudes = best
    wandering = [a for a in amplitudes.values() if 1 + a > _LEAST]
    if quiet - least < _SURE or len(wandering) < _SHARE * len(amplitudes):
        return None
    return Law(chosen, steep, amplitudes, float(np.median(list(amplitudes.values()))), 0.0)


def _std(found: Fit, values: Mapping[str, float], groups: Sequence[Sequence[str]], name: str) -> float:
    """`Law.std`, from measured less modelled at equal shares of the time."""
    problem, forms = found.model.problem, found.model.forms
    squares, freedom, noise, count = 0.0, 0, 0.0, 0
    for ids in groups:
        left, sensor = [], []
        for id in ids:
            shown = problem.compare(values, forms, id).get(name)
            if shown is not None:
                time = shown["t_s"] - shown["t_s"][0]
                own = shown["measured"] - shown["model"]
                left.append(np.interp(_SHARES, time / max(float(time[-1]), 1e-300), own))
                samples = problem.samples(id)
                sensor.append(samples.std[samples.channel == name])
        together = np.stack(left)
        squares += float(((together - together.mean(axis=0)) ** 2).sum())
        freedom += (len(left) - 1) * len(_SHARES)
        noise += float(sum((std**2).sum() for std in sensor))
        count += sum(len(std) for std in sensor)
    return math.sqrt(max(squares / freedom - noise / count, 0.0))


def _std_of(law: Law, sizes: Mapping[tuple[object, ...], float]) -> float:
    """Root mean square over the rows of what the law's modes make, in units of the noise; `sizes`: rows of a trial."""
    each = [
        law.amplitudes[condition] * float(_shape(law.bend, law.power, round(size)).mean())
        for condition, size in sizes.items()
    ]
    return math.sqrt(float(np.mean(each)))


def _noise(problem: Problem, trials: Sequence[str], name: str) -> float:
    """Root mean square noise of a channel."""
    stds = [samples.std[samples.channel == name] for samples in (problem.samples(trial) for trial in trials)]
    return math.sqrt(float(np.mean(np.concatenate(stds) ** 2)))


def _amplitude(square: Array, freedom: int, shape: Array) -> tuple[float, float]:
    """The likeliest A of one condition, and minus twice its log likelihood: rough first, then in between."""
    amplitudes = _AMPLITUDES
    for _ in range(2):
        variance = 1.0 + np.multiply.outer(amplitudes, shape)
        costs = (freedom * np.log(variance) + square / variance).sum(axis=1)
        place = int(np.argmin(costs))
        low, high = amplitudes[max(place - 1, 0)], amplitudes[min(place + 1, len(amplitudes) - 1)]
        if not high > 0:
            break
        best, cost = float(amplitudes[place]), float(costs[place])
        amplitudes = np.linspace(low, high, 21)
    return best, cost


def _shape(bend: float, power: float, count: int) -> Array:
    return np.asarray(1.0 / (1.0 + (np.arange(count) / bend) ** power))
