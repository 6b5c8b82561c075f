"""The accurate integrator: every event is located in time, and the motion between events is smooth.

Between events Dormand and Prince's pair of orders 5 and 4 with its own interpolant; the step adapts to `tolerance`.
Events are roots of a function of the state: touch-down, lift-off, the static bound, slip through zero, the damper's
switch, new ground under a spike with memory, end of the torque, the wheel's stop. A root is found by repeating the step
itself with other lengths, so the state at an event has the step's own accuracy. Grazing is looked for between the ends
of a step. Events at one moment are taken one after the other without a step between them. More than `_CROWD` within a
microsecond are answered with a step of a microsecond in the present modes, which is counted (`forced_steps`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from rigid.checks.unfit import UnfitSettingsError

from .dynamics import LOST, THETA, WHEEL, Modes, System
from .events import KINKS, Monitor, Watch, cubic, let_go, monitors, precision, resolve, triggered
from .methods import Implicit, Interpolant, Step, attempt, interpolant
from .statics import at_rest, comes_to_rest, resting, standing, stiffness_at_rest

__all__ = ["Progress", "integrate"]

_LONGEST = 5e-3  # [s] with a spike in the ground
_LONGEST_HOP = 2e-2  # [s] in flight
_SHORTEST = 1e-9  # [s] below which the step no longer adapts
_STIFF = 2e4  # [1/s]: damper over the mass that a tip offers, above which implicit steps are the quicker ones
_CROWD, _MOMENT = 40, 1e-6  # events, and within which time [s]
_TRIES, _SPAN = 2000, 1e-4  # steps tried, and within which time [s]: round-off makes them too short to go on


@dataclass
class Progress:
    """What an integration has left: called back for every accepted step, and how it went."""

    steps: int = 0
    rejected: int = 0
    events: int = 0
    forced_steps: int = 0
    transitions: list[tuple[float, str, float]] = field(default_factory=list)


OnStep = Callable[[float, float, list[float], Interpolant, Modes], None]


def integrate(
    system: System,
    *,
    duration: float,
    tolerance: float,
    on_step: OnStep,
    longest: float = _LONGEST,
    start: tuple[list[float], Modes] | None = None,
) -> Progress:
    """Integrate from `start` (static equilibrium if None) to `duration` [s].

    `on_step(t0, t1, z1, interpolant, modes)` is called after every accepted step; `interpolant(t)` is z within it.
    Raises UnfitSettingsError where numbers stop being finite or the steps become too short to go on.
    """
    z, modes = standing(system) if start is None else start
    motion = _Motion(system, z, modes, duration=duration, tolerance=tolerance, longest=longest)
    while motion.time < duration:
        if motion.quiet or at_rest(system, motion.z, modes, motion.rate):
            motion.rest(on_step)
        else:
            motion.step(on_step)
    return motion.went


class _Motion:
    """One motion under way: `z` at `time` in `modes`, its rate, and the length `h` [s] of the step to come."""

    def __init__(
        self, system: System, z: list[float], modes: Modes, *, duration: float, tolerance: float, longest: float
    ) -> None:
        self.system, self.z, self.modes, self.duration = system, z, modes, duration
        self.tolerance, self.longest = tolerance, longest
        self.time, self.went, trial = 0.0, Progress(), system.trial
        if trial.torque_until <= 0 or trial.torque == 0:
            modes.torque_over = True
        still = [n for n in modes.touching if modes.slip[n] == 0]
        modes.dry = [(speed > 0) - (speed < 0) for speed in system.dry_speeds(z)]
        self.rate = resolve(system, 0.0, z, modes, spikes=still, dry=[k for k in (0, 1) if not modes.dry[k]])
        self.went.transitions.append((0.0, modes.state, z[THETA]))
        self.h, self.crowd, self.crowd_since = 1e-4, 0, -math.inf
        self.before: Watch = {}
        self.tries, self.tries_since = 0, 0.0
        self.fresh, self.quiet = True, False
        self.scale = _scale(system)
        carried = 0.0 if system.inner else trial.counterweight
        lightest = 1 / (trial.mass + carried) + trial.spike_length**2 / trial.inertia
        stiff = stiffness_at_rest(system)[1] * lightest > _STIFF
        system.implicit = Implicit(system, self.scale, tolerance) if stiff else None

    @property
    def _ends(self) -> float:
        """Up to where the next step may go [s]: nothing changes by itself before."""
        return self.duration if self.modes.torque_over else min(self.duration, self.system.trial.torque_until)

    def rest(self, on_step: OnStep) -> None:
        """Nothing moves until the torque or the wheel ends."""
        system, modes, time, z = self.system, self.modes, self.time, self.z
        end = self._ends
        if self.rate[WHEEL] < 0:  # a brake ends with its wheel's speed
            end = min(end, time - z[WHEEL] / self.rate[WHEEL])
        rests = resting(time, z, self.rate)
        z, modes.resting = rests(end), True
        on_step(time, end, z, rests, modes)
        modes.resting, self.time, self.z, self.quiet = False, end, z, False
        self.went.steps += 1
        if end >= self.duration:
            return
        modes.torque_over = True
        if system.trial.actuator == "brake" and end < system.trial.torque_until:
            z[WHEEL] = 0.0
        self.rate, self.fresh = resolve(system, end, z, modes, dry=(0, 1)), True

    def step(self, on_step: OnStep) -> None:
        """One step, to the first event within it; or none, where it was too long."""
        system, modes, went, h = self.system, self.modes, self.went, self.h
        self._check_progress()
        ends = self._ends
        room = ends - self.time
        h = min(h, self.longest if modes.touching else _LONGEST_HOP, room)
        if room - h < 1e-3 * h:
            h = room
        if self.fresh:  # the last evaluation was at z
            self.before, self.fresh = monitors(system, self.z, modes), False
        step = self._attempt(h)
        if not math.isfinite(step.error):
            if h < 1e-12:
                raise UnfitSettingsError(f"the motion is no longer finite at t = {self.time:.6g} s")
            self.h, went.rejected = 0.1 * h, went.rejected + 1
            return
        if step.error > 1 and h > _SHORTEST:
            self.h, went.rejected = h * max(0.2, 0.9 * step.error**-0.2), went.rejected + 1
            return
        h_next = h * min(5.0, 0.9 * max(step.error, 1e-10) ** -0.2)
        forced = self.crowd >= _CROWD and self.time - self.crowd_since <= _MOMENT
        event: list[Monitor] = []
        if forced:
            if h > _MOMENT:
                h = min(_MOMENT, room)
                step = self._attempt(h)
            self.crowd = 0
            went.forced_steps += 1
        else:
            h, step, event = self._locate(h, step)
        then = ends if room - h <= 0 else self.time + h
        on_step(self.time, then, step.z, self._within(h, step), modes)
        self.time, went.steps = then, went.steps + 1
        self.z = list(step.z)
        self.rate, self.fresh = system.derivative(then, self.z, modes), True  # again: `on_step` asked for other moments
        _keep(system, self.z, modes)
        self.h = self._after(event, forced, h, h_next)

    def _check_progress(self) -> None:
        """Raises UnfitSettingsError where the steps have become so short that the motion would never end."""
        self.tries += 1
        if self.time - self.tries_since > _SPAN:
            self.tries, self.tries_since = 0, self.time
        elif self.tries > _TRIES:
            stiffness, damping = stiffness_at_rest(self.system)
            critical = 2 * math.sqrt(stiffness * self.system.trial.mass)
            raise UnfitSettingsError(
                f"the motion cannot be followed beyond t = {self.time:.6g} s: its steps become too short. Under a row "
                f"C = {damping:g} N s/m, and damping is critical at {critical:.3g} N s/m: expected at most some "
                f"thousand times that"
            )

    def _after(self, event: list[Monitor], forced: bool, h: float, h_next: float) -> float:
        """The modes that follow the step of length `h`; the length of the next [s]."""
        system, modes, went, time, z = self.system, self.modes, self.went, self.time, self.z
        changed = bool(event) or forced
        if not modes.torque_over and time >= system.trial.torque_until:
            modes.torque_over, changed = True, True
        if changed:
            went.events += len(event)
            if event:
                near = time - self.crowd_since <= _MOMENT
                self.crowd, self.crowd_since = (self.crowd + 1, self.crowd_since) if near else (1, time)
            self.rate = _switch(system, time, z, modes, event, forced)
            if went.transitions[-1][1] != modes.state:
                went.transitions.append((time, modes.state, z[THETA]))
            return min(h_next, max(h, 1e-4)) if not event else min(max(h_next, 1e-4), 1e-3)
        if any(modes.slip[n] == 0 for n in modes.touching) or system.has_dry:
            system.hold_still(z, modes)
            self.rate = system.derivative(time, z, modes)
            if comes_to_rest(system, time, z, modes, self.scale, self.tolerance):
                self.rate, self.quiet = system.derivative(time, z, modes), True
        return h_next

    def _attempt(self, h: float) -> Step:
        """A step, implicit where the ground's damper would make explicit ones too short."""
        if self.system.implicit is not None and self.modes.touching:
            return self.system.implicit.attempt(self.time, self.z, self.modes, self.rate, h)
        return attempt(self.system, self.time, self.z, self.modes, self.rate, h, self.scale, self.tolerance)

    def _within(self, h: float, step: Step) -> Interpolant:
        """z within a step: the explicit pair's interpolant; of an implicit step, steps of other lengths."""
        time = self.time
        if len(step.rates) == 7 or h <= 0:
            return interpolant(time, h, self.z, step)
        return lambda t: list(step.z) if t >= time + h else self._attempt(t - time).z

    def _lowest(self, h: float, after: Watch) -> tuple[float, Step, Watch] | None:
        """A shorter step that ends where a monitor, positive at both ends, is lowest between them and below zero.

        Only monitors that come near zero by the cubic through both ends are followed, by the root of their rate.
        """
        for key, (end, end_rate) in after.items():
            if key[0] not in ("touch", "slip", "lift") or key not in self.before:
                continue
            start, start_rate = self.before[key]
            if not (start > 0 and end >= 0 and start_rate < 0 < end_rate):
                continue
            least = min(cubic(0.05 * k, start, end, h * start_rate, h * end_rate) for k in range(1, 20))
            if least > 0.1 * max(start, end):
                continue
            low, low_rate, high, high_rate = 0.0, start_rate, h, end_rate
            for _ in range(30):
                guess = low - low_rate * (high - low) / (high_rate - low_rate)
                edge = 1e-3 * (high - low)
                guess = min(max(guess, low + edge), high - edge)
                step = self._attempt(guess)
                values = monitors(self.system, step.z, self.modes)
                if key not in values:
                    break
                value, slope = values[key]
                if value < 0:
                    return guess, step, values
                if slope == 0.0 or high - low < 1e-12:
                    break
                if slope < 0:
                    low, low_rate = guess, slope
                else:
                    high, high_rate = guess, slope
        return None

    def _locate(self, h: float, step: Step) -> tuple[float, Step, list[Monitor]]:
        """The step up to the first event within it, and which event that is."""
        before, after = self.before, monitors(self.system, step.z, self.modes)
        found = triggered(before, after)
        if not found:
            dip = self._lowest(h, after)
            if dip is None:
                return h, step, []
            h, step, after = dip
            found = triggered(before, after)
            if not found:
                return h, step, []
        low, high, high_step, high_values = 0.0, h, step, after
        low_values: dict[Monitor, float] = {key: before.get(key, (0.0, 0.0))[0] for key in found}
        for key in found:
            if key[0] not in KINKS and low_values[key] <= 0:  # it is over at once
                return 0.0, Step(list(self.z), [self.rate] * 7, 0.0), [key]
        signs = {key: 1.0 if low_values[key] > 0 else -1.0 for key in found}
        weight_low, at_low = 1.0, before
        for iteration in range(60):
            if high - low <= 1e-14 + 1e-15 * abs(self.time):
                break
            # The earliest crossing of the straight lines through both ends (Illinois), halved now and then.
            guess = high
            for key in found:
                a, b = signs[key] * low_values[key] * weight_low, signs[key] * high_values[key][0]
                if a > 0 > b:
                    guess = min(guess, low + (high - low) * a / (a - b))
            if iteration % 6 == 5 or not low < guess < high:
                guess = 0.5 * (low + high)
            trial_step = self._attempt(guess)
            values = monitors(self.system, trial_step.z, self.modes)
            crossed = [key for key in found if signs[key] * values[key][0] < 0]
            for key in triggered(before, values):  # passed by now, back by the end of the step: not yet looked for
                start = at_low.get(key, (0.0, 0.0))[0]
                if key not in found and start > 0:
                    low_values[key], signs[key] = start, 1.0
                    found, crossed = [*found, key], [*crossed, key]
            if not crossed:
                tiny = min(signs[key] * values[key][0] for key in found)
                low, low_values, at_low = guess, {key: values[key][0] for key in found}, values
                weight_low = 1.0
                if tiny == 0.0:
                    high_step, high_values, high = trial_step, values, guess
                    found = [key for key in found if values[key][0] == 0.0]
                    break
            else:
                weight_low = 0.5 if guess < high else 1.0
                high, high_step, high_values, found = guess, trial_step, values, crossed
                if all(abs(values[key][0]) <= precision(key, self.system) for key in crossed):
                    break
        return high, high_step, found


