"""The arrows point one way: what a room may import of ours, held over every module's syntax tree."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("dem", "rigid", "coupling", "experiments", "vis")
MAY_IMPORT = {
    "dem": {"dem"},
    "rigid": {"rigid"},
    "coupling": {"coupling", "dem", "rigid"},
    "experiments": {"experiments", "coupling", "dem", "rigid", "vis", "hedgebed"},
    "vis": {"vis"},
}


def imported_rooms(source: str, room: str) -> set[str]:
    """The top-level packages of ours that `source`, a module of `room`, imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(room if node.level else (node.module or "").split(".")[0])
        elif isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in (
            "import_module",
            "__import__",
        ):
            first = node.args[0] if node.args else None
            if isinstance(first, ast.Constant) and isinstance(first.value, str):
                found.add(first.value.split(".")[0])
    return found & {*ROOMS, "hedgebed", "tests", "benchmarks"}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_what_it_may(room):
    wrong = {}
    for path in sorted((ROOT / room).rglob("*.py")):
        beyond = imported_rooms(path.read_text(encoding="utf-8"), room) - MAY_IMPORT[room]
        if beyond:
            wrong[str(path.relative_to(ROOT))] = sorted(beyond)
    assert not wrong


def test_the_walk_sees_imports_inside_functions_and_by_name():
    source = "def f():\n    from dem.bed import Bed\n    import_module('rigid.platform.spike')\n    from . import x\n"
    assert imported_rooms(source, "vis") == {"dem", "rigid", "vis"}
