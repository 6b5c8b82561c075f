"""The first lines of a diagnosis, a few sentences made of diagnosis.json alone. They say what is missing, how far that
closes the gap, how sure it is, what is left, and what to do next."""

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.diagnose.core.effect_texts import meaning
from experiments.diagnose.fit.evidence import SMALL
from experiments.diagnose.fit.gaps import numeral, size_words
from experiments.diagnose.noise.spectrum import line_sentence
from vis.diagnose.held_out import worsens_held_out
from vis.diagnose.usable import gap_in_scatter
from vis.page.numbers import fitted, foldable

from .machine import machine_sentences
from .sentences import (
    behind_words,
    remark_sentences,
    say,
    shares_words,
    size_sentences,
    small_names,
    sure_sentences,
    unnamed_sentence,
    worse_sentences,
)
from .to_use import (
    law_sentences,
    near_model_sentences,
    neutral_sentences,
    number_words,
    peak_sentences,
    stated_sentences,
    use_sentences,
)

__all__ = ["scatter_sentence", "summary_sentences", "title_words"]

_WORTH_SAYING = 0.5  # share of the excess that a candidate without the best evidence closes to be called likeliest
_AS_LIKELY = 1.0  # nats within which another effect is reported beside the likeliest
_SHOWN = 3  # candidates that are reported where none is certain
_LOST = 100.0  # a standard error over the value itself past which it is none: the curvature there is round-off


def _strained(diagnosis: Mapping[str, Any], stage: str) -> list[Mapping[str, Any]]:
    """Parameters far from the stated value."""
    return [bound for bound in diagnosis["at_bounds"][stage] if bound["sigmas"] is not None]


def _only_stated_wrong(diagnosis: Mapping[str, Any]) -> str:
    """The numbers that were stated otherwise, where the base model leaves no more than noise with them; else empty."""
    if diagnosis["verdict"] != "unknown":
        return ""
    gaps = [gap for gap in diagnosis["gap"]["before"].values() if gap is not None]
    far = [bound["parameter"] for bound in _strained(diagnosis, "before")]
    return " and ".join(far) if far and max(gaps) <= SMALL else ""


def title_words(diagnosis: Mapping[str, Any]) -> str:
    """The verdict in one line."""
    if wrong := _only_stated_wrong(diagnosis):
        return f"Unknown: {wrong} is not what campaign.toml states; with another value the model explains the trials"
    small = small_names(diagnosis)
    names = " and ".join([effect["id"] for effect in diagnosis["effects"] if effect["id"] not in small]
                         + [f"{name} (small: {size})" for name, size in small.items()])  # fmt: skip
    if "noise_found" in diagnosis:
        times = numeral(max(row["found"] / row["stated"] for row in diagnosis["noise_found"].values()), 2)
        stds = ", ".join(f"{row['found']:.2g} {row['unit']} for {name}" for name, row in _noisier(diagnosis).items())
        return say("noisy_title", times=times, stds=stds)
    if diagnosis["verdict"] == "none":
        return "Nothing is missing: the model with its fitted parameters explains the trials"
    if diagnosis["verdict"] == "named":
        return f"Missing: {names}"
    if diagnosis["verdict"] == "ambiguous":
        others = " or ".join(diagnosis["alternatives"])
        if len(diagnosis["effects"]) == 1 or small:
            return f"Missing: {names}, or {others}: these trials cannot distinguish them"
        first, *rest = (effect["id"] for effect in diagnosis["effects"])  # the alternatives are in place of the first
        return f"Missing: {' and '.join(rest)}, and {first} or {others}: these trials cannot distinguish the last"
    if worsens_held_out(diagnosis):
        return "Unknown: something is missing; no effect of the library explains it with the values fitted here"
    if names:
        return f"Unknown: {names} with confidence, and something else that no effect of the library explains"
    likeliest = _likeliest(diagnosis)
    also = f"; the most likely is {likeliest}, not with confidence" if likeliest else ""
    return f"Unknown: something is missing that no effect of the library explains{also}"


