"""A robot of MuJoCo on surface laws: closed forms, `rigid.spatial` again, energy, stability, restarts."""

import math
import re

import numpy as np
import pytest
from spatial_runs import EXAMPLES, LEG, ball, model_of, moving

from coupling import LawGround, SpatialRun
from coupling.poses import Wrench
from coupling.robot import LawFeet, LostRobotError, MujocoRobot, RobotRun, load_model
from coupling.robot.stability import Load
from rigid.ground.laws import find_law
from rigid.platform.actuation import TorqueHistory
from rigid.platform.files import find_platform
from rigid.spatial.quaternions import from_turn, to_matrix
from rigid.spatial.spatial import SpatialTrial, simulate, standing

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HEDGEHOG = EXAMPLES / "mujoco-hedgehog" / "hedgehog.xml"
SPRING = {"stiffness": 2000.0, "damping": 0.0}
LOSSY = {"loss": 0.9, "loss_speed": 0.1}
BRICK = {"stiffness": 7500.0, "damping": 30.0}  # of one spike


def on_law(robot, step=4e-4, duration=0.5, *, parameters=SPRING, mu_s=0.5, **options):
    ground = LawFeet(robot.feet, parameters=parameters, mu_s=mu_s, time_step=0.1 * step)
    run = RobotRun(robot, ground, duration=duration, **options)
    run.run()
    return run


def test_a_ball_that_falls_is_where_a_falling_body_is_whatever_the_step():
    """z = h - g t^2 / 2: MuJoCo's velocity belongs to half a step before, and is started there."""
    for step in (4e-4, 2e-3):
        run = on_law(MujocoRobot(ball(height=2.0), "foot"), step, 0.4)
        assert run.columns["z"][-1] == pytest.approx(2.0 - 0.5 * 9.81 * 0.16, abs=1e-12)


def test_a_ball_swings_on_the_spring_as_an_oscillator_does_with_an_error_of_second_order():
    """z = A cos(w t) about where it rests, w^2 = K / m."""
    off = []
    for step in (2e-3, 1e-3):
        robot = MujocoRobot(ball(height=0.05 - 0.004), "foot")
        run = on_law(robot, step, 0.5, checked=False)
        rest, swing = 9.81 / 2000.0, 9.81 / 2000.0 - 0.004
        expected = 0.05 - rest + swing * np.cos(math.sqrt(2000.0) * run.columns["time"])
        off.append(float(np.abs(run.columns["z"] - expected).max()) / swing)
    assert off[1] < 0.01 and off[0] / off[1] == pytest.approx(4.0, rel=0.1)


def test_a_sliding_ball_comes_to_roll_at_five_sevenths_of_its_speed():
    """Angular momentum about the point of contact is kept: v = 5 v0 / 7 (Landau and Lifshitz, section 38)."""
    robot = moving(MujocoRobot(ball(height=0.05), "foot"), 0.3, 0, 0, 0, 0, 0)
    run = on_law(robot, 4e-4, 0.5)
    assert robot.rates[0] == pytest.approx(5 / 7 * 0.3, rel=1e-4)
    assert robot.rates[4] * 0.05 == pytest.approx(robot.rates[0], rel=1e-4)
    assert run.energy_residual < 1e-3


def test_a_box_on_its_four_corners_stays_where_it_is_put_and_a_push_beyond_friction_moves_it():
    """It sinks W / K; below mu_s W it sticks, above it slides at (F - mu_d W) / m."""
    for push, moves in ((0.45, False), (0.55, True)):
        robot = MujocoRobot(ball("box", "0.05 0.05 0.005", height=0.004, gravity=-2.0), "foot")
        robot.data.qfrc_applied[0] = push * 2.0
        run = on_law(robot, 4e-4, 0.2, parameters={"stiffness": 2000.0, "damping": 40.0}, checked=False)
        way = float(run.columns["x"][-1])
        if moves:
            speed = float(robot.rates[0])
            assert speed / 0.2 == pytest.approx((push - 0.25) * 2.0, rel=0.01) and way > 0.01
        else:
            assert abs(way) < 2e-5
        assert run.columns["z"][-1] == pytest.approx(0.005 - 2.0 / 2000.0, rel=0.02)


