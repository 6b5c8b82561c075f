"""A bed on its way through the stages of its preparation, with a report of what each of them left."""

import hashlib
import json
import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from dem.contact.timestep import time_step_for
from dem.engine.base import FLOOR
from dem.engine.values import BedFailure
from dem.files.arrays import read_arrays
from dem.grains.graded import Graded
from dem.grains.materials import Facing, Material
from dem.grains.sizes import Json
from dem.measure.grading import measure_grading, packing_under
from dem.measure.lid import Lid

from .recipe import FLUFF, Stage
from .report import ENERGY_RATIO, B, ShowsBed, StageReport, measure_stage
from .specification import BEARING
from .stages import DRAG, PAST, SHORT, Preparation

__all__ = ["Laboratory", "touching_as"]

# Nearly at rest, as a bed is that is cut level before it has settled.
_ROUGH_ENERGY_RATIO = 1e-2
# A bed that is tilted moves while it settles anew; it flows once it still does so after this many fall times.
_FLOWS = 15.0
_KEEP_INTERVAL = 60.0  # between two times that it is kept [s of waiting]


class Laboratory(Preparation[B]):
    """A bed on its way through stages that can be kept between any two pieces of the work."""

    def __init__(
        self,
        bed: B,
        *,
        stages: Sequence[Stage],
        grain: float,
        progress: Any = None,
        path: Path | None = None,
        recipe: Json | None = None,
        graded: Graded | None = None,
        sticking: tuple[Material, Facing | None] | None = None,
        labels: dict[str, str] | None = None,
    ):
        """A preparation at its beginning.

        Args:
            grain: mean diameter [m]. progress: as ``prepare_as`` takes it.
            path: where it is saved from time to time (.npz, and .json beside it); None: nowhere.
            recipe: a preparation saved at ``path`` is continued only for the same recipe.
            graded: sizes by place; every stage's report then states where the sizes lie.
            sticking: contact properties of grains and floor from the stage 'stick' on.
            labels: names of stages in the progress, for each name in the recipe; with labels stages have no reports.
        """
        super().__init__(bed, grain=grain)
        self.stages = list(stages)
        self.reports: list[StageReport] = []
        self.done = 0
        self._progress, self._path, self._kept = progress, path, time.monotonic()
        self._recipe, self._graded, self._sticking, self._labels = recipe, graded, sticking, labels

    @property
    def _packing(self) -> float:
        """Of a graded bed that of its fine grains, which a tip meets: mixed sizes beside them lie denser."""
        return self.bed.packing_fraction if self._graded is None else packing_under(self.bed, self._graded)

    def keep(self) -> None:
        """Save the preparation in its present state."""
        if self._path is not None:
            self.bed.save(self._path)
            if self._densest:
                np.savez(self._path.with_suffix(".densest.npz"), **self._densest)  # type: ignore[arg-type]
            reports = [asdict(report) for report in self.reports]
            kept = {"recipe": self._recipe, "done": self.done, "reports": reports, "notes": self.notes}
            kept |= {"steps": self.bed.steps}
            self._path.with_suffix(".json").write_text(json.dumps(kept | {"digest": _digest(kept)}))
            self._kept = time.monotonic()

    def find(self, **options: Any) -> None:
        """Go back to what was kept, if there is something whole; options are those of ``Bed.load``.

        Warns where it is damaged; the preparation then begins anew.
        """
        if self._path is None or not self._path.exists():
            return
        about = self._path.with_suffix(".json")
        try:
            kept = json.loads(about.read_text())
            if kept.pop("digest") != _digest(kept):
                raise ValueError(f"the digest of {about.name} differs")
            bed, notes = type(self.bed).load(self._path, **options), dict(kept["notes"])
            # The work ended between the two files, or is another's.
            if kept["steps"] != bed.steps or kept["recipe"] != json.loads(json.dumps(self._recipe)):
                return
            reports, done = [StageReport(**report) for report in kept["reports"]], int(kept["done"])
            if (densest := self._path.with_suffix(".densest.npz")).exists():
                self._densest = read_arrays(densest)
        except FileNotFoundError:  # the work ended before the second file
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as problem:
            words = f"{about} or {self._path.name} beside it is damaged ({problem}): the preparation begins anew"
            warnings.warn(words, stacklevel=3)
            return
        self.bed, self.notes, self.reports, self.done = bed, notes, reports, done

    def forget(self) -> None:
        """Remove what was kept."""
        if self._path is not None:
            for path in (self._path, *(self._path.with_suffix(suffix) for suffix in (".json", ".densest.npz"))):
                path.unlink(missing_ok=True)

    def _pause(self, done: float) -> None:
        try:
            if self._progress is not None:
                if isinstance(self._progress, ShowsBed):
                    self._progress.show_bed(self.bed)
                self._progress.update(done)
        except KeyboardInterrupt:
            self.keep()
            raise
        if time.monotonic() - self._kept >= _KEEP_INTERVAL:
            self.keep()

    def run(self) -> B:
        """Go on to the end; the bed. Raises as ``prepare_as``; a KeyboardInterrupt of ``progress`` keeps the work."""
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
        while self.done < len(self.stages):
            stage = self.stages[self.done]
            if self._progress is not None:
                self._progress.stage((self._labels or {}).get(stage.name, str(stage)), 1.0)
            notes = work[stage.name](stage)
            self.bed.measure_surface()
            if self._labels is None:
                if self._graded is not None:
                    notes["grading"] = asdict(measure_grading(self.bed, self._graded))
                across = self._left
                self.reports.append(measure_stage(self.bed, str(stage), grain=self._grain, across=across, notes=notes))
            self.notes = {}
            self.done += 1
            self.keep()
        return self.bed

    @property
    def _left(self) -> tuple[float, float] | None:
        """The middle of what a cut has left, from and to [m]; None without a cut."""
        widths = [s.value for s in self.stages[: self.done + 1] if s.name == "cut" and s.value is not None]
        if not widths:
            return None
        block = self.bed.size[0] - max(widths)
        margin = min(self.bed.size[2], 0.3 * block)
        return 0.5 * max(widths) + margin, self.bed.size[0] - 0.5 * max(widths) - margin

    def _rain_down(self, stage: Stage) -> Json:
        if "settle" not in self.notes:
            self._fall()
            self.notes = {"settle": {}}
        self._settle(_ROUGH_ENERGY_RATIO if stage.by == "rough" else ENERGY_RATIO, self.notes["settle"])
        return {}

    def _stick(self, stage: Stage) -> Json:
        assert self._sticking is not None
        notes = self.notes
        if not notes:
            notes |= {"before": self.bed.packing_fraction, "settle": {}}
            self.bed = touching_as(self.bed, *self._sticking)
        self._settle(ENERGY_RATIO, notes["settle"])
        return {"before": notes["before"]}

    def _level(self, stage: Stage) -> Json:
        notes = self.notes
        if not notes:
            height = self.bed.size[2] if stage.value is None else stage.value
            above = self.bed.grains().position[:, 2] > height
            notes |= {"removed": int(above.sum()), "settle": {}}
            if above.any():
                self.bed = self.bed.without(above)
        self._settle(ENERGY_RATIO, notes["settle"])
        return {"removed": notes["removed"]}

    def _loosen(self, stage: Stage) -> Json:
        self._fluff(stage.value or FLUFF, self.notes)
        return {}

    def _to_packing(self, stage: Stage) -> Json:
        assert stage.value is not None
        self._reach(stage.value, self.notes)
        return self._results()

    def _compact(self, stage: Stage) -> Json:
        found, wanted = self._packing, stage.value
        if not self.notes and wanted is not None and found > wanted + PAST:
            raise ValueError(
                f"stages: {str(stage)!r} cannot be reached: the bed lies at {found:.4f} already and compacting only "
                f"makes it denser; 'packing:{wanted:g}' loosens it from below first, or ask for more"
            )
        if stage.by == "lid":
            assert wanted is not None
            self._press_to(wanted)
        else:
            self._tap_to(wanted, self.notes)
        return self._results()

    def _results(self) -> Json:
        return {key: self.notes[key] for key in ("taps", "pressure", "packing_under_it", "trace") if key in self.notes}

    def _press_to(self, packing: float) -> None:
        """Press a lid on the bed and take it off, ever harder, until its packing fraction is reached."""
        bed, notes = self.bed, self.notes
        weight = bed.weight / (bed.size[0] * bed.size[1])
        most = BEARING * weight
        if "pressure" not in notes:
            notes |= {"pressure": 0.0, "trace": [self._packing], "settle": None}
        while notes["settle"] is not None or self._packing < packing - SHORT:
            if notes["settle"] is None:
                if "body" not in notes:
                    if notes["pressure"] >= most:
                        raise ValueError(
                            f"packing = {packing:g} cannot be reached: a lid pressed to {most:.4g} Pa, {BEARING:g} "
                            f"times what lies on the floor, brought the bed from {notes['trace'][0]:.4f} to "
                            f"{self._packing:.4f}; taps do more, or ask for less"
                        )
                    notes["pressure"] = min(most, max(weight, 2 * notes["pressure"]))
                lid = Lid(bed, notes, grain=self._grain, fall_time=self._fall_time, drag_time=DRAG * self._fall_time)
                while not lid.piece(notes["pressure"]):
                    self._pause(0.0)
                notes["settle"] = {}
            self._settle(ENERGY_RATIO, notes["settle"])
            bed.measure_surface()
            notes["trace"].append(self._packing)
            notes["settle"] = None
            way = max(1e-9, packing - notes["trace"][0])
            self._pause(min(1.0, max(0.0, (self._packing - notes["trace"][0]) / way)))

    def _cut(self, stage: Stage) -> Json:
        """Dig a strip out about x = 0 and let the faces do what they do: without drag first, so that they may fall."""
        assert stage.value is not None
        notes, half = self.notes, 0.5 * stage.value

        def in_strip() -> np.ndarray:
            x = np.mod(self.bed.grains().position[:, 0], self.bed.size[0])
            return np.asarray((x < half) | (x > self.bed.size[0] - half))

        if not notes:
            gone = in_strip()
            notes |= {"removed": int(gone.sum()), "height": self.bed.surface, "settle": {}}
            self.bed = self.bed.without(gone)
            notes["began"] = self.bed.time
        bed, fall = self.bed, self._fall_time
        while (bed.time - notes["began"]) < 5 * fall:
            bed.advance(max(1, round(0.05 * fall / bed.time_step)))
            self._pause(min(1.0, (bed.time - notes["began"]) / (5 * fall)))
        self._settle(ENERGY_RATIO, notes["settle"])
        return {"removed": notes["removed"], "fallen": int(in_strip().sum()), "height": notes["height"]}

    def _tilt(self, stage: Stage) -> Json:
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
                    f"stages: {str(stage)!r} cannot be held: the bed flows at {angle:g} degrees; give {notes['held']:g}"
                ) from None
            notes |= {"held": angle, "settle": None}
            self._pause(min(1.0, angle / stage.value))
        return {"angle": notes["held"]}


def _digest(kept: Json) -> str:
    """The digest of what JSON takes, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


def touching_as(bed: B, material: Material, floor: Facing | None = None) -> B:
    """The same grains where they are, contacts and histories kept, which touch as this material's from now on.

    Args:
        material: of the same density, with or without rolling friction as the bed's own.
        floor: how they touch the floor, where there is one; as one another when None.

    Raises ValueError: a material of which these grains cannot be.
    """
    own = bed.material
    if material.density != own.density or (material.rolling_friction > 0) != (own.rolling_friction > 0):
        raise ValueError(
            f"material = {material.name!r}: density {material.density:g} kg/m3, rolling friction "
            f"{material.rolling_friction:g}, where the grains have {own.density:g} and {own.rolling_friction:g}: give "
            f"the same density, and rolling friction in both or in none"
        )
    bed.wake()
    values = bed.state()
    smallest = 2 * float(values["position"][:, 3].min())
    step = time_step_for(material, diameter=smallest, max_overlap=bed.settings.max_overlap)
    new = bed.successor(values, material=material, time_step=min(bed.time_step, step))
    new.overlap_limit, new.recipe = bed.overlap_limit, bed.recipe
    if new.has_floor:
        new.set_facing(FLOOR, floor or Facing())
    return new
