"""One planar trial: `simulate` integrates it, accurately or the paper's way, and answers with a `Trajectory`."""

import bisect
import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from rigid.checks import check_above_zero, sample_times
from rigid.model.trial import Trial

from .dynamics import LOST, OMEGA, VX, VY, WORK, Modes, System, X, Y
from .located import integrate
from .methods import Interpolant
from .paper import integrate_fixed
from .statics import inner_slopes, leaning, standing, stiffness_at_rest
from .trajectory import LAUNCH_DISTANCE, STATES, Tally, Trajectory

__all__ = ["Method", "check_step", "longest_step", "simulate", "step_bound"]

Method = Literal["located", "paper"]
PAPER_STEP = 1e-3  # The paper's step [s]


def simulate(
    trial: Trial,
    *,
    duration: float,
    method: Method = "located",
    sample_interval: float = 1e-3,
    times: ArrayLike | None = None,
    tolerance: float = 1e-8,
    time_step: float = PAPER_STEP,
    lean: float | None = None,
) -> Trajectory:
    """Integrate one trial from static equilibrium, the torque starting at t = 0.

    Args:
        trial: its numbers.
        duration: end [s].
        method: "located" (accurate, events located in time) or "paper" (fixed step, of order 1).
        sample_interval: between samples [s], from 0 to `duration`, which is always one of them.
        times: sample times [s] instead, rising, within 0 to `duration`.
        tolerance: relative error of a step, method "located".
        time_step: of method "paper" [s].
        lean: instead it is held on its leading row until then, turned by this [rad] (`rigid.planar.statics.leaning`).

    Raises ValueError: a number that cannot be, named; a platform that cannot stand; a time step too long for the
    ground. RuntimeError: the motion is no longer finite.

    >>> trial = Trial(gravity_sim=0.0834, counterweight=5.21, torque=0.22, stiffness=7500, damping=30)
    >>> run = simulate(trial, duration=1)
    >>> [state for time, state, angle in run.transitions]
    ['slip', 'hop']
    >>> print(f"{math.degrees(run.trajectory_angle):.1f} degrees at lift-off")
    38.8 degrees at lift-off
    """
    if method not in get_args(Method):
        raise ValueError(f"method = {method!r} must be one of {', '.join(get_args(Method))}")
    check_above_zero(duration=duration, sample_interval=sample_interval, tolerance=tolerance, time_step=time_step)
    if tolerance > 1e-2:
        raise ValueError(f"tolerance = {tolerance} must be at most 0.01")
    samples = sample_times(duration, sample_interval, times).tolist()
    if method == "paper":
        check_step(trial, time_step)
    system = System(trial)
    start = standing(system) if lean is None else leaning(system, lean)
    recorder = _Recorder(system, samples, *start)
    if method == "paper":
        steps = math.ceil(duration / time_step * (1 - 1e-12))
        transitions = integrate_fixed(
            system, start, duration=steps * time_step, time_step=time_step, on_step=recorder.on_fixed_step
        )
        return recorder.build(method, transitions, {"steps": steps, "time_step": time_step})
    went = integrate(system, duration=duration, tolerance=tolerance, on_step=recorder.on_step, start=start)
    notes = {
        "steps": went.steps, "rejected_steps": went.rejected, "events": went.events,
        "forced_steps": went.forced_steps, "tolerance": tolerance,
    }  # fmt: skip
    return recorder.build(method, went.transitions, notes)


def longest_step(trial: Trial) -> float:
    """The longest step [s] that resolves the stiffest motion of the ground: 0.2 sqrt(M / K) of the heaviest load.

    K is the law's own slope at the depth where it carries the weight, M the least inertia that a row's tip offers.
    A fifth of sqrt(M / K), a thirtieth of the period, keeps the error of order 2 below half a percent. A damper adds
    the bound M / C (explicit steps are stable to 2 M / C). The same holds for a spring and a damper that a term has of
    its own, between its inertia and the platform's mass.
    """
    return min(_bounds(trial))


def _bounds(trial: Trial) -> tuple[float, float]:
    """The longest steps [s] for the ground, and for the spring and damper that a term has of its own."""
    system = System(trial)
    stiffness, damping = stiffness_at_rest(system)
    # 1 / M of a tip at its largest lever.
    carried = 0.0 if system.inner else trial.counterweight
    ground = step_bound(stiffness, damping, 1 / (trial.mass + carried) + trial.spike_length**2 / trial.inertia)
    if not system.inner:
        return ground, math.inf
    stiffness, damping, inertia = inner_slopes(system)
    return ground, step_bound(stiffness, damping, 1 / inertia + 1 / trial.mass)


def step_bound(stiffness: float, damping: float, inverse_mass: float) -> float:
    """The longest step [s] for a row's stiffness [N/m] and damping [N s/m] under a tip of this 1 / M [1/kg]."""
    bound = 0.2 / math.sqrt(stiffness * inverse_mass) if stiffness > 0 else math.inf
    return min(bound, 1 / (damping * inverse_mass)) if damping > 0 else bound