def test_a_wheel_on_rails_is_not_pushed_where_it_cannot_move_and_rolls_without_slip():
    """Driven at 2 rad/s, its grousers no feet, on an axle that has no way to go sideways."""
    robot = MujocoRobot(load_model(EXAMPLES / "mujoco-wheel" / "wheel.xml"), ["wheel"], keyframe="drive")
    run = on_law(robot, 4e-4, 0.3, parameters={"stiffness": 6000.0, "damping": 130.0})
    assert np.abs(run.columns["fy"]).max() == 0.0 and run.columns["fz"].max() < 500.0
    assert robot.rates[0] == pytest.approx(0.1 * robot.rates[2], rel=0.01)
    assert run.energy_residual < 0.02


def test_the_hedgehog_as_mjcf_is_that_of_the_spatial_model_with_an_error_of_second_order():
    """`rigid.simulate_spatial`, which locates its events: pivot and slip, 0.5 s; as the master's own body in space."""
    platform = find_platform("hedgehog")
    trial = SpatialTrial(
        platform=platform, gravity=0.0834, mu_s=0.5, ground_parameters=BRICK,
        torques=(TorqueHistory.constant(platform.wheel(), 0.22),), torque_in_flight=True,
    )  # fmt: skip
    position, quaternion = standing(trial)
    model = simulate(trial, duration=0.5, sample_interval=0.5, tolerance=1e-9)
    off = []
    for step in (1e-3, 5e-4):
        robot = MujocoRobot(load_model(HEDGEHOG), "tip_*", keyframe="tumble")
        robot.data.qpos[:7] = [*position, *quaternion]
        robot.lift(0.0)
        run = on_law(robot, step, 0.5, parameters=BRICK, checked=False)
        off.append(max(
            np.abs(robot.data.qpos[:3] - model.position[-1]).max(),
            np.abs(robot.data.qpos[3:7] - model.quaternion[-1]).max(),
        ))  # fmt: skip
        assert run.energy_residual < 1e-6
    assert off[1] < 1e-6 and off[0] / off[1] > 3.4
    assert robot.rates[7] + robot.rates[4] == pytest.approx(-0.22 * 0.5 / 1.2e-3, rel=1e-6)  # of the wheel, absolute


@pytest.mark.long
def test_the_hedgehog_lands_on_one_corner_as_the_masters_own_body_in_space_does():
    start = {
        "position": (0.0, 0.0, 0.23), "quaternion": tuple(from_turn([0.3, -0.5, 0.2])), "velocity": (0.05, -0.03, -0.1),
        "angular_velocity": (0.5, 0.8, -0.3),
    }  # fmt: skip
    trial = SpatialTrial(platform=find_platform("hedgehog"), gravity=0.0834, mu_s=0.5, ground_parameters=BRICK)
    ours = SpatialRun(trial, LawGround.of_spatial(trial), duration=0.6, substeps=4, **start)
    ours.run()
    robot = MujocoRobot(load_model(HEDGEHOG), "tip_*")
    robot.data.qpos[:7] = [*start["position"], *start["quaternion"]]
    spin = to_matrix(start["quaternion"]).T @ start["angular_velocity"]
    moving(robot, *start["velocity"], *spin, *-spin)  # the wheels stand still
    robot.lift(0.0)
    run = on_law(robot, 4e-4, 0.6, parameters=BRICK)
    assert run.columns["fz"].max() > 1.0
    assert np.abs(robot.data.qpos[:3] - ours.body.place).max() < 1e-6
    assert np.abs(robot.data.qpos[3:7] - ours.body.turn).max() < 1e-6


def test_the_work_at_the_interface_agrees_from_both_sides_with_an_error_of_second_order():
    """A leg whose motor pushes in turn up and down: of the exchange alone, and with all that MuJoCo did."""
    off = []
    for step in (1e-3, 5e-4):
        robot = MujocoRobot(model_of(LEG.format(foot_mass=0.2)), "foot", controller=pushing)
        robot.data.qpos[0] = -0.0105
        run = on_law(robot, step, 0.3, checked=False)
        assert run.columns["actuator_work"][-1] > 0.02
        numbers = run.balance_numbers
        off.append([numbers["coupling_residual"][0], numbers["exchange_residual"][0]])
    assert (np.array(off[1]) < [5e-4, 2e-3]).all() and np.array(off[0]) / off[1] == pytest.approx([4.0, 4.0], rel=0.15)


