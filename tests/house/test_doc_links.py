"""Links of the documentation lead somewhere: files, headings, modules and names that are there."""

import re
import warnings
from functools import reduce
from pathlib import Path
from pkgutil import resolve_name

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("experiments/**/*.md")]


def anchors(page: Path) -> set[str]:
    """Of the headings, as GitHub makes them, and those set by hand, under which a heading was before."""
    text = page.read_text(encoding="utf-8")
    heads = [line.lstrip("#").strip().lower() for line in text.split("\n") if line[:1] == "#"]
    made = {re.sub(r"[^\w\- ]", "", head).replace(" ", "-") for head in heads}
    return made | set(re.findall(r'<a id="([\w-]+)"></a>', text))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_to_a_file_and_a_heading_that_are_there(page):
    dead = []
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        if not there.exists() or (anchor and there.suffix == ".md" and anchor not in anchors(there)):
            dead.append(target)
    assert dead == []


def there(name: str) -> bool:
    """Whether a dotted name is a module of ours, or something in one, under the name that it has today."""
    parts = name.split(".")
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "error", r"(Bed|dem|rigid|coupling|experiments|vis)\S* is (now|deprecated)", DeprecationWarning
        )
        for length in range(len(parts), 0, -1):
            try:
                reduce(getattr, parts[length:], resolve_name(".".join(parts[:length]) + ":"))
            except (ImportError, AttributeError, DeprecationWarning):
                continue
            return True
    return False


@pytest.mark.parametrize("page", [p for p in PAGES if p.parent in (ROOT, ROOT / "docs")], ids=lambda page: page.name)
def test_every_module_and_name_of_ours_that_a_page_names_is_there(page):
    if page.name == "CHANGELOG.md":
        return  # it names what was
    text, ours = page.read_text(encoding="utf-8"), r"(?:dem|rigid|coupling|experiments|vis)"
    names = set(re.findall(rf"`({ours}(?:\.\w+)+)", text))
    for module, imported in re.findall(rf"from ({ours}[\w.]*) import ([\w, ]+)", text):
        names |= {f"{module}.{name.strip()}" for name in imported.split(",")}
    files = re.findall(r"`((?:dem|rigid|coupling|experiments|vis|benchmarks|tests|examples)/[\w/.-]+)`", text)
    assert [name for name in sorted(names) if not there(name)] == []
    assert [file for file in files if not (ROOT / file).exists()] == []
