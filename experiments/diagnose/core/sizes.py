"""How large each effect is: what the measured signal would lack without it, everything else refitted.

The signature is the root mean square of what the readings change by over the sensors' noise, as the hidden suite has it
(docs/diagnose.md); of what a channel reads it is a share, and it is at most so many N.
"""

import math
from typing import Any

import numpy as np

from experiments.diagnose.fit.evidence import held_out_fit
from experiments.diagnose.fit.fitting import fit
from experiments.diagnose.fit.gaps import unit_of
from experiments.diagnose.fit.problem import Form, Values

from .outcome import Diagnosis

__all__ = ["effect_sizes"]

_ROUNDS = 8
_SIGNALS = ("force", "accel", "ax", "ay")
"""Channels of which a change is a share: readings that are 0 where nothing pushes."""


def effect_sizes(found: Diagnosis) -> list[dict[str, Any]]:
    """``sizes`` of diagnosis.json, the largest first: effect, signature [noise], and of the channel in which it is
    plainest the change's root mean square and largest size in `unit`, and its share of what the channel reads."""
    sizes = []
    for effect in found.effects:
        rest = tuple(form for form in found.forms if form.effect != effect)
        values = dict(found.base_values) if not rest else _without(found, rest)
        sizes.append({"effect": effect, **_size(found, values, rest)})
    return sorted(sizes, key=lambda size: -size["signature"])


def _without(found: Diagnosis, rest: tuple[Form, ...]) -> dict[str, float]:
    """Values of the best model without an effect, refitted."""
    model = found.best.model.with_forms(rest)
    values = fit(model, found.best.values, rounds=_ROUNDS).values
    return held_out_fit(model, found.held_out, values) if found.held_out else dict(values)


def _size(found: Diagnosis, values: Values, rest: tuple[Form, ...]) -> dict[str, Any]:
    problem = found.problem
    whole: dict[str, list[float]] = {}
    for trial in (*found.fitted, *found.held_out):
        before, after = problem.compare(values, rest, trial), problem.compare(found.best_values, found.forms, trial)
        stds = problem.sensor_std(found.best_values, found.forms, trial)
        for name, columns in after.items():
            change = columns["model"] - before[name]["model"]
            good = np.isfinite(change) & np.isfinite(stds[name])
            if not good.any():
                continue
            sums = whole.setdefault(name, [0.0] * 5)
            sums[0] += int(good.sum())
            sums[1] += float(np.sum((change[good] / stds[name][good]) ** 2))
            sums[2] += float(np.sum(change[good] ** 2))
            sums[3] = max(sums[3], float(np.abs(change[good]).max()))
            sums[4] += float(np.sum(columns["measured"][good] ** 2))
    if not whole:
        return {"signature": 0.0, "channel": None, "unit": None, "rms": None, "most": None, "share": None}
    channel = max(whole, key=lambda name: whole[name][1] / whole[name][0])
    count, _, squares, most, signal = whole[channel]
    unit, factor = unit_of(channel)
    rms = math.sqrt(squares / count)
    return {
        "signature": math.sqrt(sum(own[1] for own in whole.values()) / sum(own[0] for own in whole.values())),
        "channel": channel, "unit": unit, "rms": factor * rms, "most": factor * most,
        "share": math.sqrt(squares / signal) if channel in _SIGNALS and signal > 0 else None,
    }  # fmt: skip
