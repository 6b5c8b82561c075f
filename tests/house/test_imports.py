"""Imports of ours point one way: between the folders at the top, between packages, between files."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from import_graph import FOLDERS, ROOT, circle, folder_of, graph_of, imported, modules

MAY_IMPORT = {
    "dem": {"dem"},
    "rigid": {"rigid"},
    "coupling": {"coupling", "dem", "rigid"},
    "experiments": {"experiments", "coupling", "dem", "rigid", "vis"},
    "vis": {"vis", "rigid"},
}
"""And all of them `hedgebed_renamed` and `hedgebed_taichi`, which import nothing of ours."""
MOST_FILES = 20
"""In one folder."""


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_folder_at_the_top_imports_only_what_it_may(folder):
    known = modules()
    wrong = {
        name: sorted(beyond)
        for name, path in known.items()
        if name.split(".")[0] == folder
        and (beyond := {module.split(".")[0] for module in imported(name, path, known)} - MAY_IMPORT[folder])
    }
    assert not wrong


def test_no_files_import_one_another_in_a_circle():
    assert circle(graph_of()) == []


def test_no_packages_import_one_another_in_a_circle():
    known, packages = modules(), {}
    for name, targets in graph_of().items():
        package = folder_of(name, known)
        packages.setdefault(package, set()).update(folder_of(target, known) for target in targets)
        packages[package].discard(package)
    assert circle(packages) == []


def test_one_module_alone_imports_taichi_or_its_fork():
    files = [*modules().values(), *ROOT.glob("*.py"), *(ROOT / "tests").rglob("*.py"), *ROOT.glob("examples/*.py")]
    importing = re.compile(r"^\s*(?:import|from) (?:taichi|quadrants)\b|import_module\(.(?:taichi|quadrants)\b", re.M)
    found = [path.relative_to(ROOT) for path in files if importing.search(path.read_text(encoding="utf-8"))]
    assert found == [Path("hedgebed_taichi.py")]


def test_a_folder_has_no_more_files_than_one_can_look_through():
    folders: dict[Path, int] = {}
    for path in [*modules().values(), *(ROOT / "tests").rglob("*.py")]:
        folders[path.parent] = folders.get(path.parent, 0) + 1
    assert {str(folder.relative_to(ROOT)): count for folder, count in folders.items() if count > MOST_FILES} == {}


def test_the_walk_sees_imports_inside_functions_for_type_checkers_and_by_name(tmp_path):
    (tmp_path / "vis").mkdir()
    for name, text in {
        "one": "def f():\n    from . import two\n    import_module('rigid.platform.spike')\n",
        "two": "if TYPE_CHECKING:\n    from .one import f\nfrom dem.bed import Bed\n",
        "__init__": "",
    }.items():
        (tmp_path / "vis" / f"{name}.py").write_text(text, encoding="utf-8")
    known = modules(tmp_path)
    assert imported("vis.one", known["vis.one"], known) == {"vis.two", "rigid.platform.spike"}
    assert imported("vis.two", known["vis.two"], known) == {"vis.one", "dem.bed"}
    assert set(circle(graph_of(tmp_path))) == {"vis.one", "vis.two"}


def test_a_bed_is_there_without_scipy_which_is_slow_to_import():
    code = "import sys\nimport dem\ndem.Bed\nassert 'scipy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_the_functions_of_an_experiment_are_there_without_what_computes():
    code = (
        "import sys\nfrom experiments import bed, hop, penetrate\nimport experiments.diagnose\n"
        "for package in (bed, hop, penetrate, experiments.diagnose):\n"
        "    assert callable(package.check) and callable(package.run) and callable(package.resume)\n"
        "    assert package.Settings.model_fields\n"
        "assert 'taichi' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
