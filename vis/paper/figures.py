"""Figures 5 to 8 of the paper with our model, and what halving and doubling does that the paper does not give."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from rigid.intervals import NORMAL, half_width
from vis.page.folder import read_columns
from vis.page.page import Block
from vis.page.plots import BED, GREY, INK, MODEL, STATES, Array, handle, legend_above, sheet
from vis.page.report import Report, Result
from vis.page.sentences import label_of
from vis.page.states import States, state_runs

__all__ = ["COLOURS", "FIGURES", "PaperRun", "in_order"]

COLOURS = ("#0072B2", "#E69F00", "#CC79A7", "#56B4E9", "#009E73")
"""Of the torques, the smallest first."""
_HARD = ("steel", "brick")
_SOILS = {"sand": "sand", "jsc1a": "JSC-1A"}
"""Surfaces of grains: the soil of the paper. Legends name the materials that we compute."""
_MARK = 2.5  # an interval below this half is no longer than its mark [degrees]
VARIANTS = ("low", "nominal", "high", "paper")
"""Of a case: friction at the lower end of its band, its value, at the upper end; the paper's fixed step."""
_DASHED, _DOTTED = (0, (5, 3)), (0, (1, 1.6))
_SURFACE_LINES, _RIG_MARKS = {"steel": "-", "brick": (0, (4, 2))}, "os^D"
_SHOWN = 0.045
"""How far Figure 5 goes [m]: a little more than what the paper trusts."""


class PaperRun:
    """The result's cases by what they are of, their series, and a colour for each torque."""

    def __init__(self, report: Report) -> None:
        self.draw, self.folder, self.result = report.draw, report.folder, report.result
        self.cases: list[Result] = self.result["cases"]
        self.sweep: list[Result] = self.result["sweep"]
        self.table = {(c["surface"], c["rig"], c["torque"], c["variant"]): c for c in self.cases}
        self.rigs = in_order(c["rig"] for c in self.cases)
        self.torques = sorted({c["torque"] for c in self.cases})
        self.surfaces = in_order(c["surface"] for c in self.cases)
        self.hard = [name for name in _HARD if name in self.surfaces]

    def on(self, what: str, surfaces: Sequence[str], rigs: Sequence[float] = ()) -> str:
        """The title of a figure: what it shows, on which surfaces' spring-dampers, in which simulated gravities."""
        gravities = " and ".join(f"{rig:g} g" for rig in rigs or self.rigs)
        named = [_SOILS.get(name, name) for name in surfaces]
        listed = " and ".join(filter(None, (", ".join(named[:-1]), named[-1])))
        return f"{what} on the spring-damper of {listed}, {gravities}"

    def colour(self, torque: float) -> str:
        """The colour of a torque."""
        return COLOURS[self.torques.index(torque) % len(COLOURS)]

    def label(self, torque: float) -> str:
        """A torque in words."""
        brake = any(c["actuator"] == "brake" for c in self.cases if c["torque"] == torque)
        return f"{torque:g} N m ({'brake' if brake else 'motor'})"

    def case(self, surface: str, rig: float, torque: float, variant: str = "nominal") -> Result:
        """One case."""
        return self.table[surface, rig, torque, variant]

    def variants(self, surface: str, rig: float, torque: float, key: str) -> list[Any]:
        """A number of a case in each of the `VARIANTS`."""
        return [self.table[surface, rig, torque, variant][key] for variant in VARIANTS]

    def rows(self, case: Result) -> tuple[dict[str, Array], States]:
        """The series of a case, and its states."""
        return read_columns(self.folder / case["series"])

    def handles(self) -> list[Any]:
        """One line a torque."""
        return [handle(self.label(torque), self.colour(torque), lw=2.2) for torque in self.torques]


def in_order(values: Iterable[Any]) -> list[Any]:
    """Each value once, in the order in which it comes."""
    return list(dict.fromkeys(values))


def _fill(axis: Axes, one: tuple[Array, Array], other: tuple[Array, Array], scale: float, **style: Any) -> None:
    """Fill between two lines that start at one point."""
    ring = np.concatenate([np.stack(one, axis=1), np.stack(other, axis=1)[::-1]])
    axis.fill(scale * ring[:, 0], scale * ring[:, 1], lw=0, **style)


