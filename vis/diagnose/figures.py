"""Figures of a diagnosis: measured against both models, what is left by phase, candidates, the latent force."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from rigid.series import read_series
from vis.page.plots import AMENDED, DASHED, GREY, INK, PHASES, STATES, Array, handle, legend_above, sheet
from vis.page.report import Result
from vis.page.sentences import Sentences
from vis.page.states import state_runs

__all__ = [
    "BASE", "Channel", "NARROW", "draw_latent", "draw_phases", "draw_trajectories", "plain_numbers", "read_channel",
    "source_of", "trials_of", "worst",
]  # fmt: skip

labels = Sentences(__package__, "labels.toml")
_MOST_ROWS = 6
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
_REPLICATES = "#c9def2"
"""By what replicates differ: no colour of a phase, and lighter than the band of the sensor, which lies on it."""
_SENSOR = "#a3b1be"
_MOST_DOTS = 300
"""Dots of one recording: so many that a step of the force while the drive stops is seen."""
_SPIKE = 3
"""Rows of the base model's line in a panel from which on it is drawn: fewer are the end of a spike from outside it."""
BASE = "#7B3FF2"
"""The base model: not the colour of the spring-damper in other figures, which is that of the state "slip" here."""
_PHASES = STATES | PHASES
"""Of a tumble the colours that its states have everywhere, of a push those of its phases."""
TRIALS = "trials"
"""What dots are called where nothing says how the trials came about."""
_FACTORS = {"mm": 1e3, "degrees": 180 / math.pi}
"""What a number in SI is multiplied by to be in a unit."""
NARROW = 3.0
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
    """How the trials of a diagnosis came about: "simulated on grains", "simulated", "as recorded (CMU)" or "trials".

    hedgebed signs the campaigns that it makes: `made_by` in the notes of campaign.toml, which model.toml repeats. A
    campaign without its signature is as recorded, if its notes say by whom (`recorded_by`), else "trials", measured or
    not. Without model.toml the word is "recorded".
    """
    path = folder / "model.toml"
    if not path.exists():
        return "recorded"
    notes = tomllib.loads(path.read_text(encoding="utf-8")).get("notes", {})
    made_by = str(notes.get("made_by", ""))
    if not made_by.startswith("hedgebed "):
        return f"as recorded ({notes['recorded_by']})" if "recorded_by" in notes else TRIALS
    return "simulated on grains" if " penetrate, grains" in made_by or " on a bed of " in made_by else "simulated"


def trials_of(folder: Path) -> str:
    """What the trials of a diagnosis are, as titles have it: the campaign's name, surface, gravities; their source
    where it is known.

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
    source = source_of(folder)
    return f"Trials of {words}" + ("" if source == TRIALS else f": {source}")


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
        step = max(1, len(time) // _MOST_DOTS)
        if c.scatter is not None:
            wide = 2 * np.hypot(1.0, c.scatter / c.std_after)
            right.fill_between(time, -wide, wide, color=_REPLICATES, lw=0, zorder=0)
        right.axhspan(-2, 2, color=_SENSOR, lw=0, zorder=0.5)
        for stage, colour, dash, _ in models:
            left.plot(place, factor * c.model(stage), color=colour, ls=dash, lw=1.4, zorder=3)
            rest = c.residual(stage)
            if stage == "before" and len(models) > 1:  # it leaves so much that the other line would lie on 0
                rest = _within(rest, *_range_of(c))
            right.plot(time, rest, color=colour, lw=0.8, ls="-")
        left.plot(place[::step], factor * c.measured[::step], ".", color=INK, ms=2.0, zorder=4)
        if len(models) > 1:
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
    handles.append(Patch(color=_SENSOR, label="2 std of the sensor"))
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


def _within(values: Array, low: float, high: float) -> Array:
    """`values` in a panel from `low` to `high`, NaN outside it and in the tips of spikes that come from outside."""
    shown = np.where((values >= low) & (values <= high), values, np.nan)
    for begin, end, inside in state_runs(np.where(np.isfinite(shown), "inside", "")):
        if inside and end - begin < _SPIKE:
            shown[begin:end] = np.nan
    return shown


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
        if max(shown) < NARROW:
            axis.set_xlim(0.0, 1.1 * max(*shown, 1.5))
        else:
            axis.set_xscale("log")
            axis.xaxis.set_major_formatter(plain_numbers)
        axis.set(title=title, xlabel="chi-square per sample (1: the sensors' noise)")
    axes[0].set_yticks(range(len(keys)), [f"{channel}, {phase}" for channel, phase in keys])
    axes[0].set_ylim(len(keys) - 0.4, -0.6)
    handles = [handle(labels[0], BASE, ls="", marker="D", ms=4.8)]
    if labels[1]:
        handles.append(handle(labels[1], AMENDED, ls="", marker="o", ms=5.5))
    legend_above(drawing, handles, 2, fontsize=8)
    return drawing


def plain_numbers(value: float, place: float) -> str:
    """A number on a logarithmic axis."""
    return f"{value:g}" if 1e-3 <= value < 1e5 else f"{value:.0e}"


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
