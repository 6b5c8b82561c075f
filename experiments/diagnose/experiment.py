"""`hedgebed diagnose CAMPAIGN`: a campaign of measured trials in, a diagnosis in a run folder out."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from threadpoolctl import threadpool_limits

from experiments.campaign import Campaign, read_campaign
from experiments.check import find_implausible, find_unstated, missing_sensors, said_once, template_warning
from experiments.diagnose.settings import DiagnoseSettings
from experiments.runs.folder import RunFolder
from experiments.runs.kernel_cache import free_kernel_cache
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run
from vis.diagnose.usable import gap_in_scatter, has_numbers_to_use, stiffness_words

from .core.diagnosis import diagnose
from .core.outcome import Diagnosis
from .fit.bounds import is_strained
from .fit.forms import OwnEffect, load_own
from .fit.gaps import numeral
from .fit.problem import Problem
from .noise.colour import together
from .push.frame import at_the_tip
from .report.document import write_diagnosis
from .report.sentences import findings_in_words, told_tables, where_sentences
from .report.spread import spread_sentences
from .report.summary import summary_sentences, title_words

__all__ = ["check", "diagnose_campaign", "make_problem", "resume", "run"]


def check(settings: DiagnoseSettings) -> None:
    """Raise ValueError, naming file and line or key, for a campaign that cannot be read or diagnosed."""
    _make_problem(Path(settings.campaign), settings.effect_file, settings.frame_stiffness)


def diagnose_campaign(
    campaign: str | Path, *, thorough: bool = False, seed: int = 0, effect_file: Sequence[str | Path] = (),
    frame_stiffness: float | None = None, progress: Progress | None = None,
) -> Diagnosis:  # fmt: skip
    """The diagnosis of the campaign in a folder, without files. Raises ValueError as `check` does. `effect_file`:
    Python files with effects of one's own, which are among the candidates. `frame_stiffness`: of what is between drive
    and tip of the pushes [N/m], see `at_the_tip`."""
    free_kernel_cache()
    measured, problem = _make_problem(Path(campaign), effect_file, frame_stiffness)
    shown = progress or Progress()
    stage = ""

    def tell(what: str, done: float) -> None:
        nonlocal stage
        if what != stage:
            stage = what
            shown.stage(what, total=1.0)
        shown.update(done)

    odd = [finding for finding in find_implausible(measured) if not problem.explains(finding)]
    unstated = find_unstated(measured)
    for finding in (*unstated, *odd):  # before the long part: a wrong number in campaign.toml is soon corrected
        shown.message(f"before anything is fitted: {finding.what}")
    gates = None
    if thorough:
        from dem.prepare.prepare import cache_folder

        gates = cache_folder() / "gates"
    with threadpool_limits(1):  # matrices are small: threads of the linear algebra slow one another down
        found = diagnose(problem, thorough=thorough, seed=seed, tell=tell, gates=gates)
    odd = [finding for finding in odd if not problem.explains(finding)]  # by now zeros may be taken into account
    return replace(found, findings=(*missing_sensors(measured), *unstated, *odd, *findings_in_words(found.findings)))


def _make_problem(
    folder: Path, effect_file: Sequence[str | Path], frame_stiffness: float | None
) -> tuple[Campaign, Problem]:
    campaign = read_campaign(folder)
    own = tuple(load_own(file) for file in effect_file)
    with threadpool_limits(1):
        return campaign, make_problem(campaign, own=own, frame_stiffness=frame_stiffness)


def make_problem(
    campaign: Campaign, *, own: Sequence[OwnEffect] = (), frame_stiffness: float | None = None
) -> Problem:  # fmt: skip
    """The problem of a campaign of either kind, with `own` among its candidates. The depth of its pushes is that of the
    tip behind a frame of `frame_stiffness` [N/m]. Raises ValueError where there is none."""
    package = {"penetration": "push", "tumble": "tumble"}[campaign.tables.kind]
    corrected = at_the_tip(campaign, frame_stiffness)
    frame = {} if frame_stiffness is None else {"frame": frame_stiffness}
    found: Problem = import_module(f"experiments.diagnose.{package}.problem").make_problem(corrected, own=own, **frame)
    return found


def _compute(settings: DiagnoseSettings, folder: RunFolder, progress: Progress) -> Result:
    options = settings.model_dump(exclude={"campaign"})
    made_up = template_warning(read_campaign(settings.campaign))
    if made_up is not None:
        progress.message(f"warning: {made_up}")
    found = diagnose_campaign(settings.campaign, **options, progress=progress)
    for file in settings.effect_file:  # model.toml names it
        shutil.copyfile(file, folder.path / Path(file).name)
    for finding in said_once(found.findings):
        progress.message(finding.what)
    with threadpool_limits(1):
        diagnosis = write_diagnosis(folder.path, found)
    return _result(found, diagnosis, made_up)


run, resume = computed_run("diagnose", DiagnoseSettings, _compute, check=lambda settings: None)


def _quantity(entry: Json, *, at_end: bool) -> Json:
    """A fitted number with its standard error; at the end of its range, or where it is not determined, it has none."""
    number = {key: value for key, value in entry.items() if key != "determined"}
    if at_end and "at_most" not in entry:
        return {**number, "std": None, "note": "at the end of its range: no standard error"}
    if entry["std"] is None or not entry.get("determined", True):
        bound = f"; at most {numeral(entry['at_most'], 2)} (95 % bound)" if "at_most" in entry else ""
        return {**number, "std": None, "note": f"these trials do not determine it: no standard error{bound}"}
    return {**number, "note": "error of the fit, right if the model is and the noise has the size found"}


def _result(found: Diagnosis, diagnosis: Json, made_up: str | None) -> Result:
    parts = [(stage, part) for stage in ("before", "after") for part in ("fit", "held_out")]
    quantities: Json = {
        f"gap_{stage}_{part}": {"value": diagnosis["gap"][stage][part], "std": None, "unit": "1",
                                "note": "chi-square per sample"}
        for stage, part in parts
    }  # fmt: skip
    if "gap_with_scatter" in diagnosis:
        note = "chi-square per sample, what replicates differ by added to the sensors' variance"
        quantities |= {
            f"gap_with_scatter_{stage}_{part}": {**gap_in_scatter(diagnosis, part, stage), "note": note}
            for stage, part in parts
        }
    at_end = {
        stage: {bound["parameter"] for bound in bounds if bound["at_bound"]}
        for stage, bounds in diagnosis["at_bounds"].items()
    }
    base: dict[str, Json] = {
        stage: {f"{name}_{stage}": _quantity(entry, at_end=name in at_end[stage])
                for name, entry in diagnosis["base"][stage].items()}
        for stage in ("before", "after")
    }  # fmt: skip
    effects: Json = {
        f"{effect['id']}.{name}": _quantity(entry, at_end=f"{effect['id']}.{name}" in at_end["after"])
        for effect in diagnosis["effects"] for name, entry in effect["parameters"].items()
    }  # fmt: skip
    if meant := stiffness_words(diagnosis):
        for name, number in base["after"].items():
            if name.startswith("stiffness"):
                number["note"] = f"{meant}; {number['note']}"
    if has_numbers_to_use(diagnosis):  # these first
        quantities = base["after"] | effects | quantities | base["before"]
    else:
        quantities |= base["before"] | base["after"] | effects
    summary = summary_sentences(diagnosis)
    remarks = [one for one in found.remarks if not any(one.removesuffix(".") in told for told in summary)]
    sentences = [*where_sentences(diagnosis), *remarks, *found.facts]
    noises = [together([colour]) for colour in found.colours.values()]
    sentences += [f"{words[0].upper()}{words[1:]}." for words in noises]
    sentences += spread_sentences(found.model_std, granular=found.problem.granular)
    warnings = [*filter(None, [made_up]), *(finding.what for finding in said_once(found.findings))]
    if not found.problem.covered.get("withdrawal", True):
        warnings.append("no push was withdrawn: the model was fitted to loading only, and states nothing of withdrawal")
    beside = "beside the effects named it means another thing"
    if is_strained(found.best):
        unknown = found.verdict == "unknown"
        beside = "it does not explain the data" if unknown else "it absorbs a difference in structure"
    for model, bounds, meaning, beyond in (  # a bent spring looks like a straight one that begins deeper
        (
            "the base model",
            found.bounds_before,
            "it bends them because something is missing",
            {found.problem.loose} if found.forms else {},
        ),
        ("the best model", found.bounds_after if found.forms else (), beside, {}),
    ):
        strained = [bound.words for bound in bounds if bound.strains and bound.parameter not in beyond]
        if strained:
            warnings.append(f"fitted by {model} as far from what was stated as no true number is: "
                            f"{', '.join(strained)}; {meaning}")  # fmt: skip
        ends = [bound.words for bound in bounds if not bound.strains]
        if ends:
            warnings.append(f"fitted by {model} to the end of its range: {', '.join(ends)}")
    return Result.make(
        "diagnose", title=title_words(diagnosis), verdict=found.verdict, summary=summary,
        quantities=quantities, tables=told_tables(diagnosis), departures={"sentences": sentences}, warnings=warnings,
    )  # fmt: skip
