"""The cores of the machine for array work that numpy does piece by piece, outside Python's lock.

Contract: the pieces touch nothing of one another, so results are bitwise equal for any number of threads.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

from experiments.runs.memory import cores_there

__all__ = ["each"]

T = TypeVar("T")
R = TypeVar("R")

_MOST = 8  # threads: the pieces are short, and more of them would wait for Python's lock


def each(function: Callable[[T], R], pieces: Sequence[T], *, threads: int | None = None) -> list[R]:
    """`function` of every piece, in their order. `threads`: one a core when None, eight at most; 1: a plain loop."""
    count = min(cores_there(), _MOST) if threads is None else threads
    if count < 2 or len(pieces) < 2:
        return [function(piece) for piece in pieces]
    return list(_pool(count).map(function, pieces))


@lru_cache(maxsize=2)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="diagnose")


os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not come along
