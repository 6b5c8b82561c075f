"""A report begins with its answer: six numbers at most, their errors, a picture, three findings; the rest is folded."""

import math
import re
import shutil
from importlib import import_module
from pathlib import Path

import pytest

from experiments.platform.law_spread import spread_entries
from experiments.runs.headline import headline_of, headline_of_tiles
from experiments.runs.registry import EXPERIMENTS
from rigid.result import read_result
from vis.page.answer import MOST_ROWS, answer, write_page
from vis.page.numbers import foldable
from vis.page.page import Page, Section, Tile, listing, text
from vis.page.sentences import label_of
from vis.paper.report import CASE_HEAD
from vis.report import write_report
from vis.robot.answer import DISTANCE, answer_tiles
from vis.tumble.answer import answer_tiles as tumble_tiles
from vis.tumble.beside import beside_rows

ON_GRAINS = {"experiment": "penetrate", "ground": "bed"}


def test_a_spread_is_the_error_of_chance_and_the_others_are_empty():
    numbers, note = answer([Tile("K", "66 ± 13 N/m", "fitted"), Tile("force", "1.4 N")], ON_GRAINS)
    assert (numbers.head[1], numbers.head[3]) == ("value", "± grain size") and "softness" in numbers.head[4]
    assert numbers.head[2].startswith("± chance") and "95" in numbers.head[2]
    assert numbers.rows[0] == ("K", "66 N/m", "13 N/m", "–", "–", "fitted")
    assert numbers.rows[1] == ("force", "1.4 N", "–", "–", "–", "")
    assert note.kind == "text"


def test_three_known_errors_stand_in_their_columns():
    (numbers,) = answer([Tile("K", "38.9 N/m", "95 %", ("5.2 N/m", "17 N/m", "18 N/m"))], ON_GRAINS)
    assert numbers.rows == (("K", "38.9 N/m", "5.2 N/m", "17 N/m", "18 N/m", "95 %"),)


def test_a_one_sided_error_has_its_sign_at_the_number_and_none_in_the_head():
    """The other numbers of that column have ± themselves; columns without a sign stay as they are."""
    tiles = [Tile("sinkage", "2 mm", "", ("1.9 mm", "+5.9 mm", "not known")),
             Tile("K", "38 N/m", "", ("−17 +31 N/m", "17 N/m", "3 N/m"))]  # fmt: skip
    numbers = answer(tiles, ON_GRAINS)[0]
    assert [head[:1] for head in numbers.head[2:5]] == ["c", "g", "±"]
    assert numbers.rows[0][2:5] == ("± 1.9 mm", "+5.9 mm", "not known")
    assert numbers.rows[1][2:5] == ("−17 +31 N/m", "± 17 N/m", "3 N/m")


def test_a_law_alone_has_no_columns_of_errors_that_it_cannot_have():
    (numbers,) = answer([Tile("launch", "0.1 m/s")], {"experiment": "hop"})
    assert numbers.head == ("", "value", "")


def test_more_than_six_numbers_are_no_answer():
    tiles = [Tile(str(number), "1") for number in range(MOST_ROWS + 1)]
    with pytest.raises(ValueError, match=f"{MOST_ROWS + 1} numbers"):
        answer(tiles, ON_GRAINS)


def test_three_findings_are_open_and_the_rest_is_folded(tmp_path):
    findings = [f"finding {number}" for number in range(5)]
    page = Page("t", [], [Section("", [listing(findings)]), Section("Numbers", [text("all of them")])])
    html = write_page(tmp_path / "report.html", page, {}).read_text()
    opened, folded = html.split("<details", 1)
    assert re.findall(r"finding \d", opened) == findings[:3]
    assert re.findall(r"finding \d", folded) == findings[3:] and "all of them" in folded


def test_the_error_of_a_law_in_other_beds_is_a_share_in_per_cent(tmp_path):
    """calibrate-sand-1mm: 0.1075 of the rms force, with a scatter of 0.0027 between the beds."""
    kept = Path(__file__).parents[2] / "docs" / "results" / "calibrate-sand-1mm"
    folder = tmp_path / "run"
    shutil.copytree(kept, folder)
    page = write_report(folder).read_text(encoding="utf-8")
    assert "<td>10.75 %</td>" in page.replace("\N{NO-BREAK SPACE}", " ")


