"""Further runs in the bed of a finished member: other loads, unloading and reloading, sideways motion.

Each is kept as a series and a note in the folder of that member and used again with it. Such a run is short: if it is
stopped, it starts again from its beginning.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel

from coupling import BedGround
from coupling.guided import Leg, guide
from experiments.converge.costs import CORE_STEP
from experiments.penetrate import beds
from experiments.penetrate.settings import PenetrateSettings
from experiments.penetrate.units import Unit, expected_time, make_run, make_spike
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.progress import Progress
from experiments.runs.types import Json

from .cells import Cell
from .data import Array, Data, Drag, Placement, Unloading
from .fit import mean_of
from .settings import say

__all__ = ["Further", "FurtherRuns", "cost_of_further", "further_rows", "further_runs", "read_further"]

RAISED = 0.05
"""How far a tip is raised where it is unloaded, and driven on after it, over its diameter [1]."""
SLOWER = 0.25
"""Speed at which it is raised and driven down again, over the slowest speed of the drives [1]."""
_NOTE = "further-"


@dataclass(frozen=True)
class Further:
    """One further run."""

    kind: Literal["placement", "unloading", "drag"]
    value: float  # Load [N], or depth [m]

    @property
    def id(self) -> str:
        """Its name in the folder."""
        return f"{_NOTE}{self.kind}-{self.value:g}"

    @property
    def file(self) -> str:
        """Its series, below that folder."""
        return f"series/{self.id}.csv"


def further_runs(cell: Cell) -> list[Further]:
    """The further runs of each bed of a cell, without the load of the member itself."""
    loads = [Further("placement", load) for load in cell.loads if load != cell.base.weight]
    unloaded = [Further("unloading", depth) for depth in cell.unload_depths]
    return [*loads, *unloaded, *(Further("drag", depth) for depth in cell.drag_depths)]


def cost_of_further(cell: Cell) -> float:
    """Their estimated cost in one bed [s of one core]."""
    base, slow = cell.base, min(cell.base.speeds)
    step, stiffness = beds.bed_step(base, beds.choose_softness(base).young), beds.expected_stiffness(base)
    total = 0.0
    for one in further_runs(cell):
        if one.kind == "placement":
            under = base.model_copy(update={"load": one.value})
            total += expected_time(under, Unit(1, "set_down", base.lowering_speed), stiffness)
        else:
            legs = _legs(base, one, slow)
            total += sum(leg.length / leg.speed for leg in legs)
    return CORE_STEP * base.grain_count * total / step


def _legs(base: PenetrateSettings, one: Further, speed: float) -> list[Leg]:
    raised = RAISED * base.tip_diameter
    if one.kind == "drag":
        return [Leg(speed, down=one.value), Leg(speed, along=base.tip_diameter)]
    slow = SLOWER * speed
    return [Leg(speed, down=one.value), Leg(slow, down=-raised), Leg(slow, down=raised), Leg(speed, down=raised)]


@dataclass(frozen=True)
class FurtherRuns:
    """The further runs of one bed, as what comes after the run of its member (`experiments.pool.tasks.After`)."""

    runs: tuple[Further, ...]
    share: float  # Of the cost of member and further runs [1]

    @property
    def files(self) -> list[str]:
        """Their series, below the folder of the member."""
        return [one.file for one in self.runs]

    def missing(self, path: Path) -> bool:
        """Whether one of them is not yet in the folder of the member."""
        return bool(self._todo(path))

    def _todo(self, path: Path) -> list[Further]:
        try:
            folder = RunFolder.open(path)
        except (OSError, ValueError):
            return list(self.runs)
        return [one for one in self.runs if not folder.is_done(one.id)]

    def make(self, settings: BaseModel, path: Path, tell: Callable[[float], None], progress: Progress) -> None:
        """Make the missing runs in the bed of the member. Raises RuntimeError if one fails."""
        assert isinstance(settings, PenetrateSettings)
        folder, todo, seed = RunFolder.open(path), self._todo(path), settings.seeds[0]
        bed = beds.prepare_bed(settings, seed, beds.choose_softness(settings).young, progress)
        bed.overlap_limit = beds.overlap_bound(settings)
        spike = make_spike(settings)
        ground = BedGround(bed, spike)
        start = ground.state()
        for number, one in enumerate(todo):
            ground.restore(start)
            bed.max_overlap = 0.0
            progress.stage(f"{path.name}: {one.kind} at {one.value:g}", total=1.0)
            if one.kind == "placement":
                under = settings.model_copy(update={"load": one.value})
                run = make_run(under, Unit(seed, "set_down", settings.lowering_speed), ground).run()
                columns = run.columns()
                found: Json = {"load": one.value, "depth": run.resting_depth}
            else:
                legs = _legs(settings, one, min(settings.speeds))
                columns = guide(spike, ground, legs, substeps=settings.substeps, on_step=progress.update)
                found = _dragged(columns, one.value) if one.kind == "drag" else _unloaded(columns, one.value)
            write_series(path / one.file, columns)  # the member's other digests stay
            folder.mark_done(one.id, found)
            tell((number + 1) / len(todo))


def _unloaded(columns: dict[str, Array], depth: float) -> Json:
    """Numbers of a run that was raised and driven down again; see `Unloading`."""
    leg, at, force = (columns[name] for name in ("leg", "depth_m", "force_N"))
    out, on = leg == 1, leg == 3
    before = at[leg == 0] > depth * (1 - RAISED)
    peak = float(force[leg == 0][before].mean())
    falling, left = np.minimum.accumulate(force[out]), 0.2 * peak
    bare = float(np.interp(left, falling[::-1], at[out][::-1]))
    return {
        "depth": depth, "force": peak, "stiffness": (falling[0] - left) / max(at[out][0] - bare, 1e-12),
        "returned": _work(at[out], force[out]) / _work(at[leg == 0], force[leg == 0]),
        "again": float(force[on].mean()) / peak,
    }  # fmt: skip


def _work(depth: Array, force: Array) -> float:
    """Work over a part of the run at constant speed [J]."""
    return abs(float(np.sum(force) * (depth[-1] - depth[0]) / max(len(depth) - 1, 1)))


def _dragged(columns: dict[str, Array], depth: float) -> Json:
    """Numbers of a run sideways, means over the second half of the way; see `Drag`."""
    late = (columns["leg"] == 1) & (columns["along_m"] > 0.5 * columns["along_m"].max())
    down = (columns["leg"] == 0) & (columns["depth_m"] > depth * (1 - RAISED))
    side, up, before = (
        float(columns[name][rows].mean())
        for name, rows in (("side_force_N", late), ("force_N", late), ("force_N", down))
    )
    return {"depth": depth, "side": side, "up": up, "before": before}


def read_further(folder: RunFolder, bed: str) -> Iterator[Placement | Unloading | Drag]:
    """Results of the further runs in a member's folder, without those that did not come to rest."""
    for path in sorted((folder.path / "checkpoint").glob(f"{_NOTE}*.done.json")):
        name = path.name.removesuffix(".done.json")
        found, kind = folder.done_data(name), name.removeprefix(_NOTE).partition("-")[0]
        if kind == "unloading":
            yield Unloading(bed=bed, **found)
        elif kind == "drag":
            yield Drag(bed=bed, **found)
        elif (found["depth"] or 0.0) > 0:
            yield Placement(bed, **found)


