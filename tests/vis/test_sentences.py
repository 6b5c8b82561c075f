"""Every sentence that code asks for is in its package's file, and every sentence there is asked for."""

import ast
import tomllib
from pathlib import Path

import pytest

from vis.page.sentences import Sentences

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(path for room in ("experiments", "vis") for path in (ROOT / room).rglob("sentences.toml"))
CAPTIONS = sorted((ROOT / "vis").rglob("figures.toml"))


def keys_said(folder: Path) -> tuple[set[str], set[str]]:
    """What the modules of a package pass to `say`: whole keys, and the beginnings of keys that are put together."""
    calls = [
        node
        for path in folder.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "say" and node.args
    ]
    begun = [part for node in calls for part in ast.walk(node.args[0]) if isinstance(part, ast.JoinedStr)]
    compared = [part for node in calls for part in ast.walk(node.args[0]) if isinstance(part, ast.Compare)]
    pieces = {id(piece) for part in [*begun, *compared] for piece in ast.walk(part)}  # no keys of their own
    whole = [part for node in calls for part in ast.walk(node.args[0]) if id(part) not in pieces]
    return {part.value for part in whole if isinstance(part, ast.Constant) and isinstance(part.value, str)}, {
        part.values[0].value for part in begun if isinstance(part.values[0], ast.Constant)
    }


def words_of(folder: Path) -> set[str]:
    """Every string in the modules of a package."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in folder.glob("*.py")]
    found = {node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    return {word for word in found if isinstance(word, str)}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_every_key_that_code_says_is_in_the_file_and_none_there_is_unsaid(path):
    there = set(tomllib.loads(path.read_text(encoding="utf-8")))
    said, begun = keys_said(path.parent)
    assert said <= there
    words = words_of(path.parent)  # a key may be chosen elsewhere than where it is said
    assert [key for key in there - said if key not in words and not key.startswith(tuple(begun))] == []


def figures_named(folder: Path) -> set[str]:
    """The strings of a package's modules, and those of two of them with _ between: what a figure may be called."""
    words = {word.partition(".")[0] for word in words_of(folder) if len(word) < 30}
    return words | {f"{one}_{other}" for one in words for other in words}


@pytest.mark.parametrize("path", CAPTIONS, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_every_figure_with_a_caption_is_named_by_the_code(path):
    there = tomllib.loads(path.read_text(encoding="utf-8"))
    assert set(there) <= figures_named(path.parent)
    assert all(set(words) == {"title", "caption"} for words in there.values())


def test_a_key_or_a_value_that_is_not_there_is_an_error(tmp_path, monkeypatch):
    package = tmp_path / "talkative"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "sentences.toml").write_text('depth = "{depth:.3g} m deep"\n')
    monkeypatch.syspath_prepend(tmp_path)
    say = Sentences("talkative")
    assert say("depth", depth=0.01234) == "0.0123 m deep"
    with pytest.raises(KeyError, match="height"):
        say("height")
    with pytest.raises(KeyError, match="depth"):
        say("depth", height=1.0)
