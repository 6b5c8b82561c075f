"""What a robot's run states of its flights: the apex after the first touch, and how long a flight lasts."""

import re

import numpy as np
import pytest

from coupling.robot import MujocoRobot
from experiments.cli.main import main
from experiments.robot.flight import fall_warning
from experiments.robot.on_grains import RobotFollowed
from experiments.robot.plan import plan_robot
from experiments.robot.result import conclude
from experiments.robot.settings import RobotSettings
from vis.robot.answer import DISTANCE, answer_tiles

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

LANDER = """<mujoco model="lander"><worldbody><body name="body" pos="0 0 0.2"><freejoint/>
  <geom name="tip" type="cylinder" size="0.03 0.01" mass="1.5"/></body></worldbody></mujoco>"""
BOUNCE = {"surface": "brick", "stiffness": 15e3, "damping": 0.0, "height": 0.02}
"""A fall of 20 mm at 9.81 m/s2 takes 64 ms, half a swing of 1.5 kg on 15 kN/m 31 ms, the flight after it 128 ms."""


@pytest.fixture
def lander(tmp_path):
    """Name of the file of a plate of 60 mm with 1.5 kg."""
    (tmp_path / "lander.xml").write_text(LANDER, encoding="utf-8")
    return str(tmp_path / "lander.xml")


def concluded(lander, folder, **given):
    """The run, its result."""
    settings = RobotSettings(model=lander, feet=("tip",), **given)
    plan = plan_robot(settings)
    run = RobotFollowed(settings, plan).run_on_law()
    run.run()
    return run, conclude(settings, plan, run, folder)


def test_the_apex_is_that_after_the_first_touch_so_that_a_drop_is_no_rise(lander, tmp_path):
    """On sand the plate falls by 20 mm and stays down; on undamped brick it comes back to where it began."""
    _, sunk = concluded(lander, tmp_path, surface="sand", height=0.02, duration=0.2)
    step = 0.63 * sunk["macro_step"]  # at sqrt(2 g h) in one exchange of forces
    assert sunk.quantities["highest"].value == pytest.approx(-0.02, abs=step)
    (below,) = [said for said in sunk["departures"]["sentences"] if "below its start" in said]
    assert sunk["start_height"] == pytest.approx(0.02) and "20 mm above" in below
    assert float(re.findall(r"stayed ([0-9.]+) mm", below)[0]) == pytest.approx(20, abs=1e3 * step)
    _, back = concluded(lander, tmp_path, **BOUNCE, duration=0.2)
    assert back.quantities["highest"].value == pytest.approx(0.0, abs=5e-4)


def test_a_run_that_ends_in_the_air_says_when_it_lands_and_what_a_launch_means(lander, tmp_path):
    """Flight 2 v / g and rise v^2 / 2 g: those that a longer run has, within an exchange of forces or the rounding."""
    _, short = concluded(lander, tmp_path, **BOUNCE, duration=0.15)
    longer, whole = concluded(lander, tmp_path, **BOUNCE, duration=0.24)
    free = longer.columns["touching"] == 0
    lands = [float(longer.columns["time"][row]) for row in np.flatnonzero(np.diff(free.astype(int)) == -1) + 1][-1]
    (said,) = [said for said in short.warnings if "cut off" in said]
    assert 0.15 + float(re.findall(r"after ([0-9.]+) s", said)[0]) == pytest.approx(lands, abs=2e-3)
    assert lands < float(re.findall(r"--duration ([0-9.]+)", said)[0]) < 1.2 * lands
    (launch,) = [said for said in whole["departures"]["sentences"] if "first flight begins" in said]
    speed = float(re.findall(r"([0-9.]+) m/s", launch)[0])
    assert 2 * speed / 9.81 == pytest.approx(whole.quantities["longest_flight"].value, rel=0.02)
    assert "crater" not in launch and "mm" not in launch  # one number for the rise: that of the table
    assert not [said for said in whole.warnings if "cut off" in said]
    for ballistic, own in (("rise_ballistic", "highest"), ("flight_ballistic", "longest_flight")):
        assert short.quantities[ballistic].value == pytest.approx(whole.quantities[own].value, rel=0.02, abs=2e-4)
        assert ballistic not in whole.quantities
    assert short.quantities["highest"].value < whole.quantities["highest"].value - 5e-4


