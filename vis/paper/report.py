"""Figures 5 to 8 of the paper with our model, and the report: reads result.json and series/ of `hedgebed paper`.

Colour stands for the torque everywhere; the band is friction 10 % (or what was set) down and up; the paper's fixed step
is dotted or hollow.
"""

from __future__ import annotations

import math
from pathlib import Path

from vis.page.page import Section, Tile, table, text
from vis.page.report import Progress, Result, again
from vis.page.sentences import Sentences
from vis.paper.assumed import grains_blocks, ours, sliding_blocks
from vis.paper.measures import figure_8, figure_sweep
from vis.paper.paths import figure_5, figure_6, figure_7
from vis.paper.run import PaperRun

__all__ = ["write_paper_report"]

say = Sentences(__package__)
_FIGURES = (figure_5, figure_6, figure_7, figure_8, figure_sweep)
_MEASURES = (
    ("trajectory_angle", 180 / math.pi),
    ("max_speed", 1e3),
    ("max_angular_velocity", 1.0),
    ("transition_angle_slip", 180 / math.pi),
    ("transition_angle_hop", 180 / math.pi),
)
_CASES = (
    "surface", "g", "torque [N m]", "angle [degrees]", "speed [mm/s]", "dθ/dt [rad/s]", "first slip [degrees]",
    "first hop [degrees]",
)  # fmt: skip
_CLAIMS = ("what the text states", "stated", "ours", "difference", "inside", "judged by, and why")


def write_paper_report(folder: str | Path, *, progress: Progress | None = None) -> Path:
    """Make figures/ and report.html of the folder of `hedgebed paper`, and return the report."""
    paper = PaperRun(folder, progress)
    blocks = {}
    for number, draw in enumerate(_FIGURES, 1):
        plot = draw(paper)
        if plot is not None:
            blocks[plot.name] = paper.draw(plot)
        paper.tell(number / (len(_FIGURES) + 1))
    result = paper.result
    swept = [blocks.pop("sweep")] if "sweep" in blocks else []
    surfaces = [
        (name, f"{s['stiffness']:g}", f"{s['damping']:g}", f"{s['mu_s']:g}", f"{s['mu_d']:g}", s["source"])
        for name, s in result["surfaces"].items()
    ]
    numbers = [_number_row(paper, case) for case in paper.cases if case["variant"] == "nominal"]
    small = "In brackets: friction at both ends of its band; after the semicolon: the paper's 1 ms step."
    sections = [
        Section("", [text(say("about"))]),
        Section("What the text states, and what comes out", [table(_CLAIMS, _claims(result), words=True)]),
        Section("The figures", list(blocks.values())),
        Section("What the paper does not give", [*swept, *sliding_blocks(paper), *grains_blocks(paper)]),
        Section("Every case", [table(_CASES, numbers), text(small, small=True)]),
        Section(
            "What stands behind it",
            [
                text(f"{_platform(result)} {ours(result)}"),
                table(("surface", "K [N/m]", "C [N s/m]", "mu_s", "mu_d", "source"), surfaces, words=True),
            ],
        ),
        again("hedgebed paper run.toml", ""),
    ]
    count = result.get("integrations", len(paper.cases) + len(paper.sweep))
    return paper.write(sections, lead=["paper", f"{count} integrations"], tiles=_tiles(result["quantities"]))


def _tiles(quantities: Result) -> list[Tile]:
    met, compared = int(quantities["claims_met"]["value"]), int(quantities["claims_compared"]["value"])
    moved, left = math.degrees(quantities["step_angle_gap"]["value"]), quantities["energy_residual"]["value"]
    return [
        Tile("Statements met", f"{met} of {compared}", "those of the text that can be compared"),
        Tile("Cases", str(quantities["case_count"]["value"]), "gravities × torques × surfaces"),
        Tile("1 ms step moves angles by", f"{moved:.2g}°", "at most", second=True),
        Tile("Energy left over", f"{left:.1g}", "largest, relative", second=True),
    ]


def _claims(result: Result) -> list[tuple[str, ...]]:
    inside = {True: "yes", False: "no", None: "not comparable"}
    return [
        (claim["statement"], claim["stated"], claim["ours"], claim["difference"] or "–", inside[claim["met"]],
         claim["judged_by"] + (f"; {claim['note']}" if claim["note"] else ""))
        for claim in result["claims"]
    ]  # fmt: skip


def _platform(result: Result) -> str:
    platform, speed = result["platform"], result.get("brake_wheel_speed")
    spun = f", a wheel at {speed:g} rad/s before it is braked" if speed is not None else ""
    return (
        f"Platform: {platform['mass']:g} kg, J = {platform['inertia']:g} kg m², l = {platform['spike_length']:g} m, "
        f"J_w = {platform['wheel_inertia']:g} kg m²{spun}."
    )


def _number_row(paper: PaperRun, case: Result) -> tuple[str, ...]:
    place = case["surface"], case["rig"], case["torque"]

    def cell(key: str, scale: float) -> str:
        *band, fixed = paper.variants(*place, key)
        if band[1] is None:
            return "none"
        known = [scale * value for value in band if value is not None]
        last = "none" if fixed is None else f"{scale * fixed:.3g}"
        return f"{scale * band[1]:.3g} ({min(known):.3g} to {max(known):.3g}; {last})"

    return (place[0], f"{place[1]:g}", f"{place[2]:g}", *(cell(key, scale) for key, scale in _MEASURES))
