"""The sentences of a package, kept as templates in a file of text beside its code.

A package with texts for users has a file ``sentences.toml``: ``key = "text with {name:.3g}"``. Its modules
share ``say = Sentences(__package__)`` and write ``say("key", name=value)``. Placeholders are those of `str.format`, so
attributes, items, conversions and format codes work: ``{settings.depth:g}``, ``{name!r}``.
"""

from __future__ import annotations

import tomllib
from functools import cached_property
from importlib.resources import files
from typing import Any

__all__ = ["Sentences", "label_of"]


class Sentences:
    """The sentences of one package, read at the first use.

    `file` is another than ``sentences.toml``: ``figures.toml`` has a table for each figure; title and caption of the
    table path have the keys path.title and path.caption.
    """

    def __init__(self, package: str | None, file: str = "sentences.toml") -> None:
        self.package, self.file = package or "", file

    @cached_property
    def templates(self) -> dict[str, str]:
        """Key to template, from the file."""
        found = tomllib.loads(files(self.package).joinpath(self.file).read_text(encoding="utf-8"))
        groups = {name: group for name, group in found.items() if isinstance(group, dict)}
        within = {f"{name}.{key}": text for name, group in groups.items() for key, text in group.items()}
        return {key: text for key, text in found.items() if key not in groups} | within

    def __call__(self, key: str, /, **values: Any) -> str:
        """The sentence `key`, its placeholders filled. Raises KeyError for a key or a placeholder without a value."""
        return self.templates[key].format(**values)

    def __repr__(self) -> str:
        return f"Sentences({self.package!r})"


_labels = Sentences(__package__, "labels.toml")


def label_of(key: str) -> str:
    """The name of a quantity or fact of result.json, as a person reads it: of labels.toml, else the key with blanks."""
    return _labels.templates.get(key, key.replace("_", " "))
