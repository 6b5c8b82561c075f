"""Kept beds are found by a digest of the code: a comment or a docstring does not change it, a number does."""

import time

import pytest

from dem.prepare import code
from dem.prepare.code import digest_of_code

SOURCE = '''"""A module."""

STEP = 0.25  # [s]
"""The step."""
NAMES = """one
# two

three"""


def half(x):
    """Half of x."""
    # exact
    return (
        # in brackets
        "x" * x
        + "#y"
    )
'''


def digest(folder, source):
    (folder / "a.py").write_text(source)
    return digest_of_code(folder)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "code"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "code").mkdir()
    return tmp_path / "code"


WORDS = {
    "docstring of a module": ('"""A module."""', '"""Another\n\nmodule."""'),
    "no docstring": ('"""A module."""\n', ""),
    "docstring of a function": ("Half of x.", "A half of x, in two\n    lines."),
    "docstring of a value": ('"""The step."""', '"""Time step [s]."""'),
    "comment behind a value": ("  # [s]", ""),
    "comment in a function": ("    # exact\n", "    # not quite\n    # exact\n\n"),
    "comment in brackets": ("        # in brackets\n", ""),
}
NUMBERS = {
    "number": ("0.25", "0.26"),
    "text that is computed with": ("# two", "# three"),
    "text after a mark of a comment": ('"#y"', '"#z"'),
    "name": ("def half", "def halve"),
    "default": ("half(x)", "half(x=2)"),
    "indentation": ("    return (", "    if x:\n     return ("),
}


@pytest.mark.parametrize("old, new", WORDS.values(), ids=WORDS)
def test_words_do_not_change_the_digest(folder, old, new):
    assert old in SOURCE and digest(folder, SOURCE) == digest(folder, SOURCE.replace(old, new))


@pytest.mark.parametrize("old, new", NUMBERS.values(), ids=NUMBERS)
def test_code_changes_the_digest(folder, old, new):
    assert old in SOURCE and digest(folder, SOURCE) != digest(folder, SOURCE.replace(old, new))


def test_code_in_another_file_changes_the_digest(folder):
    before = digest(folder, SOURCE)
    (folder / "b.py").write_text("X = 1\n")
    assert digest_of_code(folder) != before


def test_the_version_of_taichi_changes_the_digest(folder, monkeypatch):
    before = digest(folder, SOURCE)
    monkeypatch.setattr(code, "version", lambda: "another")
    assert digest_of_code(folder) != before


@pytest.mark.parametrize("text", ["", "0123", "x" * 16, "é" * 16])
def test_a_damaged_digest_in_the_cache_is_found_again(folder, cache, text):
    before = digest(folder, SOURCE)
    (kept,) = cache.iterdir()
    kept.write_text(text, encoding="utf-8")
    assert digest_of_code(folder) == before == kept.read_text()


def test_the_digest_needs_no_cache(folder, cache):
    cache.parent.write_text("a file where the folder should be")
    assert digest(folder, SOURCE) == digest(folder, SOURCE)


def test_the_second_command_finds_the_digest_without_reading_the_code(folder, monkeypatch):
    before = digest(folder, SOURCE)
    monkeypatch.setattr(code, "_bare", lambda source: pytest.fail("the code was read again"))
    assert digest_of_code(folder) == before


def test_the_digest_of_dem_takes_little_time(monkeypatch):
    monkeypatch.setattr(code, "version", lambda: "1")
    digest_of_code(code._ROOT)
    begin = time.process_time()
    digest_of_code(code._ROOT)
    assert time.process_time() - begin < 0.05
