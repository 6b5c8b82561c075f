"""Angle of repose: the bed is set on a plate with a slot, drains through it, and the slope that stays is measured.

This is the drained angle of repose, of the material at rest above an outlet (Brown & Richards 1970, Principles of
Powder Mechanics). Zhou and others (2001, Phys. Rev. E 64:021301) measured it in a bed over side outlets. The slot runs
along y, where the bed is periodic: the slopes on its two sides have no side walls. Grains that fall through the slot
lie in a pit below, so that no foot runs out. The plate is rough, so that the slope is that of the material and not of
the plate.
"""

import math
from dataclasses import dataclass

import numpy as np

from dem.engine.core import BedCore
from dem.engine.values import BedFailure
from dem.grains.packing import packing_profile
from dem.shapes.solids import Box

from .lid import ROUGH, Tell, refuse_tilted

__all__ = ["Flank", "Repose", "angle_of_repose", "check_width", "fit_flank", "measure_flanks", "thickness_profile"]

SLOT = 6.0  # Width of the slot [mean diameters], wide enough that grains do not bridge it
LEAST_FLANK = 10.0  # Least width of bed on each side of the slot [mean diameters]
# A slope is fitted between these shares of its crest's height, and above so many mean diameters: foot and crest are
# left out. The lowest layers hold to a rough plate: five layers of sand stand at 45 degrees on it.
_FOOT, _CREST, _LAYERS = 0.2, 0.8, 3.0
COLUMN = 0.5  # Width of the columns of a profile [mean diameters]
_LEAST_POINTS = 6  # of them on a slope
# At rest: kinetic energy of a grain in m g d, and nothing has drained for so many times in which a grain falls the
# bed's height. It gives up after so many.
_CALM, _QUIET, _LONGEST = 1e-5, 2.0, 80.0
# Of the plate [mean diameters]; and of the pit below it, over the bed's height: what drains lies there in a heap.
_PLATE, _PIT, _LEAST_PIT = 2.0, 1.5, 0.8
_FULL = 3.0  # A pit is full whose heap ends less than so many mean diameters below the plate


@dataclass(frozen=True)
class Flank:
    """One fitted slope.

    Attributes:
        angle, error: from the horizontal, and its standard error [degrees].
        start, end: of the fitted stretch, from where the flank begins [m]. points: of the profile on it.
        foot: where the straight line meets the floor [m].
    """

    angle: float
    error: float
    start: float
    end: float
    points: int
    foot: float


@dataclass(frozen=True)
class Repose:
    """What the slot left.

    Attributes:
        angle, error: mean of both flanks, and its standard error, of the fits and of how the flanks differ [degrees].
        flanks: towards +x and towards -x of the slot.
        distance: of the profile's points from the slot's middle, along +x [m], shape [n].
        thickness: of the bed there, at its packing fraction before the slot was opened [m], shape [n].
        height: of the bed before [m]. crest: largest thickness left, mean of three points [m].
        drained: grains that fell out. slot: its width [m].
        plate: height of its upper face in the bed as it lies now [m].
        bed: as it lies now, what drained in the pit below the plate.
    """

    angle: float
    error: float
    flanks: tuple[Flank, Flank]
    distance: np.ndarray
    thickness: np.ndarray
    height: float
    crest: float
    drained: int
    slot: float
    plate: float
    bed: BedCore


