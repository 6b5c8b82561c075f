"""The law under a robot's feet: for which foot its numbers are, and what a ground file does not go with."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from experiments.groundmap import Settings as GroundSettings
from experiments.groundmap import check as check_ground
from experiments.groundmap.maps import read_map
from experiments.robot.feet import heights_of
from experiments.robot.flight import find_flights
from experiments.robot.on_grains import RobotFollowed, RobotOnBed
from experiments.robot.plan import plan_robot
from experiments.robot.result import quantities_of
from experiments.robot.settings import RobotSettings
from rigid.ground import flat_foot
from rigid.ground.laws import find_law
from rigid.ground_file import GroundFile

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOPPER = {"model": "hopper", "feet": ("foot",)}
BALL = """<mujoco><worldbody><body pos="0 0 0.1"><freejoint/><geom name="foot" type="sphere" size="0.04" mass="1"/>
</body></worldbody></mujoco>"""


def ground_file(path, *, material="sand", law="spring-damper", **parameters):
    """A law of a ball of 12 mm at 1 g in a file; its path."""
    found = find_law(law).values(parameters)
    return str(GroundFile(
        format="hedgebed-ground/1", law=law, material=material, source="a test",
        foot={"tip": "sphere", "diameter": 0.012},
        range={"load": (0, 50), "depth": (0, 0.1), "speed": (0, 5), "gravity": (9.8, 9.8), "diameter": (0.012, 0.012)},
        parameters={name: {"value": value, "std": 0.1} for name, value in found.items()},
    ).write(path / "ground.toml"))  # fmt: skip


def test_a_ground_file_of_another_gravity_is_refused_unless_that_is_accepted(tmp_path):
    file = ground_file(tmp_path)
    near = plan_robot(RobotSettings(**HOPPER, ground=file, gravity=9.81))  # MuJoCo's own
    assert not [said for said in near.warnings if "9.8" in said]
    low = HOPPER | {"ground": file, "gravity": 9.81e-3}
    with pytest.raises(ValueError, match=r"ground = .*ground.toml': gravity = 0.00981 m/s2 .* --gravity 0.001g"):
        plan_robot(RobotSettings(**low))
    assert [said for said in plan_robot(RobotSettings(**low, ignore_gravity_range=True)).warnings if "0.00981" in said]
    with pytest.raises(ValueError, match="ignore_gravity_range: only"):
        RobotSettings(**HOPPER, ignore_gravity_range=True)


def test_a_ground_file_of_other_grains_than_the_surface_is_refused_by_both_names(tmp_path):
    given = HOPPER | {"ground": ground_file(tmp_path)}
    for surface, made in (("steel", "hard ground"), ("jsc1a", "made of jsc-1a-loose-cut")):
        with pytest.raises(ValueError, match=f"surface = '{surface}' is {made}, .* is of sand. .*surface = 'sand'"):
            plan_robot(RobotSettings(**given, surface=surface))
    own = plan_robot(RobotSettings(**given)), plan_robot(RobotSettings(**given, surface="sand"))
    assert own[0].surface == own[1].surface and own[0].warnings == own[1].warnings
    (tmp_path / "other").mkdir()
    given = HOPPER | {"ground": ground_file(tmp_path / "other", material="beads")}
    told = [plan_robot(RobotSettings(**given | more)).warnings for more in ({}, {"mu_s": 0.4})]
    assert [len([said for said in some if "made of beads" in said]) for some in told] == [1, 0]
    mine = ground_file(tmp_path, material="jsc-1a-loose-cut")
    assert plan_robot(RobotSettings(**HOPPER, ground=mine)).surface.name == "jsc1a"


def test_each_law_states_for_which_foot_its_numbers_are_and_how_far_this_one_is_from_it(tmp_path):
    """3D-RFT: a flat foot has 2.5 times the force of a ball of its area at 0.2 diameters, a ball that of itself."""

    def told(**given):
        warnings = plan_robot(RobotSettings(**HOPPER | given)).warnings
        (said,) = [text for text in warnings if text.startswith("the law ")]
        return said

    file = ground_file(tmp_path)
    spring = {"ground": "spring-damper"}
    for given in (spring, {"ground": "katsuragi-durian"}, {"ground": "power-irreversible"}, {"ground": file}):
        said = told(**given)
        assert "tip of 12" in said and "24.8 times" in said and "2.5 times" in said and "too deep" in said
    for given in ({"ground": "rft", "surface": "jsc1a"}, {"ground": "bekker"}):
        assert "dry sand" in told(**given) and "times" not in told(**given)
    own = told(ground=ground_file(tmp_path, law="rft"))
    assert "24.8 times" in own and "too deep" not in own
    assert "'foot'" in told(surface="brick") and "hard ground" in told(surface="brick")
    given = {"stiffness": 900.0, "damping": 3.0}
    assert not [said for said in plan_robot(RobotSettings(**HOPPER | given)).warnings if "law" in said]
    round_ = tmp_path / "ball.xml"
    round_.write_text(BALL)
    said = told(model=str(round_), **spring)
    assert "tip of 12" in said and "too" not in said


PUSHES = Path(__file__).parents[3] / "docs/results/mujoco-laws/flat-foot.json"


def test_factors_of_a_flat_foot_in_grains_are_those_of_the_kept_pushes():
    kept = json.loads(PUSHES.read_text(encoding="utf-8"))
    columns = [kept["depth_over_diameter"].index(depth) for depth in flat_foot.DEPTHS]
    flat, ball = (
        next(push["force"] for push in kept["pushes"] if push["tip"] == tip and push["grain"] == 0.0015)
        for tip in ("flat", "sphere")
    )
    found = {"ball": (flat_foot.OVER_BALL, ball)}
    for law, factors in flat_foot.OVER_LAW.items():
        (own,) = (one for one in kept["laws"] if (one["tip"], one["law"], one["speed"]) == ("flat", law, 0.1))
        found[law] = (factors, own["force"])
    for factors, below in found.values():
        assert [flat[k] / below[k] for k in columns] == pytest.approx(factors, rel=0.02)


def test_grains_push_a_flat_foot_harder_than_spring_and_rft_and_a_sentence_says_how_much(tmp_path):
    def told(**given):
        return [said for said in plan_robot(RobotSettings(**HOPPER | given)).warnings if "Grains of sand" in said]

    (said,) = told(ground="spring-damper")
    assert "9.9 times" in said and "4.8 times" in said
    (said,) = told()
    assert " 4 times" in said and "1.3 times" in said
    (tmp_path / "ball.xml").write_text(BALL)
    for other in (
        {"ground": "bekker"}, {"surface": "brick"}, {"surface": "jsc1a"}, {"stiffness": 900.0, "damping": 3.0},
        {"model": str(tmp_path / "ball.xml")},
    ):  # fmt: skip
        assert not told(**other)
    with pytest.raises(ValueError, match=r"11 times .*3\.4"):
        check_ground(GroundSettings(tip="flat"))


def test_a_law_that_springs_back_or_does_not_take_gravity_says_so():
    def told(part, **given):
        return [said for said in plan_robot(RobotSettings(**HOPPER | given)).warnings if part in said]

    spring = {"ground": "spring-damper"}
    assert told("gives back", **spring) and told("gives back", **spring, gravity=1.0)
    assert not told("gives back", surface="brick") and not told("gives back")
    for law in ("power", "hunt-crossley"):
        unsized = {"ground": law, "ignore_foot_size": True}
        assert told("not take gravity", **unsized, gravity=1.0) and not told("not take gravity", **unsized)
    for law in ("power-irreversible", "katsuragi-durian"):
        assert not told("not take gravity", ground=law, gravity=1.0)
    assert not told("not take gravity", gravity=1.0) and not told("not take gravity", **spring, gravity=1.0)


@pytest.mark.parametrize(
    ("given", "law"),
    [
        ({}, "rft"), ({"surface": "sand"}, "rft"), ({"surface": "sand", "gravity": 0.01}, "rft"),
        ({"surface": "brick"}, "spring-damper"), ({"surface": "jsc1a"}, "spring-damper"),
        ({"stiffness": 900.0}, "spring-damper"), ({"scale_with_gravity": False}, "spring-damper"),
        ({"surface": "sand", "ground": "bekker"}, "bekker"),
    ],
)  # fmt: skip
def test_a_robot_that_is_given_no_ground_has_rft_on_sand_and_the_spring_damper_elsewhere(given, law):
    settings = RobotSettings(**HOPPER | given)
    assert settings.ground == law and RobotSettings(**settings.model_dump()) == settings
    plan = plan_robot(settings)
    assert len([said for said in plan.notes if "3D-RFT" in said]) == (law == "rft")
    chosen = [said for said in plan.announcement() if "(default on" in said]
    assert len(chosen) == (law == "rft")
    assert not [said for said in plan_robot(RobotSettings(**settings.model_dump())).announcement() if said in chosen]


def test_a_weightless_robot_on_a_law_of_weight_is_refused_by_the_gravity_that_was_given(tmp_path):
    (tmp_path / "ball.xml").write_text(BALL.replace("<mujoco>", '<mujoco><option gravity="0 0 0"/>'))
    own = {"model": str(tmp_path / "ball.xml"), "feet": ("foot",)}
    for given, origin in ((HOPPER | {"gravity": 0.0}, "given"), (own, "model ")):
        with pytest.raises(ValueError, match=rf"^gravity = 0 m/s2 \({origin}.*ground = 'rft'"):
            plan_robot(RobotSettings(**given))
    spring = {"ground": "spring-damper", "stiffness": 900.0, "damping": 3.0}
    assert plan_robot(RobotSettings(**HOPPER, gravity=0.0, **spring)).numbers["gravity"].value == 0.0


def test_a_foot_of_the_size_and_shape_of_the_tip_is_told_nothing_of_its_area(tmp_path):
    """A ball of 12 mm on laws of a ball of 12 mm: its picture has 0.5 % less area."""
    (tmp_path / "ball.xml").write_text(BALL.replace("0.04", "0.006"))
    small = {"model": str(tmp_path / "ball.xml"), "feet": ("foot",)}
    for ground in ("spring-damper", "katsuragi-durian", ground_file(tmp_path)):
        plan = plan_robot(RobotSettings(**small, ground=ground))
        assert plan.scales["foot"] == pytest.approx(1.0, abs=0.02) and plan.scales["foot"] != 1.0
        told = [*plan.warnings, *(number.origin for number in plan.numbers.values())]
        assert not [said for said in told if "times the area" in said or "under a foot" in said]


def test_a_foot_larger_than_the_spike_has_the_k_of_the_map_beside_that_by_similarity():
    """The map's line of K over d / D: its grains keep their size, those of similarity grow with the foot."""

    def told(**given):
        plan = plan_robot(RobotSettings(**HOPPER, ground="spring-damper", **given))
        return plan, [said for said in plan.warnings if "by similarity, which" in said]

    for gravity in (9.81, 0.0980665):
        plan, (said,) = told(gravity=gravity)
        own, of_map = (float(text) for text in re.findall(r"(?:is|K =) ([0-9.]+) ", said))
        assert own == pytest.approx(plan.scales["foot"] * plan.numbers["stiffness"].value, rel=2e-2)
        expected = read_map("sand").answer(
            gravity=min(gravity, 9.80665), diameter=plan.rule.largest, grain=2e-4, packing=None, load=None
        )  # fmt: skip
        assert of_map == pytest.approx(expected.stiffness.value, rel=5e-3) and of_map < own
    assert not told(stiffness=900.0)[1]


