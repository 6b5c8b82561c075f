"""Preparation as in the laboratory: stages in any order that makes sense, each with a report of the bed it left."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import runtime
from .bed import Bed, BedFailure
from .graded import Graded
from .grading import measure_grading
from .lid import Lid
from .materials import Facing, Material
from .measure import packing_profile
from .pouring import poured, poured_on, touching_as
from .prepare import BEARING, Specification, kept_in_cache
from .recipe import DENSEST_UNIFORM, FLUFF, Stage, check_stages, parse_stage
from .sizes import Sizes, Uniform
from .stages import _DRAG, _PAST, _SHORT, ENERGY_RATIO, FLOOR_RATIO, Preparation
from .stress import find_contacts, stress_profile

__all__ = ["Laboratory", "Prepared", "StageReport", "measure_stage", "prepare_as"]

# Rained in for a bed of this packing fraction, this many diameters deeper than asked for.
_SURPLUS_DIAMETERS = 2.0
# Layers of the profiles, in mean diameters.
_LAYER = 1.5
# A bed that is tilted moves while it settles anew; it flows once it still does so after this many fall times.
_FLOWS = 15.0


@dataclass(frozen=True)
class StageReport:
    """What one stage left. SI units, ratios without one; profiles from the floor up, a value for each layer.

    Attributes:
        stage: as it is written.
        packing_fraction, coordination_number, surface: of the bed; ``surface`` its height [m].
        kinetic_energy: mean of a grain over m g d [1]. floor_share: what the floor carries over the weight [1].
        criterion: of settling, in words, with what was found.
        pressure_ratio: horizontal over vertical stress, mean over the layers away from floor and surface [1].
        max_overlap: largest since the bed was made, over diameter [1].
        time: of the bed's clock at the end [s].
        profile: ``height`` of the layers' middles [m], ``packing`` [1], ``stress_zz``, ``stress_xx``, ``stress_yy``,
            ``stress_xz`` [Pa], pressure positive; of a bed that was cut, in the middle of what was left.
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
    notes: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Prepared:
    """A bed, what it was made from, and the report of each stage. ``bed`` is None where a file's header was read."""

    bed: Bed | None
    recipe: dict[str, Any]
    reports: list[StageReport]


def prepare_as(
    material: str | Material,
    *,
    stages: Sequence[str | Stage],
    size: Sequence[float],
    grain: float | Sizes | Graded,
    spread: float | None = None,
    gravity: float = 9.81,
    seed: int = 1,
    young: float | None = None,
    max_overlap: float = 0.05,
    time_step: float | None = None,
    floor: Facing | None = None,
    precision: str = "float64",
    arch: str = "cpu",
    threads: int | None = None,
    progress: Any = None,
    keep: str | Path | None = None,
    cache: bool = False,
) -> Prepared:
    """A bed that went through these stages, at rest after each of them, or the same one from the cache.

    Args:
        stages: as ``dem.recipe.parse_stage`` reads them: ``["rain", "fluff", "level", "compact:0.6"]``.
        keep: a file (.npz; a .json comes beside it) where what is under way is kept every minute and after every stage;
            the next call with it goes on from there, to the same bits.
        cache: whether to look in the cache that ``prepare_bed`` has, and to leave the bed there, whole or under way.

    The other options are those of ``dem.prepare.prepare_bed``. The rain is more than is wanted, so that a bed that is
    levelled last has its depth up to a packing fraction of 0.64.

    Raises:
        ValueError: what ``prepare_bed`` refuses; stages that cannot be; a packing, or a slope, that is out of reach;
            both ``keep`` and ``cache``.
        BedFailure: the bed did not come to rest.
    """
    wanted = Specification.of(
        material, size=size, grain=grain, spread=spread, gravity=gravity, seed=seed, young=young,
        max_overlap=max_overlap, time_step=time_step, floor=floor, precision=precision, arch=arch, threads=threads,
    )  # fmt: skip
    stuff, sizes, (x, y, z) = wanted.material, wanted.sizes, wanted.size
    plan = [parse_stage(stage) if isinstance(stage, str) else stage for stage in stages]
    check_stages(plan, size=wanted.size, grain=sizes.mean, sizes=wanted.local, cohesive=stuff.cohesion != "none")
    recipe = wanted.recipe() | {"stages": [str(stage) for stage in plan]}
    if cache and keep is not None:
        raise ValueError(f"keep = {str(keep)!r} beside cache: the cache has a place of its own for what is under way")
    runtime.start(arch=arch, threads=threads, precision=precision)
    own, first = stuff.softened(wanted.young), wanted
    shelf, unfinished = kept_in_cache(recipe)
    if cache:
        keep = unfinished
        if (found := _cached(shelf, own, arch=arch, threads=threads)) is not None:
            return found
    dense = DENSEST_UNIFORM if isinstance(wanted.local, Uniform) else 0.70
    depth = (z + _SURPLUS_DIAMETERS * wanted.coarsest) * dense
    if plan[0].dry:
        first = replace(wanted, material=poured(stuff, friction=plan[0].value), floor=poured_on(wanted.floor))
    work = Laboratory(
        first.rain(depth * x * y),
        stages=plan,
        grain=sizes.mean,
        progress=progress,
        path=None if keep is None else Path(keep),
        recipe=recipe,
        graded=sizes if isinstance(sizes, Graded) else None,
        sticking=lambda bed: touching_as(bed, own, floor=wanted.floor),
    )
    work.find(arch=arch, threads=threads)
    prepared = Prepared(wanted.finish(work.run(), recipe), recipe, work.reports)
    if cache:
        _leave(prepared, shelf, work)
    return prepared


