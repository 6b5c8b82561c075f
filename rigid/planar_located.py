"""The accurate integrator: every event is located in time, and the motion between events is smooth.

Between events Dormand and Prince's pair of orders 5 and 4 with its own interpolant (Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, II.4 to II.6); the step adapts to `tolerance`. Events (touch-down, lift-off, the
static bound, slip through zero, the damper's switch, new ground under a spike with memory, end of the torque, the
wheel's stop) are roots of a function of the state. A root is found by repeating the step itself with other lengths, so
the state at an event has the step's own accuracy. Grazing is looked for between the ends of a step. Events at one
moment are taken one after the other without a step between them. More than `_CROWD` within a microsecond are answered
with a step of a microsecond in the present modes, which is counted (`forced_steps`), not hidden.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .dynamics import LOST, OMEGA, THETA, VX, VY, WHEEL, Modes, System, Y
from .modes import let_go, resolve, settle
from .statics import standing

__all__ = ["Progress", "integrate"]

_C = (0.2, 0.3, 0.8, 8 / 9, 1.0)
_A2 = (0.2,)
_A3 = (3 / 40, 9 / 40)
_A4 = (44 / 45, -56 / 15, 32 / 9)
_A5 = (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729)
_A6 = (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656)
_B = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
_E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
_D = (
    -12715105075 / 11282082432, 0.0, 87487479700 / 32700410799, -10690763975 / 1880347072,
    701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423,
)  # fmt: skip

_LONGEST = 5e-3  # [s] with a spike in the ground
_LONGEST_HOP = 2e-2  # [s] in flight
_SHORTEST = 1e-9  # [s] below which the step no longer adapts
_CROWD, _MOMENT = 40, 1e-6  # events, and within which time [s]

Monitor = tuple[str, int]
Interpolant = Callable[[float], list[float]]


@dataclass
class Progress:
    """What an integration has left: called back for every accepted step, and how it went."""

    steps: int = 0
    rejected: int = 0
    events: int = 0
    forced_steps: int = 0
    transitions: list[tuple[float, str, float]] = field(default_factory=list)


@dataclass(slots=True)
class _Step:
    z: list[float]
    rates: list[list[float]]
    error: float


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
    before: dict[Monitor, tuple[float, float]] = {}
    fresh = True
    scale = _scale(system)
    while time < duration:
        if settle(system, time, z, modes, rate):
            end = duration if modes.torque_over else min(duration, trial.torque_until)
            modes.resting = True
            on_step(time, end, z, _constant(z), modes)
            modes.resting, time = False, end
            told.steps += 1
            if time >= duration:
                break
            modes.torque_over = True
            rate, fresh = resolve(system, time, z, modes, vertical=True, rotation=True), True
            continue
        ends = duration if modes.torque_over else min(duration, trial.torque_until)
        room = ends - time
        h = min(h, longest if modes.touching else _LONGEST_HOP, room)
        if room - h < 1e-3 * h:
            h = room
        if fresh:  # the last evaluation was at z
            before, fresh = _monitors(system, z, modes), False
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
        on_step(time, time + h, step.z, _interpolant(time, h, z, step), modes)
        time, told.steps = time + h, told.steps + 1
        if room - h <= 0:
            time = ends
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
        h = h_next
    return told


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


def _scale(system: System) -> list[float]:
    """What the tolerance is relative to: a length, an angle, their rates, and energies, of the trial's own size."""
    trial = system.trial
    length = trial.spike_length
    rate = math.sqrt(trial.gravity_sim / length)
    energy = trial.weight * length
    wheel = max(trial.wheel_speed_0, 1.0)
    return [0.1 * length, 0.1 * length, 0.1, length * rate, length * rate, rate, 10 * wheel, energy, energy]


def _attempt(
    system: System,
    time: float,
    z: Sequence[float],
    modes: Modes,
    k1: list[float],
    h: float,
    scale: Sequence[float],
    tolerance: float,
) -> _Step:
    rates = [k1]
    try:
        for c, weights in zip(_C, (_A2, _A3, _A4, _A5, _A6), strict=True):
            rates.append(system.derivative(time + c * h, _combine(z, h, weights, rates), modes))
        end = _combine(z, h, _B, rates)
        rates.append(system.derivative(time + h, end, modes))
    except (ValueError, OverflowError, ZeroDivisionError):  # far beyond what is finite: too long a step
        return _Step(list(z), rates, math.inf)
    error = 0.0
    for i in range(9):
        off = h * sum(e * k[i] for e, k in zip(_E, rates, strict=True))
        error = max(error, abs(off) / (tolerance * (scale[i] + abs(z[i]))))
        if off != off:
            return _Step(end, rates, math.inf)
    return _Step(end, rates, error)


