"""The main experiment: a spike driven into, dropped on and set down on beds of grains, beside the spring-damper.

For each seed a bed is prepared (or taken from the cache), and every run starts from that same bed. A finished run is
kept in the folder and never computed again; a run under way is kept every `checkpoint_interval`, the bed with its
contacts included, so that a run that was stopped or killed goes on to the same bits. Then the spring-damper is fitted,
the same runs are made on it, and the two are compared.
"""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedGround, Run
from dem.materials import caveat
from hedgebed import __version__

from .amended import read_law
from .amended_runs import keep_model, kept_law, run_beside, run_without_bed
from .bed_progress import BedProgress
from .findings import Findings, bed_entry, bed_quantities
from .kept_material import MATERIAL_COPY, keep_material
from .kept_runs import read_run, write_run
from .memory import memory_there
from .penetrate_plan import RAIN, PenetratePlan
from .progress import Progress
from .reference import compare_with, read_reference
from .remarks import overlap_warning, softening_note
from .reporting import PictureCosts, write_report
from .run_campaign import SpikeSensors, campaign_of, check_target, place_campaign
from .runfolder import RunFolder
from .settings import PenetrateSettings, expected_grain_count
from .softening import Softening, bearing_gradient, check_young, drop_depth, soften_material
from .stopping import held_back
from .units import Unit, deepest, expected_time, make_run, make_spike, plan_units, share_done, shown_units
from .where import check_where

__all__ = ["check", "choose_softness", "fingerprint", "resume", "run"]

BYTES_PER_GRAIN = 4000
"""Memory of one grain with its lists and contact history, float64, measured generously [bytes]."""
MOST_GRAINS = 2**26
"""More are refused."""
MOST_STEPS = 1e9
"""Of the grains, in all runs; more are refused."""
SHIPPED_RESULT = Path(__file__).parent.parent / "docs" / "results" / "penetrate" / "result.json"
"""The result of the case that ships, in a checkout."""


def run(settings: PenetrateSettings, folder: str | Path, *, progress: Progress | None = None) -> dict[str, Any]:
    """Carry the experiment out into `folder` and return the result, as result.json has it.

    Takes up what the folder already holds of the same settings. Raises ValueError for settings that will not do,
    before any work; RuntimeError (the bed's) where a run cannot go on, its state saved in checkpoint/.
    """
    check(settings)
    kept = RunFolder.ensure(Path(folder), "penetrate", settings, code=fingerprint())
    return _carry_out(settings, kept, progress or Progress())


def resume(folder: str | Path, *, progress: Progress | None = None) -> dict[str, Any]:
    """Finish the run in `folder`. Raises ValueError where there is none; otherwise as `run`."""
    kept = RunFolder.open(Path(folder))
    copy = kept.path / MATERIAL_COPY
    given = kept.settings | ({"material": str(copy)} if copy.exists() else {})
    return _carry_out(PenetrateSettings(**given), kept, progress or Progress())


