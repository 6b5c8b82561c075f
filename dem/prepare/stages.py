"""What stages are made of: falling, settling, loosening, tapping; kept between any two pieces of the work."""

import math
from typing import Generic

import numpy as np

from dem.engine.core import BedCore
from dem.engine.values import BedFailure, State
from dem.grains.sizes import Json

from .recipe import FLUFF
from .report import ENERGY_RATIO, FLOOR_RATIO, B

__all__ = ["Preparation", "lift_apart"]

# Time constant of the drag while settling, in the time that a grain takes to fall the bed's depth.
DRAG = 0.1
_LONGEST = 60.0  # settling gives up after this many fall times
_MOST_TAPS = 40
# A tap is this many g high, or, where one would overshoot, half as high again and again, but not below the last.
_TAP, _SOFTEST_TAP = 3.0, 0.2
# The packing asked for is reached from this much below, and not passed by more than that.
SHORT, PAST = 0.0005, 0.002
# Taps gain less and less (as the logarithm of their number): so many tell what the others can still bring; a bed that
# gains less than this in so many is called the densest that taps reach.
_TELLING_TAPS, _NOTHING_GAINED = 8, 0.002
# A fluffed bed sinks back at this share of sqrt(g d) at most.
_SINK = 0.1
# The energy of grains that sink is half the square of that; below this they have sunk [m g d a grain].
_SUNK = 1e-3
# It is stirred first: velocities at random, of this standard deviation over sqrt(g d), for the time in which a grain
# with that speed goes so many diameters. Without, it comes down in the order in which it was.
_STIR, _STIR_WAY = 1.0, 2.0


