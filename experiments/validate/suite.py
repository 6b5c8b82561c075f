"""Every case of the verification suite, in the order of the table."""

from __future__ import annotations

import difflib
import hashlib
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from . import (
    books,
    cohesion,
    collisions,
    dosta,
    friction_angle,
    impact,
    integrator,
    intrusion,
    large_body,
    low_gravity,
    oblique,
    one_grain,
    peers,
    restitution,
    silo,
    sliding,
    slump,
    spinning,
)
from .case import Case

__all__ = ["SUITE", "chosen", "fingerprint", "fingerprint_of"]

SHARED = ("case.py", "spheres.py")
"""What cases of every family are computed by."""
NEEDS = {
    "books": ("cloud.py", "energy.py"),
    "peers": ("cloud.py",),
    "sliding": ("laws.py", "peers.py", "cloud.py"),
    "spinning": ("oblique.py",),
    "friction_angle": ("peers.py",),
    "slump": ("peers.py", "friction_angle.py"),
    "dosta": ("peers.py",),
    "low_gravity": ("drops.py", "parts.py"),
    "impact": ("drops.py", "parts.py"),
    "intrusion": ("drops.py", "parts.py"),
}
"""What else those of a module are."""

_MODULES = (
    one_grain,
    integrator,
    collisions,
    restitution,
    oblique,
    spinning,
    cohesion,
    books,
    silo,
    large_body,
    peers,
    sliding,
    friction_angle,
    slump,
    dosta,
    low_gravity,
    impact,
    intrusion,
)
SUITE: tuple[Case, ...] = tuple(case for module in _MODULES for case in module.CASES)


def chosen(only: Sequence[str] = (), *, quick: bool = False) -> list[Case]:
    """The cases that are to be run, in order: all, those named, or those that are not slow.

    Raises ValueError for a name that no case has, with the nearest.
    """
    known = {case.id: case for case in SUITE}
    for name in only:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
            raise ValueError(f"only = {name!r} is no case of the suite; {hint}")
    return [case for case in SUITE if (not only or case.id in only) and not (quick and case.slow)]


def fingerprint() -> str:
    """A digest of the bed's code and of the suite's."""
    return _digest(path for path in Path(__file__).parent.glob("*.py"))


def fingerprint_of(case: Case) -> str:
    """A digest of the bed's code and of what this case is computed by: a case that other code has finished is "
    "run again."""
    module = case.compute.__module__ if case.compute is not None else __name__
    own = sys.modules[module].__file__
    others = (*SHARED, *NEEDS.get(module.rpartition(".")[2], ()))
    return _digest([*([Path(own)] if own else []), *(Path(__file__).with_name(name) for name in others)])


def _digest(paths: Iterable[Path]) -> str:
    from dem.prepare import fingerprint as of_dem

    digest = hashlib.sha256(of_dem().encode())
    for path in sorted(paths):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
