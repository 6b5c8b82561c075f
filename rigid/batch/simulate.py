"""Thousands of planar trials at once, compiled by Taichi: `simulate_batch`.

The terms are those of the accurate integrator. Parameters differ from trial to trial. All have the same effects, law of
the ground and number of spikes: the kernel is compiled for these, once, and kept.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid.checks import check_above_zero, check_not_negative
from rigid.checks.unfit import UnfitSettingsError
from rigid.model.trial import POSITIVE, Trial
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
    start_depth: float = 1.0,
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
        start_depth: depth of the tips at t = 0 over that in equilibrium [1]. Other than 1 needs level ground and
            pointed tips (no `slope`, `com-offset`, `tip-radius`).

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
    if start_depth != 1:
        _check_start(first, start_depth)
        poses[:, 0] += (1 - start_depth) * (numbers[:, 3] - poses[:, 0])
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
        raise UnfitSettingsError(f"the motion of trial {wrong[0]} of the batch is no longer finite")
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


def _check_start(first: Trial, start_depth: float) -> None:
    """Raise ValueError for a share of the depth at rest that cannot be, or effects with which both rows differ."""
    check_above_zero(start_depth=start_depth)
    uneven = {"slope", "com-offset", "tip-radius"} & {effect.id for effect in first.effects}
    if uneven:
        name = min(uneven)
        raise ValueError(f"start_depth = {start_depth:g} must be 1 with effect {name!r}: its rows do not stand level")


def _many(trials: Sequence[Trial], vary: Any) -> tuple[Trial, Array]:
    if vary is not None:
        raise ValueError("vary is given with a sequence of trials: expected one trial")
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
    return first, np.concatenate([_rows(trial, {}) for trial in trials])


def _rows(trial: Trial, given: Mapping[str, Array]) -> Array:
    """Rows of numbers as the kernel wants them (`FIXED_NUMBERS`, the law's, the effects'), shape [trial_count, n].

    `given`: what varies, in the place of the trial's own numbers.
    """

    def get(key: str) -> Any:
        return given.get(key, getattr(trial, key))

    mass, length, carried = get("mass"), get("spike_length"), get("counterweight")
    moving = [effect for effect in trial.effects if not effect.term.sensor]
    row = [
        mass, get("inertia"), length, length * math.cos(math.pi / trial.spike_count), carried,
        np.where(np.asarray(carried) > 0, get("gravity"), get("gravity_sim")), (mass + carried) * get("gravity_sim"),
        get("torque"), get("torque_until"), get("wheel_inertia"), 1.0 if trial.actuator == "motor" else -1.0,
        get("wheel_speed_0"), get("mu_s"), _sliding(trial, given),
        *(trial.surface.numbers if trial.ground else (get("stiffness"), get("damping"))),
        *(given.get(f"{effect.id}.{name}", value) for effect in moving for name, value in effect.values.items()),
        *trial.surface.memory,
    ]  # fmt: skip
    return np.stack(np.broadcast_arrays(*row), axis=-1) if given else np.array([row], dtype=float)


def _sliding(trial: Trial, given: Mapping[str, Array]) -> Any:
    """mu_d: as given, else the trial's own, else half of mu_s."""
    own = 0.5 * given.get("mu_s", trial.mu_s) if trial.mu_d is None else trial.mu_d
    return given.get("mu_d", own)


def _one_varied(trial: Trial, vary: Mapping[str, ArrayLike] | None) -> tuple[Trial, Array]:
    given = {key: np.asarray(value, dtype=float) for key, value in (vary or {}).items()}
    sizes = {value.shape for value in given.values()}
    if len(sizes) > 1 or any(len(size) != 1 for size in sizes):
        raise ValueError(f"vary must hold arrays of one length, not of shapes {sorted(sizes)}")
    if (0,) in sizes:
        raise ValueError("vary holds empty arrays: at least one trial is needed")
    own = {f"{effect.id}.{p.name}": (effect.id, p) for effect in trial.effects for p in effect.term.parameters}
    for key, value in given.items():
        if key not in _FIXED and key not in own:
            raise ValueError(f"vary has {key!r}, which does not vary; there is {', '.join((*_FIXED, *sorted(own)))}")
        endless = own[key][1].default == math.inf if key in own else key == "torque_until"
        if (np.isnan(value) if endless else ~np.isfinite(value)).any():
            raise ValueError(f"vary[{key!r}] holds numbers that are not finite")
        if key in own:
            id, parameter = own[key]
            for extreme in (value.min(), value.max()):
                parameter.check(float(extreme), f"{id}.{parameter.name}")
        elif key in (*POSITIVE, "stiffness"):
            check_above_zero(**{key: value.min()})
        else:
            check_not_negative(**{key: min(value.min(), 0.0)})
    if ("stiffness" in given or "damping" in given) and trial.ground is not None:
        raise ValueError("vary has stiffness or damping, but the trial's ground has numbers of its own")
    _check_together(trial, given)
    return trial, _rows(trial, given)


def _check_together(trial: Trial, given: Mapping[str, Array]) -> None:
    """Raise ValueError for what only shows between two numbers of one trial."""
    numbers = {key: given.get(key, getattr(trial, key)) for key in _FIXED} | {"mu_d": _sliding(trial, given)}
    mass, inertia, carried = numbers["mass"], numbers["inertia"], numbers["counterweight"]
    offset = trial.effect_values("com-offset") or {}
    square = sum(given.get(f"com-offset.{axis}", value) ** 2 for axis, value in offset.items())
    rigged = any(effect.term.needs_rig for effect in trial.effects)
    stopped = np.equal(numbers["wheel_speed_0"], 0) & np.greater(numbers["torque"], 0)
    for name, wrong in (
        ("inertia must not exceed mass spike_length^2", inertia > mass * numbers["spike_length"] ** 2),
        ("inertia must exceed wheel_inertia", numbers["wheel_inertia"] >= inertia),
        ("counterweight must be below mass", carried >= mass),
        ("gravity_sim must be below gravity in a rig", (carried > 0) & (numbers["gravity_sim"] >= numbers["gravity"])),
        ("counterweight must be above 0 for these effects", np.equal(carried, 0) & rigged),
        ("mu_d must not exceed mu_s", numbers["mu_d"] > numbers["mu_s"]),
        ("wheel_speed_0 must be above 0 for a brake", stopped & (trial.actuator == "brake")),
        ("com-offset.x, y must be below sqrt(J / m)", mass * square >= inertia),
    ):
        if np.any(wrong):
            raise ValueError(f"vary: {name}; not so in trial {int(np.flatnonzero(wrong)[0])}")


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
