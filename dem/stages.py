"""The stages of a bed's preparation, which can be kept between any two pieces of the work and gone on with later."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

from .bed import Bed, BedFailure

__all__ = ["ENERGY_RATIO", "FLOOR_RATIO", "Preparation"]

# Settled: mean kinetic energy of a grain over m g d, and floor force over weight.
ENERGY_RATIO, FLOOR_RATIO = 1e-5, 0.01
_ROUGH_ENERGY_RATIO = 1e-2
# Time constant of the drag while settling, in the time that a grain takes to fall the bed's depth.
_DRAG = 0.1
_LONGEST = 60.0  # settling gives up after this many fall times
_MOST_TAPS = 40
_KEEP_INTERVAL = 60.0  # between two times that it is kept [s of waiting]


class Preparation:
    """A bed on its way from a loose column in the air to one that is level and at rest.

    Its stages: ``rain`` until the grains are down; ``calm`` in a drag, then cut level; ``settle`` in the drag, at the
    end without; ``tap`` until a packing fraction is reached, where one is asked for. What a stage remembers is in
    ``notes``, so that a preparation that was kept goes on to the same bits.
    """

    def __init__(
        self, bed: Bed, *, grain: float, depth: float, packing: float | None, progress: Any, path: Path | None
    ):
        """``path``: where it is kept now and then (.npz, and .json beside it); None: nowhere."""
        self.bed = bed
        self.stage = "rain"
        self.notes: dict[str, float] = {}
        self._grain, self._depth, self._packing = grain, depth, packing
        self._progress = progress
        self._path = path
        self._kept = time.monotonic()

    def run(self) -> Bed:
        """Go on to the end; the bed. Raises BedFailure where it does not come to rest.

        A KeyboardInterrupt out of ``progress.update`` finds it between two pieces of the work: it is kept first.
        """
        work = {"rain": self._fall, "calm": self._calm, "settle": self._come_to_rest, "tap": self._tap}
        after = {"rain": "calm", "calm": "settle", "settle": "tap", "tap": "done"}
        while self.stage != "done":
            if self._progress is not None and self.stage != "calm" and (self.stage != "tap" or self._packing):
                self._progress.stage(self.stage, 1.0)
            work[self.stage]()
            self.stage, self.notes = after[self.stage], {}
        self.forget()
        return self.bed

    # ------------------------------------------------------------------ kept and found again

    def keep(self) -> None:
        """Write it down as it is."""
        if self._path is not None:
            self.bed.save(self._path)
            notes = {"stage": self.stage, "notes": self.notes, "steps": self.bed.steps}
            self._path.with_suffix(".json").write_text(json.dumps(notes))
            self._kept = time.monotonic()

    def find(self, **options: Any) -> None:
        """Go back to what was kept, if there is something whole; options are those of ``Bed.load``."""
        if self._path is None or not self._path.exists():
            return
        try:
            bed = Bed.load(self._path, **options)
            kept = json.loads(self._path.with_suffix(".json").read_text())
            if kept["steps"] != bed.steps:  # ended between the two files
                return
            stage, notes = str(kept["stage"]), {str(k): float(v) for k, v in kept["notes"].items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return
        self.bed, self.stage, self.notes = bed, stage, notes

    def forget(self) -> None:
        """Remove what was kept."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)
            self._path.with_suffix(".json").unlink(missing_ok=True)

    def _pause(self, done: float) -> None:
        """Between two pieces of the work: say how far it is, keep it if it is time."""
        try:
            if self._progress is not None:
                self._progress.update(done)
        except KeyboardInterrupt:
            self.keep()
            raise
        if time.monotonic() - self._kept >= _KEEP_INTERVAL:
            self.keep()

    # ------------------------------------------------------------------ the stages

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
            top = bed.grains()["position"][:, 2].max()
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

    def _calm(self) -> None:
        """Nearly at rest; then the grains whose centres lie above the level are taken away."""
        self._settle(_ROUGH_ENERGY_RATIO, self.notes)
        above = self.bed.grains()["position"][:, 2] > self._depth
        if above.any():
            self.bed = self.bed.without(above)

    def _come_to_rest(self) -> None:
        self._settle(ENERGY_RATIO, self.notes)
        self.bed.measure_surface()

    def _settle(self, ratio: float, notes: dict[str, float], *, pausing: bool = True) -> None:
        """Advance until the bed is at rest by ``ratio`` and the floor carries the weight.

        Soft grains in a deep bed ring as one spring for long. So the grains settle as in a fluid until they are at
        rest; then, without it, they must still be.
        """
        bed, fall = self.bed, self._fall_time
        steps = max(1, round(0.05 * fall / bed.time_step))
        tolerance = FLOOR_RATIO if ratio == ENERGY_RATIO else 0.5
        if not notes:
            notes |= {"began": bed.time, "drag": 1.0, "first": 0.0}
        while True:
            bed.advance(steps, drag_time=_DRAG * fall if notes["drag"] else math.inf)
            energy = self._energy
            floor = abs(bed.floor_force / bed.weight - 1)
            notes["first"] = notes["first"] or math.log(max(energy / ratio, math.e))
            if energy < ratio and floor < tolerance:
                if not notes["drag"]:
                    return
                notes["drag"] = 0.0
            waited = bed.time - notes["began"]
            if waited > _LONGEST * fall:
                raise BedFailure(
                    f"the bed did not come to rest in {waited:.3g} s: energy {energy:.2g} m g d (below {ratio:g} "
                    f"was wanted), floor force off by {100 * floor:.2g} % of the weight"
                )
            if pausing:
                self._pause(1 - min(1.0, max(0.0, math.log(max(energy / ratio, 1.0)) / notes["first"])))

    def _tap(self) -> None:
        """Tap the bed until its packing fraction is reached; its surface sinks meanwhile and stays nearly level.

        A tap is half a sine of acceleration of the bed's frame, 3 g high, as long as a grain falls for its diameter.
        """
        bed, notes, packing = self.bed, self.notes, self._packing
        if packing is None:
            return
        if not notes:
            notes |= {"start": bed.packing_fraction, "taps": 0.0}
            if bed.packing_fraction > packing + 0.002:
                raise ValueError(
                    f"packing = {packing} cannot be reached: this material rains in at {bed.packing_fraction:.4f} "
                    f"already, and tapping only makes it denser; ask for more, or give the grains more friction"
                )
        g = -bed.gravity[2]
        length = math.sqrt(2 * self._grain / g)
        pieces = 10
        while bed.packing_fraction < packing - 0.0005:
            if notes["taps"] == _MOST_TAPS:
                raise ValueError(
                    f"packing = {packing} cannot be reached: {_MOST_TAPS} taps brought the bed from "
                    f"{notes['start']:.4f} to {bed.packing_fraction:.4f}"
                )
            for k in range(pieces):
                bed.set_gravity((0.0, 0.0, -g * (1 - 3 * math.sin(math.pi * (k + 0.5) / pieces))))
                bed.advance(max(1, round(length / pieces / bed.time_step)))
            bed.set_gravity(g)
            self._settle(ENERGY_RATIO, {}, pausing=False)
            bed.measure_surface()
            notes["taps"] += 1
            self._pause(min(1.0, (bed.packing_fraction - notes["start"]) / max(1e-9, packing - notes["start"])))
