"""How long a robot is followed on a law: until it flies or is at rest, so that its rise is not that of a cut push."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.robot.feet import heights_of
from experiments.robot.flight import find_flights, pushes_off
from experiments.robot.forms import other_laws
from experiments.robot.on_grains import RobotFollowed, RobotOnBed
from experiments.robot.on_laws import answer_of_run, follow_on, on_law
from experiments.robot.plan import plan_robot
from experiments.robot.result import conclude
from experiments.robot.settings import RobotSettings
from vis.robot.answer import answer_tiles

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

LANDER = """<mujoco model="lander"><worldbody><body name="body" pos="0 0 0.2"><freejoint/>
  <geom name="tip" type="cylinder" size="0.03 0.01" mass="1.5"/></body></worldbody></mujoco>"""
BRICK = {"surface": "brick", "stiffness": 15e3, "damping": 0.0, "height": 0.02, "gravity": 9.81}
"""A fall of 20 mm takes 64 ms, half a swing of 1.5 kg on 15 kN/m 31 ms; the flight after it 128 ms, back to 20 mm."""
HOPPER = {"model": "hopper", "feet": ("foot",), "surface": "sand", "height": 0.012, "controller": "hopper:control"}
"""Its push begins at 0.25 s and lasts to 0.34 s."""


@pytest.fixture
def planned(tmp_path):
    """The plan of a plate of 60 mm with 1.5 kg."""
    (tmp_path / "lander.xml").write_text(LANDER, encoding="utf-8")

    def plan(**given):
        return plan_robot(RobotSettings(model=str(tmp_path / "lander.xml"), feet=("tip",), **given))

    return plan


def run_of(plan):
    return RobotFollowed(plan.settings, plan).run_on_law()


def test_a_run_that_ends_in_contact_on_its_way_up_goes_on_to_the_flight_and_has_the_apex_of_that(planned):
    plan = planned(**BRICK, duration=0.085)
    cut, whole = run_of(plan), run_of(plan)
    cut.run()
    follow_on(whole)
    assert (
        on_law(cut, plan).rising
        and answer_of_run(cut)["highest"] < -0.019
        and answer_of_run(cut)["longest_flight"] == 0
    )
    found = on_law(whole, plan)
    assert not found.rising and 0.095 < found.time < 0.2
    assert found.answer["highest"] == pytest.approx(0.0, abs=5e-4)
    assert found.answer["longest_flight"] == pytest.approx(0.128, rel=0.02)


def test_a_robot_that_has_landed_is_followed_until_it_is_at_rest_and_one_that_falls_still_is_not(planned):
    landed = run_of(planned(surface="sand", height=0.02, duration=0.1))
    plan = planned(**BRICK, duration=0.03)
    falling, down = run_of(plan), run_of(planned(**BRICK, duration=0.07))
    follow_on(landed)
    assert 0.1 < landed.time < 0.3
    speeds = np.gradient(landed.columns["z"], landed.columns["time"])
    assert abs(speeds[landed.columns["time"] > landed.time - 0.023]).max() < np.sqrt(2 * 9.81 * 1e-3)
    follow_on(falling)
    down.run()
    assert falling.time == pytest.approx(0.03, abs=1e-3)
    assert not on_law(falling, plan).rising and not on_law(down, plan).rising


def test_a_robot_that_has_hopped_is_not_followed_into_its_next_push():
    """The second push of the leg begins at 0.75 s."""
    run = run_of(plan := plan_robot(RobotSettings(**HOPPER, duration=0.8)))
    follow_on(run)
    assert run.time == pytest.approx(0.8, abs=1e-3) and not on_law(run, plan).rising
    assert answer_of_run(run)["highest"] > 0.03


def test_a_controller_that_knows_the_duration_alone_ends_the_law_there(planned):
    def fails(_, data):
        if data.time > 0.086:
            raise ValueError

    plan = replace(planned(**BRICK, duration=0.085), controller=fails)
    run = run_of(plan)
    follow_on(run)
    assert run.time == pytest.approx(0.085, abs=1e-3) and run.done and len(run.columns["z"]) == len(run.feet)
    assert on_law(run, plan).rising


def test_a_run_of_its_own_that_ends_so_is_warned_of(planned, tmp_path):
    for duration, warned in ((0.085, True), (0.15, False)):
        plan = planned(**BRICK, duration=duration)
        run = run_of(plan)
        run.run()
        assert (pushes_off(run, find_flights(run, heights_of(run))) is not None) == warned
        assert any("pushes off" in one for one in conclude(plan.settings, plan, run, tmp_path).warnings) == warned


def on_bed():
    settings = RobotSettings(**HOPPER, ground="bed", grain=0.012, bed_size=(0.24, 0.24, 0.2), duration=0.3)
    plan = plan_robot(settings)
    return RobotOnBed(settings, plan), plan


def test_a_run_that_ends_in_the_crater_of_its_launch_flies_as_a_longer_one_does(tmp_path):
    """The leg loses contact 47 mm deep. The run ends 6 ms before the foot is at the surface, with the push over."""

    def followed(duration):
        plan = plan_robot(RobotSettings(**HOPPER, gravity=1.0, duration=duration))
        run = run_of(plan)
        run.run()
        return run, conclude(plan.settings, plan, run, tmp_path)

    whole, longer = followed(1.1)
    heights = heights_of(whole)[:, 0]
    (begin, _), *_ = find_flights(whole, heights_of(whole)).rows
    out = begin + int(np.argmax(heights[begin:] > 0))
    cut, short = followed(float(whole.columns["time"][out - 15]))
    assert heights_of(cut)[-1, 0] < -2e-3 and find_flights(cut, heights_of(cut)).at_end and not short["rising"]
    launches = [
        [said for said in one["departures"]["sentences"] if "first flight begins" in said] for one in (short, longer)
    ]
    assert launches[0] == launches[1] != []
    for name in ("rise_ballistic", "flight_ballistic"):
        assert short.quantities[name].value == pytest.approx(longer.quantities[name].value, rel=5e-3)
    assert not any("pushes off" in one for one in short.warnings)
    assert any("surface and lands" in one for one in short.warnings)
    rise = answer_tiles(longer)[0].value.replace("\N{NO-BREAK SPACE}", " ")  # it falls already: the apex is behind it
    assert any(f"it rose {rise}," in one for one in longer.warnings)
    assert any(f"it rose to {rise} above" in one for one in longer["departures"]["sentences"])


@pytest.mark.parametrize(
    ("given", "hop", "up"),
    [
        ({"surface": "sand", "height": 0.02, "duration": 0.2}, False, False),
        (BRICK | {"duration": 0.085}, True, True),
        (BRICK | {"duration": 0.2}, True, False),
    ],
)
def test_a_robot_that_stays_on_the_ground_has_no_rise_in_a_range_and_its_result_states_it(
    planned, tmp_path, given, hop, up
):
    """On sand the plate falls by 20 mm and stays: the largest height after its first touch is that of the touch."""
    plan = planned(**given)
    run = run_of(plan)
    run.run()
    result, answer = conclude(plan.settings, plan, run, tmp_path), answer_of_run(run)
    assert (result["hop"], result["rising"]) == (hop, up)
    assert (answer["highest"] == answer["clearance_largest"] == 0.0) == (not hop)
    assert result.quantities["highest"].value == pytest.approx(-0.02, abs=1e-3) or hop
    told = " ".join(result["departures"]["sentences"])
    assert ("before the end" in told) == up


def test_the_law_beside_a_bed_goes_on_to_its_flight():
    """The push is half done at 0.3 s."""
    beside = on_bed()[0].beside
    assert beside.time > 0.33 and answer_of_run(beside)["longest_flight"] > 0.15


@pytest.mark.long
def test_beside_a_bed_every_law_starts_as_the_grains_do_and_goes_on_to_its_flight():
    """The leg hops on every law."""
    bed, plan = on_bed()
    others = other_laws(plan.on_law("rft"))
    assert {round(other.robot().clearance, 9) for other in others.values()} == {0.012}
    laws = bed.forms.numbers["laws"]
    assert set(laws) == {"rft", *others} and bed.forms.numbers["rising"] == []
    assert all(answer["highest"] > 0.03 and answer["longest_flight"] > 0.15 for answer in laws.values())
    assert bed.forms.numbers["longest"] > 0.33 and any("then on" in said for said in bed.forms.words)