def _combine(z: Sequence[float], h: float, weights: Sequence[float], rates: list[list[float]]) -> list[float]:
    used = [(h * w, k) for w, k in zip(weights, rates, strict=False) if w]
    if len(used) == 1:
        (a, k), = used
        return [x + a * p for x, p in zip(z, k, strict=True)]
    return [x + sum([a * k[i] for a, k in used]) for i, x in enumerate(z)]


def _interpolant(time: float, h: float, z: list[float], step: _Step) -> Interpolant:
    """The pair's own continuous extension, of order 4."""
    end, rates = step.z, step.rates

    def at(t: float) -> list[float]:
        u = (t - time) / h if h > 0 else 1.0
        if u >= 1.0:
            return list(end)
        v = 1 - u
        out = []
        for i in range(9):
            rise = end[i] - z[i]
            bow = h * rates[0][i] - rise
            fall = rise - h * rates[6][i] - bow
            more = h * sum(d * k[i] for d, k in zip(_D, rates, strict=True))
            out.append(z[i] + u * (rise + v * (bow + u * (fall + v * more))))
        return out

    return at


def _constant(z: list[float]) -> Interpolant:
    return lambda t: list(z)


# -- events -----------------------------------------------------------------------------------------------------------


def _monitors(system: System, z: Sequence[float], modes: Modes) -> dict[Monitor, tuple[float, float]]:
    """Quantities that are positive within the modes, with their rates where known (else NaN).

    Uses what the last evaluation found, which must have been at `z` in `modes`.
    """
    found: dict[Monitor, tuple[float, float]] = {}
    ax, _, alpha = system.acceleration
    omega = z[OMEGA]
    for contact in system.contacts:
        n, top = contact.spike, modes.top[contact.spike]
        found["lift", n] = (contact.depth - system.crater * max(top, contact.depth), contact.rate)
        if modes.slip[n]:
            slip_rate = ax - alpha * contact.h + omega * omega * contact.d
            found["slip", n] = (modes.slip[n] * contact.slip, modes.slip[n] * slip_rate)
        found["rate", n] = (contact.rate, math.nan)
        if system.has_memory:
            found["fresh", n] = (top - contact.depth, -contact.rate)
    if any(modes.slip[n] == 0 for n in modes.touching):
        found["stick", -1] = (system.stick_bound - abs(system.stick_force), math.nan)
    if z[Y] < system.s.length:
        for n in range(system.trial.spike_count):
            if n not in modes.touching:
                h, d = system.arms(n, z)
                if h > 0 or modes.top[n] > 0:
                    gap = z[Y] - h + system.crater * modes.top[n]
                    found["touch", n] = (gap, z[VY] + omega * d)
    if system.vertical_bound > 0:
        if modes.vertical:
            speed = system.s.up_x * z[VX] + system.s.up_y * z[VY]
            found["vertical", 0] = (modes.vertical * speed, math.nan)
        else:
            found["vertical", 1] = (system.vertical_bound - abs(system.vertical_force), math.nan)
    if system.rotation_bound > 0:
        if modes.rotation:
            found["rotation", 0] = (modes.rotation * omega, math.nan)
        else:
            found["rotation", 1] = (system.rotation_bound - abs(system.rotation_force), math.nan)
    if system.trial.actuator == "brake" and not modes.torque_over and system.trial.torque > 0:
        found["wheel", -1] = (z[WHEEL], math.nan)
    return found


_KINKS = ("rate", "fresh")  # where only a derivative jumps
_KINK_SPEED, _KINK_DEPTH = 1e-8, 1e-12


def _triggered(before: dict[Monitor, tuple[float, float]], after: dict[Monitor, tuple[float, float]]) -> list[Monitor]:
    found = []
    for key, (value, _) in after.items():
        start = before.get(key, (math.inf, 0.0))[0]
        if key[0] == "rate":
            if start * value < 0 and min(abs(start), abs(value)) > _KINK_SPEED and math.isfinite(start):
                found.append(key)
        elif key[0] == "fresh":
            if start > _KINK_DEPTH and value < -_KINK_DEPTH:
                found.append(key)
        elif value < 0:
            found.append(key)
    return found


def _lowest(
    system: System,
    time: float,
    z: list[float],
    modes: Modes,
    rate: list[float],
    h: float,
    before: dict[Monitor, tuple[float, float]],
    after: dict[Monitor, tuple[float, float]],
    scale: Sequence[float],
    tolerance: float,
) -> tuple[float, _Step, dict[Monitor, tuple[float, float]]] | None:
    """A shorter step that ends where a monitor, positive at both ends, is lowest between them and below zero.

    Only monitors that come near zero by the cubic through both ends are followed, by the root of their rate.
    """
    for key, (end, end_rate) in after.items():
        if key[0] not in ("touch", "slip", "lift") or key not in before:
            continue
        start, start_rate = before[key]
        if not (start > 0 and end >= 0 and start_rate < 0 < end_rate):
            continue
        least = min(_cubic(0.05 * k, start, end, h * start_rate, h * end_rate) for k in range(1, 20))
        if least > 0.1 * max(start, end):
            continue
        low, low_rate, high, high_rate = 0.0, start_rate, h, end_rate
        for _ in range(30):
            guess = low - low_rate * (high - low) / (high_rate - low_rate)
            edge = 1e-3 * (high - low)
            guess = min(max(guess, low + edge), high - edge)
            step = _attempt(system, time, z, modes, rate, guess, scale, tolerance)
            values = _monitors(system, step.z, modes)
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


