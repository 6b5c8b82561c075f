"""How high and how deep each foot of a robot goes, and the frames that show it."""

import warnings

import numpy as np
import pytest
from tumble_runs import stop_at

from coupling.robot import FootForces, LawFeet, MujocoRobot, RobotRun, find_feet, law_under_feet, load_model
from experiments.grains.tracked_frames import HARDER, PlatformFrames
from experiments.robot import experiment as robot
from experiments.robot.feet import FEW, feet_quantities, feet_reached, heights_of, too_deep
from experiments.robot.flight import find_flights
from experiments.robot.on_grains import RobotFollowed
from experiments.robot.plan import plan_robot
from experiments.robot.result import RobotFrames, quantities_of
from experiments.robot.settings import RobotSettings
from experiments.runs.folder import read_series
from rigid.spatial.quaternions import to_matrix
from vis.film.film import Sheet, moments
from vis.film.reel import SpaceReel
from vis.pictures.frames import frame_names, frames_of, read_frames
from vis.robot.report import write_robot_report
from vis.view.sources import sources_of

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOPPER = {"model": "hopper", "feet": ("foot",)}
LUMP = """<mujoco><worldbody><body pos="0 0 0.2"><freejoint/><geom type="box" size=".05 .05 .03" mass="1"/>
  <geom name="foot" size=".03" pos="0 0 -.1" mass=".5"/></body></worldbody></mujoco>"""
PAIR = """<mujoco><worldbody>
  <body name="one" pos="0 0 0.13"><freejoint/><geom name="box" type="box" size=".04 .03 .01" euler="0 20 0" mass="1"/>
  </body><body name="two" pos="0.3 0 0.24"><freejoint/>
  <geom name="egg" type="ellipsoid" size=".03 .02 .04" euler="30 0 40" mass="1"/></body></worldbody></mujoco>"""


def dropped(tmp_path, *, duration):
    """A box and an ellipsoid, both askew, that fall on hard springs without damping and leave them again."""
    file = tmp_path / "pair.xml"
    file.write_text(PAIR)
    made = MujocoRobot(str(file), feet=["box", "egg"])
    ground = LawFeet(made.feet, parameters={"stiffness": 2e4, "damping": 0.0}, mu_s=0.0)
    run = RobotRun(made, ground, duration=duration)
    run.run()
    return run


def test_heights_of_feet_are_those_of_their_lowest_points_at_every_moment(tmp_path):
    run = dropped(tmp_path, duration=0.3)
    heights, feet = heights_of(run), run.feet
    for row in range(0, len(feet), 97):
        for k, foot in enumerate(run.robot.feet):
            low = feet[row, k, 2] + foot.bottom(to_matrix(feet[row, k, 3:7]))
            assert heights[row, k] == pytest.approx(low, abs=1e-9)
    depths = feet[:, :, -1]
    assert depths.max() > 1e-3
    assert depths == pytest.approx(np.maximum(-heights, 0.0), abs=2e-5)  # an ellipsoid's picture is 0.3 % too small


def test_clearance_counts_from_the_first_touch_and_each_foot_has_its_own(tmp_path):
    run = dropped(tmp_path, duration=0.3)
    heights, time = heights_of(run), run.columns["time"]
    reached = feet_reached(run, heights)
    first = int(np.argmax(run.columns["touching"] > 0))
    assert heights[0, 0] > heights[first:, 0].max() == reached["box"]["clearance_largest"]
    assert reached["egg"]["clearance_end"] == heights[-1, 1] and time[-1] == pytest.approx(0.3)
    found = feet_quantities(reached)
    assert len(found) == 8 and found["clearance_largest_box"][0] == reached["box"]["clearance_largest"]
    assert found["sinkage_largest_egg"][0] == pytest.approx(run.feet[:, 1, -1].max())


