"""The one module of ours that imports Taichi; all others write ``from hedgebed_taichi import ti``.

The variable HEDGEBED_TAICHI chooses what `ti` is: ``taichi``, or ``quadrants``, a fork of it. Where it is not set, `ti`
is Taichi. Where Taichi's compiler does not know the processor and the fork is installed (``pip install quadrants``),
`ti` is the fork. docs/performance.md compares the two. Nothing is imported before `ti` is asked for.

Imports nothing of ours.
"""

import atexit
import contextlib
import functools
import inspect
import io
import os
import re
import sys
import textwrap
import warnings
from collections.abc import Iterator
from dataclasses import is_dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import taichi as ti

__all__ = ["chosen", "is_running", "kernel_cache", "ti", "unknown_processor", "version"]

VARIABLE = "HEDGEBED_TAICHI"
CHOICES = ("taichi", "quadrants")

# The newest family of AMD processors that LLVM 15, Taichi's compiler, has a name for (Zen 3 and 4). For a later one it
# computes two numbers at a time where the processor can do eight. An Intel that it does not know it judges by features.
NEWEST_AMD_OF_LLVM_15 = 25
# Taichi itself keeps 100 MB of compiled kernels. Those of our tests are more, so that each run would compile them anew.
KEPT_KERNELS = 2**30  # [bytes]
_PROCESSOR = Path("/proc/cpuinfo")


def unknown_processor() -> bool:
    """Whether Taichi's compiler does not know this processor; False too where the system does not tell which it is."""
    try:
        said = _PROCESSOR.read_text()
    except OSError:
        return False
    family = re.search(r"^cpu family\s*: (\d+)$", said, re.MULTILINE)
    return "AuthenticAMD" in said and family is not None and int(family[1]) > NEWEST_AMD_OF_LLVM_15


@functools.cache
def chosen() -> str:
    """The package that `ti` is; imports nothing.

    Raises ValueError: HEDGEBED_TAICHI names an unknown package, or one that is not installed.
    """
    given = os.environ.get(VARIABLE)
    if given and given not in CHOICES:
        raise ValueError(f"{VARIABLE} = {given!r} is unknown; use one of {', '.join(CHOICES)}")
    if given and find_spec(given) is None:
        raise ValueError(f"{VARIABLE} = {given!r}, and that package is not installed: pip install {given}")
    faster = "quadrants" if unknown_processor() and find_spec("quadrants") else "taichi"
    return given or faster


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
    cache = Path(given) if given else Path.home() / ".cache" / folder
    return cache if chosen() == "taichi" else cache / "kernel_compilation_manager"


@functools.cache
def _load() -> Any:
    """Import it in silence: what a script prints is the script's, and nobody asks for new versions."""
    for key, value in {
        "ENABLE_TAICHI_HEADER_PRINT": "0",
        "TI_SKIP_VERSION_CHECK": "ON",
        "TI_LOG_LEVEL": "error",
        "QD_LOG_LEVEL": "error",
        "TI_OFFLINE_CACHE_MAX_SIZE_OF_FILES": str(KEPT_KERNELS),
        "QD_OFFLINE_CACHE_MAX_SIZE_OF_FILES": str(KEPT_KERNELS),
    }.items():
        os.environ.setdefault(key, value)
    # quadrants says so whenever a field of vectors is filled; kernels that steps call have no such argument.
    warnings.filterwarnings("ignore", ".*Template mapper caching disabled")
    with contextlib.redirect_stdout(io.StringIO()), _frames_known():
        taichi = import_module(chosen())
    _read_sources_once(chosen())
    if chosen() == "quadrants":
        _forget_launches()
        _read_kernels_once()
    atexit.register(_end)
    return taichi


@contextlib.contextmanager
def _frames_known() -> Iterator[None]:
    """While it is imported: spare it the search for a source that there is none of.

    A decorator looks at the line that called it, to know whether its function stands in a class. Of a function at the
    top of a module that is the import system's, which has no file.
    """
    ask = inspect.getframeinfo

    def known(frame: Any, context: int = 1) -> Any:
        if _imports(frame):
            return inspect.Traceback(frame.f_code.co_filename, frame.f_lineno, frame.f_code.co_name, None, None)
        return ask(frame, context)

    inspect.getframeinfo = known
    try:
        yield
    finally:
        inspect.getframeinfo = ask