def _start(paper: PaperRun, case: Result) -> tuple[Array, Array]:
    """The path from the start to the end of the first hop [mm], as far as Figure 5 goes."""
    numbers, states = paper.rows(case)
    x, y = 1e3 * (numbers["x_m"] - numbers["x_m"][0]), 1e3 * (numbers["y_m"] - numbers["y_m"][0])
    beyond = np.flatnonzero(np.hypot(x, y) > 1e3 * _SHOWN)
    landed = [high for _, high, name in state_runs(states) if name == "hop"]
    end = min([len(x), *beyond[:1].tolist(), *landed[:1]])
    return x[:end], y[:end]


def figure_5(paper: PaperRun) -> Block | None:
    """Path of the centre from its start, steel, the first gravity."""
    if "steel" not in paper.surfaces:
        return None
    rig, gap = paper.rigs[0], 0.0
    drawing, ((axis,),) = sheet(1, 1, 4.6)
    for stated in (22.5, 60.0):
        reach = 1e3 * _SHOWN
        along = np.array([0.0, reach * math.cos(math.radians(stated))])
        axis.plot(along, along * math.tan(math.radians(stated)), color=GREY, lw=0.9, ls=_DASHED, zorder=1)
        top = along[1] * math.tan(math.radians(stated))
        axis.annotate(
            f"{stated:g}° in the text", (along[1], top), xytext=(3, 2), textcoords="offset points", color=GREY
        )
    for torque in paper.torques:
        colour = paper.colour(torque)
        low, high = (_start(paper, paper.case("steel", rig, torque, variant)) for variant in ("low", "high"))
        _fill(axis, low, high, 1.0, color=colour, alpha=0.25)
        x, y = _start(paper, paper.case("steel", rig, torque))
        axis.plot(x, y, color=colour, lw=2.0)
        fixed = _start(paper, paper.case("steel", rig, torque, "paper"))
        axis.plot(*fixed, color=INK, lw=1.1, ls=_DOTTED)
        shared = min(len(x), len(fixed[0]))
        gap = max(gap, float(np.hypot(x[:shared] - fixed[0][:shared], y[:shared] - fixed[1][:shared]).max()))
    axis.plot(0, 0, "o", color=INK, ms=4)
    axis.set(
        aspect="equal",
        xlim=(-2.0, 1.25e3 * _SHOWN),
        ylim=(-1.0, 1.02e3 * _SHOWN),
        xlabel="x of the centre from the start [mm]",
        ylabel="y of the centre from the start [mm]",
    )
    band = Patch(color=GREY, alpha=0.35, lw=0, label="friction band")
    dotted = handle("the paper's 1 ms step", INK, lw=1.1, ls=_DOTTED)
    legend_above(drawing, [*paper.handles(), band, dotted], columns=5)
    about = paper.on("Path of the start", ["steel"], [rig])
    return paper.draw("figure5", drawing, about=about, rig=rig, shown=1e3 * _SHOWN, gap=gap)


_ROWS = (("low", "μ low"), ("nominal", "μ"), ("high", "μ high"), ("paper", "1 ms step"))


def figure_6(paper: PaperRun) -> Block | None:
    """State against angle, steel and brick, the first gravity, a row a torque."""
    if not paper.hard:
        return None
    rig, widest = paper.rigs[0], 60.0
    count = len(paper.torques)
    drawing, axes = sheet(count, len(paper.hard), 0.55 + 1.35 * count, sharex=True, sharey=True)
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
    axes[0, 0].set(ylim=(len(_ROWS) - 0.4, -0.6), xlim=(-2.0, widest))
    handles = [handle(name, colour, lw=6) for name, colour in STATES.items()]
    handles.append(handle("first hop", INK, marker="v", ls="", ms=5))
    legend_above(drawing, handles, columns=5)
    about = paper.on("States", paper.hard, [rig])
    return paper.draw("figure6", drawing, about=about, rig=rig, widest=widest)


def _state_bar(axis: Axes, paper: PaperRun, case: Result, row: int) -> None:
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