RANGE = {"low": 0.011, "high": 0.02, "unit": "m"}


def robot_result(**more):
    """The numbers of a robot's result that its answer shows."""
    values = {"highest": 0.01, "longest_flight": 0.2, "clearance_largest": 0.02, "sinkage_largest": 0.0142}
    numbers = {name: {"value": value, "std": None, "unit": "m"} for name, value in values.items()}
    numbers["longest_flight"]["unit"] = "s"
    numbers["largest_force"] = {"value": 142.0, "std": None, "unit": "N"}
    numbers["energy_residual"] = {"value": 1e-4, "std": None, "unit": "1"}
    findings = [f"finding {k} at 0.0981 m/s2" for k in range(6)]
    departures = {"sentences": findings}
    return {"experiment": "mujoco", "quantities": numbers, "departures": departures, "warnings": ["w"], **more}


@pytest.mark.parametrize(
    ("more", "errors"),
    [
        ({"ground": "bed", "grains": {}}, ("14 mm", "one bed", "not known", "not known")),
        (
            {"ground": "bed", "beds": [], "sure": {"sinkage_largest": {"value": 0.0142, "high": 0.0165, "unit": "m"}}},
            ("14.2 mm", "2.3 mm", "not known", "not known"),
        ),
        ({"ground": "rft"}, ("14 mm", "not known")),
        ({"ground": "rft", "forms": {"ranges": {"sinkage_largest": RANGE}}}, ("14 mm", "11 to 20 mm")),
        ({"ground": "rft", "sure": {"sinkage_largest": RANGE}}, ("14 mm", "11 to 20 mm", "not known")),
    ],
)
def test_a_robot_states_each_error_of_its_answer_or_that_it_is_not_known(more, errors):
    numbers, _ = answer(answer_tiles(robot_result(**more)), robot_result(**more))
    sinkage = next(row for row in numbers.rows if row[0] == "Sinkage")
    assert tuple(cell.replace("\N{NO-BREAK SPACE}", " ") for cell in sinkage[1:-1]) == errors
    assert len(numbers.head) == len(errors) + 2
    on_law = more["ground"] == "rft"  # which may be no law of sand, as on brick
    assert numbers.head[-2] == ("laws of sand" if "forms" in more else "other laws") or not on_law


def test_a_robot_that_starts_above_the_surface_states_the_height_below_its_rise():
    said = [answer(answer_tiles(robot_result()), robot_result(ground="rft", start_height=high))[-1].text
            for high in (0.01, 0.0)]  # fmt: skip
    assert "10\N{NO-BREAK SPACE}mm above" in said[0] and "mm above" not in said[1]
    hops = robot_result(ground="rft", start_height=0.01)
    hops["quantities"]["hop_distance"] = {"value": 0.3, "std": None, "unit": "m"}
    shown = answer(answer_tiles(hops), hops)
    assert "Clearance" in said[0] and "Clearance" not in shown[-1].text
    assert [row[0] for row in shown[0].rows][1] == DISTANCE[0]


def test_a_flight_that_the_run_cuts_off_heads_the_answer_with_its_apex():
    result = robot_result(ground="rft")
    result["quantities"]["rise_ballistic"] = {"value": 4.1, "std": None, "unit": "m"}
    tile = answer_tiles(result)[0]
    assert tile.label == "Rise, ballistic" and tile.value.startswith("4.1")


def test_the_terminal_of_a_robot_has_the_rows_of_its_report():
    result = robot_result(ground="rft")
    shown = headline_of_tiles(answer_tiles(result), result)
    numbers, _ = answer(answer_tiles(result), result)
    assert len(shown.rows) == MOST_ROWS
    assert [row[:2] for row in shown.rows] == [
        tuple(cell.replace("\N{NO-BREAK SPACE}", " ") for cell in row[:2]) for row in numbers.rows
    ]
    assert (len(shown.sentences), shown.left, shown.warnings) == (3, 3, ("w",))


def test_sentences_of_a_page_have_units_as_figures_have_them():
    block = listing(["at 9.81 m/s2", "gravity [m/s2]", "runs/m/s2"])
    assert block.entries == ("at 9.81 m/s²", "gravity [m/s2]", "runs/m/s2")


