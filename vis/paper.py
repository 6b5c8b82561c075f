"""Figures 5 to 8 of the paper with our model, and the report: reads result.json and series/ of `hedgebed paper`.

Colour stands for the torque everywhere; the band is friction 10 % (or what was set) down and up; the paper's fixed step
is dotted or hollow.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from vis.page import Page, Section, Tile, code, figure, table, text, write_page
from vis.style import GREY, INK, styled
from vis.tumble import STATES, read_columns, state_runs

__all__ = ["write_paper_report"]

Array = NDArray[np.float64]
Case = Mapping[str, Any]

_WIDTH = 8.6
_DPI = 150
_TORQUES = ("#0072B2", "#E69F00", "#CC79A7", "#56B4E9", "#009E73")
_HARD = ("steel", "brick")
_SHOWN = 0.045
"""How far Figure 5 goes [m]: a little more than what the paper trusts."""


def write_paper_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of `hedgebed paper`, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    paper = _Paper(folder)
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


class _Paper:
    """The result and the series that it names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.result: dict[str, Any] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        self.cases: list[dict[str, Any]] = self.result["cases"]
        self.sweep: list[dict[str, Any]] = self.result["sweep"]
        self.table = {(c["surface"], c["rig"], c["torque"], c["variant"]): c for c in self.cases}
        self.rigs = _in_order(c["rig"] for c in self.cases)
        self.torques = sorted({c["torque"] for c in self.cases})
        self.surfaces = _in_order(c["surface"] for c in self.cases)
        self.hard = [name for name in _HARD if name in self.surfaces]

    def colour(self, torque: float) -> str:
        """Of a torque."""
        return _TORQUES[self.torques.index(torque) % len(_TORQUES)]

    def label(self, torque: float) -> str:
        """Of a torque."""
        brake = any(c["actuator"] == "brake" for c in self.cases if c["torque"] == torque)
        return f"{torque:g} N m ({'brake' if brake else 'motor'})"

    def case(self, surface: str, rig: float, torque: float, variant: str = "nominal") -> dict[str, Any]:
        """One case."""
        return self.table[surface, rig, torque, variant]

    def rows(self, case: Case) -> tuple[dict[str, Array], NDArray[np.str_]]:
        """The series of a case, and its states."""
        return read_columns(self.folder / case["series"])

    def handles(self) -> list[Any]:
        """One line a torque."""
        return [Line2D([], [], color=self.colour(torque), lw=2.2, label=self.label(torque)) for torque in self.torques]


def _in_order(values: Any) -> list[Any]:
    return list(dict.fromkeys(values))


def _new(width: float, height: float) -> Figure:
    drawing = Figure(figsize=(width, height))
    FigureCanvasAgg(drawing)
    return drawing


def _legend(drawing: Figure, handles: Sequence[Any], columns: int = 4) -> None:
    drawing.legend(handles=handles, loc="outside upper left", ncols=columns)


# Figure 5 -------------------------------------------------------------------------------------------------------------

Drawn = tuple[str, str, Figure]


def _start(paper: _Paper, case: Case) -> tuple[Array, Array]:
    """The path from the start to the end of the first hop [mm], as far as Figure 5 goes."""
    numbers, states = paper.rows(case)
    x, y = 1e3 * (numbers["x_m"] - numbers["x_m"][0]), 1e3 * (numbers["y_m"] - numbers["y_m"][0])
    beyond = np.flatnonzero(np.hypot(x, y) > 1e3 * _SHOWN)
    landed = [high for _, high, name in state_runs(states) if name == "hop"]
    end = min([len(x), *beyond[:1].tolist(), *landed[:1]])
    return x[:end], y[:end]


