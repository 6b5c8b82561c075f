"""The factors of 3D-RFT that were measured in one bed of grains, and the force on any shape that they predict.

`hedgebed bed test plates` writes them to `rft.json`. The traction on a piece of surface at depth d below the surface,
with outward normal n and unit direction of motion v, is

    d (1 + b max(x1, 0) max(x2, 0)) (xi_1 f1 n + xi_2 f2 v - xi_3 f3 z),  bounded by friction along the surface,

with the functions f1, f2, f3 of Agarwal, Goldman and Kamrin (`rigid.ground.rft`), x1 = -v_z and x2 = -n_z. There b = 0
and xi_1 = xi_2 = xi_3 = xi_n, the one number of the grains. Here each may have its own value [N/m3]. b is our addition.
In beds of coarse grains, surfaces that face and move down carry more than 3D-RFT predicts from those that face forward.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from rigid.checks import nearest, why_unread

from .rft import tractions

__all__ = [
    "RFT_FORMAT", "Pieces", "RftTable", "box_pieces", "find_rft", "mesh_pieces", "read_rft", "round_pieces",
]  # fmt: skip

RFT_FORMAT = "hedgebed-rft/1"
Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Factors = tuple[Finite, Finite, Finite, Finite]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
TABLES = Path(__file__).parent / "tables"  # Those that ship; sand.json is that of docs/results/bed-test-plates
MOST = 10.0  # times what was measured, in depth and width: beyond it no force is stated


@dataclass(frozen=True)
class Pieces:
    """A surface in flat pieces, in the frame of its body, z up.

    points: middles [m], shape [n, 3]. normals: outward, of length 1, shape [n, 3]. areas: [m2], shape [n].
    """

    points: Array
    normals: Array
    areas: Array


def mesh_pieces(corners: ArrayLike, *, count: int = 2000) -> Pieces:
    """Pieces of a closed surface of triangles, halved until there are `count` or more; corners [m], shape [n, 3, 3].

    Corners are counter-clockwise seen from outside. Raises ValueError for another shape or a triangle without area.
    """
    each = np.asarray(corners, dtype=float)
    if each.ndim != 3 or each.shape[1:] != (3, 3) or not len(each):
        raise ValueError(f"corners has the shape {each.shape}: [n, 3, 3] was expected")
    while len(each) < count:
        # The longest side of the largest half of the triangles is halved.
        sides = np.linalg.norm(np.roll(each, -1, axis=1) - each, axis=2)
        cut = sides.max(axis=1) >= np.median(sides.max(axis=1))
        first = sides.argmax(axis=1)
        turned = np.take_along_axis(each, ((first[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
        a, b, c = (turned[cut, k] for k in range(3))
        middle = 0.5 * (a + b)
        each = np.concatenate([each[~cut], np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    across = np.cross(each[:, 1] - each[:, 0], each[:, 2] - each[:, 0])
    double = np.linalg.norm(across, axis=1)
    if not (double > 0).all():
        raise ValueError(f"corners: {int((double <= 0).sum())} triangles have no area")
    return Pieces(each.mean(axis=1), across / double[:, None], 0.5 * double)


def box_pieces(size: Sequence[float], tilt: float, *, count: int = 12) -> Pieces:
    """Pieces of a box of `size` [m] about the origin whose face down is turned by `tilt` [degrees] towards +x.

    `count`: pieces along the longest side.
    """
    angle, longest = math.radians(tilt), max(size)
    # Columns: where the box's own axes point.
    turn = np.array([[math.cos(angle), 0, -math.sin(angle)], [0, 1, 0], [math.sin(angle), 0, math.cos(angle)]])
    points, normals, areas = [], [], []
    for axis in range(3):
        across = [k for k in range(3) if k != axis]
        numbers = [max(1, round(count * size[k] / longest)) for k in across]
        grids = [size[k] * ((np.arange(n) + 0.5) / n - 0.5) for k, n in zip(across, numbers, strict=True)]
        u, w = (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij"))
        for sign in (-1.0, 1.0):
            face, normal = np.zeros((len(u), 3)), np.zeros(3)
            face[:, across[0]], face[:, across[1]], face[:, axis] = u, w, 0.5 * sign * size[axis]
            normal[axis] = sign
            points.append(face @ turn.T)
            normals.append(np.tile(turn @ normal, (len(u), 1)))
            areas.append(np.full(len(u), size[across[0]] * size[across[1]] / len(u)))
    return Pieces(np.concatenate(points), np.concatenate(normals), np.concatenate(areas))


def round_pieces(profile: ArrayLike, *, around: int = 48, along: int = 16) -> Pieces:
    """Pieces of a body of revolution about z.

    `profile`: radius and height [m] of its outline from the lowest point on the axis to the highest, shape [n, 2].
    """
    outline = np.asarray(profile, dtype=float)
    angle = 2 * math.pi * (np.arange(around) + 0.5) / around
    points, normals, areas = [], [], []
    fine = max(1, math.ceil(along / (len(outline) - 1)))
    for (r0, z0), (r1, z1) in pairwise(outline):
        length = math.hypot(r1 - r0, z1 - z0)
        for share in (np.arange(fine) + 0.5) / fine:
            r, z = r0 + share * (r1 - r0), z0 + share * (z1 - z0)
            out, up = (z1 - z0) / length, (r0 - r1) / length
            points.append(np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(around, z)]))
            normals.append(np.column_stack([out * np.cos(angle), out * np.sin(angle), np.full(around, up)]))
            areas.append(np.full(around, 2 * math.pi * r * length / fine / around))
    return Pieces(np.concatenate(points), np.concatenate(normals), np.concatenate(areas))


class RftTable(BaseModel):
    """The contents of an rft.json; SI units, angles in degrees."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["hedgebed-rft/1"]
    material: Annotated[str, Field(min_length=1)]  # of the grains
    source: Annotated[str, Field(min_length=1)]  # What the numbers come from
    gravity: Positive  # of the grains [m/s2]
    grain: Positive  # mean diameter [m]
    bulk_density: Positive  # [kg/m3]
    surface_friction: Annotated[float, Field(ge=0, allow_inf_nan=False)]  # of grains and body [1]
    factors: Factors  # xi_1, xi_2, xi_3 [N/m3], b [1]
    stds: Factors  # standard error of each, by fits that leave out one bed (jackknife)
    left_out: tuple[Factors, ...]  # The factors of those fits
    unseen: Annotated[float, Field(ge=0)]  # rms of the error of plates that were not fitted, over their force [1]
    shape_errors: tuple[Finite, Finite] | None = None  # of other shapes: rms and largest, over their force [1]
    depth: tuple[Finite, Finite]  # of the measured plates' middles [m]
    side: Positive  # of the plates [m]
    speed: Positive  # of the plates [m/s]
    plates: tuple[dict[str, float], ...]  # beta, gamma, stress_x, stress_z per depth and their std [N/m3]; also fitted
    notes: tuple[str, ...] = ()  # What a reader must know, a sentence each

    @model_validator(mode="after")
    def _positive(self) -> Self:
        if not any(self.factors[:3]):
            raise ValueError(f"factors = {list(self.factors)}: one of the first three must differ from 0")
        return self

    def force(
        self, pieces: Pieces, *, depth: float, direction: ArrayLike, gravity: float | None = None
    ) -> tuple[Array, Array]:
        """Force on a body [N] and its standard error [N], each of shape [3]; z up.

        `depth`: of the origin of the body below the undisturbed surface [m]. `direction`: of its motion, any length,
        shape [3]. `gravity` [m/s2]: that of the table if not given; the force is in proportion to it. The error is
        that of the factors, from the beds (jackknife). It does not contain the error of the law itself, `unseen`.
        Raises ValueError for a direction without length.
        """
        scale = 1.0 if gravity is None else gravity / self.gravity
        best = scale * law_force(self.factors, self.surface_friction, pieces, depth, direction)
        others = [scale * law_force(f, self.surface_friction, pieces, depth, direction) for f in self.left_out]
        return best, jackknife_std(others) if len(others) > 1 else np.full(3, np.nan)

    def beyond(self, pieces: Pieces, *, depth: float, direction: ArrayLike) -> list[str]:
        """What is beyond the plates, a sentence each; arguments as in `force`.

        Raises ValueError for a body narrower than a grain, and for one ten times as wide or as deep as the plates.
        """
        way = np.asarray(direction, dtype=float)
        gamma = math.degrees(math.asin(-float(way[2]) / float(np.linalg.norm(way))))
        width = float(np.ptp(pieces.points, axis=0).max())
        upright = max((abs(math.sin(math.radians(plate["beta"]))) for plate in self.plates), default=0.0)
        deep, most = depth - float(pieces.points[:, 2].min()), self.depth[1] + 0.5 * self.side * upright
        if width < self.grain:
            raise ValueError(
                f"the body is {1e3 * width:.3g} mm large, less than one grain of the table, {1e3 * self.grain:.3g} mm"
            )
        for what, value, limit in (("large", width, self.side), ("deep", deep, most)):
            if value > MOST * limit:
                raise ValueError(
                    f"the body is {value:.3g} m {what}, the plates {limit:.3g} m: {MOST * limit:.3g} m is the most"
                )
        said = []
        if abs(width - self.side) > self.grain:
            said.append(f"the body is {1e3 * width:.3g} mm large and the plates {1e3 * self.side:.3g} mm: extrapolated")
        if deep > most:
            said.append(f"it reaches {1e3 * deep:.3g} mm deep and the plates {1e3 * most:.3g} mm: extrapolated")
        measured = sorted({plate["gamma"] for plate in self.plates})
        flattest = next((g for g in measured if g > 0), 0.0)
        if gamma < 0:
            said.append(f"gamma = {gamma:.3g} degrees: no plate was pushed upwards: extrapolated")
        elif 1e-9 < gamma < flattest - 1e-9:
            said.append(f"gamma = {gamma:.3g} degrees: no plate was pushed between 0 and {flattest:g} degrees")
        return said

    def to_json(self) -> str:
        """The text of the file."""
        return self.model_dump_json(indent=1) + "\n"


