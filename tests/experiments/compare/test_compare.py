"""`hedgebed compare` and `hedgebed render`: two tumbles in one report, what is refused, pictures made again."""

import json
import math
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from golden import golden

from experiments.cli.main import main
from experiments.compare import experiment as compare
from experiments.compare.tumbles import read_moved
from experiments.runs.folder import RunFolder, read_series


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same tumble on the spring-damper of sand, by the master, and on that of brick, longer."""
    home = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)
        common = ("tumble", "--rig", "0.0085", "--torque", "0.22", "--quiet")
        sand = ("--surface", "sand", "--method", "coupled", "--duration", "0.2")
        assert main([*common, *sand, "--out", str(home / "sand")]) == 0
        assert main([*common, "--surface", "brick", "--duration", "0.3", "--out", str(home / "brick")]) == 0
    return home


def test_two_tumbles_side_by_side_have_their_differences_in_numbers_curves_and_a_page(runs, tmp_path, capsys):
    out = tmp_path / "both"
    assert (
        main(["compare", str(runs / "sand"), str(runs / "brick"), "--no-pictures", "--out", str(out), "--quiet"]) == 0
    )
    assert "difference" in capsys.readouterr().out.splitlines()[2]
    result = json.loads((out / "result.json").read_text())
    one, other = (read_series(runs / name / "trajectory.csv") for name in ("sand", "brick"))
    ends = [(run["x_m"] - run["x_m"][0])[np.searchsorted(run["t_s"], 0.2 - 1e-9)] for run in (one, other)]
    assert result["quantities"]["gap_x_end"]["value"] == pytest.approx(ends[1] - ends[0], rel=1e-3)
    assert 0 <= result["quantities"]["same_state"]["value"] <= 1
    assert {"surface", "stiffness", "mu_d", "method"} <= {row["key"] for row in result["differs"]}
    columns = read_series(out / "series" / "compared.csv")
    assert columns["t_s"][-1] == pytest.approx(0.2)
    page = (out / "report.html").read_text()
    assert page.count("data:image/png") == 5 and "0.2 and 0.3" in page


def test_numbers_that_go_with_how_long_a_run_lasts_are_compared_over_the_time_that_both_last(runs, tmp_path, capsys):
    out = tmp_path / "both"
    words = ["compare", str(runs / "sand"), str(runs / "brick"), "--no-pictures", "--out", str(out), "--quiet"]
    assert main(words) == 0
    assert "over 0.2 s" in " ".join(capsys.readouterr().out.split())
    result = json.loads((out / "result.json").read_text())
    printed = " ".join(listed["title"] for listed in result["tables"])
    said = re.findall(r"Numbers o[^\[]*?[\d.]+ s\b(?:, and \w+ less \w+)?", printed)
    golden("compare/both_last", said)
    rows = {row["name"]: row for row in result["compared"]}
    sand, brick = (json.loads((runs / name / "result.json").read_text())["quantities"] for name in ("sand", "brick"))
    series = read_series(runs / "brick" / "trajectory.csv")
    both = series["t_s"] <= 0.2 + 1e-9
    speed, spin = np.hypot(series["vx_m_s"], series["vy_m_s"])[both].max(), np.abs(series["omega_rad_s"])[both].max()
    assert result["compared_over"] == pytest.approx(0.2) and speed < brick["max_speed"]["value"]
    for name, value in (("max_speed", speed), ("max_angular_velocity", spin)):
        assert rows[name]["first"] == sand[name]["value"] and rows[name]["second"] == pytest.approx(value)
        assert rows[name]["difference"] == rows[name]["second"] - rows[name]["first"]
        assert rows[name]["second_whole"] == brick[name]["value"]
    assert rows["energy_residual"]["over"] == "whole runs"


def test_a_warning_of_both_runs_stands_once_and_one_of_either_is_told_with_its_label(runs, tmp_path):
    for name, own in (("sand", ["the wind blew", "sand's own"]), ("brick", ["the wind blew"])):
        shutil.copytree(runs / name, tmp_path / name)
        folder = RunFolder.open(tmp_path / name)
        folder.write_result(folder.read_result() | {"warnings": own})
    given = [str(tmp_path / name) for name in ("sand", "brick")]
    assert main(["compare", *given, "--no-pictures", "--out", str(tmp_path / "both"), "--quiet"]) == 0
    warnings = json.loads((tmp_path / "both" / "result.json").read_text())["warnings"]
    assert [text.split(": ") for text in warnings] == [["both", "the wind blew"], ["sand", "sand's own"]]


def test_both_sides_of_a_comparison_have_halves_of_95_per_cent_intervals():
    """Of a law 1.96 standard deviations, over three beds t s / sqrt(3) with t = 4.303; of one bed none."""
    number = {"quantities": {"highest": {"value": 1.0, "std": 0.1, "unit": "m"}}}
    one_bed = {"quantities": {"highest": {"value": 1.0, "std": None, "unit": "m"}}, "beds": [1]}
    ((law, beds),) = [
        (row["first_half"], row["second_half"]) for row in compare._compared([number, number | {"beds": [1, 2, 3]}])
    ]
    assert law == pytest.approx(0.196) and beds == pytest.approx(4.303 * 0.1 / math.sqrt(3), rel=1e-3)
    assert compare._compared([number, one_bed])[0]["second_half"] is None
    spike = number | {"experiment": "penetrate", "runs": [{"seed": 1}, {"seed": 2}]}
    assert compare._compared([spike, number])[0]["first_half"] == pytest.approx(12.706 * 0.1 / math.sqrt(2), rel=1e-3)


def test_no_difference_is_told_in_per_cent_of_next_to_nothing():
    assert compare._relative(2.0, 3.0) == 0.5 and compare._relative(-2.0, 3.0) == 2.5
    assert compare._relative(1e-25, -4e-3) is None and compare._relative(0.0, 1.0) is None


def test_a_spring_damper_s_sinkage_is_its_compression_below_the_undisturbed_surface(runs, tmp_path):
    """At rest each of two rows bears W / 2: W / (2 K) deep; an older run without the numbers is given them."""
    result = json.loads((runs / "brick" / "result.json").read_text())
    trial = {name: entry["value"] for name, entry in result["trial"].items()}
    stood = result["quantities"]["sinkage_start"]["value"]
    assert stood == pytest.approx(trial["weight"] / 2 / trial["stiffness"], rel=1e-6)
    old = tmp_path / "old"
    shutil.copytree(runs / "brick", old)
    for name in ("sinkage_start", "sinkage_largest"):
        del result["quantities"][name]
    RunFolder.open(old).write_result(result)
    out = tmp_path / "both"
    assert main(["compare", str(old), str(runs / "sand"), "--no-pictures", "--out", str(out), "--quiet"]) == 0
    found = json.loads((out / "result.json").read_text())
    rows = {row["name"]: row for row in found["compared"]}
    assert rows["sinkage_start"]["first"] == pytest.approx(stood) and rows["sinkage_start"]["second"] > 10 * stood
    assert [row["row"] for row in found["rows"]] == [0, 7]
    deepest = rows["sinkage_largest"]["second"]
    assert max(row["second"] for row in found["rows"]) == pytest.approx(deepest)


@pytest.mark.parametrize("effects", [("tip-radius.radius=0.006",), ("tip-radius.radius=0.006", "slope.angle=0.05")])
def test_ball_tips_sink_in_as_deep_as_points_on_a_slope_too(effects, tmp_path, monkeypatch):
    """Each of two rows bears half of W cos(slope), so their mean depth is W cos(slope) / 2K: of a ball's lowest point,
    (l - r) cos a + r - y. Read from the folder, of today's result and of an older one, it is the same."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)
    run = tmp_path / "run"
    given = [word for effect in effects for word in ("--effects", effect)]
    assert main(["tumble", "--rig", "0.0085", *given, "--duration", "0.02", "--quiet", "--out", str(run)]) == 0
    result = json.loads((run / "result.json").read_text())
    trial = {name: entry["value"] for name, entry in result["trial"].items()}
    carried = trial["weight"] * (math.cos(0.05) if len(effects) > 1 else 1.0)
    stood = result["quantities"]["sinkage_start"]["value"]
    assert stood == pytest.approx(carried / 2 / trial["stiffness"], rel=1e-6)
    largest = result["quantities"]["sinkage_largest"]["value"]
    for told in (result, {key: value for key, value in result.items() if key != "tip_radius"}):
        sinkage = read_moved(run, told).sinkage
        assert sinkage[0, [0, -1]].mean() == pytest.approx(stood, rel=1e-9)
        assert sinkage.max() == pytest.approx(largest, rel=1e-9) and largest >= stood


