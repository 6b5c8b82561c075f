"""Texts that a person reads are in standard terms: the words of the house's dialect do not come back."""

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("coupling", "dem", "experiments", "rigid", "vis")
DIALECT = re.compile(
    r"\b(is|are|be|was) (told|said)\b|\btells?\b|\b(would|will not) do\b|\blacks?\b|\bthe hand\b|\bthe books?\b"
    r"|\ba look\b|\blooked at\b|\bgives? back\b|\bgiven back\b|\bway (in|out)\b|\bfor certain\b|\bgoes? with\b"
    r"|\bone with another\b|\bas it (is|was)\b|\bmade[- ]up\b|\bloud(er|ness)?\b|\bthe same bits\b|\brooms?\b"
    r"|\bastray\b|\bbears? (what|more|less)\b",
    re.IGNORECASE,
)
MOST = 22
"""Texts of the suite of validation (a change makes its records invalid), and forms of effects."""
MOST_PER_1000 = 0.5
"""Words of the dialect in 1000 words of docstrings. Names of arguments, such as `tell`, are among those that remain."""


@cache
def _parsed(source: str) -> ast.Module:
    return ast.parse(source)


def strings_of(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of each string that is computed with: no docstring, no text that stands alone, no name."""
    tree = _parsed(source)
    alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Constant) and isinstance(node.value, str)) or id(node) in alone:
            continue
        if not node.value.isidentifier():
            yield node.lineno, node.value


def docstrings_of(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring, and of each text that stands alone below a value."""
    for node in ast.walk(_parsed(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.lineno, node.value.value


def found_in(texts: Iterable[tuple[int, str]]) -> list[int]:
    """Lines of the words of the dialect in texts."""
    return [line + text[: found.start()].count("\n") for line, text in texts for found in DIALECT.finditer(text)]


def paths_of(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def test_messages_have_few_words_of_the_dialect():
    paths = [path for package in PACKAGES for path in paths_of(package)]
    found = [
        f"{path.relative_to(ROOT)}:{line}" for path in paths for line in found_in(strings_of(path.read_text("utf-8")))
    ]
    assert len(found) <= MOST, found


@pytest.mark.parametrize("package", PACKAGES)
def test_docstrings_have_few_words_of_the_dialect(package):
    found, words = [], 0
    for path in paths_of(package):
        texts = list(docstrings_of(path.read_text("utf-8")))
        words += sum(len(text.split()) for _, text in texts)
        found += [f"{path.relative_to(ROOT)}:{line}" for line in found_in(texts)]
    assert words > 10_000
    assert 1000 * len(found) / words <= MOST_PER_1000, found


def test_a_word_of_the_dialect_counts_in_a_message_or_in_a_docstring():
    source = '"""It\ntells."""\nraise ValueError(f"{size} m would do", "tell")\n'
    assert found_in(strings_of(source)) == [3]
    assert found_in(docstrings_of(source)) == [2]


def prose_of(text: str) -> str:
    """The text of a page without code blocks and tables."""
    return re.sub(r"^\s*\|.*$", "", re.sub(r"```.*?```", "", text, flags=re.S), flags=re.M)


def test_pages_have_few_words_of_the_dialect_short_sentences_and_keep_to_their_bounds():
    """Without the notebook, kept results and the page of validation, which is made by code: 30,000 words in all."""
    docs = [
        path.read_text("utf-8")
        for path in sorted((ROOT / "docs").rglob("*.md"))
        if not {"results", "notes"} & set(path.relative_to(ROOT).parts) and path.name != "validation.md"
    ]
    readme = (ROOT / "README.md").read_text("utf-8")
    assert len(readme.split()) <= 700 and 20_000 < sum(len(page.split()) for page in docs) <= 30_000
    prose = "\n".join(map(prose_of, [readme, *docs]))
    assert len(prose.split()) > 20_000
    assert 1000 * len(DIALECT.findall(prose)) / len(prose.split()) <= MOST_PER_1000, DIALECT.findall(prose)
    lengths = [len(one.split()) for one in re.split(r"(?<=[.!?:])\s+", prose) if len(one.split()) > 3]
    assert sum(lengths) / len(lengths) < 18
