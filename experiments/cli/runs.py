"""Carrying a run out from the command line: its status, its exit status, and the numbers that are shown in the end."""

import math
import shutil
import sys
import textwrap
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments.runs import registry
from experiments.runs.folder import RunFolder, write_text
from experiments.runs.headline import headline_of
from experiments.runs.kernel_cache import free_kernel_cache
from experiments.runs.progress import Progress, make_progress
from experiments.runs.registry import Headline
from experiments.runs.result import Result
from experiments.runs.streams import RefusedError, file_words, say, stdout_to_stderr
from experiments.runs.whole_runs import draw_report, keeping_status
from rigid.checks.unfit import UnfitSettingsError
from rigid.intervals import half_of
from vis.page.numbers import beside, with_squares

__all__ = ["BAD_INPUT", "DONE", "FAILED", "STOPPED", "carry_out", "redraw_old_report", "show_folder"]

DONE, FAILED, BAD_INPUT, STOPPED = 0, 1, 2, 3
"""Exit statuses of the command line."""


def carry_out(
    folder: RunFolder, work: Callable[[Progress], Result], *, as_json: bool, quiet: bool, verbose: bool = False
) -> int:
    """Do the `work` of a run whose folder is there; keep its status; show what came out."""
    say(f"run folder {folder.path}")
    fresh = not folder.has_work
    free_kernel_cache()
    with stdout_to_stderr():
        try:
            with keeping_status(folder):
                with make_progress(quiet=quiet) as progress:
                    result = work(progress)
                if not (folder.path / "result.json").exists():
                    folder.write_result(result)
        except KeyboardInterrupt:
            say(f"stopped; `hedgebed resume {folder.path}` finishes it")
            return STOPPED
        except RuntimeError as error:
            from coupling.lammps.process import LammpsEndedError  # loads Taichi
            from experiments.pool.workers import SchedulerGoneError

            unfit = isinstance(error, UnfitSettingsError)
            if unfit and fresh:
                _refuse_without_work(folder, error)
            again = "the same settings would fail the same way again"
            if isinstance(error, LammpsEndedError) and not error.refused:
                again = _goes_on(folder)
            elif isinstance(error, SchedulerGoneError):
                again = f"`HEDGEBED_SCHEDULER=tcp://... hedgebed resume {folder.path}` goes on with another scheduler"
            say(f"failed: {error}")
            say(f"what was finished is kept in {folder.path}; {again}")
            return BAD_INPUT if unfit else FAILED
        except (ValueError, OverflowError) as error:
            unfit = isinstance(error, OverflowError)
            if unfit:
                error = ValueError(f"with these settings {registry.TOO_LARGE}").with_traceback(error.__traceback__)
            if fresh:
                _refuse_without_work(folder, error)
            with suppress(OSError):
                write_text(folder.path / "traceback.txt", traceback.format_exc())
            say(f"failed: {error}")
            say(f"what was finished is kept in {folder.path}, and where it failed in traceback.txt there")
            return BAD_INPUT if unfit else FAILED
        except OSError as error:
            from dem.prepare.code import cache_folder

            say(f"failed: {file_words(error, f'a file below {folder.path} or {cache_folder()}')}")
            say(f"what was finished is kept; when the fault is mended, `hedgebed resume {folder.path}` goes on")
            return FAILED
        except Exception:
            traceback.print_exc()
            say(f"failed; what there was is in {folder.path}")
            return FAILED
    return show_folder(folder, as_json=as_json, verbose=verbose)


def _refuse_without_work(folder: RunFolder, error: Exception) -> None:
    """Raise RefusedError where a new folder holds no work yet; nothing of it is left behind."""
    if folder.has_work:
        return
    if {item.name for item in folder.path.iterdir()} <= {"run.toml", "status.json", "lock"}:
        shutil.rmtree(folder.path)
    raise RefusedError(str(error)) from error