def test_the_rise_from_a_lowest_point_is_that_from_any_moment_to_a_later_one(tmp_path):
    run = dropped(tmp_path, duration=0.3)
    heights, z = heights_of(run), run.columns["z"]
    flights = find_flights(run, heights)
    found = quantities_of(run, heights, flights)
    after = z[flights.touched :]
    end = after[-1] + (flights.left[0] if flights.left else 0.0)
    rises = [max(after[row:].max(), end) - after[row] for row in range(len(after))]
    assert found["rise_from_lowest"]["value"] == pytest.approx(max(rises), abs=1e-12)
    assert found["rise_from_lowest"]["value"] > max(found["highest"]["value"], 1e-3)


def test_a_robot_of_one_foot_or_of_many_has_one_clearance_in_its_table():
    def foot(height):
        return {"clearance_largest": height, "clearance_end": -0.01, "sinkage_largest": 0.02, "sinkage_end": 0.01}

    assert list(feet_quantities({"foot": foot(0.1)})) == ["clearance_largest", "clearance_end"]
    many = feet_quantities({f"tip{k}": foot(0.1 * k) for k in range(FEW + 1)})
    (value, _, note) = many.pop("clearance_largest")
    assert not many and value == pytest.approx(0.1 * FEW) and f"tip{FEW}" in note


