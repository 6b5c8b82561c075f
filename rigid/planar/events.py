"""What is watched for events: quantities that are positive as long as the modes hold."""

import math
from collections.abc import Sequence

from .dynamics import OMEGA, VY, WHEEL, Modes, System, Y

__all__ = ["KINKS", "Monitor", "Watch", "cubic", "monitors", "precision", "triggered"]

Monitor = tuple[str, int]  # Kind of event and the spike (or a number of its own)
Watch = dict[Monitor, tuple[float, float]]  # Each monitor's value and rate (NaN where it is not known)


def monitors(system: System, z: Sequence[float], modes: Modes) -> Watch:
    """Quantities that are positive within the modes, with their rates where known (else NaN).

    Uses what the last evaluation found, which must have been at `z` in `modes`.
    """
    found: Watch = {}
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
            held = modes.held[n] if modes.held else top
            if held < top:
                found["again", n] = (held - contact.depth, -contact.rate)
    if any(modes.slip[n] == 0 for n in modes.touching):
        found["stick", -1] = (system.stick_bound - abs(system.stick_force), math.nan)
    for n in range(system.trial.spike_count):
        if n not in modes.touching:
            h, d = system.arms(n, z)
            found["touch", n] = (z[Y] - h + system.crater * modes.top[n], z[VY] + omega * d)
    for k, (bound, way, speed) in enumerate(zip(system.dry_bounds, modes.dry, system.dry_speeds(z), strict=True)):
        if bound > 0 and way:
            found["halt", k] = (way * speed, math.nan)
        elif bound > 0:
            found["yield", k] = (bound - abs(system.dry_forces[k]), math.nan)
    if system.inner:
        found["inner", -1] = (system.inner_holds, math.nan)
    if system.trial.actuator == "brake" and not modes.torque_over and system.trial.torque > 0:
        found["wheel", -1] = (z[WHEEL], math.nan)
    return found


KINKS = ("rate", "fresh", "again")  # where only a derivative jumps
_KINK_SPEED, _KINK_DEPTH = 1e-8, 1e-12
_STANDSTILL = 1e-13  # m/s or rad/s: what rounding makes of a speed that stays zero


def triggered(before: Watch, after: Watch) -> list[Monitor]:
    found = []
    for key, (value, _) in after.items():
        start = before.get(key, (math.inf, 0.0))[0]
        if key[0] == "rate":
            if start * value < 0 and min(abs(start), abs(value)) > _KINK_SPEED and math.isfinite(start):
                found.append(key)
        elif key[0] in ("fresh", "again"):
            if start > _KINK_DEPTH and value < -_KINK_DEPTH:
                found.append(key)
        elif value < (-_STANDSTILL if key[0] in ("halt", "slip") else 0.0):
            found.append(key)
    return found


def precision(key: Monitor, system: System) -> float:
    """How near to zero a monitor must come: rounding of a length, a speed, a force."""
    if key[0] in ("lift", "touch", "fresh", "again", "inner"):
        return 1e-16 * system.s.length
    if key[0] in ("slip", "rate"):
        return 1e-15
    if key[0] == "wheel":
        return 1e-12
    return 1e-15 * system.trial.weight


def cubic(u: float, start: float, end: float, rise_0: float, rise_1: float) -> float:
    """The cubic on 0 to 1 with these ends and slopes."""
    v = 1 - u
    return start * v * v * (1 + 2 * u) + rise_0 * u * v * v + end * u * u * (3 - 2 * u) - rise_1 * u * u * v
