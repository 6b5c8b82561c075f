"""No sentence of a public docstring, or of a file with texts of reports and messages, has more than 25 words."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("benchmarks", "coupling", "dem", "experiments", "rigid", "vis")
MOST = 25
"""Words of a sentence. Numbers, symbols of one letter and signs between them are no words."""
FILES = sorted([*(ROOT / "experiments").rglob("sentences.toml"), *(ROOT / "vis").rglob("*.toml")])
_WORD = re.compile(r"[A-Za-z]{2,}|\b[aA]\b")
_ENTRY = re.compile(r"\s*(?:[-*] |`{0,2}[\w, ]+`{0,2}: )")
"""Begin of an entry of a list or of the explanation of a name, which ends the sentence before it."""


def paragraphs_of(docstring: str) -> Iterator[str]:
    """Paragraphs and entries of lists, without examples, code blocks, tables and indented equations."""
    lines: list[str] = []
    fenced = example = False
    for line in [*docstring.splitlines(), ""]:
        fenced ^= line.lstrip().startswith("```")
        example = bool(line.strip()) and (example or line.lstrip().startswith(">>>"))
        left_out = fenced or example or line.lstrip().startswith(("```", "|"))
        if lines and (left_out or not line.strip() or _ENTRY.match(line)):
            if _ENTRY.match(lines[0]) or not all(one.startswith("    ") for one in lines):
                yield " ".join(one.strip() for one in lines)
            lines = []
        if line.strip() and not left_out:
            lines.append(line)


def long_sentences(docstring: str) -> list[str]:
    """The sentences with more than `MOST` words; a colon ends one, as in tools that count prose."""
    sentences = (one for part in paragraphs_of(docstring) for one in re.split(r"(?<=[.!?:])\s+", part))
    return [one for one in sentences if sum(bool(_WORD.search(word)) for word in one.split()) > MOST]


def public_docstrings(source: str) -> Iterator[str]:
    """Docstrings of a module and of its public classes, methods and functions."""
    nodes: list[ast.AST] = [ast.parse(source)]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield ast.get_docstring(node) or ""
        if isinstance(node, ast.Module | ast.ClassDef):
            nodes += [one for one in node.body if not re.match(r"_(?!_)", getattr(one, "name", "_"))]


@pytest.mark.parametrize("package", [*PACKAGES, ""])
def test_no_public_docstring_has_a_sentence_of_more_than_25_words(package):
    files = (ROOT / package).rglob("*.py") if package else ROOT.glob("*.py")
    found = {
        f"{path.relative_to(ROOT)}: {sentence}"
        for path in files
        for docstring in public_docstrings(path.read_text(encoding="utf-8"))
        for sentence in long_sentences(docstring)
    }
    assert not found, "\n".join(sorted(found))


def texts_of(table: object) -> Iterator[str]:
    """Every text in a file of texts, at any depth."""
    if isinstance(table, str):
        yield table
    elif isinstance(table, dict | list):
        for part in table.values() if isinstance(table, dict) else table:
            yield from texts_of(part)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_text_of_a_report_or_a_message_has_a_sentence_of_more_than_25_words(path):
    texts = texts_of(tomllib.loads(path.read_text(encoding="utf-8")))
    assert [sentence for text in texts for sentence in long_sentences(text)] == []


def test_texts_are_found_in_tables_lists_and_lists_of_tables():
    table = tomllib.loads('a = "one"\nb = ["two", 3]\n[c]\nd = "four"\n[[e]]\nf = "five"\ng = true\n')
    assert list(texts_of(table)) == ["one", "two", "four", "five"]


def test_a_long_sentence_counts_in_prose_and_entries_but_not_in_examples_code_tables_and_equations():
    long = " ".join(["word"] * (MOST + 1)) + "."
    assert long_sentences(f"Short.\n\n{long}\nShort.") == [long]
    entries = f"Args:\n    name: it is short.\n    other: {long}\n"
    assert long_sentences(entries) == [long]
    for other in (
        f">>> {long}",
        f"```\n{long}\n```",
        f"| {long} |",
        f"    {long}",
        f"- a\n- {long[:60]}\n- {long[:60]}",
    ):
        assert long_sentences(f"Short.\n\n{other}\n\nShort.") == []
    source = (
        f'"""{long}"""\nclass A:\n    """{long}"""\n    def f(): "{long}"\n    def _g(): "{long}"\nclass _B: "{long}"\n'
    )
    assert [len(long_sentences(one)) for one in public_docstrings(source)] == [1, 1, 1]
