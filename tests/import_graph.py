"""Which module of ours imports which, read from the syntax trees."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

__all__ = ["FOLDERS", "ROOT", "circle", "folder_of", "graph_of", "imported", "loaded_with", "modules"]

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("dem", "rigid", "coupling", "experiments", "vis")


@cache
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


@cache
def graph_of(root: Path = ROOT) -> dict[str, set[str]]:
    """Every module and the modules of ours that it imports."""
    known = modules(root)
    return {name: imported(name, path, known) & known.keys() for name, path in known.items()}


def folder_of(name: str, known: dict[str, Path]) -> str:
    """The package whose folder holds the module's file."""
    return name if known[name].name == "__init__.py" else name.rpartition(".")[0]


def loaded_with(*names: str) -> set[str]:
    """The packages that Python has loaded once these modules are imported, in a process of its own."""
    code = f"import sys, {', '.join(names)}; print(*{{name.split('.')[0] for name in sys.modules}})"
    return set(
        subprocess.run(
            [sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True
        ).stdout.split()
    )
