"""Readings noisier than campaign.toml states: a model that explains them with that noise alone is no `none`.

The format requires a gap of at most 1.2 with the stated noise. The gate uses the noise that it finds, so a base model
can pass it with any gap: a std that is 1,000 times too small leaves a gap of a million. Then these trials do not show
whether an effect smaller than that noise is missing.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from experiments.diagnose.fit.evidence import SMALL

from .outcome import Diagnosis

__all__ = ["Noise", "as_contract", "noise_found"]

_TWICE = 2.0  # times the stated noise from which on even the scatter of replicates does not excuse a sensor


@dataclass(frozen=True)
class Noise:
    """Of one channel, one standard deviation in its SI unit: as campaign.toml states it, and as the fast modes of the
    residuals show it. Where these show no other noise, it is the root mean square of the residuals."""

    stated: float
    found: float


def as_contract(found: Diagnosis) -> Diagnosis:
    """`found`, or in place of a `none` whose readings are noisier than stated an `unknown` without an effect.

    The readings are noisier where fitted and held-out trials both leave more than 1.2 with the scatter of replicates
    counted as noise. They are noisier too where both leave it without that scatter and a sensor is more than twice as
    noisy. If only held-out trials leave more, it decides nothing: a tumble may diverge late. Times that jitter are the
    clock's noise.
    """
    return replace(found, verdict="unknown") if _too_noisy(found) else found


def _too_noisy(found: Diagnosis) -> bool:
    if found.verdict != "none" or found.jitters:
        return False
    plain, weighed = (found.before.fit, found.before.held_out), found.gap_with_scatter
    if _least(plain) <= SMALL:
        return False
    loud = any(colour.std > _TWICE for colour in found.colours.values())
    return loud or weighed is None or _least(weighed.before) > SMALL


def _least(gap: tuple[float, float | None]) -> float:
    return min(part for part in gap if part is not None)


def noise_found(found: Diagnosis) -> Mapping[str, Noise]:
    """The noise of each channel, stated and found, where the verdict is `unknown` for the noise alone; else empty."""
    if found.verdict != "unknown" or found.choice is not None:
        return {}
    colours = {colour.channel: colour for colour in found.colours.values()}
    sums: dict[str, list[float]] = {}
    stated: dict[str, float] = {}
    for trial in (*found.fitted, *found.held_out):
        here = found.problem.compare(found.base_values, (), trial)
        stds = found.problem.sensor_std(found.base_values, (), trial)
        samples = found.problem.samples(trial)
        for name, columns in here.items():
            rest = (columns["measured"] - columns["model"])[np.isfinite(stds[name])]
            rest = rest[np.isfinite(rest)]
            total = sums.setdefault(name, [0.0, 0.0])
            total[0] += float(rest @ rest)
            total[1] += len(rest)
            stated[name] = float(samples.std[samples.channel == name].min())
    return {
        name: Noise(std, colours[name].std * std if name in colours else math.sqrt(sums[name][0] / sums[name][1]))
        for name, std in stated.items() if sums[name][1]
    }  # fmt: skip
