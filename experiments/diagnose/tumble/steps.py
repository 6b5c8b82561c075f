"""What the fits of tumbles are made of: whitening, coordinates, normal equations, steps to try."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from experiments.diagnose.fit.problem import Array, Form, Parameter

from .data import TrialData

__all__ = [
    "LOST",
    "ZERO_STD",
    "Answers",
    "Linearised",
    "Point",
    "Space",
    "Start",
    "Way",
    "is_flat",
    "normal_equations",
    "steps_to_try",
    "whiten",
]

ZERO_STD = 3.0 / np.sqrt(3.0)
"""Std of the camera's zero over the sensor's: it may be off by up to 3 of them, evenly (docs/diagnose.md)."""
LOST = 1e3  # residual where the model cannot stand or run [1]
TRIES = ((0.0, 1.0), (0.0, 0.4), (1e-2, 1.0), (1.0, 1.0), (30.0, 1.0))
"""Steps that are tried at once: damping on the diagonal of the normal matrix, and length."""
EASY = 3  # how many of them are as good as undamped
SETTLED = 0.05  # A step that gains less than this in chi-square ends a fit

Point = tuple[Mapping[str, float], Array]
"""Values of shared numbers, effects' parameters and what else is a trial's own, and each trial's gravity over its
stated one."""
Answers = list[Array]  # whitened residuals, one array [point_count, sample_count] a trial


def whiten(trial: TrialData, value: Array, *, until: float = np.inf) -> Array:
    """(measured - value) / std with the camera's zero marginalised, shape [set_count, sample_count].

    With the zero's covariance s^2 1 1' beside unit noise, C^(-1/2) takes the share 1 - 1 / sqrt(1 + n s^2) of the mean.
    Samples after `until` [s] count for nothing: 0.
    """
    residual = (trial.value - value) / trial.std
    lost = ~np.isfinite(residual).all(axis=1)
    seen = trial.time <= until
    for name in ("x", "y", "theta"):
        mine = np.flatnonzero(trial.of(name))
        count = int(seen[mine].sum())
        if count:
            share = 1 - 1 / np.sqrt(1 + count * ZERO_STD**2)
            own = slice(mine[0], mine[0] + count)  # a channel's samples lie in the order of their times
            residual[:, own] -= share * residual[:, own].mean(axis=1, keepdims=True)
    residual[lost] = LOST
    residual[:, ~seen] = 0.0
    return residual


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where a fit begins, and what it may change."""

    forms: tuple[Form, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    """Shared numbers and effects' parameters; what is left out has its nominal value."""
    gravity: Array | None = None  # each trial's over its stated one, shape [trial_count]; None: 1
    frozen: frozenset[str] = frozenset()  # shared names that stay
    apart: tuple[Parameter, ...] = ()
    """Further numbers of single trials that are fitted: what differs between replicates."""
    scan: bool = False  # whether to scan each trial's gravity before the first step
    horizons: tuple[float, ...] = (1.0,)
    """Shares of a trial's time that are fitted, one after another; the last is 1. What happens early is smooth in the
    parameters and tells most of them, so that later contacts are met on the right branch."""


@dataclass(frozen=True)
class Space:
    """What one fit moves, in scaled coordinates: shared first, then gravities, then what else is each trial's own, kind
    by kind."""

    names: tuple[str, ...]
    value: Array
    scale: Array
    std: Array
    low: Array
    high: Array
    step: Array
    gravities: int
    trials: int
    kinds: int = 0  # of further numbers that each trial has of its own

    @property
    def shared(self) -> int:
        """How many are shared."""
        return len(self.names) - self.gravities - self.kinds * self.trials

    def blocks(self) -> list[slice]:
        """Where the numbers of each kind stand that every trial has of its own: gravity, then the others."""
        edges = range(self.shared, len(self.names) + 1, max(1, self.trials))
        return [slice(low, high) for low, high in itertools.pairwise(edges)]

    def touching(self, trial: int) -> list[int]:
        """Places of all that changes one trial: what is shared, and its own."""
        return [*range(self.shared), *(block.start + trial for block in self.blocks())]


@dataclass(frozen=True)
class Linearised:
    """A model linearised about a point: residuals, Jacobian in scaled coordinates, and what a refit would take out."""

    residuals: list[Array]
    jacobian: list[Array]
    normal: Array
    slope: Array
    space: Space

    def promise(self, other: list[Array]) -> tuple[float, float]:
        """What chi-square would lose if the change from these residuals to `other` were free in size, and that size.

        The parameters are refitted to first order as well, priors included.
        """
        change = [b - a for a, b in zip(self.residuals, other, strict=True)]
        cross = np.zeros(len(self.slope))
        for k, (rows, c) in enumerate(zip(self.jacobian, change, strict=True)):
            cross[self.space.touching(k)] += rows @ c
        solved = np.linalg.solve(self.normal, np.column_stack([cross, self.slope]))
        size = float(sum(c @ c for c in change) - cross @ solved[:, 0])
        along = float(sum(c @ r for c, r in zip(change, self.residuals, strict=True)) - cross @ solved[:, 1])
        if size <= 0:
            return 0.0, 0.0
        return (along**2 / size if along < 0 else 0.0), -along / size


class Way:
    """Between scaled coordinates and what the model takes."""

    def __init__(self, space: Space, start: Start, trials: Sequence[int], count: int, sigma_gravity: float) -> None:
        self.space, self.fixed, self.trials, self.sigma_gravity = space, dict(start.values), list(trials), sigma_gravity
        self.gravity = np.ones(count) if start.gravity is None else np.array(start.gravity, dtype=float)

    def begin(self) -> Array:
        """Where it starts, within the bounds."""
        space = self.space
        named = zip(space.names, space.value, space.scale, strict=True)
        u = np.array([(self.fixed.get(name, value) - value) / scale for name, value, scale in named])
        if space.gravities:
            u[space.blocks()[0]] = (self.gravity[self.trials] - 1) / self.sigma_gravity
        return np.clip(u, space.low, space.high)

    def point(self, u: Array) -> Point:
        """(values, gravity)"""
        space, shared = self.space, self.space.shared
        actual = space.value + space.scale * u
        gravity = self.gravity.copy()
        if space.gravities:
            gravity[self.trials] = actual[space.blocks()[0]]
        told = np.r_[:shared, shared + space.gravities : len(u)]
        return self.fixed | {space.names[k]: float(actual[k]) for k in told}, gravity

    def price(self, answer: Answers, row: int, u: Array) -> float:
        """Chi-square and the priors'."""
        return float(sum(r[row] @ r[row] for r in answer) + np.sum((u / self.space.std) ** 2))


def normal_equations(jacobian: list[Array], residuals: list[Array], u: Array, space: Space) -> tuple[Array, Array]:
    """Normal matrix and half the gradient, priors included."""
    normal = np.diag(space.std**-2.0)
    slope = u / space.std**2
    for k, (rows, residual) in enumerate(zip(jacobian, residuals, strict=True)):
        own = space.touching(k)
        normal[np.ix_(own, own)] += rows @ rows.T
        slope[own] += rows @ residual
    return normal, slope


def steps_to_try(normal: Array, slope: Array, u: Array, space: Space, damping: float) -> list[Array]:
    """Steps to try: several dampings and lengths, held within bounds."""
    tried = []
    diagonal = np.diag(normal).copy()
    diagonal[diagonal <= 0] = 1.0
    for add, length in TRIES:
        free = ~(((u <= space.low) & (slope > 0)) | ((u >= space.high) & (slope < 0)))
        step = np.zeros_like(u)
        for _ in range(2):  # once more without those that run into a bound at once
            where = np.flatnonzero(free)
            if not len(where):
                break
            matrix = normal[np.ix_(where, where)] + np.diag((add + damping) * diagonal[where])
            step = np.zeros_like(u)
            step[where] = -np.linalg.lstsq(matrix, slope[where], rcond=1e-12)[0]
            blocked = ((u <= space.low) & (step < 0)) | ((u >= space.high) & (step > 0))
            if not (blocked & free).any():
                break
            free &= ~blocked
        tried.append(np.clip(u + length * step, space.low, space.high))
    return tried


def is_flat(normal: Array, slope: Array) -> bool:
    """Whether the quadratic model promises next to nothing."""
    return float(slope @ np.linalg.lstsq(normal, slope, rcond=1e-12)[0]) < SETTLED
