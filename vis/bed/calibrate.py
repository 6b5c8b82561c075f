"""Plots and report of `hedgebed bed calibrate`: reads result.json and series/ of its folder."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from rigid.intervals import NORMAL, half_of
from vis.bed.tests import cut_profiles, flank_lines, quoted, thicknesses
from vis.page.answer import MOST_ROWS
from vis.page.page import Block, Section, Tile, code, text
from vis.page.plots import BED, GREY, INK, MODEL, Array, handle, legend_above, new_panels, smooth_ratio
from vis.page.report import Report, Result, again, report_of, tables

__all__ = ["answer_tiles", "write_calibration_report"]

_COLOURS = (BED, MODEL, INK, GREY)


@report_of(named=True)
def write_calibration_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a calibration, and return the report."""
    result = report.result
    drawn = [
        *(_response(report, key) for key in result["curves"]),
        _residuals(report),
        *_tests(report),
        *_slopes(report),
        *_faces(report),
    ]
    material = (report.folder / "material.toml").read_text(encoding="utf-8")
    sections = [
        Section("", tables(result) + drawn),
        report.numbers(std=True),
        Section("The material", [text("material.toml, for --material:"), code(material)]),
        again("hedgebed bed calibrate run.toml"),
    ]
    return report.write(sections, lead=["bed calibrate"], tiles=answer_tiles(result))


def answer_tiles(result: Result) -> list[Tile]:
    """The fitted parameters, then the figures that they meet, six rows at most."""
    quantities, figures = result["quantities"], {one["name"]: one for one in result["figures"]}
    tiles = []
    for name in sorted(quantities, key=lambda name: name in figures):
        entry = quantities[name]
        unit = {"1": "", "degrees": "°"}.get(entry["unit"], f" {entry['unit']}")
        note = figures[name]["verdict"] if name in figures else entry["note"]
        tiles.append(
            Tile(name.replace("_", " ").capitalize(), quoted({**entry, "std": half_of(entry)}, 1.0, unit), note)
        )
    return tiles[:MOST_ROWS]


def _simulated(entry: Result) -> float | None:
    """The figure in the beds of the check; folders of an older hedgebed have it as `measured`."""
    return entry["simulated"] if "simulated" in entry else entry["measured"]


def _axis_words(entry: Result) -> str:
    kind = f", {entry['plane']}" if entry["plane"] not in (None, "shear") else ""
    return f"{entry['name'].replace('_', ' ')}{kind} [{entry['unit']}]"


def _response(report: Report, key: str) -> Block:
    """Every fitted figure against one parameter."""
    result, columns = report.result, report.columns(report.result["curves"][key])
    entries = [entry for entry in result["figures"] if entry["fitted"]]
    best, unit = result["quantities"][key]["value"], result["quantities"][key]["unit"]
    drawing, axes = new_panels(len(entries), height=3.3)
    for axis, entry in zip(axes, entries, strict=True):
        name = entry["name"]
        low, high = entry["wanted"] - entry["tolerance"], entry["wanted"] + entry["tolerance"]
        axis.axhspan(low, high, color=MODEL, alpha=0.18, lw=0)
        x, y, std = columns[key], columns[name], columns[f"{name}.std"]
        axis.fill_between(x, y - 2 * std, y + 2 * std, color=BED, alpha=0.18, lw=0)
        axis.plot(x, y, color=BED)
        at = [point["values"][key] for point in result["points"]]
        found = [point["moved"][key][name] for point in result["points"]]
        error = [point["figures"][name][1] for point in result["points"]]
        axis.errorbar(at, found, yerr=error, color=BED, marker="o", ms=4, ls="")
        end, off = _simulated(entry), entry["error"]
        axis.errorbar(
            [best], [math.nan if end is None else end], yerr=[off], color=INK, marker="D", ms=5, ls="", zorder=5
        )
        axis.axvline(best, color=INK, lw=0.8, ls=(0, (2, 2)))
        axis.set(xlabel=f"{key.replace('_', ' ')} [{unit}]", ylabel=_axis_words(entry))
    handles = [
        Patch(facecolor=MODEL, alpha=0.3, label="wanted"),
        handle("response, ± 2 std", BED),
        handle("simulated", BED, marker="o", ls=""),
        handle("check, other seeds", INK, marker="D", ls=""),
    ]
    legend_above(drawing, handles)
    others = " Line and points: at the parameters found, but for this one; points were moved there along the surface."
    words = {"parameter": key.replace("_", " "), "others": others if len(result["curves"]) > 1 else ""}
    return report.draw("response", drawing, name=f"response-{key}", **words)


