"""What the command line says and where: results to stdout, all else to stderr, faults in words, signals as Ctrl-C."""

import os
import re
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from difflib import get_close_matches
from io import IOBase
from pathlib import Path
from types import FrameType
from zipfile import ZipFile

from cyclopts import CoercionError, MissingArgumentError
from cyclopts.exceptions import UnknownOptionError, UnusedCliTokensError

__all__ = [
    "RefusedError", "fault_words", "file_words", "is_number", "naming", "refusing", "say", "stdout_to_stderr",
    "terminate_like_ctrl_c",
]  # fmt: skip


PRINTING = ("bed foot", "bed list", "bed show")
"""Commands that print what they found and keep nothing."""


_SET_BY = {("bed make", "--packing"): "A stage sets the packing fraction: --stages rain level packing:0.58"}
"""Options that a command lacks -> what sets the same there."""


class RefusedError(ValueError):
    """Bad input, found before any work."""


LONGEST = 800
"""Characters of a line on stderr; a longer one quotes a long value, and is cut in its middle."""


def say(text: str) -> None:
    """Say `text` on stderr."""
    for line in text.splitlines():
        half = LONGEST // 2 - 20
        short = line if len(line) <= LONGEST else f"{line[:half]} ... {line[-half:]}"
        print(f"hedgebed: {short}", file=sys.stderr, flush=True)


def fault_words(error: Exception) -> str:
    """What was wrong with the typed words, and what to type."""
    text = str(error)
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        count, got = error.argument.token_count()[0], len(error.tokens_so_far)
        if count > 1:
            typed = " ".join(error.tokens_so_far) or "nothing"
            about = f" ({error.argument.parameter.help.rstrip('.')})" if error.argument.parameter.help else ""
            return f"{error.argument.name} = {typed}: expected {count} values, got {got}{about}"
    if isinstance(error, UnusedCliTokensError):
        return f"{' '.join(error.unused_tokens or [])} belongs to no option and to no argument; --help lists them"
    if isinstance(error, UnknownOptionError):
        typed = (error.token.keyword or error.token.value) if error.token else ""
        if told := _SET_BY.get((" ".join(error.command_chain or ()), typed.partition("=")[0])):
            return f"Unknown option: {typed}. {told}"
        text = re.sub(r" Did you mean (--\S+?)\?", lambda found: found[0] if _like(error, found[1]) else "", text)
    if isinstance(error, UnknownOptionError) and "Did you mean" not in text:
        command = " ".join(error.command_chain or ())
        if error.token and error.token.keyword == "--out" and command in PRINTING:
            return f"{text} `{command}` prints its numbers and writes no folder; `> FILE` keeps them (--json: as JSON)"
        return f"{text} `{f'hedgebed {command}'.rstrip()} --help` lists the options"
    if isinstance(error, CoercionError) and error.target_type is float and error.token and error.argument:
        unit = re.findall(r"\[([^\[\]]+)\]", error.argument.parameter.help or "")[-1:]
        if unit and unit[0] != "1":
            text = f"{text.rstrip('.')}: give a number in {unit[0]}"
    return text


def _like(error: UnknownOptionError, option: str) -> bool:
    """Whether an option is spelt so much like the unknown one that it may be meant."""
    typed = (error.token.keyword or error.token.value) if error.token else ""
    return bool(get_close_matches(typed.strip("-"), [option.strip("-")]))


def file_words(error: OSError, place: str) -> str:
    """Which file could not be read or written, and why; `place` where neither the system nor `_written` names it."""
    return f"{error.filename or _written(error) or place}: {error.strerror or error}"


def _written(error: OSError) -> str:
    """The file that was being written when the error arose; empty where none is found.

    The system names a file that it cannot open, but not one that it cannot write further, as on a full disk. So the
    innermost open file in the frames of the traceback is taken.
    """
    found = None
    for frame, _ in traceback.walk_tb(error.__traceback__):
        for value in frame.f_locals.values():
            name = getattr(value, "filename" if isinstance(value, ZipFile) else "name", None)
            if isinstance(value, ZipFile | IOBase) and isinstance(name, str | Path):
                found = Path(name)
    if found is None:
        return ""
    # A file that is written whole or not at all (`dem.files.arrays.whole_file`) has a folder of its own until then.
    return str(found if found.parent.exists() else found.parent.parent / found.name)


def is_number(word: str) -> bool:
    """Whether `word` is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


@contextmanager
def terminate_like_ctrl_c() -> Iterator[None]:
    """Within, SIGTERM raises KeyboardInterrupt, as Ctrl-C does."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not in the main thread: whoever runs us there deals with signals
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def refusing() -> Iterator[None]:
    """Within, a ValueError is bad input."""
    try:
        yield
    except ValueError as error:
        raise RefusedError(str(error)) from error


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Within, a ValueError names the file: two settings that exclude each other name only themselves."""
    try:
        yield
    except ValueError as error:
        raise ValueError(str(error) if str(file) in str(error) else f"{file}: {error}") from error


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Within, what anyone writes to stdout, libraries in C included, goes to stderr: stdout is for results."""
    try:
        number = sys.stdout.fileno()
    except (OSError, ValueError):  # stdout is not a file, as where a test captures it
        with redirect_stdout(sys.stderr):
            yield
        return
    sys.stdout.flush()
    kept = os.dup(number)
    os.dup2(sys.stderr.fileno(), number)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, number)
        os.close(kept)
