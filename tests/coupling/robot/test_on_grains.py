"""A robot of MuJoCo on a bed of grains: as the master's own body in space, momentum, restarts, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from spatial_runs import EXAMPLES, ball, grain_bed, model_of, moving

from coupling import BedGround, LeftTheBedError, Master, SpatialBody, spatial_members
from coupling.members import HULL, ball_member
from coupling.robot import BedFeet, MujocoRobot, RobotRun
from rigid.platform.files import find_platform
from rigid.platform.platform import Platform
from rigid.platform.solids import box_vertices
from rigid.spatial.spatial import SpatialTrial

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")
pytestmark = pytest.mark.long

MIDDLE = (0.048, 0.048)
RADIUS, MASS = 0.015, 0.1
WALKER = """<mujoco><option timestep="5e-4" integrator="implicitfast"/><worldbody>
<body name="trunk" pos="0 0 .075"><freejoint/><geom type="box" size=".03 .03 .005" mass=".2"/>
<body pos="-.018 0 -.03"><joint name="left" axis="0 1 0" stiffness="2" damping=".01"/>
<geom name="left_shank" type="capsule" fromto="0 0 0 0 0 -.02" size=".004" mass=".01" contype="0" conaffinity="0"/>
<geom name="left_foot" type="box" size=".012 .012 .006" pos="0 0 -.024" mass=".05"/></body>
<body pos=".018 0 -.03"><joint name="right" axis="0 1 0" stiffness="2" damping=".01"/>
<geom name="right_foot" type="capsule" fromto="0 -.01 -.018 0 .01 -.018" size=".012" mass=".05"/></body>
</body></worldbody><actuator><motor joint="left"/></actuator></mujoco>"""


LEG = """<mujoco><option timestep="2e-4"/><worldbody><body name="trunk" pos="0 0 .0655">
<joint name="rail" type="slide" axis="0 0 1"/><geom type="box" size=".02 .02 .005" mass="1"/>
<body pos="0 0 -.049"><joint name="knee" type="slide" axis="0 0 1" stiffness="2000" damping="2"/>
<geom name="foot" type="sphere" size=".015" mass=".02"/></body></body></worldbody></mujoco>"""


def dropped(height=0.0165, *, gravity=-9.81, **options):
    robot = MujocoRobot(ball("sphere", f"{RADIUS}", mass=MASS, height=height, gravity=gravity), "foot")
    ground = BedFeet(grain_bed(), robot.feet, origin=MIDDLE, friction=0.5, restitution=0.5)
    return robot, ground


def test_a_ball_on_grains_moves_as_the_masters_own_body_in_space():
    """The same ball, thrown askew, as a `SpatialBody` under the same explicit exchange of second order."""
    robot, ground = dropped()
    moving(robot, 0.1, -0.05, -0.4, 0, 3, 0)
    run = RobotRun(robot, ground, duration=0.03, substeps=4)
    run.run()
    inertia = 0.4 * MASS * RADIUS**2
    platform = Platform(
        name="ball",
        mass=MASS,
        inertia=inertia * np.eye(3),
        tips=box_vertices([0.02, 0.02, 0.02]),
        hull_vertices=box_vertices([0.02, 0.02, 0.02]),
        wheels=(),
    )
    trial = SpatialTrial(platform=platform, gravity=9.81)
    body = SpatialBody(
        trial, position=(0.0, 0.0, 0.0165), velocity=(0.1, -0.05, -0.4), angular_velocity=(0.0, 3.0, 0.0)
    )
    bed = BedGround(
        grain_bed(),
        [replace(ball_member(RADIUS), row=HULL)],
        origin=MIDDLE,
        friction=0.5,
        restitution=0.5,
        bounded_across=True,
    )
    body.start(bed.lag)
    master = Master(body, bed, substeps=4)
    for _ in range(run.master.count):
        master.step()
    assert run.columns["fz"].max() > 5.0
    assert np.abs(robot.data.qpos[:3] - body.place).max() < 1e-5
    assert robot.rates[:3] == pytest.approx(body.twist.velocity, abs=2e-3)
    assert run.energy_residual < 0.01 and run.balance_numbers["momentum_residual"][0] < 1e-14


def test_the_hedgehog_lands_on_grains_as_the_spatial_model_does_on_the_same():
    """24 spikes and the hull of the shipped MJCF against `SpatialBody`, thrown on 768 grains of 30 mm."""
    file = EXAMPLES / "mujoco-hedgehog" / "hedgehog.xml"
    robot = MujocoRobot(file, ["spike_*", "hull"], keyframe="thrown", height=0.005)
    robot.model.opt.gravity[:] = 0.0, 0.0, -1.0
    start, (along, across, up, *spin) = robot.data.qpos[:3].copy(), robot.data.qvel[:6].tolist()
    grains, middle = {"gravity": 1.0, "young": 1e7, "diameter": 0.03}, {"origin": (0.24, 0.24), "friction": 0.5}
    run = RobotRun(robot, BedFeet(grain_bed(**grains), robot.feet, **middle), duration=0.12, substeps=4)
    run.run()
    platform = find_platform("hedgehog")
    body = SpatialBody(
        SpatialTrial(platform=platform, gravity=1.0),
        position=start,
        velocity=(along, across, up),
        angular_velocity=spin,
    )
    bed = BedGround(grain_bed(**grains), spatial_members(platform), bounded_across=True, **middle)
    body.start(bed.lag)
    master = Master(body, bed, substeps=4)
    for _ in range(run.master.count):
        master.step()
    assert run.columns["fz"].max() > 10 * 5.3  # ten times its weight: it has landed
    assert np.abs(robot.data.qpos[:3] - body.place).max() < 2e-6
    assert np.abs(robot.data.qpos[3:7] - body.pose.turn).max() < 2e-5


def test_momentum_and_angular_momentum_of_robot_and_grains_are_kept_and_energy_is_accounted_for():
    """A walker with two feet of other shapes, one of its joints driven.

    Its own momentum MuJoCo keeps to second order in its step: 2e-6 of 0.14 N s here.
    """
    robot = MujocoRobot(
        model_of(WALKER), ["left_foot", "right_foot"], height=0.004,
        controller=lambda model, data: data.ctrl.__setitem__(0, 0.02),
    )  # fmt: skip
    ground = BedFeet(grain_bed(), robot.feet, origin=MIDDLE, friction=0.5, restitution=0.5)
    run = RobotRun(robot, ground, duration=0.03)
    run.run()
    numbers = run.balance_numbers
    assert run.columns["touching"].max() == 2 and run.columns["fz"].max() > 3.0
    assert numbers["momentum_residual"][0] < 1e-5
    assert numbers["angular_momentum_residual"][0] < 1e-5
    assert run.energy_residual < 0.01 and numbers["dissipated_friction"][0] > 0


def test_a_light_foot_pressed_on_grains_by_its_leg_gives_the_work_that_the_grains_take():
    """Its acceleration is far below the ground's force over its mass, as the leg bears that; error of second order."""
    off = []
    for substeps in (5, 2):
        robot = MujocoRobot(model_of(LEG), ["foot"])
        ground = BedFeet(grain_bed(), robot.feet, origin=MIDDLE, friction=0.5, restitution=0.5)
        run = RobotRun(robot, ground, duration=0.04, substeps=substeps)
        run.run()
        off.append(run.balance_numbers["exchange_residual"][0])
        assert run.columns["fz"].max() > 40 * 0.02 * 9.81
    assert off[0] < 1e-3 and off[1] < 1e-4


