"""The first lines of a diagnosis: what is missing, how far that closes the gap, how sure it is, what is left, and what
to do next; a few sentences made of diagnosis.json alone."""

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.diagnose.core.effect_texts import meaning
from experiments.diagnose.fit.evidence import SMALL
from experiments.diagnose.fit.gaps import numeral, size_words
from experiments.diagnose.noise.spectrum import line_sentence

from .candidates import say, unnamed_sentence
from .telling import remark_sentences, shares_words, size_sentences, small_names, sure_sentences, worse_sentences

__all__ = ["scatter_sentence", "summary_sentences", "title_words"]

_WORTH_SAYING = 0.5
"""Share of what is beyond the noise that a candidate without the best evidence must close to be called likeliest."""
_AS_LIKELY = 1.0  # nats within which another name is said beside the likeliest
_NAMES = 3  # candidates that are said where none is certain


def _only_stated_wrong(said: Mapping[str, Any]) -> str:
    """The numbers that were stated otherwise, where the base model leaves no more than noise with them; else empty."""
    if said["verdict"] != "unknown":
        return ""
    gaps = [gap for gap in said["gap"]["before"].values() if gap is not None]
    far = [bound["parameter"] for bound in said["at_bounds"]["before"] if bound["sigmas"] is not None]
    return " and ".join(far) if far and max(gaps) <= SMALL else ""


def title_words(said: Mapping[str, Any]) -> str:
    """The verdict in one line."""
    if wrong := _only_stated_wrong(said):
        return f"Unknown: {wrong} is not what campaign.toml says; with another number the model explains the trials"
    small = small_names(said)
    names = " and ".join([effect["id"] for effect in said["effects"] if effect["id"] not in small]
                         + [f"{name} (small: {size})" for name, size in small.items()])  # fmt: skip
    if said["verdict"] == "none":
        return "Nothing is missing: the model with its fitted parameters explains the trials"
    if said["verdict"] == "named":
        return f"Missing: {names}"
    if said["verdict"] == "ambiguous":
        return f"Missing: {names}, or {' or '.join(said['alternatives'])}: these trials cannot tell"
    if names:
        return f"Unknown: {names} for certain, and something beside it that no effect of the library explains"
    likeliest = _likeliest(said)
    also = f"; the likeliest is {likeliest}, not for certain" if likeliest else ""
    return f"Unknown: something is missing that no effect of the library explains{also}"


def summary_sentences(said: Mapping[str, Any]) -> list[str]:
    """What stands first in the report and on the terminal."""
    wrong = _only_stated_wrong(said)
    if said["verdict"] == "none":
        gap = said["gap"]["after"]
        out = "" if gap["held_out"] is None else f" and {numeral(gap['held_out'])} of those held out"
        first = [
            f"The base model leaves {numeral(gap['fit'])} a sample of the trials that were fitted{out} (1 is noise)."
        ]
    elif wrong:
        said_so = "; ".join(
            f"{bound['parameter']} {bound['sigmas']:+.1f} sigma off" for bound in said["at_bounds"]["before"]
            if bound["sigmas"] is not None
        )  # fmt: skip
        first = [say("stated_wrong", said_so=said_so, wrong=wrong)]
    elif said["verdict"] == "unknown":
        first = [*_candidates(said), *_left(said), *worse_sentences(said)]
    else:
        first = [*sure_sentences(said), *worse_sentences(said)]
    ask = said["next_experiment"]
    if wrong:
        ask = say("check_units", wrong=wrong)
    return [*_doubts(said), *first, *scatter_sentence(said), f"Next experiment: {ask}"]


def _doubts(said: Mapping[str, Any]) -> list[str]:
    """What in the recordings may be all that stands behind a name."""
    found = [finding["what"] for finding in said.get("findings", []) if finding.get("doubt")]
    if not found or (said["verdict"] == "none" and said["gap"]["after"]["fit"] <= SMALL):
        return []
    more = f" (and {len(found) - 1} more, see the warnings)" if len(found) > 1 else ""
    return [f"To be put right first, for it may be all that is behind this: {found[0]}{more}."]


