"""Thousands of planar trials at once, compiled by Taichi: `simulate_batch`.

The terms are those of the accurate integrator. Parameters differ from trial to trial; which effects are on, the law of
the ground and the number of spikes are the same for all, since the kernel is compiled for them (once; it is kept).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid.checks import check_above_zero
from rigid.model.model import parameter_names
from rigid.model.trial import Trial
from rigid.planar.simulate import check_step, step_bound
from rigid.planar.trajectory import LAUNCH_DISTANCE, STATES

__all__ = ["BatchTrajectory", "simulate_batch"]

Array = NDArray[np.float64]

_FIXED = (
    "mass", "inertia", "spike_length", "counterweight", "torque", "torque_until", "wheel_inertia", "wheel_speed_0",
    "mu_s", "mu_d", "gravity_sim", "gravity", "stiffness", "damping",
)  # fmt: skip
"""Numbers of a trial that may vary within a batch."""


@dataclass(frozen=True, kw_only=True)
class BatchTrajectory:
    """What a batch did. Summary arrays have shape [trial_count], series [trial_count, sample_count]; SI units.

    A trial that cannot stand at the start (`stands` False) has NaN everywhere.
    """

    trial_count: int
    time_step: float
    stands: NDArray[np.bool_]
    trajectory_angle: Array  # [rad]; NaN if the centre never gets 10 mm away
    max_speed: Array
    max_angular_velocity: Array
    transition_angles: dict[str, Array]  # theta [rad] at the first entry into each state; NaN if it never comes
    final: dict[str, Array]  # x, y, theta, vx, vy, omega, wheel_speed at the end
    events: Array  # How often a step was cut at an event
    time: Array
    """Sample times [s], shape [sample_count], or [trial_count, sample_count] if they differ; empty without series."""
    series: Array
    """Shape [trial_count, sample_count, channel]; the channels are x, y, theta, vx, vy, omega, ax, ay, wheel_speed and
    the state's number (STATES)."""

    def channel(self, name: str) -> Array:
        """One channel of the series, shape [trial_count, sample_count]. Raises ValueError for an unknown one."""
        from .kernel import CHANNELS

        if name not in CHANNELS:
            raise ValueError(f"channel {name!r} must be one of {', '.join(CHANNELS)}")
        return self.series[:, :, CHANNELS.index(name)]


