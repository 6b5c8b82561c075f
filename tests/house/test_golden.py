"""Kept sentences: a change of wording shows as a diff and is accepted by one option; tests hold no other sentences."""

import ast
from pathlib import Path

import golden as kept
import pytest

TESTS = Path(__file__).resolve().parents[1]
SENTENCES_AT_MOST = 44
"""How many string literals of four words and more the asserts of all tests hold; lower it where it can be."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "FOLDER", tmp_path)
    monkeypatch.setattr(kept, "UPDATE", False)
    return tmp_path


def update(name, text):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept, "UPDATE", True)
        kept.golden(name, text)


def failure(name, text):
    with pytest.raises(pytest.fail.Exception) as caught:
        kept.golden(name, text)
    return str(caught.value).splitlines()


def test_a_changed_wording_fails_with_a_diff_until_it_is_written_anew(folder):
    update("a/said", ["It sinks 3 mm.", "It stands."])
    kept.golden("a/said", "It sinks 3 mm.\nIt stands.")
    told = failure("a/said", ["It sinks 4 mm.", "It stands."])
    assert "tests/golden/a/said.txt" in told[0] and "--update-golden" in told[0]
    assert told[-3:] == ["-It sinks 3 mm.", "+It sinks 4 mm.", " It stands."]
    update("a/said", ["It sinks 4 mm.", "It stands."])
    kept.golden("a/said", ["It sinks 4 mm.", "It stands."])


def test_a_missing_file_says_what_to_do(folder):
    (told,) = failure("new", "text")
    assert "tests/golden/new.txt" in told and "pytest --update-golden" in told
    assert not list(folder.iterdir())


def test_what_changes_from_run_to_run_is_left_out_and_numbers_stay(folder):
    line = "{when}: {path} by hedgebed {version} of {commit} took 0.125 s, 3/4 of 1.5 N at 12 N/m"
    first = {
        "when": "2026-11-24 15:42:31 UTC",
        "path": "/tmp/a/result.json",
        "version": "0.3.0",
        "commit": "0f7d7974646e",
    }
    later = {
        "when": "2027-01-02T03:04",
        "path": "/home/b/runs/",
        "version": "1.12.3.dev4+g0f7d797",
        "commit": "a1" * 20,
    }
    update("line", line.format(**first))
    kept.golden("line", line.format(**later))
    assert "took 0.125 s, 3/4 of" in (folder / "line.txt").read_text()


def test_texts_stand_under_their_headings(folder):
    update("two", {"hard": ["a", "b"], "soft": "c"})
    assert (folder / "two.txt").read_text() == "[hard]\na\nb\n\n[soft]\nc\n"


def test_a_page_is_taken_as_the_lines_that_a_browser_shows():
    head = "<title>t</title><style>p {}</style><h1>A\n run</h1>"
    table = "<table><tr><th>K</th><td>1 &lt; 2</td></tr></table>"
    assert kept.page_lines(f"{head}{table}<p>so <b>so</b></p>") == ["A run", "K | 1 < 2", "so so"]


def test_the_option_is_what_decides(request):
    assert request.config.getoption("--update-golden") == kept.UPDATE


def test_no_file_is_left_that_no_test_reads():
    sources = "".join(path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py"))
    names = {path.relative_to(kept.FOLDER).with_suffix("").as_posix() for path in kept.FOLDER.rglob("*.txt")}
    assert not {name for name in names if f'golden("{name}"' not in sources}


def sentences(path):
    """The string literals of four words and more in the asserts of one file, with their lines."""
    asserts = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Assert)]
    texts = [node for part in asserts for node in ast.walk(part.test) if isinstance(node, ast.Constant)]
    return [f"{path.relative_to(TESTS)}:{node.lineno}: {node.value!r}"
            for node in texts if isinstance(node.value, str) and len(node.value.split()) >= 4]  # fmt: skip


def test_sentences_stand_in_golden_files_and_not_in_asserts():
    found = [line for path in sorted(TESTS.rglob("*.py")) for line in sentences(path)]
    assert len(found) <= SENTENCES_AT_MOST, "\n".join(["golden(name, text) holds these:", *found])
