"""Ctrl-C and SIGTERM where work may only stop between two of its pieces."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["held_back", "request_stop", "stop_requested"]

_STOP = threading.Event()


def request_stop() -> None:
    """Ask all work of this process to stop, as the first Ctrl-C does: also outside the main thread."""
    _STOP.set()


def stop_requested() -> bool:
    """Whether `request_stop` was called."""
    return _STOP.is_set()


@contextmanager
def held_back() -> Iterator[Callable[[], bool]]:
    """Within, the first Ctrl-C or SIGTERM raises nothing: the function given says whether it or `request_stop` came.

    Whoever works asks it where it can stop, keeps what there is and raises KeyboardInterrupt. A second signal is not
    held back. Outside the main thread, where Python delivers no signals, only `request_stop` counts.
    """
    asked = False
    before: dict[int, Any] = {}

    def release() -> None:
        while before:
            number, handler = before.popitem()
            signal.signal(number, handler)

    def note(number: int, _: Any) -> None:
        nonlocal asked
        asked = True
        release()
        print("\nstopping as soon as what was done is kept; once more to stop at once", file=sys.stderr, flush=True)

    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            before[number] = signal.signal(number, note)
    except ValueError:  # not in the main thread
        release()
    try:
        yield lambda: asked or stop_requested()
    finally:
        release()
