"""Which mode follows an event: stick where the force to hold is within the static bound, slide the consistent way else.

Normal forces depend on where the tips are and how fast they go in, never on accelerations, so for one direction of
friction there is always one answer (no Painleve paradox): the force that would hold is either within its bound, or the
contact starts to slide against it.
"""

from collections.abc import Iterable

from .dynamics import OMEGA, VX, Modes, System

__all__ = ["let_go", "resolve"]

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

    Args:
        system: the trial's equations of motion.
        time: of the event [s].
        z: state vector; speeds that sticking forbids (rounding, or a tip that just stopped) are taken out.
        modes: changed in place.
        spikes: those whose slip speed is zero now, besides those that stick already.
        dry: which dry frictions may hold now: 0 the rig's, 1 the bearing's.
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
