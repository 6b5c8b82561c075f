"""The wheel that ships, and a foot with an octagonal plate, on our bed and with the same grains in LAMMPS.

    python docs/results/lammps-push/bodies.py --seeds 1 2 3 4 5 6 --out bodies.csv

Both begin from the same grains, without the history of their contacts. A row of the CSV is one run: mean force of the
ground on the foot upwards (load) and along x (pull) [N], mean torque about y [N m], over the whole run.
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np

from coupling.lammps import LammpsBed
from coupling.robot import BedFeet, LammpsFeet, MujocoRobot, RobotRun
from dem import Bed

FRICTION = {"friction": 0.5, "rolling_friction": 0.0}  # LAMMPS' walls leave their own spin out of rolling
PLATE = """<mujoco><option timestep="1e-3" integrator="implicitfast"/>
<asset><mesh name="plate" vertex="{corners}"/></asset><worldbody><body pos="0 0 0.2">
<joint type="slide" axis="0 0 1"/><geom size=".02" mass="0.2"/><body pos="0 0 -.1" euler="0 4 0">
<joint axis="0 1 0" stiffness="2"/><geom name="foot" type="mesh" mesh="plate" mass="0.2"/></body></body>
</worldbody></mujoco>"""

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--size", type=float, nargs=3, default=(0.24, 0.2, 0.1), help="of the bed [m]")
parser.add_argument("--seeds", type=int, nargs="+", default=(1,), help="of the beds")
parser.add_argument("--bodies", nargs="+", default=("wheel", "plate"), choices=("wheel", "plate"))
parser.add_argument("--duration", type=float, default=0.1, help="of each run [s]")
parser.add_argument("--out", type=Path, required=True, help="the CSV; rows are added to it")


def robot_of(body, scratch):
    """The robot with its foot just above the sand."""
    if body == "wheel":
        return MujocoRobot("wheel", ["wheel", "grouser_*"], height=1e-3, keyframe="drive")
    angle = np.pi / 4 * np.arange(8)
    corners = " ".join(f"{0.03 * np.cos(a):.9g} {0.03 * np.sin(a):.9g} {z}" for a in angle for z in (-0.01, 0.01))
    (scratch / "plate.xml").write_text(PLATE.format(corners=corners), encoding="utf-8")
    return MujocoRobot(scratch / "plate.xml", "foot", height=1e-3)


def run_of(prepared, body, kind, asked):
    """Means of one run: load and pull [N], torque [N m]."""
    grains, stuff = prepared.grains(), prepared.material
    bed = Bed.from_grains(
        stuff, positions=grains.position, velocities=grains.velocity, spins=grains.spin, radii=grains.radius,
        size=tuple(asked.size), height=0.5, max_overlap=0.1, threads=1,
    )  # fmt: skip
    bed.surface = float((grains.position[:, 2] + grains.radius).max())  # a robot may not start in a grain
    robot = robot_of(body, asked.out.parent)
    used = LammpsBed(bed, ranks=1) if kind == "lammps" else bed
    feet = (LammpsFeet if kind == "lammps" else BedFeet)(
        used, robot.feet, origin=(0.5 * bed.size[0], 0.5 * bed.size[1]), **FRICTION
    )
    run = RobotRun(robot, feet, duration=asked.duration, substeps=4)
    try:
        run.run()
    finally:
        if kind == "lammps":
            used.close()
    return run.columns["fz"].mean(), run.columns["fx"].mean(), run.feet[:, 0, 11].mean()


def main():
    """Add the rows of all bodies, seeds and both grounds."""
    asked = parser.parse_args()
    for seed in asked.seeds:
        bed = Bed.prepare("sand", size=tuple(asked.size), grain=0.012, gravity=9.81, seed=seed, threads=1)
        for body in asked.bodies:
            for kind in ("bed", "lammps"):
                began = time.monotonic()
                means = run_of(bed, body, kind, asked)
                new = not asked.out.exists()
                with asked.out.open("a", newline="", encoding="utf-8") as stream:
                    head = [["body", "seed", "ground", "load_N", "pull_N", "torque_Nm"]]
                    rows = [[body, seed, kind, *(f"{value:.6g}" for value in means)]]
                    csv.writer(stream).writerows([*(head if new else []), *rows])
                print(body, seed, kind, *means, f"({time.monotonic() - began:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