def scatter_sentence(said: Mapping[str, Any]) -> list[str]:
    """The gap weighed against what replicates differ by as well, where they differ by more than the sensors."""
    weighed = said.get("gap_with_scatter")
    if weighed is None:
        return []
    key = "weighed_none" if said["verdict"] == "none" else "weighed_both"
    before, after = _both(weighed["before"]), _both(weighed["after"], weighed)
    return [say(key, scatter=_scatter(said), before=before, after=after, rests_on=_rests_on(weighed))]


def _scatter(said: Mapping[str, Any]) -> str:
    """By how much replicates differ, in parentheses: a channel in its unit, a trial's own factor in per cent."""
    parts = [f"{kind.replace('_', ' ')} {size_words(kind, std)}" for kind, std in said.get("model_std", {}).items()]
    return f" ({', '.join(parts)})" if parts else ""


def _both(gap: Mapping[str, float | None], weighed: Mapping[str, Any] | None = None) -> str:
    """`weighed`: `gap_with_scatter`, for the standard errors of its `after`."""
    errors = {} if weighed is None else weighed.get("after_std", {})

    def told(key: str) -> str:
        error = errors.get(key)
        return numeral(gap[key] or 0.0) if error is None else f"{gap[key]:.2f} +- {error:.1g}"

    out = "" if gap["held_out"] is None else f" ({told('held_out')} held out)"
    return f"{told('fit')} fitted{out}"


def _rests_on(weighed: Mapping[str, Any]) -> str:
    """How well it is known what replicates differ by."""
    freedom = weighed.get("freedom")
    if not freedom:
        return ""
    return f"; what replicates differ by rests on {freedom} degree{'s' if freedom > 1 else ''} of freedom"


def _likeliest(said: Mapping[str, Any]) -> str:
    """The names of the best model, or of the candidate that closes most; empty where it is little."""
    leading = said.get("leading", {})
    names, near = leading.get("effects", []), leading.get("nearest")
    if names:
        also = near is not None and not near["told_apart"] and near["evidence_behind"] < _AS_LIKELY
        return " + ".join(names) + (f" or {near['effect']}" if also else "")
    rows = _singles(said)
    return str(rows[0]["effects"][0]) if rows and (rows[0].get("closes") or 0.0) >= _WORTH_SAYING else ""


def _candidates(said: Mapping[str, Any]) -> list[str]:
    """Which names lead, how far each closes the gap, and how sure it is."""
    leading = said.get("leading", {"effects": [], "certain": [], "nearest": None})
    if not leading["effects"]:
        rows = _singles(said)
        if not rows:
            return ["No effect of the library could be tried."]
        listed = _closing(sorted(rows, key=lambda row: -(row.get("closes") or 0.0))[:_NAMES])
        return [f"No effect of the library explains it: of what the base model leaves beyond the noise, {listed}."]
    certain = leading["certain"]
    others = [name for name in leading["effects"] if name not in certain]
    sentences = [words for name in leading["effects"] if (words := meaning(name))]
    sure = f"Certain: {' and '.join(certain)}" if certain else ""
    maybe = f"{'likeliest' if certain else 'Likeliest'}, but not certain: {' and '.join(others)}" if others else ""
    row = next((r for r in said["evidence"] if sorted(r["effects"]) == sorted(leading["effects"])), None)
    nats = "" if row is None else f" ({row['score']:.0f} nats over the base model{_weighed(said)})"
    parts = "; ".join(part for part in (sure, maybe) if part)
    first = f"{parts}{nats}: it takes the gap {_closes(said['gap'])}"
    near = leading["nearest"]
    if near is not None:
        apart = "these trials tell the two apart" if near["told_apart"] else "these trials do not tell the two apart"
        first += say("nearest", near=near, apart=apart)
    sentences.append(f"{first}.")
    sentences += [*_numbers(leading), *size_sentences(said), *remark_sentences(said), *unnamed_sentence(said)]
    rest = [row for row in _singles(said) if row["effects"][0] not in leading["effects"]][: _NAMES - 1]
    if rest and not certain:
        sentences.append(f"Of what the base model leaves beyond the noise{_weighed(said)}, {_closing(rest)}.")
    return [*sentences, *_why_unknown(said)]


