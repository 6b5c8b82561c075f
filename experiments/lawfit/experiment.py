"""`hedgebed calibrate RUN ...`: laws fitted to finished runs, compared, and written as ground files.

result.json has the numbers, and series/bins.csv the fitted rows with the force of each law. ground.toml has the
spring-damper, and laws/NAME.toml every law that can be a ground. With several tips or gravities these are of the first,
and cells/NAME has the same of each.
"""

from dataclasses import asdict
from pathlib import Path

from experiments.grains.kept_material import MATERIAL_COPY, keep_material
from experiments.platform.surfaces import surface_of_grains
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json
from experiments.runs.whole_runs import publish, whole_run

from .crossed import crossed_result
from .design import check_design, compute_runs
from .export import export_cell, export_crossed
from .further import further_rows
from .one_cell import OneCell, fit_cell
from .reading import read_cells
from .settings import LawFitSettings, say
from .words import beyond_rows, cell_rows, law_rows

__all__ = ["check", "resume", "run"]


def check(settings: LawFitSettings) -> None:
    """Raise ValueError for runs that cannot be read, be fitted together or be computed within the budget."""
    if settings.runs:
        read_cells(settings)
    else:
        check_design(settings)


def _compute(settings: LawFitSettings, folder: RunFolder, progress: Progress) -> Result:
    designed = None if settings.runs else compute_runs(_with_material(settings, folder), folder, progress)
    runs = read_cells(settings) if designed is None else designed.cells
    cells = [fit_cell(settings, name, data, progress) for name, data in runs.items()]
    first, several = cells[0], len(cells) > 1
    first.write(folder.path)
    folder.write_series("bins", first.columns())
    for cell in cells if several else ():
        cell.write(folder.path / "cells" / cell.name)
        folder.write_series(f"bins-{cell.name}", cell.columns())
    crossed = crossed_result(runs, progress) if several else None
    laws = {cell.name: cell.laws for cell in cells}
    target = Path(settings.export) if settings.export else folder.path / "export"
    if crossed is None:
        export_cell(first.exported, first.laws, target)
    else:
        export_crossed(crossed.best, crossed.laws, runs, target)
        folder.write_series("crossed", crossed.columns())
    tables = [{"title": say("table_laws"), **law_rows(first.laws)}, *_more_tables(cells)]
    warnings = [*(designed.notes if designed else []), *_named(cells, "warnings")]
    sentences = _named(cells, "sentences")
    entries: Json = {}
    if crossed is not None:
        tables = [{"title": say("table_cells"), **cell_rows(laws)}, *crossed.tables, *tables[1:]]
        sentences, warnings = [*crossed.sentences, *sentences], [*crossed.warnings, *warnings]
        entries = {"crossed": crossed.laws, "crossed_tangents": crossed.tangents}
        entries["cells"] = [{"name": cell.name, **_entries(cell), "quantities": cell.quantities} for cell in cells]
    return Result.make(
        "calibrate",
        title=_title(cells),
        quantities=_quantities(cells),
        departures={"sentences": sentences},
        **_entries(first),
        **entries,
        sources=[source for cell in cells for source in cell.data.sources],
        design=[] if designed is None else designed.steps,
        tables=tables,
        surface=surface_of_grains(first.data.foundation.material),
        warnings=list(dict.fromkeys(warnings)),
    )  # fmt: skip


def _quantities(cells: list[OneCell]) -> dict[str, Json]:
    """The numbers to quote: all of them for one cell; K, C and the error of each for several."""
    if len(cells) == 1:
        return cells[0].quantities
    names = ("stiffness", "damping", "held_out_error")
    return {f"{name}@{cell.name}": cell.quantities[name] for name in names for cell in cells}


def _entries(cell: OneCell) -> Json:
    """The entries of one cell in result.json."""
    data = cell.data
    return {
        "foundation": asdict(data.foundation), "best": cell.best, "laws": cell.laws,
        "placements": [asdict(place) for place in data.placements],
        "unloadings": [asdict(one) for one in data.unloadings], "drags": [asdict(one) for one in data.drags],
        "tangents": cell.tangents, "contributions": cell.contributions,
    }  # fmt: skip


def _more_tables(cells: list[OneCell]) -> list[Json]:
    """Tables of errors beyond the fitted range and of further runs, if there are any."""
    beyond = beyond_rows({cell.name: cell.laws for cell in cells})
    further = further_rows({cell.name: cell.data for cell in cells})
    found = [{"title": say("table_beyond"), **beyond}, {"title": say("table_further"), **further}]
    return [one for one in found if one["rows"]]


def _named(cells: list[OneCell], what: str) -> list[str]:
    """The sentences of all cells, each with the name of its cell if there are several."""
    before = {cell.name: f"{cell.name}: " if len(cells) > 1 else "" for cell in cells}
    return [f"{before[cell.name]}{text}" for cell in cells for text in getattr(cell, what)]


def _title(cells: list[OneCell]) -> str:
    of = cells[0].data.foundation
    if len(cells) > 1:
        return say("title_crossed", f=of, count=len(cells))
    return say("title", f=of, mm=1e3 * of.diameter)


def _with_material(settings: LawFitSettings, folder: RunFolder) -> LawFitSettings:
    """`settings` whose material, if it is a file, is the copy in the folder."""
    return settings.model_copy(update={"material": keep_material(settings.material, folder.path)})


def _carry_out(settings: LawFitSettings, folder: RunFolder, progress: Progress) -> Result:
    with folder.lock():
        return publish(folder, _compute(settings, folder, progress), progress)


run, resume = whole_run(
    "calibrate", LawFitSettings, _carry_out, check=check, material_copy=MATERIAL_COPY, as_given=False
)  # fmt: skip
