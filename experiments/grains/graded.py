"""Results of graded beds for `bed make` and `bed refine`; where a tumble needs fine grains, and which it met."""

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupling import CoupledTumble
from dem.grains.graded import NARROWEST, THROAT, Graded
from dem.grains.materials import Material
from dem.measure.grading import MOST_DRAINED, MOST_STRAYED
from dem.prepare.report import Prepared
from experiments.platform.numbers import tip_angles, tip_depth
from experiments.runs.result import quantities_of
from experiments.runs.types import Json
from rigid.planar.trajectory import Trajectory

from . import say
from .recipes import recipe_of
from .spells import spells

__all__ = [
    "coarsest_touched", "graded_quantities", "graded_under", "grading_told", "grading_warning", "places_touched",
    "tips_in_ground", "unmatched_warning",
]  # fmt: skip


def grading_told(prepared: Prepared) -> Json:
    """Tables, quantities and warnings of a graded bed, for `finish_bed`; from the notes of its last stage."""
    found, last = prepared.reports[-1].notes["grading"], prepared.reports[-1].stage
    zones = [
        [
            zone["name"], str(zone["grain_count"]), f"{100 * zone['share']:.1f}",
            *(_mm(zone[key]) for key in ("wanted", "mean", "smallest", "largest")), _or_none(zone["packing"], ".4f"),
        ]
        for zone in found["zones"]
    ]  # fmt: skip
    layers = [
        [f"{1e3 * layer['bottom']:.3g} to {1e3 * layer['top']:.3g}", _mm(layer["under"]), _mm(layer["elsewhere"])]
        for layer in reversed(found["layers"])
    ]
    stages = [
        [report.stage, *(f"{100 * report.notes['grading'][key]:.3g}" for key in ("strayed_share", "drained_share"))]
        + [f"{report.notes['grading']['farthest']:.2f}"]
        for report in prepared.reports
    ]
    quantities = {
        "fine_count": (found["fine_count"], "1", "grains of as much solid, had all the size of those under footprints"),
        "largest_under_footprints": (found["zones"][0]["largest"], "m", "the largest grain under the footprints"),
        "strayed_share": (found["strayed_share"], "1", "solid in grains too small for where they lie, by a diameter"),
        "drained_share": (found["drained_share"], "1", "solid in grains that fit through the gaps where they lie"),
    }
    warning = grading_warning(found, after=f" after {last!r}")
    warnings = [] if warning is None else [warning]
    zone_head = ["zone", "grains", "solid [%]", "wanted [mm]", "mean [mm]", "smallest [mm]", "largest [mm]", "packing"]
    layer_head = ["height [mm]", "under footprints [mm]", "elsewhere [mm]"]
    stage_head = ["after", "strayed [% of solid]", "could drain [% of solid]", "farthest [diameters]"]
    small = "Small grains among large ones: farther out than they belong by a diameter, and below "
    small += f"{THROAT:.3f} of the largest there, so that they could drain"
    return {
        "tables": [
            {"title": "Sizes by place, at the end", "head": zone_head, "rows": zones},
            {"title": "Mean diameter by height", "head": layer_head, "rows": layers},
            {"title": small, "head": stage_head, "rows": stages},
        ],
        "quantities": quantities_of(quantities, std=None),
        "warnings": warnings,
    }


def grading_warning(found: Mapping[str, Any], *, after: str = "") -> str | None:
    """Warning of small grains outside their region, or that could drain; `found`: a `dem.Grading` as a dict."""
    if found["strayed_share"] <= MOST_STRAYED and found["drained_share"] <= MOST_DRAINED:
        return None
    return (
        f"the grading did not hold:{after} {100 * found['strayed_share']:.2g} % of the grains' volume lies farther out "
        f"than it belongs, {100 * found['drained_share']:.2g} % could fall through"
    )


def unmatched_warning(
    graded: Graded | None, material: Material, *, packing: float | None = None, stages: Sequence[str] | None = None
) -> str | None:
    """Warning that a graded bed lies as it fell, denser than a bed of one size; None where its packing was chosen.

    `packing` and `stages`: as given; without both it has the stages of its material, or is brought to `rained` of
    recipes.toml, where one of them is known.
    """
    own = recipe_of(material)
    if graded is None or any(choice is not None for choice in (packing, stages, own.stages, own.rained)):
        return None
    return say("graded_unmatched", material=material.name)


