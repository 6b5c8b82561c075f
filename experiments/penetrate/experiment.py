"""The main experiment: a spike driven into, dropped on and set down on beds of grains, beside the spring-damper.

For each seed a bed is prepared (or taken from the cache), and every run starts from that same bed. A finished run is
kept in the folder and never computed again; a run under way is kept every `checkpoint_interval`, the bed with its
contacts included, so that a run that was stopped or killed continues bitwise. Then the spring-damper is fitted,
the same runs are made on it, and the two are compared.
"""

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from coupling import BedGround, Run
from experiments.campaign.files import keep_model, place_campaign
from experiments.grains.bed_progress import show_bed
from experiments.grains.kept_material import MATERIAL_COPY, keep_material
from experiments.grains.softening import Softening
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.stopping import held_back
from experiments.runs.whole_runs import PictureCosts, draw_report, whole_run

from . import beds
from .amended import run_without_bed
from .beds import fingerprint
from .findings import BedFacts
from .recorded import campaign_of, sensors_of
from .refusals import check
from .result import conclude, softening_note
from .settings import PenetrateSettings, say
from .units import PenetratePlan, Unit, expected_time, make_run, make_spike, plan_units, share_done, shown_units

__all__ = ["Frames", "check", "fingerprint", "resume", "run"]


def _carry_out(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> Result:
    if settings.ground == "spring-damper":
        return run_without_bed(settings, folder, progress)
    settings = settings.model_copy(update={"material": keep_material(settings.material, folder.path)})
    softening = beds.choose_softness(settings)
    units = plan_units(settings)
    with folder.lock():
        keep_model(settings.model, folder.path)
        progress.message(softening_note(settings, softening))
        dropped = f", a dropped spike moves {settings.mass:.4g} kg" if settings.drop_speeds else ""
        progress.message(f"the load is {settings.weight:.4g} N{dropped}")
        step, stiffness = beds.bed_step(settings, softening.young), beds.expected_stiffness(settings)
        plan = PenetratePlan(settings, units, folder, progress, step=step, stiffness=stiffness)
        work = _Work(settings, units, softening, folder, progress, plan)
        for seed in settings.seeds:
            work.run_seed(seed)
        result = conclude(settings, units, softening, folder, progress)
        folder.write_result(result)
        if settings.campaign is not None:
            campaign = campaign_of(settings, result, folder, sensors_of(settings))
            target = place_campaign(settings.campaign, campaign, keep_out=folder.path)
            progress.message(f"campaign {target}: `hedgebed diagnose {target}` says what the spring-damper lacks")
        draw_report(folder, progress, _picture_costs(folder.path, result))
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
    units: Sequence[Unit]
    softening: Softening
    folder: RunFolder
    progress: Progress
    plan: PenetratePlan

    def run_seed(self, seed: int) -> None:
        """All runs of one seed that are not finished yet, each from the same bed."""
        todo = [unit for unit in self.units if unit.seed == seed and not self.folder.is_done(unit.id)]
        if not todo and self.folder.is_done(f"bed-{seed}"):
            return
        try:
            bed = beds.prepare_bed(self.settings, seed, self.softening.young, self.progress)
        except ValueError as error:  # found while it was prepared, as a packing that cannot be reached
            raise RuntimeError(f"the bed of seed {seed}: {error}") from error
        except RuntimeError as error:
            raise RuntimeError(f"the bed of seed {seed} could not be prepared: {error}; {_remedy(error)}") from error
        self.plan.bed_is_there()
        facts = BedFacts.of(bed, seed, self.softening, self.settings.graded)
        ground = BedGround(bed, make_spike(self.settings))
        start = ground.state()
        self.folder.mark_done(f"bed-{seed}", asdict(facts))
        self.progress.message(say("bed_made", facts=facts))
        for unit in todo:
            ground.restore(start)
            bed.max_overlap = 0.0
            bed.mark_origin()
            self.run_unit(unit, ground)

    def run_unit(self, unit: Unit, ground: BedGround) -> None:
        """One run to its end, from its checkpoint where there is one."""
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
        except RuntimeError as error:  # the bed's: a NaN, a grain lost, an overlap past its bound
            folder.save_checkpoint(f"{unit.id}.failed", stepper.state())
            raise RuntimeError(say("failed", unit=unit, error=error, remedy=_remedy(error))) from error
        self.plan.is_over(unit, stepper.time)
        folder.write_series(unit.id, series.columns())
        all_of_them = bed.grain_count * stepper.count * settings.substeps
        kept_of_bed = {
            "max_overlap": float(bed.max_overlap), "code": beds.fingerprint(),
            "computed_share": ground.grain_steps / max(1, all_of_them),
        }  # fmt: skip
        folder.mark_done(unit.id, series.facts() | kept_of_bed)
        folder.drop_checkpoint(unit.id)


def _remedy(error: RuntimeError) -> str:
    """What to change where the bed has failed."""
    if "overlap" in str(error):
        return "change young (stiffer grains), the speeds or max_overlap"
    if "rest" in str(error) or "rain" in str(error):
        return "change gravity, bed_size or the seed"
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
