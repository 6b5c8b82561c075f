"""Vertical cut: how high a vertical face stands, by gravity that rises as in a centrifuge.

A strip is dug out of a bed at a fraction of its gravity; then gravity rises by steps until a face falls. A face of
height h that stands at n g is the model of one of n h at g (centrifuge modelling: stresses are alike where rho g h is;
Schofield 1980, Geotechnique 30:227). So one bed of some ten grains' depth finds critical heights from a tenth to four
times its own. Critical height and cohesion (Terzaghi 1943, a plane wedge without tension cracks):
    H_c = 4 c / gamma tan(45 + phi / 2),  gamma = rho_bulk g.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dem.engine.core import BedCore
from dem.engine.values import BedFailure

from .lid import Tell, refuse_tilted
from .repose import COLUMN, Flank, from_middle, measure_flanks, thickness_profile

__all__ = ["FALLEN_SHARE", "LEAST", "MOST", "VerticalCut", "check_width", "cohesion_of", "cut_and_load"]

LEAST, MOST = 0.1, 4.0
"""Gravities between which a face is tried if nothing else is given, over the bed's own [1]; the grains of a bed may be
too soft beyond (see ``dem.measure.shearing.MOST_PRESSURE``), which its overlaps show."""
STEP = math.sqrt(2.0)  # Gravity rises by this factor; where a face has fallen the middle is tried as well
# Slope of the wedge that is watched behind a face: tan(45 - 30/2 degrees), Rankine's for a friction angle of 30.
_WEDGE = math.tan(math.radians(30.0))
# It has fallen where this share of the wedge's grains have moved by more than so many diameters. Wedges of larger
# friction angles are steeper and smaller (0.46 of the one that is watched at 60 degrees), and their toe stays: faces of
# grains that stick slumped to where they stand again after 0.38 had moved at one gravity, where none had before.
FALLEN_SHARE, _FALLEN = 0.2, 1.0
# Gravity rises over one time in which a grain falls the bed's height, in so many pieces; then the face is watched for
# so many of them, and on until it is calm (energy of a wedge's grain in m g d), at most for so many.
_PIECES, _WATCH, _CALM, _LONGEST = 10, 2.0, 1e-3, 10.0
# At rest, and the drag in which it comes to rest, in fall times.
_REST, _DRAG, _GIVE_UP = 1e-5, 0.1, 60.0


@dataclass(frozen=True)
class VerticalCut:
    """What became of a face.

    Attributes:
        stood, fell: the largest gravity at which both faces stood and the least at which one fell, over the bed's own.
            0 where it never stood, None where it never fell.
        height: of the face [m]. unit_weight: bulk density times the bed's own gravity [N/m3].
        trials: gravity over the bed's own, and the share of the wedges' grains that had moved by a diameter, in order.
        before, after: thickness against distance from the cut's middle [m]: ``before`` is of the last standing faces
            (None where none stood). ``after`` is at rest at the bed's own gravity, when a face fell or stood to the
            end. Each is (x, thickness).
        flanks: fitted slopes of what it slumped to; None where it stood or they are too short.
        width: of the cut [m]. bed: as it lies now.
    """

    stood: float
    fell: float | None
    height: float
    unit_weight: float
    trials: list[tuple[float, float]]
    before: tuple[np.ndarray, np.ndarray] | None
    after: tuple[np.ndarray, np.ndarray]
    flanks: tuple[Flank, Flank] | None
    width: float
    bed: BedCore

    @property
    def critical_height(self) -> float | None:
        """At the bed's own gravity [m]: geometric middle of what stood and what fell; None where one of them is not."""
        return self.height * math.sqrt(self.stood * self.fell) if self.stood and self.fell else None

    @property
    def bounds(self) -> tuple[float, float]:
        """Heights between which the critical one lies [m]; infinite above where no face fell."""
        return self.height * self.stood, math.inf if self.fell is None else self.height * self.fell


def cohesion_of(height: float, unit_weight: float, friction_angle: float) -> float:
    """c = gamma H_c / 4 tan(45 + phi / 2) [Pa]; height [m], unit_weight [N/m3], friction_angle [degrees]."""
    return unit_weight * height / (4 * math.tan(math.radians(45 + 0.5 * friction_angle)))


