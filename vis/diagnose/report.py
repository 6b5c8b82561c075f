"""The report of a diagnosis: reads diagnosis.json, result.json, latent.csv and series/."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from rigid.intervals import half_of
from vis.diagnose.evidence import closed_share, draw_evidence
from vis.diagnose.figures import (
    draw_latent,
    draw_phases,
    draw_trajectories,
    read_channel,
    source_of,
    trials_of,
    worst,
)
from vis.diagnose.usable import gap_in_scatter, has_numbers_to_use, stiffness_words
from vis.page.answer import MOST_ROWS
from vis.page.numbers import beside, fitted, plain, quote, short, within
from vis.page.page import Block, Section, Tile, listing, table, table_of, text
from vis.page.report import Report, Result, again, capital, report_of, unit_text
from vis.page.sentences import Sentences

__all__ = ["answer_tiles", "write_diagnosis_report"]

say = Sentences(__package__)
_IN_UNITS = ("rms_before", "rms_after", "noise_after")
_MOST_PLACES = 8
"""Stretches that are listed."""
_DASH = "\N{EN DASH}"
_STAGES = ("before", "after")


@report_of(dpi=130)
def write_diagnosis_report(report: Report) -> Path:
    """Make figures/ and report.html of the folder of a diagnosis, and return the report.

    Raises FileNotFoundError where the folder has no diagnosis.json or result.json.
    """
    diagnosis: Result = json.loads((report.folder / "diagnosis.json").read_text(encoding="utf-8"))
    drawn = _drawn(report, diagnosis)
    result, gap = report.result, diagnosis["gap"]
    departures, following = result["departures"]["sentences"], diagnosis.get("next_experiment")
    left = [_gap_table(diagnosis), *_in_units(diagnosis), *drawn["residuals"], *_phase_table(diagnosis),
            *_set_aside(diagnosis)]  # fmt: skip
    sections = [
        Section("", [*_to_use(diagnosis), listing(result.get("summary", [])), *drawn["trajectories"]]),
        Section("Remaining misfit", [*left, *drawn["latent"]]),
        Section("Where the base model fails", [*([listing(departures)] if departures else []), *_where(diagnosis)]),
        Section("Candidates", [*drawn["evidence"], *_evidence(diagnosis)]),
        Section(say("all_forms"), _tried(diagnosis)),
        Section("What these trials can distinguish", _distinguished(diagnosis)),
        Section("The next experiment", [text(following)] if following else []),
        Section("Numbers", _numbers(diagnosis)),
        Section("Findings in the recordings", _findings(diagnosis)),
        again("hedgebed diagnose THIS_FOLDER/run.toml", f"With hedgebed {result['version']}, where it was started from "
              "(the campaign's path is as given):"),
    ]  # fmt: skip
    lead = ["diagnose", f"verdict: {diagnosis['verdict']}", f"held out: {', '.join(gap['held_out_trials']) or 'none'}"]
    return report.write([section for section in sections if section.blocks], lead=lead, tiles=answer_tiles(result))


def answer_tiles(result: Result) -> list[Tile]:
    """The gap before and after, then the fitted numbers: those of the named effects first, six rows at most."""
    numbers = result["quantities"]
    part = "held_out" if numbers["gap_after_held_out"]["value"] is not None else "fit"
    which = say(f"gap_{part}")
    where = say(f"gap_where_{part}")
    tiles = [
        Tile(say(f"gap_{stage}", where=where), _number(numbers[f"gap_{stage}_{part}"]["value"]), which)
        for stage in _STAGES
    ]
    if weighed := numbers.get(f"gap_with_scatter_after_{part}"):
        tiles.append(Tile(say("gap_scatter", where=where), fitted(weighed), which))
    effects = [name for name in numbers if "." in name and "@" not in name]
    named = effects + [name for name in numbers if name.endswith("_after")]
    tiles += [_tile_of(name, numbers[name]) for name in named]
    return tiles[:MOST_ROWS]


def _tile_of(name: str, entry: Result) -> Tile:
    """A fitted number with half of its 95 % interval, or why it has none."""
    own, at, size = name.removesuffix("_after").partition("@")
    of = f"{1e3 * float(size):g} mm" if at else ""
    if not at:
        of, _, own = own.rpartition(".")
    label = capital(own.replace("_", " ")) + (f" ({of})" if of else "")
    note, unit = str(entry.get("note", "")).replace("standard error of the fit", "error of the fit"), entry["unit"]
    if entry["std"]:
        return Tile(label, fitted(entry), note)
    why = say("at_the_end" if "end of its range" in note else "not_determined")
    value = quote(entry["value"], None, unit)
    if "at_most" in entry:
        value = within(0.0, entry["at_most"], unit)
    return Tile(label, value, note, (why, "", ""))


def _drawn(report: Report, diagnosis: Result) -> dict[str, list[Block]]:
    """Each of the figures that has something to show."""
    channels = [read_channel(path) for path in sorted((report.folder / "series").glob("*.csv"))]
    held, labels = set(diagnosis["gap"]["held_out_trials"]), _labels(diagnosis)
    source, report.about = source_of(report.folder), trials_of(report.folder)
    aside = {row["trial"] for row in diagnosis.get("set_aside", [])}
    used = [channel for channel in channels if len(channel.time) and channel.trial not in aside]
    shown = worst(used, held)
    count = f"{len(shown)} of {len(used)} recordings" if len(shown) < len(used) else f"All {len(used)} recordings"
    drawings = {
        "trajectories": draw_trajectories(shown, held, labels, source),
        "residuals": draw_phases(diagnosis.get("by_phase", []), labels),
        "evidence": draw_evidence(diagnosis),
        "latent": draw_latent(report.folder, diagnosis, channels),
    }
    return {
        key: [] if drawing is None else [report.draw(key, drawing, source=source, shown=count)]
        for key, drawing in drawings.items()
    }


def _labels(diagnosis: Result) -> tuple[str, str]:
    """What the models before and after are called; the second is empty where nothing was added."""
    before, names = "base model, fitted", " + ".join(effect["id"] for effect in diagnosis["effects"])
    if diagnosis["verdict"] == "none" or diagnosis["gap"]["after"] == diagnosis["gap"]["before"]:
        return before, ""
    likeliest = " + ".join(diagnosis.get("leading", {}).get("effects", []))
    return (
        before,
        f"with {names}" if names else f"with {likeliest}, without confidence" if likeliest else "best model found",
    )


# Its parts ------------------------------------------------------------------------------------------------------------


def _number(value: float) -> str:
    """0.97, 153, 19 400."""
    return plain(value) if value >= 1e3 else short(value, 3)


def _gap_table(diagnosis: Result) -> Block:
    gap, weighed = diagnosis["gap"], diagnosis.get("gap_with_scatter")
    rows = []
    for part, name in (("fit", "fitted trials"), ("held_out", "held-out trials")):
        cells = [name]
        for one in (gap, weighed) if weighed is not None else (gap,):
            cells += [_DASH if one[stage][part] is None else _number(one[stage][part]) for stage in ("before", "after")]
            if weighed is not None and one is weighed and one["after"][part] is not None:
                cells[-1] = fitted(gap_in_scatter(diagnosis, part))
        rows.append(cells)
    head: tuple[str, ...] = ("", "base model", "best model")
    title = "The gap, chi-square per sample (1: the sensors' noise)"
    if weighed is not None:
        head += ("base model, gap with scatter", "best model, gap with scatter")
        title += say("with_scatter")
        freedom = weighed.get("freedom")
        title += f"; their scatter has {freedom} degrees of freedom)" if freedom else ")"
    return table(head, rows, title=title)


def _in_units(diagnosis: Result) -> list[Block]:
    """The gap in the channels' units, and by condition."""
    blocks = []
    cells = {(row["channel"], row["held_out"]): row for row in diagnosis.get("by_channel", [])}

    def rms(name: str, held: bool, stage: str) -> str:
        value = cells.get((name, held), {}).get(stage)
        return _DASH if value is None else short(value, 3)

    names = dict.fromkeys((row["channel"], row["unit"]) for row in diagnosis.get("by_channel", []))
    if names:
        rows = [
            (name, unit, *(rms(name, held, stage) for held in (False, True) for stage in _IN_UNITS))
            for name, unit in names
        ]
        head = ("channel", "unit", "fitted: before", "after", "noise", "held out: before", "after", "noise")
        blocks += [table(head, rows, title=say("in_units")), text(say("in_units_noise"), small=True)]
    conditions = diagnosis.get("by_condition", [])
    if len(conditions) > 1:
        common = _common([row["settings"] for row in conditions])
        lines = [(_settings(row["settings"], but=common), ", ".join(row["trials"]), _number(row["before"]),
                  _number(row["after"])) for row in conditions]  # fmt: skip
        title = "Gap by condition" + (f" ({_settings(common)} in all)" if common else "")
        blocks.append(table(("condition", "trials", "before", "after"), lines, title=title))
    return blocks