def _parabola(launch: Result) -> tuple[Array, Array]:
    """The flight from the launch [m] until it is back at the launch's height, from where it starts."""
    g, vx, vy = launch["gravity"], launch["vx"], launch["vy"]
    time = np.linspace(0.0, 2 * max(vy, 0.0) / g, 120)
    return vx * time, vy * time - 0.5 * g * time**2


def figure_7(paper: PaperRun) -> Block | None:
    """The first hops extrapolated: motor trials above, all below."""
    if not paper.hard:
        return None
    styles = dict(zip(paper.rigs, ("-", (0, (4, 2)), (0, (1, 1.4))), strict=False))
    flat = []
    drawing, axes = sheet(2, len(paper.hard), 5.4, sharey="row", sharex="row")
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
        axis.set_xlabel("x [mm]; x and y are from the launch")
    for axis in axes[:, 0]:
        axis.set_ylabel("y [mm]")
    _square(axes)
    gravities = [handle(f"{rig:g} g", INK, ls=style, lw=1.6) for rig, style in styles.items()]
    band = Patch(color=GREY, alpha=0.35, lw=0, label="friction band")
    legend_above(drawing, [*paper.handles(), *gravities, band], columns=6)
    missing = f" No hop that rises: {'; '.join(flat)}." if flat else ""
    return paper.draw("figure7", drawing, about=paper.on("First hops", paper.hard), missing=missing)


def _square(axes: NDArray[Any]) -> None:
    """Give each row of panels one scale for x and y, and a height to match: a fifth of its width to all of it."""
    for row in axes:
        for axis in row:
            axis.set_aspect("equal", adjustable="box")
    slopes = [abs(np.ptp(row[0].get_ylim()) / np.ptp(row[0].get_xlim())) for row in axes]
    axes[0, 0].get_gridspec().set_height_ratios(np.clip(slopes, 0.2, 1.0))


def _motors(paper: PaperRun) -> list[float]:
    return [t for t in paper.torques if any(c["actuator"] == "motor" for c in paper.cases if c["torque"] == t)]


def _draw_hop(axis: Axes, paper: PaperRun, surface: str, rig: float, torque: float, style: Any) -> bool:
    """One hop with its band; False where there is none that rises."""
    low, nominal, high, _ = paper.variants(surface, rig, torque, "launch")
    if nominal is None or nominal["vy"] <= 0:
        return False
    colour = paper.colour(torque)
    if low is not None and high is not None:
        _fill(axis, _parabola(low), _parabola(high), 1e3, color=colour, alpha=0.22)
    x, y = _parabola(nominal)
    axis.plot(1e3 * x, 1e3 * y, color=colour, ls=style, lw=1.7)
    return True


_MEASURES = (
    ("trajectory_angle", 180 / math.pi, "trajectory angle [degrees]"),
    ("max_speed", 1e3, "largest speed [mm/s]"),
    ("max_angular_velocity", 1.0, "largest dθ/dt [rad/s]"),
)


def figure_8(paper: PaperRun) -> Block:
    """Angle, speed and angular velocity over gravities, torques and surfaces."""
    drawing, axes = sheet(len(_MEASURES), len(paper.rigs), 7.2, sharex=True, sharey="row")
    for j, rig in enumerate(paper.rigs):
        axes[0, j].set_title(f"{rig:g} g")
        for i, (key, scale, label) in enumerate(_MEASURES):
            axis: Axes = axes[i, j]
            for place, surface in enumerate(paper.surfaces):
                _draw_measures(axis, paper, surface, rig, key, scale, place)
            if j == 0:
                axis.set_ylabel(label)
            axis.set_xticks(range(len(paper.surfaces)), [_SOILS.get(name, name) for name in paper.surfaces])
            axis.tick_params(axis="x", length=0)
            axis.grid(False, axis="x")
            for edge in range(1, len(paper.surfaces)):
                axis.axvline(edge - 0.5, color="#e4e4e4", lw=0.7)
        for stated in (0.0, 22.5, 60.0):
            axes[0, j].axhline(stated, color=GREY, lw=0.9, ls=_DASHED, zorder=1)
    for row in axes[1:]:
        row[0].set_ylim(bottom=-0.04 * row[0].get_ylim()[1])  # a mark at 0 is whole
    dashed = handle("0°, 22.5°, 60° of the text", GREY, lw=0.9, ls=_DASHED)
    hollow = handle("the paper's 1 ms step", INK, marker="o", mfc="none", ls="", ms=7)
    dots = [handle(paper.label(t), paper.colour(t), marker="o", ls="", ms=5) for t in paper.torques]
    legend_above(drawing, [*dots, hollow, dashed], columns=3)
    return paper.draw("figure8", drawing, about=paper.on("Angles and speeds", paper.surfaces))


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