def test_a_foot_that_loses_contact_in_its_crater_does_not_fly():
    """Of the times of 5 ms and more without contact, those do not count in which the foot stays below the surface."""
    push = str(Path(__file__).parents[3] / "coupling/robot/examples/mujoco-hopper/hop.py") + ":control"
    settings = RobotSettings(**HOPPER, surface="sand", ground="rft", duration=1.0, controller=push)
    run = RobotFollowed(settings, plan_robot(settings)).run_on_law()
    free = run.run()["touching"] == 0
    heights = heights_of(run)[:, 0]
    begins = np.flatnonzero(np.diff(free.astype(int)) == 1) + 1
    lengths = [int(np.argmin(np.append(free[begin:], False))) for begin in begins]
    long = [(b, n) for b, n in zip(begins, lengths, strict=True) if n * run.macro_step >= 5e-3]
    rising = [b for b, n in long if heights[b : b + n].max() > 0]
    assert len(long) > len(rising) > 1
    flights = find_flights(run, heights_of(run))
    assert quantities_of(run, heights_of(run), flights)["flights"]["value"] == len(rising)


@pytest.mark.parametrize(("wide", "said"), [(0.2, ["0.24 m"]), (0.25, [])])
def test_a_bed_narrower_than_four_feet_is_told_before_it_is_made(wide, said):
    """A plate of 60 mm, and the bound of `hedgebed penetrate`."""
    given = {"ground": "bed", "height": 0.012, "grain": 0.012, "bed_size": (wide, 0.25, 0.17), "duration": 0.05}
    settings = RobotSettings(**HOPPER | given)
    told = RobotOnBed(settings, plan_robot(settings)).told.warnings
    assert re.findall("0.24 m", " ".join(told)) == said
