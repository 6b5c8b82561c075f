"""The named terms of the planar model: the paper's own and the effects it leaves out.

`EFFECTS` lists every effect by id. A further one is a `Term` in a file of its own, ``TERM = Term(...)``, read with
`load_effect`; it then runs in both integrators.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import FunctionType

from .base import BASE
from .body import BODY_EFFECTS
from .contact import CONTACT_EFFECTS
from .sensor import SENSOR_EFFECTS
from .term import FIXED_ARGUMENTS, STATE_FIELDS, Parameter, Term
from .wires import WIRE_EFFECTS

__all__ = ["BASE", "EFFECTS", "FIXED_ARGUMENTS", "STATE_FIELDS", "Parameter", "Term", "find_effect", "load_effect"]

EFFECTS: dict[str, Term] = {term.id: term for term in (*BODY_EFFECTS, *WIRE_EFFECTS, *CONTACT_EFFECTS, *SENSOR_EFFECTS)}
"""All effects by id, in the order in which they are summed."""


def find_effect(id: str) -> Term:
    """The effect called `id`. Raises ValueError naming those there are."""
    if id not in EFFECTS:
        raise ValueError(f"effect {id!r} is unknown; there is {', '.join(EFFECTS)}")
    return EFFECTS[id]


def load_effect(file: str | Path) -> Term:
    """The term that the Python file `file` calls TERM.

    Raises ValueError, naming the file, where there is none, where its id is one of ours, and where a hook calls another
    function of the file.
    """
    path = Path(file).resolve()
    if not path.is_file():
        raise ValueError(f"file = {str(file)!r} is not there: an effect of one's own is a Python file with TERM in it")
    name = f"hedgebed_effect_{path.stem}_{abs(hash(str(path))):x}"
    if name in sys.modules:
        return sys.modules[name].TERM
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"file = {str(file)!r} is no Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (SyntaxError, ImportError, NameError) as problem:
        raise ValueError(f"file = {str(file)!r} cannot be read: {problem}") from None
    term = getattr(module, "TERM", None)
    if not isinstance(term, Term):
        raise ValueError(f"file = {str(file)!r} has no TERM = rigid.terms.Term(...)")
    if term.id in EFFECTS or term.id in {base.id for base in BASE}:
        raise ValueError(f"file = {str(file)!r}: the id {term.id!r} is taken; choose another")
    for key, hook in term.hooks.items():
        _check_alone(hook, f"file = {str(file)!r}: hook {key!r}")
    sys.modules[name] = module
    return term


def _check_alone(hook: Callable[..., object], said: str) -> None:
    """Raise ValueError for a hook that calls a function of its own file: each is compiled by itself, and the call would
    come out as nothing, without an error."""
    own = getattr(hook, "__globals__", {})
    code = getattr(hook, "__code__", None)
    for called in code.co_names if code is not None else ():
        found = own.get(called)
        if isinstance(found, FunctionType) and found.__globals__ is own:
            raise ValueError(
                f"{said} calls {called}() of the same file: hooks are compiled one by one, so write what it does into "
                f"the hook itself"
            )
