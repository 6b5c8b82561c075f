"""Where a foot comes to rest, and whether it does: before the runs by what a bed bears, after them by what it bore.

Grains without cohesion bear in proportion to gravity and to depth (Kang et al. 2018, Nat. Commun. 9:1101): a load W
rests at W / K, which in low gravity may be far below any foot. That is an answer: the runs that would only go to the
floor are left out, and the depth is reckoned from the bed's own force, as W / K with the fitted K, beside that of a
flat plate in 3D-RFT (`experiments.grains.softening`). Both go far beyond what was driven, hence both are told. A power
law fitted to a drive does not serve: a flat tip is carried at depth 0 already, which lowers its exponent (0.54 was
found) and made metres hundreds of metres.
"""

import math
from collections.abc import Sequence
from typing import Any

from experiments.grains.bearing import COHESIONS, bearing_capacity, friction_angle, strength
from experiments.runs.types import Json
from rigid.platform.rig import STANDARD_GRAVITY

from . import beds
from .findings import Findings
from .settings import PenetrateSettings, say
from .units import Unit

__all__ = ["answer", "made_units"]

_BESIDE = "jsc-1a-loose-cut"
"""The material to try where grains without cohesion do not bear."""


def made_units(settings: PenetrateSettings, units: Sequence[Unit]) -> list[Unit]:
    """Those of the runs that are made: drops and set-downs of a load that only goes to the floor are left out."""
    return [unit for unit in units if unit.kind == "driven"] if beds.sinks_away(settings) else list(units)


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
    plate = beds.expected_stiffness(settings) / strength(material)
    depths = [load / stiffness, max(0.0, load - expected.held) / plate]
    low, high = min(depths), max(depths)
    never = low > settings.foot
    angle = friction_angle(material)
    per_pascal = bearing_capacity(1.0, angle) * area
    rows = [{"cohesion": c, "carries": c * per_pascal, "depth": max(0.0, load - c * per_pascal) / stiffness}
            for c in COHESIONS]  # fmt: skip
    enough = load / per_pascal
    told: Json = {
        "s": settings, "depth": _length(depths[0]), "foot": 1e3 * settings.foot, "floor": 1e3 * settings.bed_size[2],
        "plate": _length(depths[1]),
        "angle": angle, "enough": f"{enough:.2g}", "g": settings.gravity / STANDARD_GRAVITY, "beside": _BESIDE,
        "driven": 1e3 * settings.depth, "of_k": "the fitted K" if findings.fit.stiffness > 0 else "the K expected",
    }  # fmt: skip
    cohesionless = material.cohesion == "none"
    sentences = [say("rests_never" if never else "rests_below_the_bed", **told)]
    sentences += [say("left_out")] if not stood else []
    sentences += [say("with_cohesion", **told)] + ([say("try_cohesive", **told)] if cohesionless else [])
    return {
        "comes_to_rest": False, "at_any_depth_of_the_foot": not never, "load": load, "foot": settings.foot,
        "depth": depths[0], "depth_range": [low, high], "stiffness": stiffness,
        "stiffness_plate": plate,
        "friction_angle": angle, "cohesion_enough": enough, "cohesions": rows, "sentences": sentences,
        "source": say("terzaghi"),
    }  # fmt: skip


def _length(depth: float) -> str:
    return f"{depth:.2g} m" if depth >= 0.1 else f"{1e3 * depth:.2g} mm"
