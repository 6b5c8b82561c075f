"""The wander of replicates: their pure error beyond the sensors, which no number of a trial describes.

Grains jam and yield otherwise in each bed, so curves of one condition wander apart slowly. What a law of the mean
bed must explain is what replicates have in common. The size of the wander is the pure error of a lack-of-fit test
(Draper and Smith, Applied Regression Analysis, 3rd ed. 1998, section 2.1), taken mode by mode. Mode k of a channel has
the variance 1 + A / (1 + (k / b)^p) in units of the noise. b and p are of the channel, A of the condition (Whittle's
likelihood of the differences within conditions). A condition without replicates has the median A.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.diagnose.fit.fitting import Fit, Whitener
from experiments.diagnose.fit.problem import Array, Problem

from .replicates import deviations, groups_of

__all__ = ["Wander", "find_wander"]

_SURE = 30.0  # twice the log likelihood that wandering must gain in a channel
_SHARE = 0.5  # of the conditions with replicates that must wander
_LEAST = 3.0  # variance of the slowest mode, in units of the noise, from which on a condition wanders
_SHARES = np.linspace(0.0, 1.0, 201)
_BENDS, _POWERS = np.geomspace(0.5, 128.0, 9), (1.0, 1.5, 2.0, 3.0, 4.0, 8.0)
_AMPLITUDES = np.concatenate([[0.0], np.geomspace(0.1, 1e8, 61)])

Condition = tuple[object, ...]


@dataclass(frozen=True)
class Law:
    """How replicates wander in one channel."""

    bend: float  # b, in modes
    power: float  # p
    amplitudes: Mapping[Condition, float]
    """A of each condition, for one row: modes of a given wander grow with the root of the number of rows."""
    other: float = 0.0  # A of a condition without replicates
    std: float = 0.0  # of replicates beyond the sensor, root mean square of all rows [the channel's unit]

    def shape(self, count: int) -> Array:
        """The variance of `count` modes over A."""
        return _shape(self.bend, self.power, count)


@dataclass(frozen=True)
class Wander:
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
                    law, count = self.laws[name], block.stop - block.start
                    amplitude = law.amplitudes.get(trial.condition, law.other)
                    whole[block] = 1 / np.sqrt(1.0 + amplitude * count * law.shape(count))
            found[trial.id] = whole
        return found

    @property
    def model_std(self) -> dict[str, float]:
        """Std of replicates beyond the sensors, root mean square of the rows [the channel's unit]."""
        return {name: law.std for name, law in self.laws.items()}

    def other_than(self, known: Wander) -> bool:
        """Whether a channel wanders in one and not in the other, or by twice as much."""
        if self.laws.keys() != known.laws.keys():
            return True
        pairs = [(law.other, known.laws[name].other) for name, law in self.laws.items()]
        return any(max(a, b) > 4 * max(min(a, b), 1e-9) for a, b in pairs)


def find_wander(found: Fit, values: Mapping[str, float], trials: Sequence[str]) -> Wander:
    """How the replicates among `trials` wander apart at `values`, which hold each trial's own numbers."""
    problem = found.model.problem
    model = replace(found.model.on(trials), whitener=Whitener.bare(problem))
    (modes,) = model.evaluate([values])
    groups = {condition: ids for condition, ids in groups_of(model.infos).items() if len(ids) > 1}
    rows = {(trial, name): block for trial, name, block in model.channel_rows()}
    laws = {}
    for name in dict.fromkeys(name for _, name in rows):
        squares, freedom, sizes = {}, {}, {}
        for condition, ids in groups.items():
            blocks = [modes[rows[(id, name)]] for id in ids if (id, name) in rows]
            if len(blocks) > 1 and min(map(len, blocks)) > 1:
                sizes[condition] = float(np.mean([len(block) for block in blocks]))
                squares[condition] = (deviations(blocks) ** 2).sum(axis=0)
                freedom[condition] = len(blocks) - 1
        if squares and (law := _law(squares, freedom)) is not None:
            amplitudes = {condition: a / sizes[condition] for condition, a in law.amplitudes.items()}
            std = _std(found, values, [groups[condition] for condition in squares], name)
            if not std:  # rows show only more noise: what the law itself makes of slow modes, by the sensor's noise
                samples = [problem.samples(id) for ids in groups.values() for id in ids]
                noise = np.concatenate([one.std[one.channel == name] for one in samples])
                means = [law.amplitudes[key] * float(law.shape(round(size)).mean()) for key, size in sizes.items()]
                std = math.sqrt(float(np.mean(means))) * math.sqrt(float(np.mean(noise**2)))
            other = float(np.median(list(amplitudes.values())))
            laws[name] = replace(law, amplitudes=amplitudes, other=other, std=std)
    return Wander(laws)


def _law(squares: Mapping[Condition, Array], freedom: Mapping[Condition, int]) -> Law | None:
    """The likeliest law; None where replicates do not wander significantly."""
    least, best = math.inf, Law(0.0, 0.0, {})
    for bend, power in itertools.product(_BENDS.tolist(), _POWERS):
        total, amplitudes = 0.0, {}
        for condition, square in squares.items():
            shape = _shape(bend, power, len(square))
            amplitudes[condition], cost = _amplitude(square, freedom[condition], shape)
            total += cost
        if total < least:
            least, best = total, Law(bend, power, amplitudes)
    quiet = sum(float(square.sum()) for square in squares.values())
    wandering = [a for a in best.amplitudes.values() if 1 + a > _LEAST]
    if quiet - least < _SURE or len(wandering) < _SHARE * len(best.amplitudes):
        return None
    return best


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


def _amplitude(square: Array, freedom: int, shape: Array) -> tuple[float, float]:
    """The likeliest A of one condition, and minus twice its log likelihood: on a coarse grid, then on a fine one."""
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
