"""Pushes of two plates, one of them with another zero of the depth: what is said of it, of K and C, and what next."""

import json
import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from golden import golden
from penetration_campaigns import FORCE_STD, campaign_of, run_and_diagnosis, saved

from experiments.campaign import Recording, read_campaign, read_model
from experiments.campaign.tables import ERRORS_NOTE, OTHERS_NOTE, SCATTER_NOTE
from experiments.check import find_implausible
from experiments.check.shifted import shifted_depths
from experiments.diagnose.core.near import likelier, near_models, nearest_each, other_forms
from experiments.diagnose.core.rivals import folds_of, predict
from experiments.diagnose.experiment import diagnose_campaign
from experiments.diagnose.fit.evidence import Hypothesis
from experiments.diagnose.fit.fitting import fit, settled
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.push.remarks import Push, at_one_speed, contradict, highest_damping
from experiments.diagnose.report.document import COUNTS, _write_model, _write_near_models, document, peak_ratios
from experiments.diagnose.report.gaps import Gaps
from experiments.diagnose.report.sentences import _how_often, behind_words
from experiments.diagnose.report.summary import summary_sentences
from experiments.diagnose.report.to_use import SERIES, near_model_sentences, peak_sentences, use_sentences
from rigid.series import read_series

SHARES = (1.04, 1.06, 1.08, 1.10)
OFF = 0.4e-3
"""By which the depth of trial n2 is too large [m]."""
STIFFNESS = {0.06: 5500.0, 0.08: 9000.0}
"""K at the reference depth of 7.5 mm [N/m]: F = K z (z / 7.5 mm)^0.3."""


