"""Where a foot comes to rest, and whether it does: before the runs by what a bed bears, after them by what it bore.

Grains without cohesion bear in proportion to gravity: what a spike is driven with grows as K z, so that a load W would
rest at W / K, which in low gravity may be far below any foot. That is an answer: the runs that would only go to the
floor are left out, and the depth is reckoned from the bed's own force, once as W / K with the fitted K, once by the
power law F = a z^n of the slowest drive, (W / a)^(1/n). Both go far beyond what was driven, hence both are told.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from coupling import Penetration
from experiments.grains.bearing import COHESIONS, UNSURE, bearing_capacity, friction_angle
from experiments.runs.types import Json

from . import beds
from .findings import Findings
from .settings import PenetrateSettings, say
from .units import Unit, deepest

__all__ = ["answer", "made_units", "resting_load", "sinks_away"]

_LEAST_ROWS = 8
"""Rows that a power law needs."""
_POWERS = (0.3, 3.0)  # Within which a power is believed [1]
_BESIDE = "jsc-1a-loose-heights"
"""The material to try where grains without cohesion do not bear."""


def resting_load(settings: PenetrateSettings, *, sure: float = 1.0) -> float:
    """The load that comes to rest where drops are stopped [N], in a bed `sure` times as strong as expected."""
    return sure * beds.expected_bearing(settings).load(deepest(settings))


def sinks_away(settings: PenetrateSettings) -> bool:
    """Whether the load is too much for the whole foot and for this bed, even if they bear twice what is expected."""
    bears = beds.expected_bearing(settings)
    deep = settings.weight > UNSURE * bears.load(settings.foot)
    return deep and settings.weight > resting_load(settings, sure=UNSURE)


def made_units(settings: PenetrateSettings, units: Sequence[Unit]) -> list[Unit]:
    """Those of the runs that are made: drops and set-downs of a load that only goes to the floor are left out."""
    return [unit for unit in units if unit.kind == "driven"] if sinks_away(settings) else list(units)


def answer(findings: Findings, material: Any) -> Json | None:
    """The entry "rest" of result.json: how deep the load would rest, and what cohesion would change.

    None where a set-down came to rest, or ended otherwise than at the floor.
    """
    settings = findings.settings
    stood = findings.of("set_down")
    if stood and not all(run.ended == "max_depth" for run in stood):
        return None
    load, area = settings.weight, math.pi * settings.tip_diameter**2 / 4
    expected = beds.expected_bearing(settings)
    stiffness = findings.fit.stiffness if findings.fit.stiffness > 0 else expected.stiffness
    slowest = min(findings.of("driven"), key=lambda run: run.settings["speed"])
    law = power_law(slowest, above=settings.grain)
    depths = [load / stiffness] + ([] if law is None else [(load / law[0]) ** (1 / law[1])])
    low, high = min(depths), max(depths)
    never = low > settings.foot
    angle = friction_angle(material)
    per_pascal = bearing_capacity(1.0, angle) * area
    rows = [{"cohesion": c, "carries": c * per_pascal, "depth": max(0.0, load - c * per_pascal) / stiffness}
            for c in COHESIONS]  # fmt: skip
    enough = load / per_pascal
    told: Json = {
        "s": settings, "depth": _length(depths[0]), "foot": 1e3 * settings.foot, "floor": 1e3 * settings.bed_size[2],
        "other": f" ({_length(depths[1])} by the power law F = a z^{law[1]:.2f} of the slowest drive)" if law else "",
        "angle": angle, "enough": f"{enough:.2g}", "g": settings.gravity / 9.80665, "beside": _BESIDE,
        "driven": 1e3 * settings.depth, "of_k": "the fitted K" if findings.fit.stiffness > 0 else "the K expected",
        "share": 1e2 * settings.depth / depths[0],
    }  # fmt: skip
    cohesionless = material.cohesion == "none"
    sentences = [say("rests_never" if never else "rests_below_the_bed", **told)]
    sentences += [say("left_out")] if not stood else []
    sentences += [say("with_cohesion", **told)] + ([say("try_cohesive", **told)] if cohesionless else [])
    return {
        "comes_to_rest": False, "at_any_depth_of_the_foot": not never, "load": load, "foot": settings.foot,
        "depth": depths[0], "depth_range": [low, high], "stiffness": stiffness,
        "power_law": None if law is None else {"coefficient": law[0], "exponent": law[1]},
        "friction_angle": angle, "cohesion_enough": enough, "cohesions": rows, "sentences": sentences,
        "source": say("terzaghi"),
    }  # fmt: skip


def power_law(run: Penetration, *, above: float) -> tuple[float, float] | None:
    """a [N/m^n] and n of F = a z^n, least squares of the logarithms on the way in below a depth [m]; None where there
    are too few rows, or the force does not grow as such a law."""
    rows = (run.phase == "in") & (run.velocity > 0) & (run.depth > above) & (run.force > 0)
    if np.count_nonzero(rows) < _LEAST_ROWS:
        return None
    slope, start = np.polyfit(np.log(run.depth[rows]), np.log(run.force[rows]), 1)
    return (math.exp(start), float(slope)) if _POWERS[0] <= slope <= _POWERS[1] else None


def _length(depth: float) -> str:
    return f"{depth:.2g} m" if depth >= 0.1 else f"{1e3 * depth:.2g} mm"
