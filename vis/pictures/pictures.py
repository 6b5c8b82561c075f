"""Pictures and an animation of a run folder's frames, off screen.

With OpenGL the bed is cut open along the spike's mid-plane and rendered (`vis.pictures.scene`), in a child process:
a driver that crashes or hangs costs the pictures, never the run. Without OpenGL, or with HEDGEBED_NO_OPENGL=1 in the
environment, cross-sections drawn with matplotlib (`vis.pictures.sections`) stand in, and `Pictures.notes` says so.
"""

from __future__ import annotations

import functools
import json
import os
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vis.page.folder import Run, RunFolder, read_folder
from vis.page.numbers import quote
from vis.page.plots import Array
from vis.page.report import Progress
from vis.pictures.canvas import colour_values, nice_above
from vis.pictures.frames import Frame, Frames, frame_names, grains_box, read_frames
from vis.pictures.render import ARROW, CUT, PictureJob, View, run_job

__all__ = ["Picture", "Pictures", "carry_out", "make_pictures", "opengl_available", "render_apart"]

_PROBE = """
import os
os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import (
    vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow, vtkWindowToImageFilter
)
ball, mapper, actor, renderer, window = (
    vtkSphereSource(), vtkPolyDataMapper(), vtkActor(), vtkRenderer(), vtkRenderWindow()
)
mapper.SetInputConnection(ball.GetOutputPort())
actor.SetMapper(mapper)
actor.GetProperty().SetColor(1, 0, 0)
renderer.SetBackground(1, 1, 1)
renderer.AddActor(actor)
renderer.ResetCamera()
window.SetOffScreenRendering(True)
window.SetSize(64, 64)
window.AddRenderer(renderer)
window.Render()
grabbed = vtkWindowToImageFilter()
grabbed.SetInput(window)
grabbed.ReadFrontBufferOff()
grabbed.Update()
image = grabbed.GetOutput()
assert min(image.GetScalarComponentAsDouble(0, 0, 0, k) for k in range(3)) > 250
assert image.GetScalarComponentAsDouble(32, 32, 0, 2) < 200
"""
"""A red ball on white by VTK alone: PyVista would take most of the time to import."""
_STILLS = 6
_STILL_COSTS = 4.0  # in frames of the animation, as measured in software
_ANIMATED = 48
_WIDE = 22  # letters of a title that reach the shaft of a foot as wide as a quarter of the bed
_TILTS = (0.06, 0.15)
"""Least and greatest slope of the view down on a bed [1]."""


@dataclass(frozen=True)
class Picture:
    """An image file with its caption."""

    file: Path
    title: str
    caption: str


@dataclass(frozen=True)
class Pictures:
    """What was drawn.

    ``stills``: Pictures at chosen moments. ``animation``: The animated GIF, or None. ``method``: "opengl", "sections"
    (drawn with matplotlib) or "none". ``notes``: Sentences on what stands in for what, and why.
    """

    stills: list[Picture] = field(default_factory=list)
    animation: Picture | None = None
    method: str = "none"
    notes: list[str] = field(default_factory=list)


def opengl_available(*, timeout: float = 60.0) -> bool:
    """Whether a small off-screen picture comes out right, tried once in a child process of at most `timeout` seconds.

    HEDGEBED_NO_OPENGL=1 in the environment switches it off without a test.
    """
    return os.environ.get("HEDGEBED_NO_OPENGL", "") in ("", "0") and _probe(timeout)


@functools.cache
def _probe(timeout: float) -> bool:
    try:
        done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=timeout, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def make_pictures(
    folder: str | Path,
    *,
    size: tuple[int, int] = (1600, 1200),
    animation_size: tuple[int, int] = (720, 540),
    animate: bool = True,
    stall: float = 120.0,
    progress: Progress | None = None,
) -> Pictures:
    """Draw the stills (`figures/bed-*.png`) and `animation.gif` of a run folder.

    ``folder``: The run folder. ``size``: Of the stills [pixels]. ``animation_size``: Of the animation [pixels].
    ``animate``: Whether to make the animation. ``stall``: The child process is given up when it finishes no picture for
    this long [s]. ``progress``: Called with the share that is done, 0 to 1. Returns what was drawn. A folder without
    frames gives `method="none"` and a note; nothing that goes wrong with OpenGL is raised. Raises FileNotFoundError:
    there is no such folder.
    """
    run = read_folder(folder)
    notes: list[str] = []
    job, stills, animation = _plan(run, size, animation_size if animate else None, notes)
    if not stills:
        return Pictures(method="none", notes=[*notes, "There are no frames to draw pictures of."])
    costs = [1.0 if view["file"].endswith(".gif") else _STILL_COSTS for view in job["views"] for _ in view["frames"]]
    method, note = carry_out(
        job, run_job, costs, progress, stall=stall, failed="cross-sections stand in for the pictures",
        without="cross-sections stand in for them (Debian: apt install libegl1 libgl1-mesa-dri)",
    )  # fmt: skip
    return Pictures(stills, animation, method, notes + note)


