"""Plots and report of a diagnosis: reads diagnosis.json, result.json, evidence.csv, latent.csv and series/."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vis.numbers import short
from vis.page import Block, Page, Section, Tile, code, figure, listing, table, text, write_page
from vis.style import BED, GREY, INK, MODEL, styled

__all__ = ["write_diagnosis_report"]

Array = NDArray[np.float64]

_WIDTH = 8.6
_DPI = 130
_MOST_PANELS = 6
_UNITS = {"x": "m", "y": "m", "theta": "rad", "gyro": "rad/s", "ax": "m/s2", "ay": "m/s2", "wheel": "rad/s",
          "depth": "m", "force": "N", "accel": "m/s2"}  # fmt: skip


@dataclass(frozen=True)
class _Channel:
    """One channel of one trial, all arrays of one shape."""

    trial: str
    name: str
    time: Array
    measured: Array
    before: Array
    after: Array
    std: Array
    phase: NDArray[np.str_]

    def residual(self, stage: str) -> Array:
        """(measured - model) / std."""
        return (self.measured - getattr(self, stage)) / self.std


def write_diagnosis_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of a diagnosis, and return the report.

    Raises FileNotFoundError where the folder has no diagnosis.json or result.json.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    said = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    channels = [_read_channel(path) for path in sorted((folder / "series").glob("*.csv"))]
    worst = sorted(channels, key=lambda c: -float(np.mean(c.residual("before") ** 2)))
    held = set(said["gap"]["held_out_trials"])
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    drawn: dict[str, Block] = {}
    plans: list[tuple[str, str, str, Callable[[], Figure | None]]] = [
        ("trajectories", "Measured, before, after", "The channels in which the base model fails most: measured (dots), "
         "the base model with its parameters fitted (dashed), and the model with what was added (line).",
         lambda: _draw_trajectories(_spread(worst), held)),
        ("residuals", "Residuals before and after", "The same channels: measured less model over the sensor's noise, "
         "before (orange) and after (blue); the band is two standard deviations.",
         lambda: _draw_residuals(_spread(worst), held)),
        ("evidence", "What every candidate explains", "Log evidence over the base model, tempered for misfit of form, "
         "best form of each set of effects.", lambda: _draw_evidence(said)),
        ("latent", "What no effect explains", "What the best model lacks, against what it goes with most.",
         lambda: _draw_latent(folder, said)),
    ]  # fmt: skip
    for place, (name, title, caption, draw) in enumerate(plans):
        with styled():
            drawing = draw()
            if drawing is not None:
                drawing.savefig(figures / f"{name}.png", dpi=_DPI)
                drawn[name] = figure(figures / f"{name}.png", title=title, caption=caption)
        tell(0.2 * (place + 1))
    report = write_page(folder / "report.html", _page(said, result, channels, drawn))
    tell(1.0)
    return report


def _read_channel(path: Path) -> _Channel:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    trial, _, name = path.stem.rpartition(".")

    def column(key: str, default: float = 1.0) -> Array:
        return np.array([float(row.get(key) or default) for row in rows])

    phase = np.array([row.get("phase") or "" for row in rows])
    return _Channel(trial, name, column("t_s"), column("measured"), column("before"), column("after"),
                    column("std"), phase)  # fmt: skip


def _spread(worst: Sequence[_Channel]) -> list[_Channel]:
    """The worst channels, no more than half of the panels of one trial's kind while there are others."""
    chosen: list[_Channel] = []
    for channel in worst:
        alike = sum(c.name == channel.name for c in chosen)
        if alike < max(2, _MOST_PANELS // len({c.name for c in worst})) and len(chosen) < _MOST_PANELS:
            chosen.append(channel)
    return chosen


# Figures --------------------------------------------------------------------------------------------------------------


def _grid(count: int, height: float) -> tuple[Figure, list[Axes]]:
    rows = math.ceil(count / 2) if count > 1 else 1
    drawing = Figure(figsize=(_WIDTH, height * rows))
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(rows, 2 if count > 1 else 1, squeeze=False).ravel().tolist()
    for axis in axes[count:]:
        axis.set_visible(False)
    return drawing, axes[:count]


def _draw_trajectories(channels: Sequence[_Channel], held: set[str]) -> Figure | None:
    if not channels:
        return None
    drawing, axes = _grid(len(channels), 2.4)
    for axis, c in zip(axes, channels, strict=True):
        step = max(1, len(c.time) // 160)
        axis.plot(c.time[::step], c.measured[::step], ".", color=INK, ms=2.5, label="measured")
        axis.plot(c.time, c.before, color=MODEL, ls=(0, (4, 2)), lw=1.5, label="before")
        axis.plot(c.time, c.after, color=BED, lw=1.3, label="after")
        axis.set_title(_title(c, held))
        axis.set_xlabel("time [s]")
        axis.set_ylabel(f"{c.name} [{_UNITS.get(c.name, '1')}]")
    axes[0].legend()
    return drawing


def _draw_residuals(channels: Sequence[_Channel], held: set[str]) -> Figure | None:
    if not channels:
        return None
    drawing, axes = _grid(len(channels), 2.2)
    for axis, c in zip(axes, channels, strict=True):
        axis.axhspan(-2, 2, color="#e9eef2", lw=0)
        axis.plot(c.time, c.residual("before"), color=MODEL, lw=0.9, label="before")
        axis.plot(c.time, c.residual("after"), color=BED, lw=0.9, label="after")
        axis.set_title(_title(c, held))
        axis.set_xlabel("time [s]")
        axis.set_ylabel("residual [std]")
    axes[0].legend()
    return drawing


def _title(channel: _Channel, held: set[str]) -> str:
    return f"{channel.trial}, {channel.name}" + (", held out" if channel.trial in held else "")


def _draw_evidence(said: Mapping[str, Any]) -> Figure | None:
    best: dict[str, float] = {}
    for row in said.get("evidence", []):
        name = " + ".join(row["effects"])
        best.setdefault(name, float(row["score"]))
    if not best:
        return None
    singles = [name for name in best if " + " not in name]
    names = sorted({*singles, *list(best)[:6]}, key=lambda name: best[name])
    drawing = Figure(figsize=(_WIDTH, 0.7 + 0.33 * len(names)))
    FigureCanvasAgg(drawing)
    axis = drawing.subplots()
    chosen = " + ".join(effect["id"] for effect in said["effects"])
    colours = [BED if name == chosen else MODEL if name in said["alternatives"] else GREY for name in names]
    axis.barh(range(len(names)), [best[name] for name in names], color=colours, height=0.66)
    axis.set_yticks(range(len(names)), names)
    axis.set_xlabel("log evidence over the base model [nats]")
    return drawing


def _draw_latent(folder: Path, said: Mapping[str, Any]) -> Figure | None:
    if "latent" not in said or not (folder / said["latent"]["file"]).exists():
        return None
    with (folder / said["latent"]["file"]).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = list(rows[0]) if rows else []
    latent = next((name for name in names if name.startswith("latent_")), None)
    if latent is None:
        return None
    shares = said["latent"].get("explained", {})
    against = max(shares, key=lambda name: shares[name]) if shares else "t_s"
    drawing = Figure(figsize=(_WIDTH, 3.0))
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(1, 2)
    columns = ["t_s", against if against != "t_s" else "depth_m"]
    for axis, column in zip(axes, columns, strict=True):
        for trial in dict.fromkeys(row["trial"] for row in rows):
            own = [row for row in rows if row["trial"] == trial and row.get(column)]
            axis.plot([float(row[column]) for row in own], [float(row[latent]) for row in own], ".", ms=1.5)
        axis.set_xlabel(column)
    axes[0].set_ylabel(latent)
    return drawing


# The page -------------------------------------------------------------------------------------------------------------


def _page(
    said: Mapping[str, Any], result: Mapping[str, Any], channels: Sequence[_Channel], drawn: Mapping[str, Block]
) -> Page:
    gap = said["gap"]
    named = ", ".join(effect["id"] for effect in said["effects"]) or "nothing"
    tiles = [
        Tile("Verdict", said["verdict"], named),
        Tile("Gap before", _gap(gap["before"]["held_out"], gap["before"]["fit"]), _which(gap)),
        Tile("Gap after", _gap(gap["after"]["held_out"], gap["after"]["fit"]), _which(gap), second=True),
    ]
    effect_rows = [
        (effect["id"], name, short(entry["value"], 4), short(entry["std"], 2), entry["unit"])
        for effect in said["effects"] for name, entry in effect["parameters"].items()
    ]  # fmt: skip
    base_rows = [
        (name, short(entry["value"], 4), short(entry["std"], 2), short(said["base"]["after"][name]["value"], 4),
         short(said["base"]["after"][name]["std"], 2), entry["unit"])
        for name, entry in said["base"]["before"].items() if name in said["base"]["after"]
    ]  # fmt: skip
    where = [
        (p["trial"], p["channel"], p["phase"], f"{p['from_s']:.4g}", f"{p['to_s']:.4g}", short(p.get("excess", 0.0), 3))
        for p in said["where"]
    ]
    evidence = [
        (row["candidate"], f"{row['score']:.1f}", f"{row['left']:.3g}") for row in said.get("evidence", [])
    ]  # fmt: skip
    phases = _by_phase(channels)
    numbers: list[Block] = []
    if effect_rows:
        numbers.append(table(("effect", "parameter", "value", "std", "unit"), effect_rows, title="What was added"))
    if base_rows:
        head = ("parameter", "before", "std", "after", "std", "unit")
        numbers.append(table(head, base_rows, title="The base model's parameters"))
    sections = [
        Section("", [listing(result["departures"]["sentences"]),
                     *_there(drawn, "trajectories", "residuals", "latent")]),
        Section("Where the base model fails", [
            table(("phase", "channel", "before", "after"), phases,
                  title="Chi-square per sample by phase and channel (the sensors' noise as stated)"),
            *([table(("trial", "channel", "phase", "from [s]", "to [s]", "chi-square beyond noise"), where,
                     title="The worst stretches")] if where else []),
        ]),
        Section("Candidates", [*_there(drawn, "evidence"), *(
            [table(("candidate", "evidence [nats]", "excess a sample"), evidence)] if evidence
            else [text("Nothing was left that a candidate could explain.")]
        )]),
        Section("What these trials can tell apart", _told_apart(said)),
        Section("Numbers", numbers),
        Section("To do this again", [text(f"With hedgebed {result['version']}, in this folder:"),
                                     code("hedgebed diagnose run.toml")]),
    ]  # fmt: skip
    held = ", ".join(gap["held_out_trials"]) or "none"
    return Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "diagnose", f"held out: {held}"],
        tiles=tiles,
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[section for section in sections if section.blocks],
    )


