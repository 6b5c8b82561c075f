"""Geoms that are fixed to a foot and are no feet: the ground does not push them, and a run says so."""

import numpy as np
import pytest

from coupling.robot import LawFeet, MujocoRobot, RobotRun
from experiments.robot.on_grains import RobotFollowed, RobotOnBed
from experiments.robot.plan import plan_robot
from experiments.robot.result import conclude
from experiments.robot.settings import RobotSettings
from experiments.runs.progress import Progress

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

LEG = """<mujoco model="leg"><worldbody><body name="leg" pos="0 0 {height}"><joint type="slide" axis="0 0 1"/>
  <geom name="foot" size="0.02" mass="1"/>{shank}</body></worldbody></mujoco>"""
CAPSULE = '<geom {name} type="capsule" fromto="0 0 0 0 0 0.2" size="0.008" mass="0.1" {more}/>'
SHANK = CAPSULE.format(name='name="shank"', more="")


def leg(depth, shank=SHANK, feet=("foot",)):
    """A leg on a ball of 20 mm radius whose lowest point is this deep [m], followed for no time."""
    model = mujoco.MjModel.from_xml_string(LEG.format(height=0.02, shank=shank))
    robot = MujocoRobot(model, feet)
    ground = LawFeet(robot.feet, law="spring-damper", parameters={"stiffness": 100.0, "damping": 1.0}, mu_s=0.5)
    run = RobotRun(robot, ground, duration=0.1)
    robot.data.qpos[0] = -depth
    mujoco.mj_forward(robot.model, robot.data)
    run._sample()
    return run


@pytest.mark.parametrize("depth", [0.03, 0.06, 0.1])
def test_a_shank_is_in_the_ground_from_where_it_leaves_the_ball_and_its_depth_is_counted_from_the_surface(depth):
    """A shank of radius r leaves a ball of radius R at sqrt(R^2 - r^2) above its centre; the ball's own shell, a tenth
    of its diameter, belongs to it. Points on the shank are some 3 mm apart."""
    begins = ((0.02 + 0.004) ** 2 - 0.008**2) ** 0.5 + 0.02  # above the lowest point
    buried = leg(depth).buried
    if depth < begins:
        assert not buried
    else:
        assert buried.name == "shank" and buried.depth == pytest.approx(depth - begins, abs=3e-3)


@pytest.mark.parametrize(
    ("shank", "name"),
    [
        (CAPSULE.format(name="", more=""), "geom 1 of body leg, which has no name"),
        (CAPSULE.format(name='name="seen"', more='contype="0" conaffinity="0"'), ""),
        (f'<body name="calf">{SHANK}</body>', "shank"),
        (f'<body name="calf"><joint axis="0 1 0" pos="0 0 0.1"/>{SHANK}</body>', ""),
        ('<geom name="skin" size="0.0202" mass="0.1"/>', ""),
    ],
)
def test_what_is_fixed_counts_by_its_body_and_what_is_only_seen_or_around_the_foot_does_not(shank, name):
    assert leg(0.1, shank).buried.name == name


def test_a_spike_with_a_site_as_its_tip_goes_into_the_ground_without_a_word():
    tip = '<site name="tip" pos="0 0 -0.02"/>'
    assert not leg(0.1, SHANK + tip, ["tip"]).buried


def test_a_shank_that_is_named_is_a_foot():
    assert not leg(0.1, feet=["foot", "shank"]).buried


def test_a_run_keeps_the_deepest_and_goes_on_from_its_state_with_it():
    run = leg(0.1)
    deep, state = run.buried, run.state()
    run.robot.data.qpos[0] = 0.0
    mujoco.mj_forward(run.robot.model, run.robot.data)
    run._sample()
    assert run.buried == deep
    other = leg(0.0)
    other.restore({name: np.array(value) for name, value in state.items()})
    assert other.buried == deep


class Kept(Progress):
    """Keeps messages."""

    def __init__(self):
        super().__init__()
        self.said = []

    def message(self, text):
        self.said.append(text)


def settings_of(folder, height, **given):
    model = folder / "leg.xml"
    model.write_text(LEG.format(height=height, shank=SHANK).replace('mass="1"', 'mass="20"'), encoding="utf-8")
    own = {"model": str(model), "feet": ("foot",), "surface": "sand", "duration": 0.15}
    return RobotSettings(**own | given)


def test_a_run_on_a_law_says_once_on_its_way_and_at_its_end_that_the_ground_does_not_push_the_shank(tmp_path):
    settings = settings_of(tmp_path, 0.03)
    plan = plan_robot(settings)
    followed = RobotFollowed(settings, plan)
    run, said = followed.run_on_law(), []
    run.run(on_step=lambda run: said.append(followed.notice(run)))
    told = [one for one in said if one and "shank" in one]
    assert len(told) == 1 and "--feet" in told[0] and not said[-1]
    (warned,) = [one for one in conclude(settings, plan, run, tmp_path).warnings if "shank" in one]
    assert f"{1e3 * run.buried.depth:.3g} mm" in warned


def test_a_run_on_grains_says_so_before_the_bed_is_made(tmp_path):
    bed = {"ground": "bed", "grain": 0.004, "bed_size": (0.2, 0.2, 0.4), "spread": 0.1}
    settings = settings_of(tmp_path, 0.03, **bed, duration=0.12)
    progress = Kept()
    RobotOnBed(settings, plan_robot(settings)).announce(progress)
    assert [one for one in progress.said if "shank" in one and "Grains will not" in one]