def test_a_run_on_grains_goes_on_from_its_state_to_the_same_bits():
    def fresh():
        robot, ground = dropped()
        return RobotRun(robot, ground, duration=0.02)

    whole, half, other = fresh(), fresh(), fresh()
    for _ in range(20):
        half.advance()
    other.restore({key: np.array(value) for key, value in half.state().items()})
    expected, found = whole.run(), other.run()
    assert all((expected[name] == found[name]).all() for name in expected)
    assert (whole.feet == other.feet).all() and whole.samples["kinetic"][-1] == other.samples["kinetic"][-1]


def test_a_foot_among_the_grains_is_refused_with_the_height_that_would_do():
    robot, ground = dropped(0.010)
    with pytest.raises(
        ValueError, match=r"'foot' starts in the sand, .* mm into a grain: .* ([\d.]+) mm higher"
    ) as found:
        ground.place(robot.pose)
    higher = float(str(found.value).rsplit(" mm higher", 1)[0].rsplit(" ", 1)[1])
    robot.lift(1e-3 * higher)
    ground.place(robot.pose)


def test_a_foot_that_comes_down_beyond_the_bed_or_on_its_floor_ends_the_run():
    robot, ground = dropped()
    ground.origin[0] = 0.0955
    with pytest.raises(LeftTheBedError, match=r"foot 'foot' came down .* m beyond the bed along x"):
        RobotRun(moving(robot, 0.5, 0, -0.3, 0, 0, 0), ground, duration=0.05).run()
    robot, ground = dropped()
    ground._height = 0.005
    with pytest.raises(LeftTheBedError, match=r"foot 'foot' sank .* to within a grain of the floor"):
        RobotRun(robot, ground, duration=0.05).run()
