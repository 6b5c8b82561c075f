"""Figures of a diagnosis: measured against both models, what is left by phase, candidates, the latent force."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import NDArray

from rigid.series import read_series
from vis.diagnose.held_out import worsens_held_out
from vis.page.plots import AMENDED, DASHED, GREY, INK, MODEL, PHASES, STATES, Array, handle, legend_above, sheet
from vis.page.report import Result
from vis.page.sentences import Sentences
from vis.page.states import state_runs

__all__ = [
    "Channel", "draw_evidence", "draw_latent", "draw_phases", "draw_trajectories", "read_channel", "source_of",
    "trials_of", "worst",
]  # fmt: skip

labels = Sentences(__package__, "labels.toml")
_MOST_ROWS = 6
_MOST_BARS = 14
#: channel -> (what it is, unit)
_QUANTITIES: dict[str, tuple[str, str]] = {
    "x": ("x", "mm"),
    "y": ("y", "mm"),
    "theta": ("θ", "degrees"),
    "gyro": ("gyro", "rad/s"),
    "ax": ("specific force, body x", "m/s²"),
    "ay": ("specific force, body y", "m/s²"),
    "wheel": ("wheel", "rad/s"),
    "depth": ("depth", "mm"),
    "force": ("force", "N"),
    "accel": ("acceleration", "m/s²"),
}
_REPLICATES = "#e6d08f"  # by what replicates differ: darker than the page and than the band of the sensor
BASE = "#7B3FF2"
"""The base model: not the colour of the spring-damper in other figures, which is that of the state "slip" here."""
_PHASES = STATES | PHASES
"""Of a tumble the colours that its states have everywhere, of a push those of its phases."""
_FACTORS = {"mm": 1e3, "degrees": 180 / math.pi}
"""What a number in SI is multiplied by to be in a unit."""
_NARROW = 3.0
"""Range of chi-square up to which its axis is linear."""
_BINS = 20
_OUT, _HELD = 0.05, 0.5
"""Largest shares of the rows in withdrawal and at rest for which a push counts as loading only."""
_APART = 0.005
"""Share of the range within which bins lie at one place."""


@dataclass(frozen=True)
class Channel:
    """One channel of one trial, all arrays of one shape."""

    trial: str
    name: str
    time: Array
    measured: Array
    before: Array
    after: Array
    std: Array
    """Of the noise as the gap takes it, beside the base model and beside the best one."""
    std_after: Array
    phase: NDArray[np.str_]
    scatter: Array | None = None
    """What replicates differ by beyond the sensors, beside the best model; None where they differ by no more."""
    depth: Array | None = None
    """Of a push at these readings [m]; None of other channels."""

    def model(self, stage: str) -> Array:
        """The prediction of the model "before" or "after"."""
        return self.before if stage == "before" else self.after

    @property
    def goes_in(self) -> bool:
        """Whether it is a push that only goes in and is not held for long: its depth orders its rows as time does."""
        if self.depth is None:
            return False
        return bool(np.mean(self.phase == "out") <= _OUT and np.mean(self.phase == "rest") <= _HELD)

    def residual(self, stage: str) -> Array:
        """(measured - model) / std."""
        return (self.measured - self.model(stage)) / (self.std if stage == "before" else self.std_after)


def read_channel(path: Path) -> Channel:
    """The series <trial>.<channel>.csv."""
    columns = read_series(path, text=("phase",))
    trial, _, name = path.stem.rpartition(".")
    none = np.ones(len(next(iter(columns.values()))))

    def numbers(key: str) -> Array:
        return columns.get(key, none).astype(float)

    return Channel(trial, name, numbers("t_s"), numbers("measured"), numbers("before"), numbers("after"),
                   numbers("std"), numbers("std_after" if "std_after" in columns else "std"),
                   columns.get("phase", np.full(len(none), "")), columns.get("scatter"),
                   columns.get("depth_m"))  # fmt: skip


def source_of(folder: Path) -> str:
    """How the trials of a diagnosis came about: "simulated on grains", "simulated", "as recorded (CMU)" or "as given".

    hedgebed signs the campaigns that it makes: `made_by` in the notes of campaign.toml, which model.toml repeats. A
    campaign without its signature is as recorded, if its notes say by whom (`recorded_by`), else as given: measured or
    not. Without model.toml the word is "recorded".
    """
    path = folder / "model.toml"
    if not path.exists():
        return "recorded"
    notes = tomllib.loads(path.read_text(encoding="utf-8")).get("notes", {})
    made_by = str(notes.get("made_by", ""))
    if not made_by.startswith("hedgebed "):
        return f"as recorded ({notes['recorded_by']})" if "recorded_by" in notes else "as given"
    return "simulated on grains" if " penetrate, grains" in made_by or " on a bed of " in made_by else "simulated"


def trials_of(folder: Path) -> str:
    """What the trials of a diagnosis are, as titles have it: the campaign's name, surface, gravities, their source.

    Empty without model.toml.
    """
    path = folder / "model.toml"
    if not path.exists():
        return ""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    name = f'"{tables["name"]}"' if "name" in tables else "a campaign"
    surface = str(tables.get("surface", {}).get("kind", ""))
    words = name if not surface or surface in name else f"{name}, on {surface}"
    local = tables.get("rig", {}).get("gravity")
    found = {trial.get("gravity_sim", trial.get("gravity", local)) for trial in tables.get("trial", ())} - {None}
    if found:
        ends = dict.fromkeys(f"{gravity:.3g}" for gravity in (min(found), max(found)))
        words += f", {' to '.join(ends)} m/s\N{SUPERSCRIPT TWO}"
    return f"Trials of {words}: {source_of(folder)}"


def worst(channels: Sequence[Channel], held: set[str]) -> list[Channel]:
    """At most six channels in which the base model fails most, two of them held out where some are.

    Of the fitted ones, and of those held out, no channel is shown more than its share while there are others. Each part
    is in the order of `channels`.
    """
    order = sorted(channels, key=lambda c: -float(np.mean(c.residual("before") ** 2)))
    kinds = len({c.name for c in channels})
    each = max(2, math.ceil(_MOST_ROWS / max(1, kinds)))
    kept = min(2, sum(c.trial in held for c in channels))
    places = {id(channel): place for place, channel in enumerate(channels)}
    chosen: list[Channel] = []
    for part, most in ((False, _MOST_ROWS - kept), (True, _MOST_ROWS)):
        here: list[Channel] = []
        for channel in order:
            alike = sum(c.name == channel.name for c in here)
            if (channel.trial in held) is part and alike < each and len(chosen) + len(here) < most:
                here.append(channel)
        chosen += sorted(here, key=lambda c: places[id(c)])
    return chosen


# Measured, before, after ----------------------------------------------------------------------------------------------


def draw_trajectories(
    channels: Sequence[Channel], held: set[str], labels: tuple[str, str], source: str
) -> Figure | None:
    """A row a channel: recorded and both models on the left, residuals over the noise on the right.

    `labels`: what the models before and after are called; an empty one is not drawn. `source`: what the dots are
    called, see `source_of`.
    """
    if not channels:
        return None
    drawing, axes = sheet(len(channels), 2, 0.8 + 1.72 * len(channels))
    models = [("before", BASE, DASHED, labels[0]), ("after", AMENDED, "-", labels[1])]
    models = [entry for entry in models if entry[3]]
    for (left, right), c in zip(axes, channels, strict=True):
        what, unit = _QUANTITIES.get(c.name, (c.name, "SI"))
        factor = _FACTORS.get(unit, 1.0)
        quick = np.ptp(c.time) < 0.5
        time, over_time = c.time * (1e3 if quick else 1.0), "time [ms]" if quick else "time [s]"
        # The force of a push is a curve over its depth; what is left of one that comes back or holds, over the time.
        depth = None if c.depth is None else 1e3 * c.depth
        place = time if depth is None else depth
        if depth is not None and c.goes_in:
            time, over_time = depth, "depth [mm]"
        step = max(1, len(time) // 80)
        if c.scatter is not None:
            wide = 2 * np.hypot(1.0, c.scatter / c.std_after)
            right.fill_between(time, -wide, wide, color=_REPLICATES, lw=0, zorder=0)
        right.axhspan(-2, 2, color="#e3e8ec", lw=0)
        for stage, colour, dash, _ in models:
            left.plot(place, factor * c.model(stage), color=colour, ls=dash, lw=1.4, zorder=3)
            right.plot(time, c.residual(stage), color=colour, lw=0.8, ls="-")
        left.plot(place[::step], factor * c.measured[::step], ".", color=INK, ms=2.6, zorder=4)
        if len(models) > 1:  # the base model leaves so much that the other line would lie on 0
            right.set_ylim(*_range_of(c))
        for axis in (left, right):
            low, high = axis.get_ylim()
            axis.set_ylim(low, high + 0.07 * (high - low))  # the band along the top hides nothing
            if axis is right or place is time:
                _strip(axis, time, c.phase)
            over_place = "depth [mm]" if depth is not None else over_time
            axis.set_xlabel(over_place if axis is left else over_time, labelpad=1)
        left.set_title(f"trial {c.trial}, {what}" + (" (held out)" if c.trial in held else ""))
        left.set_ylabel(f"{what.split(',')[0]} [{unit}]", fontsize=8.5)
        right.set_ylabel("left over [std]", fontsize=8.5)
    handles: list[Any] = [handle(source, INK, ls="", marker=".")]
    handles += [handle(label, colour, ls=dash) for _, colour, dash, label in models]
    handles.append(Patch(color="#e3e8ec", label="2 std of the sensor"))
    if any(c.scatter is not None for c in channels):
        handles.append(Patch(color=_REPLICATES, label="2 std of sensor and replicates"))
    handles += _phase_handles(phase for c in channels for phase in c.phase)
    legend_above(drawing, handles, 4, fontsize=8)
    return drawing


def _range_of(channel: Channel) -> tuple[float, float]:
    """What the better model leaves of a channel, over the noise, with the band of the sensor and of replicates."""
    wide = 2.0 if channel.scatter is None else float(np.nanmax(2 * np.hypot(1.0, channel.scatter / channel.std_after)))
    rest = channel.residual("after")
    known = rest[np.isfinite(rest)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    low, high = min(low, -wide), max(high, wide)
    return low - 0.15 * (high - low), high + 0.15 * (high - low)


def _strip(axis: Axes, time: Array, phase: NDArray[np.str_]) -> None:
    """The states of the motion as a band along the panel's top."""
    spans: dict[str, list[tuple[float, float]]] = {}
    for low, high, name in state_runs(phase):
        end = time[min(high, len(time) - 1)]
        spans.setdefault(name, []).append((float(time[low]), float(end - time[low])))
    for name, pieces in spans.items():
        if name in _PHASES:
            axis.broken_barh(pieces, (0.96, 0.04), transform=axis.get_xaxis_transform(), color=_PHASES[name], lw=0)