def pushed(diameter, *, zero=0.0, seed=0, power=0.3, stiffness=None, force_zero=0.0):
    """10 mm in 2 s into F = K z (z / 7.5 mm)^power; `zero` [m]: what the depth's sensor adds."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 2.0, 101)
    depth = 0.005 * time
    z = np.maximum(depth - zero, 0.0)
    force = (stiffness or STIFFNESS[diameter]) * z * (np.maximum(z, 1e-9) / 0.0075) ** power + force_zero
    return Recording({"t_s": time, "depth_m": depth, "force_N": force + FORCE_STD * random.standard_normal(101)})


def plates(**changes):
    """Three pushes of each plate; `changes`: id -> what is other about it."""
    trials = []
    for k, (letter, d) in product((1, 2, 3), (("n", 0.06), ("w", 0.08))):
        own = {"seed": 10 * k + round(100 * d)} | changes.get(f"{letter}{k}", {})
        trials.append((f"{letter}{k}", "driven", 0.005, pushed(d, **own), {"diameter": d}))
    return campaign_of(trials, stiffness=6000.0, doubt=(1.0, 1.0), diameter=0.06, depth_std=1e-5)


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """The run folder of the plates, n2 being off by `OFF`, its result and the diagnosis behind it."""
    folder = tmp_path_factory.mktemp("plates")
    return folder / "run", *run_and_diagnosis(folder, plates(n2={"zero": OFF}))


@pytest.fixture(scope="module")
def result(diagnosed):
    """The result and diagnosis.json of the plates, and their run folder."""
    folder, found, _ = diagnosed
    return found, json.loads((folder / "diagnosis.json").read_text()), folder


def test_the_model_file_notes_the_errors_of_the_fit_and_their_correlations(diagnosed):
    folder, _, found = diagnosed
    note = read_model(folder / "model.toml").notes[ERRORS_NOTE]
    fitted = dict(found.base_parameters(found.best))
    for effect in found.effects:
        fitted |= {f"{effect}.{name}": entry for name, entry in found.parameters(effect).items()}
    assert note["names"] == [name for name, entry in fitted.items() if entry["std"] is not None]
    assert note["undetermined"] == [name for name, entry in fitted.items() if entry["std"] is None]
    assert note["std"] == pytest.approx([fitted[name]["std"] for name in note["names"]], rel=1e-5)
    correlation = np.array(note["correlation"])
    assert correlation == pytest.approx(correlation.T) and np.diag(correlation) == pytest.approx(1.0)
    assert np.linalg.eigvalsh(correlation).min() > -1e-5


def test_a_depth_zero_of_one_push_is_found_from_its_replicates():
    found = dict(shifted_depths(plates(n2={"zero": OFF})))
    assert set(found) == {"n2"} and f"{-1e3 * OFF:+.2g} mm" in found["n2"]
    assert list(shifted_depths(plates())) == []
    both = {"n2": {"zero": OFF}, "w3": {"zero": -0.3e-3}}
    assert {id for id, _ in shifted_depths(plates(**both))} == {"n2", "w3"}
    (finding,) = find_implausible(plates(n2={"zero": OFF}))
    assert finding.trial == "n2" and finding.channel == "depth" and finding.doubt


def test_a_stiffer_bed_and_pushes_that_all_differ_are_no_zero_of_the_depth():
    assert list(shifted_depths(plates(n2={"stiffness": 1.1 * STIFFNESS[0.06]}))) == []
    for zeros in ((0.2e-3, -0.5e-3, 0.6e-3), (0.1e-3, 0.05e-3, 0.9e-3)):
        assert list(shifted_depths(plates(**{f"n{k}": {"zero": zero} for k, zero in enumerate(zeros, 1)}))) == []


def test_on_a_straight_spring_the_zero_of_the_force_would_do_as_well():
    """K (z + d) = K z + K d, where every row is below the surface."""
    straight = {f"n{k}": {"power": 0.0, "force_zero": 3.0} for k in (1, 3)}
    ((id, said),) = shifted_depths(plates(**straight, n2={"power": 0.0, "force_zero": 3.0 + STIFFNESS[0.06] * OFF}))
    assert id == "n2"
    golden("diagnose/moved_depth", said)


def test_what_was_set_aside_is_in_no_gap_and_in_a_table_of_its_own(result):
    _, said, _ = result
    (aside,) = said["set_aside"]
    assert (aside["trial"], aside["channel"], aside["unit"]) == ("n2", "force", "N")
    assert aside["rms_after"] > 10 * FORCE_STD
    for rows in (said["by_phase"], said["by_condition"]):
        assert max(row["after"] for row in rows) < 1.3
    assert "n2" not in {trial for row in said["by_condition"] for trial in row["trials"]}
    assert said["residue"] == [] and said["allowed_by"] == "small_gap"


def test_the_force_of_an_effect_is_that_of_the_law_where_it_is_largest(result):
    """depth-hardening adds K z (z / D)^p - K z to K z: what the law has beyond the spring of the same K."""
    _, said, folder = result
    (size,) = said["sizes"]
    own = size["own_force"]
    series = read_series(folder / "series" / f"{own['trial']}.force.csv", text=("phase",))
    (place,) = np.flatnonzero(series["depth_m"] == own["depth_m"])
    assert own["of_N"] == series["after"][place]
    stiffness = said["base"]["after"][f"stiffness@{0.06 if own['trial'][0] == 'n' else 0.08:g}"]["value"]
    assert own["force_N"] == pytest.approx(own["of_N"] - stiffness * own["depth_m"], abs=0.01 * own["of_N"])
    stiffness = {name: said["base"]["after"][f"stiffness@{d:g}"]["value"] for name, d in (("n", 0.06), ("w", 0.08))}
    for path in (folder / "series").glob("*.force.csv"):
        rows = read_series(path, text=("phase",))
        beyond = np.abs(rows["after"] - stiffness[path.name[0]] * np.maximum(rows["depth_m"], 0.0))
        assert path.name.startswith("n2") or np.nanmax(beyond) <= 1.02 * abs(own["force_N"])


def test_the_noise_to_expect_is_the_root_mean_square_of_each_models_own():
    """sqrt((3 * 0.02^2 + 0.2^2) / 4): a reading at the first contact counts with its larger noise."""
    gaps, std = Gaps(), np.array([0.2, 0.02, 0.02, 0.02])
    gaps.add("a", "force", np.arange(4.0), 0.3 * std, 0.1 * std, std, 2 * std, phases=np.full(4, "in"), settings={},
             held_out=False)  # fmt: skip
    (row,) = gaps.by_channel
    assert row["noise_before"] == pytest.approx(np.sqrt(0.0103)) and row["noise_after"] == 2 * row["noise_before"]
    assert row["rms_after"] == pytest.approx(0.1 * row["noise_before"])


def test_there_is_one_k_to_use_for_each_plate_before_all_else(result):
    found, said, folder = result
    first = list(found["quantities"])[:5]
    assert [name for name in first if name.startswith("stiffness")] == ["stiffness@0.06_after", "stiffness@0.08_after"]
    assert "number to use" in (folder / "report.html").read_text(encoding="utf-8")
    for diameter, stiffness in STIFFNESS.items():
        assert said["base"]["after"][f"stiffness@{diameter:g}"]["value"] == pytest.approx(stiffness, rel=0.005)
    after = {
        "stiffness@0.06": {"value": 5500.0, "std": 7.0, "unit": "N/m"},
        "damping@0.06": {"value": 6.0, "std": None, "unit": "N s/m"},
        "stiffness@0.08": {"value": 9000.0, "std": None, "unit": "N/m"},
    }
    told = said | {"base": {"after": after}, "at_bounds": {"after": []}}
    golden("diagnose/numbers_to_use", use_sentences(told))
    assert use_sentences(told | {"verdict": "unknown"}) == []
    assert use_sentences(told | {"kind": "tumble"}) == []


def test_a_c_that_these_pushes_leave_open_has_no_error_and_an_experiment(result):
    found, said, folder = result
    for stage in ("before", "after"):
        assert said["base"][stage]["damping@0.06"]["std"] is None
        assert found["quantities"][f"damping@0.08_{stage}"]["std"] is None
    most = found["quantities"]["damping@0.06_after"]["at_most"]
    assert most == said["base"]["after"]["damping@0.06"]["at_most"]
    cells = f"<td>below {most:.2g}</td><td>not determined</td>"
    assert cells in re.sub(r"<td[^>]*>", "<td>", (folder / "report.html").read_text(encoding="utf-8"))
    assert "To determine C" in said["next_experiment"]
    assert "spike" not in said["next_experiment"]


def test_pushes_contradict_one_another_on_c_by_the_best_models_spring():
    """F = K z^1.5 + C v: a straight spring takes the bend for a negative C in all, the right spring finds C."""
    random, depth, speed = np.random.default_rng(3), np.linspace(0.0, 0.02, 200), np.full(200, 0.05)
    spring = 6000.0 * depth**1.5

    def contradicting(*dampings):
        rest = [0.05 * random.standard_normal(200) for _ in dampings]
        pairs = zip(dampings, rest, strict=True)
        pushes = [Push(0.016, depth, speed, spring + c * speed + left, spring) for c, left in pairs]
        assert not contradict(pushes, [])
        return contradict(pushes, ["depth-hardening"])

    assert not contradicting(3.0, 2.0, 0.0)
    assert contradicting(3.0, 2.0, -2.0)


def test_pushes_of_one_speed_leave_c_open_whatever_its_error():
    """C v is a constant force there; a hold, or another speed, tells it from one."""
    time = np.linspace(0.0, 2.0, 200)
    for speeds, is_open in (((0.005, 0.005), True), ((0.005, 0.0075), False)):
        trials = []
        for k, speed in enumerate(speeds):
            columns = {"t_s": time, "depth_m": speed * time, "force_N": 900.0 * speed * time + 20.0 * speed}
            trials.append((f"{k}", "driven", speed, Recording(columns)))
        problem = make_problem(campaign_of(trials, doubt=(1.0, 1.0), depth_std=1e-5))
        values, errors = {"stiffness": 900.0, "damping": 20.0}, {"stiffness": 1.0, "damping": 1.0}
        assert problem.undetermined(values, (), ("0", "1"), errors) == (("damping",) if is_open else ())
    held = Push(0.012, 0.005 * time, np.where(time < 1.5, 0.005, 0.0), time, time)
    assert not at_one_speed([held]) and at_one_speed([replace(held, speed=np.full(200, 0.005))])


def test_a_c_that_several_speeds_determine_keeps_its_error_though_no_push_shows_it_alone(tmp_path):
    """At 0.01 to 0.05 m/s C v is 0.4 to 2 times the noise of a reading; all speeds together show C."""
    trials = []
    for k, speed in enumerate((0.01, 0.02, 0.05) * 2):
        random, time = np.random.default_rng(k), np.linspace(0.0, 0.02 / speed, 100)
        force = 900.0 * speed * time + 2.0 * speed + FORCE_STD * random.standard_normal(100)
        trials.append((f"{k}", "driven", speed, Recording({"t_s": time, "depth_m": speed * time, "force_N": force})))
    campaign = saved(tmp_path / "c", campaign_of(trials, doubt=(1.0, 1.0), depth_std=1e-5))
    found = diagnose_campaign(campaign)
    said = document(found)
    damping = said["base"]["after"]["damping"]
    assert found.undetermined == () and "To determine C" not in said["next_experiment"]
    assert damping["value"] == pytest.approx(2.0, abs=4 * damping["std"]) and damping["std"] < 0.5


def test_stated_values_that_are_far_off_are_said_first_with_what_to_do():
    """The template's K and C left as they are: 900 ± 90 N/m for plates of 5500 and 9000 N/m."""
    bounds = [
        {"parameter": "stiffness@0.06", "value": 2275.0, "unit": "N/m", "sigmas": 15.28, "at_bound": False,
         "stated": 900.0, "stated_std": 90.0},
        {"parameter": "mu_s", "value": 0.8, "unit": "1", "sigmas": 6.0, "at_bound": True, "stated": 0.5,
         "stated_std": 0.05},
    ]  # fmt: skip
    said = {"kind": "penetration", "verdict": "named", "effects": [], "at_bounds": {"before": [], "after": bounds[:1]},
            "next_experiment": "none"}  # fmt: skip
    tumble = said | {"kind": "tumble", "at_bounds": {"before": [], "after": bounds[1:]}}
    golden("diagnose/stated_far", [summary_sentences(said)[0], summary_sentences(tumble)[0]])


