"""`hedgebed mujoco`: refusals by name, a run on a law and its report, a small bed stopped and taken up."""

import json
import re

import numpy as np
import pytest
from spatial_runs import EXAMPLES, grain_bed
from tumble_runs import stop_at

from coupling.lammps import LammpsMissingError, find_lammps
from experiments.cli.main import main
from experiments.groundmap.maps import read_map
from experiments.robot import experiment as robot
from experiments.robot.energy import MOST_RESIDUAL, growth_warning
from experiments.robot.laws import given_parameters
from experiments.robot.on_grains import RobotFollowed, RobotOnBed
from experiments.robot.plan import keep_files, plan_robot
from experiments.robot.result import conclude
from experiments.robot.settings import RobotSettings
from experiments.runs.folder import RunFolder, read_series
from rigid.ground.laws import find_law
from vis.page.folder import read_columns
from vis.view.page import report_scene
from vis.view.sources import sources_of

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOP = f"{EXAMPLES / 'mujoco-hopper' / 'hop.py'}:control"
HOPPER = {"model": "hopper", "feet": ("foot",)}
SPRING = HOPPER | {"ground": "spring-damper"}
LANDER = """<mujoco model="lander"><worldbody><body name="body" pos="0 0 0.2"><freejoint/>
  <geom name="hull" type="cylinder" size="0.1 0.01" mass="1"/>
  <geom name="tip" type="cylinder" size="0.03 0.01" pos="0 0 -0.12" mass="0.5"/></body></worldbody></mujoco>"""
ON_BED = HOPPER | {"ground": "bed", "height": 0.012, "grain": 0.012, "bed_size": (0.2, 0.2, 0.16), "duration": 0.2}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"ground": "bad"}, "ground = 'bad' is not known"),
        ({"ground": "bekker", "stiffness": 1.0}, "ground = 'bekker' takes ground_parameters"),
        (
            {"surface": "brick", "ground_parameters": ("exponent=1",)},
            "ground_parameters = exponent=1 belongs to another",
        ),
        ({"mu_s": 0.1, "mu_d": 0.2}, "mu_d = 0.2 is above mu_s = 0.1"),
        ({"lowering_speed": 0.1}, "lowering_speed = 0.1 is for platforms"),
        ({"grain": 0.004}, "grain = 0.004 belongs to ground = 'bed'"),
        ({"feet": ()}, "feet"),
        ({"ground": "power", "scale_with_gravity": True}, "scale_with_gravity.*'power'"),
        ({"ignore_foot_size": True}, "ignore_foot_size: ground = 'rft' is always"),
        ({"body_steps": 2}, "body_steps = 2 is for platforms"),
        ({"sleep_pace": 8}, "sleep_pace = 8 belongs to ground = 'bed'"),
        ({"stiffness": 1.0, "damping": 1.0, "scale_with_gravity": True}, "scale_with_gravity"),
        ({"ground": "lammps", "iterations": 3}, r"iterations = 3 .* iterations = 1"),
        ({"ground": "bed", "ranks": 2}, r"ranks = 2 .*ground = 'bed'"),
        ({"ranks": 2}, r"ranks = 2 .*ground = 'rft'"),
    ],
)
def test_what_does_not_go_together_is_refused_by_name(given, said):
    with pytest.raises(ValueError, match=said):
        RobotSettings(**HOPPER | given)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"model": "hoper"}, "model = 'hoper': there is no such file.* did you mean 'hopper'"),
        ({"model": "mine"}, "model = 'mine': there is no such file.* hedgehog, hopper, wheel"),
        ({"controller": "wheel:control"}, "controller = 'wheel:control': .* hopper:control or hedgehog:control"),
        ({"controller": "hopper:go"}, r"no function 'go'; it has control"),
        ({"feet": ("fot",)}, r"no geom or site 'fot' .did you mean 'foot'"),
        ({"keyframe": "up"}, "keyframe = 'up': the model has no keyframes"),
        ({"controller": "nothing.py:control"}, "controller = 'nothing.py:control'.*nothing.py"),
        ({"controller": HOP.replace("control", "go")}, r"no function 'go'; it has control"),
        ({"ground": "bekker", "ground_parameters": ("exponent",)}, "ground_parameters = 'exponent': name=value"),
        ({"stiffness": 1e7}, "'foot' is too light for this ground.* unstable with substeps = 10"),
    ],
)
def test_what_there_is_not_and_what_would_be_unstable_is_refused_before_any_work(given, said):
    with pytest.raises(ValueError, match=said):
        robot.check(RobotSettings(**HOPPER | given))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"grain": 0.015}, r"grain = 0.015 m: foot 'foot' is 0.06 m wide, 4 grains; .* at most 0.012 m are accepted"),
        ({"height": 0.002}, "starts 0.002 m over the surface.* height = 0.012 m is accepted"),
        ({"bed_size": (0.2, 0.2, 0.1)}, r"bed_size = 0.1 m deep is too shallow: .* a foot goes"),
        ({"bed_size": (0.04, 0.2, 0.16)}, r"bed_size = 0.04 m along x is too short"),
        ({"surface": "steel"}, "surface = 'steel' has no grains"),
        ({"gravity": 0.0}, "gravity = 0 m/s2: a bed of grains needs some"),
        ({"model": "hedgehog", "feet": ("tip_*",)}, "is a site, a point, which grains do not touch"),
        ({"substeps": 200}, "'foot' is too light for this ground.* unstable with substeps = 200"),
    ],
)
def test_a_bed_that_does_not_suit_the_robot_is_refused_before_any_work(given, said):
    with pytest.raises(ValueError, match=said):
        robot.check(RobotSettings(**ON_BED | given))