def _cached(path: Path, material: Material, *, arch: str, threads: int | None) -> Prepared | None:
    from .bedfile import load_prepared

    if not path.exists():
        return None
    try:
        found = load_prepared(path, arch=arch, threads=threads)
    except ValueError as problem:
        warnings.warn(f"the cached bed {path.name} cannot be read and is made anew: {problem}", stacklevel=3)
        return None
    assert found.bed is not None
    found.bed.material = material
    return found


def _leave(prepared: Prepared, path: Path, work: Laboratory) -> None:
    from .bedfile import save_prepared

    try:
        save_prepared(prepared, path)
    except OSError as problem:
        warnings.warn(f"the bed could not be kept in the cache: {problem}", stacklevel=3)
    else:
        work.forget()


class Laboratory(Preparation):
    """A bed on its way through stages that can be kept between any two pieces of the work."""

    def __init__(
        self,
        bed: Bed,
        *,
        stages: Sequence[Stage],
        grain: float,
        progress: Any,
        path: Path | None,
        recipe: dict[str, Any] | None = None,
        graded: Graded | None = None,
        sticking: Callable[[Bed], Bed] | None = None,
    ):
        """``path``: as for ``Preparation``; ``recipe``: what is kept there is gone on with only for the same one.

        ``graded``: where sizes belong; every stage's report then says in its notes how they lie. ``sticking``: gives
        the same grains, which touch as their material says (the stage 'stick').
        """
        super().__init__(bed, grain=grain, depth=bed.size[2], packing=None, progress=progress, path=path)
        self.stages = list(stages)
        self.reports: list[StageReport] = []
        self._recipe = recipe
        self._graded = graded
        self._sticking = sticking

    def run(self) -> Bed:
        """Go on to the end; the bed. Raises as ``prepare_as`` does."""
        work = {
            "rain": self._rain_down,
            "stick": self._stick,
            "level": self._level,
            "fluff": self._loosen,
            "compact": self._compact,
            "packing": self._to_packing,
            "cut": self._cut,
            "tilt": self._tilt,
        }
        while len(self.reports) < len(self.stages):
            stage = self.stages[len(self.reports)]
            if self._progress is not None:
                self._progress.stage(str(stage), 1.0)
            said = work[stage.name](stage)
            self.bed.measure_surface()
            if self._graded is not None:
                said["grading"] = asdict(measure_grading(self.bed, self._graded))
            self.reports.append(measure_stage(self.bed, str(stage), grain=self._grain, across=self._left, notes=said))
            self.notes = {}
            self.keep()
        return self.bed

    @property
    def _left(self) -> tuple[float, float] | None:
        """The middle of what a cut has left, from and to [m]; None without a cut."""
        widths = [s.value for s in self.stages[: len(self.reports) + 1] if s.name == "cut" and s.value is not None]
        if not widths:
            return None
        block = self.bed.size[0] - max(widths)
        margin = min(self.bed.size[2], 0.3 * block)
        return 0.5 * max(widths) + margin, self.bed.size[0] - 0.5 * max(widths) - margin

    # ------------------------------------------------------------------ kept and found again

    def _told(self) -> dict[str, Any]:
        return {"recipe": self._recipe, "reports": [asdict(report) for report in self.reports]}

    def _recall(self, kept: dict[str, Any]) -> bool:
        if kept["recipe"] != json.loads(json.dumps(self._recipe)):
            return False
        self.reports = [StageReport(**report) for report in kept["reports"]]
        return True

    # ------------------------------------------------------------------ the stages

    def _rain_down(self, stage: Stage) -> dict[str, Any]:
        if "settle" not in self.notes:
            self._fall()
            self.notes = {"settle": {}}
        self._settle(ENERGY_RATIO, self.notes["settle"])
        return {}

    def _stick(self, stage: Stage) -> dict[str, Any]:
        assert self._sticking is not None
        notes = self.notes
        if not notes:
            notes |= {"before": self.bed.packing_fraction, "settle": {}}
            self.bed = self._sticking(self.bed)
        self._settle(ENERGY_RATIO, notes["settle"])
        return {"before": notes["before"]}

    def _level(self, stage: Stage) -> dict[str, Any]:
        notes = self.notes
        if not notes:
            height = self._depth if stage.value is None else stage.value
            above = self.bed.grains()["position"][:, 2] > height
            notes |= {"removed": int(above.sum()), "settle": {}}
            if above.any():
                self.bed = self.bed.without(above)
        self._settle(ENERGY_RATIO, notes["settle"])
        return {"removed": notes["removed"]}

    def _loosen(self, stage: Stage) -> dict[str, Any]:
        self._fluff(FLUFF if stage.value is None else stage.value, self.notes)
        return {}

    def _to_packing(self, stage: Stage) -> dict[str, Any]:
        assert stage.value is not None
        self._reach(stage.value, self.notes)
        return self._said()

    def _compact(self, stage: Stage) -> dict[str, Any]:
        found, wanted = self.bed.packing_fraction, stage.value
        if not self.notes and wanted is not None and found > wanted + _PAST:
            raise ValueError(
                f"stages: {str(stage)!r} cannot be reached: the bed lies at {found:.4f} already and compacting only "
                f"makes it denser; 'packing:{wanted:g}' loosens it from below first, or ask for more"
            )
        if stage.by == "lid":
            assert wanted is not None
            self._press_to(wanted)
        else:
            self._tap_to(wanted, self.notes)
        return self._said()

    def _said(self) -> dict[str, Any]:
        """What a stage that compacts tells of itself."""
        return {key: self.notes[key] for key in ("taps", "pressure", "packing_under_it", "trace") if key in self.notes}

    def _press_to(self, packing: float) -> None:
        """Press a lid on the bed and take it off, ever harder, until its packing fraction is reached."""
        bed, notes = self.bed, self.notes
        weight = bed.weight / (bed.size[0] * bed.size[1])
        most = BEARING * weight
        if "pressure" not in notes:
            notes |= {"pressure": 0.0, "trace": [bed.packing_fraction], "settle": None}
        while notes["settle"] is not None or bed.packing_fraction < packing - _SHORT:
            if notes["settle"] is None:
                if "body" not in notes:
                    if notes["pressure"] >= most:
                        raise ValueError(
                            f"packing = {packing:g} cannot be reached: a lid pressed to {most:.4g} Pa, {BEARING:g} "
                            f"times what lies on the floor, brought the bed from {notes['trace'][0]:.4f} to "
                            f"{bed.packing_fraction:.4f}; taps do more, or ask for less"
                        )
                    notes["pressure"] = min(most, max(weight, 2 * notes["pressure"]))
                lid = Lid(bed, notes, grain=self._grain, fall_time=self._fall_time, drag_time=_DRAG * self._fall_time)
                while not lid.piece(notes["pressure"], lambda: self._energy):
                    self._pause(0.0)
                notes["settle"] = {}
            self._settle(ENERGY_RATIO, notes["settle"])
            bed.measure_surface()
            notes["trace"].append(bed.packing_fraction)
            notes["settle"] = None
            way = max(1e-9, packing - notes["trace"][0])
            self._pause(min(1.0, max(0.0, (bed.packing_fraction - notes["trace"][0]) / way)))

    def _cut(self, stage: Stage) -> dict[str, Any]:
        """Dig a strip out about x = 0 and let the faces do what they do: without drag first, so that they may fall."""
        assert stage.value is not None
        notes, half = self.notes, 0.5 * stage.value
        if not notes:
            x = np.mod(self.bed.grains()["position"][:, 0], self.bed.size[0])
            gone = (x < half) | (x > self.bed.size[0] - half)
            notes |= {"removed": int(gone.sum()), "height": self.bed.surface, "settle": {}}
            self.bed = self.bed.without(gone)
            notes["began"] = self.bed.time
        bed, fall = self.bed, self._fall_time
        while (bed.time - notes["began"]) < 5 * fall:
            bed.advance(max(1, round(0.05 * fall / bed.time_step)))
            self._pause(min(1.0, (bed.time - notes["began"]) / (5 * fall)))
        self._settle(ENERGY_RATIO, notes["settle"])
        x = np.mod(bed.grains()["position"][:, 0], bed.size[0])
        fallen = int(((x < half) | (x > bed.size[0] - half)).sum())
        return {"removed": notes["removed"], "fallen": fallen, "height": notes["height"]}

    def _tilt(self, stage: Stage) -> dict[str, Any]:
        """Turn gravity towards +x by a degree at a time, at rest after each."""
        assert stage.value is not None
        bed, notes = self.bed, self.notes
        g = math.hypot(*bed.gravity)
        notes.setdefault("held", math.degrees(math.atan2(bed.gravity[0], -bed.gravity[2])))
        notes.setdefault("settle", None)
        while notes["held"] < stage.value or notes["settle"] is not None:
            angle = min(stage.value, notes["held"] + 1.0)
            if notes["settle"] is None:
                bed.set_gravity((g * math.sin(math.radians(angle)), 0.0, -g * math.cos(math.radians(angle))))
                notes["settle"] = {}
            try:
                self._settle(ENERGY_RATIO, notes["settle"], longest=_FLOWS)
            except BedFailure:
                raise ValueError(
                    f"stages: {str(stage)!r} cannot be held: the bed flows at {angle:g} degrees; "
                    f"{notes['held']:g} would do"
                ) from None
            notes |= {"held": angle, "settle": None}
            self._pause(min(1.0, angle / stage.value))
        return {"angle": notes["held"]}


def measure_stage(
    bed: Bed,
    stage: str,
    *,
    grain: float,
    across: tuple[float, float] | None = None,
    notes: dict[str, Any] | None = None,
) -> StageReport:
    """The report of a bed as it is now; ``across``: profiles of this part of its width in x only [m]."""
    grains = bed.grains()
    position, radius = grains["position"], grains["radius"]
    width = bed.size[0]
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
    cosine = -bed.gravity[2] / math.hypot(*bed.gravity)
    share = bed.floor_force / (bed.weight * cosine)
    return StageReport(
        stage=stage,
        packing_fraction=float(
            bed.packing_fraction if across is None else (packing[inner] if inner.any() else packing).mean()
        ),
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
        profile={
            "height": middle.tolist(),
            "packing": packing.tolist(),
            "stress_zz": stress[:, 2, 2].tolist(),
            "stress_xx": stress[:, 0, 0].tolist(),
            "stress_yy": stress[:, 1, 1].tolist(),
            "stress_xz": stress[:, 0, 2].tolist(),
        },
        notes=dict(notes or {}),
    )