def test_a_rival_is_distinguished_where_evidence_or_prediction_leads_by_ten_nats_and_both_are_said(
    diagnosed, monkeypatch
):
    *_, found = diagnosed
    assert found.choice is not None
    monkeypatch.setattr(type(found), "planned", None)  # the plan of a next push takes seconds, and is none of this
    rival = found.choice.rivals[0]
    for evidence, left_out, apart in ((5.9, 10.4, True), (5.9, 7.0, False), (12.0, None, True), (9.0, None, False)):
        other = replace(rival, behind=evidence, behind_left_out=left_out)
        one = replace(found, choice=replace(found.choice, rivals=(other,)))
        row = document(one)["equivalence"][1]
        assert row["told_apart"] is apart and row["lead"] == max(evidence, left_out or 0.0)
    golden("diagnose/behind", [behind_words({"evidence_behind": e, "left_out_behind": p}) for e, p in
                               ((33.0, None), (33.0, 12.0), (5.9, 10.4))])  # fmt: skip


def test_a_near_rival_has_a_model_of_its_own_and_a_far_one_has_none(diagnosed, tmp_path):
    *_, found = diagnosed
    rival = found.choice.rivals[0]
    for evidence, left_out, written in ((5.9, 7.0, True), (5.9, 10.4, False), (12.0, None, False)):
        other = replace(rival, behind=evidence, behind_left_out=left_out)
        one = replace(found, choice=replace(found.choice, rivals=(other,), table=()))
        rows = _write_near_models(tmp_path, one, nearest_each(one))
        assert bool(rows) is written
        files = [row["file"] for row in rows]
        _write_model(
            tmp_path / "model.toml", one, {OTHERS_NOTE: {"files": files}} if files else {}
        )  # names them, so that `penetrate --model` predicts with each
        assert read_model(tmp_path / "model.toml").notes.get(OTHERS_NOTE, {}).get("files", []) == files
        for row in rows:
            model = read_model(tmp_path / row["file"])
            assert [effect.id for effect in model.effect] == row["effects"] == list(rival.hypothesis.effects)
            stiffness = model.notes["fitted_by_diameter"]["0.06"]["stiffness"]
            again = settled(fit(rival.hypothesis.fit.model, rival.hypothesis.fit.values))
            assert stiffness == pytest.approx(again.values["stiffness@0.06"], rel=1e-6)


