"""How near the batch of the planar model is to the accurate integrator: the published tolerance, measured.

Random trials of 1 s at a step of 1 ms are integrated both ways and compared at 101 moments. A trial agrees if every
channel stays within `TOLERANCE`. One that does not is asked why, each time with the accurate integrator as the judge:

- *branch*: it hangs on a decision that a push far below any sensor's takes (a tip that just grazes, a static bound that
  is just reached). The accurate integrator itself, started 1e-6 off, leaves its own path by more than the tolerance,
  or, 1e-5 off, by three times more than in proportion;
- *step*: within the tolerance at a quarter of the step, so the error is the method's second order and no decision's;
- *unexplained*: neither. There should be none.
"""

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid import EFFECTS, Effect, Trial, simulate, simulate_batch
from rigid.planar.dynamics import System
from rigid.planar.located import integrate
from rigid.planar.statics import standing

__all__ = ["CHANNELS", "SHARE_WITHIN", "TOLERANCE", "Agreement", "compare", "random_trial"]

Array = NDArray[np.float64]
Ranges = dict[str, dict[str, tuple[float, float]]]

DURATION, TIME_STEP = 1.0, 1e-3
TIMES = np.linspace(0.0, DURATION, 101)
TOLERANCE = {"x": 5e-5, "y": 2e-4, "theta": 1.5e-3, "vx": 1e-4, "vy": 4e-4, "omega": 3e-3}
"""Published: m, rad and their rates. Largest difference within 1 s at 1 ms, for `SHARE_WITHIN` of random trials."""
SHARE_WITHIN = 0.99
CHANNELS = tuple(TOLERANCE)
_LIMITS = np.array(list(TOLERANCE.values()))
_PUSHES = (1e-6, 1e-5)
_DIRECTIONS = 3
_JUMP = 3.0  # A path that a push ten times larger moves by more than so many times ten has taken another branch


