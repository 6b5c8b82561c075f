"""The factors of 3D-RFT from pushed plates: least squares, scatter between beds, error of unseen plates.

Each run is a plate (or another body) with means of depth [m] and force [N] over stretches of its way (`samples`). The
deviation of each force component is divided by the force on the same plate, mean over beds, so that plates count alike.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from experiments.runs.types import Json
from rigid.ground.rft_table import Pieces, jackknife_std, law_tractions

__all__ = ["Fit", "direction_of", "fit_of", "measured_force", "predicted_force"]

Factors = tuple[float, float, float, float]
START = 1e5  # [N/m3], from which the search starts


@dataclass(frozen=True)
class Fit:
    """xi_1, xi_2, xi_3 [N/m3] and b [1] of all runs and of those without each bed; errors over the force [1].

    unseen: rms over plates of the mean over beds, each predicted by a fit without that plate. seen: of the fit itself.
    """

    factors: Factors
    left_out: tuple[Factors, ...]
    stds: Factors
    seen: float
    unseen: float


def direction_of(gamma: float) -> np.ndarray:
    """Unit vector of the motion, shape [3]; gamma in degrees."""
    angle = math.radians(gamma)
    return np.array([math.cos(angle), 0.0, -math.sin(angle)])


def measured_force(run: Json) -> np.ndarray:
    """Mean force of a run [N], shape [3]."""
    return np.asarray(run["samples"], dtype=float)[:, 1:4].mean(axis=0)


def predicted_force(factors: ArrayLike, friction: float, run: Json, pieces: Pieces) -> np.ndarray:
    """Mean force on the body of a run at the same depths [N], shape [3]."""
    normals, weights = _faces(run, pieces)
    return np.asarray(weights @ _tractions(factors, friction, run, normals))


def _faces(run: Json, pieces: Pieces) -> tuple[np.ndarray, np.ndarray]:
    """The different normals of a body, shape [n, 3], and the mean of depth times area over the samples [m3], [n]."""
    deep = np.maximum(np.array([row[0] for row in run["samples"]])[:, None] - pieces.points[:, 2], 0.0).mean(axis=0)
    normals, which = np.unique(pieces.normals.round(12), axis=0, return_inverse=True)
    return normals, np.bincount(which.ravel(), weights=deep * pieces.areas, minlength=len(normals))


def _tractions(factors: ArrayLike, friction: float, run: Json, normals: np.ndarray) -> np.ndarray:
    return law_tractions(factors, friction, normals, direction_of(run["gamma"]))


def _solved(
    runs: Sequence[Json], surfaces: Mapping[str, Pieces], friction: float, terms: int, start: Sequence[float]
) -> Factors:
    measured = [measured_force(run) for run in runs]
    alike: dict[tuple[str, float], list[np.ndarray]] = {}
    for run, force in zip(runs, measured, strict=True):
        alike.setdefault((run["body"], run["gamma"]), []).append(force)
    sizes = [float(np.linalg.norm(np.mean(alike[run["body"], run["gamma"]], axis=0))) for run in runs]
    faces = [_faces(run, surfaces[run["body"]]) for run in runs]

    def full(x: np.ndarray) -> np.ndarray:
        gradients, downward = (x, 0.0) if terms == 3 else (np.repeat(x[:1], 3), x[1] if terms == 2 else 0.0)
        return np.array([*(START * gradients), downward])

    def off(x: np.ndarray) -> np.ndarray:
        each = zip(runs, faces, measured, sizes, strict=True)
        parts = [
            (weights @ _tractions(full(x), friction, run, normals) - force)[[0, 2]] / size
            for run, (normals, weights), force, size in each
        ]
        return np.concatenate(parts)

    first = np.asarray(start[:3]) / START
    found = full(least_squares(off, {1: first[:1], 2: np.array([first[0], start[3]]), 3: first}[terms]).x)
    return (float(found[0]), float(found[1]), float(found[2]), float(found[3]))


def fit_of(runs: Sequence[Json], surfaces: Mapping[str, Pieces], friction: float, *, terms: int) -> Fit:
    """The fit of xi (`terms` = 1), of xi and b (2), or of xi_1, xi_2 and xi_3 (3).

    `runs`: those of plates. `surfaces`: the pieces of each body, by `body` of a run. `friction`: of grains and body.
    """
    one = _solved(runs, surfaces, friction, terms, (START, START, START, 0.0))
    beds = list(dict.fromkeys(run["bed"] for run in runs))
    without = []
    if len(beds) > 1:
        without = [_solved([run for run in runs if run["bed"] != bed], surfaces, friction, terms, one) for bed in beds]
    stds = (0.0, 0.0, 0.0, 0.0)
    if len(without) > 1:
        s = jackknife_std(without)
        stds = (float(s[0]), float(s[1]), float(s[2]), float(s[3]))
    plates = list(dict.fromkeys((run["body"], run["gamma"]) for run in runs))
    seen, unseen = [], []
    for plate in plates:
        own = [run for run in runs if (run["body"], run["gamma"]) == plate]
        others = [run for run in runs if (run["body"], run["gamma"]) != plate]
        seen.append(_error(one, friction, own, surfaces))
        unseen.append(_error(_solved(others, surfaces, friction, terms, one), friction, own, surfaces))
    return Fit(one, tuple(without), stds, _rms(seen), _rms(unseen))


def _error(factors: Factors, friction: float, own: Sequence[Json], surfaces: Mapping[str, Pieces]) -> float:
    measured = np.mean([measured_force(run) for run in own], axis=0)
    law = np.mean([predicted_force(factors, friction, run, surfaces[run["body"]]) for run in own], axis=0)
    return float(np.linalg.norm(law - measured) / np.linalg.norm(measured))


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
