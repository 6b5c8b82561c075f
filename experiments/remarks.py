"""What is said of a run in words: which K holds when, what sticks out of the surface, what to be warned of.

Each is a sentence without its capital and full stop, or None where there is nothing to say.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from coupling import overdamped_below
from vis.numbers import foldable, quote

from .settings import STANDARD_GRAVITY, PenetrateSettings
from .softening import Softening

if TYPE_CHECKING:
    from .findings import Findings

__all__ = ["drop_note", "overlap_warning", "remarks", "softening_note", "warnings"]

LEAST_CONDITIONS = 3
"""Kinds and speeds that a fit of two numbers wants."""
MOST_CORRELATED = 0.85
"""Of K and C: runs at one constant speed alone give 0.87, sqrt(3) / 2."""
ENOUGH_TIPS = 6.0
"""Width of the bed that ships, in tips."""


def remarks(findings: Findings) -> dict[str, str]:
    """The sentences, by name, that explain the numbers, in the order in which they are told."""
    said = {
        "which_stiffness": _which_stiffness(findings),
        "surface": _at_surface(findings),
        "set_down": _set_down_note(findings),
        "drop": drop_note(findings.settings) if findings.of("drop") else None,
    }
    return {name: f"{text[:1].upper()}{text[1:]}." for name, text in said.items() if text}


def drop_note(settings: PenetrateSettings) -> str:
    """What a drop is, and what it is not."""
    return (
        f"a drop moves mass = {settings.mass:.4g} kg under load = {settings.weight:.4g} N; the "
        f"platform's own share is {settings.share:.4g} kg, and a body that falls freely in the laboratory "
        f"would have {settings.mass * STANDARD_GRAVITY:.4g} N on it"
    )


def warnings(findings: Findings) -> list[str]:
    """What a reader has to know: runs that did not end as they should, a law that came out at its bound."""
    said = []
    bobbing = []
    for unit in findings.units:
        ended = findings.beds[unit.id].ended
        if ended == "max_time":
            said.append(f"{unit.title} had not come to rest when its time was over: it has no depth at rest")
        elif ended == "max_depth":
            said.append(
                f"{unit.title} went within one tip's diameter of the floor and was ended there: it has no depth at "
                f"rest, and the spring-damper is not fitted to it"
            )
        elif ended == "stopped":
            bobbing.append(unit)
        elif ended == "unfinished":
            said.append(f"{unit.title} is unfinished: it has no depth at rest")
    if bobbing:
        said.append(
            f"{len(bobbing)} of {len(findings.of('drop'))} drops were still bobbing after_stop = "
            f"{findings.settings.after_stop:g} s after their first stop and ended there: they have no depth at rest"
        )
    if findings.quantities()["sinkage_dem"]["value"] is None:
        said.append("no set-down came to rest: there is no sinkage_dem")
    if findings.quantities()["sinkage_spring_damper"]["value"] is None:
        said.append("the spring-damper did not come to rest: there is no sinkage_spring_damper")
    shallow = _shallow(findings)
    if shallow:
        said.append(shallow)
    bound = overdamped_below(findings.settings.weight, findings.settings.lowering_speed)
    if findings.of("set_down") and findings.fit.stiffness > bound:
        said.append(
            f"the stiffness fitted, {findings.fit.stiffness:.3g} N/m, is above {bound:.3g} N/m, up to which a spike "
            f"set down is damped beyond critical: it may have overshot; a lower lowering_speed would do"
        )
    said += [text for text in (_inseparable(findings), _traded(findings), _narrow(findings)) if text]
    if findings.fit.damping == 0:
        said.append("the damping fitted is 0, its bound: the bed shows no drag that grows with speed in these runs")
    if findings.fit.stiffness == 0:
        said.append("the stiffness fitted is 0, its bound: the law has no resting sinkage")
    return said


def softening_note(settings: PenetrateSettings, softening: Softening) -> str:
    """How soft the grains are made, and what for: where the fastest speed and the largest pressure come from."""
    fastest = {
        "a driven run": (*settings.speeds, *settings.other_speeds[: len(settings.seeds) - 1]),
        "the pull-out": (settings.retreat_speed,),
        "a drop": (*settings.drop_speeds, *settings.other_drop_speeds),
        "the lowering": (settings.lowering_speed,),
    }
    whose = next((name for name, speeds in fastest.items() if softening.speed in speeds), "the fastest run")
    return (
        f"grains softened {softening.factor:.3g} times, to E = {softening.young:.3g} Pa, so that they overlap by at "
        f"most {100 * settings.max_overlap:.3g} % of a diameter under the tip at its deepest and the bed's own weight, "
        f"{softening.pressure:.3g} Pa together, and at {softening.speed:g} m/s, the speed of {whose}"
    )


def overlap_warning(overlap: float | None, settings: PenetrateSettings, softening: Softening) -> str | None:
    """That grains overlapped nearly as far as they may, and the modulus that would leave a fifth of it free."""
    if overlap is None or overlap <= 0.9 * settings.max_overlap:
        return None
    stiffer = softening.stiffer(overlap, 0.8 * settings.max_overlap)
    return (
        f"grains overlapped by up to {100 * overlap:.3g} % of a diameter, within a tenth of max_overlap = "
        f"{100 * settings.max_overlap:.3g} %, past which a run fails: young = {stiffer:.2g} Pa (here "
        f"{softening.young:.3g} Pa) would leave room"
    )


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
    return (
        f"K and C are for motion down to {1e3 * findings.deepest():.3g} mm; the damper acts only while the spike goes "
        f"in. For a foot that stands under {findings.settings.weight:.3g} N this K {wrong}: "
        f"there K = {_words(standing)} (load over sinkage) would do"
    )


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
    return (
        f"at depth 0 the bed already pushes with {_words(force)}, {share}{grains}: the spring-damper knows nothing of "
        f"that, and the fit leaves out what is above depth 0"
    )


def _shallow(findings: Findings) -> str | None:
    """What to know of a sinkage that is hardly more than a grain."""
    sunk = findings.quantities()["sinkage_dem"]["value"]
    if sunk is None or sunk >= 2 * findings.settings.grain:
        return None
    several = len([value for value in findings.sinkages(findings.beds) if value is not None]) > 1
    spread_words = "its spread between seeds is part of the answer" if several else "another seed will give another"
    shown = _words(findings.quantities()["sinkage_dem"])
    return (
        f"the sinkage, {shown}, is only {sunk / findings.settings.grain:.2g} grains: it depends on which grain the tip "
        f"met, so {spread_words}"
    )


def _set_down_note(findings: Findings) -> str | None:
    """What a set-down is, and why a drop at the same speed goes deeper."""
    sets = [run for run in findings.of("set_down") if run.settings.get("mass")]
    if not sets:
        return None
    speed, feels = findings.settings.lowering_speed, float(sets[0].settings["mass"])
    return (
        f"a set-down is lowered at {speed:g} m/s to where it first touches and then let go, held back by a hand "
        f"that bears what the ground does not yet carry and lets it feel {1e3 * feels:.3g} g: it sinks ever more "
        f"slowly to where the bed first carries the load. A drop brings its momentum, {findings.settings.mass:.3g} kg "
        f"times its speed, and goes deeper even at the same speed"
    )


def _inseparable(findings: Findings) -> str | None:
    """Where the runs fitted do not tell K from C."""
    conditions = {unit.condition for unit in findings.units if unit.id in findings.fit.runs}
    if len(conditions) >= LEAST_CONDITIONS and abs(findings.fit.correlation or 0.0) <= MOST_CORRELATED:
        return None
    shown = "unknown" if findings.fit.correlation is None else f"{findings.fit.correlation:.2f}"
    listed = ", ".join(f"{kind} at {speed:g} m/s" for kind, speed in sorted(conditions))
    return (
        f"the fit hardly tells K from C (correlation of the two: {shown}; fitted to {listed}): give at least two "
        f"speeds and two drop_speeds"
    )


def _traded(findings: Findings) -> str | None:
    """Where the beds' own fits do not tell K from C, so that the spreads of the two go together."""
    own = [fit.correlation for fit in findings.seed_fits.values() if fit.correlation is not None]
    if len(own) < 2 or min(own) >= -MOST_CORRELATED:
        return None
    return (
        f"what every bed has hardly tells K from C (correlation of one bed's: down to {min(own):.2f}): where one comes "
        f"out high the other comes out low, so that their spreads say less of the beds than that of the drag; "
        f"other_speeds and other_drop_speeds farther apart would do"
    )


def _narrow(findings: Findings) -> str | None:
    """A bed so narrow that the spike meets its own images, or so shallow that it feels the floor."""
    width, tip = min(findings.settings.bed_size[:2]), findings.settings.tip_diameter
    if width >= ENOUGH_TIPS * tip * (1 - 1e-9):
        return None
    return (
        f"the bed is {width / tip:.2g} tips wide and goes on beside itself, so the spike meets its own images at "
        f"that distance: force, K and sinkage may move with a wider one (bed_size of {ENOUGH_TIPS * tip:.3g} m "
        f"both ways would be {ENOUGH_TIPS:g} tips, as in the case that ships)"
    )


def _words(entry: Mapping[str, Any]) -> str:
    """A quantity as a person quotes it: by its spread, else with two figures."""
    return foldable(quote(entry["value"], entry["std"], entry["unit"], significant=2))
