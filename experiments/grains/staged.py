"""A bed prepared by stages before an experiment, from the cache if it is there; its rest in another gravity.

How long both take on the clock of the bed is estimated here too.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from dem import Bed
from dem.grains.materials import Material
from dem.grains.sizes import sizes_of
from dem.prepare.prepare import prepare_as
from dem.prepare.recipe import check_stages, parse_stage
from experiments.runs.progress import Progress, as_expected
from rigid.checks.unfit import UnfitSettingsError

from . import say
from .bed_progress import Stages

__all__ = [
    "RAIN", "check_bed_stages", "come_to_rest", "lower_gravity", "lowering_time", "preparation_time", "rest_time",
    "staged_bed",
]  # fmt: skip

_SPELL, _MOST_SPELLS = 1.5, 60
"""How long grains are left to come to rest at a time [sqrt(d / g)], and how often at most."""
_LONGEST = 10.0
"""Rest after gravity was lowered, at most [sqrt(d / g) of the lowered one]; not less than `_MOST_SPELLS`."""
_LOOKS = 10  # Steps of a gravity that falls by a factor of e
_DRAG = 0.3  # Time of the drag at first [sqrt(d / g)]
_STILL = 1e-5  # Mean kinetic energy at rest [m g d]
_CARRIED = 0.02  # Share of the weight by which the force on the floor may differ from it
RAIN = 2.5
"""Height of the loose column that a bed is rained from, over the bed's depth [1]."""
PREPARATION = 1.6
"""What a bed costs in falls from the top of the column that it is rained from, as steps of a bed at rest [1]."""
TAPPED = 10.0
"""How many times that, where it is tapped to a packing fraction: 15 taps from 0.571 to 0.600 [1]."""
EFOLD = 1.0
"""Time in which gravity falls by a factor of e [sqrt(d / g) before], as in `coupling.lowered_gravity`."""
RESTS = 2.0
"""Rest after it has fallen [sqrt(d / g) of the run]: 0.5 to 1.5 in four beds of 500 to 900 grains to 0.1, 0.01 and
0.001 of 1 g, 4 and 6 in two deeper ones to 0.001, by grains that roll on the surface (docs/notes/mujoco.md)."""
AT_ONCE = 45.0
"""Rest where it falls at once [sqrt(d / g) before]: 40 and 50 in two beds of 10 mm, from 1 g to 0.01 g."""


def preparation_time(depth: float, gravity: float, *, tapped: bool) -> float:
    """About how long a bed of this depth [m] takes to prepare under a gravity [m/s2], on its clock [s]."""
    return PREPARATION * (TAPPED if tapped else 1.0) * math.sqrt(2 * RAIN * depth / gravity)


def lowering_time(first: float, last: float, *, grain: float) -> float:
    """About how long gravity takes from `first` to `last` [m/s2], with the rest there, on the bed's clock [s].

    ``grain``: diameter [m].
    """
    return EFOLD * math.log(first / last) * math.sqrt(grain / first) + RESTS * math.sqrt(grain / last)


def rest_time(first: float, *, grain: float) -> float:
    """As `lowering_time`, where gravity falls at once."""
    return AT_ONCE * math.sqrt(grain / first)


def check_bed_stages(
    words: Sequence[str], material: Material, *, size: tuple[float, float, float], grain: float, spread: float
) -> None:
    """Raise ValueError, naming ``bed_stages``, for impossible stages, or stages that do not end with a level bed."""
    try:
        plan = [parse_stage(stage) for stage in words]
        sizes = sizes_of(grain, spread)
        check_stages(plan, size=size, grain=grain, sizes=sizes, cohesive=material.cohesion != "none")
    except ValueError as error:
        raise ValueError(f"bed_stages: {error}") from error
    spoilt = [str(stage) for stage in plan if stage.name in ("cut", "tilt")]
    if spoilt:
        raise ValueError(say("spoilt", stage=spoilt[0]))
    if plan[-1].name != "level":
        raise ValueError(say("not_level", stage=str(plan[-1])))


class _OneStage(Stages):
    """Shows the stages of a preparation as one of the experiment; stops it where it can be continued."""

    def __init__(self, progress: Progress, name: str, count: int, asked_to_stop: Callable[[], bool]) -> None:
        super().__init__(progress, asked_to_stop)
        self.count, self.index = count, -1
        progress.stage(name, total=1.0)

    def stage(self, name: str, total: float | None = None) -> None:
        self.index += total is not None

    def update(self, done: float) -> None:
        super().update(min(1.0, (max(self.index, 0) + min(max(done, 0.0), 1.0)) / self.count))


def staged_bed(
    material: Material,
    stages: Sequence[str],
    *,
    progress: Progress,
    asked_to_stop: Callable[[], bool],
    name: str = "bed",
    **options: Any,
) -> Bed:
    """The bed that `hedgebed bed make` with these stages would make; kept under ``HEDGEBED_CACHE``, as rained ones are.

    `name`: how it shows in the progress; `options` of `dem.prepare.prepare.prepare_as`. Raises RuntimeError if the
    bed cannot be made.
    """
    shown = _OneStage(progress, name, len(stages), asked_to_stop)
    try:
        prepared = prepare_as(material, make=Bed, stages=stages, **options, progress=shown)
    except ValueError as error:  # found while it was prepared, as a packing that cannot be reached
        raise UnfitSettingsError(str(error)) from error
    assert prepared.bed is not None
    return prepared.bed


