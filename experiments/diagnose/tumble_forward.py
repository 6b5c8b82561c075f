"""What the sensors of a tumble campaign should have read, for many sets of parameters at once.

Method: one lane of the batched integrator (`rigid.batch_kernel`) for every (trial, set of parameters), all effects of
the library compiled in with values that change nothing where they are off, so one kernel serves every candidate. The
motion is sampled at the measured times themselves, and at both ends and the middle of every window of the IMU, whose
mean specific force is taken by parts as in `rigid.sensors`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rigid.model import parameter_names
from rigid.terms import EFFECTS, Term

from .own import OwnEffect
from .tumble_data import CHANNELS, TrialData, TumbleData

__all__ = ["Forward", "OWN_TO_A_TRIAL", "Prediction", "SHARED", "neutral"]

Array = NDArray[np.float64]

SHARED = ("mass", "inertia", "stiffness", "damping", "mu_s", "mu_d")
"""Numbers that all trials share and that may be uncertain."""
OWN_TO_A_TRIAL = ("gravity", "bed", "friction")
"""Factors that every trial has of its own."""
_MOST_BYTES = 1.5e8
"""Of the sampled motion held at a time."""


@dataclass(frozen=True)
class Prediction:
    """One trial under several sets of parameters."""

    value: Array
    """Shape [set_count, sample_count], in the order of `TrialData.value`; NaN where a set cannot stand or run."""
    state: NDArray[np.int8]
    """Number into rigid.STATES at each sample, shape [set_count, sample_count]."""
    motion: Array
    """x, y, theta, vx, vy, omega, wheel_speed at each sample, shape [set_count, sample_count, 7]; or [.., 0, 7]."""


@lru_cache(maxsize=8)
def _moving_terms(rig: bool) -> tuple[Term, ...]:
    """Effects on the motion; those with a coordinate of their own are no candidates, and would cost every lane."""
    found = [term for term in EFFECTS.values() if not term.sensor and (rig or not term.needs_rig)]
    return tuple(term for term in found if not any(hook.startswith("inner_") for hook in term.hooks))


def neutral(name: str) -> float:
    """The value of "<effect>.<parameter>" that changes nothing."""
    effect, _, parameter = name.partition(".")
    return next(p.default for p in EFFECTS[effect].parameters if p.name == parameter)


class Forward:
    """The forward model of one campaign.

    `predict` takes arrays by name: the shared numbers ("mass" ...), effects' parameters ("pendulum.length",
    "clock-offset.offset"), each of shape [set_count]; and each trial's own, `OWN_TO_A_TRIAL`, of shape [set_count,
    trial_count]: "gravity" (over its stated one), "bed" (a factor on K and C), "friction" (on mu_s and mu_d).
    """

    def __init__(
        self, data: TumbleData, *, time_step: float = 5e-4, threads: int | None = None, own: Sequence[OwnEffect] = ()
    ) -> None:
        self.data, self.time_step, self.threads = data, time_step, threads
        self.own = tuple(own)
        tables = data.tables
        self.rig = tables.rig is not None
        self.nominal = {
            "mass": tables.platform.mass, "inertia": tables.platform.inertia,
            "stiffness": tables.surface.stiffness, "damping": tables.surface.damping,
            "mu_s": tables.surface.mu_s, "mu_d": tables.surface.sliding_friction,
        }  # fmt: skip
        self._grids = [_Grid(trial, data.window) for trial in data.trials]
        self.simulated = 0
        """How many trials have been simulated so far."""

    def neutral(self, name: str) -> float:
        """The value of "<effect>.<parameter>" that changes nothing."""
        effect, _, parameter = name.partition(".")
        for own in self.own:
            if own.id == effect:
                return own.off if parameter == own.amplitude else own.typical[parameter]
        return neutral(name)

    def predict(
        self,
        sets: Mapping[str, Array],
        *,
        trials: Sequence[int] | None = None,
        motion: bool = False,
        horizon: float = 1.0,
    ) -> list[Prediction]:
        """Predictions, one a trial (of `trials`, all by default), for all sets at once.

        After the share `horizon` of a trial's time nothing is simulated, and what is given is of no meaning.

        Raises ValueError for a name there is not.
        """
        chosen = range(len(self.data.trials)) if trials is None else trials
        count = max((np.shape(value)[0] for value in sets.values()), default=1)
        on = {name.partition(".")[0] for name in sets if "." in name}
        moving = any(id not in EFFECTS or not EFFECTS[id].sensor for id in on)
        terms = (*_moving_terms(self.rig), *(own.term for own in self.own)) if moving else ()
        columns = self._columns(sets, count, terms)
        clock, lens = np.empty((count, 2)), np.empty((count, 2))
        for k, name in enumerate(("clock-offset.offset", "clock-offset.drift")):
            clock[:, k] = sets.get(name, neutral(name))
        for k, name in enumerate(("camera-scale.scale", "camera-scale.bend")):
            lens[:, k] = sets.get(name, neutral(name))
        slope = np.asarray(sets.get("slope.angle", np.zeros(count)), dtype=float)
        found = []
        for lanes in self._chunks(chosen, count):
            found += self._run(lanes, columns, terms, clock, lens, slope, motion, horizon)
        return _joined(found, chosen, count)

    def _columns(self, sets: Mapping[str, Array], count: int, terms: tuple[Term, ...]) -> dict[str, Array]:
        every = (*EFFECTS.values(), *(own.term for own in self.own))
        known = {f"{term.id}.{p.name}" for term in every for p in term.parameters}
        for name in sets:
            if name not in self.nominal and name not in OWN_TO_A_TRIAL and name not in known:
                raise ValueError(f"{name!r} is no number of a tumble; there is {', '.join((*SHARED, *sorted(known)))}")
        columns = {
            name: np.broadcast_to(np.asarray(sets.get(name, value), dtype=float), (count,))
            for name, value in self.nominal.items()
        }
        each = np.ones((1, len(self.data.trials)))
        for name in OWN_TO_A_TRIAL:
            columns[name] = np.broadcast_to(np.asarray(sets.get(name, each), dtype=float), (count, each.size))
        for term in terms:
            for p in term.parameters:
                name = f"{term.id}.{p.name}"
                off = self.neutral(name)
                columns[name] = np.broadcast_to(np.asarray(sets.get(name, off), dtype=float), (count,))
        return columns

    def _chunks(self, chosen: Sequence[int], count: int) -> list[list[tuple[int, int, int]]]:
        """Lanes (trial, first set, set after the last) in chunks of one length that fit in memory."""
        chunks: dict[float, list[list[tuple[int, int, int]]]] = {}
        room: dict[float, float] = {}
        for trial in chosen:
            grid = self._grids[trial]
            each = 88.0 * grid.size
            most = max(1, int(_MOST_BYTES / each))
            for first in range(0, count, most):
                last = min(first + most, count)
                if room.get(grid.end, 0.0) < each * (last - first):
                    chunks.setdefault(grid.end, []).append([])
                    room[grid.end] = _MOST_BYTES
                chunks[grid.end][-1].append((trial, first, last))
                room[grid.end] -= each * (last - first)
        return [chunk for same_end in chunks.values() for chunk in same_end]

    def _run(
        self, lanes: list[tuple[int, int, int]], columns: Mapping[str, Array], terms: tuple[Term, ...],
        clock: Array, lens: Array, slope: Array, motion: bool, horizon: float,
    ) -> list[tuple[int, int, Prediction]]:  # fmt: skip
        from rigid.batch_kernel import CHANNELS as RECORDED
        from rigid.batch_kernel import SUMMARY, batch_kernel
        from rigid.runtime import ensure
        from rigid.trajectory import LAUNCH_DISTANCE

        ensure(threads=self.threads)
        stand, advance = batch_kernel(terms, "spring-damper", self.data.tables.platform.rows)
        total = sum(last - first for _, first, last in lanes)
        width = max(self._grids[trial].size for trial, _, _ in lanes)
        numbers = np.empty((total, 16 + len(parameter_names(terms))))
        times = np.empty((total, width))
        at, end = 0, 0.0
        for trial, first, last in lanes:
            rows, grid = slice(at, at + last - first), self._grids[trial]
            self._fill(numbers[rows], self.data.trials[trial], trial, columns, terms, slice(first, last))
            until = np.inf if horizon >= 1 else horizon * self.data.trials[trial].end + self.data.window
            own = np.minimum(grid.times(clock[first:last]), until)
            times[rows, : grid.size] = own
            times[rows, grid.size :] = own[:, -1:]
            end = max(end, float(own.max()))
            at += last - first
        poses = np.zeros((total, 2))
        stand(numbers, poses)
        summary = np.full((total, len(SUMMARY)), np.nan)
        series = np.full((total, width, len(RECORDED)), np.nan)
        end += 1e-9
        steps = math.ceil(end / self.time_step)
        advance(numbers, poses, times, self.time_step, steps, end, LAUNCH_DISTANCE, summary, series)
        self.simulated += total
        series[~np.isin(summary[:, SUMMARY.index("status")], (0.0, 1.0))] = np.nan
        found, at = [], 0
        for trial, first, last in lanes:
            rows = slice(at, at + last - first)
            local = self.data.trials[trial].local_gravity
            pull = columns["gravity"][first:last, trial] * self.data.trials[trial].gravity_sim
            pull = pull if local is None else np.full(last - first, local)
            grid, sets = self._grids[trial], slice(first, last)
            value, state, moved = grid.read(
                series[rows, : grid.size], clock[sets], pull, slope[sets], lens[sets], motion
            )
            found.append((trial, first, Prediction(value, state, moved)))
            at += last - first
        return found

    def _fill(
        self, numbers: Array, trial: TrialData, index: int, columns: Mapping[str, Array], terms: tuple[Term, ...],
        sets: slice,
    ) -> None:  # fmt: skip
        """Rows of numbers as `rigid.batch_kernel` wants them (FIXED_NUMBERS, the ground's law, the effects')."""
        length, rows = self.data.tables.platform.spike_length, self.data.tables.platform.rows
        gravity = columns["gravity"][sets, index] * trial.gravity_sim
        mass = columns["mass"][sets]
        bed, rubs = columns["bed"][sets, index], columns["friction"][sets, index]
        fixed = (
            mass, columns["inertia"][sets], length, length * math.cos(math.pi / rows), trial.counterweight,
            gravity if trial.local_gravity is None else trial.local_gravity, (mass + trial.counterweight) * gravity,
            trial.torque, trial.torque_until, self.data.tables.wheel.inertia,
            1.0 if trial.actuator == "motor" else -1.0, trial.wheel_speed_0,
            rubs * columns["mu_s"][sets], rubs * np.minimum(columns["mu_d"][sets], columns["mu_s"][sets]),
            bed * columns["stiffness"][sets], bed * columns["damping"][sets],
        )  # fmt: skip
        for k, value in enumerate(fixed):
            numbers[:, k] = value
        names = [f"{term.id}.{p.name}" for term in terms for p in term.parameters]
        for k, name in enumerate(names):
            numbers[:, len(fixed) + k] = columns[name][sets]
        numbers[:, -1] = 1.0  # the spring-damper gives all back


class _Grid:
    """When one trial is to be sampled, and how its samples become readings."""

    def __init__(self, trial: TrialData, window: float) -> None:
        self.window = window
        self.channel = trial.channel
        imu = np.isin(trial.channel, [CHANNELS.index(name) for name in ("gyro", "ax", "ay")])
        force = np.isin(trial.channel, [CHANNELS.index(name) for name in ("ax", "ay")])
        self.camera_time, self.camera_row = np.unique(trial.time[~imu], return_inverse=True)
        self.imu_time, self.imu_row = np.unique(trial.time[imu], return_inverse=True)
        self.camera_at, self.imu_at = np.cumsum(~imu) - 1, np.cumsum(imu) - 1  # of a sample, among its clock's
        self.imu, self.force = imu, force
        self.parts = 3 if window > 0 and force.any() else 1
        self.size = len(self.camera_time) + self.parts * len(self.imu_time)
        half = 0.5 * window if self.parts == 3 else 0.0
        latest = max(self.camera_time[-1:].tolist() + (self.imu_time[-1:] + half).tolist())
        self.end = round(max(latest, 1e-3), 1)
        self._sorted: dict[tuple[float, float], tuple[Array, NDArray[np.intp]]] = {}

    def _true(self, clock: tuple[float, float]) -> Array:
        """True times [s] of the IMU's rows, its clock being off by the first and gaining the second in a second."""
        return (self.imu_time - clock[0]) / (1.0 + clock[1])

    def _plain(self, clock: tuple[float, float]) -> tuple[Array, NDArray[np.intp]]:
        """Rising sample times for a clock that is off and gains, and where each reading's sample has gone."""
        if clock not in self._sorted:
            if len(self._sorted) > 64:
                self._sorted.clear()
            true = self._true(clock)
            half = 0.5 * self.window
            parts = (true - half, true, true + half) if self.parts == 3 else (true,)
            wanted = np.maximum(np.concatenate([self.camera_time, *parts]), 0.0)
            order = np.argsort(wanted, kind="stable")
            place = np.empty_like(order)
            place[order] = np.arange(len(order))
            self._sorted[clock] = (wanted[order], place)
        return self._sorted[clock]

    def times(self, clock: Array) -> Array:
        """Sample times [s], never below 0, shape [set_count, size]."""
        return np.stack([self._plain((float(offset), float(drift)))[0] for offset, drift in clock])

    def read(
        self, series: Array, clock: Array, pull: Array, slope: Array, lens: Array, motion: bool
    ) -> tuple[Array, NDArray[np.int8], Array]:
        """Readings and states, shape [set_count, sample_count], from the sampled motion of one trial.

        Args:
            series: as the batch recorded it at `times`, shape [set_count, size, channel].
            clock: by what the IMU's is off [s] and what it gains in a second [1], shape [set_count, 2].
            pull: local gravity [m/s2], shape [set_count] like the rest.
            slope: of the surface [rad].
            lens: the camera's scale [1] and what it grows by with the distance's square [1/m2], shape [set_count, 2].
            motion: whether to give the motion at every sample too.
        """
        count = len(series)
        value = np.empty((count, len(self.channel)))
        state = np.empty((count, len(self.channel)), dtype=np.int8)
        moved = np.empty((count, len(self.channel), 7)) if motion else np.empty((count, 0, 7))
        for one in np.unique(clock, axis=0):
            sets = np.flatnonzero((clock == one).all(axis=1))
            self._read(series, sets, (float(one[0]), float(one[1])), pull, slope, lens, value, state, moved)
        return value, state, moved

    def _read(
        self, series: Array, sets: NDArray[np.intp], clock: tuple[float, float], pull: Array, slope: Array, lens: Array,
        value: Array, state: NDArray[np.int8], moved: Array,
    ) -> None:  # fmt: skip
        place = self._plain(clock)[1]
        here = series if len(sets) == len(series) else series[sets]
        cameras, imus = len(self.camera_time), len(self.imu_time)
        camera = here[:, place[:cameras]]
        parts = [here[:, place[cameras + k * imus : cameras + (k + 1) * imus]] for k in range(self.parts)]
        middle = parts[self.parts // 2] if imus else camera[:, :0]
        seen = lens[sets, 0, None]
        if lens[sets, 1].any():
            away = (camera[:, :, 0] - camera[:, :1, 0]) ** 2 + (camera[:, :, 1] - camera[:, :1, 1]) ** 2
            seen = seen + lens[sets, 1, None] * away
        readings = {
            "x": seen * camera[:, :, 0], "y": seen * camera[:, :, 1],
            "theta": camera[:, :, 2], "wheel": np.abs(camera[:, :, 8]), "gyro": middle[:, :, 5],
        }  # fmt: skip
        if self.force.any():
            readings["ax"], readings["ay"] = self._specific_force(parts, clock, pull[sets], slope[sets])
        for number, name in enumerate(CHANNELS):
            mine = np.flatnonzero(self.channel == number)
            if not len(mine):
                continue
            rows = self.imu_row[self.imu_at[mine]] if self.imu[mine[0]] else self.camera_row[self.camera_at[mine]]
            source = middle if self.imu[mine[0]] else camera
            value[np.ix_(sets, mine)] = readings[name][:, rows]
            numbers = source[:, rows, 9]
            state[np.ix_(sets, mine)] = np.where(np.isfinite(numbers), numbers, 0).astype(np.int8)
            if moved.shape[1]:
                moved[np.ix_(sets, mine)] = source[:, rows][:, :, (0, 1, 2, 3, 4, 5, 8)]

    def _specific_force(
        self, parts: list[Array], clock: tuple[float, float], pull: Array, slope: Array
    ) -> tuple[Array, Array]:
        """In body axes [m/s2]: mean over the window by parts (`rigid.sensors`), the integral by Simpson's rule."""
        gx, gy = (pull * np.sin(slope))[:, None], (pull * np.cos(slope))[:, None]
        if self.parts == 1:
            at = parts[0]
            sine, cosine = np.sin(at[:, :, 2]), np.cos(at[:, :, 2])
            moves = self._true(clock) >= 0
            ax, ay = np.where(moves, at[:, :, 6], 0.0) + gx, np.where(moves, at[:, :, 7], 0.0) + gy
            return ax * cosine - ay * sine, ax * sine + ay * cosine
        along, up, over_x, over_y = [], [], [], []
        for at in parts:
            sine, cosine = np.sin(at[:, :, 2]), np.cos(at[:, :, 2])
            along.append(at[:, :, 3] * cosine - at[:, :, 4] * sine)
            up.append(at[:, :, 3] * sine + at[:, :, 4] * cosine)
            over_x.append(at[:, :, 5] * up[-1] + gx * cosine - gy * sine)
            over_y.append(gx * sine + gy * cosine - at[:, :, 5] * along[-1])
        weights = (1 / 6, 4 / 6, 1 / 6)
        mean_x = sum(w * over for w, over in zip(weights, over_x, strict=True))
        mean_y = sum(w * over for w, over in zip(weights, over_y, strict=True))
        return (along[2] - along[0]) / self.window + mean_x, (up[2] - up[0]) / self.window + mean_y


def _joined(found: list[tuple[int, int, Prediction]], chosen: Sequence[int], count: int) -> list[Prediction]:
    """The pieces of every trial put together, in the order of `chosen`."""
    joined = []
    for trial in chosen:
        own = [piece for at, _, piece in sorted((f for f in found if f[0] == trial), key=lambda f: f[1])]
        joined.append(
            own[0]
            if len(own) == 1
            else Prediction(
                np.concatenate([piece.value for piece in own]),
                np.concatenate([piece.state for piece in own]),
                np.concatenate([piece.motion for piece in own]),
            )
        )
    return joined
