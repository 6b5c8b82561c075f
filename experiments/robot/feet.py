"""How high and how deep each foot of a robot goes: its lowest point over the undisturbed surface."""

from collections.abc import Collection
from typing import Any

import numpy as np

from coupling.robot import LawFeet, RobotRun
from coupling.robot.soles import FASTEST
from experiments.grains.spells import spells

from . import say
from .depths import Array, depths_of_parts, ups
from .plan import RobotPlan

__all__ = [
    "FEW", "bounce_warning", "bounce_words", "buried_words", "crater_losses", "feet_quantities", "feet_reached",
    "heights_of", "too_deep", "too_fast",
]  # fmt: skip

FEW = 6  # Most feet whose numbers are quantities of their own
FEW_LOSSES = 3
"""Losses of contact in a crater up to which a law is not suspected [1]: a leg that pushes off has one to three."""
DAMPED = "power-irreversible"  # The law with memory whose damping stops a foot in its crater
NAMES = ("clearance_largest", "clearance_end", "sinkage_largest", "sinkage_end")
"""Of each foot [m]."""


def heights_of(run: RobotRun) -> Array:
    """Height of the lowest point of each foot over the undisturbed surface at every row [m], shape (row, foot).

    It is negative below the surface.
    """
    feet = run.feet
    lowest = [foot.bottoms(ups(feet[:, k, 3:7])) for k, foot in enumerate(run.robot.feet)]
    return feet[:, :, 2] + np.column_stack(lowest)


def feet_reached(run: RobotRun, heights: Array) -> dict[str, dict[str, float]]:
    """Name of a foot -> its numbers of `NAMES` [m]; of the time after the first touch, if any foot touches."""
    touching = run.columns["touching"] > 0
    first = int(np.argmax(touching)) if touching.any() else 0
    depths = run.feet[:, :, -1]
    return {
        foot.name: {
            "clearance_largest": max(0.0, float(heights[first:, k].max())), "clearance_end": float(heights[-1, k]),
            "sinkage_largest": float(depths[:, k].max()), "sinkage_end": float(depths[-1, k]),
        }
        for k, foot in enumerate(run.robot.feet)
    }  # fmt: skip


def crater_losses(run: RobotRun, heights: Array, *, apart: float) -> dict[str, list[float]]:
    """Name of a foot -> rise [m] in each time that it loses and regains contact below the undisturbed surface.

    ``heights``: as of `heights_of`; times shorter than ``apart`` [s] do not count. Feet without any are left out. A law
    with inertia of the grains has a force again where a foot begins to fall back. So such a time may be half a bounce.
    """
    pushed = np.abs(run.feet[:, :, 7:10]).max(axis=2) > 0
    found = {}
    for k, foot in enumerate(run.robot.feet):
        first = int(np.argmax(pushed[:, k])) if pushed[:, k].any() else len(pushed)
        free = [(first + low, first + high) for low, high in spells(~pushed[first:, k])]
        lasting = [(low, high) for low, high in free if high < len(pushed) and (high - low) * run.macro_step >= apart]
        rises = [
            float(heights[low - 1 : high + 1, k].max() - heights[low - 1, k])
            for low, high in lasting
            if heights[low:high, k].max() < 0
        ]
        if rises:
            found[foot.name] = rises
    return found


def bounce_words(losses: dict[str, list[float]]) -> list[str]:
    """How often the foot with most of `crater_losses` lost contact, in a sentence; none without any."""
    return [say("lost_below", **_most(losses))] if losses else []


def bounce_warning(run: RobotRun, losses: dict[str, list[float]], law: str) -> list[str]:
    """The warning that a foot may bounce in its crater on a law with memory; none up to `FEW_LOSSES` of its losses."""
    if not (isinstance(run.ground, LawFeet) and run.ground.has_memory and losses):
        return []
    most = _most(losses)
    if most["count"] <= FEW_LOSSES:
        return []
    lossy = any(ground.retreat_damping > 0 for ground in run.ground.grounds[0])
    remedy = say("bounces_bed" if law == DAMPED or lossy else "bounces_damped", law=DAMPED)
    return [say("bounces", law=law, remedy=remedy, **most)]


