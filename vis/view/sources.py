"""What there is to see of a run: for each of its frame series, or for its trajectory, one `Source`."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vis.film.reel import Reel, SpaceReel
from vis.page.folder import Run, read_folder
from vis.page.plots import Array
from vis.page.report import Result
from vis.page.sentences import Sentences
from vis.pictures.frames import Frame, frame_names, grains_box, read_frames
from vis.view import curves

__all__ = ["Source", "sources_of"]

say = Sentences(__package__)
_LAW_FRAMES = 240
"""Pictures of a platform on a law, which are computed from its trajectory."""
_FLIES = 0.25
"""A grain higher above the surface than this share of the bed's depth does not count for the size of the scene."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """One run to be seen.

    ``id``: Its name in the folder. ``title``: In words. ``times``: Of its frames [s], increasing; empty: curves only.
    ``frame``: Returns a frame by its number; displacements count from the first. ``cut``: y of the plane through the
    body's middle [m]. ``surface``: Height of the undisturbed surface [m], or None. ``low``, ``high``: Corners of the
    bed, or of the block of ground that stands for a law [m]. ``block``: Whether it is such a block. ``force``: Force
    [N] that the length of an arrow is measured by, with its name; None: there are no forces. ``panels``: Curves over
    time. ``states``: Bands of states over time. ``note``: What is not shown and how to get it.
    """

    id: str
    title: str
    times: Array
    frame: Callable[[int], Frame]
    cut: float = 0.0
    surface: float | None = None
    low: Array = field(default_factory=lambda: np.zeros(3))
    high: Array = field(default_factory=lambda: np.zeros(3))
    block: bool = False
    force: tuple[str, float] | None = None
    panels: list[curves.Panel] = field(default_factory=list)
    states: list[curves.Band] = field(default_factory=list)
    note: str = ""


def sources_of(folder: str | Path) -> list[Source]:
    """All that a run folder has to see, runs with frames first.

    A run that is still going on is shown as far as it has come. Raises FileNotFoundError: there is no such folder;
    ValueError: a file of it cannot be read, by name.
    """
    home = Path(folder)
    run = read_folder(home)
    kind = str(run.result.get("experiment", ""))
    if kind.startswith("tumble") and (home / "trajectory.csv").exists():
        return [_in_space(home) if kind == "tumble spatial" else _in_plane(home)]
    if kind == "mujoco" and (home / "series" / "motion.csv").exists():
        return [_of_robot(home)]
    names = frame_names(home)
    shown = [_of_frames(home, name, run.result, run.runs) for name in names]
    rest = [one for one in run.runs if not any(_matches(one, name) for name in names)]
    shown += [_curves_only(one) for one in rest if one.bed is not None or one.model is not None]
    return [source for source in shown if len(source.times) or source.panels]


def _in_plane(home: Path) -> Source:
    reel = _read(lambda: Reel(home, count=_LAW_FRAMES), home)
    called = str(reel.result.get("ground", "law")).replace("bed", "bed of grains")
    grains_missing = reel.frames is None and reel.result.get("ground") == "bed"
    low, high = reel.box
    return Source(
        id=reel.name, title=f"Platform on {_stands_on(reel.result)}",
        times=reel.times, frame=reel.frame, cut=reel.cut, surface=reel.surface,
        low=low, high=high, block=not reel.on_grains, force=("weight", reel.number("weight")),
        panels=curves.of_tumble(home, reel.series, called), states=curves.bands(reel.series["t_s"], reel.states),
        note=say("no_grains") if grains_missing else _hull_words(reel),
    )  # fmt: skip


def _hull_words(reel: Reel) -> str:
    """That the hull is drawn with its corners and simulated without them; "" where none is simulated."""
    return say("hull") if len(reel) and reel.frame(0).values.get("hull_radius") else ""


def _in_space(home: Path) -> Source:
    series = _read(lambda: SpaceReel(home), home)
    states = curves.bands(series.series["t_s"], series.states) if len(series.states) else []
    weight = ("weight", series.number("weight")) if len(series) else None
    title = f"Platform in space on {_stands_on(series.result)}"
    return _on_reel(series, title, weight, curves.of_space(home, series.series), states)


def _of_robot(home: Path) -> Source:
    """A robot of MuJoCo; without gravity its arrows are measured by the largest force."""
    series = _read(lambda: SpaceReel(home), home)
    largest = float(series.result["quantities"]["largest_force"]["value"])
    force = ("weight", series.number("weight"))
    if not force[1]:
        force = ("largest force", largest)
    panels = _read(lambda: curves.of_robot(home), home)
    return _on_reel(series, f"Robot on {_stands_on(series.result)}", force if largest else None, panels, [])


def _stands_on(result: Result) -> str:
    """The ground of a run in words, with its surface."""
    ground, surface = str(result.get("ground", "law")), str(result.get("surface") or "")
    if ground == "bed":
        return f"a bed of {surface or 'grains'}"
    return f"the {ground}" + (f", {surface}" if surface else "")


def _on_reel(
    series: SpaceReel,
    title: str,
    force: tuple[str, float] | None,
    panels: list[curves.Panel],
    states: list[curves.Band],
) -> Source:
    """A run in space that has frames, or its curves alone."""
    if not len(series):
        return Source(
            id=series.name, title=title, times=np.zeros(0), frame=_no_frame, panels=panels, states=states,
            note=say("no_frames"),
        )  # fmt: skip
    low, high = series.box
    return Source(
        id=series.name, title=title, times=series.times, frame=series.frame, low=low, high=high,
        cut=float(low[1]) - (0.01 * float(high[1] - low[1])), surface=float(high[2]) if not series.on_grains else None,
        block=not series.on_grains, force=force, panels=panels, states=states,
    )  # fmt: skip


def _of_frames(home: Path, name: str, result: Result, runs: list[Run]) -> Source:
    """A series of frames: of a spike in a bed, of a bed, of a test of its strength."""
    frames = read_frames(home, name)
    run = next((one for one in runs if _matches(one, name)), None)
    first = frames[0]
    low, high = grains_box(first) if len(first.grains["position"]) else (np.zeros(3), np.zeros(3))
    body = next(iter(first.bodies.values()), None)
    cut, surface = 0.5 * float(low[1] + high[1]), _stated(result, "surface")
    if body is not None:
        cut = 0.5 * float(body[0][:, 1].min() + body[0][:, 1].max())
        if "depth" in first.values:
            surface = float(body[0][:, 2].min()) + first.values["depth"]
    if surface is not None:
        high[2] = max(min(high[2], surface + _FLIES * (surface - low[2])), surface)
    has_series = run is not None and run.bed is not None
    panels = curves.of_penetration(run) if run is not None and has_series else curves.of_frames(frames)
    forces = [size for one in frames for size in _forces(one)] if body is not None else []

    def frame(index: int) -> Frame:
        found = frames[index]
        if body is not None and "force" in found.values:
            points = next(iter(found.bodies.values()))[0]
            tip = points[np.argmin(points[:, 2])]
            found.clouds["row_forces"] = (tip[None], {"force": np.array([[0.0, 0.0, found.values["force"]]])})
        return found

    return Source(
        id=name, title=_called(run, name), times=np.asarray(frames.times), frame=frame, cut=cut, surface=surface,
        low=low, high=high, panels=panels,
        force=("largest force", max(forces)) if any(forces) else None,
    )  # fmt: skip


def _forces(frame: Frame) -> list[float]:
    """Sizes of the forces that arrows show [N]: the one on a spike, or those on rows or feet."""
    if "force" in frame.values:
        return [abs(frame.values["force"])]
    _, fields = frame.clouds.get("row_forces", (None, {}))
    return [float(np.linalg.norm(force)) for force in fields.get("force", ())]


def _curves_only(run: Run) -> Source:
    return Source(
        id=run.id, title=_called(run, run.id), times=np.zeros(0), frame=_no_frame, panels=curves.of_penetration(run),
        note=say("no_frames"),
    )  # fmt: skip


def _no_frame(index: int) -> Frame:
    raise IndexError(f"there is no frame {index}: the run has none")


def _matches(run: Run, name: str) -> bool:
    return run.id == name or run.id.startswith(f"{name}-")


def _called(run: Run | None, name: str) -> str:
    if run is None or not run.kind:
        return name
    speed = f" at {run.speed or 0.0:.3g} m/s"
    words = {"driven": f"Driven{speed}", "drop": f"Dropped{speed}", "set_down": "Set down"}.get(run.kind, name)
    return words if run.seed is None else f"{words}, bed {run.seed}"


def _stated(result: Result, name: str) -> float | None:
    """A number of the bed in the result, or None."""
    given = result.get("bed")
    stated = given.get(name) if isinstance(given, dict) else None
    stated = stated.get("value") if isinstance(stated, dict) else stated
    return float(stated) if isinstance(stated, int | float) else None


def _read(make: Callable[[], Any], home: Path) -> Any:
    """A reel of a run folder. Raises ValueError, with the folder, for files that cannot be read."""
    try:
        return make()
    except (KeyError, IndexError, json.JSONDecodeError) as error:
        raise ValueError(f"the run in {str(home)!r} cannot be shown: {type(error).__name__}: {error}") from error
