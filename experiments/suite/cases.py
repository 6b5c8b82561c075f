"""The platform's experiments on grains: which cases there are, what each costs, which have a result; doing the rest.

A case is a TOML file in experiments/cases/grains, named after the experiment that it belongs to. Its result is done
once docs/results/<case>/ holds result.json; what is under way is a run folder below `work`, which is gone on with. One
that fails leaves the others alone.
"""

import functools
import math
import re
import shutil
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from experiments.pool.tasks import name_of, task_of
from experiments.pool.together import Planned
from experiments.runs.folder import read_json, write_json
from experiments.runs.reading import read_case, settings_from
from experiments.runs.registry import CASES, find_experiment
from experiments.tumble.settings import TumbleSettings
from rigid.digests import digest_of
from rigid.result import read_result

__all__ = ["EXPERIMENTS", "KEPT", "LONGEST", "Case", "Cost", "cases", "cost_of_tumble", "estimate", "keep", "planned"]

RATES = ((2.8e3, 3.8e6), (2e4, 9.52e6), (1e5, 7.09e6))
"""(grains computed, grain-steps a second with rolling friction): `hedgebed bench bed` of 2026-11-21 on a quiet Xeon
with 2 cores (in the history of docs/performance.md, db093b66). The first pair is of `grains3-row-seed1`, 2,800 awake of
84,772 grains, where one core is as fast as two. The loops of 2026-11-26 make 26.2 and 22.8 million for 20,000 and
100,000 grains on an EPYC, all awake: there a case takes up to 2.7 times less than its estimate. With sleep this is not
measured."""
BOOK = 1.19
"""Time of a step with the balance of what grains lose over one without (docs/coupling.md, 2026-11-22)."""
MACRO_STEP = 5e-3
"""Of the coupling beyond the grains, a macro step [s] (docs/coupling.md, 2026-11-21)."""
SET_DOWN = 0.4 * 0.05
"""Placement in the rig: its time times its speed [m]; 0.39 s at 0.05 m/s (docs/notes/coupling.md, A first look)."""
FALL_TIMES = 1.5
"""What rain and rest take, over the time of a fall from the column's top: 0.27 s to 0.2 s for the beds of 80 mm in
docs/performance.md, rounded up."""

TAP = 1.07
"""What a tap and the rest after it take, over the time of that fall: 0.189 s to 0.176 s, nine taps of the bed of
grains1-jsc1a-*, 61,452 grains before the last `level` (docs/notes/experiments.md, 2026-11-23)."""
TAPPED = 0.0041
"""Packing fraction that a tap adds, of the same nine: from 0.5343 to 0.5715."""
POURED, DENSEST = 0.534, 0.62
"""Where they began, and, roughly, where ``compact:densest`` ends."""

PACED, PACED_LOWERING = 1.16, 1.30
"""Grains computed by the present rules of sleep over those by the rules before 2026-11-26. First after the placement
(40.5 % of the bed over 35.1), then during it (58.2 over 44.8); five beds, docs/results/sleep-whole/runs.jsonl."""
AWAKE = PACED * 20260 * 2.4e-3**3 / 0.036
"""Grains that a motor's tumble computes a step, times their diameter cubed, over the bed's width [m2]:
grains1-sand-0.0085-0.22, 20.1 % of 100,753 over 2 s, by the rules before 2026-11-26. The motors in sand that are kept
computed 0.3 to 1.2 of that, least at 0.125 N m. A brake shakes all of it (79, 84 %)."""
CALM = 3.0
"""What rest under a lowered gravity takes, with drag and then without, over the mean that is taken for it [1]: 2.2 at
1e-6 g (docs/notes/experiments.md)."""


@dataclass(frozen=True)
class Cost:
    """An estimate."""

    grains: float  # of the whole bed
    time_step: float  # [s]
    bed_seconds: float  # preparing the bed, once for all cases that share it [s]
    run_seconds: float  # the tumble [s]
    grain_steps: float
    """Of the tumble: those of its kept result, by today's rules of sleep; without one, of a motor with sleep by
    `AWAKE`, otherwise every grain in each step."""
    steps: float  # of the tumble
    beside: float  # of the tumble, the coupling beyond the grains [s]
    kept: bool = False  # whether the grain-steps are those of a kept result

    def with_grain_steps(self, grain_steps: float) -> "Cost":
        """The same for so many grain-steps of a kept result."""
        seconds = _run_seconds(grain_steps, self.steps) + self.beside
        return replace(self, grain_steps=grain_steps, run_seconds=seconds, kept=True)

    @property
    def seconds(self) -> float:
        """Both [s]."""
        return self.bed_seconds + self.run_seconds


