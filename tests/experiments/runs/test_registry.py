"""What every experiment owes the command line: described settings with units, cases that are valid."""

import inspect
import subprocess
import sys
from importlib import import_module
from typing import get_args

import pytest

from experiments.runs import registry
from experiments.runs.reading import Layer, read_case, settings_from
from experiments.runs.registry import EXPERIMENTS, find_experiment

ALL = pytest.mark.parametrize("experiment", EXPERIMENTS.values(), ids=lambda experiment: experiment.name)

# A subject (the campaign that is diagnosed) has no default, so no case of it can ship; nor has what a case asks for.
WITHOUT_SUBJECT = pytest.mark.parametrize(
    "experiment",
    [one for one in EXPERIMENTS.values() if not (one.subject or one.example)],
    ids=lambda experiment: experiment.name,
)


@ALL
def test_settings_are_frozen_closed_and_described(experiment):
    settings_class = experiment.settings_class()
    assert settings_class.model_config["frozen"] is True
    assert settings_class.model_config["extra"] == "forbid"
    for name, field in settings_class.model_fields.items():
        assert field.description, f"{name} has no description"
        kinds = {field.annotation, *get_args(field.annotation)}
        if float in kinds:
            assert "[" in field.description, f"{name} has no unit in its description: {field.description}"


@WITHOUT_SUBJECT
def test_the_defaults_are_valid(experiment):
    settings_from(experiment.settings_class(), [])


@pytest.mark.parametrize("experiment", [one for one in EXPERIMENTS.values() if one.subject], ids=lambda one: one.name)
def test_a_subject_must_be_named(experiment):
    with pytest.raises(ValueError, match=experiment.subject):
        settings_from(experiment.settings_class(), [])
    several = {"compare": ("somewhere", "else"), "calibrate": ("somewhere",)}
    named = {experiment.subject: several.get(experiment.name, "somewhere")}
    if experiment.name == "mujoco":
        named["feet"] = ("foot",)
    settings_from(experiment.settings_class(), [Layer(None, named)])


@pytest.mark.parametrize("experiment", [one for one in EXPERIMENTS.values() if one.example], ids=lambda one: one.name)
def test_what_a_case_must_ask_for_has_an_example_that_ships(experiment):
    with pytest.raises(ValueError, match=r"as .* = "):
        settings_from(experiment.settings_class(), [])
    settings_from(experiment.settings_class(), [read_case(registry.CASES / experiment.example)])


@ALL
def test_the_presets_ship_and_are_valid(experiment):
    for preset in experiment.presets:
        settings_from(experiment.settings_class(), [read_case(registry.CASES / preset.case)])


@WITHOUT_SUBJECT
def test_the_case_that_ships_is_what_one_gets_without_a_case(experiment):
    settings_class = experiment.settings_class()
    shipped = settings_from(settings_class, [read_case(registry.CASES / f"{experiment.name.replace(' ', '-')}.toml")])
    assert shipped == settings_from(settings_class, [])


def test_every_case_that_ships_is_of_some_experiment():
    for path in registry.CASES.glob("*.toml"):
        case = read_case(path)
        names = [set(experiment.settings_class().model_fields) for experiment in EXPERIMENTS.values()]
        assert any(set(case.values) <= fields for fields in names), path.name


def test_an_experiment_there_is_not_is_refused_by_name():
    with pytest.raises(ValueError, match=r"'dig'.*penetrate"):
        find_experiment("dig")


PACKAGES = {
    "penetrate": "penetrate",
    "tumble": "tumble",
    "spatial": "tumble spatial",
    "hop": "hop",
    "paper": "paper",
    "bed": "bed make",
    "calibrate": "bed calibrate",
    "compare": "compare",
    "diagnose": "diagnose",
    "campaign": "campaign",
}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_offers_its_settings_and_its_run(package):
    module, experiment = import_module(f"experiments.{package}"), EXPERIMENTS[PACKAGES[package]]
    assert {"Settings", "check", "resume", "run"} <= set(module.__all__)
    assert module.Settings is experiment.settings_class()
    assert list(inspect.signature(module.run).parameters)[:2] == ["settings", "folder"]
    assert next(iter(inspect.signature(module.resume).parameters)) == "folder" and callable(module.check)
    with pytest.raises(AttributeError, match="no attribute 'runn'"):
        module.runn


def test_the_packages_load_no_taichi_before_they_are_used():
    names = ", ".join(PACKAGES)
    code = f"from experiments import {names}; import sys; print('taichi' in sys.modules or 'matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