def pushing(model, data):
    """Up and down, five times a second."""
    data.ctrl[0] = -3.0 * math.sin(2 * math.pi * 5 * data.time)


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "given"),
    [("hunt-crossley", {}), ("power", {}), ("katsuragi-durian", {}), ("bekker", {}), ("rft", {}), ("rft", LOSSY),
     ("bekker", LOSSY)],
)  # fmt: skip
def test_every_law_stops_the_robot_and_its_impulse_is_what_the_robot_gained(law, given):
    robot = MujocoRobot(ball("sphere", "0.01", mass=0.05, height=0.0103), "foot")
    ground = LawFeet(robot.feet, law=law, parameters=find_law(law).values(given), time_step=1e-5)
    run = RobotRun(robot, ground, duration=0.1)
    rows = run.run()
    impulse = run.macro_step * float(rows["fz"].sum())
    assert impulse - 0.05 * 9.81 * robot.time == pytest.approx(0.05 * robot.rates[2], abs=1e-12)
    assert impulse > 0.01 and rows["z"].min() > -0.05
    assert run.energy_residual < 0.02


@pytest.mark.long
def test_a_foot_too_light_for_the_explicit_exchange_is_refused_or_iterated():
    """K H^2 / 4 m = 1 is where explicit steps become unstable; iterated, the same foot follows the spring."""

    def leg():
        return MujocoRobot(model_of(LEG.format(foot_mass=0.01)), "foot", height=None)

    stiff, step = {"stiffness": 2e5, "damping": 0.0}, 1e-3
    with pytest.raises(ValueError, match=r"'foot' is too light .* substeps = 4, or iterations = 20, or a heavier foot"):
        on_law(leg(), step, 0.1, parameters=stiff)
    wild = on_law(leg(), step, 0.2, parameters=stiff, checked=False)
    calm = on_law(leg(), step, 0.2, parameters=stiff, iterations=20)
    fine = on_law(leg(), 2e-4, 0.2, parameters=stiff)
    assert calm.load == pytest.approx(2e5 * step**2 / 4 / 0.01, rel=0.1) and calm.master.exchange.unsettled <= 3
    assert calm.energy_residual < 0.1 * wild.energy_residual
    assert float(calm.columns["fz"].mean()) == pytest.approx(float(fine.columns["fz"].mean()), rel=0.05)


@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_a_swing_that_stays_in_the_ground_grows_as_the_load_says(damping):
    """m = 1 kg rests on a spring and is pushed: the swing's height after 0.1 s, from the eigenvalues of the step."""
    macro_step, duration = 1e-3, 0.1
    load = Load("foot", 1.0, 2e5, damping)
    robot = MujocoRobot(ball("sphere", "0.01", mass=1.0, height=0.01), "foot")
    ground = LawFeet(robot.feet, parameters={"stiffness": load.stiffness, "damping": damping}, time_step=1e-4)
    robot.data.qpos[2] -= 9.81 / load.stiffness
    robot.data.qvel[2] = 1e-4
    run = RobotRun(robot, ground, duration=duration, checked=False)
    swing = np.abs(run.run()["z"] - (0.01 - 9.81 / load.stiffness))
    period = round(2 * math.pi / math.sqrt(load.stiffness) / macro_step) + 1
    grown = swing[-period:].max() / swing[:period].max()
    assert grown == pytest.approx(load.growth(macro_step, duration - period * macro_step), rel=0.1)


RING = """<mujoco><worldbody><body pos="0 0 .01"><freejoint/>
<inertial pos="0 0 0" mass=".012" diaginertia="{inertia} {inertia} {inertia}"/>{balls}</body></worldbody></mujoco>"""


