"""A robot on several beds: each is a run of its own in the folder ``beds``, and the result is the mean over them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.converge.statistics import interval_of
from experiments.runs.folder import RunFolder
from experiments.runs.given import keep_given, kept_copy
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from experiments.runs.whole_runs import keeping_status, publish, report_called
from vis.page.numbers import foldable
from vis.page.numbers import quantity as in_words_of
from vis.robot.answer import BALLISTIC

from . import say
from .forms import NO_FORMS, Forms, expected_words, with_grains
from .on_grains import RobotOnBed
from .plan import CONTROLLER, MODEL, RobotPlan
from .settings import RobotSettings
from .sure import ANSWER, DISTANCE, answer_of, entry, in_words

__all__ = ["carry_out_beds", "over_beds"]

WORST = ("stability", "energy_residual", "coupling_residual", "exchange_residual", "dissipation_reversal",
         "momentum_residual", "angular_momentum_residual")  # fmt: skip
"""Quantities of which the largest of all beds counts."""
OF_ALL = ("trial", "surface", "ground", "duration", "feet")
"""Entries of a result that are the same on all beds."""


def carry_out_beds(settings: RobotSettings, plan: RobotPlan, folder: RunFolder, progress: Progress) -> Result:
    """Run the robot on the bed of each seed in `folder`, and return the result over them.

    A bed that is done is not run again; one that was stopped goes on from its checkpoint. The run folders of beds keep
    copies of model and controller from `folder`. Raises as `RobotOnBed.carry_out`.
    """
    runs = {seed: _OneOfSeveral(settings.of_bed(seed), plan) for seed in settings.seeds}
    progress.plan(
        {name: cost for run in runs.values() for name, cost in run.costs.items()},
        seconds={run.report_stage: run.report_seconds for run in runs.values()} | {"report": 5.0},
    )
    results: list[Mapping[str, Any]] = []
    before: RobotOnBed | None = None
    for place, (seed, run) in enumerate(runs.items(), 1):
        home = RunFolder.ensure(folder.path / "beds" / f"seed-{seed}", "mujoco", run.settings)
        words = {"place": place, "count": len(runs), "seed": seed}
        if home.status == "done":
            progress.message(say("bed_kept", **words))
        else:
            progress.message(say("bed_begins", **words, folder=home.path))
            _copy_given(folder.path, home.path)
            with keeping_status(home), report_called(run.report_stage):
                run.take_laws_of(before)
                run.carry_out(home, progress)
            before = run
        results.append(home.read_result())
    return publish(folder, over_beds(settings.seeds, results), progress)


class _OneOfSeveral(RobotOnBed):
    """The run on one of several beds; its stages have the seed in their names."""

    plans = False

    def __init__(self, settings: RobotSettings, plan: RobotPlan) -> None:
        super().__init__(settings, replace(plan, settings=settings))
        names = (f"{name}, seed {settings.seed}" for name in (self.stage, self.bed_stage, self.lowering_stage))
        self.stage, self.bed_stage, self.lowering_stage = names
        self.report_stage = f"report, seed {settings.seed}"

    def take_laws_of(self, other: RobotOnBed | None) -> None:
        """Take the runs on surface laws of another bed, where there is one: they do not depend on the bed."""
        if other is not None:
            self.forecast, self.beside = other.forecast, other.beside
            if "forms" in vars(other):  # computed already
                self.forms = other.forms


def _copy_given(source: Path, folder: Path) -> None:
    """Keep the model and the controller of the whole run in the folder of one bed."""
    for name in (MODEL, CONTROLLER):
        kept = kept_copy(source, name)
        if kept is not None and kept_copy(folder, name) is None:
            keep_given(folder, name, kept.read_bytes())


def over_beds(seeds: Sequence[int], results: Sequence[Mapping[str, Any]]) -> Result:
    """The result over the beds of `seeds`: means with standard deviations, and their 95 % intervals under ``sure``."""
    first, count = results[0], len(results)
    hops = [result.get("hop", True) for result in results]
    answers = [
        answer_of(result["quantities"], result["feet_reached"], hop=hop)
        for result, hop in zip(results, hops, strict=True)
    ]
    sure: Json = {}
    for name in (name for name in answers[0] if all(name in answer for answer in answers)):
        found = interval_of([answer[name] for answer in answers])
        assert found is not None and found.half is not None
        sure[name] = entry(name, found.mean, found.mean - found.half, found.mean + found.half)
    invalid = [result["title"] for result in results if result["departures"]["sentences"][0] == say("invalid")]
    sentences = [say("over_beds", count=count, words=in_words(sure, half=True)), say("chance_alone")]
    shared = [said for said in first["departures"]["sentences"] if _in_all(results, said)]
    notes = [said for said in shared if said != say("invalid")]
    forms = _forms_over(results, {name: one["value"] for name, one in sure.items()})
    sentences = [*forms.words, *sentences]
    return Result.make(
        "mujoco",
        title=say("title_beds", title=(invalid or [first["title"]])[0], count=count),
        quantities={name: _over(name, results) for name in first["quantities"] if name in _common(results)},
        departures={"sentences": [*([say("invalid")] if invalid else []), *sentences, *notes]},
        tables=[_each(seeds, results, answers)],
        sure=sure,
        **({"ballistic": True} if any(set(BALLISTIC.values()) & set(one["quantities"]) for one in results) else {}),
        hop=any(hops),
        **{name: first[name] for name in OF_ALL},
        **({"forms": forms.numbers} if forms.numbers else {}),
        **({"start_height": first["start_height"]} if "start_height" in first else {}),
        feet_reached=_mean_reached(results),
        beds=[
            {"seed": seed, "folder": f"beds/seed-{seed}", "answer": answer, "grains": _of_its_own(result)}
            for seed, result, answer in zip(seeds, results, answers, strict=True)
        ],
        beside=first["grains"]["beside"],
        beside_law=first["grains"]["beside_law"],
        code=first["code"],
        warnings=list(_warnings(seeds, results)),
    )


def _forms_over(results: Sequence[Mapping[str, Any]], mean: Mapping[str, float]) -> Forms:
    """The ranges over the laws of sand and every bed, around the `mean` over the beds."""
    every = [result["forms"] for result in results if "forms" in result]
    if len(every) < len(results):  # another surface, or a bed that an older hedgebed has computed
        return NO_FORMS
    forms = with_grains(Forms(numbers=every[0]), mean)
    for name, one in forms.numbers.get("ranges", {}).items():
        one["low"] = min(bed["ranges"][name]["low"] for bed in every)
        one["high"] = max(bed["ranges"][name]["high"] for bed in every)
    words = expected_words(forms.numbers, mean, on_grains=True)
    return Forms(numbers=forms.numbers, words=tuple(map(foldable, words)))


def _common(results: Sequence[Mapping[str, Any]]) -> set[str]:
    """Names of the quantities that all beds have."""
    return set.intersection(*(set(result["quantities"]) for result in results))


def _over(name: str, results: Sequence[Mapping[str, Any]]) -> Json:
    """A quantity over beds: mean and standard deviation (n - 1), the largest where that counts; null where a bed has
    none."""
    entries = [result["quantities"][name] for result in results]
    values, count = [one["value"] for one in entries if one["value"] is not None], len(entries)
    unit, note = entries[0]["unit"], entries[0].get("note", "")
    if len(values) < count:
        return quantity(None, unit, say("some_of", missing=count - len(values), count=count, note=note))
    if name in WORST:
        return quantity(float(max(values)), unit, say("worst_of", count=count, note=note), std=None)
    told = say("mean_of", count=count, note=note)
    return quantity(float(np.mean(values)), unit, told, std=float(np.std(values, ddof=1)))


def _mean_reached(results: Sequence[Mapping[str, Any]]) -> Json:
    """Height and depth of each foot, means over beds [m]."""
    every = [result["feet_reached"] for result in results]
    return {
        foot: {name: float(np.mean([one[foot][name] for one in every])) for name in numbers}
        for foot, numbers in every[0].items()
    }


def _of_its_own(result: Mapping[str, Any]) -> Json:
    """What a bed is, without the law beside it."""
    return {name: value for name, value in result["grains"].items() if not name.startswith("beside")}


def _each(seeds: Sequence[int], results: Sequence[Mapping[str, Any]], answers: Sequence[Mapping[str, float]]) -> Json:
    """A table with the answer of each bed."""
    along = {DISTANCE: "m"} if all(DISTANCE in answer for answer in answers) else {}
    units = {**ANSWER, **along}
    rows = [
        [str(seed), *(in_words_of({"value": answer[name], "std": 0.0, "unit": unit}) for name, unit in units.items())]
        for seed, answer in zip(seeds, answers, strict=True)
    ]
    head = ["seed", "rise", "longest flight", "clearance", "sinkage", "largest force"]
    head += ["distance of the hop"] if along else []
    return {"title": say("each_bed"), "head": head, "rows": rows}


def _in_all(results: Sequence[Mapping[str, Any]], sentence: str) -> bool:
    """Whether all beds say this."""
    return all(sentence in result["departures"]["sentences"] for result in results)


def _warnings(seeds: Sequence[int], results: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Those of all beds once; those of some with their seed, without that of a single bed."""
    every = [[said for said in result["warnings"] if said != say("one_bed")] for result in results]
    yield from (said for said in every[0] if all(said in own for own in every))
    for seed, own in zip(seeds, every, strict=True):
        yield from (say("of_seed", seed=seed, warning=said) for said in own if not all(said in each for each in every))