def test_the_loads_on_the_rows_are_the_force_that_lifts_the_platform(runs):
    """Sum of K delta + C max(0, rate) over the rows = (m + m_b) ay + W, whoever integrated it."""
    for name in ("sand", "brick"):
        result = json.loads((runs / name / "result.json").read_text())
        moved = read_moved(runs / name, result)
        assert np.abs(moved.load.sum(axis=1) - moved.lift)[1:].max() < 1e-6 * moved.weight
        assert moved.sinkage.max() == pytest.approx(result["quantities"]["sinkage_largest"]["value"], rel=1e-3)


@pytest.mark.parametrize(
    ("others", "said"),
    [
        (("sand",), "a run does not differ from itself"),
        (("nothing",), "is not a run folder"),
        (("begun",), "has no result yet"),
        (
            ("hop",),
            "is of hop, which has nothing to compare over time; expected: runs of tumble, "
            "tumble spatial, mujoco or penetrate",
        ),
        (("spike",), "is of tumble and .* of penetrate: expected two runs of one kind"),
    ],
)
def test_what_cannot_be_compared_is_refused_by_name(runs, tmp_path, others, said, capsys):
    text = (runs / "sand" / "run.toml").read_text()
    for name, command in (("begun", "tumble"), ("hop", "hop"), ("spike", "penetrate")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.toml").write_text(text.replace('command = "tumble"', f'command = "{command}"'))
    (tmp_path / "spike" / "result.json").write_text("{}")
    other = runs / "sand" if others[0] == "sand" else tmp_path / others[0]
    assert main(["compare", str(runs / "sand"), str(other), "--out", str(tmp_path / "out")]) == 2
    assert re.search(said, capsys.readouterr().err.replace("\n", " "))
    assert not (tmp_path / "out").exists()


def test_pictures_of_a_run_are_made_again_without_opengl_too(runs, monkeypatch, capsys):
    monkeypatch.setenv("HEDGEBED_NO_OPENGL", "1")
    assert main(["render", str(runs / "brick"), "--no-film", "--quiet", "--json"]) == 0
    drawn = [Path(name).name for name in json.loads(capsys.readouterr().out)["pictures"]]
    assert {"tumble-start.png", "tumble-half.png", "tumble-end.png", "trajectory.png"} <= set(drawn)
    page = (runs / "brick" / "report.html").read_text()
    assert "Close-up" in page and "no OpenGL" in page


def test_render_lists_what_it_has_drawn_and_no_film_of_before(runs, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HEDGEBED_NO_OPENGL", "1")
    run = tmp_path / "run"
    shutil.copytree(runs / "brick", run)
    (run / "film.gif").write_bytes(b"of before")
    os.utime(run / "film.gif", (1e9, 1e9))
    assert main(["render", str(run), "--no-film", "--quiet"]) == 0
    listed = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    assert "film.gif" not in listed and "tumble-end.png" in listed and "animation.gif" in listed


def test_a_kept_result_of_a_spike_is_not_rendered_either_and_nothing_is_written_into_it(tmp_path, capsys):
    kept = tmp_path / "penetrate"
    shutil.copytree(Path(__file__).parents[3] / "docs" / "results" / "penetrate", kept)
    assert main(["render", str(kept)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "result.json, run.toml alone" in said and f"`hedgebed penetrate {kept / 'run.toml'}`" in said
    assert sorted(path.name for path in kept.iterdir()) == ["cost.json", "result.json", "run.toml"]


def test_what_has_no_result_is_not_rendered(tmp_path, capsys):
    assert main(["render", str(tmp_path)]) == 2
    assert "a run folder" in capsys.readouterr().err


def test_a_kept_result_is_refused_with_what_it_lacks_and_no_lock_is_left(runs, tmp_path, capsys):
    """run.toml, result.json and trajectory.csv alone, as docs/results keeps them: `render`, `compare`, `from-run`."""
    kept = tmp_path / "kept"
    kept.mkdir()
    for name in ("run.toml", "result.json", "trajectory.csv"):
        (kept / name).write_bytes((runs / "sand" / name).read_bytes())
    out = str(tmp_path / "out")
    for words in (["render"], ["compare", str(runs / "brick"), "--out", out], ["campaign", "from-run"]):
        after = [out] if words[0] == "campaign" else []
        assert main([*words, str(kept), *after]) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert "no series/motion.csv" in said and "result.json, trajectory.csv alone" in said
        assert f"`hedgebed tumble {kept / 'run.toml'}`" in said
        assert len(list(kept.iterdir())) == 3 and not (tmp_path / "out").exists()


def test_resuming_a_kept_result_shows_it_and_computes_and_writes_nothing(runs, tmp_path, capsys):
    kept = tmp_path / "kept"
    kept.mkdir()
    for name in ("run.toml", "result.json", "trajectory.csv"):
        (kept / name).write_bytes((runs / "sand" / name).read_bytes())
    before = {path.name: path.read_bytes() for path in kept.iterdir()}
    assert main(["resume", str(kept), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads((runs / "sand" / "result.json").read_text())
    assert {path.name: path.read_bytes() for path in kept.iterdir()} == before