@pytest.mark.parametrize("more", [3.0, -3.0])
def test_a_candidate_with_more_evidence_than_the_named_effect_has_a_model_though_it_is_not_named(diagnosed, more):
    *_, found = diagnosed
    rival, best = found.choice.rivals[0].hypothesis, found.choice.best
    others = tuple(Hypothesis(rival.fit, best.score + more - less) for less in (0.5, 0.0))
    one = replace(found, choice=replace(found.choice, rivals=(), table=(best, *others)))
    assert likelier(one) == ([others[1]] if more > 0 else [])
    assert [set(model.effects) for model in near_models(one, ())] == ([set(rival.effects)] if more > 0 else [])
    assert likelier(replace(one, verdict="ambiguous")) == []


def test_the_same_effect_in_another_form_has_a_model_where_evidence_does_not_exclude_it(diagnosed, tmp_path):
    """F = K z (z / D)^0.3 is a power. The same power fitted as the quadratic is, 9 or 11 nats behind."""
    *_, found = diagnosed
    assert found.verdict == "named" and [form.id for form in found.forms] == ["depth-hardening:power"]
    form = next(form for form in found.problem.forms if form.id == "depth-hardening:quadratic")
    fitted = fit(found.best.model.with_forms([form]), found.best.values)
    for behind, written in ((9.0, True), (11.0, False)):
        other, worse = (Hypothesis(fitted, found.choice.best.score - behind - more) for more in (0.0, 0.5))
        more = Hypothesis(replace(fitted, model=fitted.model.with_forms([*found.forms, form])), other.score)
        table = (worse, more, found.choice.best, other)
        one = replace(found, choice=replace(found.choice, rivals=(), table=table))
        assert other_forms(one) == ([other] if written else [])  # one of each form, the likeliest
        rows = _write_near_models(tmp_path, one, nearest_each(one))
        file = "model-depth-hardening-quadratic.toml"
        assert rows == ([{"effects": ["depth-hardening"], "forms": [form.id], "file": file}] if written else [])
        said = near_model_sentences({"near_models": rows, "kind": "penetration"})
        assert [file in sentence for sentence in said] == [True] * written
    (effect,) = read_model(tmp_path / file).effect
    assert effect.id == "depth-hardening" and "hardening_quadratic" in effect.parameters
    assert other_forms(replace(one, verdict="unknown")) == []