def _goes_on(folder: RunFolder) -> str:
    """From where a resumed run goes on: the newest checkpoint, with its time, or the beginning."""
    kept = [path for path in (folder.path / "checkpoint").glob("*.npz") if not path.stem.endswith(".failed")]
    if not kept:
        return f"it has no checkpoint yet: `hedgebed resume {folder.path}` begins this part anew"
    newest = max(path.stat().st_mtime for path in kept)
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(newest))
    return f"`hedgebed resume {folder.path}` continues from the checkpoint of {when}"


def redraw_old_report(folder: RunFolder, *, quiet: bool) -> None:
    """Make the report anew where it is older than the result that it is of."""
    result, report = folder.path / "result.json", folder.path / "report.html"
    if not report.exists() or report.stat().st_mtime_ns >= result.stat().st_mtime_ns:
        return
    say("its report is older than result.json and is made anew")
    with folder.lock(), stdout_to_stderr(), make_progress(quiet=quiet) as progress:
        draw_report(folder, progress)


def show_folder(folder: RunFolder, *, as_json: bool, verbose: bool = False) -> int:
    """Show the result of a finished run on stdout, as JSON or as a table; return the exit status.

    The table, with findings and warnings, is short where the experiment has a short one, unless `verbose`.
    """
    if as_json:
        print((folder.path / "result.json").read_text(encoding="utf-8"), end="")
        return DONE
    result, report = folder.read_result(), folder.path / "report.html"
    console = Console(file=sys.stdout, highlight=False)
    console.print(with_squares(result.get("title", "")), markup=False, style="italic")
    experiment = registry.EXPERIMENTS.get(folder.command)
    headline = headline_of(experiment, result) if experiment is not None and not verbose else None
    if headline is not None:
        _show_headline(headline, console)
    else:
        _show_all(result, console)
    if headline is not None and (headline.left or headline.more):
        rest = "in the report, or with" if report.exists() else "with"
        what = f"{headline.left} more findings and all numbers" if headline.left else "tables and all numbers"
        print(f"{what}: {rest} `hedgebed resume {folder.path} --verbose`")
    print(f"report: {report}" if report.exists() else f"folder: {folder.path}")
    return DONE


def _number(value: Any, std: Any = 0.0) -> str:
    """A value to the digits its spread allows, to two where that is unknown (None), to four where it is exact."""
    if not isinstance(value, float) or not math.isfinite(value):
        return "-" if value is None else str(value)
    if std is None:
        whole = value.is_integer() and abs(value) < 1e15
        return f"{value:.0f}" if whole else f"{value:.2g}" if abs(value) < 100 or abs(value) >= 1e6 else f"{value:.0f}"
    if not std or not math.isfinite(std):
        return f"{value:.4g}"
    return beside(value, std)


def _interval(ends: Sequence[float] | None) -> str:
    """Both ends of an interval, to three digits of the larger one; a dash where there is none."""
    if not ends:
        return "-"
    digits = max(0, 2 - math.floor(math.log10(max(map(abs, ends), default=0.0) or 1.0)))
    return " to ".join(f"{end:.{digits}f}" for end in ends)


_NARROW = 24
"""Characters of a first column that is not broken into lines."""
_HEAD = 9
"""Characters of a heading that stays on one line above narrower cells."""
_GAP = 2
"""Blanks between two columns."""


def _unit(unit: str, value: Any, std: Any = None) -> str:
    """The unit; beside an angle in radians the same in degrees, with its spread."""
    if unit == "rad" and isinstance(value, int | float) and math.isfinite(value):
        if std and math.isfinite(std):
            angle, spread = math.degrees(value), math.degrees(std)
            return f"rad   {_number(angle, spread)} ± {_number(spread, spread)} degrees"
        return f"rad   {math.degrees(value):.4g} degrees"
    return "" if unit == "1" or value is None else unit


def _show_headline(headline: Headline, console: Console) -> None:
    """A short table, what to be warned of, and the findings that matter most."""
    table = Table(box=None, pad_edge=False)
    for place, name in enumerate(headline.head):
        widest = max((len(row[place]) for row in headline.rows), default=0)
        right = place > 0 and widest <= _NARROW
        heading = "\n".join(textwrap.wrap(name, max(widest, _HEAD), break_on_hyphens=False, break_long_words=False))
        table.add_column(heading, justify="right" if right else "left", no_wrap=right)
    for row in headline.rows:
        table.add_row(*map(Text, row))
    console.print(table, markup=False)
    for mark, texts in (("", headline.notes), ("warning: ", headline.warnings), ("- ", headline.sentences)):
        for text in texts:
            folded = textwrap.wrap(
                with_squares(text), console.width, initial_indent=mark, subsequent_indent=" " * len(mark)
            )
            print("\n".join(folded))
    _show_tables(headline.tables, console)


