"""The main experiment: a spike driven into, dropped on and set down on beds of grains, beside the spring-damper.

For each seed a bed is prepared (or taken from the cache), and every run starts from that same bed. A finished run is
kept in the folder and never computed again. A run under way is kept every `checkpoint_interval`, with the bed and its
contacts. So a run that was stopped or killed continues bitwise. Then the spring-damper is fitted, the same runs are
made on it, and the two are compared.
"""

import re
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedGround, Run
from coupling.lammps import LammpsEndedError
from experiments.campaign.files import keep_model, place_campaign
from experiments.grains.advice import resolution_advice
from experiments.grains.bed_progress import show_bed
from experiments.grains.kept_material import MATERIAL_COPY, keep_material
from experiments.grains.lammps import in_lammps
from experiments.grains.softening import Softening
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.stopping import held_back
from experiments.runs.types import Json
from experiments.runs.whole_runs import PictureCosts, draw_plots, draw_report, whole_run
from rigid.checks.unfit import UnfitSettingsError, failed_as

from . import beds
from .beds import fingerprint
from .findings import BedFacts
from .on_law import run_on_law, run_without_bed
from .recorded import campaign_of, sensors_of
from .refusals import check
from .rest import made_units
from .result import conclude, softening_note, staged_note, stiffer_note
from .settings import PenetrateSettings, say
from .similarity import fast_for_gravity, similarity_of
from .units import PenetratePlan, Unit, expected_time, make_run, make_spike, plan_units, share_done, shown_units
from .whole_beds import keep_whole_beds, missing_beds, missing_name

__all__ = ["Frames", "check", "compute", "fingerprint", "resume", "run"]

ROOM = 0.8
"""Share of `max_overlap` that is aimed at where grains were too soft [1]."""
LEAST_STIFFER = 1.25
"""By which grains become stiffer at least, and by how much more each time it happens again on a seed [1]."""
MOST_STIFFER = 10.0
"""How many times as stiff as was chosen grains become at most [1]: past that they jam between tip and floor, and no
modulus is enough (jsc-1a-dense-heights, four grains across the tip, eight deep: 12 times was not)."""