def _cubic(u: float, start: float, end: float, rise_0: float, rise_1: float) -> float:
    """The cubic on 0 to 1 with these ends and slopes."""
    v = 1 - u
    return start * v * v * (1 + 2 * u) + rise_0 * u * v * v + end * u * u * (3 - 2 * u) - rise_1 * u * u * v


def _locate(
    system: System,
    time: float,
    z: list[float],
    modes: Modes,
    rate: list[float],
    h: float,
    step: _Step,
    before: dict[Monitor, tuple[float, float]],
    scale: Sequence[float],
    tolerance: float,
) -> tuple[float, _Step, list[Monitor]]:
    """The step up to the first event within it, and which event that is."""
    after = _monitors(system, step.z, modes)
    found = _triggered(before, after)
    if not found:
        dip = _lowest(system, time, z, modes, rate, h, before, after, scale, tolerance)
        if dip is None:
            return h, step, []
        h, step, after = dip
        found = _triggered(before, after)
        if not found:
            return h, step, []
    low, high, high_step, high_values = 0.0, h, step, after
    low_values: dict[Monitor, float] = {key: before.get(key, (0.0, 0.0))[0] for key in found}
    for key in found:
        if key[0] not in _KINKS and low_values[key] <= 0:  # it is over at once
            return 0.0, _Step(list(z), [rate] * 7, 0.0), [key]
    signs = {key: 1.0 if low_values[key] > 0 else -1.0 for key in found}
    weight_low = 1.0
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
        values = _monitors(system, trial_step.z, modes)
        crossed = [key for key in found if signs[key] * values[key][0] < 0]
        if not crossed:
            tiny = min(signs[key] * values[key][0] for key in found)
            low, low_values = guess, {key: values[key][0] for key in found}
            weight_low = 1.0
            if tiny == 0.0:
                high_step, high_values, high = trial_step, values, guess
                found = [key for key in found if values[key][0] == 0.0]
                break
        else:
            weight_low = 0.5 if guess < high else 1.0
            high, high_step, high_values, found = guess, trial_step, values, crossed
            if all(abs(values[key][0]) <= _precision(key, system) for key in crossed):
                break
    return high, high_step, found


def _precision(key: Monitor, system: System) -> float:
    """How near to zero a monitor must come: rounding of a length, a speed, a force."""
    if key[0] in ("lift", "touch", "fresh"):
        return 1e-16 * system.s.length
    if key[0] in ("slip", "rate"):
        return 1e-15
    if key[0] == "wheel":
        return 1e-12
    return 1e-15 * system.trial.weight


def _keep(system: System, z: list[float], modes: Modes) -> None:
    """What outlives a step: the deepest depths."""
    if not system.has_memory:
        return
    for contact in system.contacts:
        modes.top[contact.spike] = max(modes.top[contact.spike], contact.depth)
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
            modes.top[n] = max(modes.top[n], 0.0)
            if abs(slip) < 1e-14:
                may_stick.append(n)
        elif kind == "lift":
            held = system.stored(n, z, modes)
            if held > 0:  # what the ground still held when it let go
                z[LOST] += held
            modes.touching = [m for m in modes.touching if m != n]
            modes.slip[n] = 0
            if not system.sheds:
                modes.top[n] = 0.0
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
        elif kind == "wheel":
            z[WHEEL], modes.torque_over = 0.0, True
    if forced:
        _set_by_speeds(system, z, modes)
    return resolve(system, time, z, modes, spikes=may_stick, vertical=vertical, rotation=rotation)


def _set_by_speeds(system: System, z: list[float], modes: Modes) -> None:
    """After a forced step: who touches and which way they slide, read from the state as it is."""
    for n in range(system.trial.spike_count):
        h, _ = system.arms(n, z)
        inside = h - z[Y] > system.crater * modes.top[n]
        if inside and n not in modes.touching:
            modes.touching = sorted([*modes.touching, n])
            modes.slip[n] = 1 if z[VX] - z[OMEGA] * h > 0 else -1
        elif not inside and n in modes.touching:
            modes.touching = [m for m in modes.touching if m != n]
        elif n in modes.touching and modes.slip[n]:
            slip = z[VX] - z[OMEGA] * h
            modes.slip[n] = 1 if slip > 0 else -1
    if modes.vertical:
        modes.vertical = 1 if system.s.up_x * z[VX] + system.s.up_y * z[VY] > 0 else -1
    if modes.rotation:
        modes.rotation = 1 if z[OMEGA] > 0 else -1
