"""K and C that campaign.toml states as known stand beside those that the pushes give without them."""

import html
import math

import pytest
from golden import golden
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, run_and_diagnosis, saved

from experiments.diagnose.core.stated import _difference, beside_stated, without_prior
from experiments.diagnose.experiment import diagnose_campaign
from experiments.diagnose.report.to_use import stated_sentences
from rigid.intervals import student

STATED = {"value": 1100.0, "std": 11.0, "unit": "N/m"}


def pushes(doubt, stiffness=1.02 * STIFFNESS, damping=0.9 * DAMPING):
    """Two slow pushes and two fast ones into the same straight spring with its damper."""
    trials = [
        (f"{k}", "driven", speed, driven_trial(lambda z, v, top: STIFFNESS * z + DAMPING * v, speed=speed, seed=k))
        for k, speed in enumerate((0.01, 0.01, 0.1, 0.1))
    ]
    return campaign_of(trials, doubt=doubt, stiffness=stiffness, damping=damping)


def test_a_mean_of_two_numbers_without_one_of_them_is_the_other():
    """Of 1100 ± 11 and 1050 ± 22 the mean by precision is 1090, its error 11 x 22 / (11² + 22²)^0.5."""
    joint = {"value": 1090.0, "std": 11 * 22 / math.hypot(11, 22), "unit": "N/m"}
    alone = without_prior(joint, STATED, share=(joint["std"] / 11) ** 2)
    assert (alone["value"], alone["std"]) == (pytest.approx(1050.0), pytest.approx(22.0))
    assert "freedom" not in alone
    difference = _difference(alone, STATED)
    assert (difference["value"], difference["std"]) == (pytest.approx(-50.0), pytest.approx(math.hypot(11, 22)))


def test_the_freedom_of_a_number_alone_is_that_of_its_own_error():
    """1 / own² = 1 / s² - 1 / s0², thus d(own²) = (own / s)^4 d(s²): 2 degrees of the joint error are fewer alone."""
    joint = {"value": 1090.0, "std": 11 * 22 / math.hypot(11, 22), "unit": "N/m", "freedom": 50.0}
    alone = without_prior(joint, STATED, share=0.8)
    assert alone["freedom"] == pytest.approx(50.0 * (joint["std"] / 22.0) ** 4)
    assert _difference(alone, STATED)["freedom"] == pytest.approx(alone["freedom"] * 1.25**2)


def test_what_the_trials_do_not_determine_has_no_comparison():
    for joint in ({"value": 1100.0, "std": 10.9, "unit": "N/m"}, {"value": 1100.0, "std": None, "unit": "N/m"}):
        assert without_prior(joint, STATED, share=0.2) is None
    assert without_prior({"value": 1100.0, "std": 5.0, "unit": "N/m"}, STATED, share=0.95) is None


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """The diagnosis and the run folder of pushes whose K is stated 2 % too large, with an error of 1 %."""
    folder = tmp_path_factory.mktemp("known")
    result, found = run_and_diagnosis(folder, pushes((0.01, 0.2)))
    return found, result, folder / "run"


def test_what_pushes_give_without_the_stated_numbers_is_what_they_give_with_none(known, tmp_path):
    free = diagnose_campaign(saved(tmp_path / "free", pushes((1.0, 1.0))))
    numbers = free.base_parameters(free.best)
    rows = {row.parameter: row for row in beside_stated(known[0])}
    assert set(rows) == {"stiffness", "damping"} and beside_stated(free) == []
    for name, row in rows.items():
        assert row.alone["value"] == pytest.approx(numbers[name]["value"], abs=0.3 * numbers[name]["std"])
        assert row.alone["std"] == pytest.approx(numbers[name]["std"], rel=0.1)


def test_terminal_and_report_state_both_and_whether_they_agree(known):
    _, result, folder = known
    (said,) = [sentence for sentence in result["summary"] if sentence.startswith("Stated in")]
    report = html.unescape((folder / "report.html").read_text(encoding="utf-8")).replace("\N{NO-BREAK SPACE}", " ")
    assert said in report and "trials alone" in report


def test_the_words_of_what_is_stated_and_measured():
    """±: 1.96 of the stated error, Student's 4.3 of an error with two degrees of freedom."""

    def row(name, stated, alone, agrees):
        share = None if alone is None else {"value": alone["value"] - stated["value"], "std": 1.0, "unit": ""}
        return {"parameter": name, "stated": stated, "alone": alone, "difference": share, "agrees": agrees}

    few = {"value": 1050.0, "std": 20.0 / student(2), "unit": "N/m", "freedom": 2.0}
    c = {"value": 20.0, "std": 2.0, "unit": "N s/m"}
    found = {"kind": "penetration", "verdict": "named", "at_bounds": {"after": []}, "equations": [], "effects": []}
    one = [row("stiffness", STATED, few, False), row("damping", c, None, None)]
    two = [row(f"stiffness@0.0{k}", STATED, few | {"value": 1130.0}, True) for k in range(1, 6)]
    slope = [{"effect": "layering", "form": "slope", "equation": "+ x", "stiffness": "slope above the layer"}]
    golden("diagnose/stated", "\n".join([
        *stated_sentences(found | {"stated": one}),
        *stated_sentences(found | {"stated": two, "equations": slope}),
    ]))  # fmt: skip
    assert stated_sentences(found | {"stated": one, "verdict": "unknown"}) == stated_sentences(found) == []
