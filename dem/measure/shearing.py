"""A bed sheared under a lid: shear and normal stress, and how the bed dilates, against the lid's way.

The bed is periodic sideways, so it is sheared as one layer without ends. Lid and floor are planes with so much friction
and rolling friction that the grains on them neither slide nor roll: those are the rough walls of a shear box.
"""

import math
from dataclasses import dataclass

import numpy as np

from dem.engine.base import FLOOR
from dem.engine.core import BedCore
from dem.engine.values import BedFailure
from dem.grains.materials import Facing

from .lid import ROUGH, Lid, Tell, refuse_not_positive

__all__ = ["MOST_PRESSURE", "Shearing", "shear_bed"]

# Steps between two checks of the servo; over the time in which a grain falls the depth of the bed, how long it takes
# what is still missing into its speed: a bed that dilates steadily needs a lid that rises steadily.
_STEPS, _REMEMBERS = 20, 0.2
# A lid may press this many times what lies on the floor: more makes overlaps grow past their bound at the rough walls.
MOST_PRESSURE = 4.0


@dataclass(frozen=True)
class Shearing:
    """One shear run. All arrays of shape [n].

    Attributes:
        way: the lid's, sideways [m]. height: of the lid over where it was when the shearing began [m].
        shear, normal: what the grains push the lid with over the bed's area [Pa].
        pressure: asked for [Pa]. speed: of the lid [m/s]. inertial_number: speed / height d sqrt(density / pressure).
        packing_fraction: before the lid came. overburden: the bed's own weight over its area [Pa].
    """

    way: np.ndarray
    height: np.ndarray
    shear: np.ndarray
    normal: np.ndarray
    pressure: float
    speed: float
    inertial_number: float
    packing_fraction: float
    overburden: float


def shear_bed(
    bed: BedCore, *, pressure: float, way: float, inertial_number: float, grain: float, tell: Tell = lambda share: None
) -> Shearing:
    """Press a rough lid on a bed and move it sideways, the pressure held by a servo. The bed is used up by it.

    Args:
        pressure: on the lid [Pa]. way: of the lid [m]. grain: mean diameter [m].
        inertial_number: sets the speed [1]; below 1e-2 the strength hardly depends on it (GDR MiDi 2004).
        tell: called with the share done, 0 to 1.

    Raises ValueError: a pressure, a way or a number that is not positive. BedFailure: the pressure is not met, or the
    bed's own reasons.
    """
    refuse_not_positive(pressure=pressure, way=way, inertial_number=inertial_number)
    floor = bed.weight / (bed.size[0] * bed.size[1])
    if pressure > MOST_PRESSURE * floor * (1 + 1e-9):
        raise ValueError(
            f"pressure = {pressure:g} Pa is more than {MOST_PRESSURE:g} times what lies on the bed's floor, for which "
            f"its grains are too soft: give at most {MOST_PRESSURE * floor:.4g} Pa, or a deeper bed"
        )
    bed.set_facing(FLOOR, Facing(friction=ROUGH, rolling_friction=ROUGH))
    packing, area = bed.packing_fraction, bed.size[0] * bed.size[1]
    g = math.hypot(*bed.gravity)
    fall = math.sqrt(2 * bed.size[2] / g)
    notes: dict[str, float] = {}
    lid = Lid(bed, notes, grain=grain, fall_time=fall, drag_time=0.1 * fall, rough=True)
    body = int(notes["body"])
    while not notes["lifting"]:
        lid.piece(pressure, stay=True)
        tell(0.0)
    start = bed.body_position(body)
    height = float(start[2])
    speed = inertial_number * height / grain * math.sqrt(pressure / bed.material.density)
    servo, steady, rows = max(lid.speed, speed), 0.0, []
    while (gone := float(bed.body_position(body)[0] - start[0])) < way:
        bed.advance(_STEPS)
        force = bed.reaction(body)[0]
        missing = max(-1.0, min(1.0, (pressure * area - force[2]) / (pressure * area)))
        bed.move_body(body, velocity=(speed, 0.0, -servo * missing - steady))
        steady += servo * missing * _STEPS * bed.time_step / (_REMEMBERS * fall)
        rows.append((gone, float(bed.body_position(body)[2] - height), -force[0] / area, force[2] / area))
        if len(rows) % 20 == 0:
            tell(min(1.0, gone / way))
    if not rows:
        raise BedFailure("the lid did not move")
    gone_by, height_by, shear, normal = np.array(rows).T
    return Shearing(gone_by, height_by, shear, normal, pressure, speed, inertial_number, packing, floor)
