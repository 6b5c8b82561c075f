"""Draws a list of pictures. `python -m vis.pictures.render <job.json>` does it with OpenGL in a process of its own.

A job is plain JSON, so that a crash or a hang of the driver costs a child process and nothing else. One line is printed
per finished frame.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor

from vis.page.plots import STATES
from vis.pictures.canvas import FORCE, Page, colourmap
from vis.pictures.frames import Frame, read_frames
from vis.pictures.scene import Scene
from vis.pictures.sections import Section

__all__ = ["ARROW", "CUT", "PictureJob", "View", "main", "run_job", "write_gif", "write_pictures"]


class View(TypedDict):
    """Frames of a run from one place, as one picture each or as an animation."""

    name: str
    file: str
    size: Sequence[int]
    frames: list[int]
    by: str
    top: float
    title: str
    lines: list[str]
    """A text for each frame."""
    forces: list[float | None]
    """Of the ground on the body in each frame [N], upwards; None: not known."""
    strongest: float
    """The force whose arrow is longest [N]; 0: there are no arrows."""
    note: str
    low: list[float]
    high: list[float]
    cut: float
    radius: float
    surface: float
    tilt: float


class PictureJob(TypedDict):
    """Pictures of the frames in a run folder."""

    folder: str
    views: list[View]


CUT = """bed and body are cut along the mid-plane of the body; dashed: the undisturbed surface; grains above the \
dashed line lie behind the cut or were raised"""
ARROW = "red: the force on the body"
_LONG = 0.25
"""Length of the longest arrow, over the height of the picture."""
_SLAB = """up to four diameters behind the mid-plane of the body, the farther the darker; dashed: the undisturbed \
surface"""
"""In the small print of a picture with OpenGL, and of one without."""
_GIF_LIMIT = 4_000_000  # bytes
_KEPT = tuple(ImageColor.getrgb(colour)[:3] for colour in ("#ffffff", *STATES.values(), str(FORCE["color"])))
"""Colours that no film may change for one near it, as rare as they are: a legend's would come out alike."""
_ROOM = 256 - len(_KEPT)
"""Left of a film's palette for all others."""


def run_job(job: PictureJob, *, opengl: bool, step: Callable[[], None] = lambda: None) -> None:
    """Draw every picture of a job.

    ``job``: Its views, with lengths in m and sizes in pixels. ``opengl``: With `vis.pictures.scene`, else with
    `vis.pictures.sections`. ``step``: Called after each frame.
    """
    for view in job["views"]:
        write_pictures(Path(view["file"]), _images(Path(job["folder"]), view, opengl), step)


def write_pictures(file: Path, images: Iterable[NDArray[np.uint8]], step: Callable[[], None], **options: Any) -> None:
    """Write a picture as PNG, or several as a GIF with the options of `write_gif`; `step` is called after each."""
    drawn = []
    for image in images:
        drawn.append(image)
        step()
    moving = file.suffix == ".gif"
    file.parent.mkdir(parents=True, exist_ok=True)
    temporary = file.with_name(file.name + ".part")
    if moving:
        write_gif(temporary, drawn, **options)
    else:
        Image.fromarray(drawn[0]).save(temporary, "PNG")
    temporary.replace(file)


def _images(folder: Path, view: View, opengl: bool) -> Iterator[NDArray[np.uint8]]:
    size = (int(view["size"][0]), int(view["size"][1]))
    low, high = np.array(view["low"]), np.array(view["high"])
    page, frames = Page(size, view["by"], view["top"]), read_frames(folder, view["name"])
    section = (low[0], high[0], view["cut"], low[2], view["surface"])
    note = view["note"] if opengl else view["note"].replace(CUT, _SLAB)
    drawer = (Scene if opengl else Section)(size, low, high, cut=view["cut"], radius=view["radius"], tilt=view["tilt"])
    with closing(drawer):
        for index, line, force in zip(view["frames"], view["lines"], view["forces"], strict=True):
            frame = frames[index]
            draw = partial(drawer.draw, frame=frame, colours=page.colours(frame.grains))
            ends = None if not force else _arrow(drawer, frame, view["cut"], _LONG * force / view["strongest"])
            yield page.compose(
                view["title"], line, draw, place=drawer.place, section=section, note=note, arrow=ends,
                newtons=view["strongest"] / _LONG if any(view["forces"]) else 0.0,
            )  # fmt: skip