def test_a_model_below_every_measured_peak_is_told_with_by_how_much():
    """Four pushes, measured 4, 6, 8 and 10 % above the model at the deepest point; one without a depth is left out."""
    depth = np.array([0.0, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5]) * 0.01

    model, blind = 1e3 * depth, {"force": {"measured": depth, "model": depth}}
    pushes = [{"force": {"depth_m": depth, "model": model, "measured": share * model}} for share in SHARES]
    peaks = peak_ratios([*pushes, blind])
    assert (peaks["trials"], peaks["lowest"], peaks["highest"]) == (4, pytest.approx(1.04), pytest.approx(1.10))
    assert peaks["mean"] == pytest.approx(1.07) and peaks["std"] == pytest.approx(0.0258, rel=1e-2)
    (said,) = peak_sentences({"peaks": peaks})
    assert "too low" in said and "+4 to +10" in said and "+7 %" in said
    assert not peak_sentences({"peaks": peaks | {"std": 0.05}}) and not peak_sentences({})  # chance: 3.18 std / 2
    assert peak_ratios([*pushes[:2], blind]) is None


def test_of_a_second_name_the_nearest_in_its_place_is_compared_by_prediction_too(diagnosed):
    *_, found = diagnosed

    def with_rival(place):
        forms = (*found.forms, *found.choice.rivals[place].hypothesis.forms)
        return Hypothesis.of(fit(found.best.model.with_forms(forms), found.best.values))

    best, other = with_rival(0), with_rival(1)
    best = replace(best, score=other.score + 5.0)
    choice = replace(found.choice, best=best, rivals=(), table=(best, other, found.choice.best))
    one = replace(found, verdict="named", best=best.fit, effects=best.effects, choice=choice)
    (near,) = nearest_each(one)
    assert near.effect == best.effects[1] and near.hypothesis is other and near.behind == pytest.approx(5.0)
    folds = folds_of(best.fit.model.infos)
    apart = predict(best.fit, folds).score - predict(other.fit, folds).score
    assert near.behind_left_out == pytest.approx(apart, abs=0.01) and near.needed < 10


