"""A case file on another ground: what in it belongs to its own ground is left out, with a sentence."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pydantic import BaseModel

from experiments.grains.lammps import ON_GRAINS
from experiments.grains.settings import GrainsSettings, TumbleBedSettings
from experiments.runs.reading import Layer

__all__ = ["on_another_ground"]

_OF_THE_TRIAL = ("tumbles", "tumble_turn", "drop_speed", "drop_along", "drop_spin", "drop_theta", "place")
"""Of the settings of a bed, those that say what is done there: they are refused and not left out."""
_OF_ROBOTS = ("settle_gravity", "seeds")
_OF_LAWS = ("spring-damper", *ON_GRAINS)
"""Grounds that have no parameters of their own."""


def on_another_ground(
    settings_class: type[BaseModel], layers: Sequence[Layer], typed: Layer
) -> tuple[list[Layer], list[str]]:
    """The layers of case files without what another ground than theirs does not have, and a sentence on each file.

    Only ``--ground``, in `typed`, changes a ground; what is typed beside it is kept, and refused where it cannot be.
    """
    new, kept, said = typed.values.get("ground"), [], []
    for layer in layers:
        old = layer.values.get("ground")
        names = [] if new is None or old in (None, new) else _foreign(settings_class, layer, str(new))
        names = [name for name in names if name not in typed.values]
        kept.append(replace(layer, values={key: one for key, one in layer.values.items() if key not in names}))
        if names:
            listed = ", ".join(f"{name} = {layer.values[name]}" for name in names)
            said.append(f"left out, as of ground = {old!r} in {layer.source}: {listed}")
    return kept, said


def _foreign(settings_class: type[BaseModel], layer: Layer, new: str) -> list[str]:
    """Names of the settings of the layer, not at their defaults, that the ground `new` does not have."""
    fields = settings_class.model_fields
    foreign = set() if new == "lammps" else {"ranks"}
    foreign |= {"ground_parameters"} if new in _OF_LAWS else set()
    if new not in ON_GRAINS and issubclass(settings_class, GrainsSettings):
        foreign |= {*TumbleBedSettings.model_fields, *_OF_ROBOTS} - {*_OF_THE_TRIAL, "threads"}
    if new not in _OF_LAWS and issubclass(settings_class, TumbleBedSettings):
        foreign |= {"stiffness", "damping"}
    return [name for name in layer.values if name in foreign & {*fields} and _given(layer.values[name], fields[name])]


def _given(value: Any, field: Any) -> bool:
    return (tuple(value) if isinstance(value, list) else value) != field.get_default(call_default_factory=True)