def cut_and_load(
    bed: BedCore, *, width: float | None = None, most: float = MOST, tell: Tell = lambda share: None
) -> VerticalCut:
    """Cut a strip out about x = 0 at a tenth of the bed's gravity and let gravity rise until a face falls.

    Args:
        bed: level; used up by it. width: of the strip [m]; the bed's height when None.
        most: largest gravity that is tried, over the bed's own [1]; rounded to the nearest power of 1.41.
        tell: called with the estimated share done, 0 to 1.

    Raises ValueError: a tilted bed; a strip that leaves too little for two faces; a ``most`` that is not above
    ``LEAST``. BedFailure: the bed did not come to rest, or its own reasons.
    """
    grain = 2 * float(bed.grains().radius.mean())
    refuse_tilted(bed)
    if not LEAST < most < math.inf:
        raise ValueError(f"most = {most}: give a gravity above {LEAST:g} of the bed's own")
    check_width(width, width=bed.size[0], height=bed.surface, grain=grain)
    width = bed.surface if width is None else width
    own, height, packing = -bed.gravity[2], bed.surface, bed.packing_fraction
    weight = packing * bed.material.density * own
    _ramp(bed, LEAST * own, height)
    _rest(bed, grain, height)
    bed = bed.without(np.abs(from_middle(bed.grains().position[:, 0], bed.size[0])) < 0.5 * width)
    watched, places = _wedges(bed, width, height)
    period = np.array(bed.size[:2])

    def moved() -> float:
        """Share of the grains of the wedge that moved more which have gone farther than a diameter."""
        way = bed.grains().position - places
        way[:, :2] -= period * np.round(way[:, :2] / period)
        far = np.linalg.norm(way, axis=1) > _FALLEN * grain
        return float(max(far[inside].mean() for inside in watched))

    def stands(level: float) -> bool:
        """Whether the faces stand at this gravity, over the bed's own."""
        trials.append((level, _watch(bed, level * own, height, grain, watched, moved)))
        return trials[-1][1] <= FALLEN_SHARE

    def profile() -> tuple[np.ndarray, np.ndarray]:
        return thickness_profile(bed, packing=packing, width=COLUMN * grain)

    trials: list[tuple[float, float]] = []
    stood, fell, before, kept = 0.0, None, None, bed.state()
    levels = [LEAST * STEP**k for k in range(round(math.log(most / LEAST, STEP)) + 1)]
    for k, level in enumerate(levels):
        standing = stands(level)
        tell(0.8 * (k + 1) / len(levels))
        if not standing:
            fell = level
            break
        stood, kept, before = level, bed.state(), profile()
    if fell is not None and stood:
        bed.set_gravity(stood * own)
        bed.restore(kept)
        middle = math.sqrt(stood * fell)
        if stands(middle):
            stood, before = middle, profile()
            _watch(bed, fell * own, height, grain, watched, moved)
        else:
            fell = middle
    _ramp(bed, own, height)
    _rest(bed, grain, height)
    after = profile()
    flanks = None
    if fell is not None:
        flanks = measure_flanks(*after, start=0.0, end=0.5 * bed.size[0], period=bed.size[0], grain=grain)
    tell(1.0)
    return VerticalCut(stood, fell, height, weight, trials, before, after, flanks, width, bed)


def check_width(cut: float | None, *, width: float, height: float, grain: float) -> None:
    """Raise ValueError for a cut that does not fit a bed of this width in x and height [m]; None: as wide as high."""
    cut = height if cut is None else cut
    most = width - 2 * (_WEDGE * height + 3 * grain)
    if not 2 * grain <= cut <= most:
        remedy = f"give a bed {width + 2 * grain - most:.4g} m wide, and a cut of at least"
        if most >= 2 * grain:
            remedy = f"give at most {most:.4g} m and at least"
        raise ValueError(
            f"width = {cut:.4g} m of the cut: two wedges and three grains beside each must be left; {remedy} two "
            f"grains, {2 * grain:.4g} m"
        )


def _wedges(bed: BedCore, width: float, height: float) -> tuple[list[np.ndarray], np.ndarray]:
    """The grains in front of Rankine's plane behind each face (masks by id), and where all grains are [m]."""
    position = bed.grains().position
    x = from_middle(position[:, 0], bed.size[0])
    reach = 0.5 * width + _WEDGE * np.maximum(0.0, np.minimum(position[:, 2], height))
    return [(sign * x > 0) & (np.abs(x) < reach) for sign in (1.0, -1.0)], position


def _fall_time(bed: BedCore, height: float) -> float:
    return math.sqrt(2 * height / math.hypot(*bed.gravity))


def _ramp(bed: BedCore, gravity: float, height: float) -> None:
    """Bring gravity to a value [m/s2] over one fall time, in equal shares."""
    first = -bed.gravity[2]
    for k in range(1, _PIECES + 1):
        bed.set_gravity(first * (gravity / first) ** (k / _PIECES))
        bed.advance(max(1, round(_fall_time(bed, height) / _PIECES / bed.time_step)))


def _rest(bed: BedCore, grain: float, height: float) -> None:
    fall, drag, waited = _fall_time(bed, height), True, 0.0
    steps = max(1, round(0.1 * fall / bed.time_step))
    while True:
        bed.advance(steps, drag_time=_DRAG * fall if drag else math.inf)
        waited += steps * bed.time_step
        energy = bed.kinetic_energy / bed.weight / grain
        if energy < _REST:
            if not drag:
                return
            drag = False
        if waited > _GIVE_UP * fall:
            raise BedFailure(
                f"the bed did not come to rest in {waited:.3g} s: energy {energy:.2g} m g d a grain, {_REST:g} was "
                f"wanted"
            )


def _watch(
    bed: BedCore, gravity: float, height: float, grain: float, watched: list[np.ndarray], moved: Callable[[], float]
) -> float:
    """Bring gravity to a value and watch the faces: the share of ``moved`` at the end."""
    _ramp(bed, gravity, height)
    fall = _fall_time(bed, height)
    steps, waited = max(1, round(0.25 * fall / bed.time_step)), 0.0
    while True:
        bed.advance(steps)
        waited += steps * bed.time_step / fall
        share = moved()
        if share > FALLEN_SHARE or waited > _LONGEST:
            return share
        g = bed.grains()
        speed = (g.velocity**2).sum(axis=1)
        if waited > _WATCH and max(float(speed[inside].mean()) for inside in watched) < 2 * _CALM * gravity * grain:
            return share
