"""The result of a stage of a preparation: its report, and a bed with the reports of all its stages."""

import math
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from dem.engine.core import BedCore
from dem.engine.stress import find_contacts, stress_profile
from dem.grains.packing import packing_profile
from dem.grains.sizes import Json

__all__ = ["ENERGY_RATIO", "FLOOR_RATIO", "Prepared", "ShowsBed", "StageReport", "measure_stage"]

# Settled: mean kinetic energy of a grain over m g d, and floor force over weight.
ENERGY_RATIO, FLOOR_RATIO = 1e-5, 0.01
# Layers of the profiles, in mean diameters.
_LAYER = 1.5
B = TypeVar("B", bound=BedCore)


@runtime_checkable
class ShowsBed(Protocol):
    """A progress display that also accepts the bed in preparation, before each ``update`` of the share done."""

    def show_bed(self, bed: BedCore) -> None:
        """Show the bed in its present state."""


@dataclass(frozen=True)
class StageReport:
    """The bed at the end of a stage. SI units, ratios without; profiles from the floor up, a value for each layer.

    Attributes:
        stage: its text in the recipe.
        packing_fraction, coordination_number, surface: of the bed; ``surface`` its height [m].
        kinetic_energy: mean of a grain over m g d [1]. floor_share: what the floor carries over the weight [1].
        criterion: of settling, in words, with what was found.
        pressure_ratio: horizontal over vertical stress, mean over the layers away from floor and surface [1].
        max_overlap: largest since the bed was made, over diameter [1].
        time: of the bed's clock at the end [s].
        profile: ``height`` of the layers' middles [m], ``packing`` [1], ``stress_zz``, ``stress_xx``, ``stress_yy``,
            ``stress_xz`` [Pa], pressure positive. Of a bed that was cut they are of the middle of what was left.
        notes: what the stage alone knows: taps, pressures, grains removed.
    """

    stage: str
    packing_fraction: float
    coordination_number: float
    surface: float
    grain_count: int
    kinetic_energy: float
    floor_share: float
    criterion: str
    pressure_ratio: float | None
    max_overlap: float
    time: float
    profile: dict[str, list[float]]
    notes: Json = field(default_factory=dict)


@dataclass(frozen=True)
class Prepared(Generic[B]):
    """A bed, what it was made from, and the report of each stage. ``bed`` is None where a file's header was read."""

    bed: B | None
    recipe: Json
    reports: list[StageReport]

    @property
    def whole(self) -> B:
        """The bed. Raises ValueError where only the header of its file was read."""
        if self.bed is None:
            raise ValueError("this preparation was read without its bed: there is nothing to save")
        return self.bed


def measure_stage(
    bed: BedCore, stage: str, *, grain: float, across: tuple[float, float] | None = None, notes: Json | None = None
) -> StageReport:
    """The report of the present bed; ``across``: profiles of this part of its width in x only [m]."""
    grains = bed.grains()
    position, radius, width = grains.position, grains.radius, bed.size[0]
    if across is not None:
        x = np.mod(position[:, 0], bed.size[0])
        inside = (x >= across[0]) & (x < across[1])
        position, radius, width = position[inside], radius[inside], across[1] - across[0]
    count = max(3, round(bed.surface / (_LAYER * grain)))
    edges = np.linspace(0.0, bed.surface, count + 1)
    packing = packing_profile(position[:, 2], radius, width * bed.size[1], edges)
    stress = stress_profile(bed, edges, contacts=find_contacts(bed), across=across)
    middle = 0.5 * (edges[1:] + edges[:-1])
    inner = (middle > 2 * grain) & (middle < bed.surface - 2 * grain) & (stress[:, 2, 2] > 0)
    ratio = 0.5 * (stress[:, 0, 0] + stress[:, 1, 1])[inner] / stress[:, 2, 2][inner]
    energy = bed.kinetic_energy / bed.weight / grain
    share = bed.floor_force / (bed.weight * (-bed.gravity[2] / math.hypot(*bed.gravity)))
    parts = packing[inner] if inner.any() else packing
    return StageReport(
        stage=stage,
        packing_fraction=float(bed.packing_fraction if across is None else parts.mean()),
        coordination_number=bed.coordination_number,
        surface=float(bed.surface),
        grain_count=bed.grain_count,
        kinetic_energy=float(energy),
        floor_share=float(share),
        criterion=f"without drag: {energy:.1e} m g d of kinetic energy a grain (below {ENERGY_RATIO:g}), the floor "
        f"carries {share:.4f} of the weight (within {FLOOR_RATIO:g})",
        pressure_ratio=float(ratio.mean()) if len(ratio) else None,
        max_overlap=bed.max_overlap,
        time=float(bed.time),
        profile={"height": middle.tolist(), "packing": packing.tolist()}
        | {f"stress_{'xyz'[i]}{'xyz'[j]}": stress[:, i, j].tolist() for i, j in ((2, 2), (0, 0), (1, 1), (0, 2))},
        notes=dict(notes or {}),
    )
