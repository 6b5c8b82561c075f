"""What a run on a law of sand states of a foot that is faster or deeper than the law was compared with grains."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from coupling.robot import FootForces, find_feet, load_model
from coupling.robot.soles import FASTEST
from experiments.robot.feet import heights_of, too_deep, too_fast
from experiments.robot.on_grains import RobotFollowed
from experiments.robot.own_loop import law_of_run
from experiments.robot.plan import plan_robot
from experiments.robot.settings import RobotSettings

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

BALL = """<mujoco><worldbody><body pos="0 0 0.02"><joint type="slide" axis="0 0 1"/>
<geom name="foot" size="0.015" mass="0.3"/></body></worldbody></mujoco>"""


@pytest.fixture
def fallen(tmp_path):
    """A ball of 30 mm that falls onto a law from `height`; the plan and the run."""
    (tmp_path / "ball.xml").write_text(BALL, encoding="utf-8")

    def fall(**given):
        settings = RobotSettings(model=str(tmp_path / "ball.xml"), feet=("foot",), frame_count=0, **given)
        plan = plan_robot(settings)
        run = RobotFollowed(settings, plan).run_on_law()
        run.run()
        return plan, run

    return fall


@pytest.mark.parametrize("ground", ["rft", "spring-damper"])
def test_a_foot_faster_than_the_pushes_of_grains_is_warned_of_with_the_speed_of_its_fall(fallen, ground):
    """From a height h a ball has sqrt(2 h / D) times sqrt(g D) at the surface, in any gravity."""
    for froude, gravity, duration in ((1.0, 9.80665, 0.1), (4.0, 9.80665, 0.25), (4.0, 0.0980665, 2.5)):
        plan, run = fallen(ground=ground, gravity=gravity, height=0.5 * 0.03 * froude**2, duration=duration)
        assert run.columns["sinkage"].max() > 0
        told = too_fast(plan, run, heights_of(run))
        assert bool(told) == (froude > FASTEST)
        for said in told:
            speed, times = re.findall(r"at ([0-9.]+) m/s, ([0-9.]+) times", said)[0]
            assert float(times) == pytest.approx(froude, rel=0.05)
            assert float(speed) == pytest.approx(froude * np.sqrt(gravity * 0.03), rel=0.05)
            assert len(said) < 160 and "bed" in said and "inertia" not in said
            (bounded,) = too_fast(plan, run, heights_of(run), ["rft", "rft, inertia=10"])
            assert "inertia=10" in bounded and len(bounded) < 200


@pytest.mark.parametrize("froude", [1.0, 4.0])
@pytest.mark.parametrize("of_run", [True, False])
def test_an_own_loop_warns_of_a_fast_foot_as_a_run_does(tmp_path, froude, of_run):
    """At the speed v of the warning v / sqrt(g D) is above 2.6; a slower ball gives none."""
    (tmp_path / "ball.xml").write_text(BALL, encoding="utf-8")
    model = load_model(tmp_path / "ball.xml")
    data = mujoco.MjData(model)
    model.opt.timestep, limit = 2e-4, np.sqrt(9.81 * 0.03)
    data.qpos[0], data.qvel[0] = -0.0045, -froude * limit
    mujoco.mj_forward(model, data)
    law = law_of_run(model, ["foot"], surface="sand").law if of_run else {"law": "rft"}
    with (
        warnings.catch_warnings(record=True) as caught,
        FootForces(model, data, find_feet(model, data, ["foot"]), **law),
    ):
        warnings.simplefilter("always")
        for _ in range(100):
            mujoco.mj_step(model, data)
    assert all(Path(one.filename) == Path(__file__) for one in caught)  # the line of the loop, not one of ours
    told = [str(one.message) for one in caught if "m/s" in str(one.message)]
    assert len(told) == (froude > FASTEST)
    for said in told:
        speed, most = re.findall(r"([0-9.]+) m/s", said)
        assert float(most) == pytest.approx(FASTEST * limit, rel=0.01) and float(speed) > float(most)


def test_steel_and_a_slow_foot_have_no_inertia_of_grains(fallen):
    plan, run = fallen(surface="steel", height=0.24, duration=0.25)
    assert run.columns["sinkage"].max() > 0 and too_fast(plan, run, heights_of(run)) == []


def test_a_foot_deeper_than_one_and_a_half_diameters_is_warned_of_on_rft(fallen):
    """A ball of 0.3 kg after a fall of 1 m, with no inertia of the grains, and one that is set down."""
    for height, deep in ((1.0, True), (0.001, False)):
        plan, run = fallen(
            height=height, duration=0.6 if deep else 0.05, ground_parameters=("inertia=0",), ground="rft"
        )
        depth = float(run.columns["sinkage"].max())
        told = too_deep(run, plan.law)
        assert (depth > 0.045) == deep and bool(told) == deep
        limits = [float(found) for said in told for found in re.findall(r"to ([0-9.]+) mm", said)]
        assert limits == pytest.approx([45.0] * deep, rel=0.01)