def test_the_model_file_notes_the_scatter_of_replicates_and_what_it_was_found_from(diagnosed):
    """Three pushes of one plate and two of the other, one being set aside; no note is one long line."""
    folder, _, found = diagnosed
    note = read_model(folder / "model.toml").notes[SCATTER_NOTE]
    assert note == pytest.approx({**found.model_std, "trials": 5, "freedom": 3})
    lines = (folder / "model.toml").read_text().splitlines()
    assert "# standard errors" in " ".join(lines) and max(map(len, lines)) < 240


def test_a_push_without_a_clock_is_refused_with_how_to_make_its_time(tmp_path):
    folder = saved(tmp_path / "c", plates())
    path = folder / "n1.csv"
    path.write_text("\n".join(line.partition(",")[2] for line in path.read_text().splitlines()))
    with pytest.raises(ValueError, match="t_s = depth_m / speed") as refused:
        read_campaign(folder)
    assert "n1.csv, line 1" in str(refused.value)


def test_the_shipped_plates_have_no_push_with_another_zero():
    from experiments.campaign.files import TEMPLATES

    assert list(shifted_depths(read_campaign(TEMPLATES / "cmu-plate-sinkage"))) == []


def test_the_push_that_confirms_a_name_is_stated_with_both_predictions(result):
    """F = K z (z / 7.5 mm)^0.3 beyond 10 mm, which the named effect predicts within its errors."""
    _, said, _ = result
    (first,), plan = said["effects"], said["planned"]
    rival = min(said["equivalence"][1:], key=lambda row: row["lead"])["effect"]
    asked = said["next_experiment"]
    assert first["id"] in asked and rival in asked and f"{1e3 * plan['depth_m']:.3g} mm deep" in asked
    apart = plan["apart"]
    truth = STIFFNESS[plan["diameter_m"]] * apart["depth_m"] * (apart["depth_m"] / 0.0075) ** 0.3
    error = np.hypot(apart["one_std_N"], 0.01 * truth)
    assert abs(apart["one_N"] - truth) < 4 * error < abs(apart["one_N"] - apart["other_N"])


