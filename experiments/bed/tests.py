"""What `bed test repose`, `cone` and `cut` share: the beds, run by run; quantities with their spread; the result."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from dem.grains.materials import Material, caveat
from dem.prepare.bedfile import find_bed
from experiments.grains.bed_progress import BedProgress
from experiments.grains.kept_material import keep_material
from experiments.penetrate.fit import spread
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.stopping import held_back
from experiments.runs.types import Json

from .test_settings import BedTestSettings

__all__ = ["Extent", "about", "check_bed", "carry_out", "picked", "quantity", "stiff_enough", "table", "write_frame"]

Run = Json
_PACKING = 0.6  # about, to reckon what lies on the floor


@dataclass(frozen=True)
class Extent:
    """Of a bed, before it is read or prepared: periods and depth, height of the surface, mean diameter [m]."""

    size: tuple[float, ...]
    surface: float
    grain: float


def check_bed(settings: BedTestSettings) -> Extent:
    """How large the bed is. Raises ValueError for no bed, one that is tilted or cut, or one that cannot be prepared."""
    from dem.engine.state import read_file
    from dem.grains.materials import material
    from dem.prepare.bedfile import read_preparation
    from dem.prepare.prepare import check_options

    if settings.bed is None:
        material(settings.material)
        check_options(settings.size, settings.grain, settings.gravity, 1, 0.05)
        return Extent(settings.size, settings.size[2], settings.grain)
    path = find_bed(settings.bed)
    stored, state, _ = read_file(path)
    reports = read_preparation(path).reports
    stages = [report.stage for report in reports]
    if stored.gravity[0] or stored.gravity[1] or any(stage.startswith("cut") for stage in stages):
        raise ValueError(f"bed = {settings.bed!r} was cut or tilted: a level one would do")
    position = state["position"].astype(float)
    surface = reports[-1].surface if reports else float(np.quantile(position[:, 2] + position[:, 3], 0.9))
    return Extent(stored.size, surface, 2 * float(position[:, 3].mean()))


def stiff_enough(
    stuff: Material, *, depth: float, grain: float, spread: float, gravity: float, bearing: float
) -> float:
    """Young's modulus of grains that bear the rain and ``bearing`` times what lies on the floor [Pa].

    Args:
        depth: of the bed [m]. grain, spread: mean diameter [m], and half the width of the sizes over it [1].
        gravity: [m/s2].
    """
    from dem.contact.timestep import choose_young
    from dem.grains.packing import rain_column
    from dem.grains.sizes import Uniform
    from dem.prepare.prepare import bound_of_mean

    sizes = Uniform(grain, spread)
    return choose_young(
        stuff,
        pressure=bearing * _PACKING * stuff.density * gravity * depth,
        speed=math.sqrt(2 * gravity * rain_column(sizes) * depth),
        max_overlap=bound_of_mean(sizes, 0.05),
        diameter=grain,
    )


def _beds(settings: BedTestSettings, bearing: float | None) -> Iterator[tuple[str, Callable[[Progress | None], Any]]]:
    """Name of each bed, and what makes it, anew whenever it is called; told where to show how far it is."""
    from dem import Bed
    from dem.grains.materials import material

    if settings.bed is not None:
        given = settings.bed
        yield "bed", lambda progress: Bed.load_prepared(find_bed(given), threads=settings.threads).bed
        return

    young = None
    if bearing is not None:
        young = stiff_enough(
            material(settings.material, grain=settings.grain), depth=settings.size[2], grain=settings.grain,
            spread=settings.spread, gravity=settings.gravity, bearing=bearing,
        )  # fmt: skip

    def prepared(seed: int, progress: Progress | None) -> Any:
        try:
            with held_back() as asked_to_stop:
                return Bed.prepare(
                    settings.material, size=settings.size, grain=settings.grain, spread=settings.spread,
                    packing=settings.packing, gravity=settings.gravity, seed=seed, young=young,
                    threads=settings.threads,
                    progress=progress and BedProgress(progress, f"bed of seed {seed}", asked_to_stop),
                )  # fmt: skip
        except ValueError as error:  # found while it was prepared, as a packing that cannot be reached
            raise RuntimeError(f"the bed of seed {seed} could not be prepared: {error}") from error

    for seed in settings.seeds:
        yield f"seed{seed}", partial(prepared, seed)


def carry_out(
    settings: BedTestSettings,
    folder: RunFolder,
    progress: Progress,
    *,
    test: Callable[[Any, str, Callable[[float], None]], Run],
    result: Callable[[list[Run]], Json],
    report: str,
    copies: int = 1,
    bearing: float | None = None,
) -> Result:
    """Test every bed, or take what a stopped run has finished; write result and report.

    Args:
        test: tests a bed; told the run's name and a function for the share done. What it returns is kept as JSON.
        result: makes quantities, tables and warnings of all runs.
        report: "module:function" in vis that writes the report.
        copies: tests of each bed, each of a fresh copy.
        bearing: pressure of the test over what lies on the floor [1], for which the grains of prepared beds are made
            stiff enough; None: stiff enough for a tip in half the bed's depth, as ``Bed.prepare`` has it.
    """
    with folder.lock():
        if settings.bed is None:
            settings = settings.model_copy(update={"material": keep_material(settings.material, folder.path)})
        names = [name for name, _ in _beds(settings, bearing)]
        costs = {} if settings.bed is not None else {f"bed of {name.replace('seed', 'seed ')}": 2.0 for name in names}
        progress.plan(costs | {f"test of {name}": float(copies) for name in names}, seconds={"report": 5.0})
        runs: list[Run] = []
        for name, make in _beds(settings, bearing):
            for copy in range(copies):
                which = name if copies == 1 else f"{name}-{copy + 1}"
                if folder.is_done(which):
                    runs.append(folder.done_data(which))
                    continue
                bed = make(None if copy else progress)
                if not copy or progress.stage_name != f"test of {name}":
                    progress.stage(f"test of {name}", total=float(copies))
                try:
                    found = test(bed, which, lambda share, copy=copy: progress.update(copy + share))  # type: ignore[misc]
                except ValueError as error:  # a bed whose surface lies otherwise than its depth says
                    raise RuntimeError(f"{which}: {error}") from error
                if doubt := caveat(bed.material):
                    found["warnings"] = [*found["warnings"], doubt]
                bed = None  # its engine serves the next
                folder.mark_done(which, {"id": which} | found)
                runs.append(folder.done_data(which))
        entries: Json = {"title": "", "status": "done"} | result(runs)
        entries["runs"] = runs
        entries["warnings"] = [*entries["warnings"], *dict.fromkeys(w for run in runs for w in run["warnings"])]
        whole = Result.make(folder.command, **entries)
        folder.write_result(whole)
        progress.stage("report", total=1.0)
        module, _, function = report.partition(":")
        getattr(import_module(module), function)(folder.path, progress=progress.update)
    return whole


def picked(found: Any, *names: str) -> Run:
    """These of what a test found, as JSON takes them."""

    def plain(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [plain(one) for one in value]
        return asdict(value) if is_dataclass(value) else value  # type: ignore[arg-type]

    return {name: plain(getattr(found, name)) for name in names}


def about(bed: Any) -> Run:
    """What every run says of its bed before the test."""
    return {
        "grain": 2 * float(bed.grains().radius.mean()),
        **picked(bed, "grain_count", "packing_fraction", "surface", "size"),
        "gravity": -bed.gravity[2],
        "material": bed.material.name,
        "density": bed.material.density,
        "young": bed.material.young,
        "time_step": bed.time_step,
    }


Of = str | Callable[[Run], float | None]
"""What of a run: a key, or a function."""


def quantity(runs: Sequence[Run], of: Of, unit: str, note: str, *, error: Of | None = None) -> Json:
    """An entry of quantities: mean of the runs and their standard deviation; of one run its own ``error``, if any."""

    def number(run: Run, what: Of) -> float | None:
        value = run[what] if isinstance(what, str) else what(run)
        return float(value) if value is not None and math.isfinite(value) else None

    known = {k: value for k, run in enumerate(runs) if (value := number(run, of)) is not None}
    if not known:
        return {"value": None, "std": None, "unit": unit, "note": note}
    values = list(known.values())
    std = spread(values)
    if std is not None:
        note = f"{note}; std: between {len(values)} runs"
    elif error is not None and (std := number(runs[next(iter(known))], error)) is not None:
        note = f"{note}; std: error of the one run"
    return {"value": float(np.mean(values)), "std": std, "unit": unit, "note": note}


def table(title: str, rows: Iterable[Any], columns: Mapping[str, Callable[[Any], str]]) -> Json:
    """A table of a result: by its heading, what each column says of a row."""
    return {"title": title, "head": list(columns), "rows": [[said(row) for said in columns.values()] for row in rows]}


def write_frame(folder: RunFolder, name: str, bed: Any) -> None:
    """Where the grains lie after the test, for the picture and for ParaView."""
    from vis.pictures.frames import GRAIN_FIELDS, FrameWriter

    grains = bed.grains().as_dict()
    FrameWriter(folder.path, name=name).write(0.0, {key: grains[key] for key in ("position", *GRAIN_FIELDS)})