def check(settings: PenetrateSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for what this machine or the material cannot serve."""
    if settings.model is not None:
        read_law(settings.model, settings)
    if settings.campaign is not None:
        check_target(settings.campaign)
    if settings.ground == "spring-damper":
        return
    find_material(settings)
    for seeds, speeds in ((settings.seeds[:1], settings.speeds), (settings.seeds[1:], settings.other_speeds)):
        if seeds and not speeds:
            raise ValueError("other_speeds is empty: at least one speed would do, so that every seed has a fit")
    _check_grain_count(settings)
    check_where(arch=settings.arch, threads=settings.threads, precision=settings.precision)
    _check_young(settings)
    _check_reach(settings)
    step = bed_step(settings, choose_softness(settings).young)
    found = settings.crossing(step, find_material(settings).young)
    if found:
        raise ValueError(found)
    _check_step_count(settings, step)
    if settings.reference not in (None, "shipped"):
        read_reference(str(settings.reference))


def _check_grain_count(settings: PenetrateSettings) -> None:
    count = expected_grain_count(settings.bed_size, settings.grain, settings.spread)
    need, there = count * BYTES_PER_GRAIN, memory_there().free
    if need > 0.8 * there:
        least = settings.grain * (need / (0.8 * there)) ** (1 / 3)
        raise ValueError(
            f"grain = {settings.grain:g} m makes about {count:.3g} grains, which take {need / 1e9:.3g} GB where "
            f"{there / 1e9:.3g} GB are free: grains of {least:.2g} m or a smaller bed_size would do"
        )
    if count > MOST_GRAINS:
        raise ValueError(
            f"grain = {settings.grain:g} m makes about {count:.3g} grains: at most {MOST_GRAINS} can be counted, so "
            f"grains of {settings.grain * (count / MOST_GRAINS) ** (1 / 3):.2g} m or a smaller bed_size would do"
        )


def _check_young(settings: PenetrateSettings) -> None:
    if settings.young is None:
        return
    most = find_material(settings).young
    chosen = choose_softness(settings.model_copy(update={"young": None})).young
    if settings.young > most:
        raise ValueError(
            f"young = {settings.young:g} Pa is more than {settings.material} itself has: at most {most:g} Pa would do"
        )
    check_young(settings.young, chosen=chosen, max_overlap=settings.max_overlap)


def _check_reach(settings: PenetrateSettings) -> None:
    """Refuse what would end near the floor."""
    stiffness, floor = _expected_stiffness(settings), deepest(settings)
    deeper = f"{floor:.3g} m, one tip's diameter above the floor"
    rests = settings.weight / stiffness
    if rests > floor:
        key = "load" if settings.load is not None else "platform_mass"
        value = f"{settings.load:g} N" if settings.load is not None else f"{settings.platform_mass:g} kg"
        on = "" if settings.load is not None else f", {settings.weight:.3g} N on a spike,"
        most = settings.weight * floor / rests
        raise ValueError(
            f"{key} = {value}{on} puts the spike about {rests:.2g} m deep, deeper "
            f"than {deeper}: a load of at most {most:.2g} N, a larger tip_diameter or a deeper bed_size would do"
        )
    for key in ("drop_speeds", "other_drop_speeds"):
        for speed in getattr(settings, key):
            depth = drop_depth(speed, settings.mass, settings.weight, stiffness)
            if depth > floor:
                room = stiffness * floor**2 - 2 * settings.weight * floor
                slower = f"at most {math.sqrt(room / settings.mass):.2g} m/s" if room > 0 else "a smaller load"
                raise ValueError(
                    f"{key} = {speed:g} m/s with mass = {settings.mass:g} kg would go about {depth:.2g} m deep, deeper "
                    f"than {deeper}: {slower}, a smaller mass or a deeper bed_size would do"
                )


def _check_step_count(settings: PenetrateSettings, step: float) -> None:
    stiffness = _expected_stiffness(settings)
    times = {unit: expected_time(settings, unit, stiffness) for unit in plan_units(settings)}
    count = sum(times.values()) / step
    if count <= MOST_STEPS:
        return
    unit = max(times, key=lambda unit: times[unit])
    if unit.kind == "driven":
        parts = {
            f"speeds = {unit.speed:g} m/s": settings.depth / unit.speed,
            f"hold = {settings.hold:g} s": settings.hold,
            f"retreat_speed = {settings.retreat_speed:g} m/s": settings.depth / settings.retreat_speed,
        }
    elif unit.kind == "drop":
        parts = {f"after_stop = {settings.after_stop:g} s": settings.after_stop, f"mass = {settings.mass:g} kg": 0.0}
    else:
        sinking = times[unit] - settings.rest_time
        parts = {
            f"lowering_speed = {unit.speed:g} m/s": sinking,
            f"rest_time = {settings.rest_time:g} s": settings.rest_time,
        }
    key = max(parts, key=lambda part: parts[part])
    raise ValueError(
        f"{key} asks for {times[unit] / step:.2g} steps of {step:.2g} s, all runs for {count:.2g}: at most "
        f"{MOST_STEPS:.0g} in all would do, by {key.split()[0]} or by larger grains (grain) or a longer time_step"
    )


def choose_softness(settings: PenetrateSettings) -> Softening:
    """The modulus of the grains for these runs (see `experiments.softening`), or the one that is set."""
    material = find_material(settings)
    bulk = 0.6 * material.density
    area = math.pi * settings.tip_diameter**2 / 4
    stiffness = bearing_gradient(bulk, settings.gravity, material.friction) * area
    fastest, speed = settings.fastest
    drops = [
        drop_depth(speed, settings.mass, settings.weight, stiffness)
        for speed in (*settings.drop_speeds, *settings.other_drop_speeds)
    ]
    return soften_material(
        material,
        young=settings.young,
        max_overlap=settings.max_overlap,
        grain=settings.grain,
        spread=settings.spread,
        gravity=settings.gravity,
        bed_height=settings.bed_size[2],
        depth=min(deepest(settings), max(settings.depth, *drops) if drops else settings.depth),
        speed=speed,
        fastest=fastest,
        fall=RAIN * settings.bed_size[2],
        pressure=settings.weight / area,
    )


# What the bed's room offers; tests put a stand-in here ---------------------------------------------------------------


def find_material(settings: PenetrateSettings) -> Any:
    """The grain material, for grains of this size. Raises ValueError naming those there are."""
    from dem.materials import material

    return material(settings.material, grain=settings.grain)


def fingerprint() -> str:
    """A digest of the code that computes beds: other code may give other bits."""
    from dem.prepare import fingerprint as of_dem

    return of_dem()


def bed_step(settings: PenetrateSettings, young: float) -> float:
    """The step that the bed will take [s]. Raises ValueError for one that is set and too long."""
    from dem.timestep import time_step_for

    return time_step_for(
        find_material(settings).softened(young),
        diameter=settings.grain * (1 - settings.spread),
        max_overlap=settings.max_overlap,
        wanted=settings.time_step,
    )


def prepare_bed(settings: PenetrateSettings, seed: int, young: float, progress: Progress) -> Any:
    """The bed of one seed: the one that is given, or prepared, or from the cache."""
    from dem import Bed

    if settings.bed is not None:
        from dem.bedfile import find_bed

        return Bed.load(find_bed(settings.bed), arch=settings.arch, threads=settings.threads)
    with held_back() as asked_to_stop:
        return Bed.prepare(
            find_material(settings),
            size=settings.bed_size,
            grain=settings.grain,
            spread=settings.spread,
            packing=settings.packing,
            gravity=settings.gravity,
            seed=seed,
            young=young,
            max_overlap=settings.max_overlap,
            time_step=settings.time_step,
            precision=settings.precision,
            arch=settings.arch,
            threads=settings.threads,
            cache=settings.cache,
            progress=BedProgress(progress, f"bed of seed {seed}", asked_to_stop, tapped=settings.packing is not None),
        )


# Carrying it out ------------------------------------------------------------------------------------------------------


def _carry_out(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> dict[str, Any]:
    if settings.ground == "spring-damper":
        return run_without_bed(settings, folder, progress)
    settings = settings.model_copy(update={"material": keep_material(settings.material, folder.path)})
    softening = choose_softness(settings)
    units = plan_units(settings)
    with folder.lock():
        keep_model(settings, folder.path)
        progress.message(softening_note(settings, softening))
        dropped = f", a dropped spike moves {settings.mass:.4g} kg" if settings.drop_speeds else ""
        progress.message(f"the load is {settings.weight:.4g} N{dropped}")
        plan = PenetratePlan(
            settings,
            units,
            folder,
            progress,
            step=bed_step(settings, softening.young),
            stiffness=_expected_stiffness(settings),
        )
        for seed in settings.seeds:
            _run_seed(settings, seed, [unit for unit in units if unit.seed == seed], softening, folder, progress, plan)
        result = _conclude(settings, units, softening, folder, progress)
        folder.write_result(result)
        _write_campaign(settings, result, folder, progress)
        progress.stage("report", total=1.0)
        write_report(folder.path, progress, _picture_costs(folder.path, result))
    return result


def _write_campaign(settings: PenetrateSettings, result: dict[str, Any], folder: RunFolder, progress: Progress) -> None:
    """The bed's runs as a campaign, where one is asked for."""
    if settings.campaign is None:
        return
    sensors = SpikeSensors(
        rate=settings.campaign_rate,
        depth_std=settings.campaign_depth_std,
        force_std=settings.campaign_force_std,
        accel_std=settings.campaign_accel_std,
        seed=settings.campaign_seed,
    )
    target = place_campaign(settings.campaign, campaign_of(settings, result, folder, sensors), keep_out=folder.path)
    progress.message(f"campaign {target}: `hedgebed diagnose {target}` says what the spring-damper lacks")


def _picture_costs(folder: Path, result: dict[str, Any]) -> PictureCosts:
    """What the report has to draw, by the frames that are there."""
    from vis.frames import frame_names, read_frames

    frames = {}
    for name in frame_names(folder):
        with suppress(ValueError, OSError):  # the report says what it cannot read
            frames[name] = len(read_frames(folder, name))
    return PictureCosts(frames, result["quantities"]["grain_count"]["value"])


def _run_seed(
    settings: PenetrateSettings,
    seed: int,
    units: list[Unit],
    softening: Softening,
    folder: RunFolder,
    progress: Progress,
    plan: PenetratePlan,
) -> None:
    """All runs of one seed that are not finished yet, each from the same bed."""
    todo = [unit for unit in units if not folder.is_done(unit.id)]
    if not todo and folder.is_done(f"bed-{seed}"):
        return
    try:
        bed = prepare_bed(settings, seed, softening.young, progress)
    except ValueError as error:  # found while it was prepared, as a packing that cannot be reached
        raise RuntimeError(f"the bed of seed {seed}: {error}") from error
    except RuntimeError as error:
        raise RuntimeError(f"the bed of seed {seed} could not be prepared: {error}; {_remedy(error)}") from error
    plan.bed_is_there()
    facts = _bed_facts(bed, seed, softening)
    ground = BedGround(bed, make_spike(settings))
    start = ground.state()
    folder.mark_done(f"bed-{seed}", facts)
    progress.message(
        f"seed {seed}: {facts['grain_count']} grains, packing {facts['packing_fraction']:.4f}, "
        f"step {facts['time_step']:.3g} s"
    )
    for unit in todo:
        ground.restore(start)
        bed.max_overlap = 0.0
        bed.mark_origin()
        _run_unit(settings, unit, ground, folder, progress, plan)


def _run_unit(
    settings: PenetrateSettings,
    unit: Unit,
    ground: BedGround,
    folder: RunFolder,
    progress: Progress,
    plan: PenetratePlan,
) -> None:
    """One run to its end, from its checkpoint where there is one."""
    bed = ground.bed
    stepper = make_run(settings, unit, ground)
    expected, sure = plan.expected_time(unit), False
    kept = folder.load_checkpoint(unit.id)
    if kept is not None:
        stepper.restore(kept)
        progress.message(f"{unit.title}: goes on at {stepper.time:.4g} s")
    shown = unit.id in shown_units(plan_units(settings))
    frames = _Frames(settings, unit, stepper, folder, resumed=kept is not None) if shown else None
    progress.stage(unit.title, total=1.0)
    saved = time.monotonic()

    def keep(name: str) -> None:
        folder.save_checkpoint(name, stepper.state())

    def on_step(stepper: Run) -> None:
        nonlocal saved, expected, sure
        if unit.kind == "drop" and stepper.at_bottom:  # from its first stop on the end is known
            expected, sure = stepper.time + settings.after_stop, True
        progress.update(share_done(stepper, expected, sure=sure))
        stop = asked_to_stop()
        if not stepper.done and (stop or time.monotonic() - saved >= settings.checkpoint_interval):
            keep(unit.id)
            saved = time.monotonic()
        if stop and not stepper.done:
            raise KeyboardInterrupt

    try:
        with held_back() as asked_to_stop:
            series = stepper.run(
                on_step=on_step,
                on_frame=frames.write if frames else None,
                frame_interval=frames.interval if frames else None,
            )
    except RuntimeError as error:  # the bed's: a NaN, a grain lost, an overlap past its bound
        keep(f"{unit.id}.failed")
        raise RuntimeError(
            f"{unit.title}: {error}; {_remedy(error)}; the state is in checkpoint/{unit.id}.failed.npz"
        ) from error
    plan.is_over(unit, stepper.time)
    write_run(folder, unit.id, series)
    folder.mark_done(
        unit.id,
        {
            "kind": series.kind,
            "macro_step": series.macro_step,
            "ended": series.ended,
            "settings": series.settings,
            "max_overlap": float(bed.max_overlap),
            "code": fingerprint(),
        },
    )
    folder.drop_checkpoint(unit.id)


def _remedy(error: RuntimeError) -> str:
    """What to change where the bed has failed."""
    if "overlap" in str(error):
        return "change young (stiffer grains), the speeds or max_overlap"
    if "rest" in str(error) or "rain" in str(error):
        return "change gravity, bed_size or the seed"
    return "change time_step (shorter), young or the speeds"


class _Frames:
    """Writes the frames of one run."""

    def __init__(
        self, settings: PenetrateSettings, unit: Unit, stepper: Run, folder: RunFolder, *, resumed: bool
    ) -> None:
        from vis.frames import GRAIN_FIELDS, FrameWriter
        from vis.meshes import spike_mesh

        wanted = expected_time(settings, unit, _expected_stiffness(settings)) / max(1, settings.frame_count)
        self.interval = max(wanted, stepper.macro_step) if settings.frame_count else None
        self.limit = 2 * max(1, settings.frame_count)
        self.fields = tuple(GRAIN_FIELDS)
        if resumed:
            # The frame of the very step of the checkpoint was written after it, if at all: it comes again.
            half = 0.5 * stepper.macro_step
            self.writer = FrameWriter(folder.path, name=unit.id, resume=True, keep_until=stepper.time - half)
        else:
            self.writer = FrameWriter(folder.path, name=unit.id)
        spike = stepper.spike
        self.points, self.triangles = spike_mesh(
            spike.tip,
            diameter=spike.diameter,
            length=spike.length,
            shaft_diameter=spike.shaft,
            cone_angle=spike.cone_angle,
        )

    def write(self, stepper: Run) -> None:
        """One frame of what the stepper is doing now; of a run far longer than expected, ever fewer.

        Past the limit every second is kept, past twice that every fourth and so on; the deepest point and the last
        state always are.
        """
        late = max(0, stepper.frames_taken - 1)
        if late % (1 << (late // self.limit).bit_length()) and not (stepper.done or stepper.at_bottom):
            return
        ground = stepper.ground
        assert isinstance(ground, BedGround)
        grains = ground.bed.grains()
        self.writer.write(
            stepper.time,
            {name: grains[name] for name in ("position", *self.fields)},
            {"spike": (self.points + np.array(stepper.position), self.triangles)},
            values={"depth": stepper.depth, "velocity": stepper.velocity, "force": stepper.last_force},
        )


def _conclude(
    settings: PenetrateSettings, units: list[Unit], softening: Softening, folder: RunFolder, progress: Progress
) -> dict[str, Any]:
    """Fit, make the same runs on the law, compare; write the law's series; return the result."""
    progress.stage("spring-damper", total=1.0)
    notes = {unit.id: folder.done_data(unit.id) for unit in units}
    beds = {unit.id: read_run(folder, unit.id, notes[unit.id]) for unit in units}
    facts = [folder.done_data(f"bed-{seed}") for seed in settings.seeds]
    findings = Findings(settings, units, beds, facts[0]["time_step"])
    for name, series in findings.models.items():
        write_run(folder, f"{name}.model", series)
    overlaps = [note["max_overlap"] for note in notes.values() if note.get("max_overlap") is not None]
    overlap = max(overlaps, default=None)
    quantities = findings.quantities() | bed_quantities(facts, overlap)
    warnings = findings.warnings()
    if near := overlap_warning(overlap, settings, softening):
        warnings.append(near)
    if doubt := caveat(find_material(settings)):
        warnings.append(doubt)
    if len(settings.seeds) < 3:
        warnings.append("fewer than three seeds: the spread between beds is not known well")
    codes = ({note.get("code") for note in notes.values()} | {folder.code}) - {None, ""}
    if len(codes) > 1:
        warnings.append(
            "parts of this run were computed by different versions of the code: it may not repeat to the bit"
        )
    departures = findings.departures()
    entries = findings.run_entries(notes)
    law = kept_law(settings, folder.path)
    if law is not None:
        beside = run_beside(law, units, beds, findings.models, folder)
        quantities |= beside.quantities
        warnings += law.warnings()
        departures["sentences"] = [*departures["sentences"], *beside.sentences]
        entries = beside.entries(entries)
    result: dict[str, Any] = {
        "format": "hedgebed-result/1",
        "experiment": "penetrate",
        "version": __version__,
        "code": codes.pop() if len(codes) == 1 else fingerprint(),
        "title": f"A {1e3 * settings.tip_diameter:g} mm spike in {find_material(settings).name}",
        "status": "done",
        "quantities": quantities,
        "runs": entries,
        "fits": findings.fit_entries(),
        "departures": departures,
        "bed": bed_entry(facts, settings, softening) | {"material": find_material(settings).name},
        "spike": asdict(make_spike(settings)) | {"load": settings.weight},
        "warnings": warnings,
    }
    if law is not None:
        result["model"] = {"file": settings.model, "effects": list(law.effects)}
    reference = SHIPPED_RESULT if settings.reference == "shipped" else settings.reference
    if reference == SHIPPED_RESULT and not SHIPPED_RESULT.exists():
        warnings.append("the result of the shipped case is not here (docs/results of a checkout): nothing compared")
    elif reference is not None:
        try:
            entry, said = compare_with(read_reference(reference), result)
        except ValueError as error:  # it was there before the first run
            warnings.append(f"{error}; nothing compared")
        else:
            result["reference"] = {"file": settings.reference, **entry}
            departures["sentences"] = [*departures["sentences"], *(f"Against the reference, {text}" for text in said)]
            if not entry["moved"]:
                warnings.append(f"reference = {settings.reference!r} has no run of a kind and speed made here too")
    return result


def _bed_facts(bed: Any, seed: int, softening: Softening) -> dict[str, Any]:
    """What the result says of one bed, taken before the first run."""
    return {
        "seed": seed,
        "grain_count": int(bed.grain_count),
        "packing_fraction": float(bed.packing_fraction),
        "coordination_number": float(bed.coordination_number),
        "surface": float(bed.surface),
        "young": float(softening.young),
        "time_step": float(bed.time_step),
    }


def _expected_stiffness(settings: PenetrateSettings) -> float:
    """A guess at the bed's stiffness under the tip [N/m], for progress and frames."""
    material = find_material(settings)
    area = math.pi * settings.tip_diameter**2 / 4
    return bearing_gradient(0.6 * material.density, settings.gravity, material.friction) * area
