"""Diagnoses a campaign's folder for `hedgebed bench diagnose`, in a process that is told nothing else.

After the answer it may get the same trials' readings without noise, to which `limit` fits the model that was found.
This module must not import what makes campaigns up (`hidden_*`): the answers are in another process.
"""

import os
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.runs.types import Json

if TYPE_CHECKING:
    from experiments.diagnose.core.outcome import Diagnosis
    from experiments.diagnose.push.limit import Readings

__all__ = ["answer", "begin", "limit"]

_answered: list["Diagnosis"] = []  # the last diagnosis of this process, if it came to its end


def begin() -> None:
    """What a fresh process does first: what it prints belongs to the progress, not to the result."""
    os.dup2(2, 1)


def answer(folder: str) -> Json:
    """What `hedgebed diagnose` says of the campaign in `folder`, as plain numbers and names.

    A diagnosis that fails is an answer too: its verdict is "failed", and `error` says why.
    """
    began, spent = time.monotonic(), time.process_time()
    _answered.clear()
    try:
        told = _diagnosed(folder)
    except Exception:
        told = {"verdict": "failed", "effects": [], "alternatives": [], "error": traceback.format_exc(limit=-3)}
    return told | {"seconds": time.monotonic() - began, "cpu": time.process_time() - spent}


def _diagnosed(folder: str) -> Json:
    from experiments.diagnose.experiment import diagnose_campaign

    found = diagnose_campaign(Path(folder))
    _answered.append(found)
    return {
        "verdict": found.verdict,
        "effects": list(found.effects),
        "alternatives": list(found.alternatives),
        "forms": [form.id for form in found.forms],
        "found_parameters": {effect: found.parameters(effect) for effect in found.effects},
        "before": {"fit": found.before.fit, "held_out": found.before.held_out},
        "after": {"fit": found.after.fit, "held_out": found.after.held_out},
        "with_scatter": _weighed(found),
        "base_parameters": found.base_parameters(found.best),
        "fitted": list(found.fitted),
        "held_out": list(found.held_out),
        "base_values": {name: float(value) for name, value in found.base_values.items()},
        "depends_on": found.dependence[0],
        "findings": [finding.what for finding in found.findings],
        "leading": list(found.choice.best.effects) if found.choice is not None else [],
        "at_bounds": [bound.parameter for bound in found.bounds_after],
    }


def limit(readings: "Readings") -> Json:
    """Numbers of the last answer's model, fitted with the same rows and weights to readings without noise: name or
    effect.name -> value; "error" where that cannot be done."""
    from experiments.diagnose.push.limit import limit_of

    if not _answered:
        return {"error": "no diagnosis came to its end"}
    found = _answered[0]
    try:
        at = limit_of(found.best, readings)
    except (ValueError, RuntimeError) as error:
        return {"error": str(error)}
    numbers = {name: float(told["value"]) for name, told in found.base_parameters(at).items()}
    for form in found.forms:
        for name, (value, _) in found.problem.reported(at.values, form).items():
            numbers[f"{form.effect}.{name}"] = float(value)
    return numbers


def _weighed(found: "Diagnosis") -> Json | None:
    """The gap with the scatter of replicates among the fitted trials; None where these differ by the sensors' noise
    alone, or none repeats another."""
    weighed = found.gap_with_fitted_scatter
    if weighed is None:
        return None
    stages = {"before": weighed.before, "after": weighed.after, "after_std": weighed.after_std}
    return {stage: {"fit": fitted, "held_out": held} for stage, (fitted, held) in stages.items()} | {
        "freedom": weighed.freedom
    }