def _figure_5(paper: _Paper) -> Drawn | None:
    """Path of the centre from its start, steel, the first gravity."""
    if "steel" not in paper.surfaces:
        return None
    rig, gap = paper.rigs[0], 0.0
    with styled():
        drawing = _new(_WIDTH, 4.6)
        axis = drawing.subplots()
        for stated in (22.5, 60.0):
            reach = 1e3 * _SHOWN
            along = np.array([0.0, reach * math.cos(math.radians(stated))])
            axis.plot(along, along * math.tan(math.radians(stated)), color=GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
            top = along[1] * math.tan(math.radians(stated))
            axis.annotate(
                f"{stated:g}° in the text", (along[1], top), xytext=(3, 2), textcoords="offset points", color=GREY
            )
        for torque in paper.torques:
            colour = paper.colour(torque)
            low, high = (_start(paper, paper.case("steel", rig, torque, variant)) for variant in ("low", "high"))
            ring = np.concatenate([np.stack(low, axis=1), np.stack(high, axis=1)[::-1]])
            axis.fill(ring[:, 0], ring[:, 1], color=colour, alpha=0.25, lw=0)
            x, y = _start(paper, paper.case("steel", rig, torque))
            axis.plot(x, y, color=colour, lw=2.0)
            fixed = _start(paper, paper.case("steel", rig, torque, "paper"))
            axis.plot(*fixed, color=INK, lw=1.1, ls=(0, (1, 1.6)))
            shared = min(len(x), len(fixed[0]))
            gap = max(gap, float(np.hypot(x[:shared] - fixed[0][:shared], y[:shared] - fixed[1][:shared]).max()))
        axis.plot(0, 0, "o", color=INK, ms=4)
        axis.set_aspect("equal")
        axis.set_xlim(-2.0, 1.25e3 * _SHOWN)
        axis.set_ylim(-1.0, 1.02e3 * _SHOWN)
        axis.set_xlabel("x of the centre from the start [mm]")
        axis.set_ylabel("y of the centre from the start [mm]")
        band = Patch(color=GREY, alpha=0.35, lw=0, label="friction band")
        dotted = Line2D([], [], color=INK, lw=1.1, ls=(0, (1, 1.6)), label="the paper's 1 ms step")
        _legend(drawing, [*paper.handles(), band, dotted], columns=5)
    caption = (
        f"Steel, {rig:g} g, to the end of the first hop or {1e3 * _SHOWN:g} mm from the start (the paper trusts its "
        "rig for 40 mm). Shaded: between friction at both ends of its band. Dotted: the paper's fixed step, at most "
        f"{gap:.2g} mm from the located integrator at the same time. Dashed: the angles that the text states for low "
        "and high torque."
    )
    return "Figure 5: the start on steel", caption, drawing


# Figure 6 -------------------------------------------------------------------------------------------------------------

_ROWS = (("low", "μ low"), ("nominal", "μ"), ("high", "μ high"), ("paper", "1 ms step"))


def _figure_6(paper: _Paper) -> Drawn | None:
    """State against angle, steel and brick, the first gravity, a row a torque."""
    if not paper.hard:
        return None
    rig, widest = paper.rigs[0], 60.0
    with styled():
        drawing = _new(_WIDTH, 0.55 + 1.35 * len(paper.torques))
        axes = drawing.subplots(len(paper.torques), len(paper.hard), sharex=True, sharey=True, squeeze=False)
        for i, torque in enumerate(paper.torques):
            for j, surface in enumerate(paper.hard):
                axis: Axes = axes[i, j]
                axis.set_title(f"{surface}, {paper.label(torque)}")
                for row, (variant, _) in enumerate(_ROWS):
                    _state_bar(axis, paper, paper.case(surface, rig, torque, variant), row)
                axis.axvline(0.0, color=GREY, lw=0.6)
                axis.grid(False, axis="y")
        for axis in axes[-1]:
            axis.set_xlabel("θ [degrees]")
        axes[0, 0].set_yticks(range(len(_ROWS)), [label for _, label in _ROWS])
        axes[0, 0].set_ylim(len(_ROWS) - 0.4, -0.6)
        axes[0, 0].set_xlim(-2.0, widest)
        handles = [Line2D([], [], color=colour, lw=6, label=name) for name, colour in STATES.items()]
        handles.append(Line2D([], [], color=INK, marker="v", ls="", ms=5, label="first hop"))
        _legend(drawing, handles, columns=5)
    caption = (
        f"State by angle at {rig:g} g, up to {widest:g} degrees or the end of the trial; in each panel friction low, "
        "as it is and high by the located integrator, and the paper's fixed step. The text: at the brake's torque the "
        "platform slips almost at once, and short tumbles end in a brief hop (triangle: the first one begins)."
    )
    return "Figure 6: pivot, slip, hop", caption, drawing


def _state_bar(axis: Axes, paper: _Paper, case: Case, row: int) -> None:
    """One bar of states over the angle; a state too short to be seen is a tick."""
    numbers, states = paper.rows(case)
    theta = np.degrees(numbers["theta_rad"])
    edges = [math.degrees(angle) for _, _, angle in case["transitions"]]
    for low, high, name in state_runs(states):
        start = theta[low] if low == 0 else _nearest(edges, theta[low], theta[low - 1])
        last = theta[high - 1] if high == len(theta) else _nearest(edges, theta[high], theta[high - 1])
        axis.barh(row, last - start, left=start, height=0.62, color=STATES.get(name, INK), lw=0)
    hop = case["transition_angle_hop"]
    if hop is not None:
        axis.plot(math.degrees(hop), row - 0.42, marker="v", color=INK, ms=4.5, clip_on=True)


def _nearest(edges: Sequence[float], one: float, other: float) -> float:
    """The transition between two rows; their middle where none is listed."""
    middle = 0.5 * (one + other)
    between = [edge for edge in edges if min(one, other) - 1e-9 <= edge <= max(one, other) + 1e-9]
    return min(between, key=lambda edge: abs(edge - middle)) if between else middle


# Figure 7 -------------------------------------------------------------------------------------------------------------


def _parabola(launch: Mapping[str, float]) -> tuple[Array, Array]:
    """The flight from the launch [m] until it is back at the launch's height, from where it starts."""
    g, vx, vy = launch["gravity"], launch["vx"], launch["vy"]
    time = np.linspace(0.0, 2 * max(vy, 0.0) / g, 120)
    return vx * time, vy * time - 0.5 * g * time**2


def _figure_7(paper: _Paper) -> Drawn | None:
    """The first hops extrapolated: motor trials above, all below."""
    if not paper.hard:
        return None
    styles = dict(zip(paper.rigs, ("-", (0, (4, 2)), (0, (1, 1.4))), strict=False))
    flat = []
    with styled():
        drawing = _new(_WIDTH, 5.4)
        axes = drawing.subplots(2, len(paper.hard), squeeze=False, sharey="row", sharex="row")
        for j, surface in enumerate(paper.hard):
            for i, chosen in enumerate((_motors(paper), paper.torques)):
                axis: Axes = axes[i, j]
                axis.set_title(f"{surface}, {'motor trials' if i == 0 else 'all'}")
                for torque in chosen:
                    for rig, style in styles.items():
                        drawn = _draw_hop(axis, paper, surface, rig, torque, style)
                        if not drawn and i == 0:
                            flat.append(f"{surface}, {rig:g} g, {torque:g} N m")
                axis.plot(0, 0, "o", color=INK, ms=4)
        for axis in axes[-1]:
            axis.set_xlabel("x from the launch [mm]")
        for axis in axes[:, 0]:
            axis.set_ylabel("y from the launch [mm]")
        gravities = [Line2D([], [], color=INK, ls=style, lw=1.6, label=f"{rig:g} g") for rig, style in styles.items()]
        band = Patch(color=GREY, alpha=0.35, lw=0, label="friction band")
        _legend(drawing, [*paper.handles(), *gravities, band], columns=6)
    caption = (
        "The first hop of each trial, extrapolated without a ground from where it begins until it is back at that "
        "height; above those of the motors, below all. Shaded: friction at both ends of its band."
        + (f" No hop that rises: {'; '.join(flat)}." if flat else "")
    )
    return "Figure 7: hops as parabolas", caption, drawing


def _motors(paper: _Paper) -> list[float]:
    return [t for t in paper.torques if any(c["actuator"] == "motor" for c in paper.cases if c["torque"] == t)]


def _draw_hop(axis: Axes, paper: _Paper, surface: str, rig: float, torque: float, style: Any) -> bool:
    """One hop with its band; False where there is none that rises."""
    nominal, low, high = (paper.case(surface, rig, torque, v)["launch"] for v in ("nominal", "low", "high"))
    if nominal is None or nominal["vy"] <= 0:
        return False
    colour = paper.colour(torque)
    if low is not None and high is not None:
        one, other = _parabola(low), _parabola(high)
        ring = np.concatenate([np.stack(one, axis=1), np.stack(other, axis=1)[::-1]])
        axis.fill(1e3 * ring[:, 0], 1e3 * ring[:, 1], color=colour, alpha=0.22, lw=0)
    x, y = _parabola(nominal)
    axis.plot(1e3 * x, 1e3 * y, color=colour, ls=style, lw=1.7)
    return True


# Figure 8 -------------------------------------------------------------------------------------------------------------

_MEASURES = (
    ("trajectory_angle", 180 / math.pi, "trajectory angle [degrees]"),
    ("max_speed", 1e3, "largest speed [mm/s]"),
    ("max_angular_velocity", 1.0, "largest dθ/dt [rad/s]"),
)


def _figure_8(paper: _Paper) -> Drawn | None:
    """Angle, speed and angular velocity over gravities, torques and surfaces."""
    with styled():
        drawing = _new(_WIDTH, 7.2)
        axes = drawing.subplots(len(_MEASURES), len(paper.rigs), sharex=True, sharey="row", squeeze=False)
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
        dashed = Line2D([], [], color=GREY, lw=0.9, ls=(0, (5, 3)), label="0°, 22.5°, 60° of the text")
        hollow = Line2D([], [], color=INK, marker="o", mfc="none", ls="", ms=7, label="the paper's 1 ms step")
        dots = [
            Line2D([], [], color=paper.colour(t), marker="o", ls="", ms=5, label=paper.label(t)) for t in paper.torques
        ]
        _legend(drawing, [*dots, hollow, dashed], columns=3)
    caption = (
        "The centre's angle over its first 10 mm, and its largest speed and angular velocity before it is 40 mm away. "
        "Bars: friction at both ends of its band; rings: the paper's fixed step. The text: about 22.5° at low torque "
        "on brick, growing to about 60°; negative angles for the brake on grains. Sand and JSC-1A are spring-dampers."
    )
    return "Figure 8: angle, speed, angular velocity", caption, drawing


def _draw_measures(axis: Axes, paper: _Paper, surface: str, rig: float, key: str, scale: float, place: int) -> None:
    """The marks of one surface, a torque beside the other."""
    count = len(paper.torques)
    for index, torque in enumerate(paper.torques):
        at = place + 0.22 * (index - 0.5 * (count - 1))
        values = {v: paper.case(surface, rig, torque, v)[key] for v in ("low", "nominal", "high", "paper")}
        if values["nominal"] is None:
            axis.text(at, 0.02, "none", rotation=90, fontsize=7, transform=axis.get_xaxis_transform(), ha="center")
            continue
        band = [scale * values[v] for v in ("low", "nominal", "high") if values[v] is not None]
        colour = paper.colour(torque)
        axis.plot([at, at], [min(band), max(band)], color=colour, lw=3.0, alpha=0.45, solid_capstyle="butt")
        axis.plot(at, scale * values["nominal"], "o", color=colour, ms=5)
        if values["paper"] is not None:
            axis.plot(at, scale * values["paper"], "o", color=INK, mfc="none", ms=7.5, mew=0.8)


# The sweep ------------------------------------------------------------------------------------------------------------


def _figure_sweep(paper: _Paper) -> Drawn | None:
    """What halving and doubling does to the trajectory angle and to the first hop."""
    if not paper.sweep:
        return None
    keys = _in_order(entry["variant"].split(" x")[0] for entry in paper.sweep)
    rig = paper.sweep[0]["rig"]
    words = {
        "inertia": "inertia J", "wheel_inertia": "wheel inertia", "stiffness": "stiffness K", "damping": "damping C",
        "wheel_speed_0": "brake's wheel speed",
    }  # fmt: skip
    measures = (
        ("trajectory_angle", "trajectory angle [degrees]"),
        ("transition_angle_hop", "θ at the first hop [degrees]"),
    )
    with styled():
        drawing = _new(_WIDTH, 4.6)
        axes = drawing.subplots(len(paper.hard), 2, sharey=True, sharex="col", squeeze=False)
        for i, surface in enumerate(paper.hard):
            for j, (measure, label) in enumerate(measures):
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
                if i == len(paper.hard) - 1:
                    axis.set_xlabel(label)
            axes[i, 0].set_yticks(range(len(keys)), [words.get(key, key) for key in keys])
            axes[i, 0].set_ylim(len(keys) - 0.5, -0.5)
        marks = [
            Line2D([], [], color=INK, marker=mark, ls="", ms=6, label=label)
            for mark, label in (("<", "halved"), (">", "doubled"))
        ]
        _legend(drawing, [*paper.handles(), *marks], columns=5)
    caption = (
        f"At {rig:g} g: the numbers that the paper does not give, halved and doubled one at a time; the line is the "
        "value as it is."
    )
    return "What the paper does not give", caption, drawing


_FIGURES: dict[str, Callable[[_Paper], Drawn | None]] = {
    "figure5": _figure_5,
    "figure6": _figure_6,
    "figure7": _figure_7,
    "figure8": _figure_8,
    "sweep": _figure_sweep,
}


# The page -------------------------------------------------------------------------------------------------------------


def _page(paper: _Paper, blocks: Mapping[str, Any]) -> Page:
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
    wheel = math.degrees(quantities["step_angle_gap"]["value"])
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "paper", f"{len(paper.cases) + len(paper.sweep)} integrations"],
        tiles=[
            Tile("Statements met", f"{met} of {compared}", "those of the text that can be compared"),
            Tile("Cases", str(quantities["case_count"]["value"]), "gravities × torques × surfaces"),
            Tile("1 ms step moves angles by", f"{wheel:.2g}°", "at most", second=True),
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
            Section("What the paper does not give", [blocks["sweep"]] if "sweep" in blocks else []),
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
                        f"{platform['spike_length']:g} m, J_w = {platform['wheel_inertia']:g} kg m²."
                    ),
                    table(("surface", "K [N/m]", "C [N s/m]", "mu_s", "mu_d", "source"), surfaces, words=True),
                ],
            ),
            Section("To do this again", [code("hedgebed paper run.toml")]),
        ],
    )


def _number_row(paper: _Paper, case: Case) -> tuple[str, ...]:
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