def buried_words(run: RobotRun, *, on: str | None = None) -> list[str]:
    """A sentence where a geom that is fixed to a foot, and is none, went into the ground; none otherwise.

    ``on``: name of the law of a run that only says what to expect on grains.
    """
    if not run.buried:
        return []
    key = "buried" if on is None else "buried_on_law"
    return [say(key, name=run.buried.name, depth=1e3 * run.buried.depth, law=on)]


def _most(losses: dict[str, list[float]]) -> dict[str, Any]:
    """Name, count and largest rise [mm] of the foot with most losses, the first of equals."""
    name = max(losses, key=lambda one: len(losses[one]))
    return {"name": name, "count": len(losses[name]), "rise": 1e3 * max(losses[name])}


def too_deep(run: RobotRun, law: str = "spring-damper") -> list[str]:
    """A sentence where a part of a foot went deeper than its law holds, of the part that did so most."""
    limits = run.ground.depths if isinstance(run.ground, LawFeet) else {}
    found = [
        (depth / limits[part.name], part.name, depth) for part, depth in depths_of_parts(run) if part.name in limits
    ]
    most, name, depth = max(found, default=(0.0, "", 0.0))
    key = "too_deep" if law == "spring-damper" else "too_deep_for"
    return [say(key, law=law, name=name, depth=1e3 * depth, limit=1e3 * limits[name])] if most > 1 else []


def too_fast(plan: RobotPlan, run: RobotRun, heights: Array, laws: Collection[str] = ()) -> list[str]:
    """A sentence where a foot goes into sand faster than its law was compared with grains, of the fastest foot.

    ``heights``: as of `heights_of`. ``laws``: names of those that the run was computed on. At v above sqrt(g D) the
    inertia of the grains, rho v^2 D^2, exceeds their weight, rho g D^3. This weight is the scale of the static force.
    """
    gravity, time = plan.numbers["gravity"].value, run.columns["time"]
    if plan.fitted is not None or not plan.surface.granular or not gravity > 0 or len(time) < 2:
        return []
    downwards = np.where(heights[1:] < 0, -np.diff(heights, axis=0) / np.diff(time)[:, None], 0.0).max(axis=0)
    found = []
    for foot, speed in zip(run.robot.feet, downwards, strict=True):
        diameter = max(plan.diameters[part.name] for part in foot.parts)
        found.append((float(speed) / np.sqrt(gravity * diameter), foot.name, float(speed)))
    froude, name, speed = max(found)
    if froude <= FASTEST:
        return []
    bounds = say("one_bound" if "rft, inertia=10" in laws else "bed_as_bound")
    return [say("too_fast", name=name, speed=speed, froude=froude, most=FASTEST, bounds=bounds)]


def feet_quantities(reached: dict[str, dict[str, float]]) -> dict[str, tuple[float, str, str]]:
    """Name of a quantity -> value, unit and note, for the table of a run.

    A robot of one foot has its clearance. One of up to `FEW` feet has clearance and sinkage of each. Others have the
    largest clearance of any foot.
    """
    best = max(reached, key=lambda name: reached[name]["clearance_largest"])
    if len(reached) == 1 or len(reached) > FEW:
        found = {"clearance_largest": (reached[best]["clearance_largest"], "m", say("clearance", foot=best))}
        if len(reached) == 1:
            found["clearance_end"] = (reached[best]["clearance_end"], "m", say("at_end"))
        return found
    return {
        f"{name}_{foot}": (numbers[name], "m", say(_NOTES[name], foot=foot))
        for name in NAMES
        for foot, numbers in reached.items()
    }


_NOTES = {
    "clearance_largest": "clearance", "clearance_end": "at_end", "sinkage_largest": "foot_sinkage",
    "sinkage_end": "at_end",
}  # fmt: skip
