"""A step for ground whose damper is so strong that explicit steps would have to be a small share of M / C.

Extrapolation of linearly implicit Euler steps, (I - h J) d = h f(t + h, z), over 1 to 5 parts of the step, of order 5;
the error from the last two of order 5 and 4, as steep as the explicit pair's (Hairer and Wanner, Solving Ordinary
Differential Equations II, section IV.9). J is found by differences once for all steps that begin at one state.
"""

import math
from collections.abc import Sequence

import numpy as np

from .dormand_prince import Step
from .dynamics import LOST, WORK, Modes, System

__all__ = ["Implicit"]

_PARTS = (1, 2, 3, 4, 5)
_NUDGE = 1e-8  # of the scale, for J


class Implicit:
    """Steps of one system; keeps J of the state from which it last stepped."""

    def __init__(self, system: System, scale: Sequence[float], tolerance: float) -> None:
        self.system, self.scale, self.tolerance = system, np.array(scale), tolerance
        self._from: tuple[object, ...] = ()
        self._slopes = np.zeros((len(scale), len(scale)))

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