def graded_quantities(found: Sequence[Mapping[str, Any]]) -> dict[str, Json]:
    """Quantities of the graded beds of a run: their grading, of the worst bed, and the number of grains saved."""
    saved = [1 - bed["grain_count"] / bed["fine_count"] for bed in found]
    drains = f"four in a square let grains through from {1 / THROAT:.2f} on, three from {1 / NARROWEST:.2f}"
    notes = {
        "strayed_share": "solid in grains too small for where they lie, by a diameter",
        "drained_share": "solid in grains that fit through the gaps where they lie",
        "touching_ratio": f"largest ratio of the diameters of two grains that touch; {drains}",
    }
    numbers = {
        "grains_saved": (fmean(saved), "1", "of the grains, and grain-steps, of a bed that is as fine throughout")
    }
    numbers |= {key: (max(bed[key] for bed in found), "1", note) for key, note in notes.items()}
    under = [bed["zones"][0]["packing"] for bed in found]
    if None not in under:
        numbers["packing_under_footprints"] = (fmean(under), "1", "packing fraction of the fine grains")
    return quantities_of(numbers, std=None)


def _or_none(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _mm(value: float | None) -> str:
    return _or_none(None if value is None else 1e3 * value, ".3g")


def places_touched(trajectory: Trajectory, *, reach: float) -> list[tuple[float, float]]:
    """Where the tips of a planar platform are in the ground along the motion, from its start: (from, to) [m], in order.

    A tip counts below the height `reach` above the surface [m]. The stretches do not overlap.
    """
    count, length = trajectory.trial.spike_count, trajectory.trial.spike_length
    x = trajectory.x[:, None] - length * np.sin(tip_angles(count, trajectory.theta))
    low = tip_depth(trajectory.theta, trajectory.y, count=count, length=length) > -reach
    ways = [x[a:b, tip] for tip in range(count) for a, b in spells(low[:, tip])]
    return merged([(float(way.min()), float(way.max())) for way in ways])


def merged(stretches: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same total length in stretches that do not overlap, ascending [m]."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(stretches):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found


def graded_under(
    trajectory: Trajectory,
    *,
    length: float,
    origin: float,
    spike_diameter: float,
    grain: float,
    spread: float,
    coarse: float,
    margin: float = 1.5,
    **options: Any,
) -> Graded:
    """Fine grains where the tips of a forecast come down, coarse grains elsewhere.

    `length` of the bed [m]; `origin`: x in it of the platform's start [m]; `grain`, `spread`, `coarse` as `fine`,
    `spread` and `coarse` of `dem.Graded`; `margin`: fine sand on either side of a tip's axis, over the spike's diameter
    [1]; `options`: `depth` and `growth` of `dem.Graded`. Raises ValueError for grains of more than a fifth of the
    spike, and for what `dem.Graded` refuses.
    """
    if grain > spike_diameter / 5 * (1 + 1e-9):
        raise ValueError(say("fine_for_footprints", grain=grain, spike=spike_diameter, fifth=spike_diameter / 5))
    ways = places_touched(trajectory, reach=0.5 * spike_diameter)
    beside = margin * spike_diameter
    strips = [(max(0.0, origin + low - beside), min(length, origin + high + beside)) for low, high in ways]
    return Graded(fine=grain, coarse=coarse, footprints=tuple(merged(strips)), spread=spread, **options)


def coarsest_touched(run: CoupledTumble, graded: Graded, *, size: Sequence[float]) -> float:
    """Largest mean diameter at the places of the tips during a tumble on such a bed [m]; `size` of the bed [m]."""
    ground: Any = run.ground
    x, depth = tips_in_ground(run)
    return float(graded.diameter(ground.origin[0] + x, ground.origin[2] - depth, size).max(initial=graded.fine))


def tips_in_ground(run: CoupledTumble) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where tips of a tumble were below the surface: along the motion from its start, and how deep [m], shape [n]."""
    trial, rows, depth = run.trial, run.columns, run.feet[:, 3]
    x = rows["x"][:, None] - trial.spike_length * np.sin(tip_angles(trial.spike_count, rows["theta"]))
    return x[depth > 0], depth[depth > 0]
