"""The beds of a penetrate run: their material, how soft their grains are made, and each bed of a seed."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dem import Bed
from dem.contact.timestep import time_step_for
from dem.grains.materials import material
from dem.prepare import prepare
from dem.prepare.bedfile import find_bed
from experiments.grains.bearing import STICKING, Bearing, bearing_of, sinks_past, strength
from experiments.grains.bed_progress import BedProgress
from experiments.grains.recipes import recipe_of
from experiments.grains.softening import Softening, bearing_gradient, drop_depth, soften_material, stable_overlap
from experiments.grains.staged import RAIN, come_to_rest, staged_bed
from experiments.runs.progress import Progress
from experiments.runs.stopping import held_back
from experiments.runs.types import Json
from rigid.platform.rig import STANDARD_GRAVITY

from .settings import PenetrateSettings, say
from .similarity import pace_of
from .units import deepest, rest_stage

__all__ = [
    "bed_step", "choose_softness", "expected_bearing", "expected_stiffness", "find_material", "fingerprint",
    "first_gravity", "overlap_bound", "packing_of", "prepare_bed", "resolution_of", "resting_load",
    "sinks_away", "stages_of", "stiffened", "within_numbers",
]  # fmt: skip

_FLAT = 2.0
"""The same of flat tips over those that widen [1]: in `sand-weak` and `sand` moduli chosen without it had to be 1.8 and
1.9 times as large (docs/results/penetrate-foot-sand-weak, -sand)."""


def find_material(settings: PenetrateSettings) -> Any:
    """The grain material, for grains of this size. Raises ValueError naming those there are."""
    return material(settings.material, grain=settings.grain)


def resolution_of(settings: PenetrateSettings) -> dict[str, Any]:
    """What `resolution_advice` asks of a bed and its tip."""
    return {
        "tip": settings.tip_diameter, "grain": settings.grain, "depth": settings.depth, "size": settings.bed_size,
        "cohesive": find_material(settings).cohesion != "none", "flat": settings.tip == "flat",
    }  # fmt: skip


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
    graded, stages, first = settings.graded, stages_of(settings), first_gravity(settings)
    options: Json = {
        "size": settings.bed_size, "grain": settings.grain if graded is None else graded,
        "spread": settings.spread if graded is None else None, "gravity": first, "seed": seed, "young": young,
        "max_overlap": settings.max_overlap, "time_step": settings.time_step, "precision": settings.precision,
        "arch": settings.arch, "threads": settings.threads, "cache": settings.cache,
    }  # fmt: skip
    name = f"bed of seed {seed}"
    with held_back() as asked_to_stop:
        if stages is None:
            return Bed.prepare(
                find_material(settings), packing=(packing := packing_of(settings)), **options,
                progress=BedProgress(progress, name, asked_to_stop, tapped=packing is not None),
            )  # fmt: skip
        stuff, ending = find_material(settings), asked_to_stop
        bed = staged_bed(stuff, stages, progress=progress, asked_to_stop=ending, name=name, **options)
    if first != settings.gravity:
        bed.set_gravity(settings.gravity)
        progress.stage(rest_stage(settings, seed), total=1.0)
        come_to_rest(bed, unit=math.sqrt(settings.grain / first), progress=progress)
    return bed


def stages_of(settings: PenetrateSettings) -> tuple[str, ...] | None:
    """How a bed is prepared: the stages that are given, or the material's own; None: rained and levelled."""
    if settings.bed_stages is not None:
        return settings.bed_stages
    own = recipe_of(find_material(settings)).stages
    if own is None or settings.packing is None:
        return own
    return ("rain:dry", f"compact:{settings.packing:g}", "stick", "level")


def packing_of(settings: PenetrateSettings) -> float | None:
    """Packing fraction to which a bed without stages is brought [1]; None: as it settles.

    That given; if none is given, a graded bed has that of a bed of one size.
    """
    if settings.packing is not None or settings.graded is None:
        return settings.packing
    return recipe_of(find_material(settings)).rained


def first_gravity(settings: PenetrateSettings) -> float:
    """Gravity under which a bed is prepared [m/s2]: that of the run; in stages, as in a laboratory, at least 1 g."""
    return settings.gravity if stages_of(settings) is None else max(settings.gravity, STANDARD_GRAVITY)


