"""Several beds under one robot: their mean and its interval, what a law leaves open, and what stands beside grains."""

import pytest

from experiments.robot.on_grains import RobotFollowed, RobotOnBed
from experiments.robot.plan import plan_robot
from experiments.robot.settings import RobotSettings

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOPPER = {"model": "hopper", "feet": ("foot",)}
ON_BED = HOPPER | {"ground": "bed", "height": 0.012, "grain": 0.012, "bed_size": (0.2, 0.2, 0.16), "duration": 0.2}


def followed(**given):
    """A robot that was followed on a law."""
    settings = RobotSettings(**given)
    run = RobotFollowed(settings, plan_robot(settings)).run_on_law()
    run.run()
    return run


@pytest.mark.parametrize(("more", "law"), [({}, "rft"), ({"stiffness": 500.0}, "spring-damper")])
def test_beside_a_robot_on_grains_stands_its_run_on_the_law_that_is_the_default(more, law):
    settings = RobotSettings(**ON_BED | more)
    beside = RobotOnBed(settings, plan_robot(settings)).beside
    alone = followed(**HOPPER, height=0.012, duration=0.2, **more)
    assert settings.default_law == law == RobotSettings(**HOPPER, **more).ground
    assert (beside.columns["z"] == alone.columns["z"]).all() and beside.columns["sinkage"].max() > 0.001
