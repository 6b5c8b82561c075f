"""Trials that the tests of the planar model share."""

from __future__ import annotations

from functools import wraps

import numpy as np

from benchmarks.planar import AMPLITUDES
from benchmarks.planar_trials.agreement import random_trial
from rigid import Effect, Trial

G = 9.80665
MASS, INERTIA, LENGTH = 5.3, 0.06, 0.2

# As in the benchmark, but that what moves the start may be larger, a crater's way back bent, dry friction more at rest.
RANGES = AMPLITUDES | {
    "com-offset": {"x": (-4e-4, 4e-4), "y": (-1e-3, 1e-3)},
    "slope": {"angle": (-0.03, 0.03)},
    "plastic-sinkage": {"share": (0.05, 0.6), "bend": (0.0, 1.5)},
    "rig-friction": {"force": (0.01, 0.1), "excess": (0.0, 1.0), "speed": (0.005, 0.1)},
    "bearing-drag": {"torque": (0.002, 0.02), "excess": (0.0, 1.0), "speed": (0.02, 1.0)},
}
"""Plausible sizes of every effect that acts on the motion."""


def counterweight(gravity_sim: float, mass: float = MASS) -> float:
    """The counterweight for which (m - m_b) g = (m + m_b) g_sim."""
    return mass * (G - gravity_sim) / (G + gravity_sim)


def in_rig(torque: float = 0.0, *, mu_s: float = 0.5, level: float = 0.0085, **other) -> Trial:
    """The paper's platform in its rig at `level` g."""
    given = {"gravity_sim": level * G, "counterweight": counterweight(level * G), "torque": torque, "mu_s": mu_s}
    return Trial(**(given | other))


def free(torque: float = 0.0, *, mu_s: float = 0.5, level: float = 0.0085, **other) -> Trial:
    """The paper's platform without a rig."""
    return Trial(**({"gravity_sim": level * G, "torque": torque, "mu_s": mu_s} | other))


def effect(id: str, **parameters: float) -> Effect:
    return Effect(id=id, parameters=parameters)


def turned(hook):
    """`hook` with the sign of all it gives turned."""

    @wraps(hook)
    def other(*given):
        value = hook(*given)
        return tuple(-part for part in value) if isinstance(value, tuple) else -value

    return other


def drawn_effect(id: str, rng: np.random.Generator) -> Effect:
    return effect(id, **{name: rng.uniform(*bounds) for name, bounds in RANGES[id].items()})


def drawn(rng: np.random.Generator, effects: tuple[str, ...] = ()) -> Trial:
    """A random trial as the benchmark draws it, with `RANGES` of the effects."""
    return random_trial(rng, effects, RANGES)