def stiffened(bed: Any, young: float, settings: PenetrateSettings) -> Any:
    """The same bed of stiffer grains, `young` [Pa]: same places, contacts and histories, at rest anew."""
    step = bed.time_step * math.sqrt(bed.material.young / young)  # a contact's time goes with 1 / sqrt(E)
    made = bed.successor(
        bed.state(), material=bed.material.softened(young), time_step=step, max_overlap=bed.overlap_limit
    )
    made.material, made.recipe = bed.material.softened(young), bed.recipe
    come_to_rest(made, unit=math.sqrt(settings.grain / STANDARD_GRAVITY) * pace_of(settings))
    return made


def overlap_bound(settings: PenetrateSettings) -> float:
    """Overlap past which a run is stopped [of a diameter]: that up to which the step is stable for a whole lattice.

    Some 1.2 times `max_overlap`, for which the modulus is chosen (`experiments.grains.softening.stable_overlap`); where
    step or modulus are set, `max_overlap` itself.
    """
    if settings.young is not None or settings.time_step is not None:
        return settings.max_overlap
    return stable_overlap(find_material(settings), settings.max_overlap)


def choose_softness(settings: PenetrateSettings) -> Softening:
    """The modulus of the grains for these runs (see `experiments.grains.softening`), or the one that is set.

    Raises ValueError where the real grains are too soft, and as `within_numbers`.
    """
    with within_numbers(settings):
        return _softness(settings)


@contextmanager
def within_numbers(settings: PenetrateSettings) -> Iterator[None]:
    """Raise ValueError, naming the settings that may be it, where a force is too large for a number."""
    try:
        yield
    except OverflowError:
        key, speed = settings.fastest
        raise ValueError(say("no_number", s=settings, key=key, speed=speed)) from None


def _softness(settings: PenetrateSettings) -> Softening:
    material, stiffness, bears = find_material(settings), expected_stiffness(settings), expected_bearing(settings)
    area = math.pi * settings.tip_diameter**2 / 4
    fastest, speed = settings.fastest
    floor = deepest(settings)
    drops = [
        drop_depth(speed, settings.mass, settings.weight - bears.held, stiffness) for speed in settings.dropped_speeds
    ]
    heavier = first_gravity(settings) / settings.gravity  # while it is prepared
    depth, pressure = settings.depth, 0.0
    if settings.loaded and not sinks_away(settings):  # no bed presses with more than it bears
        depth = min(floor, max(settings.depth, *drops)) if drops else settings.depth
        pressure = min(settings.weight, stiffness * floor + bears.held) / area
    peaks = _FLAT if settings.tip == "flat" else 1.0
    return soften_material(
        material, young=settings.young, max_overlap=settings.max_overlap, grain=settings.grain, spread=settings.spread,
        gravity=settings.gravity, bed_height=heavier * settings.bed_size[2],
        depth=depth, speed=speed, fastest=fastest, fall=heavier * RAIN * settings.bed_size[2], pressure=pressure,
        strength=peaks * strength(material), resistance=STICKING * bears.resistance,
    )  # fmt: skip


def expected_stiffness(settings: PenetrateSettings) -> float:
    """The stiffness under a flat plate of the tip's size by 3D-RFT [N/m], for progress and for what grains bear."""
    material = find_material(settings)
    area = math.pi * settings.tip_diameter**2 / 4
    plate = bearing_gradient(0.6 * material.density, settings.gravity, material.friction) * area
    return plate * strength(material)


def expected_bearing(settings: PenetrateSettings) -> Bearing:
    """What the bed may well bear on the tip: weight and cohesion of the grains (`experiments.grains.bearing`)."""
    area = math.pi * settings.tip_diameter**2 / 4
    return bearing_of(find_material(settings), grain=settings.grain, gravity=settings.gravity, area=area)


def resting_load(settings: PenetrateSettings, *, sure: float = 1.0) -> float:
    """The load that comes to rest where drops are stopped [N], in a bed `sure` times as strong as expected."""
    return sure * expected_bearing(settings).load(deepest(settings))


def sinks_away(settings: PenetrateSettings) -> bool:
    """Whether the load is too much for the whole foot and for this bed, even if they bear twice what is expected."""
    return sinks_past(expected_bearing(settings), settings.weight, (settings.foot, deepest(settings)))