def law_force(factors: ArrayLike, surface_friction: float, pieces: Pieces, depth: float, direction: ArrayLike) -> Array:
    """Force on a body [N], shape [3]; `factors` xi_1, xi_2, xi_3 [N/m3], b [1]; the others as in `RftTable.force`."""
    way = np.asarray(direction, dtype=float)
    if not 0 < float(np.linalg.norm(way)) < math.inf:
        raise ValueError(f"direction = {way.tolist()} must be three finite numbers, not all 0")
    deep = np.maximum(depth - pieces.points[:, 2], 0.0)
    alpha = law_tractions(factors, surface_friction, pieces.normals, way / np.linalg.norm(way))
    return np.asarray((deep * pieces.areas) @ alpha, dtype=np.float64)


def jackknife_std(left_out: ArrayLike) -> Array:
    """Standard error of numbers from those without each bed (Efron 1982), shape [n] from shape [bed, n]."""
    each = np.asarray(left_out, dtype=float)
    return np.asarray(np.sqrt((len(each) - 1) / len(each) * ((each - each.mean(axis=0)) ** 2).sum(axis=0)))


def law_tractions(factors: ArrayLike, surface_friction: float, normals: ArrayLike, direction: ArrayLike) -> Array:
    """Tractions per depth [N/m3], shape [n, 3], of pieces with these outward unit normals; `direction` of length 1."""
    *gradients, downward = np.asarray(factors, dtype=float)
    facing = np.maximum(-np.asarray(normals)[:, 2], 0.0) * max(-float(np.asarray(direction)[2]), 0.0)
    bare = tractions(normals, direction, surface_friction=surface_friction, factors=gradients)
    return np.asarray((1.0 + downward * facing)[:, None] * bare)


