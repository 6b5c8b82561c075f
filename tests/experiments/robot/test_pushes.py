"""A leg that drops, pushes and lands: the push by itself, a foot that swings, and a joint past its range."""

import re

import pytest

from experiments.robot.experiment import RobotFollowed
from experiments.robot.feet import heights_of
from experiments.robot.flight import find_flights
from experiments.robot.joints import beyond_range
from experiments.robot.plan import plan_robot
from experiments.robot.pushes import push_words, swing_warning, swings
from experiments.robot.result import conclude, quantities_of
from experiments.robot.settings import RobotSettings

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

LEG = """<mujoco><worldbody><body pos="0 0 0.307"><joint type="slide" axis="0 0 1"/>
<geom type="box" size="0.06 0.06 0.04" mass="2.5"/><body pos="0 0 -0.27">
<joint name="leg" type="slide" axis="0 0 -1" range="0 {reach}" limited="true" {stop}/>
<geom name="foot" type="sphere" size="0.025" mass="0.5"/></body></body></worldbody>
<actuator><motor joint="leg" ctrlrange="-100 100"/></actuator></mujoco>"""
PUSH = """def control(model, data):
    held = data.time < 0.25 or data.time > 0.33
    data.ctrl[0] = max(-40.0, -10.0 - 3000.0 * max(0.0, data.qpos[1]) - 60.0 * data.qvel[1]) if held else 100.0
"""


@pytest.fixture
def leg(tmp_path):
    """A function of options that follows the leg on a law: plan, run, heights and flights."""

    def follow(*, reach=0.2, stop="", **given):
        (tmp_path / "leg.xml").write_text(LEG.format(reach=reach, stop=stop), encoding="utf-8")
        (tmp_path / "push.py").write_text(PUSH, encoding="utf-8")
        plan = plan_robot(RobotSettings(**{
            "model": str(tmp_path / "leg.xml"), "feet": ("foot",), "controller": f"{tmp_path / 'push.py'}:control",
            "duration": 0.4,
        } | given))  # fmt: skip
        run = RobotFollowed(plan.settings, plan).run_on_law()
        run.run()
        heights = heights_of(run)
        return plan, run, heights, find_flights(run, heights)

    return follow


def test_the_push_has_its_own_depth_force_and_times_beside_those_of_a_later_landing(leg):
    _, run, heights, flights = leg(duration=1.0)
    found = {name: one["value"] for name, one in quantities_of(run, heights, flights).items()}
    launch = float(run.columns["time"][flights.rows[0][0]])
    assert found["push_sinkage_time"] <= launch < found["sinkage_largest_time"]
    assert found["push_force_time"] <= launch < found["largest_force_time"]
    own = run.columns["time"] <= launch
    assert found["push_sinkage"] == run.columns["sinkage"][own].max() < found["sinkage_largest"]
    assert found["push_force"] == abs(run.columns["fz"][own]).max() < found["largest_force"]
    said = " ".join(push_words(run, flights))
    for value in (1e3 * found["push_sinkage"], found["push_force"], found["push_force_time"], launch):
        assert f"{value:.3g} " in said
    early = leg(duration=0.4)
    assert len(push_words(early[1], early[3])) == 1  # it does not land
    still = leg(duration=0.2)
    assert "push_force" not in quantities_of(still[1], still[2], still[3])


def test_a_foot_that_swings_before_it_flies_is_told_of_the_loss_once_and_with_loss_it_is_not(leg):
    plan, run, heights, flights = leg()
    (said,) = swing_warning(run, heights, flights, plan)
    assert f" {swings(run, heights, flights)} times" in said and "loss=1" in said
    for given in ({"ground_parameters": ("loss=1",)}, {"ground": "bekker"}):
        plan, run, heights, flights = leg(**given)
        assert swing_warning(run, heights, flights, plan) == []


def test_a_joint_that_goes_past_its_range_is_named_with_how_far_and_when(leg, tmp_path):
    plan, run, _, _ = leg(reach=0.08)
    result = conclude(plan.settings, plan, run, tmp_path)
    (said,) = [words for words in result.warnings if "joint leg" in words]
    past, most, time = (
        float(re.search(pattern, said)[1]) for pattern in (r"went ([0-9.]+)", r"to ([0-9.]+)", r"at ([0-9.]+) s")
    )
    place = run.joints["qpos"][:, 1]
    assert most == 80 and past == pytest.approx(1e3 * place.max() - 80, rel=0.01)
    assert time == pytest.approx(run.columns["time"][place.argmax()], rel=0.01)
    for given in ({}, {"reach": 0.08, "stop": 'solreflimit="0.002 1"'}):
        assert beyond_range(leg(**given)[1]) == []
