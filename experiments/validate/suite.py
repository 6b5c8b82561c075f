"""Every case of the verification suite, in the order of the table."""

import ast
import hashlib
import pkgutil
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path

from rigid.checks import nearest

from . import base, beds, contacts, measured
from .base.case import Case, Compute

__all__ = ["SUITE", "chosen", "fingerprint", "fingerprint_of"]

_FOLDER = Path(__file__).parent


def _found() -> Iterator[Case]:
    """The cases of cases.toml, in its order, each with what computes it: the entry of a module's ``CASES``."""
    computed: dict[str, Compute] = {}
    for package in (base, beds, contacts, measured):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            computed |= vars(import_module(module.name)).get("CASES", {})
    for id, row in tomllib.loads((_FOLDER / "cases.toml").read_text(encoding="utf-8")).items():
        yield Case(id, **row, compute=computed.pop(id, None))
    if computed:
        raise RuntimeError(f"{', '.join(computed)}: no such case in cases.toml")


SUITE: tuple[Case, ...] = tuple(_found())


def chosen(only: Sequence[str] = (), *, quick: bool = False, held: bool = False) -> list[Case]:
    """The cases that are to be run, in order: all, those named, those that are not slow, or (``held``) those that are
    held against measured experiments.

    Raises ValueError for a name that no case has, with the nearest, or that is left out by the others.
    """
    known = {case.id: case for case in SUITE}
    for name in only:
        if name not in known:
            raise ValueError(f"only = {name!r} is no case of the suite; {nearest(name, known)}")
    found = [case for case in SUITE if (not only or case.id in only) and not (quick and case.slow)]
    found = [case for case in found if case.measured or not held]
    if not found:
        asked = [word for word, on in (("only", only), ("quick", quick), ("measured", held)) if on]
        raise ValueError(f"{' and '.join(asked)} together leave no case to run; leave one of them out")
    return found


def fingerprint() -> str:
    """A digest of the bed's code and of the suite's."""
    return _digest(path for path in _FOLDER.rglob("*.py"))


def fingerprint_of(case: Case) -> str:
    """A digest of the bed's code and of what computes this case: a case that other code has finished is run again."""
    compute = case.compute.func if isinstance(case.compute, partial) else case.compute
    return _digest(_sources(__name__ if compute is None else compute.__module__))


def _sources(module: str, seen: frozenset[str] = frozenset()) -> set[Path]:
    """The file of a module and those of the suite that it imports."""
    file = sys.modules[module].__file__ if module in sys.modules else None
    if file is None or module in seen:
        return set()
    found = {Path(file)}
    for node in ast.walk(ast.parse(Path(file).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            name = resolve_name("." * node.level + (node.module or ""), sys.modules[module].__package__)
            if name.startswith(__package__):
                for one in (name, *(f"{name}.{alias.name}" for alias in node.names)):
                    found |= _sources(one, seen | {module})
    return found


def _digest(paths: Iterable[Path]) -> str:
    from dem.prepare.prepare import fingerprint as of_dem

    digest = hashlib.sha256(of_dem().encode())
    for path in sorted(paths):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