@pytest.mark.parametrize("inertia", [1e-4, 1e-6])
def test_parts_of_one_foot_load_the_exchange_together_and_what_is_just_above_stable_is_refused(inertia):
    """Twelve balls on a ring of radius r: L = max(12 K / m, 6 K r^2 / I), of its fall and of its rocking."""
    angles, radius, step = 2 * math.pi / 12 * np.arange(12), 0.05, 4e-4
    balls = "".join(
        f'<geom name="foot_{k}" size=".01" pos="{radius * math.cos(a)} {radius * math.sin(a)} 0"/>'
        for k, a in enumerate(angles)
    )
    most = max(12 / 0.012, 6 * radius**2 / inertia)
    for load in (0.98, 1.02):
        robot = MujocoRobot(model_of(RING.format(inertia=inertia, balls=balls)), "foot_*")
        spring = {"stiffness": 0.5 * load * 4 / step**2 / most, "damping": 0.5 * load / step / most}
        ground = LawFeet(robot.feet, parameters=spring, time_step=0.1 * step)
        if load < 1:
            assert RobotRun(robot, ground, duration=0.1).load == pytest.approx(load, rel=1e-6)
        else:
            with pytest.raises(ValueError, match=r"too light for this ground.*1.02 times"):
                RobotRun(robot, ground, duration=0.1)


def test_on_a_spring_without_damping_a_swing_grows_by_the_closed_form_in_each_exchange():
    """Eigenvalue of the step of docs/coupling.md on a spring: 1 + k^2 / 8 for a small k = K H^2 / m; 0.2 here."""
    k, step = 0.2, 1e-3
    change = np.array([[1, 1, 0.5], [-k, 1 - 0.5 * k, -0.25 * k], [-k, -0.5 * k, -0.25 * k]])  # of z, H v, F H^2 / m
    growth = float(np.abs(np.linalg.eigvals(change)).max())
    assert growth == pytest.approx(1 + k**2 / 8, rel=1e-3)
    deep = 9.81 * step**2 / k
    robot = MujocoRobot(ball(height=0.05 - 1.01 * deep), "foot")
    rest = Wrench(np.array([0.0, 0.0, 9.81]), np.zeros(3))
    spring = {"stiffness": k / step**2, "damping": 0.0}
    run = on_law(robot, step, 0.15, parameters=spring, checked=False, first_guess=rest)
    swing = run.columns["z"] - (0.05 - deep)
    assert np.ptp(swing[-30:]) / np.ptp(swing[:30]) == pytest.approx(growth ** (len(swing) - 30), rel=0.05)


def test_a_posture_on_the_way_that_loads_the_exchange_more_than_the_start_is_kept():
    """A ball on a long arm falls over: along the arm it has the whole mass, across it that of the ball alone."""
    arm = model_of(
        "<mujoco><option gravity='0 0 0'/><worldbody><body pos='0 0 .5'><joint type='slide' axis='0 0 1' armature='9'/>"
        "<geom size='.01' mass='1'/><body><joint type='hinge' axis='0 1 0'/>"
        "<geom name='foot' size='.01' pos='0 0 -.2' mass='.1'/></body></body></worldbody></mujoco>"
    )
    loads = []
    for duration in (4e-4, 0.2):
        run = on_law(moving(MujocoRobot(arm, "foot"), 0.0, 0.5 * math.pi / 0.2), 4e-4, duration)
        loads.append(run.load)
    assert loads[0] == pytest.approx(2000 * 4e-4**2 / 4 / 10.1, rel=0.01)
    assert loads[1] == pytest.approx(2000 * 4e-4**2 / 4 / 0.1, rel=0.05)


