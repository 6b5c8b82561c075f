"""Plots of a run folder: each function takes a `RunFolder` and returns a `Plot`, or None where there is no data.

The bed is blue and solid, the spring-damper orange and dashed, in every plot. Depth is in mm, positive downwards. The
functions are in `vis.penetrate.plot_drag` and `vis.penetrate.plot_drops`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from vis.page.folder import RunFolder
from vis.page.plots import Plot
from vis.penetrate.amended import TITLE, amended_plot, is_amended
from vis.penetrate.plot_drag import drag_plot, gap_plot, work_plot
from vis.penetrate.plot_drops import drop_peaks_plot, drops_plot, set_down_plot, spread_plot

__all__ = ["PLOTS", "make_plots"]


def make_plots(run: RunFolder, folder: str | Path | None = None) -> tuple[list[tuple[Plot, Path]], list[str]]:
    """Draw and write every plot the folder has data for.

    ``run``: The run folder. ``folder``: Where the PNGs go; by default the run's `figures/`. Returns the plots with
    their files, and a sentence on each that could not be drawn.
    """
    target = Path(folder) if folder is not None else run.path / "figures"
    target.mkdir(parents=True, exist_ok=True)
    drawn: list[tuple[Plot, Path]] = []
    missing: list[str] = []
    plans = PLOTS | ({TITLE: amended_plot} if is_amended(run) else {})
    for what, draw in plans.items():
        try:
            plot = draw(run)
        except (ValueError, TypeError, KeyError, IndexError, ZeroDivisionError, FloatingPointError) as error:
            missing.append(f"{what}: could not be drawn ({type(error).__name__}: {error}).")
            continue
        if plot is None:
            missing.append(f"{what}: no data.")
        else:
            drawn.append((plot, plot.save(target)))
    return drawn, missing


#: What is drawn, in the report's order: name in words -> function.
PLOTS: dict[str, Callable[[RunFolder], Plot | None]] = {
    "Drag against depth": drag_plot,
    "Where the spring-damper departs": gap_plot,
    "Set down under its load": set_down_plot,
    "Drops": drops_plot,
    "Peaks of the drops": drop_peaks_plot,
    "Work in and out": work_plot,
    "Spread between beds": spread_plot,
}