def tumble_result(**more):
    """The numbers of a tumble's result on a law that its answer shows: 10 ± 9 degrees."""
    values = {
        "trajectory_angle": (math.radians(10.3), math.radians(9.1), "rad"), "max_speed": (0.159, 0.007, "m/s"),
        "transition_angle_slip": (0.0, 0.0, "rad"), "transition_angle_hop": (0.8, None, "rad"),
        "sinkage_largest": (None, None, "m"),
    }  # fmt: skip
    numbers = {name: {"value": value, "std": std, "unit": unit} for name, (value, std, unit) in values.items()}
    trial = {"torque": {"value": 0.22}, "gravity_sim": {"value": 0.0833565}}
    law = {"surface": "sand", "ground": "spring-damper", "actuator": "motor", "law_spread": {"parameters": ["damping"]}}
    return {"experiment": "tumble", "quantities": numbers, "trial": trial, **law, **more}


def rows_of(result):
    """Label, value and three errors of each row."""
    return {row[0]: row[1:-1] for row in answer(tumble_tiles(result), result)[0].rows}


def test_a_tumble_on_a_law_states_chance_the_parameters_of_the_law_and_the_known_bias():
    rows = rows_of(tumble_result())
    assert rows["Trajectory angle"] == ("10°", "none", "18°", "+28° (grains)")  # 1.96 x 9.1
    assert [cell.replace("\N{NO-BREAK SPACE}", " ") for cell in rows["Largest speed"]] == [
        "0.159 m/s", "none", "0.014 m/s", "not validated",
    ]  # fmt: skip
    assert rows[label_of("transition_angle_slip")][2] == "0°", "no parameter changes it"
    assert rows[label_of("transition_angle_hop")][2] == "not known", "on some of the moved laws it does not hop"
    assert rows["Largest sinkage"] == ("none", "–", "–", "–")


def test_errors_of_a_law_are_halves_of_95_per_cent_intervals_in_table_head_note_and_sentence():
    """1.96 standard deviations: the table, the sentence below it, and no word of one standard deviation."""
    result = tumble_result()
    numbers, note = answer(tumble_tiles(result), result)
    entries = {"surface": "sand", "law": "", "parameters": ["stiffness"]}
    _, sentence = spread_entries(result["quantities"], {"trajectory_angle": "angle"}, **entries)
    assert "18°" in sentence and "95 %" in sentence
    assert "95\N{NO-BREAK SPACE}%" in numbers.head[3] and "95 %" in note.text
    assert not [words for words in (sentence, note.text, *numbers.head) if "deviation" in words]


def test_what_slips_and_hops_has_one_name_in_answer_table_sweep_and_paper():
    for name in ("transition_angle_slip", "transition_angle_hop"):
        label = label_of(name)
        assert label in rows_of(tumble_result())
        assert label in [row[0] for row in beside_rows({}, {})]
        assert f"{label} [degrees]" in CASE_HEAD


def test_a_law_whose_parameters_have_no_error_says_that_it_is_not_known():
    result = tumble_result(law_spread={"parameters": []})
    result["quantities"]["transition_angle_hop"]["std"] = 0.0
    rows = rows_of(result)
    assert [rows[label_of(f"transition_angle_{one}")][2] for one in ("slip", "hop")] == ["not known"] * 2


@pytest.mark.parametrize(
    ("more", "cell"),
    [
        ({"surface": "steel"}, "+20 to +40° (paper)"),
        ({"surface": "steel", "effects": [{"id": "torque-rise"}]}, "not validated"),
        ({"surface": "steel", "actuator": "brake"}, "+16° (paper)"),
        ({"surface": "brick"}, "not validated"),
        ({"trial": {"torque": {"value": 0.125}, "gravity_sim": {"value": 0.0833565}}}, "not validated"),
        ({"ground": "rft"}, "not validated"),
    ],
)
def test_a_bias_is_stated_of_the_trials_that_it_was_found_in(more, cell):
    assert rows_of(tumble_result(**more))["Trajectory angle"][3] == cell


