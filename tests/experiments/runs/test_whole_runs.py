"""The skeleton of an experiment: what a resumed run is carried out with."""

import pytest

from experiments.runs.folder import RunFolder, write_text
from experiments.runs.whole_runs import whole_run
from experiments.tumble.settings import TumbleSettings
from rigid.digests import kept_digests


def test_a_finished_run_that_is_carried_out_again_has_the_digests_of_its_new_files(tmp_path):
    """Also one that a script resumes, whose numbers are others because the code is."""
    folder, texts = RunFolder.create(tmp_path / "run", "tumble", TumbleSettings()), iter("12")

    def carry_out(settings, folder, progress):
        write_text(folder.path / "ground.toml", f"stiffness = {next(texts)}")
        folder.write_result({"quantities": {}})

    run, resume = whole_run("tumble", TumbleSettings, carry_out, check=lambda _: None)
    run(TumbleSettings(), folder.path)
    assert set(kept_digests(folder.path)) == {"run.toml"}  # the command line says when it is done
    folder.set_status("done")
    resume(folder.path)
    folder.read_result()
    assert set(kept_digests(folder.path)) == {"run.toml", "result.json", "ground.toml"}


@pytest.mark.parametrize("given", [{"duration": 3.0}, {}, {"duration": 1.1}, {"sleep": True, "seed": 4}])
def test_a_run_is_resumed_with_the_settings_it_was_begun_with(given, tmp_path):
    """On grains a tumble lasts 1.1 s if nothing is given; 3 s, the default on a law, were given all the same."""
    begun = TumbleSettings(ground="bed", rig=0.0085, **given)
    RunFolder.create(tmp_path / "run", "tumble", begun)
    found = []
    _, resume = whole_run("tumble", TumbleSettings, lambda settings, *_: found.append(settings), check=lambda _: None)
    resume(tmp_path / "run")
    assert dict(found[0]) == dict(begun)
