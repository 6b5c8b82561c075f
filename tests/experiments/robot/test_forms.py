"""By how much a robot's answer depends on the form of its law: the same robot on the other laws of sand."""

import re

import pytest

from experiments.robot.depths import Deepest
from experiments.robot.forms import NO_FORMS, OnLaw, forms_of, other_laws, with_grains
from experiments.robot.on_grains import RobotFollowed
from experiments.robot.on_laws import on_law as of_run
from experiments.robot.plan import plan_robot
from experiments.robot.settings import RobotSettings
from experiments.robot.sure import ANSWER

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOPPER = {"model": "hopper", "feet": ("foot",), "height": 0.012, "duration": 0.12}
OF_1_G = "bekker"


def planned(**given):
    return plan_robot(RobotSettings(**HOPPER | given))


def on_law(value, **more):
    """All numbers of the answer the same."""
    return OnLaw(answer=dict.fromkeys(ANSWER, value), **{"time": 0.12} | more)


def test_other_laws_are_those_with_numbers_for_this_gravity_and_never_the_own():
    assert set(other_laws(planned())) == {
        "rft, inertia=2", "rft, inertia=10", "spring-damper", "power-irreversible", "katsuragi-durian", OF_1_G,
    }  # fmt: skip
    low = other_laws(planned(gravity=0.098, ground="spring-damper"))
    assert OF_1_G not in low and "spring-damper" not in low and "rft" in low
    assert "rft, inertia=10" not in other_laws(planned(ground_parameters=("inertia=10",)))


@pytest.mark.parametrize(
    "given", [{"surface": "jsc1a"}, {"stiffness": 900.0}, {"ground_parameters": ("surface_friction=0.2",)}]
)
def test_numbers_of_another_ground_have_no_other_laws(given):
    plan = planned(**given)
    assert other_laws(plan) == {}
    assert forms_of(plan, on_law(1.0), lambda _: pytest.fail("ran"), sure={}) == NO_FORMS


def test_the_range_holds_each_law_and_a_law_that_fails_is_named():
    plan, tried = planned(), []

    def follow(other):
        tried.append(other.law)
        if other.law == "bekker":
            raise RuntimeError
        return on_law(0.1 * len(tried))

    sure = {"highest": {"low": -0.5, "high": 0.6}}
    forms = forms_of(plan, on_law(0.05), follow, sure=sure)
    most = max(answer["highest"] for answer in forms.numbers["laws"].values())
    assert forms.numbers["ranges"]["largest_force"]["low"] == 0.05
    assert forms.numbers["ranges"]["largest_force"]["high"] == most == pytest.approx(0.1 * (len(tried) - 1))
    assert forms.numbers["ranges"]["highest"]["low"] == -0.5
    assert any("bekker" in said for said in forms.words) and "bekker" not in forms.numbers["laws"]


@pytest.mark.parametrize(("flight", "told"), [(0.2, "highest"), (0.0, "sinkage_largest")])
def test_real_sand_is_expected_between_a_law_and_grains_and_the_range_holds_both(flight, told):
    plan = planned()
    answers = {law: on_law(0.01 * place) for place, law in enumerate(other_laws(plan), 1)}
    laws = forms_of(plan, on_law(0.05, fast=True), lambda other: answers[named(other)], sure={})
    assert laws.numbers["laws"]["rft, inertia=2"] == answers["rft, inertia=2"].answer
    own = dict.fromkeys(ANSWER, 7.0) | {"longest_flight": flight}
    forms = with_grains(laws, own)
    assert forms.numbers["ranges"][told]["high"] == 7.0 and forms.numbers["ranges"][told]["value"] == 7.0
    assert forms.numbers["ranges"][told]["low"] == laws.numbers["ranges"][told]["low"] == 0.01
    word = {"highest": "rise", "sinkage_largest": "sinkage"}[told]
    assert f"{word} is 0.01" in forms.words[0] and "inertia=2 0.01 m;" in forms.words[0]
    assert [re.findall("[0-9]+ m", one.words[1]) for one in (laws, forms)] == [[], []]  # one range only
    assert "'bed'" in laws.words[1] and "inertia=2" in forms.words[1]
    harder = with_grains(laws, own | {"sinkage_largest": 0.001})  # of the law that is compared: 0.01 m and more
    assert ["likelier" in one.words[1] for one in (forms, harder)] == [False, True]
    assert with_grains(NO_FORMS, own) == NO_FORMS
    landings = [any("--duration" in words and "0.12 s" in words for words in one.words) for one in (laws, forms)]
    assert landings == [True, True] and laws.numbers["duration"] == forms.numbers["duration"] == 0.12


