"""`hedgebed effects`: the terms that may be added to the base model of tumbles, on the terminal."""

import math
import sys
from collections.abc import Sequence
from functools import partial

from rich.console import Console
from rich.table import Column, Table

from rigid.checks import nearest
from rigid.terms import EFFECTS, Term

__all__ = ["show_effects"]


def show_effects(names: Sequence[str] = ()) -> None:
    """Print a line for each effect, or all that is known of those in `names`. Raises ValueError for an unknown one."""
    for name in names:
        if name not in EFFECTS:
            raise ValueError(f"effect {name!r} is unknown; {nearest(name, EFFECTS)}")
    console = Console(file=sys.stdout, highlight=False)
    if names:
        for name in dict.fromkeys(names):
            _show_one(console, EFFECTS[name])
        return
    whole = partial(Column, no_wrap=True)
    table = Table(whole("effect"), "what it is", whole("give (unit)"), box=None, pad_edge=False)
    for term in EFFECTS.values():
        given = "\n".join(f"{term.id}.{p.name}" + ("" if p.unit == "1" else f" ({p.unit})") for p in term.parameters)
        table.add_row(term.id, term.summary + (" (rig only)" if term.needs_rig else ""), given)
    console.print(table, markup=False)
    print("\nhedgebed tumble --effects pendulum.length=2.2 com-offset.x=2e-4   sets several, in SI units")
    print("hedgebed effects pendulum                                         shows one in detail")


def _show_one(console: Console, term: Term) -> None:
    console.print(f"{term.id}: {term.summary}", markup=False, style="bold")
    for heading, words in (("acts on", term.acts), ("source", term.source), ("limits", term.limits)):
        console.print(f"  {heading}: {words}", markup=False)
    if term.needs_rig:
        console.print("  only in the rig", markup=False)
    for p in term.parameters:
        off = "infinite" if math.isinf(p.default) else f"{p.default:g}"
        about = ("" if p.unit == "1" else f"[{p.unit}] ") + f"{p.summary} ({off} if not given)"
        console.print(f"  --effects {term.id}.{p.name}=...  {about}", markup=False)
