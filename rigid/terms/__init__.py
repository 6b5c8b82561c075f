"""The named terms of the planar model: the paper's own and the effects it leaves out, each in a file of its own.

An effect is one file in `body/`, `contact/` or `sensor/`: ``TERM = Term(...)`` says what it does to the motion of a
platform, ``CANDIDATE = Candidate(...)`` what a diagnosis must know of it. Files are found by themselves; nothing else
is edited. An effect of one's own is such a file anywhere, read with `load_effect`; it then runs in both integrators.

Imports `rigid.checks`.
"""

import importlib.util
import pkgutil
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from rigid.checks import nearest

from .base import BASE
from .candidate import Candidate
from .term import FIXED_ARGUMENTS, STATE_FIELDS, Parameter, Term

__all__ = [
    "BASE", "CANDIDATES", "EFFECTS", "FIXED_ARGUMENTS", "STATE_FIELDS", "LOADED", "Candidate", "Parameter",
    "Term", "find_candidate", "find_effect", "load_effect", "sensor_terms",
]  # fmt: skip


def _discover(folders: Iterable[str], package: str) -> tuple[dict[str, Term], dict[str, Candidate]]:
    """Terms and candidates of every file in the folders of a package, by id; terms by rank, then by id."""
    terms: list[Term] = []
    candidates: dict[str, Candidate] = {}
    for found in pkgutil.walk_packages(folders, f"{package}."):
        if found.ispkg or found.name.count(".") < package.count(".") + 2:
            continue
        module = vars(import_module(found.name))
        term, candidate = module.get("TERM"), module.get("CANDIDATE")
        id = term.id if term is not None else found.name.rpartition(".")[2].replace("_", "-")
        if term is not None:
            terms.append(term)
        if candidate is not None:
            candidates[id] = candidate
    return {term.id: term for term in sorted(terms, key=lambda term: (term.rank, term.id))}, candidates


EFFECTS, CANDIDATES = _discover(__path__, __name__)
"""All effects on tumbles by id, in the order in which they are summed; all candidates of diagnoses by id."""
LOADED: dict[str, tuple[Candidate | None, Any]] = {}
"""CANDIDATE and FIT of the effects that were read from files of a person's own, by id."""


def find_candidate(id: str) -> Candidate | None:
    """What a diagnosis knows of the effect called `id`, shipped or read from a file; None where there is nothing."""
    return CANDIDATES[id] if id in CANDIDATES else LOADED.get(id, (None, None))[0]


def find_effect(id: str) -> Term:
    """The effect called `id`. Raises ValueError naming those there are."""
    if id not in EFFECTS:
        raise ValueError(f"effect {id!r} is unknown; {nearest(id, EFFECTS)}")
    return EFFECTS[id]


def sensor_terms(hook: str, own: Iterable[Term] = ()) -> tuple[Term, ...]:
    """The sensors' effects that have this hook, `clock` or `lens`: those that ship, and of `own`."""
    return tuple(term for term in (*EFFECTS.values(), *own) if term.sensor and hook in term.hooks)


def load_effect(file: str | Path) -> Term:
    """The term that the Python file `file` calls TERM.

    Raises ValueError, naming the file: it does not exist; its id is one of ours; a hook calls another function of the
    file.
    """
    path = Path(file).resolve()
    if not path.is_file():
        raise ValueError(f"file = {str(file)!r} is not there: an effect of one's own is a Python file with TERM in it")
    name = f"hedgebed_effect_{path.stem}_{abs(hash(str(path))):x}"
    if name in sys.modules:
        return _entered(sys.modules[name])
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"file = {str(file)!r} is no Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (SyntaxError, ImportError, NameError) as problem:
        raise ValueError(f"file = {str(file)!r} cannot be read: {problem}") from None
    term = vars(module).get("TERM")
    if not isinstance(term, Term):
        raise ValueError(f"file = {str(file)!r} has no TERM = rigid.terms.Term(...)")
    if term.id in CANDIDATES or term.id in EFFECTS or term.id in {base.id for base in BASE}:
        raise ValueError(f"file = {str(file)!r}: the id {term.id!r} is taken; choose another")
    for key, hook in term.hooks.items():
        _check_alone(hook, f"file = {str(file)!r}: hook {key!r}")
    sys.modules[name] = module
    return _entered(module)


def _entered(module: ModuleType) -> Term:
    """The term of a file that was read, its candidate where reports find it."""
    term: Term = module.TERM
    LOADED[term.id] = (vars(module).get("CANDIDATE"), vars(module).get("FIT"))
    return term


def _check_alone(hook: Callable[..., object], what: str) -> None:
    """Raise ValueError for a hook that calls a function of its own file: each is compiled by itself, and the call would
    come out as nothing, without an error."""
    if not isinstance(hook, FunctionType):
        return
    for called in hook.__code__.co_names:
        found = hook.__globals__.get(called)
        if isinstance(found, FunctionType) and found.__globals__ is hook.__globals__:
            raise ValueError(
                f"{what} calls {called}() of the same file: hooks are compiled one by one, so write what it does into "
                f"the hook itself"
            )
