"""What a sweep comes to: one table of all runs as CSV and netCDF, the spread of each quantity, and sensitivities.

Sensitivities are shares of the variance. Saltelli's design has Sobol' indices, first order and total (Saltelli and
others, Computer Physics Communications 181, 2010, 259-270). A Latin hypercube has the first order alone, by RBD-FAST
(Tarantola, Gatelli and Mara, Reliability Engineering and System Safety 91, 2006, 717-727). Both are SALib's. Each
sample counts by its mean over the lists that it is combined with.
"""

import itertools
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from experiments.pool.tasks import Outcome, Task
from experiments.pool.tools import required
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.result import Result, Table, quantity
from rigid.series import replacing
from vis.page.numbers import column as in_one_unit
from vis.page.sentences import label_of

from .design import Design, problem_of
from .factors import unit_of, words_of
from .members import KIND_OF_INTERVAL, ends_of, warnings_of
from .settings import SweepSettings

__all__ = ["FEWEST_SAMPLES", "conclude", "shared_title"]

FEWEST_SAMPLES = 64
"""Of a Latin hypercube, below which RBD-FAST has no confidence interval [1]."""
FEW = 8
"""Runs up to which each has a column in the table that is shown [1]."""
_INDICES = {"first": "S1", "first_conf": "S1_conf", "total": "ST", "total_conf": "ST_conf"}
"""Names in result.json -> those of SALib."""
ENDS = ("_low95", "_high95")
"""What the names of both ends of a 95 % interval have at their end, in table.csv and table.nc."""
Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Column:
    """One quantity of all runs, NaN where a run has none."""

    name: str
    unit: str
    values: Array
    stds: Array
    ends: Array = field(default_factory=lambda: np.empty((0, 2)))
    """Of 95 % intervals, shape [runs, 2]; NaN where a run does not know its own."""

    @property
    def there(self) -> bool:
        """Whether any run has it."""
        return bool(np.isfinite(self.values).any())

    @property
    def has_ends(self) -> bool:
        """Whether any run knows its 95 % interval."""
        return bool(np.isfinite(self.ends).any())

    @property
    def head(self) -> str:
        """Its name in table.csv, the unit at its end."""
        unit = self.unit.replace("/", "_").replace(" ", "_")
        return self.name if self.unit == "1" or not unit else f"{self.name}_{unit}"

    @property
    def varies(self) -> bool:
        """Whether it is not the same in all runs that have it."""
        there = self.values[np.isfinite(self.values)]
        return there.size > 1 and bool(there.max() > there.min())


def conclude(
    settings: SweepSettings, design: Design, tasks: Sequence[Task], outcomes: Mapping[str, Outcome], folder: RunFolder
) -> Result:
    """The result of a sweep whose runs are over; writes table.csv and, where xarray is there, table.nc."""
    columns, warnings = _columns(tasks, outcomes), []
    faults = [outcomes[task.name].fault for task in tasks]
    wanted = settings.quantities or tuple(column.name for column in columns if column.varies)
    for name in set(wanted) - {column.name for column in columns}:
        warnings.append(f"no run has a quantity {name!r}, which is asked for in quantities")
    drawn = [column for column in columns if column.name in wanted]
    _write_table(design, tasks, faults, columns, folder)
    try:
        _write_netcdf(design, tasks, columns, folder)
    except ValueError as error:
        warnings.append(f"there is no table.nc: {error}")
    sensitive, left_out = _sensitivities(settings, design, drawn)
    warnings += left_out
    failed = sum(bool(fault) for fault in faults)
    if failed:
        warnings.append(f"{failed} of {len(tasks)} runs failed: table.csv says why, and plots leave them out")
    warnings += warnings_of([json.loads(outcomes[task.name].result) for task in tasks if outcomes[task.name].result])
    own = design.experiment.settings_class()
    title = f"{len(tasks)} runs of {settings.experiment} over {', '.join(words_of(key, own) for key in design.keys)}"
    return Result.make(
        "sweep", title=title,
        quantities={"runs": quantity(len(tasks), "1"), "failed": quantity(failed, "1")},
        tables=[_each_run(design, columns) if len(tasks) <= FEW else _spreads(columns),
                *([_sensitivity_table(sensitive, own)] if sensitive else [])],
        of=settings.experiment, each=shared_title(one.result for one in outcomes.values()), factors=[
            {"key": key, "unit": unit_of(key, own), "words": words_of(key, own)} for key in design.keys
        ],
        columns=[
            {"name": one.name, "unit": one.unit, "head": one.head, "words": label_of(one.name),
             **({"ends": [f"{one.head}{end}" for end in ENDS]} if one.has_ends else {})}
            for one in drawn
        ],
        sensitivities=sensitive, warnings=warnings,
    )  # fmt: skip