def carry_out(
    job: Mapping[str, Any],
    run: Callable[..., None],
    costs: Sequence[float],
    progress: Progress | None = None,
    *,
    failed: str,
    without: str,
    stall: float = 120.0,
) -> tuple[str, list[str]]:
    """Draw a job by `run` with OpenGL in a child process, or where that does not succeed flat in this one.

    ``costs``: Of each picture, in any unit, for the progress. Returns "opengl" or "sections", and a note on what stands
    in: `failed` where OpenGL did not succeed, `without` where there is none.
    """
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(min(1.0, sum(costs[:done]) / sum(costs)))

    if not opengl_available():
        note = f"This machine has no OpenGL for off-screen pictures; {without}."
    elif (failure := render_apart(job, stall, step, module=run.__module__)) is None:
        return "opengl", []
    else:
        note, done = f"Rendering with OpenGL failed ({failure}); {failed}.", 0
    run(job, opengl=False, step=step)
    return "sections", [note]


def render_apart(
    job: Mapping[str, Any], stall: float, step: Callable[[], None], *, module: str = "vis.pictures.render"
) -> str | None:
    """Carry out a job in a child process, `python -m module`; None when it succeeded, else why it did not."""
    environment = dict(os.environ)
    root = str(Path(__file__).resolve().parents[2])
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, (root, environment.get("PYTHONPATH", ""))))
    with tempfile.TemporaryDirectory() as scratch:
        file, log = Path(scratch) / "job.json", Path(scratch) / "errors.txt"
        file.write_text(json.dumps(job), encoding="utf-8")
        command = [sys.executable, "-m", module, str(file)]
        with (
            log.open("w") as errors,
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, env=environment) as child,
        ):
            assert child.stdout is not None
            pipe, unread = child.stdout.fileno(), b""
            try:
                while ready := select.select([pipe], [], [], stall)[0]:
                    if not (output := os.read(pipe, 65536)):
                        break
                    *lines, unread = (unread + output).split(b"\n")
                    for _ in range(lines.count(b"done")):
                        step()
                if not ready:
                    return f"no picture within {stall:g} s"
                child.wait(timeout=stall)
            except subprocess.TimeoutExpired:
                return f"no picture within {stall:g} s"
            finally:
                child.kill()
        if child.returncode == 0:
            return None
        errors_said = log.read_text(errors="replace").strip().splitlines()
        return f"exit status {child.returncode}" + (f", {errors_said[-1][:200]}" if errors_said else "")


