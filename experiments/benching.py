"""Finding the benchmarks: they are in the repository, beside the packages, and are not installed with them.

``benchmarks/<what>.py`` offers ``run(out: Path, *, progress: Progress) -> dict``: it may write into `out`, shows its
table itself and returns what goes into bench.json, ``{"format": "hedgebed-bench/1", "what": <what>, ...}``.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from experiments.reading import nearest

__all__ = ["load_benchmark"]


def load_benchmark(what: str, root: Path | None = None) -> Callable[..., dict[str, Any]]:
    """The function `run` of benchmarks/`what`.py in the checkout `root` (by default the one this file is in).

    Raises ValueError if this is not a checkout or there is no such benchmark.
    """
    root = Path(__file__).resolve().parent.parent if root is None else root
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
