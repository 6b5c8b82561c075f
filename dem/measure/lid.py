"""A flat lid on the bed that a servo presses down to a pressure and lifts off again."""

import math
from typing import Any

from dem.engine.core import BedCore
from dem.engine.values import BedFailure
from dem.grains.sizes import Json
from dem.shapes.basic import Plane

__all__ = ["Lid"]

# Steps between two looks of the servo at the force; its fastest speed over sqrt(g d); and how long the pressure must
# hold, over the time that a grain takes to fall the bed's depth.
_STEPS, _SPEED, _HOLDS = 10, 0.1, 0.3
# The pressure is there when it is met within this share and the grains' energy is below so many m g d.
_NEAR, _CALM = 0.01, 1e-4
_LONGEST = 60.0


class Lid:
    """A lid over the whole bed. What it remembers is in ``notes``, so that its work can be kept between two pieces.

    The servo moves it down at a speed in proportion to the force that lacks, and at ``_SPEED`` sqrt(g d) at most.
    Grains do not stick to it: those that do would hang on it when it is lifted, and tear the bed open.
    """

    def __init__(self, bed: BedCore, notes: Json, *, grain: float, fall_time: float, drag_time: float):
        """``grain``: mean diameter [m]; ``drag_time``: of the drag in which the grains come to rest under it [s]."""
        self.bed, self.notes = bed, notes
        g = math.hypot(*bed.gravity)
        self.speed = _SPEED * math.sqrt(g * grain)
        self._fall_time, self._drag_time = fall_time, drag_time
        self._area = bed.size[0] * bed.size[1]
        if "body" not in notes:
            grains = bed.grains()
            top = float((grains.position[:, 2] + grains.radius).max())
            plane = Plane(normal=(0.0, 0.0, -1.0))
            body = bed.add_body([plane], position=(0.0, 0.0, top + 0.01 * grain), surface_energy=0.0)
            notes |= {"body": body, "began": bed.time, "held": 0.0, "lifting": 0.0}

    @property
    def _force(self) -> float:
        """What the grains push it up with [N]."""
        return float(self.bed.reaction(self.notes["body"])[0][2])

    def piece(self, pressure: float, energy: Any, *, stay: bool = False) -> bool:
        """One piece of the work; whether the lid has pressed and is off again.

        Args:
            stay: it stays on, pressing; ``notes["lifting"]`` says that the pressure is there.
            pressure: wanted [Pa].
            energy: a function that gives the grains' mean kinetic energy over m g d [1].

        Raises BedFailure: the pressure is not met in time.
        """
        bed, notes, target = self.bed, self.notes, pressure * self._area
        if stay and notes["lifting"]:
            return False
        for _ in range(20):
            if notes["lifting"]:
                bed.move_body(notes["body"], velocity=(0.0, 0.0, self.speed))
                bed.advance(_STEPS, drag_time=self._drag_time)
                if self._force == 0.0:
                    self._take_off()
                    return True
                continue
            bed.advance(_STEPS, drag_time=self._drag_time)
            lacking = (target - self._force) / target
            bed.move_body(notes["body"], velocity=(0.0, 0.0, -self.speed * max(-1.0, min(1.0, lacking))))
            calm = abs(lacking) < _NEAR and energy() < _CALM
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

    def _take_off(self) -> None:
        """Take the lid, which touches nothing any more, out of the bed; it is its last body."""
        bed = self.bed
        bed.engine.body_count[None] = self.notes["body"]
        bed.make_lists()
        bed.compute_forces()
        for key in ("body", "began", "held", "lifting"):
            del self.notes[key]
