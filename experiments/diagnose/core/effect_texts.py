"""What the effects' own files (`rigid.terms`) state in words and equations: meaning, confirming trial, law of a form.

Equations have the parameters' names of diagnosis.json and model.toml. Of penetration an equation that begins with + or
- is added to F = K z + C max(v, 0); another one replaces K z. Clauses after the first define its symbols, or state when
it holds.
"""

import textwrap
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.diagnose.fit.problem import Form
from rigid.terms import CANDIDATES, find_candidate
from rigid.terms.candidate import Bend, Push

__all__ = ["PENETRATION", "SYMBOLS", "TUMBLE", "advice", "confirmation", "equation", "equations_of", "form_meaning",
           "meaning", "push_advice", "with_comments"]  # fmt: skip

_FORMS: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_name("forms.toml").read_text(encoding="utf-8"))
_TABLE, _WIDE = "[[effect]]\n", 118
_BY_DIAMETER = '"fitted_by_diameter" = '
_OF_DIAMETERS = """\
# K [N/m] and C [N s/m] of each diameter [m]; [surface] has those of the diameter in [spike]. `hedgebed penetrate
# --model` uses the entry of its --tip-diameter, or a power law through the nearest two."""


def _equations(form: str, text: str, plain: str, bends: Sequence[Bend]) -> dict[str, str]:
    """Of a form and all that it is bent into."""
    effect, _, name = form.partition(":")
    found = {form: text}
    for place, bend in enumerate(bends):
        if plain in bend.of:
            bent = bend.equation if isinstance(bend.equation, str) else bend.equation(text)
            found |= _equations(f"{effect}:{bend.name.format(name)}", bent, plain, bends[place + 1 :])
    return found


def _of_pushes(effect: str, push: Push | None) -> dict[str, str]:
    """Id of each form of an effect, bent ones too -> its equation; none where the effect has none of pushes."""
    if push is None:
        return {}
    forms = [_equations(f"{effect}:{form.name}", form.equation, form.name, push.bends) for form in push.forms]
    return {id: text for form in forms for id, text in form.items()}


PENETRATION = {id: text for effect, known in CANDIDATES.items() for id, text in _of_pushes(effect, known.push).items()}
"""By the id of the form: what it makes of the force F [N] on the spike."""

TUMBLE = {id: known.tumble.equation for id, known in CANDIDATES.items() if known.tumble is not None}
"""By the name of the effect, whose forms have parameters of one equation."""

_BODY = {True: {"{one}": "the tip", "{body}": "tip"}, False: {"{one}": "one spike", "{body}": "spike"}}
"""What goes into the ground, in trials of penetration and in others."""

SYMBOLS = (
    "F is the force on the spike [N], z the depth and v the speed, downwards, z_m the deepest depth so far, "
    "r = z_m - z the way back, D the typical depth (`reference` in model.toml), H the height over which the tip "
    "widens, K and C the stiffness and damping after the fit. F = f(z) + C max(v, 0), where f is K z, or an equation "
    "in its place. Of several, the factors of K z multiply, and their terms add to it. An equation with 'on the way "
    "back' stands for f(z) there. One that begins with + or - is added to F. K is f / z where the factor is 1: for a "
    "power of z / D alone at z = D, a secant and not the stiffness at the surface"
)
"""What the equations of penetration have in common."""


def meaning(effect: str) -> str:
    """One sentence on what the effect is; empty where its file does not say it."""
    found = find_candidate(effect)
    return f"{effect}: {found.meaning}." if found is not None else ""


def form_meaning(form: str) -> str:
    """What a form such as ``plastic-sinkage:crater, empty`` is, in a clause; empty for effects of one's own."""
    effect, _, name = form.partition(":")
    known = _FORMS.get(effect, {})
    return "; ".join(known[part] for part in name.split(", ") if part in known)


def confirmation(effect: str, kind: str) -> str:
    """One sentence: the trial or bench measurement that would show the effect by itself. What goes down is a tip in
    trials of penetration, and one spike of a platform in others: `_BODY` has the words for {one} and {body}."""
    found = find_candidate(effect)
    otherwise = "change what is thought to cause it and repeat a trial: the effect should follow"
    said = found.confirm if found is not None else otherwise
    for place, words in _BODY[kind == "penetration"].items():  # braces of other files than ours stay as they are
        said = said.replace(place, words)
    return f"To confirm {effect}: {said}."


def advice(first: str, second: str) -> str:
    """One sentence: the measurements that separate two effects of tumbles."""
    found = [(id, find_candidate(id)) for id in (first, second)]
    known = [(id, one.tumble.bench) for id, one in found if one and one.tumble and one.tumble.bench]
    what = known[0][1] if known else "repeat the trials at another torque and gravity"
    if len(known) == 2:
        what = ", and ".join(f"{bench} ({id})" for id, bench in known)
    return f"To tell {first} from {second}: {what}."


def push_advice(first: str, second: str) -> str:
    """One sentence: the push that separates two effects of penetration."""
    for one, other in ((first, second), (second, first)):
        found = find_candidate(one)
        if found is not None and found.push is not None and other in found.push.apart:
            return found.push.apart[other]
    return (
        f"Drive the tip in and out at two speeds a factor of ten apart, to twice the depth reached here: {first} and "
        f"{second} part where speed, direction and depth change one at a time."
    )


def equation(kind: str, form: Form) -> str:
    """The equation of a form of trials of that kind; empty where the effect's file does not state it."""
    found = find_candidate(form.effect)
    if found is None:
        return ""
    if kind == "penetration":
        return _of_pushes(form.effect, found.push).get(form.id, "")
    return found.tumble.equation if found.tumble is not None else ""


def equations_of(kind: str, forms: Sequence[Form], units: Callable[[Form], Mapping[str, str]]) -> list[dict[str, Any]]:
    """``equations`` of diagnosis.json: effect, form, equation, its parameters' units and what K is beside it, where
    that is another than of a straight spring. A row for each ``[[effect]]`` of model.toml: of penetration one a form,
    of tumbles one an effect. `units`: of a form, name -> unit."""
    rows: dict[str, dict[str, Any]] = {}
    for form in forms:
        key = form.id if kind == "penetration" else form.effect
        row = rows.setdefault(key, {"effect": form.effect, "form": form.name, "equation": equation(kind, form),
                                    "units": {}})  # fmt: skip
        row["units"] |= dict(units(form))
        if form.stiffness:
            row["stiffness"] = form.stiffness
    return list(rows.values())


def with_comments(model: str, rows: Sequence[Mapping[str, Any]], kind: str) -> str:
    """model.toml with the equation of each ``[[effect]]``, and what K by diameter is, in comments above them."""
    model = model.replace(_BY_DIAMETER, f"{_OF_DIAMETERS}\n{_BY_DIAMETER}", 1)
    head, *tables = model.split(_TABLE)
    if len(tables) != len(rows):
        return model
    symbols = textwrap.fill(SYMBOLS, _WIDE, initial_indent="# ", subsequent_indent="# ") + "\n"
    text = head + (symbols if kind == "penetration" and tables else "")
    for table, row in zip(tables, rows, strict=True):
        said = f"{row['effect']} ({row['form']}): {row['equation'] or 'its equation is in its file'}"
        units = ", ".join(f"{name} [{unit}]" for name, unit in row["units"].items())
        units += f"; K [N/m]: {row['stiffness']}" if "stiffness" in row else ""
        text += textwrap.fill(f"{said}; {units}", _WIDE, initial_indent="# ", subsequent_indent="#   ") + "\n"
        text += _TABLE + table
    return text
