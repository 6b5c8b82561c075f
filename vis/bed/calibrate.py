"""Plots and report of `hedgebed bed calibrate`: reads result.json and series/ of its folder."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vis.bed.repose import flank_lines
from vis.page.numbers import quote
from vis.page.page import Page, Section, Tile, code, figure, table, text, write_page
from vis.page.style import BED, GREY, INK, MODEL, styled
from vis.penetrate.plot_parts import Plot, legend_above, new_panels
from vis.tumble.report import read_columns

__all__ = ["write_calibration_report"]


def write_calibration_report(folder: str | Path, *, progress: Callable[[float], None] | None = None) -> Path:
    """Make figures/ and report.html of the folder of a calibration, and return the report.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    settings = tomllib.loads((folder / "run.toml").read_text(encoding="utf-8"))["settings"]
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    plots = [_response(folder, result, key) for key in settings["free"]]
    plots += [_residuals(result), *_tests(folder, result), *_slopes(folder, result)]
    drawn = [figure(plot.save(figures), title=plot.title, caption=plot.caption) for plot in plots]
    tell(0.8)
    quantities = result["quantities"]
    tiles = [Tile(_words(key), _said(quantities[key]), quantities[key]["note"]) for key in settings["free"]]
    tiles += [
        Tile(
            _words(entry["name"]), _said(quantities[entry["name"]]), entry["verdict"], second=entry["verdict"] != "met"
        )
        for entry in result["figures"]
    ]
    every = [
        (name, "–" if entry["value"] is None else f"{entry['value']:.5g}")
        + ("–" if entry["std"] is None else f"{entry['std']:.2g}", "" if entry["unit"] == "1" else entry["unit"])
        + (entry["note"],)
        for name, entry in quantities.items()
    ]
    material = (folder / "material.toml").read_text(encoding="utf-8")
    page = Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", "bed calibrate"],
        tiles=tiles,
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section(
                "",
                [table(t["head"], t["rows"], title=t["title"], words=t["words"]) for t in result["tables"]] + drawn,
            ),
            Section(
                "Every number of the result", [table(("quantity", "value", "std", "unit", "note"), every, words=True)]
            ),
            Section("The material", [text("material.toml, for --material:"), code(material)]),
            Section("To do this again", [text("In this folder:"), code("hedgebed bed calibrate run.toml")]),
        ],
    )
    report = write_page(folder / "report.html", page)
    tell(1.0)
    return report


def _words(name: str) -> str:
    return name.replace("_", " ").capitalize()


def _said(entry: Mapping[str, Any]) -> str:
    unit = {"1": "", "degrees": "°"}.get(entry["unit"], f" {entry['unit']}")
    if entry["value"] is None:
        return "–"
    return quote(entry["value"], entry["std"]) + unit


def _axis_words(entry: Mapping[str, Any]) -> str:
    kind = f", {entry['plane']}" if entry["plane"] not in (None, "shear") else ""
    return f"{entry['name'].replace('_', ' ')}{kind} [{entry['unit']}]"


def _response(folder: Path, result: Mapping[str, Any], key: str) -> Plot:
    """Every fitted figure against one parameter."""
    columns, _ = read_columns(folder / result["curves"][key])
    entries = [entry for entry in result["figures"] if entry["fitted"]]
    several = len(result["curves"]) > 1
    best, unit = result["quantities"][key]["value"], result["quantities"][key]["unit"]
    with styled():
        drawing, axes = new_panels(len(entries), height=3.3)
        for axis, entry in zip(axes, entries, strict=True):
            name = entry["name"]
            axis.axhspan(
                entry["wanted"] - entry["tolerance"],
                entry["wanted"] + entry["tolerance"],
                color=MODEL,
                alpha=0.18,
                lw=0,
            )
            x, y, std = columns[key], columns[name], columns[f"{name}.std"]
            axis.fill_between(x, y - 2 * std, y + 2 * std, color=BED, alpha=0.18, lw=0)
            axis.plot(x, y, color=BED)
            at = [point["values"][key] for point in result["points"]]
            found = [point["moved"][key][name] for point in result["points"]]
            error = [point["figures"][name][1] for point in result["points"]]
            axis.errorbar(at, found, yerr=error, color=BED, marker="o", ms=4, ls="")
            axis.errorbar(
                [best], [entry["measured"]], yerr=[entry["error"]], color=INK, marker="D", ms=5, ls="", zorder=5
            )
            axis.axvline(best, color=INK, lw=0.8, ls=(0, (2, 2)))
            axis.set_xlabel(f"{key.replace('_', ' ')} [{unit}]")
            axis.set_ylabel(_axis_words(entry))
        handles = [
            Patch(facecolor=MODEL, alpha=0.3, label="wanted"),
            Line2D([], [], color=BED, label="response, ± 2 std"),
            Line2D([], [], color=BED, marker="o", ls="", label="simulated"),
            Line2D([], [], color=INK, marker="D", ls="", label="check, other seeds"),
        ]
        legend_above(drawing, handles)
    others = " Line and points: at the parameters found, but for this one; points were moved there along the surface."
    caption = "Bars: standard error that a test tells of itself." + (others if several else "")
    return Plot(f"response-{key}", f"Figures against {key.replace('_', ' ')}", caption, drawing)


