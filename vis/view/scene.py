"""A `Source` as data for a page: frames chosen, grains thinned if the page would be too large, numbers rounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from vis.page.numbers import short
from vis.page.plots import Array
from vis.page.report import Progress
from vis.page.sentences import Sentences
from vis.pictures.canvas import COLOURS, colour_top, colour_values
from vis.pictures.frames import Frame
from vis.pictures.scene import METAL, PARTS
from vis.view.curves import Band, Panel
from vis.view.packing import Codes, Entry, pack, packed_size, scale_of, to_codes, to_text
from vis.view.sources import Source

__all__ = ["Limits", "Packed", "make_scene"]

say = Sentences(__package__)
_LAYER = 3
"""Layers of grains that stay behind each surface where those inside are left out."""
_CELL = 1.5
"""Edge of a cell by which the inside is found, over the mean diameter."""
_FEWEST = 12
"""Frames that are kept before grains are left out."""
_STOPS = 200
"""Places of the cursor where there are no frames."""
_RAW = 400e6
"""Bytes of all numbers before compression, which a browser has to hold."""


@dataclass(frozen=True)
class Limits:
    """How large a scene may be.

    ``size``: Bytes on the page. ``frames``: Most frames. ``half``: Leave out the grains in front of the cut from the
    start, and those that no face shows.
    """

    size: float
    frames: int
    half: bool = False


class Loose(TypedDict):
    """What a frame has besides grains and corners of bodies.

    ``centre``: Of the bodies [m]. ``size``: Half the edge of the cube that their corners are rounded in [m].
    ``arrows``: Point [m] and force [N] of each. ``span``: Lowest and highest corner of the bodies [m].
    """

    centre: list[float]
    size: float
    arrows: list[list[float]]
    span: NotRequired[list[list[float]] | None]


class Body(TypedDict):
    """A body and its colour, red, green and blue from 0 to 1."""

    name: str
    colour: list[float]


class Extent(TypedDict):
    """What the first view contains, as `_extent` has it."""

    far: list[list[float]]
    near: list[list[float]]
    walks: bool


class Head(TypedDict, total=False):
    """What a page knows of a scene beside its arrays; the names are those of `Source`, or of the functions here."""

    id: str
    title: str
    times: list[float]
    frames: list[Loose]
    cut: float
    surface: float | None
    low: list[float]
    high: list[float]
    block: bool
    colours: list[Any]
    force: Any
    panels: list[Panel]
    states: list[Band]
    notes: list[str]
    arrays: list[Entry]
    grains: Any
    bodies: list[Body]
    far: list[list[float]]
    near: list[list[float]]
    walks: bool


@dataclass(frozen=True)
class Packed:
    """A scene as a page holds it: `head` becomes JSON; `data` is base64."""

    head: Head
    data: str


@dataclass(frozen=True)
class _Grains:
    """All grains over the chosen frames, by number of the grain.

    ``position``: Codes, shape (frames, n, 3). ``values``: Name of a colour -> codes from 0 to 255, shape (frames, n).
    """

    position: NDArray[np.uint16]
    radius: Array
    values: dict[str, NDArray[np.uint8]]
    tops: dict[str, float]
    low: Array
    step: float

    def of(self, frames: Any, kept: Any) -> _Grains:
        """Some frames, and some grains."""
        values = {name: codes[frames][:, kept] for name, codes in self.values.items()}
        return _Grains(self.position[frames][:, kept], self.radius[kept], values, self.tops, self.low, self.step)

    def codes(self) -> list[Codes]:
        """As they are packed."""
        if not len(self.radius):
            return []
        thick = np.rint(self.radius / self.radius.max() * 255).astype(np.uint8)
        return [
            Codes("position", self.position),
            Codes("radius", thick[None, :, None]),
            *(Codes(f"colour {name}", codes[..., None]) for name, codes in self.values.items()),
        ]


def make_scene(source: Source, limits: Limits, progress: Progress | None = None) -> Packed:
    """The scene of a source within its limits.

    First frames are left out, down to `_FEWEST`; then grains that no face shows; then further frames, down to one.
    Raises ValueError: even one frame is too large, or the frames do not have the same grains.
    """
    count = len(source.times)
    chosen = _evenly(count, limits.frames)
    if not count:
        return Packed(_head(source, chosen, [], {}), "")
    first = source.frame(0)
    grain_count = len(first.grains["position"])
    while len(chosen) > _FEWEST and len(chosen) * grain_count * 10 > _RAW:
        chosen = _evenly(count, len(chosen) // 2)
    frames: list[Loose] = []
    tops = _tops(source, first)
    grains, bodies = _read(source, chosen, tops, frames, progress)
    kept, shell = np.ones(grain_count, dtype=bool), False
    every = np.arange(len(chosen))
    if limits.half and grain_count:
        kept, shell = _near_faces(grains, source), True
    while True:
        here = grains.of(every, kept)
        arrays = [*here.codes(), *(Codes(body.name, body.values[every]) for body in bodies), *_triangles(first)]
        blob = pack(arrays)
        if packed_size(blob) <= limits.size:
            break
        if grain_count and not shell and len(every) <= _FEWEST:
            kept, shell = _near_faces(grains, source), True
        elif len(every) > 1:
            every = _evenly(len(every), max(1, len(every) // 2)) if len(every) > 2 else every[:1]
        else:
            sizes = {"size": f"{packed_size(blob) / 1e6:.0f}", "limit": f"{limits.size / 1e6:.0f}"}
            raise ValueError(say("too_large", title=source.title, **sizes))
    head = _head(source, chosen[every], [frames[k] for k in every], tops)
    head["arrays"] = [array.entry() for array in arrays]
    head["grains"] = {
        "count": int(kept.sum()), "low": here.low.tolist(), "step": here.step, "shell": shell,
        "radius": float(here.radius.max()) if len(here.radius) else 0.0,
    }  # fmt: skip
    head["bodies"] = _bodies_head(first)
    head |= _extent(source, [frames[k] for k in every])
    head["notes"] = [*filter(None, [source.note]), *_notes(source, kept, len(every), here, shell, limits)]
    return Packed(head, to_text(blob))


def _head(source: Source, chosen: NDArray[np.int64], frames: list[Loose], tops: dict[str, float]) -> Head:
    """What is known of a scene without its arrays."""
    colours = [{"name": name, "label": COLOURS[name][0], "top": float(top)} for name, top in tops.items()]
    times = source.times[chosen] if len(chosen) else _along(source)
    return {
        "id": source.id, "title": source.title, "times": [float(f"{t:.7g}") for t in times],
        "frames": frames, "cut": source.cut, "surface": source.surface, "low": source.low.tolist(),
        "high": source.high.tolist(), "block": source.block, "colours": colours,
        "force": None if source.force is None else {"name": source.force[0], "newton": source.force[1]},
        "panels": source.panels, "states": source.states, "notes": [*filter(None, [source.note])],
    }  # fmt: skip


def _along(source: Source) -> Array:
    """Times at which the cursor on the curves can stand where there are no frames [s]."""
    ends = [time for panel in source.panels for line in panel["lines"] for time in (line["t"][0], line["t"][-1])]
    return np.linspace(min(ends), max(ends), _STOPS)


def _read(
    source: Source,
    chosen: NDArray[np.int64],
    tops: dict[str, float],
    frames: list[Loose],
    progress: Progress | None,
) -> tuple[_Grains, list[Codes]]:
    """The grains and bodies of the chosen frames; what else a frame has is appended to `frames`."""
    first = source.frame(0)
    order = _order(first)
    ids = first.grains["id"][order] if "id" in first.grains else None
    low, high = _corners(source, first)
    step = scale_of(low, high)
    size = _body_size(first)
    positions: list[NDArray[np.uint16]] = []
    values: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in tops}
    corners: dict[str, list[NDArray[np.uint16]]] = {name: [] for name in first.bodies}
    for done, index in enumerate(chosen):
        frame = source.frame(int(index))
        place = _order(frame)
        if len(place) != len(order) or (ids is not None and not np.array_equal(frame.grains["id"][place], ids)):
            raise ValueError(f"frame {index} of {source.id} has other grains than the first one")
        positions.append(to_codes(frame.grains["position"][place], low, step))
        for name, top in tops.items():
            share = colour_values(frame.grains, name)[place] / top
            values[name].append(np.rint(255 * np.clip(share, 0.0, 1.0)).astype(np.uint8))
        centre = _centre(frame)
        for name, (points, _) in frame.bodies.items():
            corners[name].append(to_codes(points, centre - size, 2 * size / 65535))
        frames.append(_loose(frame, centre, size))
        if progress is not None:
            progress((done + 1) / len(chosen))
    radius = np.asarray(first.grains.get("radius", np.zeros(0)), dtype=float)[order]
    grains = _Grains(
        np.array(positions), radius, {name: np.array(codes) for name, codes in values.items()}, tops, low, step
    )
    return grains, [Codes(f"body {name}", np.array(codes)) for name, codes in corners.items()]


def _order(frame: Frame) -> NDArray[np.int64]:
    """Places of the grains by their number."""
    ids = frame.grains.get("id")
    return np.arange(len(frame.grains["position"])) if ids is None else np.argsort(ids, kind="stable")


def _corners(source: Source, first: Frame) -> tuple[Array, Array]:
    """Corners of the space in which positions are rounded: the bed, and space above it for flying grains."""
    position = first.grains["position"]
    if not len(position):
        return source.low, source.high
    low, high = np.minimum(position.min(axis=0), source.low), np.maximum(position.max(axis=0), source.high)
    room = 0.02 * float(np.max(high - low))
    return low - room, high + [room, room, max(room, float(high[2] - low[2]))]


def _tops(source: Source, first: Frame) -> dict[str, float]:
    """The colours that the frames allow, each with the upper end of its scale in the unit of its label."""
    names = [name for name in COLOURS if ("velocity" if name == "speed" else name) in first.grains]
    if not len(first.grains["position"]) or not names:
        return {}
    count = len(source.times)
    sample = [source.frame(index).grains for index in sorted({count // 3, 2 * count // 3, count - 1})]
    return {name: colour_top(sample, name) for name in names}


def _near_faces(grains: _Grains, source: Source) -> NDArray[np.bool_]:
    """Which grains lie behind the cut and within `_LAYER` layers of a face, in any frame.

    A face is where cells without grains begin. So the hole around a body counts, and the pit behind it.
    """
    mean = 2.0 * float(grains.radius.mean())
    cell, seen = _CELL * mean, np.zeros(len(grains.radius), dtype=bool)
    for codes in grains.position:
        at = grains.low + grains.step * codes
        behind = at[:, 1] >= source.cut
        if not behind.any():
            behind[:] = True
        cells = np.floor((at - at[behind].min(axis=0)) / cell).astype(int)
        filled = np.zeros(cells[behind].max(axis=0) + 1, dtype=bool)
        filled[tuple(cells[behind].T)] = True
        inside = binary_erosion(filled, np.ones((3, 3, 3)), iterations=max(1, round(_LAYER / _CELL)))
        seen[behind] |= ~inside[tuple(cells[behind].T)]
    return seen


def _centre(frame: Frame) -> Array:
    points = [points for points, _ in frame.bodies.values()]
    return np.concatenate(points).mean(axis=0) if points else np.zeros(3)


def _body_size(frame: Frame) -> float:
    """Half the edge of a cube about the bodies' centre that contains them however they turn [m]."""
    centre = _centre(frame)
    far = [float(np.linalg.norm(points - centre, axis=1).max()) for points, _ in frame.bodies.values()]
    return 1.05 * max(far, default=1e-6)