def tumble_on_grains(**more):
    """The result of one bed, without spread."""
    result = tumble_result(ground="bed", grains={}, law_spread=None, duration=1.1, **more)
    result["trial"] = {"stiffness": {"value": 77.8}} | result["trial"]
    result["quantities"] |= {
        "trajectory_angle": {"value": math.radians(-18), "std": None, "unit": "rad"},
        "sinkage_largest": {"value": 0.019, "std": None, "unit": "m"},
        "max_speed": {"value": 0.159, "std": None, "unit": "m/s"},
    }
    return result


@pytest.mark.parametrize(
    ("more", "angle", "sinkage"),
    [
        (
            {},
            ("3 to 4° (other beds; 4 mm grains: 7°)", "+21 ± 17° (real grains)", "+4 ± 16° (spikes 153 mm apart)"),
            ("20 % (other beds)", "−9 ± 6 mm (real grains)", "not known"),
        ),
        (
            {"surface": "sand-weak"},
            ("3 to 4° (other beds; 4 mm grains: 7°)", "not known", "not known"),
            ("20 % (other beds)", "not known", "not known"),
        ),
        (
            {"trial": tumble_result()["trial"] | {"stiffness": {"value": 82.2}}},  # `sand` of before 2026-11-26
            ("3 to 4° (other beds; 4 mm grains: 7°)", "not known", "not known"),
            ("20 % (other beds)", "not known", "not known"),
        ),
        ({"surface": "jsc1a"}, ("not known",) * 3, ("not known",) * 3),
        ({"effects": [{"id": "ploughing"}]}, ("not known",) * 3, ("not known",) * 3),
    ],
)
def test_a_tumble_on_one_bed_states_the_errors_that_limits_have_of_its_trial(more, angle, sinkage):
    result = tumble_on_grains(**more)
    rows = {label: tuple(map(foldable, cells)) for label, cells in rows_of(result).items()}
    assert (rows["Trajectory angle"][1:], rows["Largest sinkage"][1:]) == (angle, sinkage)
    assert rows["Largest speed"][1:] == ("not known",) * 3
    assert "docs/limits.md" in answer(tumble_tiles(result), result)[1].text


def test_the_mean_over_beds_of_a_tumble_keeps_its_own_chance_and_a_missing_number_has_none():
    result = tumble_on_grains()
    result["quantities"]["trajectory_angle"]["std"] = math.radians(2.0)
    result["quantities"]["sinkage_largest"]["value"] = None
    rows = rows_of(result)
    assert rows["Trajectory angle"][:2] == ("−18.0°", "2.0°") and rows["Trajectory angle"][2].startswith("+21")
    assert rows["Largest sinkage"] == ("none", "–", "–", "–")


def test_the_terminal_of_a_tumble_has_the_rows_and_the_note_of_its_report():
    result = tumble_result(departures={"sentences": ["a", "b", "c"]}, tables=[{"title": "t", "head": [], "rows": []}])
    shown = headline_of(EXPERIMENTS["tumble"], result)
    numbers, note = answer(tumble_tiles(result), result)
    assert [len(row) for row in shown.rows] == [5] * len(numbers.rows) and shown.head == numbers.head[:-1]
    assert [row[:2] for row in shown.rows] == [
        tuple(cell.replace("\N{NO-BREAK SPACE}", " ") for cell in row[:2]) for row in numbers.rows
    ]
    assert shown.notes == (note.text,) and shown.sentences == ("a", "b", "c") and len(shown.tables) == 1


@pytest.mark.parametrize("name", [name for name, one in EXPERIMENTS.items() if one.answer])
def test_every_answer_in_the_registry_is_there(name):
    module, _, function = EXPERIMENTS[name].answer.partition(":")
    assert callable(getattr(import_module(module), function)) and not EXPERIMENTS[name].headline


KEPT = Path(__file__).parents[2] / "docs" / "results"
ANSWERED = (
    "validate", "diagnose-grains", "diagnose-tumbles-grains-3mm", "bed-make-jsc-1a-dense", "bed-test-repose",
    "bed-test-cone", "bed-test-plates", "bed-test-cut-jsc-1a-loose", "bed-test-shear-sand-dense", "calibrate-sand",
    "calibrate-jsc-1a-loose", "converge-flagship",
)  # fmt: skip


