"""Pushes of one speed to several depths repeat nothing: check, diagnosis and report say so by one rule."""

import pytest
from penetration_campaigns import campaign_of, driven_trial, saved

from experiments.diagnose.experiment import make_problem
from experiments.diagnose.inspection import run as check_campaign
from experiments.diagnose.noise.replicates import groups_of, has_replicates
from experiments.diagnose.report.summary import summary_sentences
from experiments.diagnose.settings import CheckSettings


def pushes(depths, speeds=(0.01, 0.01, 0.01)):
    trials = [
        (f"{k}", "driven", speed, driven_trial(lambda z, v, top: 900 * z, speed=speed, depth=depth, seed=k))
        for k, (depth, speed) in enumerate(zip(depths, speeds, strict=True))
    ]
    return campaign_of(trials)


@pytest.mark.parametrize(("depths", "alike"), [((0.008, 0.012, 0.018), [1, 1, 1]), ((0.012, 0.012, 0.018), [2, 2, 1])])
def test_the_check_counts_as_alike_what_the_diagnosis_takes_for_replicates(tmp_path, depths, alike):
    campaign = pushes(depths)
    result = check_campaign(CheckSettings(campaign=str(saved(tmp_path / "c", campaign))), tmp_path / "run")
    trials = {trial["id"]: trial for trial in result["trials"]}
    groups = groups_of(make_problem(campaign).trials).values()
    assert [trials[id]["alike"] for id in "012"] == alike == [next(len(g) for g in groups if id in g) for id in "012"]
    assert trials["2"]["condition"].endswith("18 mm deep")
    said = result["departures"]["sentences"]
    assert has_replicates(make_problem(campaign).trials) is (said == [])
    if said:
        assert "speed and depth" in said[0]
        assert said[0] in (tmp_path / "run" / "report.html").read_text()


def test_each_push_has_its_depth_where_some_speeds_go_to_several(tmp_path):
    campaign = pushes((0.012, 0.018, 0.112), (0.01, 0.01, 0.02))
    result = check_campaign(CheckSettings(campaign=str(saved(tmp_path / "c", campaign))), tmp_path / "run")
    words = [trial["condition"].split(", ")[-1] for trial in result["trials"]]
    assert words == ["12 mm deep", "18 mm deep", "112 mm deep"]


def test_a_diagnosis_without_replicates_says_what_it_cannot_find():
    found = {
        "verdict": "none", "kind": "penetration", "effects": [], "at_bounds": {"before": [], "after": []},
        "gap": {"before": {"fit": 1.0, "held_out": 1.0}, "after": {"fit": 1.0, "held_out": 1.0}},
        "next_experiment": "none", "base": {"before": {}, "after": {}},
    }  # fmt: skip
    words = [summary_sentences(found | {"has_replicates": so}) for so in (True, False)]
    (said,) = [sentence for sentence in words[1] if sentence not in words[0]]
    assert said.startswith("No replicates:")