RAIL = """<mujoco><worldbody><body name="foot" pos="0 0 0.1" quat="{quat}">{joint}
  <geom name="foot" type="{kind}" size="0.04 0.04 0.04" mass="1"/></body></worldbody></mujoco>"""
UP = '<joint name="up" type="slide" axis="0 0 1"/>'


@pytest.mark.parametrize(
    ("given", "held"),
    [
        ({}, True),
        ({"kind": "ellipsoid"}, False),
        ({"joint": UP + '<joint name="yaw" axis="0 0 1"/>'}, False),
        ({"joint": UP + '<joint name="pitch" axis="0 1 0"/>'}, True),
        ({"joint": '<freejoint name="root"/>'}, False),
        ({"quat": "0.9 0.2 0.1 0"}, False),
    ],
)
def test_feet_are_regions_of_lammps_where_joints_hold_them_in_the_plane(given, held, tmp_path, monkeypatch):
    file = tmp_path / "rail.xml"
    file.write_text(RAIL.format(**{"kind": "box", "quat": "1 0 0 0", "joint": UP} | given))
    settings = RobotSettings(**ON_BED | {"model": str(file), "ground": "lammps", "duration": 0.05, "height": None})
    made = {}
    monkeypatch.setattr(
        "experiments.robot.on_grains.moved_to_lammps", lambda bed, *_, **given: made.update(given) or bed
    )
    monkeypatch.setattr("experiments.robot.on_grains.LammpsFeet", lambda *_, **__: None)
    run = RobotOnBed(settings, plan_robot(settings))
    run.progress = None
    run.ground(grain_bed())
    assert made == {"free": not held, "kept": None}


def test_the_depth_of_a_bed_that_a_refusal_names_is_accepted():
    def extent(depth):
        settings = RobotSettings(**ON_BED | {"bed_size": (0.2, 0.2, depth)})
        return RobotOnBed(settings, plan_robot(settings))

    with pytest.raises(ValueError, match="too shallow") as refused:
        extent(0.1).check_extent()
    accepted = extent(float(re.findall(r"([0-9.]+) m is accepted", str(refused.value))[0]))
    deepest, _ = accepted.depth_expected
    assert deepest < accepted.forecast.deepest  # on the spring-damper, which asks for a deeper bed
    accepted.check_bed()


def test_k_of_sand_goes_with_gravity_and_c_with_its_root_unless_that_is_refused_and_a_warning_names_it():
    """Forces among grains without cohesion go with their weight, speeds of similar motions with the root of gravity."""
    low = SPRING | {"gravity": 9.80665e-3}
    kept, scaled, asked = (plan_robot(RobotSettings(**low, scale_with_gravity=asked)) for asked in (False, None, True))
    assert scaled.numbers["stiffness"].value == pytest.approx(1e-3 * kept.numbers["stiffness"].value)
    assert scaled.numbers["damping"].value == pytest.approx(1e-3**0.5 * kept.numbers["damping"].value)
    assert scaled.numbers == asked.numbers
    (of_one_g,) = [said for said in kept.warnings if "--scale-with-gravity" in said]
    foot = scaled.numbers["stiffness"].value * scaled.scales["foot"]
    assert f"{foot:.3g} N/m" in of_one_g and f"{1e3 * foot:.3g} N/m" in of_one_g
    assert not [said for said in scaled.warnings if "--scale-with-gravity" in said]
    given = plan_robot(RobotSettings(**low, stiffness=2.0))
    assert given.numbers["stiffness"].value == 2.0 and given.numbers["damping"] == scaled.numbers["damping"]
    assert not [said for said in given.warnings if "K = " in said]
    for surface, asked in (("jsc1a-heights", None), ("jsc1a", False)):  # without a map, and without its use
        sticky = plan_robot(RobotSettings(**low, surface=surface, scale_with_gravity=asked))
        assert [said for said in sticky.warnings if f"cohesion of {surface}:" in said]
    for surface in ("jsc1a", "brick"):
        with pytest.raises(ValueError, match=f"scale_with_gravity.*{surface}"):
            plan_robot(RobotSettings(**low, surface=surface, scale_with_gravity=True))