def _arrow(drawer: Scene | Section, frame: Frame, cut: float, length: float) -> NDArray[np.float64] | None:
    """Foot and head of the arrow of a force on the body's lowest point, places on the picture, shape (2, 2)."""
    if not frame.bodies:
        return None
    points = np.concatenate([points for points, _ in frame.bodies.values()])
    middle = 0.5 * float(points[:, 0].min() + points[:, 0].max())
    foot = drawer.place(np.array([[middle, cut, float(points[:, 2].min())]]))[0]
    return np.array([foot, foot + [0.0, length]])


def write_gif(path: Path, images: list[NDArray[np.uint8]], *, frame_ms: int = 80, limit: int = _GIF_LIMIT) -> None:
    """Write an endless GIF that is not larger than `limit` bytes, by fewer frames where need be.

    One palette and no dithering: what stands still stays the same in every frame, and costs nothing.
    """
    if not images:
        raise ValueError("an animation needs at least one frame")
    while True:
        samples = images[:: max(1, len(images) // 6)][:8]
        together = Image.fromarray(np.concatenate([image[::2, ::2] for image in samples], axis=0))
        palette = _palette(_with_scale(together))
        pages = [_indexed(image, palette) for image in images]
        times = [frame_ms] * len(pages)
        times[-1] = 1500
        pages[0].save(path, "GIF", save_all=True, append_images=pages[1:], duration=times, loop=0, optimize=False)
        if path.stat().st_size <= limit or (len(images) <= 8 and images[0].shape[1] <= 320):
            return
        if len(images) > 24:
            images = [*images[:-1:2], images[-1]]
            frame_ms = round(1.8 * frame_ms)
        else:
            width, height = int(0.8 * images[0].shape[1]), int(0.8 * images[0].shape[0])
            images = [np.asarray(Image.fromarray(i).resize((width, height), Image.Resampling.LANCZOS)) for i in images]


def _palette(image: Image.Image) -> Image.Image:
    """An image with the 256 colours that serve this one best, those of `_KEPT` last, as they are."""
    colours = (image.quantize(colors=_ROOM, method=Image.Quantize.MEDIANCUT).getpalette() or [])[: 3 * _ROOM]
    kept = [part for colour in _KEPT for part in colour]
    palette = Image.new("P", (1, 1))
    palette.putpalette([*colours, *[255] * (3 * _ROOM - len(colours)), *kept])
    return palette


def _indexed(image: NDArray[np.uint8], palette: Image.Image) -> Image.Image:
    page = Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE)
    index = np.asarray(page).copy()
    whole = _in_one(image)
    for place, colour in enumerate(_KEPT, _ROOM):  # Pillow's search is coarse: white would come out as a light grey
        index[whole == _in_one(np.array(colour))] = place
    exact = Image.frombytes("P", page.size, index.tobytes())
    exact.putpalette(palette.getpalette() or [])
    return exact


def _in_one(colours: NDArray[np.integer[Any]]) -> NDArray[np.uint32]:
    """Red, green and blue of the last axis as one number, which compares faster."""
    red, green, blue = np.moveaxis(colours.astype(np.uint32), -1, 0)
    return red << 16 | green << 8 | blue


def _with_scale(image: Image.Image) -> Image.Image:
    """The image with the colour scale, light to shaded, beside it: rare colours count as well in the palette."""
    colours = colourmap()(np.linspace(0.0, 1.0, image.height))[:, :3]
    shades = np.linspace(1.0, 0.45, max(8, image.width // 4))
    strip = np.round(255 * colours[:, None, :] * shades[None, :, None]).astype(np.uint8)
    return Image.fromarray(np.concatenate([np.asarray(image), strip], axis=1))


def main(run: Callable[..., None]) -> int:
    """Carry out the job in the file that the command line names, with OpenGL; exit status 0."""
    (name,) = sys.argv[1:]
    run(json.loads(Path(name).read_text(encoding="utf-8")), opengl=True, step=lambda: print("done", flush=True))
    return 0


if __name__ == "__main__":
    sys.exit(main(run_job))
