"""The law as a callback of MuJoCo: closed forms, and the same as a `RobotRun` within what each integrates."""

import numpy as np
import pytest
from spatial_runs import EXAMPLES, ball, moving

from coupling.robot import FootForces, LawFeet, MujocoRobot, RobotRun, find_feet, load_model
from coupling.robot.models import switch_off_floors
from rigid.ground.laws import find_law
from rigid.ground_file import read_ground

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

SOFT = {"stiffness": 2000.0, "damping": 30.0}


def stepped(model, names, duration, *, step=2e-4, before=None, **options):
    """The data of MuJoCo after `duration` [s] with the callback, and the callback."""
    switch_off_floors(model)
    model.opt.timestep = step
    data = mujoco.MjData(model)
    if before is not None:
        before(data)
    mujoco.mj_forward(model, data)
    with FootForces(model, data, find_feet(model, data, names), **options) as forces:
        for _ in range(round(duration / step)):
            mujoco.mj_step(model, data)
    assert mujoco.get_mjcb_passive() is None
    return data, forces


ANKLE = """<mujoco><worldbody><body pos="0 0 0.3"><joint type="slide" axis="0 0 1"/>
<geom type="box" size="0.06 0.06 0.04" mass="2.5"/><body pos="0 0 -0.27">
<geom name="foot" type="sphere" size="0.025" mass="0.1"/><site name="ankle"/></body></body></worldbody>
<sensor><force site="ankle"/></sensor></mujoco>"""


def test_a_force_sensor_does_not_see_the_ground_in_a_loop_of_ones_own_and_does_in_a_run():
    """A foot of 0.1 kg under 2.5 kg, at rest: the ankle carries 2.5 kg."""
    law = {"parameters": {"stiffness": 2000.0, "damping": 200.0}}
    data, forces = stepped(model := mujoco.MjModel.from_xml_string(ANKLE), ["foot"], 0.7, step=5e-4, **law)
    assert forces.forces(data)["foot"][2] == pytest.approx(2.6 * 9.81, rel=0.02)
    assert abs(data.sensordata[2]) < 0.1 * 9.81 * 1.1
    robot = MujocoRobot(model, "foot")
    RobotRun(robot, LawFeet(robot.feet, time_step=5e-5, **law), duration=0.7).run()
    assert abs(robot.data.sensordata[2]) == pytest.approx(2.5 * 9.81, rel=0.05)


def test_a_ball_comes_to_rest_where_the_spring_carries_it_as_in_a_run():
    data, forces = stepped(model := ball(height=0.06), ["foot"], 1.2, parameters=SOFT)
    mass = float(model.body_mass.sum())
    assert data.qpos[2] == pytest.approx(0.05 - 9.81 / 2000.0, rel=1e-3)
    robot = MujocoRobot(ball(height=0.06), "foot")
    run = RobotRun(robot, LawFeet(robot.feet, parameters=SOFT, time_step=2e-5), duration=0.1)
    run.run()
    early, _ = stepped(ball(height=0.06), ["foot"], 0.1, parameters=SOFT)
    assert early.qpos[2] == pytest.approx(robot.data.qpos[2], abs=5e-5)
    assert forces.points > 1000
    assert forces.forces(data)["foot"] == pytest.approx([0.0, 0.0, 9.81 * mass], rel=1e-3, abs=1e-9)


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
    forces = FootForces(robot.model, robot.data, robot.feet, parameters={"stiffness": 1e3, "damping": 0.0})
    forces(robot.model, robot.data)
    linear, angular = robot.jacobian(robot.feet[0].body)
    pushed = linear.T @ expected.force + angular.T @ expected.torque
    assert expected.force[2] > 1.0
    assert robot.data.qfrc_passive == pytest.approx(pushed, abs=1e-9)