@pytest.mark.parametrize("gravity", [9.80665, 1.62, 9.80665e-3, 9.80665e-6])
def test_k_and_c_of_sand_and_their_errors_are_those_that_hedgebed_ground_states_at_this_gravity(gravity):
    map_ = read_map("sand").answer(gravity=gravity, diameter=0.012, grain=2e-4, packing=None, load=None)
    plan = plan_robot(RobotSettings(**SPRING, gravity=gravity))
    for name in ("stiffness", "damping"):
        assert plan.numbers[name].value == pytest.approx(
            getattr(map_, name).value, rel=2e-3
        )  # the surface's are rounded
    (said,) = [said for said in plan.warnings if "same relative errors" in said]
    k, c = (float(f"{1.96 * getattr(map_, name).std:.2g}") for name in ("stiffness", "damping"))
    assert f"± {k:g} N/m" in said and f"± {c:g} N s/m" in said and "(95" in said


def test_k_of_sand_stays_that_of_one_g_where_the_map_of_gravity_does_not_reach(tmp_path):
    """Below 1e-6 g, above 1 g, of a foot of more than 100 mm, and of sand that has no map: a warning says why."""
    (tmp_path / "lander.xml").write_text(LANDER, encoding="utf-8")
    lander = {"model": str(tmp_path / "lander.xml"), "feet": ("hull",), "gravity": 1.0, "ground": "spring-damper"}
    beyond = [SPRING | {"gravity": gravity} for gravity in (5e-6, 25.0)]
    weak = HOPPER | {"gravity": 1.0, "surface": "sand-weak"}
    sets = [(given, "beyond the map") for given in beyond]
    for given, why in [*sets, (weak, "no map"), (lander, "'hull' has")]:
        plan = plan_robot(RobotSettings(**given))
        earth = plan_robot(RobotSettings(**given | {"gravity": 9.81}))
        assert plan.numbers["stiffness"] == earth.numbers["stiffness"]
        (said,) = [said for said in plan.warnings if "--scale-with-gravity" in said]
        assert why in said and not [said for said in plan.warnings if "standard deviations" in said]


def test_a_hull_that_stays_above_the_grains_does_not_set_the_k_that_a_warning_names(tmp_path):
    """A body with a plate of 200 mm and, 120 mm below it, a tip of 60 mm: the warning has K of the tip."""
    (tmp_path / "lander.xml").write_text(LANDER, encoding="utf-8")
    low = {"gravity": 4.0, "model": str(tmp_path / "lander.xml"), "feet": ("hull", "tip"), "duration": 0.15}
    settings = RobotSettings(**ON_BED | low | {"bed_size": (0.3, 0.3, 0.2)})
    on_bed = RobotOnBed(settings, plan_robot(settings))
    stiffness = on_bed.told.numbers["stiffness"].value
    (said,) = [said for said in on_bed.told.warnings if "scale-with-gravity" in said]
    tip = on_bed.plan.scales["tip"] * stiffness
    assert f"{tip:.3g} N/m" in said and on_bed.plan.scales["hull"] > 5 * on_bed.plan.scales["tip"]
    assert len(on_bed.told.warnings) == len(on_bed.plan.warnings)


