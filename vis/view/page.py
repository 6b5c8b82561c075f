"""Pages and parts of reports that show a run as a scene: one HTML file each, without a network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rigid.result import read_result
from vis.page.folder import from_python, read_folder
from vis.page.numbers import with_squares
from vis.page.page import Block, scene_block, text, write_template
from vis.page.report import Progress
from vis.page.sentences import Sentences
from vis.pictures.canvas import colourmap
from vis.pictures.scene import FLOOR, GROUND, OPACITY
from vis.view.scene import Limits, Packed, make_scene
from vis.view.sources import Source, sources_of

__all__ = ["IN_REPORT", "report_scene", "write_view"]

say = Sentences(__package__)
IN_REPORT = Limits(size=5e6, frames=40, half=True)
"""Of all scenes of a report together: with its pictures it stays far below 15 MB."""
_FRAMES = 240
_RUNS = 3
"""Most runs of a folder in its report."""


def write_view(
    folder: str | Path,
    path: str | Path | None = None,
    *,
    size: float = 100e6,
    frames: int = _FRAMES,
    live: float = 0.0,
    progress: Progress | None = None,
) -> Path:
    """Write a page that shows a run, with its curves, and return it.

    ``folder``: The run folder, of a run that is finished or still going on. ``path``: Of the page; by default view.html
    in the folder. ``size``: Most bytes of all scenes together. ``frames``: Most frames of each. ``live``: The page
    loads itself again after this time [s]; 0: it does not. ``progress``: Called with the share that is done, 0 to 1.
    Raises FileNotFoundError: there is no such folder. ValueError: it has nothing to show, a file cannot be read, or one
    frame alone is larger than `size`.
    """
    home = Path(folder)
    if (home / "result.json").is_file():
        read_result(home / "result.json")  # Raises for a damaged one
    sources = sources_of(home)
    if not sources:
        raise ValueError(_nothing(home))
    scenes = _pack(sources, Limits(size, frames), progress)
    title, lead = _title(home)
    block = scene_block(_head(scenes, title, live), [scene.data for scene in scenes], whole=True)
    target = home / "view.html" if path is None else Path(path)
    return write_template(target, "view.html", title=title, lead=lead, block=block)


def report_scene(folder: str | Path, progress: Progress | None = None) -> list[Block]:
    """The scene of a run for its report, within `IN_REPORT`; a sentence if that is impossible. Empty without frames."""
    home = Path(folder)
    try:
        sources = [source for source in sources_of(home) if len(source.times)]
        chosen = _choose(sources)
        if not chosen:
            return []
        scenes = _pack(chosen, IN_REPORT, progress)
    except (ValueError, OSError) as error:
        return [text(say("failed", reason=str(error).rstrip(".")), small=True)]
    return [scene_block(_head(scenes, _title(home)[0]), [scene.data for scene in scenes])]


def _nothing(home: Path) -> str:
    """Why a folder has nothing to show, and what to open instead: one of the runs in it, frames, or nothing."""
    run = read_folder(home)
    settings = {setting.key: setting.value.strip("\"'") for setting in run.settings}
    homes = [home, home / settings.get("members", "none")]
    inside = sorted(
        {path.parent for place in homes for path in (*place.glob("*/run.toml"), *place.glob("*/*/run.toml"))}
    )
    kind = str(run.result.get("experiment") or "unknown kind")
    if inside:
        return say("of_several", folder=home, kind=kind, count=len(inside), first=inside[0])
    return say("nothing" if "frame_count" in settings else "no_picture", folder=home, kind=kind)


def _pack(sources: Sequence[Source], limits: Limits, progress: Progress | None) -> list[Packed]:
    """The scenes, which share the limit of size evenly; what a scene leaves is for those after it."""
    scenes: list[Packed] = []
    left = limits.size
    for number, source in enumerate(sources):

        def tell(done: float, number: int = number) -> None:
            if progress is not None:
                progress((number + done) / len(sources))

        own = Limits(left / (len(sources) - number), limits.frames, limits.half)
        scenes.append(make_scene(source, own, tell))
        left -= len(scenes[-1].data)
    return scenes


def _choose(sources: Sequence[Source]) -> list[Source]:
    """One of each kind of run: the first driven, dropped, set down; else the first."""
    kinds: dict[str, Source] = {}
    for source in sources:
        kinds.setdefault(source.title.split(" ")[0], source)
    return list(kinds.values())[:_RUNS]


def _title(home: Path) -> tuple[str, list[str]]:
    """Title and lead of a page: the run's own title, then version, command, surface, folder and status."""
    run = read_folder(home)
    result = run.result
    settings = {setting.key: setting.value.strip("\"'") for setting in run.settings}
    title = with_squares(str(result.get("title") or f"Run in {home.resolve().name}"))
    lead = [f"hedgebed {result['version']}"] if "version" in result else []
    of_script = from_python(run)  # there `surface` is a height [m]
    surface = result.get("surface") or settings.get("material") or (None if of_script else settings.get("surface"))
    lead += [str(result.get("experiment") or "no result yet"), *([f"surface: {surface}"] if surface else [])]
    lead += [f"folder: {home.resolve().name}", *([f"status: {run.status}"] if run.status != "done" else [])]
    return title, lead


def _head(scenes: Sequence[Packed], title: str, live: float = 0.0) -> str:
    """What the page's script reads, as JSON that cannot end the script's tag."""
    palette = np.round(255 * colourmap()(np.arange(256))[:, :3]).astype(int).tolist()
    head = {
        "title": title, "live": live, "palette": palette, "ground": GROUND, "opacity": OPACITY, "floor": FLOOR,
        "scenes": [scene.head for scene in scenes],
    }  # fmt: skip
    return json.dumps(head, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
