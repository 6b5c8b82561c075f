"""What replicates do each in its own way, beyond the sensors: the scatter of a bed that no number of a trial describes.

Grains jam and give way otherwise in each bed, so curves of one condition wander apart slowly. What a law of the mean
bed must explain is what replicates have in common; how far they wander is the pure error of a test for lack of fit
(Draper and Smith, Applied Regression Analysis, 3rd ed. 1998, section 2.1), taken mode by mode. Mode k of a channel has
the variance 1 + A (1 + k)^-p in units of the noise, p of the channel, A of the condition (Whittle's likelihood of the
differences within conditions); a condition without replicates has the median A.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from .fitting import Fit, Whitener
from .problem import Array, Finding, Problem
from .replicates import groups_of

__all__ = ["Unrest", "find_unrest"]

_SURE = 30.0
"""Twice the log likelihood that wandering must gain in a channel."""
_SHARE = 0.5
"""Share of the conditions with replicates that must wander."""
_LEAST = 3.0
"""Variance of the slowest mode, in units of the noise, from which on a condition wanders."""
_POWERS = np.linspace(0.0, 4.0, 17)
_AMPLITUDES = np.concatenate([[0.0], np.geomspace(0.1, 1e8, 181)])


@dataclass(frozen=True)
class Unrest:
    """How replicates of a campaign wander apart; nothing by default."""

    laws: Mapping[str, tuple[float, Mapping[tuple[object, ...], float], float]]
    """Channel -> p, A of each condition, A of any other."""

    def __bool__(self) -> bool:
        return bool(self.laws)

    def weights(self, problem: Problem) -> dict[str, Array]:
        """One over the std of each mode, trial by trial, as `Whitener.weights`."""
        bare = Whitener.bare(problem)
        found = {}
        for trial in problem.trials:
            whole = np.ones(len(bare.weights[trial.id]))
            channels = dict.fromkeys(problem.samples(trial.id).channel.tolist())
            for name, block in zip(channels, bare.block_slices(trial.id), strict=True):
                if name in self.laws:
                    power, amplitudes, other = self.laws[name]
                    amplitude = amplitudes.get(trial.condition, other)
                    whole[block] = 1 / np.sqrt(_variance(amplitude, power, block.stop - block.start))
            found[trial.id] = whole
        return found

    def model_std(self, problem: Problem) -> dict[str, float]:
        """By how much replicates differ, root mean square over their samples [the channel's unit]."""
        found = {}
        for name, (power, amplitudes, _) in self.laws.items():
            squares, count = 0.0, 0
            for trial in problem.trials:
                samples = problem.samples(trial.id)
                mine = samples.channel == name
                if trial.condition in amplitudes and mine.any():
                    own = _variance(amplitudes[trial.condition], power, int(mine.sum())) - 1.0
                    squares += float(own.sum()) * float(np.mean(samples.std[mine] ** 2))
                    count += int(mine.sum())
            found[name] = math.sqrt(squares / max(count, 1))
        return found

    def findings(self, problem: Problem) -> list[Finding]:
        """In plain words."""
        units = {"force": "N", "accel": "m/s2", "depth": "m"}
        return [
            Finding(
                trial=problem.trials[0].id,
                channel=name,
                what=f"replicates differ from one another in {name} by {std:.3g} {units.get(name, '')} beyond the "
                "sensors, each in its own way: that is the bed's, and what is left is weighed against it",
            )
            for name, std in self.model_std(problem).items()
        ]  # fmt: skip

    def other_than(self, known: Unrest) -> bool:
        """Whether a channel wanders in one and not in the other, or by twice as much."""
        if self.laws.keys() != known.laws.keys():
            return True
        pairs = [(law[2], known.laws[name][2]) for name, law in self.laws.items()]
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
        squares, freedom = {}, {}
        for condition, ids in groups.items():
            blocks = [modes[rows[(id, name)]] for id in ids if (id, name) in rows]
            if len(blocks) < 2 or (count := min(len(block) for block in blocks)) < 2:
                continue
            together = np.stack([block[:count] for block in blocks])
            squares[condition] = ((together - together.mean(axis=0)) ** 2).sum(axis=0)
            freedom[condition] = len(blocks) - 1
        if squares and (law := _law(squares, freedom)) is not None:
            laws[name] = law
    return Unrest(laws)


def _law(
    squares: Mapping[tuple[object, ...], Array], freedom: Mapping[tuple[object, ...], int]
) -> tuple[float, dict[tuple[object, ...], float], float] | None:
    """p, A of each condition and their median; None where replicates do not wander for sure."""
    best: tuple[float, float, dict[tuple[object, ...], float]] = (math.inf, 0.0, {})
    for power in _POWERS:
        total, amplitudes = 0.0, {}
        for condition, square in squares.items():
            costs = [_cost(square, freedom[condition], a, float(power)) for a in _AMPLITUDES]
            place = int(np.argmin(costs))
            low, high = _AMPLITUDES[max(place - 1, 0)], _AMPLITUDES[min(place + 1, len(_AMPLITUDES) - 1)]
            finer = minimize_scalar(
                lambda a, s=square, n=freedom[condition], p=float(power): _cost(s, n, a, p),
                bounds=(low, high), method="bounded",
            )  # fmt: skip
            amplitudes[condition] = float(finer.x) if finer.fun < costs[place] else float(_AMPLITUDES[place])
            total += min(float(finer.fun), costs[place])
        if total < best[0]:
            best = total, float(power), amplitudes
    quiet = sum(_cost(square, freedom[condition], 0.0, 0.0) for condition, square in squares.items())
    total, power, amplitudes = best
    wandering = [a for a in amplitudes.values() if 1 + a > _LEAST]
    if quiet - total < _SURE or len(wandering) < _SHARE * len(amplitudes):
        return None
    return power, amplitudes, float(np.median(list(amplitudes.values())))


def _cost(square: Array, freedom: int, amplitude: float, power: float) -> float:
    variance = _variance(amplitude, power, len(square))
    return float((freedom * np.log(variance) + square / variance).sum())


def _variance(amplitude: float, power: float, count: int) -> Array:
    return np.asarray(1.0 + amplitude * (1.0 + np.arange(count)) ** -power)
