"""The accurate integrator: every event is located in time, and the motion between events is smooth.

Between events Dormand and Prince's pair of orders 5 and 4 with its own interpolant; the step adapts to `tolerance`.
Events (touch-down, lift-off, the static bound, slip through zero, the damper's switch, new ground under a spike with
memory, end of the torque, the wheel's stop) are roots of a function of the state. A root is found by repeating the step
itself with other lengths, so the state at an event has the step's own accuracy. Grazing is looked for between the ends
of a step. Events at one moment are taken one after the other without a step between them. More than `_CROWD` within a
microsecond are answered with a step of a microsecond in the present modes, which is counted (`forced_steps`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .dormand_prince import Interpolant, Step, attempt, interpolant
from .dynamics import LOST, OMEGA, THETA, VX, VY, WHEEL, Modes, System, Y
from .implicit import Implicit
from .modes import let_go, resolve
from .planar_events import KINKS, Monitor, Watch, cubic, monitors, precision, triggered
from .rest import at_rest, comes_to_rest, resting
from .statics import standing, stiffness_at_rest

__all__ = ["Progress", "integrate"]

_LONGEST = 5e-3  # [s] with a spike in the ground
_LONGEST_HOP = 2e-2  # [s] in flight
_SHORTEST = 1e-9  # [s] below which the step no longer adapts
_STIFF = 2e4  # [1/s]: damper over the mass that a tip offers, above which implicit steps are the quicker ones
_CROWD, _MOMENT = 40, 1e-6  # events, and within which time [s]


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
    Raises RuntimeError where numbers stop being finite or the step would have to be absurdly short.
    """
    trial = system.trial
    z, modes = standing(system) if start is None else start
    time, told = 0.0, Progress()
    if trial.torque_until <= 0 or trial.torque == 0:
        modes.torque_over = True
    still = [n for n in modes.touching if modes.slip[n] == 0]
    climbing = system.s.up_x * z[VX] + system.s.up_y * z[VY]
    modes.vertical, modes.rotation = _sign(climbing), _sign(z[OMEGA])
    rate = resolve(system, time, z, modes, spikes=still, vertical=climbing == 0, rotation=z[OMEGA] == 0)
    told.transitions.append((time, modes.state, z[THETA]))
    h, crowd, crowd_since = 1e-4, 0, -math.inf
    before: Watch = {}
    fresh, quiet = True, False
    scale = _scale(system)
    lightest = 1 / (trial.mass + (0.0 if system.inner else trial.counterweight)) + trial.spike_length**2 / trial.inertia
    stiff = stiffness_at_rest(system)[1] * lightest > _STIFF
    system.implicit = Implicit(system, scale, tolerance) if stiff else None
    while time < duration:
        if quiet or at_rest(system, z, modes, rate):
            end = duration if modes.torque_over else min(duration, trial.torque_until)
            if rate[WHEEL] < 0:  # a brake ends with its wheel's speed
                end = min(end, time - z[WHEEL] / rate[WHEEL])
            rests = resting(time, z, rate)
            z, modes.resting = rests(end), True
            on_step(time, end, z, rests, modes)
            modes.resting, time, quiet = False, end, False
            told.steps += 1
            if time >= duration:
                break
            modes.torque_over = True
            if trial.actuator == "brake" and time < trial.torque_until:
                z[WHEEL] = 0.0
            rate, fresh = resolve(system, time, z, modes, vertical=True, rotation=True), True
            continue
        ends = duration if modes.torque_over else min(duration, trial.torque_until)
        room = ends - time
        h = min(h, longest if modes.touching else _LONGEST_HOP, room)
        if room - h < 1e-3 * h:
            h = room
        if fresh:  # the last evaluation was at z
            before, fresh = monitors(system, z, modes), False
        step = _attempt(system, time, z, modes, rate, h, scale, tolerance)
        if not math.isfinite(step.error):
            if h < 1e-12:
                raise RuntimeError(f"the motion is no longer finite at t = {time:.6g} s: {trial.describe()}")
            h, told.rejected = 0.1 * h, told.rejected + 1
            continue
        if step.error > 1 and h > _SHORTEST:
            h, told.rejected = h * max(0.2, 0.9 * step.error**-0.2), told.rejected + 1
            continue
        h_next = h * min(5.0, 0.9 * max(step.error, 1e-10) ** -0.2)
        forced = False
        if crowd >= _CROWD and time - crowd_since <= _MOMENT:
            if h > _MOMENT:
                h = min(_MOMENT, room)
                step = _attempt(system, time, z, modes, rate, h, scale, tolerance)
            forced, crowd = True, 0
            told.forced_steps += 1
        event: list[Monitor] = []
        if not forced:
            h, step, event = _locate(system, time, z, modes, rate, h, step, before, scale, tolerance)
        then = ends if room - h <= 0 else time + h
        on_step(time, then, step.z, _within(system, time, h, z, modes, rate, step, scale, tolerance), modes)
        time, told.steps = then, told.steps + 1
        z = list(step.z)
        rate, fresh = system.derivative(time, z, modes), True  # again: `on_step` has asked for other moments
        _keep(system, z, modes)
        changed = bool(event) or forced
        if not modes.torque_over and time >= trial.torque_until:
            modes.torque_over, changed = True, True
        if changed:
            told.events += len(event)
            if event:
                crowd, crowd_since = (crowd + 1, crowd_since) if time - crowd_since <= _MOMENT else (1, time)
            rate = _switch(system, time, z, modes, event, forced)
            if told.transitions[-1][1] != modes.state:
                told.transitions.append((time, modes.state, z[THETA]))
            h_next = min(h_next, max(h, 1e-4)) if not event else min(max(h_next, 1e-4), 1e-3)
        elif any(modes.slip[n] == 0 for n in modes.touching) or system.has_vertical or system.has_rotation:
            system.hold_still(z, modes)
            rate = system.derivative(time, z, modes)
            if comes_to_rest(system, time, z, modes, scale, tolerance):
                rate, quiet = system.derivative(time, z, modes), True
        h = h_next
    return told


