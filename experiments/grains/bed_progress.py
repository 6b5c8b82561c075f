"""Progress of the preparation of a bed within the experiment that needs it."""

import time
from collections.abc import Callable

from coupling.lammps import LammpsBed
from dem import Bed
from experiments.runs.pace import runtime_name
from experiments.runs.progress import Progress, as_expected

__all__ = ["BedProgress", "Stages", "show_bed"]

_SHARES = {"rain": 0.30, "calm": 0.12, "settle": 0.32, "rest": 0.26}  # Of the time, on 20,000 grains
_STEPS = {"rain": 0.60, "calm": 0.13, "settle": 0.14, "rest": 0.13}
"""Of the steps: of the time on a busy machine, where a step takes the same time however few grains touch (4,000)."""
_EARLY, _LONG = 0.12, 10.0  # Share of the fall [1] and its time [s] from which on it shows whether the denser is slower
_TAPPED = 0.1  # What all of that is where the bed is tapped to a packing fraction: 15 taps took ten times as long [1]
_DOWN = 0.82  # Share of the fall at which the grains are down: what lies is 1 / 2.5 as high as what fell [1]
_CALM, _REST = 4, 14  # Updates of a bed until it is cut level, and while it rests without drag: 2 to 30 were seen


def show_bed(progress: Progress, bed: Bed | LammpsBed) -> None:
    """Show the number of grains, of grains awake and slow, and of grain-steps done."""
    sleeper = bed.sleeper if isinstance(bed, Bed) else None
    progress.show_grains(
        grain_count=bed.grain_count, awake_count=bed.awake_count, grain_steps=bed.grain_steps,
        slow_count=0 if sleeper is None else sleeper.awake - sleeper.fast,
        runtime=runtime_name(arch=bed.runtime.arch, threads=bed.runtime.threads) if isinstance(bed, Bed) else "",
    )  # fmt: skip


class Stages:
    """Shows the stages of a preparation; stops it where it can be continued."""

    def __init__(self, progress: Progress, asked_to_stop: Callable[[], bool]) -> None:
        self.progress, self.asked_to_stop = progress, asked_to_stop

    def stage(self, name: str, total: float | None = None) -> None:
        """The next stage begins."""
        self.progress.stage(name, total=total)

    def show_bed(self, bed: Bed) -> None:
        """Show the present bed; `dem.prepare` calls this before each `update`."""
        show_bed(self.progress, bed)

    def update(self, done: float) -> None:
        """`done` of it, 0 to 1. Raises KeyboardInterrupt if asked to stop."""
        self.progress.update(done)
        if self.asked_to_stop():
            raise KeyboardInterrupt


class BedProgress(Stages):
    """Shows the stages of a preparation as one stage of the experiment; stops it where it can be continued.

    A preparation reports how far the grains have fallen and how slow they are; here that becomes time. `tapped`:
    whether a packing fraction is to be reached.
    """

    def __init__(
        self,
        progress: Progress,
        name: str,
        asked_to_stop: Callable[[], bool],
        *,
        tapped: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(progress, asked_to_stop)
        self._clock, self._fallen = clock, list[tuple[float, float]]()  # when the grains had fallen so far
        self._power = 2.0  # Of the fall, with which its time goes: the denser, the slower
        self._part, self._count, self._last = "rain", 0, 0.0
        self._scale = _TAPPED if tapped else 1.0
        progress.stage(name, total=1.0)

    def stage(self, name: str, total: float | None = None) -> None:
        """The next part begins; a stage without a part of its own, such as loosening, belongs to the present one."""
        if name in (*_SHARES, "tap"):
            self._enter(name)

    def update(self, done: float) -> None:
        """`done` of this part, 0 to 1. Raises KeyboardInterrupt if asked to stop."""
        # Grains that fall tell so in small steps. They are calmed before they are cut level, and rest without drag
        # once they are still: neither is announced.
        if self._part == "rain" and self._count and not 0 <= done - self._last <= 0.1:
            self._enter("calm")
        elif self._part == "settle" and done >= 1:
            self._enter("rest")
        elif self._part == "rain":
            self._look_at_fall(done)
        self._last, self._count = done, self._count + 1
        super().update(self._share(done))

    def _enter(self, part: str) -> None:
        self._part, self._count, self._last = part, 0, 0.0

    def _look_at_fall(self, done: float) -> None:
        """Take from the time of the fall so far whether it goes with its square, or in proportion as on a busy machine.

        The time to half of `done` stands to that to all of it as the powers of both do.
        """
        self._fallen.append((done, self._clock()))
        if done < _EARLY:
            return
        (first, began), now = self._fallen[0], self._fallen[-1][1]
        half, then = min(self._fallen, key=lambda one: abs(one[0] - 0.5 * done))
        if first < half < done and began < then < now and now - began >= _LONG:
            self._power = _power_of(first, half, done, (now - began) / (then - began))

    def _share(self, done: float) -> float:
        """Of the time of the whole preparation."""
        if self._part == "tap":
            return self._scale + (1.0 - self._scale) * done
        parts, even = list(_SHARES), 2.0 - self._power  # 1: each step takes the same time
        shares = {part: (1.0 - even) * _SHARES[part] + even * _STEPS[part] for part in parts}
        before = sum(shares[part] for part in parts[: parts.index(self._part)])
        within = {
            "rain": as_expected((done / _DOWN) ** self._power),
            "calm": as_expected(self._count / _CALM),
            "settle": done**2,  # the logarithm of the energy falls ever more slowly
            "rest": as_expected(self._count / _REST),
        }[self._part]
        return self._scale * (before + shares[self._part] * within)


def _power_of(first: float, half: float, done: float, ratio: float) -> float:
    """The power p, 1 to 2, of which (done^p - first^p) / (half^p - first^p) is `ratio`."""
    low, high = 1.0, 2.0
    for _ in range(8):
        power = 0.5 * (low + high)
        below = (done**power - first**power) / (half**power - first**power) < ratio
        low, high = (power, high) if below else (low, power)
    return 0.5 * (low + high)
