"""The equation of each form of an effect, in the names of its parameters as diagnosis.json and model.toml have them.

Of penetration an equation that begins with + or - is added to F = K z + C max(v, 0); another one stands for K z.
Clauses after the first define what it uses, or say when it holds. They stand in the effects' own files (`rigid.terms`).
"""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from experiments.diagnose.fit.problem import Form
from rigid.terms import CANDIDATES, find_candidate
from rigid.terms.candidate import Bend, Push

__all__ = ["PENETRATION", "SYMBOLS", "TUMBLE", "equation", "equations_of", "with_comments"]

_TABLE, _WIDE = "[[effect]]\n", 118


def _equations(form: str, text: str, plain: str, bends: Sequence[Bend]) -> dict[str, str]:
    """Of a form and all that it is bent into."""
    effect, _, name = form.partition(":")
    found = {form: text}
    for place, bend in enumerate(bends):
        if plain in bend.of:
            bent = bend.equation if isinstance(bend.equation, str) else bend.equation(text)
            found |= _equations(f"{effect}:{bend.name.format(name)}", bent, plain, bends[place + 1 :])
    return found


def _of_pushes(effect: str, push: Push) -> dict[str, str]:
    """Id of each form of an effect, bent ones too -> its equation."""
    return {
        id: text
        for form in push.forms
        for id, text in _equations(f"{effect}:{form.name}", form.equation, form.name, push.bends).items()
    }


PENETRATION = {
    id: text
    for effect, candidate in CANDIDATES.items()
    if candidate.push is not None
    for id, text in _of_pushes(effect, candidate.push).items()
}
"""By the id of the form: what it makes of the force F [N] on the spike."""

TUMBLE = {id: candidate.tumble.equation for id, candidate in CANDIDATES.items() if candidate.tumble is not None}
"""By the name of the effect, whose forms have parameters of one equation."""

SYMBOLS = (
    "F is the force on the spike [N], z the depth and v the speed, downwards, z_m the deepest depth so far, "
    "r = z_m - z the way back, D the typical depth (`reference` in model.toml), H the height over which the tip "
    "widens, K and C the stiffness and damping after the fit; an equation that begins with + or - is added to "
    "F = K z + C max(v, 0), another one stands for K z; where several do, their factors of K z multiply, and what they "
    "add to K z is added. K is F / z where the factor is 1: for a power of z / D alone at z = D, a secant and not the "
    "stiffness at the surface"
)
"""What the equations of penetration have in common."""


def equation(kind: str, form: Form) -> str:
    """The equation of a form of trials of that kind; empty where the effect's file does not say it."""
    found = find_candidate(form.effect)
    if found is None:
        return ""
    if kind == "penetration":
        return _of_pushes(form.effect, found.push).get(form.id, "") if found.push is not None else ""
    return found.tumble.equation if found.tumble is not None else ""


def equations_of(kind: str, forms: Sequence[Form], units: Callable[[Form], Mapping[str, str]]) -> list[dict[str, Any]]:
    """``equations`` of diagnosis.json: effect, form, equation and its parameters' units, a row for each ``[[effect]]``
    of model.toml: of penetration one a form, of tumbles one an effect. `units`: of a form, name -> unit."""
    rows: dict[str, dict[str, Any]] = {}
    for form in forms:
        key = form.id if kind == "penetration" else form.effect
        row = rows.setdefault(key, {"effect": form.effect, "form": form.name, "equation": equation(kind, form),
                                    "units": {}})  # fmt: skip
        row["units"] |= dict(units(form))
    return list(rows.values())


def with_comments(model: str, rows: Sequence[Mapping[str, Any]], kind: str) -> str:
    """model.toml with the equation of each ``[[effect]]`` in a comment above it."""
    head, *tables = model.split(_TABLE)
    if len(tables) != len(rows):
        return model
    symbols = textwrap.fill(SYMBOLS, _WIDE, initial_indent="# ", subsequent_indent="# ") + "\n"
    text = head + (symbols if kind == "penetration" and tables else "")
    for table, row in zip(tables, rows, strict=True):
        said = f"{row['effect']} ({row['form']}): {row['equation'] or 'its equation is in its file'}"
        units = ", ".join(f"{name} [{unit}]" for name, unit in row["units"].items())
        text += textwrap.fill(f"{said}; {units}", _WIDE, initial_indent="# ", subsequent_indent="#   ") + "\n"
        text += _TABLE + table
    return text
