"""When a platform rests: nothing moves and nothing will, before the torque changes.

Two ways to say so. `at_rest`: no speed at all, and no force left but rounding. `comes_to_rest`: what still moves is
less than the integrator's own error, and would not gather speed, since the equilibrium is near and stable. Without the
second a platform that its torque has shaken would be followed for ever, while it swings by less than an atom's width.
"""

from collections.abc import Callable

import numpy as np

from .dynamics import INNER, INNER_SPEED, LOST, OMEGA, THETA, VX, VY, WHEEL, Modes, System, X, Y

__all__ = ["at_rest", "comes_to_rest", "resting"]

_EPS = 2.0**-52
_REST = 1e-11  # accelerations below this share of g_sim (for the rotation g_sim / l) are rounding
_BRIM = 1e-6  # forces above their bound by less than this share hold: dry friction often ends a motion at its bound
_SLOW = 1e3  # accelerations above so many tolerances of g_sim are no rest, whatever the springs


def _may_rest(system: System, modes: Modes) -> bool:
    """Whether everything that touches sticks, and what holds now will hold later."""
    if not modes.touching or any(modes.slip[n] != 0 for n in modes.touching):
        return False
    if system.model.reads("time", but="torque_factor"):
        return False
    return modes.torque_over or not system.model.reads("time", "wheel_speed")


def at_rest(system: System, z: list[float], modes: Modes, rate: list[float]) -> bool:
    """Whether everything is at rest and stays so: no speed, everything sticks, and no force is left but rounding."""
    if z[VX] != 0.0 or z[VY] != 0.0 or z[OMEGA] != 0.0 or rate[LOST] != 0.0 or not _may_rest(system, modes):
        return False
    if system.inner and z[INNER_SPEED] != 0.0:
        return False
    trial = system.trial
    shallow = min(max(system.depth(n, z), _EPS * trial.spike_length) for n in modes.touching)
    small = max(_REST, 8 * _EPS * trial.spike_length / shallow) * trial.gravity_sim
    return _largest(system, rate) <= small


def _largest(system: System, rate: list[float]) -> float:
    """The largest acceleration [m/s2]."""
    inner = abs(rate[INNER_SPEED]) if system.inner else 0.0
    return max(abs(rate[VX]), abs(rate[VY]), abs(rate[OMEGA]) * system.s.length, inner)


def comes_to_rest(
    system: System, time: float, z: list[float], modes: Modes, scale: list[float], tolerance: float
) -> bool:
    """Whether what moves in `z` is below the tolerance and stays so; then its speeds are taken out, and booked as lost.

    `scale`: what the tolerance is relative to. Speeds within the tolerance; at zero speed, so without what the dampers
    hold up, the equilibrium no further than the tolerance, and stable: the accelerations' slopes over the coordinates
    that are free (the height, the angle with x rolling along, a term's own) have negative eigenvalues only. Dry
    frictions hold. Leaves the evaluation of the system at `z`.
    """
    speeds = (VX, VY, OMEGA, INNER_SPEED) if system.inner else (VX, VY, OMEGA)
    if any(abs(z[i]) > tolerance * scale[i] for i in speeds) or len(modes.touching) < 2 or not _may_rest(system, modes):
        return False
    still = list(z)
    for i in speeds:
        still[i] = 0.0
    holding = modes.copy()
    holding.dry = [0, 0]
    rate = system.derivative(time, still, holding)
    near = _largest(system, rate) <= _SLOW * tolerance * system.trial.gravity_sim
    forces, bounds = (system.stick_force, *system.dry_forces), (system.stick_bound, *system.dry_bounds)
    held = all(abs(force) <= bound * (1 + _BRIM) for force, bound in zip(forces, bounds, strict=True))
    if near and held and _is_stable(system, time, still, holding, rate, scale, tolerance):
        still[LOST] += system.energy(time, z, modes)[0]
        z[:] = still
        modes.dry = [0, 0]
        system.derivative(time, z, modes)
        return True
    system.derivative(time, z, modes)
    return False


def _is_stable(
    system: System, time: float, z: list[float], modes: Modes, rate: list[float], scale: list[float], tolerance: float
) -> bool:
    """Whether a stable equilibrium lies within the tolerance of `z`, where nothing moves."""
    free = [Y, THETA, INNER] if system.inner else [Y, THETA]
    if system.dry_bounds[0] > 0:
        if system.s.up_x != 0.0:
            return False
        free.remove(Y)
    if system.dry_bounds[1] > 0:
        free.remove(THETA)
    if not free:
        return True
    follows = {Y: VY, THETA: OMEGA, INNER: INNER_SPEED}
    total = sum(contact.load for contact in system.contacts)
    if total <= 0:
        return False
    mean_h = sum(contact.load * contact.h for contact in system.contacts) / total
    shallow = min(contact.depth for contact in system.contacts)
    if shallow <= 0:
        return False
    slopes = np.empty((len(free), len(free)))
    for k, i in enumerate(free):
        step = 1e-3 * shallow / (system.s.length if i == THETA else 1.0)
        sides = []
        for way in (step, -step):
            moved = list(z)
            moved[i] += way
            if i == THETA:
                moved[X] += mean_h * way
            found = system.derivative(time, moved, modes)
            sides.append([found[follows[j]] for j in free])
        slopes[:, k] = (np.array(sides[0]) - np.array(sides[1])) / (2 * step)
    values = np.linalg.eigvals(slopes)
    if not (np.isfinite(values).all() and (values.real < 0).all()):
        return False
    away = np.linalg.solve(slopes, [rate[follows[j]] for j in free])
    return bool((np.abs(away) <= tolerance * np.array([scale[i] for i in free])).all())


def resting(time: float, z: list[float], rate: list[float]) -> Callable[[float], list[float]]:
    """z of a platform that rests from `time` [s] on: only the wheel still changes its speed."""

    def at(t: float) -> list[float]:
        then = list(z)
        then[WHEEL] += (t - time) * rate[WHEEL]
        return then

    return at
