"""The push that separates two effects best: a search over what a campaign could do, with the evidence to be expected.

Two fitted models predict a push that was not made. Their difference d over the noise of force is expected to give
d^T (I + J S J^T + J' S' J'^T)^-1 d / 2 nats for the one that is right: J are slopes of a prediction over the numbers of
its model, S their covariance from the campaign. So a difference that both models could still take up does not count
(Box and Hill, Discrimination among mechanistic models, Technometrics 9 (1967), 57).
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from experiments.diagnose.core.freedom import from_beds
from experiments.diagnose.fit.problem import Array, Estimate, Form, Values
from experiments.diagnose.fit.trials import Planned

__all__ = ["best_push"]

Predict = Callable[[Sequence[tuple[Values, Sequence[Form]]], float, Array, Array, Array], Array]
"""Forces [N], shape [points, n], of a push at a diameter [m] along times [s], depths [m] and speeds [m/s]."""

_SPEEDS, _DEPTHS, _HOLDS = (0.3, 1.0, 3.0), (0.5, 1.0, 2.0), (0.0, 30.0)
"""Times the slowest and the fastest speed and the deepest depth of the campaign; seconds."""
_BEDS = ("bed", "bed damping", "bed unloading")  # in which a bed that is prepared anew differs from the mean one
_ROWS = 200  # of a planned push
_KNOWN = 0.1
"""Share of the push's depth above which no reading is quoted: there the zero of the depth and the first contact, which
no form describes, decide the force."""


def best_push(
    one: Estimate, other: Estimate, predict: Predict, *, inflation: tuple[float, float], diameters: Sequence[float],
    speeds: Sequence[float], depth: float, std: float, rows: int,
) -> Planned:  # fmt: skip
    """The push that separates two fitted models best.

    Args:
        one: a fitted model.
        other: the other one.
        predict: forces of pushes.
        inflation: factors on the standard errors of each model, for what it leaves of the campaign beyond noise.
        diameters: those of the campaign [m].
        speeds: those of the campaign [m/s].
        depth: its deepest [m].
        std: noise of a reading of force [N].
        rows: readings of a push.
    """
    slow, fast = min(speeds), max(speeds)
    paces = sorted({_SPEEDS[0] * slow, slow, fast, _SPEEDS[-1] * fast})
    found = []
    for diameter, speed, part, hold, returns in itertools.product(diameters, paces, _DEPTHS, _HOLDS, (False, True)):
        time, z, v = _path(speed, part * depth, hold, returns)
        d, noise = np.zeros(len(time)), np.eye(len(time))
        forces: list[tuple[Array, ...]] = []
        for sign, fit, factor in ((1.0, one, inflation[0]), (-1.0, other, inflation[1])):
            force, errors, rests = _predicted(fit, predict, factor, diameter, time, z, v)
            beds = _of_beds(fit, predict, diameter, time, z, v)
            forces.append((force, np.linalg.norm(errors, axis=1), rests, beds))
            weight = np.sqrt(rows / _ROWS) / std
            d += sign * weight * force
            noise += weight**2 * (errors @ errors.T)
        settings = {"diameter_m": diameter, "speed_m_s": speed, "depth_m": part * depth, "hold_s": hold,
                    "returns": float(returns)}  # fmt: skip
        nats = float(0.5 * d @ np.linalg.solve(noise, d))
        words = _words(settings, len(diameters) > 1)
        found.append(Planned(settings, words, nats, 0, _apart(z, v, forces, std)))
    found = [replace(push, tried=len(found)) for push in found]
    return replace(max(found, key=lambda push: push.nats), compared=tuple(found))


def _apart(z: Array, v: Array, forces: Sequence[tuple[Array, ...]], std: float) -> dict[str, float]:
    """The reading at which two predictions, each a force with its standard error, the part of that which rests on few
    beds, and its scatter in other beds [N], differ most over their errors, below the depth at which its zero decides;
    and the peak force of each."""
    (one, one_std, *_), (other, other_std, *_) = forces
    apart = np.abs(one - other) / np.sqrt(one_std**2 + other_std**2 + std**2)
    at = int(np.argmax(np.where(z >= _KNOWN * z.max(), apart, -1.0)))
    found = {"depth_m": float(z[at]), "speed_m_s": float(v[at]), "noise_N": std}
    for key, columns in zip(("one", "other"), forces, strict=True):
        for name, row in ((key, at), (f"{key}_peak", int(np.argmax(columns[0])))):
            keys = (f"{name}_{part}N" for part in ("", "std_", "rests_", "beds_"))
            found |= zip(keys, (float(column[row]) for column in columns), strict=True)
    return found


def _words(push: Mapping[str, float], says_diameter: bool) -> str:
    """The push in words."""
    words = f"push {1e3 * push['depth_m']:.3g} mm deep at {1e3 * push['speed_m_s']:.3g} mm/s"
    words += f" with {1e3 * push['diameter_m']:.3g} mm" if says_diameter else ""
    words += f", hold it for {push['hold_s']:g} s" if push["hold_s"] else ""
    return words + (", and draw it out at that speed" if push["returns"] else "")


def _path(speed: float, depth: float, hold: float, returns: bool) -> tuple[Array, Array, Array]:
    """Times, depths and speeds of a push to a depth, as many rows on each part as it takes of the time, half at least
    where it moves."""
    way = depth / speed
    parts = np.array([(way, speed), *([(hold, 0.0)] if hold else []), *([(way, -speed)] if returns else [])])
    spans, paces = parts.T
    moves = paces != 0.0
    share = 0.5 * spans / spans.sum() + np.where(moves, 0.5 * spans / spans[moves].sum(), 0.0)
    counts = np.maximum((share * _ROWS).astype(int), 2)
    ends = np.cumsum([0.0, *spans])
    time = np.concatenate(
        [a + (b - a) * np.arange(1, n + 1) / n for a, b, n in zip(ends, ends[1:], counts, strict=False)]
    )
    return time, np.interp(time, ends, np.cumsum([0.0, *(spans * paces)])), np.repeat(paces, counts)


def _of_beds(fit: Estimate, predict: Predict, diameter: float, time: Array, z: Array, v: Array) -> Array:
    """Standard deviation of a force in another bed than the mean one, shape [n]; by beds one standard deviation of the
    fit's scatter stiffer and softer, and so on."""
    stds = {p.kind: p.std for p in fit.model.scatter if p.kind in _BEDS}
    points = [({**fit.values, kind: sign * std}, fit.model.forms) for kind, std in stds.items() for sign in (1.0, -1.0)]
    if not points:
        return np.zeros(len(time))
    forces = predict(points, diameter, time, z, v)
    return np.linalg.norm(0.5 * (forces[0::2] - forces[1::2]), axis=0)