def test_a_flight_on_a_rail_with_damping_goes_on_as_mujoco_has_it(tmp_path):
    """m z'' = -m g - c z': from v it rises m v / c - (m / c)^2 g ln(1 + c v / m g), below v^2 / 2 g."""
    m, c, g, v = 2.0, 0.3, 0.1, 0.9
    (tmp_path / "rail.xml").write_text(
        f"""<mujoco><option timestep="1e-3" gravity="0 0 -{g}"/><worldbody><body pos="0 0 0.05">
        <joint name="rail" type="slide" axis="0 0 1" damping="{c}"/>
        <geom name="foot" type="sphere" size="0.05" mass="{m}"/>
        </body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    robot = MujocoRobot(str(tmp_path / "rail.xml"), feet=["foot"])
    robot.data.qvel[0] = v
    robot.start()
    rise, fall, along = robot.onward()
    assert tuple(along) == (0.0, 0.0) and not robot.travels
    assert rise == pytest.approx(m * v / c - (m / c) ** 2 * g * np.log(1 + c * v / (m * g)), rel=2e-3)
    assert v**2 / (2 * g) > 1.4 * rise
    assert robot.data.time == 0.0 and robot.data.qvel[0] == v and fall > 0
    assert robot.onward(most_steps=100) is None
    robot.data.qpos[0], robot.data.qvel[0] = -0.01, -0.1  # it falls in its crater, below the surface already
    robot.start()
    assert robot.onward()[:2] == (0.0, pytest.approx(1e-3))  # one step


def test_the_distance_of_a_hop_is_that_of_its_longest_flight_also_where_the_run_ends_in_it(tmp_path):
    """In flight the plate goes v_x t; a longer run has the whole flight, a shorter one is continued to the same."""
    model = LANDER.replace("<freejoint/>", """<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>""")
    (tmp_path / "sled.xml").write_text(model, encoding="utf-8")
    (tmp_path / "push.py").write_text(
        "def control(model, data):\n    data.qfrc_applied[0] = 6.0 if data.time < 0.05 else 0.0\n", encoding="utf-8"
    )
    given = BOUNCE | {"controller": f"{tmp_path}/push.py:control", "mu_s": 0.0, "mu_d": 0.0}
    run, whole = concluded(str(tmp_path / "sled.xml"), tmp_path, **given, duration=0.24)
    _, short = concluded(str(tmp_path / "sled.xml"), tmp_path, **given, duration=0.15)
    speed = np.diff(run.columns["x"])[-1] / run.macro_step
    assert speed == pytest.approx(6.0 * 0.05 / 1.5, rel=0.05)  # a push may last one step of MuJoCo longer
    distance = whole.quantities["hop_distance"].value
    assert distance == pytest.approx(speed * whole.quantities["longest_flight"].value, rel=0.02)
    assert short.quantities["hop_distance"].value == pytest.approx(distance, rel=0.02)
    assert [said for said in whole["departures"]["sentences"] if f"{1e3 * distance:.0f} mm along" in said]
    tiles = [tile.label for tile in answer_tiles(whole)]
    assert len(tiles) == 6 and DISTANCE[0] in tiles


def test_a_robot_that_is_still_falling_at_the_end_is_told_of_it_before_and_a_run_of_that_length_touches(
    lander, tmp_path
):
    """At 0.1 m/s2 a fall of 20 mm takes sqrt(2 h / g) = 0.632 s."""
    given = {"model": lander, "feet": ("tip",), "gravity": 0.1, "height": 0.02}
    short = RobotSettings(**given, duration=0.3)
    (said,) = fall_warning(short, plan_robot(short).robot())
    assert "0.632 s" in said
    wanted = float(re.findall(r"--duration ([0-9.]+)", said)[0])
    enough = RobotSettings(**given, duration=wanted)
    assert fall_warning(enough, plan_robot(enough).robot()) == []
    _, none = concluded(lander, tmp_path, gravity=0.1, height=0.02, duration=0.3)
    assert any("0.332 s more" in said for said in none["departures"]["sentences"])
    _, result = concluded(lander, tmp_path, gravity=0.1, height=0.02, duration=wanted)
    assert result.quantities["first_touch"].value == pytest.approx(0.632, abs=1e-3)


def test_the_command_warns_of_a_fall_that_it_does_not_finish(lander, tmp_path, capsys):
    given = ["--feet", "tip", "--height", "0.02", "--gravity", "0.1", "--duration", "0.01", "--frame-count", "0"]
    assert main(["mujoco", lander, *given, "--out", str(tmp_path / "run")]) == 0
    assert "0.632 s" in capsys.readouterr().err


def test_a_foot_that_bounces_in_its_crater_is_counted_and_the_run_warns_of_it_on_a_law_without_loss(lander, tmp_path):
    """On rft the plate leaves the bottom of its crater with v and rises by v^2 / 2 g. Damping stops it there."""
    given = {"surface": "sand", "height": 0.04, "duration": 0.4}
    run, result = concluded(lander, tmp_path, **given)
    free = (run.columns["touching"] == 0).astype(int)
    leaves, meets = (np.flatnonzero(np.diff(free) == sign) + 1 for sign in (1, -1))
    leaves = leaves[: len(meets) - 1]  # the first to meet is the landing, and the last to leave may not be back
    speeds = np.gradient(run.columns["z"], run.columns["time"])[leaves] + 9.81 * run.macro_step
    (words,) = [said for said in result["departures"]["sentences"] if "below the surface:" in said]
    count, rise = re.findall(r": ([0-9]+); in the highest it rises by ([0-9.]+) mm", words)[0]
    assert int(count) == len(leaves) > 3
    assert float(rise) == pytest.approx(1e3 * speeds.max() ** 2 / 2 / 9.81, rel=0.05)
    (warned,) = [said for said in result.warnings if "in its crater" in said]
    assert f"contact {count} times" in warned and "'power-irreversible'" in warned
    lossy, lost = concluded(lander, tmp_path, **given, ground="rft", ground_parameters=("loss=1",))
    assert not [said for said in lost.warnings if "in its crater" in said]
    assert lossy.columns["fz"].max() == run.columns["fz"].max()  # the landing is the same
    late = run.columns["time"] > 0.3
    assert lossy.columns["fz"][late].max() < 2 * 1.5 * 9.81 < run.columns["fz"][late].max()
    assert lossy.energy_residual < 1e-3
    _, damped = concluded(lander, tmp_path, **given, ground="power-irreversible")
    assert not [said for said in damped.warnings if "in its crater" in said]
    _, flies = concluded(lander, tmp_path, **BOUNCE, duration=0.4)
    assert not [said for said in flies["departures"]["sentences"] if "below the surface:" in said]