def _residuals(report: Report) -> Block:
    """What was simulated at the end less what was wanted, in tolerances."""
    entries = [entry for entry in report.result["figures"] if _simulated(entry) is not None]
    drawing, (axis,) = new_panels(1, height=0.9 + 0.45 * len(entries))
    axis.axvspan(-1, 1, color=MODEL, alpha=0.18, lw=0)
    axis.axvline(0, color=GREY, lw=0.8)
    for k, entry in enumerate(reversed(entries)):
        off = (_simulated(entry) - entry["wanted"]) / entry["tolerance"]
        error = (entry["error"] or 0.0) / entry["tolerance"]
        colour = BED if entry["fitted"] else GREY
        axis.errorbar([off], [k], xerr=[2 * error], color=colour, marker="o" if entry["fitted"] else "s", ls="")
    axis.set_yticks(range(len(entries)), [_axis_words(entry).split(" [")[0] for entry in reversed(entries)])
    axis.set(ylim=(-0.6, len(entries) - 0.4), xlabel="simulated less wanted [tolerances]")
    reach = max(1.6, *(abs(x) for x in axis.get_xlim()))
    axis.set_xlim(-reach, reach)
    handles = [
        Patch(facecolor=MODEL, alpha=0.3, label="within the tolerance"),
        handle("fitted", BED, marker="o", ls=""),
        handle("compared only", GREY, marker="s", ls=""),
    ]
    legend_above(drawing, handles)
    return report.draw("residuals", drawing)


def _checked(result: Result) -> list[Result]:
    """The tests of the check that counts."""
    best = {key: result["quantities"][key]["value"] for key in result["curves"]}
    checks = (test for test in result["tests"] if test["test"].startswith("check"))
    return [test for test in checks if all(test["values"][key] == value for key, value in best.items())]


def _tests(report: Report) -> list[Block]:
    """The stress ratio of the check's tests over strain."""
    tests = [test for test in _checked(report.result) if test["pressure"]]
    if not tests:
        return []
    states = list(dict.fromkeys(test["state"] for test in tests))
    pressures = sorted({test["pressure"] for test in tests})
    drawing, axes = new_panels(len(states), height=3.0, sharey=True)
    for axis, state in zip(axes, states, strict=True):
        for test in (t for t in tests if t["state"] == state):
            columns = report.columns(test["series"])
            colour = _COLOURS[pressures.index(test["pressure"]) % 4]
            axis.plot(*smooth_ratio(columns["strain"], columns), color=colour, lw=1.1, alpha=0.85)
        axis.set(title=state, xlabel="shear strain [1]", ylim=(0.0, None))
    axes[0].set_ylabel("shear over normal stress, at the lid [1]")
    handles = [handle(f"{p:g} Pa", _COLOURS[k % 4]) for k, p in enumerate(pressures)]
    legend_above(drawing, handles)
    return [report.draw("tests", drawing)]


def _slopes(report: Report) -> list[Block]:
    """What the drained beds of the check left."""

    def draw(axis: Axes, test: Result, x: Array, thickness: Array, standing: Array | None) -> str:
        axis.plot(x, thickness, color=BED, marker=".", ls="none")
        flank_lines(axis, test, start=0.5 * test["slot"], period=test["size"][0], colour=MODEL)
        return f"seed {test['seed']}: {test['angle']:.1f} ± {NORMAL * test['error']:.1f}°"

    return thicknesses(report, [test for test in _checked(report.result) if test["state"] == "drained"], draw, "slopes")


def _faces(report: Report) -> list[Block]:
    """The faces that were cut in the check's beds."""

    def title(test: Result) -> str:
        return f"seed {test['seed']}: {1e3 * test['stood']:.3g} to {1e3 * test['fell']:.3g} mm"

    return cut_profiles(report, [test for test in _checked(report.result) if test["state"] == "cut"], title, "faces")