def test_frames_of_a_robot_are_named_so_and_older_ones_are_continued_and_shown(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    settings = RobotSettings(**HOPPER, duration=0.05, frame_count=4)
    result = robot.run(settings, tmp_path / "new")
    heights = read_series(tmp_path / "new" / "series" / "feet.csv")["foot_height_m"]
    assert result.quantities["clearance_end"].value == pytest.approx(heights[-1])
    assert frame_names(tmp_path / "new") == ["robot"] and frames_of(tmp_path / "new") == "robot"
    with monkeypatch.context() as patch:
        patch.setattr(RobotFrames, "name", PlatformFrames.name)  # as it was once
        robot.run(settings, tmp_path / "old")
    assert frame_names(tmp_path / "old") == ["tumble"]
    times = []
    for folder in (tmp_path / "new", tmp_path / "old"):
        (seen,) = sources_of(folder)
        times.append(seen.times.tolist())
    page = write_robot_report(tmp_path / "new", pictures=False).read_text(encoding="utf-8")
    assert "The feet" in page and "at the end" in page
    assert times[0] == times[1] and len(times[0]) >= 4
    run = dropped(tmp_path, duration=0.01)
    RobotFrames(run, tmp_path / "old", settings, resumed=True)
    assert frame_names(tmp_path / "old") == ["tumble"] and len(read_frames(tmp_path / "old", "tumble").times)


def test_the_arrow_of_a_blow_of_several_weights_fits_into_its_picture(tmp_path, monkeypatch):
    """1.5 kg fall by 20 mm on 20 kN/m: v sqrt(K m) is 108 N, seven weights."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    (tmp_path / "lump.xml").write_text(LUMP)
    given = {"model": str(tmp_path / "lump.xml"), "feet": ("foot",), "height": 0.02, "stiffness": 2e4, "damping": 0.0}
    robot.run(RobotSettings(**given, surface="brick", duration=0.11, frame_count=25), tmp_path / "run")
    reel, cut = SpaceReel(tmp_path / "run"), []
    monkeypatch.setattr("vis.pictures.canvas._note", lambda *given: cut.append(given[-1]))
    sheet = Sheet([reel], (480, 300), by="displacement", opengl=False)
    pushes = [reel.frame(k).clouds["row_forces"][1]["force"] for k in range(len(reel))]
    largest = max(float(np.linalg.norm(force, axis=1).max(initial=0.0)) for force in pushes)
    assert reel.peak == pytest.approx(largest) and largest > 4 * reel.number("weight")
    assert sheet.shorter * largest == pytest.approx(2 * reel.number("weight"))
    for time in reel.times:
        sheet.draw(time)
    assert not cut
    sheet.shorter = 1.0  # as a blow in no frame would leave it
    for time in reel.times:
        sheet.draw(time)
    assert cut
    sheet.close()


def test_a_picture_shows_the_largest_force_also_where_a_run_stopped_and_few_frames_are_asked_for(tmp_path, monkeypatch):
    """The same blow of some 120 N at 80 ms; frames at even times come every 37 ms, the nearest after 73 ms."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    (tmp_path / "lump.xml").write_text(LUMP)
    given = {"model": str(tmp_path / "lump.xml"), "feet": ("foot",), "height": 0.02, "stiffness": 2e4, "damping": 0.0}
    settings = RobotSettings(**given, surface="brick", duration=0.11, frame_count=3)
    largest = robot.run(settings, tmp_path / "whole").quantities["largest_force"].value
    reel = SpaceReel(tmp_path / "whole")
    hardest = int(np.argmax(reel.loads))
    assert reel.loads[hardest] == pytest.approx(largest, rel=HARDER - 1) and 0 < hardest < len(reel) - 1
    even = np.delete(reel.times, hardest)
    assert even == pytest.approx([0.0, 0.11 / 3, 0.22 / 3, 0.11], abs=1e-3)
    assert np.delete(reel.loads, hardest).max() < 0.9 * largest
    shown = {name: (title, time) for name, title, time, _ in moments([reel])}
    title, time = shown["force"]
    assert time == reel.times[hardest] and title.endswith("largest force")
    files = sorted((tmp_path / "whole" / "frames").iterdir())
    steps = len(read_series(tmp_path / "whole" / "series" / "motion.csv")["t_s"])
    for step in (steps // 2, (9 * steps) // 10):  # before and after that moment
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            stop_at(patch, step)
            robot.run(settings, tmp_path / f"stopped-{step}")
        robot.resume(tmp_path / f"stopped-{step}")
        parts = sorted((tmp_path / f"stopped-{step}" / "frames").iterdir())
        assert [file.name for file in parts] == [file.name for file in files]
        assert [file.read_bytes() for file in parts] == [file.read_bytes() for file in files]


@pytest.mark.parametrize(("radius", "deep"), [(0.005, True), (0.03, False)])
def test_a_foot_deeper_than_its_diameter_is_warned_of_by_runs_and_in_mujocos_own_loop(tmp_path, radius, deep):
    """A ball of 1 kg on K = 39 N/m of 12 mm by area: 10 mm sink by over 0.3 m, 60 mm by 20 to 30 mm."""
    file = tmp_path / "ball.xml"
    file.write_text(
        f"<mujoco><worldbody><body pos='0 0 {radius}'><joint type='slide' axis='0 0 1'/>"
        f"<geom name='foot' size='{radius}' mass='1'/></body></worldbody></mujoco>"
    )
    settings = RobotSettings(model=str(file), feet=("foot",), ground="spring-damper", duration=0.1, frame_count=0)
    plan = plan_robot(settings)
    run = RobotFollowed(settings, plan).run_on_law()
    run.run()
    assert (run.feet[-1, 0, -1] > 2 * radius) == deep
    told = too_deep(run)
    limit = run.ground.depths["foot"]
    assert limit == pytest.approx(2 * radius, rel=0.01)
    assert [f"hold to {1e3 * limit:.3g} mm" in said for said in told] == [True] * deep
    model = load_model(file)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    feet = find_feet(model, data, ["foot"])
    own = {name: plan.numbers[name].value for name in ("stiffness", "damping")}
    sized = law_under_feet(feet, [np.eye(3)], "spring-damper", own, of=0.012, depth=0.012)
    with warnings.catch_warnings(record=True) as caught, FootForces(model, data, feet, **sized):
        warnings.simplefilter("always")
        for _ in range(200):
            mujoco.mj_step(model, data)
    assert [f"hold to {1e3 * limit:.3g} mm" in str(one.message) for one in caught] == [True] * deep
