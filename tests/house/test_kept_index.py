"""The list of kept runs is the one that docs/results/index.py makes, and the folders have short pages."""

import runpy
import shutil

import pytest
from import_graph import ROOT

FOLDER = ROOT / "docs" / "results"
PICTURES = runpy.run_path(str(FOLDER / "pictures.py"))
MODULE = runpy.run_path(str(FOLDER / "index.py"))


def test_the_list_of_kept_runs_is_made_from_the_folders_of_today():
    made = MODULE["index_of"](FOLDER)
    assert (FOLDER / "README.md").read_text(encoding="utf-8") == made, "python docs/results/index.py"
    assert made.count("\n| [") == sum(path.is_dir() and path.name[0] not in "._" for path in FOLDER.iterdir())


def test_a_page_of_a_kept_folder_has_at_most_200_words():
    long = {path for path in FOLDER.rglob("*/README.md") if len(path.read_text(encoding="utf-8").split()) > 200}
    assert long == set()


def test_a_line_follows_the_files_of_a_folder(tmp_path):
    def cells():
        return MODULE["index_of"](tmp_path).splitlines()[-1].strip("| ").split(" | ")

    shutil.copytree(FOLDER / "converge-flagship", tmp_path / "run")
    assert cells()[:3] == ["[run](run)", "`hedgebed converge`", "2026-11-26"]
    result = tmp_path / "run/result.json"
    result.write_text(result.read_text(encoding="utf-8").replace("A 12 mm ball", "A ball of 12 mm", 1))
    shown = "A ball of 12 mm tip in sand, with its errors; `stiffness` 38.9 ± 40 N/m"
    assert cells()[3] == shown
    (tmp_path / "run/README.md").write_text("# Two pushes\n\nCommand: `make a|b`\n\nDate: 2026-11-27\n")
    assert cells() == ["[run](run/README.md)", "`make a\\|b`", "2026-11-27", "Two pushes"]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("README.md", "# Two pushes\n", "README.md: a line"),
        ("run.toml", "x = 1\n", "run.toml: the key"),
        ("run.toml", "x =", "run.toml: cannot be read"),
        ("other.csv", "", "run.toml: cannot be read"),
    ],
)
def test_a_folder_that_states_no_command_is_named(tmp_path, capsys, name, text, said):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / name).write_text(text)
    assert MODULE["main"](tmp_path) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "README.md").exists()


def test_it_is_stated_how_each_picture_is_made_and_what_that_needs_is_there():
    entries = PICTURES["entries"]()
    names = [name for entry in entries for name in entry["names"]]
    assert sorted(names) == sorted(path.stem for path in (ROOT / "docs" / "images").glob("*.png"))
    for entry in entries:
        assert all((FOLDER / kept / "result.json").exists() for kept in entry.get("kept", []))
        assert not {"kept", "command"} & set(entry) or len(entry["figures"]) == len(entry["names"])


def test_a_picture_is_drawn_from_a_kept_result_and_one_of_a_long_run_is_refused(tmp_path, capsys):
    assert PICTURES["main"](["diagnose-grains-gap", "--out", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["diagnose-grains-gap.png"]
    with pytest.raises(SystemExit):
        PICTURES["main"](["tumble-on-sand", "--out", str(tmp_path)])
    assert "not kept" in capsys.readouterr().err
