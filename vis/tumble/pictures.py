"""Pictures of a run folder of a tumble: stills, the film, and the tracks that it leaves in the bed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.colors import TwoSlopeNorm

from vis.film.film import MOST_FRAMES, Stills, draw_reels
from vis.film.reel import Reel
from vis.page.page import Progress, capital
from vis.page.plots import Array, legend_above, sheet
from vis.page.style import INK
from vis.pictures.canvas import COLOURS, nice_above
from vis.pictures.pictures import Picture, Pictures

__all__ = ["draw_tracks", "draw_tumbles", "make_tumble_pictures", "moments"]

_LONGEST_MAP = 40.0  # length over width of a map that is drawn to scale


def make_tumble_pictures(
    folder: str | Path, *, by: str = "displacement", film: bool = True, progress: Progress | None = None
) -> Pictures:
    """Draw figures/tumble-*.png, figures/tracks.png and film.gif of a tumble's run folder.

    ``folder``: The run folder; without frames the ground is drawn as a block. ``by``: What grains are coloured by, a
    key of `vis.pictures.canvas.COLOURS`. ``film``: Whether to make the film. ``progress``: Called with the share that
    is done, 0 to 1. Raises FileNotFoundError: there is no trajectory.csv or result.json. ValueError: an unknown `by`.
    """
    if by not in COLOURS:
        raise ValueError(f"colour is {by!r}; it must be one of {', '.join(COLOURS)}")
    home = Path(folder)
    reel = Reel.open(home)
    stills = [
        (home / "figures" / f"tumble-{name}.png", capital(words), time, reel.line(reel.nearest(time)) + ".")
        for name, words, time in moments([reel])
    ]
    drawn = draw_tumbles([reel], stills, home / "film.gif" if film else None, by=by, progress=progress)
    if reel.frames is not None and "surface" in reel.frame(len(reel) - 1).maps:
        drawn.stills.append(draw_tracks(reel, home / "figures" / "tracks.png"))
    return drawn


def moments(reels: Sequence[Reel]) -> list[tuple[str, str, float]]:
    """Name, words and time [s] of the stills: the start, the middle of the way of the first run's angle, the end.

    Times at which the run with the fewest pictures has one, so that two runs are shown at the same.
    """
    first, coarse = reels[0], min(reels, key=len)
    end = min(float(reel.series["t_s"][-1]) for reel in reels)
    theta, at = first.series["theta_rad"], first.series["t_s"]
    turned = np.abs(theta - theta[0])
    half = float(at[int(np.argmax(turned >= 0.5 * turned.max()))])
    times = [float(coarse.times[coarse.nearest(time)]) for time in (0.0, min(half, end), end)]
    words = (("start", "when the torque begins"), ("half", "half way round"), ("end", "at the end"))
    return [(*named, time) for named, time in zip(words, times, strict=True)]


def _film_times(reels: Sequence[Reel]) -> Array:
    """Evenly over the longest run, no two of them with the same picture of every run on grains [s]."""
    end = max(float(reel.times[-1]) for reel in reels)
    on_grains = [reel for reel in reels if reel.frames is not None]
    count = min(MOST_FRAMES, max(len(reel) for reel in on_grains or reels))
    times = np.linspace(0.0, end, count)
    finest = max(on_grains, key=len) if on_grains else None
    if finest is None:
        return times
    # The finest run's own times, so that a law beside it is drawn when the grains are; a longer law goes on alone.
    own = [float(finest.times[finest.nearest(time)]) if time <= finest.times[-1] else float(time) for time in times]
    return np.unique(own)


def draw_tumbles(
    reels: Sequence[Reel],
    stills: Stills,
    film: Path | None,
    *,
    by: str,
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Pictures:
    """Stills and film of one or two runs, by OpenGL in a child process or flat."""
    times = _film_times(reels).tolist()
    about = f" of {times[-1]:.3g} s"
    return draw_reels(reels, stills, film, times, by=by, about=about, labels=labels, progress=progress)


def draw_tracks(reel: Reel, file: Path) -> Picture:
    """What the platform has left in the bed: the change of its surface at the end, from above, and along the spikes."""
    assert reel.frames is not None
    last = reel.frame(len(reel) - 1)
    grid = last.maps["surface"]
    change = 1e3 * np.asarray(grid.fields["change"], dtype=float)
    x = 1e3 * (grid.origin[0] + grid.spacing[0] * np.arange(change.shape[1]) - reel.origin[0])
    y = 1e3 * (grid.origin[1] + grid.spacing[1] * np.arange(change.shape[0]) - reel.cut)
    # Single grains that roll count less than what a spike's width of them did.
    most = nice_above(float(np.percentile(np.abs(change), 99.5)))
    drawing, ((above,), (along,)) = sheet(2, 1, 4.6, sharex=True, height_ratios=(1.0, 1.3))
    picture = above.pcolormesh(x, y, change, norm=TwoSlopeNorm(0.0, -most, most), cmap="RdBu", rasterized=True)
    if np.ptp(x) <= _LONGEST_MAP * np.ptp(y):
        above.set(aspect="equal", ylabel="across [mm]")
    else:  # in its true shape it would be a thread
        above.set_ylabel("across [mm], stretched")
    above.grid(False)
    bar = drawing.colorbar(picture, ax=[above, along], shrink=0.6, extend="both")
    bar.set_label("change of the surface's height [mm]")
    wide = max(reel.spikes[0], 2.0 * float(grid.spacing[1]))  # of the strip [m]: two columns of the map at least
    strip = np.abs(y) <= 0.5e3 * wide
    ages = mpl.colormaps["viridis_r"]
    for index in np.unique(np.linspace(1, len(reel) - 1, 4).round().astype(int)):
        now = reel.frame(int(index))
        mean = 1e3 * np.asarray(now.maps["surface"].fields["change"], dtype=float)[strip].mean(axis=0)
        colour = ages(0.15 + 0.8 * (index / (len(reel) - 1)))
        along.plot(x, mean, lw=1.2, label=f"{reel.times[index]:.2f} s", color=colour)
    along.axhline(0.0, color=INK, lw=0.8, ls=(0, (5, 4)))
    along.set(xlabel="x from the start of the platform's centre [mm]", ylabel="mean under the spikes [mm]")
    legend_above(drawing, along.lines[:-1], 4)
    file.parent.mkdir(parents=True, exist_ok=True)
    drawing.savefig(file, dpi=130)
    caption = (
        "Above: by how much the top of the grains has risen or fallen since the torque began, from above, at the end. "
        f"Below: the same, mean over {1e3 * wide:.3g} mm across the spikes' way, at four times."
    )
    return Picture(file, "The tracks", caption)
