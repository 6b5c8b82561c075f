"""The bed as a user meets it: ``dem.Bed``."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from hedgebed_renamed import renamed

from .engine.core import BedCore
from .engine.values import BedFailure
from .grains.materials import Material
from .prepare.bedfile import load_prepared
from .prepare.prepare import prepare_as, prepare_bed
from .prepare.report import Prepared
from .shown import html_of

__all__ = ["Bed", "BedFailure"]


class Bed(BedCore):
    """Spherical grains on a floor at z = 0, periodic in x and y, open above.

    Make one with ``Bed.prepare`` (rained, levelled, settled), ``Bed.prepare_as`` (stages of your choice),
    ``Bed.from_grains`` (your own positions) or ``Bed.load``. Lengths in m, times in s, z up. Positions and other values
    of the grains come in the order of grain ids.

    Attributes:
        max_overlap: largest overlap over mean diameter of the pair since the bed was made; set it to 0 to start anew.
        overlap_limit: the bound on it; ``advance`` raises BedFailure past it.
        surface: height of the undisturbed surface [m]. packing_fraction: bulk value [1].
        grain_steps: grains computed, summed over the steps since the bed was made in this process.
        recipe: what ``prepare`` was asked for; empty where the bed was made otherwise.
    """

    @classmethod
    def prepare(cls, material: str | Material, **options: Any) -> Self:
        """A bed rained in, levelled and settled, or the same from the cache.

        Options: ``size`` (x, y, depth) and ``grain`` (mean diameter) [m] are required; ``gravity`` [m/s2] is 9.81 and
        ``seed`` 1 if not given. ``young`` [Pa] is chosen from ``max_overlap`` (0.05 of a diameter) if not given; much
        softer grains end the preparation with BedFailure. Further ones: ``dem.prepare.specification.BedOptions``,
        ``dem.prepare.prepare.prepare_bed``.
        """
        return prepare_bed(material, make=cls, **options)

    @classmethod
    def prepare_as(cls, material: str | Material, **options: Any) -> Prepared[Self]:
        """A bed that went through stages, with its reports; ``dem.prepare.prepare.prepare_as`` lists the options."""
        return prepare_as(material, make=cls, **options)

    @classmethod
    def load_prepared(cls, path: str | Path, *, arch: str = "cpu", threads: int | None = None) -> Prepared[Self]:
        """A bed from a file, with its recipe and reports. Raises ValueError: as ``Bed.load``."""
        return load_prepared(path, arch=arch, threads=threads, make=cls)

    def _repr_html_(self) -> str | None:
        """What a notebook shows for a bed that is the last line of a cell."""
        return html_of("bed", self)

    hold = renamed("hold", "checkpoint")
    take_back = renamed("take_back", "rollback")
    keep_book = renamed("keep_book", "track_contact_work")
    work_taken = renamed("work_taken", "contact_work")