def lower_gravity(bed: Any, gravity: float, *, unit: float, progress: Stages | None = None) -> None:
    """Lower gravity to this [m/s2], and let the grains come to rest until the floor carries their weight.

    ``unit``: sqrt(d / g) in the gravity before [s]. It falls by a factor of e in each `EFOLD` of these, in a drag, so
    that the grains follow. ``progress``: shows this, and may stop it by KeyboardInterrupt. Stiff grains ring for longer
    than their kinetic energy shows. Raises UnfitSettingsError where they do not come to rest.
    """
    first = -float(bed.gravity[2])
    falls, slower = EFOLD * math.log(first / gravity), math.sqrt(first / gravity)
    count, most = math.ceil(_LOOKS * falls), max(_MOST_SPELLS, math.ceil(_LONGEST * slower / _SPELL))
    shown = None if progress is None else _Lowering(progress, bed, falls=falls, rests=RESTS * slower)
    for step in range(1, count + 1):
        bed.set_gravity(first * (gravity / first) ** (step / count))
        bed.advance(math.ceil(falls / count * unit / bed.time_step), drag_time=_drag(bed, unit))
        if shown is not None:
            shown.fell(step / count)
    come_to_rest(bed, unit=unit, progress=shown, most=most)
    for _ in range(most):
        if abs(bed.floor_force / bed.weight - 1) < _CARRIED:
            break
        bed.advance(math.ceil(_SPELL * unit / bed.time_step))
        if shown is not None:
            shown.rested()
    else:
        raise UnfitSettingsError("the floor does not come to carry the weight of the bed after gravity was lowered")
    _begin_from_here(bed)


class _Lowering:
    """Shows a gravity that falls for so long, and then a rest that is expected to last so long [sqrt(d / g) before]."""

    def __init__(self, progress: Stages, bed: Any, *, falls: float, rests: float) -> None:
        self.progress, self.bed, self.rests, self.spells = progress, bed, rests, 0
        self.fall = falls / (falls + rests)  # Share of the time

    def fell(self, share: float) -> None:
        """Gravity has done this share of its fall."""
        self._show(self.fall * share)

    def rested(self, *_: object) -> None:
        """One spell more is done."""
        self.spells += 1
        self._show(self.fall + (1 - self.fall) * as_expected(self.spells * _SPELL / self.rests))

    update = rested

    def _show(self, share: float) -> None:
        self.progress.show_bed(self.bed)
        self.progress.update(share)


class _Rest:
    """Share of a rest in a drag, and then without: half of the time each, as far as is known."""

    def __init__(self) -> None:
        self.dragged, self.free, self.first = 0, 0, 0.0

    def after(self, ratio: float, *, dragged: bool) -> float:
        """After a spell with this energy over that of rest."""
        if dragged:
            self.dragged += 1
            self.first = self.first or math.log(max(ratio, math.e))  # the logarithm of the energy falls evenly
            return 0.5 * min(1.0, max(0.0, 1 - math.log(max(ratio, 1.0)) / self.first))
        self.free += 1
        return 0.5 + 0.5 * as_expected(self.free / max(4, self.dragged))


def _drag(bed: Any, unit: float) -> float:
    """Time of the drag [s]."""
    return max(_DRAG * unit, 4 * float(bed.time_step))


def come_to_rest(
    bed: Any, *, unit: float, progress: "Progress | _Lowering | None" = None, most: int = _MOST_SPELLS
) -> None:
    """Let grains that have sprung apart come to rest, in a drag first; `unit`: sqrt(d / g) [s]. Then time is 0 again.

    At rest as a bed is when it is prepared: their mean kinetic energy is below 1e-5 m g d, in the drag and then without
    it. Without drag alone a bed that sticks rings as one spring, and its energy falls ten times in 1.6 s only (5,702
    grains of 3.2 mm at 1e-3 g, docs/notes/penetrate.md). Raises UnfitSettingsError where they do not come to rest
    in so many spells at `most`.
    """
    steps, drag = math.ceil(_SPELL * unit / bed.time_step), _drag(bed, unit)
    still, dragged, rest = _STILL * bed.weight * bed.mean_diameter, True, _Rest()
    for spell in range(most):
        bed.advance(steps, drag_time=drag if dragged else math.inf)
        ratio = bed.kinetic_energy / still
        if ratio < 1 and not dragged:
            break
        share = rest.after(ratio, dragged=dragged)
        dragged = dragged and (spell == 0 or ratio >= 1)
        if progress is not None:
            progress.update(share)
    else:
        waited = most * steps * bed.time_step
        raise UnfitSettingsError(say("not_at_rest", waited=waited, energy=ratio * _STILL, still=_STILL))
    _begin_from_here(bed)


def _begin_from_here(bed: Any) -> None:
    """Measure the surface, and count time, displacements and the largest overlap from here on."""
    bed.measure_surface()
    bed.mark_origin()
    bed.max_overlap, bed.steps = 0.0, 0