@pytest.mark.parametrize("law", ["hunt-crossley", "power", "power-irreversible", "katsuragi-durian", "bekker", "rft"])
def test_a_law_whose_parameters_do_not_follow_from_the_surface_says_so_and_its_title_names_none(law, tmp_path):
    """The foot of the hopper has 60 mm, 25 times the area of the spike of 12 mm that the defaults are of."""
    settings = RobotSettings(**HOPPER, ground=law, surface="jsc1a", duration=0.01, ignore_foot_size=True)
    plan = plan_robot(settings)
    (said,) = [said for said in plan.warnings if "ground_parameters" in said]
    assert all(word in said for word in ("'jsc1a'", "ground.toml"))
    if law not in ("rft", "bekker"):  # which are of no tip
        assert float(re.findall(r"12 mm .*has ([0-9.]+) times", said)[0]) == pytest.approx(25, rel=0.02)
    follow = ("rft", "katsuragi-durian", "power-irreversible")
    assert ("nor gravity" in said) == (law not in follow) and not [said for said in plan.warnings if "a guess" in said]
    made = RobotFollowed(settings, plan).run_on_law()
    made.run()
    title = conclude(settings, plan, made, tmp_path)["title"]
    assert law in title and "jsc1a" not in title and "sand" not in title


def test_a_law_with_all_its_parameters_given_has_no_warning_of_defaults():
    given = ("stiffness=4000", "damping=9", "exponent=1.2")  # of the foot: they stay
    told = [plan_robot(RobotSettings(**HOPPER, ground="power", ground_parameters=some)) for some in (given, given[:2])]
    assert [number.value for number in map(told[0].numbers.get, ("stiffness", "damping", "exponent"))] == [4000, 9, 1.2]
    assert not [said for said in told[0].warnings if "defaults" in said]
    (left,) = [said for said in told[1].warnings if "defaults" in said]
    assert "exponent" in left and "stiffness" not in left and "damping" not in left
    with pytest.raises(ValueError, match="stiffnes "):
        plan_robot(RobotSettings(**HOPPER, ground="power", ground_parameters=("stiffnes=1",)))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"ground": "power"},
            r"ground = 'power': its defaults of stiffness and damping are those of brick .* --ignore-foot-size",
        ),
        ({"ground": "hunt-crossley", "ground_parameters": ("stiffness=4000",)}, "its defaults of dissipation are"),
        ({"ground": "bekker", "ground_parameters": ("exponent=1.3",)}, "exponent is given, and cohesive_modulus and"),
    ],
)
def test_defaults_that_follow_no_foot_are_refused_on_grains_unless_they_are_accepted(given, said):
    with pytest.raises(ValueError, match=said):
        plan_robot(RobotSettings(**HOPPER | given))
    on_brick = {"surface": "brick", "ignore_foot_size": given["ground"] == "bekker"}  # A law of grains
    for accepted in ({"ignore_foot_size": True}, on_brick):
        plan = plan_robot(RobotSettings(**HOPPER | given | accepted))
        ground, found = plan.law_feet(plan.robot()), find_law(given["ground"])
        own = found.values(given_parameters(plan.settings))
        once = found.force(2e-3, 0.1, found.numbers(own))
        assert sum(float(one.force(2e-3, 0.1)) for one in ground.grounds[0][:8]) == pytest.approx(once, rel=1e-9)


@pytest.mark.parametrize("law", ["power-irreversible", "katsuragi-durian", "bekker", "rft"])
@pytest.mark.parametrize("surface", ["steel", "brick"])
def test_a_law_of_grains_is_refused_on_hard_ground_and_accepted_it_is_that_of_the_spike(law, surface):
    with pytest.raises(ValueError, match=f"ground = '{law}' is a law of grains, and surface = '{surface}' is hard"):
        plan_robot(RobotSettings(**HOPPER, ground=law, surface=surface))
    plan = plan_robot(RobotSettings(**HOPPER, ground=law, surface=surface, ignore_foot_size=True))
    found = find_law(law)
    own = found.values(found.in_gravity(plan.numbers["gravity"].value, {}))
    once = found.force(2e-3, 0.1, found.numbers(own))
    parts = plan.law_feet(plan.robot()).grounds[0][:8]
    assert sum(float(one.force(2e-3, 0.1)) for one in parts) == pytest.approx(once, rel=1e-9)
    assert not [number.origin for number in plan.numbers.values() if "under a foot" in number.origin]
    assert [said for said in plan.warnings if "any size" in said]