def _loose(frame: Frame, centre: Array, size: float) -> Loose:
    """What a frame has besides grains and the corners of its bodies: where the bodies are, and forces."""
    points, fields = frame.clouds.get("row_forces", (np.zeros((0, 3)), {}))
    force = np.asarray(fields.get("force", np.zeros((0, 3))), dtype=float).reshape(-1, 3)
    pairs = np.column_stack([np.asarray(points, dtype=float).reshape(-1, 3), force])
    arrows = [[float(f"{number:.5g}") for number in pair] for pair in pairs if np.any(pair[3:])]
    span = None
    if frame.bodies:
        corners = np.concatenate([points for points, _ in frame.bodies.values()])
        span = [corners.min(axis=0).tolist(), corners.max(axis=0).tolist()]
    return {"centre": [float(f"{c:.8g}") for c in centre], "size": size, "arrows": arrows, "span": span}


def _extent(source: Source, frames: list[Loose]) -> Extent:
    """Corners of what is seen: `far` of everything in all frames, `near` of the bodies in the first; `walks`.

    `walks` says that a body moves further than twice its size, so that the camera follows it.
    """
    spans = [frame.pop("span") for frame in frames]
    far = [] if source.block and spans[0] else [[source.low.tolist(), source.high.tolist()]]
    far += [span for span in spans if span]
    corners = np.array(far)
    whole = [corners[:, 0].min(axis=0).tolist(), corners[:, 1].max(axis=0).tolist()]
    way = np.array([frame["centre"] for frame in frames])
    walks = bool(spans[0]) and float(np.linalg.norm(way - way[0], axis=1).max()) > 2.0 * frames[0]["size"]
    return {"far": whole, "near": spans[0] or whole, "walks": walks}