def shared_title(results: Iterable[str]) -> str:
    """What all runs of a sweep are, such as "A tumble on brick: free at 1 m/s2": the parts up to a colon or comma that
    titles share. Only those before the first that differs where it is the very first, or numbers of parts differ.

    ``results``: Text of each run's result.json; an empty one is of a run that failed.
    """
    titles = [re.split(r"(?<=[:,]) ", str(json.loads(text).get("title", ""))) for text in results if text]
    same = [(part[0], len(set(part)) == 1) for part in zip(*titles, strict=False)]
    if len({len(title) for title in titles}) > 1 or not (same and same[0][1]):
        same = list(itertools.takewhile(lambda part: part[1], same))
    shared = [words for words, alike in same if alike]
    return " ".join(shared).rstrip(":,")


def _columns(tasks: Sequence[Task], outcomes: Mapping[str, Outcome]) -> list[_Column]:
    """Every quantity of the runs, in the order in which they are met."""
    results = [json.loads(outcomes[task.name].result or "{}") for task in tasks]
    found, known = [one.get("quantities", {}) for one in results], [ends_of(one) for one in results]
    units = {name: str(entry["unit"]) for entries in found for name, entry in entries.items()}

    def numbers(name: str, key: str) -> Array:
        entries = [entries.get(name, {}).get(key) for entries in found]
        return np.array([math.nan if entry is None else float(entry) for entry in entries])

    def ends(name: str) -> Array:
        return np.array([ends.get(name, (math.nan, math.nan)) for ends in known], dtype=float).reshape(-1, 2)

    return [_Column(name, unit, numbers(name, "value"), numbers(name, "std"), ends(name))
            for name, unit in units.items()]  # fmt: skip


def _write_table(
    design: Design, tasks: Sequence[Task], faults: Sequence[str], columns: Sequence[_Column], folder: RunFolder
) -> None:
    """table.csv: a row for each run, what is varied before what came out; spreads where a quantity has one."""
    table: dict[str, object] = {"run": [task.name for task in tasks]}
    for key in design.keys:
        table[key] = _plain([point.values.get(key, "") for point in design.points])
    for column in columns:
        table[f"{column.head}" if column.head not in table else f"{column.head}_result"] = column.values
        if (column.stds > 0).any():
            table[f"{column.head}_std"] = column.stds
        if column.has_ends:
            table |= {f"{column.head}{end}": column.ends[:, place] for place, end in enumerate(ENDS)}
    if any(faults):
        table["fault"] = faults
    write_series(folder.path / "table.csv", table)


def _plain(values: Sequence[object]) -> list[object]:
    """Numbers as they are; where there is anything else, all as text."""
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    return list(values) if numbers else [str(value) for value in values]


def _write_netcdf(design: Design, tasks: Sequence[Task], columns: Sequence[_Column], folder: RunFolder) -> None:
    """table.nc: the same; an axis for each setting where all combinations of lists are there, else one of runs.

    Raises ValueError where xarray or netCDF4 is not there.
    """
    xarray = required("xarray", "table.nc")
    required("netCDF4", "table.nc")
    units = {key: unit_of(key, design.experiment.settings_class()) for key in design.keys}
    in_full = not design.sampled and design.rows == 1 and len(design.listed) == len(design.keys)
    if in_full:
        shape = {factor.key: len(factor.values) for factor in design.listed}
        coords = {f.key: (f.key, np.array(_plain(f.values)), {"units": units[f.key]}) for f in design.listed}
    else:
        shape = {"run": len(tasks)}
        varied = {key: _plain([point.values.get(key, "") for point in design.points]) for key in design.keys}
        coords = {key: ("run", np.array(values), {"units": units[key]}) for key, values in varied.items()}
    dims, sizes = tuple(shape), tuple(shape.values())
    data: dict[str, tuple[object, ...]] = {"run_folder": (dims, np.array([task.name for task in tasks]).reshape(sizes))}
    for column in columns:
        data[column.name if column.name not in coords else f"{column.name}_result"] = (
            dims, column.values.reshape(sizes), {"units": column.unit},
        )  # fmt: skip
        if column.has_ends:
            data |= {f"{column.name}{end}": (dims, column.ends[:, place].reshape(sizes), {"units": column.unit})
                     for place, end in enumerate(ENDS)}  # fmt: skip
    attributes = {"title": f"hedgebed sweep of {design.experiment.name}"}
    with replacing(folder.path / "table.nc") as temporary:
        try:
            xarray.Dataset(data, coords, attributes).to_netcdf(temporary, engine="netcdf4")
        except RuntimeError as error:  # of HDF5, as on a full disk
            raise OSError(None, str(error), str(folder.path / "table.nc")) from error


