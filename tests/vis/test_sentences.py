"""Every sentence that code asks for is in its package's file, and every sentence there is asked for."""

import ast
import tomllib
from pathlib import Path

import pytest

from vis.page.sentences import Sentences

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(path for room in ("experiments", "vis") for path in (ROOT / room).rglob("sentences.toml"))
CAPTIONS = sorted((ROOT / "vis").rglob("figures.toml"))


def keys_used(folder: Path) -> set[str]:
    """The keys that the modules of a package pass to `say`."""
    calls = (node for path in folder.glob("*.py") for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    return {
        branch.value
        for node in calls
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "say" and node.args
        for branch in ast.walk(node.args[0])
        if isinstance(branch, ast.Constant) and isinstance(branch.value, str)
    }


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_code_and_the_file_of_sentences_name_the_same_keys(path):
    there = set(tomllib.loads(path.read_text(encoding="utf-8")))
    assert keys_used(path.parent) == there


def figures_named(folder: Path) -> set[str]:
    """The strings of a package's modules, and those of two of them with _ between: what a figure may be called."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in folder.glob("*.py")]
    words = {node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    words = {word.partition(".")[0] for word in words if isinstance(word, str) and len(word) < 30}
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
    (package / "sentences.toml").write_text('depth = "it sinks {depth:.3g} m"\n')
    monkeypatch.syspath_prepend(tmp_path)
    say = Sentences("talkative")
    assert say("depth", depth=0.01234) == "it sinks 0.0123 m"
    with pytest.raises(KeyError, match="height"):
        say("height")
    with pytest.raises(KeyError, match="depth"):
        say("depth", height=1.0)