def _triangles(first: Frame) -> list[Codes]:
    return [
        Codes(f"triangles {name}", np.asarray(faces, dtype=np.uint32)[None])
        for name, (_, faces) in first.bodies.items()
    ]


def _bodies_head(first: Frame) -> list[Body]:
    return [{"name": name, "colour": list(PARTS.get(name, METAL))} for name in first.bodies]


def _evenly(count: int, most: int) -> NDArray[np.int64]:
    """Numbers of at most so many of `count` frames, evenly, the first and the last among them."""
    return np.unique(np.linspace(0, max(0, count - 1), min(count, most)).round().astype(np.int64))


def _notes(
    source: Source, kept: NDArray[np.bool_], frames: int, grains: _Grains, shell: bool, limits: Limits
) -> Sequence[str]:
    notes = []
    if len(kept):
        numbers = {"shown": _spaced(int(kept.sum())), "count": _spaced(len(kept))}
        layer = short(1e3 * 2 * _LAYER * float(grains.radius.mean()), 2)
        notes.append(say("left_out", layer=layer, **numbers) if shell else say("grains", count=numbers["count"]) + ".")
    if frames < len(source.times):
        notes.append(say("frames_left_out", shown=frames, count=len(source.times)))
    if len(kept):
        notes.append(say("rounded", step=short(1e6 * grains.step, 2)))
    if limits.half and (shell or frames < len(source.times)):
        notes.append(say("small"))
    return notes


def _spaced(count: int) -> str:
    return f"{count:,}".replace(",", "\N{NO-BREAK SPACE}")
