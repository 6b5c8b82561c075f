"""Imports of ours point one way: between the folders at the top, between packages, between files."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("dem", "rigid", "coupling", "experiments", "vis")
MAY_IMPORT = {
    "dem": {"dem"},
    "rigid": {"rigid"},
    "coupling": {"coupling", "dem", "rigid"},
    "experiments": {"experiments", "coupling", "dem", "rigid", "vis"},
    "vis": {"vis"},
}
"""And all of them `hedgebed_renamed`, which imports nothing of ours."""
MOST_FILES = 20
"""In one folder."""


def modules(root: Path = ROOT, folders: tuple[str, ...] = (*FOLDERS, "benchmarks")) -> dict[str, Path]:
    """Every module of ours by its dotted name, and its file."""
    paths = [path for folder in folders for path in sorted((root / folder).rglob("*.py"))]
    return {".".join(p.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): p for p in paths}


def imported(name: str, path: Path, known: dict[str, Path]) -> set[str]:
    """Modules of ours that `name` imports: at its top, inside functions, for a type checker, by a literal name."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
            start = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*start, *([node.module] if node.module else [])])
            of_module = {f"{module}.{alias.name}" for alias in node.names} & known.keys()
            found |= of_module if len(of_module) == len(node.names) else of_module | {module}
        elif isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in (
            "import_module", "__import__",
        ):  # fmt: skip
            found |= {a.value for a in node.args[:1] if isinstance(a, ast.Constant) and isinstance(a.value, str)}
    return {module for module in found if module.split(".")[0] in {*FOLDERS, "hedgebed", "benchmarks", "tests"}} - {
        name
    }


def circle(graph: dict[str, set[str]]) -> list[str]:
    """One circle of `graph`; empty where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def graph_of(root: Path = ROOT) -> dict[str, set[str]]:
    """Every module and the modules of ours that it imports."""
    known = modules(root)
    return {name: imported(name, path, known) & known.keys() for name, path in known.items()}


def folder_of(name: str, known: dict[str, Path]) -> str:
    """The package whose folder holds the module's file."""
    return name if known[name].name == "__init__.py" else name.rpartition(".")[0]


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