def simulate_batch(
    trials: Sequence[Trial] | Trial,
    *,
    duration: float,
    vary: Mapping[str, ArrayLike] | None = None,
    time_step: float = 1e-3,
    times: ArrayLike | None = None,
    sample_every: int | None = None,
    threads: int | None = None,
) -> BatchTrajectory:
    """Integrate many trials from static equilibrium to `duration`.

    Args:
        trials: trials with the same effects, ground law, actuator kind and number of spikes; or one trial and `vary`.
        duration: end [s].
        vary: with one trial: arrays of shape [trial_count], by the names of `Trial`'s numbers ("mass", "mu_s" ...;
            "mu_d" follows "mu_s" where it is not given) or "<effect>.<parameter>" ("pendulum.length").
        time_step: [s].
        times: sample times [s] within 0 to `duration`, rising, shape [sample_count] or [trial_count, sample_count].
        sample_every: record every so many steps instead. Without `times` and `sample_every` only the summary is kept.
        threads: CPU threads where Taichi is not running yet.

    Raises ValueError: trials that do not go together, a number that cannot be, a time step too long for a ground.
    RuntimeError: a trial's motion is no longer finite; Taichi runs in single precision in this process.
    """
    check_above_zero("s", duration=duration, time_step=time_step)
    if time_step > duration:
        raise ValueError(f"time_step = {time_step:g} s must be at most duration = {duration:g} s")
    first, numbers = _one_varied(trials, vary) if isinstance(trials, Trial) else _many(trials, vary)
    _check_stiffest(first, numbers, time_step)
    count = len(numbers)
    samples = _sample_times(duration, time_step, times, sample_every, count)

    from .kernel import CHANNELS, SUMMARY, batch_kernel
    from .runtime import ensure

    ensure(threads=threads)
    stand, advance = batch_kernel(first.terms, first.surface.name, first.spike_count)
    poses = np.zeros((count, 2))
    stand(numbers, poses)
    summary = np.full((count, len(SUMMARY)), np.nan)
    series = np.full((count, max(samples.shape[1], 1), len(CHANNELS)), np.nan)
    steps = math.ceil(duration / time_step * (1 - 1e-12))
    shown = samples if samples.shape[1] else np.full((1, 1), np.inf)
    advance(numbers, poses, shown, time_step, steps, duration, LAUNCH_DISTANCE, summary, series)
    column = {name: summary[:, k].copy() for k, name in enumerate(SUMMARY)}
    stiff = np.flatnonzero(column["status"] == 4)
    if len(stiff):
        raise ValueError(
            f"time_step = {time_step:g} s is too long for the spring or damper of an effect ("
            f"{', '.join(term.id for term in first.terms if 'inner_mass' in term.hooks)}) in trial {stiff[0]}: at most "
            f"{column['longest_step'][stiff[0]]:.3g} s"
        )
    stands = column["status"] != 3
    wrong = np.flatnonzero(column["status"] == 2)
    if len(wrong):
        raise RuntimeError(f"the motion of trial {wrong[0]} of the batch is no longer finite")
    for name in SUMMARY:
        column[name][~stands] = np.nan
    deep = np.flatnonzero(column["status"] == 1)
    batch = BatchTrajectory(
        trial_count=count, time_step=time_step, stands=stands, trajectory_angle=column["trajectory_angle"],
        max_speed=column["max_speed"], max_angular_velocity=column["max_angular_velocity"],
        transition_angles={name: column[name] for name in STATES},
        final={name: column[name] for name in ("x", "y", "theta", "vx", "vy", "omega", "wheel_speed")},
        events=column["splits"], time=samples[0] if len(samples) == 1 else samples,
        series=series[:, : samples.shape[1]],
    )  # fmt: skip
    if len(deep):
        raise RuntimeError(
            f"trial {deep[0]} of the batch sinks so deep that four rows of spikes would touch: use `simulate` for it"
        )
    return batch


def _many(trials: Sequence[Trial], vary: Any) -> tuple[Trial, Array]:
    if vary is not None:
        raise ValueError("vary goes with one trial, not with a sequence of them")
    if not trials:
        raise ValueError("trials is empty: at least one is needed")
    first = trials[0]
    kind = (first.terms, first.surface.name, first.spike_count)
    for k, trial in enumerate(trials):
        if (trial.terms, trial.surface.name, trial.spike_count) != kind:
            raise ValueError(
                f"trials[{k}] has other effects, another ground or another number of spikes than trials[0]: a batch is "
                f"compiled for one set"
            )
    return first, np.array([_row(trial) for trial in trials])


def _row(trial: Trial) -> list[float]:
    fixed = [
        trial.mass, trial.inertia, trial.spike_length, trial.spike_length * math.cos(math.pi / trial.spike_count),
        trial.counterweight, trial.pull_at_mass, trial.weight, trial.torque, trial.torque_until, trial.wheel_inertia,
        1.0 if trial.actuator == "motor" else -1.0, trial.wheel_speed_0, trial.mu_s, trial.sliding_friction,
    ]  # fmt: skip
    return [*fixed, *trial.surface.numbers, *trial.effect_numbers().values()]


