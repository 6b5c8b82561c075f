"""A fit once more where the noise, or what replicates differ by, is found to be another."""

import math
from collections.abc import Mapping
from dataclasses import replace

from experiments.diagnose.fit.evidence import held_out_fit
from experiments.diagnose.fit.fitting import Fit, Model, Whitener, by_beginnings, fit
from experiments.diagnose.fit.problem import Finding
from experiments.diagnose.noise.colour import Colour, find_colours, find_loud, whitener_for
from experiments.diagnose.noise.jitter import Jitter, find_jitter, steepness
from experiments.diagnose.noise.lone_beds import find_lone_scatter
from experiments.diagnose.noise.replicates import Scatter, find_scatter, groups_of, with_scatter
from experiments.diagnose.noise.unrest import Unrest, find_unrest

from .deciding import unscattered, values_of_all

__all__ = [
    "calmed", "coloured", "colours_of", "differ", "doubted", "jittered", "leaves_much", "lone_scatter_of", "plain",
    "recoloured", "rescattered", "scatter_of", "unrest_of", "whitened_fit",
]  # fmt: skip

_MOST_FOR_COLOUR = 2.5  # chi-square per sample above which motion, not noise, fills the fast modes too
_OTHER = 0.1  # change of a noise's persistence, and relative change of its size, from which on it is another one
_MUCH = 3.0  # standard deviations of chi-square that a fit must leave for another one to be looked for


def whitened_fit(model: Model, *, beginnings: bool = False) -> Fit:
    """Fitted, with the whitening taken at the fit; where it leaves something, or in any case (`beginnings`), looked for
    from the beginnings, too."""
    found = fit(model)
    model.problem.rewhiten(found.values, ())
    found = fit(model, found.values)
    if beginnings or (leaves_much(found) and model.problem.contacts is not None):
        return by_beginnings(found)
    return found


def leaves_much(found: Fit) -> bool:
    """Whether more is left than a fit's rough landscape makes by itself."""
    return found.chi_square > found.count + _MUCH * math.sqrt(2 * found.count)


def jittered(found: Fit, held_out: tuple[str, ...], known: tuple[Jitter, ...] = ()) -> tuple[Fit, tuple[Jitter, ...]]:
    """With times that jitter taken into account, at the slopes of this fit; and the clocks found here or `known`."""
    jitters = tuple({jitter.channels: jitter for jitter in (*known, *find_jitter(found))}.values())
    if not jitters:
        return found, ()
    problem = found.model.problem
    problem.shake(steepness(problem, jitters, values_of_all(found, held_out), found.model.forms))
    problem.rewhiten(found.values, found.model.forms)
    return fit(found.model, found.values), jitters


def doubted(found: Fit, held_out: tuple[str, ...]) -> Fit:
    """With readings that this model makes doubtful counted for little (`Contacts.doubt`), where there are any."""
    contacts = found.model.problem.contacts
    if contacts is None:
        return found
    values = held_out_fit(found.model, held_out, found.values) if held_out else found.values
    return fit(found.model, found.values) if contacts.doubt(values, found.model.forms) else found


def plain(found: Fit) -> Fit:
    """The same with noise taken as white."""
    return fit(replace(found.model, whitener=Whitener.white(found.model.problem)), found.values)


def coloured(found: Fit, colours: Mapping[str, Colour]) -> Fit:
    """The same with noise of these colours; `found` has white noise."""
    if not colours:
        return found
    return fit(replace(found.model, whitener=whitener_for(found, dict(colours))), found.values)


def recoloured(found: Fit, colours: Mapping[str, Colour]) -> Fit:
    """The same with the noise that it leaves, where that is another than `colours`."""
    if found.chi_square > _MOST_FOR_COLOUR * found.count:
        return found
    fresh = colours_of(plain(found))
    return coloured(plain(found), fresh) if differ(fresh, colours) else found


def colours_of(found: Fit) -> dict[str, Colour]:
    """Colours of the noise, where the misfit is small enough for the fast modes to hold nothing else; where it is not,
    how loud the noise is, if it is all the time."""
    loud: dict[str, Colour] = {}
    if found.chi_square > _MOST_FOR_COLOUR * found.count:
        loud = find_loud(found)
        rest = coloured(found, loud)
        if not loud or rest.chi_square > _MOST_FOR_COLOUR * rest.count:
            return loud
    return loud | find_colours(found)


def scatter_of(found: Fit, held_out: tuple[str, ...], *, apart: bool = False, kinds: tuple[str, ...] = ()) -> Scatter:
    """Asked of all trials, and of the model without any scatter so far."""
    model = replace(found.model, scatter=())
    if all(len(ids) < 2 for ids in groups_of(model.problem.trials).values()):
        return Scatter()
    return find_scatter(fit(model.on((*model.trials, *held_out)), unscattered(found)), apart=apart, kinds=kinds)


def lone_scatter_of(found: Fit, held_out: tuple[str, ...], *, kinds: tuple[str, ...]) -> tuple[Scatter, list[Finding]]:
    """The same, of these kinds, of trials of which none repeats another, and what speaks against it; nothing where one
    does."""
    model = replace(found.model, scatter=())
    if any(len(ids) > 1 for ids in groups_of(model.problem.trials).values()):
        return Scatter(), []
    return find_lone_scatter(fit(model.on((*model.trials, *held_out)), unscattered(found)), kinds)


def unrest_of(found: Fit, held_out: tuple[str, ...]) -> Unrest:
    """How replicates wander apart beyond what trials' own numbers say: asked of all trials."""
    problem = found.model.problem
    if not problem.by_path:
        return Unrest({})
    values = held_out_fit(found.model, held_out, found.values) if held_out else found.values
    return find_unrest(found, values, (*found.model.trials, *held_out))


def calmed(found: Fit, unrest: Unrest) -> Fit:
    """The same with what replicates differ by taken for noise, which is white otherwise."""
    problem = found.model.problem
    if not unrest and not problem.calmed:
        return found
    problem.calm(unrest.weights(problem) if unrest else {})
    return plain(found)


def rescattered(found: Fit, scatter: Scatter) -> Fit:
    """The same with this scatter and no other, from where it was asked for and, with none, from here."""
    model = replace(found.model, scatter=scatter.parameters)
    if not scatter.parameters:
        return fit(model, unscattered(found))
    return with_scatter(model, {**unscattered(found), **scatter.values})


def differ(one: Mapping[str, Colour], other: Mapping[str, Colour]) -> bool:
    white = Colour("", 1.0, 0.0)
    pairs = [(one.get(name, white), other.get(name, white)) for name in set(one) | set(other)]
    return any(abs(a.persistence - b.persistence) > _OTHER or abs(a.std - b.std) > _OTHER * b.std for a, b in pairs)
