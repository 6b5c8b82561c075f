"""Finding the benchmarks: they are in the repository, beside the packages, and are not installed with them.

``benchmarks/<what>.py`` offers ``run(out: Path, *, progress: Progress) -> dict``: it may write into `out`, shows its
table itself and returns what goes into bench.json, ``{"format": "hedgebed-bench/1", "what": <what>, ...}``. Further
keyword arguments of `run`, each a str, an int or a bool with a default, are options of the command. A benchmark that
can go on in a folder of its own offers ``continues(out: Path) -> bool`` as well.
"""

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from rigid.checks import nearest

__all__ = ["benchmark_options", "goes_on", "load_benchmark", "spelled_out"]


_FLAGS = ("--json", "--quiet", "--help", "--version", "--out")  # of the command itself; --out alone is refused


def load_benchmark(what: str, root: Path | None = None) -> Callable[..., dict[str, Any]]:
    """The function `run` of benchmarks/`what`.py in the checkout `root`. Raises ValueError where there is none."""
    root = Path(__file__).resolve().parents[2] if root is None else root
    folder = root / "benchmarks"
    if not (root / "pyproject.toml").is_file() or not folder.is_dir():
        raise ValueError("bench needs a checkout of the repository (benchmarks are not installed): use `make bench`")
    there = sorted(path.stem for path in folder.glob("[a-z]*.py") if "def run(" in path.read_text(encoding="utf-8"))
    if not there:
        raise ValueError(f"there are no benchmarks in {str(folder)!r}: take the folder benchmarks/ from the repository")
    if what not in there:
        raise ValueError(f"what = {what!r} is no benchmark; {nearest(what, there)}")
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    return import_module(f"benchmarks.{what}").run


def benchmark_options(run: Callable[..., dict[str, Any]], given: Mapping[str, str]) -> dict[str, Any]:
    """Options of the command as arguments of `run`. Raises ValueError for one it has not, or for a wrong value."""
    known = {
        name: parameter.default
        for name, parameter in inspect.signature(run).parameters.items()
        if isinstance(parameter.default, str | int)
    }
    found: dict[str, Any] = {}
    for name, text in given.items():
        if name not in known:
            there = nearest(name, sorted(known)) if known else "there is none"
            raise ValueError(f"--{name} is no option here; {there}")
        if isinstance(known[name], bool):
            if text not in ("yes", "no"):
                raise ValueError(f"{name} = {text!r} must be yes or no; --{name} alone means yes")
            found[name] = text == "yes"
            continue
        whole = isinstance(known[name], int)
        if whole and not text.isdigit():
            raise ValueError(f"{name} = {text!r}: a whole number was expected")
        found[name] = int(text) if whole else text
    return found


def spelled_out(tokens: Sequence[str]) -> list[str]:
    """The words of a command line; after ``bench`` an option that stands alone, as ``--limit``, has the value yes."""
    words = list(tokens)
    if words[:1] != ["bench"]:
        return words
    alone = [
        word.startswith("--") and "=" not in word and word not in _FLAGS and (not after or after.startswith("-"))
        for word, after in zip(words, [*words[1:], ""], strict=True)
    ]
    return [f"{word}=yes" if lonely else word for word, lonely in zip(words, alone, strict=True)]


def goes_on(run: Callable[..., dict[str, Any]], out: Path) -> bool:
    """Whether the benchmark goes on with what it left in the folder `out`."""
    continues = getattr(sys.modules.get(run.__module__), "continues", None)
    return continues is not None and bool(continues(out))
