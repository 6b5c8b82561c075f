"""Single steps of the accurate integrator, explicit and implicit.

Explicit (`attempt`, `interpolant`): Dormand and Prince's pair of orders 5 and 4, with its own interpolant (Hairer,
Norsett and Wanner, Solving Ordinary Differential Equations I, table II.5.2 and section II.6). State vectors are lists
of nine to eleven numbers (`rigid.planar.dynamics`): faster in plain Python than arrays so short.

Implicit (`Implicit`), for ground whose damper is so strong that explicit steps would have to be a small share of M / C:
extrapolation of linearly implicit Euler steps, (I - h J) d = h f(t + h, z), over 1 to 5 parts of the step, of order 5.
The error is the difference of the last two, of order 5 and 4, as steep as the explicit pair's. See Hairer and Wanner,
Solving Ordinary Differential Equations II, section IV.9. J is found by differences once for all steps that begin at one
state.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .dynamics import LOST, WORK, Modes, System

__all__ = ["Implicit", "Interpolant", "Step", "attempt", "interpolant"]

Numbers = Sequence[float]
Interpolant = Callable[[float], list[float]]  # z at a time within a step

_C = (0.2, 0.3, 0.8, 8 / 9, 1.0)
_A2 = (0.2,)
_A3 = (3 / 40, 9 / 40)
_A4 = (44 / 45, -56 / 15, 32 / 9)
_A5 = (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729)
_A6 = (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656)
_B = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
_E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
_D = (
    -12715105075 / 11282082432, 0.0, 87487479700 / 32700410799, -10690763975 / 1880347072,
    701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423,
)  # fmt: skip


@dataclass(slots=True)
class Step:
    """End of a step, the seven slopes, and the error over the tolerance (infinite: not finite)."""

    z: list[float]
    rates: list[list[float]]
    error: float


def attempt(
    system: System, time: float, z: Numbers, modes: Modes, k1: list[float], h: float, scale: Numbers, tolerance: float
) -> Step:
    """A step of `h` [s] from `z` at `time` [s], where dz/dt is `k1`. `scale`: what the tolerance is relative to."""
    rates = [k1]
    try:
        for c, weights in zip(_C, (_A2, _A3, _A4, _A5, _A6), strict=True):
            rates.append(system.derivative(time + c * h, _combine(z, h, weights, rates), modes))
        end = _combine(z, h, _B, rates)
        rates.append(system.derivative(time + h, end, modes))
    except (ValueError, OverflowError, ZeroDivisionError):  # far beyond what is finite: too long a step
        return Step(list(z), rates, math.inf)
    error = 0.0
    for i in range(len(z)):
        off = h * sum(e * k[i] for e, k in zip(_E, rates, strict=True))
        error = max(error, abs(off) / (tolerance * (scale[i] + abs(z[i]))))
        if off != off:
            return Step(end, rates, math.inf)
    return Step(end, rates, error)


def _combine(z: Sequence[float], h: float, weights: Sequence[float], rates: list[list[float]]) -> list[float]:
    used = [(h * w, k) for w, k in zip(weights, rates, strict=False) if w]
    if len(used) == 1:
        ((a, k),) = used
        return [x + a * p for x, p in zip(z, k, strict=True)]
    return [x + sum([a * k[i] for a, k in used]) for i, x in enumerate(z)]


def interpolant(time: float, h: float, z: list[float], step: Step) -> Interpolant:
    """The pair's own continuous extension, of order 4."""
    end, rates = step.z, step.rates

    def at(t: float) -> list[float]:
        u = (t - time) / h if h > 0 else 1.0
        if u >= 1.0:
            return list(end)
        v = 1 - u
        out = []
        for i in range(len(end)):
            rise = end[i] - z[i]
            bow = h * rates[0][i] - rise
            fall = rise - h * rates[6][i] - bow
            more = h * sum(d * k[i] for d, k in zip(_D, rates, strict=True))
            out.append(z[i] + u * (rise + v * (bow + u * (fall + v * more))))
        return out

    return at


_PARTS = (1, 2, 3, 4, 5)
_NUDGE = 1e-8  # of the scale, for J


class Implicit:
    """Steps of one system; keeps J of the state from which it last stepped."""

    def __init__(self, system: System, scale: Sequence[float], tolerance: float) -> None:
        self.system, self.scale, self.tolerance = system, np.array(scale), tolerance
        self._from: tuple[object, ...] = ()
        self._slopes = np.zeros((len(scale), len(scale)))

    @np.errstate(over="ignore", invalid="ignore")  # of a step that is far too long: its error is infinite
    def attempt(self, time: float, z: list[float], modes: Modes, first: list[float], h: float) -> Step:
        """A step of `h` [s] from `z` at `time` [s], where dz/dt is `first`."""
        system, count = self.system, len(z)
        slopes = self._jacobian(time, z, modes, first)
        begin = np.array(z)
        table: list[np.ndarray] = []
        try:
            for j, parts in enumerate(_PARTS):
                part = h / parts
                solve = np.linalg.inv(np.eye(count) - part * slopes)
                at = begin
                for k in range(parts):
                    rate = system.derivative(time + (k + 1) * part, at.tolist(), modes)
                    at = at + part * (solve @ rate)
                row = [at]
                for k in range(j):  # Aitken and Neville's scheme
                    row.append(row[k] + (row[k] - table[k]) / (parts / _PARTS[j - k - 1] - 1))
                table, lower = row, row[-2] if j else at
            end = table[-1]
            rate = system.derivative(time + h, end.tolist(), modes)
        except (ValueError, OverflowError, ZeroDivisionError, np.linalg.LinAlgError):  # far too long a step
            return Step(list(z), [first], math.inf)
        error = float(np.max(np.abs(end - lower) / (self.tolerance * (self.scale + np.abs(begin)))))
        return Step(end.tolist(), [first, rate], error if np.isfinite(end).all() else math.inf)

    def _jacobian(self, time: float, z: list[float], modes: Modes, first: list[float]) -> np.ndarray:
        here = (
            time, tuple(z), tuple(modes.touching), tuple(modes.slip), tuple(modes.dry), modes.torque_over, modes.inner,
        )  # fmt: skip
        if self._from != here:
            self._from = here
            for i in range(len(z)):
                if i in (WORK, LOST):
                    continue
                step = _NUDGE * self.scale[i]
                moved = list(z)
                moved[i] += step
                rate = self.system.derivative(time, moved, modes)
                self._slopes[:, i] = (np.array(rate) - np.array(first)) / step
        return self._slopes