def _phase_handles(phases: Iterable[Any]) -> list[Patch]:
    there = {str(phase) for phase in phases}
    return [Patch(color=colour, label=name) for name, colour in _PHASES.items() if name in there]


# What is left, by phase and channel -----------------------------------------------------------------------------------


def draw_phases(rows: Sequence[Result], labels: tuple[str, str]) -> Figure | None:
    """Chi-square per sample before and after, by channel and phase, fitted trials and held-out ones side by side."""
    if not rows:
        return None
    keys = list(dict.fromkeys((row["channel"], row["phase"]) for row in rows))
    keys.sort(key=lambda key: (list(_QUANTITIES).index(key[0]) if key[0] in _QUANTITIES else 99,
                               list(_PHASES).index(key[1]) if key[1] in _PHASES else 99))  # fmt: skip
    parts = [
        (held, name)
        for held, name in ((False, "fitted trials"), (True, "held-out trials"))
        if any(row["held_out"] is held for row in rows)
    ]
    drawing, (axes,) = sheet(1, len(parts), 1.15 + 0.24 * len(keys), sharey=True, sharex=True)
    for axis, (held, title) in zip(axes, parts, strict=True):
        axis.axvline(1.0, color=INK, lw=1.0, ls=(0, (1, 1.5)))
        for row in rows:
            if row["held_out"] is not held:
                continue
            place = keys.index((row["channel"], row["phase"]))
            before, after = (max(float(row[stage]), 1e-3) for stage in ("before", "after"))
            if labels[1]:
                axis.plot([before, after], [place, place], color=GREY, lw=1.2, zorder=2)
                axis.plot(after, place, "o", color=AMENDED, ms=5.5, zorder=4)
            axis.plot(before, place, "D", color=BASE, ms=4.8, zorder=3)
        shown = [float(row[stage]) for row in rows for stage in ("before", "after")]
        if max(shown) < _NARROW:
            axis.set_xlim(0.0, 1.1 * max(*shown, 1.5))
        else:
            axis.set_xscale("log")
            axis.xaxis.set_major_formatter(_plain_numbers)
        axis.set(title=title, xlabel="chi-square per sample (1: the sensors' noise)")
    axes[0].set_yticks(range(len(keys)), [f"{channel}, {phase}" for channel, phase in keys])
    axes[0].set_ylim(len(keys) - 0.4, -0.6)
    handles = [handle(labels[0], BASE, ls="", marker="D", ms=4.8)]
    if labels[1]:
        handles.append(handle(labels[1], AMENDED, ls="", marker="o", ms=5.5))
    legend_above(drawing, handles, 2, fontsize=8)
    return drawing


