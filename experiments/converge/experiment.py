"""`hedgebed converge`: a penetration case on finer grains, in wider and deeper beds, stiffer, at other speeds.

Every member is an ordinary `penetrate` run in a folder of its own, found again by its settings and code. After each
member the result is written anew from the finished ones, so that a stopped sweep has a result. Where a member fails,
this is reported and the others are made. The result then has a warning, and the run ends in RuntimeError (exit status
1). `hedgebed resume` tries the member again.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from experiments.grains.kept_material import MATERIAL_COPY, keep_material
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.pool.tasks import Outcome
from experiments.pool.together import Where, run_all
from experiments.runs.folder import RunFolder, write_json
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import draw_report, whole_run

from .analysis import numbers_of
from .design import Member, affordable, members_of, variants_of
from .result import conclude, doubts, plan_told
from .settings import ConvergeSettings, say

__all__ = ["check", "fingerprint", "resume", "run"]

_REPORT = 10.0  # What the report takes [s]


def fingerprint() -> str:
    """A digest of the code that computes beds."""
    return beds.fingerprint()


def check(settings: ConvergeSettings) -> None:
    """Raise ValueError, naming list and value, for a member that machine or material cannot serve."""
    Where.of(settings).check()
    variants = variants_of(settings)
    for variant in variants:
        try:
            penetrate.check(variant.settings)
        except ValueError as error:
            raise ValueError(f"{variant.id}: {error}") from None
    members = members_of(settings, variants)
    if not affordable(members, settings.budget):
        raise ValueError(say("budget", budget=settings.budget, least=members[0].core_hours))


@dataclass
class _Work:
    """The members of a sweep, and what is known of them."""

    settings: ConvergeSettings
    folder: RunFolder
    progress: Progress
    members: Sequence[Member]
    left_out: Sequence[Member]
    numbers: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Of the members that are done: id -> quantities."""
    failed: dict[str, str] = field(default_factory=dict)
    spent: dict[str, float] = field(default_factory=dict)
    """Processor time of the members that are done [s]."""
    result: Result | None = None

    def take(self, outcomes: Sequence[Outcome]) -> None:
        """Take the numbers of members that are over, or why they have none, and write the result of what is done."""
        over = {outcome.name: outcome for outcome in outcomes}
        for member in self.members:
            outcome = over.get(member.folder)
            if outcome is not None and outcome.fault:
                self.failed[member.id] = outcome.fault
            elif outcome is not None:
                self.numbers[member.id] = numbers_of(json.loads(outcome.result))
                self.spent[member.id] = outcome.processor_time
        if self.numbers:
            self.result = self.keep()

    def keep(self) -> Result:
        """Write the result of what is done so far, and what it cost; return it."""
        result = conclude(self.settings, self.members, self.left_out, self.numbers, self.failed)
        self.folder.write_result(result)
        expected = {member.id: 3600 * member.core_hours for member in self.members}
        costs = {name: {"processor_time": spent, "expected": expected[name]} for name, spent in self.spent.items()}
        write_json(self.folder.path / "cost.json", costs)
        return result


def _carry_out(settings: ConvergeSettings, folder: RunFolder, progress: Progress) -> Result:
    with folder.lock():
        settings = settings.model_copy(update={"material": keep_material(settings.material, folder.path)})
        every = members_of(settings, variants_of(settings))
        members = affordable(every, settings.budget)
        work = _Work(settings, folder, progress, members, every[len(members) :])
        for line in (*plan_told(settings, members, work.left_out), *doubts(settings)):
            progress.message(line)
        home = Path(settings.members) if settings.members else folder.path / "members"
        planned = [member.planned(home) for member in members]
        where = Where.of(settings)
        run_all(planned, where=where, progress=progress, on_outcomes=work.take, report=_REPORT, unit=1.0)
        if work.result is None:
            raise RuntimeError(next(iter(work.failed.values())))
        draw_report(folder, progress)
    if work.failed:
        name, reason = next(iter(work.failed.items()))
        raise RuntimeError(
            say("members_failed", failed=len(work.failed), of=len(members), id=name, reason=reason, folder=folder.path)
        )
    return work.result


run, resume = whole_run(
    "converge", ConvergeSettings, _carry_out, check=check, material_copy=MATERIAL_COPY, code=fingerprint,
    as_given=False,
)  # fmt: skip