_LOST = 100.0  # A standard error over the value itself [1] past which it is none: the curvature there is round-off


def _numbers(leading: Mapping[str, Any]) -> list[str]:
    """The parameters of names that are not certain, which stand in no table."""
    parts = []
    for effect, parameters in leading.get("parameters", {}).items():
        for name, told in parameters.items() if effect not in leading["certain"] else ():
            error = f" +- {told['std']:.2g}" if told["std"] > 0 else ""
            lost = told["std"] > _LOST * abs(told["value"]) > 0  # nothing that was seen changes with it there
            value = f"{effect} {name} {told['value']:.4g}{'' if lost else error} {told['unit']}".removesuffix(" 1")
            parts.append(f"{value} (no standard error: a little more or less of it changes nothing)" if lost else value)
    return [f"Its numbers, should it be that: {', '.join(parts)}."] if parts else []


def _why_unknown(said: Mapping[str, Any]) -> list[str]:
    """What keeps the leading candidate from being the verdict."""
    gate = said["gate"]
    strained = [bound for bound in said["at_bounds"]["after"] if bound["sigmas"] is not None]
    reasons = [
        f"{numeral(score['score'])} on {which} (a right model: {score['threshold']:.3g} at most)"
        for which, score in (("the fitted trials", gate["after"]), ("those held out", gate.get("held_out")))
        if score is not None and not score["passed"]
    ]
    said_so = [f"the gate stands at {' and at '.join(reasons)}"] if reasons else []
    said_so += [f"it needs {bound['parameter']} {bound['sigmas']:+.1f} sigma off what was stated" for bound in strained]
    return [f"It is not the whole answer: {'; '.join(said_so)}."] if said_so else []


def _weighed(said: Mapping[str, Any]) -> str:
    """Against what candidates were weighed, where it is not the sensors alone."""
    return ", weighed against what replicates differ by" if said.get("evidence_base", {}).get("with_scatter") else ""


def _singles(said: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The best form of every single name, the likeliest first."""
    best: dict[str, Mapping[str, Any]] = {}
    for row in said["evidence"]:
        if len(row["effects"]) == 1:
            best.setdefault(row["effects"][0], row)
    return list(best.values())


def _closing(rows: Sequence[Mapping[str, Any]]) -> str:
    """layering would take away 40 %, adhesion 3 %"""
    first, *others = [(row["effects"][0], _share(row.get("closes"))) for row in rows]
    return f"{first[0]} would take away {first[1]}" + "".join(f", {name} {share}" for name, share in others)


def _share(share: float | None) -> str:
    if share is None:
        return "nothing"
    return "nothing" if share < 0.005 else "all" if share > 0.995 else f"{100 * share:.0f} %"


def _closes(gap: Mapping[str, Any]) -> str:
    """From what to what, and which share of what is beyond the noise that is, fitted and held out."""
    parts = []
    for key, words in (("fit", "on the trials that were fitted"), ("held_out", "on those held out")):
        before, after = gap["before"][key], gap["after"][key]
        if before is None or after is None:
            continue
        share = f", {_share(1 - max(after - 1, 0.0) / (before - 1))} of what is beyond the noise" if before > 1 else ""
        parts.append(f"from {numeral(before)} to {numeral(after)} {words}{share}")
    return " and ".join(parts)


def _left(said: Mapping[str, Any]) -> list[str]:
    """Where the best model still fails, and what the missing force goes with."""
    sentences = []
    places = said.get("left", [])
    if places:
        total = sum(place["excess"] for place in places)
        phase, channel = (shares_words(places, key, total) for key in ("phase", "channel"))
        first = places[0]
        beyond = ", beyond what replicates differ by," if "gap_with_scatter" in said else ""
        sentences.append(say("left", beyond=beyond, phase=phase, channel=channel, first=first))
    if "latent" in said:
        sentences.append(f"The force that is missing goes with {said['latent']['depends_on']}.")
        sentences += [line_sentence(row) for row in said["latent"].get("lines", [])]
    return sentences