def _carry_out(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> Result:
    if settings.ground == "spring-damper":
        return run_without_bed(settings, folder, progress)
    if not settings.on_grains:
        return run_on_law(settings, folder, progress)
    with folder.lock():
        try:
            result = compute(settings, folder, progress)
        except KeyboardInterrupt:
            if _stopped_with_result(folder):
                draw_plots(folder, progress)
                progress.message(say("stopped_report", report=folder.path / "report.html", folder=folder.path))
            raise
        draw_report(folder, progress, _picture_costs(folder.path, result))
    return result


def _stopped_with_result(folder: RunFolder) -> bool:
    """Whether the folder has the result of the beds that were whole when the run was stopped."""
    return (folder.path / "result.json").exists() and folder.read_result()["status"] == "stopped"


def compute(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> Result:
    """All runs on beds that are not finished yet, and the result in the folder, without a report.

    Where it is stopped, the result is that of the beds that are whole (`keep_whole_beds`), if any is.
    Raises RuntimeError where a bed cannot be prepared or a run cannot go on.
    """
    settings = settings.model_copy(update={"material": keep_material(settings.material, folder.path)})
    softening = beds.choose_softness(settings)
    units = made_units(settings, plan_units(settings))
    with folder.lock():
        keep_model(settings.model, folder.path)
        progress.message(similarity_of(settings)["sentence"])
        for text in fast_for_gravity(settings, beds.find_material(settings).friction):
            progress.message(f"warning: {text}")
        if note := staged_note(settings):
            progress.message(note)
        progress.message(softening_note(settings, softening))
        any_drops = any(unit.kind == "drop" for unit in units)
        dropped = f", a dropped spike moves {settings.mass:.4g} kg" if any_drops else ""
        if settings.loaded:
            progress.message(f"the load is {settings.weight:.4g} N{dropped}")
        if settings.loaded and beds.sinks_away(settings):
            rests = beds.expected_bearing(settings).depth(settings.weight)
            progress.message(say("only_driven", s=settings, rests=rests))
        plan = PenetratePlan(
            settings, units, folder, progress, step=beds.bed_step(settings, softening.young),
            stiffness=beds.expected_stiffness(settings), held=beds.expected_bearing(settings).held,
            stages=beds.stages_of(settings), gravity=beds.first_gravity(settings),
        )  # fmt: skip
        for text in resolution_advice(**beds.resolution_of(settings), seconds=plan.seconds or None):
            progress.message(text)
        work = _Work(settings, units, softening, folder, progress, plan)
        try:
            for seed in settings.seeds:
                work.run_seed(seed)
        except KeyboardInterrupt:
            keep_whole_beds(settings, folder, progress)
            raise
        result = conclude(settings, work.units, softening, folder, progress, missing=work.missing)
        folder.write_result(result)
        if settings.campaign is not None:
            campaign = campaign_of(settings, result, folder, sensors_of(settings))
            target = place_campaign(settings.campaign, campaign, keep_out=folder.path)
            progress.message(f"campaign {target}: `hedgebed diagnose {target}` states what the spring-damper omits")
    return result


def _picture_costs(folder: Path, result: Result) -> PictureCosts:
    """What the report has to draw, by the frames that are there."""
    from vis.pictures.frames import frame_names, read_frames

    frames = {}
    for name in frame_names(folder):
        with suppress(ValueError, OSError):  # the report says what it cannot read
            frames[name] = len(read_frames(folder, name))
    return PictureCosts(frames, result["quantities"]["grain_count"]["value"])


@dataclass(frozen=True)
class _Work:
    """The runs of one folder: all of them, and how each is carried out and kept."""

    settings: PenetrateSettings
    planned: Sequence[Unit]
    softening: Softening
    folder: RunFolder
    progress: Progress
    plan: PenetratePlan

    @property
    def missing(self) -> dict[int, str]:
        """Seed -> why its bed could not be prepared, of those so far."""
        return missing_beds(self.settings, self.folder)

    @property
    def units(self) -> list[Unit]:
        """The runs, without those of beds that could not be prepared."""
        missing = self.missing
        return [unit for unit in self.planned if unit.seed not in missing]

    def run_seed(self, seed: int) -> None:
        """All runs of one seed that are not finished yet, each from the same bed; none where it cannot be prepared.

        Raises RuntimeError where no bed of any seed can be prepared, and where a run cannot go on.
        """
        missing = self.missing
        if seed in missing:
            return
        todo = [unit for unit in self.planned if unit.seed == seed and not self.folder.is_done(unit.id)]
        if not todo and self.folder.is_done(f"bed-{seed}"):
            return
        try:
            bed = self._prepared(seed)
        except RuntimeError as error:
            missing[seed] = str(error)
            if len(missing) == len(self.settings.seeds):  # the last one is tried again when the run is resumed
                raise failed_as(error, "; ".join(missing.values())) from error
            self.folder.mark_done(missing_name(seed), str(error))
            self.progress.message(f"warning: {say('bed_missing', why=error)}")
            return
        self.plan.bed_is_there()
        softening = replace(self.softening, young=self._young(seed, prepared=True))
        facts = BedFacts.of(bed, seed, softening, self.settings.graded)
        self.folder.mark_done(f"bed-{seed}", asdict(facts))
        self.progress.message(say("bed_made", facts=facts))
        if (young := self._young(seed)) != softening.young:
            bed = beds.stiffened(bed, young, self.settings)
        ground = self._ground(bed)
        start = ground.state()
        for unit in todo:
            ground.restore(start)
            ground.bed.max_overlap = 0.0
            ground.bed.mark_origin()
            while not self.run_unit(unit, ground):
                ground = self._ground(beds.stiffened(self._prepared(seed), self._young(seed), self.settings))
                start = ground.state()

    def _ground(self, bed: Any) -> BedGround:
        """The spike over a bed, whose overlaps end a run past `beds.overlap_bound`."""
        bed.overlap_limit = beds.overlap_bound(self.settings)
        if self.settings.ground == "lammps":
            return in_lammps(bed, make_spike(self.settings), self.settings, self.progress)
        return BedGround(bed, make_spike(self.settings))

    def _prepared(self, seed: int) -> Any:
        """The prepared bed of a seed, with stiffer grains where the first ones overlapped too far in the preparation.

        Raises RuntimeError where it cannot be prepared.
        """
        while True:
            young = self._young(seed, prepared=True)
            try:
                return beds.prepare_bed(self.settings, seed, young, self.progress)
            except ValueError as error:  # found while it was prepared, as a packing that cannot be reached
                raise UnfitSettingsError(f"the bed of seed {seed}: {error}") from error
            except RuntimeError as error:
                if not self._made_stiffer(error, seed):
                    failed = f"the bed of seed {seed} could not be prepared: {error}; {_remedy(error)}"
                    raise failed_as(error, failed) from error

    def _notes(self, seed: int) -> list[Json]:
        """Where grains of a seed were made stiffer, and by how much, so far."""
        return list(self.folder.noted(f"stiffer-{seed}", []))

    def _young(self, seed: int, *, prepared: bool = False) -> float:
        """The present modulus of the grains of a seed [Pa], or the one its bed is `prepared` with."""
        made = [note["young"] for note in self._notes(seed) if not (prepared and note["unit"])]
        return float(made[-1]) if made else self.softening.young

    def _made_stiffer(self, error: RuntimeError, seed: int, unit: Unit | None = None) -> bool:
        """Whether it is done again with stiffer grains, after an overlap past its bound: that is kept, and told.

        Not where it was another failure, where modulus or step are set, or where the grains have no more.
        """
        found, settings = re.search(r"an overlap of ([0-9.e+-]+) % of a diameter went past", str(error)), self.settings
        fixed = settings.bed is None and (settings.young is not None or settings.time_step is not None)
        if found is None or fixed:  # a bed that is given has its own of both, chosen when it was made
            return False
        overlap, young = float(found[1]) / 100, self._young(seed, prepared=unit is None)
        now = replace(self.softening, young=young)
        # It was stopped as it passed the bound: how far it would have gone shows only in that it happens again.
        more = LEAST_STIFFER ** len(self._notes(seed))
        stiffer = more * max(now.stiffer(overlap, ROOM * settings.max_overlap), LEAST_STIFFER * young)
        if not stiffer <= min(self.softening.real, MOST_STIFFER * self.softening.young):
            return False
        note = {"seed": seed, "unit": unit.id if unit else "", "overlap": overlap, "before": young, "young": stiffer}
        if unit is not None:
            self.folder.drop_checkpoint(unit.id)
        self.folder.mark_done(f"stiffer-{seed}", [*self._notes(seed), note])
        self.progress.message(stiffer_note(note))
        return True

    def run_unit(self, unit: Unit, ground: BedGround) -> bool:
        """One run, from its checkpoint where there is one; whether it came to its end.

        If not, it is to be done again with the modulus that `_made_stiffer` has chosen.
        """
        settings, folder, bed = self.settings, self.folder, ground.bed
        stepper = make_run(settings, unit, ground)
        expected, sure = self.plan.expected_time(unit), False
        kept = folder.load_checkpoint(unit.id)
        if kept is not None:
            stepper.restore(kept)
            self.progress.message(f"{unit.title}: goes on at {stepper.time:.4g} s")
        elif settings.sleep:
            bed.let_sleep()
        frames = None
        if unit.id in shown_units(self.units):
            lasts = expected_time(settings, unit, beds.expected_stiffness(settings))
            frames = Frames(settings, unit, stepper, folder, expected=lasts, resumed=kept is not None)
        self.progress.stage(unit.title, total=1.0)
        saved = time.monotonic()

        def on_step(stepper: Run) -> None:
            nonlocal saved, expected, sure
            if unit.kind == "drop" and stepper.at_bottom:  # from its first stop on the end is known
                expected, sure = stepper.time + settings.after_stop, True
            show_bed(self.progress, bed)
            self.progress.update(share_done(stepper, expected, sure=sure))
            stop = asked_to_stop()
            if not stepper.done and (stop or time.monotonic() - saved >= settings.checkpoint_interval):
                folder.save_checkpoint(unit.id, stepper.state())
                saved = time.monotonic()
            if stop and not stepper.done:
                raise KeyboardInterrupt

        try:
            with held_back() as asked_to_stop:
                on_frame, interval = (frames.write, frames.interval) if frames else (None, None)
                series = stepper.run(on_step=on_step, on_frame=on_frame, frame_interval=interval)
        except LammpsEndedError:  # there is no state to be saved
            raise
        except RuntimeError as error:  # the bed's: a NaN, a grain lost, an overlap past its bound
            if self._made_stiffer(error, unit.seed, unit):
                return False
            folder.save_checkpoint(f"{unit.id}.failed", stepper.state())
            raise failed_as(error, say("failed", unit=unit, error=error, remedy=_remedy(error))) from error
        self.plan.is_over(unit, stepper.time)
        folder.write_series(unit.id, series.columns())
        all_of_them = bed.grain_count * stepper.count * settings.substeps
        kept_of_bed = {
            "max_overlap": float(bed.max_overlap), "code": beds.fingerprint(),
            "computed_share": ground.grain_steps / max(1, all_of_them),
        }  # fmt: skip
        folder.mark_done(unit.id, series.facts() | kept_of_bed)
        folder.drop_checkpoint(unit.id)
        return True


def _remedy(error: RuntimeError) -> str:
    """What to change where the bed has failed."""
    if "overlap" in str(error):
        return "change young (stiffer grains), the speeds or max_overlap; where grains jam, finer ones or a larger bed"
    if "rest" in str(error) or "rain" in str(error):
        return "take another seed (seeds) or another bed_size"
    return "change time_step (shorter), young or the speeds"


class Frames:
    """Writes the frames of one run."""

    def __init__(
        self,
        settings: PenetrateSettings,
        unit: Unit,
        stepper: Run,
        folder: RunFolder,
        *,
        expected: float,
        resumed: bool,
    ) -> None:
        """`expected`: how long the run may well last [s]; `resumed`: it goes on from a checkpoint."""
        from vis.pictures.frames import GRAIN_FIELDS, FrameWriter
        from vis.pictures.meshes import spike_mesh

        wanted = expected / max(1, settings.frame_count)
        self.interval = max(wanted, stepper.macro_step) if settings.frame_count else None
        self.limit = 2 * max(1, settings.frame_count)
        self.fields = tuple(GRAIN_FIELDS)
        # The frame of the very step of the checkpoint was written after it, if at all: it comes again.
        until = stepper.time - 0.5 * stepper.macro_step if resumed else None
        self.writer = FrameWriter(folder.path, name=unit.id, resume=resumed, keep_until=until)
        spike = stepper.spike
        self.points, self.triangles = spike_mesh(
            spike.tip, diameter=spike.diameter, length=spike.length, shaft_diameter=spike.shaft,
            cone_angle=spike.cone_angle,
        )  # fmt: skip

    def write(self, stepper: Run) -> None:
        """One frame of what the stepper is doing now; the deepest point and the last state are always kept.

        Of a run longer than expected every second frame is kept past the limit, every fourth past twice that, ...
        """
        late = max(0, stepper.frames_taken - 1)
        if late % (1 << (late // self.limit).bit_length()) and not (stepper.done or stepper.at_bottom):
            return
        ground = stepper.ground
        assert isinstance(ground, BedGround)
        grains = ground.bed.grains().as_dict()
        self.writer.write(
            stepper.time,
            {name: grains[name] for name in ("position", *self.fields)},
            {"spike": (self.points + np.array(stepper.position), self.triangles)},
            values={"depth": stepper.depth, "velocity": stepper.velocity, "force": stepper.last_force},
        )


run, resume = whole_run(
    "penetrate", PenetrateSettings, _carry_out, check=check, material_copy=MATERIAL_COPY,
    code=lambda: beds.fingerprint(), as_given=False,
)  # fmt: skip
