"""The figures of `hedgebed bench diagnose`: counted from cases whose answers are known, kept from run to run."""

import ast
import json
from pathlib import Path

import numpy as np
import pytest
from penetration_campaigns import campaign_of, driven_trial

import benchmarks.diagnose as bench
from benchmarks.diagnosis import worker
from benchmarks.diagnosis.table import _by_truth, show, summarise
from benchmarks.hidden.penetration import EFFECTS, Hidden, make_hidden
from benchmarks.second.drawing import Secret
from experiments.cli.benching import benchmark_options, goes_on
from experiments.runs.progress import Progress


def case(truth, verdict, effects=(), *, outside=None, signature=20.0, alternatives=(), before=9.0, after=1.0, **more):
    return {
        "truth": list(truth), "outside": outside, "signature": signature, "verdict": verdict,
        "effects": list(effects), "alternatives": list(alternatives), "before": {"fit": 8.0, "held_out": before},
        "after": {"fit": 1.0, "held_out": after}, "seconds": 1.0, "cpu": 1.0, "trials": 8, **more,
    }  # fmt: skip


def test_alarms_names_and_unknowns_are_counted_apart():
    summary = summarise([
        case((), "none", signature=0.0), case((), "named", ["layering"], signature=0.0),
        case(["adhesion"], "named", ["adhesion"]), case(["adhesion"], "named", ["layering"]),
        case(["adhesion"], "ambiguous", ["layering"], alternatives=["adhesion"], signature=2.0),
        case((), "unknown", outside="shock"), case((), "named", ["layering"], outside="shock"),
    ])  # fmt: skip
    assert summary["false_alarms"] == {"share": 0.5, "of": 2}
    assert summary["named_right_plain"] == {"share": 0.5, "of": 2}
    assert summary["top1_by_effect"]["adhesion"] == {
        "10-inf": {"share": 0.5, "of": 2}, "1-3": {"share": 0.0, "of": 1}}  # fmt: skip
    assert summary["sets_hold_truth"] == {"share": pytest.approx(2 / 3), "of": 3}
    assert summary["ambiguous_sets_hold_truth"] == {"share": 1.0, "of": 1}
    assert summary["unknown_recall"] == {"share": 0.5, "of": 2}
    assert summary["median_gap_closed"] == pytest.approx(1.0)
    show("penetration", summary)


def test_parameters_are_off_by_their_share_and_intervals_hold_the_truth_or_not():
    cases = [
        case(["slope"], "named", ["slope"], true_parameters={"slope.angle": 0.01},
             found_parameters={"slope": {"angle": {"value": value, "std": 5e-4, "unit": "rad"}}})
        for value in (0.0105, 0.012)
    ]  # fmt: skip
    told = summarise(cases)["parameters"]
    assert told["median_relative_error"] == pytest.approx(0.125)
    assert told["intervals_hold_truth"] == {"share": 0.5, "of": 2}
    assert told["intervals_90_hold_truth"] == {"share": 0.5, "of": 2}


def test_held_out_gaps_are_counted_with_the_sensors_noise_and_with_the_scatter_of_replicates():
    """Of a pair as well, where both are named."""
    weighed = {"after": {"fit": 1.0, "held_out": 1.1}}
    summary = summarise([
        case(["adhesion"], "named", ["adhesion"], after=3.0, with_scatter=weighed),
        case(["adhesion"], "named", ["adhesion"], after=3.0, with_scatter=None),
        case(["adhesion", "layering"], "named", ["layering", "adhesion"], after=1.1),
        case(["adhesion", "layering"], "named", ["layering"], after=9.0),
    ])  # fmt: skip
    assert summary["held_out_at_most_1_2"] == {"share": pytest.approx(1 / 3), "of": 3}
    assert summary["held_out_with_scatter_at_most_1_2"] == {"share": pytest.approx(2 / 3), "of": 3}
    assert summary["replicates_that_differ"] == {"share": pytest.approx(1 / 3), "of": 3}


def test_pairs_are_counted_by_the_signature_of_the_weaker_effect():
    """Plain ones, and those whose weaker effect is visible; a pair with an invisible effect counts in neither."""
    both, one = ["layering", "adhesion"], ["adhesion"]
    summary = summarise([
        case(["adhesion", "layering"], "named", named, signature=signature)
        for named, signature in ((both, 10.0), (one, 30.0), (both, 1.0), (both, 9.9), (one, 3.0), (one, 0.9))
    ])  # fmt: skip
    assert summary["pairs_both_named"] == {"share": 0.5, "of": 6}
    assert summary["pairs_both_named_both_plain"] == {"share": 0.5, "of": 2}
    assert summary["pairs_both_named_weaker_visible"] == {"share": pytest.approx(2 / 3), "of": 3}


