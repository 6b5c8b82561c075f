"""Put a hopping leg of MuJoCo on a surface law, push it off, and print where it goes."""

import sys

from coupling.robot import LawFeet, MujocoRobot, RobotRun
from experiments.robot.own_loop import law_of_run

small = "--small" in sys.argv


def control(model, data):
    """One push of the leg."""
    data.ctrl[0] = -60.0 if 0.25 < data.time < 0.34 else 0.0


robot = MujocoRobot("hopper", feet=["foot"], controller=control)
sand = law_of_run(robot.model, ["foot"], surface="sand")  # as the command
ground = LawFeet(robot.feet, **sand.law, mu_s=sand.mu_s)
run = RobotRun(robot, ground, duration=0.35 if small else 1.0, substeps=4)
rows = run.run()
print(f"sinks {1e3 * rows['sinkage'].max():.1f} mm, rises {1e3 * (rows['z'].max() - rows['z'][0]):.1f} mm")
print(f"largest force {rows['fz'].max():.0f} N, energy left over {100 * run.energy_residual:.2g} %")

assert run.energy_residual < 0.01, "all energy is accounted for"
assert rows["sinkage"].max() > 0.005, "the sand gives way"
