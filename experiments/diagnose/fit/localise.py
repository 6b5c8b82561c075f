"""Where a model fails: sensor, trial, phase and seconds; the force that is missing, and what it depends on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .problem import Array, Form, Problem, Values

__all__ = ["Place", "acceleration", "depends_on", "latent_table", "phases_of", "places", "slope"]

_SURE = 4.0  # standard deviations by which the energy of a stretch must exceed that of noise
_MOST = 24
_WINDOW = 9
_SHARE = 1 / 12  # of a recording, over which an acceleration is taken
_FEWEST = 7


@dataclass(frozen=True)
class Place:
    """One stretch of one channel in which the model fails."""

    trial: str
    channel: str
    phase: str
    from_s: float
    to_s: float
    excess: float  # chi-square beyond the number of its samples


def places(problem: Problem, values: Values, forms: Sequence[Form], residuals: Mapping[str, Array]) -> list[Place]:
    """Stretches of one phase in which residuals are beyond noise, the worst first.

    `residuals`: over the noise, by trial, shape [sample_count].
    """
    out = []
    for trial, found in residuals.items():
        samples = problem.samples(trial)
        phases = phases_of(problem, values, forms, trial)
        for channel in dict.fromkeys(samples.channel.tolist()):
            rows = np.flatnonzero(samples.channel == channel)
            time, rest, phase = samples.time[rows], found[rows], phases[rows]
            for low, high in _runs(phase):
                count = high - low
                if count < 3:
                    continue
                over = float((rest[low:high] ** 2).sum() - count)
                if over < _SURE * np.sqrt(2 * count):
                    continue
                first, last = _core(rest[low:high])
                out.append(Place(trial, str(channel), str(phase[low]), float(time[low + first]),
                                 float(time[low + last]), over))  # fmt: skip
    out.sort(key=lambda place: -place.excess)
    whole = sum(place.excess for place in out)
    return [place for place in out[:_MOST] if place.excess > 0.005 * whole]


def phases_of(problem: Problem, values: Values, forms: Sequence[Form], trial: str) -> NDArray[np.str_]:
    """The phase at each sample; a platform stands until the torque starts, whatever a model predicts."""
    phases = problem.phases(values, forms, trial)
    return np.where(problem.samples(trial).time < 0, "stand", phases) if problem.kind == "tumble" else phases


def _runs(phase: NDArray[np.str_]) -> list[tuple[int, int]]:
    if not len(phase):
        return []
    edges: list[int] = [0, *(np.flatnonzero(phase[1:] != phase[:-1]) + 1).tolist(), len(phase)]
    return list(pairwise(edges))


def _core(rest: Array) -> tuple[int, int]:
    """The shortest stretch that holds nine tenths of the energy beyond noise."""
    energy = np.maximum(np.convolve(rest**2 - 1, np.ones(_WINDOW) / _WINDOW, mode="same")[: len(rest)], 0.0)
    if len(rest) < _WINDOW or energy.sum() <= 0:
        return 0, len(rest) - 1
    share = np.cumsum(energy) / energy.sum()
    first, last = (int(place) for place in np.searchsorted(share, [0.05, 0.95]))
    return first, min(last, len(rest) - 1)


def latent_table(problem: Problem, values: Values, forms: Sequence[Form]) -> dict[str, NDArray[np.generic]]:
    """Columns of latent.csv: trial, then the problem's columns, trial after trial."""
    parts: dict[str, list[NDArray[np.generic]]] = {"trial": []}
    for trial in problem.trials:
        columns = problem.latent(values, forms, trial.id)
        count = len(next(iter(columns.values())))
        parts["trial"].append(np.full(count, trial.id))
        for name, column in columns.items():
            parts.setdefault(name, []).append(column)
        for name, value in trial.settings.items():
            parts.setdefault(name, []).append(np.full(count, value))
    return {name: np.concatenate(columns) for name, columns in parts.items()}


