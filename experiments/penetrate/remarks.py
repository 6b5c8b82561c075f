"""What is said of a run in words: which K holds when, what sticks out of the surface, what to be warned of.

Each is a sentence without its capital and full stop, or None where there is nothing to say.
"""

from collections.abc import Iterator

from coupling import overdamped_below
from experiments.grains.softening import Softening
from experiments.runs.types import Json
from vis.page.numbers import foldable, quote

from .departures import departures
from .findings import Findings, drop_note
from .settings import PenetrateSettings, say

__all__ = ["departures_in_words", "overlap_warning", "softening_note", "warnings_of"]

LEAST_CONDITIONS = 3
"""Kinds and speeds that a fit of two numbers needs."""
MOST_CORRELATED = 0.85
"""Of K and C: runs at one constant speed alone give 0.87, sqrt(3) / 2."""
ENOUGH_TIPS = 6.0
"""Width of the bed that ships, in tips."""


def departures_in_words(findings: Findings) -> Json:
    """The entry "departures" of result.json: numbers, sentences, and the remarks that explain them, by name."""
    numbers = findings.quantities()
    sunk, law = ((numbers[name]["value"], numbers[name]["std"]) for name in ("sinkage_dem", "sinkage_spring_damper"))
    pair = (sunk, law) if sunk[0] is not None and law[0] is not None else None
    by_bed = [runs for seed in findings.seeds if (runs := findings.of("driven", seed))]
    found = departures(by_bed, findings.models, findings.beds, findings.fit, sinkage=pair)
    remarks = {
        "which_stiffness": _which_stiffness(findings),
        "surface": _at_surface(findings),
        "set_down": _set_down_note(findings),
        "drop": drop_note(findings.settings) if findings.of("drop") else None,
    }
    notes = {name: f"{text[:1].upper()}{text[1:]}." for name, text in remarks.items() if text}
    return found | notes | {"sentences": [*found["sentences"], *notes.values()]}


def warnings_of(findings: Findings) -> list[str]:
    """What a reader has to know: runs that did not end as they should, a law that came out at its bound."""
    said = list(_ended_early(findings))
    numbers, settings, fit = findings.quantities(), findings.settings, findings.fit
    if numbers["sinkage_dem"]["value"] is None:
        said.append("no set-down came to rest: there is no sinkage_dem")
    if numbers["sinkage_spring_damper"]["value"] is None:
        said.append("the spring-damper did not come to rest: there is no sinkage_spring_damper")
    if shallow := _shallow(findings):
        said.append(shallow)
    bound = overdamped_below(settings.weight, settings.lowering_speed)
    if findings.of("set_down") and fit.stiffness > bound:
        said.append(say("overdamped", fit=fit, bound=bound))
    said += [text for text in (_inseparable(findings), _traded(findings), _narrow(settings)) if text]
    if fit.damping == 0:
        said.append(say("damping_zero"))
    if fit.stiffness == 0:
        said.append("the stiffness fitted is 0, its bound: the law has no resting sinkage")
    return said


def _ended_early(findings: Findings) -> Iterator[str]:
    """Runs that have no depth at rest, and why."""
    bobbing = 0
    for unit in findings.units:
        ended = findings.beds[unit.id].ended
        if ended == "max_time":
            yield say("max_time", unit=unit)
        elif ended == "max_depth":
            yield say("near_floor", unit=unit)
        elif ended == "unfinished":
            yield f"{unit.title} is unfinished: it has no depth at rest"
        bobbing += ended == "stopped"
    if bobbing:
        yield say("bobbing", count=bobbing, of=len(findings.of("drop")), s=findings.settings)


def softening_note(settings: PenetrateSettings, softening: Softening) -> str:
    """How soft the grains are made, and what for: where the fastest speed and the largest pressure come from."""
    fastest = {
        "a driven run": (*settings.speeds, *settings.other_speeds[: len(settings.seeds) - 1]),
        "the pull-out": (settings.retreat_speed,),
        "a drop": (*settings.drop_speeds, *settings.other_drop_speeds),
        "the lowering": (settings.lowering_speed,),
    }
    whose = next((name for name, speeds in fastest.items() if softening.speed in speeds), "the fastest run")
    return say("softened", softening=softening, percent=100 * settings.max_overlap, whose=whose)


