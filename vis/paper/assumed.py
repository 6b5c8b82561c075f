"""Tables of what the paper does not give and the angles hang on: sliding friction, and the ground under grains."""

from __future__ import annotations

import math

from vis.page.page import Block, table, text
from vis.page.report import Result
from vis.paper.run import PaperRun, in_order

__all__ = ["grains_blocks", "ours", "sliding_blocks"]


def ours(result: Result) -> str:
    """What of the numbers is ours, in a sentence."""
    surfaces = result["surfaces"]
    loose = [name for name, numbers in surfaces.items() if numbers.get("granular")]
    frictions = f", and all friction of {' and '.join(loose)}" if loose else ""
    return (
        "The paper gives none of J, J_w, the wheel's speed before it is braked, K and C, no friction of a tip that "
        f"slides (mu_d: half of mu_s here){frictions}: they are ours."
    )


def sliding_blocks(paper: PaperRun) -> list[Block]:
    """Trajectory angles over mu_d / mu_s; none where it was not varied."""
    entries = paper.result.get("sliding", [])
    if not entries:
        return []
    ratios = sorted({entry["varied"]["ratio"] for entry in entries})
    places = in_order((entry["surface"], entry["rig"], entry["torque"]) for entry in entries)
    places.sort(key=lambda place: (paper.surfaces.index(place[0]), place[1], place[2]))
    varied = {(*_place(entry), entry["varied"]["ratio"]): entry for entry in entries}
    rows = []
    for surface, rig, torque in places:
        numbers = paper.result["surfaces"][surface]
        cells = [_angle(paper.case(surface, rig, torque))]
        cells += [_angle(varied[surface, rig, torque, ratio]) for ratio in ratios]
        as_is = f"{numbers['mu_d'] / numbers['mu_s']:g}" if numbers["mu_s"] else "none"
        rows.append((surface, f"{rig:g}", f"{torque:g}", f"{numbers['mu_s']:g}", as_is, *cells))
    head = ("surface", "g", "torque [N m]", "mu_s", "mu_d / mu_s as it is", "angle", *(f"at {r:g}" for r in ratios))
    note = "Trajectory angles in degrees. Sliding all the way, a platform leaves at tan = m / ((m + m_b) mu_d)."
    return [table(head, rows, title="Sliding friction"), text(note, small=True)]


def grains_blocks(paper: PaperRun) -> list[Block]:
    """Trajectory angles of the brake trials on grains by the ground's stiffness and rebound; none without."""
    entries = paper.result.get("grains", [])
    if not entries:
        return []
    columns = in_order(_place(entry) for entry in entries)
    kinds = in_order(_ground(entry) for entry in entries)
    # Soft before stiff, and what gives back much before what gives back little; laws with stiffness of their own last.
    kinds.sort(key=lambda kind: (kind[1] is None, kind[1] or 0.0, -kind[2], kind[0]))
    angles = {(_ground(entry), _place(entry)): _angle(entry) for entry in entries}
    rows = [
        (
            law,
            "its own" if stiffness is None else f"{stiffness:.4g}",
            f"{rebound:g}",
            *(angles.get(((law, stiffness, rebound), place), "–") for place in columns),
        )
        for law, stiffness, rebound in kinds
    ]
    nominal = [_angle(paper.case(*place)) for place in columns]
    rows.insert(0, ("as it is", "the surface's", "1, and C", *nominal))
    head = ("ground", "K of a row [N/m]", "gives back", *(f"{s}, {g:g} g, {t:g} N m" for s, g, t in columns))
    note = (
        "Trajectory angles in degrees. Gives back: the share of the deepest depth that is undone as the load goes; the "
        "spring-dampers of this table have no damper. A softer ground lets the platform sink, and turn, further."
    )
    return [table(head, rows, title="Brake trials on grains"), text(note, small=True)]


def _place(entry: Result) -> tuple[str, float, float]:
    return entry["surface"], entry["rig"], entry["torque"]


def _ground(entry: Result) -> tuple[str, float | None, float]:
    varied = entry["varied"]
    return varied["law"], varied["stiffness"], varied["rebound"]


def _angle(entry: Result) -> str:
    value = entry["trajectory_angle"]
    return "none" if value is None else f"{math.degrees(value):.1f}"
