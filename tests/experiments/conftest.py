"""Registers the stand-in experiment; where runs go, and that they draw no report; one engine for small beds."""

import sys
from pathlib import Path
from types import ModuleType

import dig_experiment
import pytest
from engine_pool import roomy_engines

from experiments.runs import registry
from experiments.runs.folder import RunFolder

__all__ = ["dig", "reported", "roomy_engines", "unreported"]


@pytest.fixture
def reported():
    """The report is drawn."""


@pytest.fixture
def unreported(tmp_path, monkeypatch, request):
    """Runs go to `tmp_path`; only what asks for it with ``reported`` draws a report."""
    monkeypatch.chdir(tmp_path)
    if "reported" not in request.fixturenames:
        monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)


@pytest.fixture
def dig(monkeypatch, tmp_path):
    """Register the experiment ``dig``; its cases are in `tmp_path`/cases, where deep.toml is one. Go to `tmp_path`."""
    settings, module = ModuleType("dig_settings"), ModuleType("dig_module")
    settings.DigSettings = dig_experiment.DigSettings
    module.run = lambda settings, folder, *, progress: dig_experiment.dig(settings, folder, progress)
    module.resume = lambda folder, *, progress: dig_experiment.dig(
        dig_experiment.DigSettings(**RunFolder.open(folder).settings), Path(folder), progress
    )
    monkeypatch.setitem(sys.modules, "dig_settings", settings)
    monkeypatch.setitem(sys.modules, "dig_module", module)
    experiment = registry.Experiment(
        "dig",
        "Digs a hole.",
        settings="dig_settings:DigSettings",
        module="dig_module",
        presets=(registry.Preset("full", "deep.toml", "Deeper."),),
    )
    monkeypatch.setattr(registry, "EXPERIMENTS", {"dig": experiment})
    (tmp_path / "cases").mkdir()
    (tmp_path / "cases" / "deep.toml").write_text("deep = true\nsteps = 7\n")
    monkeypatch.setattr(registry, "CASES", tmp_path / "cases")
    monkeypatch.chdir(tmp_path)
    return module
