"""Pages of docs with a part that is made: what stands between two marks is written anew."""

__all__ = ["insert"]


def insert(text: str, table: str, marks: tuple[str, str], *, page: str = "the page") -> str:
    """A page's text with what is between two marks replaced by a table.

    Raises ValueError, which names the `page`, where a mark is missing.
    """
    begin, end = marks
    head, first, rest = text.partition(begin)
    _, second, tail = rest.partition(end)
    if not first or not second:
        raise ValueError(f"{page}: the marks {begin} and {end} are missing")
    return f"{head}{begin}\n{table}{end}{tail}"
