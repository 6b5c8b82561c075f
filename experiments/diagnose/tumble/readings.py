"""When one tumble is to be sampled, and how the samples of its motion become readings of its sensors."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.problem import Array
from rigid.terms import Term, sensor_terms

from .data import CHANNELS, TrialData

__all__ = ["Grid", "Optics"]

Places = NDArray[np.intp]

_X, _Y, _THETA, _VX, _VY, _OMEGA, _AX, _AY, _WHEEL, _STATE = range(10)  # channels of the batch's series
_COLUMN = {"x": _X, "y": _Y, "theta": _THETA, "wheel": _WHEEL, "gyro": _OMEGA}
_MOTION = (_X, _Y, _THETA, _VX, _VY, _OMEGA, _WHEEL)


@dataclass(frozen=True)
class Optics:
    """What lies between the motion and the readings, for several sets of parameters."""

    clock: Array  # parameters of the effects on the IMU's clock, shape [set_count, parameter_count]
    pull: Array  # local gravity [m/s2], shape [set_count] like the rest
    slope: Array  # of the surface [rad]
    lens: Array  # parameters of the effects on the camera's lens, shape [set_count, parameter_count]


@dataclass(frozen=True)
class _Part:
    """Samples of one channel that are read: `count` from `first` on, and the last where others are left out between."""

    name: str
    first: int
    count: int
    last: int | None
    rows: Places  # of the clock's times, shape [count (+ 1)]

    def put(self, into: NDArray, readings: NDArray) -> None:
        """Readings, shape [set_count, count (+ 1)], to where they belong."""
        into[:, self.first : self.first + self.count] = readings[:, : self.count]
        if self.last is not None:
            into[:, self.last] = readings[:, -1]


def _hooks(name: str, own: Sequence[Term]) -> list[tuple[Callable[..., Array], range]]:
    """Hooks of the sensors' effects, and which of the parameters of all are theirs, in the order of `sensor_terms`."""
    found, at = [], 0
    for term in sensor_terms(name, own):
        count = len(term.arguments(name))
        found.append((term.hooks[name], range(at, at + count)))
        at += count
    return found


