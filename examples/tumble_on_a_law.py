"""Let the Hedgehog tumble on a spring-damper surface and print how it leaves."""

import math

from rigid import Trial, simulate

trial = Trial(
    gravity_sim=0.0834,  # 0.0085 g in the gravity-offloading rig [m/s2]
    counterweight=5.21,  # [kg]
    torque=0.22,  # of the flywheel's motor [N m]
    mu_s=0.5,
    stiffness=7500.0,  # of a row of spikes: K [N/m], C [N s/m]
    damping=30.0,
)
run = simulate(trial, duration=2.5)
for time, state, theta in run.transitions:
    print(f"{time:6.3f} s  {state:10} turned by {math.degrees(theta):5.1f} degrees")
assert run.trajectory_angle is not None, "it leaves the surface"
print(f"leaves at {math.degrees(run.trajectory_angle):.1f} degrees; energy balance: {run.energy_residual:.1e}")

assert 0 < run.trajectory_angle < math.pi / 2, "upwards and forwards"
assert run.energy_residual < 1e-4, "the energy balance closes"
