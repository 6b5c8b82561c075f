"""A small platform in space and a small bed under it, for tests of runs in space."""

import math
from pathlib import Path

import numpy as np

from rigid.platform.files import PLATFORM_FOLDER

__all__ = ["BALL", "CUBE", "EXAMPLES", "LEG", "ball", "grain_bed", "model_of", "moving", "small_bed"]

CUBE = PLATFORM_FOLDER / "cube.toml"
"""A cube on eight spikes, 30 mm across, with wheels about x and y, that ships."""


def small_bed(*_):
    """Two layers of large grains, almost at rest."""
    from dem import Bed
    from dem.grains.materials import SAND

    d, rows = 6e-3, 20
    low = [((i + 0.5) * d, (j + 0.5) * d, 0.5 * d) for i in range(rows) for j in range(rows)]
    high = [((i + 1.0) * d, (j + 1.0) * d, 0.5 * d + d * math.sqrt(0.5)) for i in range(rows) for j in range(rows)]
    positions = np.array(low + high) % [rows * d, rows * d, 1.0]
    bed = Bed.from_grains(
        SAND, positions=positions, radii=np.full(len(positions), 0.5 * d), young=1e6, max_overlap=0.2,
        size=(rows * d, rows * d, 0.05), height=0.3, threads=1, gravity=1.0,
    )  # fmt: skip
    bed.advance(200)
    bed.surface = float((bed.grains().position[:, 2] + 0.5 * d).max())
    return bed


# Robots of MuJoCo ----------------------------------------------------------------------------------------------------

EXAMPLES = Path(__file__).parents[1] / "coupling" / "robot" / "examples"
BALL = """<mujoco model="ball"><option timestep="1e-3" integrator="implicitfast" gravity="0 0 {gravity}"/><worldbody>
<geom name="floor" type="plane" size="1 1 .1"/>
<body name="ball" pos="0 0 {height}"><freejoint/><geom name="foot" type="{kind}" size="{size}" mass="{mass}"/></body>
</worldbody></mujoco>"""
LEG = """<mujoco model="leg"><option timestep="5e-4" integrator="implicitfast"/><worldbody>
<body name="hip" pos="0 0 0.125"><joint name="rail" type="slide" axis="0 0 1"/>
<geom name="block" type="box" size=".03 .03 .03" mass="1" contype="0" conaffinity="0"/>
<body name="shank" pos="0 0 -0.1"><joint name="knee" type="slide" axis="0 0 1" stiffness="300" damping="2"/>
<geom name="foot" type="sphere" size="0.02" mass="{foot_mass}"/></body></body></worldbody>
<actuator><motor name="push" joint="knee"/></actuator></mujoco>"""


def model_of(text: str):
    """The compiled model of an MJCF text."""
    import mujoco

    return mujoco.MjModel.from_xml_string(text)


def ball(kind="sphere", size="0.05", *, mass=1.0, height=0.1, gravity=-9.81):
    """One free body with one geom called ``foot``, over a floor of MuJoCo's."""
    return model_of(BALL.format(kind=kind, size=size, mass=mass, height=height, gravity=gravity))


def moving(robot, *rates):
    """The robot with these generalised velocities at its start."""
    robot.data.qvel[:] = rates
    return robot


def grain_bed(*, gravity=9.81, young=1e7, diameter=6e-3):
    """Three layers of 16 by 16 large grains, almost at rest."""
    from dem import Bed
    from dem.grains.materials import SAND

    d, rows = diameter, 16
    layers = [
        ((i + 0.5 + 0.5 * (k % 2)) * d, (j + 0.5 + 0.5 * (k % 2)) * d, (0.5 + k * math.sqrt(0.5)) * d)
        for k in range(3) for i in range(rows) for j in range(rows)
    ]  # fmt: skip
    bed = Bed.from_grains(
        SAND, positions=np.array(layers) % [rows * d, rows * d, 1.0], radii=np.full(len(layers), 0.5 * d), young=young,
        max_overlap=0.1, size=(rows * d, rows * d, d / 6e-3 * 0.05), height=d / 6e-3 * 0.3, threads=1, gravity=gravity,
    )  # fmt: skip
    bed.advance(200)
    bed.surface = float((bed.grains().position[:, 2] + 0.5 * d).max())
    return bed