def _predicted(
    fit: Estimate, predict: Predict, inflation: float, diameter: float, time: Array, z: Array, v: Array
) -> tuple[Array, Array, Array]:
    """Forces [N], a factor of the covariance of their errors, shape [n, p], and the part of the standard errors that
    rests on the scatter of the campaign's beds, shape [n]."""
    model = fit.model
    shared = [k for k, p in enumerate(model.parameters) if p.trial is None and fit.free[k]]
    points: list[tuple[Values, Sequence[Form]]] = [(fit.values, model.forms)]
    steps = []
    for k in shared:
        p = model.parameters[k]
        steps.append(p.step if p.step is not None else 1e-4 * p.scale)
        points.append(({**fit.values, p.name: fit.values[p.name] + steps[-1]}, model.forms))
    forces = predict(points, diameter, time, z, v)
    slopes = (forces[1:] - forces[0]).T / np.array(steps)
    whole, own = fit.covariance(inflation=inflation), np.ix_(shared, shared)
    size, axes = np.linalg.eigh(whole[own])
    beds = from_beds(fit, whole, inflation)
    part = np.zeros(len(time)) if beds is None else np.einsum("ij,jk,ik->i", slopes, beds[own], slopes)
    return forces[0], slopes @ (axes * np.sqrt(np.maximum(size, 0.0))), np.sqrt(np.maximum(part, 0.0))
