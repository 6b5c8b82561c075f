"""Texts that a person reads are in standard terms: the words of the house's dialect do not come back."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("coupling", "experiments", "rigid", "vis")
"""`dem` is left out: a change in it makes kept beds invalid."""
DIALECT = re.compile(
    r"\b(is|are|be|was) (told|said)\b|\btells?\b|\b(would|will not) do\b|\blacks?\b|\bthe hand\b|\bthe books?\b"
    r"|\ba look\b|\blooked at\b|\bgives? back\b|\bgiven back\b|\bway (in|out)\b|\bfor certain\b|\bgoes? with\b"
    r"|\bone with another\b|\bas it (is|was)\b|\bmade[- ]up\b|\bloud(er|ness)?\b|\bthe same bits\b|\brooms?\b"
    r"|\bastray\b|\bbears? (what|more|less)\b",
    re.IGNORECASE,
)
MOST = 25
"""Names of types, texts of the suite of validation (a change makes its records invalid), and forms of effects."""


def strings_of(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of each string that is computed with: no docstring, no text that stands alone."""
    tree = ast.parse(source)
    alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
            yield node.lineno, node.value


def found_in(source: str) -> list[int]:
    """Lines of the words of the dialect in strings."""
    return [line for line, text in strings_of(source) for _ in DIALECT.finditer(text)]


def test_messages_have_few_words_of_the_dialect():
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    found = [f"{path.relative_to(ROOT)}:{line}" for path in paths for line in found_in(path.read_text("utf-8"))]
    assert len(found) <= MOST, found


def test_a_word_of_the_dialect_counts_in_a_message_and_not_in_a_docstring():
    source = '"""It tells."""\nraise ValueError(f"{size} m would do")\n'
    assert found_in(source) == [2]