class Grid:
    """When one trial is to be sampled, and how its samples become readings."""

    def __init__(self, trial: TrialData, window: float, own: Sequence[Term] = ()) -> None:
        self.window = window
        self._clocks, self._lenses = (_hooks(name, own) for name in ("clock", "lens"))
        self.trial = trial
        imu = np.isin(trial.channel, [CHANNELS.index(name) for name in ("gyro", "ax", "ay")])
        force = np.isin(trial.channel, [CHANNELS.index(name) for name in ("ax", "ay")])
        self.camera_time, camera_row = np.unique(trial.time[~imu], return_inverse=True)
        self.imu_time, imu_row = np.unique(trial.time[imu], return_inverse=True)
        self._row = np.empty(len(imu), dtype=np.intp)  # of a sample, among its clock's times
        self._row[~imu], self._row[imu] = camera_row, imu_row
        self.parts = 3 if window > 0 and force.any() else 1
        self.size = len(self.camera_time) + self.parts * len(self.imu_time)
        half = 0.5 * window if self.parts == 3 else 0.0
        latest = max(self.camera_time[-1:].tolist() + (self.imu_time[-1:] + half).tolist())
        self.end = round(max(latest, 1e-3), 1)
        self._sorted: dict[tuple[float, ...], tuple[Array, Places]] = {}
        self._read_until: dict[float, list[list[_Part]]] = {}

    def _true(self, clock: Array) -> Array:
        """True times [s] of the IMU's rows by clocks with these parameters, shape [set_count, time_count]."""
        times = np.broadcast_to(self.imu_time, (len(clock), len(self.imu_time)))
        for hook, columns in self._clocks:
            times = hook(times, *(clock[:, k : k + 1] for k in columns))
        return times

    def _seen(self, square: Array, lens: Array) -> Array:
        """x and y as the camera sees them, over the true ones [1], by the distance's square [m2]."""
        parts = (hook(square, *(lens[:, k : k + 1] for k in columns)) for hook, columns in self._lenses)
        return np.asarray(math.prod(parts))

    def _plain(self, clock: tuple[float, ...]) -> tuple[Array, Places]:
        """Rising sample times for a clock with these parameters, and where each reading's sample has gone."""
        if clock not in self._sorted:
            if len(self._sorted) > 64:
                self._sorted.clear()
            true = self._true(np.array([clock]))[0]
            half = 0.5 * self.window
            parts = (true - half, true, true + half) if self.parts == 3 else (true,)
            wanted = np.maximum(np.concatenate([self.camera_time, *parts]), 0.0)
            order = np.argsort(wanted, kind="stable")
            place = np.empty_like(order)
            place[order] = np.arange(len(order))
            self._sorted[clock] = (wanted[order], place)
        return self._sorted[clock]

    def times(self, clock: Array, until: float = np.inf) -> tuple[Array, Places]:
        """Sample times [s], never below 0, and where among them each reading's sample is; one row each where all
        clocks are alike, else one a set. After `until` [s] there is one more, at it, which stands for all later ones.
        """
        alike = bool((clock == clock[0]).all())
        plain = [self._plain(tuple(map(float, row))) for row in (clock[:1] if alike else clock)]
        times, place = (np.stack(rows) for rows in zip(*plain, strict=True))
        if np.isfinite(until):
            width = min(int((times < until).sum(axis=1).max()) + 1, self.size)
            times, place = np.minimum(times[:, :width], until), np.minimum(place, width - 1)
        return times, place

    def _wanted(self, horizon: float) -> list[list[_Part]]:
        """What is read up to a share of the trial's time, channels that are read at the same moments together."""
        if horizon not in self._read_until:
            until = np.inf if horizon >= 1 else horizon * self.trial.end
            alike: dict[tuple[bool, bytes], list[_Part]] = {}
            for number, name in enumerate(CHANNELS):
                mine = np.flatnonzero(self.trial.channel == number)  # together, in the order of their times
                if not len(mine):
                    continue
                count = int((self.trial.time[mine] <= until).sum())
                last = None if count == len(mine) else int(mine[-1])
                rows = self._row[mine[:count] if last is None else np.append(mine[:count], last)]
                part = _Part(name, int(mine[0]), count, last, rows)
                alike.setdefault((name in ("gyro", "ax", "ay"), rows.tobytes()), []).append(part)
            self._read_until[horizon] = list(alike.values())
        return self._read_until[horizon]

    def read(
        self, series: Array, place: Places, optics: Optics, horizon: float,
        value: Array, state: NDArray[np.int8], motion: Array,
    ) -> None:  # fmt: skip
        """Readings, and states and motion where they are wanted, from the sampled motion.

        `series`: as the batch recorded it at `times`, shape [set_count, time_count, channel]; not to be kept. `place`:
        as `times` has it. `optics`: of the same sets. `horizon`: share of the trial's time up to which is read; what
        comes later stays unchanged. Filled are `value`, shape [set_count, sample_count]; `state`, the same shape, or
        [.., 0] where it is not wanted; and `motion`: x, y, theta, vx, vy, omega, wheel_speed, shape [set_count,
        sample_count, 7], or [.., 0, 7].
        """
        flat, channels = series.reshape(-1), series.shape[2]
        starts = series.shape[1] * channels * np.arange(len(series))[:, None]

        def at(columns: Places) -> Places:
            """Where in `flat` the samples of these readings begin, shape [set_count, reading_count]."""
            return place[:, columns] * channels + starts

        def take(channel: int, index: Places) -> Array:
            found: Array = flat[channel:].take(index)
            return found

        cameras, imus = len(self.camera_time), len(self.imu_time)
        for together in self._wanted(horizon):
            rows, names = together[0].rows, [part.name for part in together]
            if "gyro" in names or "ax" in names or "ay" in names:
                indices = [at(cameras + k * imus + rows) for k in range(self.parts)]
                index = indices[self.parts // 2]
                readings = {"gyro": take(_OMEGA, index)} if "gyro" in names else {}
                if "ax" in names or "ay" in names:
                    readings["ax"], readings["ay"] = (
                        self._means([[take(k, i) for k in (_THETA, _VX, _VY, _OMEGA)] for i in indices], optics)
                        if self.parts == 3
                        else self._momentary(take, index, rows, optics)
                    )
            else:
                index = at(rows)
                readings = {name: take(_COLUMN[name], index) for name in names}
                if "wheel" in names:
                    readings["wheel"] = np.abs(readings["wheel"])
                if "x" in names or "y" in names:
                    seen = self._seen(np.zeros(1), optics.lens)
                    if (seen != self._seen(np.ones(1), optics.lens)).any():
                        first = at(np.zeros(1, dtype=np.intp))
                        away = (take(_X, index) - take(_X, first)) ** 2 + (take(_Y, index) - take(_Y, first)) ** 2
                        seen = self._seen(away, optics.lens)
                    readings |= {name: seen * readings[name] for name in ("x", "y") if name in names}
            for part in together:
                part.put(value, readings[part.name])
            if state.shape[1]:
                numbers = take(_STATE, index)
                numbers = np.where(np.isfinite(numbers), numbers, 0).astype(np.int8)
                for part in together:
                    part.put(state, numbers)
            if motion.shape[1]:
                moved = np.stack([take(k, index) for k in _MOTION], axis=2)
                for part in together:
                    part.put(motion, moved)

    def _momentary(
        self, take: Callable[[int, Places], Array], index: Places, rows: Places, optics: Optics
    ) -> tuple[Array, Array]:
        """Specific force of the moment, in body axes [m/s2]."""
        gx, gy = (optics.pull * np.sin(optics.slope))[:, None], (optics.pull * np.cos(optics.slope))[:, None]
        theta = take(_THETA, index)
        sine, cosine = np.sin(theta), np.cos(theta)
        moves = self._true(optics.clock)[:, rows] >= 0
        ax, ay = np.where(moves, take(_AX, index), 0.0) + gx, np.where(moves, take(_AY, index), 0.0) + gy
        return ax * cosine - ay * sine, ax * sine + ay * cosine

    def _means(self, parts: list[list[Array]], optics: Optics) -> tuple[Array, Array]:
        """Specific force in body axes [m/s2]: mean over the window by parts (`rigid.sensors`), the integral by
        Simpson's rule. `parts`: theta, vx, vy and omega at the window's beginning, middle and end.
        """
        gx, gy = (optics.pull * np.sin(optics.slope))[:, None], (optics.pull * np.cos(optics.slope))[:, None]
        along, up, over_x, over_y = [], [], [], []
        for theta, vx, vy, omega in parts:
            sine, cosine = np.sin(theta), np.cos(theta)
            along.append(vx * cosine - vy * sine)
            up.append(vx * sine + vy * cosine)
            over_x.append(omega * up[-1] + gx * cosine - gy * sine)
            over_y.append(gx * sine + gy * cosine - omega * along[-1])
        weights = (1 / 6, 4 / 6, 1 / 6)
        mean_x = sum(w * over for w, over in zip(weights, over_x, strict=True))
        mean_y = sum(w * over for w, over in zip(weights, over_y, strict=True))
        return (along[2] - along[0]) / self.window + mean_x, (up[2] - up[0]) / self.window + mean_y