def depends_on(table: Mapping[str, NDArray[np.generic]]) -> tuple[str, dict[str, float]]:
    """A sentence on what the latent columns depend on, and the share of their variance that each column explains.

    The share is that of a mean in twenty bins of equal count. It is computed from half of the samples and judged on the
    others (every second one), so that noise explains nothing. A column that only identifies the trial counts as the
    trial.
    """
    shares: dict[str, float] = {}
    if not len(table["trial"]):
        return "nothing: no sensor that was recorded measures a force", shares
    latents = [name for name in table if name.startswith("latent_")]
    ids, which = np.unique(np.asarray(table["trial"]), return_inverse=True)
    others = [name for name in table if name != "trial" and name not in latents and not _labels(table[name], which)]
    for latent in latents:
        y = np.asarray(table[latent], dtype=float)
        if len(ids) > 2:
            shares["trial"] = max(shares.get("trial", 0.0), _explained(which.astype(float), y))
        for name in others:
            x = np.asarray(table[name], dtype=float)
            good = np.isfinite(x) & np.isfinite(y)
            share = _explained(x[good], y[good])
            shares[name] = max(shares.get(name, 0.0), share)
    ranked = sorted(shares.items(), key=lambda pair: -pair[1])
    named = [(_WORDS.get(name, name), share) for name, share in ranked if share > 0.1]
    if not named:
        return "nothing that was recorded: no column explains a tenth of it", shares
    best = named[0]
    sentence = f"{best[0]} (explains {100 * best[1]:.0f} % of it)"
    more = [f"{name} ({100 * share:.0f} %)" for name, share in named[1:3]]
    return sentence + (f", then {', '.join(more)}" if more else ""), shares


def _labels(column: NDArray[np.generic], which: NDArray[np.intp]) -> bool:
    """Whether a column only identifies the trial: another single value in each of three trials or more."""
    count = int(which.max()) + 1
    values = np.asarray(column, dtype=float)
    single = all(np.ptp(values[which == k]) == 0 for k in range(count))
    return count > 2 and single and len(np.unique(values)) == count


_WORDS = {
    "t_s": "time", "trial": "which trial it is",
    "depth_m": "depth", "retreat_m": "the way back from the deepest point", "velocity_m_s": "velocity",
    "speed_m_s": "the trial's speed", "diameter_m": "diameter", "gravity_m_s2": "the trial's gravity",
    "torque_N_m": "the trial's torque", "x_m": "x", "y_m": "height", "theta_rad": "angle",
    "vx_m_s": "velocity along the surface", "vy_m_s": "velocity upwards", "omega_rad_s": "rate of rotation",
    "wheel_rad_s": "speed of the wheel",
}  # fmt: skip


def _explained(x: Array, y: Array) -> float:
    if len(y) < 80 or np.ptp(x) == 0:
        return 0.0
    edges = np.unique(np.quantile(x, np.linspace(0, 1, 21)[1:-1]))
    bins = np.searchsorted(edges, x)
    learn = np.arange(len(y)) % 2 == 0
    means = np.zeros(len(edges) + 1)
    for k in range(len(means)):
        inside = learn & (bins == k)
        means[k] = y[inside].mean() if inside.any() else y[learn].mean()
    rest = y[~learn] - means[bins[~learn]]
    total = float(np.sum((y[~learn] - y[learn].mean()) ** 2))
    return max(0.0, 1.0 - float(np.sum(rest**2)) / total) if total > 0 else 0.0


def slope(time: Array, values: Array, *, rows: int) -> Array:
    """Slope of a straight line through each `rows` neighbouring readings; shapes [n]."""
    return _fitted(time, values, rows, 1)


def acceleration(time: Array, values: Array) -> Array:
    """Second derivative, of a parabola through the readings of a twelfth of the time; shapes [n]."""
    return 2.0 * _fitted(time, values, max(_FEWEST, round(_SHARE * len(time))), 2)


def _fitted(time: Array, values: Array, rows: int, degree: int) -> Array:
    """The coefficient of the highest power of a polynomial through the rows around each; 0 where there are too few."""
    half, found = rows // 2, np.zeros(len(time))
    for k in range(len(time)):
        own = slice(max(0, k - half), k + half + 1)
        t = time[own] - time[own].mean()
        span = float(np.ptp(t))
        if len(t) > degree and span > 0:
            powers = (t / span)[:, None] ** np.arange(degree + 1)
            found[k] = np.linalg.lstsq(powers, values[own], rcond=None)[0][degree] / span**degree
    return found
