"""A bed prepared by stages before an experiment, from the cache if it is there."""

from collections.abc import Callable, Sequence
from typing import Any

from dem import Bed
from dem.grains.materials import Material
from dem.grains.sizes import sizes_of
from dem.prepare.prepare import prepare_as
from dem.prepare.recipe import check_stages, parse_stage
from experiments.runs.progress import Progress

from . import say
from .bed_progress import Stages

__all__ = ["check_bed_stages", "staged_bed"]


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
        raise RuntimeError(str(error)) from error
    assert prepared.bed is not None
    return prepared.bed
