"""The skeleton of an experiment: what a resumed run is carried out with."""

import pytest

from experiments.runs.folder import RunFolder
from experiments.runs.whole_runs import whole_run
from experiments.tumble.settings import TumbleSettings


@pytest.mark.parametrize("given", [{"duration": 3.0}, {}, {"duration": 1.1}, {"sleep": True, "seed": 4}])
def test_a_run_is_resumed_with_the_settings_it_was_begun_with(given, tmp_path):
    """On grains a tumble lasts 1.1 s if nothing is given; 3 s, the default on a law, were given all the same."""
    begun = TumbleSettings(ground="bed", rig=0.0085, **given)
    RunFolder.create(tmp_path / "run", "tumble", begun)
    found = []
    _, resume = whole_run("tumble", TumbleSettings, lambda settings, *_: found.append(settings), check=lambda _: None)
    resume(tmp_path / "run")
    assert dict(found[0]) == dict(begun)
