"""Code on the pages is code: commands name options that exist; Python, TOML and JSON can be read."""

import ast
import json
import re
import shlex
import tomllib
from itertools import takewhile
from pathlib import Path

import pytest
from cyclopts import CycloptsError
from import_graph import ROOT

from experiments.cli.main import build_app

PAGES = [ROOT / "README.md", *ROOT.glob("docs/*.md"), *ROOT.glob("docs/tutorials/*.md"), *ROOT.glob("examples/*.md")]
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and text of each fenced block of a page."""
    return re.findall(r"^```(\w*)\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def commands(page: Path) -> list[list[str]]:
    """Words after `hedgebed` of each command in a block of a page, but for those that the page shortens with "...".

    A word in capitals, such as SEED, stands for a value; 1 takes its place.
    """
    found = []
    for language, text in blocks(page):
        if language in ("", "sh", "bash", "console"):
            for line in text.replace("\\\n", " ").splitlines():
                match = re.match(r"(?:\$ )?(?:\S*/)?hedgebed (.*)", line)
                if match and "..." not in line:
                    words = shlex.split(re.sub(r"\b[A-Z]{3,}\b", "1", match[1]), comments=True)
                    found.append(list(takewhile(lambda word: word not in ("|", ">", "&&", "&"), words)))
    return found


APP = build_app()


def fault(tokens: list[str]) -> str | None:
    """What the parser of the command line says against a command, without running it."""
    try:
        APP.parse_args(tokens, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        return f"hedgebed {' '.join(tokens)}: {error}"
    return None


@each_page
def test_a_command_on_a_page_has_the_form_that_the_parser_takes(page):
    assert [said for tokens in commands(page) if (said := fault(tokens))] == []


def test_a_misspelt_option_is_found():
    assert fault(["hop", "--gravitty", "1e-3"]) and fault(["hopp"]) and not fault(["hop", "--gravity", "1e-3"])
    assert sum(len(commands(page)) for page in PAGES) > 60, "the pages are read"


@each_page
def test_a_block_of_python_toml_or_json_can_be_read(page):
    readers = {"python": ast.parse, "toml": tomllib.loads, "json": json.loads}
    faults = []
    for language, text in blocks(page):
        try:
            readers.get(language, str)(
                re.sub(r"^(>>>|\.\.\.) ?", "", text, flags=re.MULTILINE) if ">>>" in text else text
            )
        except (ValueError, SyntaxError) as error:
            faults.append(f"{error}\n{text}")
    assert faults == []
