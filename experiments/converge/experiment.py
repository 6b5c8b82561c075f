"""`hedgebed converge`: a penetration case on finer grains, in wider and deeper beds, stiffer, at other speeds.

Every member is an ordinary `penetrate` run in a folder of its own, found again by its settings. After each the result
is written anew from those that are there, so that a sweep that is stopped has one. A member that fails is told, and
the others are made; `hedgebed resume` tries it again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from experiments.grains.kept_material import MATERIAL_COPY, keep_material
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.runs.folder import RunFolder, write_json
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import draw_report, whole_run

from .analysis import numbers_of
from .design import Member, affordable, members_of, variants_of
from .members import finished_member, make_member
from .result import conclude, doubts, plan_told
from .settings import ConvergeSettings, say

__all__ = ["check", "fingerprint", "resume", "run"]


def fingerprint() -> str:
    """A digest of the code that computes beds."""
    return beds.fingerprint()


def check(settings: ConvergeSettings) -> None:
    """Raise ValueError, naming list and value, for a member that machine or material cannot serve."""
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

    @property
    def home(self) -> Path:
        """Where the members' run folders are."""
        return Path(self.settings.members) if self.settings.members else self.folder.path / "members"

    def make(self, member: Member) -> None:
        """Carry out a member, or go on with it."""
        path = self.home / member.folder
        self.progress.stage(member.id, total=1.0)
        failed = make_member(member.settings, path, self.progress)
        if failed is not None:
            self.failed[member.id] = failed
            self.progress.message(f"{member.id}: {failed}")
            return
        self.read(member)

    def read(self, member: Member) -> bool:
        """Take the numbers of a member that is done, and say whether it is."""
        own = finished_member(self.home / member.folder)
        if own is None:
            return False
        self.numbers[member.id] = numbers_of(own.read_result())
        self.spent[member.id] = own.processor_time
        return True

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
        todo = [member for member in members if not work.read(member)]
        progress.plan({member.id: 3600 * member.core_hours for member in todo}, seconds={"report": 10.0}, unit=1.0)
        result = work.keep() if work.numbers else None
        for member in todo:
            work.make(member)
            if work.numbers:
                result = work.keep()
        if result is None:
            raise RuntimeError(next(iter(work.failed.values())))
        draw_report(folder, progress)
    return result


run, resume = whole_run(
    "converge", ConvergeSettings, _carry_out, check=check, material_copy=MATERIAL_COPY, code=fingerprint,
    as_given=False,
)  # fmt: skip
