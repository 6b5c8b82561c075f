"""What a diagnosis says of the search that it is in. How many there will be is not known beforehand: a search is begun
anew where replicates are found to differ, or readings are weighed anew."""

from collections.abc import Callable, Iterable, Sequence

__all__ = ["differ_words", "named_search", "new_in_course"]

_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")

_MOST = 6
"""Searches of four campaigns that were counted: 1, 2, 4 and 6 (docs/notes/diagnose.md, 2026-11-29)."""

Tell = Callable[[str, float], None]


def named_search(tell: Tell, number: int, new: str) -> Tell:
    """`tell`, with which search it is in front of what is told, and what is `new` in it. `number`: from 0 on."""
    ordinal = _ORDINALS[number] if number < len(_ORDINALS) else f"{number + 1}th"
    name = f"{ordinal} search of 1 to {_MOST}" if number < _MOST else f"{ordinal} search"
    name += f" ({new})" if new else ""
    return lambda what, done: tell(f"{name}: {what}", done)


def differ_words(kinds: Iterable[str], what: str = "replicates") -> str:
    """That replicates, or trials, differ by these kinds of scatter."""
    *others, last = kinds
    return f"{what} differ in {' and '.join(filter(None, (', '.join(others), last)))}"


def new_in_course(*, aside: Sequence[object], looked_at: Sequence[str], with_wander: bool) -> str:
    """What is new in a course that was begun anew; empty of the first."""
    ways = (("without trials that diverge", aside), ("other trials held out", looked_at))
    return ", ".join([words for words, is_so in (*ways, ("replicates wander", with_wander)) if is_so])
