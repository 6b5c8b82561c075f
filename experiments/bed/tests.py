"""What `bed test repose`, `cone` and `cut` share: the beds, run by run; quantities with their spread; the result."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from dem import Bed
from dem.contact.timestep import choose_young
from dem.engine.state import read_file
from dem.grains.materials import Material, caveat, material
from dem.grains.packing import rain_column
from dem.grains.sizes import Uniform
from dem.prepare.bedfile import find_bed, read_preparation
from dem.prepare.prepare import bound_of_mean, check_options
from experiments.grains.bed_progress import BedProgress
from experiments.grains.kept_material import keep_material
from experiments.penetrate.fit import spread
from experiments.penetrate.given import material_of_bed
from experiments.runs.folder import RunFolder, write_text
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.stopping import held_back
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run
from rigid.checks.unfit import UnfitSettingsError

from .test_settings import BedTestSettings

__all__ = ["Tested", "bed_test", "check_bed", "of_beds", "picked", "quantity", "stiff_enough", "table", "write_frame"]

Run = Json
Settings = TypeVar("Settings", bound=BedTestSettings)
_PACKING = 0.6  # about, to reckon what lies on the floor


@dataclass(frozen=True)
class Extent:
    """Of a bed, before it is read or prepared: periods and depth, height of the surface, mean diameter [m]."""

    size: tuple[float, ...]
    surface: float
    grain: float


def check_bed(settings: BedTestSettings) -> Extent:
    """How large the bed is. Raises ValueError for no bed, one that is tilted or cut, or one that cannot be prepared."""
    if settings.bed is None:
        material(settings.material)
        check_options(settings.size, settings.grain, settings.gravity, 1, 0.05)
        return Extent(settings.size, settings.size[2], settings.grain)
    path = find_bed(settings.bed)
    stored, state, _ = read_file(path)
    if settings.material != type(settings).model_fields["material"].default:
        material_of_bed(settings.bed, stored.material, settings.material)
    reports = read_preparation(path).reports
    stages = [report.stage for report in reports]
    if stored.gravity[0] or stored.gravity[1] or any(stage.startswith("cut") for stage in stages):
        raise ValueError(f"bed = {settings.bed!r} was cut or tilted: a level one is accepted")
    position = state["position"].astype(float)
    surface = reports[-1].surface if reports else float(np.quantile(position[:, 2] + position[:, 3], 0.9))
    return Extent(stored.size, surface, 2 * float(position[:, 3].mean()))


def stiff_enough(
    stuff: Material, *, depth: float, grain: float, spread: float, gravity: float, bearing: float
) -> float:
    """Young's modulus [Pa] of grains that withstand the rain and ``bearing`` times what lies on the floor.

    Depth of the bed and mean diameter in m, spread of the diameters over their mean, gravity in m/s2.
    """
    sizes = Uniform(grain, spread)
    return choose_young(
        stuff,
        pressure=bearing * _PACKING * stuff.density * gravity * depth,
        speed=math.sqrt(2 * gravity * rain_column(sizes) * depth),
        max_overlap=bound_of_mean(sizes, 0.05),
        diameter=grain,
    )


def _beds(settings: BedTestSettings, bearing: float | None) -> Iterator[tuple[str, Callable[[Progress | None], Any]]]:
    """Name of each bed, and what makes it, anew whenever it is called, with a progress to report to."""
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
            raise UnfitSettingsError(f"the bed of seed {seed} could not be prepared: {error}") from error

    for seed in settings.seeds:
        yield f"seed{seed}", partial(prepared, seed)


class Tested(NamedTuple):
    """What the test of one bed found."""

    bed: Any  # as it lies after the test
    columns: Mapping[str, np.ndarray]  # of its series
    numbers: Json
    warnings: list[str]


def bed_test(
    command: str,
    settings_class: type[Settings],
    *,
    check: Callable[[Settings], None],
    test: Callable[[Settings, Any, Run, int, Callable[[float], None]], Tested],
    result: Callable[[Settings, list[Run]], Json],
    copies: Callable[[Settings], int] = lambda settings: 1,
    bearing: Callable[[Settings], float | None] = lambda settings: None,
) -> tuple[Callable[..., Result], Callable[..., Result]]:
    """`run` and `resume` of a test of beds: every bed is tested, unless a stopped run has; then result and report.

    `test` takes a bed, what is known of it, the number of the copy, and a function for the share done. `result` makes
    title, quantities, tables and warnings of all runs, and `files` for the folder (name -> text). `copies`: tests of
    each bed, each of a fresh copy. `bearing`: pressure of the test over what lies on the floor [1], for which the
    grains of prepared beds are made stiff enough; None: stiff enough for a tip in half the bed's depth, as
    ``Bed.prepare`` has it.
    """

    def compute(settings: Settings, folder: RunFolder, progress: Progress) -> Result:
        if settings.bed is None:
            settings = settings.model_copy(update={"material": keep_material(settings.material, folder.path)})
        beds, count = dict(_beds(settings, bearing(settings))), copies(settings)
        costs = {f"bed of {name.replace('seed', 'seed ')}": 2.0 for name in beds if settings.bed is None}
        progress.plan(costs | {f"test of {name}": float(count) for name in beds}, seconds={"report": 5.0})
        runs: list[Run] = []
        for name, make in beds.items():
            for copy in range(count):
                which = name if count == 1 else f"{name}-{copy + 1}"
                if not folder.is_done(which):
                    bed = make(None if copy else progress)
                    if not copy or progress.stage_name != f"test of {name}":
                        progress.stage(f"test of {name}", total=float(count))
                    tell = partial(lambda share, copy: progress.update(copy + share), copy=copy)
                    folder.mark_done(which, {"id": which} | one_test(settings, bed, folder, which, copy, tell))
                    bed = None  # its engine serves the next
                runs.append(folder.done_data(which))
        entries: Json = {"warnings": []} | result(settings, runs)
        for file, text in entries.pop("files", {}).items():
            write_text(folder.path / file, text)
        own = [*entries.pop("warnings"), *dict.fromkeys(w for run in runs for w in run["warnings"])]
        return Result.make(command, **entries, warnings=own, runs=runs)

    def one_test(settings: Settings, bed: Any, folder: RunFolder, which: str, copy: int, tell: Any) -> Run:
        about = _about(bed)
        if settings.max_overlap is not None:
            bed.overlap_limit = settings.max_overlap
        try:
            found = test(settings, bed, about, copy, tell)
        except ValueError as error:  # a bed whose surface lies otherwise than its depth says
            raise RuntimeError(f"{which}: {error}") from error
        series = folder.write_series(which, found.columns)
        write_frame(folder, which, found.bed)
        doubt = caveat(bed.material)
        warnings = [*found.warnings, doubt] if doubt else found.warnings
        kept = {"max_overlap": found.bed.max_overlap, "series": series, "frames": which, "warnings": warnings}
        return about | found.numbers | kept

    return computed_run(command, settings_class, compute, check=check)


def picked(found: Any, *names: str) -> Run:
    """These of what a test found, as JSON takes them."""

    def plain(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [plain(one) for one in value]
        return asdict(value) if is_dataclass(value) else value  # type: ignore[arg-type]

    return {name: plain(getattr(found, name)) for name in names}


def _about(bed: Any) -> Run:
    """What every run reports about its bed before the test."""
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


def of_beds(runs: Sequence[Run], count: str) -> Json:
    """The quantities that every test has last; `count`: which grains were counted. Copies of a bed count once."""
    beds = list({run["id"].partition("-")[0]: run for run in reversed(runs)}.values())
    return {
        "packing_fraction": quantity(beds, "packing_fraction", "1", "of the bed before"),
        "grain_count": quantity(beds, "grain_count", "1", count),
        "max_overlap": quantity(runs, "max_overlap", "1", "over diameter"),
    }


def table(title: str, rows: Iterable[Any], columns: Mapping[str, Callable[[Any], str]]) -> Json:
    """A table of a result; `columns`: heading to the text of a row."""
    return {"title": title, "head": list(columns), "rows": [[said(row) for said in columns.values()] for row in rows]}


def write_frame(folder: RunFolder, name: str, bed: Any) -> None:
    """Where the grains lie after the test, for the picture and for ParaView."""
    from vis.pictures.frames import GRAIN_FIELDS, FrameWriter

    grains = bed.grains().as_dict()
    FrameWriter(folder.path, name=name).write(0.0, {key: grains[key] for key in ("position", *GRAIN_FIELDS)})