def figure_signs(paper: PaperRun) -> Block | None:
    """Trajectory angles on sand and JSC-1A: spring-damper, grains, and the signs that the text states."""
    kept = paper.result.get("kept_on_grains")
    surfaces = [name for name in _SOILS if name in paper.surfaces]
    if not kept or not surfaces:
        return None
    drawing, axes = sheet(1, len(paper.rigs), 3.9, sharey=True)
    places = [(surface, torque) for surface in surfaces for torque in paper.torques]
    for axis, rig in zip(axes[0], paper.rigs, strict=True):
        axis.set_title(f"{rig:g} g")
        axis.axhline(0.0, color=INK, lw=0.8)
        for place, (surface, torque) in enumerate(places):
            _draw_signs(axis, paper, kept, (surface, rig, torque), place)
        words = [f"{torque:g} N m\n{paper.label(torque).split('(')[1][:-1]}" for _, torque in places]
        axis.set_xticks(range(len(places)), words, fontsize=8)
        axis.tick_params(axis="x", length=0)
        axis.grid(False, axis="x")
        for number, surface in enumerate(surfaces):
            middle = (len(paper.torques) * (number + 0.5) - 0.5 + 0.5) / len(places)
            axis.text(middle, 0.98, _SOILS[surface], transform=axis.transAxes, ha="center", va="top", fontweight="bold")
            if only := _only_weak(kept, surface, rig):
                axis.text(middle, 0.90, only, transform=axis.transAxes, ha="center", va="top", fontsize=8)
            if number:
                axis.axvline(len(paper.torques) * number - 0.5, color=GREY, lw=0.8)
        axis.set_xlim(-0.5, len(places) - 0.5)
    axes[0, 0].set(ylabel="trajectory angle [degrees]", ylim=(-45.0, 72.0))
    packed = [entry for entry in kept.get("packed", []) if entry["surface"] in surfaces]
    denser = [handle(f"{_grains_of(packed, surfaces)} at the powder's density: one bed", BED, marker="D", ls="", ms=5)]
    springs = [entry for entry in kept.get("springs", []) if entry["surface"] in surfaces]
    halves = [_half(entry) for entry in kept["beds"] if entry["surface"] in surfaces]
    small = ", ".join(f"± {half:.1f}°" for half in sorted(halves) if half < _MARK)
    hidden = f" (marks hide {small})" if small else ""
    thin = f"by the error of K and C, ± {_half(springs[0]):.0f}° (95 %, one case)" if springs else ""
    legend_above(drawing, [
        handle(f"spring-damper of {' and '.join(surfaces)}", MODEL, marker="o", ls="", ms=6),
        handle("by both ends of its friction band", MODEL, lw=3.0, alpha=0.4),
        *([handle(thin, MODEL, lw=1.0)] if springs else []),
        handle(f"{_grains_of(kept['beds'], surfaces)}: mean of three to five beds, 95 %{hidden}",
               BED, marker="s", ls="", ms=6),
        handle(f"other materials, {_grains_of(kept['one_bed'], surfaces)}: one bed each", BED, marker="s", mfc="none",
               ls="", ms=6),
        *(denser if packed else []),
        Patch(color=GREY, alpha=0.22, lw=0, label="the paper: motors about +22.5°, brakes below 0"),
    ], 2)  # fmt: skip
    named = " and ".join(_SOILS[name] for name in surfaces)
    return paper.draw(
        "signs", drawing, about=f"Trajectory angles on {named}: spring-damper, grains and the paper's text"
    )


def _only_weak(kept: Result, surface: str, rig: float) -> str:
    """Which grains a half of a panel shows, where it has those of other materials only."""
    here = {key: [entry for entry in kept.get(key, []) if (entry["surface"], entry["rig"]) == (surface, rig)]
            for key in ("one_bed", "beds", "packed")}  # fmt: skip
    if here["beds"] or here["packed"] or not here["one_bed"]:
        return ""
    return f"{_grains_of(here['one_bed'], [surface]).removeprefix('grains of ')} only,\none bed each"