def _one_varied(trial: Trial, vary: Mapping[str, ArrayLike] | None) -> tuple[Trial, Array]:
    given = {key: np.asarray(value, dtype=float) for key, value in (vary or {}).items()}
    sizes = {value.shape for value in given.values()} or {(1,)}
    if len(sizes) != 1 or len(next(iter(sizes))) != 1:
        raise ValueError(f"vary must hold arrays of one length, not of shapes {sorted(sizes)}")
    count = next(iter(sizes))[0]
    if count == 0:
        raise ValueError("vary holds empty arrays: at least one trial is needed")
    known = {f"{effect.id}.{name}" for effect in trial.effects for name in effect.values}
    own = {f"{effect.id}.{p.name}": p for effect in trial.effects for p in effect.term.parameters}
    endless = {key for key, p in own.items() if p.default == math.inf}
    for key, value in given.items():
        if key not in _FIXED and key not in known:
            raise ValueError(f"vary has {key!r}, which does not vary; there is {', '.join((*_FIXED, *sorted(known)))}")
        if not np.isfinite(value[np.isfinite(value) | (key not in {"torque_until", *endless})]).all():
            raise ValueError(f"vary[{key!r}] holds numbers that are not finite")
        worst = (value.min(), value.max())
        for extreme in worst:  # each bound of each number is checked where it is made: by the trial itself
            _with(trial, {key: float(extreme)}, quiet=set(given) - {key})
    if ("stiffness" in given or "damping" in given) and trial.ground is not None:
        raise ValueError("vary has stiffness or damping, but the trial's ground has numbers of its own")
    numbers = np.tile(np.array(_row(trial)), (count, 1))

    def get(key: str) -> Array:
        return given.get(key, np.full(count, float(getattr(trial, key))))

    columns = ("mass", "inertia", "spike_length", None, "counterweight", None, None, "torque", "torque_until",
               "wheel_inertia", None, "wheel_speed_0", "mu_s")  # fmt: skip
    for k, name in enumerate(columns):
        if name:
            numbers[:, k] = get(name)
    numbers[:, 3] = get("spike_length") * math.cos(math.pi / trial.spike_count)
    numbers[:, 5] = np.where(get("counterweight") > 0, get("gravity"), get("gravity_sim"))
    numbers[:, 6] = (get("mass") + get("counterweight")) * get("gravity_sim")
    if "mu_d" in given:
        numbers[:, 13] = given["mu_d"]
    elif trial.mu_d is None:
        numbers[:, 13] = 0.5 * get("mu_s")
    start = 14
    if trial.ground is None:
        numbers[:, start], numbers[:, start + 1] = get("stiffness"), get("damping")
    start += len(trial.surface.numbers)
    names = [f"{effect.id}.{name}" for effect in trial.effects if not effect.term.sensor for name in effect.values]
    assert len(names) + 1 == len(parameter_names(trial.terms))
    for k, name in enumerate(names):
        if name in given:
            numbers[:, start + k] = given[name]
    _check_together(numbers)
    return trial, numbers


def _check_together(numbers: Array) -> None:
    """What only shows between two numbers of one trial."""
    mass, inertia, length, counterweight = numbers[:, 0], numbers[:, 1], numbers[:, 2], numbers[:, 4]
    for name, wrong in (
        ("inertia must not exceed mass spike_length^2", inertia > mass * length**2),
        ("inertia must exceed wheel_inertia", numbers[:, 9] >= inertia),
        ("counterweight must be below mass", counterweight >= mass),
        ("mu_d must not exceed mu_s", numbers[:, 13] > numbers[:, 12]),
    ):
        if wrong.any():
            raise ValueError(f"vary: {name}; it does in trial {int(np.flatnonzero(wrong)[0])}")