def test_ninety_percent_intervals_of_base_parameters_are_counted_by_number():
    def told(value, **more):
        numbers = {"stiffness": {"value": value, "std": 1.0}, "mass": {"value": 5.0, "std": 0.1}}
        hidden = {"base": {"stiffness": 100.0, "mass": 5.1}, "apparent": {"stiffness": 101.0}}
        return {"hidden": hidden, "base_parameters": numbers, **more}

    summary = summarise([
        case(["adhesion"], "named", ["adhesion"], **told(101.6)), case((), "none", signature=0.0, **told(101.7)),
        case((), "unknown", signature=0.0, **told(100.0)),
    ])  # fmt: skip
    found = summary["base_parameters"]
    assert found["by_name"] == {"mass": {"share": 1.0, "of": 2}, "stiffness": {"share": 0.5, "of": 2}}
    assert found["intervals_90_hold_truth"] == {"share": 0.75, "of": 4}
    assert summary["apparent_parameters"]["by_name"] == {"stiffness": {"share": 1.0, "of": 2}}


def test_intervals_are_counted_against_what_the_found_model_gives_of_readings_without_noise():
    def told(limit, **more):
        base = {"stiffness": {"value": 100.0, "std": 1.0}, "damping": {"value": 2.0, "std": None}}
        numbers = {"base_parameters": base, "found_parameters": {"adhesion": {"pull": {"value": 0.5, "std": 0.1}}}}
        return case(["adhesion"], "named", ["adhesion"], **numbers, limit=limit, **more)

    summary = summarise([
        told({"stiffness": 101.6, "damping": 2.0, "adhesion.pull": 0.7}),
        told({"stiffness": 98.3, "adhesion.pull": 0.4}),
        told({"error": "not converged"}), told(None),
    ])["limit_parameters"]  # fmt: skip
    assert summary["by_name"] == {"stiffness": {"share": 0.5, "of": 2}, "adhesion.pull": {"share": 0.5, "of": 2}}
    assert summary["failed"] == 1


def test_a_worker_without_a_diagnosis_states_that_it_has_no_limit(tmp_path):
    assert worker.answer(str(tmp_path))["verdict"] == "failed"
    assert set(worker.limit({})) == {"error"}


def test_the_process_that_diagnoses_gets_the_readings_without_noise_after_its_answer(monkeypatch, tmp_path):
    """And only of campaigns of pushes of the second simulator, whose maker states them."""
    asked = []
    campaign = campaign_of([("001", "driven", 0.01, driven_trial(lambda z, v, top: 900 * z, speed=0.01))])
    hidden = Secret((), None, {}, 0.0, False, 1, {}, {"001": {"t_s": np.zeros(1)}})
    monkeypatch.setattr(bench, "make_case", lambda kind, case: (campaign, hidden))

    def ask(folder):
        asked.append("answer")
        return answered(folder)

    def limited(readings):
        asked.append(sorted(readings))
        return {"stiffness": 900.0}

    record = bench._one("second-push", {"seed": 1}, ask, limited, before=None, wanted=False)
    assert asked == ["answer", ["001"]]
    assert record["limit"] == {"stiffness": 900.0}


def test_baselines_stand_beside_us_on_the_very_same_cases():
    beside = {"alarm": True, "before": {"fit": None, "held_out": 9.0}, "after": {"fit": None, "held_out": 5.0},
              "points_to": ["layering"], "seconds": 2.0}  # fmt: skip
    told = summarise([
        case(["adhesion"], "named", ["adhesion"], baselines={"code": "x", "pysindy": beside}),
        case((), "none", signature=0.0, baselines={"code": "x", "pysindy": beside}),
        case(["adhesion"], "named", ["layering"]),
    ])["baselines"]  # fmt: skip
    assert told["pysindy"]["false_alarms"] == {"share": 1.0, "of": 1}
    assert told["pysindy"]["median_gap_closed"] == pytest.approx(0.5)
    assert told["pysindy"]["names_right"] == {"share": 0.0, "of": 1}
    assert told["ours"]["names_right"] == {"share": 1.0, "of": 1}


@pytest.fixture
def made(monkeypatch):
    """Campaigns that cost nothing; their answers name an effect."""
    recording = driven_trial(lambda z, v, top: 900 * z, speed=0.01)

    def make(kind, case):
        return campaign_of([("001", "driven", 0.01, recording)]), Hidden(("layering",), None, {}, 5.0, False)

    monkeypatch.setattr(bench, "make_case", make)