def _grains_of(entries: Sequence[Result], surfaces: Sequence[str]) -> str:
    """The materials of kept runs on grains; older results do not name them."""
    named = in_order(entry["grains"] for entry in entries if "grains" in entry and entry["surface"] in surfaces)
    return f"grains of {' and '.join(named)}" if named else "grains"


def _draw_signs(axis: Axes, paper: PaperRun, kept: Result, what: tuple[str, float, float], place: int) -> None:
    """One torque on one surface: what the paper's text states as a grey box, our angles as marks."""
    surface, rig, torque = what

    def of_this(entries: Sequence[Result]) -> list[Result]:
        return [entry for entry in entries if (entry["surface"], entry["rig"], entry["torque"]) == what]

    motor = paper.case(surface, rig, torque)["actuator"] == "motor"
    low, high = (17.5, 27.5) if motor else (-45.0, 0.0)
    axis.fill_between([place - 0.4, place + 0.4], low, high, color=GREY, alpha=0.22, lw=0)
    band = [value for value in paper.variants(surface, rig, torque, "trajectory_angle")[:3] if value is not None]
    nominal = paper.case(surface, rig, torque)["trajectory_angle"]
    if nominal is not None:
        axis.plot([place - 0.2] * 2, np.degrees([min(band), max(band)]), color=MODEL, lw=3.0, alpha=0.4)
        axis.plot(place - 0.2, math.degrees(nominal), "o", color=MODEL, ms=5.5)
    for entry in of_this(kept.get("springs", [])):
        axis.errorbar(place - 0.2, entry["angle"], _half(entry), fmt="none", color=MODEL, lw=1.0, capsize=3)
    for entry in of_this(kept["one_bed"]):
        axis.plot(place, entry["angle"], "s", color=BED, mfc="none", ms=5.5)
    for entry in of_this(kept["beds"]):
        axis.errorbar(place + 0.2, np.mean(entry["angles"]), _half(entry), fmt="s", color=BED, ms=5.5, capsize=3)
    for entry in of_this(kept.get("packed", [])):
        axis.plot(place + 0.33, entry["angles"][0], "D", color=BED, ms=4.5)


def _half(entry: Result) -> float:
    """Half of the 95 % interval [degrees]: of the mean over beds, or of an angle on the spring-damper."""
    if "angles" in entry:
        return half_width(float(np.std(entry["angles"], ddof=1)), len(entry["angles"])) or 0.0
    return NORMAL * float(entry["std"] if "std" in entry else entry["half"])  # older folders have the std as half


def figure_sweep(paper: PaperRun) -> Block | None:
    """What halving and doubling does to the trajectory angle and to the first hop."""
    if not paper.sweep:
        return None
    keys = in_order(entry["variant"].split(" x")[0] for entry in paper.sweep)
    rig = paper.sweep[0]["rig"]
    sliding = paper.result.get("sliding", [])
    ratios = sorted({entry["varied"]["ratio"] for entry in sliding})
    places = [*keys, "sliding"] if sliding else keys
    marks: list[tuple[Result, int, str, float]] = []
    for entry in paper.sweep:
        key, factor = entry["variant"].split(" x")
        marks.append((entry, keys.index(key), ">" if float(factor) > 1 else "<", 6.0))
    for entry in sliding:
        if entry["rig"] == rig:
            marks.append((entry, len(keys), "D", _diamond(entry["varied"]["ratio"], ratios)))
    words = {
        "inertia": "inertia J", "wheel_inertia": "wheel inertia", "stiffness": "stiffness K", "damping": "damping C",
        "wheel_speed_0": "brake's wheel speed", "sliding": "friction mu_d / mu_s",
    }  # fmt: skip
    measures = {
        "trajectory_angle": "trajectory angle [degrees]",
        "transition_angle_hop": f"{label_of('transition_angle_hop')} [degrees]",
    }
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
                for entry, place, mark, size in marks:
                    if (entry["surface"], entry["torque"]) == (surface, torque) and entry[measure] is not None:
                        axis.plot(math.degrees(entry[measure]), place, mark, color=paper.colour(torque), ms=size)
            if i == len(paper.hard) - 1:
                axis.set_xlabel(label)
        axes[i, 0].set_yticks(range(len(places)), [words.get(key, key) for key in places])
        axes[i, 0].set_ylim(len(places) - 0.5, -0.5)
    legend = [handle(label, INK, marker=mark, ls="", ms=6) for mark, label in (("<", "halved"), (">", "doubled"))]
    legend += [handle(f"mu_d = {ratio:g} mu_s", INK, marker="D", ls="", ms=_diamond(ratio, ratios)) for ratio in ratios]
    legend_above(drawing, [*paper.handles(), *legend], columns=5)
    about = paper.on("One number halved or doubled", paper.hard, [rig])
    return paper.draw("sweep", drawing, about=about, rig=rig)


