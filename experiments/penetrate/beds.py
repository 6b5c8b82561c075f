"""The beds of a penetrate run: their material, how soft their grains are made, and each bed of a seed."""

import math
from typing import Any

from dem import Bed
from dem.contact.timestep import time_step_for
from dem.grains.materials import material
from dem.prepare import prepare
from dem.prepare.bedfile import find_bed
from experiments.grains.bed_progress import BedProgress
from experiments.grains.softening import Softening, bearing_gradient, drop_depth, soften_material
from experiments.runs.progress import Progress
from experiments.runs.stopping import held_back

from .settings import PenetrateSettings
from .units import RAIN, deepest

__all__ = ["bed_step", "choose_softness", "expected_stiffness", "find_material", "fingerprint", "prepare_bed"]


def find_material(settings: PenetrateSettings) -> Any:
    """The grain material, for grains of this size. Raises ValueError naming those there are."""
    return material(settings.material, grain=settings.grain)


def fingerprint() -> str:
    """A digest of the code that computes beds: other code may give other bits."""
    return prepare.fingerprint()


def bed_step(settings: PenetrateSettings, young: float) -> float:
    """The step that the bed will take [s]. Raises ValueError for one that is set and too long."""
    return time_step_for(
        find_material(settings).softened(young),
        diameter=settings.grain * (1 - settings.spread),
        max_overlap=settings.max_overlap,
        wanted=settings.time_step,
    )


def prepare_bed(settings: PenetrateSettings, seed: int, young: float, progress: Progress) -> Any:
    """The bed of one seed: the one that is given, or prepared, or from the cache."""
    if settings.bed is not None:
        return Bed.load(find_bed(settings.bed), arch=settings.arch, threads=settings.threads)
    graded = settings.graded
    with held_back() as asked_to_stop:
        return Bed.prepare(
            find_material(settings), size=settings.bed_size, grain=settings.grain if graded is None else graded,
            spread=settings.spread if graded is None else None,
            packing=settings.packing, gravity=settings.gravity, seed=seed, young=young,
            max_overlap=settings.max_overlap, time_step=settings.time_step, precision=settings.precision,
            arch=settings.arch, threads=settings.threads, cache=settings.cache,
            progress=BedProgress(progress, f"bed of seed {seed}", asked_to_stop, tapped=settings.packing is not None),
        )  # fmt: skip


def choose_softness(settings: PenetrateSettings) -> Softening:
    """The modulus of the grains for these runs (see `experiments.grains.softening`), or the one that is set."""
    material, stiffness = find_material(settings), expected_stiffness(settings)
    area = math.pi * settings.tip_diameter**2 / 4
    fastest, speed = settings.fastest
    drops = [
        drop_depth(speed, settings.mass, settings.weight, stiffness)
        for speed in (*settings.drop_speeds, *settings.other_drop_speeds)
    ]
    return soften_material(
        material, young=settings.young, max_overlap=settings.max_overlap, grain=settings.grain, spread=settings.spread,
        gravity=settings.gravity, bed_height=settings.bed_size[2],
        depth=min(deepest(settings), max(settings.depth, *drops) if drops else settings.depth), speed=speed,
        fastest=fastest, fall=RAIN * settings.bed_size[2], pressure=settings.weight / area,
    )  # fmt: skip


def expected_stiffness(settings: PenetrateSettings) -> float:
    """A guess at the bed's stiffness under the tip [N/m], for progress and frames."""
    material = find_material(settings)
    area = math.pi * settings.tip_diameter**2 / 4
    return bearing_gradient(0.6 * material.density, settings.gravity, material.friction) * area
