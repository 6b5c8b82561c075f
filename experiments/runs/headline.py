"""The short form of a result that the terminal shows when a run ends."""

from dataclasses import dataclass

__all__ = ["Headline"]


@dataclass(frozen=True)
class Headline:
    """A short table and what is said below it."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    warnings: tuple[str, ...]
    sentences: tuple[str, ...]
    left: int
    """Findings that are left to the report."""