def _counted(kind, seeds, suite="diagnose-second"):
    rows = []
    for seed in seeds:
        path = Path(__file__).parents[4] / "docs" / "results" / suite / f"{kind}-{seed}" / "cases.jsonl"
        own = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        assert {row["case"]["seed"] // 1000 for row in own} == {seed} and len(own) == 40
        rows += own
    named = [row for row in rows if row["verdict"] == "named"]
    right = [row for row in named if row["outside"] is None and set(row["effects"]) == set(row["truth"])]
    return rows, named, right


@pytest.mark.parametrize(("kind", "of"), [("push", "pushes"), ("rig", "rig"), ("tumble", "tumbles")])
def test_how_often_a_name_is_right_is_what_the_kept_counts_have(kind, of):
    _, named, right = _counted(kind, COUNTS[of]["seeds"])
    assert COUNTS[of] == {"seeds": COUNTS[of]["seeds"], "named": len(named), "right": len(right)}


def test_by_how_much_a_frame_lowers_k_is_what_the_kept_counts_have():
    low, kept = [], Path(__file__).parents[4] / "docs" / "results" / "diagnose-second"
    for path in [kept / f"push-{seed}" / "cases.jsonl" for seed in COUNTS["pushes"]["seeds"]]:
        for row in map(json.loads, path.read_text(encoding="utf-8").splitlines()):
            true, found = row.get("hidden", {}).get("base", {}), row.get("base_parameters") or {}
            if row["verdict"] == "none" and not row["truth"] and {"stiffness"} <= true.keys() & found.keys():
                low.append(100 * (1 - found["stiffness"]["value"] / true["stiffness"]))
    assert len(low) == SERIES["count"]
    assert [round(float(np.median(low)), 1), round(max(low), 1)] == [SERIES["middle"], SERIES["most"]]


@pytest.mark.parametrize(("kind", "of"), [("push", "pushes"), ("rig", "rig"), ("tumble", "tumbles")])
def test_how_often_two_names_are_right_is_what_the_kept_counts_have(kind, of):
    counted = COUNTS["pairs"][of]
    rows, *verdicts = _counted(kind, counted["seeds"])
    named, right = ([row for row in found if len(row["effects"]) > 1] for found in verdicts)
    hidden = [row for row in rows if row["outside"] is None and len(row["truth"]) > 1]
    found = {"named": len(named), "right": len(right), "hidden": len(hidden)}
    assert counted == {"seeds": counted["seeds"]} | found


def test_how_often_a_name_is_right_on_mujocos_tumbles_is_what_the_kept_counts_have():
    counted, pairs = COUNTS["mujoco"]["tumbles"], COUNTS["mujoco"]["pairs"]["tumbles"]
    rows, named, right = _counted("tumble", counted["seeds"], "diagnose-mujoco")
    assert counted == {"seeds": pairs["seeds"], "named": len(named), "right": len(right)}
    both = [row for row in rows if row["outside"] is None and len(row["truth"]) > 1]
    two = [sum(len(row["effects"]) > 1 for row in found) for found in (named, right)]
    assert [pairs["named"], pairs["right"], pairs["hidden"]] == [*two, len(both)]
    said = " ".join(_how_often({"verdict": "named", "effects": ["slope"],
                                "counted": {"of": "tumbles", **COUNTS["tumbles"], "mujoco": counted}}))  # fmt: skip
    assert re.search(rf"{len(right)} of {len(named)} on .*MuJoCo", said)


def test_a_k_of_a_power_of_depth_is_said_with_the_depth_it_belongs_to(result):
    _, said, folder = result
    (sentence,) = use_sentences(said)
    assert said["typical_depth_m"] == pytest.approx(0.0075, rel=0.01)
    page = (folder / "report.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert all("F / z" in text and "D = 7.5" in text for text in (sentence, page))
    assert "F / z" in (folder / "model.toml").read_text(encoding="utf-8")
    straight = said | {"equations": []}
    assert "F / z" not in use_sentences(straight)[0]


def test_a_model_of_pushes_states_their_range_and_that_none_came_out(result):
    found, said, folder = result
    model = read_model(folder / "model.toml")
    covered = model.notes["fitted_range"]
    assert covered["depth_m"] == pytest.approx(0.01, rel=0.01) and not covered["withdrawal"]
    assert covered["speed_m_s"] == pytest.approx([0.005, 0.005], rel=0.02)
    assert any("was withdrawn" in warning for warning in found["warnings"])
    assert "No push was" in use_sentences(said)[0] and "No push was" not in use_sentences(said | {"covered": {}})[0]


def test_the_highest_c_is_a_bound_that_holds_the_true_one_in_nine_of_ten_cases():
    """F = k 900 z + C v with k scattered by 1.5 %: 95 % of bounds hold C."""
    random, depth = np.random.default_rng(5), np.linspace(0.0, 0.02, 100)
    bounds = []
    for _ in range(100):
        pushes = []
        for speed in (0.005, 0.08, 0.08, 0.08):
            spring, rate = 900.0 * depth, np.full(100, speed)
            force = (1 + 0.015 * random.standard_normal()) * spring + 0.5 * rate + 0.03 * random.standard_normal(100)
            pushes.append(Push(0.012, depth, rate, force, spring))
        bounds.append(highest_damping(pushes))
    assert np.mean(np.array(bounds) > 0.5) > 0.89 and np.median(bounds) < 1.0
    assert highest_damping([]) is None
