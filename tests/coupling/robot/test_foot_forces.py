"""The law as a callback of MuJoCo: closed forms, and the same as a `RobotRun` within what each integrates."""

import numpy as np
import pytest
from spatial_runs import EXAMPLES, ball, moving

from coupling.robot import FootForces, LawFeet, MujocoRobot, RobotRun, find_feet, load_model
from coupling.robot.models import switch_off_floors

mujoco = pytest.importorskip("mujoco")

SOFT = {"stiffness": 2000.0, "damping": 30.0}


def stepped(model, names, duration, *, step=2e-4, before=None, **options):
    """The data of MuJoCo after `duration` [s] with the callback, and the callback."""
    switch_off_floors(model)
    model.opt.timestep = step
    data = mujoco.MjData(model)
    if before is not None:
        before(data)
    mujoco.mj_forward(model, data)
    with FootForces(find_feet(model, data, names), **options) as forces:
        for _ in range(round(duration / step)):
            mujoco.mj_step(model, data)
    assert mujoco.get_mjcb_passive() is None
    return data, forces


def test_a_ball_comes_to_rest_where_the_spring_carries_it_as_in_a_run():
    data, forces = stepped(ball(height=0.06), ["foot"], 1.2, parameters=SOFT)
    assert data.qpos[2] == pytest.approx(0.05 - 9.81 / 2000.0, rel=1e-3)
    robot = MujocoRobot(ball(height=0.06), "foot")
    run = RobotRun(robot, LawFeet(robot.feet, parameters=SOFT, time_step=2e-5), duration=0.1)
    run.run()
    early, _ = stepped(ball(height=0.06), ["foot"], 0.1, parameters=SOFT)
    assert early.qpos[2] == pytest.approx(robot.data.qpos[2], abs=5e-5)
    assert forces.points > 1000


def test_a_sliding_ball_comes_to_roll_at_five_sevenths_of_its_speed():
    """Friction that falls with the slip brings it there with a lag of slip_speed."""
    before = 0.3
    data, _ = stepped(
        ball(height=0.05), ["foot"], 0.5, before=lambda data: data.qvel.__setitem__(0, before), parameters=SOFT,
        slip_speed=2e-3,
    )  # fmt: skip
    assert data.qvel[0] == pytest.approx(5 / 7 * before, rel=1e-3)


@pytest.mark.parametrize(("name", "feet"), [("wheel", ["wheel", "grouser_*"]), ("hedgehog", ["tip_*"])])
def test_its_force_on_feet_of_many_points_is_that_of_the_ground_of_a_run(name, feet):
    """At rest, pressed 2 mm in: sums of K z over all points, and their moments."""
    model = load_model(EXAMPLES / f"mujoco-{name}" / f"{name}.xml")
    robot = MujocoRobot(model, feet, height=0.0)
    robot.lift(-0.002)
    ground = LawFeet(robot.feet, parameters={"stiffness": 1e3, "damping": 0.0})
    still = np.zeros(3)
    expected = ground.step(robot.pose.position, still, 1e-6, robot.pose.turn, still)
    robot.data.qfrc_passive[:] = 0.0
    FootForces(robot.feet, parameters={"stiffness": 1e3, "damping": 0.0})(robot.model, robot.data)
    linear, angular = robot.jacobian(robot.feet[0].body)
    pushed = linear.T @ expected.force + angular.T @ expected.torque
    assert expected.force[2] > 1.0
    assert robot.data.qfrc_passive == pytest.approx(pushed, abs=1e-9)


def test_what_cannot_be_is_refused():
    robot = moving(MujocoRobot(ball(), "foot"), 0, 0, 0, 0, 0, 0)
    with pytest.raises(ValueError, match="no surface law 'mud'"):
        FootForces(robot.feet, law="mud")
    with pytest.raises(ValueError, match="slip_speed"):
        FootForces(robot.feet, slip_speed=0.0)
