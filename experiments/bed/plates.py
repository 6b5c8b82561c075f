"""`hedgebed bed test plates`: the stress that a bed opposes to plates, over their angle and their direction of motion.

A square plate moves along v = (cos gamma, 0, -sin gamma), z up. Its leading face has the outward normal n = (sin beta,
0, -cos beta). beta = 0 faces down, beta = 90 degrees faces forward, gamma = 90 degrees is straight down. Each plate
goes into a fresh copy of the bed. With gamma above 0 it begins above the surface and moves along v. With gamma = 0 it
first goes in edgewise, and is then dragged level at the full depth.

From the forces follow the factors of 3D-RFT in these grains (`experiments.bed.plates_fit`). Bodies of other shapes are
pushed into the same beds and compared with what that table predicts for them.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dem import Ball, Box, Cone, Cylinder, Placed, mesh_from_file
from dem.grains.materials import material
from dem.shapes.basic import Shape
from experiments.runs.types import Json
from rigid.ground.rft_table import Pieces, box_pieces, mesh_pieces, round_pieces

from .plates_fit import direction_of
from .plates_result import result_of
from .settings import say
from .test_settings import BedPlatesSettings
from .tests import Tested, bed_test, check_bed

__all__ = ["Push", "Shaped", "check", "pushes", "resume", "run", "shaped"]

SAMPLES = 120  # of each part of a way
BINS = 6  # stretches of the measured part of a way, of which means are kept
BEARING = 20.0  # pressure of a plate over what lies on the floor [1], about
FACING = 0.2  # Least n.v of a plate that is measured [1]
FLOOR = 4.0  # Least height of a body above the floor [mean diameters]
PACKING = 0.55  # of a rained bed, about: for the speed that is taken where none is given
CONE = math.radians(30.0)  # half-angle of the built-in cone


@dataclass(frozen=True)
class Push:
    """One body and the direction in which it is pushed; angles in degrees."""

    gamma: float
    beta: float | None = None  # of a plate
    shape: str | None = None  # of another body: a name of `SHAPES` or a file

    @property
    def name(self) -> str:
        """In tables."""
        return f"plate {self.beta:g}" if self.beta is not None else Path(str(self.shape)).name


@dataclass(frozen=True)
class Shaped:
    """A body: the shape that grains touch, its surface in pieces, height of its lowest point from its origin [m]."""

    body: Shape
    pieces: Pieces
    low: float


def pushes(settings: BedPlatesSettings) -> list[Push]:
    """All pushes into one bed: plates by gamma and beta, then the other shapes.

    Left out are plates that hardly face their motion (n.v below 0.2), and of two mirror images with gamma = 90 one.
    """
    found = []
    for gamma in settings.gammas:
        for beta in settings.betas:
            mirrored = gamma == 90 and beta < 0 and -beta in settings.betas
            if math.sin(math.radians(beta + gamma)) >= FACING and not mirrored:
                found.append(Push(gamma, beta=beta))
    return found + [Push(gamma, shape=shape) for shape in settings.shapes for gamma in settings.shape_gammas]


def plate_of(beta: float, side: float, thickness: float) -> Shaped:
    """A square plate about the body's origin, turned by `beta` [degrees] about y; lengths in m."""
    angle = math.radians(beta)
    turn = (math.cos(0.5 * angle), 0.0, -math.sin(0.5 * angle), 0.0)
    size = (side, side, thickness)
    high = 0.5 * (side * abs(math.sin(angle)) + thickness * abs(math.cos(angle)))
    return Shaped(Placed(Box(size), turn=turn), box_pieces(size, beta), -high)


def shaped(name: str, size: float, scale: float) -> Shaped:
    """The body called `name`: a built-in one as wide as `size` [m], or that of a file in units of `scale` [m].

    A built-in body stands on its origin. Raises ValueError for a file that is none or holds no closed surface.
    """
    radius = 0.5 * size
    if name == "ball":
        angles = np.linspace(0.0, math.pi, 49)
        profile = np.column_stack([radius * np.sin(angles), radius * (1 - np.cos(angles))])
        return Shaped(Ball((0.0, 0.0, radius), radius), round_pieces(profile), 0.0)
    if name == "cone":
        height = radius / math.tan(CONE)
        cone = Cone(bottom=0.0, top=height, bottom_radius=0.0, top_radius=radius)
        return Shaped(cone, round_pieces([(0.0, 0.0), (radius, height), (0.0, height)]), 0.0)
    if name == "cylinder":
        outline = [(0.0, 0.0), (radius, 0.0), (radius, size), (0.0, size)]
        return Shaped(Cylinder(0.0, size, radius), round_pieces(outline), 0.0)
    mesh = mesh_from_file(name, scale=scale)
    return Shaped(mesh, mesh_pieces(mesh.vertices[mesh.triangles]), float(mesh.bounds()[0][2]))


def _body_of(push: Push, settings: BedPlatesSettings) -> Shaped:
    if push.beta is not None:
        return plate_of(push.beta, settings.side, settings.thickness)
    return shaped(str(push.shape), settings.shape_size, settings.shape_scale)