def cost_of_tumble(settings: TumbleSettings) -> Cost:
    """The estimate for a tumble on a bed, on two idle cores. Raises ValueError where the run itself would."""
    from coupling.lowered_gravity import EFOLD, pace_under
    from coupling.platform_run import REST_TIME
    from dem.contact.timestep import time_step_for
    from experiments.grains.staged import RAIN
    from experiments.tumble.on_grains import PlanarOnBed

    on_bed = PlanarOnBed(settings)
    on_bed.members()
    on_bed.check_bed()
    soft = on_bed.material.softened(on_bed.softening().young)
    smallest = settings.grain * (1 - settings.spread)
    step = time_step_for(soft, diameter=smallest, max_overlap=settings.max_overlap, wanted=None)
    grains, gravity = on_bed.grain_count(), on_bed.first_gravity
    fall = math.sqrt(2 * RAIN * settings.bed_size[2] / gravity)
    way = SET_DOWN if on_bed.counterweight > 0 else on_bed.forecast.sunk
    placing = way / on_bed.lowering_speed + pace_under(gravity) * REST_TIME
    if settings.settle_gravity is not None:
        last = on_bed.grain_gravity
        placing += EFOLD * math.sqrt(settings.grain / gravity) * math.log(gravity / last)
        placing += CALM * pace_under(gravity) * REST_TIME
    steps = (settings.duration + placing) / step
    computed = grains
    if settings.sleep and settings.actuator == "motor":
        computed = min(grains, AWAKE * settings.bed_size[1] / settings.grain**3)
    beside = steps / settings.substeps * MACRO_STEP
    prepared = grains / settings.bed_repeats
    making = FALL_TIMES + TAP * _taps(on_bed.stages)
    return Cost(
        grains=grains, time_step=step, bed_seconds=making * fall / step * prepared / _rate(prepared),
        run_seconds=_run_seconds(steps * computed, steps) + beside, grain_steps=steps * computed, steps=steps,
        beside=beside,
    )  # fmt: skip


def _run_seconds(grain_steps: float, steps: float) -> float:
    return BOOK * grain_steps / _rate(grain_steps / steps)


def _taps(words: Sequence[str] | None) -> int:
    from dem.prepare.recipe import parse_stage

    stages = [parse_stage(stage) for stage in words or ()]
    wanted = [DENSEST if s.value is None else s.value for s in stages if s.name == "compact" and s.by == "tap"]
    return math.ceil(max(0.0, max(wanted, default=0.0) - POURED) / TAPPED)


def _rate(grains: float) -> float:
    counts, rates = zip(*RATES, strict=True)
    if grains < counts[0]:  # what a step costs beside its grains is in proportion more
        return rates[0] * max(0.1, grains / counts[0])
    return float(np.interp(grains, counts, rates))


LONGEST = 3600.0
"""A case that is estimated to take longer on two cores [s] is done only where it is named."""
KEPT = ("run.toml", "result.json", "trajectory.csv")
"""What of a run folder is kept as a result."""
MOST_ROWS = 2000
"""Rows of trajectory.csv that are kept, evenly thinned: a repository is no archive."""
EXPERIMENTS = {
    1: "the paper's granular cases",
    2: "flight: grains and platform at a small gravity",
    3: "four tumbles in a row: does it go on sinking?",
    4: "one case at three grain sizes",
    5: "landing: a drop with a spin",
    6: "trials for `hedgebed diagnose`",
}


@dataclass(frozen=True)
class Case:
    """One case that ships."""

    name: str
    path: Path
    settings: TumbleSettings

    @property
    def experiment(self) -> int:
        """Its number in EXPERIMENTS."""
        match = re.match(r"grains(\d+)-", self.name)
        if match is None:
            raise ValueError(f"case {self.name!r} is not named after its experiment: grains1-... is accepted")
        return int(match.group(1))


def cases(names: Sequence[str] = ()) -> list[Case]:
    """Those that ship, in order, or whose names begin as one of `names`. Raises ValueError for a name of none."""
    paths = sorted((CASES / "grains").glob("*.toml"))
    found = [Case(path.stem, path, settings_from(TumbleSettings, [read_case(path)])) for path in paths]
    for name in names:
        if not any(case.name.startswith(name) for case in found):
            begins = {"-".join(words[:n]) for case in found if (words := case.name.split("-")) for n in range(1, 9)}
            near = get_close_matches(name, sorted(begins), n=1)
            meant = f"did you mean {near[0]!r}? " if near else ""
            raise ValueError(f"there is no case {name!r}: {meant}`hedgebed experiments list` names those there are")
    return [case for case in found if not names or any(case.name.startswith(name) for name in names)]


