"""What a diagnosis of pushes says to one who predicts: shares of the force, misfit held out, the foot's size."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.diagnose.push.remarks import Push, facts
from experiments.diagnose.report.sentences import size_sentences, worse_sentences
from experiments.diagnose.report.summary import _allowed, summary_sentences, title_words
from experiments.diagnose.report.to_use import number_words, unloading_sentences

SIZE = {"channel": "force", "unit": "N", "rms": 0.66, "most": 2.6, "share": 0.083}
LARGE = SIZE | {"effect": "plastic-sinkage", "signature": 68.0, "own_force": None}


def hardening(own, of=24.3):
    force = {"trial": "09", "depth_m": 0.018, "force_N": own, "of_N": of}
    return SIZE | {"effect": "depth-hardening", "signature": 12.0, "own_force": force}


@pytest.mark.parametrize(("own", "small"), [(10.0, False), (0.5, True)])
def test_an_effect_that_holds_much_of_the_force_is_not_called_small_though_a_refit_replaces_it(own, small):
    sizes = [LARGE, hardening(own)]
    title = title_words({"verdict": "named", "effects": [{"id": s["effect"]} for s in sizes], "sizes": sizes})
    (words,) = size_sentences({"sizes": sizes})
    assert ("small" in title) is ("which is small" in words) is small
    assert f"adds {own:g} N" in words and "of 18 mm" in words and "24.3 N" in words
    if small:
        assert "2.1 %" in title and "at 18 mm" in title


@pytest.mark.parametrize(("gap", "predicts"), [(14.2, "not to within the noise"), (1.1, "is the noise of the sensors")])
def test_what_held_out_trials_say_of_a_prediction_is_in_newtons(gap, predicts):
    row = {"channel": "force", "unit": "N", "held_out": True}
    row |= {"rms_before": 3.91, "rms_after": 0.232, "noise_after": 0.06}
    both = {"fit": gap, "held_out": gap}
    found = {
        "verdict": "none", "kind": "penetration", "effects": [], "at_bounds": {"before": [], "after": []},
        "gap": {"before": both, "after": both}, "next_experiment": "none", "base": {"before": {}, "after": {}},
        "residue": [{"channel": "force", "unit": "N", "rms": 0.14}], "by_channel": [row],
    }  # fmt: skip
    (words,) = [sentence for sentence in summary_sentences(found) if sentence.startswith("How well it predicts")]
    assert "0.23 N" in words and "by 3.9" in words and predicts in words
    assert "decides nothing" not in " ".join(summary_sentences(found))


@pytest.mark.parametrize(
    ("rule", "held_out", "more", "words"),
    [
        ("small_gap", 1.1, {}, "the held-out gap is at most 1.2 ("),
        ("small_gap", None, {"gap_with_scatter": {}}, "the gap with scatter is at"),
        ("closed", 5.0, {}, "remains on fitted and on held-out"),
        ("chance", 1.3, {"gate": {"held_out": {}}}, "on fitted and on held-out"),
        ("chance", 1.3, {"gate": {}}, "chance on fitted trials ("),
        ("form", 1.3, {}, "less than 2 %"),
        ("late", 1.3, {}, "before they depart"),
    ],
)
def test_the_rule_that_lets_a_verdict_pass_is_stated(rule, held_out, more, words):
    found = {"allowed_by": rule, "gap": {"after": {"fit": 1.1, "held_out": held_out}}, **more}
    (said,) = _allowed(found)
    assert words in said and "What matters" in said
    assert _allowed({"gap": found["gap"]}) == []


def test_a_foots_diameter_is_not_said_like_a_depth():
    z = np.linspace(0.0, 0.01, 20)
    pushes = [Push(0.02, z, np.full(20, 0.01), k * z, k * z) for k in (900.0, 1000.0)]
    (said,) = facts(pushes, [], is_open=False)
    assert "of diameter" in said and "how much pushes" not in said


@pytest.mark.parametrize(("correlation", "error"), [(0.0, 500.0), (-1.0, 100.0), (1.0, 700.0)])
def test_the_stiffness_of_unloading_is_stated_in_n_m_with_the_error_of_both_numbers(correlation, error):
    """K (1 + u) = 1000 N/m; by K 10 x 40 = 400, by u 100 x 3 = 300 N/m: 500 together, 100 or 700 if as one."""
    names = ["stiffness", "plastic-sinkage.unload_stiffness"]
    unload = {"value": 9.0, "std": 3.0, "unit": "1"}
    diagnosis = {
        "base": {"after": {"stiffness": {"value": 100.0, "std": 40.0, "unit": "N/m"}}},
        "effects": [{"id": "plastic-sinkage", "parameters": {"unload_stiffness": unload}}],
        "errors": {"names": names, "std": [40.0, 3.0], "correlation": [[1.0, correlation], [correlation, 1.0]]},
    }
    (said,) = unloading_sentences(diagnosis)
    assert number_words({"value": 1000.0, "std": error, "unit": "N/m"}) in said
    diagnosis["base"]["after"]["stiffness"]["freedom"] = unload["freedom"] = 2.0  # both by the scatter of the same beds
    assert (
        number_words({"value": 1000.0, "std": error, "unit": "N/m", "freedom": 2.0})
        in unloading_sentences(diagnosis)[0]
    )
    diagnosis["errors"]["names"] = ["stiffness@0.012", names[1]]
    assert unloading_sentences(diagnosis) == []


def test_what_is_doubtful_stands_before_the_numbers_to_use():
    """A C in doubt, a condition that gets worse and a number that may be 0 stood in the middle of sixty lines."""
    found = json.loads((Path(__file__).parents[4] / "docs/results/diagnose-grains/diagnosis.json").read_text("utf-8"))
    found |= {"kind": "penetration", "at_bounds": {"before": [], "after": []}}
    found["remarks"] = ["C = 4.2 N s/m. Where the drive stops, the force falls as by another C"]
    found["by_phase"][0] |= {"before": 1.0, "after": 9.0, "samples": 100}
    found["effects"][0]["parameters"]["crater_share"]["std"] = 0.8
    said = summary_sentences(found)
    use = next(place for place, one in enumerate(said) if one.startswith("Use K"))
    starts = ("Hard to believe", "It makes worse", "Not distinguished")
    places = [place for start in starts for place, one in enumerate(said) if one.startswith(start)]
    assert len(places) == 3 and places == sorted(places) and max(places) < use


def test_two_samples_that_get_worse_by_chance_are_no_doubt():
    """Mean squares of two samples scatter by 1: 2.8 is chance, 6 is not."""
    row = {"phase": "free", "channel": "force", "held_out": False, "samples": 2, "before": 1.2, "after": 2.8}
    assert worse_sentences({"by_phase": [row]}) == []
    assert len(worse_sentences({"by_phase": [row | {"after": 6.0}]})) == 1