@dataclass(frozen=True, eq=False)
class _Story:
    """The frames of a run with what is needed to choose among them; a depth or force that is not known is NaN."""

    name: str
    run: Run
    frames: Frames
    depth: Array
    force: Array

    @property
    def deepest(self) -> int:
        """The deepest frame before the pull-out; of several as deep, the first: it is still, or was just, moving."""
        before = self._before_the_way_out()
        known = np.where(np.isfinite(self.depth), self.depth, -np.inf)[before]
        top = known.max()
        if not np.isfinite(top):
            return len(self.frames) - 1
        return int(before[np.argmax(known >= top - 0.002 * abs(top))])

    def _before_the_way_out(self) -> NDArray[np.int64]:
        """Indices of the frames before the run's first row of unloading; all where it has none, or no series."""
        every, bed = np.arange(len(self.frames)), self.run.bed
        out = np.flatnonzero(bed.phase == "out") if bed is not None and self.run.kind == "driven" else every[:0]
        if bed is None or not len(out):
            return every
        before = every[np.asarray(self.frames.times) < bed.time[out[0]]]
        return before if len(before) else every

    def held(self, index: int) -> bool:
        """Whether a driven spike was held still at this frame, its force relaxing from that of loading."""
        bed = self.run.bed
        if bed is None or self.run.kind != "driven":
            return False
        row = int(np.searchsorted(bed.time, self.frames.times[index], side="right")) - 1
        return bool(bed.phase[max(row, 0)] == "rest")

    @property
    def rested(self) -> bool:
        """Whether it was set down and came to rest, so that its last frame shows it at rest."""
        sinkage = self.run.quantities.get("sinkage")
        value = sinkage.get("value") if isinstance(sinkage, dict) else sinkage
        return self.run.kind == "set_down" and value is not None

    @property
    def title(self) -> str:
        speed = f" at {self.run.speed or 0.0:.3g} m/s"
        words = {"driven": f"Driven{speed}", "drop": f"Dropped{speed}", "set_down": "Set down"}
        return words.get(self.run.kind, self.name)

    def line(self, index: int) -> str:
        parts = [f"bed {self.run.seed}"] if self.run.seed is not None else []
        parts.append(f"t = {float(self.frames.times[index]):.3f} s")
        if np.isfinite(self.depth[index]):
            parts.append(f"depth {1e3 * self.depth[index]:.1f} mm".replace("-", "\N{MINUS SIGN}"))
        if np.isfinite(self.force[index]):
            parts.append(f"force {quote(float(self.force[index]), unit='N')}")
        return "\n".join(parts)


def _tell(run: RunFolder, name: str) -> _Story | None:
    frames = read_frames(run.path, name)
    if not len(frames):
        return None
    own = [r for r in run.runs if r.id == name] or [r for r in run.runs if r.id.startswith(name + "-")]
    match = own[0] if own else Run(id=name, kind="", seed=None, speed=None, bed=None, model=None)
    depth, force = np.full((2, len(frames)), np.nan)
    if match.bed is not None and len(match.bed):
        depth, force = (np.interp(frames.times, match.bed.time, row) for row in (match.bed.depth, match.bed.force))
    for index, frame in enumerate(frames):
        depth[index] = frame.values.get("depth", depth[index])
        force[index] = frame.values.get("force", force[index])
    return _Story(name, match, frames, depth, force)


def _plan(
    run: RunFolder, size: tuple[int, int], animation_size: tuple[int, int] | None, notes: list[str]
) -> tuple[PictureJob, list[Picture], Picture | None]:
    stories = []
    for name in frame_names(run.path):
        try:
            story = _tell(run, name)
        except (ValueError, OSError) as error:
            notes.append(f"The frames of {name} cannot be read: {error}.")
            continue
        if story is not None:
            stories.append(story)
    job: PictureJob = {"folder": str(run.path), "views": []}
    chosen = _choose(stories)
    if not chosen:
        return job, [], None
    main = chosen[0]
    moved = [_high(story.frames[story.deepest], "displacement") for story in chosen if not story.rested]
    top = nice_above(max(moved, default=0.0))
    figures = run.path / "figures"
    stills: list[Picture] = []

    def still(story: _Story, index: int, by: str, upper: float, moment: str, words: str) -> None:
        if len(stills) >= _STILLS:
            return
        file = figures / f"bed-{story.name}-{moment}.png"
        job["views"].append(_view(run, story, [index], by, upper, file, size))
        caption = f"{story.line(index)}.".replace("\n", ", ").replace("bed ", "Bed ", 1)
        stills.append(Picture(file, f"{story.title}: {words}", caption))

    def deep(story: _Story) -> None:
        if story.rested:  # it moves grains far less than a drive does: its scale is its own
            own = nice_above(_high(story.frames[len(story.frames) - 1], "displacement"))
            still(story, len(story.frames) - 1, "displacement", own, "rest", "at rest")
        else:
            held = ", held still" if story.held(story.deepest) else ""
            still(story, story.deepest, "displacement", top, "deepest", f"at its deepest{held}")

    deep(main)
    half = _half_way(main)
    fast = _high(main.frames[half], "speed")
    if fast > 0.0:
        still(main, half, "speed", nice_above(fast), "speed", "the speed of the grains at half the depth")
    last = len(main.frames) - 1
    if last != main.deepest and main.run.kind == "driven":
        inside = main.depth[last] > 0.0
        still(main, last, "displacement", top, "end", "near the end of the pull-out" if inside else "pulled out")
    for story in chosen[1:]:
        deep(story)
    animation = None
    if animation_size is not None and len(main.frames) > 1:
        frames = np.unique(np.linspace(0, last, min(len(main.frames), _ANIMATED)).round().astype(int)).tolist()
        file = run.path / "animation.gif"
        job["views"].append(_view(run, main, frames, "displacement", top, file, animation_size))
        animation = Picture(file, f"{main.title}: from the first frame to the last", f"{len(frames)} frames.")
    return job, stills, animation