def _imports(frame: Any) -> bool:
    return str(frame.f_code.co_filename).startswith("<frozen ")


def _read_kernels_once() -> None:
    """Let quadrants read the source of a kernel once where it would twice.

    Its first reading finds out which members of dataclasses and of structures with ndarrays are used. Kernels without
    such an argument have none. A function that is given one all the same is refused by name in the second reading.
    """
    kernel = import_module("quadrants.lang.kernel").Kernel
    arrays = import_module("quadrants.lang._ndarray").Ndarray
    flat = vars(import_module("quadrants.lang._kernel_impl_dataclass"))
    find, flatten = vars(kernel).get("_try_load_fastcache"), flat.get("unpack_ast_struct_expressions")

    def plain(argument: Any, value: Any) -> bool:
        held = vars(value).values() if hasattr(value, "__dict__") else ()
        return not (
            is_dataclass(argument.annotation) or is_dataclass(value) or any(isinstance(one, arrays) for one in held)
        )

    def found(self: Any, arguments: tuple[Any, ...], key: Any) -> set[str] | None:
        used: set[str] | None = find(self, arguments, key)  # type: ignore[misc]
        if used is None and all(map(plain, self.arg_metas, arguments)):
            used = self.used_py_dataclass_parameters_by_key_enforcing[key] = set()
        return used

    def flattened(tree: Any, struct_locals: set[str]) -> Any:
        return flatten(tree, struct_locals=struct_locals) if struct_locals else tree  # type: ignore[misc]

    if find and flatten:
        kernel._try_load_fastcache = found
        flat["unpack_ast_struct_expressions"] = flattened


def _forget_launches() -> None:
    """Keep quadrants from taking up the arguments of an earlier launch, which it knows by their Python ids.

    An engine that has gone may leave its id to the next one, whose kernels are others: that ended in an assertion.
    """
    kept = vars(import_module("quadrants.lang.kernel")).get("LaunchContextBufferCache")
    if kept is not None:
        kept.cache = lambda self, *arguments: None


def _end() -> None:
    """Write compiled kernels into the cache. Left to the interpreter, it depends on the order in which modules go."""
    if is_running():
        _load().reset()


def _read_sources_once(name: str) -> None:
    """Keep what Taichi asks for again and again while it reads kernels: a fifth of the time to a script's first step.

    For every node of a syntax tree it wraps the source lines around it, for the message of an error that may come, and
    for every call of a function it looks for the function's source and puts its lines in order; and for every function
    whether it stands in a class. The answers are the same each time.
    """

    @functools.cache
    def wrapper(**options: Any) -> textwrap.TextWrapper:
        made = textwrap.TextWrapper(**options)
        made.wrap = functools.lru_cache(maxsize=10_000)(made.wrap)  # type: ignore[method-assign]
        return made

    lines = SimpleNamespace(fill=functools.lru_cache(maxsize=10_000)(textwrap.fill), dedent=textwrap.dedent)
    for module in ("ast.ast_transformer_utils", "kernel_impl", "_wrap_inspect", "_func_base"):
        if find_spec(f"{name}.lang.{module}") is None:
            continue
        names = vars(import_module(f"{name}.lang.{module}"))
        if names.get("textwrap") is textwrap:
            names["textwrap"] = lines
        if "TextWrapper" in names:
            names["TextWrapper"] = wrapper
        for reader in ("getsourcelines", "getsourcefile"):
            if reader in names:
                names[reader] = functools.lru_cache(maxsize=500)(names[reader])
        if "_inside_class" in names:
            names["_inside_class"] = functools.partial(_inside_class, names["_inside_class"])


def _inside_class(ask: Any, level_of_class_stackframe: int) -> bool:
    """``ask``, but for a frame of the import system (see ``_frames_known``)."""
    try:
        frame = sys._getframe(level_of_class_stackframe)
    except ValueError:  # there is none: a function of a script
        return False
    return not _imports(frame) and ask(level_of_class_stackframe + 1)


def __getattr__(name: str) -> Any:
    if name != "ti":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _load()
