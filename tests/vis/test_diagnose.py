"""The report of a diagnosis is made from its folder alone."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.text import Annotation

from rigid.intervals import half_of
from vis.diagnose.campaign import _draw_coverage, _has_holes, _widths
from vis.diagnose.evidence import closed_share, draw_evidence
from vis.diagnose.figures import (
    _PHASES,
    _REPLICATES,
    _SENSOR,
    Channel,
    draw_trajectories,
    read_channel,
    source_of,
    worst,
)
from vis.diagnose.report import _tile_of, write_diagnosis_report
from vis.diagnose.usable import gap_in_scatter
from vis.page.plots import line_handles, line_styles


def write_folder(folder, *, trials: dict[str, float], scatter: float | None = None) -> None:
    """An unknown diagnosis of pushes; `trials`: id -> size of what is missing, in standard deviations."""
    (folder / "series").mkdir()
    time = np.linspace(0.0, 1.0, 60)
    latent = ["trial,t_s,latent_force_N,depth_m,velocity_m_s"]
    for trial, size in trials.items():
        rows = ["t_s,measured,before,after,std,phase" + ("" if scatter is None else ",scatter")]
        for t in time:
            rows.append(f"{t},{t + 0.1 * size * t},{t},{t + 0.05 * size * t},0.1,{'in' if t < 0.5 else 'out'}")
            rows[-1] += "" if scatter is None else f",{scatter}"
            latent.append(f"{trial},{t},{0.05 * size * t},{0.01 * t},0.01")
        (folder / "series" / f"{trial}.force.csv").write_text("\n".join(rows) + "\n")
    (folder / "latent.csv").write_text("\n".join(latent) + "\n")
    phase = {"phase": "in", "channel": "force", "samples": 30, "before": 9.0, "after": 3.0}
    said = {
        "verdict": "unknown", "effects": [], "alternatives": [],
        "where": [{"trial": "a", "channel": "force", "phase": "in", "from_s": 0.0, "to_s": 0.4, "excess": 90.0,
                   "settings": {"speed_m_s": 0.01}}],
        "gap": {"before": {"fit": 9.0, "held_out": 8.0}, "after": {"fit": 3.0, "held_out": 4.0},
                "held_out_trials": ["d"]},
        "latent": {"file": "latent.csv", "depends_on": "the depth", "explained": {"depth_m": 0.9, "t_s": 0.5}},
        "base": {stage: {"stiffness": {"value": 1.0, "std": 0.1, "unit": "N/m"}} for stage in ("before", "after")},
        "by_phase": [phase | {"held_out": held} for held in (False, True)],
        "evidence": [{"candidate": "layering:slope", "effects": ["layering"], "score": 2.0, "left": 2.0}],
        "findings": [{"what": "trial a: gaps", "trial": "a", "channel": "force", "from_s": 0.1, "to_s": 0.2,
                      "set_aside": True}],
        "next_experiment": "Repeat the trial.",
    }  # fmt: skip
    if scatter is not None:
        said["gap_with_scatter"] = {stage: {"fit": 2.0, "held_out": 1.5} for stage in ("before", "after")}
    result = {"title": "Something is missing", "summary": ["Certain: nothing."], "version": "0", "warnings": ["a gap"],
              "departures": {"sentences": ["The base model fails most in in."]}}  # fmt: skip
    gaps = {"gap": said["gap"]} | ({"gap_with_scatter": said["gap_with_scatter"]} if scatter is not None else {})
    result["quantities"] = {
        f"{name}_{stage}_{part}": {"value": gap[stage][part], "std": None, "unit": "1"}
        for name, gap in gaps.items() for stage in ("before", "after") for part in ("fit", "held_out")
    }  # fmt: skip
    (folder / "diagnosis.json").write_text(json.dumps(said))
    (folder / "result.json").write_text(json.dumps(result))


def test_the_report_of_an_unknown_has_every_part_and_names_columns_in_words(tmp_path):
    write_folder(tmp_path, trials={"a": 3.0, "d": 2.0})
    page = write_diagnosis_report(tmp_path).read_text(encoding="utf-8")
    for part in ("Recorded and modelled", "Remaining misfit by phase and channel", "layering:slope",
                 "Repeat the trial.", "The unexplained force", "speed 0.01 m/s", "trial a: gaps",
                 "held-out trials"):  # fmt: skip
        assert part in page
    figures = {path.stem for path in (tmp_path / "figures").iterdir()}
    assert figures == {"trajectories", "residuals", "evidence", "latent"}


def test_every_form_that_was_tried_stands_with_its_evidence_in_a_folded_table(tmp_path):
    write_folder(tmp_path, trials={"a": 3.0, "d": 2.0})
    said = json.loads((tmp_path / "diagnosis.json").read_text())
    pair = "layering:slope + adhesion:held"
    said["evidence"] += [
        {"candidate": "layering:step", "effects": ["layering"], "score": -1.25, "left": 7.0, "closes": 0.125},
        {"candidate": pair, "effects": ["layering", "adhesion"], "score": -2.5, "left": 1.0, "closes": 0.5},
    ]  # fmt: skip
    said["forms_tried"] = {"layering:step": "a step of the force"}
    (tmp_path / "diagnosis.json").write_text(json.dumps(said))
    page = write_diagnosis_report(tmp_path).read_text(encoding="utf-8")
    (part,) = [part for part in re.findall("<details>.*?</details>", page, re.DOTALL) if ">All forms" in part]
    cells = re.findall("<td[^>]*>(.*?)</td>", part)
    minus = "\N{MINUS SIGN}"
    assert cells == ["layering:slope", "2.0", "2", "\N{EN DASH}", "layering:step", f"{minus}1.2", "7", "12 %",
                     pair, f"{minus}2.5", "1", "50 %"]  # fmt: skip
    assert all(words in part for words in ("3 candidates", "3 forms", "layering:step: a"))


def test_what_replicates_differ_by_stands_beside_the_gap_and_behind_what_is_left(tmp_path):
    write_folder(tmp_path, trials={"a": 3.0, "d": 2.0}, scatter=0.2)
    page = write_diagnosis_report(tmp_path).read_text(encoding="utf-8")
    for part in (
        "Gap with scatter after, held-out trials",
        "<td>1.5",
        "best model, gap with scatter",
        "Certain: nothing.",
    ):
        assert part in page or part.replace("&#39;", "'") in page
    channel = read_channel(tmp_path / "series" / "a.force.csv")
    assert channel.scatter is not None and set(channel.scatter) == {0.2}


@pytest.mark.parametrize(
    ("notes", "source"),
    [
        ('[notes]\n"made_by" = "hedgebed 0.1.0 penetrate, grains of 2.4 mm"\n', "simulated on grains"),
        ('[notes]\n"made_by" = "hedgebed 0.1.0 tumble on a bed of sand"\n', "simulated on grains"),
        ('[notes]\n"made_by" = "hedgebed 0.1.0 tumble on the spring-damper of sand"\n', "simulated"),
        ('[notes]\n"made_by" = "hedgebed 0.1.0 campaign"\n', "simulated"),
        ('[notes]\n"made_by" = "the rig in hall 3, on a bed of sand"\n', "trials"),
        ('format = "hedgehog-model/1"\n', "trials"),
        ('[notes]\nrecorded_by = "CMU"\n', "as recorded (CMU)"),
        ('[notes]\nrecorded_by = "CMU"\nmade_by = "hedgebed 0.1.0 campaign"\n', "simulated"),
        (None, "recorded"),
    ],
)
def test_a_legend_says_measured_only_of_trials_that_hedgebed_did_not_make(tmp_path, notes, source):
    write_folder(tmp_path, trials={"a": 3.0})
    if notes is not None:
        (tmp_path / "model.toml").write_text(notes)
    assert source_of(tmp_path) == source
    channel = read_channel(tmp_path / "series" / "a.force.csv")
    drawing = draw_trajectories([channel], set(), ("base", "best"), source)
    (legend,) = drawing.legends
    assert legend.get_texts()[0].get_text() == source
    assert f"trials, {source};" in write_diagnosis_report(tmp_path).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("phases", "over"),
    [
        (["in"] * 4, "depth [mm]"),
        (["in", "in", "out", "out"], "time [s]"),
        (["in", "rest", "in", "in"], "depth [mm]"),
        (["in", "rest", "rest", "rest"], "time [s]"),
    ],
)
def test_the_force_of_a_push_is_drawn_over_its_depth_and_what_is_left_too_where_it_only_goes_in(phases, over):
    one, depth = np.ones(4), np.array([0.001, 0.002, 0.0015, 0.0005])
    channel = Channel("a", "force", np.arange(4.0), one, one, one, one, one, np.array(phases), None, depth)
    drawing = draw_trajectories([channel], set(), ("base", "best"), "as given")
    left, right = drawing.axes
    assert (left.get_xlabel(), right.get_xlabel()) == ("depth [mm]", over)
    assert left.lines[0].get_xdata() == pytest.approx(1e3 * depth)


def test_what_the_best_model_leaves_fills_its_panel_and_the_base_model_leaves_it():
    one, time = np.ones(50), np.linspace(0.0, 1.0, 50)
    base, best = 300.0 * time, 6.0 * np.sin(9 * time)
    channel = Channel("a", "force", time, 0 * one, -base, -best, one, one, np.array(["in"] * 50))
    _, right = draw_trajectories([channel], set(), ("base", "best"), "as given").axes
    low, high = right.get_ylim()
    assert low < best.min() < best.max() < high < 0.1 * base.max() and np.ptp(best) > 0.5 * (high - low)
    alone = draw_trajectories([channel], set(), ("base", ""), "as given").axes[1]
    assert alone.get_ylim()[1] > base.max()


def test_a_report_says_how_many_of_the_recordings_it_draws(tmp_path):
    write_folder(tmp_path, trials={name: float(size) for name, size in zip("abcdefgh", range(9, 1, -1), strict=True)})
    assert "6 of 8" in write_diagnosis_report(tmp_path).read_text(encoding="utf-8")


def test_a_finding_of_one_reading_has_a_mark_that_is_seen():
    entry = {"trial": "a", "sensor": "data", "from_s": 0.0, "to_s": 4.0, "gaps": []}
    finding = {"trial": "a", "channel": "depth", "what": "one reading", "from_s": 1.0}
    for end, marks in ((1.0, 1), (2.0, 0)):
        drawing = _draw_coverage({"recordings": [entry], "findings": [finding | {"to_s": end}]})
        assert len([line for line in drawing.axes[0].lines if line.get_marker() == "v"]) == marks


def test_a_trial_that_was_set_aside_has_a_table_of_its_own_and_no_curve(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "vis.diagnose.report.draw_trajectories", lambda shown, *more: drawn.extend(c.trial for c in shown)
    )
    write_folder(tmp_path, trials={"a": 3.0, "b": 30.0, "d": 2.0})
    said = json.loads((tmp_path / "diagnosis.json").read_text())
    said["set_aside"] = [{"trial": "b", "channel": "force", "unit": "N", "samples": 60, "rms_before": 1.5,
                          "rms_after": 0.75}]  # fmt: skip
    (tmp_path / "diagnosis.json").write_text(json.dumps(said))
    page = write_diagnosis_report(tmp_path).read_text(encoding="utf-8")
    assert "were set aside" in page and "0.75" in page
    assert drawn == ["a", "d"]


def test_the_worst_channels_are_drawn_and_held_out_ones_among_them(tmp_path):
    write_folder(tmp_path, trials={name: float(size) for name, size in zip("abcdefgh", range(9, 1, -1), strict=True)})
    channels = [read_channel(path) for path in sorted((tmp_path / "series").glob("*.csv"))]
    assert [channel.trial for channel in worst(channels, {"h", "g", "f"})] == ["a", "b", "c", "d", "f", "g"]


def test_trials_are_drawn_in_the_order_of_the_campaign_and_dots_over_lines(tmp_path):
    write_folder(tmp_path, trials={name: float(size) for name, size in zip("abc", (2, 9, 5), strict=True)})
    channels = [read_channel(path) for path in sorted((tmp_path / "series").glob("*.csv"))]
    assert [channel.trial for channel in worst(channels, set())] == ["a", "b", "c"]
    lines = draw_trajectories(channels[:1], set(), ("base", "best"), "as given").axes[0].lines
    order = {line.get_marker(): line.get_zorder() for line in lines}
    assert order["."] > order["None"]


def test_held_out_pushes_are_drawn_where_all_drops_were_fitted():
    def channel(trial, name, left):
        one = np.ones(3)
        return Channel(trial, name, np.arange(3.0), left * one, 0 * one, 0 * one, one, one, np.array([""] * 3), None)

    fitted = [channel(f"d{k}", name, 9.0) for k in range(3) for name in ("depth", "accel", "force")]
    chosen = worst([*fitted, channel("h1", "force", 2.0), channel("h2", "force", 1.0)], {"h1", "h2"})
    assert [c.trial for c in chosen][-2:] == ["h1", "h2"] and len(chosen) == 6


def test_replicates_share_a_line_and_conditions_do_not():
    keys = [f"condition {k}" for k in range(12) for _ in range(3)]
    styles = line_styles(keys)
    assert len(styles) == 12 and len({(style["color"], str(style["ls"])) for style in styles.values()}) == 12
    assert [line.get_label() for line in line_handles(["1", "2", "3"], ["a", "b", "a"])] == ["a: 1, 3", "b: 2"]


def test_a_spike_of_the_base_model_that_comes_from_outside_its_panel_is_not_drawn():
    """At rest the base model is 300 standard deviations off; one reading there lies in the panel."""
    one, time = np.ones(60), np.linspace(0.0, 1.0, 60)
    base = np.where(time < 0.5, 5.0 * time, 300.0)
    base[45] = 1.0
    channel = Channel("a", "force", time, 0 * one, -base, -np.sin(9 * time), one, one, np.array(["in"] * 60))
    _, right = draw_trajectories([channel], set(), ("base", "best"), "trials").axes
    drawn = np.asarray(right.lines[0].get_ydata())
    low, high = right.get_ylim()
    assert np.isnan(drawn[45]) and np.nanmin(drawn) >= low and np.nanmax(drawn) <= high
    assert np.isfinite(drawn[:20]).all()


def test_a_step_of_the_force_while_the_drive_stops_has_dots():
    """A recording of 900 readings, of which 10 are the step: at least three of these are drawn."""
    time = np.arange(900.0)
    force = np.interp(time, [450.0, 460.0], [40.0, 30.0])
    one = np.ones(900)
    channel = Channel("a", "force", time, force, force, force, one, one, np.array(["in"] * 900), None, one)
    (dots,) = [line for line in draw_trajectories([channel], set(), ("base", "best"), "trials").axes[0].lines
               if line.get_marker() == "."]  # fmt: skip
    shown = np.asarray(dots.get_ydata())
    assert np.sum((shown < 40.0) & (shown > 30.0)) >= 3


def test_the_bands_of_the_noise_look_like_no_phase_and_unlike_one_another():
    """Differences of red, green and blue: the band of replicates had the tan of "free"."""
    for band in (_REPLICATES, _SENSOR):
        free = np.subtract(to_rgb(band), to_rgb(_PHASES["free"]))
        assert np.linalg.norm(free) > 0.7
    assert np.linalg.norm(np.subtract(to_rgb(_REPLICATES), to_rgb(_SENSOR))) > 0.25


def test_shares_near_all_have_the_digits_that_separate_them_from_all():
    shares = (0.0, 0.588, 0.9375, 0.99, 0.9951, 0.99991450, 0.99999999, 1.0)
    assert [closed_share(share) for share in shares] == [
        "0 %", "59 %", "94 %", "99 %", "99.5 %", "99.99 %", ">99.999 %", "100 %"
    ]  # fmt: skip


def test_a_bar_that_is_longer_than_that_of_the_named_set_says_why_it_is_not_named():
    def row(*effects, score, note=""):
        return {"effects": effects, "score": score, "left": 1.0, "closes": 0.9, "note": note}

    rows = [row("layering", "adhesion", score=30.0, note="gains 2.0 nats: less than a further name must gain"),
            row("layering", score=28.0, note="named"), row("adhesion", score=3.0)]  # fmt: skip
    drawing = draw_evidence({"verdict": "named", "effects": [{"id": "layering"}], "alternatives": [],
                             "candidates": rows})  # fmt: skip
    notes = [text for text in drawing.axes[0].texts if isinstance(text, Annotation)]
    said = {text.xy[1]: text.get_text() for text in notes if text.get_text().startswith("gains too little")}
    assert list(said) == [2]


@pytest.mark.parametrize(
    ("change", "holes"),
    [({}, False), ({"gaps": [(1.0, 2.0)]}, True), ({"from_s": 0.5}, True), ({"to_s": 3.99}, False)],
)
def test_the_chart_of_recorded_times_is_drawn_only_where_something_is_missing(change, holes):
    pose = {"trial": "a", "sensor": "pose", "from_s": 0.0, "to_s": 4.0, "gaps": []}
    result = {"recordings": [pose, pose | {"sensor": "imu"} | change], "findings": []}
    assert _has_holes(result) is holes
    found = {"trial": "a", "channel": "x", "what": "one reading", "from_s": 1.0, "to_s": 1.0}
    assert _has_holes(result | {"findings": [found]})


def test_a_deeper_push_has_a_thicker_line_that_shallower_ones_do_not_hide():
    files = {name: {"depth_m": np.array([0.0, depth, np.nan])} for name, depth in zip("abc", (1, 3, 3), strict=True)}
    trials = [{"id": name, "condition": depth} for name, depth in zip("abc", ("1", "3", "3"), strict=True)]
    widths = _widths(files, trials)
    assert widths["a"] < widths["b"] == widths["c"]
    assert _widths(files, trials[:1]) == {"a": widths["a"]}


def test_a_gap_over_few_trials_has_students_interval_and_the_table_has_95_percent(tmp_path):
    """Four held-out trials: t = 3.18 with three degrees of freedom (printed tables)."""
    weighed = {"before": {"fit": 3.4, "held_out": 2.2}, "after": {"fit": 1.0, "held_out": 1.1},
               "after_std": {"fit": 0.6, "held_out": 0.6}, "trials": {"fit": 9, "held_out": 4}}  # fmt: skip
    assert half_of(gap_in_scatter({"gap_with_scatter": weighed}, "held_out")) == pytest.approx(3.182 * 0.6, abs=1e-3)
    assert half_of(gap_in_scatter({"gap_with_scatter": weighed | {"trials": {}}}, "fit")) == pytest.approx(1.96 * 0.6)
    assert half_of(gap_in_scatter({"gap_with_scatter": weighed}, "fit", "before")) is None
    write_folder(tmp_path, trials={"a": 3.0, "d": 2.0}, scatter=0.2)
    page = write_diagnosis_report(tmp_path).read_text(encoding="utf-8")
    assert "standard error" not in page.replace("1.96 standard errors", "")


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("stiffness@0.06_after", "Stiffness (60 mm)"),
        ("damping_after", "Damping"),
        ("depth-hardening.bend", "Bend (depth-hardening)"),
    ],
)
def test_a_number_of_one_diameter_is_named_by_it(name, label):
    tile = _tile_of(name, {"value": 1690.0, "std": 75.0, "unit": "N/m", "note": ""})
    assert tile.label == label and tile.value.startswith("1690")