def estimate(case: Case, results: Path | None = None) -> Cost | str:
    """What it costs; or in words why it cannot be run.

    With a result kept in `results`, its grain-steps; otherwise the same for beds that differ in their seed alone.
    """
    found = _estimate(case.settings.model_copy(update={"seed": 1}))
    kept = _kept_grain_steps(results / case.name) if results is not None else None
    return found if kept is None or isinstance(found, str) else found.with_grain_steps(kept)


def _kept_grain_steps(folder: Path) -> float | None:
    """Grain-steps of a kept result, those of earlier rules of sleep at what today's are expected to be."""
    try:
        grains = read_result(folder / "result.json")["grains"]
        tumble, lowering = grains["grain_steps"], grains["grain_steps_lowering"]
        settings = tomllib.loads((folder / "run.toml").read_text(encoding="utf-8"))["settings"]
    except (OSError, ValueError, KeyError):
        return None
    if settings.get("sleep") and "sleep_pace" not in settings:
        everything = grains["grain_steps_all_awake"]
        tumble, lowering = min(PACED * tumble, everything), PACED_LOWERING * lowering
    return float(tumble + lowering)


@functools.cache
def _estimate(settings: TumbleSettings) -> Cost | str:
    try:
        return cost_of_tumble(settings)
    except ValueError as error:
        return str(error)


def standing(case: Case, results: Path, work: Path) -> tuple[str, str]:
    """One of done, failed, stopped, running, to do; and why, where that is known."""
    if (results / case.name / "result.json").exists():
        return "done", ""
    folder = work / _folder_name(case)
    if not (folder / "run.toml").exists():
        other = re.compile(rf"{re.escape(case.name)}(-[0-9a-f]{{16}})?")
        found = sorted(path for path in work.glob(f"{case.name}*") if other.fullmatch(path.name))
        return "to do", f"{found[0]} was begun with other settings or code and is left alone" if found else ""
    try:
        kept = read_json(folder / "status.json")
    except (OSError, ValueError):
        return "stopped", ""
    if kept.get("status") == "done" and (folder / "result.json").exists():
        return "to do", "finished, to be kept"
    return str(kept.get("status", "stopped")), str(kept.get("reason") or "")


def _folder_name(case: Case) -> str:
    return name_of(find_experiment("tumble"), case.settings, label=case.name)


def planned(case: Case, results: Path, work: Path) -> Planned:
    """The run of a case as one of a list, in a folder below `work`; its cost is the estimate [s of two cores].

    Other settings or other code have another folder. `words` is the name of the case.
    """
    task = task_of(find_experiment("tumble"), case.settings, work, name=_folder_name(case), reports=True)
    cost = estimate(case, results)
    return Planned(task, case.name, 0.0 if isinstance(cost, str) else cost.seconds)


def keep(folder: Path, target: Path) -> None:
    """Put the settings and the numbers of a finished run where results are kept, and what it cost.

    All or nothing: it is put together beside `target` and renamed; where `target` is there already, result.json, by
    which a case is done, comes last. cost.json has digests of these files, and null for what an older run's
    status.json does not have.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as beside:
        made = Path(beside) / target.name
        made.mkdir()
        for name in KEPT:
            shutil.copyfile(folder / name, made / name)
        head, *rows = (made / "trajectory.csv").read_text(encoding="utf-8").splitlines()
        thinned = [head, *rows[:: max(1, -(-len(rows) // MOST_ROWS))]]
        (made / "trajectory.csv").write_text("\n".join(thinned) + "\n", encoding="utf-8")
        read_json(made / "result.json")
        cost = read_json(folder / "status.json")
        digests = {name: digest_of(made / name) for name in KEPT}
        kept = {name: cost.get(name) for name in ("processor_time", "updated")} | {"digests": digests}
        write_json(made / "cost.json", kept)
        try:
            made.rename(target)
            return
        except OSError:  # it is there already, maybe since a moment, by another command
            if not target.is_dir():
                raise
        (target / "result.json").unlink(missing_ok=True)
        for path in sorted(made.iterdir(), key=lambda path: path.name == "result.json"):
            path.replace(target / path.name)
