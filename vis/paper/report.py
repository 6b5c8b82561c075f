"""Figures 5 to 8 of the paper with our model, and the report: reads result.json and series/ of `hedgebed paper`.

Colour stands for the torque everywhere; the band is friction 10 % (or what was set) down and up; the paper's fixed step
is dotted or hollow.
"""

from __future__ import annotations

import math
from pathlib import Path

from vis.page.page import Block, Section, Tile, table, text
from vis.page.report import Report, Result, again, report_of
from vis.page.sentences import Sentences, label_of
from vis.paper.figures import FIGURES, PaperRun, in_order

__all__ = ["CASE_HEAD", "answer_tiles", "write_paper_report"]

say = Sentences(__package__)
_MEASURES = (
    ("trajectory_angle", 180 / math.pi),
    ("max_speed", 1e3),
    ("max_angular_velocity", 1.0),
    ("transition_angle_slip", 180 / math.pi),
    ("transition_angle_hop", 180 / math.pi),
)
CASE_HEAD = (
    "surface", "g", "torque [N m]", "angle [degrees]", "speed [mm/s]", "dθ/dt [rad/s]",
    *(f"{label_of(name)} [degrees]" for name in ("transition_angle_slip", "transition_angle_hop")),
)  # fmt: skip
"""Columns of the table of every case."""
_CLAIMS = ("in the paper's words", "compared", "stated", "ours", "met", "judged by, and why")
_RISEN = "with a torque that rises"


@report_of(dpi=150)
def write_paper_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of `hedgebed paper`, and return the report."""
    paper = PaperRun(report)
    blocks = {name: block for name, draw in FIGURES.items() if (block := draw(paper)) is not None}
    result = paper.result
    swept = [blocks.pop("sweep")] if "sweep" in blocks else []
    surfaces = [
        (name, f"{s['stiffness']:g}", f"{s['damping']:g}", f"{s['mu_s']:g}", f"{s['mu_d']:g}", s["source"])
        for name, s in result["surfaces"].items()
    ]
    given = table(("surface", "K [N/m]", "C [N s/m]", "mu_s", "mu_d", "source"), surfaces, words=True)
    numbers = [_number_row(paper, case) for case in paper.cases if case["variant"] == "nominal"]
    small = "In brackets: friction at both ends of its band; after the semicolon: the paper's 1 ms step."
    sections = [
        Section("", [text(say("about"))]),
        Section("Statements of the text and results", [_claims_table(result)]),
        *_evidence_section(result, blocks.pop("evidence", None)),
        Section("The figures", list(blocks.values())),
        Section("Numbers that the paper does not state", [*swept, *_sliding_blocks(paper), *_grains_blocks(paper)]),
        Section("Every case", [table(CASE_HEAD, numbers), text(small, small=True)]),
        Section("Inputs", [text(f"{_platform(result)} {_ours(result)}"), given]),
        again("hedgebed paper run.toml", ""),
    ]
    count = result.get("integrations", len(paper.cases) + len(paper.sweep))
    return report.write(sections, lead=["paper", f"{count} integrations"], tiles=answer_tiles(result))


def answer_tiles(result: Result) -> list[Tile]:
    """The numbers that a reader wants first."""
    quantities = result["quantities"]
    met, compared = int(quantities["claims_met"]["value"]), int(quantities["claims_compared"]["value"])
    moved, left = math.degrees(quantities["step_angle_gap"]["value"]), quantities["energy_residual"]["value"]
    return [
        Tile("Statements met", f"{met} of {compared}", "those of the text that can be compared"),
        Tile("Cases", str(quantities["case_count"]["value"]), "gravities × torques × surfaces"),
        Tile("1 ms step moves angles by", f"{moved:.2g}°", "at most"),
        Tile("Energy error", f"{left:.1g}", "largest, relative"),
    ]


_MET = {True: "yes", False: "no", None: "not judged"}


def _claims_table(result: Result) -> Block:
    """Every statement, ours beside it, and ours with a torque that rises where that was computed."""
    both = any("risen" in claim for claim in result["claims"])
    head = (*_CLAIMS[:5], _RISEN, _CLAIMS[5]) if both else _CLAIMS
    rows = []
    for claim in result["claims"]:
        risen = claim.get("risen")
        other = [_met_words(risen)] if risen else [""] if both else []
        why = claim["judged_by"] + (f"; {claim['note']}" if claim["note"] else "")
        ours = claim["ours"] + (f" ({claim['difference']})" if claim["difference"] else "")
        rows.append((claim["quote"], claim["compared"], claim["stated"], ours, _MET[claim["met"]], *other, why))
    return table(head, rows, words=True)


def _met_words(claim: Result) -> str:
    return f"{claim['ours']}: {_MET[claim['met']]}"


def _evidence_section(result: Result, drawn: Block | None) -> list[Section]:
    """What would explain the text, weighed; none where that was not asked for."""
    weighed = result.get("evidence")
    if not weighed:
        return []
    step = weighed["rivals"][0]
    head = (
        "what is missing", "ln odds against a step", "friction free", "likeliest value",
        "low-torque angles near 22.5°",
        "beyond", "steel 0.125 N m first",
    )  # fmt: skip
    rows = []
    for row in weighed["rivals"]:
        best = row["best"]
        value = "–" if best["value"] is None else f"{best['value']:g}"
        rows.append(
            (row["words"], *(f"{row[key] - step[key]:+.1f}" for key in ("nats", "apart")), value,
             f"{best['near']} of 8", str(best["above"]), "pivots" if best["pivots"] else "slips")
        )  # fmt: skip
    told = table(head, rows, words=True)
    note = text(say("evidence", error=weighed["error"], wrong=weighed["wrong"]), small=True)
    return [Section("What the model omits on hard ground", [*([drawn] if drawn else []), told, note])]


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


def _ours(result: Result) -> str:
    """What of the numbers is ours, in a sentence."""
    surfaces = result["surfaces"]
    loose = [name for name, numbers in surfaces.items() if numbers.get("granular")]
    frictions = f", and all friction of {' and '.join(loose)}" if loose else ""
    return (
        f"The paper gives none of J, J_w, the wheel's speed before it is braked, K and C{frictions}: they are ours. "
        "mu_d is half of mu_s, as the paper fixed it."
    )


def _sliding_blocks(paper: PaperRun) -> list[Block]:
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
    head = ("surface", "g", "torque [N m]", "mu_s", "mu_d / mu_s, default", "angle", *(f"at {r:g}" for r in ratios))
    note = (
        "Trajectory angles in degrees. The paper fixed mu_d / mu_s to a half; with pure sliding a platform leaves "
        "at tan = m / ((m + m_b) mu_d)."
    )
    return [table(head, rows, title="Sliding friction"), text(note, small=True)]


def _grains_blocks(paper: PaperRun) -> list[Block]:
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
    rows.insert(0, ("default", "the surface's", "1, and C", *nominal))
    head = ("ground", "K of a row [N/m]", "rebound", *(f"{s}, {g:g} g, {t:g} N m" for s, g, t in columns))
    note = (
        "Trajectory angles in degrees. Rebound: share of the deepest depth that is recovered during unloading; the "
        "spring-dampers of this table have no damper. On softer ground the platform sinks and turns further."
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
