"""Events: what is watched for them, and which modes follow.

`monitors` are quantities that are positive as long as the modes hold. After an event `resolve` lets stick what the
force to hold, within the static bound, permits; the rest slides the consistent way. Normal forces depend on the depths
of the tips and their speeds, never on accelerations. So one direction of friction always has one answer (no Painleve
paradox): the force that would hold is either within its bound, or the contact starts to slide against it.
"""

import math
from collections.abc import Iterable, Sequence

from .dynamics import OMEGA, VX, VY, WHEEL, Modes, System, Y

__all__ = ["KINKS", "Monitor", "Watch", "cubic", "let_go", "monitors", "precision", "resolve", "triggered"]

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
        into = contact.rate - contact.settling
        found["lift", n] = (contact.depth - system.crater * max(top, contact.depth), into)
        if modes.slip[n]:
            slip_rate = ax - alpha * contact.h + omega * omega * contact.d
            found["slip", n] = (modes.slip[n] * contact.slip, modes.slip[n] * slip_rate)
        found["rate", n] = (contact.rate, math.nan)
        if system.settles and system.sheds:  # from new ground to unloading, while the ground gives way
            found["into", n] = (into, math.nan)
        if system.has_memory:
            found["fresh", n] = (top - contact.depth, -into)
            held = modes.held[n] if modes.held else top
            if held < top:
                found["again", n] = (held - contact.depth, -into)
    if any(modes.slip[n] == 0 for n in modes.touching):
        found["stick", -1] = (system.stick_bound - abs(system.stick_force), math.nan)
    for n in range(system.trial.spike_count):
        if n not in modes.touching:
            h, d = system.arms(n, z)
            bottom, slope = system.bottom(n, z, modes)
            found["touch", n] = (z[Y] - h + bottom, z[VY] + omega * d + slope * (z[VX] - omega * h))
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


KINKS = ("rate", "into", "fresh", "again")  # where only a derivative jumps
_KINK_SPEED, _KINK_DEPTH = 1e-8, 1e-12
_STANDSTILL = 1e-13  # m/s or rad/s: what rounding makes of a speed that stays zero


def triggered(before: Watch, after: Watch) -> list[Monitor]:
    found = []
    for key, (value, _) in after.items():
        start = before.get(key, (math.inf, 0.0))[0]
        if key[0] in ("rate", "into"):
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
    if key[0] in ("slip", "rate", "into"):
        return 1e-15
    if key[0] == "wheel":
        return 1e-12
    return 1e-15 * system.trial.weight


def cubic(u: float, start: float, end: float, rise_0: float, rise_1: float) -> float:
    """The cubic on 0 to 1 with these ends and slopes."""
    v = 1 - u
    return start * v * v * (1 + 2 * u) + rise_0 * u * v * v + end * u * u * (3 - 2 * u) - rise_1 * u * u * v


_SAME = 1e-12  # a slip speed [m/s] or rate [rad/s] below this is rounding


def _slip_rate(system: System, spike: int) -> float:
    """d(slip)/dt of a touching spike at the state last evaluated [m/s2]."""
    contact = next(contact for contact in system.contacts if contact.spike == spike)
    ax, _, alpha = system.acceleration
    omega = system.s.omega
    return ax - alpha * contact.h + omega * omega * contact.d


def resolve(
    system: System,
    time: float,
    z: list[float],
    modes: Modes,
    *,
    spikes: Iterable[int] = (),
    dry: Iterable[int] = (),
) -> list[float]:
    """Decide in `modes` whether what may stick now does; stop in `z` what sticking does not allow; return dz/dt.

    `spikes`: those whose slip speed is zero now, besides those that stick already. `dry`: which dry frictions may hold
    now, 0 the rig's and 1 the bearing's.
    """
    fresh = [n for n in spikes if n in modes.touching]
    for n in fresh:
        modes.slip[n] = 0
    for k in dry:
        modes.dry[k] = 0
    freed: set[object] = set()
    for _ in range(12):
        rate = system.derivative(time, z, modes)
        over = _violations(system, modes)
        if not over:
            break
        worst = max(over, key=lambda entry: entry[0])
        _release(system, time, z, modes, worst[1], fresh, freed)
    else:
        rate = system.derivative(time, z, modes)
    before = tuple(z[VX : OMEGA + 1])
    system.hold_still(z, modes)
    return rate if tuple(z[VX : OMEGA + 1]) == before else system.derivative(time, z, modes)


def _violations(system: System, modes: Modes) -> list[tuple[float, int]]:
    """Ratio of force to bound where it exceeds 1, of the spikes that stick (-1) and of each dry friction (0, 1)."""
    slack, over = 1 + 1e-12, []
    if any(modes.slip[n] == 0 for n in modes.touching):
        force, bound = abs(system.stick_force), system.stick_bound
        if force > bound * slack:
            over.append((force / bound if bound > 0 else float("inf"), -1))
    for k, (force, bound) in enumerate(zip(map(abs, system.dry_forces), system.dry_bounds, strict=True)):
        if bound > 0 and modes.dry[k] == 0 and force > bound * slack:
            over.append((force / bound, k))
    return over


def _release(
    system: System, time: float, z: list[float], modes: Modes, what: int, fresh: list[int], freed: set[object]
) -> None:
    if what >= 0:
        modes.dry[what] = -1 if system.dry_forces[what] > 0 else 1
        return
    force = system.stick_force
    sticking = [n for n in modes.touching if modes.slip[n] == 0]
    older = [n for n in sticking if n not in fresh]
    newer = [n for n in sticking if n in fresh]
    against = -1 if force > 0 else 1
    if newer and older:  # those that stuck before may hold without the newcomers
        for n in newer:
            modes.slip[n] = against
        system.derivative(time, z, modes)
        for n in newer:
            if modes.slip[n] * _slip_rate(system, n) < 0 and n not in freed:
                modes.slip[n] = -modes.slip[n]
                freed.add(n)
        return
    let_go(system, modes)


def let_go(system: System, modes: Modes) -> None:
    """Let every spike that sticks slide, against the force that held them all."""
    against = -1 if system.stick_force > 0 else 1
    for contact in system.contacts:
        if modes.slip[contact.spike] == 0:
            modes.slip[contact.spike] = against if abs(contact.slip) < _SAME else (1 if contact.slip > 0 else -1)