def test_a_larger_foot_has_more_force_under_a_law_and_its_numbers_say_how_much():
    """A plate of 60 mm has 25 times the area of the spike of 12 mm: K is as the area, C as its power 1.25."""
    plan = plan_robot(RobotSettings(**HOPPER, ground="katsuragi-durian", gravity=9.80665))
    spike = find_law("katsuragi-durian").values({})
    (one, *_), value = plan.law_feet(plan.robot()).grounds[0], plan.scales["foot"]
    assert value == pytest.approx(25, rel=0.01)
    for name in ("stiffness", "drag"):
        assert one.parameters[name] == pytest.approx(value * spike[name])
        assert f"{value:.3g} times under" in plan.numbers[name].origin
    spring = plan_robot(RobotSettings(**SPRING))
    (one, *_), own = spring.law_feet(spring.robot()).grounds[0], spring.numbers
    assert one.parameters["stiffness"] == pytest.approx(value * own["stiffness"].value)
    assert one.parameters["damping"] == pytest.approx(value**1.25 * own["damping"].value)
    given = plan_robot(RobotSettings(**HOPPER, stiffness=900.0, damping=3.0))
    assert given.law_feet(given.robot()).grounds[0][0].parameters == {"stiffness": 900.0, "damping": 3.0}


def test_gravity_of_the_run_goes_into_a_law_that_takes_it_unless_it_is_given():
    """The stress of resistive force theory is in proportion to gravity, also under the sole of a foot."""

    def stress(gravity, *given):
        plan = plan_robot(RobotSettings(**HOPPER, ground="rft", gravity=gravity, ground_parameters=given))
        law = plan.law_feet(plan.robot()).grounds[0][0]
        return find_law("rft-foot").numbers(law.parameters)[0], plan.numbers

    (low, _), (high, _), (own, numbers) = stress(1.0), stress(4.0), stress(1.0, "gravity=4")
    assert high == pytest.approx(4 * low) and own == high
    assert numbers["gravity"].value == 1.0 and numbers["ground_gravity"].value == 4.0
    with pytest.raises(ValueError, match="gravity = 0 m/s2"):
        stress(0.0)


def test_a_model_that_an_option_took_as_one_of_its_words_is_found(capsys):
    assert main(["mujoco", "--surface", "sand", "--feet", "foot", "hopper"]) == 2
    said = capsys.readouterr().err
    assert "hopper --feet" in said and "foot hopper" in said


@pytest.mark.long
def test_the_hedgehog_turns_onto_its_next_face_and_stays_and_its_spikes_are_no_surprise_in_the_ground(tmp_path):
    """It stays where its kinetic energy is far below m g l (1 - cos 22.5 degrees), which it takes to tip further."""
    turn = f"{EXAMPLES / 'mujoco-hedgehog' / 'turn.py'}:control"
    settings = RobotSettings(
        model="hedgehog", feet=("tip_*",), surface="brick", controller=turn, duration=15, substeps=40, frame_count=0
    )
    plan = plan_robot(settings)
    run = RobotFollowed(settings, plan).run_on_law()
    run.run()
    quaternion, (*speed, wx, wy, wz) = run.joints["qpos"][-1][3:7], run.joints["qvel"][-1][:6]
    moving = 0.5 * 5.3 * np.square(speed).sum() + 0.5 * 0.06 * (wx**2 + wy**2 + wz**2)
    turned = 2 * np.degrees(np.arctan2(quaternion[2], quaternion[0]))
    assert turned == pytest.approx(45, abs=0.1)
    assert moving < 0.01 * 5.3 * 0.0834 * 0.2 * (1 - np.cos(np.pi / 8))
    told = conclude(settings, plan, run, tmp_path).warnings
    assert not [said for said in told if "below the surface" in said]


def test_a_controller_that_fails_is_refused_with_its_file_and_line_and_finds_what_lies_beside_it(tmp_path):
    (tmp_path / "gait.txt").write_text("1")
    file = tmp_path / "own.py"
    file.write_text(
        "from pathlib import Path\nHERE = Path(__file__).with_name('gait.txt')\n\n\n"
        "def late(model, data):\n    data.ctrl[0] = 1 / (data.time < 0.1)\n\n\n"
        "def bad(model, data):\n    data.ctrl[1] = 0.0\n\n\n"
        "def wild(model, data):\n    data.ctrl[0] = float('nan')\n\n\n"
        "def reads(model, data):\n    data.ctrl[0] = float(HERE.read_text())\n"
    )

    def given(name):
        return RobotSettings(**HOPPER, controller=f"{file}:{name}", duration=0.15, frame_count=0)

    with pytest.raises(ValueError, match=r"own.py, line 10: bad fails: IndexError"):
        robot.check(given("bad"))
    with pytest.raises(ValueError, match=r"data.ctrl is \[nan\]"):
        robot.check(given("wild"))
    robot.check(given("late"))
    with pytest.raises(RuntimeError, match=r"own.py, line 6: late fails: ZeroDivisionError.*; mend the controller"):
        robot.run(given("late"), tmp_path / "late")
    kept = tmp_path / "kept"
    kept.mkdir()
    keep_files(given("reads"), kept)
    made = plan_robot(given("reads"), folder=kept).robot()
    made.controller(made.model, made.data)
    assert made.data.ctrl[0] == 1.0


