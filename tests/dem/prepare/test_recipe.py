"""Stages of a preparation: written and read alike; an order or a number that cannot be is refused by name."""

import pytest

from dem import LogNormal, Uniform
from dem.prepare.recipe import Stage, check_packing, check_stages, parse_stage

WRITTEN = ["rain", "level", "level:0.03", "fluff", "fluff:1.6", "compact:0.61", "compact:0.58@lid", "compact:densest"]
WRITTEN += ["packing:0.57", "cut:0.02", "tilt:20", "rain:dry", "rain:0.2", "stick"]
BED = {"size": (0.1, 0.1, 0.04), "grain": 0.004, "sizes": Uniform(0.004), "cohesive": False}


@pytest.mark.parametrize("words", WRITTEN)
def test_a_stage_is_written_as_it_is_read(words):
    assert str(parse_stage(words)) == words


def test_what_stands_behind_the_colon_is_the_stage_s_number():
    assert parse_stage("compact:0.58@lid") == Stage("compact", 0.58, "lid")
    assert parse_stage("compact:densest") == Stage("compact", None)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("rian", "'rian' is no stage; did you mean 'rain'"),
        ("shake", "'shake' is no stage; there is rain, stick"),
        ("compact", r"'compact' needs a number, for example compact:0.6"),
        ("compact:0.6@hand", "by 'tap' or 'lid', not by 'hand'"),
        ("compact:densest@lid", "a lid takes a packing fraction"),
        ("tilt:steep", "'steep' is no number"),
        ("cut:-0.01", "-0.01 must be positive"),
        ("rain:wet", "'wet' is no number; 'dry', or a friction,"),
        ("stick:2", "'stick' takes no number"),
    ],
)
def test_words_that_are_no_stage_are_refused(words, said):
    with pytest.raises(ValueError, match=said):
        parse_stage(words)


@pytest.mark.parametrize(
    ("stages", "said"),
    [
        ([], "stages is empty: give 'rain'"),
        (["level"], "begins with 'level'"),
        (["rain", "level", "rain"], "'rain' comes once"),
        (["rain", "tilt:10", "compact:0.6"], "'compact:0.6' after 'tilt:10' would undo it"),
        (["rain", "compact:0.7"], r"packing = 0\.7 .* more than 0\.5 and at most 0\.64"),
        (["rain", "packing:0.45"], r"packing = 0\.45 .* grains that stick \(cohesion\) make looser beds"),
        (["rain", "level:0.01"], r"from 0\.016 m, four grains"),
        (["rain", "fluff:3"], "1.02 to 2 times"),
        (["rain", "cut:0.09"], r"width less six grains, 0\.076 m"),
        (["rain", "tilt:95"], "less than 90"),
        (["rain:dry", "stick"], "'rain:dry': these grains do not stick anyway"),
        (["rain:0.2", "level"], r"'rain:0.2' needs 'stick' once behind it \(0 found\)"),
        (["rain", "stick"], "'stick' is for what was poured without"),
        (["rain:0.2", "cut:0.02", "stick"], "'stick' after 'cut:0.02' would undo it"),
    ],
)
def test_stages_that_cannot_be_are_refused_before_any_work(stages, said):
    with pytest.raises(ValueError, match=said):
        check_stages([parse_stage(stage) for stage in stages], **BED)


def test_what_packing_there_can_be_depends_on_cohesion_and_on_sizes():
    check_packing(0.3, Uniform(0.004), cohesive=True)
    check_packing(0.68, LogNormal(0.004, 0.4), cohesive=False)
    with pytest.raises(ValueError, match=r"packing = 0\.68"):
        check_packing(0.68, Uniform(0.004, 0.15), cohesive=True)
