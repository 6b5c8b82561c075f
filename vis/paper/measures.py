"""Figure 8 of the paper with our model, and what halving and doubling does that the paper does not give."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes

from vis.page.plots import Plot, handle, legend_above, sheet
from vis.page.sentences import Sentences
from vis.page.style import GREY, INK, styled
from vis.paper.run import PaperRun, in_order

__all__ = ["figure_8", "figure_sweep"]

captions = Sentences(__package__, "figures.toml")
_MEASURES = (
    ("trajectory_angle", 180 / math.pi, "trajectory angle [degrees]"),
    ("max_speed", 1e3, "largest speed [mm/s]"),
    ("max_angular_velocity", 1.0, "largest dθ/dt [rad/s]"),
)


def figure_8(paper: PaperRun) -> Plot:
    """Angle, speed and angular velocity over gravities, torques and surfaces."""
    with styled():
        drawing, axes = sheet(len(_MEASURES), len(paper.rigs), 7.2, sharex=True, sharey="row")
        for j, rig in enumerate(paper.rigs):
            axes[0, j].set_title(f"{rig:g} g")
            for i, (key, scale, label) in enumerate(_MEASURES):
                axis: Axes = axes[i, j]
                for place, surface in enumerate(paper.surfaces):
                    _draw_measures(axis, paper, surface, rig, key, scale, place)
                if j == 0:
                    axis.set_ylabel(label)
                axis.set_xticks(range(len(paper.surfaces)), paper.surfaces)
                axis.tick_params(axis="x", length=0)
                axis.grid(False, axis="x")
                for edge in range(1, len(paper.surfaces)):
                    axis.axvline(edge - 0.5, color="#e4e4e4", lw=0.7)
            for stated in (0.0, 22.5, 60.0):
                axes[0, j].axhline(stated, color=GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        for row in axes[1:]:
            row[0].set_ylim(bottom=0.0)
        dashed = handle("0°, 22.5°, 60° of the text", GREY, lw=0.9, ls=(0, (5, 3)))
        hollow = handle("the paper's 1 ms step", INK, marker="o", mfc="none", ls="", ms=7)
        dots = [handle(paper.label(t), paper.colour(t), marker="o", ls="", ms=5) for t in paper.torques]
        legend_above(drawing, [*dots, hollow, dashed], columns=3)
    return Plot.said(captions, "figure8", drawing)


def _draw_measures(axis: Axes, paper: PaperRun, surface: str, rig: float, key: str, scale: float, place: int) -> None:
    """The marks of one surface, a torque beside the other."""
    count = len(paper.torques)
    for index, torque in enumerate(paper.torques):
        at = place + 0.22 * (index - 0.5 * (count - 1))
        *band, fixed = paper.variants(surface, rig, torque, key)
        if band[1] is None:
            axis.text(at, 0.02, "none", rotation=90, fontsize=7, transform=axis.get_xaxis_transform(), ha="center")
            continue
        known = [scale * value for value in band if value is not None]
        colour = paper.colour(torque)
        axis.plot([at, at], [min(known), max(known)], color=colour, lw=3.0, alpha=0.45, solid_capstyle="butt")
        axis.plot(at, scale * band[1], "o", color=colour, ms=5)
        if fixed is not None:
            axis.plot(at, scale * fixed, "o", color=INK, mfc="none", ms=7.5, mew=0.8)


def figure_sweep(paper: PaperRun) -> Plot | None:
    """What halving and doubling does to the trajectory angle and to the first hop."""
    if not paper.sweep:
        return None
    keys = in_order(entry["variant"].split(" x")[0] for entry in paper.sweep)
    rig = paper.sweep[0]["rig"]
    sliding = paper.result.get("sliding", [])
    ratios = sorted({entry["varied"]["ratio"] for entry in sliding})
    places = [*keys, "sliding"] if sliding else keys
    words = {
        "inertia": "inertia J", "wheel_inertia": "wheel inertia", "stiffness": "stiffness K", "damping": "damping C",
        "wheel_speed_0": "brake's wheel speed", "sliding": "friction mu_d / mu_s",
    }  # fmt: skip
    measures = {
        "trajectory_angle": "trajectory angle [degrees]",
        "transition_angle_hop": "θ at the first hop [degrees]",
    }
    with styled():
        drawing, axes = sheet(len(paper.hard), 2, 5.2, sharey=True, sharex="col")
        for i, surface in enumerate(paper.hard):
            for j, (measure, label) in enumerate(measures.items()):
                axis: Axes = axes[i, j]
                axis.set_title(surface)
                for torque in paper.torques:
                    nominal = paper.case(surface, rig, torque)[measure]
                    if nominal is None:
                        continue
                    axis.axvline(math.degrees(nominal), color=paper.colour(torque), lw=0.9)
                    for entry in paper.sweep:
                        if entry["surface"] != surface or entry["torque"] != torque or entry[measure] is None:
                            continue
                        key, factor = entry["variant"].split(" x")
                        mark = ">" if float(factor) > 1 else "<"
                        value = math.degrees(entry[measure])
                        axis.plot(value, keys.index(key), mark, color=paper.colour(torque), ms=6)
                    for entry in sliding:
                        where = (entry["surface"], entry["rig"], entry["torque"])
                        if where == (surface, rig, torque) and entry[measure] is not None:
                            size = _diamond(entry["varied"]["ratio"], ratios)
                            value = math.degrees(entry[measure])
                            axis.plot(value, len(keys), "D", color=paper.colour(torque), ms=size)
                if i == len(paper.hard) - 1:
                    axis.set_xlabel(label)
            axes[i, 0].set_yticks(range(len(places)), [words.get(key, key) for key in places])
            axes[i, 0].set_ylim(len(places) - 0.5, -0.5)
        marks = [handle(label, INK, marker=mark, ls="", ms=6) for mark, label in (("<", "halved"), (">", "doubled"))]
        marks += [
            handle(f"mu_d = {ratio:g} mu_s", INK, marker="D", ls="", ms=_diamond(ratio, ratios)) for ratio in ratios
        ]
        legend_above(drawing, [*paper.handles(), *marks], columns=5)
    return Plot.said(captions, "sweep", drawing, rig=rig)


def _diamond(ratio: float, ratios: Sequence[float]) -> float:
    """Size of the mark of a ratio [points]: the larger the ratio, the larger."""
    return 3.0 + 3.5 * ratios.index(ratio) / max(len(ratios) - 1, 1)
