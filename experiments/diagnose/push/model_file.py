"""model.toml of pushes and drops: the campaign's tables with fitted numbers and effects."""

from collections.abc import Sequence
from typing import Any

from experiments.campaign import EffectTable, PenetrationCampaign, PenetrationModel
from experiments.campaign.tables import BASE_NOTE

__all__ = ["Pairs", "model_of"]

Pairs = dict[str, dict[str, float]]
"""Diameter [m] as text -> ``stiffness`` [N/m] and ``damping`` [N s/m]."""


def model_of(
    tables: PenetrationCampaign, middle: float, pairs: Pairs, plain: Pairs, effects: Sequence[EffectTable]
) -> PenetrationModel:
    """The tables of model.toml. `middle`: the diameter [m] whose K and C stand in [surface]; `pairs`: K and C beside
    the effects; `plain`: those of the base model that was fitted without effects, empty where there are none."""
    notes: dict[str, Any] = {name: note for name, note in tables.notes.items() if name != BASE_NOTE}
    if plain:
        notes[BASE_NOTE] = plain
    if len(pairs) > 1:
        notes["fitted_by_diameter"] = pairs
    same = {name: getattr(tables, name) for name in ("format", "kind", "name", "uncertainty", "sensors")}
    surface, spike, trials = tables.surface.model_copy(update=pairs[f"{middle:g}"]), tables.spike, tables.trial
    if spike.diameter != middle:
        trials = tuple(trial.model_copy(update={"diameter": tables.diameter_of(trial)}) for trial in trials)
        spike = spike.model_copy(update={"diameter": middle})
    return PenetrationModel(**same, spike=spike, surface=surface, notes=notes, trial=trials, effect=tuple(effects))