def answered(folder):
    return {"verdict": "named", "effects": ["layering"], "alternatives": [], "before": {"fit": 9.0, "held_out": 9.0},
            "after": {"fit": 1.0, "held_out": 1.0}, "found_parameters": {}, "seconds": 1.0, "cpu": 1.0}  # fmt: skip


def test_a_bench_that_was_stopped_goes_on_and_diagnoses_nothing_twice(made, tmp_path):
    asked = []

    def ask(folder):
        if len(asked) == 2:
            raise KeyboardInterrupt
        asked.append(folder)
        return answered(folder)

    settings = {"progress": Progress(), "kind": "penetration", "count": 4, "baselines": "no"}
    with pytest.raises(KeyboardInterrupt):
        bench.run(tmp_path, ask=ask, **settings)
    assert goes_on(bench.run, tmp_path)
    with (tmp_path / "cases.jsonl").open("a") as file:
        file.write('{"kind": "penet')  # what a process leaves that is killed while it writes
    later = []
    result = bench.run(tmp_path, ask=lambda folder: later.append(folder) or answered(folder), **settings)
    assert len(later) == 2
    assert result["penetration"]["cases"] == 4
    bench.run(tmp_path, ask=None, **settings)  # nothing is left to ask


def test_a_campaign_is_diagnosed_again_where_the_code_has_changed(made, tmp_path, monkeypatch):
    settings = {"progress": Progress(), "kind": "penetration", "count": 2, "baselines": "no"}
    bench.run(tmp_path, ask=answered, **settings)
    monkeypatch.setattr(bench, "digest", lambda what: "changed")
    later = []
    bench.run(tmp_path, ask=lambda folder: later.append(folder) or answered(folder), **settings)
    assert len(later) == 2


def test_whoever_diagnoses_is_given_a_folder_without_the_answer(made, tmp_path):
    def ask(folder):
        for path in Path(folder).rglob("*"):
            assert "layering" not in path.read_text(encoding="utf-8")
        return answered(folder)

    bench.run(tmp_path, ask=ask, progress=Progress(), kind="penetration", count=1, baselines="no")
    (record,) = bench.read_cases(tmp_path)
    assert record["truth"] == ["layering"]
    source = (Path(bench.__file__).with_name("diagnosis") / "worker.py").read_text(encoding="utf-8")
    imported = {node.module or "" for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)}
    assert not any("hidden" in name or name == "" for name in imported)


def test_a_line_that_is_no_record_is_named(tmp_path):
    (tmp_path / "cases.jsonl").write_text('{"kind": 1}\nrubbish\n{"kind": 2}\n', encoding="utf-8")
    with pytest.raises(ValueError, match=r"cases\.jsonl, line 2"):
        bench.read_cases(tmp_path)


def test_campaigns_of_mujoco_without_it_are_refused_with_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr(bench, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"mujoco-tumble.*hedgebed\[mujoco\]"):
        bench.run(tmp_path, progress=Progress(), kind="mujoco-tumble")


def test_options_that_a_benchmark_has_not_are_refused():
    assert benchmark_options(bench.run, {"count": "7", "kind": "tumble"}) == {"count": 7, "kind": "tumble"}
    with pytest.raises(ValueError, match="--cuont is no option here; did you mean 'count'"):
        benchmark_options(bench.run, {"cuont": "7"})
    with pytest.raises(ValueError, match="count = 'few': a whole number was expected"):
        benchmark_options(bench.run, {"count": "few"})
    with pytest.raises(ValueError, match="kind = 'hop'"):
        bench.run(Path("nowhere"), progress=Progress(), kind="hop")


def test_comments_do_not_make_code_another_one():
    assert bench._bare('"""One."""\nx = 1  # two\n') == bench._bare("x = 1\n") != bench._bare("x = 2\n")


def test_the_answer_is_not_in_the_campaign_and_a_seed_gives_the_same_campaign():
    campaign, hidden = make_hidden(3, kind="layering", strength=8.0)
    again, _ = make_hidden(3, kind="layering", strength=8.0)
    text = campaign.tables.model_dump_json()
    assert hidden.effects == ("layering",) and not any(effect in text for effect in EFFECTS)
    assert 4.0 < hidden.signature < 16.0
    first, second = campaign.recording("001", "data"), again.recording("001", "data")
    assert all(np.array_equal(first[name], second[name]) for name in first.columns)
    assert json.loads(text)["name"] == "made up"


def test_what_the_truth_leaves_of_trials_held_out_is_that_of_these_trials():
    case = {"hidden": {"left": [[10.0, 10], [34.0, 20], [9.0, 10]]}, "held_out": ["p02", "d03"]}
    assert _by_truth(case) == pytest.approx(43.0 / 30.0)
    assert _by_truth({"held_out": ["p01"]}) is None  # a maker that does not tell
