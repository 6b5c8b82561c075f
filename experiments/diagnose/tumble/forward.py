"""What the sensors of a tumble campaign should have read, for many sets of parameters at once.

Method: every (trial, set of parameters) has one lane of the batched integrator (`rigid.batch.kernel`). All effects of
the library are compiled in; where one is off its values change nothing. So one kernel serves every candidate. The
motion is sampled at the measured times, and at both ends and the middle of every window of the IMU. Its mean specific
force is taken by parts as in `rigid.sensors`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.forms import OwnEffect
from experiments.diagnose.fit.problem import Array
from experiments.diagnose.fit.together import each
from rigid.ground.laws import NO_LOSS
from rigid.model.model import parameter_names
from rigid.terms import EFFECTS, Term, sensor_terms

from .data import TrialData, TumbleData
from .readings import Grid, Optics

__all__ = ["Forward", "OWN_TO_A_TRIAL", "Prediction", "SHARED"]

SHARED = ("mass", "inertia", "stiffness", "damping", "mu_s", "mu_d")
"""Numbers that all trials share and that may be uncertain."""
OWN_TO_A_TRIAL = ("gravity", "friction", "static_friction", "bed", "torque")
"""Factors that every trial has of its own: on its gravity, on mu_s and mu_d, on mu_s beside it, on K and C, and on the
torque."""
_MOST_BYTES = 1.5e8  # of the sampled motion of the lanes that share the end of their last step
_HELD_BYTES = 3.2e7
"""Of the sampled motion held at a time, in a buffer that is kept: it stays near the caches, and needs no new pages."""
_SETS_AT_ONCE = 64  # sets of parameters whose samples one thread turns into readings at a time


@dataclass(frozen=True)
class Prediction:
    """One trial under several sets of parameters."""

    value: Array
    """Shape [set_count, sample_count], in the order of `TrialData.value`; NaN where a set cannot stand or run."""
    state: NDArray[np.int8]  # number into rigid.STATES at each sample, shape [set_count, sample_count]; or [.., 0]
    motion: Array
    """x, y, theta, vx, vy, omega, wheel_speed at each sample, shape [set_count, sample_count, 7]; or [.., 0, 7]."""


@lru_cache(maxsize=8)
def _moving_terms(rig: bool) -> tuple[Term, ...]:
    """Effects on the motion; those with a coordinate of their own are no candidates, and would cost every lane."""
    found = [term for term in EFFECTS.values() if not term.sensor and (rig or not term.needs_rig)]
    return tuple(term for term in found if not any(hook.startswith("inner_") for hook in term.hooks))


class Forward:
    """The forward model of one campaign.

    `predict` takes arrays by name: the shared numbers ("mass" ...), effects' parameters ("pendulum.length",
    "clock-offset.offset"), each of shape [set_count]; and each trial's own, `OWN_TO_A_TRIAL`, of shape [set_count,
    trial_count].
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
        self.neutral = {f"{id}.{p.name}": p.default for id, term in EFFECTS.items() for p in term.parameters}
        """Value of each "<effect>.<parameter>" that changes nothing."""
        self.neutral |= {f"{mine.id}.{p.name}": mine.neutral(p.name) for mine in own for p in mine.term.parameters}
        self._grids = [Grid(trial, data.window, [own.term for own in self.own]) for trial in data.trials]
        self._buffer = np.empty(0)

    def predict(
        self,
        sets: Mapping[str, Array],
        *,
        trials: Sequence[int] | None = None,
        states: bool = True,
        motion: bool = False,
        horizon: float = 1.0,
    ) -> list[Prediction]:
        """Predictions, one a trial (of `trials`, all by default), for all sets at once.

        After the share `horizon` of a trial's time nothing is simulated, and values are meaningless. `states` and
        `motion`: whether these are wanted too. Results are bitwise equal for any number of threads.

        Raises ValueError for a name there is not.
        """
        chosen = range(len(self.data.trials)) if trials is None else trials
        count = max((np.shape(value)[0] for value in sets.values()), default=1)
        on = {name.partition(".")[0] for name in sets if "." in name}
        sensing = {term.id for term in (*EFFECTS.values(), *(own.term for own in self.own)) if term.sensor}
        moving = not on <= sensing
        terms = (*_moving_terms(self.rig), *(own.term for own in self.own if not own.term.sensor)) if moving else ()
        columns = self._columns(sets, count, terms)
        clock, lens = (self._of_sensors(hook, sets, count) for hook in ("clock", "lens"))
        slope = np.asarray(sets.get("slope.angle", np.zeros(count)), dtype=float)
        found = {}
        for trial in chosen:
            samples = len(self.data.trials[trial].time)
            found[trial] = Prediction(
                np.zeros((count, samples)),
                np.zeros((count, samples if states else 0), dtype=np.int8),
                np.zeros((count, samples if motion else 0, 7)),
            )
        for lanes in self._chunks(chosen, count):
            self._run(lanes, columns, terms, clock, lens, slope, horizon, found)
        return [found[trial] for trial in chosen]

    def _of_sensors(self, hook: str, sets: Mapping[str, Array], count: int) -> Array:
        """Parameters of the effects on sensors that have this hook, shape [set_count, parameter_count]."""
        terms = sensor_terms(hook, [own.term for own in self.own])
        names = [f"{term.id}.{name}" for term in terms for name in term.arguments(hook)]
        found = np.empty((count, len(names)))
        for k, name in enumerate(names):
            found[:, k] = sets.get(name, self.neutral[name])
        return found

    def _columns(self, sets: Mapping[str, Array], count: int, terms: tuple[Term, ...]) -> dict[str, Array]:
        for name in sets:
            if name not in self.nominal and name not in OWN_TO_A_TRIAL and name not in self.neutral:
                known = ", ".join((*SHARED, *sorted(self.neutral)))
                raise ValueError(f"{name!r} is no number of a tumble; there is {known}")
        columns = {
            name: np.broadcast_to(np.asarray(sets.get(name, value), dtype=float), (count,))
            for name, value in self.nominal.items()
        }
        each = np.ones((1, len(self.data.trials)))
        for name in OWN_TO_A_TRIAL:
            columns[name] = np.broadcast_to(np.asarray(sets.get(name, each), dtype=float), (count, each.size))
        for name in (f"{term.id}.{p.name}" for term in terms for p in term.parameters):
            columns[name] = np.broadcast_to(np.asarray(sets.get(name, self.neutral[name]), dtype=float), (count,))
        return columns

    def _chunks(self, chosen: Sequence[int], count: int) -> list[list[tuple[int, int, int]]]:
        """Lanes (trial, first set, set after the last) in chunks of one length that fit in memory."""
        chunks: dict[float, list[list[tuple[int, int, int]]]] = {}
        room: dict[float, float] = {}
        for trial in chosen:
            grid = self._grids[trial]
            lane = 88.0 * grid.size
            most = max(1, int(_MOST_BYTES / lane))
            for first in range(0, count, most):
                last = min(first + most, count)
                if room.get(grid.end, 0.0) < lane * (last - first):
                    chunks.setdefault(grid.end, []).append([])
                    room[grid.end] = _MOST_BYTES
                chunks[grid.end][-1].append((trial, first, last))
                room[grid.end] -= lane * (last - first)
        return [chunk for same_end in chunks.values() for chunk in same_end]

    def _run(
        self, lanes: list[tuple[int, int, int]], columns: Mapping[str, Array], terms: tuple[Term, ...],
        clock: Array, lens: Array, slope: Array, horizon: float, found: Mapping[int, Prediction],
    ) -> None:  # fmt: skip
        """Simulate these lanes and put their readings into `found`."""
        from rigid.batch.kernel import CHANNELS as RECORDED
        from rigid.batch.kernel import SUMMARY, batch_kernel
        from rigid.batch.runtime import ensure
        from rigid.planar.trajectory import LAUNCH_DISTANCE

        ensure(threads=self.threads)
        stand, advance = batch_kernel(terms, "spring-damper", self.data.tables.platform.rows)
        sampled = {}
        for trial, first, last in lanes:
            until = np.inf if horizon >= 1 else horizon * self.data.trials[trial].end + self.data.window
            sampled[trial, first] = self._grids[trial].times(clock[first:last], until)
        total = sum(last - first for _, first, last in lanes)
        width = max(times.shape[1] for times, _ in sampled.values())
        numbers = np.empty((total, 16 + len(parameter_names(terms))))
        times = np.empty((total, width))
        at = 0
        for trial, first, last in lanes:
            rows = slice(at, at + last - first)
            self._fill(numbers[rows], self.data.trials[trial], trial, columns, terms, slice(first, last))
            own = sampled[trial, first][0]
            times[rows, : own.shape[1]] = own
            times[rows, own.shape[1] :] = own[:, -1:]
            at += last - first
        poses = np.zeros((total, 2))
        stand(numbers, poses)
        end = float(times.max()) + 1e-9
        steps = math.ceil(end / self.time_step)
        most = max(1, int(_HELD_BYTES / (8 * width * len(RECORDED))))
        for begin in range(0, total, most):
            rows = slice(begin, min(begin + most, total))
            summary = np.full((rows.stop - begin, len(SUMMARY)), np.nan)
            series = self._held(len(summary), width, len(RECORDED))
            advance(
                numbers[rows], poses[rows], times[rows], self.time_step, steps, end, LAUNCH_DISTANCE, summary, series
            )
            series[~np.isin(summary[:, SUMMARY.index("status")], (0.0, 1.0))] = np.nan

            def read(piece: tuple[int, int, int, int, int], series: Array = series) -> None:
                trial, first, low, high, row = piece
                local, sets = self.data.trials[trial].local_gravity, slice(low, high)
                pull = columns["gravity"][sets, trial] * self.data.trials[trial].gravity_sim
                pull = pull if local is None else np.full(high - low, local)
                place, one = sampled[trial, first][1], found[trial]
                self._grids[trial].read(
                    series[row : row + high - low], place if len(place) == 1 else place[low - first : high - first],
                    Optics(clock[sets], pull, slope[sets], lens[sets]), horizon,
                    one.value[sets], one.state[sets], one.motion[sets],
                )  # fmt: skip

            each(read, list(_pieces(lanes, rows)), threads=self.threads)

    def _held(self, *shape: int) -> Array:
        """An array for the motion of some lanes. Its content is meaningless, and its next user overwrites it."""
        size = math.prod(shape)
        if len(self._buffer) < size:
            self._buffer = np.empty(size)
        return self._buffer[:size].reshape(shape)

    def _fill(
        self, numbers: Array, trial: TrialData, index: int, columns: Mapping[str, Array], terms: tuple[Term, ...],
        sets: slice,
    ) -> None:  # fmt: skip
        """Rows of numbers as `rigid.batch.kernel` wants them (FIXED_NUMBERS, the ground's law, the effects')."""
        length, rows = self.data.tables.platform.spike_length, self.data.tables.platform.rows
        gravity = columns["gravity"][sets, index] * trial.gravity_sim
        mass = columns["mass"][sets]
        bed, rubs = columns["bed"][sets, index], columns["friction"][sets, index]
        sliding = rubs * np.minimum(columns["mu_d"][sets], columns["mu_s"][sets])
        sticking = np.maximum(rubs * columns["static_friction"][sets, index] * columns["mu_s"][sets], sliding)
        fixed = (
            mass, columns["inertia"][sets], length, length * math.cos(math.pi / rows), trial.counterweight,
            gravity if trial.local_gravity is None else trial.local_gravity, (mass + trial.counterweight) * gravity,
            columns["torque"][sets, index] * trial.torque, trial.torque_until, self.data.tables.wheel.inertia,
            1.0 if trial.actuator == "motor" else -1.0, trial.wheel_speed_0,
            sticking, sliding,
            bed * columns["stiffness"][sets], bed * columns["damping"][sets],
        )  # fmt: skip
        for k, value in enumerate(fixed):
            numbers[:, k] = value
        names = [f"{term.id}.{p.name}" for term in terms for p in term.parameters]
        for k, name in enumerate(names):
            numbers[:, len(fixed) + k] = columns[name][sets]
        numbers[:, -3:] = 1.0, *NO_LOSS  # the spring-damper gives all back


def _pieces(lanes: Sequence[tuple[int, int, int]], rows: slice) -> Iterator[tuple[int, int, int, int, int]]:
    """Pieces of the lanes in `rows`: trial, first set of its lanes, first set of the piece, set after it, its row."""
    at = 0
    for trial, first, last in lanes:
        low, high = max(first, first + rows.start - at), min(last, first + rows.stop - at)
        for begin in range(low, high, _SETS_AT_ONCE):
            yield trial, first, begin, min(begin + _SETS_AT_ONCE, high), at + begin - first - rows.start
        at += last - first