def angle_of_repose(
    bed: BedCore, *, slot: float | None = None, rough: bool = True, tell: Tell = lambda share: None
) -> Repose:
    """Drain a level bed through a slot about x = 0 and measure the slopes that stay. The bed is used up by it.

    All grains are lifted with the contacts among them, onto a plate that has the slot.

    Args:
        bed: level. Its width in x should hold both slopes: 4 h + slot for a height h and slopes of 25 degrees.
        slot: width [m]; six mean diameters when None.
        rough: whether grains neither slide nor roll on the plate; else they do as on one another.
        tell: called with the estimated share done, 0 to 1.

    Raises ValueError: a tilted bed, a slot narrower than three diameters, a bed too narrow for two slopes. BedFailure:
    it did not come to rest, or what stays is too short to have a slope.
    """
    grain = 2 * float(bed.grains().radius.mean())
    slot = SLOT * grain if slot is None else slot
    refuse_tilted(bed)
    if not 3 * grain <= slot < math.inf:
        raise ValueError(f"slot = {slot:g} m is narrower than three grains, {3 * grain:.4g} m: grains would bridge it")
    check_width(bed.size[0], slot=slot, grain=grain, depth=bed.surface)
    height, packing = bed.surface, bed.packing_fraction
    plate = _set_on_plate(bed, grain, slot, rough=rough)
    drained = _drain(bed, grain, slot, plate, height, tell)
    distance, thickness = thickness_profile(bed, packing=packing, width=COLUMN * grain, above=plate)
    flanks = measure_flanks(
        distance, thickness, start=0.5 * slot, end=0.5 * bed.size[0], period=bed.size[0], grain=grain
    )
    if flanks is None:
        raise BedFailure(
            f"of {bed.grain_count} grains {drained} drained, and what stays has no slope of "
            f"{COLUMN * _LEAST_POINTS:g} diameters between {_LAYERS:g} above the plate and four fifths of its crest, "
            f"{_crest(thickness) / grain:.3g} diameters: a wider or a deeper bed is needed"
        )
    one, other = flanks
    return Repose(
        angle=0.5 * (one.angle + other.angle),
        error=0.5 * math.sqrt(one.error**2 + other.error**2 + (one.angle - other.angle) ** 2),
        flanks=flanks,
        distance=distance,
        thickness=thickness,
        height=height,
        crest=_crest(thickness),
        drained=drained,
        slot=slot,
        plate=plate,
        bed=bed,
    )


def check_width(width: float, *, slot: float | None, grain: float, depth: float) -> None:
    """Raise ValueError for a bed too narrow in x [m] for two slopes beside a slot [m], six mean diameters when None."""
    slot = SLOT * grain if slot is None else slot
    least = slot + 2 * LEAST_FLANK * grain
    if width < least:
        raise ValueError(
            f"size: x = {width:g} m is too narrow for a slot of {slot:.4g} m and two slopes: give at least "
            f"{least:.4g} m; slopes of 25 degrees over all of the depth need {slot + 4.3 * depth:.3g} m"
        )


def _set_on_plate(bed: BedCore, grain: float, slot: float, *, rough: bool) -> float:
    """Lift the bed onto a plate with a slot about x = 0: the height of the plate's upper face [m]."""
    e = bed.engine
    position = e.read("position")
    top = float((position[:, 2] + position[:, 3]).max())
    room = bed.settings.height - top - 2 * grain
    plate = min(_PIT * bed.surface + _PLATE * grain, room)
    if plate < _LEAST_PIT * bed.surface + _PLATE * grain:
        raise ValueError(
            f"the bed's box ends {room:.4g} m above the bed: a pit for what drains needs "
            f"{_LEAST_PIT * bed.surface + _PLATE * grain:.4g} m at least; give the bed more height"
        )
    for name, values in (("position", position), ("origin", e.read("origin"))):
        values[:, 2] += plate
        e.write(name, values)
    bed.make_lists()
    bed.compute_forces()
    length, width = bed.size[0] - slot, bed.size[1] + 2 * grain
    rub = ROUGH if rough else None
    bed.add_body(
        [Box(size=(length, width, _PLATE * grain))],
        position=(0.5 * bed.size[0], 0.5 * bed.size[1], plate - 0.5 * _PLATE * grain),
        friction=rub,
        rolling_friction=rub,
    )
    return plate


def _drain(bed: BedCore, grain: float, slot: float, plate: float, height: float, tell: Tell) -> int:
    """Wait until nothing drains and nothing moves: how many grains lie below the plate."""
    fall = math.sqrt(2 * height / -bed.gravity[2])
    steps = max(1, round(0.5 * fall / bed.time_step))
    time = quiet = 0.0
    drained = 0
    while True:
        bed.advance(steps)
        time += steps * bed.time_step
        z = bed.grains().position[:, 2]
        before, drained = drained, int((z < plate).sum())
        quiet = quiet + steps * bed.time_step if drained == before else 0.0
        energy = bed.kinetic_energy / bed.weight / grain
        if quiet > _QUIET * fall and energy < _CALM:
            break
        if time > _LONGEST * fall:
            raise BedFailure(
                f"the slope did not come to rest in {time:.3g} s: energy {energy:.2g} m g d a grain, {_CALM:g} was "
                f"wanted, {drained} grains drained"
            )
        tell(min(0.99, time / (12 * fall)))
    _refuse_blocked(bed, grain, slot, plate, drained)
    return drained