def test_only_grains_under_a_fast_foot_that_carry_more_than_the_law_say_where_real_sand_is():
    """A run on laws alone never does, and only a fast foot is told that laws push it too little."""
    plan, own = planned(), dict.fromkeys(ANSWER, 0.05)
    softer, harder = own | {"sinkage_largest": 0.07}, own | {"sinkage_largest": 0.03}
    for fast in (False, True):
        laws = forms_of(plan, on_law(0.05, fast=fast), lambda _: on_law(0.06), sure={})
        told = [" ".join(one.words) for one in (laws, with_grains(laws, softer), with_grains(laws, harder))]
        assert ["2.6" in words for words in told] == [fast, False, fast]
        assert ["likelier" in words for words in told] == [False, False, fast]
        assert not any("expected between" in words for words in told)


def deep(depth):
    return Deepest(name="ball", depth=depth, limit=0.06, diameter=0.04)


def test_laws_whose_foot_went_deeper_than_they_hold_or_moved_when_it_pushed_are_named_but_not_in_the_range():
    plan = planned()
    runs = {
        "spring-damper": on_law(0.9, deepest_before=deep(0.09), push_speed=0.01),
        "bekker": on_law(0.8, deepest=deep(0.03), push_speed=0.5),
    }
    held = on_law(0.06, deepest=deep(0.05), push_speed=0.02)
    forms = forms_of(plan, held, lambda other: runs.get(other.law, held), sure={})
    grains = with_grains(forms, dict.fromkeys(ANSWER, 0.07))
    assert set(forms.numbers["beyond"]) == set(runs) and set(runs) < set(forms.numbers["laws"])
    assert [one.numbers["ranges"]["highest"]["high"] for one in (forms, grains)] == [0.06, 0.07]
    for one in (forms, grains):
        (left_out,) = [words for words in one.words if "holds to 1.5" in words]
        assert re.findall(r"(spring-damper|bekker) ([0-9]+)", left_out) == [("spring-damper", "900"), ("bekker", "800")]
        assert "2.2 " in left_out and "0.5 m/s" in left_out and not any(law in one.words[0] for law in runs)


def test_a_push_out_of_a_motion_that_all_laws_have_leaves_none_out_and_without_a_law_that_holds_there_is_no_range():
    plan, moving = planned(), on_law(0.06, push_speed=0.5)
    forms = forms_of(plan, moving, lambda _: moving, sure={"highest": {"low": 0.05, "high": 0.07}})
    assert not forms.numbers["beyond"] and forms.numbers["ranges"]["highest"]["high"] == 0.07
    none = forms_of(
        plan, on_law(0.06, deepest_before=deep(0.1)), lambda _: on_law(0.06, deepest_before=deep(0.1)), sure={}
    )
    for one in (none, with_grains(none, dict.fromkeys(ANSWER, 0.07))):
        assert "ranges" not in one.numbers and "no law holds" in one.words[0] and "bekker 60" in one.words[1]


def test_a_law_whose_foot_goes_too_deep_in_a_later_landing_has_its_rise_in_the_range_and_neither_sinkage_nor_force():
    plan, held = planned(), on_law(0.06, deepest=deep(0.05), deepest_before=deep(0.05))
    lands = on_law(0.9, deepest=deep(0.09), deepest_before=deep(0.05))
    sure = {name: {"low": 0.02, "high": 0.95} for name in ANSWER}
    for own, others, most in ((held, lands, 0.06), (lands, held, 0.06)):
        laws = forms_of(plan, own, lambda _, found=others: found, sure=sure)
        grains = with_grains(laws, dict.fromkeys(ANSWER, 0.03))
        for one in (laws, grains):
            ranges = one.numbers["ranges"]
            assert ranges["highest"]["high"] == (0.95 if one is laws else 0.9)
            assert (
                ranges["sinkage_largest"]["high"]
                == ranges["largest_force"]["high"]
                == (0.95 if own is held and one is laws else most)
            )
            assert any("later landing" in words for words in one.words)
    none = with_grains(forms_of(plan, lands, lambda _: lands, sure={}), dict.fromkeys(ANSWER, 0.03))
    assert set(none.numbers["ranges"]) == set(ANSWER) - {"sinkage_largest", "largest_force"}


LEG = """<mujoco><worldbody><body pos="0 0 0.3"><joint type="slide" axis="0 0 1"/>
<geom type="box" size="0.06 0.06 0.04" mass="2.5"/><body pos="0 0 -0.25">
<joint name="leg" type="slide" axis="0 0 -1" range="0 0.2" limited="true"/>
<geom name="foot" type="sphere" size="0.025" mass="0.5"/></body></body></worldbody>
<actuator><motor joint="leg" ctrlrange="-100 100"/></actuator></mujoco>"""
PUSH = """def control(model, data):
    data.ctrl[0] = 100.0 if 0.25 <= data.time < 0.33 else -10.0
"""