def _phase_table(diagnosis: Result) -> list[Block]:
    """By phase and channel, fitted trials beside held-out ones."""
    rows: dict[tuple[str, str], dict[bool, Result]] = {}
    for row in diagnosis.get("by_phase", []):
        rows.setdefault((row["phase"], row["channel"]), {})[row["held_out"]] = row

    def cells(part: Result | None) -> tuple[str, str, str]:
        if part is None:
            return _DASH, _DASH, _DASH
        return str(part["samples"]), _number(part["before"]), _number(part["after"])

    head = ("phase", "channel", "samples fitted", "before", "after", "samples held out", "before", "after")
    body = [(*key, *cells(parts.get(False)), *cells(parts.get(True))) for key, parts in rows.items()]
    return table_of(head, body, title="Gap by phase and channel")


def _set_aside(diagnosis: Result) -> list[Block]:
    """What the models leave of trials that took no part, which no other table counts."""
    rows = [
        (row["trial"], row["channel"], row["unit"], str(row["samples"]),
         *(_DASH if row[f"rms_{stage}"] is None else short(row[f"rms_{stage}"], 3) for stage in ("before", "after")))
        for row in diagnosis.get("set_aside", [])
    ]  # fmt: skip
    head = ("trial", "channel", "unit", "samples", "before", "after")
    return table_of(head, rows, title=say("set_aside"))


