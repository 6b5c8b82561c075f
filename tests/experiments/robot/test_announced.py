"""What a robot's run states before it starts: sizes of a bed in one message, first touch, work, what numbers mean."""

import re

import pytest

from experiments.cli.main import main
from experiments.robot.flight import touch_words
from experiments.robot.on_grains import RobotFollowed, RobotOnBed
from experiments.robot.plan import plan_robot
from experiments.robot.result import conclude
from experiments.robot.settings import RobotSettings

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

PLATE = """<mujoco><worldbody><body pos="0 0 0.2"><freejoint/>
<geom name="foot" type="cylinder" size="0.03 0.01" mass="1.5"/></body></worldbody></mujoco>"""
BALL = """<mujoco><worldbody><body pos="0 0 0.02"><joint type="slide" axis="0 0 1"/>
  <geom name="foot" size="0.02" mass="0.3" euler="0 37 0"/></body></worldbody></mujoco>"""
HOPPER = {"model": "hopper", "feet": ("foot",), "surface": "sand"}
ON_BED = HOPPER | {"ground": "bed", "height": 0.012, "grain": 0.012, "duration": 0.05}


def on_bed(**given):
    """The robot on a bed of these settings, before it is made."""
    settings = RobotSettings(**ON_BED | given)
    return RobotOnBed(settings, plan_robot(settings))


def test_one_refusal_names_all_sides_of_a_bed_and_a_bed_of_that_size_gives_no_further_fault():
    with pytest.raises(ValueError, match=r"too shallow.*too short") as refused:
        on_bed(bed_size=(0.05, 0.2, 0.05)).check_extent()
    sizes = re.findall(r"--bed-size ([0-9.]+) ([0-9.]+) ([0-9.]+)", str(refused.value))[0]
    size = tuple(float(side.rstrip(".")) for side in sizes)
    assert size[:2] == (0.24, 0.24)  # four times the foot of 60 mm
    wide = on_bed(bed_size=size)
    wide.check_extent()
    assert not [said for said in wide.told.warnings if "narrower than" in said]
    assert [said for said in on_bed(bed_size=(0.2, *size[1:])).told.warnings if "narrower than" in said]


@pytest.mark.parametrize(("given", "told"), [({}, True), ({"stiffness": 2000.0, "damping": 5.0}, False)])
def test_a_refusal_of_the_width_names_the_law_that_decides_it_and_why_not_the_default_one(given, told):
    with pytest.raises(ValueError, match="too short") as refused:
        on_bed(**given, bed_size=(0.05, 0.24, 0.2)).check_extent()
    assert told == ("not by rft" in str(refused.value))


def test_a_ball_of_five_grains_is_accepted_though_its_outline_is_a_polygon_and_so_is_the_grain_that_a_refusal_names(
    tmp_path,
):
    """40 mm over 8 mm are 5; the outline of the ball is 39.9 mm wide."""
    (tmp_path / "ball.xml").write_text(BALL, encoding="utf-8")
    given = {"model": str(tmp_path / "ball.xml"), "bed_size": (0.16, 0.16, 0.14)}
    on_bed(**given, grain=0.008).check()
    with pytest.raises(ValueError, match="foot 'foot' is") as refused:
        on_bed(**given, grain=0.0085).check()
    (named,) = re.findall(r"at most ([0-9.]+) m", str(refused.value))
    assert 0.0079 < float(named) <= 0.0081
    on_bed(**given, grain=float(named)).check()


def test_a_robot_that_starts_above_the_surface_is_told_when_it_touches_and_it_does_so(tmp_path):
    """12 mm at 0.2 m/s2: sqrt(2 h / g) = 0.346 s; on grains of 12 mm, half a grain higher, 0.245 s."""
    (tmp_path / "plate.xml").write_text(PLATE, encoding="utf-8")
    own = {"model": str(tmp_path / "plate.xml")}  # the leg's spring moves its foot in the fall
    settings = RobotSettings(**HOPPER | own, height=0.012, gravity=0.2, duration=0.5, frame_count=0)
    plan = plan_robot(settings)
    (said,) = touch_words(settings, plan.robot())
    told = float(re.findall(r"after ([0-9.]+) s", said)[0])
    run = RobotFollowed(settings, plan).run_on_law()
    run.run()
    result = conclude(settings, plan, run, tmp_path)
    assert told == pytest.approx(0.346, abs=1e-3)
    assert result.quantities["first_touch"].value == pytest.approx(told, abs=1e-3)
    grains = RobotSettings(**ON_BED | own | {"gravity": 0.2, "duration": 0.5})
    assert "0.346 s of" in touch_words(grains, plan.robot())[0]
    assert "0.245 s" in touch_words(grains, plan.robot())[0]
    assert touch_words(settings.model_copy(update={"duration": 0.3}), plan.robot()) == []


def test_numbers_of_a_surface_law_are_marked_on_grains_and_explained_on_a_law():
    lines = {line.split(" = ")[0]: line for line in plan_robot(RobotSettings(**ON_BED)).announcement()}
    assert all("of the grains" in lines[name] for name in ("stiffness", "damping", "mu_s", "mu_d"))
    assert "of the grains" not in lines["mass"]
    lines = {line.split(" = ")[0]: line for line in plan_robot(RobotSettings(**HOPPER)).announcement()}
    assert "internal friction" in lines["friction"] and "grains and spike" in lines["surface_friction"]
    assert "sticks" in lines["mu_s"] and "slides" in lines["mu_d"]


def test_the_work_of_a_run_on_grains_is_in_proportion_to_its_duration():
    def minutes(duration):
        said = on_bed(bed_size=(0.24, 0.24, 0.17), duration=duration)._work()
        return float(re.findall(r"some ([0-9.e-]+) min", said)[0])

    assert 0.0 < minutes(0.05) == pytest.approx(0.5 * minutes(0.1), rel=0.05)


def test_a_run_on_steel_is_not_sent_to_grains(tmp_path):
    given = ["--feet", "foot", "--surface", "steel", "--duration", "0.05", "--frame-count", "0"]
    assert main(["mujoco", "hopper", *given, "--out", str(tmp_path / "run")]) == 0
    said = (tmp_path / "run" / "result.json").read_text(encoding="utf-8")
    assert "twice --stiffness" in said and "several seeds" not in said