def _with(trial: Trial, changes: Mapping[str, float], *, quiet: set[str]) -> Trial:
    """The trial with other numbers. `quiet`: numbers that vary as well, so that pairs are not judged here."""
    plain: dict[str, Any] = {key: value for key, value in changes.items() if "." not in key}
    effects = []
    for effect in trial.effects:
        own = {key.partition(".")[2]: v for key, v in changes.items() if key.partition(".")[0] == effect.id}
        effects.append(replace(effect, parameters={**effect.parameters, **own}) if own else effect)
    if "mass" in plain:
        room = {"inertia": min(trial.inertia, 0.5 * plain["mass"] * trial.spike_length**2)} if plain["mass"] > 0 else {}
        if trial.counterweight:
            room["counterweight"] = 0.5 * plain["mass"]
        plain = {**room, **plain} if "inertia" in quiet or "counterweight" in quiet else plain
    if "mu_s" in plain and trial.mu_d is not None and "mu_d" in quiet:
        plain["mu_d"] = 0.0
    if "mu_d" in plain and "mu_s" in quiet:
        plain["mu_s"] = max(trial.mu_s, plain["mu_d"])
    if "inertia" in plain and "mass" in quiet:
        plain["mass"] = max(trial.mass, plain["inertia"] / trial.spike_length**2)
    if "inertia" in plain and "wheel_inertia" in quiet:
        plain["wheel_inertia"] = min(trial.wheel_inertia, 0.5 * plain["inertia"])
    if "wheel_inertia" in plain and "inertia" in quiet:
        most = plain.get("mass", trial.mass) * trial.spike_length**2
        plain.setdefault("inertia", min(max(trial.inertia, 2 * plain["wheel_inertia"]), most))
    if "counterweight" in plain and "mass" in quiet:
        plain["mass"] = max(trial.mass, 1.01 * plain["counterweight"])
    return replace(trial, effects=tuple(effects), **plain)


def _check_stiffest(first: Trial, numbers: Array, time_step: float) -> None:
    if first.surface.name == "spring-damper":
        decoupled = any("inner_mass" in term.hooks for term in first.terms)  # the counterweight, by its wires
        carried = 0.0 if decoupled else numbers[:, 4]
        inverse = 1 / (numbers[:, 0] + carried) + numbers[:, 2] ** 2 / numbers[:, 1]
        stiffness, damping = numbers[:, 14], numbers[:, 15]
        # The worst of each kind: the bound falls with stiffness / M and with damping / M.
        for worst in {int(np.argmax(stiffness * inverse)), int(np.argmax(damping * inverse))}:
            bound = step_bound(float(stiffness[worst]), float(damping[worst]), float(inverse[worst]))
            if time_step > bound:
                raise ValueError(
                    f"time_step = {time_step:g} s is too long for the ground of trial {worst} (stiffness = "
                    f"{stiffness[worst]:g} N/m, damping = {damping[worst]:g} N s/m): at most {bound:.3g} s"
                )
    else:
        check_step(first, time_step)


def _sample_times(
    duration: float, time_step: float, times: ArrayLike | None, sample_every: int | None, count: int
) -> Array:
    if times is not None and sample_every is not None:
        raise ValueError("times and sample_every exclude each other")
    if sample_every is not None:
        if isinstance(sample_every, bool) or not isinstance(sample_every, int) or sample_every < 1:
            raise ValueError(f"sample_every = {sample_every!r} must be a whole number of 1 or more")
        steps = math.ceil(duration / time_step * (1 - 1e-12))
        return np.minimum(np.arange(0, steps + 1, sample_every) * time_step, duration)[None]
    if times is None:
        return np.zeros((1, 0))
    array = np.atleast_2d(np.asarray(times, dtype=float))
    if array.ndim != 2 or array.shape[0] not in (1, count) or array.shape[1] == 0:
        raise ValueError(f"times has shape {np.shape(times)}: it must be [sample_count] or [{count}, sample_count]")
    if not np.isfinite(array).all() or (np.diff(array, axis=1) < 0).any():
        raise ValueError("times must be finite and rise")
    if array.min() < 0 or array.max() > duration * (1 + 1e-12):
        raise ValueError(f"times must lie within 0 to duration = {duration:g} s")
    return np.ascontiguousarray(array)
