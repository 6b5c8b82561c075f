"""What tests of a bed share: walls on which grains do not slide, and a flat lid that a servo presses on the bed."""

import math
from collections.abc import Callable

from dem.engine.core import BedCore
from dem.engine.values import BedFailure
from dem.grains.materials import Facing
from dem.grains.sizes import Json
from dem.shapes.basic import Plane

__all__ = ["ROUGH", "Lid", "Tell", "add_lid", "refuse_not_positive", "refuse_tilted"]

Tell = Callable[[float], None]  # Called with the share done, 0 to 1
ROUGH = 10.0
"""Friction and rolling friction of a grain on a rough wall [1]: ten times what any grain has."""
# Steps between two checks of the servo; its fastest speed over sqrt(g d); and how long the pressure must
# hold, over the time that a grain takes to fall the bed's depth.
_STEPS, _SPEED, _HOLDS = 10, 0.1, 0.3
# The pressure is there when it is met within this share and the grains' energy is below so many m g d.
_NEAR, _CALM = 0.01, 1e-4
_LONGEST = 60.0


def refuse_not_positive(**values: float) -> None:
    """Raise ValueError for a number that is not positive and finite, with its name."""
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise ValueError(f"{name} = {value} must be positive")


def refuse_tilted(bed: BedCore) -> None:
    """Raise ValueError for a bed without gravity, or whose gravity is not straight down."""
    if bed.gravity[0] or bed.gravity[1] or not bed.gravity[2] < 0:
        raise ValueError(f"gravity = {bed.gravity} m/s2: a level bed under gravity is needed")


def add_lid(bed: BedCore, grain: float, facing: Facing) -> int:
    """Put a flat lid just above all grains, whose mean diameter is ``grain`` [m]; the number of the body."""
    grains = bed.grains()
    top = float((grains.position[:, 2] + grains.radius).max())
    return bed.add_body(Plane(normal=(0.0, 0.0, -1.0)), position=(0.0, 0.0, top + 0.01 * grain), **vars(facing))


class Lid:
    """A lid over the whole bed. Its state is in ``notes``, so that its work can be kept between two pieces.

    The servo moves it down at a speed in proportion to the missing force, and at ``_SPEED`` sqrt(g d) at most.
    Grains do not stick to it: those that do would hang on it when it is lifted, and tear the bed open.
    """

    def __init__(
        self, bed: BedCore, notes: Json, *, grain: float, fall_time: float, drag_time: float, rough: bool = False
    ):
        """A lid at its beginning, or where ``notes`` left it.

        Args:
            grain: mean diameter [m]. drag_time: of the drag in which the grains come to rest under it [s].
            fall_time: in which a grain falls the bed's depth [s].
            rough: whether grains neither slide nor roll on it; then they stick to it as to one another.
        """
        self.bed, self.notes = bed, notes
        self.speed = _SPEED * math.sqrt(math.hypot(*bed.gravity) * grain)
        self._grain, self._fall_time, self._drag_time = grain, fall_time, drag_time
        self._area = bed.size[0] * bed.size[1]
        if "body" not in notes:
            facing = Facing(friction=ROUGH, rolling_friction=ROUGH) if rough else Facing(surface_energy=0.0)
            notes |= {"body": add_lid(bed, grain, facing), "began": bed.time, "held": 0.0, "lifting": 0.0}

    @property
    def _force(self) -> float:
        """What the grains push it up with [N]."""
        return float(self.bed.reaction(self.notes["body"])[0][2])

    def piece(self, pressure: float, *, stay: bool = False) -> bool:
        """One piece of the work; whether the lid has pressed and is off again.

        Args:
            pressure: wanted [Pa].
            stay: it stays on, pressing; ``notes["lifting"]`` is then 1 once the pressure is there.

        Raises BedFailure: the pressure is not met in time.
        """
        bed, notes, target = self.bed, self.notes, pressure * self._area
        if stay and notes["lifting"]:
            return False
        for _ in range(20):
            if notes["lifting"]:
                bed.move_body(notes["body"], velocity=(0.0, 0.0, self.speed))
                bed.advance(_STEPS, drag_time=self._drag_time)
                if self._force != 0.0:
                    continue
                # It touches nothing any more: out of the bed with it, whose last body it is.
                bed.engine.body_count[None] = notes["body"]
                bed.make_lists()
                bed.compute_forces()
                for key in ("body", "began", "held", "lifting"):
                    del notes[key]
                return True
            bed.advance(_STEPS, drag_time=self._drag_time)
            missing = (target - self._force) / target
            bed.move_body(notes["body"], velocity=(0.0, 0.0, -self.speed * max(-1.0, min(1.0, missing))))
            calm = abs(missing) < _NEAR and bed.kinetic_energy / bed.weight / self._grain < _CALM
            notes["held"] = notes["held"] + _STEPS * bed.time_step if calm else 0.0
            if notes["held"] > _HOLDS * self._fall_time:
                bed.measure_surface()
                notes |= {"lifting": 1.0, "packing_under_it": bed.packing_fraction}
                if stay:
                    return False
        waited = bed.time - notes["began"]
        if waited > _LONGEST * self._fall_time:
            raise BedFailure(
                f"the lid did not come to its pressure of {pressure:.4g} Pa in {waited:.3g} s: {self._force:.3g} N, "
                f"{target:.3g} N wanted"
            )
        return False
