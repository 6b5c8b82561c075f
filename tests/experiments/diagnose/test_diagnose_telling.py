"""What a diagnosis says in words and tables."""

from __future__ import annotations

import re

import numpy as np
import pytest
from golden import golden

from experiments.diagnose.core.effect_texts import confirmation
from experiments.diagnose.core.next_steps import _follow
from experiments.diagnose.core.next_steps import say as next_step
from experiments.diagnose.fit.gaps import numeral
from experiments.diagnose.fit.localise import Place
from experiments.diagnose.noise.colour import Colour, together
from experiments.diagnose.report.gaps import Gaps
from experiments.diagnose.report.sentences import (
    candidate_rows,
    remark_sentences,
    size_sentences,
    sure_sentences,
    told_tables,
    unnamed_sentence,
    where_sentences,
    worse_sentences,
)
from experiments.diagnose.report.spread import spread_sentences
from experiments.diagnose.report.summary import _numbers, scatter_sentence, summary_sentences, title_words
from rigid.terms import CANDIDATES
from vis.diagnose.evidence import _kind


def test_chi_square_by_phase_is_that_of_the_residuals_of_all_trials_of_a_kind():
    gaps, phases = Gaps(), np.array(["in", "in", "out"])

    def add(phases, before, after, *, held_out):
        time, noise = np.arange(float(len(phases))), np.ones(len(phases))
        gaps.add("a", "force", time, np.array(before), np.array(after), noise, noise, phases=phases, settings={},
                 held_out=held_out)  # fmt: skip

    add(phases, [1.0, 3.0, 2.0], [1.0, 1.0, 0.0], held_out=False)
    add(phases[:1], [2.0], [1.0], held_out=False)
    add(phases[2:], [4.0], [0.5], held_out=True)
    rows = {(row["phase"], row["held_out"]): row for row in gaps.by_phase}
    assert rows["in", False] | {"before": 0} == {
        "phase": "in", "channel": "force", "held_out": False, "samples": 3, "before": 0, "after": 1.0,
    }  # fmt: skip
    assert rows["in", False]["before"] == pytest.approx((1 + 9 + 4) / 3)
    assert (rows["out", True]["before"], rows["out", True]["after"]) == (16.0, 0.25)


def test_a_reading_at_a_switch_of_the_contact_counts_in_no_table_as_in_the_gap():
    gaps, rest = Gaps(), np.array([2.0, 50.0, 2.0])
    noise, quiet = np.array([1.0, np.inf, 1.0]), np.ones(3)
    phases = np.array(["hop"] * 3)
    gaps.add("a", "ax", np.arange(3.0), rest, rest, noise, quiet, phases=phases, settings={}, held_out=False)
    (row,) = gaps.by_phase
    assert (row["samples"], row["before"], row["after"]) == (2, 4.0, pytest.approx((4 + 2500 + 4) / 3))
    assert gaps.by_condition[0]["after"] == row["after"]
    assert gaps.by_condition[0]["before"] == 4.0 and gaps.by_channel[0]["rms_before"] == 2.0


def place(trial: str, channel: str, phase: str, excess: float, torque: float) -> dict:
    return {"trial": trial, "channel": channel, "phase": phase, "from_s": 0.4, "to_s": 0.9, "excess": excess,
            "settings": {"torque_N_m": torque, "gravity_m_s2": 0.08}}  # fmt: skip


def test_where_the_model_fails_is_said_with_phase_channel_seconds_and_torque():
    places = [place("001", "x", "slip", 80.0, 6.0), place("002", "gyro", "slip", 15.0, 0.22),
              place("002", "x", "hop", 5.0, 0.22)]  # fmt: skip
    slow = {"settings": {"torque_N_m": 0.22, "gravity_m_s2": 0.08}, "samples": 4000, "before": 2.0}
    fast = {"settings": {"torque_N_m": 6.0, "gravity_m_s2": 0.08}, "samples": 100, "before": 5.0}
    first, second = where_sentences({"where": places, "by_condition": [slow, fast]})
    assert ["slip (95 %)" in first, "x (85 %)" in first, "trial 001" in first] == [True] * 3
    # The slow trials hold 4000 of 4400 beyond noise, in forty times as many samples; the gravity is shared by all.
    assert "6 N m" in second and "(80 %)" in second and "gravity" not in second
    golden("diagnose/telling_where", [first, second])
    assert where_sentences({"where": []}) == []


def cell(phase: str, channel: str, before: float, after: float, *, held_out: bool = False) -> dict:
    return {"phase": phase, "channel": channel, "held_out": held_out, "samples": 100, "before": before, "after": after}


