"""The paper's integrator: a fixed step of 1 ms, modes that change at the next step.

The paper gives the step and not the method. This is the plainest that holds: semi-implicit Euler (speeds first, then
the pose with the new speeds), of order 1. Touch-down, lift-off, stick and slip follow from the state at the start of a
step. It is here to show what that step does; the located integrator is the one to trust.
"""

import math
from collections.abc import Callable

from rigid.checks.unfit import UnfitSettingsError

from .dynamics import INNER, INNER_SPEED, LOST, OMEGA, THETA, VX, VY, WHEEL, WORK, Modes, System, X, Y
from .events import resolve
from .statics import at_rest

__all__ = ["integrate_fixed"]

OnStep = Callable[[float, list[float], list[float], Modes], None]


def integrate_fixed(
    system: System, start: tuple[list[float], Modes], *, duration: float, time_step: float, on_step: OnStep
) -> list[tuple[float, str, float]]:
    """Step from `start` to `duration` [s]; `on_step(time, z, dz/dt, modes)` sees the start and every step.

    Returns the transitions (time, state, theta). Raises RuntimeError where numbers stop being finite.
    """
    trial = system.trial
    z, modes = start
    modes.torque_over = trial.torque == 0 or trial.torque_until <= 0
    still = [n for n in modes.touching if modes.slip[n] == 0]
    rate = resolve(system, 0.0, z, modes, spikes=still, dry=(0, 1))
    transitions = [(0.0, modes.state, z[THETA])]
    on_step(0.0, z, rate, modes)
    count = round(duration / time_step)
    for k in range(1, count + 1):
        time = k * time_step
        if at_rest(system, z, modes, rate):
            z[WHEEL] += time_step * rate[WHEEL]
            if trial.actuator == "brake" and not modes.torque_over and z[WHEEL] <= 0 and trial.torque > 0:
                z[WHEEL], modes.torque_over = 0.0, True
                rate = resolve(system, time, z, modes, dry=(0, 1))
            on_step(time, z, rate, modes)
            if not modes.torque_over and time >= trial.torque_until:
                modes.torque_over = True
                rate = resolve(system, time, z, modes, dry=(0, 1))
            continue
        before = {n: system.depth_and_slip(n, z)[1] for n in modes.touching}
        speeds, turning = system.dry_speeds(z), z[OMEGA]
        for i in (VX, VY, OMEGA, WHEEL):
            z[i] += time_step * rate[i]
        for i in (X, Y, THETA):
            z[i] += time_step * z[i + 3]
        if system.inner:
            z[INNER_SPEED] += time_step * rate[INNER_SPEED]
            z[INNER] += time_step * z[INNER_SPEED]
        for i in range(system.first, system.size):
            z[i] += time_step * rate[i]
        # The energy balance takes the speeds' mean over the step.
        mean = 0.5 * (turning + z[OMEGA])
        z[WORK] += time_step * (rate[WORK] / turning * mean if turning else system.s.torque * mean)
        z[LOST] += time_step * rate[LOST]
        if not all(map(math.isfinite, z)):
            raise UnfitSettingsError(f"the motion is no longer finite at t = {time:.6g} s")
        rate = _read_modes(system, time, z, modes, before, speeds)
        if modes.state != transitions[-1][1]:
            transitions.append((time, modes.state, z[THETA]))
        on_step(time, z, rate, modes)
    return transitions


def _read_modes(
    system: System, time: float, z: list[float], modes: Modes, before: dict[int, float], speeds: list[float]
) -> list[float]:
    trial = system.trial
    if not modes.torque_over and time >= trial.torque_until:
        modes.torque_over = True
    if trial.actuator == "brake" and not modes.torque_over and z[WHEEL] <= 0 and trial.torque > 0:
        z[WHEEL], modes.torque_over = 0.0, True
    stopped = []
    for n in range(trial.spike_count):
        depth, slip = system.depth_and_slip(n, z)
        inside = system.inside(n, z, modes)
        if system.has_memory and depth > 0:
            modes.remember(n, depth)
        if inside and n not in modes.touching:
            system.enter(n, z, modes)
        elif not inside and n in modes.touching:
            z[LOST] += system.stored(n, z, modes)
            system.leave(n, z, modes)
        elif inside and modes.slip[n]:
            if before.get(n, slip) * slip <= 0:
                stopped.append(n)
            else:
                modes.slip[n] = 1 if slip > 0 else -1
        if n not in modes.touching and depth + system.given_way(n, z) <= 0:
            system.forget(n, z, modes)
    if system.inner:
        system.derivative(time, z, modes)
        if system.inner_holds < 0:
            modes.inner = 1 - modes.inner
    pairs = zip(modes.dry, speeds, system.dry_speeds(z), strict=True)
    halted = [k for k, (way, old, new) in enumerate(pairs) if way and old * new <= 0]
    return resolve(system, time, z, modes, spikes=stopped, dry=halted)