class Preparation(Generic[B]):
    """A bed on its way from a loose column in the air to one at rest, and what its stages are made of.

    What a stage remembers is in ``notes`` (plain values, as JSON takes them), so that a preparation that was kept goes
    on bitwise reproducibly.
    """

    def __init__(self, bed: B, *, grain: float):
        self.bed = bed
        self.notes: Json = {}
        self._grain = grain
        self._densest: State = {}  # state of the bed where taps had it densest

    def _pause(self, done: float) -> None:
        """Between two pieces of the work: report the share done of the stage, keep the work if it is time."""

    @property
    def _packing(self) -> float:
        """The packing fraction that stages bring to what is asked for [1]."""
        return self.bed.packing_fraction

    @property
    def _energy(self) -> float:
        """Mean kinetic energy of a grain over m g d [1]."""
        bed = self.bed
        return bed.kinetic_energy / bed.weight / self._grain

    @property
    def _fall_time(self) -> float:
        """The time that a grain takes to fall the bed's depth [s]."""
        return math.sqrt(2 * self.bed.size[2] / math.hypot(*self.bed.gravity))

    def _fall(self) -> None:
        """Advance until the rain is down: the grains' energy has passed its peak and is a tenth of m g d a grain."""
        bed, notes = self.bed, self.notes
        if not notes:
            top = bed.grains().position[:, 2].max()
            notes |= {"peak": 0.0, "fall": math.sqrt(2 * top / math.hypot(*bed.gravity))}
        fall = notes["fall"]
        steps = max(1, round(0.03 * fall / bed.time_step))
        while True:
            bed.advance(steps)
            energy = self._energy
            notes["peak"] = max(notes["peak"], energy)
            if energy < 0.1 and energy < 0.5 * notes["peak"]:
                return
            if bed.time > _LONGEST * fall:
                raise BedFailure(f"the rain was not down after {bed.time:.3g} s: energy {energy:.2g} m g d a grain")
            self._pause(min(1.0, bed.time / fall))

    def _settle(self, ratio: float, notes: Json, *, pausing: bool = True, longest: float | None = None) -> None:
        """Advance until the bed is at rest by ``ratio`` and the floor carries the weight; ``longest`` in fall times.

        Soft grains in a deep bed ring as one spring for long. So the grains settle as in a fluid until they are at
        rest; then, without it, they must still be.
        """
        bed, fall = self.bed, self._fall_time
        steps = max(1, round(0.05 * fall / bed.time_step))
        tolerance = FLOOR_RATIO if ratio == ENERGY_RATIO else 0.5
        if not notes:
            notes |= {"began": bed.time, "drag": 1.0, "first": 0.0}
        while True:
            bed.advance(steps, drag_time=DRAG * fall if notes["drag"] else math.inf)
            energy = self._energy
            floor = abs(bed.floor_force / (bed.weight * (-bed.gravity[2] / math.hypot(*bed.gravity))) - 1)
            notes["first"] = notes["first"] or math.log(max(energy / ratio, math.e))
            if energy < ratio and floor < tolerance:
                if not notes["drag"]:
                    return
                notes["drag"] = 0.0
            waited = bed.time - notes["began"]
            if waited > (_LONGEST if longest is None else longest) * fall:
                raise BedFailure(
                    f"the bed did not come to rest in {waited:.3g} s: energy {energy:.2g} m g d (below {ratio:g} "
                    f"was wanted), floor force off by {100 * floor:.2g} % of the weight"
                )
            if pausing:
                self._pause(1 - min(1.0, max(0.0, math.log(max(energy / ratio, 1.0)) / notes["first"])))

    def _reach(self, packing: float, notes: Json) -> None:
        """To a packing fraction from either side: loosened from below where the bed is denser, then tapped."""
        notes.setdefault("start", self._packing)
        if "fluff" in notes or (not notes.get("taps") and self._packing > packing + PAST):
            self._fluff(FLUFF, notes.setdefault("fluff", {}))
            if self._packing > packing + PAST:
                raise ValueError(
                    f"packing = {packing:g} cannot be reached: this material rains in at {notes['start']:.4f} and "
                    f"loosened from below still lies at {self._packing:.4f}; ask for that or more, or give the "
                    f"grains more friction, rolling friction or cohesion"
                )
            notes["fluffed"] = notes.pop("fluff")
        self._tap_to(packing, notes)

    def _fluff(self, times: float, notes: Json) -> None:
        """Lift the bed apart to ``times`` its height, as a flow through the floor does, and let it sink back slowly.

        It sinks in a drag in which grains fall at a tenth of sqrt(g d) at most, and must then be at rest without it.
        """
        bed, g = self.bed, math.hypot(*self.bed.gravity)
        drag = _SINK * math.sqrt(self._grain / g)
        if not notes:
            height = bed.surface
            lift_apart(bed, times, speed=_STIR * math.sqrt(g * self._grain), seed=bed.seed or 0)
            gravity, way = bed.gravity, _STIR_WAY * math.sqrt(self._grain / g) / _STIR
            bed.set_gravity(0.0)  # the flow carries them
            bed.advance(round(way / bed.time_step))
            bed.set_gravity(gravity)
            notes |= {"began": bed.time, "lasts": (times - 1) * height / (g * drag), "settle": {}}
        steps = max(1, round(0.02 * notes["lasts"] / bed.time_step))
        while not notes["settle"]:
            bed.advance(steps, drag_time=drag)
            share = (bed.time - notes["began"]) / notes["lasts"]
            if share > 1 and self._energy < _SUNK:
                break
            if share > _LONGEST:
                raise BedFailure(f"the loosened bed did not sink back in {bed.time - notes['began']:.3g} s")
            self._pause(min(1.0, share))
        self._settle(ENERGY_RATIO, notes["settle"])
        bed.measure_surface()

    def _tap_to(self, packing: float | None, notes: Json) -> None:
        """Tap the bed until its packing fraction is reached, or (None) until taps gain nothing more.

        The surface sinks meanwhile and stays nearly level. A tap is half a sine of acceleration of the bed's frame, 3 g
        high, as long as a grain falls for its diameter; one that goes too far is taken back and made half as high.
        With None the densest state remains. Taps of 3 g throw the bed up, and grains that stick may come down in looser
        lumps. From there they are tapped half as hard, and again, until that gains nothing either.
        """
        bed = self.bed
        if "taps" not in notes:
            notes |= {"taps": 0, "height": _TAP, "trace": [self._packing], "round": 0}
            self._densest = bed.state() if packing is None else {}
        trace = notes["trace"]
        while packing is None or self._packing < packing - SHORT:
            tapped = len(trace) - 1 - notes["round"]
            gained = trace[-1] - trace[-1 - _TELLING_TAPS] if tapped >= _TELLING_TAPS else math.inf
            if packing is None and (gained < _NOTHING_GAINED or notes["taps"] >= 2 * _MOST_TAPS):
                if self._packing < max(trace):
                    bed.restore(self._densest)
                softer = notes["height"] / 2
                if bed.material.cohesion == "none" or softer < _SOFTEST_TAP or notes["taps"] >= 2 * _MOST_TAPS:
                    self._densest = {}
                    return
                notes |= {"height": softer, "round": len(trace)}
                trace.append(self._packing)
            if packing is not None:
                self._refuse_dense(packing, gained / _TELLING_TAPS, notes)
            before = bed.state()
            self._tap_once(notes["height"])
            self._settle(ENERGY_RATIO, {}, pausing=False)
            bed.measure_surface()
            notes["taps"] += 1
            if packing is not None and self._packing > packing + PAST and notes["height"] > _SOFTEST_TAP:
                bed.restore(before)
                notes["height"] /= 2
            else:
                trace.append(self._packing)
                if packing is None and trace[-1] == max(trace):
                    self._densest = bed.state()
            way = (packing or 1.1 * trace[0]) - trace[0]
            self._pause(min(1.0, max(0.0, (self._packing - trace[0]) / max(1e-9, way))))

    def _refuse_dense(self, packing: float, rate: float, notes: Json) -> None:
        """Raise ValueError where the taps left cannot bring the packing: each gains less than those before."""
        left, found = _MOST_TAPS - notes["taps"], self._packing
        hoped = found + max(0.0, rate) * left + PAST
        if left > 0 and hoped >= packing:
            return
        more = f"; the {left} left would bring it to {hoped:.4f} at most" if left > 0 else ""
        raise ValueError(
            f"packing = {packing:g} cannot be reached: {notes['taps']} taps brought the bed from "
            f"{notes['trace'][0]:.4f} to {found:.4f}{more}; ask for less, or give the grains less friction"
        )

    def _tap_once(self, height: float) -> None:
        """One tap, so many g high [1]."""
        bed = self.bed
        g = -bed.gravity[2]
        length = math.sqrt(2 * self._grain / g)
        pieces = 10
        for k in range(pieces):
            bed.set_gravity((0.0, 0.0, -g * (1 - height * math.sin(math.pi * (k + 0.5) / pieces))))
            bed.advance(max(1, round(length / pieces / bed.time_step)))
        bed.set_gravity(g)


def lift_apart(bed: BedCore, times: float, *, speed: float, seed: int) -> None:
    """Put every grain at ``times`` its height, with random velocities of the standard deviation ``speed`` [m/s]."""
    e = bed.engine
    position, velocity, spin, order = (e.read(name) for name in ("position", "velocity", "spin", "id"))
    position[:, 2] *= times
    random = np.random.default_rng(seed).normal(0.0, speed, (len(order), 3))
    velocity[:, :3] = (random - random.mean(axis=0))[order]
    spin[:, :3] = 0
    for name, values in (("position", position), ("velocity", velocity), ("spin", spin)):
        e.write(name, values)
    bed.make_lists()
    bed.compute_forces()
    bed.shift_velocities(-0.5)