def further_rows(cells: Mapping[str, Data]) -> Json:
    """Head and rows of the table of further runs, means over beds with 90 % intervals; no rows where there are none."""
    rows: list[list[str]] = []
    for name, data in cells.items():
        before = [name] if len(cells) > 1 else []
        for load in sorted({place.load for place in data.placements}):
            depths = [1e3 * place.depth for place in data.placements if place.load == load]
            rows.append([*before, say("row_load", load=load), *_mean(depths, "row_sinkage")])
        for depth in sorted({one.depth for one in data.unloadings}):
            own = [one for one in data.unloadings if one.depth == depth]
            what = [*before, say("row_unloading", mm=1e3 * depth)]
            for key, values in (
                ("row_stiffness", [one.stiffness / (one.force / one.depth) for one in own]),
                ("row_returned", [100 * one.returned for one in own]), ("row_again", [one.again for one in own]),
            ):  # fmt: skip
                rows.append([*what, *_mean(values, key)])
        for depth in sorted({one.depth for one in data.drags}):
            drags, what = [one for one in data.drags if one.depth == depth], [*before, say("row_drag", mm=1e3 * depth)]
            rows.append([*what, *_mean([one.side for one in drags], "row_side")])
            rows.append([*what, *_mean([one.side / one.up for one in drags if one.up > 0], "row_ratio")])
            rows.append([*what, *_mean([one.up / one.before for one in drags if one.before > 0], "row_up")])
    rows = rows if any(data.unloadings or data.drags or _several_loads(data) for data in cells.values()) else []
    head = [*(["head_cell"] if len(cells) > 1 else []), "head_what", "head_found", "head_count"]
    return {"head": [say(key) for key in head], "rows": rows}


def _several_loads(data: Data) -> bool:
    return len({place.load for place in data.placements}) > 1


def _mean(values: Sequence[float], key: str) -> list[str]:
    """The sentence `key` with the mean of `values` and its interval, and how many beds there are."""
    if len(values) < 2:
        return [say(key, found=f"{values[0]:.3g}" if values else "-"), str(len(values))]
    found = mean_of(np.asarray(values, dtype=float))
    return [say(key, found=f"{found.value:.3g} ({found.low:.3g} to {found.high:.3g})"), str(len(values))]