def _diamond(ratio: float, ratios: Sequence[float]) -> float:
    """Size of the mark of a ratio [points]: the larger the ratio, the larger."""
    return 3.0 + 3.5 * ratios.index(ratio) / max(len(ratios) - 1, 1)


def figure_evidence(paper: PaperRun) -> Block | None:
    """Low-torque angles under a step and under a torque that rises, and the odds of every rival."""
    weighed = paper.result.get("evidence")
    if not weighed:
        return None
    rows = weighed["rivals"]
    step = rows[0]
    rise = next(row for row in rows if row["id"] == "torque-rise")
    drawing, ((left, right),) = sheet(1, 2, 3.4, width_ratios=(1.0, 1.25))
    left.axhspan(17.5, 27.5, color=GREY, alpha=0.2, lw=0)
    left.axhline(22.5, color=GREY, lw=0.9, ls=_DASHED)
    place = left.get_yaxis_transform()  # x in shares of the panel
    left.text(0.98, 28.2, "the text: 22.5°, here ± 5°", transform=place, ha="right", va="bottom", fontsize=8)
    times = [0.0 if entry["value"] is None else entry["value"] for entry in (step["best"], *rise["values"])]
    told = [step["best"], *rise["values"]]
    motors = in_order(c["torque"] for c in paper.cases if c["actuator"] == "motor")
    for k, (surface, rig, torque) in enumerate(product(_HARD, paper.rigs, motors)):  # the order of the result
        angles = [entry["low_torque_angles"][k] for entry in told]
        style = {"ls": _SURFACE_LINES[surface], "marker": _RIG_MARKS[paper.rigs.index(rig) % 4], "ms": 3.5, "lw": 1.1}
        left.plot(times, [math.nan if a is None else a for a in angles], color=paper.colour(torque), **style)
    left.set(xlabel="time constant of the torque [s]", ylabel="trajectory angle [degrees]", ylim=(0, 70))
    left.set_title("Motors: angle as the torque rises")
    right.set_title("What would explain the text")
    shown = sorted(rows[1:], key=lambda row: row["nats"])
    for place, row in enumerate(shown):
        colour = BED if row["id"] == "torque-rise" else GREY
        right.barh(place, row["nats"] - step["nats"], color=colour, height=0.62)
    right.axvline(0.0, color=INK, lw=0.8)
    right.set_yticks(range(len(shown)), [row["id"] for row in shown])
    right.set_xlabel("log odds (natural) against a step of the torque")
    right.grid(False, axis="y")
    lines = [handle(paper.label(torque), paper.colour(torque), lw=2.2) for torque in motors]
    lines += [handle(surface, INK, lw=1.1, ls=_SURFACE_LINES[surface]) for surface in _HARD]
    lines += [handle(f"{rig:g} g", INK, ls="", marker=_RIG_MARKS[k % 4], ms=3.5) for k, rig in enumerate(paper.rigs)]
    legend_above(drawing, lines, 6)
    return paper.draw("evidence", drawing, about=paper.on("Low torques", _HARD))


FIGURES = {
    "evidence": figure_evidence, "figure5": figure_5, "figure6": figure_6, "figure7": figure_7, "figure8": figure_8,
    "signs": figure_signs, "sweep": figure_sweep,
}  # fmt: skip
"""Name -> what draws it, in the report's order; None where there is nothing to draw."""
