"""The runs of a sweep: every combination of its table's rows, its samples and its lists, each read before the first.

Samples of a Latin hypercube are those of `scipy.stats.qmc`; Saltelli's design for Sobol' indices is SALib's (Saltelli
et al., Computer Physics Communications 181, 2010, 259-270).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel
from scipy.stats import qmc

from experiments.pool.tools import required
from experiments.runs.reading import Layer, find_case, read_case, settings_from
from experiments.runs.registry import CASES, Experiment, find_experiment

from .factors import Factor, parse_fixed, parse_over, read_table
from .settings import SweepSettings

__all__ = ["Design", "Point", "design_of", "problem_of"]

MOST_RUNS = 100_000
_TOLD = 5  # Different faults that a message names
Array = NDArray[np.float64]
_Rows = Sequence[Mapping[str, object]]


@dataclass(frozen=True)
class Point:
    """One run: the values of what is varied, the number of its sample and its place among the combinations."""

    values: Mapping[str, object]
    settings: BaseModel
    sample: int
    cell: int

    @property
    def words(self) -> str:
        """Its values in words."""
        return ", ".join(f"{key} = {value}" for key, value in self.values.items())


@dataclass(frozen=True)
class Design:
    """All runs, in their order: rows of the table, within each the samples, within each the lists' combinations."""

    experiment: Experiment
    factors: tuple[Factor, ...]
    rows: int  # of the table; 1 without one
    shares: Array  # of the intervals that are sampled, shape [samples, sampled factors]
    points: tuple[Point, ...]

    @property
    def sampled(self) -> tuple[Factor, ...]:
        """The factors that are sampled."""
        return tuple(factor for factor in self.factors if factor.sampled)

    @property
    def listed(self) -> tuple[Factor, ...]:
        """The factors that have a list of values."""
        return tuple(factor for factor in self.factors if not factor.sampled)

    @property
    def keys(self) -> tuple[str, ...]:
        """Every setting that is varied."""
        return tuple(dict.fromkeys(key for point in self.points for key in point.values))


def design_of(settings: SweepSettings, *, check: bool = False) -> Design:
    """The runs of a sweep, with the settings of each read; if `check`, the experiment checks them too.

    Raises ValueError, naming run, key and value, for what is not accepted.
    """
    experiment = find_experiment(settings.experiment)
    settings_class = experiment.settings_class()
    factors = parse_over(settings.over, settings_class)
    fixed = parse_fixed(settings.fixed, settings_class)
    table: _Rows = read_table(settings.table, settings_class) if settings.table is not None else [{}]
    _check_apart(settings, factors, fixed, table)
    shares = _shares(settings, [factor for factor in factors if factor.sampled])
    base = [read_case(find_case(Path(settings.base), CASES))] if settings.base is not None else []
    listed = [factor for factor in factors if not factor.sampled]
    count = len(table) * len(shares) * math.prod(len(factor.values) for factor in listed)
    if count > MOST_RUNS:
        raise ValueError(f"over makes {count:,} runs: at most {MOST_RUNS:,} is accepted")
    cells = product(*(factor.values for factor in listed))
    layers, points = [*base, Layer("fixed", fixed)], []
    faults: dict[str, list[int]] = {}  # sentence -> the runs that it is of
    every = product(table, enumerate(shares), enumerate(cells))
    for number, (row, (sample, at), (cell, values)) in enumerate(every, 1):
        varied = _varied(factors, row, at, values)
        try:
            own = settings_from(settings_class, [*layers, Layer("over", varied)])
            if check:
                experiment.check(own)
        except ValueError as error:
            faults.setdefault(str(error), []).append(number)
        else:
            points.append(Point(varied, own, sample, cell))
    if faults:
        raise ValueError("\n".join(_fault(text, numbers, count) for text, numbers in list(faults.items())[:_TOLD]))
    return Design(experiment, factors, len(table), shares, tuple(points))


def _fault(text: str, numbers: Sequence[int], count: int) -> str:
    """A fault, with the runs that have it."""
    several = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
    return f"run {numbers[0]}{several} of {count}: {text}"


def _varied(
    factors: Sequence[Factor], row: Mapping[str, object], at: Array, values: Sequence[object]
) -> Mapping[str, object]:
    """What one run varies: the row's cells, then the factors in the order in which they are given."""
    shares, listed = iter(at.tolist()), iter(values)
    return dict(row) | {
        factor.key: float(f"{factor.at(next(shares)):.10g}") if factor.sampled else next(listed) for factor in factors
    }


def _check_apart(
    settings: SweepSettings,
    factors: Sequence[Factor],
    fixed: Mapping[str, object],
    table: _Rows,
) -> None:
    """Raise ValueError where a setting is given in two places."""
    varied, tabled = {factor.key for factor in factors}, {key for row in table for key in row}
    for first, second, both in (
        ("fixed", "over", varied & set(fixed)),
        ("fixed", f"table = {settings.table!r}", tabled & set(fixed)),
        ("over", f"table = {settings.table!r}", tabled & varied),
    ):
        if both:
            raise ValueError(f"{min(both)} is in {first} and in {second}: one of them is accepted")


def _shares(settings: SweepSettings, sampled: Sequence[Factor]) -> Array:
    """Where in their intervals the samples lie, 0 to 1, shape [samples, factors]; one row without an interval."""
    if not sampled:
        return np.zeros((1, 0))
    if settings.sampling == "latin":
        return qmc.LatinHypercube(len(sampled), seed=np.random.default_rng(settings.seed)).random(settings.samples)
    sample = required("SALib.sample.sobol", "sampling = 'sobol'")
    return sample.sample(problem_of(sampled), settings.samples, calc_second_order=False, seed=settings.seed)


def problem_of(sampled: Sequence[Factor]) -> Mapping[str, object]:
    """The sampled factors as SALib takes them, each from 0 to 1."""
    return {"num_vars": len(sampled), "names": [f.key for f in sampled], "bounds": [[0.0, 1.0]] * len(sampled)}