def _told_apart(said: Mapping[str, Any]) -> list[Block]:
    """The first effect against the nearest other names, and what would tell them apart."""
    rows = said.get("equivalence", [])
    if len(rows) < 2:
        return []
    first, *others = rows

    def number(value: float | None, digits: int = 3) -> str:
        return "-" if value is None else short(value, digits)

    cells = [(first["effect"], "", "", "", "", number(first["left_out"]), "")]
    cells += [
        (row["effect"], f"{row['angle_deg']:.0f}", number(row["distance"]), f"{row['evidence_behind']:.1f}",
         "-" if row["left_out_behind"] is None else f"{row['left_out_behind']:.1f}", number(row["left_out"]),
         "yes" if row["told_apart"] else "no")
        for row in others
    ]  # fmt: skip
    head = ("name", "angle [degrees]", "distance [noise]", "evidence behind [nats]", "prediction behind [nats]",
            "chi-square of what was left out", "told apart")  # fmt: skip
    caption = (
        f"Other names in the place of {first['effect']}. The angle is that between what the two change in the data "
        "(0: these trials see them as one); conditions left out in turn are predicted, chi-square a sample"
    )
    return [table(head, cells, title=caption), listing([row["what_would_tell"] for row in others])]


def _there(drawn: Mapping[str, Block], *names: str) -> list[Block]:
    return [drawn[name] for name in names if name in drawn]


def _gap(held_out: float | None, fitted: float) -> str:
    return short(fitted if held_out is None else held_out, 3)


def _which(gap: Mapping[str, Any]) -> str:
    return "chi-square a sample, " + ("fitted trials" if gap["before"]["held_out"] is None else "held-out trials")


def _by_phase(channels: Sequence[_Channel]) -> list[tuple[str, str, str, str]]:
    found: dict[tuple[str, str], list[tuple[Array, Array]]] = {}
    for c in channels:
        for phase in dict.fromkeys(c.phase.tolist()):
            rows = c.phase == phase
            found.setdefault((phase, c.name), []).append((c.residual("before")[rows], c.residual("after")[rows]))
    rows = []
    for (phase, name), pairs in sorted(found.items()):
        before, after = (float(np.mean(np.concatenate([pair[k] for pair in pairs]) ** 2)) for k in (0, 1))
        rows.append((phase, name, short(before, 3), short(after, 3)))
    return rows
