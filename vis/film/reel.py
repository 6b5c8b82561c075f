"""A run as a sequence of frames to be pictured: of a bed of grains from its frames, of a law from its trajectory.

`Reel` is one in the plane, `SpaceReel` one in space.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rigid.result import read_result
from vis.page.folder import read_columns
from vis.page.numbers import quote
from vis.page.plots import Array
from vis.page.report import Result
from vis.pictures.canvas import HEIGHT, colour_top, moved_since, nice_above
from vis.pictures.frames import Frame, Frames, frames_of, grains_box, read_frames
from vis.pictures.meshes import in_place, spike_mesh

__all__ = ["AnyReel", "Foot", "Reel", "SpaceReel"]

_SPIKE, _CLEAR, _WIDE = 0.012, 0.04, 0.06
"""Of the platform on a law, which sees points only: diameter and length of a spike, width of the hull as they are
drawn, all of spikes that end 0.2 m from the centre [m]."""
_TOUCHES = 0.05
"""Distance from the surface below which a foot is at it [mm]."""
_BLOCK, _THIN = 0.08, 0.06
"""Depth of the ground that is drawn where there are no grains [m], in the plane and in space."""


_LEVEL = 0.01
"""Points of a foot that are so little over its lowest one, over the reach of the body, are its underside."""


@dataclass(frozen=True)
class Foot:
    """The foot or spike with the largest force of all pictures.

    ``cut``: y of its middle then [m]. ``wide``: Its extent along x then [m]. ``x``, ``low``: Middle of what is lowest
    there at every picture, and its height [m], shape (n,).
    """

    cut: float
    wide: float
    x: Array
    low: Array


@dataclass(frozen=True)
class _Seen:
    """What one reading of all frames of a run in space shows; the lists have an entry for each picture."""

    centres: Array
    ends: Array
    feet: list[Array]
    pushed: list[Array]
    forces: list[Array]


class _Filmed:
    """What runs in the plane and in space share.

    ``folder``: The run folder. ``result``: Its result.json. ``series``: The columns of trajectory.csv. ``states``: Its
    states, a word a row; none in a folder of an older hedgebed. ``times``: When there is a picture [s], increasing.
    ``frames``: Its frames; None: the ground is a law that has none. ``name``: Of its frames.
    """

    still: ClassVar[tuple[int, int]]
    """Size of its still pictures [pixels]."""
    film: ClassVar[tuple[int, int]]
    bar: ClassVar[tuple[float, float, float, float]]
    """Place of the colour bar on a sheet."""
    least: ClassVar[float]
    """End of the colour scale where there are no grains."""
    failed: ClassVar[str]
    without: ClassVar[str]
    """Texts where OpenGL failed, and where there is none."""

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.result: Result = read_result(self.folder / "result.json")
        self.series, self.states = read_columns(self.folder / "trajectory.csv")
        name = frames_of(self.folder)
        self.name = name or "tumble"
        self.frames = read_frames(self.folder, name) if name is not None else None
        self.times: Array = np.zeros(0) if self.frames is None else np.asarray(self.frames.times)

    def __len__(self) -> int:
        return len(self.times)

    @cached_property
    def _first(self) -> Frame | None:
        return self.frames[0] if self.frames is not None else None

    @property
    def on_grains(self) -> bool:
        """Whether there are grains to be seen."""
        return self._first is not None and len(self._first.grains["position"]) > 0

    @cached_property
    def radius(self) -> float | None:
        """Mean radius of the grains [m]."""
        return float(self._first.grains["radius"].mean()) if self._first is not None and self.on_grains else None

    def nearest(self, time: float) -> int:
        """The picture nearest to this time [s]."""
        return int(np.argmin(np.abs(self.times - time)))

    def row(self, index: int) -> int:
        """The row of the series at a picture."""
        return int(np.argmin(np.abs(self.series["t_s"] - self.times[index])))

    def number(self, name: str) -> float:
        """A number of the trial (`weight`, `spike_length` ...) in SI."""
        return float(self.result["trial"][name]["value"])

    def grains(self, found: Frame) -> dict[str, NDArray[Any]]:
        """The grains of a frame, displaced since the torque began: that the setting down moved them is left out."""
        return found.grains if self._first is None else moved_since(found.grains, self._first.grains)

    def colour_top(self, by: str) -> float:
        """Upper end of a scale for all pictures, in the unit of its label, by those grains that take part."""
        if self.frames is None or not self.on_grains:
            return self.least
        chosen = {len(self) // 3, 2 * len(self) // 3, len(self) - 1}
        return colour_top((self.grains(self.frames[index]) for index in chosen), by)


class SpaceReel(_Filmed):
    """A run in space to be pictured; its folder has frames, with grains or without."""

    still, film, bar, least = (1600, 1000), (960, 600), (0.93, 0.3, 0.012, 0.45), 0.0
    failed, without = "flat pictures stand in", "flat ones stand in for them"
    frames: Frames

    @property
    def called(self) -> str:
        """Its title."""
        return str(self.result["title"])

    @property
    def centres(self) -> Array:
        """Middle of what the hull's corners span at every picture [m], shape (n, 3)."""
        return self._seen.centres

    @property
    def ends(self) -> Array:
        """z of the lowest and the highest point of the body at every picture [m], shape (n, 2)."""
        return self._seen.ends

    @property
    def peak(self) -> float:
        """Largest force of one foot or spike in any picture [N]; 0: there is none."""
        return max((float(np.linalg.norm(force, axis=1).max(initial=0.0)) for force in self._seen.forces), default=0.0)

    @cached_property
    def loads(self) -> Array:
        """Force of the ground on the whole body at every picture [N], shape (n,)."""
        return np.array([float(np.linalg.norm(force.sum(axis=0))) for force in self._seen.forces])

    @cached_property
    def foot(self) -> Foot:
        """The foot or spike with the largest force of all pictures; where there is none, the lowest at the end."""
        seen, last = self._seen, int(np.argmax(self.loads)) if self.loads.any() else len(self) - 1
        points, touched = seen.feet[last], _most_pushed(seen, last)
        parts = self._parts
        own = points[parts == parts[int(np.argmin(np.linalg.norm(points - touched, axis=1)))]]
        (left, front, _), (right, back, _) = own.min(axis=0), own.max(axis=0)
        cut, half = 0.5 * float(front + back), 0.5 * float(back - front) + 1e-6
        x, low = [], []
        for every in seen.feet:
            near = every[np.abs(every[:, 1] - cut) <= half]
            near = near if len(near) else every
            low.append(float(near[:, 2].min()))
            x.append(float(near[near[:, 2] <= low[-1] + _LEVEL * self.reach, 0].mean()))
        return Foot(cut, float(right - left), np.array(x), np.array(low))

    @cached_property
    def _parts(self) -> NDArray[np.int32]:
        """Which foot or spike each point of their mesh belongs to, shape (points,)."""
        points, faces = self.frames[0].bodies[_feet_of(self.frames[0])]
        sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
        links = coo_array((np.ones(len(sides)), (sides[:, 0], sides[:, 1])), shape=(len(points), len(points)))
        return np.asarray(connected_components(links, directed=False)[1])

    @cached_property
    def _on_points(self) -> bool:
        """Whether the ground pushes on the ends of spikes alone, as a surface law does under a platform."""
        return not self.on_grains and self.what == "platform" and "spikes" in self.frames[0].bodies

    @cached_property
    def _tips(self) -> NDArray[np.intp]:
        """Number of the point of the mesh at the end of each spike: its farthest from the middle of the hull."""
        away = np.linalg.norm(self._seen.feet[0] - self.centres[0], axis=1)
        own = (np.flatnonzero(self._parts == part) for part in range(self._parts.max() + 1))
        return np.array([points[np.argmax(away[points])] for points in own])

    @cached_property
    def _seen(self) -> _Seen:
        centres, ends, feet, pushed, forces = [], [], [], [], []
        for frame in self.frames:
            centres.append(np.asarray(frame.bodies["hull"][0].mean(axis=0), dtype=float))
            heights = np.concatenate([points[:, 2] for points, _ in frame.bodies.values()])
            ends.append((float(heights.min()), float(heights.max())))
            feet.append(np.asarray(frame.bodies[_feet_of(frame)][0], dtype=float))
            points, fields = frame.clouds.get("row_forces", (np.zeros((0, 3)), {}))
            pushed.append(np.asarray(points, dtype=float))
            forces.append(np.asarray(fields.get("force", np.zeros((0, 3))), dtype=float).reshape(-1, 3))
        return _Seen(np.array(centres), np.array(ends), feet, pushed, forces)

    @property
    def surface(self) -> float | None:
        """Height of the undisturbed surface [m]; None where the folder of a run on grains does not say it."""
        if not self.on_grains:
            return 0.0
        origin = (self.result.get("grains") or {}).get("origin")
        return None if origin is None else float(origin[2])

    def grains(self, found: Frame) -> dict[str, NDArray[Any]]:
        """Those of a frame as any reel has them, and how far each has risen where the frame has directions."""
        known = super().grains(found)
        moved = known.get("displacement")
        return known if moved is None or moved.ndim != 2 else known | {HEIGHT: moved[:, 2]}

    def colour_top(self, by: str) -> float:
        """As of any reel; that of heights is the largest sinkage of a foot, at least a grain's diameter."""
        if by != HEIGHT or self.radius is None or self.surface is None:
            return super().colour_top(by)
        deepest = max(0.0, self.surface - float(self.ends[:, 0].min()))
        return nice_above(1e3 * max(2.0 * self.radius, deepest))

    @property
    def what(self) -> str:
        """What it is, in a word."""
        return "robot" if self.result.get("experiment") == "mujoco" else "platform"

    def lowest(self, frame: Frame) -> Array | None:
        """The lowest point of the feet or spikes of a frame [m], shape (3,), of the body where they are points.

        Under a platform on a law it is the lowest end of a spike: the law takes its depth from there. The ball that is
        drawn goes deeper where the spike is tilted. None where the height of the surface is not known.
        """
        if self.surface is None:
            return None
        points = frame.bodies[_feet_of(frame)][0]
        points = points[self._tips] if self._on_points else points
        return np.asarray(points[int(np.argmin(points[:, 2]))], dtype=float)

    @cached_property
    def reach(self) -> float:
        """Largest distance of a tip from the centre [m]."""
        points = np.concatenate([part for part, _ in self.frames[0].bodies.values()])
        return float(np.linalg.norm(points - self.centres[0], axis=1).max())

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Corners of the bed, or of a block of ground under the way [m]."""
        if self.on_grains:
            return grains_box(self.frames[0])
        low, high = self.centres.min(axis=0) - 4 * self.reach, self.centres.max(axis=0) + 4 * self.reach
        low[2], high[2] = -_THIN, 0.0
        return low, high

    def line(self, index: int, *, short: bool = False) -> str:
        """Time, state, and unless it is to be `short` where the lowest foot or spike is and the force on a robot."""
        state = f"    {self.states[self.row(index)]}" if len(self.states) else ""
        long = "" if short else self._height(self.frames[index])
        if long and self.what == "robot" and self.loads[index] > 0.0:
            long += f"    force {quote(float(self.loads[index]), unit='N')}"
        return f"t = {self.times[index]:.3f} s{state}{long}"

    def _height(self, frame: Frame) -> str:
        """How far the lowest foot, spike or point is from the undisturbed surface, in words."""
        lowest = self.lowest(frame)
        if lowest is None or self.surface is None:
            return ""
        height, foot = 1e3 * (float(lowest[2]) - self.surface), "foot" if self.what == "robot" else "spike"
        foot = "tip" if self._on_points else foot if "spikes" in frame.bodies else "point"
        if abs(height) < _TOUCHES:
            return f"    lowest {foot} at the undisturbed surface"
        return f"    lowest {foot} {abs(height):.3g} mm {'above' if height > 0 else 'below'} the undisturbed surface"

    def frame(self, index: int) -> Frame:
        """The frame of a picture."""
        found = self.frames[index]
        return replace(found, grains=self.grains(found))


def _feet_of(frame: Frame) -> str:
    """Which body of a frame stands on the ground: the feet or spikes, or the whole body where they are points."""
    return "spikes" if "spikes" in frame.bodies else "hull"


def _most_pushed(seen: _Seen, index: int) -> Array:
    """Where the largest force of a picture is [m], shape (3,); the lowest point where there is none."""
    force, feet = seen.forces[index], seen.feet[index]
    if not len(force):
        return np.asarray(feet[int(np.argmin(feet[:, 2]))])
    return np.asarray(seen.pushed[index][int(np.argmax(np.linalg.norm(force, axis=1)))])


class Reel(_Filmed):
    """A run in the plane to be pictured; on a law without frames, with `count` pictures to choose from.

    `like` is what `spikes` is where the folder does not say, as on a law: of the run that it stands beside. Raises
    FileNotFoundError: there is no trajectory.csv or result.json.
    """

    still, film, bar, least = (1920, 1080), (1280, 720), (0.925, 0.27, 0.012, 0.5), 1.0
    failed, without = "cross-sections stand in for the pictures", "cross-sections stand in for them"

    def __init__(self, folder: str | Path, *, count: int = 500, like: tuple[float, float] | None = None) -> None:
        super().__init__(folder)
        self.like = like
        if self.frames is None:
            self.times = np.linspace(0.0, float(self.series["t_s"][-1]), max(2, count))

    def line(self, index: int, *, short: bool = False) -> str:
        """Time, angle and state, as text on a picture; always `short`."""
        row = self.row(index)
        theta = math.degrees(float(self.series["theta_rad"][row]))
        return f"t = {self.times[index]:.3f} s    θ = {theta:.1f}°    {self.states[row]}".replace("-", "−")

    @property
    def called(self) -> str:
        """What it stands on, in words."""
        return "bed of grains" if self.frames is not None else str(self.result.get("ground", "law"))

    @cached_property
    def spikes(self) -> tuple[float, float]:
        """Diameter of a spike, and how far it stands out of the hull [m]."""
        grains = self.result.get("grains") or {}
        if "spike_diameter" in grains:
            return float(grains["spike_diameter"]), float(grains.get("spike_clear", _CLEAR))
        scale = self.reach / 0.2
        return self.like if self.like is not None else (_SPIKE * scale, _CLEAR * scale)

    # Where things are -------------------------------------------------------------------------------------------------

    @cached_property
    def origin(self) -> Array:
        """Where the trajectory's x = y = 0 is in the pictures [m], shape (3,)."""
        if self._first is None:
            return np.zeros(3)
        points = self._first.bodies["spikes"][0]
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        centre[[0, 2]] = points[:, [0, 2]].mean(axis=0)  # eight alike, evenly about the axis
        start = self.row(0)
        return centre - [self.series["x_m"][start], 0.0, self.series["y_m"][start]]

    @property
    def surface(self) -> float:
        """Height of the undisturbed surface [m]."""
        return float(self.origin[2])

    @property
    def cut(self) -> float:
        """y of the plane of the spikes [m]."""
        return float(self.origin[1])

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Corners of the bed, or of the block of ground that stands for a law [m]."""
        if self._first is None:
            x = self.series["x_m"]
            return np.array([x.min() - 1.0, 0.0, -_BLOCK]), np.array([x.max() + 1.0, 0.5 * _WIDE, 0.0])
        return grains_box(self._first)

    @property
    def reach(self) -> float:
        """Length of its spikes from the centre [m]."""
        return self.number("spike_length")

    def centres(self) -> Array:
        """(x, z) of the platform's centre at every picture [m], shape (n, 2)."""
        rows = [self.row(index) for index in range(len(self))]
        return np.column_stack([self.series["x_m"][rows], self.series["y_m"][rows]]) + self.origin[[0, 2]]

    def feet(self) -> Array:
        """x of the lowest tip at every picture [m], shape (n,): of two nearly as low the leading one."""
        rows, length = [self.row(index) for index in range(len(self))], self.reach
        angles = self._directions(self.series["theta_rad"][rows][:, None])
        x = self.series["x_m"][rows][:, None] - length * np.sin(angles)
        depth = length * np.cos(angles) - self.series["y_m"][rows][:, None]
        wanted = depth + 0.03 * (x - x.mean(axis=1, keepdims=True))
        share = np.exp((wanted - wanted.max(axis=1, keepdims=True)) / (0.005 * length))
        return (share * x).sum(axis=1) / share.sum(axis=1) + self.origin[0]

    def lowest(self) -> Array:
        """Height of the lowest tip at every picture [m], shape (n,)."""
        rows = [self.row(index) for index in range(len(self))]
        angles = self._directions(self.series["theta_rad"][rows][:, None])
        return np.asarray(self.origin[2] + self.series["y_m"][rows] - self.reach * np.cos(angles).max(axis=1))

    @property
    def _count(self) -> int:
        """Rows of spikes."""
        return int(self.result.get("spike_count", 8))

    def _directions(self, theta: Any, rows: Any = None) -> Array:
        """Angles of the rows, of all or of some, where the platform has turned by theta [rad]."""
        rows = np.arange(self._count) if rows is None else rows
        return np.asarray(theta + math.pi / self._count + 2 * math.pi / self._count * rows)

    # What is seen -----------------------------------------------------------------------------------------------------

    def frame(self, index: int) -> Frame:
        """The frame of a picture."""
        row = self.row(index)
        x, y, theta = (float(self.series[name][row]) for name in ("x_m", "y_m", "theta_rad"))
        turn = (math.cos(0.5 * theta), 0.0, math.sin(0.5 * theta), 0.0)
        bodies = {
            name: (in_place(points, self.origin + (x, 0.0, y), turn), faces)
            for name, (points, faces) in self._meshes.items()
        }
        if self.frames is not None:  # grains touch a cylinder inside the hull: shown is the octagon
            found, values = self.frames[index], {}
            if "hull" in found.bodies:
                across = found.bodies["hull"][0][:, [0, 2]] - bodies["hull"][0][:, [0, 2]].mean(axis=0)
                values["hull_radius"] = float(np.hypot(*across.T).max())
            return replace(
                found, grains=self.grains(found), bodies=found.bodies | {"hull": bodies["hull"]},
                values=found.values | values,
            )  # fmt: skip
        grains: dict[str, NDArray[Any]] = {"position": np.zeros((0, 3)), "radius": np.zeros(0)}
        return Frame(float(self.times[index]), grains, bodies, {}, {"row_forces": self._loads(row, x, y, theta)})

    @cached_property
    def _meshes(self) -> dict[str, tuple[Array, NDArray[np.int64]]]:
        """Spikes and hull in body axes."""
        length, (thick, clear) = self.reach, self.spikes
        points, faces = spike_mesh("sphere", diameter=thick, length=clear + 0.5 * thick, segments=24)
        parts, triangles = [], []
        for row, gamma in enumerate(self._directions(0.0).tolist()):
            tip = np.array([-length * math.sin(gamma), 0.0, -length * math.cos(gamma)])
            parts.append(in_place(points, tip, (math.cos(0.5 * gamma), 0.0, math.sin(0.5 * gamma), 0.0)))
            triangles.append(faces + row * len(points))
        return {"spikes": (np.concatenate(parts), np.concatenate(triangles)), "hull": self._hull(length - clear)}

    def _hull(self, corner: float) -> tuple[Array, NDArray[np.int64]]:
        """A prism whose corners are where the spikes begin, as wide as the bed."""
        (low, high), count, angles = self.box, self._count, self._directions(0.0)
        half = 0.5 * (_WIDE * self.reach / 0.2 if self.frames is None else float(high[1] - low[1]))
        ring = np.column_stack([-corner * np.sin(angles), np.zeros(count), -corner * np.cos(angles)])
        points = np.concatenate([ring - [0.0, half, 0.0], ring + [0.0, half, 0.0]])
        here = np.arange(count)
        after = (here + 1) % count
        sides = [(here, after + count, after), (here, here + count, after + count)]
        fan = np.column_stack([np.zeros(count - 2, dtype=int), here[1:-1], here[2:]])
        return points, np.concatenate([*map(np.column_stack, sides), fan, fan[:, ::-1] + count]).astype(np.int64)

    def _loads(self, row: int, x: float, y: float, theta: float) -> tuple[Array, dict[str, NDArray[Any]]]:
        """Points and forces of the rows that touch, of series/feet.csv or the law's; their friction shared by load."""
        (feet, motion), length = self._feet, self.reach
        if not motion:
            return np.zeros((0, 3)), {"force": np.zeros((0, 3))}
        if feet:
            at = int(np.argmin(np.abs(feet["t_s"] - self.series["t_s"][row])))
            load = np.array([feet[f"normal_{n}_N"][at] for n in range(self._count)])
        else:  # K delta + C max(0, rate of delta), docs/planar.md
            every = self._directions(theta)
            depth = length * np.cos(every) - y
            rate = -self.series["vy_m_s"][row] - length * np.sin(every) * self.series["omega_rad_s"][row]
            spring = self.number("stiffness") * depth + self.number("damping") * np.maximum(rate, 0.0)
            load = np.where(depth > 0, spring, 0.0)
        rows = np.flatnonzero(load > 0)
        gamma = self._directions(theta, rows)
        points = np.column_stack([x - length * np.sin(gamma), np.zeros(len(rows)), y - length * np.cos(gamma)])
        push = self.number("mass") * float(motion["ax_m_s2"][row])
        share = load[rows] / max(load[rows].sum(), 1e-300)
        return points, {"force": np.column_stack([push * share, np.zeros(len(rows)), load[rows]])}

    @cached_property
    def _feet(self) -> tuple[dict[str, Array], dict[str, Array]]:
        path, motion = (self.folder / "series" / f"{name}.csv" for name in ("feet", "motion"))
        feet = read_columns(path)[0] if path.exists() else {}
        known = bool(feet) or self.result.get("ground") == "spring-damper"
        if not known or not motion.exists() or self.result.get("effects"):
            return {}, {}
        return feet, read_columns(motion)[0]


AnyReel = Reel | SpaceReel
