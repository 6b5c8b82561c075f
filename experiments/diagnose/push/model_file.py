"""model.toml of pushes and drops: the campaign's tables with fitted numbers and effects."""

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.campaign import EffectTable, PenetrationCampaign, PenetrationModel
from experiments.campaign.tables import (
    BASE_NOTE,
    ERRORS_NOTE,
    OTHERS_NOTE,
    PEAKS_NOTE,
    RANGE_NOTE,
    SCATTER_NOTE,
    SURFACE_NOTE,
)  # fmt: skip

from .data import Prepared
from .parameters import comes_back, speeds_of

__all__ = ["Pairs", "model_of", "range_of"]

Pairs = dict[str, dict[str, float]]
"""Diameter [m] as text -> ``stiffness`` [N/m] and ``damping`` [N s/m]."""


def model_of(
    tables: PenetrationCampaign, middle: float, pairs: Pairs, plain: Pairs, effects: Sequence[EffectTable],
    covered: Mapping[str, Any], surface_depth: float, more: Mapping[str, Mapping[str, object]],
) -> PenetrationModel:  # fmt: skip
    """The tables of model.toml. `middle`: the diameter [m] whose K and C stand in [surface]; `pairs`: K and C beside
    the effects; `plain`: those of the base model that was fitted without effects, empty where there are none;
    `covered`: the range of the campaign's trials (`range_of`), noted; `surface_depth`: where the bed begins to carry
    [m], noted; `more`: further notes, by name."""
    ours = (BASE_NOTE, RANGE_NOTE, SURFACE_NOTE, ERRORS_NOTE, SCATTER_NOTE, OTHERS_NOTE, PEAKS_NOTE)
    notes: dict[str, Any] = {name: note for name, note in tables.notes.items() if name not in ours}
    notes |= {name: dict(note) for name, note in more.items()}
    if plain:
        notes[BASE_NOTE] = plain
    if covered:
        notes[RANGE_NOTE] = dict(covered)
    if surface_depth:
        notes[SURFACE_NOTE] = {"depth_m": float(f"{surface_depth:.6g}")}
    if len(pairs) > 1:
        notes["fitted_by_diameter"] = pairs
    same = {name: getattr(tables, name) for name in ("format", "kind", "name", "uncertainty", "sensors")}
    surface, spike, listed = tables.surface.model_copy(update=pairs[f"{middle:g}"]), tables.spike, tables.trial
    if spike.diameter != middle:
        listed = tuple(trial.model_copy(update={"diameter": tables.diameter_of(trial)}) for trial in listed)
        spike = spike.model_copy(update={"diameter": middle})
    return PenetrationModel(**same, spike=spike, surface=surface, notes=notes, trial=listed, effect=tuple(effects))


def range_of(trials: Sequence[Prepared], frame_stiffness: float | None = None) -> dict[str, Any]:
    """The range of the pushes among `trials`: greatest depth [m], slowest and fastest speed of loading [m/s], and
    whether one was withdrawn. Also the stiffness [N/m] of a frame whose bending was subtracted from their depth. Empty
    without pushes."""
    pushes = [trial for trial in trials if trial.driven]
    if not pushes:
        return {}
    speeds = [float(speeds_of(trial)[1]) for trial in pushes]
    deepest = max(float(trial.path.depth.max()) for trial in pushes)
    frame = {} if frame_stiffness is None else {"frame_stiffness_N_m": frame_stiffness}
    return {"depth_m": float(f"{deepest:.4g}"), "speed_m_s": [float(f"{v:.4g}") for v in (min(speeds), max(speeds))],
            "withdrawal": comes_back(pushes), **frame}  # fmt: skip
