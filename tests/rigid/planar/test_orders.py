"""The integrators converge at their orders, and the energy's residual with the tolerance."""

import numpy as np
from rigid_trials import free, in_rig

from rigid import simulate, simulate_batch
from rigid.planar.dynamics import System
from rigid.planar.located import integrate

NAMES = ("x", "y", "theta", "vx", "vy", "omega")


def end_of(trial, duration, *, longest=5e-3, tolerance=1e-12):
    last = {}
    integrate(
        System(trial), duration=duration, tolerance=tolerance, longest=longest,
        on_step=lambda t0, t1, z, at, modes: last.update(z=list(z)),
    )  # fmt: skip
    return np.array(last["z"][:6])


def order(errors):
    """Slope of the errors over halved steps."""
    return np.polyfit(range(len(errors)), -np.log2(errors), 1)[0]


# Trials with stick and slip, a lift-off, damper switches and the wheel's stop within.
MOTOR = (in_rig(0.125, mu_s=0.5), 0.4)
BRAKE = (in_rig(6.0, mu_s=0.25, actuator="brake", wheel_speed_0=300.0), 0.1)


def test_the_located_integrator_is_of_order_5_through_its_events():
    for trial, duration in (MOTOR, BRAKE):
        exact = end_of(trial, duration, tolerance=1e-13)
        errors = [np.abs(end_of(trial, duration, longest=h, tolerance=1e3) - exact).max() for h in (8e-3, 4e-3, 2e-3)]
        assert 4.3 < order(errors) < 5.7


def test_on_ground_with_a_huge_damper_implicit_steps_are_of_order_5_and_give_the_explicit_ones_motion(monkeypatch):
    # C / M is 2e4 to 1e5 per second; explicit steps are stable up to some M / C only.
    import rigid.planar.located as located

    trial = in_rig(0.22, mu_s=0.9, damping=1e5)
    monkeypatch.setattr(located, "_STIFF", np.inf)
    exact = end_of(trial, 0.1, tolerance=1e-11)
    monkeypatch.undo()
    errors = [np.abs(end_of(trial, 0.1, longest=h, tolerance=1e3) - exact).max() for h in (1e-2, 5e-3, 2.5e-3)]
    assert 4.3 < order(errors) < 5.7
    for torque in (0.22, 0.03):
        ours = simulate(in_rig(torque, damping=1e5), duration=0.2, sample_interval=0.01)
        monkeypatch.setattr(located, "_STIFF", np.inf)
        explicit = simulate(in_rig(torque, damping=1e5), duration=0.2, sample_interval=0.01)
        monkeypatch.undo()
        assert ours.notes["steps"] < 100 < 500 < explicit.notes["steps"]
        assert np.abs(ours.y - explicit.y).max() < 1e-9 and np.abs(ours.theta - explicit.theta).max() < 1e-8
        assert np.abs(ours.ay - explicit.ay).max() < 1e-4
        assert max(ours.energy_residual, explicit.energy_residual) < 2e-8


def test_the_paper_s_step_is_of_order_1():
    for trial, duration in (MOTOR, BRAKE):
        exact = end_of(trial, duration)
        errors = []
        for h in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
            run = simulate(trial, duration=duration, method="paper", time_step=h)
            errors.append(max(abs(getattr(run, name)[-1] - exact[k]) for k, name in enumerate(NAMES)))
        assert 0.8 < order(errors) < 1.3
        assert errors[0] < 2e-3


def test_the_batch_is_of_order_2_through_its_events():
    for trial, duration in (MOTOR, BRAKE):
        exact = end_of(trial, duration)
        errors = []
        for h in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
            final = simulate_batch([trial], duration=duration, time_step=h).final
            errors.append(max(abs(final[name][0] - exact[k]) for k, name in enumerate(NAMES)))
        assert 1.8 < order(errors) < 2.2


def test_the_energy_residual_falls_with_the_tolerance():
    for trial in (in_rig(0.22), BRAKE[0], free(0.3, mu_s=0.3)):
        residuals = [simulate(trial, duration=0.5, tolerance=t).energy_residual for t in (1e-6, 1e-8, 1e-10, 1e-12)]
        assert residuals[0] < 1e-6 and residuals[1] < 2e-8 and residuals[3] < 1e-11
        assert residuals[2] < 0.1 * residuals[0]
