"""Figures 5 to 8 of the paper with our model, and the report: reads result.json and series/ of `hedgebed paper`.

Colour stands for the torque everywhere; the band is friction 10 % (or what was set) down and up; the paper's fixed step
is dotted or hollow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from vis.page.page import Page, Section, Tile, code, figure, table, text, write_page
from vis.page.style import styled
from vis.paper.assumed import grains_blocks, ours, sliding_blocks
from vis.paper.measures import figure_8, figure_sweep
from vis.paper.paths import figure_5, figure_6, figure_7
from vis.paper.run import Case, Drawn, PaperRun

__all__ = ["write_paper_report"]

_DPI = 150


def write_paper_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of `hedgebed paper`, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    paper = PaperRun(folder)
    blocks = {}
    for number, (name, draw) in enumerate(_FIGURES.items(), 1):
        drawn = draw(paper)
        if drawn is not None:
            title, caption, drawing = drawn
            with styled():
                drawing.savefig(figures / f"{name}.png", dpi=_DPI)
            blocks[name] = figure(figures / f"{name}.png", title=title, caption=caption)
        tell(number / (len(_FIGURES) + 1))
    report = write_page(folder / "report.html", _page(paper, blocks))
    tell(1.0)
    return report


_FIGURES: dict[str, Callable[[PaperRun], Drawn | None]] = {
    "figure5": figure_5,
    "figure6": figure_6,
    "figure7": figure_7,
    "figure8": figure_8,
    "sweep": figure_sweep,
}


# The page -------------------------------------------------------------------------------------------------------------


def _page(paper: PaperRun, blocks: Mapping[str, Any]) -> Page:
    result = paper.result
    quantities = result["quantities"]
    met, compared = int(quantities["claims_met"]["value"]), int(quantities["claims_compared"]["value"])
    claims = [
        (
            claim["statement"],
            claim["stated"],
            claim["ours"],
            claim["difference"] or "–",
            {True: "yes", False: "no", None: "not comparable"}[claim["met"]],
            claim["judged_by"] + (f"; {claim['note']}" if claim["note"] else ""),
        )
        for claim in result["claims"]
    ]
    head = ("what the text states", "stated", "ours", "difference", "inside", "judged by, and why")
    numbers = [_number_row(paper, case) for case in paper.cases if case["variant"] == "nominal"]
    surfaces = [
        (name, f"{s['stiffness']:g}", f"{s['damping']:g}", f"{s['mu_s']:g}", f"{s['mu_d']:g}", s["source"])
        for name, s in result["surfaces"].items()
    ]
    platform = result["platform"]
    count = result.get("integrations", len(paper.cases) + len(paper.sweep))
    assumed = [*([blocks["sweep"]] if "sweep" in blocks else []), *sliding_blocks(paper), *grains_blocks(paper)]
    moved = math.degrees(quantities["step_angle_gap"]["value"])
    speed = result.get("brake_wheel_speed")
    spun = f", a wheel at {speed:g} rad/s before it is braked" if speed is not None else ""
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "paper", f"{count} integrations"],
        tiles=[
            Tile("Statements met", f"{met} of {compared}", "those of the text that can be compared"),
            Tile("Cases", str(quantities["case_count"]["value"]), "gravities × torques × surfaces"),
            Tile("1 ms step moves angles by", f"{moved:.2g}°", "at most", second=True),
            Tile("Energy left over", f"{quantities['energy_residual']['value']:.1g}", "largest, relative", second=True),
        ],
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section(
                "",
                [
                    text(
                        "Reid, Roveda, Nesnas and Pavone, “Contact Dynamics of Internally-Actuated Platforms for the "
                        "Exploration of Small Solar System Bodies” (i-SAIRAS 2014), with our model. The paper's curves "
                        "are printed in no table, so none of them is drawn here: only what its text states in numbers."
                    )
                ],
            ),
            Section("What the text states, and what comes out", [table(head, claims, words=True)]),
            Section("The figures", [blocks[name] for name in _FIGURES if name in blocks and name != "sweep"]),
            Section("What the paper does not give", assumed),
            Section(
                "Every case",
                [
                    table(
                        (
                            "surface",
                            "g",
                            "torque [N m]",
                            "angle [degrees]",
                            "speed [mm/s]",
                            "dθ/dt [rad/s]",
                            "first slip [degrees]",
                            "first hop [degrees]",
                        ),
                        numbers,
                    ),
                    text(
                        "In brackets: friction at both ends of its band; after the semicolon: the paper's 1 ms step.",
                        small=True,
                    ),
                ],
            ),
            Section(
                "What stands behind it",
                [
                    text(
                        f"Platform: {platform['mass']:g} kg, J = {platform['inertia']:g} kg m², l = "
                        f"{platform['spike_length']:g} m, J_w = {platform['wheel_inertia']:g} kg m²{spun}. "
                        + ours(result)
                    ),
                    table(("surface", "K [N/m]", "C [N s/m]", "mu_s", "mu_d", "source"), surfaces, words=True),
                ],
            ),
            Section("To do this again", [code("hedgebed paper run.toml")]),
        ],
    )


def _number_row(paper: PaperRun, case: Case) -> tuple[str, ...]:
    def cell(key: str, scale: float) -> str:
        values = {
            v: paper.case(case["surface"], case["rig"], case["torque"], v)[key]
            for v in ("nominal", "low", "high", "paper")
        }
        if values["nominal"] is None:
            return "none"
        band = [scale * values[v] for v in ("low", "nominal", "high") if values[v] is not None]
        fixed = "none" if values["paper"] is None else f"{scale * values['paper']:.3g}"
        return f"{scale * values['nominal']:.3g} ({min(band):.3g} to {max(band):.3g}; {fixed})"

    degrees = 180 / math.pi
    return (
        case["surface"],
        f"{case['rig']:g}",
        f"{case['torque']:g}",
        cell("trajectory_angle", degrees),
        cell("max_speed", 1e3),
        cell("max_angular_velocity", 1.0),
        cell("transition_angle_slip", degrees),
        cell("transition_angle_hop", degrees),
    )
