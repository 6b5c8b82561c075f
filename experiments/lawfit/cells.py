"""Cells of a crossed design: every tip under every gravity, all in grains of one size.

The settings describe the runs of the first tip under the first gravity. A cell of another tip or gravity has similar
runs: lengths go with the diameter D of the tip, speeds with sqrt(g D), times with sqrt(D / g), loads with g D^3 and
masses with D^3. So depth over D and Froude number v / sqrt(g D) are the same in all cells. So is the force over rho g
D^3 if it depends on these two alone. Grain and bed stay as they are: D over the grain differs between tips.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import ValidationError

from experiments.converge.design import MOST_OVERLAP, ROOM
from experiments.penetrate import beds
from experiments.penetrate.settings import PenetrateSettings

from .settings import LawFitSettings, say

__all__ = ["FASTER", "Cell", "cells_of"]

FASTER = 2.0
"""Speed of a drive that is added, over the fastest of the settings [1]; the modulus of the grains allows for it."""


@dataclass(frozen=True)
class Cell:
    """One tip under one gravity."""

    base: PenetrateSettings  # The runs of each bed
    loads: tuple[float, ...] = ()  # Further loads of placements [N]
    unload_depths: tuple[float, ...] = ()  # Depths at which the tip is unloaded and loaded again [m]
    drag_depths: tuple[float, ...] = ()  # Depths at which the tip is moved sideways [m]
    new_bed: bool = True  # Whether its beds are its own; another tip under this gravity has made them otherwise

    @property
    def name(self) -> str:
        """Its name in results and files."""
        base = self.base
        angle = f"-{base.cone_angle:g}deg" if base.tip == "cone" else ""
        return f"{base.tip}-{1e3 * base.tip_diameter:.4g}mm{angle}-{base.gravity:.4g}ms2"


def cells_of(settings: LawFitSettings) -> list[Cell]:
    """All cells in their order, tips of the first gravity first; one if neither tips nor gravities are given.

    Beds of one gravity have one modulus, so that all tips use the same beds. Raises ValueError, naming the cell, for
    runs that `penetrate` refuses.
    """
    plain = {name: getattr(settings, name) for name in PenetrateSettings.model_fields}
    plain |= {"other_speeds": settings.speeds, "other_drop_speeds": settings.drop_speeds}
    first = PenetrateSettings.model_construct(**plain)
    cells = []
    for gravity in settings.gravities or (first.gravity,):
        row = [
            _cell(settings, first, tip, gravity)
            for tip in settings.tip_shapes or ((first.tip, first.tip_diameter, first.cone_angle),)
        ]
        cells += _one_modulus(row)
    if len(cells) > 1:
        for cell in cells:
            _check(cell)
    return cells


def _cell(settings: LawFitSettings, first: PenetrateSettings, tip: tuple[str, float, float], gravity: float) -> Cell:
    shape, diameter, angle = tip
    longer, heavier = diameter / first.tip_diameter, gravity / first.gravity
    if (shape, angle) == (first.tip, first.cone_angle) and longer == heavier == 1:
        return Cell(first, settings.loads, settings.unload_depths, settings.drag_depths)
    faster, later = math.sqrt(longer * heavier), math.sqrt(longer / heavier)
    load = heavier * longer**3

    def times(values: Sequence[float], factor: float) -> tuple[float, ...]:
        return tuple(_typed(factor * value) for value in values)

    changed = {"tip": shape, "tip_diameter": diameter, "cone_angle": angle, "gravity": gravity}
    for name in ("speeds", "other_speeds", "drop_speeds", "other_drop_speeds"):
        changed[name] = times(getattr(first, name), faster)
    for name in ("lowering_speed", "retreat_speed"):
        changed[name] = _typed(faster * getattr(first, name))
    for name in ("hold", "after_stop", "drop_time", "rest_time"):
        changed[name] = _typed(later * getattr(first, name))
    changed |= {"depth": _typed(longer * first.depth), "load": _typed(load * first.weight)}
    changed["mass"] = _typed(longer**3 * first.mass)
    if first.shaft_diameter is not None:
        changed["shaft_diameter"] = diameter if shape == "flat" else _typed(longer * first.shaft_diameter)
    return Cell(
        first.model_copy(update=changed), times(settings.loads, load), times(settings.unload_depths, longer),
        times(settings.drag_depths, longer),
    )  # fmt: skip


def _one_modulus(row: Sequence[Cell]) -> list[Cell]:
    """The cells of one gravity with one modulus, stiff enough for the fastest drive that may be added."""
    bases = [cell.base for cell in row]
    if bases[0].young is None:
        faster = [
            base.model_copy(update={"speeds": (*base.speeds, FASTER * max(base.speeds))} | _heaviest(cell))
            for base, cell in zip(bases, row, strict=True)
        ]
        room = min(
            MOST_OVERLAP, ROOM * bases[0].max_overlap
        )  # one modulus for all beds: a run does not make it stiffer
        young = max(beds.choose_softness(base).young for base in faster)
        bases = [base.model_copy(update={"young": young, "max_overlap": room}) for base in bases]
    new = [number == 0 or not base.cache for number, base in enumerate(bases)]
    return [
        Cell(base, cell.loads, cell.unload_depths, cell.drag_depths, own)
        for base, cell, own in zip(bases, row, new, strict=True)
    ]


def _heaviest(cell: Cell) -> dict[str, float]:
    return {"load": max(cell.base.weight, *cell.loads)} if cell.loads else {}


def _check(cell: Cell) -> None:
    try:
        PenetrateSettings(**cell.base.model_dump())  # `model_copy` checks nothing
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise ValueError(say("bad_cell", name=cell.name, reason=reason)) from None


def _typed(number: float) -> float:
    """To six digits, as one would type it."""
    return float(f"{number:.6g}")