@pytest.mark.parametrize("law", ["spring-damper", "hunt-crossley", "bekker", "rft"])
@pytest.mark.parametrize(
    "shape", [("box", ".03 .04 .02"), ("cylinder", ".03 .02"), ("capsule", ".02 .03"), ("ellipsoid", ".03 .05 .02")]
)
@pytest.mark.parametrize("tilt", [0.1, 1.5])
def test_its_wrench_on_a_foot_askew_is_the_sum_over_all_points_of_the_foot(law, shape, tilt):
    """Each point by `SurfaceLaw.force` at its depth and rate, with its friction, about the foot's origin."""
    model, mu_d, slow = ball(*shape, height=0.012), 0.3, 0.01
    data = mujoco.MjData(model)
    data.qpos[3:7] = np.array([np.cos(0.5 * tilt), 0.6 * np.sin(0.5 * tilt), 0.8 * np.sin(0.5 * tilt), 0.0])
    data.qvel[:] = 0.2, 0.1, -0.3, 0.5, -0.7, 0.4
    mujoco.mj_forward(model, data)
    (foot,) = find_feet(model, data, ["foot"])
    data.qfrc_passive[:] = 0.0
    forces = FootForces(model, data, [foot], law=law, parameters=find_law(law).values({}), mu_d=mu_d, slip_speed=slow)
    forces(model, data)
    turn, found = data.xmat[foot.body].reshape(3, 3), find_law(law)
    speed, spin, push = data.qvel[:3], turn @ data.qvel[3:], np.zeros(6)
    numbers = found.numbers({}, count=foot.parts[0].share)
    for arm in foot.lowest(turn):
        moving = speed + np.cross(spin, arm)
        load = found.force(-(data.qpos[2] + arm[2]), -moving[2], numbers)
        slip = moving[:2] * mu_d * load / max(slow, np.hypot(*moving[:2]))
        force = np.array([*-slip, load])
        push += np.concatenate([force, turn.T @ np.cross(arm, force)])
    assert push[2] > 0.1
    assert data.qfrc_passive == pytest.approx(push, rel=1e-12, abs=1e-12 * push[2])


def test_a_law_of_a_file_has_the_area_of_the_foot_over_that_of_its_tip():
    sand, model = read_ground(EXAMPLES.parents[2] / "docs" / "results" / "calibrate-sand-1mm" / "ground.toml"), ball()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    feet = find_feet(model, data, ["foot"])
    once, more = (
        pushed(FootForces(model, data, feet, law=sand.law, parameters=sand.values, scales=scales), model, data, 1e-3)
        for scales in ({}, {"foot": 25.0})
    )
    assert once == pytest.approx(sand.surface_law.force(1e-3, 0.0, sand.surface_law.numbers(sand.values)))
    assert more == pytest.approx(25 * once)


def test_what_cannot_be_is_refused():
    robot = moving(MujocoRobot(ball(), "foot"), 0, 0, 0, 0, 0, 0)
    with pytest.raises(ValueError, match="no surface law 'mud'"):
        FootForces(robot.model, robot.data, robot.feet, law="mud")
    with pytest.raises(ValueError, match="slip_speed"):
        FootForces(robot.model, robot.data, robot.feet, slip_speed=0.0)


def pushed(forces, model, data, depth):
    """Upward force of the law on a ball of 50 mm radius at `depth` [m], at rest, at the time of `data`."""
    data.qpos[:3], data.qvel[:] = (0.0, 0.0, 0.05 - depth), 0.0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    data.qfrc_passive[:] = 0.0
    forces(model, data)
    return data.qfrc_passive[2]