def _above(what: str, surface: str) -> str:
    """The title of a picture; a long name of the surface has its gravity below it, beside the shaft in the middle."""
    return "\n".join(filter(None, (what, surface.replace(", ", ",\n") if len(surface) > _WIDE else surface)))


def _choose(stories: list[_Story]) -> list[_Story]:
    """The slowest and fastest driven run, the fastest drop and one set down; the first is animated."""
    driven = sorted((s for s in stories if s.run.kind == "driven"), key=lambda s: (s.run.speed or 0.0, -len(s.frames)))
    drops = sorted((s for s in stories if s.run.kind == "drop"), key=lambda s: s.run.speed or 0.0)
    rest = [s for s in stories if s.run.kind == "set_down"]
    wanted = [*driven[:1], *driven[-1:], *drops[-1:], *rest[:1]]
    return list(dict.fromkeys(wanted or stories[:4]))


def _half_way(story: _Story) -> int:
    end = story.deepest
    if not np.isfinite(story.depth[end]) or end == 0:
        return end // 2
    return int(np.argmin(np.abs(np.nan_to_num(story.depth[:end]) - 0.5 * story.depth[end])))


def _high(frame: Frame, by: str) -> float:
    """Nearly the largest value of a frame, in the unit of the scale's label; 0 where the frame has no such field."""
    try:
        values = colour_values(frame.grains, by)
    except ValueError:
        return 0.0
    return float(np.percentile(values, 99.5)) if len(values) else 0.0


def _tilt(story: _Story, behind: float) -> float:
    """How far the camera looks down, as a slope [1], on a bed that reaches so far behind the cut [m].

    On the picture the surface behind the cut rises by tilt x `behind`. Above a spike that sinks less than this rise the
    surface would look like the rim of a hole: the less it sinks, the lower the camera.
    """
    deepest = float(np.nanmax(story.depth)) if np.isfinite(story.depth).any() else behind
    return float(np.clip(deepest / behind, *_TILTS)) if behind > 0.0 else _TILTS[1]


def _view(
    run: RunFolder, story: _Story, frames: list[int], by: str, top: float, file: Path, size: tuple[int, int]
) -> View:
    first = story.frames[0]
    position = first.grains["position"]
    low, high = grains_box(first)
    cut = 0.5 * float(low[1] + high[1])
    surface = float(high[2])
    body = next(iter(first.bodies.values()), None)
    given = run.result.get("bed")
    stated = given.get("surface") if isinstance(given, dict) else None
    stated = stated.get("value") if isinstance(stated, dict) else stated
    if body is not None:
        cut = 0.5 * float(body[0][:, 1].min() + body[0][:, 1].max())
    if body is not None and np.isfinite(story.depth[0]):
        surface = float(body[0][:, 2].min()) + float(story.depth[0])
    elif isinstance(stated, int | float):
        surface = float(stated)
    high[2] = max(min(high[2], surface + 0.25 * (surface - low[2])), surface)  # a grain that flies does not count
    strongest = float(np.nanmax(story.force)) if np.isfinite(story.force).any() else 0.0
    forces = [float(force) if force > 0.0 else None for force in story.force[frames]]
    seen = f"{CUT}; {ARROW}" if any(forces) else CUT
    count = f"{len(position):,}".replace(",", "\N{NO-BREAK SPACE}")
    title = _above(story.title, run.surface)
    return {
        "name": story.name, "frames": frames, "by": by, "top": top, "title": title,
        "lines": [story.line(index) for index in frames], "forces": forces,
        "strongest": strongest, "note": f"{count} grains; {seen}", "low": low.tolist(),
        "high": high.tolist(), "cut": cut, "radius": float(first.grains["radius"].mean()), "surface": surface,
        "tilt": _tilt(story, float(high[1]) - cut),
        "file": str(file), "size": list(size),
    }  # fmt: skip