def test_a_platform_that_stands_otherwise_than_the_model_has_it_is_told_from_a_camera_zero_alone():
    said = {"where": [place("001", "x", "slip", 80.0, 6.0)], "by_phase": [cell("stand", "y", 18.0, 18.0)]}
    zero = where_sentences(said)[-1]
    said["by_phase"].append(cell("stand", "ax", 5.1, 5.0))
    stands = where_sentences(said)[-1]
    assert "ax of" in stands and "no sign" in zero and "no sign" not in stands
    golden("diagnose/telling_stands", {"a zero": zero, "stands otherwise": stands})
    quiet = {"where": said["where"], "by_phase": [cell("stand", "y", 1.1, 1.0), cell("stand", "ax", 5.1, 5.0)]}
    assert not any("phase stand" in sentence for sentence in where_sentences(quiet))


def test_what_the_best_model_explains_less_well_than_the_base_model_is_said():
    slow = {"settings": {"torque_N_m": 0.125, "gravity_m_s2": 0.147}, "trials": ["004"], "samples": 2772,
            "before": 224.0, "after": 395.0}  # fmt: skip
    fast = {"settings": {"torque_N_m": 0.22, "gravity_m_s2": 0.147}, "trials": ["005"], "samples": 2772,
            "before": 312.0, "after": 132.0}  # fmt: skip
    cells = [cell("pivot", "x", 144.0, 222.0), cell("pivot", "y", 93.0, 4087.0, held_out=True),
             cell("pivot", "wheel", 1.02, 1.9), cell("slip", "x", 90.0, 100.0)]  # fmt: skip
    (told,) = worse_sentences({"by_condition": [slow, fast], "by_phase": cells})
    assert re.findall(r"from ([\d,.]+) to ([\d,]+)", told) == [("224", "395"), ("93", "4,090"), ("144", "222")]
    golden("diagnose/telling_worse", told)
    assert worse_sentences({"by_condition": [fast], "by_phase": cells[2:]}) == []


def test_a_number_that_is_hard_to_believe_is_said_with_the_candidate():
    golden("diagnose/telling_remark", remark_sentences({"remarks": ["rig-friction: 2 N"]}))
    assert remark_sentences({}) == []


def test_the_table_of_candidates_has_every_name_once_and_sets_that_beat_their_parts():
    def row(candidate: str, score: float) -> dict:
        effects = [part.split(":")[0] for part in candidate.split(" + ")]
        return {"candidate": candidate, "effects": effects, "score": score, "left": 1.0}

    said = {
        "verdict": "named", "effects": [{"id": "a"}, {"id": "b"}], "by_phase": [],
        "evidence": [row("b:1 + a:1", 30.0), row("a:2 + b:1", 28.0), row("a:1 + a:2", 25.0), row("a:1", 20.0),
                     row("b:1", 3.0), row("c:1 + b:1", 2.0), row("c:1 + a:1", 1.0), row("c:1", -1.0)],
    }  # fmt: skip
    (table,) = told_tables(said)
    assert [cells[0] for cells in table["rows"]] == ["a:1 + b:1", "a:1 + 2", "b:1"]
    assert table["rows"][1][1] == "25.0" and "c)" in table["title"]
    golden("diagnose/telling_table_title", table["title"])
    rows = candidate_rows(said)
    assert (rows[0]["effects"], rows[0]["tried"], rows[0]["note"]) == (["a", "b"], 2, "named")


def test_a_pair_with_more_evidence_than_what_is_told_is_not_passed_over_in_silence():
    pair = {"candidate": "friction:1 + adhesion:1", "effects": ["friction", "adhesion"], "score": 33.0, "left": 0.4}
    evidence = [pair, {"candidate": "friction:1", "effects": ["friction"], "score": 28.5, "left": 0.5}]
    said = {"verdict": "named", "effects": [{"id": "friction"}], "evidence": evidence,
            "gate": {"after": {"passed": False}}}  # fmt: skip
    (gains,) = unnamed_sentence(said)
    assert "4 nats more" in gains and "4.5 nats, 20" in gains
    (not_needed,) = unnamed_sentence(said | {"gate": {"after": {"passed": True}}})
    quiet = [row | {"left": row["left"] - 0.6} for row in evidence]
    (noise,) = unnamed_sentence(said | {"evidence": quiet})
    assert unnamed_sentence(said | {"evidence": evidence[1:]}) == []
    other = {"candidate": "layering:1", "effects": ["layering"], "score": 31.0, "left": 0.5}
    nearest = [{"effect": "friction"}, {"effect": "layering", "left_out_behind": 12.0}]
    (single,) = unnamed_sentence(said | {"evidence": [other, evidence[1]], "equivalence": nearest})
    assert "by 12 nats" in single
    told = {"gains too little": gains, "not needed": not_needed, "takes up noise": noise, "one other name": single}
    golden("diagnose/telling_most_evidence", told)


