"""Which runs tell K and C: two beds first, then a run where the answer is least sure, until it is sure or time is up.

It does not stop before `LEAST_BEDS` beds: of two or three that happen to be alike, the interval is too narrow, and a
rule that stops at the first narrow one would choose those. `experiments.lawfit.synthetic` measures what is left of it.

Every bed gets the same drives, drops and a placement under the load. After each step the spring-damper is fitted. How
sure it is, is half of the 90 % interval of its force at the middle of the depth and the fastest speed, over the force.
If C is not told from 0, and is most of it, each bed gets one more drive at twice the fastest speed. Else another bed is
added. Costs are estimates made beforehand, so that the same settings lead to the same runs on every machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from experiments.converge.design import BASE, MOST_OVERLAP, ROOM, Member, Variant
from experiments.converge.members import finished_member, make_member
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.types import Json

from .data import Data
from .fit import Estimated, LawFit, fit_law, interval
from .laws import CANDIDATES
from .reading import read_folders
from .settings import LawFitSettings, say

__all__ = ["Designed", "check_design", "compute_runs", "how_sure", "middle_force", "sure_enough"]

FASTER = 2.0
"""Speed of a drive that is added, over the fastest of the settings [1]; the modulus of the grains allows for it."""
LEAST_BEDS = 4
"""Beds below which no interval is narrow enough to stop at [1]."""


@dataclass
class Designed:
    """What was computed, why, and what it told."""

    data: Data
    steps: list[Json] = field(default_factory=list)
    """For each step: why, the run folders, their cost by estimate [s], and how sure the force was after it [1]."""
    notes: list[str] = field(default_factory=list)  # Why it ended


def _base(settings: LawFitSettings) -> PenetrateSettings:
    """The runs of one bed, their grains stiff enough for the fastest drive that may be added."""
    plain = {name: getattr(settings, name) for name in PenetrateSettings.model_fields}
    plain |= {"other_speeds": settings.speeds, "other_drop_speeds": settings.drop_speeds}
    base = PenetrateSettings.model_construct(**plain)
    if base.young is None:
        fastest = base.model_copy(update={"speeds": (*base.speeds, FASTER * max(base.speeds))})
        room = min(MOST_OVERLAP, ROOM * base.max_overlap)  # one modulus for all beds: a run does not make it stiffer
        base = base.model_copy(update={"young": beds.choose_softness(fastest).young, "max_overlap": room})
    return base


def _member(base: PenetrateSettings, seed: int, *, faster: bool = False) -> Member:
    """All runs in the bed of `seed`, or only the faster drive in it."""
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
    """Raise ValueError for runs that cannot be computed, and a budget below what the first two beds cost."""
    base = _base(settings)
    penetrate.check(base)
    least = sum(_cost([_member(base, seed) for seed in _seeds(settings)[:2]]))
    budget = settings.budget or 0.0
    if least > budget:
        drives, drops = len(base.speeds), len(base.drop_speeds)
        raise ValueError(say("small_budget", budget=budget, least=least, drives=drives, drops=drops))


def _cost(members: Sequence[Member]) -> list[float]:
    return [3600 * member.core_hours for member in members]


def compute_runs(settings: LawFitSettings, folder: RunFolder, progress: Progress) -> Designed:
    """Compute runs, or find them done, until the force is sure or the budget is used up.

    Raises RuntimeError where a run fails: what was computed is kept, and resuming goes on with it.
    """
    base, seeds = _base(settings), _seeds(settings)
    home = Path(settings.members) if settings.members else folder.path / "members"
    budget, spent, fast, beds_made = settings.budget or 0.0, 0.0, False, 0
    why, todo = say("first"), [_member(base, seed) for seed in seeds[:2]]
    paths: list[Path] = []
    designed: Designed | None = None
    while True:
        costs = _cost(todo)
        if designed is not None and spent + sum(costs) > budget:
            now = designed.steps[-1]["sure"]
            said = {"now": now, "tolerance": settings.tolerance, "spent": spent, "budget": budget, "beds": beds_made}
            said["least"] = LEAST_BEDS
            designed.notes.append(say("spent", **said, more=spent + sum(costs) - budget))
            return designed
        progress.message(why)
        for member in todo:
            _make(member, home / member.folder, progress)
        spent += sum(costs)
        paths += [home / member.folder for member in todo]
        beds_made = len({member.seed for member in todo} | set(seeds[:beds_made]))
        data = read_folders([(path.name, path) for path in paths], settings)
        fitted = fit_law(CANDIDATES["spring-damper"](data.foundation), data)  # type: ignore[arg-type]
        sure, of_rate = how_sure(fitted)
        step: Json = {"why": why, "runs": [path.name for path in paths[-len(todo) :]], "cost": sum(costs), "sure": sure}
        designed = Designed(data, [*(designed.steps if designed else []), step])
        numbers = {"now": sure, "tolerance": settings.tolerance, "least": LEAST_BEDS}
        if sure_enough(sure, beds_made, settings.tolerance):
            designed.notes.append(say("told", **numbers))
            return designed
        if not fast and of_rate > 0.5 and fitted.parameter("damping").low <= 0:
            fast, why = True, say("faster", speed=FASTER * max(base.speeds))
            todo = [_member(base, seed, faster=True) for seed in seeds[:beds_made]]
            continue
        if beds_made == len(seeds):
            designed.notes.append(say("enough_beds", beds=beds_made, **numbers))
            return designed
        why, seed = say("more_beds" if sure > settings.tolerance else "least_beds", **numbers), seeds[beds_made]
        todo = [_member(base, seed), *([_member(base, seed, faster=True)] if fast else [])]


def _make(member: Member, path: Path, progress: Progress) -> None:
    if finished_member(path) is not None:
        return
    progress.stage(path.name, total=1.0)
    if (failed := make_member(member.settings, path, progress)) is not None:
        raise RuntimeError(say("member_failed", name=path.name, reason=failed))


def sure_enough(sure: float, beds: int, tolerance: float) -> bool:
    """Whether no more runs are needed."""
    return beds >= LEAST_BEDS and sure <= tolerance


def middle_force(fitted: LawFit) -> Estimated:
    """The force at half the depth and the fastest speed [N].

    Its interval is from the forces of the fits that leave out one bed each: K and C are not independent.
    """
    depth, speed = 0.5 * float(fitted.data.depth.max()), max(fitted.data.speeds)
    z, v = np.array([depth]), np.array([speed])
    forces = [float(fitted.candidate.force(theta, z, v)[0]) for theta in (fitted.theta, *fitted.left_out)]
    return interval(forces[0], np.array(forces[1:]))


def how_sure(fitted: LawFit) -> tuple[float, float]:
    """Half of the 90 % interval of `middle_force` over it, and the share that C has in its variance [1]."""
    depth, speed, found = 0.5 * float(fitted.data.depth.max()), max(fitted.data.speeds), middle_force(fitted)
    parts = [(fitted.parameter(name).std * arm) ** 2 for name, arm in (("stiffness", depth), ("damping", speed))]
    sure = 0.5 * (found.high - found.low) / found.value if found.value > 0 else float("inf")
    return sure, parts[1] / sum(parts) if sum(parts) > 0 else 0.0