def _attempt(
    system: System, time: float, z: list[float], modes: Modes, rate: list[float], h: float, scale: Sequence[float],
    tolerance: float,
) -> Step:  # fmt: skip
    """A step, implicit where the ground's damper would make explicit ones too short."""
    if system.implicit is not None and modes.touching:
        return system.implicit.attempt(time, z, modes, rate, h)
    return attempt(system, time, z, modes, rate, h, scale, tolerance)


def _within(
    system: System, time: float, h: float, z: list[float], modes: Modes, rate: list[float], step: Step,
    scale: Sequence[float], tolerance: float,
) -> Interpolant:  # fmt: skip
    """z within a step: the explicit pair's interpolant; of an implicit step, steps of other lengths."""
    if len(step.rates) == 7 or h <= 0:
        return interpolant(time, h, z, step)
    return lambda t: list(step.z) if t >= time + h else _attempt(
        system, time, z, modes, rate, t - time, scale, tolerance
    ).z  # fmt: skip


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


def _scale(system: System) -> list[float]:
    """What the tolerance is relative to: a length, an angle, their rates, and energies, of the trial's own size."""
    trial = system.trial
    length = trial.spike_length
    rate = math.sqrt(trial.gravity_sim / length)
    energy = trial.weight * length
    wheel = max(trial.wheel_speed_0, 1.0)
    scale = [0.1 * length, 0.1 * length, 0.1, length * rate, length * rate, rate, 10 * wheel, energy, energy]
    return [*scale, 0.1 * length, length * rate] if system.inner else scale


def _lowest(
    system: System,
    time: float,
    z: list[float],
    modes: Modes,
    rate: list[float],
    h: float,
    before: Watch,
    after: Watch,
    scale: Sequence[float],
    tolerance: float,
) -> tuple[float, Step, Watch] | None:
    """A shorter step that ends where a monitor, positive at both ends, is lowest between them and below zero.

    Only monitors that come near zero by the cubic through both ends are followed, by the root of their rate.
    """
    for key, (end, end_rate) in after.items():
        if key[0] not in ("touch", "slip", "lift") or key not in before:
            continue
        start, start_rate = before[key]
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
            step = _attempt(system, time, z, modes, rate, guess, scale, tolerance)
            values = monitors(system, step.z, modes)
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


