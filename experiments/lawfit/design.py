"""Choice of the runs that identify K and C: two beds, then further runs until the tolerance or the budget is reached.

The design does not stop before `LEAST_BEDS` beds. Two or three beds that agree by chance have an interval that is too
narrow, and stopping at the first narrow interval would select them. `experiments.lawfit.synthetic` measures the bias
that remains.

Every bed gets the same drives, drops and a placement under the load. After each step the spring-damper is fitted. Its
uncertainty is half of the 90 % interval of its force at half the depth and the fastest speed, over the force. If C does
not differ significantly from 0 and causes most of the uncertainty, each bed gets one more drive at twice the fastest
speed. Otherwise another bed is added. Of several cells (`experiments.lawfit.cells`) each begins with two beds, and the
next step is made in the cell with the largest uncertainty. Costs are estimates made in advance, so that the same
settings lead to the same runs on every machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from experiments.converge.costs import core_hours
from experiments.converge.design import BASE, Member, Variant
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.pool.together import Planned, Where, run_all, whole_folder
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.types import Json

from .cells import FASTER, Cell, cells_of
from .data import Data
from .fit import Estimated, LawFit, fit_law, interval
from .further import FurtherRuns, cost_of_further, further_runs
from .laws import CANDIDATES, Candidate
from .reading import read_folders
from .settings import LawFitSettings, say

__all__ = ["Designed", "check_design", "compute_runs", "how_sure", "middle_force", "sure_enough", "with_chosen"]

LEAST_BEDS = 4
"""Least number of beds before the design may stop [1]."""
FOR_FURTHER = 0.5
"""Share of the budget that `LEAST_BEDS` beds may cost with the further runs that the design chooses itself [1]. The
rest is for more beds."""


@dataclass
class Designed:
    """The runs that were computed, and why."""

    cells: dict[str, Data] = field(default_factory=dict)  # Name of the cell -> its runs
    steps: list[Json] = field(default_factory=list)
    """For each step: cell, why, run folders, their estimated cost [s], and the relative uncertainty after it [1]."""
    notes: list[str] = field(default_factory=list)  # Why the design ended


@dataclass
class _Growing:
    """A cell to which beds are added."""

    cell: Cell
    seeds: list[int]
    beds: int = 0
    fast: bool = False  # Whether each bed has the faster drive
    paths: list[Path] = field(default_factory=list)
    data: Data | None = None
    sure: float = float("inf")
    of_rate: bool = False  # Whether C causes most of the uncertainty and does not differ significantly from 0
    ended: bool = False

    def next_step(self, tolerance: float) -> tuple[str, list[Member]]:
        """Why more runs are needed, and which."""
        numbers = {"now": self.sure, "tolerance": tolerance, "least": LEAST_BEDS}
        if not self.beds:
            return say("first"), [_member(self.cell, seed) for seed in self.seeds[:2]]
        if not self.fast and self.of_rate:
            speed = FASTER * max(self.cell.base.speeds)
            own = self.seeds[: self.beds]
            return say("faster", speed=speed), [_member(self.cell, seed, faster=True) for seed in own]
        why, seed = say("more_beds" if self.sure > tolerance else "least_beds", **numbers), self.seeds[self.beds]
        more = [_member(self.cell, seed, faster=True)] if self.fast else []
        return why, [_member(self.cell, seed), *more]

    def take(self, members: Sequence[Member], home: Path, settings: LawFitSettings) -> None:
        """Fit all runs of the cell, of which `members` are new."""
        self.fast = self.fast or any(member.variant.what != BASE for member in members)
        self.paths += [home / member.folder for member in members]
        self.beds = len({member.seed for member in members} | set(self.seeds[: self.beds]))
        self.data = read_folders([(path.name, path) for path in self.paths], settings)
        pair = CANDIDATES["spring-damper"](self.data.foundation)
        assert pair is not None
        fitted = fit_law(pair, self.data)
        self.sure, share = how_sure(fitted)
        self.of_rate = share > 0.5 and fitted.parameter("damping").low <= 0


def _member(cell: Cell, seed: int, *, faster: bool = False) -> Member:
    """All runs in the bed of `seed`, or only the faster drive in it."""
    base = cell.base
    if not faster:
        return Member(Variant(BASE, 1.0, base), seed, 1)
    speed = (float(f"{FASTER * max(base.speeds):.6g}"),)
    own = base.model_copy(update={"speeds": speed, "other_speeds": speed, "drop_speeds": (), "other_drop_speeds": ()})
    return Member(Variant("speed", FASTER, own), seed, 1)


def _seeds(settings: LawFitSettings) -> list[int]:
    """Seeds of the beds, in their order: those of the settings, then the next numbers."""
    own = list(settings.seeds)
    return (own + [max(own) + 1 + k for k in range(settings.most_beds)])[: settings.most_beds]


def check_design(settings: LawFitSettings) -> None:
    """Raise ValueError for runs that cannot be computed, and for a budget below the cost of the first two beds."""
    Where.of(settings).check()
    settings, _ = with_chosen(settings)
    cells, seeds = cells_of(settings), _seeds(settings)[:2]
    for cell in cells:
        penetrate.check(cell.base)
        for load in cell.loads:
            heavy = cell.base.model_copy(update={"load": load})
            penetrate.check(heavy)
            if beds.sinks_away(heavy):
                raise ValueError(say("load_sinks", load=load, name=cell.name, most=beds.resting_load(heavy)))
    least = sum(_cost(cell, [_member(cell, seed) for seed in seeds]) for cell in cells)
    budget = settings.budget or 0.0
    if least > budget:
        base = cells[0].base
        several = say("for_each", count=len(cells)) if len(cells) > 1 else ""
        numbers = {"drives": len(base.speeds), "drops": len(base.drop_speeds), "cells": several}
        raise ValueError(say("small_budget", budget=budget, least=least, **numbers))


def with_chosen(settings: LawFitSettings) -> tuple[LawFitSettings, str]:
    """`settings` with the further runs that the design chooses, and the sentence that states them; "" for none.

    It chooses only if none are given: unloading at half the depth, then half the load, then a drag at half the depth.
    Each is chosen if `LEAST_BEDS` beds with it cost at most `FOR_FURTHER` of the budget. Half the load does not change
    the modulus of the grains, which follows from the largest load.
    """
    if not settings.choose_further or settings.loads or settings.unload_depths or settings.drag_depths:
        return settings, ""
    half = float(f"{0.5 * settings.depth:.6g}")
    load = float(f"{0.5 * cells_of(settings)[0].base.weight:.6g}")
    chosen: dict[str, tuple[float, ...]] = {}
    for key, value in (("unload_depths", half), ("loads", load), ("drag_depths", half)):
        more = settings.model_copy(update=chosen | {key: (value,)})
        if _cost_of_least(more) <= FOR_FURTHER * (settings.budget or 0.0):
            chosen[key] = (value,)
    words = " ".join(f"--{key.replace('_', '-')} {value:g}" for key, (value,) in chosen.items())
    return settings.model_copy(update=chosen), say("chosen", words=words) if chosen else ""


def _cost_of_least(settings: LawFitSettings) -> float:
    """Estimated cost of `LEAST_BEDS` beds in every cell, each with the faster drive [s of one core]."""
    seeds = _seeds(settings)[:LEAST_BEDS]
    return sum(
        _cost(cell, [_member(cell, seed, faster=faster) for seed in seeds for faster in (False, True)])
        for cell in cells_of(settings)
    )


def _cost(cell: Cell, members: Sequence[Member]) -> float:
    """Estimated cost of `members` [s of one core]."""
    plain = [core_hours(member.settings, bed=cell.new_bed) for member in members if member.variant.what == BASE]
    further = len(plain) * cost_of_further(cell)
    return further + 3600 * sum([*plain, *(member.core_hours for member in members if member.variant.what != BASE)])


def compute_runs(settings: LawFitSettings, folder: RunFolder, progress: Progress) -> Designed:
    """Compute runs, or read those that are done, until every cell reaches the tolerance or the budget is spent.

    Beds that are needed in any case are computed together with the first two. Raises RuntimeError if a run fails: the
    finished runs are kept, and resuming continues from them.
    """
    settings, chosen = with_chosen(settings)
    if chosen:
        progress.message(chosen)
    home = Path(settings.members) if settings.members else folder.path / "members"
    growing = [_Growing(cell, _seeds(settings)) for cell in cells_of(settings)]
    budget, spent, designed = settings.budget or 0.0, 0.0, Designed()
    certain = _certain([one.cell for one in growing], _seeds(settings), budget, home)
    while going := [one for one in growing if not one.ended]:
        one = max(going, key=lambda one: one.sure)  # the first of those that are alike
        why, todo = one.next_step(settings.tolerance)
        cost = _cost(one.cell, todo)
        if one.beds and spent + cost > budget:
            numbers = {"now": one.sure, "tolerance": settings.tolerance, "spent": spent, "budget": budget}
            numbers |= {"beds": one.beds, "least": LEAST_BEDS, "more": spent + cost - budget}
            designed.notes.append(_of_cell(one, growing, say("spent", **numbers)))
            break
        progress.message(_of_cell(one, growing, why))
        _make([_planned(one.cell, member, home) for member in todo], certain, Where.of(settings), progress)
        spent += cost
        one.take(todo, home, settings)
        step: Json = {"cell": one.cell.name, "why": why, "runs": [path.name for path in one.paths[-len(todo) :]]}
        designed.steps.append(step | {"cost": cost, "sure": one.sure})
        if ended := _ended(one, settings.tolerance):
            one.ended = True
            designed.notes.append(_of_cell(one, growing, ended))
    designed.cells = {one.cell.name: one.data for one in growing if one.data is not None}
    return designed


def _ended(one: _Growing, tolerance: float) -> str:
    """Why a cell gets no more runs; empty if it gets some."""
    numbers = {"now": one.sure, "tolerance": tolerance, "least": LEAST_BEDS}
    if sure_enough(one.sure, one.beds, tolerance):
        return say("within_tolerance", **numbers)
    if one.beds == len(one.seeds) and (one.fast or not one.of_rate):
        return say("enough_beds", beds=one.beds, **numbers)
    return ""


def _of_cell(one: _Growing, growing: Sequence[_Growing], text: str) -> str:
    """The sentence, with the name of the cell before it where there are several."""
    return f"{one.cell.name}: {text}" if len(growing) > 1 else text


def _planned(cell: Cell, member: Member, home: Path) -> Planned:
    """A member as a run of a list, with the further runs in its bed."""
    plain, runs = member.planned(home), tuple(further_runs(cell)) if member.variant.what == BASE else ()
    if not runs:
        return plain
    cost = plain.cost + cost_of_further(cell)
    after = FurtherRuns(runs, share=1.0 - plain.cost / cost)
    return replace(plain, task=replace(plain.task, after=after), cost=cost)


def _certain(cells: Sequence[Cell], seeds: Sequence[int], budget: float, home: Path) -> list[Planned]:
    """Beds that are needed in any case: the first two of each cell, or `LEAST_BEDS` of each if the budget is sufficient
    for these in all cells, each with the faster drive, which is decided later.
    """
    first = seeds[:LEAST_BEDS]
    most = [_cost(cell, [_member(cell, seed, faster=faster) for seed in first for faster in (False, True)])
            for cell in cells]  # fmt: skip
    first = first if sum(most) <= budget else seeds[:2]
    return [_planned(cell, _member(cell, seed), home) for cell in cells for seed in first]


def _make(todo: Sequence[Planned], certain: Sequence[Planned], where: Where, progress: Progress) -> None:
    """Compute the runs of `todo` that are not done, and those of `certain` if several processes are available.

    If runs of `todo` fail, the others are finished first; then RuntimeError names the first that failed.
    """
    alone = where.scheduler is None and where.processes([one.cost for one in (*todo, *certain)]) == 1
    outcomes = run_all([*todo, *([] if alone else certain)], where=where, progress=progress)
    for one in todo:
        if fault := outcomes[one.task.name].fault:
            raise RuntimeError(say("member_failed", name=one.task.name, reason=fault))
        whole_folder(one.task, "series", *(one.task.after.files if one.task.after is not None else ()))


def sure_enough(sure: float, beds: int, tolerance: float, *, least: int = LEAST_BEDS) -> bool:
    """Whether no more runs are needed."""
    return beds >= least and sure <= tolerance


def middle_force(fitted: LawFit[Candidate]) -> Estimated:
    """The force at half the depth and the fastest speed [N].

    Its interval is from the forces of the fits that leave out one bed each: K and C are not independent.
    """
    depth, speed = 0.5 * float(fitted.data.depth.max()), max(fitted.data.speeds)
    z, v = np.array([depth]), np.array([speed])
    forces = [float(fitted.candidate.force(theta, z, v)[0]) for theta in (fitted.theta, *fitted.left_out)]
    return interval(forces[0], np.array(forces[1:]))


def how_sure(fitted: LawFit[Candidate]) -> tuple[float, float]:
    """Half of the 90 % interval of `middle_force` over it, and the share that C has in its variance [1]."""
    depth, speed, found = 0.5 * float(fitted.data.depth.max()), max(fitted.data.speeds), middle_force(fitted)
    parts = [(fitted.parameter(name).std * arm) ** 2 for name, arm in (("stiffness", depth), ("damping", speed))]
    sure = 0.5 * (found.high - found.low) / found.value if found.value > 0 else float("inf")
    return sure, parts[1] / sum(parts) if sum(parts) > 0 else 0.0