def check(settings: BedPlatesSettings) -> None:
    """Raise ValueError for a bed that is none or too small, a shape that is none, or too few plates for a fit."""
    bed = check_bed(settings)
    asked = pushes(settings)
    plates = [push for push in asked if push.beta is not None]
    if len(plates) < 3:
        raise ValueError(say("few_plates", s=settings, count=len(plates), facing=FACING))
    least = 3 * bed.grain
    if settings.side < least:
        raise ValueError(say("small_plate", s=settings, least=least))
    for push in asked:
        shape = _body_of(push, settings)
        wide = 2 * float(np.abs(shape.pieces.points[:, :2]).max())
        if 2 * wide > min(bed.size[:2]):
            raise ValueError(say("narrow_for_body", name=push.name, wide=wide, width=min(bed.size[:2])))
        below = settings.depth - shape.low
        if below > bed.surface - FLOOR * bed.grain:
            most = bed.surface - FLOOR * bed.grain + shape.low
            raise ValueError(say("deep_for_body", name=push.name, s=settings, most=most, surface=bed.surface))


def speed_of(settings: BedPlatesSettings, grain: float, density: float, gravity: float) -> float:
    """Speed of the bodies [m/s]: as given, or that of the inertial number.

    The pressure of the inertial number is that of the bed at half a plate's side, which is less than that on the plate.
    """
    if settings.speed is not None:
        return settings.speed
    pressure = 0.5 * PACKING * density * gravity * settings.side
    return settings.inertial_number * settings.side / grain * math.sqrt(pressure / density)


def _test(settings: BedPlatesSettings, bed: Any, about: Json, copy: int, tell: Callable[[float], None]) -> Tested:
    push = pushes(settings)[copy]
    shape = _body_of(push, settings)
    speed = speed_of(settings, about["grain"], about["density"], about["gravity"])
    rows = np.array(list(_pushed(settings, bed, push, shape, speed, tell)))
    columns = dict(zip(("way_m", "depth_m", "force_x_N", "force_y_N", "force_z_N", "evaluated"), rows.T, strict=True))
    numbers = {
        "beta": push.beta, "gamma": push.gamma, "shape": push.shape, "body": push.name, "speed": speed,
        "samples": [[float(f"{value:.6g}") for value in part] for part in _binned(rows[rows[:, 5] > 0][:, 1:5])],
    }  # fmt: skip
    return Tested(bed, columns, numbers, [])


def _binned(rows: np.ndarray) -> list[list[float]]:
    """Means of depth [m] and force [N] over `BINS` stretches of equal length, each of 4 numbers."""
    return [part.mean(axis=0).tolist() for part in np.array_split(rows, BINS) if len(part)]


def _pushed(
    settings: BedPlatesSettings, bed: Any, push: Push, shape: Shaped, speed: float, tell: Callable[[float], None]
) -> Iterator[tuple[float, ...]]:
    """Way, depth of the origin [m], mean force [N] and whether it counts as measured, of each sample."""
    grains, surface = bed.grains(), bed.surface
    top = float((grains.position[:, 2] + grains.radius).max())
    start = top + 1e-6 - shape.low
    middle = (0.5 * bed.size[0], 0.5 * bed.size[1])
    body = bed.add_body([shape.body], position=(*middle, start), friction=settings.friction)
    fall = start - surface + settings.depth
    along = direction_of(push.gamma)
    ways: list[tuple[np.ndarray, float]] = []
    if push.gamma > 0:
        ways.append((along, fall / -along[2]))
    else:
        # Edgewise: in the plane of a plate. Another body goes straight down.
        edge = np.array([0.0, 0.0, -1.0])
        if push.beta is not None:
            angle = math.radians(push.beta)
            edge = np.array([-math.cos(angle), 0.0, -math.sin(angle)])
        ways += [(edge, fall / -edge[2]), (along, settings.travel)]
    total, gone = sum(way for _, way in ways), 0.0
    for k, (heading, way) in enumerate(ways):
        bed.move_body(body, velocity=tuple((speed * heading).tolist()))
        steps, done, last = math.ceil(way / (speed * bed.time_step)), 0, k == len(ways) - 1
        for end in np.linspace(0, steps, SAMPLES + 1).round().astype(int)[1:]:
            if end == done:
                continue
            bed.advance(int(end) - done)
            moved = speed * bed.time_step * (int(end) - done)
            done, gone = int(end), gone + moved
            depth = surface - float(bed.body_position(body)[2]) + 0.5 * moved * heading[2]
            share = done / steps
            counts = last and (share > 0.5 if push.gamma == 0 else depth >= settings.shallow * settings.depth)
            yield (gone, depth, *map(float, bed.reaction(body)[0]), float(counts))
            tell(gone / total)


def _result(settings: BedPlatesSettings, runs: list[Json]) -> Json:
    surfaces = {push.name: _body_of(push, settings).pieces for push in pushes(settings)}
    friction = settings.friction if settings.friction is not None else material(runs[0]["material"]).friction
    return result_of(settings, runs, surfaces, friction)


run, resume = bed_test(
    "bed test plates", BedPlatesSettings, check=check, test=_test, result=_result,
    copies=lambda settings: len(pushes(settings)), bearing=lambda settings: BEARING,
)  # fmt: skip
