"""Steps and events of `rigid.spatial.spatial`: what changes the modes, when, and into which.

Events are detected at the end of each step and located by repeating it. So the state at an event has the step's own
accuracy. Events at one moment are taken together. Two things could make it crawl, and both are counted, not hidden:
- More than `CROWD` events within a microsecond: a step of `FORCED` is made in the present modes, which are then set
  anew from the state (`forced_steps`).
- A driven slip that is almost zero turns its direction ever faster. It never passes through 0 as it does in the plane.
  Where steps fall below `STALL`, tips slower than `SLOW` are made to stick (`stalls`). Those that the static bound lets
  go start against the force that held them, and keep that direction until they are faster.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import RK45

from rigid.checks.unfit import UnfitSettingsError
from rigid.platform.actuation import TorqueHistory

from .motion import FRICTION_WORK, GROUND_WORK, TORQUE_WORK, H, L, Modes, Motion, P, Q, R

__all__ = ["Integration"]

Array = NDArray[np.float64]
LONGEST = 2e-2  # step in flight [s]
LONGEST_TOUCHING = 1e-2
SHORTEST = 1e-9  # below it the step no longer adapts [s]
CROWD, MOMENT, FORCED = 40, 1e-6, 1e-5
STALL, SLOW = 5e-5, 1e-3  # [s], and share of sqrt(g reach)
STILL = 1e-9  # a slip below this share of sqrt(g reach) is none
_A, _B, _C, _E = (np.asarray(getattr(RK45, name)) for name in ("A", "B", "C", "E"))


class Integration:
    """One motion under way: state `z` at `time` in `modes`; `advance` goes on to a time, never past it."""

    def __init__(
        self,
        motion: Motion,
        histories: Sequence[TorqueHistory | None],
        torque_in_flight: bool,
        z: Array,
        *,
        tolerance: float,
        time_step: float | None,
    ) -> None:
        self.motion, self.histories, self.in_flight = motion, histories, torque_in_flight
        self.z, self.time, self.tolerance, self.fixed = z.copy(), 0.0, tolerance, time_step
        self.modes = Modes()
        self.changes = sorted({t for history in histories if history for t in history.times})
        self.spent = [False] * 3  # a wheel at its end does not start again
        platform = motion.platform
        pull = float(np.linalg.norm(motion.weight)) / float(motion.masses[2])
        self.speed = max(math.sqrt(pull * platform.reach), float(np.linalg.norm(z[P])) / platform.mass, 1e-6)
        self.step = time_step or 1e-4
        self.events = self.forced_steps = self.stalls = 0
        self.crowd, self.since = 0, -math.inf
        self.transitions: list[tuple[float, int, int]] = []
        depths = motion.depths(z)
        for k in np.flatnonzero(depths > 0):
            self._touch(int(k))
        self._resolve([k for k in self.modes.touching if self._stands_still(k, STILL)])
        self.stored_0 = motion.energy(self.z, self.modes)[2]
        self._note_change()
        self.scale = self._scale()

    def advance(self, until: float) -> None:
        """One step, which ends at `until` [s] at the latest."""
        ends = min([until, *(t for t in self.changes if t > self.time)])
        room = ends - self.time
        if self._rests():
            self.time = ends
            self._change_torques()
            return
        longest = LONGEST_TOUCHING if self.modes.touching else LONGEST
        h = min(self.fixed if self.fixed else min(self.step, longest), room)
        if room - h < 1e-3 * h:
            h = room
        first = self.motion.rates(self.z, self.modes)
        while True:
            z, error = self._attempt(first, h)
            if not math.isfinite(error):
                if h < 1e-12:
                    raise UnfitSettingsError(f"the motion is no longer finite at t = {self.time:.6g} s")
                h *= 0.1
            elif error > 1 and h > SHORTEST and not self.fixed:
                h *= max(0.2, 0.9 * error**-0.2)
            else:
                break
        grown = h * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        found: list[tuple[str, int]] = []
        forced = self.crowd >= CROWD and self.time - self.since <= MOMENT
        if forced:
            h = min(h, FORCED)
            z = self._attempt(first, h)[0]
            self.crowd, self.forced_steps = 0, self.forced_steps + 1
        else:
            h, z, found = self._locate(first, h, z)
        self.time = ends if h >= room else self.time + h
        self.z = z
        self.z[Q] /= np.linalg.norm(self.z[Q])
        self._forget()
        if found:
            self.events += len(found)
            self.crowd, self.since = (
                (self.crowd + 1, self.since) if self.time - self.since <= MOMENT else (1, self.time)
            )
        if forced:
            self._set_anew()
        elif found:
            self._switch(found)
        else:
            self._keep_still(stalled=h < STALL and h < room and not self.fixed)
        if self.time == ends:
            self._change_torques()
        self.step = grown if not found else min(max(grown, 1e-4), 1e-3)

    def _attempt(self, first: Array, h: float) -> tuple[Array, float]:
        rates = [first]
        for stage in range(1, 6):
            ahead = self.z + h * (_A[stage, :stage] @ np.array(rates))
            rates.append(self.motion.rates(ahead, self.modes))
        end = self.z + h * (_B @ np.array(rates))
        rates.append(self.motion.rates(end, self.modes))
        off = h * (_E @ np.array(rates))
        with np.errstate(invalid="ignore"):
            error = float(np.max(np.abs(off) / (self.tolerance * (self.scale + np.abs(self.z)))))
        return end, error if np.isfinite(end).all() and math.isfinite(error) else math.inf

    def _scale(self) -> Array:
        platform = self.motion.platform
        reach, scale = platform.reach, np.ones(19)
        moment = float(np.trace(platform.inertia)) / 3
        energy = platform.mass * self.speed**2
        scale[R], scale[Q] = 0.1 * reach, 0.1
        scale[P], scale[L] = platform.mass * self.speed, moment * self.speed / reach
        scale[H] = max(moment * self.speed / reach, float(np.abs(self.z[H]).max()))
        scale[[TORQUE_WORK, GROUND_WORK, FRICTION_WORK]] = energy
        return scale

    def _rests(self) -> bool:
        """Whether nothing moves and nothing will before the next change of a torque; the last speed is taken out.

        That is so where three tips or more hold it that are not in a line, all stick, and what moves is no more than
        the steps' own error, ten times `tolerance`, and would not gather speed: such a balance is stable.
        """
        modes, motion = self.modes, self.motion
        if len(modes.touching) < 3 or len(modes.sticking) < len(modes.touching) or any(modes.torque):
            return False
        rest = 10 * self.tolerance
        mass, reach = motion.platform.mass, motion.platform.reach
        turn, spin = motion.turning(self.z)
        if max(np.abs(self.z[P]).max() / mass, np.abs(spin).max() * reach) > rest * self.speed:
            return False
        still = self.z.copy()
        still[P] = 0.0
        still[L] -= turn @ motion.platform.inertia @ turn.T @ spin
        rates = motion.rates(still, modes)  # without the dampers' share
        weight = float(np.linalg.norm(motion.weight))
        if max(np.abs(rates[P]).max(), np.abs(rates[L]).max() / reach) > 100 * rest * weight:
            return False
        feet = np.array([tip.arm[:2] for tip in motion.found])
        if np.linalg.svd(feet - feet[0], compute_uv=False)[1] < 1e-3 * reach:
            return False
        still[FRICTION_WORK] -= motion.energy(self.z, modes)[0]
        self.z = still
        return True

    def _monitors(self, z: Array) -> dict[tuple[str, int], float]:
        """Numbers that are positive within the modes, at `z`, where the equations were last evaluated."""
        modes, motion = self.modes, self.motion
        motion.rates(z, modes)
        out: dict[tuple[str, int], float] = {}
        reach = motion.platform.reach
        if z[2] < 1.01 * reach:
            for k, depth in enumerate(motion.depths(z)):
                if k not in modes.touching:
                    out["touch", k] = self._bottom(k) - float(depth)
        for tip in motion.found:
            k = tip.index
            out["lift", k] = tip.depth - self._bottom(k)
            if motion.law.has_memory:
                top = modes.top[k]
                fresh = top < 0
                out["turn" if fresh else "deeper", k] = (
                    tip.rate + 1e-12 * self.speed if fresh else top - tip.depth + 1e-15 * reach
                )
            if k in modes.weight:
                out["loose", k] = motion.mu_s * tip.load * (1 + 1e-12) - float(np.linalg.norm(tip.friction))
            else:
                out["stop", k] = float(tip.slip @ modes.direction[k])
        for k, history in enumerate(self.histories):
            if history is not None and modes.torque[k] != 0:
                low, high = history.limits()
                speed = z[H.start + k] / history.wheel.inertia
                out["wheel", k] = speed - low if modes.torque[k] > 0 else high - speed
        return out

    def _locate(self, first: Array, h: float, z: Array) -> tuple[float, Array, list[tuple[str, int]]]:
        """The step up to the first event within it, and what happens then."""
        after = self._monitors(z)
        found = [key for key, value in after.items() if value < 0]
        if not found:
            return h, z, []
        before = self._monitors(self.z)
        at_once = [
            key for key in found if key in before and before[key] <= 0 and key[0] in ("loose", "wheel", "lift", "turn")
        ]
        if at_once:
            return 0.0, self.z.copy(), at_once
        low, high, high_z = 0.0, h, z
        values_low, values_high = {key: before.get(key, 0.0) for key in found}, after
        for iteration in range(70):
            if high - low <= 1e-13 + 1e-15 * abs(self.time):
                break
            guess = high
            for key in found:  # the earliest crossing of the straight lines, halved now and then
                a, b = values_low[key], values_high[key]
                if a > 0 > b:
                    guess = min(guess, low + (high - low) * a / (a - b))
            if iteration % 3 == 2 or not low < guess < high:
                guess = 0.5 * (low + high)
            middle = self._attempt(first, guess)[0]
            values = self._monitors(middle)
            crossed = [key for key in found if values[key] < 0]
            if crossed:
                high, high_z, values_high, found = guess, middle, values, crossed
            else:
                low, values_low = guess, {key: values[key] for key in found}
        together = [
            key
            for key, value in values_high.items()
            if value < 0 or (value < before.get(key, math.inf) and self._same_moment(key, value))
        ]
        return high, high_z, together

    def _same_moment(self, key: tuple[str, int], value: float) -> bool:
        """Whether a monitor is so near to zero that its event belongs to this moment: symmetric tips go together."""
        kind, k = key
        if kind in ("touch", "lift"):
            return value < 1e-13 * self.motion.platform.reach
        if kind == "stop":
            return value < 1e-12 * self.speed
        if kind == "loose":
            return value < 1e-9 * self.motion.mu_s * self.motion.tip(k).load
        return False

    def _switch(self, found: Sequence[tuple[str, int]]) -> None:
        may_stick, loose = [], []
        self.motion.rates(self.z, self.modes)
        for kind, k in found:
            if kind == "touch" and k not in self.modes.touching:
                self._touch(k)
                if self._stands_still(k, STILL):
                    may_stick.append(k)
            elif kind == "lift":
                self._lift(k)
            elif kind == "stop" and k in self.modes.direction:
                slip = self.motion.tip(k).slip
                size = float(np.linalg.norm(slip))
                if size < (SLOW if k in self.modes.frozen else 1e-6) * self.speed:
                    may_stick.append(k)
                else:
                    self.modes.direction[k] = slip / size
            elif kind == "loose":
                loose.append(k)
            elif kind in ("turn", "deeper"):
                self.modes.top[k] = max(self.motion.tip(k).depth, 0.0) if kind == "turn" else -1.0
            elif kind == "wheel":
                self.spent[k] = True
                history = self.histories[k]
                assert history is not None
                low, high = history.limits()
                self.z[H.start + k] = (low if self.modes.torque[k] > 0 else high) * history.wheel.inertia
        if loose:
            frictions = {tip.index: tip.friction.copy() for tip in self.motion.found}
            for k in loose:
                if k in self.modes.sticking:
                    self._let_go(k, frictions[k])
        self._resolve(may_stick)

    def _change_torques(self) -> None:
        if self.time in self.changes:
            self._resolve([])

    def _touch(self, k: int) -> None:
        self.modes.touching = sorted([*self.modes.touching, k])
        self.modes.top.setdefault(k, -1.0)
        self.modes.direction[k] = _unit(self._slip(k))

    def _lift(self, k: int) -> None:
        self.modes.direction.pop(k, None)
        self.modes.weight.pop(k, None)
        self.modes.frozen.discard(k)
        if self.modes.top.get(k, 0.0) <= 0 or not self.motion.law.has_memory:
            self.modes.top.pop(k, None)
        self.modes.touching = [n for n in self.modes.touching if n != k]
        self.modes.sticking = [n for n in self.modes.sticking if n != k]

    def _bottom(self, k: int) -> float:
        """Depth at which a tip meets the ground [m]: 0, or the bottom of the crater it has made and not left."""
        top = self.modes.top.get(k, 0.0)
        return (1.0 - self.motion.rebound) * top if top > 0 and self.motion.law.has_memory else 0.0

    def _forget(self) -> None:
        """A tip that has left the surface makes a new crater when it comes back."""
        lifted = [k for k in self.modes.top if k not in self.modes.touching]
        if lifted:
            depths = self.motion.depths(self.z)
            for k in lifted:
                if depths[k] < 0:
                    del self.modes.top[k]

    def _let_go(self, k: int, friction: Array) -> None:
        """From sticking to sliding against the force that held it."""
        self.modes.sticking = [n for n in self.modes.sticking if n != k]
        self.modes.weight.pop(k, None)
        self.modes.direction[k] = _unit(-friction)
        self.modes.frozen.add(k)

    def _slip(self, k: int) -> Array:
        turn, spin = self.motion.turning(self.z)
        return (self.z[P] / self.motion.masses + np.cross(spin, turn @ self.motion.tips[k]))[:2]

    def _stands_still(self, k: int, share: float) -> bool:
        """Whether the slip of a tip is below this share of sqrt(g reach)."""
        return float(np.linalg.norm(self._slip(k))) < share * self.speed

    def _resolve(self, may_stick: Sequence[int]) -> None:
        """Let those stick that may and can; set the torques; take out of the speeds what sticking forbids."""
        modes, motion = self.modes, self.motion
        self._set_torques()
        for k in may_stick:
            if k in modes.direction and k in modes.touching:
                del modes.direction[k]
                modes.frozen.discard(k)
                modes.sticking = sorted([*modes.sticking, k])
        for _ in range(2 * len(modes.touching) + 2):
            self._weigh()
            motion.rates(self.z, modes)
            if not modes.sticking:
                break
            ratios = {
                tip.index: float(np.linalg.norm(tip.friction)) - motion.mu_s * tip.load * (1 + 1e-9)
                for tip in motion.found
                if tip.index in modes.weight
            }
            worst = max(ratios.values())
            if worst <= 0:
                break
            frictions = {tip.index: tip.friction.copy() for tip in motion.found}
            for k, over in ratios.items():
                if over >= worst * (1 - 1e-6):
                    self._let_go(k, frictions[k])
        self._weigh()
        motion.rates(self.z, modes)
        motion.hold_still(self.z, modes)
        self._note_change()

    def _weigh(self) -> None:
        """Shares of the sticking tips in the load they carry, at this moment."""
        modes, motion = self.modes, self.motion
        if not modes.sticking:
            modes.weight = {}
            return
        modes.weight = dict.fromkeys(modes.sticking, 1.0 / len(modes.sticking))
        motion.rates(self.z, modes)
        loads = {tip.index: tip.load for tip in motion.found if tip.index in modes.weight}
        total = sum(loads.values())
        if total > 0:
            modes.weight = {k: load / total for k, load in loads.items()}

    def _set_torques(self) -> None:
        driving = bool(self.modes.touching) or self.in_flight
        self.modes.torque = tuple(
            history.torque(self.time, float(self.z[H.start + k]) / history.wheel.inertia)
            if history is not None and driving and not self.spent[k] else 0.0
            for k, history in enumerate(self.histories)
        )  # fmt: skip

    def _keep_still(self, *, stalled: bool) -> None:
        """After a step without events: new weights and directions; the speeds that sticking forbids taken out."""
        modes, motion = self.modes, self.motion
        if not modes.touching:
            return
        self._weigh()
        motion.rates(self.z, modes)
        slow = []
        for tip in motion.found:
            k, size = tip.index, float(np.linalg.norm(tip.slip))
            if k not in modes.direction:
                continue
            if size > 2 * SLOW * self.speed:
                modes.frozen.discard(k)
            if k not in modes.frozen:
                if size > 1e-12 * self.speed:
                    modes.direction[k] = tip.slip / size
                if size < SLOW * self.speed:
                    slow.append(k)
        motion.hold_still(self.z, modes)
        if stalled and slow:
            self.stalls += 1
            self._resolve(slow)  # what cannot stick is let go, its direction frozen

    def _set_anew(self) -> None:
        """After a forced step: who touches and which way they slide, read from the state."""
        for k, depth in enumerate(self.motion.depths(self.z)):
            if depth > self._bottom(k) and k not in self.modes.touching:
                self._touch(k)
            elif depth > self.modes.top.get(k, math.inf) >= 0:
                self.modes.top[k] = -1.0
            elif depth <= self._bottom(k) and k in self.modes.touching:
                self._lift(k)
        for k in list(self.modes.direction):
            slip = self._slip(k)
            size = float(np.linalg.norm(slip))
            if size > 0:
                self.modes.direction[k] = slip / size
        self._resolve([k for k in self.modes.direction if self._stands_still(k, 1e-6)])

    def _note_change(self) -> None:
        """Add to the transitions how many touch and stick now, where that has changed."""
        now = (len(self.modes.touching), len(self.modes.sticking))
        if not self.transitions or self.transitions[-1][1:] != now:
            self.transitions.append((self.time, *now))


def _unit(vector: Array) -> Array:
    """The vector over its length, shape (2,); (1, 0) where it has none."""
    size = float(np.linalg.norm(vector))
    return vector / size if size > 0 else np.array([1.0, 0.0])