# Candidates -----------------------------------------------------------------------------------------------------------


def draw_evidence(diagnosis: Result) -> Figure | None:
    """Bars of evidence, and what each candidate leaves: the best form of each single name, and the best sets of names
    that beat all of their parts."""
    best: dict[tuple[str, ...], Result] = {}
    orders: dict[frozenset[str], tuple[str, ...]] = {}  # one set of names, in whatever order they were added
    for row in (*diagnosis.get("candidates", []), *diagnosis.get("evidence", [])):
        best.setdefault(orders.setdefault(frozenset(row["effects"]), tuple(row["effects"])), row)
    if not best:
        return None
    score = {names: float(row["score"]) for names, row in best.items()}
    leading = _leading_names(diagnosis, score)
    leading = orders.get(frozenset(leading), leading)
    singles = [names for names in best if len(names) == 1]
    sets = [
        names
        for names in best
        if len(names) > 1 and all(score[names] > score.get((name,), -math.inf) + 0.05 for name in names)
    ]
    names = sorted({*singles, *sets[:5], *([leading] if leading in best else [])}, key=lambda n: (score[n], -len(n)))
    names = names[-_MOST_BARS:]
    drawing, ((axis, beside),) = sheet(1, 2, 1.3 + 0.27 * len(names), sharey=True, width_ratios=(3, 2))
    kinds = {name: _kind(name, leading, diagnosis) for name in names}
    colours = {name: _KINDS[kinds[name]] for name in names}
    places = range(len(names))
    axis.barh(places, [score[name] for name in names], color=[colours[n] for n in names], height=0.66)
    most = max(*(score[name] for name in names), 1.0)
    for place, name in enumerate(names):
        axis.annotate(f"{score[name]:z.1f}" if abs(score[name]) < 10 else f"{score[name]:.0f}",
                      (max(score[name], 0.0), place), xytext=(3, 0), textcoords="offset points", va="center",
                      fontsize=7.5, color=INK)  # fmt: skip
    least = min(score[name] for name in names)  # one that is far off does not press the others together
    axis.set_xlim(max(1.1 * least, -0.3 * most) if least < 0 else 0.0, 1.12 * most)
    axis.axvline(0.0, color=INK, lw=0.9)
    axis.set_yticks(places, [" + ".join(name) for name in names])
    axis.grid(False, axis="y")
    axis.set_xlabel("log evidence over the base model [nats]\n(left of 0: not worth its parameters)")
    _draw_left(beside, [best[name] for name in names], [colours[name] for name in names], diagnosis)
    shown = [kind for kind in _KINDS if kind in kinds.values()]
    handles: list[Any] = [Patch(color=_KINDS[kind], label=kind) for kind in shown]
    handles.append(handle("the noise alone", INK, ls=(0, (1, 1.5))))
    handles.append(handle("the base model", BASE, ls=DASHED))
    legend_above(drawing, handles, 5, fontsize=8)
    return drawing