def check_step(trial: Trial, time_step: float) -> None:
    """Raises ValueError, naming what is too stiff, where `time_step` [s] is too long for the ground or for a term."""
    ground, inner = _bounds(trial)
    longest = min(ground, inner)
    if time_step > longest:
        what = _ground_words(trial)
        if ground > inner:
            own = [effect for effect in trial.effects if "inner_mass" in effect.term.hooks]
            what = " and ".join(f"effect {effect.id!r}, {_values(effect.values)}" for effect in own)
        raise ValueError(f"time_step = {time_step:g} s is too long for {what}: at most {longest:.3g} s would follow it")


def _ground_words(trial: Trial) -> str:
    if trial.ground is None:
        return f"the ground, stiffness = {trial.stiffness:g} N/m and damping = {trial.damping:g} N s/m"
    return f"ground = {trial.ground.name!r}, {_values(trial.ground.law.values(trial.ground.parameters))}"


def _values(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())


class _Recorder:
    """Follows an integration: rows at the sample times, largest speeds, the launch and the energy's residual."""

    def __init__(self, system: System, samples: list[float], z: list[float], modes: Modes) -> None:
        self.system, self.samples, self.next = system, samples, 0
        self.tally = Tally(system.trial, z[X], z[Y], sum(system.energy(0.0, z, modes)))
        self.last = (0.0, list(z), modes)
        self.rows: list[tuple[Any, ...]] = []

    def see(self, time: float, z: list[float], energy: tuple[float, float, float]) -> None:
        """One moment."""
        self.tally.see(time, z[VX], z[VY], z[OMEGA], sum(energy), z[WORK], z[LOST])

    def sample(self, time: float, z: list[float], modes: Modes, energy: tuple[float, float, float]) -> None:
        """The row of the next sample time, where the system was evaluated last."""
        a = self.system.acceleration
        self.rows.append((time, *z[:6], *a, z[6], STATES.index(modes.state), *energy, z[WORK], z[LOST]))
        self.next += 1

    def on_step(self, t0: float, t1: float, z1: list[float], at: Interpolant, modes: Modes) -> None:
        """A step of the accurate integrator, from `t0` to `t1` [s]; `at` gives the state within it."""
        tally = self.tally
        if tally.angle is None and tally.distance(z1[X], z1[Y]) >= LAUNCH_DISTANCE:
            low, high = t0, t1
            for _ in range(60):
                middle = 0.5 * (low + high)
                z = at(middle)
                low, high = (low, middle) if tally.distance(z[X], z[Y]) >= LAUNCH_DISTANCE else (middle, high)
                if not low < 0.5 * (low + high) < high:
                    break
            z = at(high)
            tally.launch(z[X], z[Y])
        # Samples up to the step's end; one that falls on an event belongs to what went before it.
        for t in self.samples[self.next : bisect.bisect_right(self.samples, t1)]:
            z = at(t)
            self.system.derivative(t, z, modes)
            energy = self.system.energy(t, z, modes)
            self.sample(t, z, modes, energy)
            self.see(t, z, energy)
        self.see(t1, z1, self.system.energy(t1, z1, modes))

    def on_fixed_step(self, time: float, z: list[float], rate: list[float], modes: Modes) -> None:
        """The end of a fixed step: samples lie on the straight line, their state is that of the step before."""
        tally, (start, before, kind) = self.tally, self.last
        energy = self.system.energy(time, z, modes)
        self.see(time, z, energy)
        away = tally.distance(z[X], z[Y])
        if tally.angle is None and away >= LAUNCH_DISTANCE:
            near = tally.distance(before[X], before[Y])
            share = (LAUNCH_DISTANCE - near) / (away - near)
            tally.launch(before[X] + share * (z[X] - before[X]), before[Y] + share * (z[Y] - before[Y]))
        close = 1e-9 * (time - start)
        while self.next < len(self.samples) and self.samples[self.next] <= time + close:
            t = self.samples[self.next]
            if t < time - close:
                share = (t - start) / (time - start)
                z_t = [a + share * (b - a) for a, b in zip(before, z, strict=True)]
                self.sample(t, z_t, kind, self.system.energy(t, z_t, kind))
            else:
                self.sample(t, z, modes, energy)
        self.last = (time, list(z), modes.copy())

    def build(self, method: str, transitions: Any, notes: dict[str, Any]) -> Trajectory:
        """What it was, as a trajectory."""
        names = [field.name for field in fields(Trajectory)][2:]  # of the arrays, in the order of `sample`
        arrays: dict[str, Any] = dict(zip(names, np.array(self.rows, dtype=float).T, strict=False))
        arrays["state"] = arrays["state"].astype(np.int8)
        tally = self.tally
        return Trajectory(
            trial=self.system.trial, method=method, transitions=tuple(transitions), trajectory_angle=tally.angle,
            max_speed=tally.max_speed, time_of_max_speed=tally.time_of_max_speed,
            max_angular_velocity=tally.max_spin, energy_residual=tally.residual, notes=notes, **arrays,
        )  # fmt: skip
