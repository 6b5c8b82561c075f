"""What the reports of `hedgebed bed test repose`, `cone` and `cut` share: the page, and grains seen from the side."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from numpy.typing import NDArray

from vis.page.numbers import quote
from vis.page.page import Page, Section, Tile, code, figure, table, text, write_page
from vis.page.style import styled
from vis.penetrate.plot_parts import Plot, new_panels
from vis.pictures.frames import read_frames

__all__ = ["said", "side_plot", "write_test_report"]

Grains = Mapping[str, NDArray[Any]]


def write_test_report(
    folder: str | Path,
    *,
    plots: Callable[[Path, Mapping[str, Any]], list[Plot]],
    tiles: Callable[[Mapping[str, Any]], list[Tile]],
    method: Sequence[str],
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Make figures/ and report.html of the folder of a test, and return the report.

    Args:
        plots: draws what result and series of the folder say. tiles: the numbers on top.
        method: how the test is made, a paragraph each.

    Raises FileNotFoundError where the folder has no result.json or a series is missing.
    """
    tell = progress if progress is not None else lambda done: None
    folder = Path(folder)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    drawn = [figure(plot.save(figures), title=plot.title, caption=plot.caption) for plot in plots(folder, result)]
    tell(0.9)
    one, command = result["runs"][0], result["experiment"]
    every = [
        (
            name,
            "–" if entry["value"] is None else f"{entry['value']:.5g}",
            "–" if entry["std"] is None else f"{entry['std']:.2g}",
            "" if entry["unit"] == "1" else entry["unit"],
            entry["note"],
        )
        for name, entry in result["quantities"].items()
    ]
    bed = (
        f"{one['material']}, {one['grain_count']} grains of {1e3 * one['grain']:.3g} mm in "
        f"{' x '.join(f'{1e3 * side:.3g}' for side in one['size'][:2])} mm, {1e3 * one['surface']:.3g} mm deep, "
        f"packing {one['packing_fraction']:.3f}, {one['gravity']:.3g} m/s2; grains of {1e-6 * one['young']:.3g} MPa, "
        f"steps of {1e6 * one['time_step']:.3g} us."
    )
    page = Page(
        title=str(result["title"]),
        lead=[f"hedgebed {result['version']}", command, f"{len(result['runs'])} runs"],
        tiles=tiles(result),
        warnings=[str(warning)[:1].upper() + str(warning)[1:] for warning in result["warnings"]],
        sections=[
            Section("", [table(t["head"], t["rows"], title=t["title"]) for t in result["tables"]] + drawn),
            Section("How it is measured", [*(text(words) for words in method), text(f"First bed: {bed}")]),
            Section(
                "Every number of the result", [table(("quantity", "value", "std", "unit", "note"), every, words=True)]
            ),
            Section("To do this again", [text("In this folder:"), code(f"hedgebed {command} run.toml")]),
        ],
    )
    report = write_page(folder / "report.html", page)
    tell(1.0)
    return report


def said(entry: Mapping[str, Any], scale: float = 1.0, unit: str = "") -> str:
    """A quantity with its spread, as a tile says it."""
    if entry["value"] is None:
        return "–"
    value, std = scale * entry["value"], entry["std"]
    return f"{quote(value, None if std is None else scale * std)}{unit}"


def side_plot(
    folder: Path,
    run: Mapping[str, Any],
    draw: Callable[[Axes], None],
    *,
    title: str,
    caption: str,
    top: float = 5.0,
    shown: Callable[[Grains], Grains] = lambda grains: grains,
) -> list[Plot]:
    """The grains of a run's last frame from the side, coloured by how far each has moved; none where no frame is.

    Args:
        draw: draws over them, in mm. top: end of the colours' scale [mean diameters].
        shown: which grains, and where.
    """
    frames = read_frames(folder, run["frames"])
    if not len(frames):
        return []
    grains, period = shown(frames[len(frames) - 1].grains), float(run["size"][0])
    highest = float((grains["position"][:, 2] + grains["radius"]).max())
    with styled():
        # The grains fill the panel's width, or nearly.
        drawing, (axis,) = new_panels(1, height=min(5.5, 0.7 + 6.9 * highest / period))
        drawn = _draw_grains(axis, grains, period=period, unit=run["grain"], top=top)
        draw(axis)
        drawing.colorbar(drawn, ax=axis, shrink=0.8, extend="max", label="way since it was made [d]")
    return [Plot("side", title, caption, drawing)]


def _draw_grains(axis: Axes, grains: Grains, *, period: float, unit: float, top: float) -> Any:
    """The grains, x against height in mm, those at the back first, within half a period of x = 0, for a colour bar."""
    position, radius = grains["position"], grains["radius"]
    order = np.argsort(-position[:, 1])
    x = np.mod(position[order, 0] + 0.5 * period, period) - 0.5 * period
    size, way = 2e3 * radius[order], np.linalg.norm(grains["displacement"][order], axis=1) / unit
    drawn = EllipseCollection(
        size, size, np.zeros(len(size)), units="xy", offsets=1e3 * np.column_stack([x, position[order, 2]]),
        offset_transform=axis.transData, array=way, cmap="cividis", edgecolors="#00000055", linewidths=0.25,
    )  # fmt: skip
    drawn.set_clim(0.0, top)
    axis.add_collection(drawn)
    axis.set_aspect("equal")
    axis.set_xlim(-5e2 * period, 5e2 * period)
    axis.set_ylim(0.0, 1e3 * float((position[:, 2] + radius).max()) * 1.08)
    axis.set_xlabel("x [mm]")
    axis.set_ylabel("height [mm]")
    axis.grid(False)
    return drawn
