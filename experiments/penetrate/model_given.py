"""The settings of `penetrate` without a bed that a model's file decides: the spike, what falls, and its load."""

from __future__ import annotations

import math
from pathlib import Path

from experiments.campaign import PenetrationModel, read_model
from experiments.runs.types import Json

__all__ = ["settings_of_model"]


def settings_of_model(given: Json) -> Json:
    """`given` with the spike of its ``model`` where it says nothing of one: tip, diameter, cone angle, mass, and the
    load m g under which the model's drops moved it, where they all had one gravity.

    What was given stands; with a mass of its own the load is not the model's. A file that cannot be read, or is no
    model of penetration, is left to those who need it.
    """
    try:
        model = read_model(Path(str(given["model"])))
    except (OSError, ValueError):
        return given
    if not isinstance(model, PenetrationModel):
        return given
    spike = model.spike
    diameters = sorted({trial.diameter for trial in model.trial if trial.diameter is not None})
    own: Json = {"tip": spike.tip, "cone_angle": spike.cone_angle}
    own["tip_diameter"] = spike.diameter or (diameters[len(diameters) // 2] if diameters else None)
    if spike.mass is not None and given.get("mass") is None:
        own["mass"] = spike.mass
        gravities = [trial.gravity for trial in model.trial if trial.mode == "drop"]
        if gravities and math.isclose(min(gravities), max(gravities), rel_tol=1e-6):
            own["load"] = spike.mass * gravities[0]
    return {name: value for name, value in own.items() if value is not None} | given