def _scale(system: System) -> list[float]:
    """What the tolerance is relative to: a length, an angle, their rates, and energies, of the trial's own size."""
    trial = system.trial
    length = trial.spike_length
    rate = math.sqrt(trial.gravity_sim / length)
    energy = trial.weight * length
    wheel = max(trial.wheel_speed_0, 1.0)
    scale = [0.1 * length, 0.1 * length, 0.1, length * rate, length * rate, rate, 10 * wheel, energy, energy]
    inner = [0.1 * length, length * rate] if system.inner else []
    return [*scale, *inner, *([0.1 * length] * (system.size - system.first))]


def _keep(system: System, z: list[float], modes: Modes) -> None:
    if not (system.has_memory or system.settles):
        return
    for contact in system.contacts:
        modes.remember(contact.spike, contact.depth)
    for n in range(system.trial.spike_count):
        gone = system.given_way(n, z)
        if n not in modes.touching and (modes.top[n] > 0 or gone > 0) and system.depth(n, z) + gone < 0:
            system.forget(n, z, modes)


def _switch(
    system: System, time: float, z: list[float], modes: Modes, event: list[Monitor], forced: bool
) -> list[float]:
    may_stick: list[int] = []
    halted: list[int] = []
    for kind, n in event:
        if kind == "touch":
            system.enter(n, z, modes)
            if abs(system.depth_and_slip(n, z)[1]) < 1e-14:
                may_stick.append(n)
        elif kind == "lift":
            _lift(system, z, modes, n)
        elif kind == "slip":
            may_stick.append(n)
        elif kind == "stick":
            let_go(system, modes)
        elif kind == "yield":
            modes.dry[n] = -1 if system.dry_forces[n] > 0 else 1
        elif kind == "halt":
            halted.append(n)
        elif kind == "inner":
            modes.inner = 1 - modes.inner
        elif kind == "wheel":
            z[WHEEL], modes.torque_over = 0.0, True
    if forced:
        _set_by_speeds(system, z, modes)
    return resolve(system, time, z, modes, spikes=may_stick, dry=halted)


def _lift(system: System, z: list[float], modes: Modes, n: int) -> None:
    """Spike `n` leaves the ground; what the ground still held when it let go is lost."""
    z[LOST] += max(system.stored(n, z, modes), 0.0)
    system.leave(n, z, modes)
    if not system.sheds:
        modes.top[n] = 0.0


def _set_by_speeds(system: System, z: list[float], modes: Modes) -> None:
    """Find from the present state, after a forced step, which contacts touch and in which direction they slide."""
    for n in range(system.trial.spike_count):
        slip, inside = system.depth_and_slip(n, z)[1], system.inside(n, z, modes)
        if inside and n not in modes.touching:
            system.enter(n, z, modes)
        elif not inside and n in modes.touching:
            _lift(system, z, modes, n)
        elif n in modes.touching and modes.slip[n]:
            modes.slip[n] = 1 if slip > 0 else -1
    modes.dry = [way and (1 if speed > 0 else -1) for way, speed in zip(modes.dry, system.dry_speeds(z), strict=True)]