def find_rft(name: str | Path) -> Path:
    """The file of a table: a path, or `sand`, the table that ships. Raises ValueError for another word."""
    path, shipped = Path(name), {file.stem: file for file in sorted(TABLES.glob("*.json"))}
    if path.exists() or path.suffix or path.parent != Path():
        return path
    if path.name not in shipped:
        raise ValueError(
            f"table = {str(name)!r}: there is no such file; rft.json of `hedgebed bed test plates` is accepted, or a "
            f"table that ships: {nearest(path.name, shipped)}"
        )
    return shipped[path.name]


def read_rft(path: str | Path) -> RftTable:
    """The table at `path`, or the one that ships by this name. Raises ValueError, naming the file and its fault."""
    path = find_rft(path)
    try:
        return RftTable(**json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be read, rft.json of `hedgebed bed test plates` was expected: {why_unread(path, error)}"
        ) from None
    except (json.JSONDecodeError, UnicodeDecodeError, TypeError) as error:
        raise ValueError(f"{path}: no JSON table of `hedgebed bed test plates`: {error}") from None
    except ValidationError as error:
        faults = (f"{'.'.join(map(str, e['loc'])) or 'table'}: {e['msg']}" for e in error.errors())
        raise ValueError("\n".join(f"{path}: {fault}" for fault in faults)) from None
