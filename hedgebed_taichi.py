"""The one module of ours that imports Taichi; all others write ``from hedgebed_taichi import ti``.

The variable HEDGEBED_TAICHI chooses what `ti` is: ``taichi`` (where it is not set), or ``quadrants``, a fork of it
(``pip install quadrants``). docs/performance.md compares the two. Nothing is imported before `ti` is asked for.

Imports nothing of ours.
"""

import contextlib
import functools
import io
import os
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import taichi as ti

__all__ = ["chosen", "is_running", "kernel_cache", "ti", "version"]

VARIABLE = "HEDGEBED_TAICHI"
CHOICES = ("taichi", "quadrants")


@functools.cache
def chosen() -> str:
    """The package that HEDGEBED_TAICHI chooses; imports nothing.

    Raises ValueError: it names another package, or one that is not installed.
    """
    given = os.environ.get(VARIABLE)
    if given and given not in CHOICES:
        raise ValueError(f"{VARIABLE} = {given!r} is unknown; use one of {', '.join(CHOICES)}")
    if given and find_spec(given) is None:
        raise ValueError(f"{VARIABLE} = {given!r}, and that package is not installed: pip install {given}")
    return given or "taichi"


def version() -> str:
    """Name and version of what `ti` is; imports it."""
    return f"{chosen()} {'.'.join(map(str, _load().__version__))}"


def is_running() -> bool:
    """Whether somebody has started Taichi in this process."""
    if chosen() not in sys.modules:
        return False
    runtime = _load().lang.impl.get_runtime()
    return (runtime.prog if chosen() == "taichi" else runtime._prog) is not None


def kernel_cache() -> Path:
    """The folder in which Taichi keeps compiled kernels, where a program names no other."""
    variable, folder = {
        "taichi": ("TI_OFFLINE_CACHE_FILE_PATH", "taichi/ticache"),
        "quadrants": ("QD_OFFLINE_CACHE_FILE_PATH", "quadrants/qdcache"),
    }[chosen()]
    given = os.environ.get(variable)
    return Path(given) if given else Path.home() / ".cache" / folder


@functools.cache
def _load() -> Any:
    """Import it in silence: what a script prints is the script's, and nobody asks for new versions."""
    for key, value in {
        "ENABLE_TAICHI_HEADER_PRINT": "0",
        "TI_SKIP_VERSION_CHECK": "1",
        "TI_LOG_LEVEL": "error",
        "QD_LOG_LEVEL": "error",
    }.items():
        os.environ.setdefault(key, value)
    with contextlib.redirect_stdout(io.StringIO()):
        return import_module(chosen())


def __getattr__(name: str) -> Any:
    if name != "ti":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _load()