def overlap_warning(overlap: float | None, settings: PenetrateSettings, softening: Softening) -> str | None:
    """That grains overlapped nearly as far as they may, and the modulus that would leave a fifth of it free."""
    most = settings.max_overlap
    if overlap is None or overlap <= 0.9 * most:
        return None
    stiffer = softening.stiffer(overlap, 0.8 * most)
    return say("overlap_near", percent=100 * overlap, most=100 * most, stiffer=stiffer, softening=softening)


def _which_stiffness(findings: Findings) -> str | None:
    """When to use the fitted K, and when that of a foot that stands."""
    standing, fitted = findings.standing_stiffness().get("stiffness_standing"), findings.fit.stiffness
    if standing is None or fitted <= 0:
        return None
    ratio = standing["value"] / fitted
    if ratio >= 1.005:
        wrong = f"overstates the sinkage at rest {ratio:.2g} times"
    elif ratio <= 0.995:
        wrong = f"understates the sinkage at rest {1 / ratio:.2g} times"
    else:
        wrong = "gives the sinkage at rest as well"
    deepest, s = 1e3 * findings.deepest(), findings.settings
    return say("which_stiffness", deepest=deepest, s=s, wrong=wrong, standing=_words(standing))


def _at_surface(findings: Findings) -> str | None:
    """What the bed pushes back with before depth 0, where that matters; None below a tenth of the load."""
    numbers = findings.at_surface()
    force, load = numbers.get("surface_force"), findings.settings.weight
    if force is None or force["value"] <= 0.1 * load:
        return None
    out = numbers.get("surface_roughness")
    grains = f", because grains stick out of the surface by up to {_words(out)}" if out else ""
    ratio = force["value"] / load
    share = f"{100 * ratio:.2g} % of the load" if ratio < 0.995 else f"{ratio:.2g} times the load"
    return say("at_surface", force=_words(force), share=share, grains=grains)


def _shallow(findings: Findings) -> str | None:
    """What to know of a sinkage that is hardly more than a grain."""
    sunk, grain = findings.quantities()["sinkage_dem"], findings.settings.grain
    if sunk["value"] is None or sunk["value"] >= 2 * grain:
        return None
    several = sum(value is not None for value in findings.sinkages(findings.beds)) > 1
    so = "its spread between seeds is part of the answer" if several else "another seed will give another"
    return say("shallow", shown=_words(sunk), grains=sunk["value"] / grain, so=so)


def _set_down_note(findings: Findings) -> str | None:
    """What a set-down is, and why a drop at the same speed goes deeper."""
    sets = [run for run in findings.of("set_down") if run.settings.get("mass")]
    return say("set_down", s=findings.settings, grams=1e3 * float(sets[0].settings["mass"])) if sets else None


def _inseparable(findings: Findings) -> str | None:
    """Where the runs fitted do not tell K from C."""
    conditions = {unit.condition for unit in findings.units if unit.id in findings.fit.runs}
    correlation = findings.fit.correlation
    if len(conditions) >= LEAST_CONDITIONS and abs(correlation or 0.0) <= MOST_CORRELATED:
        return None
    shown = "unknown" if correlation is None else f"{correlation:.2f}"
    return say("inseparable", shown=shown, listed=", ".join(f"{kind} at {v:g} m/s" for kind, v in sorted(conditions)))


def _traded(findings: Findings) -> str | None:
    """Where the beds' own fits do not tell K from C, so that the spreads of the two go together."""
    own = [fit.correlation for fit in findings.seed_fits.values() if fit.correlation is not None]
    return say("traded", least=min(own)) if len(own) >= 2 and min(own) < -MOST_CORRELATED else None


def _narrow(settings: PenetrateSettings) -> str | None:
    """A bed so narrow that the spike meets its own images, or so shallow that it feels the floor."""
    width, tip = min(settings.bed_size[:2]), settings.tip_diameter
    if width >= ENOUGH_TIPS * tip * (1 - 1e-9):
        return None
    return say("narrow", tips=width / tip, enough=ENOUGH_TIPS * tip, enough_tips=ENOUGH_TIPS)


def _words(entry: Json) -> str:
    """A quantity as a person quotes it: by its spread, else with two figures."""
    return foldable(quote(entry["value"], entry["std"], entry["unit"], significant=2))
