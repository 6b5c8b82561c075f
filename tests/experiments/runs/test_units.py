"""Settings with a unit behind the number, as options, in case files and from Python."""

import math
import tomllib
from pathlib import Path

import pytest
from pydantic import ValidationError

from experiments.bed.settings import BedSettings
from experiments.cli.main import main
from experiments.hop.settings import HopSettings
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.registry import EXPERIMENTS
from experiments.runs.strict import plain_kinds
from experiments.runs.units import find_unit, has_unit, in_both
from experiments.spatial.settings import SpatialSettings
from experiments.tumble.campaign_settings import CampaignSettings
from experiments.tumble.settings import TumbleSettings

G = 9.80665


@pytest.mark.parametrize(
    ("text", "stated", "number"),
    [
        ("1e-3g", "[m/s2]", 1e-3 * G),
        ("0.0098m/s2", "[m/s2]", 0.0098),
        ("0.0098 m/s^2", "[m/s2]", 0.0098),
        ("8.5mg", "[9.80665 m/s2]", 0.0085),
        ("0.0085 g", "[9.80665 m/s2]", 0.0085),
        ("9.80665 m/s2", "[9.80665 m/s2]", 1.0),
        ("100 ug", "[m/s2]", 1e-4 * G),
        ("16mm", "[m]", 0.016),
        ("100g", "[kg]", 0.1),
        ("5 mN", "[N]", 0.005),
        ("+2ms", "[s]", 0.002),
        ("1.5h", "[s]", 5400.0),
    ],
)
def test_a_number_is_read_in_the_unit_behind_it(text, stated, number):
    unit = find_unit(f"Something {stated}, of a setting.")
    assert unit is not None
    assert unit.value_of(text) == pytest.approx(number, rel=1e-15)


@pytest.mark.parametrize("text", ["1e-3", "-2E+05", "1e3", ".5", "7.", "1e-30"])
def test_a_plain_number_has_no_unit(text):
    assert not has_unit(text)
    assert has_unit(f"{text}g")


def test_a_rig_in_g_is_the_same_number_to_the_last_bit():
    assert TumbleSettings(rig="0.0085g") == TumbleSettings(rig=0.0085)


@pytest.mark.parametrize("text", ["0.1", "1e-3", "g", "fast", "1e-3 parsec", "1e-3kg", "nang", "1e-3g.", "--1g", ""])
def test_what_has_no_unit_of_the_kind_is_refused_by_name(text):
    unit = find_unit("Gravity [m/s2].")
    assert unit is not None
    with pytest.raises(ValueError, match=r"is not a valid number|acceleration in m/s2"):
        unit.value_of(text)
    with pytest.raises(ValidationError, match="gravity"):
        PenetrateSettings(gravity=text)


@pytest.mark.parametrize("bad", ["nan g", "inf g", "-1g", "0g"])
def test_bounds_hold_for_numbers_with_a_unit(bad):
    with pytest.raises(ValidationError, match="gravity"):
        HopSettings(gravity=bad)


@pytest.mark.parametrize(
    ("settings_class", "key"),
    [
        (PenetrateSettings, "gravity"), (PenetrateSettings, "rig"), (TumbleSettings, "gravity"),
        (TumbleSettings, "rig"), (TumbleSettings, "settle_gravity"), (SpatialSettings, "gravity"),
        (SpatialSettings, "rig"), (HopSettings, "gravity"), (BedSettings, "gravity"), (CampaignSettings, "gravity"),
        (CampaignSettings, "rig"),
    ],
)  # fmt: skip
def test_every_gravity_and_rig_takes_g_and_metres_a_second_squared(settings_class, key):
    unit = find_unit(settings_class.model_fields[key].description)
    assert unit is not None
    assert unit.kind == "acceleration"
    assert unit.value_of("1e-3g") * unit.factor == pytest.approx(1e-3 * G)


def test_every_setting_called_gravity_or_rig_states_its_unit():
    for experiment in EXPERIMENTS.values():
        for name, field in experiment.settings_class().model_fields.items():
            if name in ("gravity", "rig") and float in plain_kinds(field.annotation):
                assert find_unit(field.description) is not None, (experiment.name, name)


def test_several_numbers_may_have_several_units():
    settings = CampaignSettings(rig=["8.5mg", 0.015, "0.2 m/s2"])
    assert settings.rig == pytest.approx((0.0085, 0.015, 0.2 / G))


def test_what_a_bare_number_means_is_told_in_both_units():
    (line,) = in_both("gravity", 0.0098, find_unit("Gravity [m/s2]."))
    assert "0.0098 m/s2" in line
    assert f"{0.0098 / G:.4g} g" in line
    (line,) = in_both("rig", 0.0085, find_unit("g_sim [9.80665 m/s2]."))
    assert f"{0.0085 * G:.4g} m/s2" in line
    assert not list(in_both("load", 0.5, find_unit("Load [N].")))


@pytest.mark.parametrize("how", ["option", "case"])
def test_a_tumble_takes_a_gravity_in_g_and_answers_in_both_units(how, tmp_path, monkeypatch, capsys, unreported):
    Path("case.toml").write_text('gravity = "1e-2g"\nduration = "50ms"\n')
    given = ["--gravity", "1e-2g", "--duration", "50ms"] if how == "option" else ["case.toml"]
    assert main(["tumble", *given, "--out", "a"]) == 0
    table = tomllib.loads(Path("a/run.toml").read_text())["settings"]
    assert math.isclose(table["gravity"], 1e-2 * G)
    assert table["duration"] == 0.05
    told = [line for line in capsys.readouterr().err.splitlines() if "0.01 g" in line]
    assert len(told) == 1