def test_a_robot_that_the_world_holds_and_a_load_above_the_limit_are_told(tmp_path):
    held = tmp_path / "held.xml"
    held.write_text(
        "<mujoco><worldbody><body pos='0 0 .3'><joint type='hinge' axis='0 1 0'/>"
        "<geom name='foot' size='.02' pos='0 0 -.25' mass='1'/></body></worldbody></mujoco>"
    )
    told = [any("fixed to the world" in said for said in plan_robot(RobotSettings(**given)).warnings)
            for given in (HOPPER | {"model": str(held)}, HOPPER)]  # fmt: skip
    assert told == [True, False]
    settings = RobotSettings(**HOPPER, duration=0.01)
    plan = plan_robot(settings)
    made = RobotFollowed(settings, plan).run_on_law()
    made.run()
    warned = []
    for load in (0.5, 1.5):
        made.load = load
        warned.append(any("stability" in said for said in conclude(settings, plan, made, tmp_path).warnings))
    assert warned == [False, True]


BIPED = """<mujoco><worldbody><body pos="0 0 .32"><freejoint/><geom type="box" size=".08 .06 .05" mass="2"/>
  <geom name="foot_l" size=".03" pos="0 .05 -.27" mass=".3"/>
  <geom name="foot_r" size=".03" pos="0 -.05 -.27" mass=".3"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("given", "grows"), [({}, True), ({"substeps": 1}, False), ({"iterations": 20}, False), ({"damping": 2e3}, False)]
)
def test_a_start_on_contacts_that_create_energy_is_warned_of_with_what_would_do(tmp_path, given, grows):
    biped = tmp_path / "biped.xml"
    biped.write_text(BIPED)
    on_springs = {"model": str(biped), "feet": ("foot_*",), "stiffness": 1e7, "damping": 0.0, "duration": 0.2}
    settings = RobotSettings(**on_springs | given)
    run = RobotFollowed(settings, plan_robot(settings)).run_on_law()
    assert run.load < 1
    warning = growth_warning(settings, run) or ""
    assert all((named in warning) == grows for named in ("--iterations 20", "--substeps 1"))


def test_a_run_whose_exchange_created_energy_says_so_in_title_and_warnings_and_iterated_it_does_not(tmp_path):
    biped = tmp_path / "biped.xml"
    biped.write_text(BIPED)
    on_springs = {"model": str(biped), "feet": ("foot_*",), "stiffness": 1e7, "damping": 0.0, "duration": 0.2}
    results = []
    for name, iterations in (("explicit", 1), ("iterated", 20)):
        settings = RobotSettings(**on_springs, iterations=iterations, frame_count=0)
        plan = plan_robot(settings)
        run = RobotFollowed(settings, plan).run_on_law()
        run.run()
        results.append(conclude(settings, plan, run, tmp_path / name))
        assert (run.unaccounted > 0.1 * run.energy_scale) == (iterations == 1)
    wild, calm = results
    assert wild.quantities["energy_residual"].value > MOST_RESIDUAL > 1e-6 > calm.quantities["energy_residual"].value
    for result, expected in ((wild, True), (calm, False)):
        assert any("--iterations 20" in said for said in result.warnings) == expected
        assert ("not valid" in result.title) == expected


@pytest.mark.parametrize("surface", ["sand", "sand-weak", "jsc1a", "brick", "steel"])
def test_the_robots_that_ship_start_without_a_warning_of_energy(surface):
    wheel = {"model": "wheel", "feet": ("wheel", "grouser_*"), "keyframe": "drive"}
    hedgehog = {"model": "hedgehog", "feet": ("tip_*",), "keyframe": "tumble", "substeps": 40, "duration": 15}
    for given in (HOPPER, wheel, hedgehog):
        settings = RobotSettings(**given, surface=surface)
        assert growth_warning(settings, RobotFollowed(settings, plan_robot(settings)).run_on_law()) is None


def test_threads_on_a_law_are_taken_with_a_message_as_in_a_tumble(tmp_path, capsys):
    foot = ["hopper", "--feet", "foot", "--duration", "0.02", "--frame-count", "0"]
    assert main(["mujoco", *foot, "--threads", "1", "--out", str(tmp_path / "run")]) == 0
    told = capsys.readouterr().err
    assert "threads = 1" in told and "] tumble" not in told and "] robot" in told


@pytest.mark.parametrize(("duration", "airborne"), [(0.08, False), (0.15, True)])
def test_a_run_that_ends_in_a_flight_says_that_the_flight_is_cut_off(duration, airborne, tmp_path):
    """A fall of 20 mm takes 64 ms, half a swing of 1.5 kg on 15 kN/m 31 ms, the flight after it 128 ms."""
    (tmp_path / "lander.xml").write_text(LANDER, encoding="utf-8")
    settings = RobotSettings(
        model=str(tmp_path / "lander.xml"), feet=("tip",), surface="brick", stiffness=15e3, damping=0.0, height=0.02,
        duration=duration,
    )  # fmt: skip
    plan = plan_robot(settings)
    run = RobotFollowed(settings, plan).run_on_law()
    run.run()
    told = conclude(settings, plan, run, tmp_path).warnings
    assert any("cut off" in said for said in told) == airborne


@pytest.mark.long
def test_a_run_on_a_law_leaves_its_series_and_numbers(tmp_path):
    settings = RobotSettings(**HOPPER, controller=HOP, duration=0.45, frame_count=0)
    result = robot.run(settings, tmp_path)
    motion, joints = (read_series(tmp_path / "series" / f"{name}.csv") for name in ("motion", "joints"))
    feet, _ = read_columns(tmp_path / "series" / "feet.csv")
    assert motion["t_s"][-1] == pytest.approx(0.45) and len(motion["t_s"]) == len(feet["t_s"]) == len(joints["t_s"])
    assert motion["fz_N"] == pytest.approx(feet["foot_fz_N"], abs=1e-9)
    assert np.ptp(joints["knee_m"]) > 0.01 and joints["push_control"].min() == -60.0
    quantities = result.quantities
    assert quantities["energy_residual"].value < 5e-3 and quantities["flights"].value == 1
    assert not any("energy" in said for said in result.warnings)
    assert quantities["sinkage_largest"].value == pytest.approx(float(motion["sinkage_m"].max()))
    # K of the foot: that of a spike times the area of 60 mm over that of 12 mm, as its picture of 32 sides has it.
    plan = plan_robot(settings)
    assert plan.scales["foot"] == pytest.approx((60 / 12) ** 2, rel=0.01)
    assert (tmp_path / "report.html").stat().st_size > 1e4
    again = robot.resume(tmp_path)
    assert again.quantities == result.quantities


@pytest.mark.long
def test_on_a_small_bed_a_stopped_run_goes_on_to_the_same_bits_and_is_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(RobotOnBed, "prepare", lambda *_: grain_bed())
    monkeypatch.setattr(RobotOnBed, "check", lambda *_: None)
    given = ON_BED | {"grain": 0.006, "bed_size": (0.096, 0.096, 0.05), "duration": 0.05, "height": 0.003}
    given |= {"frame_count": 2, "checkpoint_interval": 1e-3}
    whole = robot.run(RobotSettings(**given), tmp_path / "whole")
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        stop_at(patch, 60)
        robot.run(RobotSettings(**given), tmp_path / "parts")
    parts = robot.resume(tmp_path / "parts")
    assert parts.quantities == whole.quantities
    rows = [read_series(tmp_path / part / "series" / "bed.csv") for part in ("whole", "parts")]
    assert all((rows[0][name] == rows[1][name]).all() for name in rows[0])
    assert whole.quantities["largest_force"].value > 1.0 and whole.quantities["energy_residual"].value < 0.02
    assert (tmp_path / "whole" / "figures" / "robot-end.png").exists()
    assert (tmp_path / "whole" / "report.html").read_text().count('class="head"') == 1  # the scene that can be turned
    assert (tmp_path / "whole" / "series" / "rft.csv").exists() and "Grains and rft" in (
        tmp_path / "whole" / "report.html"
    ).read_text()
    (seen,) = sources_of(tmp_path / "whole")
    assert not seen.block and len(seen.times) >= 2 and len(seen.frame(0).grains["position"]) == 768
    last = seen.panels[0]["lines"][-1]
    assert len(seen.panels[0]["lines"]) == 4 and last["name"] == "z, rft" and last["dashed"]
    assert json.loads((tmp_path / "whole" / "result.json").read_text())["grains"]["grain_count"] == 768


@pytest.mark.long
def test_on_grains_in_lammps_a_stopped_run_goes_on_to_its_end(tmp_path, monkeypatch):
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    monkeypatch.setattr(RobotOnBed, "prepare", lambda *_: grain_bed())
    monkeypatch.setattr(RobotOnBed, "check", lambda *_: None)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    given = ON_BED | {"ground": "lammps", "bed_size": (0.096, 0.096, 0.05), "grain": 0.006, "height": 0.003}
    settings = RobotSettings(**given | {"duration": 0.05, "frame_count": 2, "checkpoint_interval": 1e3})
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        stop_at(patch, 60)
        robot.run(settings, tmp_path)
    result = robot.resume(tmp_path)
    motion = read_series(tmp_path / "series" / "motion.csv")
    assert motion["t_s"][-1] == pytest.approx(0.05, rel=0.01) and (np.diff(motion["t_s"]) > 0).all()
    assert result.quantities["largest_force"].value > 1.0 and result.quantities["energy_residual"].value < 0.02
    assert result["ground"] == "bed" and "LAMMPS" in result["title"] and "dissipated_friction" not in result.quantities


def test_a_robot_on_a_law_is_shown_on_a_block_with_its_curves_and_arrows_in_weights(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    result = robot.run(RobotSettings(**HOPPER, duration=0.06, frame_count=4), tmp_path)
    (seen,) = sources_of(tmp_path)
    assert seen.block and seen.surface == 0.0 and (seen.low[:2] < seen.high[:2]).all()
    assert seen.force == ("weight", pytest.approx(1.72 * 9.81))
    assert seen.times[-1] == pytest.approx(0.06) and set(seen.frame(0).bodies) == {"spikes", "hull"}
    panels = {panel["label"]: {line["name"]: line for line in panel["lines"]} for panel in seen.panels}
    assert [list(lines) for lines in panels.values()] == [
        [*"xyz"],
        [*"xyz"],
        ["foot"],
        [""],
        ["rail", "knee"],
        ["push"],
    ]
    (depth,) = panels["depth of the feet [mm]: foot"].values()
    assert max(depth["y"]) == pytest.approx(1e3 * result.quantities["sinkage_largest"].value, rel=1e-3)
    last = read_series(tmp_path / "series" / "motion.csv")
    _, arrows = seen.frame(len(seen.times) - 1).clouds["row_forces"]
    assert arrows["force"][0, 2] == pytest.approx(last["fz_N"][-1], rel=1e-5)
    assert len(report_scene(tmp_path)) == 1


def test_a_robot_without_frames_has_its_curves_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    robot.run(RobotSettings(**HOPPER, duration=0.04, frame_count=0), tmp_path)
    (seen,) = sources_of(tmp_path)
    assert not len(seen.times) and len(seen.panels) >= 5 and "--frame-count" in seen.note
    assert report_scene(tmp_path) == []


def test_a_law_in_a_file_is_that_of_its_tip_times_the_area_of_the_foot():
    file = EXAMPLES.parents[2] / "docs" / "results" / "calibrate-sand-1mm" / "ground.toml"
    plan = plan_robot(RobotSettings(**HOPPER, ground=str(file)))
    fitted = plan.fitted
    assert plan.scales["foot"] == pytest.approx((0.06 / fitted.foot.diameter) ** 2, rel=0.01)
    ground = plan.law_feet(plan.robot())
    own = sum(float(law.force(1e-3, 0.0)) for law in ground.grounds[0][:8])
    assert own == pytest.approx(plan.scales["foot"] * float(fitted.ground().force(1e-3, 0.0)), rel=1e-9)
    with pytest.raises(ValueError, match="has its own parameters"):
        RobotSettings(**HOPPER, ground=str(file), stiffness=1.0)


def test_the_command_takes_the_model_as_its_first_word(tmp_path, capsys):
    file = str(EXAMPLES / "mujoco-hopper" / "hopper.xml")
    out = str(tmp_path / "run")
    code = main(["mujoco", file, "--feet", "foot", "--duration", "20ms", "--frame-count", "0", "--out", out, "--quiet"])
    assert code == 0 and RunFolder.open(tmp_path / "run").status == "done"
    assert main(["mujoco", file, "--feet", "toe"]) == 2
    assert "'toe'" in capsys.readouterr().err