@pytest.mark.parametrize("name", ANSWERED)
def test_a_terminal_ends_with_words_and_not_with_keys(name):
    """Every kept result that is no motion: at most six rows of its page, none of which is a key of result.json."""
    result = read_result(KEPT / name / "result.json")
    shown = headline_of(EXPERIMENTS[result["experiment"]], result)
    assert 0 < len(shown.rows) <= MOST_ROWS and shown.more == bool(result.get("tables"))
    for row in shown.rows:
        assert row[0][0].isupper() and not any("_" in cell for cell in row)
    assert shown.sentences[: len(result.get("summary", []))] == tuple(result.get("summary", []))


def test_errors_that_no_row_of_a_bed_knows_are_named_below_the_table():
    result = read_result(KEPT / "bed-test-repose" / "result.json")
    shown = headline_of(EXPERIMENTS["bed test repose"], result)
    assert shown.rows[0] == ("Angle of repose", "31°", "4°")  # 4.303 x 1.515 / sqrt(3)
    assert len(shown.head) == 3 and shown.head[2].endswith("(95\N{NO-BREAK SPACE}%)")
    assert all(name in shown.notes[0] for name in ("grain size", "softness"))


def test_a_fitted_number_has_its_interval_or_why_it_has_none():
    result = read_result(KEPT / "diagnose-grains" / "result.json")
    shown = headline_of(EXPERIMENTS["diagnose"], result)
    rows = {row[0]: row[1:] for row in shown.rows}
    assert shown.head[2].endswith("(95\N{NO-BREAK SPACE}%)")
    assert rows["Crater share (plastic-sinkage)"] == ("0.96", "0.04")  # 1.96 standard errors of 0.0195
    assert rows["Crater bend (plastic-sinkage)"] == ("2.50", "end of range")
    assert rows["Stiffness"] == ("39 N/m", "4 N/m")


def test_a_comparison_has_both_numbers_their_spreads_and_the_difference():
    row = {"unit": "rad", "first": math.radians(10), "second": math.radians(-17), "difference": math.radians(-27)}
    compared = [
        row | {"name": "trajectory_angle", "relative": None, "first_half": math.radians(9), "second_half": None},
        {"name": "max_speed", "unit": "m/s", "first": 0.1, "second": 0.2, "difference": 0.1, "relative": 1.0},
    ]
    result = {"experiment": "compare", "compared": compared, "quantities": {"compared": {"value": 2}}}
    shown = headline_of(EXPERIMENTS["compare"], result)
    assert [head.replace("\N{NO-BREAK SPACE}", " ") for head in shown.head[1:]] == [
        "first | second",
        "± (95 %)",
        "difference",
    ]
    assert shown.rows[0] == ("Trajectory angle", "10° | −17°", "9° | –", "−27°")
    assert [cell.split() for cell in shown.rows[1][1:]] == [
        ["0.1", "m/s", "|", "0.2", "m/s"],
        ["–"],
        ["+0.1", "m/s", "(+100", "%)"],
    ]


@pytest.mark.parametrize(("feet", "third"), [(1, "Longest flight"), (2, "Clearance")])
def test_a_robot_that_stays_on_the_ground_has_no_rise_but_that_from_its_lowest_point(feet, third):
    reached = {f"foot{k}": {"clearance_largest": 0.004} for k in range(feet)}
    result = robot_result(ground="rft", hop=False, start_height=0.008, feet_reached=reached)
    result["quantities"]["highest"]["value"] = -0.0076
    result["quantities"]["rise_from_lowest"] = {"value": 0.099, "std": None, "unit": "m"}
    tiles = answer_tiles(result)
    assert [tile.label.partition(" from")[0] for tile in tiles[:3]] == ["Rise", "Rise", third]
    assert tiles[0].value == "none" and tiles[1].value.startswith("99")
    assert not any("start" in block.text for block in answer(tiles, result) if block.text)


def test_a_rise_that_ends_on_the_way_up_is_labelled():
    labels = [tile.label for tile in answer_tiles(robot_result(ground="rft", rising=True))]
    assert labels[0] == "Rise, so far" and "Sinkage" in labels