_WORSE = "fits best, but predicts held-out trials worse than the base model"
_KINDS = {"named": AMENDED, "with confidence": AMENDED, "most likely, without confidence": "#80cfb9", _WORSE: "#d9b87f",
          "cannot be distinguished from it": MODEL, "other": "#b5b5b5"}  # fmt: skip
"""What a candidate is -> its colour."""


def _draw_left(axis: Axes, rows: Sequence[Result], colours: Sequence[str], diagnosis: Result) -> None:
    """Chi-square a sample that each candidate leaves, between that of the base model and that of the noise."""
    base = diagnosis.get("evidence_base", {})
    left = [max(1 + float(row["left"]), 1e-2) for row in rows]
    axis.axvline(1.0, color=INK, lw=1.0, ls=(0, (1, 1.5)))
    whole = 1 + float(base["left"]) if base else max(left)
    axis.axvline(whole, color=BASE, lw=1.0, ls=DASHED)
    most = max(whole, *left)
    for place, (row, value, colour) in enumerate(zip(rows, left, colours, strict=True)):
        axis.plot([whole, value], [place, place], color=GREY, lw=1.0, zorder=2)
        axis.plot(value, place, "o", color=colour, ms=5.5, zorder=3)
        closes = row.get("closes")
        if closes is not None:
            share = f"{100 * min(max(closes, 0.0), 1.0):.0f} %"
            axis.annotate(share, (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=7.5,
                          color=INK, annotation_clip=False)  # fmt: skip
    if most < _NARROW:
        low = min(1.0, *left)
        axis.set_xlim(low - 0.1 * max(most - low, 0.1), most + 0.1 * max(most - low, 0.1))
    else:
        axis.set(xscale="log", xlim=(min(0.9, 0.9 * min(left)), 1.15 * most))
        axis.xaxis.set_major_formatter(_plain_numbers)
        if most < 20:
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_minor_locator(NullLocator())
    noise = "noise and replicates" if base.get("with_scatter") else "noise"
    axis.set_xlabel(f"chi-square per sample left\n(1: {noise}; %: gap closed)")
    axis.grid(False, axis="y")


def _plain_numbers(value: float, place: float) -> str:
    return f"{value:g}" if 1e-3 <= value < 1e5 else f"{value:.0e}"


def _leading_names(diagnosis: Result, score: Mapping[tuple[str, ...], float]) -> tuple[str, ...]:
    """The leading set of names: the verdict's; where that is unknown the best model's, or the likeliest single name."""
    if diagnosis["verdict"] != "unknown":
        return tuple(effect["id"] for effect in diagnosis["effects"])
    names = tuple(diagnosis.get("leading", {}).get("effects", ()))
    same = next((known for known in score if sorted(known) == sorted(names)), names)
    singles = [known for known in score if len(known) == 1 and score[known] > 0]
    return same or max(singles, key=lambda known: score[known], default=())


def _kind(name: tuple[str, ...], leading: tuple[str, ...], diagnosis: Result) -> str:
    if diagnosis["verdict"] == "unknown":
        certain = {effect["id"] for effect in diagnosis["effects"]}
        if worsens_held_out(diagnosis):
            return _WORSE if name == leading else "other"
        if certain and set(name) == certain:
            return "with confidence"
        return "most likely, without confidence" if name == leading else "other"
    if name == leading:
        return "named"
    swapped = [(other, *leading[1:]) for other in diagnosis["alternatives"]]
    return "cannot be distinguished from it" if set(name) in [set(s) for s in swapped] else "other"


# What no effect explains ----------------------------------------------------------------------------------------------


def draw_latent(folder: Path, diagnosis: Result, channels: Sequence[Channel]) -> Figure | None:
    """Every latent column over time and over the column that explains most of it, by phase, with means of equal counts.

    None where there is no latent force.
    """
    if "latent" not in diagnosis or not (folder / diagnosis["latent"]["file"]).exists():
        return None
    columns = read_series(folder / diagnosis["latent"]["file"], text=("trial",))
    latents = [name for name in columns if name.startswith("latent_")]
    if not latents or not len(columns["trial"]):
        return None
    trials = columns.pop("trial")
    values = {
        name: column if column.dtype.kind == "f" else np.array([float(cell or "nan") for cell in column])
        for name, column in columns.items()
    }
    shares = {name: share for name, share in diagnosis["latent"].get("explained", {}).items() if name in values}
    others = [name for name in sorted(shares, key=lambda n: -shares[n]) if name != "t_s" and shares[name] > 0]
    other = others[0] if others else next(name for name in columns if name not in (*latents, "t_s"))
    phase = _phase_at(trials, values["t_s"], channels)
    drawing, axes = sheet(len(latents), 2, 0.6 + 2.3 * len(latents), sharey="row")
    for pair, latent in zip(axes, latents, strict=True):
        for axis, column in zip(pair, ("t_s", other), strict=True):
            label, factor = _label(column)
            across = factor * values[column]
            for name in dict.fromkeys(phase.tolist()):
                own = phase == name
                axis.plot(across[own], values[latent][own], ".", ms=2.2, color=_PHASES.get(name, GREY), alpha=0.8)
            axis.axhline(0.0, color=GREY, lw=0.8)
            axis.plot(*_means(across, values[latent]), "-", color=INK, lw=1.3, marker="o", ms=3)
            share = diagnosis["latent"].get("explained", {}).get(column)
            several = "up to " if len(latents) > 1 else ""  # it is the largest of all that is missing
            axis.set_xlabel(label + (f"; explains {several}{100 * share:.0f} %" if share is not None else ""))
        pair[0].set_ylabel(_label(latent)[0])
        _frame(pair[1], values[latent])
    handles = [*_phase_handles(phase), handle("means of equal counts", INK, marker="o", ms=3)]
    legend_above(drawing, handles, 5, fontsize=8)
    return drawing


def _label(column: str) -> tuple[str, float]:
    """Label of the axis of a column of latent.csv, and the factor of its numbers; its own name where it has none."""
    label = labels.templates.get(column, column)
    return label, _FACTORS.get(label.partition("[")[2].rstrip("]"), 1.0)


def _frame(axis: Axes, values: Array) -> None:
    """A range of y that a few touches do not stretch, and how many rows lie beyond it."""
    known = values[np.isfinite(values)]
    if not len(known):
        return
    low, high = np.percentile(known, (0.5, 99.5))
    room = 0.5 * (high - low)
    if room <= 0 or (known.min() > low - room and known.max() < high + room):
        return
    axis.set_ylim(low - room, high + room)
    beyond = int(((known < low - room) | (known > high + room)).sum())
    axis.text(0.99, 0.97, f"{beyond} rows beyond", transform=axis.transAxes, ha="right", va="top", fontsize=7.5,
              color="#555555")  # fmt: skip


def _phase_at(trials: NDArray[np.str_], time: Array, channels: Sequence[Channel]) -> NDArray[np.str_]:
    """The phase at each row of the latent force: that of the same trial's sample next in time."""
    phase = np.full(len(trials), "", dtype="<U8")
    for trial in dict.fromkeys(trials.tolist()):
        source = next((c for c in channels if c.trial == trial and len(c.time)), None)
        if source is not None:
            own = trials == trial
            middle = 0.5 * (source.time[1:] + source.time[:-1])
            phase[own] = source.phase[np.searchsorted(middle, time[own])]
    return phase


def _means(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of y over x in bins of equal count; what is constant within a bin counts once."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if len(np.unique(x)) <= _BINS:
        places = np.unique(x)
        return places, np.array([y[x == place].mean() for place in places])
    order = np.argsort(x, kind="stable")
    pieces = [piece for piece in np.array_split(order, _BINS) if len(piece)]
    counts = np.array([len(piece) for piece in pieces], dtype=float)
    places, means = (np.array([column[piece].mean() for piece in pieces]) for column in (x, y))
    group = np.cumsum(np.concatenate([[0], np.diff(places) > _APART * np.ptp(x)]).astype(int))  # one place is one mean
    whole = np.bincount(group, counts)
    return np.bincount(group, places * counts) / whole, np.bincount(group, means * counts) / whole