def sand_and(model):
    """New data of a model, and the callback for a law that remembers."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data, FootForces(model, data, find_feet(model, data, ["foot"]), law="katsuragi-durian")


def test_sand_pushes_less_below_the_deepest_depth_and_a_reset_makes_it_new():
    model = ball()
    data, forces = sand_and(model)
    fresh = pushed(forces, model, data, 1e-3)
    assert fresh > 1e-3
    for depth in (0.01, 1e-3):
        data.time += model.opt.timestep
        again = pushed(forces, model, data, depth)
    assert again == 0.0
    mujoco.mj_resetData(model, data)
    assert pushed(forces, model, data, 1e-3) == fresh
    assert [forces.forces(data)["foot"][2] for _ in range(2)] == [fresh, fresh]
    assert pushed(forces, model, data, 1e-3) == fresh  # reading has changed nothing
    data.time = 5.0  # a state from elsewhere
    assert pushed(forces, model, data, 0.01) > fresh
    data.time = 9.0
    assert pushed(forces, model, data, 1e-3) == fresh


@pytest.mark.parametrize("law", ["power-irreversible", "rft"])
@pytest.mark.parametrize("rise", [0.0, 2e-4])
def test_on_retreat_in_its_crater_a_foot_has_the_force_of_the_law_with_its_loss(law, rise):
    model, found, depth, speed = ball(), find_law(law), 0.01, 0.3
    values = found.values({"loss": 0.7, "loss_speed": 0.1})
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    forces = FootForces(model, data, find_feet(model, data, ["foot"]), law=law, parameters=values)
    pushed(forces, model, data, depth)
    data.time += model.opt.timestep
    data.qpos[2], data.qvel[2], data.qfrc_passive[:] = 0.05 - depth + rise, speed, 0.0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comVel(model, data)
    forces(model, data)
    kept = {"top": depth, "rebound": values["rebound"], "loss": found.loss(values)}
    expected = found.force(depth - rise, -speed, found.numbers(values), **kept)
    whole = found.force(depth - rise, 0.0, found.numbers(values), top=depth, rebound=values["rebound"])
    assert data.qfrc_passive[2] == pytest.approx(expected, rel=1e-9)
    assert expected == pytest.approx(whole * (1 - 0.7 * 0.75), rel=1e-9)


def test_a_second_look_at_the_same_time_leaves_no_trace():
    model = ball()
    data, forces = sand_and(model)
    fresh = pushed(forces, model, data, 1e-3)
    pushed(forces, model, data, 0.01)
    assert pushed(forces, model, data, 1e-3) == fresh


def test_each_data_has_its_own_depths_and_other_models_get_no_force():
    model = ball()
    data, forces = sand_and(model)
    fresh = pushed(forces, model, data, 1e-3)
    data.time += model.opt.timestep
    pushed(forces, model, data, 0.01)
    data.time += model.opt.timestep
    other = mujoco.MjData(model)
    other.time = data.time
    assert pushed(forces, model, other, 1e-3) == fresh
    assert pushed(forces, model, data, 1e-3) == 0.0
    stranger = ball()
    assert pushed(forces, stranger, mujoco.MjData(stranger), 1e-3) == 0.0


def test_two_models_may_have_their_laws_at_once():
    first, second = ball(), ball()
    (one, on_first), (two, on_second) = sand_and(first), sand_and(second)
    with on_first:
        with on_second:
            for model, data in ((first, one), (second, two)):
                data.qpos[2] = 0.04
                mujoco.mj_forward(model, data)
        assert one.qfrc_passive[2] == two.qfrc_passive[2] > 0.0
        mujoco.mj_forward(second, two)
        mujoco.mj_forward(first, one)
        assert one.qfrc_passive[2] > 0.0 == two.qfrc_passive[2]
    assert mujoco.get_mjcb_passive() is None


def test_a_step_that_is_too_long_for_the_law_is_refused_on_entry():
    model = ball()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass, step = float(model.body_mass.sum()), 1e-3
    model.opt.timestep = step
    feet, limit = find_feet(model, data, ["foot"]), 4 * mass / step**2  # K h^2 / 4 m = 1
    with FootForces(model, data, feet, parameters={"stiffness": 0.9 * limit, "damping": 0.0}):
        pass
    with pytest.raises(ValueError, match=r"model.opt.timestep = 0.001 s .*'foot'"):
        FootForces(model, data, feet, parameters={"stiffness": 1.1 * limit, "damping": 0.0}).__enter__()
    assert mujoco.get_mjcb_passive() is None


def test_a_slope_by_tilted_gravity_and_any_integrator_may_be_entered():
    model = ball()
    model.opt.gravity[:] = 1.0, 0.0, -9.7
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
    data, forces = sand_and(model)
    with forces:
        mujoco.mj_step(model, data)
    assert model.opt.gravity[0] == 1.0 and model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_RK4)


def test_the_bound_on_entry_is_where_a_ball_on_an_undamped_spring_gains_energy():
    """Steps v' = v - h K z / m, z' = z + h v' grow for K h^2 / 4 m above 1 only."""
    swings = []
    for share in (0.95, 1.05):
        model = ball()
        switch_off_floors(model)
        mass, step = float(model.body_mass.sum()), 1e-3
        model.opt.timestep, stiffness = step, share * 4 * mass / step**2
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        forces = FootForces(
            model, data, find_feet(model, data, ["foot"]), parameters={"stiffness": stiffness, "damping": 0.0}
        )
        mujoco.set_mjcb_passive(forces)
        rest = 0.05 - 9.81 * mass / stiffness
        data.qpos[2] = rest + 1e-8
        found = []
        for _ in range(20):
            mujoco.mj_step(model, data)
            found.append(abs(data.qpos[2] - rest))
        mujoco.set_mjcb_passive(None)
        swings.append(max(found) / 1e-8)
    assert swings[0] < 20 < 100 < swings[1]