def _show_tables(tables: Sequence[Mapping[str, Any]], console: Console) -> None:
    """Tables of a result under their titles. One of numbers that is too wide for the screen is shown in parts."""
    for listed in tables:
        if listed["title"]:
            console.print(listed["title"], markup=False, style="italic")
        for places in _parts(listed, console.width):
            shown = Table(box=None, pad_edge=False)
            for place in places:
                narrow = all(len(str(row[place])) <= _NARROW for row in listed["rows"])
                shown.add_column(listed["head"][place], no_wrap=place == 0 and narrow, overflow="fold")
            for row in listed["rows"]:
                shown.add_row(*(Text(str(row[place])) for place in places))
            console.print(shown, markup=False)


def _parts(listed: Mapping[str, Any], width: int) -> list[list[int]]:
    """The columns of each part of a table; every part has the names, and the units where they are the second column.

    One part where the table is no wider than ``width`` characters, or has sentences in it.
    """
    columns = range(len(listed["head"]))
    cells = [[str(row[place]) for row in listed["rows"]] for place in columns]
    widths = [max(map(len, (str(listed["head"][place]), *cells[place]))) for place in columns]
    fixed = [place for place in columns if place == 0 or (place == 1 and listed["head"][1] == "unit")]
    free = [place for place in columns if place not in fixed]
    whole = sum(widths) + _GAP * (len(widths) - 1)
    if whole <= width or len(free) < 2 or max(widths[place] for place in free) > _NARROW:
        return [list(columns)]
    taken = min(widths[0], _NARROW) + sum(widths[place] for place in fixed[1:])
    room = width - taken - _GAP * (len(fixed) - 1)
    parts: list[list[int]] = [[]]
    for place in free:
        if parts[-1] and sum(widths[one] + _GAP for one in [*parts[-1], place]) > room:
            parts.append([])
        parts[-1].append(place)
    return [[*fixed, *part] for part in parts]


def _show_all(result: Mapping[str, Any], console: Console) -> None:
    """What it comes to, every quantity, the tables, findings and warnings."""
    for sentence in result.get("summary", []):
        console.print(with_squares(f"- {sentence}"), markup=False)
    table = Table(box=None, pad_edge=False)
    table.add_column("quantity")
    table.add_column("value", justify="right")
    quantities = result.get("quantities", {})
    stds = [quantity.get("std") for quantity in quantities.values()]  # 0: exact, or computed once
    spreads = any(isinstance(std, float) and math.isfinite(std) and std > 0 for std in stds)
    fitted = result.get("experiment") == "diagnose"
    if spreads:
        table.add_column("± 95 %" if fitted else "spread (std)", justify="right")
    intervals = any(quantity.get("interval") for quantity in quantities.values())
    if intervals:
        table.add_column("90 % interval", justify="right")
    table.add_column("unit")
    for name, quantity in quantities.items():
        value, std = quantity.get("value"), half_of(quantity) if fitted else quantity.get("std")
        cells = [_number(std, None) if std != 0 else "exact"] if spreads else []
        cells += [_interval(quantity.get("interval"))] if intervals else []
        shown = f"below {quantity['at_most']:.2g}" if "at_most" in quantity else _number(value, std)
        table.add_row(name, shown, *cells, _unit(quantity.get("unit", ""), value, std))
    if quantities:
        console.print(table, markup=False)
    _show_tables(result.get("tables", []), console)
    for sentence in result.get("departures", {}).get("sentences", []):
        console.print(with_squares(f"- {sentence}"), markup=False)
    for warning in result.get("warnings", []):
        console.print(with_squares(f"warning: {warning}"), markup=False)
