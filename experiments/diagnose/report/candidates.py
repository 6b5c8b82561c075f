"""The candidates in a table: a row for each set of effects, and why one that scores better is not named."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from vis.page.sentences import Sentences

__all__ = ["candidate_rows", "no_better", "say", "unnamed_sentence"]

say = Sentences(__package__)

_MORE = 0.05  # nats by which a set of effects must beat each of its parts to be listed
_SETS = 4  # sets of effects that are listed beside the one that is named
_WORTH_SAYING = 1.0  # nats by which a candidate must beat what is named to be mentioned

Row = Mapping[str, Any]


def candidate_rows(said: Mapping[str, Any]) -> list[dict[str, Any]]:
    """``candidates`` of diagnosis.json: the best form of each effect, of what is named, and of the sets of effects that
    beat all of their parts; the likeliest first, those no better than the base model last."""
    best: dict[frozenset[str], Row] = {}
    tried = Counter(frozenset(row["effects"]) for row in said.get("evidence", []))
    for row in said.get("evidence", []):
        names = frozenset(row["effects"])
        if names not in best or row["score"] > best[names]["score"]:
            best[names] = row
    alone = {name: row["score"] for names, row in best.items() for name in names if len(names) == 1}
    order = _told(said)
    told = frozenset(order)
    sets = [names for names, row in best.items()
            if len(names) > 1 and all(row["score"] > alone.get(name, 0.0) + _MORE for name in names)]  # fmt: skip
    sets.sort(key=lambda names: -best[names]["score"])
    shown = [names for names in best if len(names) == 1 or names == told or names in sets[:_SETS]]
    shown.sort(key=lambda names: -best[names]["score"])
    base = said.get("evidence_base", {}).get("left")

    def left(row: Row) -> float | None:
        """At amplitude 0 every form is the base model, which was fitted once more after the candidates."""
        return min(row["left"], base) if "left" in row and base is not None else row.get("left")

    return [
        {"candidate": _written(best[names], alone, order), "effects": _ordered(names, alone, order),
         "score": best[names]["score"], "left": left(best[names]), "closes": best[names].get("closes"),
         "tried": tried[names], "better": best[names]["score"] > 0, "note": _note(said, names, best, told)}
        for names in shown
    ]  # fmt: skip


def no_better(rows: Sequence[Row]) -> str:
    """The effects that are no better than the base model, as a clause; empty where all are."""
    names = [" + ".join(row["effects"]) for row in rows if not row["better"]]
    return f"no better than the base model with its parameters fitted: {', '.join(names)}" if names else ""


def unnamed_sentence(said: Mapping[str, Any]) -> list[str]:
    """A candidate that is likelier than what is named: which, and why it is not named."""
    rows = candidate_rows(said)
    own = next((row for row in rows if {*row["effects"]} == {*_told(said)}), None)
    ahead = [row for row in rows if own is not None and row["score"] > own["score"] + _WORTH_SAYING and row["note"]]
    if own is None or not ahead:
        return []
    row = ahead[0]
    what = "is not told" if said["effects"] else "does not lead"
    names, ours = (" + ".join(one["effects"]) for one in (row, own))
    return [say("most_evidence", names=names, more=row["score"] - own["score"], own=ours, what=what, row=row)]


def _told(said: Mapping[str, Any]) -> tuple[str, ...]:
    """The effects that are named, or of an unknown the best model's, in order."""
    names = tuple(effect["id"] for effect in said.get("effects", ()))
    leading = tuple(said.get("leading", {}).get("effects", ()))
    return leading if said["verdict"] == "unknown" and leading else names


def _ordered(names: frozenset[str], alone: Mapping[str, float], told: Sequence[str]) -> list[str]:
    """What is named first, then those that explain most alone."""
    place = {name: k for k, name in enumerate(told)}
    return sorted(names, key=lambda name: (place.get(name, len(place)), -alone.get(name, -1e300), name))


def _written(row: Row, alone: Mapping[str, float], told: Sequence[str]) -> str:
    """``a:one + two + b:three``: effects in order, each once, with its forms."""
    forms: dict[str, list[str]] = {}
    for part in row.get("candidate", " + ".join(row["effects"])).split(" + "):
        effect, _, form = part.partition(":")
        forms.setdefault(effect, []).append(form)
    order = _ordered(frozenset(forms), alone, told)
    return " + ".join(f"{effect}:{' + '.join(forms[effect])}".removesuffix(":") for effect in order)


def _note(
    said: Mapping[str, Any], names: frozenset[str], best: Mapping[frozenset[str], Row], told: frozenset[str]
) -> str:
    """How a candidate relates to the one that is named; of one that is likelier, why it is not named."""
    if names == told:
        return {"named": "told", "ambiguous": "told, or another"}.get(said["verdict"], "leads")
    if not told or told not in best:
        return ""
    if said["verdict"] == "ambiguous" and any(names == {other, *_told(said)[1:]} for other in said["alternatives"]):
        return "cannot be told from it"
    own, row = best[told], best[names]
    more = row["score"] - own["score"]
    if more <= 0:
        return ""
    together = " + ".join(_told(said))
    if names > told or len(names) > len(told):
        if said.get("gate", {}).get("after", {}).get("passed"):
            return f"is not needed: {together} leaves no more than noise"
        left, whole = own.get("left") or 0.0, said.get("evidence_base", {}).get("left") or 0.0
        if left <= 0:
            return f"takes up noise: what {together} leaves is no more"
        what = "a further name" if names > told else f"{len(names)} names in the place of {together}"
        share = f"{100 * (left - row['left']) / left:.0f} % of what {together} leaves"
        of_base = f", {100 * (left - row['left']) / whole:.2g} % of what the base model leaves" if whole > 0 else ""
        return f"gains {more:.1f} nats, {share}{of_base}: less than {what} must"
    other = next((r for r in said.get("equivalence", [])[1:] if r["effect"] in names - told), None)
    if other is not None and (other.get("left_out_behind") or 0.0) > 0:
        return f"predicts conditions that were left out worse, by {other['left_out_behind']:.0f} nats"
    return "does not stand when noise and names are looked at together"