def _refuse_blocked(bed: BedCore, grain: float, slot: float, plate: float, drained: int) -> None:
    """Raise BedFailure where grains are still in the slot: on the heap of a full pit, or as a bridge above a gap."""
    grains = bed.grains()
    x, _, z = grains.position.T
    over, bottom = np.abs(from_middle(x, bed.size[0])) < 0.5 * slot - grain, plate - _PLATE * grain
    if not (over & (z > bottom)).any():
        return
    heap = z[over & (z < bottom)]
    top = float(heap.max()) if len(heap) else 0.0
    if top > bottom - _FULL * grain:
        raise BedFailure(
            f"the pit below the plate, {bottom:.3g} m deep, is full of the {drained} grains that drained: the slope "
            f"cannot end; a shallower or a narrower bed"
        )
    raise BedFailure(
        f"grains bridge the slot of {slot:.3g} m ({slot / grain:.2g} diameters): {drained} of {bed.grain_count} "
        f"drained, and the pit is not full; slot = {1.5 * slot:.2g} m, or grains of lower friction"
    )


def from_middle(x: np.ndarray, period: float) -> np.ndarray:
    """The same places within half a period of x = 0 [m]."""
    return np.mod(x + 0.5 * period, period) - 0.5 * period


def thickness_profile(
    bed: BedCore, *, packing: float, width: float, above: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """How thick the bed lies against x: solid volume of a column over its area and a packing fraction.

    Args:
        packing: of the bed in bulk [1]. width: of a column in x [m], about.
        above: grains that lie lower do not count [m].

    Returns:
        x of the columns' middles, within half the bed's width of x = 0, and thickness [m], each of shape [n].
    """
    grains = bed.grains()
    counts = grains.position[:, 2] > above
    x, radius, period = grains.position[counts, 0], grains.radius[counts], bed.size[0]
    x = from_middle(x, period)
    edges = np.linspace(-0.5 * period, 0.5 * period, round(period / width) + 1)
    around = np.concatenate([x - period, x, x + period])
    share = packing_profile(around, np.tile(radius, 3), bed.size[1], edges)
    return 0.5 * (edges[1:] + edges[:-1]), share / packing


def measure_flanks(
    distance: np.ndarray, thickness: np.ndarray, *, start: float, end: float, period: float, grain: float
) -> tuple[Flank, Flank] | None:
    """Both flanks of a profile about x = 0, fitted as ``fit_flank`` does; None where one is too short.

    Args:
        distance, thickness: of ``thickness_profile``. start, end: of a flank, from x = 0 [m]. period: of the bed [m].
        grain: mean diameter [m].
    """
    fitted = []
    crest = _crest(thickness)
    for sign in (1.0, -1.0):
        along = np.mod(sign * distance, period)
        order = np.argsort(along)
        inside = (along[order] > start) & (along[order] < end)
        flank = fit_flank(along[order][inside] - start, thickness[order][inside], crest=crest, least=_LAYERS * grain)
        if flank is None:
            return None
        fitted.append(flank)
    return fitted[0], fitted[1]


def fit_flank(distance: np.ndarray, thickness: np.ndarray, *, crest: float, least: float = 0.0) -> Flank | None:
    """A straight line by least squares where the thickness is above ``least`` and a fifth of ``crest``, to four fifths.

    The stretch ends where the profile first passes four fifths and begins behind the last point before that which lies
    lower. None where it has fewer than six points.
    """
    above = np.flatnonzero(thickness > _CREST * crest)
    last = int(above[0]) if len(above) else len(thickness)
    below = np.flatnonzero(thickness[:last] < max(least, _FOOT * crest))
    first = int(below[-1]) + 1 if len(below) else 0
    x, y = distance[first:last], thickness[first:last]
    if len(x) < _LEAST_POINTS:
        return None
    slope, start = np.polyfit(x, y, 1)
    rest = y - start - slope * x
    error = math.sqrt(float(rest @ rest) / (len(x) - 2) / float(((x - x.mean()) ** 2).sum()))
    to_degrees = math.degrees(1.0) / (1 + slope**2)
    return Flank(
        angle=math.degrees(math.atan(slope)),
        error=error * to_degrees,
        start=float(x[0]),
        end=float(x[-1]),
        points=len(x),
        foot=float(-start / slope) if slope else math.nan,
    )


def _crest(thickness: np.ndarray) -> float:
    """Largest mean of three neighbouring points, around the period [m]."""
    return float(((thickness + np.roll(thickness, 1) + np.roll(thickness, -1)) / 3).max())