def test_how_large_an_effect_is_is_said_the_largest_first_and_a_small_one_is_called_so():
    size = {"channel": "force", "unit": "N"}
    large = size | {"effect": "drag", "signature": 9.0, "rms": 0.4, "most": 1.25, "share": 0.21}
    small = size | {"effect": "crust", "signature": 1.1, "rms": 0.01, "most": 0.04, "share": 0.02}
    (words,) = size_sentences({"sizes": [large, small]})
    assert [number in words for number in ("0.4 N", "1.2 N", "21 %", "9 times")] == [True] * 4
    assert words.index("drag") < words.index("crust") < words.index("0.04 N") < words.index("which is small")
    golden("diagnose/telling_sizes", words)
    assert size_sentences({}) == []


def test_the_gap_is_told_in_millimetres_by_condition_and_from_when_on():
    # 3 mm where the camera has 0.5 mm, from 0.5 s on: 6 sigma a sample, the mean of nine beyond 5 at three.
    gaps, time = Gaps(), np.linspace(0.0, 1.0, 101)
    rest = np.where(time > 0.495, 3e-3, 0.0)
    for trial, torque in (("a", 0.1), ("b", 0.2)):
        before = rest if trial == "a" else 0 * rest
        noise = np.full(101, 5e-4)
        gaps.add(trial, "x", time, before, 0 * rest, noise, noise, phases=np.full(101, "hop"),
                 settings={"torque_N_m": torque}, held_out=False)  # fmt: skip
    (row,) = gaps.by_channel
    assert (row["unit"], row["rms_after"]) == ("mm", 0.0)
    assert row["rms_before"] == pytest.approx(3 * np.sqrt(51 / 202))
    assert [(row["trials"], row["before"]) for row in gaps.by_condition] == [
        (["a"], pytest.approx(36 * 51 / 101)), (["b"], 0.0)]  # fmt: skip
    offset = np.where(np.linspace(-0.2, 1.0, 121) < 0.295, 2e-3, 5e-3)  # the zero alone is no parting
    time, noise = np.linspace(-0.2, 1.0, 121), np.full(121, 5e-4)
    still = np.full(121, "stand")
    gaps.add("c", "y", time, offset, 0 * offset, noise, noise, phases=still, settings={}, held_out=False)
    parted, later = gaps.parted
    assert later["trial"] == "c" and later["at_s"] == pytest.approx(0.3, abs=0.03)
    assert parted["trial"] == "a" and parted["at_s"] == pytest.approx(0.5, abs=0.03)


def test_how_sure_a_name_is_stands_in_words_with_its_nearest_rival():
    said = {
        "verdict": "named", "effects": [{"id": "umbilical"}], "evidence": [{"effects": ["umbilical"], "score": 267.6}],
        "gap": {"before": {"held_out": 153.0}, "after": {"held_out": 0.97}},
        "equivalence": [{"effect": "umbilical"},
                        {"effect": "com-offset", "evidence_behind": 209.0, "angle_deg": 9.0, "told_apart": True}],
    }  # fmt: skip
    what, sure = sure_sentences(said)
    assert what.startswith("umbilical")
    for words in ("268 nats", "153 to 0.97", "com-offset", "209 nats", "9 degrees"):
        assert words in sure
    golden("diagnose/telling_sure", [what, sure, confirmation("umbilical", "tumble")])


def test_the_confirming_measurement_names_a_tip_in_pushes_and_a_spike_in_tumbles():
    for effect in CANDIDATES:
        pushed, tumbled = confirmation(effect, "penetration"), confirmation(effect, "tumble")
        assert "spike" not in pushed and "{" not in pushed + tumbled
        assert ("one spike" in tumbled) == (re.search("(push|drop|lift|press|load|drag) the tip", pushed) is not None)
    assert "the tip's guide" in confirmation("shaft-friction", "penetration")