def _where(diagnosis: Result) -> list[Block]:
    if not diagnosis["where"]:
        return []
    places = diagnosis["where"][:_MOST_PLACES]
    common = _common([p.get("settings", {}) for p in diagnosis["where"]])
    rows = [
        (p["trial"], _settings(p.get("settings", {}), but=common), p["channel"], p["phase"], f"{p['from_s']:.4g}",
         f"{p['to_s']:.4g}", _number(p.get("excess", 0.0)))
        for p in places
    ]  # fmt: skip
    more = len(diagnosis["where"]) - len(places)
    title = "The worst stretches" + (f" (of {len(places) + more}, which diagnosis.json has)" if more else "")
    head = ("trial", "settings", "channel", "phase", "from [s]", "to [s]", "chi-square beyond noise")
    return [table(head, rows, title=title), *_parted(diagnosis)]


def _common(settings: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """What is the same in several conditions."""
    first = settings[0] if len(settings) > 1 else {}
    return {name: value for name, value in first.items() if all(other.get(name) == value for other in settings)}


def _parted(diagnosis: Result) -> list[Block]:
    """When each trial parts from the base model, channel by channel, in the order in which they do."""
    trials: dict[str, list[str]] = {}
    for row in diagnosis.get("parted", []):
        trials.setdefault(row["trial"], []).append(f"{row['channel']} {row['at_s']:.3g}")
    title = "First parts from the base model at [s]: a running mean of nine samples beyond 5 standard errors"
    rows = [(trial, ", ".join(times)) for trial, times in trials.items()]
    return table_of(("trial", "channel and time"), rows, title=title, words=True)


def _settings(settings: Mapping[str, float], *, but: Mapping[str, float] | None = None) -> str:
    """torque_N_m = 0.22 as "torque 0.22 N m"; `but`: settings left out because all trials share them."""
    left = {name: value for name, value in settings.items() if name not in (but or {})}
    settings = left or settings
    units = {"N_m": "N m", "m_s2": "m/s²", "m_s": "m/s", "m": "m", "kg": "kg", "rad_s": "rad/s"}
    shown = []
    for name, value in settings.items():
        unit = next((u for u in sorted(units, key=len, reverse=True) if name.endswith(f"_{u}")), "")
        what = name.removesuffix(f"_{unit}") if unit else name
        shown.append(f"{what.replace('_', ' ')} {short(value, 4)} {units.get(unit, '')}".strip())
    return ", ".join(shown)


def _evidence(diagnosis: Result) -> list[Block]:
    """A line a set of names; those no better than the base model in one sentence."""
    plain = {"closes": None, "tried": 1, "better": True, "note": ""}  # of a folder from before there were candidates
    rows = diagnosis.get("candidates") or [plain | dict(row) for row in diagnosis.get("evidence", [])]
    if not rows:
        return [text("Nothing was left that a candidate could explain: none was tried.")]
    better = [
        (row["candidate"], f"{row['score']:.1f}", _DASH if row["left"] is None else f"{row['left']:.3g}",
         _DASH if row["closes"] is None else closed_share(row["closes"]), str(row["tried"]),
         row["note"])
        for row in rows if row["better"]
    ]  # fmt: skip
    worse = [" + ".join(row["effects"]) for row in rows if not row["better"]]
    blocks: list[Block] = []
    if better:
        head = ("candidate (effect:form)", "evidence over the base model [nats]", "excess", "excess removed",
                "forms tried", "what became of it")  # fmt: skip
        title = "One line for each set of names, in its best form; the most likely first"
        blocks.append(table(head, better, title=title, words=True))
        blocks += _forms(diagnosis, [row[0] for row in better])
    if worse:
        blocks.append(text(say("worse", names=", ".join(worse))))
    blocks.append(text(say("searched"), small=True))
    return blocks


def _forms(diagnosis: Result, candidates: Sequence[str]) -> list[Block]:
    """What the forms of these candidates are."""
    meanings = diagnosis.get("forms", {})
    shown = [
        id for id in meanings if any(id.partition(":")[2] in one and id.partition(":")[0] in one for one in candidates)
    ]
    return [text(say("forms"), small=True), listing([f"{id}: {meanings[id]}" for id in shown])] if shown else []


def _tried(diagnosis: Result) -> list[Block]:
    """Every candidate that was fitted, in each of its forms, and what the forms are."""
    rows = [
        (row["candidate"], f"{row['score']:.1f}".replace("-", "\N{MINUS SIGN}"),
         _DASH if row.get("left") is None else short(row["left"], 3),
         _DASH if row.get("closes") is None else closed_share(row["closes"]))
        for row in diagnosis.get("evidence", [])
    ]  # fmt: skip
    count = len({part for row in rows for part in row[0].split(" + ")})
    head = ("candidate (effect:form)", "evidence over the base model [nats]", "excess", "excess removed")
    meanings = diagnosis.get("forms_tried", {})
    told = [listing([f"{id}: {words}" for id, words in meanings.items()])] if rows and meanings else []
    return [*table_of(head, rows, title=say("tried", candidates=len(rows), forms=count)), *told]


def _sizes(diagnosis: Result) -> list[Block]:
    rows = [
        (size["effect"], short(size["signature"], 2), size["channel"], f"{short(size['rms'], 2)} {size['unit']}",
         f"{short(size['most'], 2)} {size['unit']}",
         _DASH if size["share"] is None else f"{100 * size['share']:.2g} %")
        for size in diagnosis.get("sizes", []) if size["channel"] is not None
    ]  # fmt: skip
    head = ("effect", "signature [noise]", "plainest in", "change, root mean square", "at most", "of what it reads")
    return table_of(head, rows, title=say("sizes"))


def _value(entry: Result) -> str:
    """A number beside half of its 95 % interval, with the digits that the terminal shows; of C that is not determined
    its upper bound."""
    if "at_most" in entry:
        return say("below", bound=short(entry["at_most"], 2))
    return beside(entry["value"], half_of(entry)).replace("-", "\N{MINUS SIGN}")


def _error(diagnosis: Result, entry: Result, name: str, stage: str) -> str:
    """Half of the 95 % interval of a number, or why it has none."""
    if "at_most" in entry:
        return say("not_determined")
    if any(bound["parameter"] == name and bound["at_bound"] for bound in diagnosis.get("at_bounds", {}).get(stage, [])):
        return "at its end"
    half = half_of(entry) if entry.get("determined", True) else None
    if half is None:
        return say("not_determined")
    return short(half, 2) if abs(entry["value"]) < half else beside(half, half)


def _effects(diagnosis: Result) -> list[tuple[str, str, str, str, str]]:
    """A row for each parameter of the effects that were added: effect, parameter, value, half of its interval, unit."""
    return [
        (effect["id"], name, _value(entry), _error(diagnosis, entry, f"{effect['id']}.{name}", "after"),
         unit_text(entry["unit"]))
        for effect in diagnosis["effects"] for name, entry in effect["parameters"].items()
    ]  # fmt: skip


def _to_use(diagnosis: Result) -> list[Block]:
    """The numbers of the best model in one table, where there is a K to use."""
    if not has_numbers_to_use(diagnosis):
        return []
    meant = f", {words}" if (words := stiffness_words(diagnosis)) else ""
    rows = [
        (name + (meant if name.startswith("stiffness") else ""), _value(entry),
         _error(diagnosis, entry, name, "after"), unit_text(entry["unit"]))
        for name, entry in diagnosis["base"]["after"].items()
    ] + [(f"{effect} {name}", *numbers) for effect, name, *numbers in _effects(diagnosis)]  # fmt: skip
    return table_of(("number to use", "value", say("in_95"), "unit"), rows, title=say("to_use"))


def _numbers(diagnosis: Result) -> list[Block]:
    effects, after = _effects(diagnosis), diagnosis["base"]["after"]
    meant = f" (after: {words})" if (words := stiffness_words(diagnosis)) else ""
    base = [
        (name + (meant if name.startswith("stiffness") else ""),
         _DASH if name.startswith("damping") and entry["std"] is None else _value(entry),
         _error(diagnosis, entry, name, "before"), _value(after[name]),
         _error(diagnosis, after[name], name, "after"), unit_text(entry["unit"]))
        for name, entry in diagnosis["base"]["before"].items() if name in after
    ]  # fmt: skip
    added = table_of(("effect", "parameter", "value", say("in_95"), "unit"), effects, title="Added effects")
    head = ("parameter", "before", say("in_95"), "after", say("in_95"), "unit")
    fitted = table_of(head, base, title="The base model's parameters")
    fitted += _stated(diagnosis)
    blocks = [*_sizes(diagnosis), *added, *_equations(diagnosis), *fitted] if effects else fitted
    return [*blocks, text(say("errors_of_fit"), small=True)] if blocks else []


def _stated(diagnosis: Result) -> list[Block]:
    """What campaign.toml states as known, what the trials give without it, and the difference."""
    rows = []
    for row in diagnosis.get("stated", []):
        cells = [row["parameter"], unit_text(row["stated"]["unit"])]
        for key in ("stated", "alone", "difference"):
            entry = row[key]
            cells += [say("not_determined"), _DASH] if entry is None else _interval(entry)
        rows.append((*cells, {True: "yes", False: "no", None: _DASH}[row["agrees"]]))
    numbers = [part for name in ("stated", "trials alone", "difference") for part in (name, say("in_95"))]
    head = ("parameter", "unit", *numbers, "agree")
    return table_of(head, rows, title=say("stated"))


def _interval(entry: Result) -> list[str]:
    """A number and half of its 95 % interval."""
    half = half_of(entry)
    error = _DASH if half is None else short(half, 2) if abs(entry["value"]) < half else beside(half, half)
    return [_value(entry), error]


def _equations(diagnosis: Result) -> list[Block]:
    """The law that each number is of."""
    rows = [row for row in diagnosis.get("equations", []) if row["equation"]]
    if not rows:
        return []
    laws = [f"{row['effect']} ({row['form']}): {row['equation']}." for row in rows]
    symbols = diagnosis.get("symbols", "")
    return [listing(laws), *([text(f"{symbols}.", small=True)] if symbols else [])]


def _findings(diagnosis: Result) -> list[Block]:
    rows = [
        (f["what"], f["trial"] or _DASH, f["channel"] or _DASH,
         _DASH if f["from_s"] is None else f"{f['from_s']:.4g} to {f['to_s']:.4g}", "yes" if f["set_aside"] else "no")
        for f in diagnosis.get("findings", [])
    ]  # fmt: skip
    return table_of(("what", "trial", "channel", "seconds", "set aside"), rows, words=True)


def _distinguished(diagnosis: Result) -> list[Block]:
    """The first effect against the nearest other names, and the trials that would separate them."""
    rows = diagnosis.get("equivalence", [])
    if len(rows) < 2:
        return []
    first, *others = rows

    def number(value: float | None, digits: int = 3) -> str:
        return _DASH if value is None else short(value, digits)

    cells = [(first["effect"], "", "", "", "", number(first["left_out"]), "")]
    cells += [
        (row["effect"], f"{row['angle_deg']:.0f}", number(row["distance"]), f"{row['evidence_behind']:.1f}",
         _DASH if row["left_out_behind"] is None else f"{row['left_out_behind']:.1f}", number(row["left_out"]),
         "yes" if row["told_apart"] else "no")
        for row in others
    ]  # fmt: skip
    head = ("name", "angle [degrees]", "distance [noise]", "evidence behind [nats]", "prediction behind [nats]",
            "chi-square of what was left out", "told apart")  # fmt: skip
    caption = say("other_names", effect=first["effect"])
    close = [row["what_would_tell"] for row in others if not row["told_apart"]]
    return [table(head, cells, title=caption), *([listing(close)] if close else [])]
