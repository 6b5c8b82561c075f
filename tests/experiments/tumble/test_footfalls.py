"""Rows of spikes that come down one after the other: found in the record, and judged over beds."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from golden import golden
from scipy.stats import linregress

from experiments.suite import commands as suite_commands
from experiments.suite.cases import cases
from experiments.tumble.footfalls import Footfall, find_footfalls, sinking_over


def _falls(depths: list[float], **changed: bool) -> list[Footfall]:
    return [
        Footfall(k % 8, float(k), depth, 1.0, **({"set_down": False, "open": False} | changed))
        for k, depth in enumerate(depths)
    ]


def test_rows_are_found_in_the_order_in_which_they_touch_and_a_graze_is_none():
    time = np.linspace(0.0, 4.0, 401)
    sinkage = np.column_stack([
        np.where(time < 0.5, 3e-3, 0.0),  # set down by the hand
        0.02 * np.sin(np.pi * (time - 2.0).clip(0.0, 1.0)),
        np.where((time > 1.0) & (time < 1.5), 0.015, -0.01),
        np.where((time > 1.0) & (time < 1.1), 0.5e-3, 0.0),  # a graze
        0.01 * (time - 3.5).clip(0.0),  # still going down
    ])  # fmt: skip
    load = np.where(sinkage > 0, 2.0, 0.0)
    found = find_footfalls(time, sinkage, load)
    assert [fall.row for fall in found] == [0, 2, 1, 4]
    assert [fall.deepest for fall in found] == pytest.approx([3e-3, 0.015, 0.02, 5e-3])
    assert [fall.set_down for fall in found] == [True, False, False, False]
    assert [fall.open for fall in found] == [False, False, False, True]
    assert found[1].time == pytest.approx(1.0, abs=0.02) and {fall.load for fall in found} == {2.0}


def test_of_one_bed_slope_and_error_are_those_of_a_line_through_its_depths():
    depths = [0.021, 0.024, 0.022, 0.0255, 0.023, 0.026]
    found, line = sinking_over([_falls(depths)]), linregress(np.arange(6), depths)
    assert found is not None and (found.slope, found.error) == pytest.approx((line.slope, line.stderr))


def test_a_bed_that_is_softer_throughout_is_not_taken_for_sinking_on():
    firm, soft = [0.020, 0.021, 0.020, 0.021, 0.020], [0.030, 0.031, 0.030, 0.031, 0.030]
    found = sinking_over([_falls(firm), _falls(soft)])
    assert found is not None and found.slope == pytest.approx(0.0, abs=1e-12) and found.beds == 2
    assert found.low < 0 < found.high
    golden("tumble/not_sinking", found.verdict)


@pytest.mark.parametrize(
    ("step", "words"),
    [(1e-3, "increases from tumble to tumble: +1.0"), (-1e-3, "sinkage decreases")],
)
def test_rows_that_go_deeper_or_less_deep_each_time_are_said_to(step: float, words: str):
    noise = 1e-4 * np.random.default_rng(1).standard_normal((3, 8))
    found = sinking_over([_falls(list(0.03 + step * np.arange(8) + own)) for own in noise])
    assert found is not None and words in found.verdict
    assert found.low < step < found.high


def test_what_a_hand_set_down_and_what_still_sinks_do_not_count():
    assert sinking_over([_falls([1e-3, 0.02, 0.03, 0.04], set_down=True)]) is None
    assert sinking_over([_falls([1e-3, 0.02, 0.03, 0.04], open=True)]) is None
    assert sinking_over([_falls([0.02, 0.02])]) is None  # a line through two points has no error


def test_the_command_says_each_bed_and_one_verdict_for_all_seeds(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for case in cases(["grains3-row"]):
        (tmp_path / case.name).mkdir()
        falls = _falls([0.02, 0.021, 0.0205, 0.0212, 0.0203])
        (tmp_path / case.name / "result.json").write_text(json.dumps({"footfalls": [asdict(fall) for fall in falls]}))
    assert suite_commands._sinking(("grains3",), results=tmp_path) == 0
    said = capsys.readouterr().out
    assert said.count("grains3-row-seed") == 3
    golden("tumble/sinking_of_seeds", said)
    assert suite_commands._sinking(("grains1",), results=tmp_path) == 1
