"""What is fitted of pushes and drops beside effects: K and C by diameter; and what is typical of a campaign."""

import math
from collections.abc import Sequence

import numpy as np

from experiments.campaign import PenetrationCampaign
from experiments.campaign.tables import SURFACE
from experiments.diagnose.fit.problem import Array, Parameter

from .data import Prepared
from .forms import Scales

__all__ = [
    "base_parameters", "comes_back", "diameters_of", "find_scales", "loose_surface", "named", "speeds_of",
]  # fmt: skip

_LOOSE = 0.01  # its standard deviation before any reading, over D


def diameters_of(trials: Sequence[Prepared]) -> list[float]:
    """Rising [m]."""
    return sorted({trial.diameter for trial in trials})


def named(name: str, diameter: float, diameters: Sequence[float]) -> str:
    """The name of the parameter that is K or C of a diameter."""
    return name if len(diameters) == 1 else f"{name}@{diameter:g}"


def base_parameters(tables: PenetrationCampaign, trials: Sequence[Prepared]) -> tuple[Parameter, ...]:
    """K and C of each diameter, where they are uncertain."""
    surface, doubt, diameters = tables.surface, tables.uncertainty, diameters_of(trials)
    guess_k, guess_c = max(surface.stiffness, 1e-9), max(surface.damping, 1e-9)
    found = []
    for diameter in diameters:
        for name, unit, value, relative, size in (
            ("stiffness", "N/m", surface.stiffness, doubt.stiffness, guess_k),
            ("damping", "N s/m", surface.damping, doubt.damping, guess_c),
        ):
            if relative == 0:
                continue
            free = relative >= 1
            start = _straight_stiffness(tables, trials, diameter) if free and name == "stiffness" else value
            if free and name == "damping":
                size = max(size, 1e-3 * _straight_stiffness(tables, trials, diameter))
            found.append(Parameter(
                name=named(name, diameter, diameters), unit=unit, value=start,
                std=math.inf if free else relative * value,
                scale=max(0.02 * (start if name == "stiffness" else size), 1e-12), lowest=0.0,
                step=1e-4 * max(start, size),
            ))  # fmt: skip
    return tuple(found)


def _straight_stiffness(tables: PenetrationCampaign, trials: Sequence[Prepared], diameter: float) -> float:
    """F / z by least squares over the driven trials of this diameter; from the depth of drops where there is none.

    A drop from speed v to depth z without loss: K z^2 / 2 = m v^2 / 2 + m g z.
    """
    driven = [trial for trial in trials if trial.driven and trial.diameter == diameter]
    below = [(t, t.path.depth, t.has_other & (t.path.depth > 0)) for t in driven]
    top = sum(float((depth * t.other)[rows].sum()) for t, depth, rows in below)
    down = sum(float((depth**2)[rows].sum()) for _, depth, rows in below)
    if down > 0 and top > 0:
        return top / down
    found = []
    for trial in trials:
        if not trial.driven and trial.diameter == diameter and trial.has_depth.any():
            z = max(float(trial.depth[trial.has_depth].max()), 1e-6)
            mass, speed = tables.spike.mass or 1.0, trial.table.speed or 0.0
            found.append(mass * (speed**2 + 2 * trial.table.gravity * z) / z**2)
    return float(np.median(found)) if found else max(tables.surface.stiffness, 1e-9)


def loose_surface(depth: float) -> Parameter:
    """How deep below the zero of the depth the bed begins to carry [m], of all trials; `depth`: D, typical of them.

    A tip touches single loose grains first, and a touch may be seen too early: K is the slope of what follows. It is
    never above the zero, since readings there have no force.
    """
    std = _LOOSE * depth
    return Parameter(
        name=SURFACE, unit="m", value=0.0, std=std, scale=0.1 * std, lowest=0.0, highest=10.0 * std, step=0.01 * std
    )


def find_scales(tables: PenetrationCampaign, trials: Sequence[Prepared], base: Sequence[Parameter]) -> Scales:
    """What is typical of the campaign."""
    deepest = [float((t.smooth.depth if t.smooth is not None else t.depth[t.has_depth]).max()) for t in trials]
    depth = max(0.75 * max(deepest), 1e-9)
    speed = max(max(speeds_of(trial).max() for trial in trials), 1e-9)
    diameters = diameters_of(trials)
    middle = named("stiffness", diameters[len(diameters) // 2], diameters)
    stiffness = next((p.value for p in base if p.name == middle), tables.surface.stiffness)
    return Scales(depth=depth, speed=speed, force=max(stiffness, 1e-9) * depth)


def comes_back(trials: Sequence[Prepared]) -> bool:
    """Whether a spike comes out again, by more than its depth's error."""
    for trial in trials:
        if not trial.driven:
            return True
        depth = trial.path.depth
        back = np.maximum.accumulate(depth) - depth
        if back.max() > 0.02 * max(depth.max(), 1e-12) + 5 * trial.path.depth_std.max():
            return True
    return False


def speeds_of(trial: Prepared) -> Array:
    """Slow and fast speed of loading [m/s]."""
    if trial.smooth is None:
        return np.array([0.0, trial.table.speed or 0.0])
    inside = trial.smooth.depth > 0
    fast = trial.smooth.speed[inside] if inside.any() else trial.smooth.speed
    return np.percentile(np.maximum(fast, 0.0), [20, 90])