@pytest.fixture
def leg(tmp_path):
    (tmp_path / "leg.xml").write_text(LEG, encoding="utf-8")
    (tmp_path / "push.py").write_text(PUSH, encoding="utf-8")
    return {"model": str(tmp_path / "leg.xml"), "controller": f"{tmp_path / 'push.py'}:control", "duration": 0.4}


def test_a_law_into_which_a_leg_still_sinks_when_it_pushes_is_outside_its_range_and_that_on_which_it_rests_is_not(leg):
    """Of 3 kg on a ball of 50 mm: katsuragi-durian stops it 8 diameters deep only."""
    plan = planned(**leg)
    runs = {}
    for law in (plan, other_laws(plan)["katsuragi-durian"]):
        run = RobotFollowed(law.settings, law).run_on_law()
        run.run()
        runs[law.law] = of_run(run, law)
    rests, sinks = runs["rft"], runs["katsuragi-durian"]
    assert 0 <= rests.push_speed < 0.05 < 0.3 < sinks.push_speed
    assert (
        not rests.deepest_before.beyond
        and sinks.deepest_before.beyond
        and sinks.deepest_before.limit == pytest.approx(0.075, rel=0.01)
    )


def test_a_law_on_which_the_robot_still_pushes_off_is_left_out_and_named_and_so_in_the_run_itself():
    plan, tried = planned(), []

    def follow(other):
        tried.append(named(other))
        return on_law(0.2, time=0.48, rising=tried[-1] in ("rft, inertia=2", "bekker"))

    forms = forms_of(plan, on_law(-0.9, rising=True, fast=True), follow, sure={"highest": {"low": -0.95, "high": -0.9}})
    assert tried[0] == "rft" and forms.numbers["ranges"]["highest"]["low"] == 0.2
    assert forms.numbers["rising"] == ["rft, inertia=2", "bekker"] and not set(forms.numbers["rising"]) & set(
        forms.numbers["laws"]
    )
    for one in (forms, with_grains(forms, dict.fromkeys(ANSWER, 0.3) | {"sinkage_largest": 0.05})):
        (left_out,) = [said for said in one.words if "rft, inertia=2, bekker" in said]
        assert "0.48 s" in left_out
        assert ("between rft and" in " ".join(one.words)) == (one is not forms)  # the law that is there
    none = forms_of(plan, on_law(-0.9, rising=True), lambda _: on_law(0.2, rising=True), sure={})
    assert not none.numbers and "bekker" in none.words[0] and with_grains(none, {}) == none


def test_a_robot_that_leaves_no_law_has_no_later_landing():
    own = OnLaw(answer=dict.fromkeys(ANSWER, 0.05) | {"longest_flight": 0.0}, time=0.12)
    assert not any("--duration" in words for words in forms_of(planned(), own, lambda _: own, sure={}).words)


def test_laws_on_which_the_robot_does_not_hop_count_as_no_rise():
    plan, stays = planned(), dict.fromkeys(ANSWER, 0.03) | {"highest": 0.0, "longest_flight": 0.0}

    def follow(other):
        return OnLaw(answer=stays, time=0.12) if other.law == OF_1_G else on_law(0.06)

    forms = forms_of(plan, on_law(0.05), follow, sure={})
    rise = forms.numbers["ranges"]["highest"]
    assert f"{OF_1_G} no hop" in forms.words[0] and (rise["low"], rise["high"]) == (0.0, 0.06)
    assert "no hop" not in with_grains(forms, stays).words[0]  # there the sinkage is compared


def test_laws_on_which_a_foot_sinks_deeper_than_the_bed_are_named():
    plan = planned()
    answers = {law: on_law(0.01 * place) for place, law in enumerate(other_laws(plan), 1)}
    laws = forms_of(plan, on_law(0.005), lambda other: answers[named(other)], sure={})
    (deeper,) = [words for words in with_grains(laws, on_law(0.01).answer, depth=0.055).words if "this bed" in words]
    assert "55 mm" in deeper and [law for law in answers if law in deeper] == list(answers)[5:]
    for depth in (None, 0.2):
        assert not any("this bed" in words for words in with_grains(laws, on_law(0.01).answer, depth=depth).words)


def named(plan):
    return ", ".join((plan.law, *plan.settings.ground_parameters))


def test_a_robot_on_another_law_moves_as_in_a_run_of_that_law():
    other = other_laws(planned())["spring-damper"]
    rows = [RobotFollowed(plan.settings, plan).run_on_law().run() for plan in (other, planned(ground="spring-damper"))]
    assert rows[0]["sinkage"].max() > 1e-3 and (rows[0]["z"] == rows[1]["z"]).all()