def unknown(**changes):
    """diagnosis.json of an unknown, as far as words need it."""
    gap = {"before": {"fit": 52.0, "held_out": 65.0}, "after": {"fit": 23.0, "held_out": 62.0}}
    said = {
        "verdict": "unknown", "effects": [{"id": "plastic-sinkage"}], "alternatives": [], "gap": gap,
        "leading": {"effects": ["plastic-sinkage"], "certain": ["plastic-sinkage"],
                    "nearest": {"effect": "adhesion", "evidence_behind": 41.0, "angle_deg": 34.0, "told_apart": True}},
        "evidence": [{"effects": ["plastic-sinkage"], "score": 102.0, "left": 0.1, "closes": 0.9},
                     {"effects": ["adhesion"], "score": 61.0, "left": 0.5, "closes": 0.5}],
        "evidence_base": {"left": 1.0, "with_scatter": True}, "at_bounds": {"before": [], "after": []},
        "gate": {"before": {"passed": False, "score": 90.0, "threshold": 4.0},
                 "after": {"passed": False, "score": 22.0, "threshold": 4.0}},
        "left": [place("b", "force", "rest", 30.0, 0.1)],
        "latent": {"depends_on": "depth (explains 23 % of it)"}, "next_experiment": "Push once more.",
    }  # fmt: skip
    return said | changes


def test_the_first_lines_of_an_unknown_name_what_leads_how_far_it_goes_and_what_is_left():
    lines = summary_sentences(unknown())
    words = " ".join(lines)
    for said in ("plastic-sinkage (102 nats", "52 to 23", "57 %",  # (51 - 22) / 51
                 "65 to 62", "5 %", "41 nats", "gate is 22", "rest (100 %)", "trial b", "0.4 to 0.9",
                 "Push once more."):  # fmt: skip
        assert said in words, said
    golden("diagnose/telling_unknown", {"title": title_words(unknown()), "summary": lines})


def test_where_nothing_is_certain_the_candidates_are_said_with_what_each_would_close():
    leading = {"effects": ["adhesion"], "certain": [], "nearest": None}
    likely = summary_sentences(unknown(effects=[], leading=leading))
    assert "adhesion (61 nats" in " ".join(likely) and "remove 90 %" in " ".join(likely)
    nothing = unknown(effects=[], leading={"effects": [], "certain": [], "nearest": None})
    none = summary_sentences(nothing)
    assert "90 %, adhesion 50 %" in " ".join(none)
    title = title_words(unknown(effects=[], leading=leading))
    golden("diagnose/telling_nothing_certain", {"title": title, "likely": likely, "not even that": none})


@pytest.mark.parametrize("certain", [[], ["adhesion"]])
def test_no_name_leads_that_predicts_held_out_trials_worse_than_the_base_model(certain):
    """A fit of the right name at a wrong branch: 4.5 to 509 held out, and it was called the most likely."""
    gap = {"before": {"fit": 4.0, "held_out": 4.5}, "after": {"fit": 2.0, "held_out": 509.0}}
    leading = {"effects": ["adhesion"], "certain": certain, "nearest": None}
    said = unknown(effects=[{"id": name} for name in certain], leading=leading, gap=gap)
    better = said | {"gap": gap | {"after": {"fit": 2.0, "held_out": 4.4}}}
    title, lines = title_words(said), summary_sentences(said)
    assert "adhesion" not in title and "likely" not in " ".join(lines) and "confidence" not in " ".join(lines)
    assert "4.5 to 509" in lines[0]
    assert "leads" not in [row["note"] for row in candidate_rows(said)]
    colours = [_kind(("adhesion",), ("adhesion",), one) for one in (said, better)]
    assert colours[0].startswith("fits best") and not colours[1].startswith("fits best")
    assert "adhesion" in title_words(better) and "leads" in [row["note"] for row in candidate_rows(better)]
    golden("diagnose/telling_worse_held_out", {"title": title, "summary": lines})


def test_what_an_effect_may_do_as_well_is_to_be_checked_and_what_is_surely_wrong_corrected():
    slow = {"what": "the wheel is slow", "doubt": True, "maybe_effect": True}
    turned = {"what": "the sign is reversed", "doubt": True, "maybe_effect": False}
    (check, *_), (correct, *_) = (summary_sentences(unknown(findings=f)) for f in ([slow], [slow, turned]))
    assert check.startswith("Check this") and slow["what"] in check
    assert correct.startswith("Correct this first") and turned["what"] in correct and "1 more" in correct


def test_what_does_not_repeat_may_be_a_wrong_branch():
    words = {"measured": "7 % repeats", "alone": "Write it down."}
    beside = next_step("no_repeat_beside", names="ploughing", **words)
    for said in (beside, next_step("no_repeat", **words)):
        assert "wrong branch" in said and "no second effect" not in said and "belongs" not in said
    golden("diagnose/telling_no_repeat", [beside, next_step("no_repeat", **words)])


