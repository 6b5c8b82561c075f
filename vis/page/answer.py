"""The top of a report: the answer as a table with three errors, one picture, three findings; the rest is folded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vis.page.limits import kind_of
from vis.page.numbers import quantity, split_spread
from vis.page.page import Block, Page, Section, Tile, listing, table, text, write_template
from vis.page.sentences import Sentences

__all__ = ["LIFTED", "MOST_ROWS", "answer", "without_unknown", "write_page"]

say = Sentences(__package__)
MINUS, NBSP = "\N{MINUS SIGN}", "\N{NO-BREAK SPACE}"
MOST_ROWS = 6
LIFTED = 1e-4  # Height of the lowest foot of a robot above which a start is said to be above the surface [m]
_FINDINGS = 3
_ERRORS = ("± chance", "± grain size", "± bed, softness, speed")
_MOTIONS = ("tumble", "tumble spatial", "hop")
_ON_GRAINS = ("spike on grains", "platform on grains", "robot on grains", "bed")


@dataclass(frozen=True)
class Top:
    """A page in its order: what is open, and what is folded."""

    answer: Sequence[Block]
    picture: Block | None
    findings: Block | None
    folded: Sequence[Section]


def answer(tiles: Sequence[Tile], result: Mapping[str, Any]) -> list[Block]:
    """The table of the numbers that a reader wants first, and what its empty cells mean.

    A spread in a tile's value goes into the column of chance, where the tile does not state that error itself.
    Raises ValueError for more than `MOST_ROWS` tiles.
    """
    if not tiles:
        return []
    if len(tiles) > MOST_ROWS:
        raise ValueError(f"{len(tiles)} numbers at the top of a report: at most {MOST_ROWS} are one answer")
    rows = [_row(tile) for tile in tiles]
    on_grains = kind_of(result) in _ON_GRAINS
    errors, keys = _errors(result, on_grains)
    shown = [k for k in range(len(errors)) if on_grains or any(row[2 + k] for row in rows)]
    compared = result.get("experiment") == "compare"
    beside = [say("difference" if compared else "beside")] if any(tile.beside for tile in tiles) else []
    end = result.get("compared_over")
    values = (
        say("two_values") + (f", over {end:.3g}\N{NO-BREAK SPACE}s" if end is not None else "") if compared else "value"
    )
    errors, rows = _signs(errors, rows)
    head = ("", values, *(errors[k] for k in shown), *beside, "")
    cells = [
        (*row[:2], *(row[2 + k] or "\N{EN DASH}" for k in shown), *([tile.beside] if beside else []), row[-1])
        for tile, row in zip(tiles, rows, strict=True)
    ]
    if result.get("experiment") == "mujoco" and not on_grains and 0 in shown:
        keys = ["range_of_law", *keys]
    if "empty_cells" in keys and not any("\N{EN DASH}" in row for row in cells):
        keys.remove("empty_cells")
    if not shown:
        keys = []
    height = quantity({"value": result.get("start_height"), "std": None, "unit": "m"})
    said = " ".join(say(key, height=height) for key in keys)
    return [table(head, cells, words=True), *([text(said, small=True)] if keys else [])]


def without_unknown(numbers: Block, notes: Sequence[Block]) -> tuple[Block, list[Block]]:
    """The table of an answer without the errors that no row knows, and a note that names them; for narrow screens."""
    none = {say("not_known"), "\N{EN DASH}"}
    columns = range(len(numbers.head))
    empty = [k for k in columns if numbers.head[k].startswith("±") and all(row[k] in none for row in numbers.rows)]
    if not empty:
        return numbers, list(notes)
    kept = [k for k in columns if k not in empty]
    head, *rows = (tuple(row[k] for k in kept) for row in (numbers.head, *numbers.rows))
    names = "; ".join(numbers.head[k] for k in empty)
    dashes = any("\N{EN DASH}" in row for row in rows)
    left = [note for note in notes if dashes or not note.text.startswith("\N{EN DASH}")]
    return replace(numbers, head=head, rows=tuple(rows)), [text(say("unknown", names=names), small=True), *left]


def _signs(heads: Sequence[str], rows: Sequence[tuple[str, ...]]) -> tuple[list[str], list[tuple[str, ...]]]:
    """Heads and rows where a column with a one-sided error, such as +5.9 mm, has its signs at the numbers.

    The head of such a column has no ±, which the other numbers of the column have instead.
    """
    found, cells = list(heads), [list(row) for row in rows]
    for k, head in enumerate(heads):
        own = [row[2 + k] for row in rows]
        if head.startswith("± ") and any(error.startswith(("+", MINUS)) for error in own):
            found[k] = head.removeprefix("± ")
            for row in cells:
                row[2 + k] = f"±{NBSP}{row[2 + k]}" if row[2 + k][:1].isdigit() else row[2 + k]
    return found, [tuple(row) for row in cells]


def _errors(result: Mapping[str, Any], on_grains: bool) -> tuple[Sequence[str], list[str]]:
    """The heads of the three errors of this result, and the keys of the sentences below the table."""
    experiment = result.get("experiment")
    if experiment == "converge":
        return (say("of_95"), *_ERRORS[1:], say("all")), ["sum"]
    if kind_of(result) == "planar model" and experiment in _MOTIONS:
        return (_ERRORS[0], say("of_the_law"), say("bias")), ["one_law"]
    if experiment == "compare":
        return (say("of_compare"), *_ERRORS[1:]), []
    if experiment == "mujoco":
        return _errors_of_robot(result, on_grains)
    if kind_of(result) == "platform on grains" and experiment in _MOTIONS and "beds" not in result:
        return _ERRORS, ["of_limits"]
    keys = ["empty_cells"] if on_grains else []
    if experiment == "diagnose":
        return (say("of_fit"), *_ERRORS[1:]), keys
    if str(experiment).startswith(("bed calibrate", "bed test")):
        return (say("of_95"), *_ERRORS[1:]), keys
    if experiment == "ground":
        return (say("of_map"), *_ERRORS[1:]), ["sum_of_map"]
    if "ground_file" in result:
        return (say("of_the_law"), *_ERRORS[1:]), keys
    if experiment == "penetrate" and result.get("ground", "bed") != "bed":
        return (say("of_model"), *_ERRORS[1:]), keys
    if experiment == "penetrate" or "beds" in result:
        return (say("of_95"), *_ERRORS[1:]), keys
    if not on_grains and "sure" in result:
        return (say("left_open"), _ERRORS[1], say("over_laws")), keys
    return _ERRORS, keys


def _errors_of_robot(result: Mapping[str, Any], on_grains: bool) -> tuple[Sequence[str], list[str]]:
    """The same of a robot of MuJoCo."""
    forms, hop = "forms" in result, result.get("hop", True)
    rise = [result["quantities"].get("highest", {}).get("value")] if hop else []
    rise += [one["low"] for one in [(result.get("forms") or {}).get("ranges", {}).get("highest")] if one]
    lifted = hop and (result.get("start_height") or 0.0) > LIFTED
    along = (result["quantities"].get("hop_distance") or {}).get("value") is not None  # in place of the clearance
    told = {
        "one_bed": on_grains and "beds" not in result, "laws_of_sand": forms and not on_grains,
        "laws_and_grains": forms and on_grains, "start_of_rise": lifted, "of_clearance": lifted and not along,
        "below_start": any((one or 0.0) < 0 for one in rise), "no_error": True,
    }  # fmt: skip
    chance = say("of_95") if "beds" in result else _ERRORS[0]
    if on_grains:
        return (chance, _ERRORS[1], say("with_laws") if forms else _ERRORS[2]), [key for key, so in told.items() if so]
    first = say("of_the_law") if "ground_file" in result else say("left_open")
    return (first, _ERRORS[1], say("over_laws" if forms else "other_laws")), [key for key, so in told.items() if so]


def _row(tile: Tile) -> tuple[str, ...]:
    value, error = ("", "") if tile.errors[0] else split_spread(tile.value)
    if not error:
        return (tile.label, tile.value, *tile.errors, tile.note)
    return (tile.label, value, error, *tile.errors[1:], tile.note)


def write_page(path: Path, page: Page, result: Mapping[str, Any]) -> Path:
    """Write the page of a result to `path`, all of it or nothing, and return it."""
    return write_template(path, "page.html", page=page, top=_arranged(page, result))


def _arranged(page: Page, result: Mapping[str, Any]) -> Top:
    """The first scene or else the first figure goes to the top, with the first three findings of the first section."""
    blocks = [block for section in page.sections for block in section.blocks]
    pictures = [block for kind in ("scene", "figure") for block in blocks if block.kind == kind]
    picture = pictures[0] if pictures else None
    first = next((section for section in page.sections if picture in section.blocks), None)
    lists = [block for block in (page.sections[0].blocks if page.sections else ()) if block.kind == "list"]
    said = lists[0].entries if lists else ()
    sections = []
    for section in page.sections:
        kept = list(section.blocks)
        if section is first and picture is not None:
            kept.remove(picture)
        if lists:
            more = [listing(said[_FINDINGS:])] if len(said) > _FINDINGS else []
            kept = [left for block in kept for left in (more if block is lists[0] else [block])]
        if kept:
            sections.append(replace(section, heading=section.heading or "More on this run", blocks=kept))
    return Top(answer(page.tiles, result), picture, listing(said[:_FINDINGS]) if said else None, sections)