def _locate(
    system: System,
    time: float,
    z: list[float],
    modes: Modes,
    rate: list[float],
    h: float,
    step: Step,
    before: Watch,
    scale: Sequence[float],
    tolerance: float,
) -> tuple[float, Step, list[Monitor]]:
    """The step up to the first event within it, and which event that is."""
    after = monitors(system, step.z, modes)
    found = triggered(before, after)
    if not found:
        dip = _lowest(system, time, z, modes, rate, h, before, after, scale, tolerance)
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
            return 0.0, Step(list(z), [rate] * 7, 0.0), [key]
    signs = {key: 1.0 if low_values[key] > 0 else -1.0 for key in found}
    weight_low, at_low = 1.0, before
    for iteration in range(60):
        if high - low <= 1e-14 + 1e-15 * abs(time):
            break
        # The earliest crossing of the straight lines through both ends (Illinois), halved now and then.
        guess = high
        for key in found:
            a, b = signs[key] * low_values[key] * weight_low, signs[key] * high_values[key][0]
            if a > 0 > b:
                guess = min(guess, low + (high - low) * a / (a - b))
        if iteration % 6 == 5 or not low < guess < high:
            guess = 0.5 * (low + high)
        trial_step = _attempt(system, time, z, modes, rate, guess, scale, tolerance)
        values = monitors(system, trial_step.z, modes)
        crossed = [key for key in found if signs[key] * values[key][0] < 0]
        for key in triggered(before, values):  # passed by now and back by the end of the step, so not yet looked for
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
            if all(abs(values[key][0]) <= precision(key, system) for key in crossed):
                break
    return high, high_step, found


def _keep(system: System, z: list[float], modes: Modes) -> None:
    """What outlives a step: the deepest depths."""
    if not system.has_memory:
        return
    for contact in system.contacts:
        modes.remember(contact.spike, contact.depth)
    for n in range(system.trial.spike_count):
        if n not in modes.touching and modes.top[n] > 0 and system.depth(n, z) < 0:
            modes.top[n] = 0.0


def _switch(
    system: System, time: float, z: list[float], modes: Modes, event: list[Monitor], forced: bool
) -> list[float]:
    """Change the modes for what happened; return dz/dt."""
    may_stick: list[int] = []
    vertical = rotation = False
    for kind, n in event:
        if kind == "touch":
            modes.touching = sorted([*modes.touching, n])
            h, _ = system.arms(n, z)
            slip = z[VX] - z[OMEGA] * h
            modes.slip[n] = 1 if slip > 0 else -1
            modes.touch(n, h - z[Y])
            if abs(slip) < 1e-14:
                may_stick.append(n)
        elif kind == "lift":
            _lift(system, z, modes, n)
        elif kind == "slip":
            may_stick.append(n)
        elif kind == "stick":
            let_go(system, modes)
        elif kind in ("vertical", "rotation") and n == 1:
            setattr(modes, kind, -1 if getattr(system, f"{kind}_force") > 0 else 1)
        elif kind == "vertical":
            vertical = True
        elif kind == "rotation":
            rotation = True
        elif kind == "inner":
            modes.inner = 1 - modes.inner
        elif kind == "wheel":
            z[WHEEL], modes.torque_over = 0.0, True
    if forced:
        _set_by_speeds(system, z, modes)
    return resolve(system, time, z, modes, spikes=may_stick, vertical=vertical, rotation=rotation)


def _lift(system: System, z: list[float], modes: Modes, n: int) -> None:
    """Spike `n` leaves the ground; what the ground still held when it let go is lost."""
    z[LOST] += max(system.stored(n, z, modes), 0.0)
    modes.touching = [m for m in modes.touching if m != n]
    modes.slip[n] = 0
    if not system.sheds:
        modes.top[n] = 0.0


def _set_by_speeds(system: System, z: list[float], modes: Modes) -> None:
    """After a forced step: who touches and which way they slide, read from the state as it is."""
    for n in range(system.trial.spike_count):
        h, _ = system.arms(n, z)
        inside = h - z[Y] > system.crater * modes.top[n]
        if inside and n not in modes.touching:
            modes.touching = sorted([*modes.touching, n])
            modes.touch(n, h - z[Y])
            modes.slip[n] = 1 if z[VX] - z[OMEGA] * h > 0 else -1
        elif not inside and n in modes.touching:
            _lift(system, z, modes, n)
        elif n in modes.touching and modes.slip[n]:
            slip = z[VX] - z[OMEGA] * h
            modes.slip[n] = 1 if slip > 0 else -1
    if modes.vertical:
        modes.vertical = 1 if system.s.up_x * z[VX] + system.s.up_y * z[VY] > 0 else -1
    if modes.rotation:
        modes.rotation = 1 if z[OMEGA] > 0 else -1