def _residuals(result: Mapping[str, Any]) -> Plot:
    """What was measured at the end less what was wanted, in tolerances."""
    entries = [entry for entry in result["figures"] if entry["measured"] is not None]
    with styled():
        drawing, (axis,) = new_panels(1, height=0.9 + 0.45 * len(entries))
        axis.axvspan(-1, 1, color=MODEL, alpha=0.18, lw=0)
        axis.axvline(0, color=GREY, lw=0.8)
        for k, entry in enumerate(reversed(entries)):
            off = (entry["measured"] - entry["wanted"]) / entry["tolerance"]
            error = (entry["error"] or 0.0) / entry["tolerance"]
            colour = BED if entry["fitted"] else GREY
            axis.errorbar([off], [k], xerr=[2 * error], color=colour, marker="o" if entry["fitted"] else "s", ls="")
        axis.set_yticks(range(len(entries)), [_axis_words(entry).split(" [")[0] for entry in reversed(entries)])
        axis.set_ylim(-0.6, len(entries) - 0.4)
        axis.set_xlabel("measured less wanted [tolerances]")
        reach = max(1.6, *(abs(x) for x in axis.get_xlim()))
        axis.set_xlim(-reach, reach)
        handles = [
            Patch(facecolor=MODEL, alpha=0.3, label="within the tolerance"),
            Line2D([], [], color=BED, marker="o", ls="", label="fitted"),
            Line2D([], [], color=GREY, marker="s", ls="", label="compared only"),
        ]
        legend_above(drawing, handles)
    return Plot("residuals", "What is left", "Bars: two standard errors of the check.", drawing)


def _checked(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The tests of the check that counts."""
    return [
        test
        for test in result["tests"]
        if test["test"].startswith("check")
        and all(test["values"][key] == result["quantities"][key]["value"] for key in result["curves"])
    ]


def _tests(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    """The stress ratio of the check's tests over strain."""
    tests = [test for test in _checked(result) if test["state"] != "drained"]
    if not tests:
        return []
    states = list(dict.fromkeys(test["state"] for test in tests))
    pressures = sorted({test["pressure"] for test in tests})
    with styled():
        drawing, axes = new_panels(len(states), height=3.0, sharey=True)
        for axis, state in zip(axes, states, strict=True):
            for test in (t for t in tests if t["state"] == state):
                columns, _ = read_columns(folder / test["series"])
                strain, count = columns["strain"], max(1, len(columns["strain"]) // 60)
                kernel = np.ones(count) / count
                ratio = np.convolve(columns["shear_Pa"], kernel, "valid") / np.convolve(
                    columns["normal_Pa"], kernel, "valid"
                )
                colour = (BED, MODEL, INK, GREY)[pressures.index(test["pressure"]) % 4]
                axis.plot(strain[count // 2 : count // 2 + len(ratio)], ratio, color=colour, lw=1.1, alpha=0.85)
            axis.set_title(state)
            axis.set_xlabel("shear strain [1]")
            axis.set_ylim(bottom=0.0)
        axes[0].set_ylabel("shear over normal stress, at the lid [1]")
        handles = [
            Line2D([], [], color=(BED, MODEL, INK, GREY)[k % 4], label=f"{p:g} Pa") for k, p in enumerate(pressures)
        ]
        legend_above(drawing, handles)
    return [Plot("tests", "The check's tests", "A line a seed, smoothed over a sixtieth of the strain.", drawing)]


def _slopes(folder: Path, result: Mapping[str, Any]) -> list[Plot]:
    """What the drained beds of the check left."""
    tests = [test for test in _checked(result) if test["state"] == "drained"]
    if not tests:
        return []
    with styled():
        drawing, axes = new_panels(len(tests), height=2.4, sharey=True)
        for axis, test in zip(axes, tests, strict=True):
            columns, _ = read_columns(folder / test["series"])
            axis.plot(1e3 * columns["x_m"], 1e3 * columns["thickness_m"], color=BED, marker=".", ls="none")
            flank_lines(axis, test, start=0.5 * test["slot"], period=test["size"][0], colour=MODEL)
            axis.set_title(f"seed {test['seed']}: {test['angle']:.1f} ± {test['error']:.1f}°")
            axis.set_xlabel("x [mm]")
            axis.set_ylim(bottom=0.0)
        axes[0].set_ylabel("thickness [mm]")
    return [Plot("slopes", "Slopes of the check's beds", "Heights are not to the scale of x.", drawing)]