def _noisier(diagnosis: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The channels whose noise exceeds the stated one by what matters."""
    rows = diagnosis["noise_found"].items()
    return {name: row for name, row in rows if (row["found"] / row["stated"]) ** 2 > SMALL}


def summary_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """What stands first in the report and on the terminal."""
    ask = diagnosis["next_experiment"]
    if diagnosis["verdict"] == "none":
        gap = diagnosis["gap"]["after"]
        out = "" if gap["held_out"] is None else f" and {numeral(gap['held_out'])} on held-out trials"
        first = [f"The gap of the base model is {numeral(gap['fit'])} on fitted trials{out} (1 is noise)."]
    elif wrong := _only_stated_wrong(diagnosis):
        off = [f"{bound['parameter']} {bound['sigmas']:+.1f} sigma off" for bound in _strained(diagnosis, "before")]
        first, ask = [say("stated_wrong", said_so="; ".join(off), wrong=wrong)], say("check_units", wrong=wrong)
    elif "noise_found" in diagnosis:
        rows = _noisier(diagnosis).items()
        stds = ", ".join(f"{name} {row['found']:.2g} {row['unit']} (stated {row['stated']:.2g})" for name, row in rows)
        gap = {key: "-" if value is None else numeral(value) for key, value in diagnosis["gap"]["after"].items()}
        first = [say("noisy", gap=gap, stds=stds)]
    elif diagnosis["verdict"] == "unknown":
        first = [*_candidates(diagnosis), *_left(diagnosis)]
    else:
        first = sure_sentences(diagnosis)
    if diagnosis["verdict"] != "unknown":
        first += [*_residue(diagnosis), *_allowed(diagnosis)]
    aside = list(dict.fromkeys(row["trial"] for row in diagnosis.get("set_aside", [])))
    apart = [say("took_no_part", trials=", ".join(aside))] if aside else []
    use = [*use_sentences(diagnosis), *stated_sentences(diagnosis), *law_sentences(diagnosis)]
    doubts = [*_doubts(diagnosis), *_stated_far(diagnosis), *machine_sentences(diagnosis),
              *remark_sentences(diagnosis), *peak_sentences(diagnosis), *worse_sentences(diagnosis),
              *neutral_sentences(diagnosis), *_no_replicates(diagnosis)]  # fmt: skip
    return [*doubts, *use, *apart, *first, *scatter_sentence(diagnosis), *near_model_sentences(diagnosis),
            f"Next experiment: {ask}"]  # fmt: skip


def _stated_far(diagnosis: Mapping[str, Any]) -> list[str]:
    """Which numbers of the best model are far from what campaign.toml states, and what to do about it: a stated value
    may be wrong, a template's for example. None where the verdict is about just that."""
    far = _strained(diagnosis, "after")
    if not far or _only_stated_wrong(diagnosis):
        return []
    listed = "; ".join(_far_words(bound) for bound in far)
    kind = diagnosis.get("kind", "tumble")
    return [say("check_stated", listed=listed, widen=say(f"widen_{kind}"))]


def _far_words(bound: Mapping[str, Any]) -> str:
    """stiffness = 2275 N/m is +15.3 sigma from the stated 900 (sigma 90)"""
    unit = "" if bound["unit"] == "1" else f" {bound['unit']}"
    stated = f"{bound['stated']:.4g} (sigma {bound['stated_std']:.2g})" if bound.get("stated_std") else "value"
    return f"{bound['parameter']} = {bound['value']:.4g}{unit} is {bound['sigmas']:+.1f} sigma from the stated {stated}"


def _residue(diagnosis: Mapping[str, Any]) -> list[str]:
    """Whether the model predicts, or how large what is left is; which numbers absorb a difference in structure."""
    sentences = []
    left = diagnosis.get("residue", []) if "gap_with_scatter" not in diagnosis else []
    held = {row["channel"]: row for row in diagnosis.get("by_channel", []) if row["held_out"]}
    known = [held[row["channel"]] for row in left if row["channel"] in held]
    if known:
        parts = [say("predicts_one", channel=row["channel"], unit=row["unit"], after=row["rms_after"],
                     before=row["rms_before"], noise=row["noise_after"]) for row in known]  # fmt: skip
        more = (diagnosis["gap"]["after"]["held_out"] or 0.0) > SMALL
        judged = say("predicts_more" if more else "predicts_noise")
        sentences.append(say("predicts", sizes=", ".join(parts), judged=judged))
    elif left:
        sizes = ", ".join(f"{row['rms']:.2g} {row['unit']} in {row['channel']}" for row in left)
        sentences.append(say("residue", sizes=sizes))
    if far := _strained(diagnosis, "after"):
        names = " and ".join(f"{bound['parameter']} ({bound['sigmas']:+.1f} sigma)" for bound in far)
        sentences.append(say("absorbs", names=names))
    return sentences


def _allowed(diagnosis: Mapping[str, Any]) -> list[str]:
    """The rule that lets the verdict pass; a folder of an older hedgebed has none."""
    if "allowed_by" not in diagnosis:
        return []
    held_out = diagnosis["gap"]["after"]["held_out"] is not None
    both = held_out and (diagnosis["allowed_by"] != "chance" or "held_out" in diagnosis["gate"])
    rule = say(
        f"allowed_{diagnosis['allowed_by']}",
        held_out="held-out " if held_out else "",
        with_scatter=say("with_scatter_as_noise") if "gap_with_scatter" in diagnosis else "",
        on_both=say("on_both_parts" if both else "on_fitted"),
        shares=_shares(diagnosis.get("shares_left", [])),
    )
    return [say("allowed", rule=rule)]


def _shares(left: Sequence[float]) -> str:
    """: 0.31 % on fitted trials and 0.42 % on held-out trials"""
    parts = zip(left, ("fitted", "held-out"), strict=False)
    told = [say("share_left", share=100 * max(share, 0.0), trials=trials) for share, trials in parts]
    return f": {' and '.join(told)}" if told else say("on_fitted")


def _doubts(diagnosis: Mapping[str, Any]) -> list[str]:
    """Faults of the recordings that may be all there is behind an effect."""
    aside = {row["trial"] for row in diagnosis.get("set_aside", [])}  # what took no part causes nothing
    doubts = [f for f in diagnosis.get("findings", []) if f.get("doubt") and f.get("trial") not in aside]
    doubts.sort(key=lambda finding: finding.get("maybe_effect", False))  # sure faults first
    found = [finding["what"] for finding in doubts]
    if not found or (diagnosis["verdict"] == "none" and diagnosis["gap"]["after"]["fit"] <= SMALL):
        return []
    more = f" (and {len(found) - 1} more, see the warnings)" if len(found) > 1 else ""
    ask = "Check this" if doubts[0].get("maybe_effect") else "Correct this first"
    return [f"{ask}, because it may be the whole cause: {found[0]}{more}."]


def scatter_sentence(diagnosis: Mapping[str, Any]) -> list[str]:
    """The gap weighed against what replicates differ by as well, where they differ by more than the sensors."""
    weighed = diagnosis.get("gap_with_scatter")
    if weighed is None:
        return []
    scatter = diagnosis.get("model_std", {})
    kinds = [kind.replace("_", " ") + ("" if len(scatter) > 1 else f" {size_words(kind, std)}")
             for kind, std in scatter.items()]  # fmt: skip
    apart = say("inseparable") if len(kinds) > 1 else ""
    freedom = weighed.get("freedom")
    s = "" if freedom == 1 else "s"
    return [say(
        "weighed_none" if diagnosis["verdict"] == "none" else "weighed_both",
        scatter=f" ({' and '.join(kinds)}{apart})" if kinds else "", before=_both(diagnosis, "before"),
        after=_both(diagnosis, "after"),
        rests_on=f"; the scatter has {freedom} degree{s} of freedom" if freedom else "",
    )]  # fmt: skip


def _no_replicates(diagnosis: Mapping[str, Any]) -> list[str]:
    """That no trial repeats another, so that the scatter between trials is unknown."""
    return [] if diagnosis.get("has_replicates", True) else [say(f"no_replicates_{diagnosis['kind']}")]


def _both(diagnosis: Mapping[str, Any], stage: str) -> str:
    """The gap with the scatter of replicates, fitted and held out, with halves of 95 % intervals."""

    def written(part: str) -> str:
        gap = gap_in_scatter(diagnosis, part, stage)
        return numeral(gap["value"] or 0.0) if gap["std"] is None else foldable(fitted(gap))

    out = "" if diagnosis["gap_with_scatter"][stage]["held_out"] is None else f" ({written('held_out')} held out)"
    return f"{written('fit')} fitted{out}"


def _likeliest(diagnosis: Mapping[str, Any]) -> str:
    """The effects of the best model, or the candidate that closes most; empty where it is little."""
    leading = diagnosis.get("leading", {})
    names, near = leading.get("effects", []), leading.get("nearest")
    if names:
        also = near is not None and not near["told_apart"] and near["evidence_behind"] < _AS_LIKELY
        return " + ".join(names) + (f" or {near['effect']}" if also else "")
    rows = _singles(diagnosis)
    return str(rows[0]["effects"][0]) if rows and (rows[0].get("closes") or 0.0) >= _WORTH_SAYING else ""


def _candidates(diagnosis: Mapping[str, Any]) -> list[str]:
    """Which effects lead, how far each closes the gap, and how sure it is."""
    leading = diagnosis.get("leading", {"effects": [], "certain": [], "nearest": None})
    if not leading["effects"]:
        rows = _singles(diagnosis)
        if not rows:
            return ["No effect of the library could be tried."]
        listed = _closing(sorted(rows, key=lambda row: -(row.get("closes") or 0.0))[:_SHOWN])
        costs = "" if any(row["score"] > 0 for row in rows) else f" {say('costs_more')}"
        return [f"No effect of the library explains the misfit. Of the excess, {listed}.{costs}"]
    if worsens_held_out(diagnosis):
        gaps = {stage: numeral(diagnosis["gap"][stage]["held_out"]) for stage in ("before", "after")}
        return [say("worse_held_out", names=" + ".join(leading["effects"]), **gaps)]
    certain = leading["certain"]
    others = [name for name in leading["effects"] if name not in certain]
    sentences = [words for name in leading["effects"] if (words := meaning(name))]
    sure = f"With confidence: {' and '.join(certain)}" if certain else ""
    maybe = f"{'most' if certain else 'Most'} likely, but without confidence: {' and '.join(others)}" if others else ""
    row = next((r for r in diagnosis["evidence"] if sorted(r["effects"]) == sorted(leading["effects"])), None)
    nats = "" if row is None else f" ({row['score']:.0f} nats above the base model{_weighed(diagnosis)})"
    parts = "; ".join(part for part in (sure, maybe) if part)
    first = f"{parts}{nats}: it changes the gap {_closes(diagnosis['gap'])}"
    near = leading["nearest"]
    if near is not None:
        apart = "these trials distinguish the two" if near["told_apart"] else "these trials do not distinguish the two"
        first += say("nearest", near=near, behind=behind_words(near), apart=apart)
    sentences.append(f"{first}.")
    sentences += [*_numbers(leading), *size_sentences(diagnosis)]
    sentences += unnamed_sentence(diagnosis)
    rest = [row for row in _singles(diagnosis) if row["effects"][0] not in leading["effects"]][: _SHOWN - 1]
    if rest and not certain:
        sentences.append(f"Of the base model's excess{_weighed(diagnosis)}, {_closing(rest)}.")
    return [*sentences, *_why_unknown(diagnosis)]


def _numbers(leading: Mapping[str, Any]) -> list[str]:
    """The parameters of effects that are not certain, which are in no table."""
    parts = []
    for effect, parameters in leading.get("parameters", {}).items():
        for name, told in parameters.items() if effect not in leading["certain"] else ():
            std = told["std"]
            # nothing that was seen changes with it there
            lost = std is None or std > _LOST * abs(told["value"]) > 0
            value = f"{effect} {name} {number_words({**told, 'std': None} if lost else told)}"
            parts.append(f"{value} (no standard error: small changes of it have no effect)" if lost else value)
    return [f"Its parameters, if it is the cause: {', '.join(parts)}."] if parts else []


def _why_unknown(diagnosis: Mapping[str, Any]) -> list[str]:
    """What keeps the leading candidate from being the verdict."""
    gate = diagnosis["gate"]
    failed = [
        f"{numeral(score['score'])} on {which} (a right model: {score['threshold']:.3g} at most)"
        for which, score in (("the fitted trials", gate["after"]), ("the held-out trials", gate.get("held_out")))
        if score is not None and not score["passed"]
    ]
    reasons = [f"the gate is {' and '.join(failed)}"] if failed else []
    reasons += [f"it needs {bound['parameter']} {bound['sigmas']:+.1f} sigma off the stated value"
                for bound in _strained(diagnosis, "after")]  # fmt: skip
    return [f"It is not the whole answer: {'; '.join(reasons)}."] if reasons else []


def _weighed(diagnosis: Mapping[str, Any]) -> str:
    """A clause where candidates were compared against more than the sensors' noise."""
    with_scatter = diagnosis.get("evidence_base", {}).get("with_scatter")
    return ", with the scatter of replicates as noise" if with_scatter else ""


def _singles(diagnosis: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The best form of every single effect, the likeliest first."""
    best: dict[str, Mapping[str, Any]] = {}
    for row in diagnosis["evidence"]:
        if len(row["effects"]) == 1:
            best.setdefault(row["effects"][0], row)
    return list(best.values())


def _closing(rows: Sequence[Mapping[str, Any]]) -> str:
    """layering would remove 40 %, adhesion 3 %"""
    first, *others = [(row["effects"][0], _share(row.get("closes"))) for row in rows]
    return f"{first[0]} would remove {first[1]}" + "".join(f", {name} {share}" for name, share in others)


def _share(share: float | None) -> str:
    if share is None:
        return "nothing"
    return "nothing" if share < 0.005 else "all" if share > 0.995 else f"{100 * share:.0f} %"


def _closes(gap: Mapping[str, Any]) -> str:
    """From what to what, and which share of what is beyond the noise that is, fitted and held out."""
    parts = []
    for key, words in (("fit", "on fitted trials"), ("held_out", "on held-out trials")):
        before, after = gap["before"][key], gap["after"][key]
        if before is None or after is None:
            continue
        share = f" ({_share(1 - max(after - 1, 0.0) / (before - 1))} of the misfit)" if before > 1 else ""
        parts.append(f"from {numeral(before)} to {numeral(after)} {words}{share}")
    return " and ".join(parts)


def _left(diagnosis: Mapping[str, Any]) -> list[str]:
    """Where the best model still fails, and what the missing force correlates with."""
    sentences = []
    if places := diagnosis.get("left", []):
        beyond = ", beyond the scatter of replicates," if "gap_with_scatter" in diagnosis else ""
        phase, channel = (shares_words(places, key) for key in ("phase", "channel"))
        sentences.append(say("left", beyond=beyond, phase=phase, channel=channel, first=places[0]))
    if "latent" in diagnosis:
        sentences.append(f"The missing force correlates with {diagnosis['latent']['depends_on']}.")
        sentences += [line_sentence(row) for row in diagnosis["latent"].get("lines", [])]
    return sentences
