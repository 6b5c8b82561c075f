"""Gravity that falls while a platform is being placed on grains: from the one it was set down under to the run's.

Grains without cohesion are the same problem under any gravity g, lengths in grains d, times in sqrt(d / g) and moduli
in rho g d: a bed that was set down under a larger g1 lies as it would under the small one, and is there sooner. Only
overlaps remember, as (g / E)^(2/3). They relax while g falls by a factor of e every `EFOLD` sqrt(d / g1). This begins
when the grains are calm, under a drag of time `DRAG` sqrt(d / g1). At rest the drag ends, and at rest without it the
placement ends. Rest means: with the present speeds and missing weight, platform and grains would move less than `NEAR`
d. The time for this is the shorter of sqrt(d / g) and the run's duration. docs/coupling.md says more.
"""

import math
from collections.abc import Sequence

import numpy as np

from rigid.platform.rig import STANDARD_GRAVITY

from .bed_ground import BedGround

__all__ = ["EFOLD", "NEAR", "LoweredGravity", "pace_under"]

EFOLD = 1.0  # Time of an e-fold of the gravity [sqrt(d / g1)]
LOOKS = 50  # Steps of the gravity in an e-fold: each makes new lists, and a large one shakes the bed
DRAG = 0.3  # Time of the drag meanwhile [sqrt(d / g1)]
NEAR = 0.01  # How far anything may still go [d]


def pace_under(gravity: float) -> float:
    """How many times slower all that falls is under `gravity` [m/s2] than on Earth: sqrt(g0 / gravity) [1]."""
    return math.sqrt(STANDARD_GRAVITY / gravity)


class LoweredGravity:
    """Of the grains of `ground`, from what it is to `last` [m/s2], for a run of `duration` [s].

    Raises ValueError where it is below `last` or grains sleep, who would keep the springs of the gravity before.
    """

    def __init__(self, ground: BedGround, *, last: float, duration: float) -> None:
        self.ground, self.last = ground, last
        self.first = ground.gravity
        if self.first < last:
            raise ValueError(f"settle_gravity is {self.first:g} m/s2: it must not be below that of the run, {last:g}")
        self.grain = ground.grain
        decay = EFOLD * math.sqrt(self.grain / self.first)
        self.steps = math.ceil(LOOKS * math.log(self.first / last))  # Of the gravity, from the first to the last
        self.every = decay / LOOKS  # Between two of them [s]
        self.sees = min(math.sqrt(self.grain / last), duration)  # For how long what moves is watched [s]
        self.begun: float | None = None  # Time at which it begins to fall [s]; None: not yet
        self.done = 0  # Steps that have been made
        self.dragged = False  # Whether the drag acts

    @property
    def at_last(self) -> bool:
        """Whether it is what the run has."""
        return self.begun is not None and self.done == self.steps

    @property
    def now(self) -> float:
        """Gravity [m/s2]."""
        if self.done == self.steps:
            return self.last
        return float(self.first * (self.last / self.first) ** (self.done / self.steps))

    @property
    def calm(self) -> bool:
        """Whether the grains, under the first gravity, would go less than NEAR d in sqrt(d / g1)."""
        return self.ground.grain_speed() * math.sqrt(self.grain / self.first) < NEAR * self.grain

    def begin(self, time: float) -> None:
        """It falls from here on, the drag acts."""
        self.begun = time
        self.drag(True)

    def drag(self, acts: bool) -> None:
        """Let the drag act, or no more."""
        self.dragged = acts
        self.ground.drag_time = DRAG * math.sqrt(self.grain / self.first) if acts else math.inf

    def fall(self, time: float) -> bool:
        """Lower gravity to its value at `time` [s]; return whether it has changed."""
        assert self.begun is not None
        due = min(self.steps, int((time - self.begun) / self.every))
        if due <= self.done:
            return False
        self.done = due
        self.ground.bed.set_gravity(self.now)
        return True

    def far(self, speeds: Sequence[float], missing: Sequence[float]) -> float:
        """How far what has these speeds [m/s] and misses these accelerations [m/s2] would go, over NEAR d [1]."""
        way = max(self.sees * max(speeds), 0.5 * self.sees**2 * max(missing))
        return float(way / (NEAR * self.grain))

    def numbers(self) -> np.ndarray:
        """What a checkpoint keeps."""
        return np.array([math.nan if self.begun is None else self.begun, self.done, self.dragged])

    def restore(self, numbers: np.ndarray) -> None:
        """Go back to what `numbers` gave; the bed's own gravity is in its state."""
        self.begun = None if math.isnan(numbers[0]) else float(numbers[0])
        self.done = int(numbers[1])
        self.drag(bool(numbers[2]))