def random_trial(rng: np.random.Generator, effects: Sequence[str], ranges: Ranges) -> Trial:
    """A random trial: motor or brake, rig or free, both of the paper's gravities, soft to hard ground.

    ``rng``: draws the numbers. ``effects``: the ids of those that are on. ``ranges``: of the effects' parameters.
    """
    mass, level = rng.uniform(4, 7), rng.choice([0.0085, 0.015]) * 9.80665
    rigged = any(EFFECTS[id].needs_rig for id in effects) or rng.random() < 0.6
    brake = rng.random() < 0.3
    return Trial(
        mass=mass,
        inertia=rng.uniform(0.04, 0.09),
        gravity_sim=level,
        counterweight=mass * (9.80665 - level) / (9.80665 + level) if rigged else 0.0,
        mu_s=rng.uniform(0.15, 0.8),
        stiffness=10 ** rng.uniform(3, 4.3),
        damping=10 ** rng.uniform(0.5, 2.2),
        torque=6.0 if brake else rng.uniform(0.05, 0.4),
        actuator="brake" if brake else "motor",
        wheel_speed_0=rng.uniform(50, 400) if brake else 0.0,
        torque_until=10.0 if rng.random() < 0.7 else rng.uniform(0.05, 0.8),
        effects=tuple(
            Effect(id=id, parameters={name: rng.uniform(*bounds) for name, bounds in ranges[id].items()})
            for id in effects
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """What a comparison found, over the trials that can stand."""

    differences: Array  # largest difference of a trial, shape [trial_count, channel], in `CHANNELS`' order and units
    kinds: tuple[str, ...]  # of each trial: "within", "branch", "step" or "unexplained" (see the module)
    ratios: Array  # largest difference over tolerance, shape [trial_count]
    seconds: float  # time of one accurate trial [s]
    energy_residual: float  # the largest of the accurate ones [1]
    strangers: int  # trials that stand by one integrator and not by the other

    def share(self, kind: str) -> float:
        """Share of the trials of this kind [1]."""
        return self.kinds.count(kind) / len(self.kinds)

    def summary(self) -> dict[str, Any]:
        """What goes into bench.json."""
        names = dict(zip(CHANNELS, self.differences.T, strict=True))
        plain = [ratio for ratio, kind in zip(self.ratios, self.kinds, strict=True) if kind != "branch"]
        return {
            "trials": len(self.kinds),
            "tolerance": TOLERANCE,
            "share_promised": SHARE_WITHIN,
            "counts": {kind: self.kinds.count(kind) for kind in ("within", "step", "branch", "unexplained")},
            "largest_over_tolerance_no_branch": float(max(plain, default=0.0)),
            "differences": {
                name: {
                    "median": float(np.median(values)),
                    "quantile_99": float(np.quantile(values, 0.99)),
                    "largest": float(values.max()),
                }
                for name, values in names.items()
            },
            "seconds_per_accurate_trial": self.seconds,
            "largest_energy_residual_accurate": self.energy_residual,
            "stand_by_one_only": self.strangers,
        }


def compare(trials: Sequence[Trial], *, time_step: float = TIME_STEP) -> Agreement:
    """Integrate the trials both ways and say how far apart they are, and why where it is beyond the tolerance.

    Trials may have any effects: they are compiled with all that any of them has (an effect at its defaults changes
    nothing), at `time_step` [s]. Raises ValueError if none can stand.
    """
    quick, stands = _batched(trials, time_step)
    paths: dict[int, Array] = {}
    seconds = residual = 0.0
    strangers = 0
    for k, trial in enumerate(trials):
        begin = time.perf_counter()
        try:
            run = simulate(trial, duration=DURATION, times=TIMES)
        except ValueError:
            strangers += int(stands[k])
            continue
        seconds += time.perf_counter() - begin
        if not stands[k]:
            strangers += 1
            continue
        paths[k] = np.array([getattr(run, name) for name in CHANNELS]).T
        residual = max(residual, run.energy_residual)
    if not paths:
        raise ValueError("none of the trials can stand")
    differences = np.array([np.abs(quick[k] - path).max(axis=0) for k, path in paths.items()])
    late = [k for k, most in zip(paths, differences, strict=True) if (most > _LIMITS).any()]
    finer = _batched([trials[k] for k in late], time_step / 4)[0]
    why = {
        k: "branch" if _branches(trials[k], paths[k])
        else "step" if (np.abs(fine - paths[k]) <= _LIMITS).all()
        else "unexplained"
        for k, fine in zip(late, finer, strict=True)
    }  # fmt: skip
    return Agreement(
        differences=differences,
        kinds=tuple(why.get(k, "within") for k in paths),
        ratios=(differences / _LIMITS).max(axis=1),
        seconds=seconds / len(paths),
        energy_residual=residual,
        strangers=strangers,
    )


def _batched(trials: Sequence[Trial], time_step: float) -> tuple[Array, NDArray[np.bool_]]:
    """Series of shape [trial_count, time, channel], and which trials stand."""
    series = np.full((len(trials), len(TIMES), len(CHANNELS)), np.nan)
    stands = np.zeros(len(trials), dtype=bool)
    on = Counter(effect.id for trial in trials for effect in trial.effects)
    every = [id for id in EFFECTS if id in on]
    groups: dict[tuple[str, ...], list[int]] = {}
    for k, trial in enumerate(trials):
        ids = tuple(id for id in every if trial.counterweight > 0 or not EFFECTS[id].needs_rig)
        groups.setdefault(ids, []).append(k)
    for ids, members in groups.items():
        alike = []
        for k in members:
            given = {effect.id: effect for effect in trials[k].effects}
            alike.append(replace(trials[k], effects=tuple(given.get(id, Effect(id=id)) for id in ids)))
        batch = simulate_batch(alike, duration=DURATION, times=TIMES, time_step=time_step)
        series[members] = np.stack([batch.channel(name) for name in CHANNELS], axis=2)
        stands[members] = batch.stands
    return series, stands


def _branches(trial: Trial, path: Array) -> bool:
    """Whether the accurate integrator, pushed a little at the start, leaves its own `path`."""

    def off(size: float, k: int) -> float:
        return float((np.abs(_pushed(trial, size, np.random.default_rng(k)) - path) / _LIMITS).max())

    moved = [max(off(size, k) for k in range(_DIRECTIONS)) for size in _PUSHES]
    growth = _PUSHES[1] / _PUSHES[0]
    return moved[0] > 1 or moved[1] > max(1.0, _JUMP * growth * moved[0])


def _pushed(trial: Trial, size: float, rng: np.random.Generator) -> Array:
    """The accurate path from a start that is off by `size`, in units of the spike's length, radians and seconds."""
    system = System(trial)
    z, modes = standing(system)
    start = [float(value) for value in z]
    for k, unit in enumerate(2 * (trial.spike_length, trial.spike_length, 1.0)):
        start[k] += size * unit * float(rng.normal())
    path = np.full((len(TIMES), len(CHANNELS)), np.nan)

    def keep(begin: float, end: float, last: list[float], at: Any, modes: Any) -> None:
        for k in np.flatnonzero((begin <= TIMES) & (end >= TIMES)):
            path[k] = at(float(TIMES[k]))[:6]

    integrate(system, duration=DURATION, tolerance=1e-10, on_step=keep, start=(start, modes))
    return path