def test_the_gap_with_the_beds_own_share_is_said_beside_the_gap():
    weighed = {"before": {"fit": 4.0, "held_out": 5.0}, "after": {"fit": 1.1, "held_out": None}}
    said = unknown(gap_with_scatter=weighed, model_std={"force": 3.7, "depth": 0.0005, "static_friction": 0.08})
    (sentence,) = scatter_sentence(said)
    for number in ("force and depth", "is uncertain", "4 fitted (5", "1.1 fitted"):
        assert number in sentence
    assert "3.7" not in sentence  # how much is of each kind, these trials do not show
    (alone,) = scatter_sentence(unknown(gap_with_scatter=weighed, model_std={"static_friction": 0.08}))
    assert "friction 8 %" in alone
    golden("diagnose/telling_scatter", sentence)
    assert scatter_sentence(unknown()) == []


def test_what_to_do_next_follows_the_phase_or_the_column_that_holds_what_is_left():
    places = [Place("1", "force", "rest", 0.0, 1.0, 60.0), Place("1", "force", "in", 0.0, 1.0, 30.0)]
    rest, depth, nothing = (
        _follow(places, {"depth_m": 0.9}),
        _follow(places[1:], {"depth_m": 0.9, "t_s": 0.2}),
        _follow(places[1:], {"depth_m": 0.05}),
    )
    assert "ten times" in rest and "twice as deep" in depth
    golden("diagnose/telling_next", {"at rest": rest, "with depth": depth, "with nothing": nothing})


def test_what_replicates_differ_by_in_several_ways_has_its_sizes_and_units():
    (said,) = spread_sentences({"bed": 0.0222, "depth zero": 2.5e-4}, granular=True)
    assert "by 2.2 %" in said and "by 0.00025 m" in said


def test_the_noise_of_one_sensor_is_one_sentence_whatever_the_number_of_its_rates():
    slow, fast = Colour("depth", 1.003, 0.61), Colour("depth", 0.998, 0.62)
    words = together([slow, fast])
    assert ("by 0.61" in words or "by 0.62" in words) and "2 sampling rates" in words
    wide = together([Colour("x", 1.4, 0.3), Colour("x", 2.1, 0.3)])
    white = together([Colour("force", 0.87, 0.001)])
    assert "1.40 to 2.10" in wide and "0.87 times" in white and "correlates" not in white
    golden("diagnose/telling_noise", {"one rate": together([slow]), "two": words, "wide": wide, "white": white})


def test_large_numbers_are_written_out():
    assert [numeral(value) for value in (0.9692, 152.6, 19441.0, 9995.0, 3.2e7)] == [
        "0.969", "153", "19,400", "10,000", "3.2e+07",
    ]  # fmt: skip
    assert (numeral(103.2, 2), numeral(6.54, 2), numeral(12480.0, 4)) == ("100", "6.5", "12,480")


def test_the_title_says_that_a_second_name_is_small_and_that_another_is_as_likely():
    size = {"channel": "force", "unit": "N", "rms": 0.1, "most": 0.2}
    sizes = [size | {"effect": "shaft-friction", "signature": 26.0, "share": 0.055},
             size | {"effect": "layering", "signature": 0.4, "share": 0.0009}]  # fmt: skip
    said = {"verdict": "named", "effects": [{"id": "layering"}, {"id": "shaft-friction"}], "sizes": sizes}
    small, both = title_words(said), title_words(said | {"sizes": sizes[:1]})
    assert "0.09 %" in small and small.index("shaft-friction") < small.index("layering")
    assert "%" not in both and both.index("layering") < both.index("shaft-friction")
    near = {"effect": "plastic-sinkage", "evidence_behind": 0.3, "angle_deg": 9.0, "told_apart": False}
    leading = {"effects": ["adhesion"], "certain": [], "nearest": near}
    alike = title_words(unknown(effects=[], leading=leading))
    golden("diagnose/telling_titles", {"one is small": small, "both": both, "as likely": alike})


def test_a_number_that_the_trials_do_not_tell_has_no_standard_error_of_round_off():
    force = {"value": 1.841, "unit": "N"}
    leading = {"certain": [], "parameters": {"rig-friction": {"force": force | {"std": 7.3e132}}}}
    (told,) = _numbers(leading)
    assert "1.841 N (no standard" in told and "e+" not in told
    leading["parameters"]["rig-friction"]["force"]["std"] = 0.09
    (sure,) = _numbers(leading)
    assert "1.84 ± 0.18 N" in sure  # 1.96 standard errors
    golden("diagnose/telling_numbers", {"not told": told, "told": sure})