def _each_run(design: Design, columns: Sequence[_Column]) -> Table:
    """A column for each run: what is varied, then what came out."""
    settings_class = design.experiment.settings_class()
    varied = [
        [
            words_of(key, settings_class),
            *_typed(unit_of(key, settings_class), [one.values.get(key) for one in design.points]),
        ]
        for key in design.keys
    ]
    rows = []
    for column in filter(lambda one: one.there, columns):
        rows.append([label_of(column.name), *_cells(column.unit, column.values)])
        if column.has_ends:
            rows.append([f"{label_of(column.name)}: {KIND_OF_INTERVAL[design.experiment.name]}", *_ends(column)])
    numbers = [str(place + 1) for place in range(len(design.points))]
    return Table(
        title="Each run, in the order of table.csv", head=["quantity", "unit", *numbers], rows=[*varied, *rows]
    )


def _spreads(columns: Sequence[_Column]) -> Table:
    """Least, median and largest of each quantity over all runs."""
    rows = []
    for column in filter(lambda one: one.there, columns):
        there = column.values[np.isfinite(column.values)]
        three = np.array([np.min(there), np.median(there), np.max(there)])
        rows.append([label_of(column.name), *_cells(column.unit, three)])
    return Table(title="Over all runs", head=["quantity", "unit", "least", "median", "largest"], rows=rows)


def _typed(unit: str, values: Sequence[object]) -> list[str]:
    """The unit and the values of a setting: numbers as those of quantities, other values as they were given."""
    numbers = [float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    if len(numbers) == len(values):
        return _cells(unit, np.array(numbers), exact=True)
    return [unit, *("" if value is None else str(value) for value in values)]


def _cells(unit: str, values: Array, *, exact: bool = False) -> list[str]:
    """The unit and numbers of a table for reading, as in other reports: lengths in mm, angles in degrees."""
    shown, numbers = in_one_unit(values.tolist(), unit or "1", significant=6 if exact else 4, exact=exact)
    return [shown, *numbers]


def _ends(column: _Column) -> list[str]:
    """The unit and both ends of each interval, such as "1.6 to 6.4"; a dash where there is none."""
    shown, cells = in_one_unit(column.ends.ravel().tolist(), column.unit or "1", significant=2)
    return [
        shown,
        *(low if low == high else f"{low} to {high}" for low, high in zip(cells[::2], cells[1::2], strict=True)),
    ]


def _sensitivities(
    settings: SweepSettings, design: Design, columns: Sequence[_Column]
) -> tuple[list[Mapping[str, object]], list[str]]:
    """For each quantity and sampled setting its share of the variance; and why there are none, where there are none."""
    if not design.sampled:
        return [], []
    if design.rows > 1:
        return [], ["sensitivities are not computed beside a table of several rows"]
    if settings.sampling == "latin" and settings.samples < FEWEST_SAMPLES:
        return [], [f"samples = {settings.samples} are too few for sensitivities: {FEWEST_SAMPLES} are needed"]
    found: list[Mapping[str, object]] = []
    warnings, problem = [], problem_of(design.sampled)
    if settings.samples < FEWEST_SAMPLES:
        warnings.append(
            f"samples = {settings.samples} are few for Sobol' indices, which may lie outside 0 to 1: "
            f"use {FEWEST_SAMPLES} or more"
        )
    for column in columns:
        means = column.values.reshape(len(design.shares), -1).mean(axis=1)
        whole = np.isfinite(means)
        if whole.any() and np.ptp(means[whole]) == 0.0:
            continue  # nothing of it hangs on what is sampled
        if settings.sampling == "latin" and whole.sum() >= FEWEST_SAMPLES:
            analysis = required("SALib.analyze.rbd_fast", "sampling")
            indices = analysis.analyze(problem, design.shares[whole], means[whole], seed=settings.seed)
        elif settings.sampling == "sobol" and whole.all():
            analysis = required("SALib.analyze.sobol", "sampling")
            # Standardised: the estimator of the first order loses digits to a mean far from 0.
            scaled = (means - means.mean()) / (means.std() or 1.0)
            indices = analysis.analyze(problem, scaled, calc_second_order=False, seed=settings.seed)
        else:
            missing = int((~whole).sum())
            warnings.append(f"{missing} samples have no {column.name}: its sensitivities are left out")
            continue
        found += [
            {"quantity": column.name, "key": factor.key}
            | {name: float(indices[key][place]) if key in indices else None for name, key in _INDICES.items()}
            for place, factor in enumerate(design.sampled)
        ]
    return found, warnings


def _sensitivity_table(sensitive: Sequence[Mapping[str, object]], settings_class: type[BaseModel]) -> Table:
    def cell(entry: Mapping[str, object], name: str) -> str:
        value, conf = entry[name], entry[f"{name}_conf"]
        return "-" if value is None else f"{value:.2f} ± {conf:.2f}"

    rows = [
        [label_of(str(e["quantity"])), words_of(str(e["key"]), settings_class), cell(e, "first"), cell(e, "total")]
        for e in sensitive
    ]
    head = ["quantity", "setting", "first order", "total"]
    return Table(title="Share of the variance [1], ± 95 % of its estimate", head=head, rows=rows)
