"""docs/architecture.md and the docstrings of packages say what is so."""

import ast
import re

import pytest
from import_graph import ROOT, folder_of, graph_of, modules

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PACKAGES = {
    name: ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    for name, path in modules().items()
    if path.name == "__init__.py" and name.split(".")[0] != "benchmarks"
}


def test_every_file_and_folder_that_the_page_names_is_there():
    named = re.findall(r"`([a-z_]+/[\w/.-]*)`", PAGE)
    assert len(named) > 40
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_what_the_page_names_in_a_file_is_in_that_file():
    named = re.findall(r"`([a-z_]+/[\w/]+\.py)`[,:]? (?:the term |its )?`([\w.]+)`", PAGE)
    assert len(named) >= 4
    for file, name in named:
        assert name.split(".")[-1] in (ROOT / file).read_text(encoding="utf-8"), (file, name)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_docstring_begins_with_what_the_package_is_in_four_words_or_more_on_its_first_line(name):
    assert len(PACKAGES[name].split("\n")[0].split()) >= 4


@pytest.mark.parametrize("name", [name for name in PACKAGES if "." not in name])
def test_the_page_lists_the_folder_with_the_clause_that_begins_its_docstring(name):
    first = re.split(r"\n\n", PACKAGES[name])[0].replace("\n", " ")
    clause = re.search(rf"^- `{name}/`: (.*)$", PAGE, re.MULTILINE)[1].rstrip(".")
    assert len(clause.split()) >= 4 and re.match(rf"{re.escape(clause)}( \(|[.,:;])", first), "whole, or up to a comma"


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_imports_what_the_end_of_its_docstring_says_and_nothing_else(name):
    last = PACKAGES[name].split("\n\n")[-1].replace("\n", " ")
    assert last.startswith("Imports ")
    may = re.findall(r"`([\w.]+)`", last)
    known, graph = modules(), graph_of()
    inside = {module for module in graph if module == name or module.startswith(f"{name}.")}
    found = {folder_of(target, known) for module in inside for target in graph[module] - inside}
    beyond = {module for module in found if not any(f"{module}.".startswith(f"{part}.") for part in may)}
    assert not beyond
    assert all(any(f"{module}.".startswith(f"{part}.") for module in found) for part in may), "no more than it needs"