def test_a_robot_whose_state_or_control_is_no_number_ends_the_run_instead_of_starting_anew(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file there
    text = LEG.format(foot_mass=0.1).replace("<motor ", '<position kp="5e6" ')
    with pytest.raises(LostRobotError, match=r"lost at .* s: .* too large") as lost:
        on_law(MujocoRobot(model_of(text), "foot"), 4e-4, 0.3)
    assert "gains" in lost.value.remedy
    broken = MujocoRobot(
        model_of(LEG.format(foot_mass=0.1)), "foot", controller=lambda _, data: data.ctrl.fill(math.nan)
    )
    with pytest.raises(LostRobotError, match=r"control .data.ctrl. that is no number") as lost:
        on_law(broken, 4e-4, 0.1)
    assert "controller" in lost.value.remedy


def test_a_robot_that_has_been_run_and_a_part_below_the_surface_are_refused():
    robot = MujocoRobot(ball(), "foot")
    on_law(robot, 1e-3, 0.01)
    with pytest.raises(ValueError, match=r"another run has it.* 0.01 s.* new MujocoRobot"):
        on_law(robot, 1e-3, 0.02)
    deep = LEG.format(foot_mass=0.1).replace('size=".03 .03 .03"', 'size=".03 .03 .14"')
    with pytest.raises(ValueError, match=r"'block', which is no foot, starts 0.015 m below"):
        on_law(MujocoRobot(model_of(deep), "foot"), 1e-3, 0.01)


def test_a_foot_that_starts_in_the_ground_is_refused_by_name_and_a_height_lifts_it():
    with pytest.raises(ValueError, match=r"'foot' starts 0.01 m below the surface"):
        on_law(MujocoRobot(ball(height=0.04), "foot"))
    robot = MujocoRobot(ball(height=0.04), "foot", height=0.003)
    assert robot.clearance == pytest.approx(0.003)
    rail = MujocoRobot(model_of(LEG.format(foot_mass=0.2)), "foot", height=0.1)
    assert rail.clearance == pytest.approx(0.1)
    hinged = LEG.format(foot_mass=0.2).replace('type="slide" axis="0 0 1"/>', 'type="hinge" axis="0 1 0"/>')
    with pytest.raises(ValueError, match="no free joint or upright rail"):
        MujocoRobot(model_of(hinged), "foot", height=0.1)


def test_floors_of_mujocos_own_world_touch_nothing():
    robot = MujocoRobot(ball(height=0.06), "foot")
    assert robot.floors == ("floor",)
    run = on_law(robot, 4e-4, 0.2)
    assert run.columns["z"].min() < 0.045  # it has gone through z = 0, where MuJoCo's floor was


URDF = """<robot name="leg"><link name="base"/><link name="shank"><inertial><mass value="1"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
<collision name="foot"><origin xyz="0 0 -0.1"/><geometry><sphere radius="0.03"/></geometry></collision></link>
<joint name="rail" type="prismatic"><parent link="base"/><child link="shank"/><origin xyz="0 0 0.2"/>
<axis xyz="0 0 1"/><limit effort="10" velocity="1" lower="-1" upper="1"/></joint></robot>"""


def test_a_urdf_stands_where_the_spring_carries_it(tmp_path):
    (tmp_path / "leg.urdf").write_text(URDF)
    robot = MujocoRobot(tmp_path / "leg.urdf", ["foot"], height=0.0)
    run = on_law(robot, 1e-3, 0.6, parameters={"stiffness": 2000.0, "damping": 100.0})
    assert run.columns["sinkage"][-1] == pytest.approx(9.81 / 2000.0, rel=0.01)


@pytest.mark.long
def test_the_scripts_of_the_page_run_as_they_stand_in_any_folder(monkeypatch, tmp_path):
    root = EXAMPLES.parents[2]
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (root / "docs" / "mujoco.md").read_text(), flags=re.S)
    on_laws = [block for block in blocks if "Bed.prepare" not in block]  # the other: test_own_loop.py
    assert len(on_laws) == 2 and len(blocks) == 3
    for block in on_laws:
        exec(compile(block, "docs/mujoco.md", "exec"), {})


def test_the_controller_is_called_at_the_models_own_step_whatever_the_exchanges():
    for step in (2e-4, 1e-3, 4e-3):
        times: list[float] = []

        def clocked(model, data, times=times):
            times.append(data.time)

        robot = MujocoRobot(model_of(LEG.format(foot_mass=0.2)), "foot", controller=clocked)
        on_law(robot, step, 0.1)
        assert len(times) == pytest.approx(0.1 / max(5e-4, min(step, 5e-4)), abs=1)
        assert np.diff(times) == pytest.approx(5e-4, rel=0.41)


def test_a_run_goes_on_from_its_state_to_the_same_bits():
    def fresh():
        robot = MujocoRobot(load_model(HEDGEHOG), "tip_*", keyframe="tumble", height=0.002)
        return RobotRun(robot, LawFeet(robot.feet, parameters=BRICK), duration=0.2, iterations=3)

    whole = fresh()
    half = fresh()
    for _ in range(90):
        half.advance()
    other = fresh()
    other.restore({key: np.array(value) for key, value in half.state().items()})
    expected, found = whole.run(), other.run()
    assert all((expected[name] == found[name]).all() for name in expected)
    assert (whole.feet == other.feet).all() and (whole.joints["qpos"] == other.joints["qpos"]).all()
