"""Write a robot of your own as a TOML file, let it tumble, and see how far it hops over the speed of its wheel."""

import sys
from pathlib import Path

from experiments import hop
from rigid import Trial, find_platform, simulate

ROBOT = """
format = "hedgebed-platform/1"
name = "Small Hedgehog"
[body]
mass = 4.2                     # kg
inertia = [0.04, 0.04, 0.04]   # kg m2 about x, y, z
[hull]
shape = "rhombicuboctahedron"
edge = 0.1378                  # m: 2 l sin(pi/8) for tips 0.18 m from the centre
[wheels]
inertia = 0.9e-3               # kg m2
max_speed = 1050.0             # rad/s
motor_torque = 0.22            # N m
brake_time = 0.1               # s, from any speed
axes = [[0.0, 1.0, 0.0]]
"""
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples")
out.mkdir(parents=True, exist_ok=True)
(out / "robot.toml").write_text(ROBOT, encoding="utf-8")
robot = find_platform(out / "robot.toml")
length = robot.stance().spike_length
trial = Trial(mass=robot.mass, inertia=robot.moment(), spike_length=length, gravity_sim=1e-2, torque=0.02, mu_s=0.6)
run = simulate(trial, duration=4.0)
print(f"{robot} turned by {run.theta[-1]:.2f} rad in {run.time[-1]:.1f} s, {1e3 * run.max_speed:.0f} mm/s at most")
for speed in (50.0, 100.0):  # of the wheel [rad/s]
    settings = hop.Settings(platform=str(out / "robot.toml"), gravity=1e-2, surface="brick", wheel_speed_0=speed)
    numbers = hop.run(settings, out / f"hop-{speed:g}")["quantities"]
    print(f"{speed:g} rad/s:", *(f"{name} = {numbers[name]['value']:.3g} m" for name in ("distance", "model_distance")))

assert abs(length - 0.18) < 1e-4 and len(robot.tips) == 24, "the robot is the one in the file"
assert run.energy_residual < 1e-4 and run.theta[-1] > 0.5, "it tumbles"
